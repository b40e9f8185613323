//! What the mission actor does with plans, orders and what is in its way; its map is known free around the datum.

use std::sync::Arc;
use std::time::Duration;
use tomoswarm_proto::TileReport;

use tomoswarm_proto::{
    Boot, Lease, MissionEnd, MissionKind, MissionPhase, MissionRefusal, Plan, Position, Revision,
    SeenState, State, Stop, StopId, TaskKind, TileAddress, VehicleId, VehicleMode,
};

use super::super::tests_support::{own_state, settings, state};
use super::*;
use crate::actor::Input;
use crate::node::vehicle::MoveCommand;

const RUN: RunId = RunId(1);
/// The first state of the vehicle.
const SEEN: SeenState = SeenState {
    boot: Boot(1),
    sequence: 1,
};

pub(super) fn at(time_s: f64) -> Time {
    Time::from_secs_f64(time_s)
}

pub(super) fn fed(mission: &mut Mission, time_s: f64, input: In) -> Vec<Out> {
    let mut out = Vec::new();
    mission.handle(at(time_s), input, &mut out).unwrap();
    // The disk takes no time.
    let memory = out.iter().find_map(|out| {
        if let Out::Remember(memory) = out {
            Some(*memory)
        } else {
            None
        }
    });
    if let Some(memory) = memory {
        let remembered = Remembered {
            on_disk: memory,
            tried: memory,
        };
        mission
            .handle(at(time_s), In::Remembered(remembered), &mut out)
            .unwrap();
    }
    out
}

/// Tiles that are free for 6 m around the datum, but for what lies in `wall` (x from, x to, metres).
pub(super) fn tiles(wall: Option<(f64, f64)>) -> Vec<In> {
    let cell = |x: i32, index: usize| {
        let middle_m = (f64::from(x * 32 + (index % 32) as i32) + 0.5) * 0.2;
        if wall.is_some_and(|(from, to)| (from..to).contains(&middle_m)) {
            17
        } else {
            -17
        }
    };
    let tile = |x: i32, y: i32| TileReport {
        layer: Default::default(),
        address: TileAddress { slice: 0, x, y },
        revision: 1,
        cells: Arc::new(std::array::from_fn(|index| cell(x, index))),
    };
    (-1..1)
        .flat_map(|x| (-1..1).map(move |y| (x, y)))
        .map(|(x, y)| In::Tile(tile(x, y).into()))
        .collect()
}

pub(super) fn plan(revision: u32, stops: &[(f64, f64)]) -> In {
    let stop = |(index, (x_m, y_m)): (usize, &(f64, f64))| Stop {
        id: StopId(index as u32 + 1),
        at: Position::from_metres(*x_m, *y_m, 0.0),
        route: vec![],
        dwell_ms: 0,
        dwell_limit_ms: 0,
        partners: vec![],
        after: vec![],
    };
    let (vehicle, members) = (VehicleId(1), vec![VehicleId(1)]);
    let stops = stops.iter().enumerate().map(stop).collect();
    let revision = Revision(revision);
    In::Plan(Plan {
        vehicle,
        run: RUN,
        revision,
        members,
        stops,
        ..Plan::default()
    })
}

pub(super) fn order(kind: OrderKind) -> In {
    let (vehicle, lease) = (VehicleId(1), Lease::default());
    In::Order(Order {
        vehicle,
        lease,
        run: RUN,
        revision: Revision(1),
        seen: Some(SEEN),
        kind,
        ends: vec![],
    })
}

/// A mission at the datum that has adopted a plan to (2, 0) and (2, 2), and not been started.
pub(super) fn planned(wall: Option<(f64, f64)>) -> Mission {
    let mut mission = Mission::new(settings(1));
    fed(&mut mission, 1.0, In::State(own_state(0.0, 0.0)));
    for tile in tiles(wall) {
        fed(&mut mission, 1.0, tile);
    }
    fed(&mut mission, 1.0, plan(1, &[]));
    let out = fed(&mut mission, 1.0, plan(2, &[(2.0, 0.0), (2.0, 2.0)]));
    assert!(out.contains(&Out::Accepted(RUN, Revision(2))), "{out:?}");
    mission
}

/// A vehicle on known ground at the datum that was started in a mission of its own.
pub(super) fn started(task: TaskKind) -> Mission {
    let mut mission = Mission::new(VehicleSettings {
        task: Some(task),
        ..settings(1)
    });
    fed(&mut mission, 1.0, In::State(own_state(0.0, 0.0)));
    for tile in tiles(None) {
        fed(&mut mission, 1.0, tile);
    }
    fed(&mut mission, 1.1, order(OrderKind::Start));
    mission
}

pub(super) fn driven(out: &[Out]) -> Option<Vec<Point>> {
    out.iter().find_map(|out| match out {
        Out::Command(_, MoveCommand::Drive { route, .. }) => Some(route.clone()),
        Out::Command(..)
        | Out::Holds(_)
        | Out::Accepted(..)
        | Out::Progress(_)
        | Out::Measure(_)
        | Out::Remember(_)
        | Out::MissionEvent(_) => None,
    })
}

pub(super) fn holds(out: &[Out]) -> bool {
    out.iter()
        .any(|out| matches!(out, Out::Command(_, MoveCommand::Hold)))
}

/// Repeats a state until the mission says something that counts, or a minute is over.
fn until(
    mission: &mut Mission,
    from_s: f64,
    x_m: f64,
    counts: impl Fn(&Out) -> bool,
) -> Option<f64> {
    (1..600)
        .map(|tenth| from_s + 0.1 * f64::from(tenth))
        .find(|now_s| {
            let mut out = Vec::new();
            if mission
                .deadline()
                .is_some_and(|deadline| deadline.at <= at(*now_s))
            {
                mission.wake(at(*now_s), &mut out).unwrap();
            }
            out.extend(fed(mission, *now_s, In::State(own_state(x_m, 0.0))));
            out.iter().any(&counts)
        })
}

#[test]
fn nothing_is_driven_or_measured_before_a_start() {
    let mut mission = planned(None);
    assert_eq!(
        until(&mut mission, 1.0, 0.0, |out| matches!(
            out,
            Out::Command(..) | Out::Measure(_)
        )),
        None
    );
    let out = fed(&mut mission, 70.0, order(OrderKind::Start));
    assert!(out.contains(&Out::Measure(Some(RUN))));
    assert_eq!(
        driven(&out).unwrap().last(),
        Some(&Point::new(2.0, 2.0)),
        "the first stop is driven through"
    );
}

#[test]
fn a_hold_stops_and_a_start_goes_on() {
    let mut mission = planned(None);
    assert!(driven(&fed(&mut mission, 2.0, order(OrderKind::Start))).is_some());
    let out = fed(&mut mission, 3.0, order(OrderKind::Hold));
    assert!(holds(&out) && out.contains(&Out::Measure(None)));
    assert_eq!(
        until(&mut mission, 3.0, 1.0, |out| matches!(
            out,
            Out::Command(..)
        )),
        None
    );
    fed(&mut mission, 70.0, order(OrderKind::Start));
    assert!(
        until(&mut mission, 70.0, 1.0, |out| matches!(
            out,
            Out::Command(_, MoveCommand::Drive { .. })
        ))
        .is_some()
    );
}

#[test]
fn a_held_vehicle_takes_a_new_revision_from_where_it_stands() {
    let mut mission = planned(None);
    fed(&mut mission, 2.0, order(OrderKind::Start));
    fed(&mut mission, 3.0, In::State(own_state(1.0, 0.0)));
    assert!(
        !fed(&mut mission, 3.0, plan(3, &[])).contains(&Out::Accepted(RUN, Revision(3))),
        "on a leg"
    );
    fed(&mut mission, 4.0, order(OrderKind::Hold));
    let adopts = |out: &Out| *out == Out::Accepted(RUN, Revision(3));
    assert!(
        until(&mut mission, 4.0, 1.0, adopts).is_some()
            || mission.plan.progress().revision == Revision(3)
    );
}

#[test]
fn a_blocked_route_is_planned_anew_and_a_closed_one_is_said() {
    // A wall through the whole known world, and beyond it nothing is known: searched, looked at, and said.
    let mut mission = planned(Some((1.4, 1.8)));
    fed(&mut mission, 2.0, order(OrderKind::Start));
    let looks = until(&mut mission, 2.0, 0.8, |out| {
        matches!(out, Out::MissionEvent(MissionEvent::Blocked(_)))
    });
    assert!(looks.is_some(), "the wall is met");
    assert_eq!(
        mission.plan.progress().done,
        None,
        "nothing is done by that"
    );
}

#[test]
fn the_way_home_waits_until_lower_ids_are_quiet() {
    let mut mission = Mission::new(settings(2));
    fed(&mut mission, 1.0, In::State(own_state(2.0, 0.0)));
    for tile in tiles(None) {
        fed(&mut mission, 1.0, tile);
    }
    fed(
        &mut mission,
        1.0,
        In::Peer(State {
            mode: VehicleMode::Driving,
            ..state(1, 5.0, 5.0)
        }),
    );
    fed(&mut mission, 2.0, order(OrderKind::Return));
    let drives = |out: &Out| matches!(out, Out::Command(_, MoveCommand::Drive { .. }));
    for second in 2..22 {
        let (now_s, sequence) = (f64::from(second), u64::from(second as u32));
        fed(
            &mut mission,
            now_s,
            In::Peer(State {
                mode: VehicleMode::Driving,
                sequence,
                ..state(1, 5.0, 5.0)
            }),
        );
        let out = fed(&mut mission, now_s, In::State(own_state(2.0, 0.0)));
        assert!(!out.iter().any(drives), "after {now_s} s");
    }
    fed(
        &mut mission,
        70.0,
        In::Peer(State {
            sequence: 30,
            ..state(1, 5.0, 5.0)
        }),
    );
    assert!(until(&mut mission, 70.0, 2.0, drives).is_some());
}

#[test]
fn neither_an_order_nor_a_tile_is_lost_to_a_slow_mission() {
    let mut seat = crate::actor::ActorCell::new(planned(None));
    seat.push(order(OrderKind::Hold));
    for tile in tiles(Some((1.4, 1.8))) {
        seat.push(tile);
    }
    for revision in 1..2000 {
        let progress = VehicleProgress {
            vehicle: VehicleId(2),
            revision: Revision(revision),
            ..VehicleProgress::default()
        };
        seat.push(In::Progress(progress));
        seat.push(tiles(None).remove(0));
    }
    assert_eq!(seat.dropped(), 0);
    let mut out = Vec::new();
    seat.act(at(2.0), |output| out.push(output)).unwrap();
    assert!(holds(&out), "{out:?}");
}

#[test]
fn a_plan_out_of_the_fence_is_refused_once_and_the_old_one_followed() {
    let mut mission = planned(None);
    let out = fed(&mut mission, 1.5, plan(3, &[(2.0, 0.0), (26.0, 0.0)]));
    assert_eq!(
        out,
        [Out::MissionEvent(MissionEvent::Outside(Point::new(
            26.0, 0.0
        )))]
    );
    assert_eq!(
        fed(&mut mission, 6.5, plan(3, &[(2.0, 0.0), (26.0, 0.0)])),
        [],
        "repeated by the ground"
    );
    assert!(driven(&fed(&mut mission, 7.0, order(OrderKind::Start))).is_some());
}

#[test]
fn a_peer_whose_old_state_comes_late_is_still_driving() {
    let mut mission = Mission::new(settings(2));
    fed(&mut mission, 1.0, In::State(own_state(2.0, 0.0)));
    for tile in tiles(None) {
        fed(&mut mission, 1.0, tile);
    }
    fed(
        &mut mission,
        1.0,
        In::Peer(State {
            mode: VehicleMode::Driving,
            sequence: 9,
            ..state(1, 5.0, 5.0)
        }),
    );
    fed(
        &mut mission,
        1.1,
        In::Peer(State {
            sequence: 8,
            ..state(1, 5.0, 5.0)
        }),
    );
    fed(&mut mission, 2.0, order(OrderKind::Return));
    let drives = |out: &Out| matches!(out, Out::Command(_, MoveCommand::Drive { .. }));
    let began_s = until(&mut mission, 4.0, 2.0, drives)
        .expect("what has fallen silent is not waited for forever");
    assert!(began_s > 20.0, "after {began_s} s");
}

#[test]
#[allow(clippy::disallowed_methods, reason = "the work itself is measured")]
fn a_place_far_away_is_not_searched_for() {
    let mut terrain = Terrain::new(settings(1));
    let Some(In::Tile(tile)) = tiles(None).pop() else {
        panic!("a tile")
    };
    terrain.learn(&tile);
    let begin = std::time::Instant::now();
    for _ in 0..500 {
        assert!(!terrain.can_reach(at(1.0), own_state(0.0, 0.0).pose, Point::new(9e5, 9e5)));
    }
    assert!(
        begin.elapsed() < Duration::from_secs(1),
        "{:?}",
        begin.elapsed()
    );
}

fn task(lease: Lease, run: RunId, members: &[u8], kind: TaskKind) -> In {
    let members = members.iter().map(|id| VehicleId(*id)).collect();
    In::Task(Task {
        lease,
        run,
        members,
        compare_with: None,
        kind,
    })
}

fn start(mission: &mut Mission, time_s: f64, run: u32, lease: Lease) -> Vec<Out> {
    let (vehicle, revision, kind) = (VehicleId(1), Revision(run), OrderKind::Start);
    let start = Order {
        vehicle,
        lease,
        run: RunId(run),
        revision,
        seen: Some(SEEN),
        kind,
        ends: vec![],
    };
    fed(mission, time_s, In::Order(start))
}

/// What a mission shows of what it is out for.
fn shown(mission: &Mission) -> (RunId, MissionKind, MissionPhase, Option<MissionEnd>) {
    let output = mission.on_wire();
    (output.progress.run, output.kind, output.phase, output.end)
}

#[test]
fn a_task_moves_nobody_and_its_start_begins_it_in_place_of_the_plan() {
    let mut mission = planned(None);
    assert_eq!(
        fed(
            &mut mission,
            1.5,
            task(Lease::default(), RunId(2), &[1], TaskKind::Browse)
        ),
        []
    );
    start(&mut mission, 2.0, 1, Lease::default());
    assert_eq!(
        shown(&mission).1,
        MissionKind::Sweep,
        "run 1 is another one"
    );
    let out = start(&mut mission, 3.0, 2, Lease::default());
    assert!(holds(&out), "what was driven is given up");
    assert!(
        out.contains(&Out::Measure(None)),
        "nothing is measured for the sweep any more"
    );
    assert!(
        out.iter()
            .any(|out| matches!(out, Out::Progress(output) if output.kind == MissionKind::Browse))
    );
    mission.wake(at(3.2), &mut Vec::new()).unwrap();
    assert_eq!(
        shown(&mission),
        (RunId(2), MissionKind::Browse, MissionPhase::Looking, None)
    );
    // Back in the sweep it waits for a plan from where it is.
    let out = start(&mut mission, 9.0, 3, Lease::default());
    assert_eq!(
        (driven(&out), shown(&mission).1),
        (None, MissionKind::Sweep)
    );
}

#[test]
fn a_task_that_comes_after_its_start_counts_at_once_and_the_same_one_changes_nothing() {
    let mut mission = planned(None);
    start(&mut mission, 2.0, 2, Lease::default());
    let browse = task(Lease::default(), RunId(2), &[1], TaskKind::Browse);
    assert!(holds(&fed(&mut mission, 3.0, browse.clone())));
    mission.wake(at(3.2), &mut Vec::new()).unwrap();
    let before = shown(&mission);
    assert_eq!(before.2, MissionPhase::Looking);
    assert!(!holds(&fed(&mut mission, 4.0, browse)));
    assert_eq!(shown(&mission), before);
    // A start of the same run goes on with it.
    let out = start(&mut mission, 5.0, 2, Lease::default());
    assert!(!out.iter().any(|out| matches!(out, Out::Progress(_))));
}

#[test]
fn a_task_by_a_lower_right_than_is_followed_is_passed_over() {
    let lease = |number| Lease { number, holder: 7 };
    for (number, kind) in [
        (3, MissionKind::Sweep),
        (4, MissionKind::Browse),
        (5, MissionKind::Browse),
    ] {
        let mut mission = planned(None);
        start(&mut mission, 2.0, 2, lease(4));
        fed(
            &mut mission,
            3.0,
            task(lease(number), RunId(2), &[1], TaskKind::Browse),
        );
        assert_eq!(shown(&mission).1, kind, "lease {number}");
        assert_eq!(mission.on_wire().lease_number, 4, "a task takes no lease");
    }
}

#[test]
fn who_refuses_its_task_stands_says_why_and_is_free_for_the_next_one() {
    let mut mission = planned(None);
    fed(
        &mut mission,
        1.5,
        task(Lease::default(), RunId(2), &[2, 3], TaskKind::Explore),
    );
    let out = start(&mut mission, 2.0, 2, Lease::default());
    let refused = EndReason::Refused(MissionRefusal::NoPlace);
    assert!(
        out.contains(&Out::MissionEvent(MissionEvent::Ended(refused))) && driven(&out).is_none()
    );
    let end = Some(MissionEnd::Refused(MissionRefusal::NoPlace));
    assert_eq!(
        shown(&mission),
        (RunId(2), MissionKind::Explore, MissionPhase::Over, end)
    );
    assert_eq!(
        until(&mut mission, 2.0, 0.0, |out| matches!(
            out,
            Out::Command(..) | Out::Measure(_)
        )),
        None
    );
    fed(
        &mut mission,
        70.0,
        task(Lease::default(), RunId(2), &[1, 2], TaskKind::Explore),
    );
    mission.wake(at(70.2), &mut Vec::new()).unwrap();
    assert_eq!(
        shown(&mission),
        (RunId(2), MissionKind::Explore, MissionPhase::Looking, None)
    );
}

#[test]
fn a_vehicle_that_is_held_takes_a_task_and_stays_held() {
    let mut mission = planned(None);
    start(&mut mission, 2.0, 2, Lease::default());
    fed(&mut mission, 3.0, order(OrderKind::Hold));
    let out = fed(
        &mut mission,
        4.0,
        task(Lease::default(), RunId(2), &[1], TaskKind::Browse),
    );
    assert!(
        !out.iter().any(|out| matches!(out, Out::Command(..))),
        "{out:?}"
    );
    assert_eq!(shown(&mission).2, MissionPhase::Held);
}

#[test]
fn of_two_unread_orders_that_the_vehicle_obeys_the_newer_one_stays() {
    let given = |revision: u32, kind| {
        let In::Order(order) = order(kind) else {
            panic!("it is an order");
        };
        let revision = Revision(revision);
        In::Order(Order { revision, ..order })
    };
    let (hold, start) = (given(5, OrderKind::Hold), given(6, OrderKind::Start));
    assert_eq!(In::join(hold.clone(), start.clone()), start);
    assert_eq!(In::join(start.clone(), hold), start);
}

#[test]
fn of_two_unread_tasks_of_a_run_the_one_of_the_greater_right_stays() {
    let lease = |number| Lease { number, holder: 7 };
    let given = |number, kind| task(lease(number), RunId(2), &[1], kind);
    let (low, high) = (given(1, TaskKind::Browse), given(2, TaskKind::Search));
    assert_eq!(In::join(high.clone(), low.clone()), high);
    assert_eq!(In::join(low, high.clone()), high);
    assert_eq!(
        In::join(high, given(2, TaskKind::Browse)),
        given(2, TaskKind::Browse)
    );
}
