//! The nodes' sides of the simulated bus: each asks whether it may take part, greets, and sends within its budget, by the same
//! [`Exchange`] as a live node's. A vehicle that may not take part ends, as its process would.
//!
//! ```text
//!   node ─► exchange ─► bus ─► exchange ─► node
//!             ▲  └─ greetings, what has waited
//!             └─ alarm
//! ```
//!
//! A vehicle whose software does not run has none. An operator's only listens, and says what it wants to say.

use tomoswarm_proto::{Boot, Hello, Message};

use super::{Alarm, Event, Kernel};
use crate::exchange::Exchange;
use crate::exchange::egress::OutboundFrame;
use crate::exchange::ingress::HeardMessage;
use crate::exchange::joining::GreetingVerdict as JoinVerdict;
use crate::exchange::presence::Presence;
use crate::sim::bus::{BusFrame, NodeId, operators_that_hear, receivers};
use crate::sim::judge::RunVerdict;
use crate::sim::noise::Purpose;

/// A node's side of the bus.
#[derive(Debug)]
pub(super) struct NodeExchange {
    node: NodeId,
    /// How it greets; `None` = an operator, which does so by itself.
    greeting: Option<Hello>,
    /// `None` = its software does not run.
    exchange: Option<Exchange>,
    alarm: Alarm,
    /// It was seen to take part.
    is_member: bool,
}

impl NodeExchange {
    /// A node that greets in this way once it is started.
    pub fn greeting(greeting: Hello) -> NodeExchange {
        NodeExchange::silent(greeting.node, Some(greeting))
    }

    /// An operator, which sends so many bytes a second.
    pub fn listening(node: NodeId, egress_bytes_per_s: u32) -> NodeExchange {
        let mut exchange = Exchange::new(egress_bytes_per_s, Presence::listening());
        exchange.speak();
        NodeExchange {
            exchange: Some(exchange),
            ..NodeExchange::silent(node, None)
        }
    }

    fn silent(node: NodeId, greeting: Option<Hello>) -> NodeExchange {
        NodeExchange {
            node,
            greeting,
            exchange: None,
            alarm: Alarm::default(),
            is_member: false,
        }
    }
}

impl Kernel {
    /// Lets a node begin to ask whether it may take part.
    pub(super) fn join(&mut self, index: usize, boot: Boot) {
        let (noise, budget) = (self.noise, self.egress_bytes_per_s);
        let of_node = &mut self.exchanges[index];
        let Some(greeting) = &of_node.greeting else {
            return;
        };
        // A process draws it anew at every start.
        let instance = noise.hash(Purpose::Instance, &[index as u64, u64::from(boot.0)]);
        let own = Hello {
            boot,
            instance,
            ..greeting.clone()
        };
        of_node.exchange = Some(Exchange::new(budget, Presence::asking(self.now, own)));
        of_node.is_member = false;
        self.set_exchange_alarm(index);
    }

    /// Returns whether the software of a node runs.
    pub(super) fn runs(&self, index: usize) -> bool {
        self.exchanges[index].exchange.is_some()
    }

    /// Takes a node off the bus.
    pub(super) fn leave(&mut self, index: usize) {
        let of_node = &mut self.exchanges[index];
        of_node.exchange = None;
        of_node.alarm = Alarm {
            at: None,
            generation: of_node.alarm.generation + 1,
        };
    }

    /// Lets a node say something: it goes out at once, or when it is its turn.
    pub(super) fn publish(&mut self, index: usize, message: &Message) {
        let Some(exchange) = &mut self.exchanges[index].exchange else {
            return;
        };
        // A message too long for a frame is dropped here as a live bus would drop it.
        let ready = exchange.say(self.now, message).ok().flatten();
        ready.into_iter().for_each(|frame| self.send(index, &frame));
        self.set_exchange_alarm(index);
    }

    pub(super) fn wake_exchange(&mut self, index: usize, generation: u64) {
        if self.exchanges[index].alarm.generation != generation {
            return;
        }
        self.exchanges[index].alarm.at = None;
        let is_linked = self.exchanges[index].is_member || self.is_linked(index);
        let of_node = &mut self.exchanges[index];
        let Some(exchange) = &mut of_node.exchange else {
            return;
        };
        if is_linked {
            exchange.meet(self.now);
        }
        let due = exchange.due(self.now);
        let joins = exchange.is_member() && !of_node.is_member;
        of_node.is_member = exchange.is_member();
        for frame in due {
            self.send(index, &frame);
        }
        if joins {
            self.log(&self.name_of(index), format_args!("takes part in the bus"));
        }
        self.set_exchange_alarm(index);
    }

    /// Hands a frame to a node's exchange; returns what the node is to be told.
    pub(super) fn hear_frame(&mut self, index: usize, frame: &BusFrame) -> Option<HeardMessage> {
        let exchange = self.exchanges[index].exchange.as_mut()?;
        let (now, sender) = (self.now, frame.sender());
        let heard = exchange
            .admit(now, sender, frame.bytes())
            .and_then(|()| frame.read().clone());
        let reception = match heard.and_then(|heard| exchange.accept(now, frame.bytes(), heard)) {
            Ok(reception) => reception,
            Err(refusal) => {
                if let Some(count) = exchange.refuse(Some(sender), &refusal) {
                    let what = refusal.what();
                    let who = self.name_of(index);
                    self.log(
                        &who,
                        format_args!("refused {what} of {sender} ({count} so far): {refusal}"),
                    );
                }
                return None;
            }
        };
        reception
            .reply
            .into_iter()
            .for_each(|frame| self.send(index, &frame));
        self.set_exchange_alarm(index);
        match reception.verdict {
            JoinVerdict::Fine => reception.heard,
            JoinVerdict::Foreign(reason) | JoinVerdict::Stays(reason) => {
                self.log(&self.name_of(index), format_args!("{reason}"));
                reception.heard
            }
            JoinVerdict::Refused(reason) => {
                self.refused(index, &reason);
                None
            }
        }
    }

    /// Ends a node that may not take part; without a ground station the run is over.
    fn refused(&mut self, index: usize, reason: &str) {
        let who = self.name_of(index);
        self.log(&who, format_args!("may not take part: {reason}"));
        match self.exchanges[index].node {
            NodeId::Vehicle(vehicle) => self.die(vehicle),
            NodeId::Ground => {
                self.leave(index);
                self.follow(RunVerdict::Failed(format!(
                    "the ground station may not take part: {reason}"
                )));
            }
            // Operators ask nobody.
            NodeId::Operator(_) => {}
        }
    }

    /// Returns whether anybody can hear a node.
    fn is_linked(&self, index: usize) -> bool {
        let own = self.exchanges[index].node;
        let mut others = self
            .exchanges
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != index);
        others
            .any(|(_, other)| other.exchange.is_some() && self.bus.joins(self.now, own, other.node))
    }

    /// Puts a frame on the bus.
    fn send(&mut self, index: usize, outbound: &OutboundFrame) {
        let sender = self.exchanges[index].node;
        let topic = outbound.topic;
        let operators = self
            .operators
            .iter()
            .map(|operator| (operator.id, &operator.interest[..]));
        let operators = operators_that_hear(sender, topic.kind, operators);
        let mut receivers = receivers(
            sender,
            topic,
            self.vehicles.iter().map(|vehicle| vehicle.id()),
        );
        receivers.extend(operators);
        for delivery in self.bus.send(self.now, sender, outbound, &receivers) {
            self.queue.push(
                delivery.at,
                Event::Deliver {
                    to: delivery.to,
                    frame: delivery.frame,
                },
            );
        }
    }

    /// Queues when a node's exchange has something again, unless that is queued already.
    fn set_exchange_alarm(&mut self, index: usize) {
        let of_node = &mut self.exchanges[index];
        let at = of_node
            .exchange
            .as_ref()
            .and_then(Exchange::deadline)
            .map(|at| at.max(self.now));
        if of_node.alarm.at == at {
            return;
        }
        of_node.alarm = Alarm {
            at,
            generation: of_node.alarm.generation + 1,
        };
        if let Some(at) = at {
            self.queue.push(
                at,
                Event::Exchange {
                    index,
                    generation: of_node.alarm.generation,
                },
            );
        }
    }

    fn name_of(&self, index: usize) -> String {
        match self.exchanges[index].node {
            NodeId::Vehicle(vehicle) => format!("vehicle {vehicle}"),
            NodeId::Ground => "ground".to_owned(),
            NodeId::Operator(operator) => format!("operator {operator}"),
        }
    }
}
