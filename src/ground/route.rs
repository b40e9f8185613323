//! Who hears whom inside the ground station: the only place that knows.
//!
//! ```text
//!   bus ──State, Progress, Tile, Samples, Digest, Want, Report──► station ──Plan, Order, Have, Report, Tile…──► bus
//!   bus ──Task, Hello of an operator──► station ──Request──► planner ──PlannerAnswer──► station
//!                       station ──Job──► imager ──Picture──► edge (log, files), station, image publisher
//!   bus ──Hello of an operator──► image publisher ──Image──► bus
//!                       station ──StationMemory──► edge (store)
//!   edge (store) ──whether samples can be stored──► station
//!   bus ──Standing, leases──► stops ──which stops are open──► station      stops ──Standing──► bus, edge (disk)
//! ```

use tomoswarm_proto::{Image, Message, OpenStops, RunId, Sender};

use super::{image_publisher, imager, planner, station};
use crate::stops;

/// What reaches the ground station from outside.
#[derive(Clone, Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "nearly all are messages, and each is moved a few times only"
)]
pub enum Event {
    /// The bus delivered a message that another node said.
    Bus(Sender, Message),
    /// Samples can be stored, or cannot.
    StoresSamples(bool),
    /// What is wrong with the process, in words.
    Troubles(Vec<String>),
}

/// What the ground station wants done outside, in this order: what it remembers must be stored before what follows is
/// published.
#[derive(Clone, Debug)]
pub enum Effect {
    /// The bus shall carry a message to the vehicles.
    Publish(Message),
    /// A picture was made; to be stored in place of an earlier one of its run, laps and subject.
    Picture(Box<imager::ReconstructedImage>),
    /// What a station that is started anew needs; to be stored in place of what it remembered before.
    Remember(Box<station::StationMemory>),
    /// The store shall open a run, or keep it open.
    BeginRun {
        /// Which run.
        run: RunId,
        /// The run that it is compared with.
        compared_with: Option<RunId>,
    },
    /// The store shall close a run.
    EndRun(RunId),
    /// These emergency stops shall outlive the software, in place of those that did before.
    KeepStops(OpenStops),
    /// Emergency stops were opened or lifted: worth a line in the log.
    StopEvent(stops::StopEvent),
    /// Something worth a line in the log.
    StationEvent(station::StationEvent),
}

/// Whatever is said inside the ground station or at its edge.
#[derive(Debug)]
pub enum Output {
    /// From outside.
    Edge(Event),
    /// By the keeper of the emergency stops.
    Stops(stops::Out),
    /// By the station.
    Station(station::Out),
    /// By the planner.
    Planner(planner::PlannerAnswer),
    /// By the imager.
    Imager(Box<imager::ReconstructedImage>),
    /// By the one who says images to operators.
    ImagePublisher(Image),
}

/// Where it goes.
#[derive(Debug)]
pub enum Destination {
    /// To the keeper of the emergency stops.
    Stops(stops::In),
    /// To the station.
    Station(station::In),
    /// To the planner.
    Planner(planner::Request),
    /// To the imager.
    Imager(imager::Job),
    /// To the one who says images to operators.
    ImagePublisher(image_publisher::In),
    /// To the outside.
    Edge(Effect),
}

/// Says where something goes.
pub(crate) fn route(output: Output, to: &mut Vec<Destination>) {
    let next = match output {
        Output::Edge(Event::Bus(sender, message)) => return route_message(sender, message, to),
        Output::Edge(Event::StoresSamples(can)) => {
            Destination::Station(station::In::StoresSamples(can))
        }
        Output::Edge(Event::Troubles(troubles)) => {
            Destination::Station(station::In::Troubles(troubles))
        }
        Output::Stops(out) => return route_stops(out, to),
        Output::Station(station::Out::Publish(message)) => {
            Destination::Edge(Effect::Publish(message))
        }
        Output::Station(station::Out::Ask(request)) => Destination::Planner(request),
        Output::Station(station::Out::Reconstruct(job)) => Destination::Imager(job),
        Output::Station(station::Out::BeginRun { run, compared_with }) => {
            Destination::Edge(Effect::BeginRun { run, compared_with })
        }
        Output::Station(station::Out::EndRun(run)) => Destination::Edge(Effect::EndRun(run)),
        Output::Station(station::Out::StationEvent(note)) => {
            Destination::Edge(Effect::StationEvent(note))
        }
        Output::Planner(answer) => Destination::Station(station::In::Planned(answer)),
        Output::Station(station::Out::Remember(memory)) => {
            Destination::Edge(Effect::Remember(memory))
        }
        Output::Imager(picture) => {
            let made = station::In::Pictured {
                name: station::PictureName::of(&picture),
                is_made: picture.result.is_ok(),
            };
            let published = image_publisher::In::Made(picture.clone());
            to.push(Destination::ImagePublisher(published));
            to.push(Destination::Edge(Effect::Picture(picture)));
            Destination::Station(made)
        }
        Output::ImagePublisher(image) => Destination::Edge(Effect::Publish(Message::Image(image))),
    };
    to.push(next);
}

fn route_message(sender: Sender, message: Message, to: &mut Vec<Destination>) {
    let lease = match &message {
        Message::Standing(standing) => {
            return to.push(Destination::Stops(stops::In::Standing(
                sender,
                standing.clone(),
            )));
        }
        Message::Hello(hello) => hello.lease,
        Message::Report(report) => Some(report.lease),
        Message::Plan(plan) => Some(plan.lease),
        Message::State(_)
        | Message::Tile(_)
        | Message::Digest(_)
        | Message::Want(_)
        | Message::Mission(_)
        | Message::Order(_)
        | Message::Samples(_)
        | Message::Have(_)
        | Message::Beacon(_)
        | Message::Health(_)
        | Message::Task(_)
        | Message::Image(_)
        | Message::Fix(_)
        | Message::Mark(_)
        | Message::Look(_)
        | Message::Log(_)
        | Message::Settings(_) => None,
    };
    if let (Sender::Operator(operator), Message::Hello(_)) = (sender, &message) {
        let heard = image_publisher::In::Heard(operator);
        to.push(Destination::ImagePublisher(heard));
    }
    to.extend(lease.map(|lease| Destination::Stops(stops::In::Lease(lease))));
    // What the station decides by names its author itself.
    to.push(Destination::Station(station::In::Bus(message)));
}

fn route_stops(out: stops::Out, to: &mut Vec<Destination>) {
    to.push(match out {
        stops::Out::Open(open) => Destination::Station(station::In::Stops(open)),
        // A ground station waits for nobody's word before it plans.
        stops::Out::Heard(_) => return,
        stops::Out::Publish(standing) => {
            Destination::Edge(Effect::Publish(Message::Standing(standing)))
        }
        stops::Out::Remember(standing) => Destination::Edge(Effect::KeepStops(standing)),
        stops::Out::StopEvent(event) => Destination::Edge(Effect::StopEvent(event)),
    });
}
