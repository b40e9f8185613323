//! The server in virtual time: what ground stations see of vehicles, and what becomes of what they say.

use std::time::Duration;

use tomoswarm_proto::{
    EmergencyName, Health, MissionEnd, MissionPhase, MissionProgress, OrderKind, Permille,
    PoseReport, Position, StandReason, State, VehicleId, VehicleMode,
};

use super::*;
use crate::geom::{Bearing, Geodetic};
use crate::mavlink::dialect::{
    self as d, COMMAND_LONG_DATA, MavCmd, MavModeFlag, MavState, PARAM_REQUEST_LIST_DATA,
    PARAM_SET_DATA,
};
use crate::mavlink::frames::{FrameReader, FrameWriter};
use crate::mavlink::signing::Signing;

const CLIENT: ClientId = ClientId(4);
const STATION: MavAddress = MavAddress {
    system: 255,
    component: 190,
};
const STEP: Duration = Duration::from_millis(50);

fn frame() -> EarthFrame {
    let datum = Geodetic {
        latitude_deg: 52.0,
        longitude_deg: 4.0,
        altitude_m: 3.0,
    };
    EarthFrame::new(datum, Bearing::from_degrees(40.0))
}

fn settings(commands: bool) -> SwarmServerSettings {
    SwarmServerSettings {
        frame: frame(),
        homes: vec![Point::new(1.0, 2.0), Point::new(4.0, 2.0)],
        separation_m: 0.9,
        commands,
        file: "operator.toml".to_owned(),
        key: None,
    }
}

/// What one vehicle says.
#[derive(Clone, Default)]
struct Said {
    state: State,
    mission: MissionProgress,
    health: Health,
    is_silent: bool,
}

/// A server with vehicles and one ground station.
struct Rig {
    now: Time,
    server: SwarmServer,
    vehicles: Vec<Said>,
    reader: FrameReader,
    writer: FrameWriter,
    requests: Vec<OrderRequest>,
    warnings: Vec<String>,
}

impl Rig {
    fn new(commands: bool) -> Rig {
        let vehicle = |id: u8| Said {
            state: State {
                vehicle: VehicleId(id),
                pose: Some(PoseReport {
                    at: Position::from_metres(f64::from(id), 0.0, 0.0),
                    ..PoseReport::default()
                }),
                battery: Some(Permille(800)),
                is_landed: true,
                ..State::default()
            },
            ..Said::default()
        };
        let mut server = SwarmServer::new(settings(commands));
        server.joined(Time::ZERO, CLIENT, 0);
        Rig {
            now: Time::ZERO,
            server,
            vehicles: vec![vehicle(1), vehicle(2)],
            reader: FrameReader::default(),
            writer: FrameWriter::new(STATION),
            requests: Vec::new(),
            warnings: Vec::new(),
        }
    }

    fn read(&mut self, output: ServerOutput) -> Vec<(u8, MavMessage)> {
        self.requests.extend(output.requests);
        self.warnings.extend(output.warnings);
        for (client, bytes) in output.bytes {
            assert_eq!(client, CLIENT);
            self.reader.push(&bytes);
        }
        let frames = std::iter::from_fn(|| self.reader.next(None));
        frames
            .map(|frame| match frame.content {
                Content::Message(message) => (frame.from.system, *message),
                other => panic!("{other:?}"),
            })
            .collect()
    }

    /// What is said until so many seconds later.
    fn pass(&mut self, seconds: f64) -> Vec<(u8, MavMessage)> {
        let end = self.now + Duration::from_secs_f64(seconds);
        let mut output = ServerOutput::default();
        while self.now < end {
            self.now = self.now + STEP;
            let (now, vehicles) = (self.now, &self.vehicles);
            let heard = vehicles.iter().filter(|said| !said.is_silent);
            let reports = heard.map(|said| VehicleReport {
                at: now,
                state: &said.state,
                mission: Some(&said.mission),
                health: Some(&said.health),
                hello: None,
            });
            self.server.due(now, reports, &mut output);
        }
        self.read(output)
    }

    fn say(&mut self, message: &MavMessage) -> Vec<(u8, MavMessage)> {
        let mut bytes = Vec::new();
        self.writer.write(message, None, &mut bytes);
        let mut output = ServerOutput::default();
        self.server.hear(self.now, CLIENT, &bytes, &mut output);
        self.read(output)
    }

    fn command(&mut self, system: u8, command: MavCmd, parameters: [f32; 2]) -> Vec<MavResult> {
        self.command_again(system, command, parameters, 0)
    }

    fn command_again(
        &mut self,
        system: u8,
        command: MavCmd,
        [param1, param2]: [f32; 2],
        confirmation: u8,
    ) -> Vec<MavResult> {
        let said = self.say(&MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
            param1,
            param2,
            command,
            target_system: system,
            target_component: 1,
            confirmation,
            ..Default::default()
        }));
        acks(&said, command)
    }

    fn ended(&mut self, number: u32, end: &RequestEnd) -> Vec<(u8, MavMessage)> {
        let mut output = ServerOutput::default();
        self.server.ended(number, end, &mut output);
        self.read(output)
    }
}

fn acks(said: &[(u8, MavMessage)], command: MavCmd) -> Vec<MavResult> {
    let ack = |message: &MavMessage| match message {
        MavMessage::COMMAND_ACK(ack) if ack.command == command => {
            assert_eq!(ack.target_system, STATION.system);
            Some(ack.result)
        }
        _ => None,
    };
    said.iter()
        .filter_map(|(_, message)| ack(message))
        .collect()
}

fn texts(said: &[(u8, MavMessage)]) -> Vec<String> {
    let text = |message: &MavMessage| match message {
        MavMessage::STATUSTEXT(said) => Some(said.text.to_str().unwrap().to_owned()),
        _ => None,
    };
    said.iter()
        .filter_map(|(_, message)| text(message))
        .collect()
}

fn count(said: &[(u8, MavMessage)], system: u8, is: impl Fn(&MavMessage) -> bool) -> usize {
    let of = said
        .iter()
        .filter(|(from, message)| *from == system && is(message));
    of.count()
}

fn last_heartbeat(said: &[(u8, MavMessage)], system: u8) -> d::HEARTBEAT_DATA {
    let beat = |(from, message): &(u8, MavMessage)| match message {
        MavMessage::HEARTBEAT(beat) if *from == system => Some(beat.clone()),
        _ => None,
    };
    said.iter().rev().find_map(beat).unwrap()
}

#[test]
fn every_vehicle_is_shown_at_its_rates_and_at_its_place() {
    let mut rig = Rig::new(false);
    rig.vehicles[1].state.is_armed = true;
    let said = rig.pass(10.0);
    for system in [1, 2] {
        let heartbeats = count(&said, system, |said| {
            matches!(said, MavMessage::HEARTBEAT(_))
        });
        assert!((10..=11).contains(&heartbeats), "{heartbeats}");
        let places = count(&said, system, |said| {
            matches!(said, MavMessage::GLOBAL_POSITION_INT(_))
        });
        assert!((49..=51).contains(&places), "{places}");
        let statuses = count(&said, system, |said| {
            matches!(said, MavMessage::SYS_STATUS(_))
        });
        assert!((10..=11).contains(&statuses), "{statuses}");
    }
    assert!(count(&said, 3, |_| true) == 0);
    let (latitude, longitude) = frame().wire_place(Point::new(2.0, 0.0));
    let is_there = |message: &MavMessage| match message {
        MavMessage::GLOBAL_POSITION_INT(at) => (at.lat, at.lon) == (latitude, longitude),
        MavMessage::HOME_POSITION(home) => {
            (home.latitude, home.longitude) == frame().wire_place(Point::new(4.0, 2.0))
        }
        _ => true,
    };
    assert_eq!(count(&said, 2, |message| !is_there(message)), 0);
    let armed = MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
    assert!(last_heartbeat(&said, 2).base_mode.contains(armed));
    assert!(!last_heartbeat(&said, 1).base_mode.contains(armed));
}

#[test]
fn the_mode_says_what_a_vehicle_does_and_a_stop_is_critical() {
    let mut rig = Rig::new(false);
    let mut shown = |change: fn(&mut Said)| {
        change(&mut rig.vehicles[0]);
        let said = rig.pass(1.5);
        let beat = last_heartbeat(&said, 1);
        (beat.custom_mode, beat.system_status)
    };
    const STANDBY: MavState = MavState::MAV_STATE_STANDBY;
    assert_eq!(shown(|_| ()), (4, STANDBY), "nothing was ordered: HOLD");
    let start = |said: &mut Said| {
        said.state.ordered.kind = Some(OrderKind::Start);
        said.state.is_armed = true;
    };
    assert_eq!(shown(start), (10, MavState::MAV_STATE_ACTIVE), "AUTO");
    let held = |said: &mut Said| said.state.stands_under = Some(StandReason::Held);
    assert_eq!(shown(held).0, 4);
    let returns = |said: &mut Said| {
        (said.state.stands_under, said.mission.phase) = (None, MissionPhase::Returning);
    };
    assert_eq!(shown(returns).0, 11, "RTL");
    let remote = |said: &mut Said| said.state.control = tomoswarm_proto::Control::Remote;
    assert_eq!(shown(remote).0, 0, "MANUAL");
    let stopped = |said: &mut Said| {
        said.state.control = tomoswarm_proto::Control::Ours;
        said.state.stands_under = Some(StandReason::Stop(EmergencyName(7)));
        said.state.mode = VehicleMode::Stopped;
    };
    assert_eq!(shown(stopped), (4, MavState::MAV_STATE_CRITICAL));
    let lost = |said: &mut Said| (said.state.stands_under, said.state.pose) = (None, None);
    assert_eq!(shown(lost).1, MavState::MAV_STATE_CRITICAL);
}

#[test]
fn a_vehicle_that_is_not_heard_says_nothing_and_is_back_at_once() {
    let mut rig = Rig::new(true);
    rig.pass(2.0);
    rig.vehicles[0].is_silent = true;
    let said = rig.pass(5.0);
    assert_eq!(count(&said, 1, |_| true), 0);
    assert!(count(&said, 2, |_| true) > 0);
    rig.vehicles[0].is_silent = false;
    let said = rig.pass(0.05);
    let is_beat = |message: &MavMessage| matches!(message, MavMessage::HEARTBEAT(_));
    assert_eq!(count(&said, 1, is_beat), 1);
}

#[test]
fn what_changes_is_told_once_and_in_pieces_that_fit() {
    let mut rig = Rig::new(false);
    rig.pass(1.0);
    let vehicle = &mut rig.vehicles[1];
    vehicle.state.stands_under = Some(StandReason::NoPlace);
    vehicle.mission.end = Some(MissionEnd::Done);
    vehicle.health.troubles = vec![format!("radio: {}", "x".repeat(70))];
    let said = rig.pass(1.0);
    assert_eq!(
        count(&said, 1, |said| matches!(said, MavMessage::STATUSTEXT(_))),
        0
    );
    let told = texts(&said);
    assert!(
        told[0].contains("place") && told[1].contains("run 0 is over"),
        "{told:?}"
    );
    assert_eq!(
        told[2..],
        [format!("radio: {}", "x".repeat(43)), "x".repeat(27)]
    );
    // Whose words change while it lasts is known.
    rig.vehicles[1].health.troubles = vec!["radio: for 3 s".to_owned()];
    assert_eq!(texts(&rig.pass(1.0)), Vec::<String>::new());
    rig.vehicles[1].health.troubles.clear();
    assert_eq!(texts(&rig.pass(1.0)), ["radio: in order again"]);
}

#[test]
fn while_commands_are_off_all_that_steers_is_denied_and_asking_is_answered() {
    let mut rig = Rig::new(false);
    rig.pass(1.0);
    for command in [
        MavCmd::MAV_CMD_COMPONENT_ARM_DISARM,
        MavCmd::MAV_CMD_NAV_LAND,
        MavCmd::MAV_CMD_DO_FLIGHTTERMINATION,
        MavCmd::MAV_CMD_DO_PARACHUTE,
    ] {
        assert_eq!(
            rig.command(1, command, [1.0, 0.0]),
            [MavResult::MAV_RESULT_DENIED]
        );
    }
    let mode = MavMessage::SET_MODE(SET_MODE_DATA {
        custom_mode: 10,
        target_system: 1,
        ..Default::default()
    });
    assert_eq!(texts(&rig.say(&mode)), Vec::<String>::new(), "it was told");
    rig.pass(11.0);
    let told = texts(&rig.say(&mode)).concat();
    assert!(
        told.ends_with("set commands = true in operator.toml"),
        "{told}"
    );
    let ask = MavCmd::MAV_CMD_REQUEST_MESSAGE;
    assert_eq!(
        rig.command(2, ask, [148.0, 0.0]),
        [MavResult::MAV_RESULT_ACCEPTED]
    );
    assert_eq!(rig.requests, []);
}

#[test]
fn commands_become_orders_and_are_answered_when_they_are_in_force() {
    let (done, under_way) = (
        MavResult::MAV_RESULT_ACCEPTED,
        MavResult::MAV_RESULT_IN_PROGRESS,
    );
    use MavCmd as Is;
    for (command, parameters, kind, begins) in [
        (
            Is::MAV_CMD_COMPONENT_ARM_DISARM,
            [1.0, 0.0],
            OrderKind::Start,
            true,
        ),
        (
            Is::MAV_CMD_COMPONENT_ARM_DISARM,
            [0.0, 0.0],
            OrderKind::Land,
            false,
        ),
        (
            Is::MAV_CMD_COMPONENT_ARM_DISARM,
            [0.0, 21_196.0],
            OrderKind::CutMotors,
            false,
        ),
        (Is::MAV_CMD_DO_SET_MODE, [1.0, 10.0], OrderKind::Start, true),
        (Is::MAV_CMD_DO_SET_MODE, [1.0, 15.0], OrderKind::Start, true),
        (Is::MAV_CMD_DO_SET_MODE, [1.0, 4.0], OrderKind::Hold, false),
        (Is::MAV_CMD_DO_SET_MODE, [1.0, 5.0], OrderKind::Hold, false),
        (
            Is::MAV_CMD_DO_SET_MODE,
            [1.0, 11.0],
            OrderKind::Return,
            false,
        ),
        (
            Is::MAV_CMD_MISSION_START,
            [0.0, 0.0],
            OrderKind::Start,
            true,
        ),
        (
            Is::MAV_CMD_DO_PAUSE_CONTINUE,
            [0.0, 0.0],
            OrderKind::Hold,
            false,
        ),
        (
            Is::MAV_CMD_DO_PAUSE_CONTINUE,
            [1.0, 0.0],
            OrderKind::Start,
            false,
        ),
        (
            Is::MAV_CMD_NAV_RETURN_TO_LAUNCH,
            [0.0, 0.0],
            OrderKind::Return,
            false,
        ),
        (Is::MAV_CMD_NAV_LAND, [0.0, 0.0], OrderKind::Land, false),
        (
            Is::MAV_CMD_DO_FLIGHTTERMINATION,
            [1.0, 0.0],
            OrderKind::CutMotors,
            false,
        ),
    ] {
        let mut rig = Rig::new(true);
        rig.pass(1.0);
        assert_eq!(
            rig.command(2, command, parameters),
            [under_way],
            "{command:?}"
        );
        let wanted = OrderRequest {
            number: 0,
            vehicle: VehicleId(2),
            kind,
            begins,
        };
        assert_eq!(rig.requests, [wanted], "{command:?}");
        let said = rig.ended(0, &RequestEnd::InForce);
        assert_eq!(acks(&said, command), [done]);
        assert_eq!(count(&said, 1, |_| true), 0);
    }
}

#[test]
fn what_makes_no_sense_is_no_order() {
    let mut rig = Rig::new(true);
    rig.pass(1.0);
    let (denied, unsupported) = (
        MavResult::MAV_RESULT_DENIED,
        MavResult::MAV_RESULT_UNSUPPORTED,
    );
    let arm = MavCmd::MAV_CMD_COMPONENT_ARM_DISARM;
    for (command, parameters, answer) in [
        (arm, [f32::NAN, 0.0], denied),
        (arm, [f32::INFINITY, 0.0], denied),
        (arm, [2.0, 0.0], denied),
        (arm, [0.5, 21_196.0], denied),
        (MavCmd::MAV_CMD_DO_SET_MODE, [1.0, f32::NAN], denied),
        (MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 0.0], unsupported),
        (MavCmd::MAV_CMD_DO_FLIGHTTERMINATION, [0.0, 0.0], denied),
        (MavCmd::MAV_CMD_NAV_TAKEOFF, [0.0, 0.0], unsupported),
    ] {
        assert_eq!(rig.command(1, command, parameters), [answer], "{command:?}");
    }
    assert_eq!(rig.command(9, arm, [1.0, 0.0]), [], "it is nobody");
    assert_eq!(
        rig.command(0, arm, [0.0, 0.0]),
        [denied; 2],
        "for all at once"
    );
    assert_eq!(rig.requests, []);
}

#[test]
fn a_command_that_is_said_again_is_one_order() {
    let mut rig = Rig::new(true);
    rig.pass(1.0);
    let (land, arm) = (
        MavCmd::MAV_CMD_NAV_LAND,
        MavCmd::MAV_CMD_COMPONENT_ARM_DISARM,
    );
    let (done, under_way) = (
        MavResult::MAV_RESULT_ACCEPTED,
        MavResult::MAV_RESULT_IN_PROGRESS,
    );
    assert_eq!(rig.command(1, land, [0.0, 0.0]), [under_way]);
    rig.pass(2.0);
    assert_eq!(rig.command_again(1, land, [0.0, 0.0], 1), [under_way]);
    assert_eq!(
        rig.command(1, arm, [0.0, 0.0]),
        [under_way],
        "the same order"
    );
    assert_eq!(rig.requests.len(), 1);
    let said = rig.ended(0, &RequestEnd::InForce);
    assert_eq!(
        (acks(&said, land), acks(&said, arm)),
        (vec![done], vec![done])
    );
    assert_eq!(rig.command_again(1, land, [0.0, 0.0], 2), [done]);
    assert_eq!(rig.command(1, land, [0.0, 0.0]), [under_way], "much later");
    assert_eq!(rig.requests.len(), 2);
    rig.ended(1, &RequestEnd::InForce);
    assert_eq!(rig.command(1, land, [0.0, 0.0]), [done], "within a second");
    assert_eq!(rig.requests.len(), 2);
    // Arming and a mode after it are one start.
    assert_eq!(rig.command(1, arm, [1.0, 0.0]), [under_way]);
    rig.ended(2, &RequestEnd::InForce);
    rig.pass(3.0);
    assert_eq!(
        rig.command(1, MavCmd::MAV_CMD_DO_SET_MODE, [1.0, 10.0]),
        [done]
    );
    assert_eq!(rig.requests.len(), 3);
}

#[test]
fn an_order_that_is_not_obeyed_is_answered_with_its_reason() {
    let mut rig = Rig::new(true);
    rig.pass(1.0);
    let start = MavCmd::MAV_CMD_MISSION_START;
    rig.command(1, start, [0.0, 0.0]);
    let why = "vehicle 1 is not heard".to_owned();
    let said = rig.ended(0, &RequestEnd::Failed(why.clone()));
    assert_eq!(acks(&said, start), [MavResult::MAV_RESULT_FAILED]);
    assert_eq!(texts(&said), [why]);
    rig.pass(2.0);
    rig.command(1, start, [0.0, 0.0]);
    let said = rig.ended(1, &RequestEnd::Refused("a run is under way".to_owned()));
    assert_eq!(acks(&said, start), [MavResult::MAV_RESULT_DENIED]);
    assert_eq!(rig.ended(1, &RequestEnd::InForce), [], "it has ended");
    assert_eq!(rig.ended(77, &RequestEnd::InForce), [], "nobody wanted it");
}

#[test]
fn orders_that_are_open_are_bounded() {
    let mut rig = Rig::new(true);
    rig.pass(1.0);
    let modes = [4.0, 11.0].into_iter().cycle().take(40);
    let answers: Vec<MavResult> = modes
        .flat_map(|mode| rig.command(1, MavCmd::MAV_CMD_DO_SET_MODE, [1.0, mode]))
        .collect();
    assert_eq!(rig.requests.len(), 8);
    assert_eq!(answers[38], MavResult::MAV_RESULT_TEMPORARILY_REJECTED);
    (0..8).for_each(|number| drop(rig.ended(number, &RequestEnd::InForce)));
    let answer = rig.command(1, MavCmd::MAV_CMD_NAV_LAND, [0.0, 0.0]);
    assert_eq!(answer, [MavResult::MAV_RESULT_IN_PROGRESS]);
}

#[test]
fn ground_stations_find_what_they_load_and_change_none_of_it() {
    let mut rig = Rig::new(true);
    rig.pass(1.0);
    rig.say(&MavMessage::PARAM_REQUEST_LIST(PARAM_REQUEST_LIST_DATA {
        target_system: 2,
        target_component: 1,
    }));
    let values = |said: Vec<(u8, MavMessage)>| -> Vec<(String, f32)> {
        let value = |(_, message)| match message {
            MavMessage::PARAM_VALUE(value) => {
                assert_eq!(value.param_count, 4);
                Some((
                    value.param_id.to_str().unwrap().to_owned(),
                    value.param_value,
                ))
            }
            _ => None,
        };
        said.into_iter().filter_map(value).collect()
    };
    let listed = values(rig.pass(1.0));
    assert_eq!(listed.len(), 4);
    assert!(
        listed.contains(&("SYSID_THISMAV".to_owned(), 2.0)),
        "{listed:?}"
    );
    let set = MavMessage::PARAM_SET(PARAM_SET_DATA {
        param_value: 9.0,
        target_system: 2,
        param_id: "SYSID_THISMAV".into(),
        ..Default::default()
    });
    assert_eq!(values(rig.say(&set)), [("SYSID_THISMAV".to_owned(), 2.0)]);
    let count = MavMessage::MISSION_COUNT(d::MISSION_COUNT_DATA {
        count: 3,
        target_system: 2,
        ..Default::default()
    });
    let refused = |said: &[(u8, MavMessage)]| match &said[0].1 {
        MavMessage::MISSION_ACK(ack) => ack.mavtype == MavMissionResult::MAV_MISSION_UNSUPPORTED,
        _ => false,
    };
    assert!(refused(&rig.say(&count)));
    let list = MavMessage::MISSION_REQUEST_LIST(d::MISSION_REQUEST_LIST_DATA {
        target_system: 2,
        ..Default::default()
    });
    assert!(matches!(&rig.say(&list)[0].1, MavMessage::MISSION_COUNT(count) if count.count == 0));
}

#[test]
fn a_vehicle_without_a_home_and_one_that_knows_no_place_are_shown_without() {
    let mut rig = Rig::new(true);
    rig.vehicles[0].state.vehicle = VehicleId(9);
    rig.vehicles[1].state.pose = None;
    let said = rig.pass(6.0);
    let is_home = |message: &MavMessage| matches!(message, MavMessage::HOME_POSITION(_));
    let is_place = |message: &MavMessage| matches!(message, MavMessage::GLOBAL_POSITION_INT(_));
    assert_eq!(
        (count(&said, 9, is_home), count(&said, 2, is_place)),
        (0, 0)
    );
    assert!(count(&said, 9, is_place) > 0 && count(&said, 2, is_home) > 0);
    let home = rig.command(9, MavCmd::MAV_CMD_REQUEST_MESSAGE, [242.0, 0.0]);
    assert_eq!(home, [MavResult::MAV_RESULT_FAILED]);
}

#[test]
fn what_is_not_signed_with_the_key_is_told_once_and_not_heard() {
    let mut rig = Rig::new(true);
    let key = [7; KEY_BYTES];
    rig.server = SwarmServer::new(SwarmServerSettings {
        key: Some(key),
        ..settings(true)
    });
    rig.server.joined(rig.now, CLIENT, 1_000);
    rig.pass(1.0);
    let land = MavCmd::MAV_CMD_NAV_LAND;
    assert_eq!(rig.command(1, land, [0.0, 0.0]), []);
    assert_eq!(rig.command(1, land, [0.0, 0.0]), []);
    assert_eq!((rig.warnings.len(), rig.requests.len()), (1, 0));
    let mut bytes = Vec::new();
    let command = MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
        command: land,
        target_system: 1,
        ..Default::default()
    });
    let mut signing = Signing::new(key, 3, 5_000);
    rig.writer.write(&command, Some(&mut signing), &mut bytes);
    let mut output = ServerOutput::default();
    rig.server.hear(rig.now, CLIENT, &bytes, &mut output);
    assert_eq!(output.requests.len(), 1);
}

#[test]
fn garbage_and_floods_stop_nobody() {
    let mut rig = Rig::new(true);
    rig.pass(1.0);
    let mut output = ServerOutput::default();
    let mut noise: Vec<u8> = (0..200_000_u32)
        .map(|at| (at.wrapping_mul(at) >> 7) as u8)
        .collect();
    rig.server.hear(rig.now, CLIENT, &noise, &mut output);
    noise.fill(0xFD);
    rig.server.hear(rig.now, CLIENT, &noise, &mut output);
    rig.server.hear(rig.now, ClientId(99), &noise, &mut output);
    assert_eq!((output.requests.len(), output.bytes.len()), (0, 0));
    // What an unfinished frame has swallowed is lost, nothing after it.
    rig.server.left(CLIENT);
    rig.server.joined(rig.now, CLIENT, 0);
    let land = rig.command(1, MavCmd::MAV_CMD_NAV_LAND, [0.0, 0.0]);
    assert_eq!(land, [MavResult::MAV_RESULT_IN_PROGRESS]);
}
