//! The six actors of a vehicle with their inboxes, run together on one thread.
//!
//! This is how the simulator runs a vehicle. A live node may run the same actors on several
//! threads: only [`super::route`] says what goes where, in both.

use tomoswarm_proto::codec::EncodeError;
use tomoswarm_proto::{Boot, RunId, VehicleId};

use super::map::Map;
use super::mission::Mission;
use super::outbox::Outbox;
use super::radio::Radio;
use super::route::{Effect, Event, Said, To, route};
use super::sensor::Sensor;
use super::vehicle::Vehicle;
use super::{Acted, Settings};
use crate::actor::{Fault, Seat, Snapshot};
use crate::map::Merged;
use crate::time::{Deadline, Time};

/// A vehicle's actors, wired.
#[derive(Debug)]
pub struct VehicleNode {
    id: VehicleId,
    boot: Boot,
    vehicle: Seat<Vehicle>,
    sensor: Seat<Sensor>,
    map: Seat<Map>,
    mission: Seat<Mission>,
    radio: Seat<Radio>,
    outbox: Seat<Outbox>,
    /// What earlier starts have measured, for [`VehicleNode::samples_made`].
    radios: Vec<Radio>,
    routed: Vec<To>,
    /// What the actors did and nobody has taken yet; `None` while nobody watches.
    acted: Option<Vec<Acted>>,
}

impl VehicleNode {
    /// Makes a vehicle that has not heard anything yet.
    pub fn new(settings: &Settings) -> VehicleNode {
        let sensor = Sensor::new(settings.look.clone(), settings.swarm.pose_sd_max_m);
        VehicleNode {
            id: settings.vehicle,
            boot: settings.boot,
            vehicle: Seat::new(Vehicle::new(settings.clone())),
            sensor: Seat::new(sensor),
            map: Seat::new(Map::new(settings.clone())),
            mission: Seat::new(Mission::new(settings.clone())),
            radio: Seat::new(Radio::new(settings.clone())),
            outbox: Seat::new(Outbox::new(settings.vehicle)),
            radios: Vec::new(),
            routed: Vec::new(),
            acted: None,
        }
    }

    /// Starts anew, with settings of a higher boot; what was measured is kept at the edge.
    pub fn restart(&mut self, settings: &Settings) {
        let before = std::mem::replace(self, VehicleNode::new(settings));
        (self.radios, self.acted) = (before.radios, before.acted);
        self.radios.push(before.radio.actor().clone());
    }

    /// Gives the vehicle's id.
    pub fn id(&self) -> VehicleId {
        self.id
    }

    /// Gives what the mission is doing, for status lines and tests.
    pub fn mission(&self) -> &Mission {
        self.mission.actor()
    }

    /// Gives the boot of the vehicle's software.
    pub fn boot(&self) -> Boot {
        self.boot
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
            + self.outbox.dropped()
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
            self.outbox.deadline(),
        ]
        .into_iter()
        .fold(None, Deadline::earlier)
    }

    /// Begins to keep every step of every actor, for [`VehicleNode::acted`].
    pub fn watch(&mut self) {
        self.acted.get_or_insert_default();
    }

    /// Gives what the actors did since the last call, in order; nothing unless it is watched.
    pub fn acted(&mut self) -> Vec<Acted> {
        self.acted.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Gives every actor as it is now. Nothing may be unread, as it is between two calls.
    ///
    /// # Errors
    /// One cannot be written, which is a mistake of this program.
    pub fn snapshots(&self) -> Result<Vec<Snapshot>, EncodeError> {
        [
            Snapshot::of("vehicle", self.vehicle.actor()),
            Snapshot::of("sensor", self.sensor.actor()),
            Snapshot::of("map", self.map.actor()),
            Snapshot::of("mission", self.mission.actor()),
            Snapshot::of("radio", self.radio.actor()),
            Snapshot::of("outbox", self.outbox.actor()),
        ]
        .into_iter()
        .collect()
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
            To::Outbox(input) => self.outbox.push(input),
            To::Edge(effect) => effects.push(effect),
        }
    }

    /// Lets every actor act, in the order of the data's way, and routes what they say.
    fn act(&mut self, now: Time) -> Result<(), Fault> {
        let routed = &mut self.routed;
        self.vehicle.act_watched(now, watcher(&mut self.acted, Acted::Vehicle), |said| {
            route(Said::Vehicle(said), routed)
        })?;
        self.sensor.act_watched(now, watcher(&mut self.acted, Acted::Sensor), |said| {
            route(Said::Sensor(said), routed)
        })?;
        self.map
            .act_watched(now, watcher(&mut self.acted, Acted::Map), |said| route(Said::Map(said), routed))?;
        self.mission.act_watched(now, watcher(&mut self.acted, Acted::Mission), |said| {
            route(Said::Mission(said), routed)
        })?;
        self.radio.act_watched(now, watcher(&mut self.acted, Acted::Radio), |said| {
            route(Said::Radio(said), routed)
        })?;
        self.outbox.act_watched(now, watcher(&mut self.acted, Acted::Outbox), |said| {
            route(Said::Outbox(said), routed)
        })
    }
}

/// Puts steps among those kept, if any are.
fn watcher<S>(acted: &mut Option<Vec<Acted>>, wrap: fn(S) -> Acted) -> Option<impl FnMut(S)> {
    acted.as_mut().map(|acted| move |step| acted.push(wrap(step)))
}
