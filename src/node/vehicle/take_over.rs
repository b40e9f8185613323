//! Whether somebody else has begun something with the vehicle: a person by remote control, or the autopilot by itself. It
//! ends as an emergency stop does: by an operator's start that names it, and nothing else. What shows a take-over is the
//! link's matter (`autopilot/steering.rs`).
//!
//! ```text
//!   [NotTaken] ──Remote──► [ByRemote] ──an operator's start that names it──► [NotTaken]
//!   [NotTaken] ──Own─────► [ByItself] ──the same──► [NotTaken]
//!   [ByItself] ──Remote──► [ByRemote]
//! ```
//!
//! The link reports `Ours` again only after it was told to take it back; older reports on their way have then
//! arrived. A silent autopilot ends nothing: what was begun before the silence is still so. The name is that of the
//! vehicle and the
//! start of its software ([`EmergencyName::of_take_over`]); which of several take-overs is meant follows from the
//! state that the start answers: one made after it began.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Boot, Control, EmergencyName, Order, Sender, StandReason, VehicleId};

/// Whether somebody else has begun something with the vehicle.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub(super) enum TakeOver {
    /// Nobody, since the last start that named it.
    #[default]
    NotTaken,
    /// A person by remote control.
    ByRemote,
    /// The autopilot by itself.
    ByItself,
}

impl TakeOver {
    /// Records who steers; returns whether somebody has just taken over.
    pub(super) fn take(&mut self, control: Control) -> bool {
        let before = *self;
        match (before, control) {
            (TakeOver::NotTaken | TakeOver::ByItself, Control::Remote) => {
                *self = TakeOver::ByRemote
            }
            (TakeOver::NotTaken, Control::Own) => *self = TakeOver::ByItself,
            (_, Control::Ours) => *self = TakeOver::NotTaken,
            (TakeOver::ByRemote | TakeOver::ByItself, Control::Own)
            | (TakeOver::ByRemote, Control::Remote)
            | (_, Control::Silent) => {}
        }
        *self != before && self.stands()
    }

    /// Takes a start that is obeyed; returns whether it ends a take-over.
    pub(super) fn end(&mut self) -> bool {
        std::mem::take(self) != TakeOver::NotTaken
    }

    /// Returns whether a start may be obeyed.
    pub(super) fn lets_start(
        self,
        sender: Sender,
        order: &Order,
        vehicle: VehicleId,
        boot: Boot,
    ) -> bool {
        let names_it = order
            .ends
            .contains(&EmergencyName::of_take_over(vehicle, boot));
        !self.stands() || names_it && matches!(sender, Sender::Operator(_))
    }

    /// Returns whether somebody has taken over.
    pub(super) fn stands(self) -> bool {
        self != TakeOver::NotTaken
    }

    /// Returns why the vehicle stands by it.
    pub(super) fn reason(self) -> Option<StandReason> {
        match self {
            TakeOver::NotTaken => None,
            TakeOver::ByRemote => Some(StandReason::Remote),
            TakeOver::ByItself => Some(StandReason::Autopilot),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::tests_support::{drawn, variants};
    use TakeOver::{ByItself, ByRemote, NotTaken};

    #[test]
    fn who_steers_leads_where_the_drawing_says_and_silence_nowhere() {
        let controls = [
            Control::Ours,
            Control::Remote,
            Control::Own,
            Control::Silent,
        ];
        for (from, to) in [
            (NotTaken, [NotTaken, ByRemote, ByItself, NotTaken]),
            (ByRemote, [NotTaken, ByRemote, ByRemote, ByRemote]),
            (ByItself, [NotTaken, ByRemote, ByItself, ByItself]),
        ] {
            for (control, to) in controls.into_iter().zip(to) {
                let mut take_over = from;
                let is_new = from != to && to != NotTaken;
                assert_eq!(
                    (take_over.take(control), take_over),
                    (is_new, to),
                    "{from:?} by {control:?}"
                );
            }
            let mut take_over = from;
            assert_eq!((take_over.end(), take_over), (from != NotTaken, NotTaken));
        }
        assert_eq!(drawn(include_str!("take_over.rs")), variants::<TakeOver>());
    }
}
