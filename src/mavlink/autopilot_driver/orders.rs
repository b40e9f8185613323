//! Commands of the link as messages, and the answers to them. A command is said once each time that it is told; only the
//! target of a drive under way is said again, as autopilots want it, for as long as its mode is GUIDED, and its speed until
//! it is taken.
//!
//! ```text
//!   [nothing] ──Route──► [a drive: corner after corner] ──last corner reached; another command; no GUIDED──► [nothing]
//! ```

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use super::heard::Heard;
use super::upload::{Upload, UploadResult};
use super::{DriverOut, MavlinkDriverSettings, say, text};
use crate::autopilot::{
    Ack, ArmRefusal, AutopilotReport, Command, CommandAck, FlightMode, Item, NumberedCommand,
    VehicleKind,
};
use crate::geom::{Point, Vector};
use crate::mavlink::dialect::{
    self as d, COMMAND_ACK_DATA, COMMAND_INT_DATA, COMMAND_LONG_DATA, MavCmd, MavFrame, MavMessage,
    MavResult, PositionTargetTypemask as Ignored,
};
use crate::mavlink::frames::MavAddress;
use crate::mavlink::modes::{ShownMode, number_of};
use crate::time::Time;

/// The target of a drive is said again this often.
const TARGET_AGAIN: Duration = Duration::from_millis(500);
/// A corner is passed when it is this near, metres.
const PASSED_M: f64 = 0.25;
/// The last corner is reached when it is this near and the vehicle stands, metres.
const REACHED_M: f64 = 0.1;
/// So many answers to speeds may be on their way at most, said with a target each: the others were lost.
const SPEEDS_UNDER_WAY: u8 = 4;
/// A speed that is not taken for so many targets is warned of.
const SPEED_TRIES: u8 = 10;
/// The magic number of whoever insists.
const FORCE: f32 = 21_196.0;

/// What the autopilot was told.
#[derive(Clone, Debug, Default)]
pub(super) struct Orders {
    /// Numbers of commands that wait for their answers, by the commands' own.
    waiting: BTreeMap<u32, Waiting>,
    /// Speeds of drives that were said and not answered yet, at most.
    unanswered_speeds: u8,
    drive: Option<Drive>,
    upload: Option<Upload>,
}

#[derive(Clone, Copy, Debug)]
struct Waiting {
    number: u32,
    times: u8,
    is_arming: bool,
}

/// A drive under way.
#[derive(Clone, Debug)]
struct Drive {
    corners: VecDeque<Point>,
    altitude_m: Option<f64>,
    /// Until the autopilot has taken it.
    speed: Option<WantedSpeed>,
    due: Time,
}

/// A speed that the autopilot has not taken yet. ArduRover takes none before it drives to a place, forgets it when it
/// changes to GUIDED, and takes a few in a second only (`ModeGuided::set_desired_speed`, `AR_WPNav::set_speed_max`).
#[derive(Clone, Copy, Debug)]
struct WantedSpeed {
    mps: f64,
    times: u8,
    /// So many answers are about drives before it.
    of_others: u8,
}

impl Orders {
    /// Forgets everything: the autopilot has started anew, and knows nothing of it.
    pub(super) fn forget(&mut self) {
        *self = Orders::default();
    }

    /// Ends a drive when the mode is not GUIDED any more: somebody else steers.
    pub(super) fn mind_mode(&mut self, mode: Option<ShownMode>) {
        if mode.is_some_and(|mode| mode != ShownMode::Known(FlightMode::Guided)) {
            self.drive = None;
        }
    }

    /// Says a command.
    pub(super) fn take(
        &mut self,
        now: Time,
        told: &NumberedCommand,
        target: MavAddress,
        settings: &MavlinkDriverSettings,
        heard: &Heard,
        out: &mut Vec<DriverOut>,
    ) {
        let number = told.number;
        if told.command.moves() || told.command.stops() {
            self.drive = None;
        }
        let long = |command, parameters: [f32; 7]| (command, parameters);
        let (command, parameters) = match &told.command {
            Command::Mode(mode) => match number_of(settings.kind, *mode) {
                Some(mode) => long(
                    MavCmd::MAV_CMD_DO_SET_MODE,
                    [1.0, mode as f32, 0.0, 0.0, 0.0, 0.0, 0.0],
                ),
                None => return answer(number, CommandAck::Unsupported, None, out),
            },
            Command::Arm { force } => {
                long(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, arming(1.0, *force))
            }
            Command::Disarm { force } => {
                long(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, arming(0.0, *force))
            }
            Command::Takeoff { altitude_m } if altitude_m.is_finite() => {
                let altitude_m = *altitude_m as f32;
                long(
                    MavCmd::MAV_CMD_NAV_TAKEOFF,
                    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, altitude_m],
                )
            }
            Command::Speed(speed_mps) if speed_mps.is_finite() => speed(*speed_mps),
            Command::Servo { channel, pulse_us } => {
                let (channel, pulse_us) = (f32::from(*channel), f32::from(*pulse_us));
                long(
                    MavCmd::MAV_CMD_DO_SET_SERVO,
                    [channel, pulse_us, 0.0, 0.0, 0.0, 0.0, 0.0],
                )
            }
            Command::SetCurrent(item) => {
                let item = *item as f32;
                long(
                    MavCmd::MAV_CMD_DO_SET_MISSION_CURRENT,
                    [item, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                )
            }
            Command::Begin => long(MavCmd::MAV_CMD_MISSION_START, [0.0; 7]),
            Command::SetHome(at) if is_place(*at) => {
                return self.say_home(*at, number, target, settings, out);
            }
            Command::Route {
                corners,
                altitude_m,
                speed_mps,
            } => {
                return self.set_out(
                    now,
                    number,
                    (corners, *altitude_m, *speed_mps),
                    target,
                    settings,
                    out,
                );
            }
            Command::Velocity(velocity) if is_place(Point::default() + *velocity) => {
                say(out, velocity_target(*velocity, target, settings));
                return answer(number, CommandAck::Accepted, None, out);
            }
            Command::Stop => {
                say(out, velocity_target(Vector::default(), target, settings));
                return answer(number, CommandAck::Accepted, None, out);
            }
            Command::Yaw(heading) => {
                let bearing = settings.frame.bearing_of(*heading);
                match settings.kind {
                    // https://ardupilot.org/copter/docs/common-mavlink-mission-command-messages-mav_cmd.html#condition-yaw
                    VehicleKind::Copter => {
                        let degrees = bearing.degrees() as f32;
                        long(
                            MavCmd::MAV_CMD_CONDITION_YAW,
                            [degrees, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
                        )
                    }
                    VehicleKind::Rover => {
                        say(out, yaw_target(bearing.radians() as f32, target));
                        return answer(number, CommandAck::Accepted, None, out);
                    }
                }
            }
            Command::Upload(items) => {
                return self.begin_upload(now, number, items, target, settings, out);
            }
            Command::Clear => return self.begin_upload(now, number, &[], target, settings, out),
            // What is no number is never said: some firmware dies of it.
            Command::Takeoff { .. }
            | Command::Speed(_)
            | Command::SetHome(_)
            | Command::Velocity(_) => {
                return answer(number, CommandAck::Denied, None, out);
            }
        };
        let _ = heard;
        self.say_long(number, command, parameters, target, out);
    }

    fn say_long(
        &mut self,
        number: u32,
        command: MavCmd,
        parameters: [f32; 7],
        target: MavAddress,
        out: &mut Vec<DriverOut>,
    ) {
        let [param1, param2, param3, param4, param5, param6, param7] = parameters;
        let confirmation = self.expect(number, command, param1 == 1.0);
        say(
            out,
            MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
                param1,
                param2,
                param3,
                param4,
                param5,
                param6,
                param7,
                command,
                target_system: target.system,
                target_component: target.component,
                confirmation,
            }),
        );
    }

    /// Waits for the answer to a command; returns how often it has been said before.
    fn expect(&mut self, number: u32, command: MavCmd, first_is_one: bool) -> u8 {
        let said = self
            .waiting
            .get(&(command as u32))
            .filter(|waiting| waiting.number == number);
        let times = said.map_or(0, |waiting| waiting.times.saturating_add(1));
        let waiting = Waiting {
            number,
            times,
            is_arming: command == MavCmd::MAV_CMD_COMPONENT_ARM_DISARM && first_is_one,
        };
        self.waiting.insert(command as u32, waiting);
        times
    }

    fn say_home(
        &mut self,
        at: Point,
        number: u32,
        target: MavAddress,
        settings: &MavlinkDriverSettings,
        out: &mut Vec<DriverOut>,
    ) {
        let (x, y) = settings.frame.wire_place(at);
        self.expect(number, MavCmd::MAV_CMD_DO_SET_HOME, false);
        say(
            out,
            MavMessage::COMMAND_INT(COMMAND_INT_DATA {
                x,
                y,
                z: settings.frame.datum.altitude_m as f32,
                command: MavCmd::MAV_CMD_DO_SET_HOME,
                target_system: target.system,
                target_component: target.component,
                frame: MavFrame::MAV_FRAME_GLOBAL,
                ..COMMAND_INT_DATA::default()
            }),
        );
    }

    /// Sets out for the first corner.
    fn set_out(
        &mut self,
        now: Time,
        number: u32,
        (corners, altitude_m, speed_mps): (&[Point], Option<f64>, Option<f64>),
        target: MavAddress,
        settings: &MavlinkDriverSettings,
        out: &mut Vec<DriverOut>,
    ) {
        let are_sound = corners.iter().all(|corner| is_place(*corner))
            && altitude_m.is_none_or(f64::is_finite)
            && speed_mps.is_none_or(f64::is_finite);
        if corners.is_empty() || !are_sound {
            return answer(number, CommandAck::Denied, None, out);
        }
        let drive = Drive {
            corners: corners.iter().copied().collect(),
            altitude_m,
            speed: speed_mps.map(|mps| WantedSpeed {
                mps,
                times: 0,
                of_others: self.unanswered_speeds,
            }),
            due: now + TARGET_AGAIN,
        };
        drive.say(target, settings, out);
        self.drive = Some(drive);
        self.say_speed(target, out);
        answer(number, CommandAck::Accepted, None, out);
    }

    /// Says how fast the drive is to be, if the autopilot has not taken that yet: behind a target, since it takes none before.
    fn say_speed(&mut self, target: MavAddress, out: &mut Vec<DriverOut>) {
        let Some(wanted) = self.drive.as_mut().and_then(|drive| drive.speed.as_mut()) else {
            return;
        };
        wanted.times = wanted.times.saturating_add(1);
        let WantedSpeed { mps, times, .. } = *wanted;
        if times == SPEED_TRIES {
            text(
                out,
                format!("it does not take the speed of {mps} m/s"),
                true,
            );
        }
        self.unanswered_speeds = SPEEDS_UNDER_WAY.min(self.unanswered_speeds + 1);
        let (command, parameters) = speed(mps);
        // No command waits for that answer: the drive itself is what is asked for.
        self.say_long(0, command, parameters, target, out);
    }

    /// Goes on to the next corner when one is passed.
    pub(super) fn go_on(
        &mut self,
        now: Time,
        report: &AutopilotReport,
        target: MavAddress,
        settings: &MavlinkDriverSettings,
        out: &mut Vec<DriverOut>,
    ) {
        let Some(drive) = &mut self.drive else { return };
        let Some(corner) = drive.corners.front() else {
            return;
        };
        let away_m = corner.distance_to(report.pose.at);
        if drive.corners.len() > 1 && away_m <= PASSED_M {
            drive.corners.pop_front();
            drive.due = now + TARGET_AGAIN;
            drive.say(target, settings, out);
        } else if drive.corners.len() == 1 && away_m <= REACHED_M && report.speed_mps < 0.05 {
            self.drive = None;
        }
    }

    fn begin_upload(
        &mut self,
        now: Time,
        number: u32,
        items: &[Item],
        target: MavAddress,
        settings: &MavlinkDriverSettings,
        out: &mut Vec<DriverOut>,
    ) {
        if self
            .upload
            .as_ref()
            .is_some_and(|upload| upload.number() == number)
        {
            return;
        }
        let frame = &settings.frame;
        match Upload::begin(now, number, items, target, frame, out) {
            Ok(upload) => self.upload = Some(upload),
            Err(ended) => self.end_upload(Some(ended), out),
        }
    }

    /// Takes what concerns an upload under way.
    pub(super) fn hear_mission(
        &mut self,
        now: Time,
        message: &MavMessage,
        settings: &MavlinkDriverSettings,
        out: &mut Vec<DriverOut>,
    ) {
        let upload = self.upload.as_mut();
        let ended = upload.and_then(|upload| upload.hear(now, message, &settings.frame, out));
        self.end_upload(ended, out);
    }

    fn end_upload(&mut self, ended: Option<UploadResult>, out: &mut Vec<DriverOut>) {
        let Some(ended) = ended else { return };
        self.upload = None;
        if let Some(complaint) = ended.complaint {
            text(out, complaint, true);
        }
        answer(ended.number, ended.ack, None, out);
    }

    /// Takes an answer of the autopilot; `explained` is what it has said about why it does not arm.
    pub(super) fn answer(
        &mut self,
        ack: &COMMAND_ACK_DATA,
        explained: Option<&str>,
        out: &mut Vec<DriverOut>,
    ) {
        let result = match ack.result {
            // It will say more.
            MavResult::MAV_RESULT_IN_PROGRESS => return,
            MavResult::MAV_RESULT_ACCEPTED => CommandAck::Accepted,
            MavResult::MAV_RESULT_DENIED => CommandAck::Denied,
            MavResult::MAV_RESULT_TEMPORARILY_REJECTED
            | MavResult::MAV_RESULT_FAILED
            | MavResult::MAV_RESULT_CANCELLED
            | MavResult::MAV_RESULT_NOT_IN_CONTROL => CommandAck::Failed,
            MavResult::MAV_RESULT_UNSUPPORTED
            | MavResult::MAV_RESULT_COMMAND_LONG_ONLY
            | MavResult::MAV_RESULT_COMMAND_INT_ONLY
            | MavResult::MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME => CommandAck::Unsupported,
        };
        if ack.command == MavCmd::MAV_CMD_DO_CHANGE_SPEED {
            self.answer_speed(result);
        }
        let Some(waiting) = self.waiting.remove(&(ack.command as u32)) else {
            return;
        };
        let is_refused = waiting.is_arming && result != CommandAck::Accepted;
        let refusal = is_refused.then(|| explained.map(refusal_of)).flatten();
        answer(waiting.number, result, refusal, out);
    }

    /// Takes the answer to a speed: answers come in the order in which speeds were said, as far as none is lost.
    fn answer_speed(&mut self, result: CommandAck) {
        self.unanswered_speeds = self.unanswered_speeds.saturating_sub(1);
        let Some(drive) = &mut self.drive else { return };
        match &mut drive.speed {
            Some(speed) if speed.of_others > 0 => speed.of_others -= 1,
            Some(_) if result == CommandAck::Accepted => drive.speed = None,
            Some(_) | None => {}
        }
    }

    /// Returns when something is to be said next.
    pub(super) fn deadline(&self) -> Option<Time> {
        let drive = self.drive.as_ref().map(|drive| drive.due);
        let upload = self.upload.as_ref().map(Upload::deadline);
        [drive, upload].into_iter().flatten().min()
    }

    /// Says what is due by now.
    pub(super) fn due(
        &mut self,
        now: Time,
        target: MavAddress,
        settings: &MavlinkDriverSettings,
        out: &mut Vec<DriverOut>,
    ) {
        if let Some(drive) = &mut self.drive
            && now >= drive.due
        {
            drive.due = now + TARGET_AGAIN;
            drive.say(target, settings, out);
            self.say_speed(target, out);
        }
        let upload = self.upload.as_mut();
        let ended = upload.and_then(|upload| upload.due(now, &settings.frame, out));
        self.end_upload(ended, out);
    }
}

impl Drive {
    /// Says where to go now.
    fn say(&self, target: MavAddress, settings: &MavlinkDriverSettings, out: &mut Vec<DriverOut>) {
        let Some(corner) = self.corners.front() else {
            return;
        };
        let (lat_int, lon_int) = settings.frame.wire_place(*corner);
        let mut ignored = only(
            Ignored::POSITION_TARGET_TYPEMASK_X_IGNORE | Ignored::POSITION_TARGET_TYPEMASK_Y_IGNORE,
        );
        if self.altitude_m.is_some() {
            ignored -= Ignored::POSITION_TARGET_TYPEMASK_Z_IGNORE;
        }
        // ArduCopter wants all three or none: without a wish for its altitude it stays at the present one, which is said.
        say(
            out,
            MavMessage::SET_POSITION_TARGET_GLOBAL_INT(d::SET_POSITION_TARGET_GLOBAL_INT_DATA {
                lat_int,
                lon_int,
                alt: self.altitude_m.unwrap_or(0.0) as f32,
                type_mask: ignored,
                target_system: target.system,
                target_component: target.component,
                coordinate_frame: MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT,
                ..d::SET_POSITION_TARGET_GLOBAL_INT_DATA::default()
            }),
        );
    }
}

fn answer(
    number: u32,
    result: CommandAck,
    arm_refusal: Option<ArmRefusal>,
    out: &mut Vec<DriverOut>,
) {
    if number != 0 {
        out.push(DriverOut::Ack(Ack {
            number,
            result,
            arm_refusal,
        }));
    }
}

/// Answers that it is not armed as long as its failsafes are missing.
pub(super) fn refuse_to_arm(number: u32, out: &mut Vec<DriverOut>) {
    let refusal = Some(ArmRefusal::Failsafes);
    answer(number, CommandAck::Denied, refusal, out);
}

fn arming(arm: f32, force: bool) -> [f32; 7] {
    let force = if force { FORCE } else { 0.0 };
    [arm, force, 0.0, 0.0, 0.0, 0.0, 0.0]
}

fn speed(speed_mps: f64) -> (MavCmd, [f32; 7]) {
    // Of the ground speed, in m/s; the throttle stays.
    let parameters = [1.0, speed_mps as f32, -1.0, 0.0, 0.0, 0.0, 0.0];
    (MavCmd::MAV_CMD_DO_CHANGE_SPEED, parameters)
}

/// Returns a mask that ignores all but these.
fn only(wanted: Ignored) -> Ignored {
    let all = Ignored::all() - Ignored::POSITION_TARGET_TYPEMASK_FORCE_SET;
    all - wanted
}

/// Returns the target of a velocity. A rover turns to where one points, and one of nothing points north: told as well that
/// it is not to turn, it brakes as it goes (`GCS_MAVLink_Rover::handle_set_position_target_local_ned`).
fn velocity_target(
    velocity: Vector,
    target: MavAddress,
    settings: &MavlinkDriverSettings,
) -> MavMessage {
    let (north_mps, east_mps) = settings.frame.north_east(Point::default() + velocity);
    let mut wanted = Ignored::POSITION_TARGET_TYPEMASK_VX_IGNORE
        | Ignored::POSITION_TARGET_TYPEMASK_VY_IGNORE
        | Ignored::POSITION_TARGET_TYPEMASK_VZ_IGNORE;
    if settings.kind == VehicleKind::Rover && velocity == Vector::default() {
        wanted |= Ignored::POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE;
    }
    MavMessage::SET_POSITION_TARGET_LOCAL_NED(d::SET_POSITION_TARGET_LOCAL_NED_DATA {
        vx: north_mps as f32,
        vy: east_mps as f32,
        type_mask: only(wanted),
        target_system: target.system,
        target_component: target.component,
        coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
        ..d::SET_POSITION_TARGET_LOCAL_NED_DATA::default()
    })
}

/// Turns a rover on the spot (<https://ardupilot.org/dev/docs/mavlink-rover-commands.html>).
fn yaw_target(yaw_rad: f32, target: MavAddress) -> MavMessage {
    MavMessage::SET_POSITION_TARGET_LOCAL_NED(d::SET_POSITION_TARGET_LOCAL_NED_DATA {
        yaw: yaw_rad,
        type_mask: only(Ignored::POSITION_TARGET_TYPEMASK_YAW_IGNORE),
        target_system: target.system,
        target_component: target.component,
        coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
        ..d::SET_POSITION_TARGET_LOCAL_NED_DATA::default()
    })
}

fn is_place(at: Point) -> bool {
    crate::autopilot::item::is_place(at)
}

/// Returns what a text says about why it does not arm, in the link's terms; the text itself goes to the log.
fn refusal_of(text: &str) -> ArmRefusal {
    let text = text.to_ascii_lowercase();
    let has = |words: &[&str]| words.iter().any(|word| text.contains(word));
    if has(&["battery", "volt"]) {
        ArmRefusal::BatteryEmpty
    } else if has(&["position", "gps", "ekf", "ahrs", "origin", "where it is"]) {
        ArmRefusal::NoPlace
    } else {
        ArmRefusal::NotReady
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests_support;
    use super::*;

    const TARGET: MavAddress = MavAddress {
        system: 1,
        component: 1,
    };

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    /// What is said to a rover or a copter that is told a command.
    fn said(orders: &mut Orders, kind: VehicleKind, command: Command) -> Vec<DriverOut> {
        let told = NumberedCommand { number: 7, command };
        let settings = MavlinkDriverSettings {
            kind,
            ..tests_support::settings()
        };
        let mut out = Vec::new();
        let heard = Heard::default();
        orders.take(at(1.0), &told, TARGET, &settings, &heard, &mut out);
        out
    }

    /// The speeds that are said, and whether a target was said before each of them.
    fn speeds(out: &[DriverOut]) -> Vec<(f32, bool)> {
        let mut is_aimed = false;
        let mut speeds = Vec::new();
        for said in out {
            let DriverOut::Say(message) = said else {
                continue;
            };
            match message.as_ref() {
                MavMessage::SET_POSITION_TARGET_GLOBAL_INT(_) => is_aimed = true,
                MavMessage::COMMAND_LONG(long)
                    if long.command == MavCmd::MAV_CMD_DO_CHANGE_SPEED =>
                {
                    speeds.push((long.param2, is_aimed));
                }
                _ => {}
            }
        }
        speeds
    }

    #[test]
    fn a_rover_that_is_stopped_is_told_not_to_turn() {
        let masks = [VehicleKind::Rover, VehicleKind::Copter].map(|kind| {
            let out = said(&mut Orders::default(), kind, Command::Stop);
            let DriverOut::Say(message) = &out[0] else {
                panic!("{out:?}");
            };
            match message.as_ref() {
                MavMessage::SET_POSITION_TARGET_LOCAL_NED(target) => {
                    assert_eq!((target.vx, target.vy, target.yaw_rate), (0.0, 0.0, 0.0));
                    target.type_mask.bits()
                }
                other => panic!("{other:?}"),
            }
        });
        // Velocity alone; for a rover the rate of its yaw as well.
        assert_eq!(masks, [0b0101_1100_0111, 0b1101_1100_0111]);
    }

    #[test]
    fn a_speed_is_said_behind_each_target_until_it_is_taken() {
        let settings = tests_support::settings();
        let mut orders = Orders::default();
        let route = Command::Route {
            corners: vec![Point::new(5.0, 0.0)],
            altitude_m: None,
            speed_mps: Some(0.5),
        };
        let out = said(&mut orders, VehicleKind::Rover, route);
        assert_eq!(speeds(&out), [(0.5, true)]);
        let answered = |orders: &mut Orders, result| {
            let ack = COMMAND_ACK_DATA {
                command: MavCmd::MAV_CMD_DO_CHANGE_SPEED,
                result,
                ..COMMAND_ACK_DATA::default()
            };
            let mut out = Vec::new();
            orders.answer(&ack, None, &mut out);
            assert_eq!(out, [], "nobody waits for that answer");
        };
        let mut warnings = 0;
        for turn in 1..=12 {
            // What it says may be lost, too.
            if turn % 2 == 0 {
                answered(&mut orders, MavResult::MAV_RESULT_FAILED);
            }
            let mut out = Vec::new();
            orders.due(at(1.0 + 0.5 * f64::from(turn)), TARGET, &settings, &mut out);
            assert_eq!(speeds(&out), [(0.5, true)], "{turn}");
            let is_warning = |said: &&DriverOut| matches!(said, DriverOut::Text { .. });
            warnings += out.iter().filter(is_warning).count();
        }
        assert_eq!(warnings, 1);
        answered(&mut orders, MavResult::MAV_RESULT_ACCEPTED);
        let mut out = Vec::new();
        orders.due(at(9.0), TARGET, &settings, &mut out);
        assert!(speeds(&out).is_empty() && !out.is_empty());
    }
}
