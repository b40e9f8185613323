//! What the orders of operators leave standing: whether the vehicle may move, and whether its motors are to be cut. The
//! states are drawn in the actor's doc. Which order counts is not judged here, and that a vehicle brakes by every order
//! but a start is not said here.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::OrderKind;

use super::disarming::DisarmingState;
use super::messages::{AutopilotCommand, CommandRefusal, Telemetry};
use crate::time::Time;

/// How far orders hold the vehicle back. One that may move, or only holds, has its motors; one that has landed, or
/// whose motors were cut, is being disarmed.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) enum Restraint {
    /// It may move.
    #[default]
    Free,
    /// It stands, armed, until a start or a return.
    Held,
    /// It stands and is disarmed, until a start or a return.
    Landing(DisarmingState),
    /// Its motors were cut, and it stands until a start.
    MotorsCut(DisarmingState),
}

impl Restraint {
    /// Takes an order that is obeyed; returns what the motors are told at once.
    pub(super) fn obey(&mut self, now: Time, kind: OrderKind) -> Option<AutopilotCommand> {
        use Restraint::{Free, Held, Landing, MotorsCut};
        let (next, motors) = match (*self, kind) {
            (Free | Held | Landing(_) | MotorsCut(_), OrderKind::Start) => {
                (Free, Some(AutopilotCommand::Arm))
            }
            (Free | Held | Landing(_), OrderKind::Return) => (Free, Some(AutopilotCommand::Arm)),
            (Free | Held, OrderKind::Hold) => (Held, None),
            (same @ (Landing(_) | MotorsCut(_)), OrderKind::Hold) => (same, None),
            (same @ MotorsCut(_), OrderKind::Return) => (same, None),
            (Free | Held, OrderKind::Land) => (Landing(DisarmingState::at_rest(now)), None),
            (Landing(disarming), OrderKind::Land) => (Landing(disarming.again(now)), None),
            (MotorsCut(disarming), OrderKind::Land) => (MotorsCut(disarming.again(now)), None),
            (Free | Held | Landing(_) | MotorsCut(_), OrderKind::CutMotors) => (
                MotorsCut(DisarmingState::ordered(now)),
                Some(AutopilotCommand::Disarm),
            ),
        };
        *self = next;
        motors
    }

    /// Takes what telemetry shows; returns what the motors are told.
    pub(super) fn take(&mut self, now: Time, telemetry: &Telemetry) -> Option<AutopilotCommand> {
        match self {
            Restraint::Free | Restraint::Held => None,
            Restraint::Landing(disarming) | Restraint::MotorsCut(disarming) => disarming
                .take(now, telemetry)
                .then_some(AutopilotCommand::Disarm),
        }
    }

    /// Returns why nothing is driven; `None` while it is free.
    pub(super) fn refusal(&self) -> Option<CommandRefusal> {
        match self {
            Restraint::Free => None,
            Restraint::Held | Restraint::Landing(DisarmingState::AtRest { .. }) => {
                Some(CommandRefusal::Held)
            }
            Restraint::Landing(DisarmingState::Ordered { .. }) => Some(CommandRefusal::Disarmed),
            Restraint::MotorsCut(_) => Some(CommandRefusal::Disarmed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::tests_support::variant_of;

    const KINDS: [OrderKind; 5] = [
        OrderKind::Start,
        OrderKind::Hold,
        OrderKind::Return,
        OrderKind::Land,
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
        let check = |before: &[OrderKind], expected: [&str; 5]| {
            let leads = KINDS.map(|kind| variant_of(&after(&[before, &[kind]].concat())));
            assert_eq!(leads, expected, "after {before:?}");
        };
        let (held, landing, cut) = ("Held", "Landing", "MotorsCut");
        check(&[], ["Free", held, "Free", landing, cut]);
        check(&[OrderKind::Hold], ["Free", held, "Free", landing, cut]);
        check(&[OrderKind::Land], ["Free", landing, "Free", landing, cut]);
        check(&[OrderKind::CutMotors], ["Free", cut, cut, cut, cut]);
    }

    #[test]
    fn motors_are_armed_by_what_frees_and_cut_at_once_by_one_order_alone() {
        for before in KINDS {
            for kind in KINDS {
                let mut restraint = after(&[before]);
                let motors = restraint.obey(Time::ZERO, kind);
                let expected = match kind {
                    OrderKind::CutMotors => Some(AutopilotCommand::Disarm),
                    OrderKind::Start | OrderKind::Return if restraint == Restraint::Free => {
                        Some(AutopilotCommand::Arm)
                    }
                    OrderKind::Start | OrderKind::Return | OrderKind::Hold | OrderKind::Land => {
                        None
                    }
                };
                assert_eq!(motors, expected, "{kind:?} after {before:?}");
            }
        }
    }

    #[test]
    fn what_stands_is_named_when_a_command_is_refused() {
        assert_eq!(after(&[]).refusal(), None);
        assert_eq!(
            after(&[OrderKind::Hold]).refusal(),
            Some(CommandRefusal::Held)
        );
        assert_eq!(
            after(&[OrderKind::Land]).refusal(),
            Some(CommandRefusal::Held),
            "it is armed still"
        );
        assert_eq!(
            Restraint::Landing(DisarmingState::ordered(Time::ZERO)).refusal(),
            Some(CommandRefusal::Disarmed)
        );
        assert_eq!(
            after(&[OrderKind::CutMotors]).refusal(),
            Some(CommandRefusal::Disarmed)
        );
    }

    #[test]
    fn a_hold_lifts_no_landing_and_a_landing_gives_no_motors_back() {
        let landing = after(&[OrderKind::Land]);
        assert_eq!(after(&[OrderKind::Land, OrderKind::Hold]), landing);
        let cut = variant_of(&after(&[OrderKind::CutMotors]));
        assert_eq!(
            variant_of(&after(&[OrderKind::CutMotors, OrderKind::Land])),
            cut
        );
        assert_eq!(
            variant_of(&after(&[OrderKind::Land, OrderKind::CutMotors])),
            cut
        );
    }
}
