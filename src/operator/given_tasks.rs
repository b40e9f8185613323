//! The tasks that an operator has given, and which of them are still to be said: each at once, and again every 5 s until
//! a ground station's Report shows the run as the task describes it. It knows no lease; who says a task adds the one in
//! force.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Lease, MissionKind, RunId, RunReport, Task, TaskKind, VehicleId};

use super::fleet_view::FleetView;
use crate::time::Time;

/// A task that is not shown yet is said again after so long.
const REPEAT: Duration = Duration::from_secs(5);

/// A run as an operator wants it.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct TaskWish {
    /// Which run it is.
    pub run: RunId,
    /// Who takes part, ascending; at least one.
    pub members: Vec<VehicleId>,
    /// The run that it is compared with; `None` = with none.
    pub compare_with: Option<RunId>,
    /// What is to be done.
    pub kind: TaskKind,
}

impl TaskWish {
    fn under(&self, lease: Lease) -> Task {
        let TaskWish { run, members, compare_with, kind } = self.clone();
        Task { lease, run, members, compare_with, kind }
    }

    fn is_shown_by(&self, report: &RunReport) -> bool {
        let shown = (report.run, report.kind, report.compared_with);
        shown == (self.run, MissionKind::from(&self.kind), self.compare_with)
    }
}

/// The tasks that no ground station shows yet, and when each was said last.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct GivenTasks(BTreeMap<RunId, (TaskWish, Option<Time>)>);

impl GivenTasks {
    /// Takes a task up, in place of an earlier one of its run.
    pub fn give(&mut self, wish: TaskWish) {
        self.0.insert(wish.run, (wish, None));
    }

    /// Returns the tasks that are due, by this lease.
    pub fn due(&mut self, now: Time, view: &FleetView, lease: Lease) -> Vec<Task> {
        let shown = view.ground(now).map(|report| report.value.runs.as_slice()).unwrap_or_default();
        self.0.retain(|_, (wish, said)| said.is_none() || !shown.iter().any(|run| wish.is_shown_by(run)));
        let is_due = |said: &Option<Time>| said.is_none_or(|at| now.since(at) >= REPEAT);
        let due = self.0.values_mut().filter(|(_, said)| is_due(said));
        due.map(|(wish, said)| {
            *said = Some(now);
            wish.under(lease)
        })
        .collect()
    }

    /// Returns when one is to be said again.
    pub fn next(&self) -> Option<Time> {
        self.0.values().filter_map(|(_, said)| *said).min().map(|at| at + REPEAT)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests_support::{at, heard, report};
    use super::*;
    use tomoswarm_proto::{Message, Report};

    #[test]
    fn a_task_is_repeated_under_the_lease_in_force_until_a_report_shows_it_as_it_is() {
        let kind = TaskKind::Explore;
        let wish =
            TaskWish { run: RunId(2), members: vec![VehicleId(1)], compare_with: Some(RunId(1)), kind };
        let (mut tasks, mut view) = (GivenTasks::default(), FleetView::default());
        let lease = |number| Lease { number, holder: 9 };
        tasks.give(wish);
        assert_eq!(tasks.due(at(0.0), &view, lease(1)).len(), 1);
        assert_eq!((tasks.due(at(4.9), &view, lease(1)).len(), tasks.next()), (0, Some(at(5.0))));
        let mut show = |at_s: f64, compared_with| {
            let runs = vec![RunReport {
                run: RunId(2),
                kind: MissionKind::Explore,
                compared_with,
                ..RunReport::default()
            }];
            view.hear(at(at_s), &heard(Message::Report(Report { runs, ..report() })));
            tasks.due(at(at_s), &view, lease(2))
        };
        assert_eq!(show(5.0, None)[0].lease, lease(2), "it is shown as another one");
        assert!(show(10.0, Some(RunId(1))).is_empty());
        assert_eq!(tasks.next(), None);
    }
}
