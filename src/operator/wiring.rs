//! The two actors of an operator and how they are wired, for every runtime: the operator, and the keeper of the emergency
//! stops, which says them on as every node does and keeps nothing on a disk.
//!
//! A fault ends the node: what was ordered stands in State, and is not repeated by one that knows nothing of it.

use tomoswarm_proto::Message;

use super::Heard;
use super::operator_actor::{In, Operator, OperatorSettings, Out};
use crate::actor::{ActingTime, Fill, LocalNode, Place, Recipient, RestartPolicy, Visitor, Wire, Wiring};
use crate::stops::{self, Stops, StopsSettings};

/// An operator's actor on one thread, as the simulator runs it.
pub type OperatorNode = LocalNode<OperatorWiring>;

/// How an operator is wired.
#[derive(Debug)]
pub enum OperatorWiring {}

/// A place for each actor of an operator.
#[derive(Clone, Debug)]
pub struct Actors<P: Place<OperatorWiring>> {
    pub(crate) stops: P::Of<Stops>,
    pub(crate) operator: P::Of<Operator>,
}

/// Whatever is said inside the operator or at its edge.
#[derive(Debug)]
pub enum Output {
    /// From outside.
    Edge(In),
    /// By the keeper of the emergency stops.
    Stops(stops::Out),
    /// By the operator.
    Operator(Out),
}

/// Where it goes.
#[derive(Debug)]
pub enum Destination {
    /// To the keeper of the emergency stops.
    Stops(stops::In),
    /// To the operator.
    Operator(In),
    /// To the outside.
    Edge(Out),
}

impl Wiring for OperatorWiring {
    const KIND: &'static str = "operator";
    type Source = OperatorSettings;
    type Event = In;
    type Effect = Out;
    type Output = Output;
    type Destination = Destination;
    type Actors<P: Place<Self>> = Actors<P>;

    fn fill<P: Place<Self>>(fill: &mut impl Fill<Self, P>) -> Actors<P> {
        Actors {
            stops: fill.actor(Wire {
                name: "stops",
                restart: RestartPolicy::StopNode,
                acting: ActingTime::Instant,
                make: |settings| {
                    Stops::new(&StopsSettings { is_silent: !settings.greets, ..StopsSettings::default() })
                },
                output: Output::Stops,
            }),
            operator: fill.actor(Wire {
                name: "operator",
                restart: RestartPolicy::StopNode,
                acting: ActingTime::Short,
                make: |settings| Operator::new(settings.clone()),
                output: Output::Operator,
            }),
        }
    }

    fn visit<P: Place<Self>>(actors: &mut Actors<P>, visitor: &mut impl Visitor<Self, P>) {
        // Taken apart, so that none can be forgotten.
        let Actors { stops, operator } = actors;
        visitor.actor::<Stops>(stops);
        visitor.actor::<Operator>(operator);
    }

    fn event(event: In) -> Output {
        Output::Edge(event)
    }

    fn route(output: Output, to: &mut Vec<Destination>) {
        match output {
            Output::Edge(event) => {
                to.extend(for_stops(&event).map(Destination::Stops));
                to.push(Destination::Operator(event));
            }
            Output::Stops(stops::Out::Publish(standing)) => {
                to.push(Destination::Edge(Out::Publish(Message::Standing(standing))));
            }
            Output::Stops(stops::Out::Remark(remark)) => to.push(Destination::Edge(Out::StopsNote(remark))),
            // The operator hears for itself who knows which stops.
            Output::Stops(stops::Out::Open(_) | stops::Out::Heard(_) | stops::Out::Remember(_)) => {}
            Output::Operator(Out::Give(given)) => to.push(Destination::Stops(stops::In::Give(given))),
            Output::Operator(said) => to.push(Destination::Edge(said)),
        }
    }

    fn deliver<P: Recipient<Self>>(
        actors: &mut Actors<P>,
        destination: Destination,
        carry_out: &mut impl FnMut(Out),
    ) {
        match destination {
            Destination::Stops(input) => P::tell::<Stops>(&mut actors.stops, input),
            Destination::Operator(input) => P::tell::<Operator>(&mut actors.operator, input),
            Destination::Edge(effect) => carry_out(effect),
        }
    }
}

/// Returns what the keeper of the emergency stops is told of what comes from outside.
fn for_stops(event: &In) -> Option<stops::In> {
    match event {
        In::Bus(Heard::Message(sender, Message::Standing(standing))) => {
            Some(stops::In::Standing(*sender, standing.clone()))
        }
        In::Linked(true) => Some(stops::In::Linked),
        In::Bus(_)
        | In::Linked(false)
        | In::Want(..)
        | In::Stop(..)
        | In::Withdraw(_)
        | In::Follow(_)
        | In::CueDone => None,
    }
}
