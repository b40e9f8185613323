//! What a vehicle remembers of its orders: what it says before and after they are on disk, and what it obeys once it was
//! started anew.

use super::*;
use crate::node::memory::OrderEdition;
use tomoswarm_proto::{EmergencyName, Ordered};

fn edition(number: u32, revision: u32) -> OrderEdition {
    OrderEdition {
        lease: lease(number),
        revision: Revision(revision),
        run: RunId(1),
    }
}

fn lease(number: u32) -> Lease {
    Lease { number, holder: 50 }
}

fn memory(number: u32, revision: u32) -> VehicleMemory {
    VehicleMemory::of_order(edition(number, revision))
}

/// A vehicle at rest that has heard its autopilot once, at 1 s; its disk answers nothing by itself.
fn remembering(memory: VehicleMemory) -> Vehicle {
    let mut vehicle = Vehicle::new(VehicleSettings {
        memory,
        ..settings(1)
    });
    vehicle.readiness = Readiness::Ready;
    handle(&mut vehicle, 1.0, telemetry(0.0, 0.0, 0.05));
    vehicle
}

fn handle(vehicle: &mut Vehicle, time_s: f64, input: In) -> Vec<Out> {
    let mut out = Vec::new();
    vehicle.handle(at(time_s), input, &mut out).unwrap();
    out
}

fn ordered(vehicle: &mut Vehicle, kind: OrderKind, number: u32, revision: u32) -> Vec<Out> {
    let seen = vehicle.reports.sequence();
    handle(
        vehicle,
        1.1,
        given(order(kind, lease(number), revision, seen)),
    )
}

/// The disk has this.
fn written(vehicle: &mut Vehicle, time_s: f64, memory: VehicleMemory) -> Vec<Out> {
    handle(
        vehicle,
        time_s,
        In::Remembered(Remembered {
            on_disk: memory,
            tried: memory,
        }),
    )
}

/// The disk cannot be written: it has nothing.
fn not_written(vehicle: &mut Vehicle, memory: VehicleMemory) -> Vec<Out> {
    handle(
        vehicle,
        1.2,
        In::Remembered(Remembered {
            on_disk: VehicleMemory::default(),
            tried: memory,
        }),
    )
}

/// What it shows with the next telemetry.
fn shown(vehicle: &mut Vehicle) -> (Lease, Revision, Option<OrderKind>) {
    let out = handle(vehicle, 1.3, telemetry(0.0, 0.0, 0.05));
    let state = out.iter().find_map(|out| {
        if let Out::State(state) = out {
            Some(state)
        } else {
            None
        }
    });
    let Ordered {
        lease,
        revision,
        kind,
        ..
    } = state.unwrap().ordered;
    (lease, revision, kind)
}

const NOTHING: (Lease, Revision, Option<OrderKind>) = (
    Lease {
        number: 0,
        holder: 0,
    },
    Revision(0),
    None,
);

#[test]
fn a_start_that_waited_for_the_disk_when_somebody_took_over_is_not_obeyed() {
    for control in [Control::Ours, Control::Remote] {
        let mut vehicle = remembering(VehicleMemory::default());
        let seen = vehicle.reports.sequence();
        let ends = vec![EmergencyName::of_take_over(VehicleId(1), Boot(1))];
        let start = Order {
            ends,
            ..order(OrderKind::Start, lease(1), 1, seen)
        };
        assert!(!obeyed(&handle(&mut vehicle, 1.1, given(start))));
        handle(
            &mut vehicle,
            1.2,
            In::Autopilot(ControlStatus {
                switch: None,
                control,
                is_landed: true,
            }),
        );
        let out = written(&mut vehicle, 1.3, memory(1, 1));
        assert_eq!(
            obeyed(&out),
            control == Control::Ours,
            "{control:?}: {out:?}"
        );
    }
}

#[test]
fn a_start_is_remembered_before_anything_follows_from_it() {
    let mut vehicle = remembering(VehicleMemory::default());
    assert_eq!(
        ordered(&mut vehicle, OrderKind::Start, 3, 1),
        [Out::Remember(memory(3, 1))]
    );
    assert_eq!(shown(&mut vehicle), NOTHING);
    let out = written(&mut vehicle, 1.3, memory(3, 1));
    assert_eq!(out[0], Out::AutopilotCommand(AutopilotCommand::Arm));
    assert!(obeyed(&out));
    assert_eq!(
        shown(&mut vehicle),
        (lease(3), Revision(1), Some(OrderKind::Start))
    );
    assert_eq!(written(&mut vehicle, 1.4, memory(3, 1)), [], "once");
}

#[test]
fn what_stops_does_so_at_once_and_is_written_then_and_shown_at_last() {
    for kind in [
        OrderKind::Hold,
        OrderKind::Return,
        OrderKind::Land,
        OrderKind::CutMotors,
    ] {
        let mut vehicle = remembering(VehicleMemory::default());
        let out = ordered(&mut vehicle, kind, 3, 1);
        assert_eq!(
            (&out[0], out.last()),
            (
                &Out::AutopilotCommand(AutopilotCommand::Stop),
                Some(&Out::Remember(memory(3, 1)))
            )
        );
        assert_eq!(
            out.contains(&Out::AutopilotCommand(AutopilotCommand::Disarm)),
            kind == OrderKind::CutMotors
        );
        assert!(
            !out.contains(&Out::AutopilotCommand(AutopilotCommand::Arm)) && !obeyed(&out),
            "{kind:?}"
        );
        assert!(
            !flies(&handle(&mut vehicle, 1.2, drive(&[(0.0, 0.0), (0.0, 5.0)]))),
            "{kind:?}"
        );
        assert_eq!(shown(&mut vehicle), NOTHING, "{kind:?}");
        let out = written(&mut vehicle, 1.4, memory(3, 1));
        assert!(
            obeyed(&out) && !out.contains(&Out::AutopilotCommand(AutopilotCommand::Disarm)),
            "{kind:?}"
        );
        assert_eq!(shown(&mut vehicle), (lease(3), Revision(1), Some(kind)));
    }
}

#[test]
fn nothing_lower_than_what_was_on_disk_is_obeyed_after_a_restart() {
    for kind in [OrderKind::Start, OrderKind::Hold, OrderKind::CutMotors] {
        let mut vehicle = remembering(memory(5, 7));
        assert_eq!(
            shown(&mut vehicle),
            (lease(5), Revision(7), None),
            "it begins free, and says what it knows"
        );
        assert_eq!(
            ordered(&mut vehicle, kind, 4, 9),
            [],
            "{kind:?}: a lower lease"
        );
        assert_eq!(ordered(&mut vehicle, kind, 5, 6), [], "{kind:?}: late");
        let out = ordered(&mut vehicle, kind, 5, 7);
        assert!(
            obeyed(&out),
            "{kind:?}: nobody may have seen that it was obeyed"
        );
        assert!(
            !out.iter().any(|out| matches!(out, Out::Remember(_))),
            "it is on disk"
        );
        assert_eq!(ordered(&mut vehicle, kind, 5, 7), [], "{kind:?}: once");
        assert_eq!(shown(&mut vehicle), (lease(5), Revision(7), Some(kind)));
    }
}

#[test]
fn a_disk_that_cannot_be_written_keeps_a_start_back_and_nothing_that_stops() {
    let mut vehicle = remembering(VehicleMemory::default());
    ordered(&mut vehicle, OrderKind::Start, 3, 1);
    assert_eq!(not_written(&mut vehicle, memory(3, 1)), []);
    assert_eq!(
        shown(&mut vehicle),
        (lease(3), Revision(1), None),
        "others can go above it"
    );
    assert_eq!(
        ordered(&mut vehicle, OrderKind::Start, 3, 1),
        [],
        "it waits"
    );
    ordered(&mut vehicle, OrderKind::Return, 3, 2);
    assert!(obeyed(&not_written(&mut vehicle, memory(3, 2))));
    assert_eq!(shown(&mut vehicle).2, Some(OrderKind::Return));
    assert_eq!(
        written(&mut vehicle, 1.4, memory(3, 2)),
        [],
        "the start is overruled"
    );
}

#[test]
fn a_start_that_has_waited_too_long_is_given_up_and_may_come_again() {
    let mut vehicle = remembering(VehicleMemory::default());
    ordered(&mut vehicle, OrderKind::Start, 3, 1);
    assert_eq!(written(&mut vehicle, 60.0, memory(3, 1)), []);
    assert_eq!(
        ordered(&mut vehicle, OrderKind::Hold, 2, 9),
        [],
        "a higher lease is on disk"
    );
    handle(&mut vehicle, 60.1, telemetry(0.0, 0.0, 0.05));
    let seen = vehicle.reports.sequence();
    let again = given(order(OrderKind::Start, lease(3), 1, seen));
    let out = handle(&mut vehicle, 60.2, again);
    assert!(obeyed(&out) && out.contains(&Out::AutopilotCommand(AutopilotCommand::Arm)));
}

#[test]
fn an_order_that_is_repeated_while_it_waits_stays_young_and_is_asked_for_once() {
    let mut vehicle = remembering(VehicleMemory::default());
    ordered(&mut vehicle, OrderKind::Start, 3, 1);
    handle(&mut vehicle, 60.0, telemetry(0.0, 0.0, 0.05));
    let seen = vehicle.reports.sequence();
    assert_eq!(
        handle(
            &mut vehicle,
            60.1,
            given(order(OrderKind::Start, lease(3), 1, seen))
        ),
        []
    );
    assert!(obeyed(&written(&mut vehicle, 60.2, memory(3, 1))));
}

#[test]
fn of_two_that_wait_the_higher_is_obeyed_alone() {
    let mut vehicle = remembering(VehicleMemory::default());
    ordered(&mut vehicle, OrderKind::Start, 3, 1);
    let out = ordered(&mut vehicle, OrderKind::Hold, 3, 2);
    assert!(stops(&out) && out.contains(&Out::Remember(memory(3, 2))));
    assert_eq!(
        written(&mut vehicle, 1.2, memory(3, 1)),
        [],
        "the start is overruled"
    );
    assert_eq!(
        ordered(&mut vehicle, OrderKind::Start, 3, 1),
        [],
        "for good"
    );
    assert!(obeyed(&written(&mut vehicle, 1.3, memory(3, 2))));
    assert_eq!(shown(&mut vehicle).2, Some(OrderKind::Hold));
}

#[test]
fn what_was_decided_before_a_stop_that_was_never_told_the_mission_is_not_driven() {
    let mut vehicle = remembering(VehicleMemory::default());
    ordered(&mut vehicle, OrderKind::Return, 3, 1);
    ordered(&mut vehicle, OrderKind::Start, 3, 2);
    assert!(obeyed(&written(&mut vehicle, 1.2, memory(3, 2))));
    let route = vec![Point::new(0.0, 0.0), Point::new(0.0, 5.0)];
    let decided = |time_s| {
        In::Command(
            at(time_s),
            MoveCommand::Drive {
                is_off_plan: true,
                route: route.clone(),
            },
        )
    };
    assert_eq!(
        refusal(&handle(&mut vehicle, 1.3, decided(1.05))),
        Some(CommandRefusal::Old)
    );
    assert!(flies(&handle(&mut vehicle, 1.3, decided(1.25))));
}
