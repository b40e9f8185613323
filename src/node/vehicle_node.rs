//! The nine actors of a vehicle with their inboxes, run together on one thread.
//!
//! This is how the simulator runs a vehicle. A live node runs the same actors on several threads: [`super`] says
//! which there are and [`super::route`] what goes where, in both.

use tomoswarm_proto::codec::EncodeError;
use tomoswarm_proto::{Boot, RunId, VehicleId};

use super::mission::Mission;
use super::radio::Radio;
use super::route::{Effect, Event};
use super::{VehicleSettings, VehicleWiring};
use crate::actor::{ActorStep, Fault, LocalNode, Snapshot};
use crate::map::Merged;
use crate::time::{Deadline, Time};

/// A vehicle's actors, wired.
#[derive(Debug)]
pub struct VehicleNode {
    id: VehicleId,
    boot: Boot,
    node: LocalNode<VehicleWiring>,
    /// What earlier starts have measured, for [`VehicleNode::samples_made`].
    radios: Vec<Radio>,
}

impl VehicleNode {
    /// Makes a vehicle that has not heard anything yet.
    pub fn new(settings: &VehicleSettings) -> VehicleNode {
        VehicleNode {
            id: settings.vehicle,
            boot: settings.boot,
            node: LocalNode::new(&mut settings.clone()),
            radios: Vec::new(),
        }
    }

    /// Starts anew, with settings of a higher boot; what was measured is kept at the edge.
    pub fn restart(&mut self, settings: &VehicleSettings) {
        let mut before = std::mem::replace(self, VehicleNode::new(settings));
        self.node.go_on_from(&mut before.node);
        before.radios.push(before.radio().clone());
        self.radios = before.radios;
    }

    /// Returns the vehicle's id.
    pub fn id(&self) -> VehicleId {
        self.id
    }

    /// Returns what the mission is doing, for status lines and tests.
    pub fn mission(&self) -> &Mission {
        self.node.actors().mission.place.actor()
    }

    /// Returns the boot of the vehicle's software.
    pub fn boot(&self) -> Boot {
        self.boot
    }

    /// Returns the map that the vehicle holds: its own layer and its peers'.
    pub fn map(&self) -> &Merged {
        self.node.actors().map.place.actor().merged()
    }

    /// Returns the map as the mission knows it, with the parts of cells that the vehicle has seen empty.
    #[cfg(test)]
    pub(crate) fn known_ground(&self) -> &Merged {
        self.mission().known_ground()
    }

    /// Returns how many samples of a run its radio has made, over all starts.
    pub fn samples_made(&self, run: RunId) -> u64 {
        let made = self
            .radios
            .iter()
            .chain([self.radio()])
            .map(|radio| radio.samples_made(run));
        made.sum()
    }

    fn radio(&self) -> &Radio {
        self.node.actors().radio.place.actor()
    }

    /// Returns how many inputs its actors have dropped unread, because they were too slow.
    pub fn dropped(&mut self) -> u64 {
        self.node.dropped()
    }

    /// Tells the vehicle something, and lets its actors act until all is quiet.
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

    /// Begins to keep every step of every actor, for [`VehicleNode::steps`].
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
