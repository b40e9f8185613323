//! Which orders are obeyed, what they leave standing, and what two unread ones come to. By lease and revision alone the
//! higher wins; what a vehicle flies by an order is not said here.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Order, OrderKind, Ordered};

use super::restraint::Restraint;
use super::words::{Fly, Telemetry};
use crate::time::Time;

/// The highest order obeyed, and what all of them leave standing.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Orders {
    highest: Ordered,
    restraint: Restraint,
    /// When one that stops the vehicle was obeyed last: what was decided before it is not driven.
    stopped_at: Option<Time>,
}

impl Orders {
    /// Returns whether an order to this vehicle is to be obeyed; `is_answer` when it answers a state that was made lately.
    /// To stop is never too late.
    pub fn accepts(&self, order: &Order, is_answer: bool) -> bool {
        let is_newer = (order.lease, order.revision) > self.highest.edition();
        let is_in_time = match order.kind {
            OrderKind::Hold | OrderKind::Emergency | OrderKind::Land | OrderKind::CutMotors => true,
            OrderKind::Start | OrderKind::Return => is_answer,
        };
        is_newer && is_in_time
    }

    /// Takes an order that was accepted; returns what the motors are told at once.
    pub fn obey(&mut self, now: Time, order: &Order) -> Option<Fly> {
        let Order { vehicle: _, lease, run, revision, seen: _, kind, ends: _ } = *order;
        self.highest = Ordered { lease, revision, run, kind: Some(kind) };
        if stops(kind) {
            self.stopped_at = Some(now);
        }
        self.restraint.obey(now, kind)
    }

    /// Takes what telemetry shows; returns what the motors are told.
    pub fn take(&mut self, now: Time, telemetry: &Telemetry) -> Option<Fly> {
        self.restraint.take(now, telemetry)
    }

    /// Returns the highest order obeyed.
    pub fn highest(&self) -> Ordered {
        self.highest
    }

    /// Returns what orders leave standing.
    pub fn restraint(&self) -> &Restraint {
        &self.restraint
    }

    /// Returns whether something was decided before an order that stopped the vehicle.
    pub fn have_overtaken(&self, decided: Time) -> bool {
        self.stopped_at.is_some_and(|stopped_at| decided < stopped_at)
    }
}

/// Returns whether an order stops the vehicle whatever it does: all but a start do.
pub(super) fn stops(kind: OrderKind) -> bool {
    match kind {
        OrderKind::Start => false,
        OrderKind::Hold
        | OrderKind::Return
        | OrderKind::Land
        | OrderKind::Emergency
        | OrderKind::CutMotors => true,
    }
}

/// Joins two unread orders: within one lease the stronger kind wins, otherwise the order of the greater lease.
///
/// cut motors > emergency > land > return > hold > start; the joined order carries the higher revision, so that
/// neither of the two comes back.
pub fn join_orders(unread: Order, newer: Order) -> Order {
    if unread.lease != newer.lease {
        return if unread.lease > newer.lease { unread } else { newer };
    }
    let kind = unread.kind.stronger(newer.kind);
    let latest = if unread.revision > newer.revision { unread } else { newer };
    Order { kind, ..latest }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Lease, Revision, RunId, VehicleId};

    fn order(kind: OrderKind, number: u32, revision: u32) -> Order {
        let lease = Lease { number, holder: 7 };
        let revision = Revision(revision);
        Order { vehicle: VehicleId(1), lease, run: RunId(1), revision, seen: None, kind, ends: vec![] }
    }

    #[test]
    fn a_revision_counts_within_its_lease_and_only_moving_needs_an_answer() {
        let mut orders = Orders::default();
        orders.obey(Time::ZERO, &order(OrderKind::Hold, 3, 5));
        for (number, revision, is_higher) in [(3, 6, true), (3, 5, false), (4, 1, true), (2, 9, false)] {
            for kind in [OrderKind::Hold, OrderKind::Land, OrderKind::Emergency, OrderKind::CutMotors] {
                assert_eq!(orders.accepts(&order(kind, number, revision), false), is_higher, "{kind:?}");
            }
            for kind in [OrderKind::Start, OrderKind::Return] {
                assert_eq!(orders.accepts(&order(kind, number, revision), true), is_higher, "{kind:?}");
                assert!(!orders.accepts(&order(kind, number, revision), false), "{kind:?}");
            }
        }
    }

    #[test]
    fn what_was_decided_before_a_stop_is_overtaken_even_after_a_start() {
        let mut orders = Orders::default();
        assert!(!orders.have_overtaken(Time::ZERO));
        orders.obey(Time::from_secs_f64(2.0), &order(OrderKind::Hold, 1, 1));
        orders.obey(Time::from_secs_f64(3.0), &order(OrderKind::Start, 1, 2));
        assert!(orders.have_overtaken(Time::from_secs_f64(1.9)));
        assert!(!orders.have_overtaken(Time::from_secs_f64(2.0)));
    }
}
