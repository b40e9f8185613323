//! What the mission actor does with plans, orders and what is in its way; its map is known free around the datum.

use std::sync::Arc;
use tomoswarm_proto::TileReport;

use tomoswarm_proto::{Boot, Lease, Mode, Position, Revision, State, Stop, StopId, TileAddress};

use super::super::tests_support::{own_state, settings, state};
use super::*;

const RUN: RunId = RunId(1);
/// The first state of the vehicle.
const SEEN: SeenState = SeenState { boot: Boot(1), sequence: 1 };

pub(super) fn at(time_s: f64) -> Time {
    Time::from_secs_f64(time_s)
}

pub(super) fn told(mission: &mut Mission, time_s: f64, input: In) -> Vec<Out> {
    let mut out = Vec::new();
    mission.handle(at(time_s), input, &mut out).unwrap();
    // The disk takes no time.
    let memory =
        out.iter().find_map(|out| if let Out::Remember(memory) = out { Some(*memory) } else { None });
    if let Some(memory) = memory {
        let remembered = Remembered { on_disk: memory, tried: memory };
        mission.handle(at(time_s), In::Remembered(remembered), &mut out).unwrap();
    }
    out
}

/// Tiles that are free for 6 m around the datum, but for what lies in `wall` (x from, x to, metres).
pub(super) fn tiles(wall: Option<(f64, f64)>) -> Vec<In> {
    let cell = |x: i32, index: usize| {
        let middle_m = (f64::from(x * 32 + (index % 32) as i32) + 0.5) * 0.2;
        if wall.is_some_and(|(from, to)| (from..to).contains(&middle_m)) { 17 } else { -17 }
    };
    let tile = |x: i32, y: i32| TileReport {
        layer: Default::default(),
        address: TileAddress { slice: 0, x, y },
        revision: 1,
        cells: Arc::new(std::array::from_fn(|index| cell(x, index))),
    };
    (-1..1).flat_map(|x| (-1..1).map(move |y| (x, y))).map(|(x, y)| In::Tile(tile(x, y))).collect()
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
    In::Plan(Plan { vehicle, run: RUN, revision, members, stops, ..Plan::default() })
}

pub(super) fn order(kind: OrderKind) -> In {
    let (vehicle, lease) = (VehicleId(1), Lease::default());
    In::Order(Order { vehicle, lease, run: RUN, revision: Revision(1), seen: Some(SEEN), kind, ends: vec![] })
}

/// A mission at the datum that has adopted a plan to (2, 0) and (2, 2), and not been started.
pub(super) fn planned(wall: Option<(f64, f64)>) -> Mission {
    let mut mission = Mission::new(settings(1));
    told(&mut mission, 1.0, In::State(own_state(0.0, 0.0)));
    for tile in tiles(wall) {
        told(&mut mission, 1.0, tile);
    }
    told(&mut mission, 1.0, plan(1, &[]));
    let out = told(&mut mission, 1.0, plan(2, &[(2.0, 0.0), (2.0, 2.0)]));
    assert!(out.contains(&Out::Accepted(RUN, Revision(2))), "{out:?}");
    mission
}

pub(super) fn driven(out: &[Out]) -> Option<Vec<Point>> {
    out.iter().find_map(|out| match out {
        Out::Command(_, Command::Drive { route, .. }) => Some(route.clone()),
        Out::Command(..)
        | Out::Holds(_)
        | Out::Accepted(..)
        | Out::Progress(_)
        | Out::Measure(_)
        | Out::Remember(_)
        | Out::Remark(_) => None,
    })
}

pub(super) fn holds(out: &[Out]) -> bool {
    out.iter().any(|out| matches!(out, Out::Command(_, Command::Hold)))
}

/// Repeats a state until the mission says something that counts, or a minute is over.
fn until(mission: &mut Mission, from_s: f64, x_m: f64, counts: impl Fn(&Out) -> bool) -> Option<f64> {
    (1..600).map(|tenth| from_s + 0.1 * f64::from(tenth)).find(|now_s| {
        let mut out = Vec::new();
        if mission.deadline().is_some_and(|deadline| deadline.at <= at(*now_s)) {
            mission.wake(at(*now_s), &mut out).unwrap();
        }
        out.extend(told(mission, *now_s, In::State(own_state(x_m, 0.0))));
        out.iter().any(&counts)
    })
}

#[test]
fn nothing_is_driven_or_measured_before_a_start() {
    let mut mission = planned(None);
    assert_eq!(until(&mut mission, 1.0, 0.0, |out| matches!(out, Out::Command(..) | Out::Measure(_))), None);
    let out = told(&mut mission, 70.0, order(OrderKind::Start));
    assert!(out.contains(&Out::Measure(Some(RUN))));
    assert_eq!(driven(&out).unwrap().last(), Some(&Point::new(2.0, 2.0)), "the first stop is driven through");
}

#[test]
fn a_hold_stops_and_a_start_goes_on() {
    let mut mission = planned(None);
    assert!(driven(&told(&mut mission, 2.0, order(OrderKind::Start))).is_some());
    let out = told(&mut mission, 3.0, order(OrderKind::Hold));
    assert!(holds(&out) && out.contains(&Out::Measure(None)));
    assert_eq!(until(&mut mission, 3.0, 1.0, |out| matches!(out, Out::Command(..))), None);
    told(&mut mission, 70.0, order(OrderKind::Start));
    assert!(
        until(&mut mission, 70.0, 1.0, |out| matches!(out, Out::Command(_, Command::Drive { .. }))).is_some()
    );
}

#[test]
fn a_held_vehicle_takes_a_new_revision_from_where_it_stands() {
    let mut mission = planned(None);
    told(&mut mission, 2.0, order(OrderKind::Start));
    told(&mut mission, 3.0, In::State(own_state(1.0, 0.0)));
    assert!(!told(&mut mission, 3.0, plan(3, &[])).contains(&Out::Accepted(RUN, Revision(3))), "on a leg");
    told(&mut mission, 4.0, order(OrderKind::Hold));
    let adopts = |out: &Out| *out == Out::Accepted(RUN, Revision(3));
    assert!(
        until(&mut mission, 4.0, 1.0, adopts).is_some() || mission.plan.progress().revision == Revision(3)
    );
}

#[test]
fn a_blocked_route_is_planned_anew_and_a_closed_one_is_said() {
    // A wall through the whole known world, and beyond it nothing is known: searched, looked at, and said.
    let mut mission = planned(Some((1.4, 1.8)));
    told(&mut mission, 2.0, order(OrderKind::Start));
    let looks = until(&mut mission, 2.0, 0.6, |out| matches!(out, Out::Remark(Remark::Blocked(_))));
    assert!(looks.is_some(), "the wall is met");
    assert_eq!(mission.plan.progress().done, None, "nothing is done by that");
}

#[test]
fn the_way_home_waits_until_lower_ids_are_quiet() {
    let mut mission = Mission::new(settings(2));
    told(&mut mission, 1.0, In::State(own_state(2.0, 0.0)));
    for tile in tiles(None) {
        told(&mut mission, 1.0, tile);
    }
    told(&mut mission, 1.0, In::Peer(State { mode: Mode::Driving, ..state(1, 5.0, 5.0) }));
    told(&mut mission, 2.0, order(OrderKind::Return));
    let drives = |out: &Out| matches!(out, Out::Command(_, Command::Drive { .. }));
    for second in 2..22 {
        let (now_s, sequence) = (f64::from(second), u64::from(second as u32));
        told(&mut mission, now_s, In::Peer(State { mode: Mode::Driving, sequence, ..state(1, 5.0, 5.0) }));
        let out = told(&mut mission, now_s, In::State(own_state(2.0, 0.0)));
        assert!(!out.iter().any(drives), "after {now_s} s");
    }
    told(&mut mission, 70.0, In::Peer(State { sequence: 30, ..state(1, 5.0, 5.0) }));
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
    seat.act(at(2.0), |said| out.push(said)).unwrap();
    assert!(holds(&out), "{out:?}");
}

#[test]
fn a_plan_out_of_the_fence_is_refused_once_and_the_old_one_followed() {
    let mut mission = planned(None);
    let out = told(&mut mission, 1.5, plan(3, &[(2.0, 0.0), (26.0, 0.0)]));
    assert_eq!(out, [Out::Remark(Remark::Outside(Point::new(26.0, 0.0)))]);
    assert_eq!(told(&mut mission, 6.5, plan(3, &[(2.0, 0.0), (26.0, 0.0)])), [], "repeated by the ground");
    assert!(driven(&told(&mut mission, 7.0, order(OrderKind::Start))).is_some());
}

#[test]
fn a_peer_whose_old_state_comes_late_is_still_driving() {
    let mut mission = Mission::new(settings(2));
    told(&mut mission, 1.0, In::State(own_state(2.0, 0.0)));
    for tile in tiles(None) {
        told(&mut mission, 1.0, tile);
    }
    told(&mut mission, 1.0, In::Peer(State { mode: Mode::Driving, sequence: 9, ..state(1, 5.0, 5.0) }));
    told(&mut mission, 1.1, In::Peer(State { sequence: 8, ..state(1, 5.0, 5.0) }));
    told(&mut mission, 2.0, order(OrderKind::Return));
    let drives = |out: &Out| matches!(out, Out::Command(_, Command::Drive { .. }));
    let began_s =
        until(&mut mission, 4.0, 2.0, drives).expect("what has fallen silent is not waited for forever");
    assert!(began_s > 20.0, "after {began_s} s");
}

#[test]
#[allow(clippy::disallowed_methods, reason = "the work itself is measured")]
fn a_place_far_away_is_not_searched_for() {
    let mut pilot = Pilot::new(settings(1));
    let Some(In::Tile(tile)) = tiles(None).pop() else { panic!("a tile") };
    pilot.learn(&tile);
    let begin = std::time::Instant::now();
    for _ in 0..500 {
        assert!(!pilot.can_reach(at(1.0), &own_state(0.0, 0.0), Point::new(9e5, 9e5)));
    }
    assert!(begin.elapsed() < Duration::from_secs(1), "{:?}", begin.elapsed());
}
