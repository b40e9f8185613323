//! When the execution of a sweep takes which step, told by hand what vehicles show.

use std::time::Duration;

use super::*;
use tomoswarm_proto::{
    Boot, Plan, PoseReport, Position, Revision, Sample, Samples, StandReason, State, Stop, StopId,
};

const RUN: RunId = RunId(2);
const ONE: VehicleId = VehicleId(1);
const TWO: VehicleId = VehicleId(2);

/// An execution and the tables that it looks at.
struct Ground {
    execution: SweepExecution,
    fleet: Fleet,
    samples: SampleStore,
    is_held: bool,
    stores_samples: bool,
    map_changes: u64,
    sequence: u64,
}

/// Words for what was said, in order.
type Words = Vec<String>;

impl Ground {
    /// Two vehicles were heard, and no sweep is under way.
    fn new() -> Ground {
        let mut ground = Ground {
            execution: SweepExecution::default(),
            fleet: Fleet::new(&[ONE, TWO], Lease::default()),
            samples: SampleStore::new(7, 0.5, 0.06),
            is_held: false,
            stores_samples: true,
            map_changes: 0,
            sequence: 0,
        };
        ground.states(0.0, &[ONE, TWO]);
        ground
    }

    /// Two vehicles follow plans of revision 2 with two laps, given at 2 s: the stops are 1 and 2.
    fn running() -> Ground {
        let mut ground = Ground::new();
        ground.begin(0.0);
        ground.resume(1.0, 1);
        ground
    }

    /// Everyone stops under an empty revision, and gets plans of the next one.
    fn resume(&mut self, now_s: f64, empty: u32) {
        self.progress(now_s, empty, None);
        let words = self.advance(now_s);
        assert!(words.contains(&format!("ask {}", empty + 1)), "{words:?}");
        self.answer(now_s + 1.0, empty + 1);
        self.progress(now_s + 1.0, empty + 1, None);
    }

    fn step(
        &mut self,
        now_s: f64,
        step: impl FnOnce(&mut SweepExecution, &Conditions<'_>, &mut Vec<SweepOutput>),
    ) -> Words {
        let at = Conditions {
            now: Time::from_secs_f64(now_s),
            fleet: &self.fleet,
            samples: &self.samples,
            map_changes: self.map_changes,
            silence: SilenceLimits::new(Duration::from_secs(30), Duration::from_secs(60)),
            idle: IdleLimits::of(72.0, 0.5),
            lease: Lease::default(),
            is_held: self.is_held,
            stores_samples: self.stores_samples,
            is_deaf: false,
        };
        let mut out = Vec::new();
        step(&mut self.execution, &at, &mut out);
        out.iter().map(words_of).collect()
    }

    fn begin(&mut self, now_s: f64) -> Words {
        let requested = RequestedSweep {
            run: RUN,
            compared_with: Some(RunId(1)),
        };
        self.step(now_s, |it, at, out| it.begin(requested, at, out))
    }

    fn advance(&mut self, now_s: f64) -> Words {
        self.step(now_s, SweepExecution::advance)
    }

    fn answer(&mut self, now_s: f64, revision: u32) -> Words {
        let plan = |vehicle| Plan {
            vehicle,
            start: place(vehicle),
            stops: [1, 2].map(|id| stop(vehicle, id)).to_vec(),
            ..Plan::default()
        };
        let lap = |id| [ONE, TWO].map(|vehicle| (vehicle, StopId(id))).to_vec();
        let answer = PlannerAnswer {
            run: RUN,
            revision: Revision(revision),
            plans: Ok(vec![plan(ONE), plan(TWO)]),
            laps: vec![lap(1), lap(2)],
        };
        self.step(now_s, |it, at, out| it.take_answer(answer, at, out))
    }

    fn states(&mut self, now_s: f64, vehicles: &[VehicleId]) {
        for vehicle in vehicles {
            self.state(now_s, *vehicle, |_| {});
        }
    }

    fn state(&mut self, now_s: f64, vehicle: VehicleId, change: impl FnOnce(&mut State)) {
        self.sequence += 1;
        let mut state = State {
            vehicle,
            boot: Boot(1),
            sequence: self.sequence,
            pose: Some(Default::default()),
            ..State::default()
        };
        change(&mut state);
        let now = Time::from_secs_f64(now_s);
        let shown = self.fleet.heard_state(now, state);
        self.execution.hear(now, shown);
    }

    fn progress(&mut self, now_s: f64, revision: u32, done: Option<u32>) {
        for vehicle in [ONE, TWO] {
            self.progress_of(now_s, vehicle, revision, done);
        }
    }

    fn progress_of(&mut self, now_s: f64, vehicle: VehicleId, revision: u32, done: Option<u32>) {
        let progress = VehicleProgress {
            vehicle,
            boot: Boot(1),
            run: RUN,
            revision: Revision(revision),
            done: done.map(StopId),
            leg: None,
        };
        let now = Time::from_secs_f64(now_s);
        let shown = self.fleet.heard_progress(now, progress);
        self.execution.hear(now, shown);
        self.execution.hear_progress(&progress);
    }

    /// Stores the second of two samples of the run; the first is missing.
    fn leave_gap(&mut self) {
        let sample = Sample {
            sequence: 1,
            heard_at_ns: 0,
            transmitter: TWO,
            transmitter_pose: Default::default(),
            receiver_pose: Default::default(),
            channel: 11,
            power_dbm: 0,
            rssi_dbm: None,
        };
        self.samples.take(&Samples {
            vehicle: ONE,
            boot: Boot(1),
            run: RUN,
            samples: vec![sample],
            lost: vec![],
        });
    }
}

fn place(vehicle: VehicleId) -> Position {
    Position::from_metres(10.0 * f64::from(vehicle.0), 0.0, 0.0)
}

fn stop(vehicle: VehicleId, id: u32) -> Stop {
    Stop {
        id: StopId(id),
        at: place(vehicle),
        route: vec![],
        dwell_ms: 0,
        dwell_limit_ms: 0,
        partners: vec![],
        after: vec![],
    }
}

fn words_of(output: &SweepOutput) -> String {
    match output {
        SweepOutput::StationEvent(note) => format!("{note:?}"),
        SweepOutput::Plans(plans) => {
            let is_empty = plans.iter().all(|plan| plan.stops.is_empty());
            let what = if is_empty { "stop" } else { "plan" };
            format!("{what} {}", plans[0].revision.0)
        }
        SweepOutput::Begun(sweep) => {
            let compared_with = sweep.compared_with().map(|run| run.0);
            format!("begin {} {compared_with:?}", sweep.run().0)
        }
        SweepOutput::StartAll(run) => format!("start {}", run.0),
        SweepOutput::HoldAll(run) => format!("hold {}", run.0),
        SweepOutput::PlansNeeded(request) => format!("ask {}", request.revision.0),
        SweepOutput::LapDone { sweep, is_last } => format!("lap {} {is_last}", sweep.laps_done()),
        SweepOutput::Closed(sweep) => format!("closed {}", sweep.run().0),
        SweepOutput::GivenUp { run, end, why } => format!("{end:?} {}: {why}", run.0),
    }
}

#[test]
fn a_sweep_begins_with_a_stop_and_is_planned_once_all_have_stopped() {
    let mut ground = Ground::new();
    assert_eq!(ground.begin(0.0), ["stop 1", "start 2"]);
    ground.progress_of(1.0, ONE, 1, None);
    assert_eq!(ground.advance(1.0), [""; 0], "vehicle 2 has not stopped");
    ground.progress_of(1.5, TWO, 1, None);
    assert_eq!(ground.advance(2.0), ["ask 2"]);
    let planned = ground.answer(3.0, 2);
    assert_eq!(
        planned,
        [
            "Planned { run: RunId(2), laps: 2, stops: 4 }",
            "begin 2 Some(1)",
            "plan 2"
        ]
    );
    assert!(matches!(
        ground.execution.phase(),
        ExecutionPhase::Running { .. }
    ));
}

#[test]
fn laps_are_counted_when_all_have_done_them_and_the_run_is_closed_after_the_last() {
    let mut ground = Ground::running();
    ground.progress_of(10.0, ONE, 2, Some(2));
    assert_eq!(ground.advance(10.0), [""; 0], "vehicle 2 has done nothing");
    ground.progress_of(11.0, TWO, 2, Some(1));
    assert_eq!(ground.advance(11.0), ["lap 1 false"]);
    assert_eq!(ground.advance(12.0), [""; 0]);
    ground.progress_of(20.0, TWO, 2, Some(2));
    assert_eq!(ground.advance(20.0), ["lap 2 true"]);
    assert_eq!(ground.advance(22.9), [""; 0]);
    assert_eq!(ground.advance(23.0), ["closed 2"]);
    assert!(matches!(
        ground.execution.phase(),
        ExecutionPhase::Idle { .. }
    ));
}

#[test]
fn missing_samples_are_waited_for_but_not_for_ever() {
    let mut ground = Ground::running();
    ground.leave_gap();
    ground.progress(20.0, 2, Some(2));
    assert_eq!(ground.advance(20.0), ["lap 2 true"]);
    assert_eq!(ground.advance(79.9), [""; 0]);
    assert_eq!(ground.advance(80.0), ["closed 2"]);
}

#[test]
fn a_run_is_not_closed_while_samples_cannot_be_stored() {
    let mut ground = Ground::running();
    ground.stores_samples = false;
    ground.progress(20.0, 2, Some(2));
    assert_eq!(ground.advance(20.0), ["lap 2 true"]);
    assert_eq!(ground.advance(23.0), [""; 0]);
    assert_eq!(ground.advance(900.0), [""; 0]);
    ground.stores_samples = true;
    assert_eq!(ground.advance(902.9), [""; 0], "they come again");
    ground.leave_gap();
    assert_eq!(ground.advance(959.9), [""; 0]);
    assert_eq!(ground.advance(960.0), ["closed 2"]);
}

#[test]
fn plans_that_do_not_come_are_asked_for_again_and_others_are_passed_over() {
    let mut ground = Ground::new();
    assert_eq!(ground.answer(0.0, 1), [""; 0], "nobody has asked");
    ground.begin(0.0);
    ground.progress(1.0, 1, None);
    assert_eq!(ground.advance(1.0), ["ask 2"]);
    assert_eq!(ground.advance(31.0), [""; 0]);
    ground.states(31.1, &[ONE, TWO]);
    assert_eq!(ground.advance(31.1), ["ask 2"]);
    assert_eq!(ground.answer(32.0, 3), [""; 0], "of another revision");
    ground.state(33.0, TWO, |state| state.boot = Boot(2));
    assert_eq!(ground.answer(33.0, 2), [""; 0], "vehicle 2 was restarted");
    assert_eq!(
        ground.advance(33.0),
        ["Replans(RunId(2))", "stop 2", "start 2"]
    );
}

/// A sweep whose first plans are asked for at 1 s.
fn asked() -> Ground {
    let mut ground = Ground::new();
    ground.begin(0.0);
    ground.progress(1.0, 1, None);
    ground.advance(1.0);
    ground
}

fn no_plan(ground: &mut Ground, now_s: f64, is_of_places: bool) -> Words {
    let why = "no room".to_owned();
    let answer = PlannerAnswer {
        run: RUN,
        revision: Revision(2),
        plans: Err(NoPlan { why, is_of_places }),
        laps: vec![],
    };
    ground.step(now_s, |it, at, out| it.take_answer(answer, at, out))
}

#[test]
fn a_sweep_that_cannot_be_planned_from_anywhere_is_given_up() {
    let mut ground = asked();
    assert_eq!(
        no_plan(&mut ground, 2.0, false),
        ["NoPlan(\"no room\")", "Failed 2: no room"]
    );
    assert_eq!(ground.execution.phase().sweep(), None);
}

#[test]
fn when_the_map_has_changed_a_plan_is_tried_again_and_it_is_given_up_after_a_minute() {
    let mut ground = asked();
    assert_eq!(no_plan(&mut ground, 2.0, true), ["NoPlan(\"no room\")"]);
    assert_eq!(ground.advance(20.0), [""; 0], "nothing has changed");
    ground.map_changes += 1;
    assert_eq!(ground.advance(21.0), ["ask 2"]);
    assert_eq!(no_plan(&mut ground, 22.0, true), [""; 0], "it is no news");
    assert_eq!(ground.advance(24.0), [""; 0]);
    let mut helped = asked();
    no_plan(&mut helped, 2.0, true);
    helped.map_changes += 1;
    assert_eq!(helped.advance(7.0)[0], "ask 2");
    assert_eq!(helped.answer(8.0, 2).last().unwrap(), "plan 2");
    ground.states(62.0, &[ONE, TWO]);
    assert_eq!(ground.advance(62.0), ["Failed 2: no room"]);
    assert_eq!(ground.execution.phase().sweep(), None);
}

#[test]
fn a_plan_that_somebody_does_not_show_within_30_s_is_replaced() {
    let mut ground = Ground::new();
    ground.begin(0.0);
    ground.progress(1.0, 1, None);
    ground.advance(1.0);
    ground.answer(2.0, 2);
    ground.progress_of(3.0, ONE, 2, None);
    assert_eq!(ground.advance(32.0), ["plan 2"]);
    assert_eq!(
        ground.advance(32.1),
        ["Replans(RunId(2))", "stop 3", "start 2"]
    );
}

#[test]
fn without_progress_plans_are_made_anew_once_for_every_lap_and_then_it_is_given_up() {
    let stalled = ["Replans(RunId(2))", "stop 3", "start 2"];
    let mut ground = Ground::running();
    ground.progress_of(100.0, ONE, 2, Some(1));
    ground.advance(219.0);
    assert_eq!(ground.advance(220.0), [""; 0]);
    assert_eq!(ground.advance(220.1), stalled);
    ground.resume(230.0, 3);
    ground.advance(351.0);
    assert_eq!(
        ground.advance(351.1),
        [
            "Stalled(RunId(2))",
            "hold 2",
            "Failed 2: it cannot be ended, no vehicle gets on"
        ]
    );
    assert_eq!(ground.execution.phase().sweep(), None);
}

#[test]
fn who_only_looks_for_a_way_where_nobody_was_gets_on_for_so_long_and_no_longer() {
    let mut ground = Ground::running();
    ground.progress_of(10.0, ONE, 2, Some(1));
    let said_at = |ground: &mut Ground, seconds: std::ops::Range<u32>, what: &str| {
        seconds.into_iter().find(|second| {
            let now_s = f64::from(*second);
            if second.is_multiple_of(30) {
                let at = Position::from_metres(now_s, 0.0, 0.0);
                ground.state(now_s, ONE, |state| {
                    state.pose = Some(PoseReport {
                        at,
                        ..PoseReport::default()
                    });
                });
            }
            let words = ground.advance(now_s);
            words.iter().any(|words| words.starts_with(what))
        })
    };
    assert_eq!(said_at(&mut ground, 11..300, "Replans"), Some(192));
    ground.resume(200.0, 3);
    assert_eq!(said_at(&mut ground, 202..300, "Stalled"), Some(282));
}

#[test]
fn vehicles_that_never_come_to_rest_are_stopped_anew_once() {
    let mut ground = Ground::new();
    ground.begin(0.0);
    ground.advance(420.0);
    assert_eq!(
        ground.advance(420.1),
        ["Replans(RunId(2))", "stop 2", "start 2"]
    );
    ground.advance(840.1);
    assert_eq!(ground.advance(840.2)[0], "Stalled(RunId(2))");
}

#[test]
fn that_an_earlier_sweep_made_no_progress_is_not_held_against_the_next_one() {
    let mut ground = Ground::running();
    ground.advance(122.0);
    assert_eq!(ground.advance(122.1)[0], "Replans(RunId(2))");
    ground.execution.leave_to_vehicles(RUN);
    ground.begin(500.0);
    ground.advance(920.0);
    assert_eq!(ground.advance(920.1)[0], "Replans(RunId(2))");
}

#[test]
fn while_an_order_is_in_force_plans_are_only_repeated() {
    let mut ground = Ground::running();
    ground.is_held = true;
    ground.state(3.0, ONE, |state| state.boot = Boot(2));
    assert_eq!(ground.advance(1000.0), ["plan 2"]);
    assert_eq!(ground.advance(1001.0), [""; 0]);
    ground.is_held = false;
    assert_eq!(ground.advance(1002.0)[0], "Replans(RunId(2))");
}

#[test]
fn after_a_hold_the_plans_go_on_and_after_any_other_order_everyone_is_planned_for_anew() {
    let words = |lifted| {
        let mut ground = Ground::running();
        let words = ground.step(900.0, |it, at, out| it.go_on(lifted, at, out));
        (words, ground.advance(900.0))
    };
    let (held, after) = words(OrderKind::Hold);
    assert_eq!((held, after), (vec![], vec!["plan 2".to_owned()]));
    for lifted in [OrderKind::Return, OrderKind::Land, OrderKind::CutMotors] {
        assert_eq!(words(lifted).0, ["stop 3", "start 2"], "{lifted:?}");
    }
}

#[test]
fn a_lost_vehicle_is_planned_around_once_it_surely_stands_and_with_one_left_the_sweep_waits() {
    let mut ground = Ground::running();
    ground.states(40.0, &[ONE]);
    let now = Time::from_secs_f64(41.0);
    let limits = SilenceLimits::new(Duration::from_secs(30), Duration::from_secs(60));
    assert_eq!(limits.lose(now, &mut ground.fleet), [TWO]);
    assert_eq!(
        ground.advance(41.0),
        ["Replans(RunId(2))", "stop 3", "start 2", "Waits(RunId(2))"]
    );
    ground.progress_of(42.0, ONE, 3, None);
    assert_eq!(
        ground.advance(1000.0),
        ["stop 3"],
        "it waits, and is not stalled"
    );
    ground.state(1001.0, TWO, |_| {});
    assert_eq!(
        ground.advance(1001.0),
        ["Replans(RunId(2))", "stop 4", "start 2"]
    );
}

#[test]
fn a_vehicle_that_is_out_is_planned_around_at_once_and_not_started_and_with_one_left_the_sweep_ends()
 {
    let mut ground = Ground::running();
    let battery = |state: &mut State| state.stands_under = Some(StandReason::Battery);
    ground.state(40.0, TWO, |state| {
        battery(state);
        state.is_at_rest = false;
    });
    ground.state(40.0, ONE, |_| {});
    assert_eq!(ground.fleet.out_of_service(), [TWO]);
    assert_eq!(
        ground.advance(41.0),
        ["Replans(RunId(2))", "stop 3", "start 2", "Waits(RunId(2))"]
    );
    ground.fleet.start_all(RunId(2));
    let started: Vec<VehicleId> = ground
        .fleet
        .open_orders()
        .iter()
        .map(|order| order.vehicle)
        .collect();
    assert!(!started.contains(&TWO), "{started:?}");
    ground.progress_of(42.0, ONE, 3, None);
    assert_eq!(ground.advance(43.0), [""; 0], "too few are left");
    // It may go on again.
    ground.state(44.0, TWO, |_| {});
    assert_eq!(
        ground.advance(44.0),
        ["Replans(RunId(2))", "stop 4", "start 2"]
    );
    // It may not, for good.
    ground.state(50.0, TWO, battery);
    assert_eq!(
        ground.advance(51.0),
        ["Replans(RunId(2))", "stop 5", "start 2", "Waits(RunId(2))"]
    );
    ground.progress_of(52.0, ONE, 5, None);
    let words = ground.advance(500.0);
    assert!(words.contains(&"Replans(RunId(2))".to_owned()), "{words:?}");
    let words = ground.advance(1000.0);
    let given_up = words
        .iter()
        .find(|word| word.contains("out of service: vehicle 2"));
    assert!(given_up.is_some(), "{words:?}");
}

#[test]
fn plans_of_others_are_outnumbered_and_those_of_a_higher_run_end_the_sweep() {
    let outnumber = |ground: &mut Ground, accepted: (RunId, Revision)| {
        ground.state(3.0, ONE, |state| state.accepted = accepted);
        let words = ground.step(3.0, SweepExecution::outnumber_others);
        (words, ground.advance(3.0))
    };
    let mut ground = Ground::running();
    let (words, after) = outnumber(&mut ground, (RUN, Revision(8)));
    assert_eq!(words, [""; 0]);
    assert_eq!(after, ["Replans(RunId(2))", "stop 9", "start 2"]);
    let mut ground = Ground::running();
    let (words, after) = outnumber(&mut ground, (RunId(3), Revision(1)));
    assert_eq!(
        words,
        [
            "Overtaken(RunId(2))",
            "Stopped 2: vehicles follow a higher run"
        ]
    );
    assert_eq!(after, [""; 0]);
}

#[test]
fn a_vehicle_that_restarts_disturbs_a_sweep_that_is_driven_and_none_that_only_waits_for_samples() {
    for (done, is_disturbed) in [(None, true), (Some(2), false)] {
        let mut ground = Ground::running();
        ground.progress(10.0, 2, done);
        ground.advance(10.0);
        ground.state(11.0, ONE, |state| state.boot = Boot(2));
        let sweep = ground.execution.phase().sweep().unwrap();
        assert_eq!(sweep.is_disturbed(), is_disturbed, "{done:?}");
    }
}

#[test]
fn after_a_restart_the_same_plans_are_in_force_and_every_time_begins_anew() {
    let before = Ground::running();
    let succession = before.execution.plans().succession().cloned();
    let mut ground = Ground::new();
    ground.execution = SweepExecution::restored(before.execution.phase().clone(), succession);
    ground.execution.count_from(Time::from_secs_f64(5000.0));
    assert_eq!(
        ground.step(5000.0, SweepExecution::publish),
        ["plan 2"],
        "nothing else is given by this number"
    );
    assert_eq!(ground.advance(5030.0), ["plan 2"], "30 s are not over");
    assert_eq!(ground.advance(5030.1)[0], "Replans(RunId(2))");
}

#[test]
fn a_run_is_compared_with_another_one_only_if_it_is_under_way() {
    let mut ground = Ground::running();
    let compared_with = |ground: &Ground| {
        let sweep = ground.execution.phase().sweep();
        sweep.and_then(SweepRun::compared_with)
    };
    ground.execution.compare_with(RunId(5), None);
    assert_eq!(compared_with(&ground), Some(RunId(1)));
    ground.execution.compare_with(RUN, Some(RunId(7)));
    assert_eq!(compared_with(&ground), Some(RunId(7)));
    ground.execution.leave_to_vehicles(RunId(5));
    assert!(ground.execution.phase().sweep().is_some());
}
