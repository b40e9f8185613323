//! The ground station: the list of its five actors and how each is made, for every runtime. Fleet, schedule and samples
//! are the [`station`]'s, the next stops the [`planner`]'s, the picture the [`imager`]'s, which the [`image_publisher`]
//! says to operators. [`route`] says who hears whom.
//!
//! Planner and imager may think for seconds; a fault of theirs is mended by a fresh one. A fault of the station ends the
//! node: what it knows is in the store, and is read at the start.
//!
//! Like a vehicle it knows no device and no network: what reaches it is an [`Event`], what it wants
//! done is an [`Effect`].

mod fleet;
pub mod from_config;
mod ground_node;
pub mod image_publisher;
pub mod imager;
pub mod planner;
pub mod route;
mod samples;
pub mod station;

use self::from_config::GroundParts;
use self::image_publisher::ImagePublisher;
use self::imager::ImagerActor;
use self::planner::PlannerActor;
use self::route::{Destination, Output, route};
use self::station::Station;
use crate::actor::{ActingTime, Fill, Place, Recipient, RestartPolicy, Visitor, Wire, Wiring};
use crate::stops::{Stops, StopsSettings};

pub use ground_node::GroundNode;
pub use route::{Effect, Event};
pub use samples::{MeasuredSample, SampleStore};

/// How a ground station is wired.
#[derive(Debug)]
pub enum GroundWiring {}

/// A place for each actor of the ground station.
#[derive(Clone, Debug)]
pub struct Actors<P: Place<GroundWiring>> {
    pub(crate) stops: P::Of<Stops>,
    pub(crate) station: P::Of<Station>,
    pub(crate) planner: P::Of<PlannerActor>,
    pub(crate) imager: P::Of<ImagerActor>,
    pub(crate) image_publisher: P::Of<ImagePublisher>,
}

/// What the actors are made from.
#[derive(Debug)]
pub struct ActorSettings {
    /// What a station, a planner and an imager that begin are made from.
    pub parts: GroundParts,
    /// A station that goes on where an earlier one was; it is taken for the first one.
    pub resumed: Option<Station>,
    /// The emergency stops that its disk has kept.
    pub stops: StopsSettings,
}

impl ActorSettings {
    fn station(&mut self) -> Station {
        self.resumed
            .take()
            .unwrap_or_else(|| Station::new(self.parts.station.clone()))
    }
}

impl Wiring for GroundWiring {
    const KIND: &'static str = "ground";
    type Source = ActorSettings;
    type Event = Event;
    type Effect = Effect;
    type Output = Output;
    type Destination = Destination;
    type Actors<P: Place<Self>> = Actors<P>;

    fn fill<P: Place<Self>>(fill: &mut impl Fill<Self, P>) -> Actors<P> {
        Actors {
            stops: fill.actor(Wire {
                name: "stops",
                restart: RestartPolicy::StopNode,
                acting: ActingTime::Instant,
                make: |source| Stops::new(&source.stops),
                output: Output::Stops,
            }),
            station: fill.actor(Wire {
                name: "station",
                restart: RestartPolicy::StopNode,
                acting: ActingTime::Short,
                make: ActorSettings::station,
                output: Output::Station,
            }),
            planner: fill.actor(Wire {
                name: "planner",
                restart: RestartPolicy::Restart,
                acting: ActingTime::Long,
                make: |source| source.parts.planner.clone(),
                output: Output::Planner,
            }),
            imager: fill.actor(Wire {
                name: "imager",
                restart: RestartPolicy::Restart,
                acting: ActingTime::Long,
                make: |source| source.parts.imager.clone(),
                output: |made| Output::Imager(Box::new(made)),
            }),
            image_publisher: fill.actor(Wire {
                name: "image_publisher",
                restart: RestartPolicy::Restart,
                acting: ActingTime::Short,
                make: |source| ImagePublisher::new(source.parts.station.boot),
                output: Output::ImagePublisher,
            }),
        }
    }

    fn visit<P: Place<Self>>(actors: &mut Actors<P>, visitor: &mut impl Visitor<Self, P>) {
        // Taken apart, so that none can be forgotten.
        let Actors {
            stops,
            station,
            planner,
            imager,
            image_publisher,
        } = actors;
        visitor.actor::<Stops>(stops);
        visitor.actor::<Station>(station);
        visitor.actor::<PlannerActor>(planner);
        visitor.actor::<ImagerActor>(imager);
        visitor.actor::<ImagePublisher>(image_publisher);
    }

    fn event(event: Event) -> Output {
        Output::Edge(event)
    }

    fn route(output: Output, to: &mut Vec<Destination>) {
        route(output, to);
    }

    fn deliver<P: Recipient<Self>>(
        actors: &mut Actors<P>,
        destination: Destination,
        carry_out: &mut impl FnMut(Effect),
    ) {
        match destination {
            Destination::Stops(input) => P::tell::<Stops>(&mut actors.stops, input),
            Destination::Station(input) => P::tell::<Station>(&mut actors.station, input),
            Destination::Planner(input) => P::tell::<PlannerActor>(&mut actors.planner, input),
            Destination::Imager(input) => P::tell::<ImagerActor>(&mut actors.imager, input),
            Destination::ImagePublisher(input) => {
                P::tell::<ImagePublisher>(&mut actors.image_publisher, input);
            }
            Destination::Edge(effect) => carry_out(effect),
        }
    }

    fn published(effect: Effect) -> Option<tomoswarm_proto::Message> {
        match effect {
            Effect::Publish(message) => Some(message),
            _ => None,
        }
    }
}
