//! How far the execution of a sweep is. Each state carries what belongs to it alone, and each transition is a method. When
//! one is due is decided by the execution; this knows neither plans nor vehicles.
//!
//! ```text
//!  [Idle] ─begin─► [Stopping] ─plan─► [Planning] ─run─► [Running] ─close─► [Closing]
//!     ▲               ▲ │                 │                 │                  │
//!     │               └─┴──────stop───────┴─────────────────┘                  │
//!     └──────────────────────────────── end ───────────────────────────────────┘
//! ```
//!
//! *begin*: a sweep is requested, and it is known where all vehicles are. *plan*: all are at rest. *run*: plans have come.
//! *stop*: a vehicle is lost, is back, was restarted or cannot begin, or none makes progress. *close*: every stop is done.
//! *end*: the samples are in; or from any state the sweep is given up.
//!
//! Times are those of the station's present start: they are not remembered over a restart, but counted anew
//! ([`Phase::count_from`]).

use std::mem::{Discriminant, discriminant};

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{StopId, VehicleId};

use super::sweep::{Laps, SweepRun};
use crate::time::Time;

/// The state of the execution; `since` = when it was entered, or an order was lifted that had held everyone up in it.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(crate) enum ExecutionPhase {
    /// No sweep is under way.
    Idle {
        /// The sweep that was closed or given up last.
        last: Option<SweepRun>,
    },
    /// Everyone is brought to rest, to be planned for.
    Stopping { sweep: SweepRun, since: Time },
    /// Plans are being made from where the vehicles rest.
    Planning { sweep: SweepRun, since: Time },
    /// The vehicles follow their plans.
    Running {
        sweep: SweepRun,
        laps: Laps,
        since: Time,
        /// When a vehicle last made progress with its plan, or `since` if that is later.
        progress_at: Time,
    },
    /// The last samples are waited for.
    Closing { sweep: SweepRun, since: Time },
}

impl Default for ExecutionPhase {
    fn default() -> ExecutionPhase {
        ExecutionPhase::Idle { last: None }
    }
}

impl ExecutionPhase {
    /// Returns the sweep that is under way.
    pub(crate) fn sweep(&self) -> Option<&SweepRun> {
        match self {
            ExecutionPhase::Idle { .. } => None,
            ExecutionPhase::Stopping { sweep, .. }
            | ExecutionPhase::Planning { sweep, .. }
            | ExecutionPhase::Running { sweep, .. }
            | ExecutionPhase::Closing { sweep, .. } => Some(sweep),
        }
    }

    /// Returns the sweep that is under way, to be changed.
    pub(crate) fn sweep_mut(&mut self) -> Option<&mut SweepRun> {
        match self {
            ExecutionPhase::Idle { .. } => None,
            ExecutionPhase::Stopping { sweep, .. }
            | ExecutionPhase::Planning { sweep, .. }
            | ExecutionPhase::Running { sweep, .. }
            | ExecutionPhase::Closing { sweep, .. } => Some(sweep),
        }
    }

    /// Returns the sweep that is under way, or else the last one.
    pub(crate) fn newest_sweep(&self) -> Option<&SweepRun> {
        match self {
            ExecutionPhase::Idle { last } => last.as_ref(),
            ExecutionPhase::Stopping { .. }
            | ExecutionPhase::Planning { .. }
            | ExecutionPhase::Running { .. }
            | ExecutionPhase::Closing { .. } => self.sweep(),
        }
    }

    /// Returns the sweep for which vehicles follow plans, or are to: neither none nor one that only waits for samples.
    pub(crate) fn driven(&self) -> Option<&SweepRun> {
        match self {
            ExecutionPhase::Idle { .. } | ExecutionPhase::Closing { .. } => None,
            ExecutionPhase::Stopping { .. }
            | ExecutionPhase::Planning { .. }
            | ExecutionPhase::Running { .. } => self.sweep(),
        }
    }

    /// Begins a sweep, if none is under way.
    pub(crate) fn begin(&mut self, now: Time, sweep: SweepRun) {
        if let ExecutionPhase::Idle { .. } = self {
            *self = ExecutionPhase::Stopping { sweep, since: now };
        }
    }

    /// Brings everyone to rest, if vehicles follow plans or are to.
    pub(crate) fn stop(&mut self, now: Time) {
        if let Some(mut sweep) = self.driven().copied() {
            sweep.settle();
            *self = ExecutionPhase::Stopping { sweep, since: now };
        }
    }

    /// Waits for plans, once all are at rest; the whole time again if it does so already.
    pub(crate) fn plan(&mut self, now: Time) {
        if let ExecutionPhase::Stopping { sweep, .. } | ExecutionPhase::Planning { sweep, .. } =
            *self
        {
            *self = ExecutionPhase::Planning { sweep, since: now };
        }
    }

    /// Lets the vehicles follow plans that have come, with the given last stops in each lap.
    pub(crate) fn run(&mut self, now: Time, last_stops: Vec<Vec<(VehicleId, StopId)>>) {
        if let ExecutionPhase::Planning { sweep, .. } = *self {
            *self = ExecutionPhase::Running {
                sweep,
                laps: Laps::new(sweep.laps_done(), last_stops),
                since: now,
                progress_at: now,
            };
        }
    }

    /// Waits for the last samples, once every stop is done.
    pub(crate) fn close(&mut self, now: Time) {
        if let ExecutionPhase::Running { sweep, .. } = *self {
            *self = ExecutionPhase::Closing { sweep, since: now };
        }
    }

    /// Ends the sweep that is under way; it is the last one from now on.
    pub(crate) fn end(&mut self) {
        if let Some(sweep) = self.sweep().copied() {
            *self = ExecutionPhase::Idle { last: Some(sweep) };
        }
    }

    /// Records that the plans no longer suit the vehicles, if there are any who follow them.
    pub(crate) fn disturb(&mut self) {
        if self.driven().is_some()
            && let Some(sweep) = self.sweep_mut()
        {
            sweep.disturb();
        }
    }

    /// Records that a vehicle has made progress with its plan.
    pub(crate) fn note_progress(&mut self, now: Time) {
        if let ExecutionPhase::Running { progress_at, .. } = self {
            *progress_at = now;
        }
    }

    /// Gives everyone the whole time again: an order that had held them up is lifted.
    pub(crate) fn go_on(&mut self, now: Time) {
        match self {
            ExecutionPhase::Idle { .. } | ExecutionPhase::Closing { .. } => {}
            ExecutionPhase::Stopping { since, .. } | ExecutionPhase::Planning { since, .. } => {
                *since = now
            }
            ExecutionPhase::Running {
                since, progress_at, ..
            } => (*since, *progress_at) = (now, now),
        }
    }

    /// Goes on after a time in which nothing was decided, as after a restart. Plans that were being made have gone unheard:
    /// they are asked for again.
    pub(crate) fn count_from(&mut self, now: Time) {
        self.go_on(now);
        match self {
            ExecutionPhase::Planning { sweep, .. } => {
                *self = ExecutionPhase::Stopping {
                    sweep: *sweep,
                    since: now,
                }
            }
            ExecutionPhase::Closing { since, .. } => *since = now,
            ExecutionPhase::Idle { .. }
            | ExecutionPhase::Stopping { .. }
            | ExecutionPhase::Running { .. } => {}
        }
    }

    /// Returns whether two are the same, whatever their times.
    pub(crate) fn is_same_but_for_times(&self, other: &ExecutionPhase) -> bool {
        self.without_times() == other.without_times()
    }

    /// Returns everything but the times. Every field is named, so that none is forgotten.
    fn without_times(
        &self,
    ) -> (
        Discriminant<ExecutionPhase>,
        Option<&SweepRun>,
        Option<&Laps>,
    ) {
        let (sweep, laps) = match self {
            ExecutionPhase::Idle { last } => (last.as_ref(), None),
            ExecutionPhase::Stopping { sweep, since: _ }
            | ExecutionPhase::Planning { sweep, since: _ }
            | ExecutionPhase::Closing { sweep, since: _ } => (Some(sweep), None),
            ExecutionPhase::Running {
                sweep,
                laps,
                since: _,
                progress_at: _,
            } => (Some(sweep), Some(laps)),
        };
        (discriminant(self), sweep, laps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actor::tests_support::{drawn, variant_of, variants};
    use crate::ground::station::run_registry::RequestedSweep;
    use tomoswarm_proto::RunId;

    fn at(at_s: f64) -> Time {
        Time::from_secs_f64(at_s)
    }

    fn sweep() -> SweepRun {
        SweepRun::new(RequestedSweep {
            run: RunId(2),
            compared_with: Some(RunId(1)),
        })
    }

    /// Every state, entered at the first second.
    fn every_state() -> [ExecutionPhase; 5] {
        let mut states: Vec<ExecutionPhase> = vec![ExecutionPhase::default()];
        let ways: [fn(&mut ExecutionPhase); 4] = [
            |it| it.begin(at(1.0), sweep()),
            |it| it.plan(at(1.0)),
            |it| it.run(at(1.0), vec![vec![]]),
            |it| it.close(at(1.0)),
        ];
        for go in ways {
            let mut next = states[states.len() - 1].clone();
            go(&mut next);
            states.push(next);
        }
        states.try_into().unwrap()
    }

    /// What a transition is called in the drawing, and what it does.
    type Transition = (&'static str, fn(&mut ExecutionPhase));

    const TRANSITIONS: [Transition; 6] = [
        ("begin", |it| it.begin(at(2.0), sweep())),
        ("plan", |it| it.plan(at(2.0))),
        ("run", |it| it.run(at(2.0), vec![])),
        ("stop", |it| it.stop(at(2.0))),
        ("close", |it| it.close(at(2.0))),
        ("end", |it| it.end()),
    ];

    #[test]
    fn the_drawing_shows_every_state_and_every_transition() {
        let source = include_str!("phase.rs");
        assert_eq!(drawn(source), variants::<ExecutionPhase>());
        let drawing = source.split("```").nth(1).unwrap();
        for (name, _) in TRANSITIONS {
            let words = drawing.split(|letter: char| !letter.is_alphabetic());
            assert!(words.into_iter().any(|word| word == name), "{name}");
        }
    }

    #[test]
    fn every_transition_leads_from_every_state_where_the_drawing_says() {
        for phase in every_state() {
            let expected = match &phase {
                ExecutionPhase::Idle { .. } => ["Stopping", "Idle", "Idle", "Idle", "Idle"],
                ExecutionPhase::Stopping { .. } => {
                    ["Stopping", "Planning", "Stopping", "Stopping", "Stopping"]
                }
                ExecutionPhase::Planning { .. } => {
                    ["Planning", "Planning", "Running", "Stopping", "Planning"]
                }
                ExecutionPhase::Running { .. } => {
                    ["Running", "Running", "Running", "Stopping", "Closing"]
                }
                ExecutionPhase::Closing { .. } => ["Closing"; 5],
            };
            let expected = expected.into_iter().chain(["Idle"]);
            for ((name, go), expected) in TRANSITIONS.into_iter().zip(expected) {
                let mut after = phase.clone();
                go(&mut after);
                assert_eq!(variant_of(&after), expected, "{name} from {phase:?}");
            }
        }
    }

    #[test]
    fn what_ends_is_the_last_sweep_until_the_next_one_begins() {
        let mut phase = ExecutionPhase::default();
        phase.end();
        assert_eq!((phase.sweep(), phase.newest_sweep()), (None, None));
        phase.begin(at(1.0), sweep());
        phase.end();
        assert_eq!(
            (phase.sweep(), phase.newest_sweep()),
            (None, Some(&sweep()))
        );
        phase.begin(at(2.0), sweep());
        assert_eq!(
            (phase.sweep(), phase.driven()),
            (Some(&sweep()), Some(&sweep()))
        );
    }

    #[test]
    fn laps_go_on_from_those_that_are_done_and_a_stop_settles() {
        let mut phase = every_state()[2].clone();
        let sweep = phase.sweep_mut().unwrap();
        sweep.complete_laps(3);
        sweep.disturb();
        phase.run(at(2.0), vec![vec![], vec![]]);
        let ExecutionPhase::Running { laps, .. } = &phase else {
            unreachable!()
        };
        assert_eq!(laps.total(), 5);
        phase.stop(at(3.0));
        let sweep = phase.sweep().unwrap();
        assert_eq!((sweep.laps_done(), sweep.is_disturbed()), (3, false));
    }

    #[test]
    fn a_lifted_order_gives_the_whole_time_again_and_progress_only_that_for_progress() {
        let mut phase = every_state()[3].clone();
        phase.note_progress(at(5.0));
        let times = |phase: &ExecutionPhase| match phase {
            ExecutionPhase::Running {
                since, progress_at, ..
            } => (*since, *progress_at),
            other => panic!("{other:?}"),
        };
        assert_eq!(times(&phase), (at(1.0), at(5.0)));
        phase.go_on(at(7.0));
        assert_eq!(times(&phase), (at(7.0), at(7.0)));
    }

    #[test]
    fn after_a_restart_times_begin_anew_and_plans_are_asked_for_again() {
        let after: Vec<ExecutionPhase> = every_state()
            .into_iter()
            .map(|mut phase| {
                phase.count_from(at(9.0));
                phase
            })
            .collect();
        let stopping = ExecutionPhase::Stopping {
            sweep: sweep(),
            since: at(9.0),
        };
        assert_eq!(after[0], ExecutionPhase::default());
        assert_eq!((&after[1], &after[2]), (&stopping, &stopping));
        assert!(matches!(&after[3], ExecutionPhase::Running { since, .. } if *since == at(9.0)));
        assert!(matches!(&after[4], ExecutionPhase::Closing { since, .. } if *since == at(9.0)));
    }

    #[test]
    fn two_are_the_same_whatever_their_times_but_not_with_another_state_or_sweep() {
        for (index, phase) in every_state().iter().enumerate() {
            for (other_index, other) in every_state().iter().enumerate() {
                assert_eq!(
                    phase.is_same_but_for_times(other),
                    index == other_index,
                    "{phase:?}, {other:?}"
                );
            }
            let (mut later, mut disturbed) = (phase.clone(), phase.clone());
            later.go_on(at(8.0));
            assert!(phase.is_same_but_for_times(&later));
            if let Some(sweep) = disturbed.sweep_mut() {
                sweep.disturb();
                assert!(!phase.is_same_but_for_times(&disturbed), "{phase:?}");
            }
        }
        let mut other_laps = every_state()[2].clone();
        other_laps.run(at(1.0), vec![]);
        assert!(!every_state()[3].is_same_but_for_times(&other_laps));
    }
}
