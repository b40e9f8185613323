//! How the station brings a requested sweep to its end, and what it does when no vehicle makes progress.

mod scripted_swarm;

use std::time::Duration;

use tomoswarm_proto::{
    Boot, Ordered, Permille, Plan, Position, Progress, Revision, State, Stop, StopId, TaskKind,
    VehicleId, VehicleMode,
};

use super::*;
use crate::ground::planner::PlannerAnswer;

const RUN: RunId = RunId(2);
const ONE: VehicleId = VehicleId(1);

const LEASE: Lease = Lease {
    number: 1,
    holder: 1,
};

fn settings() -> StationSettings {
    StationSettings {
        compare_with: Some(RunId(1)),
        ..scripted_swarm::settings(1)
    }
}

fn station() -> Station {
    Station::new(settings())
}

fn fed(station: &mut Station, time_s: f64, input: In) -> Vec<Out> {
    let mut out = Vec::new();
    station
        .handle(Time::from_secs_f64(time_s), input, &mut out)
        .unwrap();
    out
}

fn state() -> In {
    In::Bus(Message::State(State {
        vehicle: ONE,
        boot: Boot(1),
        sequence: 1,
        pose: Some(Default::default()),
        is_at_rest: true,
        mode: VehicleMode::Idle,
        battery: Some(Permille::WHOLE),
        leg: None,
        accepted: Default::default(),
        ordered: Default::default(),
        ..State::default()
    }))
}

/// The vehicle shows what somebody else has ordered it: by the lease in force, above all that it was ordered before.
fn shows(station: &mut Station, time_s: f64, run: RunId, kind: OrderKind) -> Vec<Out> {
    let (_, member) = station.fleet.members().next().unwrap();
    let issued = member.dealings().open_order().map(|order| order.revision);
    let echo = member.state().map(|state| state.ordered.revision);
    let revision = Revision(issued.max(echo).unwrap_or_default().0 + 1);
    let sequence = station
        .fleet
        .newest_state(ONE)
        .map_or(1, |seen| seen.sequence + 1);
    let In::Bus(Message::State(state)) = state() else {
        unreachable!()
    };
    let ordered = Ordered {
        lease: LEASE,
        revision,
        run,
        kind: Some(kind),
    };
    fed(
        station,
        time_s,
        In::Bus(Message::State(State {
            sequence,
            ordered,
            ..state
        })),
    )
}

fn progress(revision: u32, done: Option<u32>) -> In {
    let (revision, done) = (Revision(revision), done.map(StopId));
    let boot = Boot(1);
    let progress = Progress {
        run: RUN,
        revision,
        done,
        leg: None,
    };
    In::Bus(Message::Mission(MissionProgress {
        vehicle: ONE,
        boot,
        progress,
        ..MissionProgress::default()
    }))
}

/// Plans of two stops for every request, as the planner would make them.
fn answer(revision: u32) -> In {
    let stop = |id| Stop {
        id: StopId(id),
        at: Position::default(),
        route: vec![],
        dwell_ms: 0,
        dwell_limit_ms: 0,
        partners: vec![],
        after: vec![],
    };
    let stops = vec![stop(1), stop(2)];
    let (members, start) = (vec![ONE], Position::default());
    let plan = Plan {
        vehicle: ONE,
        run: RUN,
        members,
        start,
        stops,
        ..Plan::default()
    };
    let (revision, laps) = (Revision(revision), vec![vec![(ONE, StopId(2))]]);
    In::Planned(PlannerAnswer {
        run: RUN,
        revision,
        plans: Ok(vec![plan]),
        laps,
    })
}

/// The vehicle says again what it said last, if it was heard.
fn says_again(station: &mut Station, time_s: f64) {
    let (_, member) = station.fleet.members().next().unwrap();
    if let Some(state) = member.state().cloned() {
        let sequence = state.sequence + 1;
        let again = Message::State(State { sequence, ..state });
        fed(station, time_s, In::Bus(again));
    }
}

/// Ticks until something is noted; when, and what.
fn next_note(station: &mut Station, within_s: f64) -> Option<StationEvent> {
    let mut out = Vec::new();
    let until = station.deadline()?.at + Duration::from_secs_f64(within_s);
    while let Some(deadline) = station.deadline().filter(|deadline| deadline.at < until) {
        says_again(station, deadline.at.as_secs_f64());
        station.wake(deadline.at, &mut out).unwrap();
        let note = out.drain(..).find_map(|out| match out {
            Out::StationEvent(note) => Some(note),
            Out::Publish(_) | Out::Ask(_) | Out::Reconstruct(_) | Out::Remember(_) => None,
            Out::BeginRun { .. } | Out::EndRun(_) => None,
        });
        if note.is_some() {
            return note;
        }
    }
    None
}

/// A station whose vehicle follows a plan of two stops.
fn running() -> Station {
    let mut station = station();
    shows(&mut station, 0.1, RUN, OrderKind::Start);
    begin(&mut station, 1);
    station
}

/// Lets the vehicle stop under an empty revision, and begin the next.
fn begin(station: &mut Station, empty: u32) {
    let planned_s = plan(station, empty);
    fed(station, planned_s + 0.1, progress(empty + 1, None));
}

/// Lets the vehicle stop under an empty revision, and gives the plans of the next one; returns when.
fn plan(station: &mut Station, empty: u32) -> f64 {
    let now_s = station
        .deadline()
        .map_or(0.0, |deadline| deadline.at.as_secs_f64());
    fed(station, now_s, state());
    let mut out = Vec::new();
    station.wake(Time::from_secs_f64(now_s), &mut out).unwrap();
    fed(station, now_s, progress(empty, None));
    station
        .wake(Time::from_secs_f64(now_s + 1.0), &mut out)
        .unwrap();
    assert!(out.iter().any(|out| matches!(out, Out::Ask(_))), "{out:?}");
    fed(station, now_s + 1.5, answer(empty + 1));
    now_s + 1.5
}

#[test]
fn a_requested_sweep_waits_for_everybody_and_begins_with_a_stop() {
    let mut station = Station::new(StationSettings {
        vehicles: vec![ONE, VehicleId(2)],
        ..settings()
    });
    shows(&mut station, 0.1, RUN, OrderKind::Start);
    let mut out = said_within(&mut station, 2.0);
    let empty =
        |out: &Out| matches!(out, Out::Publish(Message::Plan(plan)) if plan.stops.is_empty());
    let orders = |out: &Out| matches!(out, Out::Publish(Message::Order(_)));
    assert!(
        !out.iter().any(|out| empty(out) || orders(out)),
        "the other one was not heard"
    );
    let In::Bus(Message::State(other)) = state() else {
        unreachable!()
    };
    fed(
        &mut station,
        3.2,
        In::Bus(Message::State(State {
            vehicle: VehicleId(2),
            ..other
        })),
    );
    out = said_within(&mut station, 1.0);
    assert!(out.iter().any(empty) && out.iter().any(orders));
    assert!(
        !out.iter().any(|out| matches!(out, Out::Ask(_))),
        "nobody has stopped yet"
    );
}

#[test]
fn a_lap_is_done_when_all_have_done_its_last_stop_and_then_the_run_is_closed() {
    let mut station = running();
    fed(&mut station, 10.0, progress(2, Some(1)));
    assert_eq!(next_note(&mut station, 60.0), None);
    fed(&mut station, 70.0, progress(2, Some(2)));
    assert!(matches!(
        next_note(&mut station, 60.0),
        Some(StationEvent::LapDone { laps: 1, .. })
    ));
    assert!(matches!(
        next_note(&mut station, 60.0),
        Some(StationEvent::RunClosed { .. })
    ));
}

#[test]
fn without_progress_plans_are_made_anew_once_and_then_it_is_said() {
    let mut station = running();
    assert_eq!(
        next_note(&mut station, 1000.0),
        Some(StationEvent::Replans(RUN))
    );
    begin(&mut station, 3);
    assert_eq!(
        next_note(&mut station, 1000.0),
        Some(StationEvent::Stalled(RUN))
    );
}

#[test]
fn who_never_comes_to_rest_does_not_hold_up_the_end_for_ever() {
    let mut station = station();
    fed(&mut station, 0.5, state());
    shows(&mut station, 1.0, RunId(1), OrderKind::Start);
    // Nobody ever reports the empty revision.
    let notes: Vec<Option<StationEvent>> = (0..2).map(|_| next_note(&mut station, 600.0)).collect();
    assert_eq!(
        notes,
        [
            Some(StationEvent::Replans(RunId(1))),
            Some(StationEvent::Stalled(RunId(1)))
        ]
    );
}

#[test]
fn who_does_not_follow_its_plan_is_planned_for_anew() {
    let mut station = station();
    shows(&mut station, 0.1, RUN, OrderKind::Start);
    plan(&mut station, 1);
    assert_eq!(
        next_note(&mut station, 60.0),
        Some(StationEvent::Replans(RUN))
    );
}

#[test]
fn who_does_not_follow_its_plan_is_a_trouble_after_a_while() {
    let mut station = station();
    shows(&mut station, 0.1, RUN, OrderKind::Start);
    let planned_s = plan(&mut station, 1);
    let are_missed = |station: &Station, after_s: f64| {
        let parts = station.parts_to_report(Time::from_secs_f64(planned_s + after_s));
        let troubles = parts.report().troubles;
        troubles.contains(&"do not follow their plan yet: vehicle 1".to_owned())
    };
    assert_eq!(
        [2.9, 3.1].map(|after_s| are_missed(&station, after_s)),
        [false, true]
    );
    fed(&mut station, planned_s + 3.2, progress(2, None));
    assert!(!are_missed(&station, 3.3));
}

fn starts(out: &[Out]) -> bool {
    let is_start = |out: &Out| {
        let Out::Publish(Message::Order(order)) = out else {
            return false;
        };
        order.kind == OrderKind::Start
    };
    out.iter().any(is_start)
}

/// Everything said within a while.
fn said_within(station: &mut Station, within_s: f64) -> Vec<Out> {
    let mut out = Vec::new();
    let until = station.deadline().unwrap().at + Duration::from_secs_f64(within_s);
    while let Some(deadline) = station.deadline().filter(|deadline| deadline.at < until) {
        station.wake(deadline.at, &mut out).unwrap();
    }
    out
}

#[test]
fn what_the_operator_has_stopped_only_the_operator_starts() {
    for kind in [
        OrderKind::Hold,
        OrderKind::Return,
        OrderKind::Land,
        OrderKind::CutMotors,
    ] {
        let mut station = running();
        shows(&mut station, 10.0, RUN, kind);
        let task = Task {
            lease: LEASE,
            run: RunId(3),
            members: vec![ONE],
            compare_with: None,
            kind: TaskKind::Explore,
        };
        let mut out = fed(&mut station, 10.0, In::Bus(Message::Task(task)));
        out.extend(said_within(&mut station, 3000.0));
        assert!(!starts(&out), "{kind:?}");
        assert!(
            !out.iter()
                .any(|out| matches!(out, Out::StationEvent(_) | Out::Ask(_))),
            "{kind:?}"
        );
        assert_eq!(station.order.strongest_with(None), Some(kind));
        shows(&mut station, 4000.0, RUN, OrderKind::Start);
        assert!(!station.order.is_any(), "{kind:?}");
    }
}

#[test]
fn an_order_is_in_force_too_while_a_sweep_is_being_stopped_or_only_requested() {
    let mut stopping = station();
    shows(&mut stopping, 0.1, RUN, OrderKind::Start);
    shows(&mut stopping, 0.2, RUN, OrderKind::Land);
    fed(&mut stopping, 0.3, state());
    let mut out = said_within(&mut stopping, 600.0);
    out.extend(fed(&mut stopping, 601.0, progress(1, None)));
    out.extend(said_within(&mut stopping, 600.0));
    assert!(!starts(&out) && !out.iter().any(|out| matches!(out, Out::Ask(_))));
}

#[test]
fn after_a_return_everyone_is_planned_for_anew_and_after_a_hold_the_plan_goes_on() {
    let empties = |out: &[Out]| {
        out.iter()
            .any(|out| matches!(out, Out::Publish(Message::Plan(plan)) if plan.stops.is_empty()))
    };
    for (kind, anew) in [(OrderKind::Hold, false), (OrderKind::Return, true)] {
        let mut station = running();
        shows(&mut station, 10.0, RUN, kind);
        said_within(&mut station, 600.0);
        let mut out = shows(&mut station, 700.0, RUN, OrderKind::Start);
        out.extend(said_within(&mut station, 100.0));
        assert_eq!(empties(&out), anew, "{kind:?}");
    }
}

#[test]
fn what_was_done_under_another_revision_is_no_lap() {
    let mut station = running();
    fed(&mut station, 10.0, progress(1, Some(2)));
    station.fleet = Fleet::new(&[ONE], LEASE);
    fed(&mut station, 10.0, state());
    fed(&mut station, 10.0, progress(1, Some(2)));
    assert_eq!(next_note(&mut station, 60.0), None);
}

#[test]
fn a_new_ground_takes_a_lease_above_that_of_the_plans_in_force() {
    // The operator who started the run had lease 1; the ground that planned it went on under its own, 2, and lost its disk.
    let mut station = Station::new(StationSettings {
        lease: None,
        holder: 9,
        ..settings()
    });
    fed(&mut station, 0.1, state());
    let mission = MissionProgress {
        vehicle: ONE,
        boot: Boot(1),
        lease_number: 2,
        ..MissionProgress::default()
    };
    fed(&mut station, 0.2, In::Bus(Message::Mission(mission)));
    for second in 1..=4 {
        station
            .wake(Time::from_secs_f64(f64::from(second)), &mut Vec::new())
            .unwrap();
    }
    assert_eq!(
        station.leases.own(),
        Lease {
            number: 3,
            holder: 9
        }
    );
    // Nobody who is not expected displaces it.
    let mission = MissionProgress {
        vehicle: VehicleId(9),
        boot: Boot(1),
        lease_number: 8,
        ..MissionProgress::default()
    };
    fed(&mut station, 5.0, In::Bus(Message::Mission(mission)));
    assert!(station.leases.holds());
}

#[test]
fn what_is_wrong_with_the_process_is_said_beside_what_the_station_says() {
    let mut station = station();
    let said = |station: &Station| {
        station
            .parts_to_report(Time::from_secs_f64(3.0))
            .report()
            .troubles
    };
    let own = said(&station);
    let of_process = |words: &[&str]| In::Troubles(words.iter().map(ToString::to_string).collect());
    fed(&mut station, 1.0, of_process(&["store: no room"]));
    assert_eq!(
        said(&station),
        [&own[..], &["store: no room".to_owned()]].concat()
    );
    let long = "ä".repeat(300);
    fed(&mut station, 2.0, of_process(&[long.as_str(); 99]));
    let report = station.parts_to_report(Time::from_secs_f64(3.0)).report();
    assert!(report.troubles.last().unwrap().ends_with('…'));
    tomoswarm_proto::codec::encode(&Message::Report(report)).unwrap();
    fed(&mut station, 3.0, of_process(&[]));
    assert_eq!(said(&station), own);
}
