//! One node's side of the simulated bus: its exchange, how it greets, and when it has something to do again. It sends nothing
//! itself: what goes out it returns.

use tomoswarm_proto::{Boot, Hello, Interest, Message, OperatorId};

use super::super::alarm::Alarm;
use crate::exchange::egress::OutboundFrame;
use crate::exchange::presence::Presence;
use crate::exchange::{Exchange, ExchangeCounts, ReceivedFrame};
use crate::sim::bus::{BusFrame, NodeId};
use crate::time::Time;

/// A node's side of the bus.
#[derive(Debug)]
pub(super) struct NodeExchange {
    node: NodeId,
    kind: NodeKind,
    egress_bytes_per_s: u32,
    /// `None` = its software does not run.
    exchange: Option<Exchange>,
    alarm: Alarm,
    /// It was seen to take part.
    is_member: bool,
}

/// What a node is to the bus.
#[derive(Debug)]
enum NodeKind {
    /// It asks whether it may take part, and greets in this way.
    Asks(Hello),
    /// An operator, which greets by itself, and what it is interested in.
    Listens(OperatorId, Vec<Interest>),
}

impl NodeExchange {
    /// A node that greets in this way once it has joined, and may send so many bytes a second.
    pub(super) fn asking(greeting: Hello, egress_bytes_per_s: u32) -> NodeExchange {
        NodeExchange {
            node: greeting.node,
            kind: NodeKind::Asks(greeting),
            egress_bytes_per_s,
            exchange: None,
            alarm: Alarm::default(),
            is_member: false,
        }
    }

    /// An operator, which may send so many bytes a second.
    pub(super) fn listening(
        id: OperatorId,
        interest: Vec<Interest>,
        egress_bytes_per_s: u32,
    ) -> NodeExchange {
        let mut exchange = Exchange::new(egress_bytes_per_s, Presence::listening());
        exchange.speak();
        NodeExchange {
            node: NodeId::Operator(id),
            kind: NodeKind::Listens(id, interest),
            egress_bytes_per_s,
            exchange: Some(exchange),
            alarm: Alarm::default(),
            is_member: false,
        }
    }

    /// Returns which node it is.
    pub(super) fn node(&self) -> NodeId {
        self.node
    }

    /// Returns an operator with what it is interested in; `None` of another node.
    pub(super) fn operator(&self) -> Option<(OperatorId, &[Interest])> {
        match &self.kind {
            NodeKind::Asks(_) => None,
            NodeKind::Listens(id, interest) => Some((*id, interest)),
        }
    }

    /// Begins to ask whether the node may take part, as this start of it; returns false of one that need not ask.
    pub(super) fn join(&mut self, now: Time, boot: Boot, instance: u64) -> bool {
        let NodeKind::Asks(greeting) = &self.kind else {
            return false;
        };
        let own = Hello {
            boot,
            instance,
            ..greeting.clone()
        };
        let presence = Presence::asking(now, own);
        self.exchange = Some(Exchange::new(self.egress_bytes_per_s, presence));
        self.is_member = false;
        true
    }

    /// Is at the bus no more.
    pub(super) fn leave(&mut self) {
        self.exchange = None;
        self.alarm.cancel();
    }

    /// Returns whether it is at the bus, whether or not it may take part.
    pub(super) fn is_joined(&self) -> bool {
        self.exchange.is_some()
    }

    /// Returns whether it was seen to take part.
    pub(super) fn is_member(&self) -> bool {
        self.is_member
    }

    /// Returns how many frames it has taken and refused since its software started.
    pub(super) fn counts(&self) -> ExchangeCounts {
        self.exchange
            .as_ref()
            .map_or_else(Default::default, Exchange::counts)
    }

    /// Takes what the node says; returns what goes out at once.
    pub(super) fn say(&mut self, now: Time, message: &Message) -> Vec<OutboundFrame> {
        let Some(exchange) = self.exchange.as_mut() else {
            return Vec::new();
        };
        // A message too long for a frame is dropped here as a live bus would drop it.
        exchange.say(now, message).unwrap_or_default()
    }

    /// Does what is due; returns what goes out, and whether it takes part from now on. `is_linked` = somebody can hear it.
    pub(super) fn wake(
        &mut self,
        now: Time,
        is_linked: bool,
    ) -> Option<(Vec<OutboundFrame>, bool)> {
        let exchange = self.exchange.as_mut()?;
        if is_linked {
            exchange.meet(now);
        }
        let due = exchange.due(now);
        let joins = exchange.is_member() && !self.is_member;
        self.is_member = exchange.is_member();
        Some((due, joins))
    }

    /// Takes a frame.
    ///
    /// # Errors
    /// It is refused, or the node does not run; with a line for the log, where it is worth one.
    pub(super) fn hear(
        &mut self,
        now: Time,
        frame: &BusFrame,
    ) -> Result<ReceivedFrame, Option<String>> {
        let exchange = self.exchange.as_mut().ok_or(None)?;
        let (sender, bytes) = (frame.sender(), frame.bytes());
        let heard = exchange
            .admit(now, sender, bytes)
            .and_then(|()| frame.read().clone());
        let reception = heard.and_then(|heard| exchange.accept(now, bytes, heard));
        reception.map_err(|refusal| {
            let count = exchange.refuse(Some(sender), &refusal)?;
            let what = refusal.what();
            Some(format!(
                "refused {what} of {sender} ({count} so far): {refusal}"
            ))
        })
    }

    /// Sets its alarm to when it has something to do again; returns the wake that must be queued, if one must.
    pub(super) fn set_alarm(&mut self, now: Time) -> Option<(Time, u64)> {
        let at = self.exchange.as_ref().and_then(Exchange::deadline);
        self.alarm.set(now, at)
    }

    /// Returns whether a wake counts.
    pub(super) fn rings(&mut self, generation: u64) -> bool {
        self.alarm.rings(generation)
    }
}
