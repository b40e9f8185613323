//! The map actor: turns scans into evidence in its own layer, joins the peers' layers, and repairs what
//! the network lost.
//!
//! It is told scans, the peers' states, peers' tiles, digests and wants. It says changed tiles
//! (to the mission at once; to the bus newly occupied ones at once, others once a second), digests and wants.
//! It plans nothing.
//!
//! Deadline: `share tiles and digest`.

use std::collections::BTreeSet;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Digest, LayerId, Message, State, TileAddress, TileReport, VehicleId, Want};

use super::Settings;
use super::peers::{Peer, Peers, join_states};
use super::sensor::Scan;
use crate::actor::{Actor, Class, Fault, Input};
use crate::geom::Pose;
use crate::map::{Body, Changes, Joined, Mapper, Merged, PeerBody, ScanReading};
use crate::time::{Deadline, Time};

/// Changed tiles and the digest are published this often.
const SHARE_EVERY: Duration = Duration::from_secs(1);
/// Tiles published per second at most, besides newly occupied ones: 12 kB/s.
const SHARE_TILES: usize = 12;
/// Wants sent for one digest.
const WANTS: usize = 16;
/// Tiles sent for one want.
const REPAIR_TILES: usize = 8;

/// What the map actor can be told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum In {
    /// A range reading.
    Scan(Scan),
    /// Where a peer is.
    Peer(State),
    /// A tile of a peer's layer.
    Tile(TileReport),
    /// What another node holds.
    Digest(Digest),
    /// What another node asks for.
    Want(Want),
}

/// What the map actor can say.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Out {
    /// Tiles that changed, own and peers'.
    Tiles(Vec<TileReport>),
    /// For the bus.
    Publish(Message),
}

/// The map actor.
#[derive(Debug, Serialize, Deserialize)]
pub struct Map {
    settings: Settings,
    own: LayerId,
    merged: Merged,
    mapper: Mapper,
    /// Where peers may be, so that they are not mapped: their last legs, or where they stand.
    peers: Peers,
    unshared: BTreeSet<TileAddress>,
    share_at: Time,
}

impl Map {
    /// Makes the actor with an empty map.
    pub fn new(settings: Settings) -> Map {
        let own = LayerId { vehicle: settings.vehicle, boot: settings.boot };
        // Nodes share at different moments, so that the bus is not hit by all at once.
        let share_at = Time::ZERO + SHARE_EVERY + Duration::from_millis(37) * u32::from(settings.vehicle.0);
        Map {
            own,
            merged: Merged::new(settings.lattice, Some(own)),
            mapper: Mapper::new(own, settings.slice),
            peers: Peers::new(settings.vehicle),
            unshared: BTreeSet::new(),
            share_at,
            settings,
        }
    }

    /// Gives the merged map.
    pub fn merged(&self) -> &Merged {
        &self.merged
    }

    fn scan(&mut self, scan: &Scan, out: &mut Vec<Out>) {
        if scan.suspect {
            return;
        }
        let look = &self.settings.look;
        let reading = ScanReading {
            origin: scan.pose.at,
            direction: scan.pose.heading + scan.beam,
            half_width_rad: look.half_angle.radians(),
            range_m: scan.range_m,
            max_range_m: look.max_range_m,
            sure_range_m: look.sure_range_m,
            min_range_m: look.min_range_m,
        };
        let changes = self.record(&reading, scan.pose);
        self.tell(changes, out);
    }

    fn record(&mut self, reading: &ScanReading, pose: Pose) -> Changes {
        let body = Body { at: pose.at, radius_m: self.settings.body.radius_m };
        let sure_m = self.settings.body.radius_m + self.settings.lattice.cell_m();
        let body_of = |peer: &'_ Peer| sure_m + 2.0 * (pose.sd_m + peer.sd_m);
        let peers: Vec<PeerBody<'_>> = self
            .peers
            .iter()
            .map(|(_, peer)| PeerBody { leg: &peer.claim, radius_m: body_of(peer) })
            .collect();
        self.mapper.record(&mut self.merged, reading, body, &peers)
    }

    fn tell(&mut self, changes: Changes, out: &mut Vec<Out>) {
        if changes.is_empty() {
            return;
        }
        let report = |address: &TileAddress| self.merged.report(self.own, *address);
        for tile in changes.newly_occupied.iter().filter_map(report) {
            out.push(Out::Publish(Message::Tile(tile)));
        }
        out.push(Out::Tiles(changes.changed.iter().filter_map(report).collect()));
        self.unshared.extend(changes.changed);
        for address in changes.newly_occupied {
            self.unshared.remove(&address);
        }
    }

    fn tile(&mut self, report: TileReport, out: &mut Vec<Out>) {
        match self.merged.join(&report) {
            Ok(Joined::Newer { .. }) => out.push(Out::Tiles(vec![report])),
            // A known tile is nothing new; an impossible one is its sender's business.
            Ok(Joined::Known) | Err(_) => {}
        }
    }

    fn share(&mut self, out: &mut Vec<Out>) {
        for _ in 0..SHARE_TILES {
            let Some(address) = self.unshared.pop_first() else { break };
            let tile = self.merged.report(self.own, address);
            out.extend(tile.map(|tile| Out::Publish(Message::Tile(tile))));
        }
        out.push(Out::Publish(Message::Digest(self.merged.digest())));
    }
}

impl Actor for Map {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        match input {
            In::Scan(scan) => self.scan(&scan, out),
            In::Peer(state) => self.peers.take(now, &state),
            In::Tile(report) => self.tile(report, out),
            In::Digest(digest) => {
                let wants = self.merged.want(&digest).into_iter().filter(|want| want.layer != self.own);
                out.extend(wants.take(WANTS).map(|want| Out::Publish(Message::Want(want))));
            }
            In::Want(want) => {
                let tiles = self.merged.answer(&want, REPAIR_TILES);
                out.extend(tiles.into_iter().map(|tile| Out::Publish(Message::Tile(tile))));
            }
        }
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        Some(Deadline { at: self.share_at, why: "share tiles and digest" })
    }

    fn wake(&mut self, now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        self.share_at = now + SHARE_EVERY;
        self.share(out);
        Ok(())
    }
}

/// Which inputs replace unread ones.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Key {
    /// The state of one peer.
    Peer(VehicleId),
    /// A tile of a layer.
    Tile(LayerId, TileAddress),
}

impl Input for In {
    type Key = Key;

    fn class(&self) -> Class<Key> {
        match self {
            In::Peer(state) => Class::Latest(Key::Peer(state.vehicle)),
            In::Tile(report) => Class::Latest(Key::Tile(report.layer, report.address)),
            In::Scan(_) | In::Digest(_) | In::Want(_) => Class::Queue,
        }
    }

    fn join(unread: In, newer: In) -> In {
        match (unread, newer) {
            // Tiles may overtake each other: the higher revision stays.
            (In::Tile(unread), In::Tile(newer)) if unread.revision > newer.revision => In::Tile(unread),
            (In::Peer(unread), In::Peer(newer)) => In::Peer(join_states(unread, newer)),
            (_, newer) => newer,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests_support::{settings, state};
    use super::*;
    use crate::geom::{Angle, Point};

    fn scan(range_m: Option<f64>) -> In {
        let pose = Pose { at: Point::new(1.0, 1.0), heading: Angle::default(), sd_m: 0.05 };
        In::Scan(Scan { pose, beam: Angle::default(), range_m, suspect: false })
    }

    fn told(map: &mut Map, inputs: Vec<In>) -> Vec<Out> {
        let mut out = Vec::new();
        for input in inputs {
            map.handle(Time::ZERO, input, &mut out).unwrap();
        }
        out
    }

    fn tiles_published(out: &[Out]) -> usize {
        out.iter().filter(|out| matches!(out, Out::Publish(Message::Tile(_)))).count()
    }

    #[test]
    fn a_newly_seen_obstacle_is_published_at_once_and_free_space_later() {
        let mut map = Map::new(settings(1));
        let free = told(&mut map, vec![scan(None), scan(None)]);
        assert_eq!(tiles_published(&free), 0);
        let hit = told(&mut map, vec![scan(Some(2.0)); 6]);
        assert!(tiles_published(&hit) > 0);
        let mut out = Vec::new();
        map.wake(map.deadline().unwrap().at, &mut out).unwrap();
        assert!(out.iter().any(|out| matches!(out, Out::Publish(Message::Digest(_)))));
    }

    #[test]
    fn a_peer_in_the_beam_is_not_mapped() {
        let mut map = Map::new(settings(1));
        told(&mut map, vec![In::Peer(state(2, 3.2, 1.0))]);
        assert_eq!(tiles_published(&told(&mut map, vec![scan(Some(2.0)); 6])), 0);
    }

    #[test]
    fn what_the_network_lost_is_asked_for_and_sent() {
        let (mut one, mut two) = (Map::new(settings(1)), Map::new(settings(2)));
        told(&mut one, vec![scan(Some(2.0)), scan(None)]);
        let mut said = Vec::new();
        one.share(&mut said);
        let Some(Out::Publish(Message::Digest(digest))) = said.pop() else { panic!("no digest") };
        let wants = told(&mut two, vec![In::Digest(digest)]);
        let [Out::Publish(Message::Want(want))] = &wants[..] else { panic!("{wants:?}") };
        for out in told(&mut one, vec![In::Want(want.clone())]) {
            let Out::Publish(Message::Tile(report)) = out else { panic!("not a tile") };
            told(&mut two, vec![In::Tile(report)]);
        }
        assert_eq!(one.merged.digest(), two.merged.digest());
    }

    #[test]
    fn a_digest_of_many_layers_is_not_answered_by_as_many_wants() {
        let layer = |vehicle| tomoswarm_proto::LayerDigest {
            layer: LayerId { vehicle: VehicleId(vehicle), boot: tomoswarm_proto::Boot(1) },
            tiles: 1,
            hash: 1,
        };
        let digest = Digest { layers: (2..=255).map(layer).collect() };
        let wants = told(&mut Map::new(settings(1)), vec![In::Digest(digest)]);
        assert!((1..=16).contains(&wants.len()), "{} wants", wants.len());
    }
}
