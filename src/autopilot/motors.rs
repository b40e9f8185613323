//! Giving the motors current, and taking it: how far that has come. Which command serves it is the link's matter.
//!
//! ```text
//!   [Unasked] ──Start──► [Arming] ──accepted──► [Accepted] ──shown──► [Armed]
//!                           │ └──── shown ───────────────────────────► [Armed]
//!                           └── refused or not answered three times, or [Accepted] and not shown for 3 s ──► [GivenUp]
//!   any ──Disarm──► [Disarming]      said again whenever telemetry shows current; until a Start
//!   any ──Start───► [Arming]
//!   [Arming] ──Stop──► [Postponed] ──Drive, Turn──► [Arming]      with the tries that are left
//!                           └── accepted late, or shown ──► [Accepted], [Armed]
//!   [Arming], [Postponed], [Accepted] ──somebody else has taken over──► [Unasked]
//! ```
//!
//! An accepted arming is not tried again, and once it was seen armed there is none before the next Start: whoever takes the
//! current away by hand is not overruled. A stop cancels an arming under way: nothing is armed after it before the vehicle
//! wants to move again, which it may by a start only. A disarming is not believed before telemetry shows it.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::command::{Ack, ArmRefusal, CommandAck};
use crate::time::Time;

/// Tries to arm for one start.
pub(super) const ARM_TRIES: u8 = 3;
/// From one try to arm to the next.
pub(super) const ARM_AGAIN: Duration = Duration::from_secs(1);
/// What was accepted shows within this time: a heartbeat comes once a second, and one may be lost.
const SHOWS_WITHIN: Duration = Duration::from_secs(3);
/// A disarming that was accepted is said again after this time, if it does not show: a heartbeat is that late.
const ACCEPTED_AGAIN: Duration = Duration::from_millis(1200);

/// How far arming or disarming has come.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) enum Motors {
    /// Nobody has asked for anything.
    #[default]
    Unasked,
    /// They are to get current.
    Arming(Arming),
    /// They are to get current before the vehicle moves next: it was stopped meanwhile.
    Postponed(Arming),
    /// The autopilot has accepted to arm; telemetry does not show it yet.
    Accepted {
        /// Since when.
        since: Time,
    },
    /// It was seen armed.
    Armed,
    /// It did not arm.
    GivenUp,
    /// They are to have no current.
    Disarming(DisarmTries),
}

/// An arming under way.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct Arming {
    tries: u8,
    /// The number of all tries.
    number: u32,
    /// When it is tried next.
    next_at: Time,
    /// From when on it is believed when it shows: what shows before may be older than a disarming of ours.
    believed_from: Time,
    /// Why the last try was refused, if the autopilot has said so.
    refusal: Option<ArmRefusal>,
}

/// A disarming under way.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) struct DisarmTries {
    /// When it was said last, and by which number.
    sent_at: Option<(Time, u32)>,
    is_accepted: bool,
}

impl Motors {
    /// Takes a start: they are to get current.
    pub(super) fn start(&mut self, now: Time) {
        let believed_from = match self {
            Motors::Disarming(DisarmTries {
                sent_at: Some((sent_at, _)),
                ..
            }) => *sent_at + SHOWS_WITHIN,
            Motors::Unasked
            | Motors::Arming(_)
            | Motors::Postponed(_)
            | Motors::Accepted { .. }
            | Motors::Armed
            | Motors::GivenUp
            | Motors::Disarming(DisarmTries { sent_at: None, .. }) => now,
        };
        *self = Motors::Arming(Arming {
            tries: 0,
            number: 0,
            next_at: now,
            believed_from,
            refusal: None,
        });
    }

    /// They are to have no current; said again it changes nothing.
    pub(super) fn disarm(&mut self) {
        match self {
            Motors::Disarming(_) => {}
            Motors::Unasked
            | Motors::Arming(_)
            | Motors::Postponed(_)
            | Motors::Accepted { .. }
            | Motors::Armed
            | Motors::GivenUp => *self = Motors::Disarming(DisarmTries::default()),
        }
    }

    /// Records that the vehicle is to stand: an arming under way waits.
    pub(super) fn postpone(&mut self) {
        if let Motors::Arming(arming) = *self {
            *self = Motors::Postponed(arming);
        }
    }

    /// Records that the vehicle is to move: an arming that waits goes on.
    pub(super) fn go_on(&mut self) {
        if let Motors::Postponed(arming) = *self {
            *self = Motors::Arming(arming);
        }
    }

    /// Gives an arming up: somebody else has taken over.
    pub(super) fn let_go(&mut self) {
        match self {
            Motors::Arming(_) | Motors::Postponed(_) | Motors::Accepted { .. } => {
                *self = Motors::Unasked
            }
            Motors::Unasked | Motors::Armed | Motors::GivenUp | Motors::Disarming(_) => {}
        }
    }

    /// Takes whether telemetry shows current.
    pub(super) fn take(&mut self, now: Time, is_armed: bool) {
        let is_seen = match self {
            Motors::Arming(arming) | Motors::Postponed(arming) => {
                is_armed && now >= arming.believed_from
            }
            Motors::Accepted { since: _ } => is_armed,
            Motors::Unasked | Motors::Armed | Motors::GivenUp | Motors::Disarming(_) => false,
        };
        if is_seen {
            *self = Motors::Armed;
        }
    }

    /// Takes an answer, if it is one to a try to arm.
    pub(super) fn arm_answered(&mut self, now: Time, ack: &Ack) {
        let (Motors::Arming(arming) | Motors::Postponed(arming)) = self else {
            return;
        };
        if arming.tries == 0 || arming.number != ack.number {
            return;
        }
        match ack.result {
            CommandAck::Accepted => *self = Motors::Accepted { since: now },
            CommandAck::Denied | CommandAck::Unsupported | CommandAck::Failed => {
                arming.refusal = ack.arm_refusal;
            }
        }
    }

    /// Takes an answer to a disarming of this number.
    pub(super) fn disarm_answered(&mut self, number: u32, result: CommandAck) {
        if let Motors::Disarming(disarming) = self
            && disarming
                .sent_at
                .is_some_and(|(_, sent_at)| sent_at == number)
        {
            disarming.is_accepted = result == CommandAck::Accepted;
        }
    }

    /// Takes note of a try to arm; returns its number, which is the `fresh` one if it is the first.
    pub(super) fn tried(&mut self, now: Time, fresh: u32) -> u32 {
        let Motors::Arming(arming) = self else {
            return fresh;
        };
        if arming.tries == 0 {
            arming.number = fresh;
        }
        (arming.tries, arming.next_at) = (arming.tries + 1, now + ARM_AGAIN);
        arming.number
    }

    /// Takes note that a disarming, or what leads to one, is said now, by this number.
    pub(super) fn disarm_said(&mut self, now: Time, number: u32) {
        if let Motors::Disarming(disarming) = self {
            *disarming = DisarmTries {
                sent_at: Some((now, number)),
                is_accepted: false,
            };
        }
    }

    /// Returns when the next step of an arming is due: a try, or to give it up.
    pub(super) fn arm_due(&self) -> Option<Time> {
        match self {
            Motors::Arming(arming) => Some(arming.next_at),
            Motors::Accepted { since } => Some(*since + SHOWS_WITHIN),
            Motors::Unasked
            | Motors::Postponed(_)
            | Motors::Armed
            | Motors::GivenUp
            | Motors::Disarming(_) => None,
        }
    }

    /// Returns whether an arming that is due is given up; the reason may be known.
    pub(super) fn is_given_up(&self, now: Time) -> Option<Option<ArmRefusal>> {
        match self {
            Motors::Arming(arming) => {
                (arming.tries >= ARM_TRIES && arming.next_at <= now).then_some(arming.refusal)
            }
            Motors::Accepted { since } => (*since + SHOWS_WITHIN <= now).then_some(None),
            Motors::Unasked
            | Motors::Postponed(_)
            | Motors::Armed
            | Motors::GivenUp
            | Motors::Disarming(_) => None,
        }
    }

    /// Returns when a disarming is to be said: at once, or again as long as telemetry shows current, which is not known of
    /// one that was not said yet.
    pub(super) fn disarm_due(&self, is_armed: bool, again: Duration) -> Option<Time> {
        match self {
            Motors::Disarming(DisarmTries { sent_at: None, .. }) => Some(Time::ZERO),
            Motors::Disarming(DisarmTries {
                sent_at: Some((sent_at, _)),
                is_accepted,
            }) => {
                let wait = if *is_accepted {
                    again.max(ACCEPTED_AGAIN)
                } else {
                    again
                };
                is_armed.then_some(*sent_at + wait)
            }
            Motors::Unasked
            | Motors::Arming(_)
            | Motors::Postponed(_)
            | Motors::Accepted { .. }
            | Motors::Armed
            | Motors::GivenUp => None,
        }
    }

    /// Returns whether they are to have no current.
    pub(super) fn is_disarming(&self) -> bool {
        matches!(self, Motors::Disarming(_))
    }
}
