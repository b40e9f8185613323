//! Exchanges that speak with each other in virtual time, over a bus that only carries: every frame reaches every other
//! node 10 ms later.

use std::collections::VecDeque;
use std::time::Duration;

use tomoswarm_proto::codec::{VERSION, encode};
use tomoswarm_proto::{
    Boot, EmergencyName, EmergencyStop, Have, LayerId, Lease, MessageKind, MissionProgress,
    OpenStops, OperatorId, Order, OrderKind, Progress, Revision, RunId, SeenState, State,
    StopScope, TileAddress, TileRequest, Topic, VehicleId,
};

use super::*;

const TWO: Sender = Sender::Vehicle(VehicleId(2));
const THREE: Sender = Sender::Vehicle(VehicleId(3));
const VENUE: u64 = 5;
const BYTES_PER_S: u32 = 64_000;
/// What is taken from one sender at once, in seconds of what a node may send: four times as much, for four seconds.
const SAVED_UP_S: f64 = 16.0;
const DELAY: Duration = Duration::from_millis(10);

struct Node {
    name: Sender,
    exchange: Exchange,
    heard: Vec<Message>,
    /// Those that say something.
    verdicts: Vec<JoinEffect>,
}

impl Node {
    fn is_refused(&self) -> bool {
        self.verdicts
            .iter()
            .any(|verdict| matches!(verdict, JoinEffect::Refused(_)))
    }

    fn has_heard(&self, message: &Message) -> bool {
        self.heard.contains(message)
    }
}

#[derive(Default)]
struct Swarm {
    now: Time,
    nodes: Vec<Node>,
    /// When a frame arrives, by which node it was sent, under which name, and what it is.
    on_the_way: VecDeque<(Time, usize, Sender, Vec<u8>)>,
}

impl Swarm {
    /// Lets a node begin to ask; returns its place.
    fn join(&mut self, name: Sender, instance: u64, venue_hash: u64) -> usize {
        let own = Hello::asking(name, Boot(1), venue_hash, instance);
        let exchange = Exchange::new(BYTES_PER_S, Presence::asking(self.now, own));
        self.nodes.push(Node {
            name,
            exchange,
            heard: vec![],
            verdicts: vec![],
        });
        self.nodes.len() - 1
    }

    /// Puts a frame on the bus, whatever it is.
    fn put(&mut self, from: usize, frame: Vec<u8>) {
        self.on_the_way
            .push_back((self.now + DELAY, from, self.nodes[from].name, frame));
    }

    fn say(&mut self, from: usize, message: &Message) {
        let ready = self.nodes[from].exchange.say(self.now, message).unwrap();
        ready
            .into_iter()
            .for_each(|outbound| self.put(from, outbound.frame));
    }

    fn run(&mut self, span: Duration) {
        let until = self.now + span;
        loop {
            let present = self.nodes.iter().filter(|node| !node.is_refused());
            let deadlines = present.filter_map(|node| node.exchange.deadline());
            let arrival = self.on_the_way.front().map(|(at, ..)| *at);
            let Some(next) = deadlines.chain(arrival).min().filter(|next| *next <= until) else {
                break;
            };
            self.now = self.now.max(next);
            self.wake();
            while self
                .on_the_way
                .front()
                .is_some_and(|(at, ..)| *at <= self.now)
            {
                let Some((_, from, sender, frame)) = self.on_the_way.pop_front() else {
                    break;
                };
                self.deliver(from, sender, &frame);
            }
        }
        self.now = until;
    }

    /// Delivers all that is on the way, and lets nobody say anything meanwhile.
    fn deliver_all(&mut self) {
        self.now = self.now + DELAY;
        for (_, from, sender, frame) in std::mem::take(&mut self.on_the_way) {
            self.deliver(from, sender, &frame);
        }
    }

    /// Returns the places of all but those who had to leave.
    fn present(&self) -> Vec<usize> {
        (0..self.nodes.len())
            .filter(|node| !self.nodes[*node].is_refused())
            .collect()
    }

    fn wake(&mut self) {
        for node in self.present() {
            let exchange = &mut self.nodes[node].exchange;
            let due = exchange.due(self.now);
            assert!(
                exchange.deadline().is_none_or(|at| at > self.now),
                "woken in vain"
            );
            due.into_iter()
                .for_each(|outbound| self.put(node, outbound.frame));
        }
    }

    fn deliver(&mut self, from: usize, sender: Sender, frame: &[u8]) {
        for to in self.present().into_iter().filter(|to| *to != from) {
            let node = &mut self.nodes[to];
            let Ok(ReceivedFrame {
                heard,
                verdict,
                replies,
            }) = node.exchange.hear(self.now, sender, frame)
            else {
                continue;
            };
            match heard {
                Some(HeardMessage::Message(_, message)) => node.heard.push(message),
                Some(HeardMessage::Greeting(..) | HeardMessage::Unknown(_)) => {
                    panic!("a node is told messages only")
                }
                None => {}
            }
            if verdict != JoinEffect::Fine {
                node.verdicts.push(verdict);
            }
            replies
                .into_iter()
                .for_each(|outbound| self.put(to, outbound.frame));
        }
    }
}

fn state(vehicle: u8, sequence: u64) -> Message {
    Message::State(State {
        vehicle: VehicleId(vehicle),
        sequence,
        ..State::default()
    })
}

fn have(store: u64) -> Message {
    Message::Have(Have {
        store,
        ..Have::default()
    })
}

fn progress(vehicle: u8, run: u32) -> Message {
    let progress = Progress {
        run: RunId(run),
        ..Progress::default()
    };
    Message::Mission(MissionProgress {
        vehicle: VehicleId(vehicle),
        progress,
        ..MissionProgress::default()
    })
}

fn order(kind: OrderKind) -> Message {
    Message::Order(Order {
        vehicle: VehicleId(2),
        lease: Lease {
            number: 1,
            holder: 1,
        },
        run: RunId(1),
        revision: Revision(1),
        seen: Some(SeenState {
            boot: Boot(1),
            sequence: 1,
        }),
        kind,
        ends: vec![],
    })
}

fn seconds(span_s: f64) -> Duration {
    Duration::from_secs_f64(span_s)
}

#[test]
fn before_a_node_takes_part_it_only_greets() {
    let mut swarm = Swarm::default();
    let (two, three) = (swarm.join(TWO, 1, VENUE), swarm.join(THREE, 2, VENUE));
    swarm.say(two, &progress(2, 1));
    swarm.run(seconds(0.2));
    assert!(!swarm.nodes[two].exchange.is_member());
    assert!(!swarm.nodes[three].heard.is_empty(), "greetings are heard");
    assert!(
        swarm.nodes[three]
            .heard
            .iter()
            .all(|message| matches!(message, Message::Hello(_)))
    );
    swarm.run(seconds(0.3));
    assert!(swarm.nodes.iter().all(|node| node.exchange.is_member()));
    swarm.say(two, &progress(2, 2));
    swarm.run(seconds(0.6));
    assert!(
        swarm.nodes[three].has_heard(&progress(2, 2))
            && !swarm.nodes[three].has_heard(&progress(2, 1))
    );
}

#[test]
fn of_two_nodes_of_one_name_the_newcomer_leaves_and_the_other_goes_on() {
    for (elder, younger) in [(1, 9), (9, 1)] {
        let mut swarm = Swarm::default();
        let (first, ground) = (
            swarm.join(TWO, elder, VENUE),
            swarm.join(Sender::Ground, 50, VENUE),
        );
        swarm.run(seconds(5.0));
        let second = swarm.join(TWO, younger, VENUE);
        swarm.run(seconds(2.0));
        assert!(swarm.nodes[second].is_refused() && !swarm.nodes[second].exchange.is_member());
        assert!(!swarm.nodes[first].is_refused() && swarm.nodes[first].exchange.is_member());
        assert!(
            swarm.nodes[first]
                .verdicts
                .iter()
                .any(|verdict| matches!(verdict, JoinEffect::Stays(_)))
        );
        swarm.say(first, &progress(2, 1));
        swarm.run(seconds(0.6));
        assert!(swarm.nodes[ground].has_heard(&progress(2, 1)));
    }
}

#[test]
fn a_node_of_another_venue_is_refused_and_not_listened_to_but_which_stops_it_knows_are_open() {
    let mut swarm = Swarm::default();
    let two = swarm.join(TWO, 1, VENUE);
    swarm.run(seconds(3.0));
    let ground = swarm.join(Sender::Ground, 9, VENUE + 1);
    swarm.run(seconds(1.0));
    assert!(
        swarm.nodes[ground].is_refused(),
        "who comes later learns it"
    );
    assert!(
        swarm.nodes[two]
            .verdicts
            .iter()
            .any(|verdict| matches!(verdict, JoinEffect::Foreign(_)))
    );
    // One that goes on all the same.
    let stop = EmergencyStop {
        name: EmergencyName(0x1_0000),
        scope: StopScope::All,
        by: OperatorId(1),
    };
    let standing = |lifted: &[u32]| {
        let lifted = lifted.iter().copied().map(EmergencyName).collect();
        Message::Standing(OpenStops {
            open: vec![stop],
            lifted,
        })
    };
    for message in [
        order(OrderKind::Start),
        order(OrderKind::CutMotors),
        standing(&[5]),
    ] {
        swarm.put(ground, encode(&message).unwrap());
    }
    swarm.run(seconds(0.1));
    assert_eq!(
        swarm.nodes[two].heard,
        [standing(&[])],
        "what is open, and not what was lifted"
    );
}

#[test]
fn a_node_of_another_wire_version_is_refused_by_name_and_its_messages_are_counted() {
    let another = |mut frame: Vec<u8>| {
        frame[2] = VERSION + 1;
        frame
    };
    let mut swarm = Swarm::default();
    let two = swarm.join(TWO, 1, VENUE);
    swarm.run(seconds(3.0));
    let three = swarm.join(THREE, 2, VENUE);
    let hello = swarm.nodes[three].exchange.due(swarm.now).remove(0).frame;
    swarm.put(three, another(hello));
    swarm.put(three, another(encode(&progress(3, 1)).unwrap()));
    swarm.deliver_all();
    let Some(JoinEffect::Foreign(reason)) = swarm.nodes[two].verdicts.last() else {
        panic!("it fits?")
    };
    assert!(reason.contains("wire version"), "{reason}");
    assert_eq!(swarm.nodes[two].exchange.counts().refused, 1);
    assert!(swarm.nodes[two].heard.is_empty());
}

#[test]
fn a_flood_costs_its_sender_its_share_and_nobody_else_theirs() {
    let mut swarm = Swarm::default();
    let (two, three, ground) = (
        swarm.join(TWO, 1, VENUE),
        swarm.join(THREE, 2, VENUE),
        swarm.join(Sender::Ground, 3, VENUE),
    );
    swarm.run(seconds(3.0));
    let known = (0..1000)
        .map(|x| (TileAddress { slice: 0, x, y: 0 }, 1))
        .collect();
    let frame = encode(&Message::Want(TileRequest {
        layer: LayerId::default(),
        known,
    }))
    .unwrap();
    // A flooder does not ask its own exchange; all that it may save up is gone after the first of these.
    let many = (SAVED_UP_S * f64::from(BYTES_PER_S) / frame.len() as f64) as usize;
    (0..many + 1000).for_each(|_| swarm.put(three, frame.clone()));
    swarm.say(ground, &order(OrderKind::Hold));
    swarm.say(two, &state(2, 1));
    swarm.deliver_all();
    let by_ground = swarm.nodes[ground].exchange.counts();
    assert!((990..=1100).contains(&by_ground.refused), "{by_ground:?}");
    assert!(swarm.nodes[two].has_heard(&order(OrderKind::Hold)));
    assert!(swarm.nodes[ground].has_heard(&state(2, 1)));
    swarm.run(seconds(1.0));
    swarm.say(three, &progress(3, 1));
    swarm.run(seconds(0.6));
    assert!(
        swarm.nodes[ground].has_heard(&progress(3, 1)),
        "its share fills up again"
    );
}

#[test]
fn an_order_or_a_task_of_a_vehicle_and_what_is_said_in_anothers_name_are_refused_and_counted() {
    let mut swarm = Swarm::default();
    let (two, three) = (swarm.join(TWO, 1, VENUE), swarm.join(THREE, 2, VENUE));
    swarm.run(seconds(3.0));
    let (_, task) = examples::examples()
        .into_iter()
        .find(|(word, _)| *word == "task")
        .unwrap();
    for message in [order(OrderKind::CutMotors), progress(2, 7), task] {
        swarm.put(three, encode(&message).unwrap());
    }
    swarm.put(three, b"nonsense".to_vec());
    swarm.run(seconds(0.1));
    assert_eq!(swarm.nodes[two].exchange.counts().refused, 4);
    assert!(
        swarm.nodes[two]
            .heard
            .iter()
            .all(|message| matches!(message, Message::Hello(_)))
    );
}

#[test]
fn when_the_budget_is_spent_orders_go_at_once_and_of_states_the_newest_goes_later() {
    let mut exchange = Exchange::new(1000, Presence::listening());
    exchange.speak();
    let mut at_once = |message: &Message| !exchange.say(Time::ZERO, message).unwrap().is_empty();
    let sent_before = (0..)
        .take_while(|number| at_once(&state(2, *number)))
        .count() as u64;
    assert!(sent_before > 10);
    assert!(at_once(&order(OrderKind::Hold)));
    assert!(!at_once(&state(2, 1_000_000)));
    let newest = OutboundFrame::of(&state(2, 1_000_000)).unwrap();
    assert_eq!(newest.topic, Topic::of(&state(2, 0)));
    assert!(exchange.due(Time::ZERO).is_empty());
    let at = exchange.deadline().unwrap();
    assert!(at > Time::ZERO);
    assert_eq!(exchange.due(at), [newest]);
    assert_eq!(exchange.deadline(), None);
}

#[test]
fn what_is_said_again_and_again_travels_with_the_next_state_or_after_half_a_second() {
    let mut exchange = Exchange::new(BYTES_PER_S, Presence::listening());
    exchange.speak();
    let of = |message: &Message| OutboundFrame::of(message).unwrap();
    let at = |ms| Time::ZERO + Duration::from_millis(ms);
    for (ms, run) in [(0, 1), (100, 2)] {
        assert_eq!(exchange.say(at(ms), &have(run)).unwrap(), []);
    }
    assert_eq!(exchange.due(at(150)), []);
    assert_eq!(
        exchange.say(at(200), &state(2, 1)).unwrap(),
        [of(&state(2, 1)), of(&have(2))],
        "the newest of its topic, behind what it travels with"
    );
    assert_eq!(exchange.deadline(), None);
    for (ms, run) in [(1000, 3), (1400, 4)] {
        exchange.say(at(ms), &have(run)).unwrap();
        assert_eq!(
            exchange.deadline(),
            Some(at(1500)),
            "a later one waits no longer"
        );
    }
    assert_eq!(exchange.due(at(1499)), []);
    assert_eq!(exchange.due(at(1500)), [of(&have(4))]);
    assert_eq!(exchange.deadline(), None);
    exchange.say(at(1600), &have(5)).unwrap();
    assert_eq!(
        exchange
            .say(at(1600), &order(OrderKind::Hold))
            .unwrap()
            .len(),
        2,
        "also with what is urgent"
    );
}

#[test]
fn that_no_stop_is_open_travels_with_others_when_it_says_the_same_as_a_while_ago() {
    let mut exchange = Exchange::new(BYTES_PER_S, Presence::listening());
    exchange.speak();
    let stop = EmergencyStop {
        name: EmergencyName(0x1_0000),
        scope: StopScope::All,
        by: OperatorId(1),
    };
    let standing = |is_open: bool| {
        Message::Standing(OpenStops {
            open: is_open.then_some(stop).into_iter().collect(),
            lifted: vec![],
        })
    };
    let mut goes_at_once = |ms, is_open| {
        let now = Time::ZERO + Duration::from_millis(ms);
        !exchange.say(now, &standing(is_open)).unwrap().is_empty()
    };
    assert!(goes_at_once(0, false), "the first one");
    assert!(
        goes_at_once(25, false),
        "said again at once, it may have been lost"
    );
    assert!(!goes_at_once(1025, false), "a repeat");
    assert!(
        goes_at_once(1050, false),
        "the same at once again: somebody asks for it"
    );
    assert!(goes_at_once(2025, true), "a stop");
    assert!(goes_at_once(2050, true));
    for ms in [3050, 4050, 5050] {
        assert!(goes_at_once(ms, true), "an open stop waits for nobody");
    }
    assert!(goes_at_once(5060, false), "it is lifted");
    assert!(!goes_at_once(6060, false));
    assert!(goes_at_once(6070, true), "another one");
    let due = exchange.due(Time::ZERO + Duration::from_secs(9));
    assert!(
        due.is_empty(),
        "the repeat that waited is not said after it"
    );
}

#[test]
fn what_travels_with_others_keeps_to_the_budget() {
    let mut exchange = Exchange::new(1000, Presence::listening());
    exchange.speak();
    let at_once = |number: &u64, exchange: &mut Exchange| {
        !exchange
            .say(Time::ZERO, &state(2, *number))
            .unwrap()
            .is_empty()
    };
    assert!(
        (0..)
            .take_while(|number| at_once(number, &mut exchange))
            .count()
            > 10
    );
    exchange.say(Time::ZERO, &have(1)).unwrap();
    let urgent = exchange.say(Time::ZERO, &order(OrderKind::Hold)).unwrap();
    assert_eq!(urgent.len(), 1, "what is urgent alone");
    let due: Vec<MessageKind> = std::iter::from_fn(|| {
        let frames = exchange.due(exchange.deadline()?);
        Some(
            frames
                .into_iter()
                .map(|frame| frame.topic.kind)
                .collect::<Vec<_>>(),
        )
    })
    .flatten()
    .collect();
    assert_eq!(due, [MessageKind::State, MessageKind::Have], "none is lost");
}

#[test]
fn refusals_are_worth_a_line_at_powers_of_ten_for_each_sender_and_sort() {
    let mut exchange = Exchange::new(BYTES_PER_S, Presence::listening());
    let refusal = FrameRefusal::NotItsToSay { sender: TWO };
    let lines: Vec<u64> = (0..1000)
        .filter_map(|_| exchange.refuse(Some(TWO), &refusal))
        .collect();
    assert_eq!(lines, [1, 10, 100, 1000]);
    assert_eq!(exchange.refuse(Some(THREE), &refusal), Some(1));
    assert_eq!(
        exchange.refuse(Some(TWO), &FrameRefusal::OverShare),
        Some(1)
    );
    assert_eq!(exchange.counts().refused, 1002);
}

#[test]
fn a_listener_hears_everyone_and_greetings_of_every_version() {
    let mut listener = Exchange::new(BYTES_PER_S, Presence::listening());
    assert_eq!(listener.deadline(), None);
    assert!(
        listener
            .say(Time::ZERO, &progress(2, 1))
            .unwrap()
            .is_empty(),
        "it does not speak"
    );
    let mut swarm = Swarm::default();
    let two = swarm.join(TWO, 1, VENUE + 1);
    let mut frame = swarm.nodes[two].exchange.due(Time::ZERO).remove(0).frame;
    let heard = listener.hear(Time::ZERO, TWO, &frame).unwrap().heard;
    assert!(
        matches!(heard, Some(HeardMessage::Greeting(_, Some(_)))),
        "{heard:?}"
    );
    frame[2] = VERSION + 1;
    let heard = listener.hear(Time::ZERO, TWO, &frame).unwrap().heard;
    assert!(
        matches!(heard, Some(HeardMessage::Greeting(_, None))),
        "{heard:?}"
    );
    assert_eq!(
        listener.hear(Time::ZERO, THREE, &frame),
        Err(FrameRefusal::ForeignGreeting { node: TWO })
    );
    assert_eq!(
        listener.counts(),
        ExchangeCounts {
            taken: 2,
            taken_bytes: 2 * frame.len() as u64,
            refused: 1,
            unknown: 0,
            dropped: 0
        }
    );
}

#[test]
fn a_message_of_an_unknown_kind_is_counted_and_nothing_else_comes_of_it() {
    let mut swarm = Swarm::default();
    let (two, three) = (swarm.join(TWO, 1, VENUE), swarm.join(THREE, 2, VENUE));
    swarm.run(seconds(3.0));
    let heard = swarm.nodes[two].heard.len();
    let verdicts = swarm.nodes[two].verdicts.len();
    for kind in [MessageKind::ALL.len() as u8, u8::MAX] {
        let mut frame = encode(&progress(3, 1)).unwrap();
        frame[3] = kind;
        frame.extend(b"whatever it says");
        swarm.put(three, frame);
    }
    swarm.deliver_all();
    let node = &swarm.nodes[two];
    let ExchangeCounts {
        refused, unknown, ..
    } = node.exchange.counts();
    assert_eq!((refused, unknown, node.heard.len()), (0, 2, heard));
    assert_eq!(node.verdicts.len(), verdicts, "it is no objection");
    swarm.say(three, &progress(3, 2));
    swarm.run(seconds(0.6));
    assert!(
        swarm.nodes[two].has_heard(&progress(3, 2)),
        "its sender is listened to as before"
    );
    assert!(swarm.present().contains(&three));
}

#[test]
fn what_stands_is_heard_whatever_the_venue_and_a_task_is_not() {
    let mut swarm = Swarm::default();
    let two = swarm.join(TWO, 1, VENUE);
    swarm.run(seconds(3.0));
    let operator = swarm.join(Sender::Operator(OperatorId(7)), 9, VENUE + 1);
    swarm.run(seconds(1.0));
    let stop = EmergencyStop {
        name: EmergencyName(EmergencyName::LOWEST_DRAWN + 1),
        scope: StopScope::All,
        by: OperatorId(7),
    };
    let with_open = |open: Vec<EmergencyStop>| {
        Message::Standing(OpenStops {
            open,
            lifted: Vec::new(),
        })
    };
    let (nothing, standing) = (with_open(Vec::new()), with_open(vec![stop]));
    let (_, task) = examples::examples()
        .into_iter()
        .find(|(word, _)| *word == "task")
        .unwrap();
    for message in [&nothing, &standing, &task] {
        swarm.put(operator, encode(message).unwrap());
    }
    swarm.run(seconds(0.1));
    assert_eq!(
        swarm.nodes[two].heard,
        [standing],
        "that nothing stands is no news"
    );
}

#[test]
fn a_number_far_above_all_others_is_refused_by_nodes_and_shown_by_tools() {
    let mut swarm = Swarm::default();
    swarm.join(TWO, 1, VENUE);
    let mission = |lease_number: u32| {
        Message::Mission(MissionProgress {
            vehicle: VehicleId(3),
            lease_number,
            ..MissionProgress::default()
        })
    };
    let hear = |exchange: &mut Exchange, lease_number: u32| {
        let frame = encode(&mission(lease_number)).unwrap();
        exchange
            .hear(Time::ZERO, THREE, &frame)
            .map(|reception| reception.heard)
    };
    let node = &mut swarm.nodes[0].exchange;
    assert_eq!(
        hear(node, 5),
        Ok(Some(HeardMessage::Message(THREE, mission(5))))
    );
    let refusal = FrameRefusal::Leaps {
        what: "lease",
        number: u32::MAX,
        highest: 5,
    };
    assert_eq!(hear(node, u32::MAX), Err(refusal.clone()));
    assert_eq!(
        refusal.to_string(),
        "lease 4294967295 is too far above 5, the highest heard"
    );
    assert_eq!((node.counts().taken, node.counts().refused), (1, 1));
    let mut tool = Exchange::new(BYTES_PER_S, Presence::listening());
    assert!(hear(&mut tool, 5).is_ok() && hear(&mut tool, u32::MAX).is_ok());
}

#[test]
fn a_tool_believes_that_a_stop_is_lifted_by_those_of_its_venue_alone() {
    let stop = EmergencyStop {
        name: EmergencyName(77_777),
        scope: StopScope::All,
        by: OperatorId(1),
    };
    let said = |open: &[EmergencyStop], lifted: &[EmergencyName]| {
        let standing = OpenStops {
            open: open.to_vec(),
            lifted: lifted.to_vec(),
        };
        encode(&Message::Standing(standing)).unwrap()
    };
    let lifted = said(&[], &[stop.name]);
    let both = said(&[stop], &[EmergencyName(88_888)]);
    let mut tool = Exchange::new(BYTES_PER_S, Presence::listening_at(VENUE));
    let hears = |tool: &mut Exchange, frame: &[u8]| -> Option<(usize, usize)> {
        match tool.hear(Time::ZERO, TWO, frame).unwrap().heard? {
            HeardMessage::Message(_, Message::Standing(said)) => {
                Some((said.open.len(), said.lifted.len()))
            }
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(
        hears(&mut tool, &lifted),
        Some((0, 1)),
        "nobody has greeted"
    );
    let greeting = |venue_hash| {
        let hello = Hello::asking(TWO, Boot(1), venue_hash, 7);
        encode(&Message::Hello(hello)).unwrap()
    };
    tool.hear(Time::ZERO, TWO, &greeting(VENUE + 1)).unwrap();
    assert_eq!(hears(&mut tool, &lifted), None);
    assert_eq!(
        hears(&mut tool, &both),
        Some((1, 0)),
        "whoever stops is believed"
    );
    assert!(
        tool.hear(Time::ZERO, TWO, &encode(&progress(2, 1)).unwrap())
            .unwrap()
            .heard
            .is_some()
    );
    tool.hear(Time::ZERO, TWO, &greeting(VENUE)).unwrap();
    assert_eq!(
        hears(&mut tool, &both),
        Some((1, 1)),
        "it has another file now"
    );
    let mut newer = greeting(VENUE);
    newer[2] = VERSION + 1;
    tool.hear(Time::ZERO, TWO, &newer).unwrap();
    assert_eq!(hears(&mut tool, &lifted), None, "a wire of another version");
}

#[test]
fn what_a_node_says_itself_is_not_too_far_above_what_it_has_heard() {
    let mut swarm = Swarm::default();
    let two = swarm.join(TWO, 1, VENUE);
    swarm.run(Duration::from_secs(2));
    let of = |vehicle: u8, lease_number: u32| {
        Message::Mission(MissionProgress {
            vehicle: VehicleId(vehicle),
            lease_number,
            ..MissionProgress::default()
        })
    };
    let now = swarm.now;
    let node = &mut swarm.nodes[two].exchange;
    node.say(now, &of(2, 90_000)).unwrap();
    assert!(
        node.hear(now, THREE, &encode(&of(3, 90_001)).unwrap())
            .is_ok()
    );
}
