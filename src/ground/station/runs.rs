//! What became of the last runs: what each was for, which one it is compared with, and how it ended. A run is known from
//! the task that an operator gives, or from the start that begins it; it is [`RunEnd::Done`] when its last images are made,
//! and not before. This counts and remembers; it begins and ends nothing.
//!
//! ```text
//!   task, or begun ─► open ─every last image is made, or every vehicle has ended its own mission─► Done
//!                      └──no plans, nobody gets on─► Failed      └─another run begins, or is followed─► Stopped
//! ```

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{MissionKind, RunEnd, RunId, RunReport, Task, VehicleId, fitted};

use super::super::planner::SweepTask;

/// So many runs are remembered; the newest ones stay, and those that are under way.
const RUNS_MAX: usize = 16;
/// A trouble has so many bytes at most on the wire.
const TROUBLE_BYTES_MAX: usize = 200;

/// The last runs.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) struct Runs(BTreeMap<RunId, Run>);

/// One of them.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
struct Run {
    kind: MissionKind,
    compared_with: Option<RunId>,
    /// How the operator wants it to be swept; `None` = as the ground station's file says.
    sweep: Option<SweepTask>,
    /// Whether an operator has given it as a task; then that says which run it is compared with.
    is_task: bool,
    /// Who takes part in a run that is left to the vehicles, as far as that is known.
    members: Vec<VehicleId>,
    /// Whether it was started.
    is_begun: bool,
    end: Option<RunEnd>,
    /// Why it ended so, in words.
    why: String,
    /// Images that were made, also while it lasted.
    images: u32,
}

impl Run {
    fn is_of_vehicles(&self) -> bool {
        self.is_begun && self.kind != MissionKind::Sweep
    }

    /// Returns whether two are the same, however many images there are. Every field is named, so that none is forgotten.
    fn is_same_but_for_images(&self, other: &Run) -> bool {
        let Run {
            kind,
            compared_with,
            sweep,
            is_task,
            members,
            is_begun,
            end,
            why,
            images: _,
        } = self;
        (*kind, *compared_with) == (other.kind, other.compared_with)
            && (*sweep, *is_task) == (other.sweep, other.is_task)
            && *members == other.members
            && (*is_begun, *end) == (other.is_begun, other.end)
            && *why == other.why
    }

    /// Returns whether it goes on beside one that is begun: other vehicles have other missions of their own.
    fn is_beside(&self, opened: &Run) -> bool {
        let is_apart = !self
            .members
            .iter()
            .any(|member| opened.members.contains(member));
        self.is_of_vehicles() && opened.kind != MissionKind::Sweep && opened.is_task && is_apart
    }
}

impl Runs {
    /// Takes what an operator wants a run to be; one that has ended stays what it was.
    pub(super) fn take(&mut self, task: &Task) {
        let run = self.0.entry(task.run).or_default();
        if run.end.is_none() {
            (run.kind, run.compared_with) = (MissionKind::from(&task.kind), task.compare_with);
            (run.sweep, run.is_task) = (SweepTask::of(&task.kind), true);
            run.members.clone_from(&task.members);
        }
        self.forget();
    }

    /// Opens a run that is begun, once more if it has ended before. What was open before it is stopped, unless `goes_on`, or
    /// both are left to other vehicles.
    pub(super) fn open(
        &mut self,
        run: RunId,
        compared_with: Option<RunId>,
        goes_on: impl Fn(RunId) -> bool,
    ) {
        let opened = self.0.get(&run).cloned().unwrap_or_default();
        let goes_on = |earlier: RunId, known: &Run| goes_on(earlier) || known.is_beside(&opened);
        let earlier = self
            .0
            .range_mut(..run)
            .filter(|(_, known)| known.end.is_none());
        for (_, known) in earlier.filter(|(earlier, known)| !goes_on(**earlier, known)) {
            known.end = Some(RunEnd::Stopped);
        }
        let known = self.0.entry(run).or_default();
        (known.compared_with, known.is_begun) = (compared_with, true);
        (known.end, known.why) = (None, String::new());
        self.forget();
    }

    /// Ends a run; `why` may be empty.
    pub(super) fn end(&mut self, run: RunId, end: RunEnd, why: impl Into<String>) {
        if let Some(known) = self.0.get_mut(&run) {
            (known.end, known.why) = (Some(end), why.into());
        }
    }

    /// Takes up a run of before this station had a memory.
    pub(super) fn recall(&mut self, run: RunId, end: RunEnd) {
        self.0.entry(run).or_insert(Run {
            end: Some(end),
            ..Run::default()
        });
        self.forget();
    }

    /// Counts pictures of a run that were made.
    pub(super) fn count_pictures(&mut self, run: RunId, made: u32) {
        if let Some(known) = self.0.get_mut(&run) {
            known.images = known.images.saturating_add(made);
        }
    }

    /// Returns how many pictures of a run were made.
    pub(super) fn images(&self, run: RunId) -> u32 {
        self.0.get(&run).map_or(0, |known| known.images)
    }

    /// Returns whether two are the same, however many images there are: of those that are made while a run lasts there are too
    /// many to store something for each.
    pub(super) fn is_same_but_for_images(&self, other: &Runs) -> bool {
        let is_same = |((run, known), (other_run, other)): ((&RunId, &Run), (&RunId, &Run))| {
            run == other_run && known.is_same_but_for_images(other)
        };
        self.0.len() == other.0.len() && self.0.iter().zip(&other.0).all(is_same)
    }

    /// Returns whether the ground station plans a run; of one that nobody has given as a task it does.
    pub(super) fn is_swept(&self, run: RunId) -> bool {
        self.0
            .get(&run)
            .is_none_or(|known| known.kind == MissionKind::Sweep)
    }

    /// Records that vehicles are out for missions of their own in a run that has no task.
    pub(super) fn leave_to(&mut self, run: RunId, kind: MissionKind, members: Vec<VehicleId>) {
        if let Some(known) = self.0.get_mut(&run) {
            (known.kind, known.members) = (kind, members);
        }
    }

    /// Returns whether a run was begun, nobody has given it as a task, and it counts as a sweep.
    pub(super) fn is_sweep_without_task(&self, run: RunId) -> bool {
        let known = self
            .0
            .get(&run)
            .filter(|known| known.is_begun && known.end.is_none());
        known.is_some_and(|known| !known.is_task && known.kind == MissionKind::Sweep)
    }

    /// Returns the runs that are left to the vehicles, were begun and have not ended, with their members.
    pub(super) fn left_to_vehicles(&self) -> Vec<(RunId, Vec<VehicleId>)> {
        let is_open = |(_, known): &(&RunId, &Run)| known.is_of_vehicles() && known.end.is_none();
        self.0
            .iter()
            .filter(is_open)
            .map(|(run, known)| (*run, known.members.clone()))
            .collect()
    }

    /// Returns the newest run that is left to the vehicles and was begun.
    pub(super) fn newest_left_to_vehicles(&self) -> Option<RunId> {
        self.0
            .iter()
            .rev()
            .find(|(_, known)| known.is_of_vehicles())
            .map(|(run, _)| *run)
    }

    /// Returns the run that the task of a run compares it with; `None` = it has no task.
    pub(super) fn task_compares_with(&self, run: RunId) -> Option<Option<RunId>> {
        self.0
            .get(&run)
            .filter(|known| known.is_task)
            .map(|known| known.compared_with)
    }

    /// Returns how an operator wants a run to be swept; `None` = as the ground station's file says.
    pub(super) fn sweep(&self, run: RunId) -> Option<SweepTask> {
        self.0.get(&run)?.sweep
    }

    /// Returns what there is to say of each run, ascending; `samples` counts those of a run.
    pub(super) fn reports(&self, samples: impl Fn(RunId) -> u64) -> Vec<RunReport> {
        let report = |(run, known): (&RunId, &Run)| RunReport {
            run: *run,
            kind: known.kind,
            compared_with: known.compared_with,
            end: known.end,
            samples: samples(*run),
            images: known.images,
        };
        self.0.iter().map(report).collect()
    }

    /// Returns why the newest run did not come to its end, if it did not.
    pub(super) fn trouble(&self) -> Option<String> {
        let (run, known) = self.0.last_key_value()?;
        let how = match known.end.filter(|_| !known.why.is_empty())? {
            RunEnd::Done => return None,
            RunEnd::Stopped => "was given up",
            RunEnd::Failed => "has failed",
        };
        let words = format!("run {run} {how}: {}", known.why);
        Some(fitted(words, TROUBLE_BYTES_MAX))
    }

    /// Forgets the lowest runs that are too many; whatever tasks are given, not one that is under way.
    fn forget(&mut self) {
        while self.0.len() > RUNS_MAX {
            let is_under_way = |known: &Run| known.is_begun && known.end.is_none();
            let least = self
                .0
                .iter()
                .min_by_key(|(run, known)| (is_under_way(known), **run));
            let Some(run) = least.map(|(run, _)| *run) else {
                return;
            };
            self.0.remove(&run);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Lease, TaskKind, VehicleId};

    fn task(run: u32, kind: TaskKind) -> Task {
        let (lease, members) = (Lease::default(), vec![VehicleId(1)]);
        Task {
            lease,
            run: RunId(run),
            members,
            compare_with: Some(RunId(1)),
            kind,
        }
    }

    fn ends(runs: &Runs) -> Vec<(u32, Option<RunEnd>)> {
        runs.reports(|_| 0)
            .iter()
            .map(|report| (report.run.0, report.end))
            .collect()
    }

    #[test]
    fn a_run_is_stopped_when_another_begins_unless_its_images_are_still_being_made() {
        for (goes_on, end) in [(false, Some(RunEnd::Stopped)), (true, None)] {
            let mut runs = Runs::default();
            runs.open(RunId(1), None, |_| false);
            runs.open(RunId(2), Some(RunId(1)), |_| goes_on);
            assert_eq!(ends(&runs), [(1, end), (2, None)]);
        }
    }

    #[test]
    fn the_newest_sixteen_are_remembered() {
        let mut runs = Runs::default();
        for run in 1..=20 {
            runs.open(RunId(run), None, |_| false);
        }
        assert_eq!(ends(&runs).first(), Some(&(5, Some(RunEnd::Stopped))));
        assert_eq!(ends(&runs).len(), 16);
    }

    #[test]
    fn tasks_of_runs_to_come_push_out_none_that_is_under_way() {
        let mut runs = Runs::default();
        runs.open(RunId(1), None, |_| false);
        (100..200).for_each(|run| runs.take(&task(run, TaskKind::Browse)));
        assert_eq!(ends(&runs).len(), 16);
        runs.end(RunId(1), RunEnd::Done, "");
        assert_eq!(ends(&runs)[0], (1, Some(RunEnd::Done)));
        runs.take(&task(200, TaskKind::Browse));
        assert_eq!(ends(&runs)[0], (185, None), "it is over");
    }

    #[test]
    fn a_task_says_what_a_run_is_for_until_it_has_ended() {
        let mut runs = Runs::default();
        assert!(runs.is_swept(RunId(2)), "nobody has said otherwise");
        runs.take(&task(2, TaskKind::Explore));
        assert!(!runs.is_swept(RunId(2)));
        assert_eq!(runs.task_compares_with(RunId(2)), Some(Some(RunId(1))));
        runs.end(RunId(2), RunEnd::Done, "");
        runs.take(&Task {
            compare_with: None,
            ..task(2, TaskKind::Browse)
        });
        let report = runs.reports(|run| u64::from(run.0))[0];
        assert_eq!(
            (report.kind, report.compared_with),
            (MissionKind::Explore, Some(RunId(1)))
        );
        assert_eq!((report.samples, report.end), (2, Some(RunEnd::Done)));
    }

    #[test]
    fn runs_of_other_vehicles_go_on_beside_each_other_and_those_of_the_same_do_not() {
        let explore = |run: u32, vehicle: u8| Task {
            members: vec![VehicleId(vehicle)],
            compare_with: None,
            ..task(run, TaskKind::Explore)
        };
        let mut runs = Runs::default();
        for (run, vehicle) in [(1, 1), (2, 2), (3, 1)] {
            runs.take(&explore(run, vehicle));
            runs.open(RunId(run), None, |_| false);
        }
        assert_eq!(
            ends(&runs),
            [(1, Some(RunEnd::Stopped)), (2, None), (3, None)]
        );
        assert_eq!(runs.newest_left_to_vehicles(), Some(RunId(3)));
        runs.open(RunId(4), None, |_| false);
        assert_eq!(runs.left_to_vehicles(), [], "a sweep is for all");
    }

    #[test]
    fn why_the_newest_run_failed_is_said_in_words_that_can_travel() {
        let mut runs = Runs::default();
        runs.open(RunId(1), None, |_| false);
        runs.end(RunId(1), RunEnd::Failed, "ä".repeat(300));
        let words = runs.trouble().unwrap();
        assert!(
            words.starts_with("run 1 has failed: ä") && (199..=200).contains(&words.len()),
            "{words}"
        );
        runs.open(RunId(2), None, |_| false);
        assert_eq!(runs.trouble(), None, "another one has begun");
    }
}
