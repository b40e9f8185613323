//! Emergency stops: what an open one does, what its lifting does not do, and what a vehicle must have heard before it may be
//! started.

use super::*;
use tomoswarm_proto::{EmergencyName, StopScope};

fn stop(number: u32, scope: StopScope) -> EmergencyStop {
    let name = EmergencyName(EmergencyName::LOWEST_DRAWN + number);
    EmergencyStop {
        name,
        scope,
        by: OperatorId(1),
    }
}

fn open(stops: &[EmergencyStop]) -> In {
    In::Stops(stops.to_vec())
}

fn all() -> EmergencyStop {
    stop(0, StopScope::All)
}

fn stands_under(vehicle: &mut Vehicle, time_s: f64) -> (VehicleMode, Option<StandReason>) {
    let out = fed(vehicle, time_s, telemetry(0.0, 0.0, 0.05));
    let state = |out: &Out| {
        if let Out::Publish(state) = out {
            Some((state.mode, state.stands_under))
        } else {
            None
        }
    };
    out.iter()
        .find_map(state)
        .expect("a state is published when its mode changes")
}

fn start(vehicle: &Vehicle, revision: u32) -> Order {
    order(
        OrderKind::Start,
        LEASE,
        revision,
        vehicle.reports.sequence(),
    )
}

#[test]
fn a_stop_brakes_at_once_and_disarms_at_rest() {
    let mut vehicle = vehicle();
    fed(&mut vehicle, 1.0, drive(&[(0.0, 0.0), (3.0, 0.0)]));
    fed(&mut vehicle, 2.0, telemetry(0.5, 0.5, 0.05));
    assert_eq!(
        flown(&fed(&mut vehicle, 2.0, open(&[all()]))),
        [AutopilotCommand::Stop],
        "at once"
    );
    assert_eq!(
        fed(&mut vehicle, 2.05, open(&[all(), stop(1, StopScope::All)])),
        [],
        "once"
    );
    let mut flown_at = Vec::new();
    for (tenth, speed_mps) in [(1, 0.4), (4, 0.1), (8, 0.0), (9, 0.0), (10, 0.0)] {
        let now_s = 2.0 + 0.1 * f64::from(tenth);
        for fly in flown(&fed(&mut vehicle, now_s, telemetry(0.6, speed_mps, 0.05))) {
            flown_at.push((tenth, fly));
        }
    }
    assert_eq!(
        flown_at,
        [(4, AutopilotCommand::Stop), (8, AutopilotCommand::Disarm)],
        "it brakes still after 0.3 s"
    );
}

#[test]
fn under_an_open_stop_nothing_is_driven_and_nobody_starts_or_calls_it_home() {
    let mut vehicle = vehicle();
    fed(&mut vehicle, 1.1, open(&[all()]));
    assert_eq!(
        stands_under(&mut vehicle, 1.2),
        (VehicleMode::Stopped, Some(StandReason::Stop(all().name)))
    );
    for (revision, kind) in [(1, OrderKind::Start), (2, OrderKind::Return)] {
        for sender in [Sender::Ground, Sender::Operator(OperatorId(1))] {
            let order = Order {
                kind,
                ..start(&vehicle, revision)
            };
            assert!(
                !obeyed(&fed(&mut vehicle, 1.3, In::Order(sender, order))),
                "{kind:?} of {sender:?}"
            );
        }
    }
    assert_eq!(
        refusal(&fed(&mut vehicle, 1.4, drive(&[(0.0, 0.0), (1.0, 0.0)]))),
        Some(CommandRefusal::Emergency)
    );
    assert!(
        obeyed(&fed(
            &mut vehicle,
            1.5,
            given(order(OrderKind::CutMotors, LEASE, 1, 0))
        )),
        "stops do count"
    );
}

#[test]
fn a_lift_moves_nobody_and_only_an_operators_start_that_answers_a_later_state_does() {
    let mut vehicle = vehicle();
    fed(&mut vehicle, 1.1, open(&[all()]));
    fed(&mut vehicle, 1.5, telemetry(0.0, 0.0, 0.05));
    let before = start(&vehicle, 1);
    assert_eq!(fed(&mut vehicle, 1.6, open(&[])), [], "nothing moves");
    let drives = || drive(&[(0.0, 0.0), (1.0, 0.0)]);
    assert_eq!(
        refusal(&fed(&mut vehicle, 1.7, drives())),
        Some(CommandRefusal::Emergency)
    );
    assert!(
        !obeyed(&fed(&mut vehicle, 1.8, given(before))),
        "it answers a state of before the lift"
    );
    assert_eq!(
        stands_under(&mut vehicle, 1.9),
        (VehicleMode::Held, Some(StandReason::Held))
    );
    let after = start(&vehicle, 1);
    assert!(
        !obeyed(&fed(
            &mut vehicle,
            2.0,
            In::Order(Sender::Ground, after.clone())
        )),
        "the ground lifts nothing"
    );
    let called_home = Order {
        kind: OrderKind::Return,
        ..after.clone()
    };
    assert!(!obeyed(&fed(&mut vehicle, 2.0, given(called_home))));
    assert_eq!(
        flown(&fed(&mut vehicle, 2.1, given(after))),
        [AutopilotCommand::Arm]
    );
    assert!(flies(&fed(&mut vehicle, 2.2, drives())));
}

#[test]
fn a_start_that_waits_for_the_disk_is_gone_when_a_stop_comes() {
    let mut vehicle = vehicle();
    let mut out = Vec::new();
    let waits = start(&vehicle, 1);
    vehicle.handle(at(1.1), given(waits), &mut out).unwrap();
    let memory = out.iter().find_map(|out| {
        if let Out::Remember(memory) = out {
            Some(*memory)
        } else {
            None
        }
    });
    fed(&mut vehicle, 1.2, open(&[all()]));
    fed(&mut vehicle, 1.3, open(&[]));
    let memory = memory.expect("it is to be remembered");
    let written = In::Remembered(Remembered {
        on_disk: memory,
        tried: memory,
    });
    assert!(!obeyed(&fed(&mut vehicle, 1.4, written)));
}

#[test]
fn a_stop_for_another_vehicle_stops_this_one_not_and_what_the_disk_has_stops_it_from_the_start() {
    let mut free = vehicle();
    assert_eq!(
        fed(
            &mut free,
            1.1,
            open(&[stop(0, StopScope::One(VehicleId(2)))])
        ),
        []
    );
    assert!(flies(&fed(
        &mut free,
        1.2,
        drive(&[(0.0, 0.0), (1.0, 0.0)])
    )));
    let kept = tomoswarm_proto::OpenStops {
        open: vec![all()],
        lifted: vec![],
    };
    let mut stopped = Vehicle::new(VehicleSettings {
        stops: kept,
        ..settings(1)
    });
    assert_eq!(stands_under(&mut stopped, 1.0).0, VehicleMode::Stopped);
}

#[test]
fn a_vehicle_that_was_started_is_not_started_out_before_it_has_listened() {
    let mut vehicle = Vehicle::new(settings(1));
    fed(&mut vehicle, 1.0, telemetry(0.0, 0.0, 0.05));
    let peer = |sequence| {
        In::Peer(State {
            sequence,
            ..super::super::super::tests_support::state(2, 5.0, 5.0)
        })
    };
    fed(&mut vehicle, 1.0, peer(1));
    fed(&mut vehicle, 3.0, peer(2));
    let begins = |vehicle: &mut Vehicle, time_s: f64| {
        let start = start(vehicle, 1);
        obeyed(&fed(vehicle, time_s, given(start)))
    };
    assert!(
        !begins(&mut vehicle, 1.5) && !begins(&mut vehicle, 3.1),
        "vehicle 2 has not told what it knows"
    );
    fed(
        &mut vehicle,
        3.2,
        In::StopsReported(Sender::Vehicle(VehicleId(2))),
    );
    assert!(begins(&mut vehicle, 3.2));
    let hold = order(OrderKind::Hold, LEASE, 1, 0);
    assert!(
        obeyed(&fed(&mut Vehicle::new(settings(1)), 0.1, given(hold))),
        "to stop is never too early"
    );
}
