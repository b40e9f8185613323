//! The one actor of an operator and how it is wired, for every runtime. Nobody hears anybody inside: what comes from
//! outside is for it, and what it says goes outside.
//!
//! A fault of it ends the node: what it has ordered stands in State, and is not repeated by one that knows nothing of it.

use super::operator_actor::{In, Operator, OperatorSettings, Out};
use crate::actor::{ActingTime, Fill, LocalNode, Place, Recipient, RestartPolicy, Visitor, Wire, Wiring};

/// An operator's actor on one thread, as the simulator runs it.
pub type OperatorNode = LocalNode<OperatorWiring>;

/// How an operator is wired.
#[derive(Debug)]
pub enum OperatorWiring {}

/// A place for each actor of an operator.
#[derive(Clone, Debug)]
pub struct Actors<P: Place<OperatorWiring>> {
    pub(crate) operator: P::Of<Operator>,
}

/// Whatever is said inside the operator or at its edge.
#[derive(Debug)]
pub enum Output {
    /// From outside.
    Edge(In),
    /// By the operator.
    Operator(Out),
}

/// Where it goes.
#[derive(Debug)]
pub enum Destination {
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
        let Actors { operator } = actors;
        visitor.actor::<Operator>(operator);
    }

    fn event(event: In) -> Output {
        Output::Edge(event)
    }

    fn route(output: Output, to: &mut Vec<Destination>) {
        to.push(match output {
            Output::Edge(event) => Destination::Operator(event),
            Output::Operator(said) => Destination::Edge(said),
        });
    }

    fn deliver<P: Recipient<Self>>(
        actors: &mut Actors<P>,
        destination: Destination,
        carry_out: &mut impl FnMut(Out),
    ) {
        match destination {
            Destination::Operator(input) => P::tell::<Operator>(&mut actors.operator, input),
            Destination::Edge(effect) => carry_out(effect),
        }
    }
}
