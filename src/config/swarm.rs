//! The swarm's contract: what all its nodes must agree on besides the place. It stands in the venue's file, table
//! `[swarm]`, and is part of the venue's hash. A simulation's file may give the same keys in its own tables, laid over
//! its venue; the files of nodes may not.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::keys::{Keyed, Keys, Number, NumberBounds, Only, Whole};
use super::source::Source;
use crate::time::Time;

/// What all nodes of a swarm agree on.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Swarm {
    /// Smallest distance between two vehicles, middle to middle, metres.
    pub separation_m: f64,
    /// Smallest distance in height between two copters, one above the other, metres.
    pub separation_up_m: f64,
    /// How long a vehicle carries on when it hears nobody on the bus, seconds; then it returns.
    pub autonomy_s: f64,
    /// Slot T of the beacon ring, milliseconds.
    pub slot_ms: f64,
    /// What the direct successor of a vehicle that was heard waits instead of a slot, milliseconds; `None` = a slot.
    #[serde(default)]
    pub successor_ms: Option<f64>,
    /// Channel number of the radio.
    pub channel: usize,
    /// Above this deviation of the place nothing is driven, measured or mapped, metres.
    pub pose_sd_max_m: f64,
    /// After this much silence the stops of a vehicle go to the others, seconds.
    pub lost_after_s: f64,
}

/// The keys that a simulation may give in `[safety]`.
const MARGINS: [&str; 4] = [
    "separation_m",
    "separation_up_m",
    "autonomy_s",
    "pose_sd_max_m",
];
/// A key that a simulation may give in `[radio]`.
const SLOT: &str = "slot_ms";
/// As [`SLOT`].
const SUCCESSOR: &str = "successor_ms";
/// As [`SLOT`].
const CHANNEL: &str = "channel";
/// Where they belong.
const PLACE: &str = "the venue file, table [swarm]";

impl Swarm {
    /// What the nodes agreed on before the venue said so. A venue of these values has the hash of one that says nothing;
    /// this never changes, whatever the defaults become.
    const UNSAID: Swarm = Swarm {
        separation_m: 1.0,
        separation_up_m: 2.0,
        autonomy_s: 60.0,
        slot_ms: 50.0,
        successor_ms: None,
        channel: 15,
        pose_sd_max_m: 0.5,
        lost_after_s: 30.0,
    };

    /// Returns how long a vehicle carries on when it hears nobody on the bus.
    pub fn autonomy(&self) -> Duration {
        Time::from_secs_f64(self.autonomy_s).since(Time::ZERO)
    }

    /// Returns the slot T of the beacon ring.
    pub fn slot(&self) -> Duration {
        Time::from_secs_f64(self.slot_ms * 1e-3).since(Time::ZERO)
    }

    /// Returns what the direct successor of a vehicle that was heard waits; `None` = a slot.
    pub fn successor(&self) -> Option<Duration> {
        let wait_ms = self.successor_ms?;
        Some(Time::from_secs_f64(wait_ms * 1e-3).since(Time::ZERO))
    }

    /// Returns the silence after which the stops of a vehicle go to the others.
    pub fn lost_after(&self) -> Duration {
        Time::from_secs_f64(self.lost_after_s).since(Time::ZERO)
    }

    /// Returns the channel number of the radio.
    pub fn channel(&self) -> u8 {
        u8::try_from(self.channel).unwrap_or(u8::MAX)
    }

    /// Returns what is part of the venue's hash: nothing when it is what was agreed on before the venue said so, so that
    /// stores and rosters of such a venue stay valid.
    pub(super) fn hashed(&self) -> Option<Vec<f64>> {
        let Swarm {
            separation_m,
            separation_up_m,
            autonomy_s,
            slot_ms,
            successor_ms,
            channel,
            pose_sd_max_m,
            lost_after_s,
        } = *self;
        let successor_ms = successor_ms.filter(|wait_ms| *wait_ms != slot_ms);
        let mut numbers = vec![
            separation_m,
            separation_up_m,
            autonomy_s,
            slot_ms,
            channel as f64,
            pose_sd_max_m,
            lost_after_s,
        ];
        numbers.extend(successor_ms);
        let said = Swarm {
            successor_ms,
            ..*self
        };
        (said != Swarm::UNSAID).then_some(numbers)
    }

    /// Checks the numbers together; they stand in this table, or some of them do.
    pub(super) fn check(&self, source: &Source<'_>, table: &str) {
        let slot_ms = self.slot_ms;
        let Some(wait_ms) = self.successor_ms.filter(|wait_ms| *wait_ms > slot_ms) else {
            return;
        };
        let given = [SUCCESSOR, SLOT].map(|name| format!("{table}.{name}"));
        let Some(key) = given.iter().find(|key| source.is_known(key)) else {
            return;
        };
        let wrong = format!("a successor waits {wait_ms} ms, longer than a slot of {slot_ms} ms");
        source.refuse(key, &wrong, "successor_ms may be at most slot_ms");
    }

    /// Shows the keys that a simulation may give in `[safety]`, with the venue's values as defaults.
    pub(super) fn margins(&mut self, to: &mut dyn Keys) {
        self.keys(&mut Only {
            names: &MARGINS,
            to,
        });
    }

    /// Shows slot and successor's wait, which a simulation may give in `[radio]`, with the venue's values as defaults.
    pub(super) fn slot_keys(&mut self, to: &mut dyn Keys) {
        self.keys(&mut Only {
            names: &[SLOT, SUCCESSOR],
            to,
        });
    }

    /// Shows the channel in the same way.
    pub(super) fn channel_key(&mut self, to: &mut dyn Keys) {
        self.keys(&mut Only {
            names: &[CHANNEL],
            to,
        });
    }

    /// Says that the keys of `[safety]` are not for the file of a node.
    pub(super) fn moved_margins(to: &mut dyn Keys) {
        MARGINS.iter().for_each(|name| to.moved(name, PLACE));
    }

    /// Says that the keys of `[radio]` are not for the file of a node.
    pub(super) fn moved_air(to: &mut dyn Keys) {
        [SLOT, SUCCESSOR, CHANNEL]
            .iter()
            .for_each(|name| to.moved(name, PLACE));
    }

    /// Says that the ground station's time is not for its file.
    pub(super) fn moved_silence(to: &mut dyn Keys) {
        to.moved("lost_after_s", PLACE);
    }
}

impl Default for Swarm {
    /// Returns the contract of a venue that says nothing of it.
    fn default() -> Swarm {
        Swarm::UNSAID
    }
}

impl Keyed for Swarm {
    fn keys(&mut self, to: &mut dyn Keys) {
        let Swarm {
            separation_m,
            separation_up_m,
            autonomy_s,
            slot_ms,
            successor_ms,
            channel,
            pose_sd_max_m,
            lost_after_s,
        } = self;
        to.number(
            separation_m,
            Number {
                name: "separation_m",
                default: 1.0,
                allowed: 0.1..=20.0,
                means: "smallest distance between two vehicles, middle to middle, by the places that they believe to be at",
            },
        );
        to.number(
            separation_up_m,
            Number {
                name: "separation_up_m",
                default: 2.0,
                allowed: 0.1..=100.0,
                means: "smallest distance in height between two copters, one above the other; no effect yet but in \
                        the venue's hash",
            },
        );
        to.number(
            autonomy_s,
            Number {
                name: "autonomy_s",
                default: 60.0,
                allowed: 3.0..=86_400.0,
                means: "a vehicle that hears nobody on the bus for so long returns",
            },
        );
        to.number(
            slot_ms,
            Number {
                name: SLOT,
                default: 50.0,
                allowed: 1.0..=5000.0,
                means: "slot of the beacon ring",
            },
        );
        to.maybe_number(
            successor_ms,
            NumberBounds {
                name: SUCCESSOR,
                left_out: "slot_ms",
                allowed: 1.0..=5000.0,
                means: "after a vehicle that was heard the next one of the ring waits so long instead of a slot; at most \
                        slot_ms. 3 suits XBees",
            },
        );
        to.whole(
            channel,
            Whole {
                name: CHANNEL,
                default: 15,
                allowed: 11..=26,
                means: "channel of the radio",
            },
        );
        to.number(
            pose_sd_max_m,
            Number {
                name: "pose_sd_max_m",
                default: 0.5,
                allowed: 0.01..=10.0,
                means: "above this deviation of the place nothing is driven, measured or mapped",
            },
        );
        to.number(
            lost_after_s,
            Number {
                name: "lost_after_s",
                default: 30.0,
                allowed: 1.1..=3600.0,
                means: "after this much silence the stops of a vehicle go to the others",
            },
        );
    }
}
