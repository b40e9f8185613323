//! The five actors of the ground station, run together on one thread, as the simulator does it.

use tomoswarm_proto::codec::EncodeError;

use super::from_config::GroundParts;
use super::route::{Effect, Event};
use super::station::Station;
use super::{ActorSettings, GroundWiring};
use crate::actor::{ActorStep, Fault, LocalNode, Snapshot};
use crate::stops::StopsSettings;
use crate::time::{Deadline, Time};

/// The ground station's actors, wired.
#[derive(Debug)]
pub struct GroundNode {
    node: LocalNode<GroundWiring>,
}

impl GroundNode {
    /// Makes the actors of a ground station, and wires them.
    pub fn new(parts: GroundParts) -> GroundNode {
        GroundNode {
            node: LocalNode::new(&mut ActorSettings {
                parts,
                resumed: None,
                stops: StopsSettings::default(),
            }),
        }
    }

    /// Starts anew, with what its disk has kept.
    pub fn restart(&mut self, mut source: ActorSettings) {
        let mut before = std::mem::replace(&mut self.node, LocalNode::new(&mut source));
        self.node.go_on_from(&mut before);
    }

    /// Returns the station, for the outcome of a run.
    pub fn station(&self) -> &Station {
        self.node.actors().station.place.actor()
    }

    /// Tells the ground station something, and lets its actors act until all is quiet.
    ///
    /// # Errors
    /// An actor cannot go on.
    pub fn tell(
        &mut self,
        now: Time,
        event: Event,
        effects: &mut Vec<Effect>,
    ) -> Result<(), Fault> {
        self.node.tell(now, event, effects)
    }

    /// Lets all actors act whose deadline has come, until all is quiet.
    ///
    /// # Errors
    /// An actor cannot go on.
    pub fn wake(&mut self, now: Time, effects: &mut Vec<Effect>) -> Result<(), Fault> {
        self.node.wake(now, effects)
    }

    /// Returns the earliest deadline of all actors.
    pub fn deadline(&mut self) -> Option<Deadline> {
        self.node.deadline()
    }

    /// Begins to keep every step of every actor, for [`GroundNode::steps`].
    pub fn watch(&mut self) {
        self.node.watch();
    }

    /// Returns what the actors did since the last call, in order; nothing unless it is watched.
    pub fn steps(&mut self) -> Vec<ActorStep> {
        self.node.steps()
    }

    /// Returns every actor as it is now. Nothing may be unread, as it is between two calls.
    ///
    /// # Errors
    /// One cannot be written, which is a mistake of this program.
    pub fn snapshots(&mut self) -> Result<Vec<Snapshot>, EncodeError> {
        self.node.snapshots()
    }
}
