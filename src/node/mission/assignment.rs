//! What the vehicle is out for: the newest task of the run that it was started in; without one, what its own file says. An
//! operator's task moves nobody: it counts from the start of its run on, and at once when that was given before.
//!
//! ```text
//!   task of this run or a later one ─► kept
//!   start of a run ─► its task, if there is one ─► a mission of its own, the ground's plan, or refused, and why
//!                      └─ none: as the file says
//! ```
//!
//! Deliberately absent: by whose right a task is given ([`super::leases`]), how a mission is carried out
//! ([`super::runner`]), and a disk: who is started anew is told again.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{MissionKind, MissionRefusal, RunId, Task, TaskKind, VehicleId};

use super::share::share;
use crate::geom::{Point, Polygon};
use crate::node::VehicleSettings;

/// Tasks of so many runs are kept: the present one's, and the highest.
const RUNS_MAX: usize = 4;

/// What a vehicle is out for, and what it was told for later.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Assignment {
    vehicle: VehicleId,
    is_blind: bool,
    fence: Polygon,
    by_file: Option<TaskKind>,
    /// The run that it was started in last.
    run: RunId,
    /// Tasks of that run and of later ones.
    tasks: BTreeMap<RunId, Task>,
    /// What follows from it.
    kind: MissionKind,
    task: Result<Option<TaskKind>, MissionRefusal>,
}

impl Assignment {
    /// Makes the assignment of a vehicle that no operator has told anything.
    pub(super) fn by_file(settings: &VehicleSettings) -> Assignment {
        Assignment {
            vehicle: settings.vehicle,
            is_blind: settings.look.is_blind,
            fence: settings.fence.clone(),
            by_file: settings.task.clone(),
            run: RunId::default(),
            tasks: BTreeMap::new(),
            kind: kind_of(settings.task.as_ref()),
            task: Ok(settings.task.clone()),
        }
    }

    /// Returns the run that it was started in last.
    pub(super) fn run(&self) -> RunId {
        self.run
    }

    /// Returns the kind of what it is out for, also of what it refuses.
    pub(super) fn kind(&self) -> MissionKind {
        self.kind
    }

    /// Returns what it is out for; `None` = it follows the ground's plan.
    ///
    /// # Errors
    /// Why it is never begun.
    pub(super) fn task(&self) -> Result<Option<&TaskKind>, MissionRefusal> {
        self.task.as_ref().map(Option::as_ref).map_err(|why| *why)
    }

    /// Returns why it never begins what it was told to do.
    pub(super) fn refusal(&self) -> Option<MissionRefusal> {
        self.task.as_ref().err().copied()
    }

    /// Returns whether it does not follow the ground's plan: it has a mission of its own, or refuses its task.
    pub(super) fn is_own(&self) -> bool {
        self.task != Ok(None)
    }

    /// Takes a task, unless it is of an earlier run; returns whether the vehicle is out for something else from now on.
    pub(super) fn hear(&mut self, task: &Task) -> bool {
        if task.run < self.run {
            return false;
        }
        self.tasks.insert(task.run, task.clone());
        if self.tasks.len() > RUNS_MAX {
            let lowest = self.tasks.keys().copied().find(|run| *run != self.run);
            lowest.and_then(|run| self.tasks.remove(&run));
        }
        task.run == self.run && self.decide()
    }

    /// Records that it is started in a run; returns whether it begins something, or something else.
    pub(super) fn start(&mut self, run: RunId) -> bool {
        let is_another = run != self.run;
        self.run = run;
        self.tasks.retain(|kept, _| *kept >= run);
        self.decide() || is_another
    }

    /// Decides what it is out for in the present run; returns whether that is something else than before.
    fn decide(&mut self) -> bool {
        let (kind, task) = match self.tasks.get(&self.run) {
            Some(task) => (MissionKind::from(&task.kind), self.share_of(task)),
            None => (kind_of(self.by_file.as_ref()), Ok(self.by_file.clone())),
        };
        let is_news = (kind, &task) != (self.kind, &self.task);
        (self.kind, self.task) = (kind, task);
        is_news
    }

    /// Returns what of a task is this vehicle's to do; `None` = to follow the ground's plan.
    fn share_of(&self, task: &Task) -> Result<Option<TaskKind>, MissionRefusal> {
        let Some(index) = task
            .members
            .iter()
            .position(|member| *member == self.vehicle)
        else {
            return Err(MissionRefusal::NoPlace);
        };
        if MissionKind::from(&task.kind) == MissionKind::Sweep {
            return Ok(None);
        }
        if self.is_blind {
            return Err(MissionRefusal::NotCapable);
        }
        let share = share(&task.kind, index, task.members.len());
        let is_inside = share
            .places()
            .into_iter()
            .all(|at| self.fence.contains(Point::from(at)));
        if is_inside {
            Ok(Some(share))
        } else {
            Err(MissionRefusal::OutsideFence)
        }
    }
}

/// Returns the kind of a mission of its own; without one it sweeps.
fn kind_of(task: Option<&TaskKind>) -> MissionKind {
    task.map_or(MissionKind::Sweep, MissionKind::from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::tests_support::settings;
    use tomoswarm_proto::Position;

    fn task(run: u32, kind: TaskKind) -> Task {
        let members = vec![VehicleId(1), VehicleId(3)];
        Task {
            lease: Default::default(),
            run: RunId(run),
            members,
            compare_with: None,
            kind,
        }
    }

    fn places(all: &[(f64, f64)]) -> Vec<Position> {
        all.iter()
            .map(|(x_m, y_m)| Position::from_metres(*x_m, *y_m, 0.0))
            .collect()
    }

    /// What a vehicle that is started in run 3 makes of a task of that run.
    fn taken(vehicle: u8, kind: TaskKind) -> Result<Option<TaskKind>, MissionRefusal> {
        let mut assignment = Assignment::by_file(&settings(vehicle));
        assignment.hear(&task(3, kind));
        assert_eq!(assignment.task(), Ok(None), "it moves nobody");
        assignment.start(RunId(3));
        assignment.task().map(Option::<&TaskKind>::cloned)
    }

    #[test]
    fn every_member_takes_its_share_of_a_task() {
        let round = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 0.0)];
        let from_second = [(4.0, 0.0), (4.0, 4.0), (0.0, 0.0), (4.0, 0.0)];
        let legs = |all: &[(f64, f64)]| TaskKind::Legs {
            places: places(all),
        };
        assert_eq!(taken(1, legs(&round)), Ok(Some(legs(&round))));
        assert_eq!(taken(3, legs(&round)), Ok(Some(legs(&from_second))));
        let visits = |all: &[(f64, f64)]| TaskKind::Pathfind {
            places: places(all),
        };
        assert_eq!(
            taken(1, visits(&round)),
            Ok(Some(visits(&[(0.0, 0.0), (4.0, 4.0)])))
        );
        assert_eq!(
            taken(3, visits(&round)),
            Ok(Some(visits(&[(4.0, 0.0), (0.0, 0.0)])))
        );
        for whole in [
            TaskKind::Forward { distance_mm: 2500 },
            TaskKind::Browse,
            TaskKind::Search,
            TaskKind::Explore,
        ] {
            assert_eq!(taken(3, whole.clone()), Ok(Some(whole)));
        }
    }

    #[test]
    fn what_cannot_be_begun_is_refused_with_its_reason() {
        assert_eq!(
            taken(2, TaskKind::Explore),
            Err(MissionRefusal::NoPlace),
            "it is no member"
        );
        let out = places(&[(1.0, 1.0), (99.0, 0.0)]);
        assert_eq!(
            taken(
                3,
                TaskKind::Legs {
                    places: out.clone()
                }
            ),
            Err(MissionRefusal::OutsideFence)
        );
        let visits = TaskKind::Pathfind { places: out };
        assert_eq!(taken(3, visits.clone()), Err(MissionRefusal::OutsideFence));
        assert!(
            taken(1, visits).is_ok(),
            "the other one's places are not its own"
        );
        let mut blind = settings(1);
        blind.look.is_blind = true;
        let mut assignment = Assignment::by_file(&blind);
        assignment.hear(&task(3, TaskKind::Browse));
        assert!(assignment.start(RunId(3)) && assignment.is_own());
        assert_eq!(assignment.refusal(), Some(MissionRefusal::NotCapable));
        assert_eq!(assignment.kind(), MissionKind::Browse);
    }

    #[test]
    fn a_task_of_an_earlier_run_is_passed_over_and_of_the_present_one_the_newest_counts_at_once() {
        let mut assignment = Assignment::by_file(&settings(1));
        assignment.start(RunId(3));
        assert_eq!(assignment.task(), Ok(None));
        assert!(!assignment.hear(&task(2, TaskKind::Explore)));
        assert!(
            assignment.hear(&task(3, TaskKind::Explore)),
            "after its start it counts at once"
        );
        assert!(
            !assignment.hear(&task(3, TaskKind::Explore)),
            "and is no news again"
        );
        assert!(
            assignment.hear(&task(3, TaskKind::Browse)),
            "the newest counts"
        );
        assert!(!assignment.hear(&task(4, TaskKind::Search)));
        assert_eq!(
            assignment.task(),
            Ok(Some(&TaskKind::Browse)),
            "another run is another one's"
        );
    }

    #[test]
    fn another_run_begins_anew_and_without_a_task_as_the_file_says() {
        let by_file = VehicleSettings {
            task: Some(TaskKind::Search),
            ..settings(1)
        };
        let mut assignment = Assignment::by_file(&by_file);
        assignment.hear(&task(3, TaskKind::Explore));
        assert!(assignment.start(RunId(2)));
        assert_eq!(assignment.task(), Ok(Some(&TaskKind::Search)));
        assert!(!assignment.start(RunId(2)), "it goes on");
        assert!(assignment.start(RunId(3)));
        assert_eq!(
            (assignment.task(), assignment.run()),
            (Ok(Some(&TaskKind::Explore)), RunId(3))
        );
        assert!(assignment.start(RunId(4)));
        assert_eq!(assignment.task(), Ok(Some(&TaskKind::Search)));
    }

    #[test]
    fn tasks_to_come_never_push_out_the_present_one() {
        let mut assignment = Assignment::by_file(&settings(1));
        assignment.start(RunId(3));
        for run in 3..3000 {
            assignment.hear(&task(run, TaskKind::Explore));
        }
        assert_eq!(
            (assignment.tasks.len(), assignment.task()),
            (RUNS_MAX, Ok(Some(&TaskKind::Explore)))
        );
        assignment.start(RunId(2999));
        assert_eq!(
            assignment.task(),
            Ok(Some(&TaskKind::Explore)),
            "the newest is kept as well"
        );
    }
}
