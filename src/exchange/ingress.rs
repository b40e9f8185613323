//! What comes over the bus, before anyone hears it: whether it is within its sender's share, whether it can be read, and
//! whether its sender may say it. What is refused is counted, and forgotten.
//!
//! [`read`] needs no state: who holds this state under a lock reads frames outside of it. Whether the sender is listened to
//! at all is [`super::presence`]'s.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::codec::{self, DecodeError, Decoded, Greeting, LIMIT};
use tomoswarm_proto::{Hello, Message, Sender};

use super::table::may_say;
use super::token_bucket::TokenBucket;
use crate::time::Time;

/// So many times what a node may send is taken from each of the others, and saved up for so many seconds.
const SHARE: f64 = 4.0;
const SAVED_S: f64 = 4.0;

/// What came over the bus.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum HeardMessage {
    /// A message that its sender may say.
    Message(Sender, Message),
    /// A greeting, of whatever version; with the whole Hello when it is of this one.
    Greeting(Greeting, Option<Hello>),
    /// A message of a kind, by its number, that this version does not know: counted and dropped, and no mistake of its
    /// sender, who may be newer.
    Unknown(u8),
}

/// Why a frame is not heard.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum FrameRefusal {
    /// It came under a key that belongs to no sender.
    #[error("nobody has such a key")]
    NoSender,
    /// Its sender has said too much.
    #[error("its sender says too much")]
    OverShare,
    /// It is not what was sent.
    #[error("its bytes were damaged on the way")]
    Damaged,
    /// It is not a message, or an impossible one, or of a version that is not known here.
    #[error("{reason}")]
    Unreadable {
        /// What the codec found.
        reason: String,
    },
    /// It is a greeting of somebody else.
    #[error("a greeting of {node}")]
    ForeignGreeting {
        /// In whose name.
        node: Sender,
    },
    /// Its sender may not say that, or not under this key.
    #[error("what {sender} may not say")]
    NotItsToSay {
        /// Who said it.
        sender: Sender,
    },
    /// A number that others count on from is too far above all that were heard.
    #[error("{what} {number} is too far above {highest}, the highest heard")]
    Leaps {
        /// What is counted.
        what: &'static str,
        /// The number.
        number: u32,
        /// The highest that is believed.
        highest: u32,
    },
}

impl FrameRefusal {
    /// Returns what was refused, in words under which refusals are counted.
    pub fn what(&self) -> &'static str {
        match self {
            FrameRefusal::NoSender => "a key of no sender",
            FrameRefusal::OverShare => "more than its share of the bus",
            FrameRefusal::Leaps { .. } => "a number far above all others",
            FrameRefusal::Damaged
            | FrameRefusal::Unreadable { .. }
            | FrameRefusal::ForeignGreeting { .. }
            | FrameRefusal::NotItsToSay { .. } => "a frame",
        }
    }

    fn unreadable(error: &DecodeError) -> FrameRefusal {
        FrameRefusal::Unreadable {
            reason: error.to_string(),
        }
    }
}

/// What was taken and refused of what came.
#[derive(Clone, Debug)]
pub struct Ingress {
    per_s: f64,
    shares: BTreeMap<Sender, TokenBucket>,
    /// By sender and what was refused.
    refused_by: BTreeMap<(Option<Sender>, &'static str), u64>,
    taken: u64,
    taken_bytes: u64,
    refused: u64,
    unknown: u64,
}

impl Ingress {
    /// Makes the ingress of a node that may itself send so many bytes a second.
    pub fn new(egress_bytes_per_s: u32) -> Ingress {
        Ingress {
            per_s: SHARE * f64::from(egress_bytes_per_s),
            shares: BTreeMap::new(),
            refused_by: BTreeMap::new(),
            taken: 0,
            taken_bytes: 0,
            refused: 0,
            unknown: 0,
        }
    }

    /// Takes so many bytes of a sender's share.
    ///
    /// # Errors
    /// Nothing of its share is left.
    pub fn admit(&mut self, now: Time, sender: Sender, bytes: usize) -> Result<(), FrameRefusal> {
        let fresh = || TokenBucket::new(self.per_s, SAVED_S * self.per_s);
        let share = self.shares.entry(sender).or_insert_with(fresh);
        if share.spend(now, bytes) {
            Ok(())
        } else {
            Err(FrameRefusal::OverShare)
        }
    }

    /// Counts a frame that is taken.
    pub fn accept(&mut self, bytes: usize) {
        self.taken += 1;
        self.taken_bytes += bytes as u64;
    }

    /// Counts a frame of a kind that is not known here, which is dropped.
    pub fn drop_unknown(&mut self) {
        self.unknown += 1;
    }

    /// Counts a frame that is refused; returns how many of its sort there were when that is worth a line: at every power of
    /// ten.
    pub fn refuse(&mut self, sender: Option<Sender>, refusal: &FrameRefusal) -> Option<u64> {
        self.refused += 1;
        let count = self.refused_by.entry((sender, refusal.what())).or_default();
        *count += 1;
        (10_u64.pow(count.ilog10()) == *count).then_some(*count)
    }

    /// Returns how many frames were taken, and their bytes.
    pub fn taken(&self) -> (u64, u64) {
        (self.taken, self.taken_bytes)
    }

    /// Returns how many frames were refused.
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Returns how many frames were of kinds that are not known here.
    pub fn unknown(&self) -> u64 {
        self.unknown
    }
}

/// Reads a frame of a sender.
///
/// # Errors
/// It is no frame of this version and no greeting of any, or the sender may not say it.
pub fn read(sender: Sender, frame: &[u8]) -> Result<HeardMessage, FrameRefusal> {
    if frame.len() > LIMIT {
        return Err(FrameRefusal::unreadable(&DecodeError::TooLong {
            length: frame.len(),
        }));
    }
    if let Ok(greeting) = codec::greeting(frame) {
        return read_greeting(sender, greeting, frame);
    }
    let message = match codec::decode(frame).map_err(|error| FrameRefusal::unreadable(&error))? {
        Decoded::Message(message) => message,
        Decoded::Unknown(kind) => return Ok(HeardMessage::Unknown(kind)),
    };
    match may_say(sender, &message) {
        true => Ok(HeardMessage::Message(sender, message)),
        false => Err(FrameRefusal::NotItsToSay { sender }),
    }
}

fn read_greeting(
    sender: Sender,
    greeting: Greeting,
    frame: &[u8],
) -> Result<HeardMessage, FrameRefusal> {
    if greeting.node != sender {
        return Err(FrameRefusal::ForeignGreeting {
            node: greeting.node,
        });
    }
    match codec::decode(frame) {
        Ok(Decoded::Message(Message::Hello(hello))) => {
            Ok(HeardMessage::Greeting(greeting, Some(hello)))
        }
        Err(DecodeError::Version { .. }) => Ok(HeardMessage::Greeting(greeting, None)),
        // A greeting has the kind of one in every version.
        Ok(Decoded::Message(_) | Decoded::Unknown(_)) => Err(FrameRefusal::Unreadable {
            reason: "another message that begins as a greeting".to_owned(),
        }),
        Err(error) => Err(FrameRefusal::unreadable(&error)),
    }
}
