//! The book of runs: which sweep is requested and not begun yet, which runs are closed, which is the newest, and what became
//! of the last ones ([`Runs`]). A run enters it by an operator's task, or by the start that begins it. It decides nothing
//! about vehicles: when the requested sweep begins is the station's business.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{MissionKind, RunEnd, RunId, Task, VehicleId};

use super::runs::Runs;
use crate::time::Time;

/// A sweep to be begun.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) struct RequestedSweep {
    /// Its run.
    pub run: RunId,
    /// The run that it is compared with.
    pub compared_with: Option<RunId>,
}

/// What is known of runs, and asked for.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) struct RunRegistry {
    runs: Runs,
    /// Runs of which everything is done and all samples are in.
    closed: BTreeSet<RunId>,
    /// The highest run that was ever started.
    newest: RunId,
    requested: Option<RequestedSweep>,
    /// Since when the requested sweep waits for vehicles that have not been heard.
    waits_since: Time,
}

impl RunRegistry {
    /// Records that an operator has started a run; it counts if it is higher than any before. Without a task it is compared
    /// with `default`, and is a sweep.
    pub(super) fn start(&mut self, now: Time, run: RunId, default: Option<RunId>) {
        if run <= self.newest {
            return;
        }
        let default = default.filter(|other| *other != run);
        let compared_with = self.runs.task_compares_with(run).unwrap_or(default);
        // In any other kind of run the vehicles know what to do.
        if self.runs.is_swept(run) {
            self.waits_since = now;
            self.requested = Some(RequestedSweep { run, compared_with });
        }
        let closed = &self.closed;
        self.runs
            .open(run, compared_with, |earlier| closed.contains(&earlier));
        self.newest = run;
    }

    /// Takes what an operator says that a run is, before it is started or after; returns whether it counts: not of a run
    /// that another one has followed.
    pub(super) fn take_task(&mut self, task: &Task) -> bool {
        if task.run < self.newest {
            return false;
        }
        self.runs.take(task);
        if let Some(requested) = &mut self.requested
            && requested.run == task.run
        {
            requested.compared_with = task.compare_with;
        }
        if !self.runs.is_swept(task.run) {
            self.withdraw(task.run);
        }
        true
    }

    /// Leaves a run to vehicles that are out for missions of their own in it.
    pub(super) fn leave_to(&mut self, run: RunId, kind: MissionKind, members: Vec<VehicleId>) {
        self.runs.leave_to(run, kind, members);
        self.withdraw(run);
    }

    /// Records that a run has ended; `why` may be empty.
    pub(super) fn end(&mut self, run: RunId, end: RunEnd, why: impl Into<String>) {
        self.runs.end(run, end, why);
    }

    /// Records that everything of a run is done and all its samples are in; its last pictures are still to be made.
    pub(super) fn close(&mut self, run: RunId) {
        self.closed.insert(run);
    }

    /// Counts pictures of a run that were made.
    pub(super) fn count_pictures(&mut self, run: RunId, made: u32) {
        self.runs.count_pictures(run, made);
    }

    /// Takes up a run of before this station had a memory: no old order begins it again.
    pub(super) fn recall(&mut self, run: RunId, is_closed: bool) {
        self.newest = self.newest.max(run);
        let end = match is_closed {
            true => RunEnd::Done,
            false => RunEnd::Stopped,
        };
        if is_closed {
            self.closed.insert(run);
        }
        self.runs.recall(run, end);
    }

    /// Returns the sweep that is requested, and since when it waits for vehicles that have not been heard.
    pub(super) fn requested(&self) -> Option<(RequestedSweep, Time)> {
        self.requested
            .map(|requested| (requested, self.waits_since))
    }

    /// Records that the requested sweep is begun.
    pub(super) fn begin_requested(&mut self) {
        if let Some(requested) = self.requested.take() {
            self.closed.remove(&requested.run);
        }
    }

    /// Waits as long as ever for vehicles that have not been heard, from now on.
    pub(super) fn count_from(&mut self, now: Time) {
        self.waits_since = now;
    }

    /// Returns the runs that are closed.
    pub(super) fn closed(&self) -> &BTreeSet<RunId> {
        &self.closed
    }

    /// Returns what became of the last runs.
    pub(super) fn runs(&self) -> &Runs {
        &self.runs
    }

    /// Returns whether two are the same, whatever their times and their counts of images. Every field is named, so that none is
    /// forgotten.
    pub(super) fn is_same_but_for_times(&self, other: &RunRegistry) -> bool {
        let RunRegistry {
            runs,
            closed,
            newest,
            requested,
            waits_since: _,
        } = self;
        *requested == other.requested
            && *newest == other.newest
            && *closed == other.closed
            && runs.is_same_but_for_images(&other.runs)
    }

    fn withdraw(&mut self, run: RunId) {
        self.requested = self.requested.filter(|requested| requested.run != run);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use tomoswarm_proto::{Lease, TaskKind};

    fn at(at_s: u64) -> Time {
        Time::ZERO + Duration::from_secs(at_s)
    }

    fn task(run: u32, compare_with: Option<u32>, kind: TaskKind) -> Task {
        Task {
            lease: Lease::default(),
            run: RunId(run),
            members: vec![VehicleId(1)],
            compare_with: compare_with.map(RunId),
            kind,
        }
    }

    fn sweep() -> TaskKind {
        TaskKind::ConfiguredSweep {
            planner: None,
            positions: Some(16),
            laps: None,
            dwell_ms: None,
            dwell_limit_ms: None,
        }
    }

    fn requested(book: &RunRegistry) -> Option<(u32, Option<u32>)> {
        let (sweep, _) = book.requested()?;
        Some((sweep.run.0, sweep.compared_with.map(|run| run.0)))
    }

    #[test]
    fn only_a_start_of_a_higher_run_requests_a_sweep() {
        let mut book = RunRegistry::default();
        book.start(at(1), RunId(3), Some(RunId(1)));
        assert_eq!(requested(&book), Some((3, Some(1))));
        assert_eq!(book.requested().unwrap().1, at(1));
        book.start(at(2), RunId(3), None);
        book.start(at(2), RunId(2), None);
        assert_eq!(requested(&book), Some((3, Some(1))));
        book.begin_requested();
        book.start(at(3), RunId(3), None);
        assert_eq!(requested(&book), None);
        book.start(at(4), RunId(5), Some(RunId(5)));
        assert_eq!(requested(&book), Some((5, None)), "not with itself");
    }

    #[test]
    fn a_task_counts_before_the_start_and_after_but_not_once_another_run_has_followed() {
        let mut book = RunRegistry::default();
        assert!(book.take_task(&task(2, Some(7), sweep())));
        book.start(at(1), RunId(2), Some(RunId(1)));
        assert_eq!(requested(&book), Some((2, Some(7))));
        assert!(book.take_task(&task(2, None, sweep())));
        assert_eq!(requested(&book), Some((2, None)));
        book.start(at(2), RunId(3), None);
        assert!(!book.take_task(&task(2, Some(7), sweep())));
    }

    #[test]
    fn what_is_left_to_the_vehicles_is_not_requested() {
        let mut book = RunRegistry::default();
        book.take_task(&task(2, None, TaskKind::Explore));
        book.start(at(1), RunId(2), None);
        assert_eq!(requested(&book), None);
        book.start(at(2), RunId(3), None);
        book.take_task(&task(3, None, TaskKind::Explore));
        assert_eq!(requested(&book), None, "its task came after its start");
        book.start(at(3), RunId(4), None);
        book.leave_to(RunId(4), MissionKind::Explore, vec![VehicleId(1)]);
        assert_eq!(requested(&book), None);
    }

    #[test]
    fn a_closed_run_is_not_stopped_by_the_next_one_and_an_open_one_is() {
        let end = |is_closed: bool| {
            let mut book = RunRegistry::default();
            book.start(at(1), RunId(1), None);
            if is_closed {
                book.close(RunId(1));
            }
            book.start(at(2), RunId(2), None);
            book.runs().reports(|_| 0)[0].end
        };
        assert_eq!((end(false), end(true)), (Some(RunEnd::Stopped), None));
    }

    #[test]
    fn no_old_order_begins_a_run_that_was_recalled() {
        let mut book = RunRegistry::default();
        book.recall(RunId(4), true);
        book.recall(RunId(3), false);
        book.start(at(1), RunId(4), None);
        assert_eq!(requested(&book), None);
        assert_eq!(book.closed().iter().collect::<Vec<_>>(), [&RunId(4)]);
    }

    #[test]
    fn two_are_the_same_whatever_their_times_but_not_with_other_content() {
        let mut book = RunRegistry::default();
        book.start(at(1), RunId(2), None);
        let differs = |change: fn(&mut RunRegistry)| {
            let mut other = book.clone();
            change(&mut other);
            !book.is_same_but_for_times(&other)
        };
        assert!(!differs(|it| it.count_from(at(9))));
        assert!(differs(|it| it.close(RunId(1))));
        assert!(differs(RunRegistry::begin_requested));
        assert!(!differs(|it| it.count_pictures(RunId(2), 1)));
        assert!(differs(|it| it.end(RunId(2), RunEnd::Failed, "")));
        assert!(differs(|it| it.newest = RunId(9)));
    }
}
