//! The operator: what it hears, what it wants of the swarm, and how it brings that about. State machines and tables
//! without I/O; the command line, a scenario and a page are its faces.
//!
//! [`operator_actor`] is the actor: it keeps a [`fleet_view`] of everyone, brings each want about by an [`ordering`], gives
//! tasks ([`given_tasks`]), and follows a [`script`]. [`status`] and [`preflight`] judge what is known. Emergency stops are
//! given by [`stopping`]. An operator says nothing but its greeting, tasks, orders, and which stops stand.
//!
//! The list of the node's actors stands here: the operator, and the keeper of the emergency stops, which says them on as
//! every node does and keeps nothing on a disk. A fault ends the node: what was ordered stands in State, and is not
//! repeated by one that knows nothing of it. [`route`] says who hears whom.

pub mod fleet_view;
pub mod given_marks;
pub mod given_tasks;
pub mod messages;
pub mod names;
pub mod operator_actor;
pub mod order_goal;
pub mod ordering;
pub mod outcome;
pub mod preflight;
pub mod route;
pub mod script;
pub mod status;
pub mod stopping;
#[cfg(test)]
pub(crate) mod tests_support;

use self::operator_actor::{In, Operator, OperatorSettings, Out};
use self::route::{Destination, Output, route};
use crate::actor::{
    ActingTime, Fill, LocalNode, Place, Recipient, RestartPolicy, Visitor, Wire, Wiring,
};
pub use crate::exchange::ingress::HeardMessage;
use crate::stops::{Stops, StopsSettings};

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
                    Stops::new(&StopsSettings {
                        is_silent: !settings.greets,
                        ..StopsSettings::default()
                    })
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
        route(output, to);
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

    fn published(effect: Out) -> Option<tomoswarm_proto::Message> {
        match effect {
            Out::Publish(message) => Some(message),
            _ => None,
        }
    }
}
