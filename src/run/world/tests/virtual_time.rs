//! What is true in the live world, without sockets and without waiting.

use tomoswarm_proto::Boot;

use super::super::live_world::{LiveWorld, VehicleWord};
use super::*;
use crate::autopilot::{Ack, AutopilotReport, CommandAck, Motion};
use crate::geom::Angle;
use crate::node::sensor::Ping;
use crate::run::link::{FromWorld, LinkRefusal};
use crate::time::Time;

fn world() -> LiveWorld {
    LiveWorld::new(&scenario(), false).unwrap()
}

fn joined() -> LiveWorld {
    let mut world = world();
    assert_eq!(world.join(ONE, Boot(1)).unwrap().0, 0);
    assert_eq!(world.join(TWO, Boot(1)).unwrap().0, 1);
    world
}

/// Lets the world go on to a moment, event by event as its thread does; returns what it says meanwhile.
fn advance(world: &mut LiveWorld, to_s: f64) -> Vec<VehicleWord> {
    let (mut output, to) = (Vec::new(), Time::from_secs_f64(to_s));
    while world.next_at() <= to {
        world.advance(world.next_at(), &mut output);
    }
    world.advance(to, &mut output);
    output
}

fn telemetry(output: &[VehicleWord], index: usize) -> Vec<AutopilotReport> {
    let of = |(to, word): &VehicleWord| match word {
        FromWorld::Autopilot(report) if *to == index => Some(*report),
        _other => None,
    };
    output.iter().filter_map(of).collect()
}

fn ranges(output: &[VehicleWord]) -> Vec<(usize, Option<f64>)> {
    let of = |(to, word): &VehicleWord| match word {
        FromWorld::Echo(echo) => Some((*to, echo.range_m)),
        _other => None,
    };
    output.iter().filter_map(of).collect()
}

/// A driver says something; returns what is said back at once.
fn obey(world: &mut LiveWorld, index: usize, word: ToWorld) -> Vec<VehicleWord> {
    let mut output = Vec::new();
    world.obey(index, word, &mut output);
    output
}

fn ping(number: u64) -> ToWorld {
    ToWorld::Ping(Ping { number })
}

#[test]
fn telemetry_comes_ten_times_a_second_to_those_who_drive() {
    let mut world = world();
    world.join(ONE, Boot(1)).unwrap();
    let output = advance(&mut world, 10.0);
    assert_eq!(telemetry(&output, 0).len(), 100);
    assert_eq!(telemetry(&output, 1).len(), 0, "nobody drives vehicle 2");
    assert!(
        telemetry(&output, 0)
            .iter()
            .all(|told| told.pose.at.distance_to(Point::new(-1.5, 5.0)) < 1e-9)
    );
}

#[test]
fn a_world_that_stood_still_does_not_say_everything_at_once() {
    let mut world = joined();
    assert!(
        advance(&mut world, 20.0).len() >= 200,
        "it goes on in steps of 0.1 s"
    );
    let mut world = joined();
    let mut output = Vec::new();
    world.advance(Time::from_secs_f64(0.1), &mut output);
    output.clear();
    world.advance(Time::from_secs_f64(20.1), &mut output);
    assert!(telemetry(&output, 0).len() <= 2, "{}", output.len());
    assert!(world.next_at() > Time::from_secs_f64(20.1));
}

#[test]
fn the_wall_is_as_far_as_it_is_and_a_busy_sensor_is_not_asked_twice() {
    let mut world = joined();
    (1..=5).for_each(|number| assert!(obey(&mut world, 0, ping(number)).is_empty()));
    let heard = ranges(&advance(&mut world, 0.5));
    let [(0, Some(range_m))] = heard[..] else {
        panic!("{heard:?}")
    };
    assert!((range_m - WALL_M).abs() < 0.05, "{range_m}");
    assert_eq!(world.status().dropped, 4);
}

#[test]
fn the_persons_are_seen_once_they_have_entered() {
    let mut world = joined();
    obey(&mut world, 0, ToWorld::Steer(Angle::from_degrees(90.0)));
    obey(&mut world, 0, ping(1));
    assert_eq!(ranges(&advance(&mut world, 0.5)), [(0, None)]);
    assert!(!world.status().entered);
    world.enter();
    obey(&mut world, 0, ping(2));
    let heard = ranges(&advance(&mut world, 1.0));
    let [(0, Some(range_m))] = heard[..] else {
        panic!("{heard:?}")
    };
    assert!((range_m - PERSON_M).abs() < 0.05, "{range_m}");
    assert!(world.status().entered);
}

#[test]
fn a_beacon_is_heard_after_its_airtime_and_two_at_once_are_lost() {
    let heard = |output: &[VehicleWord]| -> Vec<(usize, i16)> {
        let of = |(to, word): &VehicleWord| match word {
            FromWorld::Heard { rssi_dbm, .. } => Some((*to, *rssi_dbm)),
            _other => None,
        };
        output.iter().filter_map(of).collect()
    };
    let mut world = joined();
    obey(&mut world, 0, beacon(ONE, 1));
    assert_eq!(
        obey(&mut world, 0, beacon(ONE, 2)),
        [(0, FromWorld::Unsent(2))]
    );
    assert!(heard(&advance(&mut world, 0.003)).is_empty());
    let [(1, rssi_dbm)] = heard(&advance(&mut world, 0.01))[..] else {
        panic!("one beacon, one hearer")
    };
    assert!(HEARD_DBM.contains(&rssi_dbm), "{rssi_dbm} dBm");
    assert_eq!(world.status().dropped, 1, "it was speaking still");
    obey(&mut world, 0, beacon(ONE, 3));
    obey(&mut world, 1, beacon(TWO, 1));
    assert!(heard(&advance(&mut world, 0.1)).is_empty());
    assert_eq!(world.status().collided_beacons, 2);
    obey(&mut world, 1, beacon(ONE, 4));
    assert!(
        heard(&advance(&mut world, 0.2)).is_empty(),
        "nobody speaks in another's name"
    );
}

#[test]
fn an_autopilot_whose_companion_is_silent_brakes_and_stands() {
    for leaves in [false, true] {
        let mut world = joined();
        obey(&mut world, 1, drive(5.0, 5.0));
        advance(&mut world, 1.0);
        if leaves {
            world.leave(1);
        }
        advance(&mut world, 1.9);
        assert!(world.status().vehicles[1].speed_mps > 0.9);
        advance(&mut world, 3.0);
        let stood = world.status().vehicles[1].clone();
        assert_eq!(stood.speed_mps, 0.0);
        // 2 s to 2.1 s at 1 m/s, less the ramp, and 0.1 m to brake.
        assert!((-0.1..=0.25).contains(&stood.at.y_m), "{:?}", stood.at);
        advance(&mut world, 10.0);
        assert_eq!(world.status().vehicles[1].at, stood.at);
    }
}

#[test]
fn any_word_of_the_companion_keeps_it_driving() {
    let mut world = joined();
    obey(&mut world, 1, drive(5.0, 5.0));
    for tenth in 1..40 {
        advance(&mut world, f64::from(tenth) * 0.1);
        obey(&mut world, 1, ping(tenth as u64));
    }
    assert!(world.status().vehicles[1].speed_mps > 0.9);
}

#[test]
fn of_two_processes_the_later_one_drives() {
    let mut world = world();
    world.join(ONE, Boot(5)).unwrap();
    let taken = |found| LinkRefusal::Taken {
        vehicle: ONE,
        present: Boot(5),
        found,
    };
    assert_eq!(world.join(ONE, Boot(5)), Err(taken(Boot(5))));
    assert_eq!(world.join(ONE, Boot(4)), Err(taken(Boot(4))));
    world.join(ONE, Boot(6)).unwrap();
    world.leave(0);
    let outdated = LinkRefusal::Outdated {
        vehicle: ONE,
        present: Boot(6),
        found: Boot(5),
    };
    assert_eq!(world.join(ONE, Boot(5)), Err(outdated));
    world.join(ONE, Boot(6)).unwrap();
    let unknown = LinkRefusal::Unknown {
        vehicle: VehicleId(3),
        count: 2,
    };
    assert_eq!(world.join(VehicleId(3), Boot(1)), Err(unknown));
}

#[test]
fn who_comes_back_stands_where_it_stood() {
    let mut world = joined();
    obey(&mut world, 1, drive(5.0, -1.0));
    advance(&mut world, 4.0);
    world.leave(1);
    advance(&mut world, 8.0);
    let (index, welcome) = world.join(TWO, Boot(2)).unwrap();
    assert_eq!(index, 1);
    assert!(
        welcome.start.unwrap().at.distance_to(Point::new(5.0, -1.0)) < 1e-6,
        "{welcome:?}"
    );
}

#[test]
fn the_referee_sees_a_contact_and_those_involved_stay() {
    let mut world = joined();
    obey(&mut world, 0, drive(0.5, 5.0));
    let output = advance(&mut world, 3.0);
    assert_eq!(
        telemetry(&output, 0).last().unwrap().motion,
        Motion::Resting
    );
    let status = world.status();
    assert_eq!((status.collision_count, status.collisions.len()), (1, 1));
    let contact = status.collisions[0];
    assert_eq!((contact.vehicle, contact.with), (ONE, None));
    // The body's radius is 0.25 m.
    assert!((contact.place.x_m + 0.25).abs() < 0.01, "{contact:?}");
    obey(&mut world, 0, drive(-3.0, 5.0));
    advance(&mut world, 6.0);
    assert_eq!(world.status().vehicles[0].at, contact.place);
    assert_eq!(world.status().collision_count, 1);
}

#[test]
fn a_contact_with_one_that_was_stopped_by_another_contact_is_foreseen() {
    let mut world = joined();
    // Vehicle 2 comes around the wall to the place where vehicle 1 will have stopped.
    obey(&mut world, 0, drive(0.5, 5.0));
    advance(&mut world, 0.5);
    let corners = vec![
        Point::new(5.0, 2.0),
        Point::new(-0.25, 2.0),
        Point::new(-0.25, 9.0),
    ];
    obey(&mut world, 1, route(corners));
    for second in 1..30 {
        advance(&mut world, f64::from(second));
        obey(&mut world, 1, ping(second as u64));
    }
    let status = world.status();
    assert_eq!(status.collision_count, 2, "{:?}", status.collisions);
    let second = status.collisions[1];
    assert_eq!(
        (
            second.vehicle.min(second.with.unwrap()),
            second.vehicle.max(second.with.unwrap())
        ),
        (ONE, TWO)
    );
    assert!((status.min_separation_m.unwrap() - 0.5).abs() < 0.01);
}

#[test]
fn an_impossible_command_changes_nothing_and_hides_no_contact() {
    let mut world = joined();
    obey(&mut world, 0, drive(0.5, 5.0));
    advance(&mut world, 0.2);
    obey(&mut world, 0, drive(f64::NAN, 5.0));
    obey(
        &mut world,
        0,
        command(Command::Yaw(Angle::from_radians(f64::INFINITY))),
    );
    obey(&mut world, 0, ToWorld::Steer(Angle::from_radians(f64::NAN)));
    obey(&mut world, 0, ToWorld::Transmit(vec![1, 2, 3]));
    obey(&mut world, 0, ToWorld::Stop);
    advance(&mut world, 3.0);
    assert_eq!(world.status().collision_count, 1);
}

#[test]
fn an_autopilot_answers_who_commands_it() {
    let mut world = joined();
    for (word, result) in [
        (drive(-1.0, 5.0), CommandAck::Accepted),
        (drive(f64::NAN, 5.0), CommandAck::Denied),
    ] {
        let ack = Ack {
            number: 9,
            result,
            arm_refusal: None,
        };
        assert_eq!(obey(&mut world, 0, word), [(0, FromWorld::Ack(ack))]);
    }
}

#[test]
fn a_flood_of_words_leaves_nothing_behind() {
    let mut world = joined();
    for number in 0..20_000 {
        obey(&mut world, 0, drive(-1.5, 4.0 + f64::from(number % 7)));
        obey(&mut world, 0, ping(u64::from(number as u32)));
        obey(&mut world, 0, beacon(ONE, number as u32));
    }
    assert!(
        world.pending() < 20,
        "{} things are to happen",
        world.pending()
    );
}

#[test]
fn a_track_has_a_place_a_second_and_none_while_standing() {
    let mut world = joined();
    obey(&mut world, 1, drive(5.0, -1.0));
    for second in 1..10 {
        advance(&mut world, f64::from(second));
    }
    let track = world.places(TWO, 0);
    assert_eq!(track.first(), Some(&Point::new(5.0, -2.0)));
    assert!((2..=3).contains(&track.len()), "{track:?}");
    assert_eq!(world.status().vehicles[1].places as usize, track.len());
    assert_eq!(world.places(TWO, 1), track[1..]);
    assert!(world.places(TWO, 9999).is_empty() && world.places(VehicleId(9), 0).is_empty());
}
