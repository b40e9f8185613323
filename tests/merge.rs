//! The merge of the maps over a network that loses, doubles, reorders and cuts: whatever happened, soon after it is
//! over everybody holds the same map. The map actors and the station are the real ones, on virtual time.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

#[path = "merge/network.rs"]
mod network;

use network::{Act, Fault, Network, Weather};
use proptest::prelude::*;
use tomoswarm_proto::Message;

/// After so long on a quiet network all maps are equal, seconds: a digest, a want, an answer.
const WITHIN_S: f64 = 3.0;

/// What happens to a few nodes in some twenty seconds.
fn script() -> impl Strategy<Value = Vec<(f64, Act)>> {
    let act = prop_oneof![
        6 => (0..5_usize, 0..40_u32).prop_map(|(node, place)| Act::Scan { node, place }),
        1 => (0..5_usize).prop_map(|node| Act::Restart { node }),
        1 => (0..5_usize).prop_map(|node| Act::Stop { node }),
        1 => any::<u8>().prop_map(|sides| Act::Cut { sides }),
        1 => Just(Act::Join),
    ];
    prop::collection::vec((0.0..20.0, act), 5..60)
}

fn weather() -> impl Strategy<Value = Weather> {
    let shares = (
        prop_oneof![Just(0.0), 0.0..1.0],
        prop_oneof![Just(0.0), 0.0..0.5],
    );
    (any::<u64>(), shares, 1..400_u64).prop_map(|(seed, (loss, doubles), delay_ms)| Weather {
        seed,
        loss,
        doubles,
        delay_ms,
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]
    #[test]
    fn once_the_network_is_quiet_all_maps_are_equal(script in script(), weather in weather()) {
        let mut network = Network::new(3, weather);
        network.play(&script, 20.0);
        network.calm();
        let took_s = network.run_until_equal(10.0);
        prop_assert!(took_s.is_some_and(|took_s| took_s <= WITHIN_S), "{took_s:?}: {:?}", network.difference());
        // It stays so, and in the end nobody has anything left to say about it.
        network.run_for(5.0);
        let before = network.sent_tiles();
        network.run_for(5.0);
        prop_assert_eq!(network.difference(), None);
        prop_assert_eq!(network.sent_tiles(), before);
    }
}

/// A script in which much is lost: of what one node saw nothing arrives.
fn lossy() -> (Vec<(f64, Act)>, Weather) {
    let script = (0..30)
        .map(|step| {
            (
                f64::from(step) * 0.1,
                Act::Scan {
                    node: 0,
                    place: step,
                },
            )
        })
        .collect();
    (
        script,
        Weather {
            seed: 1,
            loss: 1.0,
            doubles: 0.0,
            delay_ms: 10,
        },
    )
}

#[test]
fn the_comparison_finds_maps_that_nobody_repairs() {
    for fault in [Fault::Wants, Fault::Digests, Fault::Tiles] {
        let (script, weather) = lossy();
        let mut network = Network::new(3, weather);
        network.play(&script, 5.0);
        network.calm();
        network.plant(fault);
        assert_eq!(
            network.run_until_equal(20.0),
            None,
            "that {fault:?} are missing was not found"
        );
        assert!(network.difference().is_some());
    }
    let (script, weather) = lossy();
    let mut network = Network::new(3, weather);
    network.play(&script, 5.0);
    network.calm();
    assert!(
        network
            .run_until_equal(20.0)
            .is_some_and(|took_s| took_s <= WITHIN_S)
    );
}

/// Eight vehicles that hold 8 layers of about 60 tiles.
fn full_fleet() -> Network {
    let mut network = Network::new(8, Weather::calm(3));
    let places = (0..8).flat_map(|node| {
        (0..49).map(move |place| (0.02 * f64::from(place), Act::Scan { node, place }))
    });
    network.play(&places.collect::<Vec<_>>(), 6.0);
    assert_eq!(network.difference(), None);
    let tiles = network.tiles_held();
    assert!((8 * 55..8 * 80).contains(&tiles), "{tiles} tiles in all");
    network
}

#[test]
fn a_late_joiner_is_complete_within_3_s() {
    let mut network = full_fleet();
    let before = network.sent_tiles();
    network.act(&Act::Join);
    let took_s = network.run_until_equal(10.0);
    println!("complete after {took_s:?} s");
    assert!(
        took_s.is_some_and(|took_s| took_s <= WITHIN_S),
        "{took_s:?}"
    );
    let (sent, missing) = (network.sent_tiles() - before, network.tiles_held());
    assert!(
        sent <= missing + missing / 10,
        "{sent} tiles sent for {missing} that were missing"
    );
}

#[test]
fn a_late_joiner_is_complete_within_3_s_also_when_only_one_is_left_who_knows() {
    let mut network = full_fleet();
    (1..8).for_each(|node| network.act(&Act::Stop { node }));
    network.stop_station();
    network.act(&Act::Join);
    let took_s = network.run_until_equal(10.0);
    println!("complete after {took_s:?} s");
    assert!(
        took_s.is_some_and(|took_s| took_s <= WITHIN_S),
        "{took_s:?}"
    );
}

#[test]
fn both_halves_are_one_within_3_s_after_a_minute_apart() {
    let mut network = Network::new(8, Weather::calm(5));
    network.act(&Act::Cut { sides: 0b0000_1111 });
    let places = (0..8).flat_map(|node| {
        (0..100).map(move |place| (0.6 * f64::from(place), Act::Scan { node, place }))
    });
    network.play(&places.collect::<Vec<_>>(), 60.0);
    assert!(network.difference().is_some());
    let before = network.sent_tiles();
    network.calm();
    let took_s = network.run_until_equal(10.0);
    println!("equal after {took_s:?} s");
    assert!(
        took_s.is_some_and(|took_s| took_s <= WITHIN_S),
        "{took_s:?}"
    );
    let (sent, held) = (network.sent_tiles() - before, network.tiles_held());
    assert!(
        sent <= held + held / 10,
        "{sent} tiles sent for {held} in all"
    );
}

#[test]
fn what_a_vehicle_saw_before_its_restart_is_given_back_to_it() {
    let mut network = Network::new(2, Weather::calm(9));
    network.play(
        &[
            (0.0, Act::Scan { node: 0, place: 3 }),
            (2.0, Act::Restart { node: 0 }),
        ],
        2.5,
    );
    network.play(&[(0.0, Act::Scan { node: 0, place: 4 })], 4.0);
    assert_eq!(network.difference(), None);
    assert_eq!(
        network.layers_of(0),
        2,
        "its earlier boot is a layer of its own"
    );
}

#[test]
fn on_a_network_in_order_nothing_is_sent_twice() {
    let mut network = Network::new(4, Weather::calm(2));
    let places = (0..4).flat_map(|node| {
        (0..80).map(move |place| (0.2 * f64::from(place), Act::Scan { node, place }))
    });
    network.play(&places.collect::<Vec<_>>(), 20.0);
    assert_eq!(network.difference(), None);
    assert_eq!(
        network.sent(|message| matches!(message, Message::Want(_))),
        0
    );
}
