//! What the environment promises to its callers, whoever they are.

use tomoswarm_proto::{Boot, Progress};

use super::*;
use crate::config::{Fault, FaultKind};
use crate::geom::Point;
use crate::plan::{Mount, Mounts};
use crate::sim::autopilot::Kind;
use crate::sim::world::tests::{drive, secs, world};

const ONE: VehicleId = VehicleId(1);

/// Rovers at places on the x axis that face along it, with posts of 0.5 m radius ahead (their x, and their two ends).
fn environment(posts: &[(f64, f64, f64)], places_m: &[f64], faults: Vec<Fault>) -> Environment {
    let world = world(Kind::Rover, 0.0, posts, places_m);
    begun(world, faults)
}

fn begun(world: World, faults: Vec<Fault>) -> Environment {
    let mut environment = Environment::new(world, Noise::new(1), Faults::new(faults), None);
    environment.begin(&mut Vec::new());
    environment
}

fn fault(kind: FaultKind, from_s: f64, until_s: f64) -> Fault {
    Fault { from: secs(from_s), until: secs(until_s), kind, vehicles: vec![ONE] }
}

fn beacon(sender: u8, sequence: u64) -> DeviceCommand {
    let (sender, boot) = (VehicleId(sender), Boot(1));
    let progress = Progress { vehicle: sender, boot, ..Progress::default() };
    let (pose, members) = (Default::default(), Vec::new());
    DeviceCommand::Transmit(Beacon {
        sender,
        boot,
        sequence,
        pose,
        channel: 15,
        power_dbm: 0,
        members,
        progress,
    })
}

fn ping(number: u64) -> DeviceCommand {
    DeviceCommand::Ping(Ping { number })
}

/// Tells a device something; nothing happens at once.
fn obey(environment: &mut Environment, now_s: f64, vehicle: usize, command: DeviceCommand) {
    let mut said = Vec::new();
    environment.obey(secs(now_s), vehicle, command, &mut said);
    assert!(said.iter().all(|event| matches!(event, WorldEvent::Scheduled(_))), "{said:?}");
}

/// Lets everything happen up to a moment, event by event.
fn wake(environment: &mut Environment, to_s: f64) -> Vec<WorldEvent> {
    let (mut said, to) = (Vec::new(), secs(to_s));
    while let Some(due) = environment.deadline().filter(|due| due.at <= to) {
        environment.wake(due.at, &mut said);
        assert!(
            environment.deadline().is_none_or(|next| next.at > due.at),
            "after a wake the deadline is later"
        );
    }
    environment.wake(to, &mut said);
    said
}

/// What was measured, and by whom.
fn echoes(said: &[WorldEvent]) -> Vec<(usize, Option<f64>)> {
    let of = |event: &WorldEvent| match event {
        WorldEvent::Echo { vehicle, echo } => Some((*vehicle, echo.range_m)),
        _other => None,
    };
    said.iter().filter_map(of).collect()
}

/// Who heard something.
fn hearers(said: &[WorldEvent]) -> Vec<usize> {
    let of = |event: &WorldEvent| match event {
        WorldEvent::Heard { receivers, .. } => receivers.iter().map(|(to, _)| *to).collect(),
        _other => Vec::new(),
    };
    said.iter().flat_map(of).collect()
}

fn contacts(said: &[WorldEvent]) -> usize {
    said.iter().filter(|event| matches!(event, WorldEvent::Contact(_))).count()
}

#[test]
fn a_ping_before_the_servo_has_turned_hears_what_it_passes() {
    // 60° in 0.6 s; ahead stands a post, to the left nothing.
    let servo =
        Mount { zero: Angle::ZERO, from_rad: -1.6, to_rad: 1.6, slew_s_per_rad: 0.6 / 60f64.to_radians() };
    let world = world(Kind::Rover, 0.0, &[(3.0, 0.0, 1.0)], &[0.0]).with_mounts(Mounts::new(vec![servo]));
    let mut environment = begun(world, Vec::new());
    let hears = |environment: &mut Environment, now_s: f64| {
        let heard = echoes(&wake(environment, now_s + 0.09));
        let [(0, range_m)] = heard[..] else { panic!("{heard:?}") };
        range_m.is_some()
    };
    obey(&mut environment, 1.0, 0, ping(1));
    obey(&mut environment, 1.0, 0, DeviceCommand::Steer(Angle::from_degrees(90.0)));
    assert!(hears(&mut environment, 1.0), "it begins at its zero");
    for (now_s, is_heard) in [(1.1, true), (1.5, false), (2.0, false)] {
        obey(&mut environment, now_s, 0, ping(1));
        assert_eq!(hears(&mut environment, now_s), is_heard, "after {now_s} s");
    }
}

#[test]
fn woken_at_what_it_scheduled_it_says_the_same_as_woken_at_its_deadlines() {
    let play = |by_schedule: bool| {
        let world = world(Kind::Rover, 0.0, &[(6.0, 0.0, 1.0)], &[0.0, -3.0]);
        let charge = vec![fault(FaultKind::Battery(0.5), 2.0, 3.0)];
        let mut environment = Environment::new(world, Noise::new(1), Faults::new(charge), None);
        let (mut said, mut begun) = (Vec::new(), Vec::new());
        environment.begin(&mut begun);
        for (vehicle, command) in [(0, DeviceCommand::Fly(drive(9.0))), (0, ping(1)), (1, beacon(2, 1))] {
            environment.obey(secs(0.5), vehicle, command, &mut begun);
        }
        let mut scheduled = begun;
        loop {
            let of =
                |event: &WorldEvent| if let WorldEvent::Scheduled(at) = event { Some(*at) } else { None };
            let next = if by_schedule {
                scheduled.iter().filter_map(of).filter(|at| *at > environment.now).min()
            } else {
                environment.deadline().map(|due| due.at)
            };
            let Some(at) = next.filter(|at| *at <= secs(8.0)) else { return said };
            environment.wake(at, &mut scheduled);
            said.extend(scheduled.iter().filter(|event| of(event).is_none()).cloned());
            scheduled.retain(|event| of(event).is_some());
        }
    };
    let (by_schedule, by_deadline) = (play(true), play(false));
    assert_eq!(by_schedule, by_deadline);
    let kinds = (echoes(&by_deadline).len(), hearers(&by_deadline).len(), contacts(&by_deadline));
    assert_eq!(kinds, (1, 1, 1));
    assert!(by_deadline.contains(&WorldEvent::Charged { vehicle: 0, charge: 0.5 }));
}

#[test]
fn a_blind_sensor_and_a_dead_radio_are_silent_and_only_for_as_long_as_they_are() {
    let faults = vec![fault(FaultKind::Sensor, 1.0, 2.0), fault(FaultKind::Radio, 1.0, 2.0)];
    let mut environment = environment(&[(3.0, 0.0, 1.0)], &[0.0, -3.0], faults);
    let mut at = |now_s: f64| {
        obey(&mut environment, now_s, 0, ping(1));
        obey(&mut environment, now_s, 0, beacon(1, 1));
        obey(&mut environment, now_s + 0.1, 1, beacon(2, 1));
        let said = wake(&mut environment, now_s + 0.4);
        (echoes(&said).len(), hearers(&said))
    };
    assert_eq!(at(0.5), (1, vec![1, 0]));
    assert_eq!(at(1.0), (0, vec![]), "neither heard nor hears");
    assert_eq!(at(2.0), (1, vec![1, 0]));
}

#[test]
fn a_long_sleep_is_not_made_up_for() {
    let mut environment = environment(&[], &[0.0], Vec::new());
    let mut said = Vec::new();
    environment.wake(secs(0.1), &mut said);
    said.clear();
    environment.wake(secs(20.1), &mut said);
    let reports = said.iter().filter(|event| matches!(event, WorldEvent::Telemetry { .. })).count();
    assert!(reports <= 2, "{reports}");
    assert!(environment.deadline().unwrap().at > secs(20.1));
}

#[test]
fn a_contact_that_a_newer_command_prevents_does_not_come() {
    let mut environment = environment(&[(5.0, 0.0, 1.0)], &[0.0], Vec::new());
    obey(&mut environment, 0.0, 0, DeviceCommand::Fly(drive(9.0)));
    let said = wake(&mut environment, 2.0);
    obey(&mut environment, 2.0, 0, DeviceCommand::Fly(Fly::Stop));
    assert_eq!(contacts(&said) + contacts(&wake(&mut environment, 20.0)), 0);
    assert!(environment.world().truth(0, secs(20.0)).at.distance_to(Point::new(0.0, 0.0)) > 0.5);
}
