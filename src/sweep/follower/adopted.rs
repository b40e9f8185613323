//! The revision that a vehicle follows: the plans of all members, how far each has come in them, and how far the vehicle itself
//! has come: which legs it has entered, which stops it has done, whether it dwells. It knows no other revision.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Plan, Stop, StopId, VehicleId};

use super::peers::Edition;
use crate::sweep::{FollowError, VehicleProgress, WaitsFor};
use crate::time::Time;

/// A revision with all its plans.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Adopted {
    plans: Vec<Plan>,
    own: usize,
    members: BTreeMap<VehicleId, Member>,
    done: usize,
    entered: usize,
    dwell: Option<Dwell>,
}

/// What is known of a member in this revision; only ever grows.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Member {
    order: BTreeMap<StopId, usize>,
    adopted: bool,
    done: usize,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Dwell {
    since: Time,
    missing: BTreeSet<VehicleId>,
}

impl Adopted {
    /// Begins a revision as one of its members; `follows` says of whom it is known already that it follows
    /// an edition.
    pub(super) fn new(
        plans: Vec<Plan>,
        vehicle: VehicleId,
        follows: impl Fn(VehicleId, Edition) -> bool,
    ) -> Adopted {
        let member = |plan: &Plan| {
            let order = plan.stops.iter().enumerate();
            let member = Member {
                order: order.map(|(index, stop)| (stop.id, index)).collect(),
                adopted: follows(plan.vehicle, edition_of(plan)),
                done: 0,
            };
            (plan.vehicle, member)
        };
        let members = plans.iter().map(member).collect();
        let own = plans.iter().position(|plan| plan.vehicle == vehicle);
        Adopted {
            plans,
            own: own.unwrap_or(0),
            members,
            done: 0,
            entered: 0,
            dwell: None,
        }
    }

    /// Returns the plans of all members.
    #[cfg(test)]
    pub(super) fn plans(&self) -> &[Plan] {
        &self.plans
    }

    /// Returns its own plan.
    pub(super) fn plan(&self) -> &Plan {
        &self.plans[self.own]
    }

    /// Returns the stops of its own plan.
    pub(super) fn stops(&self) -> &[Stop] {
        &self.plan().stops
    }

    /// Returns run and revision.
    pub(super) fn edition(&self) -> Edition {
        edition_of(self.plan())
    }

    /// Returns how many stops of its own plan are done.
    pub(super) fn done(&self) -> usize {
        self.done
    }

    /// Returns whether a leg is entered whose stop is not reached.
    pub(super) fn is_driving(&self) -> bool {
        self.entered > self.done && self.dwell.is_none()
    }

    /// Returns the stops whose legs are entered and which are not done.
    pub(super) fn entered(&self) -> &[Stop] {
        &self.stops()[self.done..self.entered]
    }

    /// Returns the stop of the leg `ahead` legs behind the last one entered, if it and all before it may be entered now, as far
    /// as this revision goes.
    pub(super) fn may_enter(&self, ahead: usize) -> Option<&Stop> {
        let target = self.entered.checked_add(ahead)?;
        let stop = self.stops().get(target)?;
        self.obstacle_up_to(target).is_none().then_some(stop)
    }

    /// Returns why the next leg may not be entered, if that is so.
    pub(super) fn waits_for(&self) -> Option<WaitsFor> {
        if self.entered < self.stops().len() {
            return self.obstacle_up_to(self.entered);
        }
        let dwelling = self
            .dwell
            .as_ref()
            .and_then(|_| self.stops().get(self.done));
        Some(dwelling.map_or(WaitsFor::Nothing, |stop| WaitsFor::Dwell { stop: stop.id }))
    }

    /// The first reason why not all legs up to `target` may be entered.
    fn obstacle_up_to(&self, target: usize) -> Option<WaitsFor> {
        let own = self.plan().vehicle;
        let waiting = self
            .members
            .iter()
            .find(|(vehicle, member)| **vehicle != own && !member.adopted);
        if let Some((&vehicle, _)) = waiting {
            return Some(WaitsFor::Member { vehicle });
        }
        let stops = self.stops();
        let dwelling = stops[self.done..target]
            .iter()
            .find(|stop| stop.dwell_ms > 0);
        if let Some(stop) = dwelling {
            return Some(WaitsFor::Dwell { stop: stop.id });
        }
        let after = stops[self.entered..=target]
            .iter()
            .flat_map(|stop| &stop.after);
        let missing = after
            .into_iter()
            .find(|(vehicle, stop)| !self.is_done(*vehicle, *stop));
        missing.map(|(vehicle, stop)| WaitsFor::Stop {
            vehicle: *vehicle,
            stop: *stop,
        })
    }

    fn is_done(&self, vehicle: VehicleId, stop: StopId) -> bool {
        let Some(member) = self.members.get(&vehicle) else {
            return false;
        };
        let index = member.order.get(&stop);
        index.is_some_and(|index| *index < member.done)
    }

    /// Takes the progress of a member in this revision; who rests, by its latest start, is not waited for in a dwell.
    pub(super) fn hear(&mut self, progress: &VehicleProgress, is_latest: bool) {
        if let Some(member) = self.members.get_mut(&progress.vehicle) {
            member.adopted = true;
            let index = progress.done.and_then(|stop| member.order.get(&stop));
            member.done = member.done.max(index.map_or(0, |index| index + 1));
        }
        if let Some(dwell) = self
            .dwell
            .as_mut()
            .filter(|_| is_latest && progress.leg.is_none())
        {
            dwell.missing.remove(&progress.vehicle);
        }
    }

    /// Enters the next leg.
    pub(super) fn enter(&mut self) {
        self.entered += 1;
    }

    /// Passes or reaches the stop whose leg is driven: with a dwell that begins, without one the stop is done. `rests` says
    /// which peers were heard to rest under this revision.
    ///
    /// # Errors
    /// It is not the first stop that is entered and not done.
    pub(super) fn arrive(
        &mut self,
        now: Time,
        stop: StopId,
        rests: impl Fn(VehicleId) -> bool,
    ) -> Result<(), FollowError> {
        if !self.is_driving() || self.stops()[self.done].id != stop {
            return Err(FollowError::NotThere(stop));
        }
        let reached = &self.stops()[self.done];
        if reached.dwell_ms > 0 {
            let partners = reached.partners.iter().copied();
            let missing = partners.filter(|partner| !rests(*partner)).collect();
            let since = now;
            self.dwell = Some(Dwell { since, missing });
        } else {
            self.done += 1;
        }
        Ok(())
    }

    /// Returns when the dwell ends, if the vehicle dwells.
    pub(super) fn dwell_ends(&self) -> Option<Time> {
        let dwell = self.dwell.as_ref()?;
        let stop = &self.stops()[self.done];
        let stay_ms = if dwell.missing.is_empty() {
            stop.dwell_ms
        } else {
            stop.dwell_limit_ms.max(stop.dwell_ms)
        };
        Some(dwell.since + Duration::from_millis(u64::from(stay_ms)))
    }

    /// Ends a dwell whose time is over; returns whether a stop was done by that.
    pub(super) fn end_dwell(&mut self, now: Time) -> bool {
        let is_over = self.dwell_ends().is_some_and(|at| at <= now);
        if is_over {
            self.dwell = None;
            self.done += 1;
        }
        is_over
    }

    /// Returns its own progress; its boot is for the caller to fill in.
    pub(super) fn progress(&self) -> VehicleProgress {
        let (run, revision) = self.edition();
        let id = |count: usize| count.checked_sub(1).map(|last| self.stops()[last].id);
        VehicleProgress {
            vehicle: self.plan().vehicle,
            run,
            revision,
            done: id(self.done),
            leg: id(self.entered).filter(|_| self.is_driving()),
            ..VehicleProgress::default()
        }
    }
}

/// Returns the revision that a plan belongs to.
pub(super) fn edition_of(plan: &Plan) -> Edition {
    (plan.run, plan.revision)
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{Position, Revision, RunId};

    use super::*;

    const ONE: VehicleId = VehicleId(1);
    const TWO: VehicleId = VehicleId(2);

    fn stop(number: u32, dwell_ms: u32, after: &[u32]) -> Stop {
        Stop {
            id: StopId(number),
            at: Position::from_metres(f64::from(number), 0.0, 0.0),
            route: vec![],
            dwell_ms,
            dwell_limit_ms: 3 * dwell_ms,
            partners: vec![TWO],
            after: after.iter().map(|stop| (TWO, StopId(*stop))).collect(),
        }
    }

    /// Vehicle 1 with stops of its own; vehicle 2 has stops 7 and 8.
    fn adopted(stops: Vec<Stop>, other_follows: bool) -> Adopted {
        let plan = |vehicle, stops| Plan {
            vehicle,
            run: RunId(1),
            revision: Revision(2),
            members: vec![ONE, TWO],
            stops,
            ..Plan::default()
        };
        let others = plan(TWO, vec![stop(7, 0, &[]), stop(8, 0, &[])]);
        Adopted::new(vec![plan(ONE, stops), others], ONE, |_, _| other_follows)
    }

    fn heard(done: Option<u32>, leg: Option<u32>) -> VehicleProgress {
        VehicleProgress {
            vehicle: TWO,
            done: done.map(StopId),
            leg: leg.map(StopId),
            ..VehicleProgress::default()
        }
    }

    fn second(seconds: f64) -> Time {
        Time::from_secs_f64(seconds)
    }

    #[test]
    fn no_leg_is_entered_before_everybody_follows_and_has_done_what_is_waited_for() {
        let mut adopted = adopted(vec![stop(1, 0, &[7]), stop(2, 0, &[8])], false);
        assert_eq!(adopted.waits_for(), Some(WaitsFor::Member { vehicle: TWO }));
        adopted.hear(&heard(None, Some(7)), true);
        let stop = StopId(7);
        assert_eq!(
            adopted.waits_for(),
            Some(WaitsFor::Stop { vehicle: TWO, stop })
        );
        adopted.hear(&heard(Some(7), Some(8)), true);
        assert_eq!((adopted.waits_for(), adopted.may_enter(1)), (None, None));
        adopted.hear(&heard(Some(8), None), true);
        adopted.hear(&heard(Some(7), Some(8)), true);
        assert_eq!(
            adopted.may_enter(1).map(|stop| stop.id),
            Some(StopId(2)),
            "a late word takes nothing back"
        );
        assert_eq!(adopted.may_enter(2), None);
    }

    #[test]
    fn legs_are_entered_ahead_and_stops_done_in_their_order() {
        let mut adopted = adopted(vec![stop(1, 0, &[]), stop(2, 0, &[])], true);
        (0..2).for_each(|_| adopted.enter());
        assert_eq!(adopted.progress().leg, Some(StopId(2)));
        let arrive =
            |adopted: &mut Adopted, stop| adopted.arrive(second(1.0), StopId(stop), |_| true);
        assert_eq!(
            arrive(&mut adopted, 2),
            Err(FollowError::NotThere(StopId(2)))
        );
        assert_eq!(arrive(&mut adopted, 1), Ok(()));
        assert_eq!(
            (
                adopted.done(),
                adopted.entered().len(),
                adopted.is_driving()
            ),
            (1, 1, true)
        );
        assert_eq!(arrive(&mut adopted, 2), Ok(()));
        let progress = adopted.progress();
        assert_eq!(
            (progress.done, progress.leg, adopted.is_driving()),
            (Some(StopId(2)), None, false)
        );
        assert_eq!(adopted.waits_for(), Some(WaitsFor::Nothing));
    }

    #[test]
    fn a_dwell_is_shorter_once_the_partner_rests() {
        for (rests, ends_s) in [(true, 12.0), (false, 16.0)] {
            let mut adopted = adopted(vec![stop(1, 2000, &[])], true);
            adopted.enter();
            adopted.arrive(second(10.0), StopId(1), |_| rests).unwrap();
            assert_eq!(adopted.dwell_ends(), Some(second(ends_s)));
            assert_eq!(
                adopted.waits_for(),
                Some(WaitsFor::Dwell { stop: StopId(1) })
            );
            adopted.hear(&heard(None, None), false);
            assert_eq!(
                adopted.dwell_ends(),
                Some(second(ends_s)),
                "an earlier start said it"
            );
            adopted.hear(&heard(None, None), true);
            assert_eq!(adopted.dwell_ends(), Some(second(12.0)));
            assert!(!adopted.end_dwell(second(11.9)) && adopted.end_dwell(second(12.0)));
            assert_eq!((adopted.done(), adopted.dwell_ends()), (1, None));
        }
    }
}
