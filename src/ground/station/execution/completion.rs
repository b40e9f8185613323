//! When a lap is done, and when a run is: every stop was made, and the samples are in.

use std::time::Duration;

use super::{Conditions, ExecutionPhase, PublishedPlans, SweepOutput};

/// Time for the last samples to come in after the last stop.
const CLOSING: Duration = Duration::from_secs(3);
/// Gaps in the samples are waited for at most this long.
const CLOSING_MAX: Duration = Duration::from_secs(60);

/// Counts the laps that all vehicles have done; after the last one the samples are waited for.
pub(super) fn count_laps(
    phase: &mut ExecutionPhase,
    plans: &PublishedPlans,
    at: &Conditions<'_>,
) -> Option<SweepOutput> {
    let ExecutionPhase::Running { sweep, laps, .. } = phase else {
        return None;
    };
    let is_done = |lap: &[_]| plans.is_lap_done(at.fleet, lap);
    let done = laps.done(sweep.laps_done(), is_done);
    let is_last = done == laps.total();
    let is_new = sweep.complete_laps(done);
    let sweep = *sweep;
    if is_last {
        phase.close(at.now);
    }
    is_new.then_some(SweepOutput::LapDone { sweep, is_last })
}

/// Closes a run whose samples are in; of what is missing no more is expected after a while, in which they could be stored.
pub(super) fn close(phase: &mut ExecutionPhase, at: &Conditions<'_>) -> Option<SweepOutput> {
    let ExecutionPhase::Closing { sweep, since } = phase else {
        return None;
    };
    if !at.stores_samples {
        *since = at.now;
    }
    let (sweep, waited) = (*sweep, at.now.since(*since));
    if waited < CLOSING || (waited < CLOSING_MAX && at.samples.has_gaps(sweep.run())) {
        return None;
    }
    phase.end();
    Some(SweepOutput::Closed(sweep))
}
