//! The tasks that an operator has given, and which of them are still to be said: each at once, and again every 5 s until
//! a ground station's Report shows the run as the task describes it, and, where vehicles have missions of their own, the
//! Mission of every member does. A mission of its own is told again to a member that was started anew, until the next task
//! is given. It knows no lease; who says a task adds the one in force.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    Lease, MissionKind, RunId, RunReport, SweepPlanner, Task, TaskKind, VehicleId,
};

use super::fleet_view::FleetView;
use crate::config::{GivenSweep, PlannerChoice};
use crate::time::Time;

/// A task that is not shown yet is said again after this long.
const REPEAT: Duration = Duration::from_secs(5);

/// A run as an operator wants it.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct TaskRequest {
    /// Which run it is.
    pub run: RunId,
    /// Who takes part, ascending; at least one.
    pub members: Vec<VehicleId>,
    /// The run that it is compared with; `None` = with none.
    pub compare_with: Option<RunId>,
    /// What is to be done.
    pub kind: TaskKind,
}

impl TaskRequest {
    fn under(&self, lease: Lease) -> Task {
        let TaskRequest {
            run,
            members,
            compare_with,
            kind,
        } = self.clone();
        Task {
            lease,
            run,
            members,
            compare_with,
            kind,
        }
    }

    fn is_own(&self) -> bool {
        MissionKind::from(&self.kind) != MissionKind::Sweep
    }

    /// Returns how many of its members at least can do it: a sweep measures between vehicles.
    pub(super) fn least_members(&self) -> usize {
        let least = if self.is_own() { 1 } else { 2 };
        least.min(self.members.len())
    }

    /// Returns whether everyone who is to know of it shows it; without a ground station that is the members.
    fn is_shown(&self, now: Time, view: &FleetView) -> bool {
        let report = view.ground(now).map(|report| &report.value.runs);
        let is_reported = |runs: &Vec<RunReport>| runs.iter().any(|run| self.is_shown_by(run));
        match self.is_own() {
            true => {
                report.is_none_or(is_reported)
                    && self.members.iter().all(|id| self.is_shown_at(view, *id))
            }
            false => report.is_some_and(is_reported),
        }
    }

    fn is_shown_by(&self, report: &RunReport) -> bool {
        let shown = (report.run, report.kind, report.compared_with);
        shown == (self.run, MissionKind::from(&self.kind), self.compare_with)
    }

    fn is_shown_at(&self, view: &FleetView, member: VehicleId) -> bool {
        let said = view
            .vehicle(member)
            .and_then(|seen| seen.mission.as_ref())
            .map(|said| said.value);
        said.is_some_and(|said| {
            (said.progress.run, said.kind) == (self.run, MissionKind::from(&self.kind))
        })
    }
}

/// The tasks that were given and stand, and when each was said last.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct GivenTasks(BTreeMap<RunId, RepeatedTask>);

/// A task that was given.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct RepeatedTask {
    wish: TaskRequest,
    said: Option<Time>,
    is_shown: bool,
}

impl GivenTasks {
    /// Takes a task up, in place of an earlier one of its run, and of those that are shown.
    pub(super) fn give(&mut self, wish: TaskRequest) {
        self.0.retain(|_, given| !given.is_shown);
        self.0.insert(
            wish.run,
            RepeatedTask {
                wish,
                said: None,
                is_shown: false,
            },
        );
    }

    /// Returns the tasks that are due, by this lease.
    pub(super) fn due(&mut self, now: Time, view: &FleetView, lease: Lease) -> Vec<Task> {
        for given in self.0.values_mut() {
            given.is_shown = given.said.is_some() && given.wish.is_shown(now, view);
        }
        self.0
            .retain(|_, given| given.wish.is_own() || !given.is_shown);
        let is_due = |given: &RepeatedTask| {
            !given.is_shown && given.said.is_none_or(|at| now.since(at) >= REPEAT)
        };
        let due = self.0.values_mut().filter(|given| is_due(given));
        due.map(|given| {
            given.said = Some(now);
            given.wish.under(lease)
        })
        .collect()
    }

    /// Returns when one is to be said again.
    pub(super) fn next(&self) -> Option<Time> {
        let open = self.0.values().filter(|given| !given.is_shown);
        open.filter_map(|given| given.said)
            .min()
            .map(|at| at + REPEAT)
    }
}

/// Returns what is to be done: a mission of the vehicles' own, or without one this sweep.
pub fn task_kind(task: Option<TaskKind>, sweep: &GivenSweep) -> TaskKind {
    task.unwrap_or_else(|| sweep_kind(sweep))
}

fn sweep_kind(sweep: &GivenSweep) -> TaskKind {
    let milliseconds = |span: Duration| u32::try_from(span.as_millis()).unwrap_or(u32::MAX);
    let count = |number: usize| u16::try_from(number).unwrap_or(u16::MAX);
    let GivenSweep {
        planner,
        positions,
        laps,
        dwell,
        dwell_limit,
    } = *sweep;
    let planner = planner.map(|planner| match planner {
        PlannerChoice::RotatingGap => SweepPlanner::RotatingGap,
        PlannerChoice::Fan => SweepPlanner::Fan,
        PlannerChoice::Calibrate => SweepPlanner::Calibrate,
        PlannerChoice::FanCorners => SweepPlanner::FanCorners,
        PlannerChoice::FanStraight => SweepPlanner::FanStraight,
    });
    let (positions, laps) = (positions.map(count), laps.map(count));
    let dwell_ms = dwell.map(milliseconds);
    let dwell_limit_ms =
        dwell_limit.map(|limit| milliseconds(limit.max(dwell.unwrap_or_default())));
    match (planner, positions, dwell_ms, dwell_limit_ms) {
        (Some(planner), Some(positions), Some(dwell_ms), Some(dwell_limit_ms)) => TaskKind::Sweep {
            planner,
            positions,
            laps,
            dwell_ms,
            dwell_limit_ms,
        },
        _ => TaskKind::ConfiguredSweep {
            planner,
            positions,
            laps,
            dwell_ms,
            dwell_limit_ms,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::super::HeardMessage;
    use super::super::tests_support::{at, heard, report};
    use super::*;
    use tomoswarm_proto::{Boot, GroundReport, Message, MissionProgress, Progress};

    fn lease(number: u32) -> Lease {
        Lease { number, holder: 9 }
    }

    fn wish(kind: TaskKind) -> TaskRequest {
        TaskRequest {
            run: RunId(2),
            members: vec![VehicleId(1)],
            compare_with: Some(RunId(1)),
            kind,
        }
    }

    fn reported(kind: MissionKind, compared_with: Option<RunId>) -> HeardMessage {
        let run = RunReport {
            run: RunId(2),
            kind,
            compared_with,
            ..RunReport::default()
        };
        heard(Message::Report(GroundReport {
            runs: vec![run],
            ..report()
        }))
    }

    fn mission(boot: u32, run: u32, kind: MissionKind) -> HeardMessage {
        let progress = Progress {
            run: RunId(run),
            ..Progress::default()
        };
        let vehicle = VehicleId(1);
        heard(Message::Mission(MissionProgress {
            vehicle,
            boot: Boot(boot),
            progress,
            kind,
            ..MissionProgress::default()
        }))
    }

    #[test]
    fn a_sweep_is_repeated_under_the_lease_in_force_until_a_report_shows_it_as_it_is() {
        let sweep = sweep_kind(&GivenSweep {
            positions: Some(76),
            ..GivenSweep::default()
        });
        let (mut tasks, mut view) = (GivenTasks::default(), FleetView::default());
        tasks.give(wish(sweep));
        assert_eq!(tasks.due(at(0.0), &view, lease(1)).len(), 1);
        assert_eq!(
            (tasks.due(at(4.9), &view, lease(1)).len(), tasks.next()),
            (0, Some(at(5.0)))
        );
        let mut show = |at_s: f64, compared_with| {
            view.hear(at(at_s), &reported(MissionKind::Sweep, compared_with));
            tasks.due(at(at_s), &view, lease(2))
        };
        assert_eq!(
            show(5.0, None)[0].lease,
            lease(2),
            "it is shown as another one"
        );
        assert!(show(10.0, Some(RunId(1))).is_empty());
        assert!(
            show(20.0, None).is_empty(),
            "what was shown is the ground's to remember"
        );
        assert_eq!(tasks.next(), None);
    }

    #[test]
    fn a_mission_of_their_own_is_repeated_until_its_members_show_it_and_to_whoever_is_started_anew()
    {
        let (mut tasks, mut view) = (GivenTasks::default(), FleetView::default());
        tasks.give(wish(TaskKind::Explore));
        let mut count = |at_s: f64, news: Option<HeardMessage>| {
            news.into_iter().for_each(|news| view.hear(at(at_s), &news));
            (tasks.due(at(at_s), &view, lease(1)).len(), tasks.next())
        };
        assert_eq!(count(0.0, None), (1, Some(at(5.0))));
        assert_eq!(
            count(5.0, Some(reported(MissionKind::Explore, Some(RunId(1))))).0,
            1
        );
        assert_eq!(
            count(10.0, Some(mission(1, 1, MissionKind::Explore))).0,
            1,
            "in another run"
        );
        assert_eq!(
            count(11.0, Some(mission(1, 2, MissionKind::Explore))),
            (0, None)
        );
        assert_eq!(count(30.0, None).0, 0);
        assert_eq!(count(31.0, Some(mission(2, 0, MissionKind::Sweep))).0, 1);
        assert_eq!(
            count(32.0, Some(mission(2, 2, MissionKind::Explore))),
            (0, None)
        );
        tasks.give(TaskRequest {
            run: RunId(3),
            ..wish(TaskKind::Browse)
        });
        assert_eq!(tasks.0.len(), 1, "the next one takes its place");
    }
}
