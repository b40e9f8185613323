//! What the environment promises to its callers, whoever they are.

use tomoswarm_proto::{BodyKind, Boot};

use super::*;
use crate::autopilot::{ArmRefusal, FlightMode, Item, VehicleKind};
use crate::config::{FaultKind, FaultSpec};
use crate::geom::Point;
use crate::plan::{Mount, Mounts};
use crate::sim::world::tests::{drive, secs, stage, world};

const ONE: VehicleId = VehicleId(1);

/// Rovers at places on the x axis that face along it, their software running, with posts of 0.5 m radius ahead (their x,
/// and their two ends).
fn environment(posts: &[(f64, f64, f64)], places_m: &[f64], faults: Vec<FaultSpec>) -> Environment {
    let world = world(VehicleKind::Rover, 0.0, posts, places_m);
    begun(world, faults)
}

fn begun(world: World, faults: Vec<FaultSpec>) -> Environment {
    let mut environment = Environment::new(world, Noise::new(1), Faults::new(faults), None);
    environment.begin(&mut Vec::new());
    (0..environment.world().vehicles()).for_each(|vehicle| environment.attach(Time::ZERO, vehicle));
    environment
}

fn fault(kind: FaultKind, from_s: f64, until_s: f64) -> FaultSpec {
    FaultSpec {
        from: secs(from_s),
        until: secs(until_s),
        kind,
        vehicles: vec![ONE],
        ground: false,
    }
}

fn beacon(sender: u8, sequence: u32) -> DeviceCommand {
    let (sender, boot) = (VehicleId(sender), Boot(1));
    let pose = Some(Default::default());
    DeviceCommand::Transmit(Beacon {
        sender,
        boot,
        sequence,
        pose,
        channel: 15,
        ..Beacon::default()
    })
}

/// A command to the autopilot of which nobody awaits the answer.
fn to_device(command: Command) -> DeviceCommand {
    DeviceCommand::Autopilot(NumberedCommand { number: 0, command })
}

fn ping(number: u64) -> DeviceCommand {
    DeviceCommand::Ping(Ping { number })
}

/// Tells a device something; returns what comes back at once.
fn obey(
    environment: &mut Environment,
    now_s: f64,
    vehicle: usize,
    command: DeviceCommand,
) -> Vec<WorldEvent> {
    let mut output = Vec::new();
    environment.obey(secs(now_s), vehicle, command, &mut output);
    let is_answer = |event: &WorldEvent| {
        matches!(
            event,
            WorldEvent::Ack {
                ack: Ack { number: 0, .. },
                ..
            }
        )
    };
    output.retain(|event| !matches!(event, WorldEvent::Scheduled(_)) && !is_answer(event));
    output
}

/// Lets everything happen up to a moment, event by event.
fn wake(environment: &mut Environment, to_s: f64) -> Vec<WorldEvent> {
    let (mut output, to) = (Vec::new(), secs(to_s));
    while let Some(due) = environment.deadline().filter(|due| due.at <= to) {
        environment.wake(due.at, &mut output);
        assert!(
            environment.deadline().is_none_or(|next| next.at > due.at),
            "after a wake the deadline is later"
        );
    }
    environment.wake(to, &mut output);
    output
}

/// What was measured, and by whom.
fn echoes(output: &[WorldEvent]) -> Vec<(usize, Option<f64>)> {
    let of = |event: &WorldEvent| match event {
        WorldEvent::Echo { vehicle, echo } => Some((*vehicle, echo.range_m)),
        _other => None,
    };
    output.iter().filter_map(of).collect()
}

/// Who heard something.
fn hearers(output: &[WorldEvent]) -> Vec<usize> {
    let of = |event: &WorldEvent| match event {
        WorldEvent::Heard { receivers, .. } => receivers.iter().map(|(to, _)| *to).collect(),
        _other => Vec::new(),
    };
    output.iter().flat_map(of).collect()
}

fn contacts(output: &[WorldEvent]) -> usize {
    output
        .iter()
        .filter(|event| matches!(event, WorldEvent::Contact(_)))
        .count()
}

#[test]
fn a_ping_before_the_servo_has_turned_hears_what_it_passes() {
    // 60° in 0.6 s; ahead stands a post, to the left nothing.
    let servo = Mount {
        zero: Angle::ZERO,
        from_rad: -1.6,
        to_rad: 1.6,
        slew_s_per_rad: 0.6 / 60f64.to_radians(),
    };
    let world = world(VehicleKind::Rover, 0.0, &[(2.5, 0.0, 1.0)], &[0.0])
        .with_mounts(Mounts::new(vec![servo]));
    let mut environment = begun(world, Vec::new());
    let hears = |environment: &mut Environment, now_s: f64| {
        let heard = echoes(&wake(environment, now_s + 0.09));
        let [(0, range_m)] = heard[..] else {
            panic!("{heard:?}")
        };
        range_m.is_some()
    };
    obey(&mut environment, 1.0, 0, ping(1));
    obey(
        &mut environment,
        1.0,
        0,
        DeviceCommand::Steer(Angle::from_degrees(90.0)),
    );
    assert!(hears(&mut environment, 1.0), "it begins at its zero");
    for (now_s, is_heard) in [(1.1, true), (1.5, false), (2.0, false)] {
        obey(&mut environment, now_s, 0, ping(1));
        assert_eq!(hears(&mut environment, now_s), is_heard, "after {now_s} s");
    }
}

/// Plays a drive against a post, a ping, a beacon and a fault of a battery, either waking the environment at its deadlines
/// or at what it has scheduled; returns what it says.
fn play(by_schedule: bool) -> Vec<WorldEvent> {
    let world = world(VehicleKind::Rover, 0.0, &[(1.5, 0.0, 1.0)], &[0.0, -3.0]);
    let charge = Faults::new(vec![fault(FaultKind::Battery(0.5), 2.0, 3.0)]);
    let mut environment = Environment::new(world, Noise::new(1), charge, None);
    let (mut output, mut fresh, mut scheduled) = (Vec::new(), Vec::new(), Vec::new());
    (0..2).for_each(|vehicle| environment.attach(Time::ZERO, vehicle));
    environment.begin(&mut fresh);
    for (vehicle, command) in [(0, to_device(drive(9.0))), (0, ping(1)), (1, beacon(2, 1))] {
        environment.obey(Time::ZERO, vehicle, command, &mut fresh);
    }
    loop {
        for event in fresh.drain(..) {
            if let WorldEvent::Scheduled(at) = event {
                scheduled.push(at)
            } else {
                output.push(event)
            }
        }
        scheduled.sort();
        let due = environment.deadline().map(|due| due.at);
        let next = if by_schedule {
            (!scheduled.is_empty()).then(|| scheduled.remove(0))
        } else {
            due
        };
        let Some(at) = next.filter(|at| *at <= secs(8.0)) else {
            return output;
        };
        environment.wake(at, &mut fresh);
    }
}

#[test]
fn woken_at_what_it_scheduled_it_says_the_same_as_woken_at_its_deadlines() {
    let output = play(false);
    assert_eq!(play(true), output);
    assert_eq!(
        (
            echoes(&output).len(),
            hearers(&output).len(),
            contacts(&output)
        ),
        (1, 1, 1)
    );
    assert!(output.contains(&WorldEvent::Charged {
        vehicle: 0,
        charge: 0.5
    }));
}

#[test]
fn a_blind_sensor_and_a_dead_radio_are_silent_and_only_for_as_long_as_they_are() {
    let faults = vec![
        fault(FaultKind::Sensor, 1.0, 2.0),
        fault(FaultKind::Radio, 1.0, 2.0),
    ];
    let mut environment = environment(&[(3.0, 0.0, 1.0)], &[0.0, -3.0], faults);
    let mut at = |now_s: f64| {
        obey(&mut environment, now_s, 0, ping(1));
        obey(&mut environment, now_s, 0, beacon(1, 1));
        let mut output = wake(&mut environment, now_s + 0.1);
        obey(&mut environment, now_s + 0.1, 1, beacon(2, 1));
        output.extend(wake(&mut environment, now_s + 0.4));
        (echoes(&output).len(), hearers(&output))
    };
    assert_eq!(at(0.5), (1, vec![1, 0]));
    assert_eq!(at(1.0), (0, vec![]), "neither heard nor hears");
    assert_eq!(at(2.0), (1, vec![1, 0]));
}

#[test]
fn devices_tell_what_they_have_done_since_their_software_started() {
    let faults = vec![fault(FaultKind::Sensor, 1.0, 5.0)];
    let mut environment = environment(&[(3.0, 0.0, 1.0)], &[0.0], faults);
    let ask = |environment: &mut Environment, time_s: f64| {
        obey(environment, time_s, 0, ping(1));
        environment.facts(0)
    };
    for sequence in 1..=2 {
        // The second comes while the radio is speaking.
        obey(&mut environment, 0.0, 0, beacon(1, sequence));
    }
    let facts = ask(&mut environment, 0.5);
    let radio = facts.radio.unwrap();
    assert_eq!((radio.sent, radio.unsent), (1, 1));
    let body = facts.autopilot.unwrap().body;
    assert_eq!((facts.range.unwrap().faults, body), (0, BodyKind::Rover));
    wake(&mut environment, 0.9);
    assert_eq!(ask(&mut environment, 1.0).troubles, [""; 0]);
    let facts = ask(&mut environment, 4.0);
    assert_eq!(facts.troubles, [""; 0], "3 s are none yet");
    let facts = ask(&mut environment, 4.5);
    assert_eq!(facts.troubles, ["range sensor: it answers nothing"]);
    assert_eq!(
        facts.range.unwrap().faults,
        2,
        "the last is still waited for"
    );
    ask(&mut environment, 6.0);
    wake(&mut environment, 6.5);
    assert_eq!(environment.facts(0).troubles, [""; 0], "it answers again");
    environment.attach(secs(7.0), 0);
    let facts = environment.facts(0);
    assert_eq!(
        (facts.radio.unwrap().sent, facts.range.unwrap().faults),
        (0, 0)
    );
}

#[test]
fn a_long_sleep_is_not_made_up_for() {
    let mut environment = environment(&[], &[0.0], Vec::new());
    let mut output = Vec::new();
    environment.wake(secs(0.1), &mut output);
    output.clear();
    environment.wake(secs(20.1), &mut output);
    let reports = output
        .iter()
        .filter(|event| matches!(event, WorldEvent::Report { .. }))
        .count();
    assert!(reports <= 2, "{reports}");
    assert!(environment.deadline().unwrap().at > secs(20.1));
}

#[test]
fn a_contact_that_a_newer_command_prevents_does_not_come() {
    let mut environment = environment(&[(5.0, 0.0, 1.0)], &[0.0], Vec::new());
    obey(&mut environment, 0.0, 0, to_device(drive(9.0)));
    let output = wake(&mut environment, 1.5);
    obey(&mut environment, 1.5, 0, to_device(Command::Stop));
    assert_eq!(
        contacts(&output) + contacts(&wake(&mut environment, 20.0)),
        0
    );
    assert!(
        environment
            .world()
            .truth(0, secs(20.0))
            .at
            .distance_to(Point::new(0.0, 0.0))
            > 0.5
    );
}

#[test]
fn a_sensor_that_measures_is_not_asked_twice() {
    let mut environment = environment(&[(3.0, 0.0, 1.0)], &[0.0], Vec::new());
    (1..=5).for_each(|number| assert_eq!(obey(&mut environment, 0.0, 0, ping(number)), []));
    assert_eq!(echoes(&wake(&mut environment, 0.5)).len(), 1);
    assert_eq!(
        (environment.counts().scans, environment.counts().dropped),
        (1, 4)
    );
    obey(&mut environment, 0.5, 0, ping(6));
    assert_eq!(
        echoes(&wake(&mut environment, 1.0)).len(),
        1,
        "it is free again"
    );
}

#[test]
fn a_beacon_while_the_radio_speaks_comes_back_and_the_first_one_is_heard() {
    let mut environment = environment(&[], &[0.0, -3.0], Vec::new());
    assert_eq!(obey(&mut environment, 0.0, 0, beacon(1, 7)), []);
    let unsent = WorldEvent::Unsent {
        vehicle: 0,
        sequence: 8,
    };
    assert_eq!(obey(&mut environment, 0.0, 0, beacon(1, 8)), [unsent]);
    assert_eq!(hearers(&wake(&mut environment, 0.1)), [1]);
    assert_eq!(obey(&mut environment, 0.1, 0, beacon(1, 8)), []);
    assert_eq!(hearers(&wake(&mut environment, 0.2)), [1]);
}

#[test]
fn a_beacon_in_anothers_name_or_for_no_frame_comes_back_and_nobody_hears_it() {
    let mut environment = environment(&[], &[0.0, -3.0], Vec::new());
    let unsent = [WorldEvent::Unsent {
        vehicle: 0,
        sequence: 3,
    }];
    assert_eq!(obey(&mut environment, 0.0, 0, beacon(2, 3)), unsent);
    let DeviceCommand::Transmit(mut long) = beacon(1, 3) else {
        panic!("a beacon")
    };
    long.members = vec![VehicleId(1); 300_000];
    assert_eq!(
        obey(&mut environment, 0.0, 0, DeviceCommand::Transmit(long)),
        unsent
    );
    assert!(hearers(&wake(&mut environment, 0.1)).is_empty());
}

#[test]
fn a_dead_radio_does_not_say_that_it_has_not_sent() {
    let mut environment = environment(&[], &[0.0, -3.0], vec![fault(FaultKind::Radio, 0.0, 1.0)]);
    (1..=2)
        .for_each(|sequence| assert_eq!(obey(&mut environment, 0.0, 0, beacon(1, sequence)), []));
    assert!(hearers(&wake(&mut environment, 0.5)).is_empty());
}

#[test]
fn an_autopilot_brakes_two_seconds_after_the_last_word_of_its_companion() {
    for leaves in [false, true] {
        let mut environment = environment(&[], &[0.0], Vec::new());
        obey(&mut environment, 0.0, 0, to_device(drive(90.0)));
        wake(&mut environment, 3.0);
        let stood_m = environment.world().truth(0, secs(9.0)).at.x_m;
        // 1 m in 2 s, and 0.5 m to brake.
        assert!(
            (stood_m - 1.5).abs() < 0.02,
            "a word at the beginning is not enough: {stood_m}"
        );
        obey(&mut environment, 9.0, 0, to_device(drive(90.0)));
        for half in 1..20 {
            wake(&mut environment, 9.0 + 0.5 * f64::from(half));
            obey(&mut environment, 9.0 + 0.5 * f64::from(half), 0, ping(1));
        }
        assert_eq!(
            environment.world().truth(0, secs(18.5)).speed_mps,
            1.0,
            "any word keeps it driving"
        );
        if leaves {
            environment.detach(secs(18.5), 0);
        }
        wake(&mut environment, 20.4);
        assert_eq!(environment.world().truth(0, secs(20.4)).speed_mps, 1.0);
        wake(&mut environment, 22.0);
        assert_eq!(environment.world().truth(0, secs(22.0)).speed_mps, 0.0);
    }
}

fn reports(output: &[WorldEvent]) -> Vec<AutopilotReport> {
    let of = |event: &WorldEvent| match event {
        WorldEvent::Report { report, .. } => Some(*report),
        _other => None,
    };
    output.iter().filter_map(of).collect()
}

#[test]
fn modes_and_arming_show_as_late_as_a_heartbeat_and_places_do_not() {
    let mut environment = environment(&[], &[0.0], Vec::new());
    wake(&mut environment, 1.45);
    obey(
        &mut environment,
        1.45,
        0,
        to_device(Command::Mode(FlightMode::Hold)),
    );
    obey(
        &mut environment,
        1.45,
        0,
        to_device(Command::Disarm { force: false }),
    );
    let output = reports(&wake(&mut environment, 3.0));
    let shown = |report: &&AutopilotReport| report.mode == FlightMode::Hold && !report.is_armed;
    let old = output
        .iter()
        .filter(|report| report.mode == FlightMode::Guided && report.is_armed)
        .count();
    assert_eq!(
        old + output.iter().filter(shown).count(),
        output.len(),
        "both come with one heartbeat"
    );
    assert!((1..10).contains(&old), "{old} of {}", output.len());
    environment.detach(secs(3.0), 0);
    obey(
        &mut environment,
        3.0,
        0,
        to_device(Command::Mode(FlightMode::Guided)),
    );
    environment.attach(secs(3.0), 0);
    assert_eq!(
        reports(&wake(&mut environment, 3.1))[0].mode,
        FlightMode::Guided,
        "who joins hears one at once"
    );
}

#[test]
fn an_autopilot_answers_by_the_number_and_says_why_it_does_not_arm() {
    let battery = vec![fault(FaultKind::Battery(0.0), 0.5, 1.0)];
    let mut environment = environment(&[], &[0.0], battery);
    let mut answer = |now_s: f64, number: u32, command: Command| {
        wake(&mut environment, now_s);
        let numbered = DeviceCommand::Autopilot(NumberedCommand { number, command });
        match obey(&mut environment, now_s, 0, numbered)[..] {
            [WorldEvent::Ack { vehicle: 0, ack }] => ack,
            ref other => panic!("{other:?}"),
        }
    };
    let accepted = Ack {
        number: 4,
        result: CommandAck::Accepted,
        arm_refusal: None,
    };
    assert_eq!(answer(0.1, 4, drive(1.0)), accepted);
    let arm = Command::Arm { force: false };
    let refused = Ack {
        number: 5,
        result: CommandAck::Failed,
        arm_refusal: Some(ArmRefusal::BatteryEmpty),
    };
    assert_eq!(answer(1.0, 5, arm), refused);
}

#[test]
fn software_that_does_not_run_is_told_nothing() {
    let mut environment = environment(&[(3.0, 0.0, 1.0)], &[0.0, -3.0], Vec::new());
    obey(&mut environment, 0.0, 0, ping(1));
    obey(&mut environment, 0.0, 1, beacon(2, 1));
    environment.detach(Time::ZERO, 0);
    let output = wake(&mut environment, 0.5);
    let is_told = |event: &WorldEvent| matches!(event, WorldEvent::Report { vehicle: 0, .. });
    assert!(
        echoes(&output).is_empty() && hearers(&output).is_empty() && !output.iter().any(is_told)
    );
    environment.attach(secs(0.5), 0);
    assert!(wake(&mut environment, 1.0).iter().any(is_told));
}

#[test]
fn a_wreck_obeys_no_more_and_others_may_meet_it() {
    // The first one touches the post; the second one comes from behind.
    let mut environment = environment(&[(1.5, 0.0, 1.0)], &[0.0, -3.0], Vec::new());
    obey(&mut environment, 0.0, 0, to_device(drive(9.0)));
    obey(&mut environment, 0.0, 1, to_device(drive(0.6)));
    let mut output = wake(&mut environment, 1.9);
    assert_eq!(contacts(&output), 1);
    let place = environment.world().truth(0, secs(1.9)).at;
    for second in 0..4 {
        let now_s = 1.9 + f64::from(second);
        obey(&mut environment, now_s, 0, to_device(drive(-9.0)));
        obey(&mut environment, now_s, 1, ping(1));
        output.extend(wake(&mut environment, now_s + 1.0));
    }
    assert_eq!((contacts(&output), environment.counts().dropped), (2, 4));
    assert_eq!(environment.world().truth(0, secs(6.0)).at, place);
}

#[test]
fn a_flood_of_commands_leaves_nothing_behind() {
    let mut environment = environment(&[(5.0, 0.0, 1.0)], &[0.0, -3.0], Vec::new());
    for number in 0..20_000 {
        obey(
            &mut environment,
            0.0,
            0,
            to_device(drive(4.0 + (number % 7) as f64)),
        );
        obey(&mut environment, 0.0, 0, ping(number));
    }
    assert!(
        environment.pending() < 20,
        "{} things are to happen",
        environment.pending()
    );
}

#[test]
fn a_stored_mission_is_braked_too_when_its_companion_is_silent() {
    for (kind, altitude_m) in [(VehicleKind::Rover, 0.0), (VehicleKind::Copter, 2.0)] {
        let mut environment = begun(world(kind, altitude_m, &[], &[0.0]), Vec::new());
        let waypoint = |x_m: f64| Item::Waypoint {
            at: Point::new(x_m, 0.0),
            altitude_m,
            delay: Duration::ZERO,
        };
        let mission = vec![waypoint(0.0), waypoint(20.0), waypoint(40.0)];
        for command in [
            Command::Upload(mission),
            Command::Mode(FlightMode::Auto),
            Command::Begin,
        ] {
            obey(&mut environment, 0.0, 0, to_device(command));
        }
        let speed_mps = |environment: &Environment, at_s: f64| {
            environment.world().truth(0, secs(at_s)).speed_mps
        };
        obey(&mut environment, 3.0, 0, ping(1));
        wake(&mut environment, 4.5);
        assert!(speed_mps(&environment, 4.5) > 0.5, "{kind:?}");
        wake(&mut environment, 9.0);
        assert_eq!(speed_mps(&environment, 9.0), 0.0, "{kind:?}");
    }
}

#[test]
fn whoever_walks_into_a_vehicle_that_stands_touches_it_once() {
    let mut environment = environment(&[], &[0.0, 6.0], Vec::new());
    let mut output = wake(&mut environment, 1.0);
    for step in 0..20 {
        let at_s = 1.0 + 0.5 * f64::from(step);
        output.extend(wake(&mut environment, at_s));
        let walker_m = 3.0 - 0.25 * f64::from(step);
        environment.set_stage(stage(&[(walker_m, 0.0, 1.8)]), &mut output);
    }
    output.extend(wake(&mut environment, 12.0));
    assert_eq!(
        contacts(&output),
        1,
        "the one in the way, and not at every step"
    );
}
