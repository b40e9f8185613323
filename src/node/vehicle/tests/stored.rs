//! A mission that the autopilot carries out is judged as a whole before it begins, and braked like a drive.

use std::time::Duration;

use super::*;
use crate::autopilot::{Item, StoredPhase, StoredProgress};

fn to(x_m: f64, y_m: f64) -> Item {
    Item::Waypoint {
        at: Point::new(x_m, y_m),
        altitude_m: 0.0,
        delay: Duration::ZERO,
    }
}

fn follow(items: &[Item]) -> In {
    let home = to(0.0, 0.0);
    let items = std::iter::once(home).chain(items.iter().copied()).collect();
    In::Command(Time::NEVER, MoveCommand::FollowStored { items, from: 1 })
}

fn follows(out: &[Out]) -> bool {
    let is_follow = |out: &Out| {
        matches!(
            out,
            Out::AutopilotCommand(AutopilotCommand::FollowStored { .. })
        )
    };
    out.iter().any(is_follow)
}

#[test]
fn every_way_of_a_mission_lies_inside_the_fence_also_those_of_jumps() {
    let inside = [to(3.0, 0.0), Item::Speed(0.5), to(3.0, 3.0)];
    let out = fed(&mut vehicle(), 1.1, follow(&inside));
    assert_eq!((follows(&out), refusal(&out)), (true, None));
    for outside in [
        vec![to(3.0, 0.0), to(24.9, 0.0)],
        vec![to(26.0, 0.0)],
        vec![
            to(3.0, 0.0),
            Item::Jump { to: 4, times: None },
            to(3.0, 3.0),
            to(30.0, 3.0),
        ],
        vec![
            Item::Jump {
                to: 3,
                times: Some(1),
            },
            to(30.0, 0.0),
            Item::Return,
        ],
    ] {
        let out = fed(&mut vehicle(), 1.1, follow(&outside));
        let expected = (false, Some(CommandRefusal::Fence));
        assert_eq!((follows(&out), refusal(&out)), expected, "{outside:?}");
    }
}

/// One that carries out a mission along x, at 1 m.
fn under_way() -> Vehicle {
    let mut vehicle = vehicle();
    fed(&mut vehicle, 1.1, follow(&[to(3.0, 0.0), to(6.0, 0.0)]));
    let In::Telemetry(telemetry) = telemetry(1.0, 0.5, 0.05) else {
        panic!("telemetry")
    };
    let stored = Some(StoredProgress {
        item: 1,
        phase: StoredPhase::UnderWay,
    });
    let told = In::Telemetry(Telemetry {
        stored,
        ..telemetry
    });
    let out = fed(&mut vehicle, 2.0, told);
    let own = out.iter().find_map(|out| match out {
        Out::State(own) => Some(own.clone()),
        _ => None,
    });
    let own = own.unwrap();
    let claimed = own.leg.map(|leg| leg.len());
    assert_eq!((claimed, own.stored), (Some(3), stored));
    vehicle
}

#[test]
fn it_is_braked_by_the_reflex_and_by_an_order() {
    assert!(stops(&fed(&mut under_way(), 2.1, scan(0.3, 0.0))));
    let hold = given(order(OrderKind::Hold, LEASE, 5, 0));
    assert!(stops(&fed(&mut under_way(), 2.1, hold)));
}

#[test]
fn it_is_braked_for_a_peer_that_rests_on_its_way_and_for_none_beside_it() {
    let met = |x_m: f64, y_m: f64| fed(&mut under_way(), 2.1, In::Peer(state(2, x_m, y_m)));
    let out = met(5.0, 0.2);
    let expected = (true, Some(CommandRefusal::Separation(VehicleId(2))));
    assert_eq!((stops(&out), refusal(&out)), expected);
    assert!(!stops(&met(5.0, 3.0)));
}

#[test]
fn one_whose_second_way_leads_to_a_peer_at_rest_does_not_begin() {
    let begun = |x_m: f64| {
        let mut vehicle = vehicle();
        fed(&mut vehicle, 1.0, In::Peer(state(2, x_m, 2.0)));
        fed(&mut vehicle, 1.1, follow(&[to(3.0, 0.0), to(3.0, 3.0)]))
    };
    let out = begun(3.0);
    let expected = (false, Some(CommandRefusal::Separation(VehicleId(2))));
    assert_eq!((follows(&out), refusal(&out)), expected);
    assert!(follows(&begun(6.0)));
}
