//! Simulated vehicles behind links of bytes: each endpoint shows one vehicle or several, to any number of clients. Pure: it
//! is told who has come, what bytes they said and what time it is, and says what bytes go to whom. Nothing a client says
//! stops it: what is no frame is passed over, and what is not read in time is dropped.
//!
//! ```text
//!   bytes ─► reader (one a client) ─► messages ─► vehicles of its endpoint ─► messages ─► writer (client, vehicle) ─► bytes
//! ```

use std::collections::BTreeMap;

use super::environment::Environment;
use super::mavlink_vehicle::{FlownVehicle, MavlinkVehicle};
use crate::mavlink::client_link::{ClientBytes, ClientId, ClientLink, Outgoing, bytes_for};
use crate::mavlink::earth_frame::EarthFrame;
use crate::mavlink::signing::KEY_BYTES;
use crate::time::Time;

/// How vehicles are shown.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Endpoints {
    /// Each has an endpoint of its own, in their order.
    OneEach,
    /// All share endpoint 0, and are told apart by their system ids.
    Shared,
}

/// A client of an endpoint.
struct Client {
    endpoint: usize,
    link: ClientLink,
}

/// Vehicles and who listens to them.
pub struct MavlinkFleet {
    vehicles: Vec<MavlinkVehicle>,
    endpoints: Endpoints,
    clients: BTreeMap<ClientId, Client>,
    key: Option<[u8; KEY_BYTES]>,
    output: Vec<Outgoing>,
}

impl MavlinkFleet {
    /// Shows all vehicles of an environment, under system ids from 1 on. With a key only who signs with it is heard.
    pub fn new(
        environment: &Environment,
        frame: EarthFrame,
        endpoints: Endpoints,
        key: Option<[u8; KEY_BYTES]>,
    ) -> MavlinkFleet {
        let vehicle = |index: usize| {
            let system = environment.world().id(index).0;
            MavlinkVehicle::new(system, environment.kind(), frame)
        };
        MavlinkFleet {
            vehicles: (0..environment.world().vehicles()).map(vehicle).collect(),
            endpoints,
            clients: BTreeMap::new(),
            key,
            output: Vec::new(),
        }
    }

    /// Gives a parameter of all vehicles a value; returns whether they have it.
    pub fn set_parameter(
        &mut self,
        now: Time,
        (name, value): (&str, f32),
        environment: &mut Environment,
    ) -> bool {
        let all = self.vehicles.iter_mut().enumerate();
        all.fold(true, |is_known, (index, vehicle)| {
            let mut flown = FlownVehicle::new(environment, index);
            let set = vehicle.set_parameter(now, name, value, &mut flown);
            is_known && set.is_some()
        })
    }

    /// Returns how many endpoints there are.
    pub fn endpoints(&self) -> usize {
        match self.endpoints {
            Endpoints::OneEach => self.vehicles.len(),
            Endpoints::Shared => 1,
        }
    }

    /// Somebody has come to an endpoint. `clock` is the time of signatures, units of 10 µs since 2015.
    pub fn joined(&mut self, now: Time, client: ClientId, endpoint: usize, clock: u64) {
        for index in self.shown_at(endpoint) {
            self.vehicles[index].joined(now);
        }
        let known = Client {
            endpoint,
            link: ClientLink::new(self.key, clock),
        };
        self.clients.insert(client, known);
    }

    /// Somebody is gone.
    pub fn left(&mut self, client: ClientId) {
        self.clients.remove(&client);
        self.vehicles
            .iter_mut()
            .for_each(|vehicle| vehicle.left(client));
    }

    /// Hears bytes of a client; the environment has gone on to `now`.
    pub fn hear(
        &mut self,
        now: Time,
        client: ClientId,
        bytes: &[u8],
        environment: &mut Environment,
        out: &mut Vec<ClientBytes>,
    ) {
        let Some(known) = self.clients.get_mut(&client) else {
            return;
        };
        known.link.push(bytes);
        let endpoint = known.endpoint;
        while let Some(frame) = self
            .clients
            .get_mut(&client)
            .and_then(|known| known.link.next_frame())
        {
            for index in self.shown_at(endpoint) {
                let mut flown = FlownVehicle::new(environment, index);
                self.vehicles[index].hear(now, client, &frame, &mut flown, &mut self.output);
                self.write(index, out);
            }
        }
    }

    /// Returns when something is to be said next.
    pub fn deadline(&self) -> Time {
        let deadlines = self.vehicles.iter().map(MavlinkVehicle::deadline);
        deadlines.min().unwrap_or(Time::NEVER)
    }

    /// Says what is due by now; the environment has gone on to then.
    pub fn due(&mut self, now: Time, environment: &mut Environment, out: &mut Vec<ClientBytes>) {
        for index in 0..self.vehicles.len() {
            if self.vehicles[index].deadline() <= now {
                let mut flown = FlownVehicle::new(environment, index);
                self.vehicles[index].due(now, &mut flown, &mut self.output);
                self.write(index, out);
            }
        }
    }

    /// Returns the vehicles of an endpoint.
    fn shown_at(&self, endpoint: usize) -> std::ops::Range<usize> {
        match self.endpoints {
            Endpoints::OneEach => endpoint..(endpoint + 1).min(self.vehicles.len()),
            Endpoints::Shared => 0..self.vehicles.len(),
        }
    }

    /// Makes frames of what a vehicle has said.
    fn write(&mut self, index: usize, out: &mut Vec<ClientBytes>) {
        let said = std::mem::take(&mut self.output);
        for outgoing in &said {
            for (id, client) in &mut self.clients {
                let hears = match self.endpoints {
                    Endpoints::OneEach => client.endpoint == index,
                    Endpoints::Shared => true,
                };
                if hears && outgoing.to.is_none_or(|to| to == *id) {
                    let from = self.vehicles[index].address();
                    client.link.write(from, &outgoing.said, bytes_for(*id, out));
                }
            }
        }
        self.output = said;
        self.output.clear();
    }
}
