//! Runs that no ground station plans: the vehicles have missions of their own, and the station only watches. It says which
//! run that is, and ends it when every member that is there has ended its mission. It gives no order in such a run.
//!
//! A run is one of these by its task. Without a task it is one when every vehicle that is there says that it is out for a
//! mission of its own in it, as its file says; until then it counts as a sweep. This reads what the vehicles say; what
//! became of a run is kept in the book of runs.

use tomoswarm_proto::{MissionEnd, MissionKind, RunEnd, RunId, VehicleId};

use super::lost_vehicles::SilenceLimits;
use crate::ground::fleet::Fleet;
use crate::time::Time;

/// The missions of the vehicles' own, as they say them at one moment.
#[derive(Clone, Copy, Debug)]
pub(super) struct OwnMissions<'a> {
    now: Time,
    fleet: &'a Fleet,
    silence: SilenceLimits,
}

impl OwnMissions<'_> {
    /// Looks at what the vehicles of a fleet have said last.
    pub(super) fn new(now: Time, fleet: &Fleet, silence: SilenceLimits) -> OwnMissions<'_> {
        OwnMissions {
            now,
            fleet,
            silence,
        }
    }

    /// Returns the vehicles that are there if all of them are out for missions of their own in a run; `None` = not all are.
    pub(super) fn members_of(self, run: RunId) -> Option<Vec<VehicleId>> {
        let is_out = |id: &VehicleId| {
            let report = self.fleet.mission(*id);
            report.is_some_and(|report| {
                report.progress.run == run && report.kind != MissionKind::Sweep
            })
        };
        let there: Vec<VehicleId> = self.there().collect();
        there.iter().all(is_out).then_some(there)
    }

    /// Returns how a run of these members has ended, and why in words; `None` = one is under way, or none is there.
    pub(super) fn end_of(self, run: RunId, members: &[VehicleId]) -> Option<(RunEnd, String)> {
        let end_of = |id: VehicleId| {
            let report = self.fleet.mission(id);
            let report = report.filter(|report| report.progress.run == run);
            Some((id, report?.end?))
        };
        let there = self.there().filter(|id| members.contains(id));
        let ends: Vec<(VehicleId, MissionEnd)> = there.map(end_of).collect::<Option<_>>()?;
        if ends.is_empty() {
            return None;
        }
        let why = why_failed(&ends);
        let end = match why.is_empty() {
            true => RunEnd::Done,
            false => RunEnd::Failed,
        };
        Some((end, why))
    }

    fn there(&self) -> impl Iterator<Item = VehicleId> {
        self.silence.there(self.now, self.fleet)
    }
}

/// Returns why a run has failed whose vehicles have so ended; empty = it has not. What no way leads to is found out, not
/// failed.
fn why_failed(ends: &[(VehicleId, MissionEnd)]) -> String {
    let is_failed = |end: MissionEnd| match end {
        MissionEnd::Done | MissionEnd::Stopped | MissionEnd::NoWay(_) => false,
        MissionEnd::GaveUp(_) | MissionEnd::Refused(_) => true,
    };
    let failed = ends.iter().filter(|(_, end)| is_failed(*end));
    let words: Vec<String> = failed
        .map(|(id, end)| format!("vehicle {id} {end}"))
        .collect();
    words.join("; ")
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use tomoswarm_proto::{Boot, Lease, MissionProgress, Progress, State};

    const RUN: RunId = RunId(4);

    /// A fleet of which each vehicle was heard at the first second, and says that mission of run 4.
    fn fleet(missions: &[(MissionKind, Option<MissionEnd>)]) -> Fleet {
        let vehicles: Vec<VehicleId> = (1..).take(missions.len()).map(VehicleId).collect();
        let mut fleet = Fleet::new(&vehicles, Lease::default());
        for (vehicle, (kind, end)) in vehicles.into_iter().zip(missions) {
            let state = State {
                vehicle,
                boot: Boot(1),
                sequence: 1,
                ..State::default()
            };
            fleet.heard_state(Time::ZERO, state);
            let progress = Progress {
                run: RUN,
                ..Progress::default()
            };
            fleet.heard_mission(&MissionProgress {
                vehicle,
                boot: Boot(1),
                progress,
                kind: *kind,
                end: *end,
                ..MissionProgress::default()
            });
        }
        fleet
    }

    fn at(now_s: u64, fleet: &Fleet) -> OwnMissions<'_> {
        let limit = Duration::from_secs(30);
        let now = Time::ZERO + Duration::from_secs(now_s);
        OwnMissions::new(now, fleet, SilenceLimits::new(limit, limit))
    }

    #[test]
    fn a_run_is_left_to_vehicles_that_are_all_out_for_missions_of_their_own_in_it() {
        let (explore, sweep) = ((MissionKind::Explore, None), (MissionKind::Sweep, None));
        let all = fleet(&[explore, explore]);
        assert_eq!(
            at(1, &all).members_of(RUN),
            Some(vec![VehicleId(1), VehicleId(2)])
        );
        assert_eq!(at(1, &all).members_of(RunId(5)), None);
        let mixed = fleet(&[explore, sweep]);
        assert_eq!(at(1, &mixed).members_of(RUN), None);
    }

    #[test]
    fn a_run_ends_when_all_members_that_are_there_have_ended_and_says_who_failed_and_why() {
        let explore = |end| (MissionKind::Explore, end);
        let done = explore(Some(MissionEnd::Done));
        for (last, expected) in [
            (explore(None), None),
            (done, Some((RunEnd::Done, ""))),
            (
                explore(Some(MissionEnd::NoWay(2))),
                Some((RunEnd::Done, "")),
            ),
            (
                explore(Some(MissionEnd::GaveUp(2))),
                Some((RunEnd::Failed, "vehicle 2 gave up 2")),
            ),
        ] {
            let fleet = fleet(&[done, last]);
            let members = [VehicleId(1), VehicleId(2)];
            let expected = expected.map(|(end, why)| (end, why.to_owned()));
            assert_eq!(at(1, &fleet).end_of(RUN, &members), expected);
            let first = Some((RunEnd::Done, String::new()));
            assert_eq!(at(1, &fleet).end_of(RUN, &members[..1]), first);
        }
    }

    #[test]
    fn nothing_ends_while_nobody_is_there() {
        let fleet = fleet(&[(MissionKind::Explore, Some(MissionEnd::Done))]);
        assert!(at(30, &fleet).end_of(RUN, &[VehicleId(1)]).is_some());
        assert_eq!(at(31, &fleet).end_of(RUN, &[VehicleId(1)]), None);
    }
}
