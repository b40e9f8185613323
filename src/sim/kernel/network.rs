//! The simulated network: the bus, and every node's side of it. Each node asks whether it may take part, greets, and sends
//! within its budget, by the same [`Exchange`] as a live node's.
//!
//! ```text
//!   node ─► exchange ─► bus ─► exchange ─► node
//!             ▲  └─ greetings, what has waited
//!             └─ alarm
//! ```
//!
//! A node whose software does not run has none. What follows when a node may not take part is not decided here.
//!
//! [`Exchange`]: crate::exchange::Exchange

mod node_exchange;
#[cfg(test)]
mod tests;

use std::fmt;

use tomoswarm_proto::{Boot, Hello, Interest, Message, OperatorId, VehicleId};

use self::node_exchange::NodeExchange;
use super::nodes::NodePlace;
use super::schedule::{Schedule, ScheduledEvent};
use crate::exchange::egress::OutboundFrame;
use crate::exchange::ingress::HeardMessage;
use crate::exchange::joining::JoinEffect;
use crate::exchange::{ExchangeCounts, ReceivedFrame};
use crate::sim::bus::{BusFrame, NodeId, SimulatedBus, operators_that_hear, receivers};
use crate::sim::noise::{Noise, NoisePurpose};
use crate::time::Time;

/// The bus with all nodes at it.
pub(super) struct Network {
    bus: SimulatedBus,
    noise: Noise,
    vehicles: Vec<NodeExchange>,
    ground: NodeExchange,
    operators: Vec<NodeExchange>,
}

/// How nodes greet that ask whether they may take part.
pub(in crate::sim) struct Greetings {
    /// The vehicles, in their order.
    pub vehicles: Vec<Hello>,
    pub ground: Hello,
}

/// What comes of a frame.
#[derive(Debug, Default)]
pub(super) struct Hearing {
    /// What the node is to be told.
    pub heard: Option<HeardMessage>,
    /// Worth a line in the log.
    pub line: Option<String>,
    /// Why the node may not take part in the bus, if that is so.
    pub expelled: Option<String>,
}

impl Network {
    /// Joins nodes to a bus, each of which may send so many bytes a second. Vehicles and ground station do not take part before
    /// they join ([`Network::join`]); operators, named with what they are interested in, do at once.
    pub(super) fn new(
        bus: SimulatedBus,
        noise: Noise,
        egress_bytes_per_s: u32,
        greetings: Greetings,
        operators: impl Iterator<Item = (OperatorId, Vec<Interest>)>,
    ) -> Network {
        let asking = |hello| NodeExchange::asking(hello, egress_bytes_per_s);
        let operators = operators
            .map(|(id, interest)| NodeExchange::listening(id, interest, egress_bytes_per_s));
        Network {
            bus,
            noise,
            vehicles: greetings.vehicles.into_iter().map(asking).collect(),
            ground: asking(greetings.ground),
            operators: operators.collect(),
        }
    }

    /// Lets a node begin to ask whether it may take part.
    pub(super) fn join(&mut self, node: NodePlace, boot: Boot, schedule: &mut Schedule) {
        let number = match node {
            NodePlace::Vehicle(vehicle) => vehicle,
            NodePlace::Ground | NodePlace::Operator(_) => self.vehicles.len(),
        };
        // A process draws it anew at every start.
        let ids = [number as u64, u64::from(boot.0)];
        let instance = self.noise.hash(NoisePurpose::Instance, &ids);
        let joins = self.at(node).join(schedule.now(), boot, instance);
        if joins {
            self.set_alarm(node, schedule);
        }
    }

    /// Takes a node off the bus.
    pub(super) fn leave(&mut self, node: NodePlace) {
        self.at(node).leave();
    }

    /// Returns whether a node is at the bus, whether or not it may take part.
    pub(super) fn is_joined(&mut self, node: NodePlace) -> bool {
        self.at(node).is_joined()
    }

    /// Returns how many frames a node has taken and refused since its software started.
    pub(super) fn counts(&mut self, node: NodePlace) -> ExchangeCounts {
        self.at(node).counts()
    }

    /// Lets whoever listens to the bus hear a line of a node's log.
    pub(super) fn overhear(&mut self, now: Time, node: NodeId, line: fmt::Arguments<'_>) {
        self.bus.overhear(now, node, line);
    }

    /// Lets a node say something: it goes out at once, or when it is its turn.
    pub(super) fn publish(&mut self, node: NodePlace, message: &Message, schedule: &mut Schedule) {
        let of_node = self.at(node);
        if !of_node.is_joined() {
            return;
        }
        for frame in of_node.say(schedule.now(), message) {
            self.send(node, &frame, schedule);
        }
        self.set_alarm(node, schedule);
    }

    /// Lets a node's exchange do what is due, if the wake counts; returns whether the node takes part from now on.
    pub(super) fn wake(
        &mut self,
        node: NodePlace,
        generation: u64,
        schedule: &mut Schedule,
    ) -> bool {
        let of_node = self.at(node);
        if !of_node.rings(generation) {
            return false;
        }
        let is_linked = of_node.is_member() || self.is_linked(node, schedule.now());
        let Some((due, joins)) = self.at(node).wake(schedule.now(), is_linked) else {
            return false;
        };
        for frame in due {
            self.send(node, &frame, schedule);
        }
        self.set_alarm(node, schedule);
        joins
    }

    /// Hands a frame to a node's exchange; returns what comes of it.
    pub(super) fn hear(
        &mut self,
        node: NodePlace,
        frame: &BusFrame,
        schedule: &mut Schedule,
    ) -> Hearing {
        let ReceivedFrame {
            heard,
            verdict,
            replies,
        } = match self.at(node).hear(schedule.now(), frame) {
            Ok(reception) => reception,
            Err(line) => {
                return Hearing {
                    line,
                    ..Hearing::default()
                };
            }
        };
        for reply in replies {
            self.send(node, &reply, schedule);
        }
        self.set_alarm(node, schedule);
        let (heard, line, expelled) = match verdict {
            JoinEffect::Fine => (heard, None, None),
            JoinEffect::Foreign(reason) | JoinEffect::Stays(reason) => (heard, Some(reason), None),
            JoinEffect::Refused(reason) => (None, None, Some(reason)),
        };
        Hearing {
            heard,
            line,
            expelled,
        }
    }

    /// Returns the bus.
    pub(super) fn into_bus(self) -> SimulatedBus {
        self.bus
    }

    /// Returns the bus.
    #[cfg(test)]
    pub fn bus(&self) -> &SimulatedBus {
        &self.bus
    }

    fn at(&mut self, node: NodePlace) -> &mut NodeExchange {
        match node {
            NodePlace::Vehicle(vehicle) => &mut self.vehicles[vehicle],
            NodePlace::Ground => &mut self.ground,
            NodePlace::Operator(operator) => &mut self.operators[operator],
        }
    }

    fn set_alarm(&mut self, node: NodePlace, schedule: &mut Schedule) {
        if let Some((at, generation)) = self.at(node).set_alarm(schedule.now()) {
            schedule.push(at, ScheduledEvent::Exchange { node, generation });
        }
    }

    /// Returns whether anybody can hear a node.
    fn is_linked(&mut self, node: NodePlace, now: Time) -> bool {
        let own = self.at(node).node();
        let all = self.vehicles.iter().chain([&self.ground]);
        let mut others = all
            .chain(&self.operators)
            .filter(|other| other.node() != own);
        others.any(|other| other.is_joined() && self.bus.joins(now, own, other.node()))
    }

    /// Puts a frame on the bus.
    fn send(&mut self, node: NodePlace, outbound: &OutboundFrame, schedule: &mut Schedule) {
        let (sender, topic) = (self.at(node).node(), outbound.topic);
        let operators = self.operators.iter().filter_map(NodeExchange::operator);
        let operators = operators_that_hear(sender, topic.kind, operators);
        let mut receivers = receivers(sender, topic, self.vehicle_ids());
        receivers.extend(operators);
        for delivery in self.bus.send(schedule.now(), sender, outbound, &receivers) {
            let (to, frame) = (delivery.to, delivery.frame);
            schedule.push(delivery.at, ScheduledEvent::Deliver { to, frame });
        }
    }

    fn vehicle_ids(&self) -> impl Iterator<Item = VehicleId> + '_ {
        self.vehicles
            .iter()
            .filter_map(|vehicle| match vehicle.node() {
                NodeId::Vehicle(id) => Some(id),
                NodeId::Ground | NodeId::Operator(_) => None,
            })
    }
}
