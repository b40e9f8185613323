//! Who hears whom inside an operator: the only place that knows.

use tomoswarm_proto::Message;

use super::HeardMessage;
use super::operator_actor::{In, Out};
use crate::stops;

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

/// Says where something goes.
pub(super) fn route(output: Output, to: &mut Vec<Destination>) {
    match output {
        Output::Edge(event) => {
            to.extend(for_stops(&event).map(Destination::Stops));
            to.push(Destination::Operator(event));
        }
        Output::Stops(stops::Out::Publish(standing)) => {
            to.push(Destination::Edge(Out::Publish(Message::Standing(standing))));
        }
        Output::Stops(stops::Out::StopEvent(event)) => {
            to.push(Destination::Edge(Out::StopEvent(event)))
        }
        // The operator hears for itself who knows which stops.
        Output::Stops(stops::Out::Open(_) | stops::Out::Heard(_) | stops::Out::Remember(_)) => {}
        Output::Operator(Out::Give(given)) => to.push(Destination::Stops(stops::In::Give(given))),
        Output::Operator(outputs) => to.push(Destination::Edge(outputs)),
    }
}

/// Returns what the keeper of the emergency stops is told of what comes from outside.
fn for_stops(event: &In) -> Option<stops::In> {
    match event {
        In::Bus(HeardMessage::Message(sender, Message::Standing(standing))) => {
            Some(stops::In::Standing(*sender, standing.clone()))
        }
        In::Linked(true) => Some(stops::In::Linked),
        In::Bus(_)
        | In::Linked(false)
        | In::Want(..)
        | In::Stop(..)
        | In::Withdraw(_)
        | In::Follow(_)
        | In::CueDone
        | In::Fix(_)
        | In::Mark(..)
        | In::Ask(..) => None,
    }
}
