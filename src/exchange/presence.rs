//! Whether a node takes part in the bus: who of the others is heard, what may be said, and when it greets. The rules of
//! joining are [`Joining`]'s; an operator's tool, which joins nothing, listens to everyone.

use std::collections::BTreeSet;

use tomoswarm_proto::codec::VERSION;
use tomoswarm_proto::{Hello, Message, MessageKind, OpenStops, Sender};

use super::ingress::HeardMessage;
use super::joining::{JoinEffect, Joining};
use crate::time::Time;

/// How a node is present.
#[derive(Debug)]
pub enum Presence {
    /// It asks whether it may take part, greets, and listens to those that fit.
    Node(Box<Joining>),
    /// It listens to everyone and everything, greetings of any version among them.
    Listener {
        /// Whether it may say anything but greetings.
        may_speak: bool,
        /// The hash of its venue file; `None` = it has none, and takes every venue for its own.
        venue_hash: Option<u64>,
        /// Who greeted last with another venue file, or in another version: nobody has lifted a stop because they say so.
        strangers: BTreeSet<Sender>,
    },
}

/// What is to be done about what was heard.
#[derive(Clone, PartialEq, Debug)]
pub struct PresenceDecision {
    /// What the node is to be told; of a node's greetings only the message, and only of those that fit.
    pub heard: Option<HeardMessage>,
    /// What follows for taking part.
    pub verdict: JoinEffect,
    /// What the node answers at once.
    pub answer: Option<Hello>,
}

impl Presence {
    /// Begins to ask whether a node may take part.
    pub fn asking(now: Time, own: Hello) -> Presence {
        Presence::Node(Box::new(Joining::new(now, own)))
    }

    /// Makes the presence of a tool that listens and says nothing yet.
    pub fn listening() -> Presence {
        Presence::listener(None)
    }

    /// Makes that of a tool with a venue file, by its hash: it hears everyone, but that a stop is lifted from its own alone.
    pub fn listening_at(venue_hash: u64) -> Presence {
        Presence::listener(Some(venue_hash))
    }

    fn listener(venue_hash: Option<u64>) -> Presence {
        Presence::Listener {
            may_speak: false,
            venue_hash,
            strangers: BTreeSet::new(),
        }
    }

    /// Returns whether it is that of a node; a tool listens only.
    pub fn is_of_node(&self) -> bool {
        match self {
            Presence::Node(_) => true,
            Presence::Listener { .. } => false,
        }
    }

    /// Judges what was heard.
    pub fn hear(&mut self, now: Time, heard: HeardMessage) -> PresenceDecision {
        let fine = |heard| PresenceDecision {
            heard,
            verdict: JoinEffect::Fine,
            answer: None,
        };
        let joining = match self {
            Presence::Node(joining) => joining,
            Presence::Listener {
                venue_hash,
                strangers,
                ..
            } => return fine(heard_by_tool(*venue_hash, strangers, heard)),
        };
        match heard {
            HeardMessage::Message(sender, message) => {
                let heard = if joining.listens_to(sender) {
                    Some(message)
                } else {
                    of_stranger(message)
                };
                fine(heard.map(|message| HeardMessage::Message(sender, message)))
            }
            HeardMessage::Unknown(_) => fine(None),
            HeardMessage::Greeting(greeting, hello) => {
                let verdict = joining.hear(now, &greeting, hello.as_ref());
                let fits = verdict == JoinEffect::Fine;
                let hello = hello.filter(|hello| fits && joining.listens_to(hello.node));
                let heard =
                    hello.map(|hello| HeardMessage::Message(hello.node, Message::Hello(hello)));
                // Whoever asks and does not fit learns it at once.
                PresenceDecision {
                    heard,
                    verdict,
                    answer: joining.greet_if_due(now),
                }
            }
        }
    }

    /// Learns that somebody can hear the node.
    pub fn meet(&mut self, now: Time) {
        match self {
            Presence::Node(joining) => joining.meet(now),
            Presence::Listener { .. } => {}
        }
    }

    /// Returns a greeting when one is due; also ends the asking when nobody has objected.
    pub fn greet(&mut self, now: Time) -> Option<Hello> {
        match self {
            Presence::Node(joining) => joining.greet(now),
            Presence::Listener { .. } => None,
        }
    }

    /// Returns when to greet next; `None` = never by itself.
    pub fn next(&self) -> Option<Time> {
        match self {
            Presence::Node(joining) => Some(joining.next()),
            Presence::Listener { .. } => None,
        }
    }

    /// Lets a listener say everything; a node may when it takes part.
    pub fn speak(&mut self) {
        match self {
            Presence::Node(_) => {}
            Presence::Listener { may_speak, .. } => *may_speak = true,
        }
    }

    /// Returns whether the node takes part, or the listener speaks.
    pub fn is_member(&self) -> bool {
        match self {
            Presence::Node(joining) => joining.is_member(),
            Presence::Listener { may_speak, .. } => *may_speak,
        }
    }

    /// Returns whether messages of a kind may be said: greetings, and which emergency stops are open, always are.
    pub fn may_say(&self, kind: MessageKind) -> bool {
        matches!(kind, MessageKind::Hello | MessageKind::Standing) || self.is_member()
    }
}

/// Returns what a tool with a venue file hears, and notes who is a stranger to it.
fn heard_by_tool(
    venue_hash: Option<u64>,
    strangers: &mut BTreeSet<Sender>,
    heard: HeardMessage,
) -> Option<HeardMessage> {
    match heard {
        HeardMessage::Greeting(greeting, _) => {
            let is_ours = venue_hash.is_none_or(|own| own == greeting.venue_hash);
            match is_ours && greeting.version == VERSION {
                true => strangers.remove(&greeting.node),
                false => strangers.insert(greeting.node),
            };
            Some(heard)
        }
        HeardMessage::Message(sender, message @ Message::Standing(_))
            if strangers.contains(&sender) =>
        {
            of_stranger(message).map(|message| HeardMessage::Message(sender, message))
        }
        HeardMessage::Message(..) | HeardMessage::Unknown(_) => Some(heard),
    }
}

/// Returns what is heard of a message of somebody who does not fit. Emergency stops must not depend on venue files:
/// open ones are heard, lifted ones are not.
fn of_stranger(message: Message) -> Option<Message> {
    match message {
        Message::Standing(OpenStops { open, lifted: _ }) => {
            // Who says that none is open says nothing, not even that somebody of the swarm is there.
            (!open.is_empty()).then_some(Message::Standing(OpenStops {
                open,
                lifted: Vec::new(),
            }))
        }
        Message::Hello(_)
        | Message::State(_)
        | Message::Tile(_)
        | Message::Digest(_)
        | Message::Want(_)
        | Message::Plan(_)
        | Message::Mission(_)
        | Message::Order(_)
        | Message::Samples(_)
        | Message::Have(_)
        | Message::Beacon(_)
        | Message::Health(_)
        | Message::Report(_)
        | Message::Task(_)
        | Message::Image(_)
        | Message::Fix(_)
        | Message::Mark(_)
        | Message::Look(_)
        | Message::Log(_)
        | Message::Settings(_) => None,
    }
}
