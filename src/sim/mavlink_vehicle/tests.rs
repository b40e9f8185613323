//! The driver against simulated autopilots, over bytes and in virtual time; and what it makes of autopilots that misbehave.

use std::time::Duration;

use tomoswarm_proto::{
    AutopilotFamily, BodyKind, Estimator, FailsafeAction, Failsafes, SatelliteFix,
};

use crate::autopilot::{
    Ack, ArmRefusal, AutopilotReport, Command, CommandAck, FlightMode, Item, Motion,
    NumberedCommand, RemoteSwitch, VehicleKind,
};
use crate::geom::{Angle, Bearing, Geodetic, Point, Vector};
use crate::mavlink::asked_command::command_ack;
use crate::mavlink::autopilot_driver::{
    DriverOut, DriverTrouble, MavlinkDriver, MavlinkDriverSettings, PlaceSource, SwitchSettings,
};
use crate::mavlink::client_link::{ClientBytes, ClientId};
use crate::mavlink::dialect::{
    self as d, GPS_RAW_INT_DATA, GpsFixType, HEARTBEAT_DATA, MavAutopilot, MavCmd, MavMessage,
    MavResult, MavType,
};
use crate::mavlink::earth_frame::EarthFrame;
use crate::mavlink::frames::{Content, Frame, FrameReader, FrameWriter, MavAddress};
use crate::sim::environment::Environment;
use crate::sim::free_space::free_space;
use crate::sim::mavlink_fleet::{Endpoints, MavlinkFleet};
use crate::sim::mavlink_vehicle::that_keep_place;
use crate::time::Time;

const OWN: MavAddress = MavAddress {
    system: 255,
    component: 191,
};
const CLIENT: ClientId = ClientId(1);

fn frame() -> EarthFrame {
    let datum = Geodetic {
        latitude_deg: 52.0,
        longitude_deg: 4.0,
        altitude_m: 3.0,
    };
    EarthFrame::new(datum, Bearing::from_degrees(40.0))
}

fn settings(kind: VehicleKind) -> MavlinkDriverSettings {
    MavlinkDriverSettings {
        own: OWN,
        system: 1,
        kind,
        frame: frame(),
        place: PlaceSource::Global,
        sets_origin: false,
        place_sd_min_m: 0.01,
        arms_without_failsafes: true,
        takes_fixes: false,
        switch: None,
        ranges: None,
    }
}

/// A driver and simulated vehicles that it speaks with, each told what the other says at once.
struct Rig {
    now: Time,
    driver: MavlinkDriver,
    environment: Environment,
    fleet: MavlinkFleet,
    to_driver: FrameReader,
    writer: FrameWriter,
    reports: Vec<AutopilotReport>,
    acks: Vec<Ack>,
    texts: Vec<String>,
    number: u32,
    is_cut: bool,
    /// What it answers to who asks for single messages, as old firmware does; `None` = it knows how.
    refuses_messages: Option<MavResult>,
}

impl Rig {
    fn new(settings: MavlinkDriverSettings) -> Rig {
        let mut environment = free_space(settings.kind, 2, 7).unwrap();
        environment.begin(&mut Vec::new());
        let mut fleet = MavlinkFleet::new(&environment, frame(), Endpoints::Shared, None);
        fleet.joined(Time::ZERO, CLIENT, 0, 0);
        Rig {
            now: Time::ZERO,
            driver: MavlinkDriver::new(settings),
            environment,
            fleet,
            to_driver: FrameReader::default(),
            writer: FrameWriter::new(OWN),
            reports: Vec::new(),
            acks: Vec::new(),
            texts: Vec::new(),
            number: 0,
            is_cut: false,
            refuses_messages: None,
        }
    }

    fn take(&mut self, out: Vec<DriverOut>) {
        for said in out {
            match said {
                DriverOut::Say(message) if self.refusal(&message).is_some() => {
                    let refusal = self.refusal(&message);
                    self.to_driver.push(&refusal.unwrap_or_default());
                    self.tell(Vec::new());
                }
                DriverOut::Say(message) => {
                    let (mut bytes, mut answers) = (Vec::new(), Vec::new());
                    self.writer.write(&message, None, &mut bytes);
                    if !self.is_cut {
                        self.fleet.hear(
                            self.now,
                            CLIENT,
                            &bytes,
                            &mut self.environment,
                            &mut answers,
                        );
                        self.tell(answers);
                    }
                }
                DriverOut::Report(report) => self.reports.push(report),
                DriverOut::Ack(ack) => self.acks.push(ack),
                DriverOut::Reading(reading) => panic!("no range sensor hangs on it: {reading:?}"),
                DriverOut::Text { text, .. } => self.texts.push(text),
            }
        }
    }

    /// Returns the bytes of a refusal, if a message asks for what is not known.
    fn refusal(&self, said: &MavMessage) -> Option<Vec<u8>> {
        let MavMessage::COMMAND_LONG(asked) = said else {
            return None;
        };
        let is_of_messages = matches!(
            asked.command,
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL | MavCmd::MAV_CMD_REQUEST_MESSAGE
        );
        let result = self.refuses_messages.filter(|_| is_of_messages)?;
        let mut writer = FrameWriter::new(MavAddress {
            system: 1,
            component: 1,
        });
        let mut bytes = Vec::new();
        writer.write(&command_ack(OWN, asked.command, result), None, &mut bytes);
        Some(bytes)
    }

    fn tell(&mut self, answers: Vec<ClientBytes>) {
        for (_, bytes) in answers {
            if !self.is_cut {
                self.to_driver.push(&bytes);
            }
        }
        while let Some(frame) = self.to_driver.next(None) {
            let mut out = Vec::new();
            self.driver.hear(self.now, &frame, &mut out);
            self.take(out);
        }
    }

    /// Lets time pass, 10 ms at a time, until something is so; returns whether it came to be within so many seconds.
    fn until(&mut self, within_s: f64, is_so: impl Fn(&Rig) -> bool) -> bool {
        let end = self.now + Duration::from_secs_f64(within_s);
        while self.now < end {
            if is_so(self) {
                return true;
            }
            self.now = self.now + Duration::from_millis(10);
            self.environment.wake(self.now, &mut Vec::new());
            let mut answers = Vec::new();
            self.fleet
                .due(self.now, &mut self.environment, &mut answers);
            self.tell(answers);
            let mut out = Vec::new();
            while self.driver.deadline() <= self.now && out.len() < 100 {
                self.driver.due(self.now, &mut out);
            }
            self.take(out);
        }
        is_so(self)
    }

    fn pass(&mut self, time_s: f64) {
        self.until(time_s, |_| false);
    }

    fn command(&mut self, command: Command) -> CommandAck {
        self.number += 1;
        let (number, mut out) = (self.number, Vec::new());
        self.driver
            .command(self.now, &NumberedCommand { number, command }, &mut out);
        self.take(out);
        assert!(
            self.until(2.0, |rig| rig.acks.iter().any(|ack| ack.number == number)),
            "no answer"
        );
        self.acks.last().unwrap().result
    }

    fn last(&self) -> &AutopilotReport {
        self.reports.last().unwrap()
    }

    /// Armed in GUIDED.
    fn armed(kind: VehicleKind) -> Rig {
        let mut rig = Rig::new(settings(kind));
        rig.pass(1.5);
        assert_eq!(
            rig.command(Command::Mode(FlightMode::Guided)),
            CommandAck::Accepted
        );
        assert_eq!(
            rig.command(Command::Arm { force: false }),
            CommandAck::Accepted
        );
        assert!(rig.until(2.0, |rig| rig.last().is_armed));
        rig
    }
}

#[test]
fn it_reports_ten_times_a_second_where_the_vehicle_is() {
    let mut rig = Rig::new(settings(VehicleKind::Rover));
    rig.pass(5.0);
    rig.reports.clear();
    rig.pass(2.0);
    assert!(
        (19..=21).contains(&rig.reports.len()),
        "{}",
        rig.reports.len()
    );
    let truth = rig.environment.known(0, rig.now).pose;
    let told = rig.last().pose;
    assert!(told.at.distance_to(truth.at) < 0.02, "{told:?} {truth:?}");
    assert!(told.heading.is_near(truth.heading, 1e-3));
    assert!(told.sd_m < 0.1, "{told:?}");
    assert_eq!(rig.driver.trouble(rig.now), None);
    assert_eq!(rig.last().motion, Motion::Resting);
}

#[test]
fn old_firmware_that_sets_no_rate_of_a_message_is_asked_for_its_groups() {
    for refusal in [
        MavResult::MAV_RESULT_UNSUPPORTED,
        MavResult::MAV_RESULT_FAILED,
    ] {
        let mut rig = Rig::new(settings(VehicleKind::Rover));
        rig.refuses_messages = Some(refusal);
        rig.pass(5.0);
        rig.reports.clear();
        rig.pass(2.0);
        let count = rig.reports.len();
        assert!((19..=21).contains(&count), "{count}");
        assert_eq!(rig.driver.trouble(rig.now), None);
        let health = rig.driver.health(rig.now).unwrap();
        let known = (health.fix, health.estimator, health.battery_mv.is_some());
        assert_eq!(known, (SatelliteFix::ThreeD, Estimator::Good, true));
        assert_eq!(health.firmware, "");
    }
}

#[test]
fn its_health_and_failsafes_are_known_soon_after_it_is_heard() {
    for (kind, body, estimator) in [
        (VehicleKind::Rover, BodyKind::Rover, FailsafeAction::Unknown),
        (VehicleKind::Copter, BodyKind::Copter, FailsafeAction::Land),
    ] {
        let mut rig = Rig::new(settings(kind));
        assert_eq!(rig.driver.health(rig.now), None);
        rig.pass(6.0);
        let health = rig.driver.health(rig.now).unwrap();
        assert_eq!(
            (health.family, health.body),
            (AutopilotFamily::ArduPilot, body)
        );
        assert!(!health.firmware.is_empty() && health.battery_mv.is_some());
        assert_eq!(
            (health.fix, health.estimator),
            (SatelliteFix::ThreeD, Estimator::Good)
        );
        // As ArduPilot comes: nothing is switched on.
        let expected = Failsafes {
            battery: FailsafeAction::Off,
            companion: FailsafeAction::Off,
            fence: FailsafeAction::Off,
            remote: FailsafeAction::Unknown,
            estimator,
        };
        assert_eq!(health.failsafes, expected);
    }
}

#[test]
fn it_is_not_armed_before_its_failsafes_keep_it_where_it_is() {
    for kind in [VehicleKind::Rover, VehicleKind::Copter] {
        let mut rig = Rig::new(MavlinkDriverSettings {
            arms_without_failsafes: false,
            ..settings(kind)
        });
        assert_eq!(
            rig.command(Command::Arm { force: false }),
            CommandAck::Denied
        );
        assert!(rig.texts.is_empty(), "they are not read yet");
        rig.pass(4.0);
        rig.command(Command::Mode(FlightMode::Guided));
        assert_eq!(
            rig.command(Command::Arm { force: false }),
            CommandAck::Denied
        );
        let refusal = rig.acks.last().unwrap().arm_refusal;
        assert_eq!(refusal, Some(ArmRefusal::Failsafes));
        let complaint =
            "not armed: its failsafes (battery, companion, fence) do not keep it where it is";
        assert_eq!(rig.texts, [complaint]);
        for parameter in that_keep_place(kind) {
            let is_known = rig
                .fleet
                .set_parameter(rig.now, *parameter, &mut rig.environment);
            assert!(is_known, "{parameter:?}");
        }
        // It is told of new values by whoever sets them; here the autopilot starts anew.
        rig.driver = MavlinkDriver::new(MavlinkDriverSettings {
            arms_without_failsafes: false,
            ..settings(kind)
        });
        rig.pass(4.0);
        assert_eq!(
            rig.command(Command::Arm { force: false }),
            CommandAck::Accepted
        );
    }
}

#[test]
fn where_the_switch_of_the_remote_control_stands_is_reported() {
    let mut rig = Rig::new(MavlinkDriverSettings {
        switch: Some(SwitchSettings {
            channel: 7,
            hold_us: 1500,
            return_us: 1900,
        }),
        ..settings(VehicleKind::Rover)
    });
    rig.pass(4.0);
    assert_eq!(rig.last().switch, None, "no receiver");
    for (width_us, expected) in [
        (1000, None),
        (1400, Some(RemoteSwitch::Hold)),
        (1700, None),
        (2000, Some(RemoteSwitch::Return)),
        (0, None),
    ] {
        // Clients may speak in place of a receiver.
        let channels = d::RC_CHANNELS_OVERRIDE_DATA {
            chan7_raw: width_us,
            target_system: 1,
            target_component: 1,
            ..d::RC_CHANNELS_OVERRIDE_DATA::default()
        };
        let channels = Box::new(MavMessage::RC_CHANNELS_OVERRIDE(channels));
        rig.take(vec![DriverOut::Say(channels)]);
        rig.pass(0.6);
        assert_eq!(rig.last().switch, expected, "{width_us}");
    }
}

#[test]
fn a_route_is_driven_corner_by_corner() {
    let mut rig = Rig::armed(VehicleKind::Rover);
    let corners = [
        Point::new(-4.0, 0.0),
        Point::new(-4.0, -5.0),
        Point::new(-8.0, -5.0),
    ];
    let route = Command::Route {
        corners: corners.to_vec(),
        altitude_m: None,
        speed_mps: Some(1.0),
    };
    assert_eq!(rig.command(route), CommandAck::Accepted);
    rig.reports.clear();
    let there = |rig: &Rig| {
        rig.reports
            .last()
            .is_some_and(|last| last.pose.at.distance_to(corners[2]) < 0.15)
    };
    assert!(rig.until(40.0, there), "{:?}", rig.last());
    for corner in corners {
        let nearest_m = rig
            .reports
            .iter()
            .map(|report| report.pose.at.distance_to(corner))
            .fold(f64::MAX, f64::min);
        assert!(nearest_m < 0.3, "{corner:?} {nearest_m}");
    }
    let fastest_mps = rig
        .reports
        .iter()
        .map(|report| report.speed_mps)
        .fold(0.0, f64::max);
    assert!((0.9..1.05).contains(&fastest_mps), "{fastest_mps}");
}

#[test]
fn a_stop_ends_a_drive_and_it_is_not_said_again() {
    let mut rig = Rig::armed(VehicleKind::Rover);
    let route = Command::Route {
        corners: vec![Point::new(-30.0, 0.0)],
        altitude_m: None,
        speed_mps: Some(1.0),
    };
    rig.command(route);
    assert!(rig.until(8.0, |rig| rig.last().speed_mps > 0.5));
    let ahead = rig.last().pose.heading;
    assert_eq!(rig.command(Command::Stop), CommandAck::Accepted);
    assert!(rig.until(3.0, |rig| rig.last().motion == Motion::Resting));
    let at = rig.last().pose.at;
    rig.pass(5.0);
    assert!(rig.last().pose.at.distance_to(at) < 0.1);
    assert!(
        rig.last().pose.heading.is_near(ahead, 0.05),
        "it turns away"
    );
}

#[test]
fn a_rover_takes_a_speed_while_it_drives_to_a_place_and_each_drive_is_as_fast_as_it_is_told() {
    let mut rig = Rig::armed(VehicleKind::Rover);
    assert_eq!(
        rig.command(Command::Speed(0.5)),
        CommandAck::Failed,
        "it drives nowhere"
    );
    for (x_m, speed_mps) in [(-9.0, 0.4), (-1.0, 0.8)] {
        let goal = Point::new(x_m, 0.0);
        rig.command(Command::Route {
            corners: vec![goal],
            altitude_m: None,
            speed_mps: Some(speed_mps),
        });
        rig.reports.clear();
        let there = |rig: &Rig| {
            let last = rig.reports.last();
            last.is_some_and(|last| last.pose.at.distance_to(goal) < 0.15)
        };
        assert!(rig.until(40.0, there), "{:?}", rig.last());
        let speeds = rig.reports.iter().map(|report| report.speed_mps);
        let fastest_mps = speeds.fold(0.0, f64::max);
        let is_it = (fastest_mps - speed_mps).abs() < 0.1;
        assert!(is_it, "{fastest_mps} instead of {speed_mps}");
        rig.command(Command::Stop);
        rig.pass(1.0);
    }
}

#[test]
fn who_changes_the_mode_is_not_driven_against() {
    let mut rig = Rig::armed(VehicleKind::Rover);
    let route = Command::Route {
        corners: vec![Point::new(-30.0, 0.0)],
        altitude_m: None,
        speed_mps: Some(1.0),
    };
    rig.command(route);
    assert!(rig.until(8.0, |rig| rig.last().speed_mps > 0.5));
    for mode in [FlightMode::Hold, FlightMode::Guided] {
        rig.environment
            .command_by_client(rig.now, 0, &Command::Mode(mode));
        assert!(rig.until(3.0, |rig| rig.last().mode == mode), "it shows");
    }
    rig.pass(1.0);
    let at = rig.last().pose.at;
    rig.pass(4.0);
    assert!(
        rig.last().pose.at.distance_to(at) < 0.1,
        "the drive is forgotten"
    );
}

#[test]
fn a_copter_takes_off_turns_goes_and_lands() {
    let mut rig = Rig::armed(VehicleKind::Copter);
    assert_eq!(
        rig.command(Command::Takeoff { altitude_m: 4.0 }),
        CommandAck::Accepted
    );
    assert!(rig.until(10.0, |rig| rig.last().flight_state.altitude_m > 3.9));
    assert!(!rig.last().is_landed);
    let heading = Angle::from_degrees(70.0);
    assert_eq!(rig.command(Command::Yaw(heading)), CommandAck::Accepted);
    assert!(rig.until(6.0, |rig| rig.last().pose.heading.is_near(heading, 0.02)));
    let goal = Point::new(6.0, 12.0);
    let route = Command::Route {
        corners: vec![goal],
        altitude_m: Some(5.0),
        speed_mps: None,
    };
    assert_eq!(rig.command(route), CommandAck::Accepted);
    let there = |rig: &Rig| {
        rig.last().pose.at.distance_to(goal) < 0.3
            && (rig.last().flight_state.altitude_m - 5.0).abs() < 0.1
    };
    assert!(rig.until(30.0, there), "{:?}", rig.last());
    assert_eq!(
        rig.command(Command::Disarm { force: false }),
        CommandAck::Failed,
        "in the air"
    );
    assert_eq!(
        rig.command(Command::Mode(FlightMode::Land)),
        CommandAck::Accepted
    );
    assert!(rig.until(30.0, |rig| rig.last().is_landed && !rig.last().is_armed));
}

#[test]
fn a_mission_is_uploaded_and_flown() {
    let mut rig = Rig::armed(VehicleKind::Rover);
    let waypoint = |x_m, y_m| Item::Waypoint {
        at: Point::new(x_m, y_m),
        altitude_m: 0.0,
        delay: Duration::ZERO,
    };
    let servo = Item::Servo {
        channel: 9,
        pulse_us: 1700,
    };
    let jump = Item::Jump {
        to: 1,
        times: Some(1),
    };
    let items = vec![
        waypoint(0.0, 0.0),
        waypoint(-3.0, 0.0),
        servo,
        waypoint(-3.0, -3.0),
        jump,
    ];
    assert_eq!(rig.command(Command::Upload(items)), CommandAck::Accepted);
    assert_eq!(
        rig.command(Command::Mode(FlightMode::Auto)),
        CommandAck::Accepted
    );
    assert!(
        rig.until(60.0, |rig| rig
            .texts
            .iter()
            .any(|text| text == "Mission Complete")),
        "{:?}",
        rig.texts
    );
    let begun: Vec<&str> = rig
        .texts
        .iter()
        .filter_map(|text| text.strip_prefix("Mission: "))
        .collect();
    assert_eq!(begun, ["1", "2", "3", "4", "1", "2", "3", "4"]);
    let follow = Item::Land { at: None };
    assert_eq!(
        rig.command(Command::Upload(vec![waypoint(0.0, 0.0), follow])),
        CommandAck::Unsupported
    );
}

#[test]
fn what_is_no_number_is_never_said() {
    let mut rig = Rig::armed(VehicleKind::Copter);
    let nan = f64::NAN;
    for command in [
        Command::Takeoff { altitude_m: nan },
        Command::Route {
            corners: vec![Point::new(nan, 0.0)],
            altitude_m: None,
            speed_mps: None,
        },
        Command::Route {
            corners: vec![Point::new(1.0, 0.0)],
            altitude_m: Some(f64::INFINITY),
            speed_mps: None,
        },
        Command::Velocity(Point::new(nan, 0.0) - Point::default()),
        Command::Speed(nan),
        Command::SetHome(Point::new(0.0, nan)),
    ] {
        assert_eq!(
            rig.command(command.clone()),
            CommandAck::Denied,
            "{command:?}"
        );
    }
}

#[test]
fn a_cut_is_seen_after_a_second_and_mends_by_itself() {
    let mut rig = Rig::armed(VehicleKind::Rover);
    rig.is_cut = true;
    rig.pass(0.8);
    assert_eq!(rig.driver.trouble(rig.now), None);
    rig.pass(0.4);
    assert!(matches!(
        rig.driver.trouble(rig.now),
        Some(DriverTrouble::Silent { system: 1, .. })
    ));
    rig.reports.clear();
    rig.pass(4.0);
    assert!(rig.reports.is_empty());
    rig.is_cut = false;
    rig.pass(2.5);
    assert_eq!(rig.driver.trouble(rig.now), None);
    assert!(rig.reports.len() > 10);
}

/// A driver that has heard nothing, told messages one by one.
struct Told(MavlinkDriver, Vec<DriverOut>);

impl Told {
    fn new(kind: VehicleKind) -> Told {
        Told(MavlinkDriver::new(settings(kind)), Vec::new())
    }

    fn hear(&mut self, time_s: f64, system: u8, message: MavMessage) {
        let from = MavAddress {
            system,
            component: 1,
        };
        let frame = Frame {
            from,
            sequence: 0,
            content: Content::Message(Box::new(message)),
        };
        self.0
            .hear(Time::from_secs_f64(time_s), &frame, &mut self.1);
    }

    fn trouble(&self, time_s: f64) -> String {
        let trouble = self.0.trouble(Time::from_secs_f64(time_s));
        trouble
            .map(|trouble| trouble.to_string())
            .unwrap_or_default()
    }

    fn reports(&self) -> usize {
        self.1
            .iter()
            .filter(|out| matches!(out, DriverOut::Report(_)))
            .count()
    }
}

fn heartbeat_of(mavtype: MavType) -> MavMessage {
    MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        mavtype,
        autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        ..HEARTBEAT_DATA::default()
    })
}

fn place(boot_ms: u32) -> MavMessage {
    MavMessage::GLOBAL_POSITION_INT(d::GLOBAL_POSITION_INT_DATA {
        time_boot_ms: boot_ms,
        lat: 520_000_000,
        lon: 40_000_000,
        ..d::GLOBAL_POSITION_INT_DATA::default()
    })
}

fn fix(fix_type: GpsFixType) -> MavMessage {
    MavMessage::GPS_RAW_INT(GPS_RAW_INT_DATA {
        fix_type,
        satellites_visible: 4,
        h_acc: 300,
        ..GPS_RAW_INT_DATA::default()
    })
}

#[test]
fn each_misfit_is_told_in_words_and_reports_nothing() {
    let mut told = Told::new(VehicleKind::Rover);
    assert_eq!(told.trouble(0.0), "system 1 was not heard");
    told.hear(0.1, 4, heartbeat_of(MavType::MAV_TYPE_GROUND_ROVER));
    assert_eq!(told.trouble(0.1), "system 1 was not heard, but 4");
    told.hear(0.2, 1, heartbeat_of(MavType::MAV_TYPE_FIXED_WING));
    told.hear(0.2, 1, place(1));
    assert_eq!(
        told.trouble(0.2),
        "it steers something else (MAV_TYPE 1), and the vehicle's file says rover"
    );
    told.hear(0.3, 1, heartbeat_of(MavType::MAV_TYPE_QUADROTOR));
    assert_eq!(
        told.trouble(0.3),
        "it steers a copter, and the vehicle's file says rover"
    );
    told.hear(
        0.4,
        1,
        MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            mavtype: MavType::MAV_TYPE_GROUND_ROVER,
            autopilot: MavAutopilot::MAV_AUTOPILOT_PX4,
            ..HEARTBEAT_DATA::default()
        }),
    );
    told.hear(0.4, 1, place(2));
    assert!(
        told.trouble(0.4).contains("no ArduPilot"),
        "{}",
        told.trouble(0.4)
    );
    assert_eq!(told.reports(), 0);
}

#[test]
fn a_place_without_a_fix_is_reported_as_unknown() {
    let mut told = Told::new(VehicleKind::Rover);
    told.hear(0.1, 1, heartbeat_of(MavType::MAV_TYPE_GROUND_ROVER));
    told.hear(0.1, 1, MavMessage::ATTITUDE(d::ATTITUDE_DATA::default()));
    for (fix_type, known) in [
        (GpsFixType::GPS_FIX_TYPE_NO_FIX, false),
        (GpsFixType::GPS_FIX_TYPE_3D_FIX, true),
    ] {
        told.hear(0.2, 1, fix(fix_type));
        told.hear(0.2, 1, place(3));
        let Some(DriverOut::Report(report)) = told.1.last() else {
            panic!("a report")
        };
        assert_eq!(report.pose.sd_m, if known { 0.3 } else { 1000.0 });
        assert_eq!(told.trouble(0.2).is_empty(), known);
    }
}

#[test]
fn a_local_place_or_velocity_that_is_no_number_is_not_reported() {
    let mut told = Told(
        MavlinkDriver::new(MavlinkDriverSettings {
            place: PlaceSource::Local,
            ..settings(VehicleKind::Rover)
        }),
        Vec::new(),
    );
    told.hear(0.1, 1, heartbeat_of(MavType::MAV_TYPE_GROUND_ROVER));
    told.hear(0.1, 1, MavMessage::ATTITUDE(d::ATTITUDE_DATA::default()));
    let nan = f32::NAN;
    for (x, vx, vz) in [(nan, 0.0, 0.0), (0.0, nan, 0.0), (0.0, 0.0, nan)] {
        let place = d::LOCAL_POSITION_NED_DATA {
            x,
            vx,
            vz,
            ..d::LOCAL_POSITION_NED_DATA::default()
        };
        told.hear(0.2, 1, MavMessage::LOCAL_POSITION_NED(place));
        assert_eq!(told.reports(), 0);
        assert!(told.trouble(0.2).contains("no number"));
    }
    told.hear(0.3, 1, MavMessage::LOCAL_POSITION_NED(Default::default()));
    assert_eq!(told.reports(), 1);
}

#[test]
fn one_that_starts_anew_is_set_up_again_and_two_of_one_name_are_told() {
    let mut told = Told::new(VehicleKind::Rover);
    told.hear(0.0, 1, heartbeat_of(MavType::MAV_TYPE_GROUND_ROVER));
    told.hear(0.1, 1, fix(GpsFixType::GPS_FIX_TYPE_3D_FIX));
    told.hear(0.1, 1, place(90_000));
    told.hear(0.2, 1, place(100));
    let anew = |told: &Told| {
        told.1
            .iter()
            .filter(
                |out| matches!(out, DriverOut::Text { text, .. } if text.contains("started anew")),
            )
            .count()
    };
    assert_eq!(anew(&told), 1);
    for step in 0..4 {
        let time_s = 0.3 + 0.2 * f64::from(step);
        told.hear(time_s, 1, place(91_000));
        told.hear(time_s + 0.1, 1, place(1_000));
    }
    assert!(
        told.trouble(1.0).contains("two autopilots"),
        "{}",
        told.trouble(1.0)
    );
    assert_eq!(anew(&told), 2, "after that it is no start");
    let before = told.reports();
    told.hear(1.1, 1, place(91_500));
    assert_eq!(told.reports(), before, "nothing is believed of either");
}

#[test]
fn an_autopilot_that_is_started_anew_while_it_drives_stands_disarmed_and_is_asked_for_everything_again()
 {
    let mut rig = Rig::armed(VehicleKind::Rover);
    rig.pass(2.0);
    let before = rig.last().pose.at;
    let there = before + Vector::new(40.0, 0.0);
    let drive = Command::Route {
        corners: vec![there],
        altitude_m: None,
        speed_mps: Some(1.0),
    };
    assert_eq!(rig.command(drive), CommandAck::Accepted);
    rig.pass(3.0);
    assert!(rig.last().pose.at.distance_to(before) > 1.0);
    rig.fleet.joined(rig.now, ClientId(9), 0, 0);
    for (force, is_taken) in [(0.0, false), (20_190_226.0, true)] {
        let reboot = MavMessage::COMMAND_LONG(d::COMMAND_LONG_DATA {
            param1: 1.0,
            param6: force,
            command: MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
            target_system: 1,
            target_component: 1,
            ..d::COMMAND_LONG_DATA::default()
        });
        let (mut bytes, mut answers) = (Vec::new(), Vec::new());
        rig.writer.write(&reboot, None, &mut bytes);
        let Rig {
            now,
            fleet,
            environment,
            ..
        } = &mut rig;
        fleet.hear(*now, ClientId(9), &bytes, environment, &mut answers);
        rig.reports.clear();
        rig.pass(0.5);
        assert_eq!(rig.reports.is_empty(), is_taken, "{force}");
    }
    assert!(rig.until(5.0, |rig| {
        rig.texts.iter().any(|text| text.contains("started anew"))
    }));
    rig.reports.clear();
    rig.pass(6.0);
    assert!(rig.reports.len() > 40, "{}", rig.reports.len());
    let last = rig.last();
    let shown = (last.is_armed, last.mode, last.motion);
    assert_eq!(shown, (false, FlightMode::Manual, Motion::Resting));
    assert_eq!(rig.driver.trouble(rig.now), None);
    // Nothing that was said before is said again.
    let at = rig.last().pose.at;
    rig.pass(5.0);
    assert!(rig.last().pose.at.distance_to(at) < 0.1);
}
