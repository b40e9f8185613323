//! The ground's side of revisions: stop everyone, learn where they rest, begin the next revision.
//!
//! ```text
//!           stop()                    every member reports it        begin(plans)
//!  Driving ────────► Stopping (empty) ─────────────────────► Stopped ───────────► Driving
//! ```
//!
//! An empty revision (no stops, start anywhere) makes every vehicle finish or hold its leg and report;
//! only then is it known from where the next real revision must start. A run begins with one too,
//! since a vehicle adopts no stops before an empty revision: so answer the restart of a vehicle (Hello
//! with another boot) with [`Succession::stop`] and a new plan. The plans of the current revision are
//! repeated, every 5 s, by the caller, who also fills in by whose right they are given. Members that are dropped or taken
//! up again ([`Succession::set_members`]) are so from the next empty revision on.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Plan, Revision, RunId, VehicleId};

use super::{PlanError, VehicleProgress, validate};

/// How far the current revision is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum RevisionPhase {
    /// No revision was published; the vehicles are taken to be at rest.
    Resting,
    /// An empty revision is out; not everyone reports it.
    Stopping,
    /// Everyone has stopped under the empty revision and reports it.
    Stopped,
    /// A revision with stops is out.
    Driving,
}

/// Numbers the revisions of a run and remembers the plans to repeat.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Succession {
    run: RunId,
    members: Vec<VehicleId>,
    revision: Revision,
    plans: Vec<Plan>,
    reported: BTreeSet<VehicleId>,
}

impl Succession {
    /// Makes the succession of a run; its first revision is the one above `highest`, the highest
    /// revision that any vehicle has echoed of this run (0 when none).
    pub fn new(run: RunId, members: &[VehicleId], highest: Revision) -> Succession {
        let ascending: BTreeSet<VehicleId> = members.iter().copied().collect();
        Succession {
            run,
            members: ascending.into_iter().collect(),
            revision: highest,
            plans: Vec::new(),
            reported: BTreeSet::new(),
        }
    }

    /// Returns the members, ascending.
    pub fn members(&self) -> &[VehicleId] {
        &self.members
    }

    /// Returns the run.
    pub fn run(&self) -> RunId {
        self.run
    }

    /// Returns the current revision.
    pub fn revision(&self) -> Revision {
        self.revision
    }

    /// Plans for these vehicles from the next revision on, which must be an empty one.
    pub fn set_members(&mut self, members: &[VehicleId]) {
        let ascending: BTreeSet<VehicleId> = members.iter().copied().collect();
        self.members = ascending.into_iter().collect();
    }

    /// Goes on above `highest`, when a vehicle shows a revision that this succession has not given.
    pub fn skip_to(&mut self, highest: Revision) {
        self.revision = self.revision.max(highest);
    }

    /// Forgets who reports the current revision: after a restart of the ground it is heard again.
    pub fn forget_reports(&mut self) {
        self.reported.clear();
    }

    /// Returns the revision that the next plans will have.
    pub fn next_revision(&self) -> Revision {
        Revision(self.revision.0.saturating_add(1))
    }

    /// Returns the plans of the current revision, to be published on change and every 5 s.
    pub fn plans(&self) -> &[Plan] {
        &self.plans
    }

    /// Replaces the current revision by an empty one, under which everyone comes to rest.
    pub fn stop(&mut self) -> &[Plan] {
        let empty = |vehicle: &VehicleId| Plan {
            vehicle: *vehicle,
            run: self.run,
            revision: self.revision,
            members: self.members.clone(),
            ..Plan::default()
        };
        let plans = self.members.iter().map(empty).collect();
        self.publish(plans)
    }

    /// Begins a revision with the given plans; run, revision and members are filled in.
    ///
    /// The plans must start where the vehicles rest: as last reported in [`RevisionPhase::Stopped`].
    ///
    /// # Errors
    /// The plans are not exactly one for each member, or not valid together; nothing is changed.
    pub fn begin(&mut self, mut plans: Vec<Plan>) -> Result<&[Plan], PlanError> {
        for plan in &mut plans {
            plan.run = self.run;
            plan.revision = self.next_revision();
            plan.members.clone_from(&self.members);
        }
        validate(&plans)?;
        Ok(self.publish(plans))
    }

    fn publish(&mut self, mut plans: Vec<Plan>) -> &[Plan] {
        self.revision = self.next_revision();
        for plan in &mut plans {
            plan.revision = self.revision;
        }
        self.plans = plans;
        self.reported.clear();
        &self.plans
    }

    /// Takes a vehicle's progress.
    pub fn hear(&mut self, progress: &VehicleProgress) {
        let current = (progress.run, progress.revision) == (self.run, self.revision);
        if current && self.members.contains(&progress.vehicle) {
            self.reported.insert(progress.vehicle);
        }
    }

    /// Returns the members not heard to follow the current revision.
    pub fn missing(&self) -> impl Iterator<Item = VehicleId> + '_ {
        self.members
            .iter()
            .filter(|member| !self.reported.contains(member))
            .copied()
    }

    /// Returns how far the current revision is.
    pub fn phase(&self) -> RevisionPhase {
        if self.plans.is_empty() {
            RevisionPhase::Resting
        } else if self.plans.iter().any(|plan| !plan.stops.is_empty()) {
            RevisionPhase::Driving
        } else if self.missing().next().is_some() {
            RevisionPhase::Stopping
        } else {
            RevisionPhase::Stopped
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Stop, StopId};

    fn report(vehicle: u8, revision: u32) -> VehicleProgress {
        let (run, revision) = (RunId(4), Revision(revision));
        VehicleProgress {
            vehicle: VehicleId(vehicle),
            run,
            revision,
            ..VehicleProgress::default()
        }
    }

    #[test]
    fn a_dropped_member_is_neither_waited_for_nor_planned_for() {
        let mut ground = Succession::new(
            RunId(4),
            &[VehicleId(1), VehicleId(2), VehicleId(3)],
            Revision(0),
        );
        ground.stop();
        ground.set_members(&[VehicleId(3), VehicleId(1)]);
        let plans = ground.stop().to_vec();
        assert_eq!(
            plans.iter().map(|plan| plan.vehicle.0).collect::<Vec<_>>(),
            [1, 3]
        );
        assert!(
            plans
                .iter()
                .all(|plan| plan.members == [VehicleId(1), VehicleId(3)])
        );
        ground.hear(&report(2, 2));
        ground.hear(&report(1, 2));
        assert_eq!(ground.phase(), RevisionPhase::Stopping);
        ground.hear(&report(3, 2));
        assert_eq!(ground.phase(), RevisionPhase::Stopped);
        ground.skip_to(Revision(7));
        assert_eq!(
            (ground.next_revision(), ground.revision()),
            (Revision(8), Revision(7))
        );
    }

    #[test]
    fn a_new_revision_begins_once_all_have_stopped_under_an_empty_one() {
        let mut ground = Succession::new(RunId(4), &[VehicleId(2), VehicleId(1)], Revision(6));
        assert_eq!(ground.phase(), RevisionPhase::Resting);
        assert!(
            ground
                .stop()
                .iter()
                .all(|plan| plan.revision == Revision(7) && plan.stops.is_empty())
        );
        ground.hear(&report(1, 7));
        ground.hear(&report(2, 6));
        ground.hear(&report(9, 7));
        assert_eq!(ground.phase(), RevisionPhase::Stopping);
        assert_eq!(ground.missing().collect::<Vec<_>>(), [VehicleId(2)]);
        ground.hear(&report(2, 7));
        assert_eq!(ground.phase(), RevisionPhase::Stopped);
        let mut plans = ground.plans().to_vec();
        assert!(ground.begin(plans[..1].to_vec()).is_err());
        assert_eq!(ground.phase(), RevisionPhase::Stopped);
        plans[0].stops.push(Stop {
            id: StopId(1),
            at: Default::default(),
            route: vec![],
            dwell_ms: 0,
            dwell_limit_ms: 0,
            partners: vec![],
            after: vec![],
        });
        assert!(
            ground
                .begin(plans)
                .unwrap()
                .iter()
                .all(|plan| plan.revision == Revision(8))
        );
        assert_eq!(ground.phase(), RevisionPhase::Driving);
    }
}
