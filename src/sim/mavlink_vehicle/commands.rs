//! The commands of clients (COMMAND_LONG, COMMAND_INT) and what each is answered: as ArduPilot does
//! (<https://mavlink.io/en/messages/common.html#mav_commands>).

use super::parameters::speed_mps;
use super::telemetry::Telemetry;
use super::{FlownVehicle, MavlinkVehicle, tell};
use crate::autopilot::{Command, CommandAck, FlightMode, VehicleKind};
use crate::geom::{Angle, Bearing, Point};
use crate::mavlink::asked_command::{AskedCommand, FORCE, command_ack};
use crate::mavlink::client_link::{ClientId, Outgoing};
use crate::mavlink::dialect::{MavCmd, MavResult, MavSeverity};
use crate::mavlink::frames::MavAddress;
use crate::mavlink::message_requests::answer_request;
use crate::mavlink::modes::{ShownMode, mode_of};
use crate::mavlink::status_text::line;
use crate::time::Time;

/// What a command has come to.
enum Answer {
    /// The autopilot's own.
    Of(CommandAck),
    /// One of the protocol.
    Result(MavResult),
}

impl MavlinkVehicle {
    /// Carries out a command and answers it.
    pub(super) fn carry_out(
        &mut self,
        now: Time,
        (client, from): (ClientId, MavAddress),
        asked: &AskedCommand,
        vehicle: &mut FlownVehicle<'_>,
        out: &mut Vec<Outgoing>,
    ) {
        let result = match self.answer(now, client, asked, vehicle, out) {
            Answer::Result(result) => result,
            Answer::Of(CommandAck::Accepted) => MavResult::MAV_RESULT_ACCEPTED,
            Answer::Of(CommandAck::Denied) => MavResult::MAV_RESULT_DENIED,
            Answer::Of(CommandAck::Unsupported) => MavResult::MAV_RESULT_UNSUPPORTED,
            Answer::Of(CommandAck::Failed) => MavResult::MAV_RESULT_FAILED,
        };
        tell(out, Some(client), command_ack(from, asked.command, result));
    }

    fn answer(
        &mut self,
        now: Time,
        client: ClientId,
        asked: &AskedCommand,
        vehicle: &mut FlownVehicle<'_>,
        out: &mut Vec<Outgoing>,
    ) -> Answer {
        let denied = Answer::Result(MavResult::MAV_RESULT_DENIED);
        let shown = (self.missions.count(), self.remote_control.channels());
        let at = (now, self.booted);
        let telemetry = Telemetry::new(at, self.kind, vehicle.readout(now), &self.frame, shown);
        let said = |number| telemetry.said(number);
        if let Some(result) = answer_request(now, client, asked, &mut self.streams, &said, out) {
            return Answer::Result(result);
        }
        let place = asked.place.map(|place| self.frame.local_place(place));
        let command = match asked.command {
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => {
                return Answer::Of(arm(now, asked, vehicle, out));
            }
            MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN => {
                return Answer::Of(self.reboot(now, asked, vehicle));
            }
            MavCmd::MAV_CMD_DO_SET_MODE => {
                return match asked.whole(2) {
                    Some(number) => Answer::Result(self.change_mode(now, number, vehicle)),
                    None => denied,
                };
            }
            MavCmd::MAV_CMD_NAV_TAKEOFF => Command::Takeoff {
                altitude_m: asked.number(7).unwrap_or(f64::NAN),
            },
            MavCmd::MAV_CMD_NAV_LAND => Command::Mode(FlightMode::Land),
            MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH => Command::Mode(FlightMode::Return),
            MavCmd::MAV_CMD_NAV_LOITER_UNLIM => Command::Mode(FlightMode::Loiter),
            MavCmd::MAV_CMD_MISSION_START => Command::Begin,
            MavCmd::MAV_CMD_DO_SET_MISSION_CURRENT => match asked.whole(1) {
                Some(item) => Command::SetCurrent(item as usize),
                None => return denied,
            },
            MavCmd::MAV_CMD_DO_CHANGE_SPEED => {
                let speed_mps = asked.number(2).unwrap_or(f64::NAN);
                return Answer::Of(self.change_speed(now, speed_mps, vehicle));
            }
            MavCmd::MAV_CMD_DO_SET_SERVO => match (asked.whole(1), asked.whole(2)) {
                (Some(channel), Some(pulse)) => Command::Servo {
                    channel: u8::try_from(channel).unwrap_or(0),
                    pulse_us: u16::try_from(pulse).unwrap_or(0),
                },
                _ => return denied,
            },
            MavCmd::MAV_CMD_CONDITION_YAW if self.kind == VehicleKind::Rover => {
                return Answer::Of(CommandAck::Unsupported);
            }
            MavCmd::MAV_CMD_CONDITION_YAW => match asked.number(1) {
                Some(degrees) => Command::Yaw(self.heading(now, asked, degrees, vehicle)),
                None => return denied,
            },
            MavCmd::MAV_CMD_DO_REPOSITION => match place {
                Some(at) => return Answer::Of(self.reposition(now, asked, at, vehicle)),
                None => return denied,
            },
            MavCmd::MAV_CMD_DO_SET_HOME => match place {
                _ if asked.whole(1) == Some(1) => Command::SetHome(vehicle.readout(now).pose.at),
                Some(at) => Command::SetHome(at),
                None => return denied,
            },
            _ => return Answer::Of(CommandAck::Unsupported),
        };
        self.target.take_if(|_| command.moves() || command.stops());
        Answer::Of(vehicle.command(now, &command).result)
    }

    /// Changes the speed. A rover in GUIDED takes one while it drives to a place only (`ModeGuided::set_desired_speed`), and
    /// drives on with it.
    fn change_speed(
        &self,
        now: Time,
        speed_mps: f64,
        vehicle: &mut FlownVehicle<'_>,
    ) -> CommandAck {
        let is_guided = vehicle.readout(now).mode == FlightMode::Guided;
        let route = match &self.target {
            _ if self.kind == VehicleKind::Copter || !is_guided => None,
            Some(Command::Route {
                corners,
                altitude_m,
                ..
            }) => Some(Command::Route {
                corners: corners.clone(),
                altitude_m: *altitude_m,
                speed_mps: Some(speed_mps),
            }),
            Some(_) | None => return CommandAck::Failed,
        };
        let changed = vehicle.command(now, &Command::Speed(speed_mps)).result;
        match route.filter(|_| changed == CommandAck::Accepted) {
            Some(route) => vehicle.command(now, &route).result,
            None => changed,
        }
    }

    /// Changes to the mode of a number.
    pub(super) fn change_mode(
        &mut self,
        now: Time,
        number: u32,
        vehicle: &mut FlownVehicle<'_>,
    ) -> MavResult {
        self.target = None;
        let mode = match mode_of(self.kind, number) {
            ShownMode::Known(mode) => mode,
            ShownMode::Other(_) => return MavResult::MAV_RESULT_FAILED,
        };
        match vehicle.command(now, &Command::Mode(mode)).result {
            CommandAck::Accepted => {
                self.forget_speed(now, mode, vehicle);
                MavResult::MAV_RESULT_ACCEPTED
            }
            CommandAck::Denied | CommandAck::Unsupported | CommandAck::Failed => {
                MavResult::MAV_RESULT_FAILED
            }
        }
    }

    /// A rover begins GUIDED with the speed of its parameter, whatever it was told before (`ModeGuided::_enter`).
    fn forget_speed(&self, now: Time, mode: FlightMode, vehicle: &mut FlownVehicle<'_>) {
        let is_begun = self.kind == VehicleKind::Rover && mode == FlightMode::Guided;
        let speed = speed_mps(&self.parameters, "WP_SPEED", self.kind).filter(|_| is_begun);
        if let Some(speed_mps) = speed {
            vehicle.command(now, &Command::Speed(speed_mps));
        }
    }

    /// Goes to a place in GUIDED, which is changed to if the first flag of parameter 2 says so.
    fn reposition(
        &mut self,
        now: Time,
        asked: &AskedCommand,
        at: Point,
        vehicle: &mut FlownVehicle<'_>,
    ) -> CommandAck {
        self.target = None;
        if asked.whole(2).is_some_and(|flags| flags & 1 == 1) {
            let changed = vehicle
                .command(now, &Command::Mode(FlightMode::Guided))
                .result;
            if changed != CommandAck::Accepted {
                return changed;
            }
        }
        let route = Command::Route {
            corners: vec![at],
            altitude_m: (self.kind == VehicleKind::Copter)
                .then(|| asked.number(7))
                .flatten(),
            speed_mps: asked.number(1).filter(|speed_mps| *speed_mps > 0.0),
        };
        let result = vehicle.command(now, &route).result;
        self.target = (result == CommandAck::Accepted).then_some(route);
        result
    }

    /// Returns the heading for a bearing, or one relative to where it faces (parameter 4 = 1; parameter 3 = the side).
    fn heading(
        &self,
        now: Time,
        asked: &AskedCommand,
        degrees: f64,
        vehicle: &mut FlownVehicle<'_>,
    ) -> Angle {
        if asked.whole(4) == Some(1) {
            let side = asked.number(3).map_or(1.0, f64::signum);
            let turned_rad = -side * degrees.to_radians();
            return Angle::from_radians(vehicle.readout(now).pose.heading.radians() + turned_rad);
        }
        self.frame.heading_of(Bearing::from_degrees(degrees))
    }
}

/// Arms or disarms; who is refused is told why.
fn arm(
    now: Time,
    asked: &AskedCommand,
    vehicle: &mut FlownVehicle<'_>,
    out: &mut Vec<Outgoing>,
) -> CommandAck {
    let force = asked.parameters[1] == FORCE;
    let command = match asked.whole(1) {
        Some(1) => Command::Arm { force },
        Some(0) => Command::Disarm { force },
        _ => return CommandAck::Unsupported,
    };
    let obeyed = vehicle.command(now, &command);
    if let Some(refusal) = obeyed.arm_refusal {
        tell(
            out,
            None,
            line(
                MavSeverity::MAV_SEVERITY_CRITICAL,
                &format!("PreArm: {refusal}"),
            ),
        );
    }
    obeyed.result
}
