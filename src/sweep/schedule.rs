//! What a planner hands over: the plans, and which stops end which lap.

use tomoswarm_proto::{Plan, StopId, VehicleId};

use super::precedence::{resolve_after, topological_order, tracks_of, validate};
use super::{PlanError, SweepError, VehicleProgress};

/// A plan that travels has at most so many stops.
const MOST_STOPS: usize = 4096;

/// Plans of all vehicles, with their schedule.
#[derive(Clone, PartialEq, Debug)]
pub struct PlannedSweep {
    /// One plan per vehicle, ascending by vehicle.
    pub plans: Vec<Plan>,
    /// The laps of the sweep.
    pub schedule: Schedule,
}

/// Checks that plans can travel.
///
/// # Errors
/// One has too many stops.
pub(super) fn check_stops(plans: &[Plan]) -> Result<(), SweepError> {
    plans
        .iter()
        .try_for_each(|plan| check_count(plan.stops.len()))
}

/// Checks that a plan of so many stops can travel.
///
/// # Errors
/// They are too many.
pub(super) fn check_count(stops: usize) -> Result<(), SweepError> {
    if stops > MOST_STOPS {
        let limit = MOST_STOPS;
        return Err(SweepError::TooManyStops { stops, limit });
    }
    Ok(())
}

/// The laps of a sweep, in order.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Schedule {
    /// The laps that the plans drive; not those already driven before.
    pub laps: Vec<Lap>,
}

/// One lap (of the fan: one round).
#[derive(Clone, PartialEq, Debug)]
pub struct Lap {
    /// Its number in the whole sweep, from 0.
    pub number: usize,
    /// Per vehicle, ascending, its first and last stop of the lap.
    pub stops: Vec<(VehicleId, StopId, StopId)>,
}

/// Returns whether a vehicle's progress says that a stop of its plan is done. Stops are done in the order of the plan,
/// which is not that of their numbers.
///
/// Progress of another vehicle, run or revision says nothing of the plan.
pub fn has_done(plan: &Plan, progress: &VehicleProgress, stop: StopId) -> bool {
    let done = &plan.stops[..stops_done(plan, progress)];
    done.iter().any(|candidate| candidate.id == stop)
}

/// Returns how many stops of its plan a vehicle's progress says to be done: the first ones.
///
/// Progress of another vehicle, run or revision says nothing of the plan.
pub fn stops_done(plan: &Plan, progress: &VehicleProgress) -> usize {
    let same = (plan.vehicle, plan.run, plan.revision)
        == (progress.vehicle, progress.run, progress.revision);
    let index = |id: StopId| plan.stops.iter().position(|candidate| candidate.id == id);
    let last = progress.done.filter(|_| same).and_then(index);
    last.map_or(0, |last| last + 1)
}

/// When a stop of a plan is expected to be done.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ExpectedStop {
    /// When its leg can be entered, seconds from the start of the plans.
    pub ready_s: f64,
    /// When its dwell is over, seconds from the start of the plans.
    pub done_s: f64,
    /// What it comes after: the last to be done of all that must be, as the indices of a plan and of a stop in it; `None` =
    /// nothing.
    pub behind: Option<(usize, usize)>,
}

/// Returns when every stop of plans is done at a steady speed, with turns for nothing and every dwell at its shortest: for
/// each plan its stops, in order.
///
/// # Errors
/// The plans are not valid together.
pub fn expected_stops(plans: &[Plan], speed_mps: f64) -> Result<Vec<Vec<ExpectedStop>>, PlanError> {
    validate(plans)?;
    let after = resolve_after(plans)?;
    let nothing = ExpectedStop {
        ready_s: 0.0,
        done_s: 0.0,
        behind: None,
    };
    let mut expected: Vec<Vec<ExpectedStop>> = plans
        .iter()
        .map(|plan| vec![nothing; plan.stops.len()])
        .collect();
    let lengths_m: Vec<Vec<f64>> = plans
        .iter()
        .map(|plan| {
            tracks_of(plan)
                .iter()
                .map(crate::geom::Track::length_m)
                .collect()
        })
        .collect();
    for (index, at) in topological_order(plans)? {
        let own = (at > 0).then(|| (index, at - 1));
        let before = own.into_iter().chain(after[index][at].iter().copied());
        let done_s = |(of, stop): (usize, usize)| expected[of][stop].done_s;
        let behind = before.max_by(|one, other| done_s(*one).total_cmp(&done_s(*other)));
        let ready_s = behind.map_or(0.0, done_s);
        let dwell_s = f64::from(plans[index].stops[at].dwell_ms) * 1e-3;
        expected[index][at] = ExpectedStop {
            ready_s,
            done_s: ready_s + lengths_m[index][at] / speed_mps + dwell_s,
            behind,
        };
    }
    Ok(expected)
}

/// Returns the time to drive plans to their ends at a steady speed, with turns for nothing and every
/// dwell at its shortest, seconds.
///
/// # Errors
/// The plans are not valid together.
pub fn expected_duration_s(plans: &[Plan], speed_mps: f64) -> Result<f64, PlanError> {
    Ok(expected_stops(plans, speed_mps)?
        .iter()
        .filter_map(|stops| stops.last())
        .map(|stop| stop.done_s)
        .fold(0.0, f64::max))
}
