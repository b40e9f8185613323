//! What the network does with frames, without any node: two vehicles, a ground station and an operator that say nothing by
//! themselves.

use std::time::Duration;

use tomoswarm_proto::{Have, MessageKind, Progress, Sender};

use super::*;
use crate::sim::bus::BusModel;

const ONE: NodePlace = NodePlace::Vehicle(0);
const TWO: NodePlace = NodePlace::Vehicle(1);

fn greeting(node: Sender, venue_hash: u64) -> Hello {
    Hello::asking(node, Boot(1), venue_hash, 0)
}

fn network(venue_of_two: u64) -> Network {
    let vehicle = |id, venue| greeting(Sender::Vehicle(VehicleId(id)), venue);
    let greetings = Greetings {
        vehicles: vec![vehicle(1, 7), vehicle(2, venue_of_two)],
        ground: greeting(Sender::Ground, 7),
    };
    let operators = [(OperatorId(1), vec![Interest::Fleet])];
    let (noise, model) = (Noise::new(1), BusModel::default());
    let bus = SimulatedBus::new(noise, model);
    Network::new(bus, noise, 1_000_000, greetings, operators.into_iter())
}

fn schedule() -> Schedule {
    Schedule::new(Time::from_secs_f64(60.0), None)
}

fn place_of(node: NodeId) -> NodePlace {
    match node {
        NodeId::Vehicle(id) => NodePlace::Vehicle(usize::from(id.0) - 1),
        NodeId::Ground => NodePlace::Ground,
        NodeId::Operator(_) => NodePlace::Operator(0),
    }
}

/// Who takes part, from when on.
type Join = (NodePlace, Time);

/// What came of a frame, with whom it came to.
type HeardBy = (NodePlace, Hearing);

/// Carries frames until a second, and lets those leave that are expelled; returns who has joined, and what came of frames.
fn carry(
    network: &mut Network,
    schedule: &mut Schedule,
    until_s: f64,
) -> (Vec<Join>, Vec<HeardBy>) {
    let (mut joined, mut hearings) = (Vec::new(), Vec::new());
    schedule.push(Time::from_secs_f64(until_s), ScheduledEvent::Environment);
    loop {
        match schedule.pop().unwrap() {
            ScheduledEvent::Exchange { node, generation } => {
                if network.wake(node, generation, schedule) {
                    joined.push((node, schedule.now()));
                }
            }
            ScheduledEvent::Deliver { to, frame } => {
                let to = place_of(to);
                let hearing = network.hear(to, &frame, schedule);
                if hearing.expelled.is_some() {
                    network.leave(to);
                }
                hearings.push((to, hearing));
            }
            ScheduledEvent::Environment => return (joined, hearings),
            ScheduledEvent::Wake { .. }
            | ScheduledEvent::Fault(_)
            | ScheduledEvent::OperatorsBegin => {
                panic!("there is no node here")
            }
        }
    }
}

/// All three have joined at the beginning.
fn joined(venue_of_two: u64) -> (Network, Schedule) {
    let (mut network, mut schedule) = (network(venue_of_two), schedule());
    for node in [ONE, TWO, NodePlace::Ground] {
        network.join(node, Boot(1), &mut schedule);
    }
    (network, schedule)
}

fn progress() -> Message {
    Message::Mission(tomoswarm_proto::MissionProgress {
        vehicle: VehicleId(1),
        progress: Progress::default(),
        ..tomoswarm_proto::MissionProgress::default()
    })
}

fn heard_by(hearings: &[HeardBy], kind: MessageKind) -> Vec<NodePlace> {
    let is_it = |(to, hearing): &HeardBy| match &hearing.heard {
        Some(HeardMessage::Message(_, message)) => (message.kind() == kind).then_some(*to),
        Some(HeardMessage::Greeting(..) | HeardMessage::Unknown(_)) | None => None,
    };
    hearings.iter().filter_map(is_it).collect()
}

#[test]
fn all_take_part_after_a_while_and_are_heard_from_then_on() {
    let (mut network, mut schedule) = joined(7);
    network.publish(ONE, &progress(), &mut schedule);
    let (joined, hearings) = carry(&mut network, &mut schedule, 5.0);
    let mut who: Vec<NodePlace> = joined.iter().map(|(node, _)| *node).collect();
    who.sort_by_key(|node| format!("{node:?}"));
    assert_eq!(who, [NodePlace::Ground, ONE, TWO]);
    assert_eq!(
        heard_by(&hearings, MessageKind::Mission),
        [],
        "it did not take part"
    );
    network.publish(ONE, &progress(), &mut schedule);
    let (_, hearings) = carry(&mut network, &mut schedule, 6.0);
    let mut heard = heard_by(&hearings, MessageKind::Mission);
    heard.sort_by_key(|node| format!("{node:?}"));
    assert_eq!(heard, [NodePlace::Ground, NodePlace::Operator(0), TWO]);
}

#[test]
fn who_has_left_neither_hears_nor_says_anything() {
    let (mut network, mut schedule) = joined(7);
    carry(&mut network, &mut schedule, 5.0);
    network.leave(TWO);
    assert!(!network.is_joined(TWO) && network.is_joined(ONE));
    network.publish(TWO, &progress(), &mut schedule);
    network.publish(ONE, &progress(), &mut schedule);
    let (_, hearings) = carry(&mut network, &mut schedule, 6.0);
    let heard = heard_by(&hearings, MessageKind::Mission);
    assert_eq!(
        heard.len(),
        2,
        "the ground station and the operator: {heard:?}"
    );
    network.join(TWO, Boot(2), &mut schedule);
    let (joined, _) = carry(&mut network, &mut schedule, 11.0);
    assert_eq!(joined.len(), 1, "it asks anew");
}

#[test]
fn one_of_another_venue_is_expelled_and_the_others_say_why() {
    let (mut network, mut schedule) = joined(7);
    network.leave(TWO);
    carry(&mut network, &mut schedule, 5.0);
    let mut other = self::network(8);
    std::mem::swap(&mut network.vehicles[1], &mut other.vehicles[1]);
    network.join(TWO, Boot(1), &mut schedule);
    let (joined, hearings) = carry(&mut network, &mut schedule, 7.0);
    assert_eq!(joined, []);
    let expelled = hearings
        .iter()
        .filter(|(_, hearing)| hearing.expelled.is_some());
    assert!(expelled.clone().all(|(to, _)| *to == TWO) && expelled.count() > 0);
    let says = |(to, hearing): &HeardBy| *to == ONE && hearing.line.is_some();
    assert!(hearings.iter().any(says));
}

#[test]
fn a_frame_that_says_nothing_is_refused_with_a_line() {
    let (mut network, mut schedule) = joined(7);
    carry(&mut network, &mut schedule, 5.0);
    let frame = BusFrame::of_bytes(NodeId::Ground, &[1, 2, 3]);
    let hearing = network.hear(ONE, &frame, &mut schedule);
    assert!(hearing.heard.is_none() && hearing.expelled.is_none());
    assert!(
        hearing
            .line
            .is_some_and(|line| line.starts_with("refused "))
    );
    let have = Message::Have(Have::default());
    let forged = tomoswarm_proto::codec::encode(&have).unwrap();
    let forged = BusFrame::of_bytes(NodeId::Vehicle(VehicleId(2)), &forged);
    let hearing = network.hear(ONE, &forged, &mut schedule);
    assert!(hearing.heard.is_none(), "no vehicle says that");
}

#[test]
fn who_is_cut_off_from_all_others_asks_for_longer() {
    let mut network = network(7);
    let cut = crate::config::Partition {
        from: Time::ZERO,
        until: Time::from_secs_f64(30.0),
        sides: vec![vec![NodeId::Vehicle(VehicleId(1))]],
    };
    let model = BusModel {
        partitions: vec![cut],
        ..BusModel::default()
    };
    network.bus = SimulatedBus::new(Noise::new(1), model);
    let mut schedule = schedule();
    for node in [ONE, TWO, NodePlace::Ground] {
        network.join(node, Boot(1), &mut schedule);
    }
    let (joined, _) = carry(&mut network, &mut schedule, 20.0);
    // Whoever nobody can hear waits longer before it believes that it is alone.
    let since = |node| {
        let of_node = joined.iter().find(|(other, _)| *other == node);
        of_node.map(|(_, at)| at.since(Time::ZERO))
    };
    assert_eq!(since(TWO), Some(Duration::from_millis(300)));
    assert_eq!(since(ONE), Some(Duration::from_millis(1500)));
}
