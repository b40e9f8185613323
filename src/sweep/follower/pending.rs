//! The newest revision that was heard of and is not followed yet: its plans as they come in, and why it was refused. Where the
//! vehicle is, and what it follows, is told by the caller.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Lease, Plan, Revision, VehicleId};

use super::adopted::edition_of;
use super::peers::Edition;
use crate::geom::Point;
use crate::sweep::{OfferResult, PlanRefusal, validate};

/// The plans of a revision, collected.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct PendingRevision {
    plans: BTreeMap<VehicleId, Plan>,
    refusal: Option<PlanRefusal>,
}

/// The vehicle that would follow a revision, as it is now.
#[derive(Clone, Copy, Debug)]
pub(super) struct AdoptingVehicle {
    pub vehicle: VehicleId,
    /// Where it rests; `None` = it does not.
    pub rest: Option<Point>,
    /// How far from a plan's start it may stand to begin it, metres.
    pub tolerance_m: f64,
    /// Whether it follows a revision already.
    pub follows: bool,
}

impl PendingRevision {
    /// Returns run and revision, if there is one.
    pub(super) fn edition(&self) -> Option<Edition> {
        self.plans.values().next().map(edition_of)
    }

    /// Returns the revision, if there is one.
    pub(super) fn revision(&self) -> Option<Revision> {
        self.edition().map(|(_, revision)| revision)
    }

    /// Returns why it is not followed, if it was refused.
    pub(super) fn refusal(&self) -> Option<&PlanRefusal> {
        self.refusal.as_ref()
    }

    fn lease(&self) -> Option<Lease> {
        self.plans.values().next().map(|plan| plan.lease)
    }

    /// Forgets all of it.
    pub(super) fn give_up(&mut self) {
        self.plans.clear();
        self.refusal = None;
    }

    /// Takes a plan, beside a revision that is followed; returns false of one that is old.
    pub(super) fn collect(&mut self, plan: &Plan, followed: Option<Edition>) -> bool {
        let edition = edition_of(plan);
        // What a lower right has given and nobody here follows yet is void, whatever its revision. Two grounds may also give
        // one edition to different plans: those of the higher right are kept, never mixed.
        let lease = self.lease();
        if lease.is_some_and(|lease| lease < plan.lease) {
            self.give_up();
        }
        let newest = self.edition().or(followed);
        let known = followed.is_some_and(|followed| followed >= edition);
        if known || newest.is_some_and(|newest| newest > edition) {
            return false;
        }
        if newest == Some(edition) && lease.is_some_and(|lease| lease > plan.lease) {
            return false;
        }
        if newest != Some(edition) {
            self.give_up();
        }
        self.plans
            .entry(plan.vehicle)
            .or_insert_with(|| plan.clone());
        true
    }

    /// Hands out all plans when they are complete, fit, and the vehicle rests; nothing is pending then.
    ///
    /// # Errors
    /// The verdict that it is not so.
    pub(super) fn adopt(&mut self, candidate: AdoptingVehicle) -> Result<Vec<Plan>, OfferResult> {
        let Some(sample) = self.plans.values().next() else {
            return Err(OfferResult::Old);
        };
        let (members, revision) = (&sample.members, sample.revision);
        if !members.contains(&candidate.vehicle) {
            return Err(self.refuse(PlanRefusal::NotMember { revision }));
        }
        if let Some(refusal @ PlanRefusal::Invalid { .. }) = &self.refusal {
            return Err(OfferResult::Refused(refusal.clone()));
        }
        let is_complete = members.iter().all(|member| self.plans.contains_key(member));
        let own = self.plans.get(&candidate.vehicle).filter(|_| is_complete);
        let (Some(rest), Some(own)) = (candidate.rest, own) else {
            return Err(OfferResult::Unchanged);
        };
        let distance_m = rest.distance_to(own.start.into());
        // A vehicle without stops of its own is in the way of the others all the same.
        let all_stop = self.plans.values().all(|plan| plan.stops.is_empty());
        if !all_stop && !candidate.follows {
            return Err(self.refuse(PlanRefusal::NotStopped { revision }));
        }
        if !all_stop && distance_m > candidate.tolerance_m {
            return Err(self.refuse(PlanRefusal::Elsewhere {
                revision,
                distance_m,
            }));
        }
        let plans: Vec<Plan> = self.plans.values().cloned().collect();
        if let Err(error) = validate(&plans) {
            return Err(self.refuse(PlanRefusal::Invalid { revision, error }));
        }
        self.give_up();
        Ok(plans)
    }

    fn refuse(&mut self, refusal: PlanRefusal) -> OfferResult {
        self.refusal = Some(refusal.clone());
        OfferResult::Refused(refusal)
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::RunId;

    use super::super::tests::{self, ONE, TWO};
    use super::*;

    fn plan(vehicle: VehicleId, revision: u32, lease_number: u32, stops: u32) -> Plan {
        Plan {
            lease: Lease {
                number: lease_number,
                holder: 1,
            },
            ..tests::plan(vehicle, revision, stops)
        }
    }

    /// Vehicle 1 at rest at its start, under a revision.
    fn candidate() -> AdoptingVehicle {
        AdoptingVehicle {
            vehicle: ONE,
            rest: Some(Point::new(0.0, 5.0)),
            tolerance_m: 0.3,
            follows: true,
        }
    }

    fn collected(plans: &[Plan]) -> PendingRevision {
        let mut pending = PendingRevision::default();
        assert!(plans.iter().all(|plan| pending.collect(plan, None)));
        pending
    }

    #[test]
    fn a_revision_is_collected_until_a_newer_one_comes() {
        let mut pending = collected(&[plan(ONE, 3, 1, 2)]);
        let followed = Some((RunId(1), Revision(2)));
        assert!(
            !pending.collect(&plan(TWO, 2, 1, 2), followed),
            "it is followed"
        );
        assert!(pending.collect(&plan(TWO, 4, 1, 2), followed));
        assert!(!pending.collect(&plan(TWO, 3, 1, 2), followed));
        assert_eq!(pending.revision(), Some(Revision(4)));
        assert_eq!(
            pending.adopt(candidate()),
            Err(OfferResult::Unchanged),
            "one plan is missing"
        );
    }

    #[test]
    fn a_greater_right_makes_void_what_a_lower_one_has_given() {
        let mut pending = collected(&[plan(ONE, 900, 1, 2)]);
        assert!(pending.collect(&plan(ONE, 3, 2, 2), None));
        assert_eq!(pending.edition(), Some((RunId(1), Revision(3))));
        assert!(
            !pending.collect(&plan(TWO, 3, 1, 2), None),
            "they are not mixed"
        );
    }

    #[test]
    fn it_is_adopted_whole_and_only_by_who_rests() {
        let mut pending = collected(&[plan(TWO, 3, 1, 2), plan(ONE, 3, 1, 2)]);
        let moving = AdoptingVehicle {
            rest: None,
            ..candidate()
        };
        assert_eq!(pending.adopt(moving), Err(OfferResult::Unchanged));
        let plans = pending.adopt(candidate()).unwrap();
        assert_eq!([plans[0].vehicle, plans[1].vehicle], [ONE, TWO]);
        assert_eq!(
            pending.adopt(candidate()),
            Err(OfferResult::Old),
            "nothing is pending"
        );
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_reason() {
        let both = [plan(ONE, 3, 1, 2), plan(TWO, 3, 1, 2)];
        let refusal = |candidate| {
            let mut pending = collected(&both);
            let verdict = pending.adopt(candidate);
            (verdict.is_err(), pending.refusal().cloned())
        };
        let stranger = AdoptingVehicle {
            vehicle: VehicleId(3),
            ..candidate()
        };
        assert!(matches!(
            refusal(stranger),
            (true, Some(PlanRefusal::NotMember { .. }))
        ));
        let restarted = AdoptingVehicle {
            follows: false,
            ..candidate()
        };
        assert!(matches!(
            refusal(restarted),
            (true, Some(PlanRefusal::NotStopped { .. }))
        ));
        let elsewhere = AdoptingVehicle {
            rest: Some(Point::new(0.4, 5.0)),
            ..candidate()
        };
        assert!(matches!(
            refusal(elsewhere),
            (true, Some(PlanRefusal::Elsewhere { .. }))
        ));
        let mut empty = collected(&[plan(ONE, 3, 1, 0), plan(TWO, 3, 1, 0)]);
        assert!(empty.adopt(elsewhere).is_ok(), "nobody goes anywhere");
    }
}
