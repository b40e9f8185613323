//! The simulated ground station: its node, what its process was told, and its disk. Its side of the bus is the network's.

use tomoswarm_proto::{Boot, OpenStops};

use super::Alarm;
use crate::actor::Fault;
use crate::ground::from_config::GroundParts;
use crate::ground::station::{StationMemory, StationSettings};
use crate::ground::{self, GroundNode, MeasuredSample};
use crate::sim::ground_disk::GroundDisk;
use crate::sim::noise::{Noise, NoisePurpose};
use crate::sim::operator_script::RUN;
use crate::sim::silence::HeardSeconds;
use crate::time::Time;

/// The ground station in the simulation.
pub(in crate::sim) struct SimulatedGround {
    node: GroundNode,
    /// What it is made of, also when it restarts.
    parts: GroundParts,
    disk: GroundDisk,
    alarm: Alarm,
    /// It was started anew and nobody has noticed yet.
    has_restarted: bool,
}

impl SimulatedGround {
    /// Starts its software with an empty disk; `is_disk_read` = it will be started anew, or its samples are wanted.
    pub(crate) fn new(parts: GroundParts, is_disk_read: bool) -> SimulatedGround {
        SimulatedGround {
            node: GroundNode::new(parts.clone()),
            parts,
            disk: GroundDisk::new(is_disk_read),
            alarm: Alarm::default(),
            has_restarted: false,
        }
    }

    /// Returns its node.
    pub(crate) fn node(&self) -> &GroundNode {
        &self.node
    }

    /// Returns its node, to be watched.
    pub(crate) fn node_mut(&mut self) -> &mut GroundNode {
        &mut self.node
    }

    /// Returns when it has learnt that beacons were heard.
    pub(crate) fn heard(&self) -> &HeardSeconds {
        self.disk.heard()
    }

    /// Returns the samples on its disk, each once, in order.
    pub(crate) fn samples(&self) -> Vec<MeasuredSample> {
        self.disk.samples()
    }

    pub(super) fn alarm_mut(&mut self) -> &mut Alarm {
        &mut self.alarm
    }

    pub(super) fn alarm_and_deadline(&mut self) -> (&mut Alarm, Option<Time>) {
        let deadline = self.node.deadline();
        (&mut self.alarm, deadline.map(|deadline| deadline.at))
    }

    /// Tells its node something; what it must not lose is on its disk before.
    ///
    /// # Errors
    /// An actor cannot go on.
    pub(crate) fn tell(
        &mut self,
        now: Time,
        event: ground::Event,
        effects: &mut Vec<ground::Effect>,
    ) -> Result<(), Fault> {
        match &event {
            ground::Event::Bus(_, message) => self.disk.keep(message),
            ground::Event::StoresSamples(_) | ground::Event::Troubles(_) => {}
        }
        self.node.tell(now, event, effects)
    }

    /// Lets its node do what is due.
    ///
    /// # Errors
    /// An actor cannot go on.
    pub(crate) fn wake(
        &mut self,
        now: Time,
        effects: &mut Vec<ground::Effect>,
    ) -> Result<(), Fault> {
        self.node.wake(now, effects)
    }

    /// Keeps what the station needs, in place of what it needed before.
    pub(crate) fn remember(&mut self, memory: Box<StationMemory>) {
        self.disk.remember(memory);
    }

    /// Keeps what emergency stops it knows.
    pub(crate) fn keep_stops(&mut self, stops: OpenStops) {
        self.disk.keep_stops(stops);
    }

    /// Ends its software: what it has not kept is gone.
    pub(crate) fn end(&mut self) {
        self.alarm.cancel();
    }

    /// Starts its software anew, with what its disk holds; returns the count of its starts. As a live one it listens first, and
    /// draws a new name for the lease that it may hold.
    pub(crate) fn restart(&mut self, noise: Noise) -> Boot {
        let boot = Boot(self.parts.station.boot.0.saturating_add(1));
        self.parts.station.boot = boot;
        let holder = noise.hash(NoisePurpose::Start, &[u64::MAX, u64::from(boot.0)]);
        let station = StationSettings {
            lease: None,
            holder,
            ..self.parts.station.clone()
        };
        self.node.restart(self.disk.source(GroundParts {
            station,
            ..self.parts.clone()
        }));
        self.has_restarted = true;
        boot
    }

    /// Returns whether it was started anew since the last call.
    pub(crate) fn take_has_restarted(&mut self) -> bool {
        std::mem::take(&mut self.has_restarted)
    }

    /// Returns a line about what it holds: its map and its samples.
    pub(crate) fn holdings(&self) -> String {
        let station = self.node.station();
        let map = super::map_hash(&station.map().digest());
        let samples = station.samples().count(RUN);
        format!("holds map {map:016x}, stored {samples} samples")
    }
}
