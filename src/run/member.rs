//! A node of the swarm on the bus: it asks whether it may take part, greets, and is told of what it may hear. The rules
//! are [`crate::exchange::presence`]'s; this is the shell that gives them threads and says aloud what they decide.

use std::sync::Mutex;

use tomoswarm_proto::{Hello, Message, Sender};

use super::bus::{BusError, BusSession, BusSettings, HeardMessage, Publisher};
use super::mailbox::{Ending, RuntimeContext, lock};
use super::reach::ReachWatch;
use super::trust::AccessRule;
use crate::exchange::joining::JoinEffect;
use crate::exchange::presence::Presence;
use crate::time::Time;

/// A node on the bus.
pub struct BusMember {
    bus: BusSession,
    is_speaking: bool,
    reach: ReachWatch,
}

impl BusMember {
    /// Goes on the bus and begins to ask; `hear` gets every message of nodes that fit.
    ///
    /// # Errors
    /// The bus cannot be opened.
    pub fn open(
        settings: BusSettings,
        own: Hello,
        context: &RuntimeContext,
        hear: impl Fn(Sender, Message) + Send + Sync + 'static,
    ) -> Result<BusMember, BusError> {
        let endings = Mutex::new(context.endings.clone());
        let presence = Presence::asking(context.clock.now(), own);
        let reach = ReachWatch::new(context.clock.now(), &settings);
        let take = move |heard: Option<HeardMessage>, verdict| {
            if let Some(HeardMessage::Message(sender, message)) = heard {
                hear(sender, message);
            }
            match verdict {
                JoinEffect::Fine => {}
                JoinEffect::Foreign(reason) | JoinEffect::Stays(reason) => {
                    tracing::warn!("{reason}")
                }
                JoinEffect::Refused(reason) => {
                    lock(&endings)
                        .send(Ending::Refused(reason))
                        .unwrap_or_default();
                }
            }
        };
        let bus = BusSession::join(
            settings,
            presence,
            context.clock,
            context.troubles.clone(),
            take,
        )?;
        Ok(BusMember {
            bus,
            is_speaking: false,
            reach,
        })
    }

    /// Returns the handle by which messages are published.
    pub fn publisher(&self) -> Publisher {
        self.bus.publisher()
    }

    /// Greets when it is time; returns when to be called again. Once nobody has objected the node may speak; that it takes part
    /// is logged when there is somebody who can hear it.
    pub fn greet(&mut self, now: Time) -> Time {
        let publisher = self.bus.publisher();
        let is_linked = !(self.is_speaking && self.reach.is_reached()) && publisher.links() > 0;
        let next = publisher.greet(now, is_linked && !self.is_speaking);
        self.is_speaking |= publisher.is_member();
        if self.is_speaking && !self.reach.is_reached() {
            // In a star the hub is told of no links.
            let is_reached = is_linked || publisher.traffic().taken > 0;
            if self.reach.look(now, is_reached) {
                tracing::info!("takes part in the bus");
            }
        }
        next.unwrap_or(Time::NEVER)
    }

    /// From now on others may write what a newer roster says.
    pub fn allow(&self, access: Vec<AccessRule>) {
        self.bus.allow(access);
    }

    /// Returns whether the node takes part.
    pub fn is_member(&self) -> bool {
        self.is_speaking
    }

    /// Leaves the bus.
    pub fn close(self) {
        self.bus.close();
    }
}
