//! What an autopilot does, as stories in virtual time.

use std::time::Duration;

use proptest::prelude::*;

use super::super::motion::DriveLimits;
use super::super::noise::Noise;
use super::*;
use crate::autopilot::item::{ItemError, check_items};
use crate::autopilot::{FlightMode, Item};
use crate::geom::Vector;

/// What the vehicles of these tests can do.
pub(super) const LIMITS: DriveLimits = DriveLimits {
    speed_mps: 2.0,
    acceleration_mps2: 1.0,
    braking_mps2: 1.0,
    turn_rate_radps: 1.0,
};

pub(super) fn secs(seconds_s: f64) -> Time {
    Time::from_secs_f64(seconds_s)
}

fn point(x_m: f64, y_m: f64) -> Point {
    Point::new(x_m, y_m)
}

fn sure(sd_m: f64) -> Navigation {
    Navigation::new(Noise::new(1), 1, sd_m, Duration::from_secs(20))
}

fn autopilot(kind: VehicleKind) -> Autopilot {
    Autopilot::new(
        AutopilotSettings::new(kind, LIMITS),
        sure(0.0),
        Point::default(),
        Angle::default(),
    )
    .unwrap()
}

/// Switched on a minute ago, armed, in GUIDED.
fn ready(kind: VehicleKind) -> Autopilot {
    let mut autopilot = autopilot(kind);
    for ask in [
        Command::Mode(FlightMode::Guided),
        Command::Arm { force: false },
    ] {
        assert_eq!(autopilot.command(secs(60.0), ask), CommandAck::Accepted);
    }
    autopilot
}

fn go(x_m: f64, y_m: f64) -> Command {
    Command::Route {
        corners: vec![point(x_m, y_m)],
        altitude_m: None,
        speed_mps: None,
    }
}

/// Lets it go on until nothing more happens by itself but what the battery does; returns when that was.
fn settle(autopilot: &mut Autopilot, from: Time) -> Time {
    let mut now = from;
    while let Some(next) = autopilot
        .next_change()
        .filter(|next| *next < from + Duration::from_secs(900))
    {
        now = next;
        autopilot.advance(now);
    }
    now
}

fn place(autopilot: &Autopilot, at: Time) -> (f64, f64, f64) {
    let truth = autopilot.truth(at);
    (
        truth.at.x_m,
        truth.at.y_m,
        autopilot.motion().altitude_m(at),
    )
}

fn mode_of(autopilot: &Autopilot) -> FlightMode {
    autopilot.report(autopilot.now()).mode
}

fn is_armed(autopilot: &Autopilot) -> bool {
    autopilot.report(autopilot.now()).is_armed
}

fn charge_of(autopilot: &Autopilot) -> f64 {
    autopilot.report(autopilot.now()).battery
}

fn check_near(got: (f64, f64, f64), expected: (f64, f64, f64)) {
    let near = |a: f64, b: f64| (a - b).abs() < 1e-5;
    assert!(
        near(got.0, expected.0) && near(got.1, expected.1) && near(got.2, expected.2),
        "{got:?}, not {expected:?}"
    );
}

fn waypoint(x_m: f64, y_m: f64, altitude_m: f64) -> Item {
    Item::Waypoint {
        at: point(x_m, y_m),
        altitude_m,
        delay: Duration::ZERO,
    }
}

/// Takes a mission in place of the stored one, or tells why it is none.
fn upload(autopilot: &mut Autopilot, now: Time, items: Vec<Item>) -> Result<(), ItemError> {
    let sound = check_items(&items, autopilot.kind());
    let expected = match sound {
        Ok(()) => CommandAck::Accepted,
        Err(_) => CommandAck::Denied,
    };
    assert_eq!(autopilot.command(now, Command::Upload(items)), expected);
    sound
}

fn reached(notices: &[DatedText]) -> Vec<usize> {
    let item = |(_, notice): &DatedText| match notice {
        StatusText::Reached(item) => Some(*item),
        StatusText::Mode(_)
        | StatusText::Armed(_)
        | StatusText::Begun(_)
        | StatusText::MissionDone
        | StatusText::BatteryLow
        | StatusText::BatteryEmpty
        | StatusText::PlaceLost => None,
    };
    notices.iter().filter_map(item).collect()
}

#[test]
fn it_is_armed_after_22_s_and_where_a_place_is_needed_after_42_s() {
    let arms = |now_s: f64, mode: FlightMode| {
        let mut autopilot = autopilot(VehicleKind::Copter);
        let changed = autopilot.command(secs(now_s), Command::Mode(mode));
        (
            changed,
            autopilot.command(secs(now_s), Command::Arm { force: false }),
        )
    };
    use CommandAck::{Accepted, Failed};
    assert_eq!(arms(21.0, FlightMode::Manual).1, Failed);
    assert_eq!(arms(22.0, FlightMode::Manual).1, Accepted);
    assert_eq!(arms(41.0, FlightMode::Guided).0, Failed);
    assert_eq!(arms(42.0, FlightMode::Guided), (Accepted, Accepted));
    assert_eq!(
        arms(60.0, FlightMode::Return),
        (Accepted, Failed),
        "nobody is armed in RTL"
    );
    assert_eq!(arms(60.0, FlightMode::Land), (Accepted, Failed));
    assert_eq!(
        arms(60.0, FlightMode::Hold),
        (Failed, Accepted),
        "no copter has it"
    );
    let mut forced = autopilot(VehicleKind::Copter);
    assert_eq!(
        forced.command(secs(1.0), Command::Arm { force: true }),
        Accepted
    );
}

#[test]
fn who_is_not_armed_or_not_in_guided_goes_nowhere() {
    let mut rover = autopilot(VehicleKind::Rover);
    rover.command(secs(60.0), Command::Mode(FlightMode::Guided));
    assert_eq!(rover.command(secs(60.0), go(5.0, 0.0)), CommandAck::Failed);
    let mut rover = ready(VehicleKind::Rover);
    assert_eq!(
        rover.command(secs(61.0), Command::Mode(FlightMode::Loiter)),
        CommandAck::Accepted
    );
    assert_eq!(rover.command(secs(62.0), go(5.0, 0.0)), CommandAck::Failed);
    assert_eq!(
        ready(VehicleKind::Copter).command(secs(61.0), go(5.0, 0.0)),
        CommandAck::Failed,
        "it has not taken off"
    );
    check_near(place(&rover, secs(90.0)), (0.0, 0.0, 0.0));
}

#[test]
fn what_makes_no_sense_is_denied_and_changes_nothing() {
    let mut rover = ready(VehicleKind::Rover);
    rover.command(secs(60.0), go(50.0, 0.0));
    let ends = rover.next_change();
    let nan = f64::NAN;
    let asks = [
        go(nan, 0.0),
        go(0.0, 1e7),
        Command::Route {
            corners: vec![point(1.0, 0.0)],
            altitude_m: Some(nan),
            speed_mps: None,
        },
        Command::Route {
            corners: vec![point(1.0, 0.0)],
            altitude_m: None,
            speed_mps: Some(0.0),
        },
        Command::Velocity(Vector::new(nan, 0.0)),
        Command::Yaw(Angle::from_radians(nan)),
        Command::Speed(-1.0),
        Command::Servo {
            channel: 0,
            pulse_us: 1500,
        },
        Command::Servo {
            channel: 1,
            pulse_us: 60_000,
        },
        Command::SetHome(point(nan, 0.0)),
        Command::SetCurrent(1),
        Command::Upload(vec![waypoint(0.0, 0.0, 0.0), waypoint(nan, 0.0, 0.0)]),
    ];
    for ask in asks {
        assert_eq!(
            rover.command(secs(61.0), ask.clone()),
            CommandAck::Denied,
            "{ask:?}"
        );
        assert_eq!(rover.next_change(), ends, "{ask:?}");
    }
    let takes_off = rover.command(secs(61.0), Command::Takeoff { altitude_m: 5.0 });
    assert_eq!((takes_off, takes_off.code()), (CommandAck::Unsupported, 3));
    assert_eq!(
        [CommandAck::Accepted, CommandAck::Denied, CommandAck::Failed].map(CommandAck::code),
        [0, 2, 4]
    );
}

#[test]
fn a_mission_that_cannot_be_flown_is_refused_with_its_item_and_the_stored_one_stays() {
    let home = waypoint(0.0, 0.0, 0.0);
    let check = |kind, items: Vec<Item>, expected: Result<(), (u8, &str)>| {
        let mut autopilot = ready(kind);
        upload(
            &mut autopilot,
            secs(60.0),
            vec![home, waypoint(1.0, 0.0, 5.0)],
        )
        .unwrap();
        let got = upload(&mut autopilot, secs(60.0), items.clone());
        assert_eq!(
            got.map_err(|error| (error.code(), error.to_string())),
            expected.map_err(|(code, text)| (code, text.to_owned()))
        );
        assert_eq!(
            autopilot.items().len(),
            if expected.is_ok() { items.len() } else { 2 }
        );
    };
    check(
        VehicleKind::Copter,
        vec![home, Item::Takeoff { altitude_m: 5.0 }],
        Ok(()),
    );
    check(
        VehicleKind::Rover,
        vec![home, Item::Takeoff { altitude_m: 5.0 }],
        Err((3, "item 1 is not for this kind of vehicle")),
    );
    check(
        VehicleKind::Rover,
        vec![home, Item::Land { at: None }],
        Err((3, "item 1 is not for this kind of vehicle")),
    );
    check(
        VehicleKind::Rover,
        vec![home, waypoint(f64::INFINITY, 0.0, 0.0)],
        Err((10, "item 1: x is not finite or too far")),
    );
    check(
        VehicleKind::Rover,
        vec![home, home, waypoint(0.0, 1e9, 0.0)],
        Err((11, "item 2: y is not finite or too far")),
    );
    check(
        VehicleKind::Rover,
        vec![Item::Return],
        Err((5, "item 0: a parameter makes no sense")),
    );
    check(
        VehicleKind::Rover,
        vec![home; 719],
        Err((4, "719 items are more than 718")),
    );
    check(VehicleKind::Rover, vec![home; 718], Ok(()));
}

#[test]
fn a_rover_drives_its_mission_and_holds_after_it() {
    let mut rover = ready(VehicleKind::Rover);
    let items = vec![
        waypoint(0.0, 0.0, 0.0),
        Item::Speed(1.0),
        Item::Waypoint {
            at: point(10.0, 0.0),
            altitude_m: 0.0,
            delay: Duration::from_secs(3),
        },
        Item::Servo {
            channel: 9,
            pulse_us: 1700,
        },
        Item::Delay(Duration::from_secs(2)),
        Item::Yaw(Angle::from_degrees(90.0)),
        waypoint(10.0, 5.0, 0.0),
        Item::Return,
    ];
    upload(&mut rover, secs(60.0), items).unwrap();
    assert_eq!(
        rover.command(secs(60.0), Command::Mode(FlightMode::Auto)),
        CommandAck::Accepted
    );
    // 10 m at 1 m/s: 11 s by its trapezoid; then 3 s and 2 s of standing, and 1.57 s for the turn.
    rover.advance(secs(70.9));
    assert_eq!(
        (
            rover.report(secs(70.9)).item,
            rover.report(secs(70.9)).servos.len()
        ),
        (2, 0)
    );
    rover.advance(secs(74.5));
    let report = rover.report(secs(74.5));
    assert_eq!(
        (
            report.item,
            report.servos.get(&9).copied(),
            report.speed_mps
        ),
        (4, Some(1700), 0.0)
    );
    check_near(place(&rover, secs(74.5)), (10.0, 0.0, 0.0));
    rover.advance(secs(77.58));
    assert_eq!(rover.report(secs(77.58)).item, 6, "the turn is done");
    let end = settle(&mut rover, secs(77.58));
    assert_eq!(
        (mode_of(&rover), is_armed(&rover)),
        (FlightMode::Hold, true)
    );
    check_near(place(&rover, end), (0.0, 0.0, 0.0));
    let notices = rover.status_texts();
    assert_eq!(reached(&notices), [2, 4, 5, 6, 7]);
    assert!(
        notices.contains(&(end, StatusText::MissionDone)),
        "{notices:?}"
    );
    assert!(rover.status_texts().is_empty(), "said once");
}

#[test]
fn a_copter_flies_its_mission_lands_and_is_disarmed() {
    let mut copter = ready(VehicleKind::Copter);
    let items = vec![
        waypoint(0.0, 0.0, 0.0),
        Item::Takeoff { altitude_m: 5.0 },
        waypoint(8.0, 0.0, 5.0),
        Item::Loiter {
            at: point(8.0, 6.0),
            altitude_m: 3.0,
            time: Duration::from_secs(4),
        },
        Item::Land {
            at: Some(point(0.0, 6.0)),
        },
    ];
    upload(&mut copter, secs(60.0), items).unwrap();
    assert_eq!(
        copter.command(secs(60.0), Command::Begin),
        CommandAck::Accepted
    );
    copter.advance(secs(61.0));
    check_near(place(&copter, secs(61.0)), (0.0, 0.0, 2.5));
    assert_eq!(copter.report(secs(61.0)).climb_mps, 2.5);
    let end = settle(&mut copter, secs(61.0));
    check_near(place(&copter, end), (0.0, 6.0, 0.0));
    assert!(!is_armed(&copter) && copter.report(end).is_landed);
    assert_eq!(reached(&copter.status_texts()), [1, 2, 3, 4]);
    // The way: 2 s up; 8 m in 6 s; 90° in 1.57 s, 6 m in 5 s, 2 m down at 1.5 m/s, 4 s; 90°, 8 m, 3 m down at 0.5 m/s.
    let turn_s = std::f64::consts::FRAC_PI_2;
    let expected_s = 2.0 + 6.0 + (turn_s + 5.0 + 2.0 / 1.5 + 4.0) + (turn_s + 6.0 + 6.0);
    assert!(
        (end.as_secs_f64() - 60.0 - expected_s).abs() < 0.01,
        "{end}"
    );
}

#[test]
fn on_the_ground_a_copters_mission_begins_with_a_takeoff_or_not_at_all() {
    let mut copter = ready(VehicleKind::Copter);
    assert_eq!(
        copter.command(secs(60.0), Command::Mode(FlightMode::Auto)),
        CommandAck::Failed,
        "there is none"
    );
    upload(
        &mut copter,
        secs(60.0),
        vec![waypoint(0.0, 0.0, 0.0), waypoint(5.0, 0.0, 5.0)],
    )
    .unwrap();
    assert_eq!(
        copter.command(secs(60.0), Command::Mode(FlightMode::Auto)),
        CommandAck::Failed
    );
    assert_eq!(
        copter.command(secs(60.0), Command::Begin),
        CommandAck::Failed
    );
    copter.command(secs(60.0), Command::Takeoff { altitude_m: 2.0 });
    assert_eq!(
        copter.command(secs(62.0), Command::Mode(FlightMode::Auto)),
        CommandAck::Accepted
    );
    let end = settle(&mut copter, secs(62.0));
    check_near(place(&copter, end), (5.0, 0.0, 5.0));
    assert_eq!(
        (mode_of(&copter), is_armed(&copter)),
        (FlightMode::Auto, true),
        "it hovers after its mission"
    );
}

#[test]
fn a_mission_is_interrupted_and_goes_on_with_the_item_under_way() {
    let mut rover = ready(VehicleKind::Rover);
    let items = vec![
        waypoint(0.0, 0.0, 0.0),
        waypoint(10.0, 0.0, 0.0),
        waypoint(10.0, 10.0, 0.0),
    ];
    upload(&mut rover, secs(60.0), items).unwrap();
    rover.command(secs(60.0), Command::Mode(FlightMode::Auto));
    assert_eq!(
        rover.command(secs(69.0), Command::Mode(FlightMode::Hold)),
        CommandAck::Accepted
    );
    let stood = settle(&mut rover, secs(69.0));
    assert_eq!(rover.report(stood).item, 2);
    let before = place(&rover, stood);
    assert_eq!(before, place(&rover, secs(500.0)), "it stays");
    rover.command(secs(500.0), Command::Mode(FlightMode::Auto));
    let end = settle(&mut rover, secs(500.0));
    check_near(place(&rover, end), (10.0, 10.0, 0.0));
    assert_eq!(reached(&rover.status_texts()), [1, 2]);
}

#[test]
fn setting_the_current_item_to_one_that_takes_no_time_goes_on_to_the_next_that_does() {
    let mut rover = ready(VehicleKind::Rover);
    let items = vec![
        waypoint(0.0, 0.0, 0.0),
        waypoint(10.0, 0.0, 0.0),
        Item::Speed(0.5),
        waypoint(0.0, 4.0, 0.0),
    ];
    upload(&mut rover, secs(60.0), items).unwrap();
    rover.command(secs(60.0), Command::Mode(FlightMode::Auto));
    assert_eq!(
        rover.command(secs(60.5), Command::SetCurrent(4)),
        CommandAck::Denied
    );
    assert_eq!(
        rover.command(secs(61.0), Command::SetCurrent(2)),
        CommandAck::Accepted
    );
    assert_eq!(rover.report(secs(61.0)).item, 3);
    let end = settle(&mut rover, secs(61.0));
    check_near(place(&rover, end), (0.0, 4.0, 0.0));
}

#[test]
fn a_copter_returns_at_its_altitude_of_return_and_lands_at_home() {
    let mut copter = ready(VehicleKind::Copter);
    copter.command(secs(60.0), Command::Takeoff { altitude_m: 3.0 });
    copter.command(secs(62.0), go(20.0, 0.0));
    let there = settle(&mut copter, secs(62.0));
    assert_eq!(
        copter.command(there, Command::Mode(FlightMode::Return)),
        CommandAck::Accepted
    );
    let (mut highest_m, mut now) = (0.0f64, there);
    while is_armed(&copter) {
        now = now + Duration::from_millis(100);
        copter.advance(now);
        highest_m = highest_m.max(copter.motion().altitude_m(now));
        assert!(now < there + Duration::from_secs(120));
    }
    assert!((highest_m - 15.0).abs() < 1e-9);
    check_near(place(&copter, now), (0.0, 0.0, 0.0));
}

#[test]
fn a_rover_returns_straight_and_stays() {
    let mut rover = ready(VehicleKind::Rover);
    rover.command(secs(60.0), go(6.0, 8.0));
    let there = settle(&mut rover, secs(60.0));
    rover.command(there, Command::Mode(FlightMode::Return));
    let end = settle(&mut rover, there);
    check_near(place(&rover, end), (0.0, 0.0, 0.0));
    assert_eq!(
        (mode_of(&rover), is_armed(&rover)),
        (FlightMode::Return, true)
    );
}

#[test]
fn in_the_air_nobody_is_disarmed_but_by_force_and_landing_disarms() {
    let mut copter = ready(VehicleKind::Copter);
    copter.command(secs(60.0), Command::Takeoff { altitude_m: 12.0 });
    let up = settle(&mut copter, secs(60.0));
    assert_eq!(
        copter.command(up, Command::Disarm { force: false }),
        CommandAck::Failed
    );
    assert_eq!(copter.report(up).status, SystemStatus::Active);
    copter.command(up, Command::Mode(FlightMode::Land));
    // 2 m at 1.5 m/s, then 10 m at 0.5 m/s.
    let end = settle(&mut copter, up);
    assert!((end.since(up).as_secs_f64() - 2.0 / 1.5 - 20.0).abs() < 1e-6);
    assert!(!is_armed(&copter));
}

#[test]
fn an_armed_copter_that_does_not_take_off_is_disarmed_and_a_rover_is_not() {
    let mut copter = ready(VehicleKind::Copter);
    assert_eq!(
        copter.report(secs(60.0)).status,
        SystemStatus::Standby,
        "armed on the ground"
    );
    copter.advance(secs(69.9));
    assert!(is_armed(&copter));
    copter.advance(secs(70.1));
    assert!(!is_armed(&copter));
    let mut rover = ready(VehicleKind::Rover);
    rover.advance(secs(500.0));
    assert!(is_armed(&rover));
    assert_eq!(rover.report(secs(500.0)).status, SystemStatus::Active);
}

#[test]
fn a_velocity_holds_for_three_seconds_and_then_it_brakes() {
    let mut rover = ready(VehicleKind::Rover);
    let ahead = || Command::Velocity(Vector::new(1.0, 0.0));
    rover.command(secs(60.0), ahead());
    rover.advance(secs(62.9));
    assert!((rover.truth(secs(62.9)).speed_mps - 1.0).abs() < 1e-6);
    let end = settle(&mut rover, secs(62.9));
    assert!((end.as_secs_f64() - 64.5).abs() < 1e-6, "{end}");
    for second in 100..120 {
        rover.command(secs(f64::from(second)), ahead());
        assert!(second == 100 || rover.truth(secs(f64::from(second))).speed_mps > 0.99);
    }
}

#[test]
fn the_battery_lasts_as_long_as_it_should_and_what_follows_is_a_choice() {
    let drive = |on_low_battery: LowBattery| {
        let endurance_driving = Duration::from_secs(100);
        let settings = AutopilotSettings {
            on_low_battery,
            endurance_driving,
            ..AutopilotSettings::new(VehicleKind::Rover, LIMITS)
        };
        let mut rover = Autopilot::new(settings, sure(0.0), Point::default(), Angle::default())
            .unwrap()
            .under_way(0.0);
        rover.command(secs(50.0), go(1000.0, 0.0));
        rover.advance(secs(60.0));
        rover.status_texts();
        (charge_of(&rover), rover)
    };
    // 50 s of rest at 36,000 s, then 10 s of driving at 100 s.
    let (left, mut rover) = drive(LowBattery::Warn);
    assert!(
        (left - (1.0 - 50.0 / 36_000.0 - 0.1)).abs() < 1e-9,
        "{left}"
    );
    rover.advance(secs(149.0));
    let [(low, StatusText::BatteryLow)] = rover.status_texts()[..] else {
        panic!("it is low")
    };
    assert!(
        (low.as_secs_f64() - (50.0 + 100.0 * (0.8 - 50.0 / 36_000.0))).abs() < 1e-6,
        "{low}"
    );
    assert!(rover.truth(secs(149.0)).speed_mps > 1.9, "it drives on");
    rover.advance(secs(200.0));
    assert_eq!((is_armed(&rover), charge_of(&rover)), (false, 0.0));
    assert_eq!(rover.truth(secs(200.0)).speed_mps, 0.0);
    assert_eq!(
        rover.command(secs(201.0), Command::Arm { force: true }),
        CommandAck::Failed
    );
    for (choice, mode) in [
        (LowBattery::Return, FlightMode::Return),
        (LowBattery::Land, FlightMode::Hold),
    ] {
        let (_, mut rover) = drive(choice);
        rover.advance(secs(131.0));
        assert_eq!(
            (mode_of(&rover), rover.report(secs(131.0)).status),
            (mode, SystemStatus::Critical)
        );
    }
}

#[test]
fn who_hears_no_satellites_for_long_stands_or_lands() {
    for (kind, mode) in [
        (VehicleKind::Rover, FlightMode::Hold),
        (VehicleKind::Copter, FlightMode::Land),
    ] {
        let outage = Outage {
            from: secs(100.0),
            until: secs(200.0),
        };
        let navigation = sure(0.1).with_outages(vec![outage], 0.1);
        let settings = AutopilotSettings {
            place_sd_max_m: 2.1,
            ..AutopilotSettings::new(kind, LIMITS)
        };
        let mut autopilot =
            Autopilot::new(settings, navigation, Point::default(), Angle::default())
                .unwrap()
                .under_way(5.0);
        autopilot.command(secs(90.0), go(500.0, 0.0));
        autopilot.advance(secs(119.9));
        assert_eq!(mode_of(&autopilot), FlightMode::Guided);
        assert!((autopilot.report(secs(119.9)).pose.sd_m - 2.09).abs() < 1e-9);
        autopilot.advance(secs(121.0));
        assert_eq!(
            (mode_of(&autopilot), autopilot.report(secs(121.0)).status),
            (mode, SystemStatus::Critical)
        );
        assert_eq!(
            autopilot.command(secs(150.0), Command::Mode(FlightMode::Guided)),
            CommandAck::Failed
        );
        assert_eq!(
            autopilot.command(secs(200.0), Command::Mode(FlightMode::Guided)),
            CommandAck::Accepted,
            "heard again"
        );
    }
}

#[test]
fn a_copter_is_carried_by_the_wind_and_leans_into_it() {
    let settings = AutopilotSettings {
        wind: Vector::new(0.0, -4.0),
        ..AutopilotSettings::new(VehicleKind::Copter, LIMITS)
    };
    let mut copter = Autopilot::new(settings, sure(0.0), Point::default(), Angle::default())
        .unwrap()
        .under_way(5.0);
    copter.command(secs(1.0), go(20.0, 0.0));
    let end = settle(&mut copter, secs(1.0));
    // Where the wind blows to, beside the place that it was sent to.
    let truth = copter.truth(end);
    assert!(
        (truth.at.x_m - 20.0).abs() < 1e-9 && (truth.at.y_m + 0.2).abs() < 1e-9,
        "{truth:?}"
    );
    assert!(
        (copter.report(end).pose.at.y_m + 0.2).abs() < 1e-9,
        "it knows that it is not there"
    );
    // It faces nearly east, and the wind comes from the left: the left side is low.
    let still = copter.attitude(end);
    assert!(
        (still.roll.radians() + libm::atan(4.0 * 0.3 / 9.80665)).abs() < 1e-3,
        "{still:?}"
    );
    let flying = copter.attitude(secs(6.0));
    assert!(
        flying.pitch.radians() < -0.04,
        "nose down against its own speed: {flying:?}"
    );
    assert_eq!(
        ready(VehicleKind::Rover).attitude(secs(60.0)).roll,
        Angle::ZERO
    );
}

#[test]
fn uploading_and_clearing_stop_a_mission_under_way() {
    let items = vec![waypoint(0.0, 0.0, 0.0), waypoint(50.0, 0.0, 0.0)];
    for ask in [Command::Clear, Command::Upload(items.clone())] {
        let mut rover = ready(VehicleKind::Rover);
        upload(&mut rover, secs(60.0), items.clone()).unwrap();
        rover.command(secs(60.0), Command::Begin);
        assert_eq!(rover.command(secs(65.0), ask), CommandAck::Accepted);
        let end = settle(&mut rover, secs(65.0));
        assert!(rover.truth(end).at.x_m < 15.0 && rover.motion().is_at_rest(end));
    }
}

fn asks() -> impl Strategy<Value = Vec<(f64, Command)>> {
    let place = || (-20.0..20.0f64, -20.0..20.0f64).prop_map(|(x_m, y_m)| point(x_m, y_m));
    let items = vec![
        waypoint(0.0, 0.0, 0.0),
        Item::Takeoff { altitude_m: 4.0 },
        waypoint(5.0, 5.0, 6.0),
        Item::Speed(0.7),
        Item::Yaw(Angle::from_degrees(10.0)),
        Item::Delay(Duration::from_secs(3)),
        Item::Return,
    ];
    let modes = [
        FlightMode::Manual,
        FlightMode::Loiter,
        FlightMode::Guided,
        FlightMode::Auto,
        FlightMode::Return,
        FlightMode::Land,
    ];
    let ask = prop_oneof![
        3 => (place(), prop::option::of(0.5..9.0f64))
            .prop_map(|(at, altitude_m)| Command::Route { corners: vec![at], altitude_m, speed_mps: None }),
        3 => prop::sample::select(modes.to_vec()).prop_map(Command::Mode),
        1 => Just(Command::Stop),
        1 => Just(Command::Begin),
        1 => Just(Command::Upload(items)),
        1 => (0usize..8).prop_map(Command::SetCurrent),
        2 => Just(Command::Arm { force: false }),
        1 => any::<bool>().prop_map(|force| Command::Disarm { force }),
        1 => Just(Command::Takeoff { altitude_m: 3.0 }),
        1 => (-2.0..2.0f64, -2.0..2.0f64).prop_map(|(x, y)| Command::Velocity(Vector::new(x, y))),
        1 => (-3.0..3.0f64).prop_map(|rad| Command::Yaw(Angle::from_radians(rad))),
    ];
    prop::collection::vec((0.0..12.0f64, ask), 1..14)
}

proptest! {
    #[test]
    fn it_does_the_same_whether_it_is_looked_at_often_or_seldom(asks in asks(), sd_m in 0.0..0.3f64) {
        let settings = AutopilotSettings {
            endurance_driving: Duration::from_secs(90),
            on_low_battery: LowBattery::Return,
            ..AutopilotSettings::new(VehicleKind::Copter, LIMITS)
        };
        let seldom = Autopilot::new(settings, sure(sd_m), Point::default(), Angle::default()).unwrap();
        let (mut seldom, mut often) = (seldom.clone(), seldom);
        let mut now = secs(50.0);
        for (wait_s, ask) in asks {
            let until = now + Duration::from_secs_f64(wait_s);
            while now < until {
                now = (now + Duration::from_millis(70)).min(until);
                often.advance(now);
            }
            prop_assert_eq!(seldom.command(now, ask.clone()), often.command(now, ask));
            let (a, b) = (seldom.report(now), often.report(now));
            prop_assert!(a.pose.at.distance_to(b.pose.at) < 1e-5 && (a.altitude_m - b.altitude_m).abs() < 1e-5);
            prop_assert!((a.battery - b.battery).abs() < 1e-9);
            prop_assert_eq!((a.mode, a.is_armed, a.item, a.home.is_some()), (b.mode, b.is_armed, b.item, b.home.is_some()));
            let output = |autopilot: &mut Autopilot| -> Vec<StatusText> {
                autopilot.status_texts().into_iter().map(|(_, notice)| notice).collect()
            };
            prop_assert_eq!(output(&mut seldom), output(&mut often));
        }
    }

    #[test]
    fn it_never_jumps_nor_goes_below_the_ground(asks in asks()) {
        let settings = AutopilotSettings::new(VehicleKind::Copter, LIMITS);
        let mut copter = Autopilot::new(settings, sure(0.0), Point::default(), Angle::default()).unwrap();
        let mut now = secs(50.0);
        let mut before = place(&copter, now);
        for (wait_s, ask) in asks {
            copter.command(now, ask);
            let until = now + Duration::from_secs_f64(wait_s);
            while now < until {
                now = now + Duration::from_millis(20);
                copter.advance(now);
                let here = place(&copter, now);
                let way_m = (here.0 - before.0).hypot(here.1 - before.1);
                prop_assert!(way_m <= 2.0 * 0.02 + 1e-6, "{} m at {}", way_m, now);
                prop_assert!((here.2 - before.2).abs() <= 2.5 * 0.02 + 1e-6, "at {}", now);
                prop_assert!(here.2 >= 0.0);
                before = here;
            }
        }
    }
}
