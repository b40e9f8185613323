//! Which run an order belongs to, and what that run is: the present one, the next one, or one that a mission begins.

use tomoswarm_proto::{
    GroundReport, MissionEnd, MissionKind, OrderKind, RunId, StationPhase, VehicleId,
};

use super::{LAST_REVISION, Ordering};
use crate::operator::given_tasks::TaskRequest;
use crate::operator::outcome::{OrderRefusal, VehicleOutcome};
use crate::time::Time;

impl Ordering {
    /// Returns the mission that is begun, as the task of its run: once, when it is known who takes part.
    pub fn task(&mut self, now: Time, is_linked: bool) -> Option<TaskRequest> {
        if is_linked {
            self.linked.get_or_insert(now);
        }
        let mission = self
            .instruction
            .mission
            .clone()
            .filter(|_| !self.is_task_given)?;
        let knows_all = !self.instruction.vehicles.is_empty() || self.has_listened(now);
        if self.linked.is_none()
            || !knows_all
            || !self.knows_ground(now)
            || self.refusal(now).is_some()
        {
            return None;
        }
        let members: Vec<VehicleId> = self
            .targets(now)
            .into_iter()
            .filter(|id| self.misfit(*id).is_none())
            .collect();
        if members.is_empty() {
            return None;
        }
        let run = self.next_run(now);
        (self.is_task_given, self.run) = (true, Some(run));
        Some(TaskRequest {
            run,
            members,
            compare_with: mission.compare_with,
            kind: mission.kind,
        })
    }

    /// Returns whether its mission is still to be given as a task, before anybody is started.
    pub(super) fn waits_for_task(&self) -> bool {
        self.instruction.mission.is_some() && !self.is_task_given
    }

    /// Returns the run of the orders, chosen once: what was started must not count as a run before.
    pub(super) fn run_of(&mut self, now: Time) -> RunId {
        if let Some(run) = self.run {
            return run;
        }
        let newest = self.newest_run(now);
        let report = self.view.ground(now).map(|report| &report.value);
        let is_idle = report.is_some_and(|report| report.phase == StationPhase::Idle);
        let is_left_to_vehicles = report.is_some_and(|report| is_open_mission(report, newest));
        let is_new = self.instruction.begins && is_idle && !is_left_to_vehicles;
        let run = self
            .instruction
            .run
            .unwrap_or(if is_new { self.next_run(now) } else { newest });
        self.run = Some(run);
        run
    }

    /// Returns why no other run may begin: one is under way that is not to be given up.
    pub(super) fn run_under_way(&self, now: Time) -> Option<OrderRefusal> {
        let is_own = self.instruction.mission.is_some();
        let asked = self
            .instruction
            .run
            .or_else(|| is_own.then(|| self.next_run(now)))?;
        let GroundReport {
            phase,
            run: under_way,
            ..
        } = &self.view.ground(now)?.value;
        let under_way = *under_way;
        let is_driven = match phase {
            StationPhase::Stopping | StationPhase::Planning | StationPhase::Running => true,
            StationPhase::Idle | StationPhase::Waiting | StationPhase::Closing => false,
        };
        let is_refused = is_driven && under_way != asked && !self.instruction.ends_run;
        is_refused.then_some(OrderRefusal::UnderWay { under_way, asked })
    }

    /// Returns why the run that is asked for cannot begin: the ground station, which drives none, says that it has ended.
    pub(super) fn run_ended(&self, now: Time) -> Option<OrderRefusal> {
        let asked = self.instruction.run?;
        let report = &self.view.ground(now)?.value;
        let of_run = report.runs.iter().find(|known| known.run == asked);
        let is_over = of_run.map_or(asked < report.run, |known| known.end.is_some());
        let is_idle = report.phase == StationPhase::Idle;
        (is_idle && is_over).then_some(OrderRefusal::Ended(asked))
    }

    /// Returns what the mission that is to be begun lacks of the ground station; before that was listened for, nothing.
    pub(super) fn mission_misfit(&self, now: Time) -> Option<OrderRefusal> {
        let ground = self.view.ground(now).map(|report| &report.value);
        let is_known = ground.is_some() || self.has_listened(now);
        let mission = self.instruction.mission.as_ref();
        let mission = mission.filter(|_| is_known && !self.is_task_given)?;
        mission.judge(ground).err().map(OrderRefusal::Mission)
    }

    /// Returns the newest run that anybody was started in.
    fn newest_run(&self, now: Time) -> RunId {
        let states = self
            .view
            .vehicles()
            .filter_map(|(_, seen)| seen.state.as_ref());
        let driven = states.map(|state| state.value.accepted.0.max(state.value.ordered.run));
        let report = self.view.ground(now).map(|report| report.value.run);
        driven.chain(report).max().unwrap_or_default()
    }

    /// Returns the next run: above all that were started, and above those that were only given as a task.
    pub(super) fn next_run(&self, now: Time) -> RunId {
        let report = self.view.ground(now).map(|report| &report.value);
        let given = report
            .and_then(|report| report.runs.last())
            .map(|run| run.run);
        let newest = self.newest_run(now).max(given.unwrap_or_default());
        RunId(newest.0.saturating_add(1).min(LAST_REVISION))
    }

    /// Returns what became of a vehicle that has obeyed the start of a mission, when there is more to say than that.
    pub(super) fn mission_outcome(
        &self,
        now: Time,
        id: VehicleId,
        outcome: VehicleOutcome,
    ) -> Option<VehicleOutcome> {
        let VehicleOutcome::Obeyed { after, .. } = outcome else {
            return None;
        };
        let output = self
            .view
            .vehicle(id)
            .and_then(|seen| seen.mission.as_ref())
            .map(|output| output.value);
        let Some(wish) = self.instruction.mission.as_ref() else {
            let shown = output.map(|output| output.progress.run);
            let run = self.run.filter(|_| shown != self.run)?;
            if !self.goes_on_with(now, run) {
                return None;
            }
            // Its mission is said each second: who is not heard of yet may have a part.
            return Some(match self.has_listened(now) {
                true => VehicleOutcome::NoPart { after, run },
                false => VehicleOutcome::NotOut,
            });
        };
        let kind = MissionKind::from(&wish.kind);
        let output = output.filter(|output| output.kind == kind);
        match output {
            // The ground station makes its plans first.
            _ if kind == MissionKind::Sweep => None,
            Some(output) if Some(output.progress.run) == self.run => match output.end {
                Some(MissionEnd::Refused(why)) => Some(VehicleOutcome::Refused(why)),
                Some(
                    MissionEnd::Done
                    | MissionEnd::Stopped
                    | MissionEnd::NoWay(_)
                    | MissionEnd::GaveUp(_),
                )
                | None => None,
            },
            Some(_) | None => Some(VehicleOutcome::NotOut),
        }
    }

    /// Returns whether it is a start that goes on with a mission that is left to the vehicles.
    fn goes_on_with(&self, now: Time, run: RunId) -> bool {
        let report = self.view.ground(now).map(|report| &report.value);
        self.instruction.kind == OrderKind::Start
            && report.is_some_and(|report| is_open_mission(report, run))
    }
}

/// Returns whether a run was begun, is none that a ground station plans, and has not ended.
fn is_open_mission(report: &GroundReport, run: RunId) -> bool {
    let of_run = report.runs.iter().find(|known| known.run == run);
    of_run.is_some_and(|known| known.kind != MissionKind::Sweep && known.end.is_none())
}
