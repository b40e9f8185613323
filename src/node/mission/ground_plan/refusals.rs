//! Which plans are not taken whatever is in them: old ones, and an own one that leads out of the fence. Whether a plan fits
//! to the others is decided by [`crate::sweep::Follower`].

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Plan, Revision, RunId, VehicleId};

use crate::geom::{Point, Polygon};
use crate::node::mission::MissionEvent;

/// The refusals of a vehicle.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Refusals {
    own: VehicleId,
    fence: Polygon,
    /// The plan refused last.
    last: Option<(RunId, Revision)>,
}

impl Refusals {
    /// Makes those of a vehicle that has refused nothing.
    pub(super) fn new(own: VehicleId, fence: Polygon) -> Refusals {
        Refusals {
            own,
            fence,
            last: None,
        }
    }

    /// Judges a plan; `is_old` = it answers a state that is too old, or has a lower right than others.
    ///
    /// # Errors
    /// Why it is not taken, the first time that it comes; nothing when it comes again.
    pub(super) fn judge(&mut self, plan: &Plan, is_old: bool) -> Result<(), Option<MissionEvent>> {
        let edition = (plan.run, plan.revision);
        let old = is_old.then_some(MissionEvent::OldPlan(plan.run, plan.revision));
        let Some(event) = old.or_else(|| self.leads_outside(plan).map(MissionEvent::Outside))
        else {
            return Ok(());
        };
        let is_news = self.last.replace(edition) != Some(edition);
        Err(is_news.then_some(event))
    }

    /// Returns the first place of its own plan that lies outside the fence.
    fn leads_outside(&self, plan: &Plan) -> Option<Point> {
        let own = plan.stops.iter().filter(|_| plan.vehicle == self.own);
        let mut places = own
            .flat_map(|stop| stop.route.iter().chain([&stop.at]))
            .map(|at| Point::from(*at));
        places.find(|at| !self.fence.contains(*at))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::mission::In;
    use crate::node::mission::tests::plan;
    use crate::node::tests_support::settings;

    fn given(revision: u32, x_m: f64) -> Plan {
        let In::Plan(plan) = plan(revision, &[(x_m, 0.0)]) else {
            panic!("a plan")
        };
        plan
    }

    #[test]
    fn only_the_own_plan_must_stay_within_the_fence_and_old_ones_are_named_as_such() {
        let mut refusals = Refusals::new(VehicleId(1), settings(1).fence);
        let (inside, outside) = (given(2, 3.0), given(3, 26.0));
        assert_eq!(refusals.judge(&inside, false), Ok(()));
        let leads_out = MissionEvent::Outside(Point::new(26.0, 0.0));
        assert_eq!(refusals.judge(&outside, false), Err(Some(leads_out)));
        assert_eq!(refusals.judge(&outside, false), Err(None), "said before");
        let old = MissionEvent::OldPlan(inside.run, inside.revision);
        assert_eq!(refusals.judge(&inside, true), Err(Some(old)));
        let mut of_peer = Refusals::new(VehicleId(2), settings(1).fence);
        assert_eq!(
            of_peer.judge(&outside, false),
            Ok(()),
            "a peer judges its own"
        );
    }
}
