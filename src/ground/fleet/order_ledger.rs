//! What the ground has dealt with one vehicle, which must not be forgotten when the ground station starts anew: which start
//! of its software was heard, what it was ordered and by whom, and whether it is lost. Knows no times, and not where the
//! vehicle is.
//!
//! **Orders by several.** The station and an operator's `order` use the same lease, each with a revision above the
//! vehicle's echo; the higher (lease, revision) wins, and a vehicle obeys only what is above its echo. So an echo that
//! is not the station's own order shows what somebody else has ordered: a Start, or something that *stands* until the
//! next Start of that vehicle. An own order that lost is given up, never raised over the other one; a Start that was on its
//! way when somebody stopped the vehicle lifts nothing: what stands is ordered again, above it, at once and when the start
//! came all the same. So nobody else's next start has its number.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Boot, Lease, Order, OrderKind, Ordered, Revision, RunId, State, VehicleId};

/// What must not be forgotten of a vehicle when the ground station starts anew.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(crate) struct OrderLedger {
    /// Newest start of its software that was heard.
    boot: Option<Boot>,
    /// What the station has ordered last.
    issued: Option<Order>,
    /// Whether that order is still to be repeated.
    is_pending: bool,
    /// Whether it was said; then it may be on its way.
    is_said: bool,
    /// An own start that was said, and given up because somebody else has stopped the vehicle.
    crossing: Option<Order>,
    /// What it said last that it was ordered.
    shown_order: Option<Ordered>,
    /// The run that it had been started for before anything was heard of it, as long as it shows nothing else.
    earlier: Option<RunId>,
    /// What it was ordered other than Start, by anyone, since its last Start; the strongest.
    stands: Option<OrderKind>,
    /// Whether it has been silent for too long while others were heard.
    is_lost: bool,
}

impl OrderLedger {
    /// Returns the newest start of its software that was heard.
    pub(crate) fn boot(&self) -> Option<Boot> {
        self.boot
    }

    /// Records which start of its software is heard; returns whether it is another one than before.
    pub(crate) fn hear(&mut self, boot: Boot) -> bool {
        self.boot.replace(boot).is_some_and(|known| known != boot)
    }

    /// Returns whether it has been silent for too long while others were heard.
    pub(crate) fn is_lost(&self) -> bool {
        self.is_lost
    }

    /// Counts it as lost until it is found.
    pub(crate) fn lose(&mut self) {
        self.is_lost = true;
    }

    /// Counts it as there; returns whether it was lost.
    pub(crate) fn find(&mut self) -> bool {
        std::mem::take(&mut self.is_lost)
    }

    /// Returns what it was ordered other than Start, by anyone, since its last Start; the strongest.
    pub(crate) fn stands(&self) -> Option<OrderKind> {
        self.stands
    }

    /// Returns the order that is to be repeated.
    pub(crate) fn open_order(&self) -> Option<&Order> {
        self.issued.as_ref().filter(|_| self.is_pending)
    }

    /// Takes the open order for said: from now on it may be on its way.
    pub(crate) fn note_said(&mut self) {
        self.is_said |= self.open_order().is_some();
    }

    /// Starts it unless something stands: what somebody has stopped, only somebody starts.
    pub(crate) fn start(&mut self, vehicle: VehicleId, lease: Lease, run: RunId) {
        if self.stands.is_none() {
            self.order(vehicle, lease, run, OrderKind::Start);
        }
    }

    /// Orders something above whatever it has obeyed before.
    pub(crate) fn order(&mut self, vehicle: VehicleId, lease: Lease, run: RunId, kind: OrderKind) {
        let echo = self.shown_order.filter(|echo| echo.lease >= lease);
        let obeyed = echo.map_or(Revision(0), |echo| echo.revision);
        let pending = self
            .issued
            .as_ref()
            .filter(|order| self.is_pending && order.lease == lease);
        let pending = pending.map_or(Revision(0), |order| order.revision);
        let crossing = self.crossing.as_ref().filter(|order| order.lease == lease);
        let crossing = crossing.map_or(Revision(0), |order| order.revision);
        let revision = Revision(obeyed.max(pending).max(crossing).0.saturating_add(1));
        self.issued = Some(Order {
            vehicle,
            lease,
            run,
            revision,
            seen: None,
            kind,
            ends: Vec::new(),
        });
        (self.is_pending, self.is_said) = (true, false);
        self.stand(kind);
    }

    /// Passes what is still to be repeated to another right, above what the vehicle shows of that right.
    pub(crate) fn pass_to(&mut self, lease: Lease) {
        let obeyed = self
            .shown_order
            .filter(|echo| echo.lease == lease)
            .map_or(Revision(0), |echo| echo.revision);
        let pending = self
            .issued
            .as_mut()
            .filter(|order| self.is_pending && order.lease != lease);
        if let Some(order) = pending {
            (order.lease, order.revision) = (lease, Revision(obeyed.0.saturating_add(1)));
            self.is_said = false;
        }
    }

    /// Records that an emergency stop holds it, whoever has ordered what: that stands until somebody starts it. An own
    /// start that is not obeyed yet is given up; the next one to order counts on to its number, once it was said: a hold
    /// goes above it, so that no other start is taken for it.
    pub(crate) fn be_stopped(&mut self, vehicle: VehicleId, lease: Lease) {
        self.stand(OrderKind::Hold);
        let start = self
            .issued
            .clone()
            .filter(|order| self.is_pending && order.kind == OrderKind::Start);
        match start {
            Some(start) if self.is_said => self.order(vehicle, lease, start.run, OrderKind::Hold),
            Some(_) => self.is_pending = false,
            None => {}
        }
    }

    fn stand(&mut self, kind: OrderKind) {
        let strongest = self
            .stands
            .into_iter()
            .chain([kind])
            .reduce(OrderKind::stronger);
        self.stands = strongest.filter(|_| kind != OrderKind::Start);
    }

    /// Takes what a vehicle says it was ordered; returns the run that somebody else has started it for. Of orders
    /// from before it was first heard, only a run counts whose plans it has not `accepted`, under at least `lease`.
    pub(crate) fn take_shown_order(
        &mut self,
        echo: Ordered,
        accepted: RunId,
        lease: Lease,
    ) -> Option<RunId> {
        let known = self.shown_order.replace(echo);
        self.go_above(echo);
        let kind = echo.kind.filter(|_| known != Some(echo))?;
        let of = |order: &Order| (order.lease, order.revision);
        let is = |order: &Order| {
            of(order) == echo.edition() && (order.kind, order.run) == (kind, echo.run)
        };
        if let Some(order) = self.crossing.take_if(|order| is(order)) {
            let is_above = self
                .issued
                .as_ref()
                .is_some_and(|issued| of(issued) > echo.edition());
            if !(self.is_pending && is_above) {
                self.stop_again(order.vehicle, lease, echo.run);
            }
            return None;
        }
        let is_own = self.issued.as_ref().is_some_and(is);
        // What somebody has stopped meanwhile is not started again by what was ordered before.
        let is_beaten = self.issued.as_ref().is_some_and(|order| {
            echo.edition() >= of(order)
                || (kind != OrderKind::Start && order.kind == OrderKind::Start)
        });
        self.is_pending = self.is_pending && !is_beaten;
        if is_own {
            return None;
        }
        let is_start = kind == OrderKind::Start;
        if is_beaten {
            // Another order of the same edition is not taken for the own one.
            let lost = self
                .issued
                .take()
                .filter(|order| self.is_said && order.kind == OrderKind::Start);
            self.crossing = lost.filter(|order| !is_start && of(order) > echo.edition());
        }
        self.stand(kind);
        if let Some(start) = self
            .crossing
            .clone()
            .filter(|_| is_beaten && kind != OrderKind::CutMotors)
        {
            // It may be on its way still, and whoever orders next counts on to its number.
            self.stop_again(start.vehicle, lease, echo.run);
        }
        let is_fresh = known.is_some() || (echo.lease >= lease && accepted < echo.run);
        self.earlier = (is_start && !is_fresh && echo.lease >= lease).then_some(echo.run);
        (is_start && is_fresh).then_some(echo.run)
    }

    /// An own start has come after what stands: that is ordered again. Motors that would be cut stop otherwise: the vehicle
    /// may be under way by now.
    fn stop_again(&mut self, vehicle: VehicleId, lease: Lease, run: RunId) {
        match self.stands {
            None | Some(OrderKind::Start) => {}
            Some(OrderKind::CutMotors) => self.order(vehicle, lease, run, OrderKind::Land),
            Some(kind @ (OrderKind::Hold | OrderKind::Return | OrderKind::Land)) => {
                self.order(vehicle, lease, run, kind);
            }
        }
    }

    /// Orders above what a vehicle that was started anew remembers of this lease: it obeys nothing lower.
    fn go_above(&mut self, echo: Ordered) {
        let pending = self
            .issued
            .as_mut()
            .filter(|_| self.is_pending && echo.kind.is_none());
        if let Some(order) =
            pending.filter(|order| order.lease == echo.lease && order.revision < echo.revision)
        {
            order.revision = Revision(echo.revision.0.saturating_add(1));
            self.is_said = false;
        }
    }

    /// Returns the run that a vehicle is in the middle of, though it was started before anything was heard of it: who
    /// drives a leg has not come to the end of its plan.
    pub(crate) fn under_way(&mut self, state: &State) -> Option<RunId> {
        if state.leg.is_some() {
            self.earlier.take()
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ONE: VehicleId = VehicleId(1);
    const LEASE: Lease = Lease {
        number: 1,
        holder: 9,
    };
    const NEXT: Lease = Lease { number: 2, ..LEASE };
    const RUN: RunId = RunId(1);

    /// Lets a vehicle show an order of [`LEASE`] whose run it has not been planned for; returns the run that somebody else
    /// has started it for.
    fn shows(dealings: &mut OrderLedger, revision: u32, kind: OrderKind) -> Option<RunId> {
        let echo = Ordered {
            lease: LEASE,
            revision: Revision(revision),
            run: RUN,
            kind: Some(kind),
        };
        dealings.take_shown_order(echo, RunId(0), LEASE)
    }

    /// Lets a vehicle that was started anew show what it remembers.
    fn remembers(dealings: &mut OrderLedger, lease: Lease, revision: u32) {
        let echo = Ordered {
            lease,
            revision: Revision(revision),
            run: RUN,
            kind: None,
        };
        assert_eq!(dealings.take_shown_order(echo, RunId(0), LEASE), None);
    }

    /// What was dealt with a vehicle that shows this order.
    fn that_shows(revision: u32, kind: OrderKind) -> OrderLedger {
        let mut dealings = OrderLedger::default();
        shows(&mut dealings, revision, kind);
        dealings
    }

    fn open(dealings: &OrderLedger) -> Option<(Lease, u32, OrderKind)> {
        dealings
            .open_order()
            .map(|order| (order.lease, order.revision.0, order.kind))
    }

    #[test]
    fn an_order_is_open_until_it_is_shown_and_then_nobody_elses() {
        let mut dealings = that_shows(3, OrderKind::Start);
        dealings.start(ONE, LEASE, RUN);
        assert_eq!(open(&dealings), Some((LEASE, 4, OrderKind::Start)));
        assert_eq!(shows(&mut dealings, 3, OrderKind::Start), None);
        assert!(dealings.open_order().is_some());
        assert_eq!(shows(&mut dealings, 4, OrderKind::Start), None);
        assert_eq!(dealings.open_order(), None);
    }

    #[test]
    fn an_order_above_the_highest_revision_is_no_overflow() {
        let mut dealings = that_shows(u32::MAX, OrderKind::Hold);
        dealings.order(ONE, LEASE, RUN, OrderKind::Land);
        assert_eq!(open(&dealings), Some((LEASE, u32::MAX, OrderKind::Land)));
    }

    #[test]
    fn what_somebody_else_has_stopped_stands_and_beats_the_own_start() {
        for revision in [3, 4, 7] {
            let mut dealings = that_shows(2, OrderKind::Start);
            dealings.order(ONE, LEASE, RUN, OrderKind::Start);
            dealings.order(ONE, LEASE, RUN, OrderKind::Start);
            // The operator's order came before, at the same time as, or after the own one.
            assert_eq!(shows(&mut dealings, revision, OrderKind::Hold), None);
            assert_eq!(dealings.stands(), Some(OrderKind::Hold));
            assert_eq!(
                dealings.open_order(),
                None,
                "the own start is not repeated: {revision}"
            );
            assert_eq!(
                shows(&mut dealings, revision + 1, OrderKind::Start),
                Some(RUN)
            );
            assert_eq!(dealings.stands(), None);
        }
    }

    #[test]
    fn an_own_start_that_came_after_a_stop_lifts_nothing_and_the_stop_is_ordered_again() {
        for (stop, again) in [
            (OrderKind::Hold, OrderKind::Hold),
            (OrderKind::Land, OrderKind::Land),
            (OrderKind::CutMotors, OrderKind::Land),
        ] {
            let mut dealings = that_shows(2, OrderKind::Start);
            dealings.order(ONE, LEASE, RUN, OrderKind::Start);
            dealings.order(ONE, LEASE, RUN, OrderKind::Start);
            dealings.note_said();
            // The operator has not heard of the own start, which has revision 4.
            shows(&mut dealings, 3, stop);
            assert_eq!(shows(&mut dealings, 4, OrderKind::Start), None);
            assert_eq!(dealings.stands(), Some(stop));
            assert_eq!(open(&dealings), Some((LEASE, 5, again)));
            dealings.start(ONE, LEASE, RUN);
            assert_eq!(
                open(&dealings),
                Some((LEASE, 5, again)),
                "what stands is not started"
            );
            shows(&mut dealings, 5, again);
            shows(&mut dealings, 6, OrderKind::Start);
            assert_eq!(dealings.stands(), None, "somebody has started it");
        }
    }

    #[test]
    fn under_an_emergency_stop_the_own_start_is_given_up_and_hold_stands() {
        let mut dealings = that_shows(2, OrderKind::Start);
        dealings.start(ONE, LEASE, RUN);
        dealings.be_stopped(ONE, LEASE);
        assert_eq!(
            (dealings.open_order(), dealings.stands()),
            (None, Some(OrderKind::Hold))
        );
        dealings.order(ONE, LEASE, RUN, OrderKind::Land);
        dealings.be_stopped(ONE, LEASE);
        assert_eq!(
            dealings.open_order().map(|order| order.kind),
            Some(OrderKind::Land),
            "that is no start"
        );
    }

    #[test]
    fn whoever_starts_next_does_not_have_the_number_of_an_own_start_that_was_given_up() {
        let output = || {
            let mut dealings = that_shows(2, OrderKind::Start);
            dealings.start(ONE, LEASE, RUN);
            dealings.note_said();
            dealings
        };
        // It was stopped under a lower lease, or by an emergency stop: its echo says nothing of the start.
        let (mut held, mut stopped) = (output(), output());
        let lower = Lease {
            number: 0,
            holder: 3,
        };
        let hold = Ordered {
            lease: lower,
            revision: Revision(9),
            run: RUN,
            kind: Some(OrderKind::Hold),
        };
        assert_eq!(held.take_shown_order(hold, RunId(0), LEASE), None);
        stopped.be_stopped(ONE, LEASE);
        for dealings in [&mut held, &mut stopped] {
            assert_eq!(
                (open(dealings), dealings.stands()),
                (Some((LEASE, 4, OrderKind::Hold)), Some(OrderKind::Hold))
            );
            shows(dealings, 4, OrderKind::Hold);
            assert_eq!(
                shows(dealings, 5, OrderKind::Start),
                Some(RUN),
                "somebody has started it"
            );
            assert_eq!(dealings.stands(), None);
        }
    }

    #[test]
    fn under_another_lease_orders_count_from_one_again() {
        let mut dealings = that_shows(7, OrderKind::Start);
        dealings.start(ONE, LEASE, RUN);
        assert_eq!(open(&dealings), Some((LEASE, 8, OrderKind::Start)));
        dealings.pass_to(NEXT);
        assert_eq!(open(&dealings), Some((NEXT, 1, OrderKind::Start)));
        let mut anew = that_shows(9, OrderKind::Hold);
        anew.pass_to(NEXT);
        anew.order(ONE, NEXT, RUN, OrderKind::Start);
        assert_eq!(open(&anew), Some((NEXT, 1, OrderKind::Start)));
    }

    #[test]
    fn what_waits_goes_above_what_a_vehicle_started_anew_remembers_of_the_next_lease() {
        let mut dealings = that_shows(7, OrderKind::Start);
        dealings.start(ONE, LEASE, RUN);
        remembers(&mut dealings, NEXT, 3);
        dealings.pass_to(NEXT);
        assert_eq!(open(&dealings), Some((NEXT, 4, OrderKind::Start)));
    }

    #[test]
    fn what_waits_to_be_obeyed_goes_above_what_a_vehicle_started_anew_remembers() {
        for (remembered, expected) in [(3, 4), (4, 4), (7, 8)] {
            let mut dealings = that_shows(3, OrderKind::Hold);
            dealings.order(ONE, LEASE, RUN, OrderKind::Return);
            remembers(&mut dealings, LEASE, remembered);
            assert_eq!(
                open(&dealings),
                Some((LEASE, expected, OrderKind::Return)),
                "{remembered}"
            );
        }
    }

    #[test]
    fn what_was_ordered_long_ago_by_a_lower_right_starts_nothing() {
        let mut dealings = OrderLedger::default();
        let started = [2, 3].map(|revision| {
            let (revision, kind) = (Revision(revision), Some(OrderKind::Start));
            let echo = Ordered {
                lease: LEASE,
                revision,
                run: RUN,
                kind,
            };
            dealings.take_shown_order(
                echo,
                RunId(0),
                Lease {
                    number: 5,
                    holder: 9,
                },
            )
        });
        assert_eq!(started, [None, Some(RUN)], "the second one is new");
    }

    #[test]
    fn of_what_was_ordered_before_anything_was_heard_only_what_was_not_driven_counts() {
        for (accepted, started) in [(0, Some(RUN)), (1, None), (2, None)] {
            let (revision, kind) = (Revision(3), Some(OrderKind::Start));
            let old = Ordered {
                lease: LEASE,
                revision,
                run: RUN,
                kind,
            };
            let shown =
                OrderLedger::default().take_shown_order(old, RunId(accepted), Lease::default());
            assert_eq!(shown, started, "{accepted}");
        }
    }
}
