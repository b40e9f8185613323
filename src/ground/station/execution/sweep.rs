//! One sweep as it is executed: its run, what it is compared with, and its laps. Knows neither plans nor times.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{RunId, StopId, VehicleId};

use super::super::run_registry::RequestedSweep;

/// A sweep that was begun.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(crate) struct SweepRun {
    run: RunId,
    compared_with: Option<RunId>,
    laps_done: usize,
    /// Whether a vehicle has come back or was restarted since everyone was last brought to rest.
    is_disturbed: bool,
    /// Whether plans were made anew for want of progress since a lap was done.
    is_retried: bool,
}

impl SweepRun {
    /// Begins a sweep.
    pub(crate) fn new(requested: RequestedSweep) -> SweepRun {
        SweepRun {
            run: requested.run,
            compared_with: requested.compared_with,
            laps_done: 0,
            is_disturbed: false,
            is_retried: false,
        }
    }

    /// Returns its run.
    pub(crate) fn run(&self) -> RunId {
        self.run
    }

    /// Returns the run that it is compared with.
    pub(crate) fn compared_with(&self) -> Option<RunId> {
        self.compared_with
    }

    /// Compares it with another run from now on.
    pub(crate) fn compare_with(&mut self, compared_with: Option<RunId>) {
        self.compared_with = compared_with;
    }

    /// Returns how many laps all vehicles have done.
    pub(crate) fn laps_done(&self) -> usize {
        self.laps_done
    }

    /// Records how many laps are done; returns whether these are more than before.
    pub(crate) fn complete_laps(&mut self, laps_done: usize) -> bool {
        let is_more = laps_done > self.laps_done;
        if is_more {
            (self.laps_done, self.is_retried) = (laps_done, false);
        }
        is_more
    }

    /// Records that its plans no longer suit the vehicles: everyone must be brought to rest.
    pub(crate) fn disturb(&mut self) {
        self.is_disturbed = true;
    }

    /// Records that everyone is brought to rest, to be planned for anew.
    pub(crate) fn settle(&mut self) {
        self.is_disturbed = false;
    }

    /// Returns whether its plans no longer suit the vehicles.
    pub(crate) fn is_disturbed(&self) -> bool {
        self.is_disturbed
    }

    /// Returns whether plans were made anew for want of progress since a lap was done.
    pub(crate) fn is_retried(&self) -> bool {
        self.is_retried
    }

    /// Returns whether it may be planned anew for want of progress: once for every lap.
    pub(crate) fn retry(&mut self) -> bool {
        !std::mem::replace(&mut self.is_retried, true)
    }
}

/// The laps for which there are plans.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(crate) struct Laps {
    /// Laps done before the present plans were made.
    done_before: usize,
    /// The last stop of each vehicle, per lap that was still to be driven then.
    last_stops: Vec<Vec<(VehicleId, StopId)>>,
}

impl Laps {
    /// Takes the laps of plans that were made when `done_before` laps were done.
    pub(crate) fn new(done_before: usize, last_stops: Vec<Vec<(VehicleId, StopId)>>) -> Laps {
        Laps {
            done_before,
            last_stops,
        }
    }

    /// Returns how many laps the whole sweep has, those done under earlier plans included.
    pub(crate) fn total(&self) -> usize {
        self.done_before + self.last_stops.len()
    }

    /// Returns how many laps of the whole sweep are done, when `known` are known to be; `is_done` says whether all
    /// vehicles have done their last stops of a lap.
    pub(crate) fn done(
        &self,
        known: usize,
        is_done: impl Fn(&[(VehicleId, StopId)]) -> bool,
    ) -> usize {
        let known = known.saturating_sub(self.done_before);
        let further = self.last_stops.iter().skip(known);
        self.done_before + known + further.take_while(|lap| is_done(lap)).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep() -> SweepRun {
        SweepRun::new(RequestedSweep {
            run: RunId(2),
            compared_with: None,
        })
    }

    #[test]
    fn a_lap_that_is_done_allows_for_another_retry() {
        let mut sweep = sweep();
        assert!(sweep.retry() && !sweep.retry());
        assert!(!sweep.complete_laps(0) && !sweep.retry(), "no lap was done");
        assert!(sweep.complete_laps(1) && sweep.retry() && !sweep.retry());
        assert_eq!(sweep.laps_done(), 1);
    }

    #[test]
    fn it_is_disturbed_until_everyone_is_brought_to_rest() {
        let mut sweep = sweep();
        assert!(!sweep.is_disturbed());
        sweep.disturb();
        assert!(sweep.is_disturbed());
        sweep.settle();
        assert!(!sweep.is_disturbed());
    }

    #[test]
    fn laps_are_counted_in_their_order_and_on_from_those_done_under_earlier_plans() {
        let lap = |stop: u32| vec![(VehicleId(1), StopId(stop))];
        let laps = Laps::new(1, vec![lap(10), lap(20), lap(30)]);
        let done =
            |known: usize, stops: &[u32]| laps.done(known, |lap| stops.contains(&lap[0].1.0));
        assert_eq!(laps.total(), 4);
        assert_eq!((done(1, &[]), done(1, &[10, 20])), (1, 3));
        assert_eq!(done(1, &[20, 30]), 1, "the first of them is not done");
        assert_eq!(done(2, &[20]), 3, "what is known to be done stays done");
        assert_eq!(Laps::new(2, vec![]).done(2, |_| false), 2);
    }
}
