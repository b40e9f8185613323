//! The process of one vehicle: its six actors, each on a thread of its own, the bus, the drivers and the disk, joined by
//! [`crate::node::route`].
//!
//! ```text
//!   bus ─────┐                         ┌─ fly, steer, ping, transmit ─► drivers
//!   drivers ─┼─ Event ─► desks (actors) ┼─ publish ─► bus
//!   disk ────┘            ▲    │ route  ├─ keep, forget, recall ─► disk
//!                         └────┘        └─ note ─► log
//! ```
//!
//! The vehicle actor shares its thread with nobody, so a search for a path or a merge of maps never delays a halt.

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use super::desk::{Desk, Office, Post, Record, seat};
use crate::node::map::{self, Map};
use crate::node::mission::{self, Mission};
use crate::node::outbox::{self, Outbox};
use crate::node::radio::{self, Radio};
use crate::node::route::{Effect, Event, Said, To, route};
use crate::node::sensor::{self, Sensor};
use crate::node::vehicle::{self, Vehicle};
use crate::node::{Acted, Settings};
use crate::store::recording::{Deed, Recorder};
use crate::time::Time;

/// The inboxes of a vehicle's actors.
#[derive(Clone)]
pub struct Desks {
    vehicle: Desk<vehicle::In>,
    sensor: Desk<sensor::In>,
    map: Desk<map::In>,
    mission: Desk<mission::In>,
    radio: Desk<radio::In>,
    outbox: Desk<outbox::In>,
}

impl Default for Desks {
    fn default() -> Desks {
        Desks {
            vehicle: Desk::new("vehicle"),
            sensor: Desk::new("sensor"),
            map: Desk::shared("map"),
            mission: Desk::new("mission"),
            radio: Desk::new("radio"),
            outbox: Desk::new("outbox"),
        }
    }
}

impl Desks {
    /// Tells the vehicle something from outside; never waits.
    pub fn tell(&self, event: Event) {
        // What comes from outside concerns actors only.
        self.pass(Said::Edge(event), &mut |_| {});
    }

    /// Hands on what was said; what concerns the edge goes to `carry_out`.
    pub(crate) fn pass(&self, said: Said, carry_out: &mut dyn FnMut(Effect)) {
        let mut routed = Vec::new();
        route(said, &mut routed);
        for to in routed {
            match to {
                To::Vehicle(input) => self.vehicle.tell(input),
                To::Sensor(input) => self.sensor.tell(input),
                To::Map(input) => self.map.tell(input),
                To::Mission(input) => self.mission.tell(input),
                To::Radio(input) => self.radio.tell(input),
                To::Outbox(input) => self.outbox.tell(input),
                To::Edge(effect) => carry_out(effect),
            }
        }
    }

    /// Gives for how long the busiest actor has been acting without a pause.
    pub fn busy_for(&self, now: Time) -> Duration {
        let of = [
            self.vehicle.busy_for(now),
            self.sensor.busy_for(now),
            self.map.busy_for(now),
            self.mission.busy_for(now),
            self.radio.busy_for(now),
            self.outbox.busy_for(now),
        ];
        of.into_iter().max().unwrap_or_default()
    }

    /// Tells how many inputs were dropped unread.
    pub fn dropped(&self) -> u64 {
        self.vehicle.dropped()
            + self.sensor.dropped()
            + self.map.dropped()
            + self.mission.dropped()
            + self.radio.dropped()
            + self.outbox.dropped()
    }

    /// Sends the mission home, so that nothing new is decided; the others go on.
    pub fn close_mission(&self) {
        self.mission.close();
    }

    /// Sends all actors home.
    pub fn close(&self) {
        self.mission.close();
        self.sensor.close();
        self.map.close();
        self.radio.close();
        self.vehicle.close();
        self.outbox.close();
    }
}

/// Seats the six actors. `carry_out` is called from their threads for everything that concerns the outside; what they do
/// is written down where there is a recorder.
///
/// The range sensor's actor begins anew after a fault; a fault of any other ends the process, the radio's too: its
/// samples are numbered, and a fresh one would count from the beginning under the same start.
///
/// # Errors
/// The machine has no threads to give.
pub fn seat_all(
    office: &Office,
    desks: &Desks,
    settings: &Settings,
    recorder: Option<&Recorder>,
    carry_out: impl Fn(Effect) + Send + Sync + 'static,
) -> std::io::Result<Threads> {
    let edge = Arc::new(carry_out);
    let own = || settings.clone();
    let (v, s, m, i, r, o) = (own(), own(), own(), own(), own(), own());
    let vehicle = move || Ok(Vehicle::new(v.clone()));
    let sensor = move || Ok(Sensor::new(s.look.clone(), s.swarm.pose_sd_max_m));
    let map = move || Ok(Map::new(m.clone()));
    let mission = move || Ok(Mission::new(i.clone()));
    let radio = move || Ok(Radio::new(r.clone()));
    let outbox = move || Ok(Outbox::new(o.vehicle));
    let (of_vehicle, of_sensor, of_map, of_mission, of_radio, of_outbox) = (
        Record::by(recorder, |step| Deed::Vehicle(Acted::Vehicle(step))),
        Record::by(recorder, |step| Deed::Vehicle(Acted::Sensor(step))),
        Record::by(recorder, |step| Deed::Vehicle(Acted::Map(step))),
        Record::by(recorder, |step| Deed::Vehicle(Acted::Mission(step))),
        Record::by(recorder, |step| Deed::Vehicle(Acted::Radio(step))),
        Record::by(recorder, |step| Deed::Vehicle(Acted::Outbox(step))),
    );
    let others = vec![
        seat(office, &desks.vehicle, Post::Vital, of_vehicle, vehicle, voice(desks, &edge, Said::Vehicle))?,
        seat(office, &desks.sensor, Post::Leaf, of_sensor, sensor, voice(desks, &edge, Said::Sensor))?,
        seat(office, &desks.map, Post::Vital, of_map, map, voice(desks, &edge, Said::Map))?,
        seat(office, &desks.radio, Post::Vital, of_radio, radio, voice(desks, &edge, Said::Radio))?,
        seat(office, &desks.outbox, Post::Vital, of_outbox, outbox, voice(desks, &edge, Said::Outbox))?,
    ];
    let mission =
        seat(office, &desks.mission, Post::Vital, of_mission, mission, voice(desks, &edge, Said::Mission))?;
    Ok(Threads { mission, others })
}

/// The threads of a vehicle's actors.
pub struct Threads {
    mission: JoinHandle<()>,
    others: Vec<JoinHandle<()>>,
}

impl Threads {
    /// Tells whether the mission decides nothing any more.
    pub fn has_mission_ended(&self) -> bool {
        self.mission.is_finished()
    }

    /// Waits until all have ended.
    pub fn join(self) {
        for thread in self.others.into_iter().chain([self.mission]) {
            // An actor that panicked has said so already.
            let _ = thread.join();
        }
    }
}

/// Gives what hands on the words of one actor.
fn voice<T, E>(
    desks: &Desks,
    edge: &Arc<E>,
    wrap: fn(T) -> Said,
) -> impl FnMut(T) + Send + 'static + use<T, E>
where
    T: 'static,
    E: Fn(Effect) + Send + Sync + 'static,
{
    let (desks, edge) = (desks.clone(), edge.clone());
    move |out| desks.pass(wrap(out), &mut |effect| edge(effect))
}
