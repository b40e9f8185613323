//! What the actors of the ground station did, one step each, for whoever watches: a recording. Nothing here writes.

use super::{imager, planner, station};
use crate::actor::Step;
use crate::time::Time;

/// A step of one of the ground station's actors.
#[derive(Clone, Debug)]
pub enum Acted {
    /// Of the station.
    Station(Step<station::In, station::Out>),
    /// Of the planner.
    Planner(Step<planner::Request, planner::Answer>),
    /// Of the imager.
    Imager(Step<imager::Job, imager::Picture>),
}

impl Acted {
    /// Gives the name of the actor.
    pub fn actor(&self) -> &'static str {
        match self {
            Acted::Station(_) => "station",
            Acted::Planner(_) => "planner",
            Acted::Imager(_) => "imager",
        }
    }

    /// Gives the moment.
    pub fn now(&self) -> Time {
        match self {
            Acted::Station(step) => step.now,
            Acted::Planner(step) => step.now,
            Acted::Imager(step) => step.now,
        }
    }
}
