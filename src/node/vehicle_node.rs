//! The six actors of a vehicle with their inboxes, run together on one thread.
//!
//! This is how the simulator runs a vehicle. A live node may run the same actors on several
//! threads: only [`super::route`] says what goes where, in both.

use tomoswarm_proto::{RunId, VehicleId};

use super::Settings;
use super::map::Map;
use super::mission::Mission;
use super::outbox::{self, Outbox};
use super::radio::Radio;
use super::route::{Effect, Event, Said, To, route};
use super::sensor::Sensor;
use super::vehicle::Vehicle;
use crate::actor::{Fault, Seat};
use crate::map::Merged;
use crate::time::{Deadline, Time};

/// A vehicle's actors, wired.
#[derive(Debug)]
pub struct VehicleNode {
    id: VehicleId,
    vehicle: Seat<Vehicle>,
    sensor: Seat<Sensor>,
    map: Seat<Map>,
    mission: Seat<Mission>,
    radio: Seat<Radio>,
    outbox: Seat<Outbox>,
    /// What earlier starts have measured and the ground may not have yet: their disk outlives them.
    earlier: Vec<Seat<Outbox>>,
    /// What they have measured, for [`VehicleNode::samples_made`].
    radios: Vec<Radio>,
    routed: Vec<To>,
}

impl VehicleNode {
    /// Makes a vehicle that has not heard anything yet.
    pub fn new(settings: &Settings) -> VehicleNode {
        let sensor = Sensor::new(settings.look.clone(), settings.safety.pose_sd_max_m);
        VehicleNode {
            id: settings.vehicle,
            vehicle: Seat::new(Vehicle::new(settings.clone())),
            sensor: Seat::new(sensor),
            map: Seat::new(Map::new(settings.clone())),
            mission: Seat::new(Mission::new(settings.clone())),
            radio: Seat::new(Radio::new(settings.clone())),
            outbox: Seat::new(Outbox::new(settings.vehicle, settings.boot)),
            earlier: Vec::new(),
            radios: Vec::new(),
            routed: Vec::new(),
        }
    }

    /// Starts anew, with settings of a higher boot: only what was measured is kept.
    pub fn restart(&mut self, settings: &Settings) {
        let before = std::mem::replace(self, VehicleNode::new(settings));
        (self.earlier, self.radios) = (before.earlier, before.radios);
        self.radios.push(before.radio.actor().clone());
        self.earlier.push(before.outbox);
    }

    /// Gives the vehicle's id.
    pub fn id(&self) -> VehicleId {
        self.id
    }

    /// Gives what the mission is doing, for status lines and tests.
    pub fn mission(&self) -> &Mission {
        self.mission.actor()
    }

    /// Gives the map that the vehicle holds: its own layer and its peers'.
    pub fn map(&self) -> &Merged {
        self.map.actor().merged()
    }

    /// Gives how many samples of a run its radio has made, over all starts.
    pub fn samples_made(&self, run: RunId) -> u64 {
        let made = self.radios.iter().chain([self.radio.actor()]).map(|radio| radio.samples_made(run));
        made.sum()
    }

    /// Tells how many inputs its actors have dropped unread, because they were too slow.
    pub fn dropped(&self) -> u64 {
        self.vehicle.dropped()
            + self.sensor.dropped()
            + self.map.dropped()
            + self.mission.dropped()
            + self.radio.dropped()
            + self.outboxes().map(Seat::dropped).sum::<u64>()
    }

    /// Tells the vehicle something, and lets its actors act until all is quiet.
    ///
    /// # Errors
    /// An actor cannot go on.
    pub fn tell(&mut self, now: Time, event: Event, effects: &mut Vec<Effect>) -> Result<(), Fault> {
        route(Said::Edge(event), &mut self.routed);
        self.settle(now, effects)
    }

    /// Lets all actors act whose deadline has come, until all is quiet.
    ///
    /// # Errors
    /// An actor cannot go on.
    pub fn wake(&mut self, now: Time, effects: &mut Vec<Effect>) -> Result<(), Fault> {
        self.act(now)?;
        self.settle(now, effects)
    }

    /// Gives the earliest deadline of all actors.
    pub fn deadline(&self) -> Option<Deadline> {
        [
            self.vehicle.deadline(),
            self.sensor.deadline(),
            self.map.deadline(),
            self.mission.deadline(),
            self.radio.deadline(),
        ]
        .into_iter()
        .chain(self.outboxes().map(Seat::deadline))
        .fold(None, Deadline::earlier)
    }

    fn outboxes(&self) -> impl Iterator<Item = &Seat<Outbox>> {
        self.earlier.iter().chain([&self.outbox])
    }

    fn settle(&mut self, now: Time, effects: &mut Vec<Effect>) -> Result<(), Fault> {
        while !self.routed.is_empty() {
            let routed = std::mem::take(&mut self.routed);
            for to in routed {
                self.deliver(to, effects);
            }
            self.act(now)?;
        }
        Ok(())
    }

    fn deliver(&mut self, to: To, effects: &mut Vec<Effect>) {
        match to {
            To::Vehicle(input) => self.vehicle.push(input),
            To::Sensor(input) => self.sensor.push(input),
            To::Map(input) => self.map.push(input),
            To::Mission(input) => self.mission.push(input),
            To::Radio(input) => self.radio.push(input),
            To::Outbox(input) => {
                if let outbox::In::Have(_) = input {
                    self.earlier.iter_mut().for_each(|outbox| outbox.push(input.clone()));
                }
                self.outbox.push(input);
            }
            To::Edge(effect) => effects.push(effect),
        }
    }

    /// Lets every actor act, in the order of the data's way, and routes what they say.
    fn act(&mut self, now: Time) -> Result<(), Fault> {
        let routed = &mut self.routed;
        self.vehicle.act(now, |said| route(Said::Vehicle(said), routed))?;
        self.sensor.act(now, |said| route(Said::Sensor(said), routed))?;
        self.map.act(now, |said| route(Said::Map(said), routed))?;
        self.mission.act(now, |said| route(Said::Mission(said), routed))?;
        self.radio.act(now, |said| route(Said::Radio(said), routed))?;
        for outbox in self.earlier.iter_mut().chain([&mut self.outbox]) {
            outbox.act(now, |said| route(Said::Outbox(said), routed))?;
        }
        Ok(())
    }
}
