//! The plans of a sweep against time: when each stop is expected to be done, which chain of stops takes longest, how far the
//! vehicles are, and who waits for whom.
//!
//! It plans nothing and foretells nothing: times are those of one steady speed, with turns for nothing.

use std::borrow::Borrow;
use std::collections::BTreeMap;

use tomoswarm_proto::{Plan, StopId, VehicleId};

use crate::sweep::{ExpectedStop, VehicleProgress, expected_stops, has_done, stops_done};

/// The speed that times are shown for, m/s: vehicles do not say theirs.
pub const SHOWN_SPEED_MPS: f64 = 0.5;

/// How far vehicles are, by their own word.
pub type ProgressOf = BTreeMap<VehicleId, VehicleProgress>;

/// The plans of one revision, complete and valid together, with their times.
#[derive(Clone, PartialEq, Debug)]
pub struct Timetable {
    plans: Vec<Plan>,
    expected: Vec<Vec<ExpectedStop>>,
}

impl Timetable {
    /// Makes the timetable of the newest revision of the plans that were heard; `None` while a member's plan is missing, or
    /// when they are not valid together.
    pub fn of(heard: &BTreeMap<VehicleId, impl Borrow<Plan>>) -> Option<Timetable> {
        let edition = |plan: &Plan| (plan.run, plan.lease, plan.revision);
        let plans = heard.values().map(Borrow::borrow);
        let newest = plans.max_by_key(|plan| edition(plan))?;
        let plan_of = |id: &VehicleId| {
            let plan = heard.get(id).map(Borrow::borrow);
            plan.filter(|plan| edition(plan) == edition(newest))
        };
        let plans: Option<Vec<Plan>> = newest
            .members
            .iter()
            .map(|id| plan_of(id).cloned())
            .collect();
        let plans = plans?;
        let expected = expected_stops(&plans, SHOWN_SPEED_MPS).ok()?;
        Some(Timetable { plans, expected })
    }

    /// Returns the plans, each with the times of its stops.
    pub fn rows(&self) -> impl Iterator<Item = (&Plan, &[ExpectedStop])> {
        let expected = self.expected.iter().map(Vec::as_slice);
        self.plans.iter().zip(expected)
    }

    /// Returns when everything is expected to be done, seconds from the start of the plans.
    pub fn length_s(&self) -> f64 {
        let all = self.expected.iter().flatten();
        all.map(|stop| stop.done_s).fold(0.0, f64::max)
    }

    /// Returns the chain of stops that takes longest, in order: each can begin only when the one before it is done.
    pub fn longest_chain(&self) -> Vec<(VehicleId, StopId)> {
        let ends = self.expected.iter().enumerate();
        let ends = ends.filter_map(|(plan, stops)| Some((plan, stops.len().checked_sub(1)?)));
        let done_s = |(plan, stop): &(usize, usize)| self.expected[*plan][*stop].done_s;
        let last = ends.max_by(|one, other| done_s(one).total_cmp(&done_s(other)));
        let before = |(plan, stop): &(usize, usize)| self.expected[*plan][*stop].behind;
        let mut chain: Vec<(VehicleId, StopId)> = std::iter::successors(last, before)
            .map(|(plan, stop)| (self.plans[plan].vehicle, self.plans[plan].stops[stop].id))
            .collect();
        chain.reverse();
        chain
    }

    /// Returns the expected time of the last stop that anybody has done: where the swarm is in the timetable, seconds.
    pub fn reached_s(&self, progress: &ProgressOf) -> f64 {
        let reached = self.rows().flat_map(|(plan, expected)| {
            let said = progress.get(&plan.vehicle);
            let done = said.map_or(0, |said| stops_done(plan, said));
            expected.iter().take(done).map(|stop| stop.done_s)
        });
        reached.fold(0.0, f64::max)
    }

    /// Returns the stops of others that a vehicle waits for before it enters its next leg; empty when it does not wait.
    pub fn waits_for(&self, id: VehicleId, progress: &ProgressOf) -> Vec<(VehicleId, StopId)> {
        let plan_of = |id: VehicleId| self.plans.iter().find(|plan| plan.vehicle == id);
        let (Some(plan), Some(said)) = (plan_of(id), progress.get(&id)) else {
            return Vec::new();
        };
        let follows = (said.run, said.revision) == (plan.run, plan.revision);
        if !follows || said.leg.is_some() {
            return Vec::new();
        }
        let Some(next) = plan.stops.get(stops_done(plan, said)) else {
            return Vec::new();
        };
        let is_open = |(of, stop): &&(VehicleId, StopId)| {
            let said = progress.get(of);
            let is_done = plan_of(*of)
                .zip(said)
                .is_some_and(|(plan, said)| has_done(plan, said, *stop));
            !is_done
        };
        next.after.iter().filter(is_open).copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Boot, Position, Revision, RunId, Stop};

    const ONE: VehicleId = VehicleId(1);
    const TWO: VehicleId = VehicleId(2);

    fn stop(id: u32, x_m: f64, after: &[(VehicleId, StopId)]) -> Stop {
        Stop {
            id: StopId(id),
            at: Position::from_metres(x_m, 0.0, 0.0),
            after: after.to_vec(),
            route: Vec::new(),
            dwell_ms: 0,
            dwell_limit_ms: 0,
            partners: Vec::new(),
        }
    }

    /// Vehicle 1 drives 4 m and 4 m; vehicle 2 drives 2 m, waits for the first stop of vehicle 1, and drives 8 m.
    fn plans() -> BTreeMap<VehicleId, Plan> {
        let plan = |vehicle, stops| Plan {
            vehicle,
            run: RunId(3),
            revision: Revision(1),
            members: vec![ONE, TWO],
            stops,
            ..Plan::default()
        };
        let first = plan(ONE, vec![stop(1, 4.0, &[]), stop(2, 8.0, &[])]);
        let second = vec![stop(1, 2.0, &[]), stop(2, 10.0, &[(ONE, StopId(1))])];
        BTreeMap::from([(ONE, first), (TWO, plan(TWO, second))])
    }

    fn said(
        vehicle: VehicleId,
        done: Option<u32>,
        leg: Option<u32>,
    ) -> (VehicleId, VehicleProgress) {
        let progress = VehicleProgress {
            vehicle,
            boot: Boot(1),
            run: RunId(3),
            revision: Revision(1),
            done: done.map(StopId),
            leg: leg.map(StopId),
        };
        (vehicle, progress)
    }

    #[test]
    fn the_longest_chain_goes_through_whom_it_waits_for() {
        let table = Timetable::of(&plans()).unwrap();
        let chain = [(ONE, StopId(1)), (TWO, StopId(2))];
        assert_eq!(table.longest_chain(), chain);
        assert!((table.length_s() - (4.0 + 8.0) / SHOWN_SPEED_MPS).abs() < 1e-9);
        let times: Vec<f64> = table.expected[1].iter().map(|stop| stop.ready_s).collect();
        assert_eq!(times, [0.0, 4.0 / SHOWN_SPEED_MPS]);
    }

    #[test]
    fn a_vehicle_waits_until_the_stop_of_the_other_is_done() {
        let table = Timetable::of(&plans()).unwrap();
        let waits = |said: [(VehicleId, VehicleProgress); 2]| table.waits_for(TWO, &said.into());
        let two = said(TWO, Some(1), None);
        assert_eq!(waits([said(ONE, None, Some(1)), two]), [(ONE, StopId(1))]);
        assert_eq!(waits([said(ONE, Some(1), Some(2)), two]), []);
        assert_eq!(
            waits([said(ONE, None, Some(1)), said(TWO, None, Some(1))]),
            [],
            "it drives"
        );
        assert_eq!(
            table.waits_for(VehicleId(9), &BTreeMap::new()),
            [],
            "it has no plan"
        );
        let reached_s = table.reached_s(&[said(ONE, Some(1), None), two].into());
        assert!((reached_s - 4.0 / SHOWN_SPEED_MPS).abs() < 1e-9);
    }

    #[test]
    fn plans_that_are_not_complete_or_wait_in_a_circle_have_no_timetable() {
        let mut heard = plans();
        heard.remove(&ONE);
        assert_eq!(Timetable::of(&heard), None);
        let mut heard = plans();
        heard.get_mut(&ONE).unwrap().stops[0].after = vec![(TWO, StopId(2))];
        assert_eq!(Timetable::of(&heard), None);
        assert_eq!(Timetable::of(&BTreeMap::<_, Plan>::new()), None);
    }
}
