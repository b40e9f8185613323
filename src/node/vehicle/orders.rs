//! What two unread orders come to. Whether an order is too old is not judged here.

use tomoswarm_proto::{Order, OrderKind};

/// Joins two unread orders: within one lease the stronger kind wins, otherwise the order of the greater lease.
///
/// cut motors > emergency > land > return > hold > start; the joined order carries the higher revision, so that
/// neither of the two comes back.
pub fn join_orders(unread: Order, newer: Order) -> Order {
    if unread.lease != newer.lease {
        return if unread.lease > newer.lease { unread } else { newer };
    }
    let kind = stronger(unread.kind, newer.kind);
    let latest = if unread.revision > newer.revision { unread } else { newer };
    Order { kind, ..latest }
}

fn stronger(a: OrderKind, b: OrderKind) -> OrderKind {
    let rank = |kind: OrderKind| match kind {
        OrderKind::Start => 0,
        OrderKind::Hold => 1,
        OrderKind::Return => 2,
        OrderKind::Land => 3,
        OrderKind::Emergency => 4,
        OrderKind::CutMotors => 5,
    };
    if rank(b) > rank(a) { b } else { a }
}
