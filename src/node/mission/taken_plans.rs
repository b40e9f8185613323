//! Which plans that are heard are taken: not those that answer too old a state or have a lower right than others, and one
//! of a greater right only when that is on the disk. What a plan says is judged by [`super::ground_plan`].

use tomoswarm_proto::{Plan, SeenState};

use super::goal::Goal;
use super::{AutonomyCause, Mission, Out};
use crate::time::Time;

impl Mission {
    /// Takes a plan, own or a peer's, unless it is not to be followed.
    pub(super) fn take_plan(&mut self, now: Time, plan: &Plan, out: &mut Vec<Out>) {
        let is_old = self.is_old(now, plan);
        if let Err(event) = self.plan.refuse(plan, is_old) {
            return out.extend(event.map(Out::MissionEvent));
        }
        if self.leases.is_greater(plan.lease) {
            return out.extend(self.leases.wait_with(plan).map(Out::Remember));
        }
        self.resume_for(now, plan, out);
        out.extend(self.plan.offer(now, plan).map(Out::MissionEvent));
        self.report(out);
    }

    /// Returns whether a plan has a lower right than another that was heard, or its own one answers a state that was made
    /// too long ago. (No state was made before the first; only what has heard none answers that.)
    fn is_old(&self, now: Time, plan: &Plan) -> bool {
        let is_own = plan.vehicle == self.settings.vehicle && plan.seen.is_some();
        self.leases.are_above(plan.lease) || (is_own && !self.answers(now, plan))
    }

    /// Returns whether a plan answers a state that this start of the software made not long ago.
    fn answers(&self, now: Time, plan: &Plan) -> bool {
        let is_fresh = |seen: SeenState| {
            seen.boot == self.settings.boot && self.ages.is_fresh(now, seen.sequence)
        };
        plan.seen.is_some_and(is_fresh)
    }

    /// A newer own plan takes back a vehicle that acts on its own since it lost the bus: the ground knows of
    /// it, and has planned from where it is.
    fn resume_for(&mut self, now: Time, plan: &Plan, out: &mut Vec<Out>) {
        if self.plan.is_newer(plan) && self.goal.cause() == Some(AutonomyCause::BusLost) {
            self.goal = Goal::Following;
            self.stop(now, out);
        }
    }
}
