//! The commands of clients (COMMAND_LONG, COMMAND_INT) and what each is answered: as ArduPilot does
//! (<https://mavlink.io/en/messages/common.html#mav_commands>).

use std::time::Duration;

use super::streams::DEFAULT_EVERY;
use super::{ClientId, FlownVehicle, MavlinkVehicle, Outgoing, tell, texts};
use crate::autopilot::{Command, CommandAck, FlightMode, VehicleKind};
use crate::geom::{Angle, Bearing, Point};
use crate::mavlink::dialect::{
    self as d, COMMAND_INT_DATA, COMMAND_LONG_DATA, MavCmd, MavFrame, MavMessage, MavResult,
    MavSeverity,
};
use crate::mavlink::frames::MavAddress;
use crate::mavlink::modes::{ShownMode, mode_of};
use crate::time::Time;

/// The magic number of whoever insists on arming or disarming.
const FORCE: f32 = 21_196.0;
/// Degrees as they are sent.
const PER_DEGREE: f64 = 1e7;
/// The message that says how often another one comes.
const MESSAGE_INTERVAL: u32 = 244;
/// The message that says where home is.
const HOME_POSITION: u32 = 242;
/// The message that says what the autopilot can do.
const AUTOPILOT_VERSION: u32 = 148;

/// A command with its parameters, whichever message it came in.
pub(super) struct Asked {
    command: MavCmd,
    /// Parameters 1 to 7; 5 and 6 in degrees where they are a place.
    parameters: [f32; 7],
    /// Latitude and longitude, 1e-7 degrees, if it has a place.
    place: Option<(i32, i32)>,
}

impl Asked {
    /// Reads a COMMAND_LONG.
    pub(super) fn of_long(long: &COMMAND_LONG_DATA) -> Asked {
        let place = [long.param5, long.param6].map(f64::from);
        let is_place = place
            .iter()
            .all(|degrees| degrees.is_finite() && degrees.abs() <= 180.0)
            && place != [0.0, 0.0];
        Asked {
            command: long.command,
            parameters: [
                long.param1,
                long.param2,
                long.param3,
                long.param4,
                long.param5,
                long.param6,
                long.param7,
            ],
            place: is_place.then(|| {
                let [latitude, longitude] =
                    place.map(|degrees| (degrees * PER_DEGREE).round() as i32);
                (latitude, longitude)
            }),
        }
    }

    /// Reads a COMMAND_INT.
    pub(super) fn of_int(int: &COMMAND_INT_DATA) -> Asked {
        let is_global = matches!(
            int.frame,
            MavFrame::MAV_FRAME_GLOBAL
                | MavFrame::MAV_FRAME_GLOBAL_INT
                | MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT
                | MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
        );
        let is_within = |degrees: i32, most: f64| f64::from(degrees).abs() <= most * PER_DEGREE;
        let is_place = is_global
            && (int.x, int.y) != (0, 0)
            && is_within(int.x, 90.0)
            && is_within(int.y, 180.0);
        Asked {
            command: int.command,
            parameters: [
                int.param1, int.param2, int.param3, int.param4, 0.0, 0.0, int.z,
            ],
            place: is_place.then_some((int.x, int.y)),
        }
    }

    /// Returns a parameter, counted from 1, as a whole number; `None` when it is none.
    fn whole(&self, number: usize) -> Option<u32> {
        let value = self.parameters[number - 1];
        ((0.0..1e6).contains(&value) && value.fract() == 0.0).then_some(value as u32)
    }

    /// Returns a parameter, counted from 1, if it is a number.
    fn number(&self, number: usize) -> Option<f64> {
        let value = self.parameters[number - 1];
        value.is_finite().then_some(f64::from(value))
    }
}

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
        asked: &Asked,
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
        let ack = d::COMMAND_ACK_DATA {
            command: asked.command,
            result,
            target_system: from.system,
            target_component: from.component,
            ..d::COMMAND_ACK_DATA::default()
        };
        tell(out, Some(client), MavMessage::COMMAND_ACK(ack));
    }

    fn answer(
        &mut self,
        now: Time,
        client: ClientId,
        asked: &Asked,
        vehicle: &mut FlownVehicle<'_>,
        out: &mut Vec<Outgoing>,
    ) -> Answer {
        let denied = Answer::Result(MavResult::MAV_RESULT_DENIED);
        let place = asked.place.map(|place| self.frame.local_place(place));
        let command = match asked.command {
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => {
                return Answer::Of(arm(now, asked, vehicle, out));
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
            MavCmd::MAV_CMD_DO_CHANGE_SPEED => Command::Speed(asked.number(2).unwrap_or(f64::NAN)),
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
            MavCmd::MAV_CMD_GET_HOME_POSITION => {
                return self.send(now, client, HOME_POSITION, vehicle, out);
            }
            MavCmd::MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES => {
                return self.send(now, client, AUTOPILOT_VERSION, vehicle, out);
            }
            MavCmd::MAV_CMD_REQUEST_MESSAGE => {
                return match asked.whole(1) {
                    Some(number) => self.send(now, client, number, vehicle, out),
                    None => denied,
                };
            }
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => {
                return Answer::Result(self.set_interval(now, client, asked, vehicle));
            }
            MavCmd::MAV_CMD_GET_MESSAGE_INTERVAL => {
                return Answer::Result(self.tell_interval(now, client, asked, vehicle, out));
            }
            _ => return Answer::Of(CommandAck::Unsupported),
        };
        self.target.take_if(|_| command.moves() || command.stops());
        Answer::Of(vehicle.command(now, &command).result)
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
            CommandAck::Accepted => MavResult::MAV_RESULT_ACCEPTED,
            CommandAck::Denied | CommandAck::Unsupported | CommandAck::Failed => {
                MavResult::MAV_RESULT_FAILED
            }
        }
    }

    /// Goes to a place in GUIDED, which is changed to if the first flag of parameter 2 says so.
    fn reposition(
        &mut self,
        now: Time,
        asked: &Asked,
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
        vehicle.command(now, &route).result
    }

    /// Returns the heading for a bearing, or one relative to where it faces (parameter 4 = 1; parameter 3 = the side).
    fn heading(
        &self,
        now: Time,
        asked: &Asked,
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

    fn send(
        &mut self,
        now: Time,
        client: ClientId,
        number: u32,
        vehicle: &mut FlownVehicle<'_>,
        out: &mut Vec<Outgoing>,
    ) -> Answer {
        let said = self.telemetry(now, vehicle).said(number);
        Answer::Result(match said {
            Some(said) => {
                let to = Some(client);
                out.push(Outgoing { to, said });
                MavResult::MAV_RESULT_ACCEPTED
            }
            None => MavResult::MAV_RESULT_FAILED,
        })
    }

    fn set_interval(
        &mut self,
        now: Time,
        client: ClientId,
        asked: &Asked,
        vehicle: &mut FlownVehicle<'_>,
    ) -> MavResult {
        let (Some(number), Some(interval_us)) = (asked.whole(1), asked.number(2)) else {
            return MavResult::MAV_RESULT_DENIED;
        };
        if self.telemetry(now, vehicle).said(number).is_none() {
            return MavResult::MAV_RESULT_DENIED;
        }
        let every = match interval_us {
            us if us < 0.0 => None,
            0.0 => Some(DEFAULT_EVERY),
            us => Some(Duration::from_secs_f64(us.min(1e10) * 1e-6)),
        };
        self.streams.set(now, client, number, every);
        MavResult::MAV_RESULT_ACCEPTED
    }

    /// Says how often a message comes: as an interval, microseconds; -1 = not by itself, 0 = it is not known.
    fn tell_interval(
        &mut self,
        now: Time,
        client: ClientId,
        asked: &Asked,
        vehicle: &mut FlownVehicle<'_>,
        out: &mut Vec<Outgoing>,
    ) -> MavResult {
        let Some(number) = asked.whole(1).and_then(|number| u16::try_from(number).ok()) else {
            return MavResult::MAV_RESULT_DENIED;
        };
        if u32::from(number) == MESSAGE_INTERVAL {
            return MavResult::MAV_RESULT_FAILED;
        }
        let is_known = self
            .telemetry(now, vehicle)
            .said(u32::from(number))
            .is_some();
        let interval_us = match self.streams.every(client, u32::from(number)) {
            Some(every) => i32::try_from(every.as_micros()).unwrap_or(i32::MAX),
            None if is_known => -1,
            None => 0,
        };
        let interval = d::MESSAGE_INTERVAL_DATA {
            interval_us,
            message_id: number,
        };
        tell(out, Some(client), MavMessage::MESSAGE_INTERVAL(interval));
        MavResult::MAV_RESULT_ACCEPTED
    }
}

/// Arms or disarms; who is refused is told why.
fn arm(
    now: Time,
    asked: &Asked,
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
            texts::line(
                MavSeverity::MAV_SEVERITY_CRITICAL,
                &format!("PreArm: {refusal}"),
            ),
        );
    }
    obeyed.result
}
