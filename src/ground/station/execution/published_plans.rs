//! The plans that vehicles are to follow: which revision is in force, who shows it, and when it was published last. Knows
//! no phase; when everyone is stopped or begins is decided by the execution.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Lease, Plan, Revision, RunId, StopId, VehicleId};

use crate::geom::Point;
use crate::ground::fleet::Fleet;
use crate::sweep::{RevisionPhase, Succession, VehicleProgress, has_done};
use crate::time::Time;

/// Plans are repeated this often until every vehicle shows them.
const REPEAT_EVERY: Duration = Duration::from_secs(5);
/// Plans that every vehicle shows are repeated this often, for one that restarts.
const REPEAT_SHOWN_EVERY: Duration = Duration::from_secs(60);

/// The plans in force of the newest run.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct PublishedPlans {
    /// `None` = no sweep was ever begun.
    succession: Option<Succession>,
    published_at: Time,
}

impl PublishedPlans {
    /// Goes on with the plans of an earlier start of the station; who follows them is heard again.
    pub(crate) fn restored(mut succession: Option<Succession>) -> PublishedPlans {
        succession.iter_mut().for_each(Succession::forget_reports);
        PublishedPlans {
            succession,
            published_at: Time::ZERO,
        }
    }

    /// Begins a run, above every revision of it that a vehicle shows. There are no plans until everyone is stopped.
    pub(crate) fn begin_run(&mut self, run: RunId, fleet: &Fleet) {
        let highest = fleet.highest_revision(run);
        self.succession = Some(Succession::new(run, &fleet.present(), highest));
    }

    /// Stops the vehicles that are there by an empty revision.
    pub(crate) fn stop(&mut self, present: &[VehicleId]) {
        if let Some(succession) = &mut self.succession {
            succession.set_members(present);
            succession.stop();
        }
    }

    /// Begins the next revision with these plans; returns how many stops they have.
    ///
    /// # Errors
    /// The plans cannot be followed, or no sweep was ever begun; nothing is changed.
    pub(crate) fn begin(&mut self, plans: Vec<Plan>) -> Result<usize, String> {
        let succession = self.succession.as_mut().ok_or("no run was begun")?;
        let stops = plans.iter().map(|plan| plan.stops.len()).sum();
        match succession.begin(plans) {
            Ok(_) => Ok(stops),
            Err(error) => Err(error.to_string()),
        }
    }

    /// Goes on above the highest revision that a vehicle shows; returns whether it is one that was never published here.
    pub(crate) fn go_above(&mut self, highest: Revision) -> bool {
        match &mut self.succession {
            Some(succession) if succession.revision() < highest => {
                succession.skip_to(highest);
                true
            }
            Some(_) | None => false,
        }
    }

    /// Takes a vehicle's progress.
    pub(crate) fn hear(&mut self, progress: &VehicleProgress) {
        if let Some(succession) = &mut self.succession {
            succession.hear(progress);
        }
    }

    /// Returns where the plan of a vehicle has a stop.
    pub(crate) fn place_of(&self, vehicle: VehicleId, stop: StopId) -> Option<Point> {
        let plan = self.plans().iter().find(|plan| plan.vehicle == vehicle)?;
        let stop = plan.stops.iter().find(|one| one.id == stop)?;
        Some(stop.at.into())
    }

    /// Returns the plans as they are published, by the right of `lease`, each with the newest state of its vehicle.
    pub(crate) fn publish(&mut self, now: Time, lease: Lease, fleet: &Fleet) -> Vec<Plan> {
        self.published_at = now;
        let of_vehicle = |plan: &Plan| Plan {
            lease,
            seen: fleet.newest_state(plan.vehicle),
            ..plan.clone()
        };
        self.plans().iter().map(of_vehicle).collect()
    }

    /// Returns whether it is time to publish the plans again.
    pub(crate) fn is_repeat_due(&self, now: Time) -> bool {
        let every = match self.are_shown() {
            true => REPEAT_SHOWN_EVERY,
            false => REPEAT_EVERY,
        };
        now.since(self.published_at) >= every
    }

    /// Returns whether every member shows the present revision.
    pub(crate) fn are_shown(&self) -> bool {
        self.missing().next().is_none()
    }

    /// Returns the members that do not show the present revision.
    pub(crate) fn missing(&self) -> impl Iterator<Item = VehicleId> {
        self.succession.iter().flat_map(Succession::missing)
    }

    /// Returns whether every member has stopped under an empty revision.
    pub(crate) fn are_all_stopped(&self) -> bool {
        let phase = self.succession.as_ref().map(Succession::phase);
        phase == Some(RevisionPhase::Stopped)
    }

    /// Returns for whom the plans are, ascending; `None` = no sweep was ever begun.
    pub(crate) fn members(&self) -> Option<&[VehicleId]> {
        self.succession.as_ref().map(Succession::members)
    }

    /// Returns the revision that the next plans will have; `None` = no sweep was ever begun.
    pub(crate) fn next_revision(&self) -> Option<Revision> {
        self.succession.as_ref().map(Succession::next_revision)
    }

    /// Returns the longest time that a vehicle stays at a stop by its plan.
    pub(crate) fn longest_dwell(&self) -> Duration {
        let stops = self.plans().iter().flat_map(|plan| &plan.stops);
        let longest_ms = stops
            .map(|stop| stop.dwell_ms.max(stop.dwell_limit_ms))
            .max();
        Duration::from_millis(longest_ms.unwrap_or_default().into())
    }

    /// Returns whether every vehicle has done its last stop of a lap, under the present plans.
    pub(crate) fn is_lap_done(&self, fleet: &Fleet, last_stops: &[(VehicleId, StopId)]) -> bool {
        let is_done = |(vehicle, stop): &(VehicleId, StopId)| {
            let plan = self.plans().iter().find(|plan| plan.vehicle == *vehicle);
            let member = fleet.members().find(|(id, _)| id == vehicle);
            let progress = member.and_then(|(_, member)| member.progress());
            plan.zip(progress)
                .is_some_and(|(plan, progress)| has_done(plan, &progress, *stop))
        };
        last_stops.iter().all(is_done)
    }

    /// Returns the numbered plans, to be stored.
    pub(crate) fn succession(&self) -> Option<&Succession> {
        self.succession.as_ref()
    }

    fn plans(&self) -> &[Plan] {
        self.succession.as_ref().map_or(&[], Succession::plans)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Boot, Position, SeenState, State, Stop};

    const RUN: RunId = RunId(2);
    const ONE: VehicleId = VehicleId(1);
    const LEASE: Lease = Lease {
        number: 3,
        holder: 1,
    };

    fn at(at_s: f64) -> Time {
        Time::from_secs_f64(at_s)
    }

    fn fleet() -> Fleet {
        Fleet::new(&[ONE], LEASE)
    }

    /// Stops the only vehicle, then lets it follow a plan with these stops, of revision 2.
    fn driving(stops: &[u32]) -> PublishedPlans {
        let mut plans = PublishedPlans::default();
        plans.begin_run(RUN, &fleet());
        plans.stop(&[ONE]);
        plans.hear(&progress(1, None));
        assert!(plans.are_all_stopped());
        assert_eq!(plans.begin(vec![plan(stops)]), Ok(stops.len()));
        plans
    }

    fn plan(stops: &[u32]) -> Plan {
        let stop = |id: &u32| Stop {
            id: StopId(*id),
            at: Position::default(),
            route: vec![],
            dwell_ms: 0,
            dwell_limit_ms: 0,
            partners: vec![],
            after: vec![],
        };
        Plan {
            vehicle: ONE,
            stops: stops.iter().map(stop).collect(),
            ..Plan::default()
        }
    }

    fn progress(revision: u32, done: Option<u32>) -> VehicleProgress {
        VehicleProgress {
            vehicle: ONE,
            run: RUN,
            revision: Revision(revision),
            done: done.map(StopId),
            ..VehicleProgress::default()
        }
    }

    #[test]
    fn before_any_run_there_is_nothing_to_follow() {
        let mut plans = PublishedPlans::default();
        plans.stop(&[ONE]);
        plans.hear(&progress(1, None));
        assert!(plans.begin(vec![]).is_err() && !plans.go_above(Revision(9)));
        assert_eq!((plans.members(), plans.next_revision()), (None, None));
        assert!(!plans.are_all_stopped());
        assert_eq!(plans.publish(at(1.0), LEASE, &fleet()), []);
    }

    #[test]
    fn plans_are_repeated_often_until_everyone_shows_them_and_seldom_afterwards() {
        let mut plans = driving(&[1]);
        plans.publish(at(10.0), LEASE, &fleet());
        assert_eq!(plans.missing().collect::<Vec<_>>(), [ONE]);
        assert!(!plans.is_repeat_due(at(14.9)) && plans.is_repeat_due(at(15.0)));
        plans.hear(&progress(2, None));
        assert!(plans.are_shown());
        assert!(!plans.is_repeat_due(at(69.9)) && plans.is_repeat_due(at(70.0)));
    }

    #[test]
    fn a_plan_goes_out_by_the_lease_and_answers_the_newest_state() {
        let mut fleet = fleet();
        fleet.heard_state(
            at(0.0),
            State {
                vehicle: ONE,
                boot: Boot(1),
                sequence: 7,
                ..State::default()
            },
        );
        let published = driving(&[1]).publish(at(1.0), LEASE, &fleet);
        let seen = SeenState {
            boot: Boot(1),
            sequence: 7,
        };
        assert_eq!(
            (published[0].lease, published[0].seen, published.len()),
            (LEASE, Some(seen), 1)
        );
    }

    #[test]
    fn a_lap_is_done_by_its_last_stop_or_one_after_it_under_the_present_revision() {
        let plans = driving(&[5, 3, 9]);
        for (revision, done, is_done) in [
            (2, None, false),
            (2, Some(5), false),
            (2, Some(3), true),
            (2, Some(9), true),
            (1, Some(9), false),
            (2, Some(4), false),
        ] {
            let mut fleet = fleet();
            assert!(!plans.is_lap_done(&fleet, &[(ONE, StopId(3))]));
            fleet.heard_progress(at(1.0), progress(revision, done));
            assert_eq!(
                plans.is_lap_done(&fleet, &[(ONE, StopId(3))]),
                is_done,
                "revision {revision}, {done:?}"
            );
        }
    }

    #[test]
    fn a_revision_that_was_not_published_here_is_outnumbered() {
        let mut plans = driving(&[1]);
        assert!(!plans.go_above(Revision(2)));
        assert!(plans.go_above(Revision(8)));
        assert_eq!(plans.next_revision(), Some(Revision(9)));
    }

    #[test]
    fn restored_plans_are_the_same_but_nobody_is_known_to_follow_them() {
        let mut before = driving(&[1]);
        before.hear(&progress(2, None));
        let after = PublishedPlans::restored(before.succession().cloned());
        assert_eq!(after.plans(), before.plans());
        assert!(before.are_shown() && !after.are_shown());
    }
}
