//! The bus between nodes, in memory: every frame is read once, whoever receives it. It delays, drops, doubles, reorders and
//! partitions by noise keyed by sender, count and receiver; nobody's traffic changes another's luck.
//!
//! It stores nothing: what is not delivered is gone. The caller hands the frames over in time, each to its receiver's
//! [`crate::exchange::Exchange`], which judges it.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use tomoswarm_proto::{
    Interest, LOG_LINE_BYTES_MAX, LogLine, LogLines, LogSeverity, Message, MessageKind,
    MessageSubject, OperatorId, Topic, VehicleId, fitted,
};

use super::noise::{Noise, NoisePurpose};
use crate::config::Partition;
use crate::exchange::egress::OutboundFrame;
use crate::exchange::ingress::{FrameRefusal, HeardMessage, read};
use crate::exchange::table::{VehicleSet, interest, row};
use crate::time::Time;

/// A node of the swarm: the ground station or a vehicle.
pub use tomoswarm_proto::Sender as NodeId;

/// Nothing arrives sooner than this.
pub const SHORTEST_DELAY: Duration = Duration::from_micros(1);

/// How the bus behaves.
#[derive(Clone, PartialEq, Debug)]
pub struct BusModel {
    /// Shortest time on the way.
    pub delay: Duration,
    /// Evenly distributed addition to it.
    pub jitter: Duration,
    /// Share of deliveries that are lost, 0 to 1.
    pub drop_share: f64,
    /// Share of deliveries that come twice, 0 to 1.
    pub duplicate_share: f64,
    /// When the bus is cut.
    pub partitions: Vec<Partition>,
}

impl Default for BusModel {
    /// A wireless network in order: 5 to 15 ms, nothing lost.
    fn default() -> BusModel {
        BusModel {
            delay: Duration::from_millis(5),
            jitter: Duration::from_millis(10),
            drop_share: 0.0,
            duplicate_share: 0.0,
            partitions: Vec::new(),
        }
    }
}

/// A frame as it travels: what its receivers read, with the length of its bytes.
#[derive(PartialEq, Debug)]
pub struct BusFrame {
    sender: NodeId,
    bytes: usize,
    /// What reading the bytes gave; the same for every receiver.
    read: Result<HeardMessage, FrameRefusal>,
}

impl BusFrame {
    /// Reads bytes as their receivers will, whatever they hold.
    pub fn of_bytes(sender: NodeId, bytes: &[u8]) -> BusFrame {
        BusFrame {
            sender,
            bytes: bytes.len(),
            read: read(sender, bytes),
        }
    }

    /// Returns who said it.
    pub fn sender(&self) -> NodeId {
        self.sender
    }

    /// Returns its length, bytes.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Returns what its receivers read.
    ///
    /// # Errors
    /// They refuse it.
    pub fn read(&self) -> &Result<HeardMessage, FrameRefusal> {
        &self.read
    }
}

/// A frame that reaches a node.
#[derive(Clone, PartialEq, Debug)]
pub struct BusDelivery {
    /// When.
    pub at: Time,
    /// Whom.
    pub to: NodeId,
    /// What arrives.
    pub frame: Arc<BusFrame>,
}

/// What a node has sent and was sent.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct NodeTraffic {
    /// Messages it has sent, each counted once.
    pub sent_messages: u64,
    /// Their bytes.
    pub sent_bytes: u64,
    /// Deliveries to it, doubles included.
    pub delivered_messages: u64,
    /// Their bytes.
    pub delivered_bytes: u64,
    /// Messages for it that were dropped or cut off.
    pub lost_messages: u64,
}

/// Bytes sent, by the word of the message's kind.
pub type BytesByKind = BTreeMap<&'static str, u64>;

/// What is told a moment of virtual time and what is heard then.
type Hears = dyn FnMut(Time, &HeardMessage);

/// Hears everything that an operator would hear, when it is said: nothing of it is lost, delayed or doubled, and nobody's
/// traffic changes by it.
pub struct BusListener {
    hears: Box<Hears>,
    /// Lines of each node's log so far.
    lines: BTreeMap<NodeId, u32>,
}

impl BusListener {
    /// Makes a listener of what it does with what it hears.
    pub fn new(hears: impl FnMut(Time, &HeardMessage) + 'static) -> BusListener {
        BusListener {
            hears: Box::new(hears),
            lines: BTreeMap::new(),
        }
    }
}

impl std::fmt::Debug for BusListener {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        to.write_str("BusListener")
    }
}

/// The bus.
#[derive(Debug)]
pub struct SimulatedBus {
    noise: Noise,
    model: BusModel,
    traffic: BTreeMap<NodeId, NodeTraffic>,
    /// Messages of each node that somebody was to hear: what nobody listens to changes nothing for the others.
    heard: BTreeMap<NodeId, u64>,
    sent_by_kind: BTreeMap<NodeId, BytesByKind>,
    listener: Option<BusListener>,
}

impl SimulatedBus {
    /// Makes a bus over which nothing was sent yet.
    pub fn new(noise: Noise, model: BusModel) -> SimulatedBus {
        SimulatedBus {
            noise,
            model,
            heard: BTreeMap::new(),
            traffic: BTreeMap::new(),
            sent_by_kind: BTreeMap::new(),
            listener: None,
        }
    }

    /// Lets somebody listen who is no node.
    pub fn with_listener(self, listener: BusListener) -> SimulatedBus {
        SimulatedBus {
            listener: Some(listener),
            ..self
        }
    }

    /// Lets whoever listens hear a line of a node's log, as operators are told it by live nodes.
    pub fn overhear(&mut self, now: Time, node: NodeId, line: fmt::Arguments<'_>) {
        let Some(listener) = &mut self.listener else {
            return;
        };
        // What operators do is heard as orders.
        if let NodeId::Operator(_) = node {
            return;
        }
        let number = listener.lines.entry(node).or_default();
        *number += 1;
        let said = LogLine {
            number: *number,
            age_ms: 0,
            severity: LogSeverity::Info,
            text: fitted(line.to_string(), LOG_LINE_BYTES_MAX),
        };
        let log = LogLines {
            node,
            // Lines are counted over all starts.
            instance: 1,
            lines: vec![said],
        };
        (listener.hears)(now, &HeardMessage::Message(node, Message::Log(log)));
    }

    /// Sends a frame to receivers (the sender among them is passed over) and returns what arrives.
    pub fn send(
        &mut self,
        now: Time,
        sender: NodeId,
        outbound: &OutboundFrame,
        receivers: &[NodeId],
    ) -> Vec<BusDelivery> {
        let frame = BusFrame::of_bytes(sender, &outbound.frame);
        if let (Some(listener), Ok(heard)) = (&mut self.listener, frame.read()) {
            let audience = row(outbound.topic.kind).audience(sender);
            if audience.is_some_and(|audience| audience.operators) {
                (listener.hears)(now, heard);
            }
        }
        let of_sender = self.sent_by_kind.entry(sender).or_default();
        *of_sender.entry(outbound.topic.kind.word()).or_default() += frame.bytes() as u64;
        self.carry(now, frame, receivers)
    }

    fn carry(&mut self, now: Time, frame: BusFrame, receivers: &[NodeId]) -> Vec<BusDelivery> {
        let (sender, bytes, frame) = (frame.sender, frame.bytes() as u64, Arc::new(frame));
        let traffic = self.traffic.entry(sender).or_default();
        traffic.sent_messages += 1;
        traffic.sent_bytes += bytes;
        let heard = self.heard.entry(sender).or_default();
        let count = *heard;
        *heard += u64::from(receivers.iter().any(|to| *to != sender));
        let mut deliveries = Vec::with_capacity(receivers.len());
        for to in receivers.iter().copied().filter(|to| *to != sender) {
            let copies = self.copies(now, sender, to, count);
            let traffic = self.traffic.entry(to).or_default();
            traffic.delivered_messages += copies;
            traffic.delivered_bytes += copies * bytes;
            traffic.lost_messages += u64::from(copies == 0);
            deliveries.extend((0..copies).map(|copy| {
                let at = now + self.delay(&[number(sender), count, number(to), copy]);
                BusDelivery {
                    at,
                    to,
                    frame: frame.clone(),
                }
            }));
        }
        deliveries
    }

    /// Returns whether two nodes hear each other at a moment. Operators sit beside the ground station: what cuts off the one
    /// cuts off the others.
    pub fn joins(&self, now: Time, a: NodeId, b: NodeId) -> bool {
        let (a, b) = (place_of(a), place_of(b));
        !self
            .model
            .partitions
            .iter()
            .any(|partition| partition.cuts(now, a, b))
    }

    /// Returns what every node has sent and was sent, ascending.
    pub fn traffic(&self) -> &BTreeMap<NodeId, NodeTraffic> {
        &self.traffic
    }

    /// Returns the bytes that every node has sent of each kind, ascending.
    pub fn sent_by_kind(&self) -> &BTreeMap<NodeId, BytesByKind> {
        &self.sent_by_kind
    }

    fn copies(&self, now: Time, sender: NodeId, to: NodeId, count: u64) -> u64 {
        let ids = [number(sender), count, number(to)];
        let dropped = self.noise.uniform(NoisePurpose::BusDrop, &ids) < self.model.drop_share;
        if dropped || !self.joins(now, sender, to) {
            return 0;
        }
        1 + u64::from(
            self.noise.uniform(NoisePurpose::BusDuplicate, &ids) < self.model.duplicate_share,
        )
    }

    fn delay(&self, ids: &[u64]) -> Duration {
        let jitter_ns =
            self.model.jitter.as_nanos() as f64 * self.noise.uniform(NoisePurpose::BusDelay, ids);
        self.model
            .delay
            .saturating_add(Duration::from_nanos(jitter_ns as u64))
            .max(SHORTEST_DELAY)
    }
}

/// Returns who of the operators hears what a sender says; each is named with what it is interested in.
pub fn operators_that_hear<'a>(
    sender: NodeId,
    kind: MessageKind,
    operators: impl Iterator<Item = (OperatorId, &'a [Interest])>,
) -> Vec<NodeId> {
    let is_told = row(kind)
        .audience(sender)
        .is_some_and(|audience| audience.operators);
    let of = interest(kind);
    let hears = |(_, wanted): &(OperatorId, &[Interest])| of.is_none_or(|of| wanted.contains(&of));
    operators
        .filter(|operator| is_told && hears(operator))
        .map(|(id, _)| NodeId::Operator(id))
        .collect()
}

fn place_of(node: NodeId) -> NodeId {
    match node {
        NodeId::Operator(_) => NodeId::Ground,
        NodeId::Ground | NodeId::Vehicle(_) => node,
    }
}

/// Returns which vehicles and ground station hear what a sender says, in a swarm of these vehicles and a ground station:
/// the vehicles first, in the order that is given.
pub fn receivers(
    sender: NodeId,
    topic: Topic,
    vehicles: impl Iterator<Item = VehicleId>,
) -> Vec<NodeId> {
    let Some(audience) = row(topic.kind).audience(sender) else {
        return Vec::new();
    };
    let ground = audience.ground.then_some(NodeId::Ground);
    match (audience.vehicles, topic.about) {
        (VehicleSet::All, _) => vehicles.map(NodeId::Vehicle).chain(ground).collect(),
        // An order for a vehicle that is not there is lost as any other can be.
        (VehicleSet::Addressed, MessageSubject::Vehicle(vehicle)) => [NodeId::Vehicle(vehicle)]
            .into_iter()
            .chain(ground)
            .collect(),
        (
            VehicleSet::Addressed,
            MessageSubject::Whole
            | MessageSubject::Run(_)
            | MessageSubject::Layer(_)
            | MessageSubject::Tile(..)
            | MessageSubject::Part(..),
        )
        | (VehicleSet::None, _) => ground.into_iter().collect(),
    }
}

fn number(node: NodeId) -> u64 {
    match node {
        NodeId::Ground => 0,
        NodeId::Vehicle(vehicle) => 1 + u64::from(vehicle.0),
        NodeId::Operator(operator) => 257 + u64::from(operator.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exchange::examples::examples;
    use crate::exchange::table::may_say;
    use tomoswarm_proto::{Message, MissionProgress, Progress, RunId};

    const A: NodeId = NodeId::Vehicle(VehicleId(1));
    const B: NodeId = NodeId::Vehicle(VehicleId(2));
    const ALL: [NodeId; 3] = [NodeId::Ground, A, B];

    fn message(run: u32) -> Message {
        let progress = Progress {
            run: RunId(run),
            ..Progress::default()
        };
        Message::Mission(MissionProgress {
            vehicle: VehicleId(1),
            progress,
            ..MissionProgress::default()
        })
    }

    /// What a node says: that of a vehicle in its own name.
    fn outbound(run: u32) -> OutboundFrame {
        OutboundFrame::of(&message(run)).unwrap()
    }

    fn send_many(model: BusModel, count: u32) -> (SimulatedBus, Vec<BusDelivery>) {
        let mut bus = SimulatedBus::new(Noise::new(1), model);
        let sent = (0..count)
            .flat_map(|run| bus.send(Time::ZERO, A, &outbound(run), &ALL))
            .collect();
        (bus, sent)
    }

    #[test]
    fn everybody_but_the_sender_reads_what_was_sent_within_the_delay() {
        let (_, sent) = send_many(BusModel::default(), 200);
        for (index, delivery) in sent.iter().enumerate() {
            assert_eq!(delivery.to, [NodeId::Ground, B][index % 2]);
            let read = Ok(HeardMessage::Message(A, message(index as u32 / 2)));
            assert_eq!(*delivery.frame.read(), read);
            let bounds = Duration::from_millis(5)..=Duration::from_millis(15);
            assert!(bounds.contains(&delivery.at.since(Time::ZERO)));
        }
        assert!(
            sent.windows(3).any(|three| three[2].at < three[0].at),
            "some overtake others"
        );
    }

    #[test]
    fn a_frame_is_read_once_for_all_and_names_its_sender() {
        let (_, sent) = send_many(BusModel::default(), 1);
        assert_eq!(sent.len(), 2);
        assert!(Arc::ptr_eq(&sent[0].frame, &sent[1].frame));
        assert_eq!(sent[0].frame.sender(), A);
    }

    #[test]
    fn shares_of_loss_and_doubles_are_kept() {
        let model = BusModel {
            drop_share: 0.2,
            duplicate_share: 0.1,
            ..BusModel::default()
        };
        let (bus, sent) = send_many(model, 10_000);
        let to_ground = bus.traffic()[&NodeId::Ground];
        assert!((to_ground.lost_messages as f64 - 2000.0).abs() < 160.0);
        assert!((to_ground.delivered_messages as f64 - 8000.0 * 1.1).abs() < 200.0);
        let delivered = to_ground.delivered_messages + bus.traffic()[&B].delivered_messages;
        assert_eq!(sent.len() as u64, delivered);
    }

    #[test]
    fn messages_and_bytes_are_counted_by_node() {
        let (bus, sent) = send_many(BusModel::default(), 10);
        let bytes: u64 = sent
            .iter()
            .map(|delivery| delivery.frame.bytes() as u64)
            .sum();
        assert_eq!(bus.traffic()[&A].sent_messages, 10);
        assert_eq!(bus.traffic()[&A].sent_bytes * 2, bytes);
        assert_eq!(bus.traffic()[&B].delivered_bytes * 2, bytes);
        assert_eq!(bus.traffic()[&A].delivered_messages, 0);
        let by_kind = BTreeMap::from([("mission", bus.traffic()[&A].sent_bytes)]);
        assert_eq!(bus.sent_by_kind(), &BTreeMap::from([(A, by_kind)]));
    }

    #[test]
    fn a_partition_cuts_between_its_sides_while_it_lasts() {
        let (from, until) = (Time::from_secs_f64(1.0), Time::from_secs_f64(2.0));
        let partitions = vec![Partition {
            from,
            until,
            sides: vec![vec![A]],
        }];
        let bus = SimulatedBus::new(
            Noise::new(1),
            BusModel {
                partitions,
                ..BusModel::default()
            },
        );
        let joined = |seconds_s, a, b| bus.joins(Time::from_secs_f64(seconds_s), a, b);
        assert!(joined(0.9, A, B) && joined(2.0, A, B));
        assert!(!joined(1.0, A, B) && !joined(1.5, NodeId::Ground, A));
        assert!(joined(1.5, NodeId::Ground, B));
        let mut bus = bus;
        let sent = bus.send(from, B, &outbound(1), &ALL);
        assert_eq!(
            sent.iter().map(|delivery| delivery.to).collect::<Vec<_>>(),
            [NodeId::Ground]
        );
        assert_eq!(bus.traffic()[&A].lost_messages, 1);
    }

    #[test]
    fn the_traffic_of_another_node_changes_nobodys_luck() {
        let model = BusModel {
            drop_share: 0.5,
            duplicate_share: 0.5,
            ..BusModel::default()
        };
        let (_, alone) = send_many(model.clone(), 100);
        let mut bus = SimulatedBus::new(Noise::new(1), model);
        let mut among_others = Vec::new();
        for run in 0..100 {
            bus.send(Time::ZERO, B, &outbound(run), &ALL);
            among_others.extend(bus.send(Time::ZERO, A, &outbound(run), &[B, NodeId::Ground]));
        }
        let sorted = |mut deliveries: Vec<BusDelivery>| {
            deliveries.sort_by_key(|delivery| (delivery.at, delivery.to));
            deliveries
        };
        assert_eq!(sorted(alone), sorted(among_others));
    }

    /// Who subscribed to what before there was a table.
    fn subscribers(message: &Message) -> Vec<NodeId> {
        match message {
            Message::Samples(_)
            | Message::Health(_)
            | Message::Look(_)
            | Message::Log(_)
            | Message::Settings(_) => vec![NodeId::Ground],
            Message::Order(order) => vec![NodeId::Vehicle(order.vehicle)],
            Message::Plan(_) | Message::Have(_) | Message::Report(_) => vec![A, B],
            Message::State(_)
            | Message::Tile(_)
            | Message::Digest(_)
            | Message::Want(_)
            | Message::Mission(_)
            | Message::Standing(_)
            | Message::Task(_)
            | Message::Hello(_) => vec![A, B, NodeId::Ground],
            Message::Fix(fix) => vec![NodeId::Vehicle(fix.vehicle)],
            Message::Mark(_) => vec![NodeId::Ground],
            Message::Beacon(_) | Message::Image(_) => Vec::new(),
        }
    }

    #[test]
    fn whoever_may_say_a_message_is_heard_by_its_subscribers() {
        for (word, message) in examples() {
            for sender in ALL.into_iter().filter(|sender| may_say(*sender, &message)) {
                let others = |nodes: Vec<NodeId>| -> Vec<NodeId> {
                    nodes.into_iter().filter(|node| *node != sender).collect()
                };
                let heard_by = receivers(
                    sender,
                    Topic::of(&message),
                    [VehicleId(1), VehicleId(2)].into_iter(),
                );
                assert_eq!(
                    others(heard_by),
                    others(subscribers(&message)),
                    "{word} of {sender}"
                );
            }
        }
    }

    #[test]
    fn an_operator_hears_what_it_is_interested_in_and_what_all_are_told() {
        let (fleet, map) = ([Interest::Fleet], [Interest::Map]);
        let operators = [
            (OperatorId(1), &fleet[..]),
            (OperatorId(2), &map[..]),
            (OperatorId(3), &[]),
        ];
        let mut heard: BTreeMap<NodeId, Vec<MessageKind>> = BTreeMap::new();
        for (_, message) in examples() {
            for sender in ALL.into_iter().filter(|sender| may_say(*sender, &message)) {
                for to in operators_that_hear(sender, message.kind(), operators.into_iter()) {
                    heard.entry(to).or_default().push(message.kind());
                }
            }
        }
        let kinds = |number: u8, of: &[MessageKind]| {
            let heard = &heard[&NodeId::Operator(OperatorId(number))];
            of.iter()
                .map(|kind| heard.contains(kind))
                .collect::<Vec<bool>>()
        };
        assert_eq!(
            kinds(
                1,
                &[
                    MessageKind::State,
                    MessageKind::Mission,
                    MessageKind::Report,
                    MessageKind::Tile
                ]
            ),
            [true, true, true, false]
        );
        assert_eq!(
            kinds(
                2,
                &[MessageKind::State, MessageKind::Tile, MessageKind::Report]
            ),
            [false, true, true]
        );
        assert_eq!(
            kinds(
                3,
                &[
                    MessageKind::State,
                    MessageKind::Samples,
                    MessageKind::Image,
                    MessageKind::Report
                ]
            ),
            [false, false, false, true]
        );
    }

    #[test]
    fn a_bus_without_delay_still_takes_time() {
        let model = BusModel {
            delay: Duration::ZERO,
            jitter: Duration::ZERO,
            ..BusModel::default()
        };
        let (_, sent) = send_many(model, 1);
        assert!(sent[0].at > Time::ZERO);
    }

    #[test]
    fn what_its_sender_may_not_say_is_carried_and_read_as_a_refusal() {
        let mut bus = SimulatedBus::new(Noise::new(1), BusModel::default());
        let sent = bus.send(Time::ZERO, B, &outbound(1), &ALL);
        assert_eq!(sent.len(), 2);
        assert_eq!(
            *sent[0].frame.read(),
            Err(FrameRefusal::NotItsToSay { sender: B })
        );
    }
}
