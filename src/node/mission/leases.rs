//! By whose right the vehicle was ordered and planned for: the greatest lease wins, over all starts of its software. A plan
//! by a greater right than any before waits until the disk has that lease, so that after a restart no plan of a lower one
//! is taken. Orders wait in the vehicle actor. Whether a plan fits is not judged here.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Lease, Plan, VehicleId};

use crate::node::memory::VehicleMemory;

/// The greatest lease followed, and plans that wait to be.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct PlanLeases {
    greatest: Lease,
    /// The greatest that was handed to the disk.
    asked: Lease,
    waiting: BTreeMap<VehicleId, Plan>,
}

impl PlanLeases {
    /// Makes the leases of a vehicle whose earlier starts have left this.
    pub(super) fn remembering(memory: VehicleMemory) -> PlanLeases {
        PlanLeases {
            greatest: memory.lease(),
            asked: memory.lease(),
            waiting: BTreeMap::new(),
        }
    }

    /// Returns the greatest lease followed.
    pub(super) fn greatest(&self) -> Lease {
        self.greatest
    }

    /// Follows the lease of an order that is obeyed.
    pub(super) fn follow(&mut self, lease: Lease) {
        self.greatest = self.greatest.max(lease);
    }

    /// Returns whether a greater lease was followed, or is about to be.
    pub(super) fn are_above(&self, lease: Lease) -> bool {
        lease < self.greatest.max(self.asked)
    }

    /// Returns whether a plan by this right has to wait for the disk.
    pub(super) fn is_greater(&self, lease: Lease) -> bool {
        lease > self.greatest
    }

    /// Keeps a plan until the disk has its lease; returns what is to be remembered, unless that was asked for before.
    pub(super) fn wait_with(&mut self, plan: &Plan) -> Option<VehicleMemory> {
        let edition = |plan: &Plan| (plan.lease, plan.run, plan.revision);
        let known = self.waiting.get(&plan.vehicle);
        if known.is_none_or(|known| edition(known) <= edition(plan)) {
            self.waiting.insert(plan.vehicle, plan.clone());
        }
        let is_news = plan.lease > self.asked;
        self.asked = self.asked.max(plan.lease);
        is_news.then(|| VehicleMemory::of_plan(plan.lease))
    }

    /// Takes what is on disk; returns the plans that need not wait any more.
    pub(super) fn remembered(&mut self, on_disk: VehicleMemory) -> Vec<Plan> {
        self.follow(on_disk.lease());
        let greatest = self.greatest;
        let all = std::mem::take(&mut self.waiting);
        let (ready, waiting): (BTreeMap<_, _>, _) = all
            .into_iter()
            .partition(|(_, plan)| plan.lease <= greatest);
        self.waiting = waiting;
        ready.into_values().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::Revision;

    fn plan(vehicle: u8, number: u32, revision: u32) -> Plan {
        Plan {
            vehicle: VehicleId(vehicle),
            lease: lease(number),
            revision: Revision(revision),
            ..Plan::default()
        }
    }

    fn lease(number: u32) -> Lease {
        Lease { number, holder: 7 }
    }

    #[test]
    fn a_plan_by_a_greater_right_waits_for_the_disk_and_is_asked_for_once() {
        let mut leases = PlanLeases::remembering(VehicleMemory::of_plan(lease(3)));
        assert!(
            leases.are_above(lease(2))
                && !leases.are_above(lease(3))
                && !leases.is_greater(lease(3))
        );
        assert!(leases.is_greater(lease(4)));
        assert_eq!(
            leases.wait_with(&plan(1, 4, 2)),
            Some(VehicleMemory::of_plan(lease(4)))
        );
        assert_eq!(leases.wait_with(&plan(2, 4, 2)), None);
        assert_eq!(leases.wait_with(&plan(1, 4, 1)), None, "it came late");
        assert!(
            leases.are_above(lease(3)),
            "what is about to be on disk counts"
        );
        assert_eq!(leases.greatest(), lease(3), "and is not shown");
        assert_eq!(leases.remembered(VehicleMemory::of_plan(lease(3))), []);
        assert_eq!(
            leases.remembered(VehicleMemory::of_plan(lease(4))),
            [plan(1, 4, 2), plan(2, 4, 2)]
        );
        assert_eq!((leases.greatest(), leases.waiting.len()), (lease(4), 0));
    }
}
