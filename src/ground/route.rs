//! Who hears whom inside the ground station: the only place that knows.
//!
//! ```text
//!   bus ──State, Progress, Tile, Samples, Digest, Want, Report──► station ──Plan, Order, Have, Report, Tile…──► bus
//!   operator ──Begin──► station ──Request──► planner ──Answer──► station
//!                       station ──Job──► imager ──Picture──► edge (log, files, dashboard), station
//!                       station ──Memory──► edge (store)
//! ```

use tomoswarm_proto::{Message, Sender};

use super::{imager, planner, station};

/// What reaches the ground station from outside.
#[derive(Clone, Debug)]
pub enum Event {
    /// The bus delivered a message that another node said.
    Bus(Sender, Message),
    /// The operator wants something.
    Operator(station::Wish),
}

/// What the ground station wants done outside, in this order: what it remembers must be stored before what follows is
/// published.
#[derive(Clone, Debug)]
pub enum Effect {
    /// The bus shall carry a message to the vehicles.
    Publish(Message),
    /// A picture was made; to be stored in place of an earlier one of its run, laps and subject.
    Picture(imager::Picture),
    /// What a station that is started anew needs; to be stored in place of what it remembered before.
    Remember(Box<station::Memory>),
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
    let next = match said {
        // What the station decides by names its author itself.
        Said::Edge(Event::Bus(_, message)) => To::Station(station::In::Bus(message)),
        Said::Edge(Event::Operator(wish)) => To::Station(station::In::Wish(wish)),
        Said::Station(station::Out::Publish(message)) => To::Edge(Effect::Publish(message)),
        Said::Station(station::Out::Ask(request)) => To::Planner(request),
        Said::Station(station::Out::Reconstruct(job)) => To::Imager(job),
        Said::Station(station::Out::Note(note)) => To::Edge(Effect::Note(note)),
        Said::Planner(answer) => To::Station(station::In::Planned(answer)),
        Said::Station(station::Out::Remember(memory)) => To::Edge(Effect::Remember(memory)),
        Said::Imager(picture) => {
            let made = station::In::Pictured(station::PictureName::of(&picture));
            to.push(To::Edge(Effect::Picture(picture)));
            To::Station(made)
        }
    };
    to.push(next);
}
