//! The bus over loopback.

use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use tomoswarm_proto::{MissionProgress, Progress, RunId, VehicleId};

use super::*;
use crate::run::live::processes::free_ports;

const ONE: Sender = Sender::Vehicle(VehicleId(1));
const TWO: Sender = Sender::Vehicle(VehicleId(2));

fn settings(
    node: Sender,
    topology: SessionTopology,
    listen: &[String],
    connect: &[String],
) -> BusSettings {
    BusSettings {
        node,
        prefix: "tomoswarm/test".to_owned(),
        topology,
        listen: listen.to_vec(),
        connect: connect.to_vec(),
        trust: None,
        lease: Duration::from_secs(3),
        egress_bytes_per_s: 64_000,
        gossip: true,
    }
}

fn free_endpoint() -> String {
    format!("tcp/127.0.0.1:{}", free_ports(1).unwrap()[0])
}

fn open(settings: BusSettings) -> (BusSession, Receiver<HeardMessage>) {
    let (output, heard) = channel();
    let ear = Mutex::new(output);
    let hear = move |what| lock(&ear).send(what).unwrap_or_default();
    let bus = BusSession::open(settings, Clock::start(), Troubles::default(), hear).unwrap();
    bus.publisher().speak();
    (bus, heard)
}

/// Opens a node's bus and that of vehicle 2 beside it, which looks for it.
fn neighbours(first: Sender) -> [(BusSession, Receiver<HeardMessage>); 2] {
    let (here, there) = (free_endpoint(), free_endpoint());
    let listens = std::slice::from_ref(&here);
    let first = open(settings(first, SessionTopology::Mesh, listens, &[]));
    let second = settings(TWO, SessionTopology::Mesh, &[there], listens);
    [first, open(second)]
}

fn progress(of: u8, run: u32) -> Message {
    let progress = Progress {
        run: RunId(run),
        ..Progress::default()
    };
    Message::Mission(MissionProgress {
        vehicle: VehicleId(of),
        progress,
        ..MissionProgress::default()
    })
}

/// Publishes again and again until it is heard; links take a moment.
fn until_heard(
    publisher: &Publisher,
    message: &Message,
    heard: &Receiver<HeardMessage>,
) -> Option<HeardMessage> {
    (0..100).find_map(|_| {
        publisher.publish(message);
        heard.recv_timeout(Duration::from_millis(100)).ok()
    })
}

#[test]
fn peers_hear_each_other_and_nobody_hears_itself() {
    let [(one, by_one), (two, by_two)] = neighbours(ONE);
    assert_eq!(
        until_heard(&two.publisher(), &progress(2, 1), &by_one),
        Some(HeardMessage::Message(TWO, progress(2, 1)))
    );
    assert_eq!(
        until_heard(&one.publisher(), &progress(1, 1), &by_two),
        Some(HeardMessage::Message(ONE, progress(1, 1)))
    );
    assert!(
        by_two
            .try_iter()
            .all(|heard| matches!(heard, HeardMessage::Message(ONE, _)))
    );
    assert_eq!(one.publisher().links(), 1);
}

#[test]
fn clients_hear_each_other_through_the_ground_also_when_it_comes_later() {
    let hub = free_endpoint();
    let (one, _by_one) = open(settings(
        ONE,
        SessionTopology::Star,
        &[],
        std::slice::from_ref(&hub),
    ));
    let (two, by_two) = open(settings(
        TWO,
        SessionTopology::Star,
        &[],
        std::slice::from_ref(&hub),
    ));
    assert_eq!(two.publisher().links(), 0);
    let (_ground, _) = open(settings(Sender::Ground, SessionTopology::Star, &[hub], &[]));
    assert_eq!(
        until_heard(&one.publisher(), &progress(1, 7), &by_two),
        Some(HeardMessage::Message(ONE, progress(1, 7)))
    );
}

#[test]
fn a_peer_finds_its_neighbour_also_when_that_one_comes_later() {
    let (here, there) = (free_endpoint(), free_endpoint());
    let (one, _by_one) = open(settings(
        ONE,
        SessionTopology::Mesh,
        &[here],
        std::slice::from_ref(&there),
    ));
    std::thread::sleep(Duration::from_secs(1));
    let (_two, by_two) = open(settings(TWO, SessionTopology::Mesh, &[there], &[]));
    assert_eq!(
        until_heard(&one.publisher(), &progress(1, 7), &by_two),
        Some(HeardMessage::Message(ONE, progress(1, 7)))
    );
}

#[test]
fn what_is_not_the_senders_to_say_is_not_heard() {
    let [(one, by_one), (two, _)] = neighbours(ONE);
    until_heard(&two.publisher(), &progress(2, 1), &by_one).unwrap();
    // Progress of vehicle 1 under the key of vehicle 2.
    let refused = (0..100).any(|_| {
        two.publisher().publish(&progress(1, 2));
        std::thread::sleep(Duration::from_millis(20));
        one.publisher().traffic().refused > 0
    });
    assert!(refused);
    assert!(
        by_one
            .try_iter()
            .all(|heard| heard == HeardMessage::Message(TWO, progress(2, 1)))
    );
}

#[test]
fn a_port_in_use_is_refused_in_words() {
    let here = free_endpoint();
    let (_one, _) = open(settings(
        ONE,
        SessionTopology::Mesh,
        std::slice::from_ref(&here),
        &[],
    ));
    let again = BusSession::open(
        settings(TWO, SessionTopology::Mesh, std::slice::from_ref(&here), &[]),
        Clock::start(),
        Troubles::default(),
        |_| {},
    );
    let error = again.err().unwrap().to_string();
    assert!(error.contains(&here), "{error}");
}

#[test]
fn a_message_of_an_unknown_kind_is_counted_and_its_sender_is_heard_as_before() {
    let [(ground, by_ground), (two, _)] = neighbours(Sender::Ground);
    until_heard(&two.publisher(), &progress(2, 1), &by_ground).unwrap();
    let health = tomoswarm_proto::Health {
        vehicle: VehicleId(2),
        ..tomoswarm_proto::Health::default()
    };
    let mut unknown = OutboundFrame::of(&Message::Health(health)).unwrap();
    unknown.frame[3] = u8::MAX;
    let is_counted = (0..100).any(|_| {
        two.shared.send(unknown.clone());
        std::thread::sleep(Duration::from_millis(20));
        ground.publisher().traffic().unknown > 0
    });
    assert!(is_counted);
    assert_eq!(ground.publisher().traffic().refused, 0);
    assert!(
        by_ground
            .try_iter()
            .all(|heard| heard == HeardMessage::Message(TWO, progress(2, 1)))
    );
    assert_eq!(
        until_heard(&two.publisher(), &progress(2, 3), &by_ground),
        Some(HeardMessage::Message(TWO, progress(2, 3)))
    );
}

#[test]
fn what_is_older_than_what_was_said_since_is_not_sent() {
    let [(one, _by_one), (_two, by_two)] = neighbours(ONE);
    until_heard(&one.publisher(), &progress(1, 1), &by_two).unwrap();
    // Another thread has taken this one to send it, and gets no farther.
    let carried = OutboundFrame::of(&progress(1, 2)).unwrap();
    one.publisher().publish(&progress(1, 2));
    one.publisher().publish(&progress(1, 3));
    one.shared.send(carried);
    one.publisher().publish(&progress(1, 4));
    let all = std::iter::from_fn(|| by_two.recv_timeout(Duration::from_secs(1)).ok());
    let runs = all.filter_map(|heard| match heard {
        HeardMessage::Message(_, Message::Mission(said)) => Some(said.progress.run.0),
        _ => None,
    });
    let runs: Vec<u32> = runs.filter(|run| *run > 1).collect();
    assert_eq!(runs, [2, 3, 4]);
}

/// Returns the keys that a session was told of.
fn told(bus: &BusSession) -> Vec<String> {
    bus.shared.keys.told()
}

#[test]
fn a_session_is_told_of_the_keys_that_are_used_and_the_next_one_anew() {
    let [(one, by_one), (two, by_two)] = neighbours(ONE);
    let speak = || {
        until_heard(&one.publisher(), &progress(1, 1), &by_two).unwrap();
        until_heard(&two.publisher(), &progress(2, 1), &by_one).unwrap();
    };
    let keys = ["vehicle/1/mission", "vehicle/2/mission"];
    let keys = keys.map(|key| format!("tomoswarm/test/{key}"));
    // A session that was opened anew meanwhile is told of what is said then.
    let are_told = || {
        (0..100).any(|_| {
            speak();
            std::thread::sleep(Duration::from_millis(50));
            told(&one) == keys && told(&two) == keys
        })
    };
    assert!(are_told(), "{:?} {:?}", told(&one), told(&two));
    lock(&one.shared.hearing).change_roster();
    one.shared.more.notify_one();
    assert!((0..100).any(|_| {
        std::thread::sleep(Duration::from_millis(20));
        told(&one).is_empty()
    }));
    assert!(are_told(), "{:?} {:?}", told(&one), told(&two));
}

/// Opens a session again and again, and prints how much memory each opening leaves behind in the process: after a panic of
/// the library, too, when what it gave is left alone.
/// `cargo test --lib a_session_that_is_opened_again -- --ignored --nocapture`
#[test]
#[ignore = "takes a minute and a half, and wants the process for itself"]
fn a_session_that_is_opened_again_leaves_little_behind() {
    let [(one, by_one), (two, by_two)] = neighbours(ONE);
    let memory_kb = || {
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        let number = line.unwrap().split_whitespace().next().unwrap();
        number.parse::<u64>().unwrap()
    };
    let open_again = |has_panicked: bool| {
        until_heard(&one.publisher(), &progress(1, 1), &by_two).unwrap();
        until_heard(&two.publisher(), &progress(2, 1), &by_one).unwrap();
        let is_told = |count: usize| {
            (0..600).any(|_| {
                std::thread::sleep(Duration::from_millis(10));
                told(&one).len() == count
            })
        };
        assert!(is_told(2));
        match has_panicked {
            true => assert_eq!(guarded(|| panic!("as it shall")), None::<()>),
            false => lock(&one.shared.hearing).change_roster(),
        }
        one.shared.more.notify_one();
        assert!(is_told(0));
    };
    for (has_panicked, openings) in [(false, 60), (true, 20)] {
        (0..10).for_each(|_| open_again(has_panicked));
        let before_kb = memory_kb();
        (0..openings).for_each(|_| open_again(has_panicked));
        let left_kb = memory_kb().saturating_sub(before_kb) / openings;
        println!("panic of the library: {has_panicked}; {left_kb} kB an opening");
        assert!(has_panicked || left_kb < 100, "{left_kb} kB an opening");
    }
}
