//! What is to be done next about the plans of a sweep. Decides only; the execution does it.

use std::time::Duration;

use super::{Conditions, ExecutionPhase, PublishedPlans, SweepRun};
use crate::ground::station::lost_vehicles::{is_too_few, is_too_few_in_service};
use crate::time::Time;

/// A revision that somebody does not follow after this long is replaced.
const ADOPTED_WITHIN: Duration = Duration::from_secs(30);
/// Plans that did not come after this long are asked for again.
const ANSWERED_WITHIN: Duration = Duration::from_secs(30);
/// When nobody can be planned for for this long, everyone is stopped anew; a second time in a lap the sweep is given up.
/// Vehicles that are lost are waited for as long as it takes.
const NOT_STOPPED_AFTER: Duration = Duration::from_secs(420);
/// When no vehicle has done a stop, or come to where it was not, for this long beyond the longest dwell, everyone is planned
/// for anew; a second time in a lap the sweep is given up. People read of it in docs/modules.md.
const STALLED_AFTER: Duration = Duration::from_secs(120);

/// What is to be done next about the plans.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum NextStep {
    /// Nothing.
    Wait,
    /// The plans are published again.
    Repeat,
    /// Everyone is brought to rest, and planned for anew: the plans do not suit the vehicles.
    Replan,
    /// No vehicle makes progress: everyone is planned for anew, or the sweep is given up when that was done before.
    Retry,
    /// Plans are asked for.
    Ask,
}

impl NextStep {
    /// Returns the next step; `idle` = the time without a stop.
    pub(super) fn of(
        phase: &ExecutionPhase,
        plans: &PublishedPlans,
        idle: Duration,
        at: &Conditions<'_>,
    ) -> NextStep {
        if at.is_held {
            return NextStep::while_held(phase, plans, at.now);
        }
        let is_over = |since: Time, limit: Duration| at.now.since(since) > limit;
        match *phase {
            ExecutionPhase::Idle { .. } | ExecutionPhase::Closing { .. } => NextStep::Wait,
            ExecutionPhase::Stopping { .. }
            | ExecutionPhase::Planning { .. }
            | ExecutionPhase::Running { .. }
                if must_rest(phase, plans, at) =>
            {
                NextStep::Replan
            }
            ExecutionPhase::Stopping { .. } if may_plan(plans, at) => NextStep::Ask,
            ExecutionPhase::Stopping { since, .. }
                if is_over(since, NOT_STOPPED_AFTER)
                    && (!is_too_few(at.fleet) || is_too_few_in_service(at.fleet)) =>
            {
                NextStep::Retry
            }
            // The request or the answer was lost.
            ExecutionPhase::Planning { since, .. } if is_over(since, ANSWERED_WITHIN) => {
                NextStep::Ask
            }
            ExecutionPhase::Planning { .. } => NextStep::Wait,
            ExecutionPhase::Running { since, .. }
                if is_over(since, ADOPTED_WITHIN) && !plans.are_shown() =>
            {
                NextStep::Replan
            }
            ExecutionPhase::Running {
                sweep, progress_at, ..
            } if is_over(progress_at, STALLED_AFTER + plans.longest_dwell())
                || idle > idle_for(&sweep, at) + plans.longest_dwell() =>
            {
                NextStep::Retry
            }
            ExecutionPhase::Stopping { .. } | ExecutionPhase::Running { .. } => {
                NextStep::repeat(plans, at.now)
            }
        }
    }

    /// Returns the next step while an order other than Start is in force: nothing is planned or timed.
    fn while_held(phase: &ExecutionPhase, plans: &PublishedPlans, now: Time) -> NextStep {
        match phase {
            ExecutionPhase::Stopping { .. } | ExecutionPhase::Running { .. } => {
                NextStep::repeat(plans, now)
            }
            ExecutionPhase::Idle { .. }
            | ExecutionPhase::Planning { .. }
            | ExecutionPhase::Closing { .. } => NextStep::Wait,
        }
    }

    /// Returns whether the plans in force are published again.
    pub(super) fn repeat(plans: &PublishedPlans, now: Time) -> NextStep {
        match plans.is_repeat_due(now) {
            true => NextStep::Repeat,
            false => NextStep::Wait,
        }
    }
}

/// Returns how long a sweep may be without a stop.
fn idle_for(sweep: &SweepRun, at: &Conditions<'_>) -> Duration {
    match sweep.is_retried() {
        true => at.idle.given_up_after,
        false => at.idle.retried_after,
    }
}

/// Returns whether the present plans are for others than those who are there, or somebody has forgotten them.
pub(super) fn must_rest(
    phase: &ExecutionPhase,
    plans: &PublishedPlans,
    at: &Conditions<'_>,
) -> bool {
    let is_disturbed = phase.sweep().is_some_and(SweepRun::is_disturbed);
    is_disturbed || plans.members() != Some(&at.fleet.present()[..])
}

/// Returns whether everyone has come to rest and plans may be made.
fn may_plan(plans: &PublishedPlans, at: &Conditions<'_>) -> bool {
    plans.are_all_stopped()
        && !is_too_few(at.fleet)
        && at.silence.do_absent_ones_rest(at.now, at.fleet)
        && at.fleet.are_placed()
}
