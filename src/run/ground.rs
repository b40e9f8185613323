//! The actors of the ground station, each on a thread of its own, joined by [`crate::ground::route`]. The imager may take
//! seconds and the planner too; the station goes on meanwhile.

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use super::desk::{Desk, Office, Post, Record, seat};
use crate::actor::Fault;
use crate::ground::Acted;
use crate::ground::imager::{Imager, Job};
use crate::ground::planner::{Planner, Request};
use crate::ground::route::{Effect, Event, Said, To, route};
use crate::ground::station::{self, Station};
use crate::store::recording::{Deed, Recorder};
use crate::time::Time;

/// The inboxes of the ground station's actors.
#[derive(Clone)]
pub struct Desks {
    station: Desk<station::In>,
    planner: Desk<Request>,
    imager: Desk<Job>,
}

impl Default for Desks {
    fn default() -> Desks {
        Desks { station: Desk::new("station"), planner: Desk::new("planner"), imager: Desk::new("imager") }
    }
}

impl Desks {
    /// Tells the station something from outside; never waits.
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
                To::Station(input) => self.station.tell(input),
                To::Planner(input) => self.planner.tell(input),
                To::Imager(input) => self.imager.tell(input),
                To::Edge(effect) => carry_out(effect),
            }
        }
    }

    /// Gives for how long the station has been acting without a pause; planner and imager may think for long.
    pub fn busy_for(&self, now: Time) -> Duration {
        self.station.busy_for(now)
    }

    /// Tells how many inputs were dropped unread.
    pub fn dropped(&self) -> u64 {
        self.station.dropped() + self.planner.dropped() + self.imager.dropped()
    }

    /// Sends all actors home.
    pub fn close(&self) {
        self.planner.close();
        self.imager.close();
        self.station.close();
    }
}

/// What makes an actor, at the start and again after a fault.
pub type Maker<A> = Box<dyn FnMut() -> Result<A, Fault> + Send>;

/// What makes the three actors.
pub struct Makers {
    /// The station; its fault ends the process.
    pub station: Maker<Station>,
    /// The planner.
    pub planner: Maker<Planner>,
    /// The imager.
    pub imager: Maker<Imager>,
}

/// Seats the three actors. `carry_out` is called from their threads for everything that concerns the outside.
///
/// # Errors
/// The machine has no threads to give.
pub fn seat_all(
    office: &Office,
    desks: &Desks,
    makers: Makers,
    recorder: Option<&Recorder>,
    carry_out: impl Fn(Effect) + Send + Sync + 'static,
) -> std::io::Result<Vec<JoinHandle<()>>> {
    let edge = Arc::new(carry_out);
    let Makers { station, planner, imager } = makers;
    let of_station = Record::by(recorder, |step| Deed::Ground(Acted::Station(step)));
    let of_planner = Record::by(recorder, |step| Deed::Ground(Acted::Planner(step)));
    let of_imager = Record::by(recorder, |step| Deed::Ground(Acted::Imager(step)));
    Ok(vec![
        seat(office, &desks.station, Post::Vital, of_station, station, voice(desks, &edge, Said::Station))?,
        seat(office, &desks.planner, Post::Leaf, of_planner, planner, voice(desks, &edge, Said::Planner))?,
        seat(office, &desks.imager, Post::Leaf, of_imager, imager, voice(desks, &edge, Said::Imager))?,
    ])
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
