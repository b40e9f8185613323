//! Who may speak for the ground: the greatest lease wins, a live holder is not displaced unless that is asked for.
//!
//! ```text
//!   Listening ─2 s, nobody else holds one─► Holding ─a greater lease is heard─► StandingBy
//!       └───── another ground lives ───────────────────────────────────────────►  │
//!                                            ▲ │ ▲                                │
//!      an operator holds the greatest lease: └─┘ └── no other ground for 10 s ────┤
//!      it is planned under                   ▲                                    │
//!                                            └── it was that of an operator ──────┘
//! ```
//!
//! A lease is taken above the highest number heard, so that vehicles that echo an older one obey the new holder. A
//! lease in an echo is no sign of life of its holder; only the Report of a ground is, or the Hello of an operator.
//!
//! **Operators.** A lease that a live operator holds is not fought over: the ground that leads plans under it. When the
//! operator has been silent for 5 s the ground takes one of its own. Of two grounds that lead under one operator's lease
//! (they could not hear each other before) the one whose store has the lower id goes on.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Hello, Lease, Sender};

use crate::time::Time;

/// Echoes and reports are listened to for this long before a lease is taken.
const LISTEN: Duration = Duration::from_secs(2);
/// Another ground lives when its report came within this time.
const LIVES: Duration = Duration::from_secs(5);
/// Who stands by takes over when the other one has been silent for this long.
const SILENT: Duration = Duration::from_secs(10);

#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
enum Right {
    /// Since when, once anything was looked at.
    Listening(Option<Time>),
    Holding,
    StandingBy(Time),
}

/// What has changed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Change {
    /// This lease is held from now on, after a time without one.
    Taken(Lease),
    /// This lease, an operator's or an own one, has taken the place of the one held before.
    Renewed(Lease),
    /// Somebody else holds a greater one: this one.
    StoodDown(Lease),
}

/// The own right to give orders, and what is known of others'.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Leases {
    own: Lease,
    highest: Lease,
    /// The newest report of another ground, and its lease.
    other: Option<(Time, Lease)>,
    right: Right,
    take_over: bool,
    /// Its random id as the holder of a lease; that of its own lease unless it is an operator's.
    holder: u64,
    /// The greatest lease that an operator says to hold, and when it said so last.
    operator: Option<(Time, Lease)>,
}

impl Leases {
    /// Holds a lease from the start.
    pub fn held(lease: Lease) -> Leases {
        Leases {
            right: Right::Holding,
            ..Leases::listening(lease, false)
        }
    }

    /// Listens first. `last` is the lease held before (number 0 = none) and names the holder; with `take_over` a live
    /// holder is displaced, once.
    pub fn listening(last: Lease, take_over: bool) -> Leases {
        let (right, holder) = (Right::Listening(None), last.holder);
        Leases {
            own: last,
            highest: last,
            other: None,
            right,
            take_over,
            holder,
            operator: None,
        }
    }

    /// Returns whether orders and plans may be given.
    pub fn holds(&self) -> bool {
        self.right == Right::Holding
    }

    /// Returns whether another ground is waited for.
    pub fn stands_by(&self) -> bool {
        matches!(self.right, Right::StandingBy(_))
    }

    /// Returns the lease held now, or held last (number 0 = none yet).
    pub fn own(&self) -> Lease {
        self.own
    }

    /// Returns the greatest lease heard.
    pub fn highest(&self) -> Lease {
        self.highest
    }

    /// Takes a lease echoed by a vehicle or carried by a plan.
    pub fn heard(&mut self, now: Time, lease: Lease) -> Option<Change> {
        self.highest = self.highest.max(lease);
        if !self.holds() || lease <= self.own {
            return None;
        }
        self.right = Right::StandingBy(now);
        Some(Change::StoodDown(lease))
    }

    /// Takes the lease of a ground's report; one without a lease, and its own, says nothing.
    pub fn heard_report(&mut self, now: Time, lease: Lease) -> Option<Change> {
        if lease.number == 0 || lease.holder == self.holder {
            return None;
        }
        if lease >= self.own {
            self.other = Some((now, lease));
        }
        self.heard(now, lease)
    }

    /// Takes the lease of the report of a ground that comes before this one: of two that lead under one operator's lease it
    /// is the one that goes on.
    pub fn heard_elder(&mut self, now: Time, lease: Lease) -> Option<Change> {
        if !self.holds() || lease != self.own || lease.holder == self.holder {
            return self.heard_report(now, lease);
        }
        (self.other, self.right) = (Some((now, lease)), Right::StandingBy(now));
        Some(Change::StoodDown(lease))
    }

    /// Takes a greeting: an operator names the lease that it holds.
    pub fn heard_hello(&mut self, now: Time, hello: &Hello) -> Option<Change> {
        match hello.node {
            Sender::Operator(_) => self.heard_operator(now, hello.lease?),
            Sender::Ground | Sender::Vehicle(_) => None,
        }
    }

    /// Takes the lease that an operator says to hold; one that is displaced already counts for nothing.
    pub fn heard_operator(&mut self, now: Time, lease: Lease) -> Option<Change> {
        if lease.number == 0 || lease < self.highest {
            return None;
        }
        (self.highest, self.operator) = (lease, Some((now, lease)));
        match self.right {
            Right::Holding if lease == self.own => None,
            Right::Holding => {
                self.own = lease;
                Some(Change::Renewed(lease))
            }
            // It stood by for nobody else than this operator.
            Right::StandingBy(_) if self.other_lives(now, SILENT).is_none() => {
                Some(self.follow(lease))
            }
            Right::StandingBy(_) | Right::Listening(_) => None,
        }
    }

    /// Looks whether a lease can be taken now.
    pub fn tick(&mut self, now: Time) -> Option<Change> {
        let lives = |within| self.other_lives(now, within);
        match self.right {
            Right::Holding if self.own.holder == self.holder || self.operator(now).is_some() => {
                None
            }
            Right::Holding => {
                self.take();
                Some(Change::Renewed(self.own))
            }
            Right::Listening(None) => {
                self.right = Right::Listening(Some(now));
                None
            }
            Right::Listening(Some(since)) if now.since(since) < LISTEN => None,
            Right::Listening(Some(_)) => match lives(LIVES).filter(|_| !self.take_over) {
                None => Some(self.lead(now)),
                Some((at, lease)) => {
                    self.right = Right::StandingBy(at);
                    Some(Change::StoodDown(lease))
                }
            },
            Right::StandingBy(since) if now.since(since) < SILENT || lives(SILENT).is_some() => {
                None
            }
            Right::StandingBy(_) => Some(self.lead(now)),
        }
    }

    /// Returns the lease of a live operator, if it is the greatest of all.
    fn operator(&self, now: Time) -> Option<Lease> {
        let live = self
            .operator
            .filter(|(at, lease)| now.since(*at) < LIVES && *lease >= self.highest);
        live.map(|(_, lease)| lease)
    }

    /// Returns when another ground was heard to hold no lower lease, if that was within this time.
    fn other_lives(&self, now: Time, within: Duration) -> Option<(Time, Lease)> {
        self.other
            .filter(|(at, lease)| *lease >= self.own && now.since(*at) < within)
    }

    /// Leads from now on, under the lease of an operator if one holds the greatest.
    fn lead(&mut self, now: Time) -> Change {
        match self.operator(now) {
            Some(lease) => self.follow(lease),
            None => self.take(),
        }
    }

    fn follow(&mut self, lease: Lease) -> Change {
        self.own = lease;
        (self.right, self.take_over, self.other) = (Right::Holding, false, None);
        Change::Taken(lease)
    }

    fn take(&mut self) -> Change {
        let number = self.highest.number.max(self.own.number).saturating_add(1);
        self.own = Lease {
            number,
            holder: self.holder,
        };
        self.highest = self.own;
        (self.right, self.take_over, self.other) = (Right::Holding, false, None);
        Change::Taken(self.own)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn lease(number: u32, holder: u64) -> Lease {
        Lease { number, holder }
    }

    fn at(seconds: u64) -> Time {
        Time::ZERO + Duration::from_secs(seconds)
    }

    /// Ticks once a second; returns what changed first, and when.
    fn first_change(leases: &mut Leases, from_s: u64, until_s: u64) -> Option<(u64, Change)> {
        (from_s..until_s).find_map(|second| Some((second, leases.tick(at(second))?)))
    }

    #[test]
    fn who_is_alone_takes_a_lease_above_every_echo() {
        let mut leases = Leases::listening(lease(0, 7), false);
        assert!(!leases.holds());
        leases.heard(at(0), lease(4, 1));
        assert_eq!(
            first_change(&mut leases, 0, 9),
            Some((2, Change::Taken(lease(5, 7))))
        );
        assert!(leases.holds());
    }

    #[test]
    fn a_live_holder_is_not_displaced_and_a_dead_one_is() {
        let mut leases = Leases::listening(lease(0, 7), false);
        for second in 0..20 {
            leases.heard_report(at(second), lease(4, 1));
            let changed = leases.tick(at(second));
            assert_eq!(
                changed,
                (second == 2).then_some(Change::StoodDown(lease(4, 1))),
                "{second}"
            );
        }
        assert_eq!(
            first_change(&mut leases, 20, 99),
            Some((29, Change::Taken(lease(5, 7))))
        );
    }

    #[test]
    fn who_shall_take_over_does_so_once() {
        let mut leases = Leases::listening(lease(0, 7), true);
        leases.heard_report(at(0), lease(4, 1));
        assert_eq!(
            first_change(&mut leases, 0, 9),
            Some((2, Change::Taken(lease(5, 7))))
        );
        assert_eq!(leases.heard_report(at(3), lease(4, 1)), None);
        assert_eq!(
            leases.heard_report(at(4), lease(6, 1)),
            Some(Change::StoodDown(lease(6, 1)))
        );
        leases.heard_report(at(8), lease(6, 1));
        assert_eq!(first_change(&mut leases, 8, 18), None);
    }

    #[test]
    fn of_two_that_take_the_same_number_one_stands_down() {
        let (mut one, mut two) = (Leases::held(lease(3, 1)), Leases::held(lease(3, 2)));
        assert_eq!(one.heard_report(at(1), two.own()), None);
        assert_eq!(
            two.heard_report(at(1), one.own()),
            Some(Change::StoodDown(lease(3, 1)))
        );
    }

    #[test]
    fn a_greater_lease_in_an_echo_alone_is_outlived() {
        let mut leases = Leases::held(lease(3, 1));
        assert_eq!(
            leases.heard(at(5), lease(8, 2)),
            Some(Change::StoodDown(lease(8, 2)))
        );
        assert_eq!(
            first_change(&mut leases, 5, 99),
            Some((15, Change::Taken(lease(9, 1))))
        );
    }

    /// A ground that holds lease 3 and hears an operator take lease 4 over.
    fn under_operator() -> Leases {
        let mut leases = Leases::held(lease(3, 1));
        assert_eq!(
            leases.heard(at(1), lease(4, 9)),
            Some(Change::StoodDown(lease(4, 9)))
        );
        assert_eq!(
            leases.heard_operator(at(1), lease(4, 9)),
            Some(Change::Taken(lease(4, 9)))
        );
        leases
    }

    #[test]
    fn a_live_operators_lease_is_planned_under_and_a_silent_ones_is_replaced_after_five_seconds() {
        let mut leases = under_operator();
        for second in 1..60 {
            assert_eq!(leases.heard_operator(at(second), lease(4, 9)), None);
            assert_eq!(leases.tick(at(second)), None);
        }
        assert_eq!(
            first_change(&mut leases, 60, 99),
            Some((64, Change::Renewed(lease(5, 1))))
        );
        assert_eq!(
            leases.heard_operator(at(65), lease(4, 9)),
            None,
            "it is too late"
        );
        assert_eq!(leases.own(), lease(5, 1));
    }

    #[test]
    fn between_operators_nobody_stands_by_when_the_hello_comes_before_the_echo() {
        let mut leases = under_operator();
        assert_eq!(
            leases.heard_operator(at(2), lease(5, 8)),
            Some(Change::Renewed(lease(5, 8)))
        );
        assert_eq!(leases.heard(at(2), lease(5, 8)), None);
        assert_eq!(
            leases.heard_operator(at(3), lease(4, 9)),
            None,
            "it is displaced"
        );
        assert_eq!((leases.holds(), leases.own()), (true, lease(5, 8)));
    }

    #[test]
    fn of_two_grounds_under_one_operator_one_leads_and_the_other_follows_it() {
        let (mut one, mut two) = (under_operator(), under_operator());
        assert_eq!(one.heard_report(at(2), two.own()), None);
        assert_eq!(
            two.heard_elder(at(2), one.own()),
            Some(Change::StoodDown(lease(4, 9)))
        );
        for second in 2..30 {
            one.heard_operator(at(second), lease(4, 9));
            two.heard_report(at(second), one.own());
            assert_eq!(
                (
                    two.heard_operator(at(second), lease(4, 9)),
                    two.tick(at(second))
                ),
                (None, None)
            );
        }
        let mut alone = two;
        assert_eq!(
            first_change(&mut alone, 30, 99),
            Some((39, Change::Taken(lease(5, 1))))
        );
    }

    #[test]
    fn others_that_stand_by_themselves_hold_nobody_up() {
        let mut leases = Leases::listening(lease(0, 7), false);
        leases.heard_report(at(0), Lease::default());
        assert!(matches!(
            first_change(&mut leases, 0, 9),
            Some((2, Change::Taken(_)))
        ));
    }
}
