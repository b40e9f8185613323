//! What open emergency stops do to the vehicle: it may not move, and is disarmed as soon as it rests, whatever anyone
//! orders. When the last one that concerns it is lifted nothing moves by that: it stands until an operator's start of its
//! own, that answers a state made after the lift. Which stops are open is told; braking is not here.
//!
//! ```text
//!   [Clear] ──a stop is open──► [Stopped] ──all are lifted──► [Lifted] ──an operator's start──► [Clear]
//!                                   ▲───────a stop is open───────┘
//! ```

use serde::{Deserialize, Serialize};
use tomoswarm_proto::EmergencyName;

use super::disarming::DisarmingState;
use super::messages::Telemetry;
use crate::time::Time;

/// Whether emergency stops keep the vehicle where it is.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) enum Emergency {
    /// No stop is open, and a start has come since the last one was lifted.
    #[default]
    Clear,
    /// A stop is open.
    Stopped {
        /// Which; of several the one that State names.
        name: EmergencyName,
        /// How far the disarming has come.
        disarming: DisarmingState,
    },
    /// No stop is open any more; it stands.
    Lifted,
}

impl Emergency {
    /// Records which open stop the vehicle stands under; returns whether it must brake now.
    pub(super) fn take(&mut self, now: Time, open: Option<EmergencyName>) -> bool {
        let (next, brakes) = match (*self, open) {
            (Emergency::Clear, None) => (Emergency::Clear, false),
            (Emergency::Stopped { .. } | Emergency::Lifted, None) => (Emergency::Lifted, false),
            (Emergency::Clear | Emergency::Lifted, Some(name)) => (
                Emergency::Stopped {
                    name,
                    disarming: DisarmingState::at_rest(now),
                },
                true,
            ),
            (Emergency::Stopped { name: _, disarming }, Some(name)) => {
                (Emergency::Stopped { name, disarming }, false)
            }
        };
        *self = next;
        brakes
    }

    /// Takes a start that is obeyed.
    pub(super) fn start(&mut self) {
        if *self == Emergency::Lifted {
            *self = Emergency::Clear;
        }
    }

    /// Returns whether a start may be obeyed; `is_of_operator` when an operator gave it.
    pub(super) fn lets_start(&self, is_of_operator: bool) -> bool {
        match self {
            Emergency::Clear => true,
            Emergency::Stopped { .. } => false,
            Emergency::Lifted => is_of_operator,
        }
    }

    /// Returns the open stop that the vehicle stands under.
    pub(super) fn stop(&self) -> Option<EmergencyName> {
        match self {
            Emergency::Stopped { name, .. } => Some(*name),
            Emergency::Clear | Emergency::Lifted => None,
        }
    }

    /// Returns whether the vehicle stands because of a stop, open or lifted.
    pub(super) fn stands(&self) -> bool {
        *self != Emergency::Clear
    }

    /// Takes what telemetry shows; returns whether the autopilot is to be told to disarm.
    pub(super) fn disarms(&mut self, now: Time, telemetry: &Telemetry) -> bool {
        match self {
            Emergency::Stopped { disarming, .. } => disarming.take(now, telemetry),
            Emergency::Clear | Emergency::Lifted => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::tests_support::{drawn, variant_of, variants};

    const NAME: EmergencyName = EmergencyName(0x1_0000);

    #[test]
    fn every_word_leads_from_every_state_where_the_drawing_says() {
        let stopped = Emergency::Stopped {
            name: NAME,
            disarming: DisarmingState::at_rest(Time::ZERO),
        };
        for (from, open, start, clear) in [
            (Emergency::Clear, "Stopped", "Clear", "Clear"),
            (stopped, "Stopped", "Stopped", "Lifted"),
            (Emergency::Lifted, "Stopped", "Clear", "Lifted"),
        ] {
            let after = |tell: &dyn Fn(&mut Emergency)| {
                let mut emergency = from;
                tell(&mut emergency);
                variant_of(&emergency)
            };
            assert_eq!(
                after(&|it| assert!(it.take(Time::ZERO, Some(NAME)) || it.stop().is_some())),
                open,
                "from {from:?}"
            );
            assert_eq!(
                after(&|it| assert!(!it.take(Time::ZERO, None))),
                clear,
                "from {from:?}"
            );
            assert_eq!(after(&|it| it.start()), start, "from {from:?}");
        }
        assert_eq!(drawn(include_str!("emergency.rs")), variants::<Emergency>());
    }

    #[test]
    fn it_brakes_once_and_only_an_operators_start_ends_a_lifted_stop() {
        let mut emergency = Emergency::default();
        assert!(emergency.take(Time::ZERO, Some(NAME)) && !emergency.take(Time::ZERO, Some(NAME)));
        assert!(!emergency.lets_start(true) && !emergency.lets_start(false));
        emergency.take(Time::ZERO, None);
        assert!(emergency.lets_start(true) && !emergency.lets_start(false));
        assert!(emergency.take(Time::ZERO, Some(NAME)), "another one");
    }
}
