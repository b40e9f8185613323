//! Who hears whom inside the ground station: the only place that knows.
//!
//! ```text
//!   bus ──State, Progress, Tile, Samples, Digest, Want──► station ──Plan, Order, Have, Tile…──► bus
//!   operator ──Begin──► station ──Request──► planner ──Answer──► station
//!                       station ──Job──► imager ──Picture──► edge (log, files, dashboard)
//! ```

use tomoswarm_proto::Message;

use super::{imager, planner, station};

/// What reaches the ground station from outside.
#[derive(Clone, Debug)]
pub enum Event {
    /// The bus delivered a message of a vehicle.
    Bus(Message),
    /// The operator wants something.
    Operator(station::Wish),
}

/// What the ground station wants done outside.
#[derive(Clone, Debug)]
pub enum Effect {
    /// The bus shall carry a message to the vehicles.
    Publish(Message),
    /// A picture was made.
    Picture(imager::Picture),
    /// Something worth a line in the log.
    Note(station::Note),
}

/// Whatever is said inside the ground station or at its edge.
#[derive(Debug)]
pub(crate) enum Said {
    Edge(Event),
    Station(station::Out),
    Planner(planner::Answer),
    Imager(imager::Picture),
}

/// Where it goes.
#[derive(Debug)]
pub(crate) enum To {
    Station(station::In),
    Planner(planner::Request),
    Imager(imager::Job),
    Edge(Effect),
}

/// Says where something goes.
pub(crate) fn route(said: Said, to: &mut Vec<To>) {
    to.push(match said {
        Said::Edge(Event::Bus(message)) => To::Station(station::In::Bus(message)),
        Said::Edge(Event::Operator(wish)) => To::Station(station::In::Wish(wish)),
        Said::Station(station::Out::Publish(message)) => To::Edge(Effect::Publish(message)),
        Said::Station(station::Out::Ask(request)) => To::Planner(request),
        Said::Station(station::Out::Reconstruct(job)) => To::Imager(job),
        Said::Station(station::Out::Note(note)) => To::Edge(Effect::Note(note)),
        Said::Planner(answer) => To::Station(station::In::Planned(answer)),
        Said::Imager(picture) => To::Edge(Effect::Picture(picture)),
    });
}
