//! A node's side of the bus, without the bus: what comes is judged, what goes waits its turn, and whether the node takes
//! part at all is decided here, in virtual time as well as live. It is told the time; it opens, sends and locks nothing.
//!
//! ```text
//!            ┌─ ingress ──────────────────────┐   ┌─ presence ────────────┐
//!   frame ─► │ share ─► codec ─► may say that? │ ─►│ is it listened to?    │ ─► heard
//!            │             └► can that be true? │   │                       │
//!            └──────┬─────────────────────────┘   │ greets, joins, leaves │
//!                   ▼ refused, counted            └──────────┬────────────┘
//!            ┌─ egress ───────────────────────┐              │ greetings; nothing else before it takes part
//!   frame ◄─ │ class, budget, newest of each  │ ◄────────────┴──────────────────────────────────── message
//!            └────────────────────────────────┘
//! ```
//!
//! [`table`] says who may say what to whom. One node is one [`Exchange`]. Two steps are the costly ones, reading a frame
//! ([`ingress::read`]) and writing one ([`OutboundFrame::of`]); both need no state, so that whoever shares an exchange
//! between threads does them without its lock: [`Exchange::hear`] is [`Exchange::admit`], `read` and [`Exchange::accept`],
//! and [`Exchange::say`] is `of` and [`Exchange::offer`].

pub mod egress;
pub mod ingress;
pub mod joining;
pub mod plausibility;
pub mod presence;
pub mod restarts;
pub mod sequences;
pub mod software;
pub mod table;
pub mod token_bucket;

#[cfg(test)]
mod tests;

use tomoswarm_proto::codec::EncodeError;
use tomoswarm_proto::{Hello, Message, Sender};

use self::egress::{Egress, OutboundFrame};
use self::ingress::{FrameRefusal, HeardMessage, Ingress, read};
use self::joining::JoinEffect;
use self::plausibility::Plausibility;
use self::presence::{Presence, PresenceDecision};
use crate::time::Time;

/// A node's side of the bus.
#[derive(Debug)]
pub struct Exchange {
    ingress: Ingress,
    /// `None` = a tool, which hears everything and decides nothing for long.
    plausibility: Option<Plausibility>,
    presence: Presence,
    egress: Egress,
}

/// What comes of a frame that was not refused.
#[derive(Clone, PartialEq, Debug)]
pub struct ReceivedFrame {
    /// What the node is to be told.
    pub heard: Option<HeardMessage>,
    /// What follows for taking part.
    pub verdict: JoinEffect,
    /// Frames to be sent now, one that answers it first.
    pub replies: Vec<OutboundFrame>,
}

/// What an exchange has carried so far.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct ExchangeCounts {
    /// Frames taken.
    pub taken: u64,
    /// Their bytes.
    pub taken_bytes: u64,
    /// Frames refused.
    pub refused: u64,
    /// Frames of kinds that are not known here, dropped.
    pub unknown: u64,
    /// Frames dropped before they were sent, because too much waited.
    pub dropped: u64,
}

impl Exchange {
    /// Makes the exchange of a node that may send so many bytes a second.
    pub fn new(egress_bytes_per_s: u32, presence: Presence) -> Exchange {
        let (ingress, egress) = (
            Ingress::new(egress_bytes_per_s),
            Egress::new(egress_bytes_per_s),
        );
        let plausibility = presence.is_of_node().then(Plausibility::default);
        Exchange {
            ingress,
            plausibility,
            presence,
            egress,
        }
    }

    /// Takes a frame of a sender, as its key or address names it.
    ///
    /// # Errors
    /// The frame is refused, and counted.
    pub fn hear(
        &mut self,
        now: Time,
        sender: Sender,
        frame: &[u8],
    ) -> Result<ReceivedFrame, FrameRefusal> {
        let heard = self
            .admit(now, sender, frame.len())
            .and_then(|()| read(sender, frame));
        let reception = heard.and_then(|heard| self.accept(now, frame.len(), heard));
        reception.inspect_err(|refusal| {
            self.refuse(Some(sender), refusal);
        })
    }

    /// Takes so many bytes of a sender's share; what is refused is counted by [`Exchange::refuse`].
    ///
    /// # Errors
    /// Nothing of its share is left.
    pub fn admit(&mut self, now: Time, sender: Sender, bytes: usize) -> Result<(), FrameRefusal> {
        self.ingress.admit(now, sender, bytes)
    }

    /// Takes what a frame of so many bytes says; what is of an unknown kind is counted, and nothing else comes of it.
    ///
    /// # Errors
    /// What it says is not plausible; to be counted by [`Exchange::refuse`].
    pub fn accept(
        &mut self,
        now: Time,
        bytes: usize,
        heard: HeardMessage,
    ) -> Result<ReceivedFrame, FrameRefusal> {
        if let HeardMessage::Unknown(_) = heard {
            self.ingress.drop_unknown();
            return Ok(ReceivedFrame {
                heard: None,
                verdict: JoinEffect::Fine,
                replies: Vec::new(),
            });
        }
        if let Some(plausibility) = &mut self.plausibility {
            plausibility.judge(now, &heard)?;
        }
        self.ingress.accept(bytes);
        let PresenceDecision {
            heard,
            verdict,
            answer,
        } = self.presence.hear(now, heard);
        let greeting = answer.map(|hello| self.offer_greeting(now, hello));
        Ok(ReceivedFrame {
            heard,
            verdict,
            replies: greeting.unwrap_or_default(),
        })
    }

    /// Counts a refusal; returns how many of its sort there were when that is worth a line.
    pub fn refuse(&mut self, sender: Option<Sender>, refusal: &FrameRefusal) -> Option<u64> {
        self.ingress.refuse(sender, refusal)
    }

    /// Takes a message that the node says: returns the frames that are to be sent now. Otherwise it waits for its turn or for
    /// another one to travel with, or it is dropped, since the node does not take part yet.
    ///
    /// # Errors
    /// The message is too long for a frame.
    pub fn say(&mut self, now: Time, message: &Message) -> Result<Vec<OutboundFrame>, EncodeError> {
        Ok(self.offer(now, OutboundFrame::of(message)?))
    }

    /// Takes a frame as [`Exchange::say`] does.
    pub fn offer(&mut self, now: Time, frame: OutboundFrame) -> Vec<OutboundFrame> {
        if !self.presence.may_say(frame.topic.kind) {
            return Vec::new();
        }
        if let Some(plausibility) = &mut self.plausibility {
            plausibility.know(now, frame.numbers);
        }
        self.egress.offer(now, frame)
    }

    /// Returns whether something newer was offered in the place of a frame that is about to be sent.
    pub fn is_outdated(&self, frame: &OutboundFrame) -> bool {
        self.egress.is_outdated(frame)
    }

    /// Returns all that is to be sent now: a greeting when it is time, and what has waited for its turn.
    pub fn due(&mut self, now: Time) -> Vec<OutboundFrame> {
        let mut due = self.greet(now);
        due.extend(std::iter::from_fn(|| self.egress.due(now)));
        due
    }

    /// Returns when [`Exchange::due`] has something again; `None` when nothing waits and the node does not greet.
    pub fn deadline(&self) -> Option<Time> {
        [self.presence.next(), self.egress.next()]
            .into_iter()
            .flatten()
            .min()
    }

    /// Returns a greeting when it is time, and what goes with it, to be sent now; also ends the asking when nobody has objected.
    pub fn greet(&mut self, now: Time) -> Vec<OutboundFrame> {
        let hello = self.presence.greet(now);
        hello.map_or_else(Vec::new, |hello| self.offer_greeting(now, hello))
    }

    /// Returns when to greet next; `None` = never by itself.
    pub fn greets_at(&self) -> Option<Time> {
        self.presence.next()
    }

    /// Learns that somebody can hear the node.
    pub fn meet(&mut self, now: Time) {
        self.presence.meet(now);
    }

    /// Lets a listener say everything.
    pub fn speak(&mut self) {
        self.presence.speak();
    }

    /// Returns whether the node takes part.
    pub fn is_member(&self) -> bool {
        self.presence.is_member()
    }

    /// Returns what was carried so far.
    pub fn counts(&self) -> ExchangeCounts {
        let (taken, taken_bytes) = self.ingress.taken();
        ExchangeCounts {
            taken,
            taken_bytes,
            refused: self.ingress.refused(),
            unknown: self.ingress.unknown(),
            dropped: self.egress.dropped(),
        }
    }

    /// A greeting always fits into a frame and never waits: it is a few words of the node's own.
    fn offer_greeting(&mut self, now: Time, hello: Hello) -> Vec<OutboundFrame> {
        let frame = OutboundFrame::of(&Message::Hello(hello));
        frame.map_or_else(|_| Vec::new(), |frame| self.offer(now, frame))
    }
}

/// One message of every kind, as the wire's own tests have them.
#[cfg(test)]
#[path = "../proto/tests/examples/mod.rs"]
#[allow(dead_code, reason = "some of them are for the wire's own tests alone")]
pub(crate) mod examples;
