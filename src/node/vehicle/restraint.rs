//! What the orders of operators leave standing: whether the vehicle may move, and whether its motors are to be cut. The
//! states are drawn in the actor's doc. Which order counts is not judged here, and that a vehicle brakes by every order
//! but a start is not said here.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::OrderKind;

use super::disarming::Disarming;
use super::words::{Fly, Refusal, Telemetry};
use crate::time::Time;

/// How far orders hold the vehicle back. One that may move, or only holds, has its motors; one that has landed, or is
/// under an emergency, is being disarmed.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) enum Restraint {
    /// It may move.
    #[default]
    Free,
    /// It stands, armed, until a start or a return.
    Held,
    /// It stands and is disarmed, until a start or a return.
    Landing(Disarming),
    /// It stands and is disarmed, until a start.
    Emergency(Disarming),
}

impl Restraint {
    /// Takes an order that is obeyed; returns what the motors are told at once.
    pub fn obey(&mut self, now: Time, kind: OrderKind) -> Option<Fly> {
        use Restraint::{Emergency, Free, Held, Landing};
        let (next, motors) = match (*self, kind) {
            (Free | Held | Landing(_) | Emergency(_), OrderKind::Start) => (Free, Some(Fly::Arm)),
            (Free | Held | Landing(_), OrderKind::Return) => (Free, Some(Fly::Arm)),
            (Free | Held, OrderKind::Hold) => (Held, None),
            (same @ (Landing(_) | Emergency(_)), OrderKind::Hold) => (same, None),
            (same @ Emergency(_), OrderKind::Return) => (same, None),
            (Free | Held, OrderKind::Land) => (Landing(Disarming::at_rest(now)), None),
            (Landing(disarming), OrderKind::Land) => (Landing(disarming.again(now)), None),
            (Free | Held, OrderKind::Emergency) => (Emergency(Disarming::at_rest(now)), None),
            (Landing(disarming), OrderKind::Emergency)
            | (Emergency(disarming), OrderKind::Land | OrderKind::Emergency) => {
                (Emergency(disarming.again(now)), None)
            }
            (Free | Held | Landing(_) | Emergency(_), OrderKind::CutMotors) => {
                (Emergency(Disarming::told(now)), Some(Fly::Disarm))
            }
        };
        *self = next;
        motors
    }

    /// Takes what telemetry shows; returns what the motors are told.
    pub fn take(&mut self, now: Time, telemetry: &Telemetry) -> Option<Fly> {
        match self {
            Restraint::Free | Restraint::Held => None,
            Restraint::Landing(disarming) | Restraint::Emergency(disarming) => {
                disarming.take(now, telemetry).then_some(Fly::Disarm)
            }
        }
    }

    /// Returns why nothing is driven; `None` while it is free.
    pub fn refusal(&self) -> Option<Refusal> {
        match self {
            Restraint::Free => None,
            Restraint::Held | Restraint::Landing(Disarming::AtRest { .. }) => Some(Refusal::Held),
            Restraint::Landing(Disarming::Told { .. }) => Some(Refusal::Disarmed),
            Restraint::Emergency(_) => Some(Refusal::Emergency),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::tests_support::variant_of;

    const KINDS: [OrderKind; 6] = [
        OrderKind::Start,
        OrderKind::Hold,
        OrderKind::Return,
        OrderKind::Land,
        OrderKind::Emergency,
        OrderKind::CutMotors,
    ];

    fn after(orders: &[OrderKind]) -> Restraint {
        let mut restraint = Restraint::default();
        for kind in orders {
            restraint.obey(Time::ZERO, *kind);
        }
        restraint
    }

    #[test]
    fn every_order_leads_from_every_state_where_the_drawing_says() {
        let check = |before: &[OrderKind], expected: [&str; 6]| {
            let leads = KINDS.map(|kind| variant_of(&after(&[before, &[kind]].concat())));
            assert_eq!(leads, expected, "after {before:?}");
        };
        let (held, landing, emergency) = ("Held", "Landing", "Emergency");
        check(&[], ["Free", held, "Free", landing, emergency, emergency]);
        check(&[OrderKind::Hold], ["Free", held, "Free", landing, emergency, emergency]);
        check(&[OrderKind::Land], ["Free", landing, "Free", landing, emergency, emergency]);
        for stops in [OrderKind::Emergency, OrderKind::CutMotors] {
            check(&[stops], ["Free", emergency, emergency, emergency, emergency, emergency]);
        }
    }

    #[test]
    fn motors_are_armed_by_what_frees_and_cut_at_once_by_one_order_alone() {
        for before in KINDS {
            for kind in KINDS {
                let mut restraint = after(&[before]);
                let motors = restraint.obey(Time::ZERO, kind);
                let expected = match kind {
                    OrderKind::CutMotors => Some(Fly::Disarm),
                    OrderKind::Start | OrderKind::Return if restraint == Restraint::Free => Some(Fly::Arm),
                    OrderKind::Start
                    | OrderKind::Return
                    | OrderKind::Hold
                    | OrderKind::Land
                    | OrderKind::Emergency => None,
                };
                assert_eq!(motors, expected, "{kind:?} after {before:?}");
            }
        }
    }

    #[test]
    fn what_stands_is_named_when_a_command_is_refused() {
        assert_eq!(after(&[]).refusal(), None);
        assert_eq!(after(&[OrderKind::Hold]).refusal(), Some(Refusal::Held));
        assert_eq!(after(&[OrderKind::Land]).refusal(), Some(Refusal::Held), "it is armed still");
        assert_eq!(Restraint::Landing(Disarming::told(Time::ZERO)).refusal(), Some(Refusal::Disarmed));
        assert_eq!(after(&[OrderKind::CutMotors]).refusal(), Some(Refusal::Emergency));
    }

    #[test]
    fn a_hold_lifts_no_landing_and_a_landing_no_emergency() {
        let landing = after(&[OrderKind::Land]);
        assert_eq!(after(&[OrderKind::Land, OrderKind::Hold]), landing);
        let emergency = after(&[OrderKind::Emergency]);
        assert_eq!(after(&[OrderKind::Emergency, OrderKind::Land]), emergency);
        assert_eq!(after(&[OrderKind::Land, OrderKind::Emergency]), emergency);
    }
}
