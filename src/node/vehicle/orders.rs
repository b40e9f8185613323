//! Which orders are obeyed, what they leave standing, and what two unread ones come to. By lease and revision alone the
//! higher wins; what a vehicle flies by an order is not said here.
//!
//! An order that was accepted is remembered first, so that after a restart nothing lower is obeyed than what was shown:
//!
//! ```text
//!   accepted ─what stops takes effect at once─► waiting ──on disk──► obeyed: shown, told the mission, motors armed
//!                                                  │ └─the disk cannot be written─► obeyed, but for a start, which waits
//!                                                  └─a higher one is accepted, or it has become too old─► gone
//! ```
//!
//! (Stops and returns make nothing worse when they are forgotten after all; to refuse them because of a disk would.)
//!
//! Nothing lower than what was once handed to the disk is accepted any more, whether or not it was obeyed. What the disk
//! has and this start of the software has not obeyed may come again: after a restart the order that stood is repeated.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Lease, Order, OrderKind, Ordered, Revision};

use super::messages::{AutopilotCommand, Telemetry};
use super::restraint::Restraint;
use crate::node::memory::{OrderEdition, Remembered, VehicleMemory};
use crate::time::Time;

/// The highest order obeyed, one that waits for the disk, and what all of them leave standing.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Orders {
    /// The highest order obeyed; without its kind what is above it and only remembered, such as that of earlier starts.
    highest: Ordered,
    /// The highest edition that was handed to the disk.
    asked: (Lease, Revision),
    /// What the disk has, and what it was to have.
    disk: Remembered,
    /// An order that was accepted and waits for the disk.
    waiting: Option<Order>,
    restraint: Restraint,
    /// When one that stops the vehicle took effect last: what was decided before it is not driven.
    stopped_at: Option<Time>,
    /// When an emergency stop stopped the vehicle last, or was lifted, or somebody else took over: what answers an earlier
    /// state does not send it out.
    answers_from: Option<Time>,
}

/// What follows at once from an order that was accepted.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Accepted {
    /// What the motors are told.
    pub motors: Option<AutopilotCommand>,
    /// What is to be remembered, unless that was asked for before.
    pub memory: Option<VehicleMemory>,
}

impl Orders {
    /// Makes the orders of a vehicle whose earlier starts have left this.
    pub(super) fn remembering(memory: VehicleMemory) -> Orders {
        Orders {
            highest: memory.ordered.forgotten(),
            asked: memory.ordered.key(),
            disk: Remembered {
                on_disk: memory,
                tried: memory,
            },
            ..Orders::default()
        }
    }

    /// Returns whether an order to this vehicle is to be obeyed; `is_answer` when it answers a state that was made lately.
    /// To stop is never too late.
    pub(super) fn accepts(&self, order: &Order, is_answer: bool) -> bool {
        let edition = (order.lease, order.revision);
        let obeyed = self
            .highest
            .kind
            .map(|_| self.highest.edition())
            .unwrap_or_default();
        edition > obeyed && edition >= self.asked && is_in_time(order.kind, is_answer)
    }

    /// Returns whether this order waits for the disk already; another one of the same edition is taken for it.
    pub(super) fn awaits_disk(&self, order: &Order) -> bool {
        let edition = |order: &Order| (order.lease, order.revision);
        self.waiting
            .as_ref()
            .is_some_and(|waiting| edition(waiting) == edition(order))
    }

    /// Takes the same order again: it answers a newer state than it did.
    pub(super) fn renew(&mut self, order: Order) {
        self.waiting = self.waiting.take().map(|waiting| Order {
            seen: order.seen,
            ..waiting
        });
    }

    /// Takes an order that is accepted. What holds the vehicle back does so at once.
    pub(super) fn accept(&mut self, now: Time, order: Order) -> Accepted {
        let edition = OrderEdition {
            lease: order.lease,
            revision: order.revision,
            run: order.run,
        };
        let is_news = edition.key() > self.asked;
        self.asked = edition.key();
        if stops(order.kind) {
            self.stopped_at = Some(now);
        }
        let motors = match order.kind {
            OrderKind::Start | OrderKind::Return => None,
            kind @ (OrderKind::Hold | OrderKind::Land | OrderKind::CutMotors) => {
                self.restraint.obey(now, kind)
            }
        };
        self.waiting = Some(order);
        Accepted {
            motors,
            memory: is_news.then(|| VehicleMemory::of_order(edition)),
        }
    }

    /// Records that an emergency stop holds the vehicle: an order to set out that waits for the disk is gone, and no earlier
    /// one counts after it.
    pub(super) fn hold(&mut self, now: Time) {
        self.waiting.take_if(|order| !stays(order.kind));
        self.restraint.obey(now, OrderKind::Hold);
        (self.stopped_at, self.answers_from) = (Some(now), Some(now));
    }

    /// Records that a person beside the vehicle sends it home: what waits for the disk is gone, and only what answers a
    /// state from now on sends it elsewhere. Returns what the motors are told, and the highest order obeyed.
    pub(super) fn go_home(&mut self, now: Time) -> (Option<AutopilotCommand>, Ordered) {
        self.waiting = None;
        (self.stopped_at, self.answers_from) = (Some(now), Some(now));
        (self.restraint.obey(now, OrderKind::Return), self.highest)
    }

    /// Records that the last emergency stop was lifted, or that somebody else has taken over: only what answers a state
    /// from now on sends the vehicle out.
    pub(super) fn answer_from(&mut self, now: Time) {
        self.answers_from = Some(now);
    }

    /// Returns after which moment states were made that may be answered by what sends the vehicle out; `None` = any.
    pub(super) fn answers_from(&self) -> Option<Time> {
        self.answers_from
    }

    /// Records how it stands with the disk.
    pub(super) fn remembered(&mut self, remembered: Remembered) {
        self.disk = remembered;
    }

    /// Returns the order that may be obeyed from now on, if one does, and what the motors are told. `is_answer` tells of an
    /// order whether it answers a state that was made lately: one that has waited too long is none any more.
    pub(super) fn obey(
        &mut self,
        now: Time,
        is_answer: impl Fn(&Order) -> bool,
    ) -> Option<(Order, Option<AutopilotCommand>)> {
        let due = self
            .waiting
            .take_if(|order| may_be_obeyed(order, &self.disk));
        let Some(order) = due.filter(|order| is_in_time(order.kind, is_answer(order))) else {
            self.show_what_is_not_obeyed();
            return None;
        };
        let Order {
            vehicle: _,
            lease,
            run,
            revision,
            seen: _,
            kind,
            ends: _,
        } = order;
        self.highest = Ordered {
            lease,
            revision,
            run,
            kind: Some(kind),
        };
        if stops(kind) {
            self.stopped_at = Some(now);
        }
        let motors = match kind {
            OrderKind::Start | OrderKind::Return => self.restraint.obey(now, kind),
            OrderKind::Hold | OrderKind::Land | OrderKind::CutMotors => None,
        };
        Some((order, motors))
    }

    /// Shows what was remembered and is not obeyed, without its kind: whoever orders next goes above it.
    fn show_what_is_not_obeyed(&mut self) {
        let tried = self.disk.on_disk.join(self.disk.tried).ordered;
        if tried.key() > self.highest.edition() {
            self.highest = tried.forgotten();
        }
    }

    /// Takes what telemetry shows; returns what the motors are told.
    pub(super) fn take(&mut self, now: Time, telemetry: &Telemetry) -> Option<AutopilotCommand> {
        self.restraint.take(now, telemetry)
    }

    /// Returns the highest order obeyed; without its kind what is above it and only remembered.
    pub(super) fn highest(&self) -> Ordered {
        self.highest
    }

    /// Returns what orders leave standing.
    pub(super) fn restraint(&self) -> &Restraint {
        &self.restraint
    }

    /// Returns whether something was decided before an order that stopped the vehicle, or without knowing of one.
    pub(super) fn have_overtaken(&self, decided: Time) -> bool {
        let waits_to_stop = self.waiting.as_ref().is_some_and(|order| stops(order.kind));
        waits_to_stop
            || self
                .stopped_at
                .is_some_and(|stopped_at| decided < stopped_at)
    }
}

/// Returns whether an order of a kind is not too late; `is_answer` when it answers a state that was made lately.
fn is_in_time(kind: OrderKind, is_answer: bool) -> bool {
    match kind {
        OrderKind::Hold | OrderKind::Land | OrderKind::CutMotors => true,
        OrderKind::Start | OrderKind::Return => is_answer,
    }
}

/// Returns whether an order need not wait for the disk any more. One that stops the vehicle, or brings it home, is obeyed
/// although it cannot be remembered; one that sends it out is not.
fn may_be_obeyed(order: &Order, disk: &Remembered) -> bool {
    let enough = if stops(order.kind) {
        disk.on_disk.join(disk.tried)
    } else {
        disk.on_disk
    };
    enough.ordered.key() >= (order.lease, order.revision)
}

/// Returns whether an order stops the vehicle whatever it does: all but a start do.
pub(super) fn stops(kind: OrderKind) -> bool {
    match kind {
        OrderKind::Start => false,
        OrderKind::Hold | OrderKind::Return | OrderKind::Land | OrderKind::CutMotors => true,
    }
}

/// Returns whether an order keeps the vehicle where it is.
fn stays(kind: OrderKind) -> bool {
    match kind {
        OrderKind::Start | OrderKind::Return => false,
        OrderKind::Hold | OrderKind::Land | OrderKind::CutMotors => true,
    }
}

/// Joins two unread orders: within one lease the stronger kind wins, otherwise the order of the greater lease.
///
/// cut motors > land > return > hold > start; the joined order carries the higher revision, so that
/// neither of the two comes back.
pub fn join_orders(unread: Order, newer: Order) -> Order {
    if unread.lease != newer.lease {
        return if unread.lease > newer.lease {
            unread
        } else {
            newer
        };
    }
    let kind = unread.kind.stronger(newer.kind);
    let latest = if unread.revision > newer.revision {
        unread
    } else {
        newer
    };
    Order { kind, ..latest }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Lease, Revision, RunId, VehicleId};

    /// Obeys an order, with a disk that takes no time.
    fn obey(orders: &mut Orders, now: Time, order: Order) -> Option<AutopilotCommand> {
        let Accepted { motors, memory } = orders.accept(now, order);
        let tried = memory.unwrap_or_default().join(orders.disk.on_disk);
        orders.remembered(Remembered {
            on_disk: tried,
            tried,
        });
        let (_, later) = orders.obey(now, |_| true).unwrap();
        motors.or(later)
    }

    fn order(kind: OrderKind, number: u32, revision: u32) -> Order {
        let lease = Lease { number, holder: 7 };
        let revision = Revision(revision);
        Order {
            vehicle: VehicleId(1),
            lease,
            run: RunId(1),
            revision,
            seen: None,
            kind,
            ends: vec![],
        }
    }

    #[test]
    fn a_revision_counts_within_its_lease_and_only_moving_needs_an_answer() {
        let mut orders = Orders::default();
        obey(&mut orders, Time::ZERO, order(OrderKind::Hold, 3, 5));
        for (number, revision, is_higher) in
            [(3, 6, true), (3, 5, false), (4, 1, true), (2, 9, false)]
        {
            for kind in [OrderKind::Hold, OrderKind::Land, OrderKind::CutMotors] {
                assert_eq!(
                    orders.accepts(&order(kind, number, revision), false),
                    is_higher,
                    "{kind:?}"
                );
            }
            for kind in [OrderKind::Start, OrderKind::Return] {
                assert_eq!(
                    orders.accepts(&order(kind, number, revision), true),
                    is_higher,
                    "{kind:?}"
                );
                assert!(
                    !orders.accepts(&order(kind, number, revision), false),
                    "{kind:?}"
                );
            }
        }
    }

    #[test]
    fn what_was_decided_before_a_stop_is_overtaken_even_after_a_start() {
        let mut orders = Orders::default();
        assert!(!orders.have_overtaken(Time::ZERO));
        obey(
            &mut orders,
            Time::from_secs_f64(2.0),
            order(OrderKind::Hold, 1, 1),
        );
        assert_eq!(
            obey(
                &mut orders,
                Time::from_secs_f64(3.0),
                order(OrderKind::Start, 1, 2)
            ),
            Some(AutopilotCommand::Arm)
        );
        assert!(orders.have_overtaken(Time::from_secs_f64(1.9)));
        assert!(!orders.have_overtaken(Time::from_secs_f64(2.0)));
    }
}
