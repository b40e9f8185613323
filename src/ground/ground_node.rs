//! The three actors of the ground station, run together on one thread, as the simulator does it.

use super::imager::Imager;
use super::planner::Planner;
use super::route::{Effect, Event, Said, To, route};
use super::station::Station;
use crate::actor::{Fault, Seat};
use crate::time::{Deadline, Time};

/// The ground station's actors, wired.
#[derive(Debug)]
pub struct GroundNode {
    station: Seat<Station>,
    planner: Seat<Planner>,
    imager: Seat<Imager>,
    routed: Vec<To>,
}

impl GroundNode {
    /// Wires the actors of a ground station.
    pub fn new(station: Station, planner: Planner, imager: Imager) -> GroundNode {
        GroundNode {
            station: Seat::new(station),
            planner: Seat::new(planner),
            imager: Seat::new(imager),
            routed: Vec::new(),
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
        [self.station.deadline(), self.planner.deadline(), self.imager.deadline()]
            .into_iter()
            .fold(None, Deadline::earlier)
    }

    fn settle(&mut self, now: Time, effects: &mut Vec<Effect>) -> Result<(), Fault> {
        while !self.routed.is_empty() {
            for to in std::mem::take(&mut self.routed) {
                match to {
                    To::Station(input) => self.station.push(input),
                    To::Planner(input) => self.planner.push(input),
                    To::Imager(input) => self.imager.push(input),
                    To::Edge(effect) => effects.push(effect),
                }
            }
            self.act(now)?;
        }
        Ok(())
    }

    fn act(&mut self, now: Time) -> Result<(), Fault> {
        let routed = &mut self.routed;
        self.station.act(now, |said| route(Said::Station(said), routed))?;
        self.planner.act(now, |said| route(Said::Planner(said), routed))?;
        self.imager.act(now, |said| route(Said::Imager(said), routed))
    }
}
