//! What the actors of a vehicle did, one step each, for whoever watches: a recording. Nothing here writes.

use super::{map, mission, outbox, radio, sensor, vehicle};
use crate::actor::Step;
use crate::time::Time;

/// A step of one of a vehicle's actors.
#[derive(Clone, PartialEq, Debug)]
pub enum Acted {
    /// Of the vehicle actor.
    Vehicle(Step<vehicle::In, vehicle::Out>),
    /// Of the sensor.
    Sensor(Step<sensor::In, sensor::Out>),
    /// Of the map.
    Map(Step<map::In, map::Out>),
    /// Of the mission.
    Mission(Step<mission::In, mission::Out>),
    /// Of the radio.
    Radio(Step<radio::In, radio::Out>),
    /// Of the outbox.
    Outbox(Step<outbox::In, outbox::Out>),
}

impl Acted {
    /// Gives the name of the actor.
    pub fn actor(&self) -> &'static str {
        match self {
            Acted::Vehicle(_) => "vehicle",
            Acted::Sensor(_) => "sensor",
            Acted::Map(_) => "map",
            Acted::Mission(_) => "mission",
            Acted::Radio(_) => "radio",
            Acted::Outbox(_) => "outbox",
        }
    }

    /// Gives the moment.
    pub fn now(&self) -> Time {
        match self {
            Acted::Vehicle(step) => step.now,
            Acted::Sensor(step) => step.now,
            Acted::Map(step) => step.now,
            Acted::Mission(step) => step.now,
            Acted::Radio(step) => step.now,
            Acted::Outbox(step) => step.now,
        }
    }
}
