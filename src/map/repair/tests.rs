//! What one node asks for and answers, looked at message by message.

use std::sync::Arc;

use tomoswarm_proto::{Boot, TILE_CELLS, VehicleId};

use super::*;
use crate::geom::Lattice;

fn layer(vehicle: u8) -> LayerId {
    LayerId {
        vehicle: VehicleId(vehicle),
        boot: Boot(1),
    }
}

fn tile(vehicle: u8, x: i32, revision: u32) -> TileReport {
    let address = TileAddress { slice: 0, x, y: 0 };
    TileReport {
        layer: layer(vehicle),
        address,
        revision,
        cells: Arc::new([-17; TILE_CELLS]),
    }
}

fn at(ms: u64) -> Time {
    Time::from_nanos(ms * 1_000_000)
}

/// A node that only listens, and what it holds.
struct Node {
    map: Merged,
    repair: Repair,
    output: Vec<(Time, Message)>,
}

impl Node {
    fn new(own: Option<LayerId>, tiles: &[TileReport]) -> Node {
        // The map is a listener's, so that a test can put tiles into any layer.
        let mut map = Merged::new(Lattice::new(0.2), None);
        for tile in tiles {
            map.join(tile).unwrap();
        }
        Node {
            map,
            repair: Repair::new(own),
            output: Vec::new(),
        }
    }

    fn hears_digest_of(&mut self, now: Time, other: &Node) {
        self.repair.hear_digest(now, &self.map, &other.map.digest());
    }

    fn hears(&mut self, now: Time, tile: &TileReport) {
        let _ = self.map.join(tile);
        self.repair.pass(now, &self.map, tile);
    }

    fn run(&mut self, until: Time) {
        while let Some(now) = self.repair.deadline().filter(|at| *at <= until) {
            let mut out = Vec::new();
            self.repair.wake(now, &self.map, &mut out);
            self.output
                .extend(out.into_iter().map(|message| (now, message)));
            assert!(self.repair.deadline().is_none_or(|next| next > now));
        }
    }

    fn wants(&self) -> Vec<(Time, TileRequest)> {
        let want = |(now, message): &(Time, Message)| match message {
            Message::Want(want) => Some((*now, want.clone())),
            _ => None,
        };
        self.output.iter().filter_map(want).collect()
    }

    fn tiles(&self) -> Vec<(Time, TileReport)> {
        let tile = |(now, message): &(Time, Message)| match message {
            Message::Tile(tile) => Some((*now, tile.clone())),
            _ => None,
        };
        self.output.iter().filter_map(tile).collect()
    }
}

#[test]
fn what_is_on_its_way_is_not_asked_for_and_what_was_lost_is() {
    let writer = Node::new(Some(layer(1)), &[tile(1, 0, 4), tile(1, 1, 2)]);
    let mut hearer = Node::new(Some(layer(2)), &[tile(1, 0, 3)]);
    hearer.hears_digest_of(at(0), &writer);
    hearer.hears(at(40), &tile(1, 0, 4));
    hearer.hears(at(60), &tile(1, 1, 3));
    hearer.run(at(5000));
    assert_eq!(
        hearer.wants(),
        [],
        "what came is even newer than the digest"
    );
    let mut deaf = Node::new(Some(layer(3)), &[tile(1, 0, 3)]);
    deaf.hears_digest_of(at(0), &writer);
    deaf.hears(at(40), &tile(1, 0, 4));
    deaf.run(at(5000));
    let known = vec![(tile(1, 0, 4).address, 4)];
    assert_eq!(
        deaf.wants(),
        [(
            at(150),
            TileRequest {
                layer: layer(1),
                known
            }
        )]
    );
}

#[test]
fn a_layer_is_asked_for_again_only_after_a_while() {
    let writer = Node::new(Some(layer(1)), &[tile(1, 0, 4)]);
    let mut hearer = Node::new(Some(layer(2)), &[]);
    for ms in (0..1000).step_by(10) {
        hearer.hears_digest_of(at(ms), &writer);
        hearer.run(at(ms));
    }
    let times: Vec<Time> = hearer.wants().into_iter().map(|(now, _)| now).collect();
    assert_eq!(times, [at(150), at(550), at(950)]);
}

#[test]
fn the_writer_answers_at_once_and_a_few_tiles_at_a_time() {
    let tiles: Vec<TileReport> = (0..40).map(|x| tile(1, x, 1)).collect();
    let mut writer = Node::new(Some(layer(1)), &tiles);
    writer.repair.hear_want(
        at(0),
        &writer.map,
        &TileRequest {
            layer: layer(1),
            known: vec![],
        },
    );
    writer.run(at(5000));
    let sent = writer.tiles();
    assert_eq!(
        sent.iter()
            .map(|(_, tile)| tile.clone())
            .collect::<Vec<_>>(),
        tiles
    );
    let times: Vec<Time> = sent.iter().map(|(now, _)| *now).collect();
    assert_eq!(
        (times[0], times[15], times[16], times[39]),
        (at(0), at(0), at(30), at(60))
    );
}

#[test]
fn who_sees_another_answer_stays_silent_and_goes_on_when_it_falls_silent() {
    let tiles: Vec<TileReport> = (0..4).map(|x| tile(1, x, 1)).collect();
    let want = TileRequest {
        layer: layer(1),
        known: vec![],
    };
    let mut second = Node::new(Some(layer(5)), &tiles);
    second.repair.hear_want(at(0), &second.map, &want);
    for (x, ms) in [(0, 120), (1, 150), (2, 180)] {
        second.run(at(ms));
        second.hears(at(ms), &tiles[x]);
    }
    second.run(at(5000));
    let own_turn_ms = 100 + 6 * 15;
    assert_eq!(second.tiles(), [(at(180 + own_turn_ms), tiles[3].clone())]);
    let mut alone = Node::new(None, &tiles);
    alone.repair.hear_want(at(0), &alone.map, &want);
    alone.run(at(5000));
    assert_eq!(alone.tiles().len(), 4);
    assert!(
        alone.tiles().iter().all(|(now, _)| *now == at(100)),
        "the ground is the first of the others"
    );
}

#[test]
fn an_older_tile_that_goes_by_answers_nothing() {
    let mut holder = Node::new(None, &[tile(1, 0, 7)]);
    holder.repair.hear_want(
        at(0),
        &holder.map,
        &TileRequest {
            layer: layer(1),
            known: vec![],
        },
    );
    holder.hears(at(20), &tile(1, 0, 6));
    holder.run(at(5000));
    assert_eq!(holder.tiles(), [(at(100), tile(1, 0, 7))]);
}

#[test]
fn several_who_ask_for_the_same_are_answered_once_and_who_missed_it_is_answered_again() {
    let mut writer = Node::new(Some(layer(1)), &[tile(1, 0, 1)]);
    let want = TileRequest {
        layer: layer(1),
        known: vec![],
    };
    for ms in [0, 10, 20, 99] {
        writer.repair.hear_want(at(ms), &writer.map, &want);
        writer.run(at(ms));
    }
    assert_eq!(writer.tiles().len(), 1);
    writer.repair.hear_want(at(160), &writer.map, &want);
    writer.run(at(5000));
    assert_eq!(writer.tiles().len(), 2);
}

#[test]
fn others_cannot_make_it_remember_without_bound() {
    let mut node = Node::new(
        Some(layer(1)),
        &(0..5000).map(|x| tile(2, x % 1000, 1)).collect::<Vec<_>>(),
    );
    for number in 0..3000_u32 {
        let layer = LayerId {
            vehicle: VehicleId(9),
            boot: Boot(number),
        };
        let digest = LayerDigest {
            layer,
            tiles: 1,
            revisions: u64::MAX,
            hash: 1,
        };
        node.repair.hear_digest(
            at(0),
            &node.map,
            &Digest {
                layers: vec![digest],
            },
        );
        node.repair.hear_want(
            at(0),
            &node.map,
            &TileRequest {
                layer,
                known: vec![],
            },
        );
        let far = TileReport {
            layer,
            ..tile(9, i32::MAX, number)
        };
        node.repair.pass(at(0), &node.map, &far);
    }
    assert!(node.repair.lacks.len() <= LACKS_MAX);
    assert!(node.repair.passed.is_empty() && node.repair.debts.is_empty());
}
