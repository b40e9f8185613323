//! The three actors of the ground station, run together on one thread, as the simulator does it.

use tomoswarm_proto::codec::EncodeError;

use super::Acted;
use super::imager::Imager;
use super::planner::Planner;
use super::route::{Destination, Effect, Event, Output, route};
use super::station::Station;
use crate::actor::{ActorCell, Fault, Snapshot};
use crate::time::{Deadline, Time};

/// The ground station's actors, wired.
#[derive(Debug)]
pub struct GroundNode {
    station: ActorCell<Station>,
    planner: ActorCell<Planner>,
    imager: ActorCell<Imager>,
    routed: Vec<Destination>,
    /// What the actors did and nobody has taken yet; `None` while nobody watches.
    acted: Option<Vec<Acted>>,
}

impl GroundNode {
    /// Wires the actors of a ground station.
    pub fn new(station: Station, planner: Planner, imager: Imager) -> GroundNode {
        GroundNode {
            station: ActorCell::new(station),
            planner: ActorCell::new(planner),
            imager: ActorCell::new(imager),
            routed: Vec::new(),
            acted: None,
        }
    }

    /// Gives the station, for the outcome of a run.
    pub fn station(&self) -> &Station {
        self.station.actor()
    }

    /// Tells the ground station something, and lets its actors act until all is quiet.
    ///
    /// # Errors
    /// An actor cannot go on.
    pub fn tell(&mut self, now: Time, event: Event, effects: &mut Vec<Effect>) -> Result<(), Fault> {
        route(Output::Edge(event), &mut self.routed);
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
        [self.station.deadline(), self.planner.deadline(), self.imager.deadline()]
            .into_iter()
            .fold(None, Deadline::earlier)
    }

    /// Begins to keep every step of every actor, for [`GroundNode::acted`].
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
            Snapshot::of("station", self.station.actor()),
            Snapshot::of("planner", self.planner.actor()),
            Snapshot::of("imager", self.imager.actor()),
        ]
        .into_iter()
        .collect()
    }

    fn settle(&mut self, now: Time, effects: &mut Vec<Effect>) -> Result<(), Fault> {
        while !self.routed.is_empty() {
            for to in std::mem::take(&mut self.routed) {
                match to {
                    Destination::Station(input) => self.station.push(input),
                    Destination::Planner(input) => self.planner.push(input),
                    Destination::Imager(input) => self.imager.push(input),
                    Destination::Edge(effect) => effects.push(effect),
                }
            }
            self.act(now)?;
        }
        Ok(())
    }

    fn act(&mut self, now: Time) -> Result<(), Fault> {
        let routed = &mut self.routed;
        self.station.act_watched(now, watcher(&mut self.acted, Acted::Station), |said| {
            route(Output::Station(said), routed)
        })?;
        self.planner.act_watched(now, watcher(&mut self.acted, Acted::Planner), |said| {
            route(Output::Planner(said), routed)
        })?;
        self.imager.act_watched(now, watcher(&mut self.acted, Acted::Imager), |said| {
            route(Output::Imager(said), routed)
        })
    }
}

/// Puts steps among those kept, if any are.
fn watcher<S>(acted: &mut Option<Vec<Acted>>, wrap: fn(S) -> Acted) -> Option<impl FnMut(S)> {
    acted.as_mut().map(|acted| move |step| acted.push(wrap(step)))
}
