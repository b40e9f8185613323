//! What a vehicle must not forget when its software is started anew: by whose right it was ordered and planned for. It
//! only ever grows. What orders leave standing is not part of it: a vehicle that is started anew waits for a start in any
//! case. How it is kept is the runtime's business.
//!
//! ```text
//!   vehicle, mission ──Remember──► disk ──Remembered──► vehicle, mission: only now it is done, and shown
//! ```

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Lease, Ordered, Revision, RunId};

/// The highest order and the greatest lease that a vehicle has followed, over all starts of its software.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct VehicleMemory {
    /// The highest order.
    pub ordered: OrderEdition,
    /// The greatest lease of a plan.
    pub planned: Lease,
}

/// Which order: all of it but what was ordered.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct OrderEdition {
    /// By whose right.
    pub lease: Lease,
    /// Which of that lease's orders.
    pub revision: Revision,
    /// In which run.
    pub run: RunId,
}

impl OrderEdition {
    /// Returns what orders are compared by: the higher one wins.
    pub fn key(&self) -> (Lease, Revision) {
        (self.lease, self.revision)
    }

    /// Returns it as a vehicle shows it that has obeyed nothing since its software was started.
    pub fn forgotten(self) -> Ordered {
        let OrderEdition {
            lease,
            revision,
            run,
        } = self;
        Ordered {
            lease,
            revision,
            run,
            kind: None,
        }
    }
}

impl VehicleMemory {
    /// Returns the memory of an order alone.
    pub fn of_order(ordered: OrderEdition) -> VehicleMemory {
        VehicleMemory {
            ordered,
            ..VehicleMemory::default()
        }
    }

    /// Returns the memory of a plan's lease alone.
    pub fn of_plan(planned: Lease) -> VehicleMemory {
        VehicleMemory {
            planned,
            ..VehicleMemory::default()
        }
    }

    /// Returns what both are: the higher of each.
    pub fn join(self, other: VehicleMemory) -> VehicleMemory {
        let ordered = if other.ordered.key() > self.ordered.key() {
            other.ordered
        } else {
            self.ordered
        };
        VehicleMemory {
            ordered,
            planned: self.planned.max(other.planned),
        }
    }

    /// Returns the greatest lease that was followed.
    pub fn lease(&self) -> Lease {
        self.ordered.lease.max(self.planned)
    }
}

/// How it stands with the disk.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Remembered {
    /// What outlives a power cut from now on.
    pub on_disk: VehicleMemory,
    /// What was to be remembered; more than what is on disk while that cannot be written.
    pub tried: VehicleMemory,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_memory_only_grows_and_orders_and_plans_do_not_mix() {
        let order = |number, revision| {
            let lease = Lease { number, holder: 7 };
            VehicleMemory::of_order(OrderEdition {
                lease,
                revision: Revision(revision),
                run: RunId(1),
            })
        };
        let plan = |number| VehicleMemory::of_plan(Lease { number, holder: 7 });
        let check = |all: &[VehicleMemory], ordered: VehicleMemory, planned: VehicleMemory| {
            let joined = all
                .iter()
                .copied()
                .fold(VehicleMemory::default(), VehicleMemory::join);
            let turned = all
                .iter()
                .rev()
                .copied()
                .fold(VehicleMemory::default(), VehicleMemory::join);
            assert_eq!(
                (joined.ordered, joined.planned),
                (ordered.ordered, planned.planned)
            );
            assert_eq!((turned, joined.join(joined)), (joined, joined));
        };
        check(
            &[order(3, 9), order(4, 1)],
            order(4, 1),
            VehicleMemory::default(),
        );
        check(&[order(3, 9), order(3, 8), plan(2)], order(3, 9), plan(2));
        check(&[plan(5), order(3, 9), plan(4)], order(3, 9), plan(5));
        assert_eq!(order(3, 9).join(plan(5)).lease().number, 5);
    }
}
