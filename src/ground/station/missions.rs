//! Runs that no ground station plans: the vehicles have missions of their own, and the station only watches. It says which
//! run that is, and ends it when every member that is there has ended its mission. It gives no order in such a run.
//!
//! A run is one of these by its task. Without a task it is one when every vehicle that is there says that it is out for a
//! mission of its own in it, as its file says; until then it counts as a sweep.

use tomoswarm_proto::{MissionEnd, MissionKind, MissionProgress, RunEnd, RunId, VehicleId};

use super::Station;
use crate::time::Time;

impl Station {
    /// Takes that vehicles are out for missions of their own in a run that nobody has given as a task.
    pub(super) fn look_after_kind(&mut self, now: Time, mission: &MissionProgress) {
        let run = mission.progress.run;
        if mission.kind == MissionKind::Sweep || !self.runs.is_untold(run) {
            return;
        }
        let there: Vec<VehicleId> = self.there(now).collect();
        let is_out = |id: &VehicleId| {
            let said = self.fleet.mission(*id);
            said.is_some_and(|said| said.progress.run == run && said.kind != MissionKind::Sweep)
        };
        if there.iter().all(is_out) {
            self.runs.leave_to(run, mission.kind, there);
            self.leave_to_vehicles(run);
        }
    }

    /// Ends the runs in which every member that is there has ended its mission.
    pub(super) fn look_after_missions(&mut self, now: Time) {
        for (run, members) in self.runs.of_vehicles() {
            let there = self.there(now).filter(|id| members.contains(id));
            let end_of = |id: VehicleId| {
                let said = self
                    .fleet
                    .mission(id)
                    .filter(|said| said.progress.run == run);
                Some((id, said?.end?))
            };
            let ends: Option<Vec<(VehicleId, MissionEnd)>> = there.map(end_of).collect();
            match ends.filter(|ends| !ends.is_empty()) {
                None => {}
                Some(ends) => match why_failed(&ends) {
                    None => self.runs.end(run, RunEnd::Done, ""),
                    Some(why) => self.runs.end(run, RunEnd::Failed, why),
                },
            }
        }
    }

    /// Returns the newest run that is left to the vehicles and was begun, if it is newer than another one.
    pub(super) fn newest_mission(&self, other: Option<RunId>) -> Option<RunId> {
        self.runs
            .newest_of_vehicles()
            .filter(|run| Some(*run) > other)
    }

    /// Returns the vehicles that have said their state not long ago.
    fn there(&self, now: Time) -> impl Iterator<Item = VehicleId> {
        let lost_after = self.lost_after;
        let is_there =
            move |heard_at: Option<Time>| heard_at.is_some_and(|at| now.since(at) <= lost_after);
        self.fleet
            .members()
            .filter(move |(_, member)| is_there(member.heard_at()))
            .map(|(id, _)| id)
    }
}

/// Returns why a run has failed whose vehicles have so ended; `None` = it has not. What no way leads to is found out, not
/// failed.
fn why_failed(ends: &[(VehicleId, MissionEnd)]) -> Option<String> {
    let is_failed = |end: MissionEnd| match end {
        MissionEnd::Done | MissionEnd::Stopped | MissionEnd::NoWay(_) => false,
        MissionEnd::GaveUp(_) | MissionEnd::Refused(_) => true,
    };
    let failed = ends.iter().filter(|(_, end)| is_failed(*end));
    let words: Vec<String> = failed
        .map(|(id, end)| format!("vehicle {id} {end}"))
        .collect();
    (!words.is_empty()).then(|| words.join("; "))
}
