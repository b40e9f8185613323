//! A simulated vehicle: its node, what its process was told, its disk, and whether its software runs. Its body and its
//! devices are the environment's, its side of the bus is the network's.

use tomoswarm_proto::{Boot, VehicleId};

use super::Alarm;
use crate::actor::Fault;
use crate::node::{self, VehicleNode};
use crate::sim::disk::Disk;
use crate::sim::operator_script::RUN;
use crate::time::Time;

/// A vehicle in the simulation.
pub(in crate::sim) struct SimulatedVehicle {
    node: VehicleNode,
    /// What it was told, to be told again when it restarts.
    settings: node::VehicleSettings,
    disk: Disk,
    alarm: Alarm,
    /// Its software does not run.
    is_dead: bool,
    /// It was started anew and nobody has noticed yet.
    has_restarted: bool,
}

impl SimulatedVehicle {
    /// Starts the software of a vehicle with an empty disk.
    pub(crate) fn new(settings: node::VehicleSettings) -> SimulatedVehicle {
        SimulatedVehicle {
            node: VehicleNode::new(&settings),
            settings,
            disk: Disk::default(),
            alarm: Alarm::default(),
            is_dead: false,
            has_restarted: false,
        }
    }

    /// Returns which vehicle it is.
    pub(crate) fn id(&self) -> VehicleId {
        self.node.id()
    }

    /// Returns its node.
    pub(crate) fn node(&self) -> &VehicleNode {
        &self.node
    }

    /// Returns its node, to be watched.
    pub(crate) fn node_mut(&mut self) -> &mut VehicleNode {
        &mut self.node
    }

    /// Returns what its disk holds of orders and plans.
    #[cfg(test)]
    pub fn memory(&self) -> node::VehicleMemory {
        self.disk.memory()
    }

    /// Returns whether its software does not run.
    pub(crate) fn is_dead(&self) -> bool {
        self.is_dead
    }

    pub(super) fn alarm_mut(&mut self) -> &mut Alarm {
        &mut self.alarm
    }

    pub(super) fn alarm_and_deadline(&mut self) -> (&mut Alarm, Option<Time>) {
        let deadline = self.node.deadline();
        (&mut self.alarm, deadline.map(|deadline| deadline.at))
    }

    /// Tells its node something.
    ///
    /// # Errors
    /// An actor cannot go on.
    pub(crate) fn tell(
        &mut self,
        now: Time,
        event: node::Event,
        effects: &mut Vec<node::Effect>,
    ) -> Result<(), Fault> {
        self.node.tell(now, event, effects)
    }

    /// Lets its node do what is due.
    ///
    /// # Errors
    /// An actor cannot go on.
    pub(crate) fn wake(&mut self, now: Time, effects: &mut Vec<node::Effect>) -> Result<(), Fault> {
        self.node.wake(now, effects)
    }

    /// Lets its disk do what it is asked for; returns what that answers. Other effects are not for it.
    pub(crate) fn store(&mut self, effect: node::Effect) -> Option<node::Event> {
        match effect {
            node::Effect::Keep(run, sample) => {
                let boot = self.node.boot();
                self.disk.keep(boot, run, sample);
                Some(node::Event::SampleStored(boot, run, sample))
            }
            node::Effect::Recall { after } => Some(node::Event::Recalled(self.disk.recall(after))),
            node::Effect::Remember(memory) => {
                Some(node::Event::Remembered(self.disk.remember(memory)))
            }
            node::Effect::Forget { boot, run, below } => {
                self.disk.forget(boot, run, below);
                None
            }
            node::Effect::KeepStops(standing) => {
                self.disk.keep_stops(standing);
                None
            }
            node::Effect::Command(_)
            | node::Effect::Fix(..)
            | node::Effect::Steer(_)
            | node::Effect::Ping(_)
            | node::Effect::Transmit(_)
            | node::Effect::Publish(_)
            | node::Effect::VehicleEvent(_) => None,
        }
    }

    /// Ends its software.
    pub(crate) fn end(&mut self) {
        self.is_dead = true;
        self.alarm.cancel();
    }

    /// Starts its software anew, with what its disk holds; returns the count of its starts.
    pub(crate) fn restart(&mut self) -> Boot {
        let boot = Boot(self.settings.boot.0.saturating_add(1));
        self.settings.boot = boot;
        self.settings.memory = self.disk.memory();
        self.settings.stops = self.disk.stops();
        self.node.restart(&self.settings);
        (self.is_dead, self.has_restarted) = (false, true);
        boot
    }

    /// Returns whether it was started anew since the last call.
    pub(crate) fn take_has_restarted(&mut self) -> bool {
        std::mem::take(&mut self.has_restarted)
    }

    /// Returns a line about what it holds: its map, its samples, and what it waits for.
    pub(crate) fn holdings(&mut self) -> String {
        let map = super::map_hash(&self.node.map().digest());
        let (samples, dropped) = (self.node.samples_made(RUN), self.node.dropped());
        let waits = self.node.mission().waits_for();
        let waits = waits.map_or("drives on".to_owned(), |waits| waits.to_string());
        format!("holds map {map:016x}, made {samples} samples, dropped {dropped} inputs, {waits}")
    }
}
