//! The map actor: turns scans into evidence in its own layer, joins the peers' layers, and repairs what
//! the network lost.
//!
//! It is told scans, the peers' states, whom the ground expects, peers' tiles, digests and wants. It says changed tiles
//! (to the mission at once; to the bus newly occupied ones at once, others once a second), digests and wants.
//! It plans nothing.
//!
//! Deadlines: `share tiles and digest`, `send an occupied tile again`, `ask for or send missing tiles`.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    Digest, LayerId, Message, State, TileAddress, TileReport, TileRequest, VehicleId,
};

use super::VehicleSettings;
use super::peers::{Peers, join_states};
use super::sensor::Scan;
use crate::actor::{Actor, Fault, Input, InputClass};
use crate::geom::Pose;
use crate::map::{
    Changes, JoinResult, MapTile, Mapper, Merged, OwnDisc, PeerBody, Repair, ScanReading,
    TileRefusal,
};
use crate::time::{Deadline, Time};

/// Changed tiles and the digest are published this often.
const SHARE_EVERY: Duration = Duration::from_secs(1);
/// Tiles published per second at most, besides newly occupied ones: typically 4 kB/s.
const SHARE_TILES: usize = 24;
/// A tile that becomes occupied again and again is published at once, then at most this often.
const OCCUPIED_EVERY: Duration = Duration::from_millis(100);

/// What the map actor can be told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum In {
    /// A range reading.
    Scan(Scan),
    /// Where a peer is.
    Peer(State),
    /// A ground station expects these vehicles.
    Expected(Vec<VehicleId>),
    /// A tile of a peer's layer.
    Tile(TileReport),
    /// What another node holds.
    Digest(Digest),
    /// What another node asks for.
    Want(TileRequest),
}

/// What the map actor can say.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[allow(
    clippy::large_enum_variant,
    reason = "nearly all of them are messages, and are taken out at once"
)]
pub enum Out {
    /// Tiles that changed, own and peers'.
    Tiles(Vec<MapTile>),
    /// For the bus.
    Publish(Message),
}

/// The map actor.
#[derive(Debug, Serialize, Deserialize)]
pub struct Map {
    settings: VehicleSettings,
    own: LayerId,
    merged: Merged,
    mapper: Mapper,
    /// Where peers may be, so that they are not mapped: their last legs, or where they stand.
    peers: Peers,
    /// Tiles of its own layer that have changed since they were published.
    unshared: BTreeSet<TileAddress>,
    /// The last one shared: the next ones after it have their turn.
    shared: TileAddress,
    share_at: Time,
    /// When newly occupied tiles were published last.
    occupied: BTreeMap<TileAddress, Time>,
    /// Those that became occupied again since, and when they may be published.
    occupied_again: BTreeMap<TileAddress, Time>,
    repair: Repair,
}

impl Map {
    /// Makes the actor with an empty map.
    pub fn new(settings: VehicleSettings) -> Map {
        let own = settings.layer();
        // Nodes share at different moments, so that the bus is not hit by all at once.
        let share_at =
            Time::ZERO + SHARE_EVERY + Duration::from_millis(37) * u32::from(settings.vehicle.0);
        let mut mapper = Mapper::new(own, settings.slice);
        if let Some(post) = settings.look.smallest_post {
            mapper.regard_posts(post.heard_m);
        }
        Map {
            own,
            merged: Merged::new(settings.lattice, Some(own)),
            mapper,
            peers: Peers::new(settings.vehicle),
            unshared: BTreeSet::new(),
            shared: TileAddress::default(),
            share_at,
            occupied: BTreeMap::new(),
            occupied_again: BTreeMap::new(),
            repair: Repair::new(Some(own)),
            settings,
        }
    }

    /// Returns the merged map.
    pub fn merged(&self) -> &Merged {
        &self.merged
    }

    fn scan(&mut self, now: Time, scan: &Scan, out: &mut Vec<Out>) {
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
            origin_sd_m: scan.pose.sd_m,
        };
        let changes = self.record(&reading, scan.pose);
        self.tell(now, changes, out);
    }

    fn record(&mut self, reading: &ScanReading, pose: Pose) -> Changes {
        let body = OwnDisc {
            at: pose.at,
            radius_m: self.settings.body.radius_m,
        };
        let sure_m = self.settings.body.radius_m + self.settings.lattice.cell_m();
        // One that has lost its place stands somewhere near it: what answers there is mapped like all that stands.
        let peers = self.peers.iter().filter_map(|(_, peer)| {
            Some(PeerBody {
                leg: &peer.claim,
                radius_m: peer.met_within_m(sure_m, pose.sd_m)?,
            })
        });
        let peers: Vec<PeerBody<'_>> = peers.collect();
        self.mapper.record(&mut self.merged, reading, body, &peers)
    }

    fn tell(&mut self, now: Time, changes: Changes, out: &mut Vec<Out>) {
        if changes.is_empty() {
            return;
        }
        let told = changes.changed.iter().chain(&changes.cleared).copied();
        let told: BTreeSet<TileAddress> = told.collect();
        let tiles = told
            .into_iter()
            .filter_map(|address| self.own_tile(address));
        let tiles: Vec<MapTile> = tiles.collect();
        self.unshared.extend(changes.changed);
        for address in changes.newly_occupied {
            let again_at = self
                .occupied
                .get(&address)
                .map_or(Time::ZERO, |at| *at + OCCUPIED_EVERY);
            if again_at > now {
                self.occupied_again.insert(address, again_at);
            } else {
                self.publish_occupied(now, address, out);
            }
        }
        if !tiles.is_empty() {
            out.push(Out::Tiles(tiles));
        }
    }

    /// Returns a tile of its own layer with what is known of it more finely.
    fn own_tile(&self, address: TileAddress) -> Option<MapTile> {
        Some(MapTile {
            report: self.merged.report(self.own, address)?,
            cleared: Some(self.mapper.cleared(address)),
        })
    }

    fn publish_occupied(&mut self, now: Time, address: TileAddress, out: &mut Vec<Out>) {
        self.occupied.insert(address, now);
        self.publish(now, address, out);
    }

    /// Publishes a tile of its own layer as it is now.
    fn publish(&mut self, now: Time, address: TileAddress, out: &mut Vec<Out>) {
        self.unshared.remove(&address);
        self.occupied_again.remove(&address);
        let Some(report) = self.merged.report(self.own, address) else {
            return;
        };
        self.repair.pass(now, &self.merged, &report);
        out.push(Out::Publish(Message::Tile(report)));
    }

    fn tile(&mut self, now: Time, report: TileReport, out: &mut Vec<Out>) {
        let joined = self.merged.join(&report);
        if joined == Err(TileRefusal::Own) && self.merged.disown(&report) {
            self.unshared.insert(report.address);
        }
        self.repair.pass(now, &self.merged, &report);
        match joined {
            Ok(JoinResult::Newer { .. }) => out.push(Out::Tiles(vec![report.into()])),
            // A known tile is nothing new; an impossible one is its sender's business.
            Ok(JoinResult::Known) | Err(_) => {}
        }
    }

    fn share(&mut self, now: Time, out: &mut Vec<Out>) {
        for _ in 0..SHARE_TILES {
            let after = (
                std::ops::Bound::Excluded(self.shared),
                std::ops::Bound::Unbounded,
            );
            let next = self
                .unshared
                .range(after)
                .next()
                .or_else(|| self.unshared.first())
                .copied();
            let Some(address) = next else { break };
            self.shared = address;
            self.publish(now, address, out);
        }
        self.occupied
            .retain(|_, at| now.since(*at) < OCCUPIED_EVERY);
        out.push(Out::Publish(Message::Digest(self.merged.digest())));
    }

    /// Asks for what is missing, and sends what others miss.
    fn mend(&mut self, now: Time, out: &mut Vec<Out>) {
        let mut messages = Vec::new();
        self.repair.wake(now, &self.merged, &mut messages);
        for message in messages {
            if let Message::Tile(report) = &message
                && report.layer == self.own
            {
                self.unshared.remove(&report.address);
                self.occupied_again.remove(&report.address);
            }
            out.push(Out::Publish(message));
        }
    }

    fn publish_again(&mut self, now: Time, out: &mut Vec<Out>) {
        let due = self
            .occupied_again
            .iter()
            .filter(|(_, at)| **at <= now)
            .map(|(address, _)| *address);
        for address in due.collect::<Vec<_>>() {
            self.publish_occupied(now, address, out);
        }
    }
}

impl Actor for Map {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        match input {
            In::Scan(scan) => self.scan(now, &scan, out),
            In::Peer(state) => self.peers.take(now, &state),
            In::Expected(vehicles) => self.peers.note_expected(now, &vehicles),
            In::Tile(report) => self.tile(now, report, out),
            In::Digest(digest) => self.repair.hear_digest(now, &self.merged, &digest),
            In::Want(want) => {
                self.repair.hear_want(now, &self.merged, &want);
                self.mend(now, out);
            }
        }
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        let share = Deadline {
            at: self.share_at,
            why: "share tiles and digest",
        };
        let again = self.occupied_again.values().min();
        let again = again.map(|at| Deadline {
            at: *at,
            why: "send an occupied tile again",
        });
        let repair = self.repair.deadline().map(|at| Deadline {
            at,
            why: "ask for or send missing tiles",
        });
        [again, repair]
            .into_iter()
            .fold(Some(share), Deadline::earlier)
    }

    fn wake(&mut self, now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        self.publish_again(now, out);
        if self.share_at <= now {
            self.share_at = now + SHARE_EVERY;
            self.share(now, out);
        }
        self.mend(now, out);
        Ok(())
    }
}

/// Which inputs replace unread ones.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Key {
    /// The state of one peer.
    Peer(VehicleId),
    /// Whom a ground station expects.
    Expected,
    /// A tile of a layer.
    Tile(LayerId, TileAddress),
}

impl Input for In {
    type Key = Key;

    fn class(&self) -> InputClass<Key> {
        match self {
            In::Peer(state) => InputClass::Latest(Key::Peer(state.vehicle)),
            In::Expected(_) => InputClass::Latest(Key::Expected),
            In::Tile(report) => InputClass::Latest(Key::Tile(report.layer, report.address)),
            In::Scan(_) | In::Digest(_) | In::Want(_) => InputClass::Queue,
        }
    }

    fn join(unread: In, newer: In) -> In {
        match (unread, newer) {
            // Tiles may overtake each other: the higher revision stays.
            (In::Tile(unread), In::Tile(newer)) if unread.revision > newer.revision => {
                In::Tile(unread)
            }
            (In::Peer(unread), In::Peer(newer)) => In::Peer(join_states(unread, newer)),
            (_, newer) => newer,
        }
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::StandReason;

    use super::super::tests_support::{settings, state};
    use super::*;
    use crate::geom::{Angle, Point};

    fn scan(range_m: Option<f64>) -> In {
        let pose = Pose {
            at: Point::new(1.0, 1.0),
            heading: Angle::default(),
            sd_m: 0.05,
        };
        In::Scan(Scan {
            pose,
            beam: Angle::default(),
            range_m,
            suspect: false,
        })
    }

    fn fed(map: &mut Map, inputs: Vec<In>) -> Vec<Out> {
        let mut out = Vec::new();
        for input in inputs {
            map.handle(Time::ZERO, input, &mut out).unwrap();
        }
        out
    }

    fn tiles_published(out: &[Out]) -> usize {
        out.iter()
            .filter(|out| matches!(out, Out::Publish(Message::Tile(_))))
            .count()
    }

    #[test]
    fn a_newly_seen_obstacle_is_published_at_once_and_free_space_later() {
        let mut map = Map::new(settings(1));
        let free = fed(&mut map, vec![scan(None), scan(None)]);
        assert_eq!(tiles_published(&free), 0);
        let hit = fed(&mut map, vec![scan(Some(2.0)); 6]);
        assert!(tiles_published(&hit) > 0);
        let mut out = Vec::new();
        map.wake(map.deadline().unwrap().at, &mut out).unwrap();
        assert!(
            out.iter()
                .any(|out| matches!(out, Out::Publish(Message::Digest(_))))
        );
    }

    #[test]
    fn a_peer_in_the_beam_is_not_mapped() {
        let mut map = Map::new(settings(1));
        fed(&mut map, vec![In::Peer(state(2, 3.2, 1.0))]);
        assert_eq!(tiles_published(&fed(&mut map, vec![scan(Some(2.0)); 6])), 0);
    }

    #[test]
    fn what_answers_where_a_peer_has_lost_its_place_is_mapped() {
        let mut map = Map::new(settings(1));
        let lost = State {
            sequence: 2,
            stands_under: Some(StandReason::NoPlace),
            ..state(2, 9.0, 9.0)
        };
        fed(&mut map, vec![In::Peer(state(2, 3.2, 1.0)), In::Peer(lost)]);
        assert!(tiles_published(&fed(&mut map, vec![scan(Some(2.0)); 6])) > 0);
    }

    /// Wakes an actor at its deadlines until `until`.
    fn woken(map: &mut Map, until: Time) -> Vec<Out> {
        let mut out = Vec::new();
        while let Some(deadline) = map.deadline().filter(|deadline| deadline.at <= until) {
            map.wake(deadline.at, &mut out).unwrap();
            assert!(map.deadline().unwrap().at > deadline.at, "{}", deadline.why);
        }
        out
    }

    #[test]
    fn a_tile_that_is_occupied_again_soon_after_is_published_once_more_with_all_of_it() {
        let mut map = Map::new(settings(1));
        let mut out = Vec::new();
        let told_at = |map: &mut Map, ms: u64, range_m: f64, out: &mut Vec<Out>| {
            let now = Time::from_nanos(ms * 1_000_000);
            (0..6).for_each(|_| map.handle(now, scan(Some(range_m)), out).unwrap());
        };
        told_at(&mut map, 0, 2.0, &mut out);
        let first = tiles_published(&out);
        told_at(&mut map, 10, 2.6, &mut out);
        told_at(&mut map, 20, 3.2, &mut out);
        assert_eq!(tiles_published(&out), first, "at most ten times a second");
        let again = woken(&mut map, Time::from_secs_f64(0.1));
        let reports = again.iter().filter_map(|out| match out {
            Out::Publish(Message::Tile(report)) => Some(report),
            Out::Publish(_) | Out::Tiles(_) => None,
        });
        let reports: Vec<_> = reports.collect();
        assert!(
            (1..=first).contains(&reports.len()),
            "{} of {first} tiles again",
            reports.len()
        );
        for report in reports {
            assert_eq!(
                map.merged.report(map.own, report.address).as_ref(),
                Some(report)
            );
        }
    }

    #[test]
    fn the_mission_and_the_bus_are_given_the_cells_of_the_map_itself() {
        let mut map = Map::new(settings(1));
        let out = fed(&mut map, vec![scan(Some(2.0)); 4]);
        let Some(Out::Tiles(tiles)) = out.last() else {
            panic!("no tiles")
        };
        for report in tiles {
            let held = map
                .merged
                .layer(map.own)
                .unwrap()
                .tile(report.report.address)
                .unwrap();
            assert!(std::sync::Arc::ptr_eq(&held.cells, &report.report.cells));
        }
        let mut peer = Map::new(settings(2));
        let heard = fed(&mut peer, vec![In::Tile(tiles[0].report.clone())]);
        let [Out::Tiles(heard)] = &heard[..] else {
            panic!("{heard:?}")
        };
        assert!(std::sync::Arc::ptr_eq(
            &heard[0].report.cells,
            &tiles[0].report.cells
        ));
    }

    #[test]
    fn what_others_say_of_the_own_layer_is_asked_for_and_put_right() {
        let mut map = Map::new(settings(1));
        fed(&mut map, vec![scan(Some(2.0)); 4]);
        woken(&mut map, Time::from_secs_f64(2.0));
        let mut report = map
            .merged
            .report(
                map.own,
                map.merged.layer(map.own).unwrap().tiles().next().unwrap().0,
            )
            .unwrap();
        (report.revision, report.cells) =
            (900, std::sync::Arc::new([17; tomoswarm_proto::TILE_CELLS]));
        let layer = tomoswarm_proto::LayerDigest {
            layer: map.own,
            tiles: 1,
            revisions: 900,
            hash: 1,
        };
        let mut out = Vec::new();
        map.handle(
            Time::from_secs_f64(2.0),
            In::Digest(Digest {
                layers: vec![layer],
            }),
            &mut out,
        )
        .unwrap();
        out.extend(woken(&mut map, Time::from_secs_f64(2.5)));
        let asks = |output: &Out| matches!(output, Out::Publish(Message::Want(want)) if want.layer == map.own);
        assert!(out.iter().any(asks), "{out:?}");
        out.clear();
        map.handle(Time::from_secs_f64(2.5), In::Tile(report.clone()), &mut out)
            .unwrap();
        out.extend(woken(&mut map, Time::from_secs_f64(4.0)));
        let own = map.merged.report(map.own, report.address).unwrap();
        assert!(own.revision == 901 && own.cells != report.cells);
        assert!(
            out.contains(&Out::Publish(Message::Tile(own))),
            "everybody is told"
        );
    }

    #[test]
    fn all_changed_tiles_have_their_turn_however_many_there_are() {
        let mut map = Map::new(settings(1));
        for place in 0..400 {
            let at = Point::new(f64::from(place % 20) * 6.4, f64::from(place / 20) * 6.4);
            let pose = Pose {
                at,
                heading: Angle::default(),
                sd_m: 0.05,
            };
            fed(
                &mut map,
                vec![In::Scan(Scan {
                    pose,
                    beam: Angle::default(),
                    range_m: None,
                    suspect: false,
                })],
            );
        }
        let mut shared = BTreeSet::new();
        let held = map.merged.layer(map.own).unwrap().tiles().count();
        let seconds = held.div_ceil(SHARE_TILES) as f64 + 1.1;
        for out in woken(&mut map, Time::from_secs_f64(seconds)) {
            if let Out::Publish(Message::Tile(report)) = out {
                assert!(shared.insert(report.address), "nothing is published twice");
            }
        }
        assert!(
            held > 400 && shared.len() == held,
            "{} of {held}",
            shared.len()
        );
    }

    #[test]
    fn a_digest_of_many_layers_is_not_answered_by_as_many_wants() {
        let layer = |vehicle| tomoswarm_proto::LayerDigest {
            layer: LayerId {
                vehicle: VehicleId(vehicle),
                boot: tomoswarm_proto::Boot(1),
            },
            tiles: 1,
            revisions: 1,
            hash: 1,
        };
        let digest = Digest {
            layers: (2..=255).map(layer).collect(),
        };
        let mut map = Map::new(settings(1));
        assert_eq!(fed(&mut map, vec![In::Digest(digest)]), []);
        let out = woken(&mut map, Time::from_secs_f64(0.16));
        assert_eq!(out.len(), 16, "wants come a few at a time");
        let out = woken(&mut map, Time::from_secs_f64(5.0));
        let wants = out
            .iter()
            .filter(|out| matches!(out, Out::Publish(Message::Want(_))))
            .count();
        assert_eq!(wants, 254 - 16, "and each once");
    }
}
