//! What a mission does when it hears nobody, has lost the bus, or runs out of battery.

use crate::node::radio::BeaconReport;
use tomoswarm_proto::{Boot, Lease, Plan, Revision, SeenState, VehicleId, VehicleMode};
use tomoswarm_proto::{Sender, StandReason};

use super::super::tests_support::{own_state, settings, state};
use super::tests::{at, driven, fed, holds, order, plan, planned};
use super::*;
use crate::node::vehicle::MoveCommand;

const GROUND: In = In::Heard(Sender::Ground);

fn sighting(vehicle: u8, x_m: f64) -> In {
    let progress = VehicleProgress {
        vehicle: VehicleId(vehicle),
        ..VehicleProgress::default()
    };
    In::Sighted(BeaconReport {
        pose: state(vehicle, x_m, 20.0).pose,
        progress,
    })
}

/// Lets the mission stand where it is from one second to another, in steps of a tenth; `each` is told every time.
fn pass(mission: &mut Mission, seconds: std::ops::Range<u32>, x_m: f64, each: &[In]) -> Vec<Out> {
    let mut out = Vec::new();
    for tenth in seconds.start * 10..seconds.end * 10 {
        let now_s = 0.1 * f64::from(tenth);
        if mission
            .deadline()
            .is_some_and(|deadline| deadline.at <= at(now_s))
        {
            mission.wake(at(now_s), &mut out).unwrap();
        }
        for input in each {
            out.extend(fed(mission, now_s, input.clone()));
        }
        let sequence = u64::from(tenth);
        out.extend(fed(
            mission,
            now_s,
            In::State(OwnState {
                sequence,
                ..own_state(x_m, 0.0)
            }),
        ));
    }
    out
}

/// A mission that drives toward (2, 0), with the ground on the bus until second 10.
fn under_way() -> Mission {
    let mut mission = planned(None);
    fed(&mut mission, 1.9, GROUND);
    fed(&mut mission, 2.0, order(OrderKind::Start));
    pass(&mut mission, 2..10, 0.0, &[GROUND]);
    assert_eq!(mission.status(), MissionStatus::Following);
    mission
}

fn has(out: &[Out], event: MissionEvent) -> bool {
    out.contains(&Out::MissionEvent(event))
}

#[test]
fn with_the_ground_alone_on_the_bus_a_vehicle_carries_on() {
    let mut mission = under_way();
    pass(&mut mission, 10..200, 0.0, &[GROUND]);
    assert_eq!(mission.status(), MissionStatus::Following);
}

#[test]
fn who_hears_nobody_stands_and_goes_on_as_soon_as_somebody_is_heard() {
    let mut mission = under_way();
    let out = pass(&mut mission, 10..13, 0.0, &[]);
    assert!(
        has(&out, MissionEvent::Alone)
            && holds(&out)
            && out.contains(&Out::Holds(Some(StandReason::Alone))),
        "{out:?}"
    );
    assert_eq!(mission.status(), MissionStatus::Held);
    let out = pass(&mut mission, 13..15, 0.0, &[GROUND]);
    assert!(
        driven(&out).is_some() && out.contains(&Out::Holds(None)),
        "{out:?}"
    );
}

#[test]
fn who_hears_peers_by_radio_carries_on_for_a_minute_and_then_returns() {
    let mut mission = under_way();
    let out = pass(&mut mission, 10..69, 0.0, &[sighting(2, 20.0)]);
    assert!(!holds(&out));
    assert_eq!(mission.status(), MissionStatus::Following);
    let out = pass(&mut mission, 69..80, 1.0, &[sighting(2, 20.0)]);
    assert!(
        has(
            &out,
            MissionEvent::Decides(AutonomyCause::BusLost, MissionStatus::Returning)
        ),
        "{out:?}"
    );
    let drives = out.rsplit(|output| !matches!(output, Out::Command(_, MoveCommand::Drive { .. })));
    let last = drives
        .filter_map(driven)
        .next()
        .and_then(|route| route.last().copied());
    assert_eq!(last, Some(settings(1).home), "{out:?}");
    let out = pass(&mut mission, 80..85, 0.0, &[sighting(2, 20.0)]);
    assert!(has(&out, MissionEvent::Home), "{out:?}");
    assert_eq!(mission.status(), MissionStatus::Home);
}

#[test]
fn a_minute_without_bus_and_radio_is_stood_through_until_the_ground_decides() {
    let mut mission = under_way();
    pass(&mut mission, 10..100, 0.0, &[]);
    let out = pass(&mut mission, 100..110, 0.0, &[GROUND]);
    assert_eq!(
        (driven(&out), mission.status()),
        (None, MissionStatus::Held)
    );
    let out = fed(&mut mission, 110.0, order(OrderKind::Start));
    assert!(
        driven(&out).is_some() || driven(&pass(&mut mission, 110..112, 0.0, &[GROUND])).is_some()
    );
}

#[test]
fn who_came_home_on_its_own_adopts_a_newer_plan_and_drives_it() {
    let mut mission = under_way();
    pass(&mut mission, 10..80, 1.0, &[sighting(2, 20.0)]);
    pass(&mut mission, 80..85, 0.0, &[sighting(2, 20.0)]);
    assert_eq!(mission.status(), MissionStatus::Home);
    let out = fed(&mut mission, 85.0, order(OrderKind::Start));
    assert_eq!(
        driven(&out),
        None,
        "its old plan does not lead on from here"
    );
    let out = pass(&mut mission, 85..90, 0.0, &[GROUND]);
    assert_eq!(driven(&out), None);
    fed(&mut mission, 90.0, plan(3, &[]));
    fed(&mut mission, 90.0, plan(4, &[(2.0, 0.0)]));
    let out = pass(&mut mission, 90..92, 0.0, &[GROUND]);
    assert!(driven(&out).is_some(), "{out:?}");
}

#[test]
fn a_newer_plan_alone_takes_a_returning_vehicle_back() {
    let mut mission = under_way();
    pass(&mut mission, 10..80, 1.0, &[sighting(2, 20.0)]);
    fed(&mut mission, 80.0, GROUND);
    let out = fed(&mut mission, 80.0, plan(3, &[]));
    assert!(holds(&out), "{out:?}");
    let out = pass(&mut mission, 80..82, 1.0, &[GROUND]);
    assert_eq!(
        (driven(&out), mission.status()),
        (None, MissionStatus::Following)
    );
    assert_eq!(mission.plan.progress().revision, Revision(3));
}

#[test]
fn what_was_held_by_order_stays_held_without_bus() {
    let mut mission = under_way();
    fed(&mut mission, 10.0, order(OrderKind::Hold));
    let out = pass(&mut mission, 10..100, 0.0, &[sighting(2, 20.0)]);
    assert_eq!(
        (driven(&out), mission.status()),
        (None, MissionStatus::Held)
    );
}

#[test]
fn a_low_battery_sends_home_and_an_empty_one_holds() {
    let mut mission = under_way();
    let battery = |battery: f64, x_m: f64| {
        In::State(OwnState {
            battery: Some(battery),
            sequence: 500,
            ..own_state(x_m, 0.0)
        })
    };
    let out = fed(&mut mission, 10.0, battery(0.21, 1.0));
    assert!(!has(
        &out,
        MissionEvent::Decides(AutonomyCause::BatteryLow, MissionStatus::Returning)
    ));
    let out = fed(&mut mission, 10.1, battery(0.19, 1.0));
    assert!(
        has(
            &out,
            MissionEvent::Decides(AutonomyCause::BatteryLow, MissionStatus::Returning)
        ),
        "{out:?}"
    );
    fed(&mut mission, 10.2, order(OrderKind::Start));
    assert_eq!(
        mission.status(),
        MissionStatus::Returning,
        "a start does not charge it"
    );
    let out = fed(&mut mission, 10.3, battery(0.04, 1.0));
    assert!(
        has(
            &out,
            MissionEvent::Decides(AutonomyCause::BatteryEmpty, MissionStatus::Held)
        ),
        "{out:?}"
    );
    assert!(holds(&out));
}

#[test]
fn a_silent_peer_is_said_once_and_said_again_when_it_speaks() {
    let mut mission = under_way();
    fed(&mut mission, 10.0, sighting(2, 20.0));
    let out = pass(&mut mission, 10..20, 0.0, &[GROUND]);
    let output = |out: &[Out], event: fn(VehicleId) -> MissionEvent| {
        out.iter()
            .filter(|output| **output == Out::MissionEvent(event(VehicleId(2))))
            .count()
    };
    assert_eq!(output(&out, MissionEvent::Silent), 1);
    let out = pass(&mut mission, 20..22, 0.0, &[GROUND, sighting(2, 20.0)]);
    assert_eq!(output(&out, MissionEvent::HeardAgain), 1);
}

#[test]
fn a_lower_id_that_drives_by_radio_goes_home_first() {
    let mut mission = Mission::new(settings(3));
    for tile in super::tests::tiles(None) {
        fed(&mut mission, 1.0, tile);
    }
    fed(&mut mission, 1.0, GROUND);
    let order = Order {
        vehicle: VehicleId(3),
        ..match order(OrderKind::Return) {
            In::Order(order) => order,
            other => panic!("{other:?}"),
        }
    };
    fed(&mut mission, 1.0, sighting(1, 0.5));
    fed(&mut mission, 1.0, In::State(own_state(2.0, 0.0)));
    fed(&mut mission, 1.0, In::Order(order));
    let mut began_s = None;
    for tenth in 10..200 {
        let now_s = 0.1 * f64::from(tenth);
        // Vehicle 1 drives until second 8, and stands then.
        fed(&mut mission, now_s, sighting(1, 0.5 * now_s.min(8.0)));
        let mut out = fed(&mut mission, now_s, In::State(own_state(2.0, 0.0)));
        if mission
            .deadline()
            .is_some_and(|deadline| deadline.at <= at(now_s))
        {
            mission.wake(at(now_s), &mut out).unwrap();
        }
        if driven(&out).is_some() {
            began_s.get_or_insert(now_s);
        }
    }
    let began_s = began_s.expect("it returns");
    assert!((9.0..14.0).contains(&began_s), "after {began_s} s");
}

#[test]
fn plans_of_a_lower_right_and_old_ones_are_not_taken() {
    let mut mission = planned(None);
    let lease = |number| Lease { number, holder: 7 };
    let edition = |out: &[Out]| {
        out.iter()
            .any(|out| matches!(out, Out::MissionEvent(MissionEvent::OldPlan(..))))
    };
    let with = |number, sequence, revision| match plan(revision, &[]) {
        In::Plan(plan) => {
            let seen = Some(SeenState {
                boot: Boot(1),
                sequence,
            })
            .filter(|_| sequence > 0);
            In::Plan(Plan {
                lease: lease(number),
                seen,
                ..plan
            })
        }
        other => other,
    };
    for (second, sequence) in [(2.0, 20), (20.0, 200), (21.0, 210)] {
        fed(
            &mut mission,
            second,
            In::State(OwnState {
                sequence,
                ..own_state(0.0, 0.0)
            }),
        );
    }
    assert!(
        edition(&fed(&mut mission, 21.0, with(5, 20, 3))),
        "answers a state of 19 s ago"
    );
    assert!(
        edition(&fed(&mut mission, 21.0, with(5, 900, 4))),
        "answers a state that was never made"
    );
    assert_eq!(mission.plan.progress().revision, Revision(2));
    fed(&mut mission, 21.0, with(5, 200, 5));
    assert_eq!(mission.plan.progress().revision, Revision(5));
    assert!(
        edition(&fed(&mut mission, 21.0, with(4, 210, 6))),
        "of a lower right"
    );
    assert_eq!(mission.plan.progress().revision, Revision(5));
    let mut own = OwnState {
        sequence: 211,
        mode: VehicleMode::Idle,
        ..own_state(0.0, 0.0)
    };
    own.ordered.lease = lease(9);
    fed(&mut mission, 21.1, In::State(own.clone()));
    fed(&mut mission, 21.1, with(9, 210, 1));
    assert_eq!(
        mission.plan.progress().revision,
        Revision(5),
        "its start was tried and is not obeyed: the disk has not got its lease"
    );
    fed(&mut mission, 21.1, with(5, 211, 6));
    assert_eq!(mission.plan.progress().revision, Revision(5));
    own.ordered.kind = Some(OrderKind::Hold);
    fed(&mut mission, 21.1, In::State(own));
    assert!(
        edition(&fed(&mut mission, 21.1, with(5, 210, 7))),
        "a higher right was obeyed"
    );
}

#[test]
fn what_sends_a_vehicle_home_by_itself_ends_a_mission_of_its_own() {
    let task = Some(tomoswarm_proto::TaskKind::Explore);
    let started = || {
        let mut mission = Mission::new(VehicleSettings {
            task: task.clone(),
            ..settings(1)
        });
        fed(&mut mission, 1.0, GROUND);
        fed(&mut mission, 1.0, In::State(own_state(0.0, 0.0)));
        fed(&mut mission, 1.1, order(OrderKind::Start));
        mission
    };
    let end = |mission: &Mission| mission.runner.as_ref().and_then(StepRunner::end).cloned();
    for (battery, expected) in [
        (0.3, None),
        (0.1, Some(EndReason::BatteryLow)),
        (0.01, Some(EndReason::BatteryLow)),
    ] {
        let mut mission = started();
        let low = crate::node::OwnState {
            battery: Some(battery),
            ..own_state(0.0, 0.0)
        };
        let out = fed(&mut mission, 2.0, In::State(low));
        assert_eq!(end(&mission), expected, "{battery}");
        assert_eq!(
            has(&out, MissionEvent::Ended(EndReason::BatteryLow)),
            expected.is_some()
        );
    }
    let mut mission = started();
    let mut own = own_state(0.0, 0.0);
    for step in 0..1000 {
        fed(&mut mission, 2.0 + 0.1 * f64::from(step), sighting(2, 4.0));
        own.sequence += 1;
        fed(
            &mut mission,
            2.0 + 0.1 * f64::from(step),
            In::State(own.clone()),
        );
    }
    assert_eq!(mission.goal.cause(), Some(AutonomyCause::BusLost));
    assert_eq!(end(&mission), Some(EndReason::BusLost));
}

/// The task of vehicle 1 to explore in the run in which it was started.
fn exploration(mission: &Mission) -> In {
    In::Task(Task {
        lease: Lease::default(),
        run: mission.assignment.run(),
        members: vec![VehicleId(1)],
        compare_with: None,
        kind: tomoswarm_proto::TaskKind::Explore,
    })
}

#[test]
fn a_task_that_comes_after_a_vehicle_has_gone_home_by_itself_ends_with_that_reason() {
    let mut mission = Mission::new(settings(1));
    fed(&mut mission, 1.0, GROUND);
    fed(&mut mission, 1.0, In::State(own_state(0.0, 0.0)));
    fed(&mut mission, 1.1, order(OrderKind::Start));
    let low = crate::node::OwnState {
        battery: Some(0.1),
        ..own_state(0.0, 0.0)
    };
    fed(&mut mission, 2.0, In::State(low));
    assert_eq!(mission.goal.cause(), Some(AutonomyCause::BatteryLow));
    let task = exploration(&mission);
    let out = fed(&mut mission, 3.0, task);
    assert!(
        has(&out, MissionEvent::Ended(EndReason::BatteryLow)),
        "{out:?}"
    );
}

#[test]
fn a_run_that_begins_while_something_keeps_a_vehicle_at_home_ends_there_with_that_reason() {
    for (battery, kept) in [(0.1, true), (0.9, false)] {
        let mut mission = Mission::new(settings(1));
        fed(&mut mission, 1.0, GROUND);
        fed(&mut mission, 1.0, In::State(own_state(0.0, 0.0)));
        fed(&mut mission, 1.1, order(OrderKind::Start));
        let charged = |battery| crate::node::OwnState {
            battery: Some(battery),
            ..own_state(0.0, 0.0)
        };
        fed(&mut mission, 2.0, In::State(charged(0.1)));
        mission.goal = Goal::Home(GoalSource::Itself(AutonomyCause::BatteryLow));
        fed(&mut mission, 3.0, In::State(charged(battery)));
        assert_eq!(mission.holds_for().is_some(), kept);
        let next = RunId(mission.assignment.run().0 + 1);
        let In::Task(task) = exploration(&mission) else {
            unreachable!()
        };
        fed(&mut mission, 4.0, In::Task(Task { run: next, ..task }));
        let In::Order(start) = order(OrderKind::Start) else {
            unreachable!()
        };
        let out = fed(&mut mission, 5.0, In::Order(Order { run: next, ..start }));
        let ends = has(&out, MissionEvent::Ended(EndReason::BatteryLow));
        assert_eq!(ends, kept, "{out:?}");
        let status = if kept {
            MissionStatus::Home
        } else {
            MissionStatus::Following
        };
        assert_eq!(mission.goal.status(), status);
    }
}

#[test]
fn a_task_that_comes_while_a_vehicle_drives_home_leaves_it_on_its_way() {
    let mut mission = Mission::new(settings(1));
    let away = own_state(5.0, 0.0);
    fed(&mut mission, 1.0, GROUND);
    fed(&mut mission, 1.0, In::State(away.clone()));
    fed(&mut mission, 1.1, order(OrderKind::Start));
    let low = crate::node::OwnState {
        battery: Some(0.1),
        sequence: away.sequence + 1,
        ..away
    };
    fed(&mut mission, 2.0, In::State(low));
    assert!(mission.goal.drives_home(), "{:?}", mission.goal);
    let task = exploration(&mission);
    let out = fed(&mut mission, 3.0, task);
    assert!(!has(&out, MissionEvent::Home), "{out:?}");
    assert!(mission.goal.drives_home(), "{:?}", mission.goal);
}

#[test]
fn a_vehicle_at_home_with_an_empty_battery_is_home_when_it_is_to_return() {
    let home = settings(1).home;
    let empty = |off_m: f64| {
        In::State(crate::node::OwnState {
            battery: Some(0.04),
            ..own_state(home.x_m + off_m, home.y_m)
        })
    };
    for (off_m, expected) in [(0.0, MissionStatus::Home), (3.0, MissionStatus::Held)] {
        let mut mission = Mission::new(settings(1));
        fed(&mut mission, 1.0, GROUND);
        fed(&mut mission, 1.0, empty(off_m));
        fed(&mut mission, 1.1, order(OrderKind::Return));
        assert_eq!(mission.status(), expected, "{off_m} m from home");
    }
}
