//! Links that end, or through which nothing goes any more.

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::time::Duration;

use tomoswarm::run::bus::{BusSettings, HeardMessage, SessionTopology};
use tomoswarm_proto::{LayerId, Message, Sender};

use crate::member::{Member, progress, within};
use crate::relay::Relay;
use crate::swarm::{GROUND, Size, Swarm, Watch, free_address, vehicle};

/// How long a partition lasts.
const APART: Duration = Duration::from_secs(30);

/// Returns the sum of revisions that each vehicle says of its own layers.
fn own_layers(watch: &Watch) -> BTreeMap<LayerId, u64> {
    let own = watch.digests.iter().flat_map(|(node, (_, digest))| {
        let is_own = move |layer: LayerId| *node == Sender::Vehicle(layer.vehicle);
        digest
            .layers
            .iter()
            .filter(move |layer| is_own(layer.layer))
    });
    own.map(|layer| (layer.layer, layer.revisions)).collect()
}

/// Returns whether everyone holds at least this much of every layer.
fn all_hold(watch: &Watch, nodes: usize, least: &BTreeMap<LayerId, u64>) -> bool {
    let holds = |layer: &LayerId, revisions: &u64| {
        let of = |(_, digest): &(_, tomoswarm_proto::Digest)| {
            let held = digest.layers.iter().find(|held| held.layer == *layer);
            held.is_some_and(|held| held.revisions >= *revisions)
        };
        watch.digests.values().filter(|digest| of(digest)).count() >= nodes
    };
    least
        .iter()
        .all(|(layer, revisions)| holds(layer, revisions))
}

/// Waits until what was mapped apart is known to all.
fn until_joined(swarm: &Swarm, nodes: usize) {
    let mapped = swarm.look(own_layers);
    assert!(!mapped.is_empty());
    swarm.until("all hold what was mapped apart", 10, |watch| {
        all_hold(watch, nodes, &mapped)
    });
}

#[test]
fn a_vehicle_without_links_for_30_s_joins_again() {
    let mut swarm = Swarm::start(Size {
        vehicles: 3,
        laps: 2,
        relayed: true,
    });
    swarm.begin();
    swarm.until_samples(100);
    swarm.note("vehicle 3 is alone");
    swarm.border(&[vehicle(3)]).for_each(|relay| relay.cut());
    std::thread::sleep(APART);
    swarm.note("it is joined again");
    swarm
        .border(&[vehicle(3)])
        .for_each(|relay| relay.restore());
    until_joined(&swarm, 4);
    swarm.finish();
}

#[test]
fn two_halves_that_hear_nothing_of_each_other_for_30_s_join_again() {
    let mut swarm = Swarm::start(Size {
        vehicles: 4,
        laps: 2,
        relayed: true,
    });
    swarm.begin();
    swarm.until_samples(100);
    let half = [GROUND, vehicle(1), vehicle(2)];
    swarm.note("half and half: links are frozen without a word");
    swarm.border(&half).for_each(|relay| relay.freeze());
    std::thread::sleep(APART);
    swarm.note("joined again");
    swarm.border(&half).for_each(|relay| relay.restore());
    until_joined(&swarm, 5);
    swarm.finish();
}

#[test]
fn all_that_lose_the_bus_at_once_for_20_s_go_on() {
    let mut swarm = Swarm::start(Size {
        vehicles: 2,
        laps: 1,
        relayed: true,
    });
    swarm.begin();
    swarm.until_samples(100);
    swarm.note("everyone is alone");
    swarm.relays().for_each(|relay| relay.cut());
    std::thread::sleep(Duration::from_secs(20));
    swarm.note("joined again");
    swarm.relays().for_each(|relay| relay.restore());
    until_joined(&swarm, 3);
    swarm.finish();
}

#[test]
fn a_slow_and_late_bus_is_enough_for_a_sweep() {
    let mut swarm = Swarm::start(Size {
        vehicles: 2,
        laps: 1,
        relayed: true,
    });
    swarm
        .relays()
        .for_each(|relay| relay.shape(50_000.0, Duration::from_millis(50)));
    swarm.begin();
    swarm.finish();
    assert!(swarm.relays().all(|relay| relay.carried() > 10_000));
}

#[test]
fn damaged_bytes_on_every_link_for_20_s_stop_nobody_for_good() {
    let mut swarm = Swarm::start(Size {
        vehicles: 2,
        laps: 1,
        relayed: true,
    });
    swarm.begin();
    swarm.until_samples(20);
    swarm.note("bytes are damaged");
    swarm.relays().for_each(|relay| relay.damage(Some(1500)));
    std::thread::sleep(Duration::from_secs(20));
    swarm.relays().for_each(|relay| relay.damage(None));
    let damaged: u64 = swarm.relays().map(|relay| relay.damaged()).sum();
    swarm.note(&format!(
        "links are in order again, after {damaged} damaged bytes"
    ));
    assert!(damaged > 20);
    swarm.finish_after_damage();
}

/// Starts a ground station and vehicle 1, which connects to it through a relay.
fn two_members() -> (Member, Member, Relay) {
    let (hub, other) = (free_address(), free_address());
    let relay = Relay::start(hub);
    let of = |node, listen: SocketAddr, connect: Vec<String>| BusSettings {
        node,
        prefix: "tomoswarm/courtyard".to_owned(),
        topology: SessionTopology::Mesh,
        listen: vec![format!("tcp/{listen}")],
        connect,
        trust: None,
        lease: Duration::from_secs(3),
        egress_bytes_per_s: 1_000_000,
        gossip: false,
    };
    (
        Member::join(of(GROUND, hub, vec![])),
        Member::join(of(
            vehicle(1),
            other,
            vec![format!("tcp/{}", relay.address())],
        )),
        relay,
    )
}

#[test]
fn a_subscription_that_is_damaged_makes_nobody_deaf_for_good() {
    let (ground, one, relay) = two_members();
    let mut run = 0;
    let mut say = || {
        run += 1;
        one.publisher.publish(&progress(1, run));
        std::thread::sleep(Duration::from_millis(10));
    };
    let hears = |count: usize| move |ground: &Member| ground.heard_count() > count;
    let mut within_s = |seconds: u64, hears: &dyn Fn(&Member) -> bool| {
        within(Duration::from_secs(seconds), || {
            say();
            hears(&ground)
        })
    };
    assert!(within_s(10, &hears(0)));
    // All that is subscribed to is said anew with the connection; here it is changed into what is never said.
    relay.rewrite(Some((b"/**", b"/zz")));
    relay.cut();
    relay.restore();
    std::thread::sleep(Duration::from_secs(3));
    assert!(relay.damaged() > 0);
    relay.rewrite(None);
    let heard_before = ground.heard_count();
    assert!(
        !within_s(5, &hears(heard_before + 1)),
        "the link was not damaged"
    );
    assert!(
        within_s(25, &hears(heard_before + 100)),
        "the ground station stays deaf"
    );
}

#[test]
fn a_panic_of_the_bus_library_is_counted_and_its_session_opened_anew() {
    let (ground, one, relay) = two_members();
    let mut run = 0;
    let mut say = || {
        run += 1;
        one.publisher.publish(&progress(1, run));
        std::thread::sleep(Duration::from_millis(1));
    };
    assert!(within(Duration::from_secs(10), || {
        say();
        ground.heard_count() > 0
    }));
    // Names of keys are sent anew with every connection; one of them becomes impossible.
    relay.rewrite(Some((b"/*/hello", b".*/hello")));
    relay.cut();
    relay.restore();
    let panics = || ground.publisher.traffic().panics + one.publisher.traffic().panics;
    assert!(
        within(Duration::from_secs(20), || panics() > 0),
        "{} pieces were changed",
        relay.damaged()
    );
    relay.rewrite(None);
    relay.cut();
    relay.restore();
    let heard_before = ground.heard_count();
    let hears_again = || {
        say();
        ground.heard_count() > heard_before + 100
    };
    assert!(
        within(Duration::from_secs(30), hears_again),
        "after {} panics nothing is heard",
        panics()
    );
    let is_known = |heard: &HeardMessage| matches!(heard, HeardMessage::Message(_, message) if *message == progress(1, run_of(message)));
    assert!(
        ground.heard_of(vehicle(1)).iter().all(is_known),
        "what was damaged is not heard"
    );
}

fn run_of(message: &Message) -> u32 {
    match message {
        Message::Mission(mission) => mission.progress.run.0,
        other => panic!("{other:?}"),
    }
}
