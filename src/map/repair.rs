//! Who asks for what the network lost, and who answers: digests, wants and tiles, without repeating for everybody
//! what one node sends already. It says when it wants to be woken; it holds no tile and sends nothing itself.
//!
//! - Who hears a digest that is ahead of its own map waits a little, since the tiles may be on their way, and asks
//!   then for what is still missing.
//! - A layer's writer answers at once; the others, each after a turn of its own, send what has not gone by
//!   meanwhile. While one of them answers, the rest wait on; when it falls silent, the next goes on.
//! - What has just gone by is not sent again: who missed it asks again.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    Digest, LayerDigest, LayerId, Message, TileAddress, TileReport, TileRequest,
};

use super::Merged;
use crate::time::Time;

/// Tiles that a digest knows of may be on their way for this long.
const GRACE: Duration = Duration::from_millis(150);
/// A layer is asked for at most this often.
const ASK_EVERY: Duration = Duration::from_millis(400);
/// Layers that are found wanting at the same time at most; others are when their digest is heard again.
const LACKS_MAX: usize = 256;
/// Wants sent at a time at most, and the time to the next ones.
const WANTS: usize = 16;
const WANTS_EVERY: Duration = Duration::from_millis(50);
/// Tiles sent at a time at most, and the time to the next ones: 533 a second, about 75 kB/s.
const TILES: usize = 16;
const TILES_EVERY: Duration = Duration::from_millis(30);
/// Tiles owed at most; who asks for more asks again.
const OWED_MAX: usize = 4096;
/// What has gone by is not sent again for this long. Less than [`GRACE`]: who asks has waited longer.
const RECENT: Duration = Duration::from_millis(100);
/// The ground station answers for others after this long, vehicles later, by their number.
const FIRST_TURN: Duration = Duration::from_millis(100);
const TURN: Duration = Duration::from_millis(15);
/// So many vehicles have turns of their own.
const TURNS: u8 = 32;

/// What one node lacks and owes.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Repair {
    own: Option<LayerId>,
    /// How long answering for another is left to others.
    turn: Duration,
    lacks: BTreeMap<LayerId, Lack>,
    /// When layers were asked for last.
    asked: BTreeMap<LayerId, Time>,
    /// Where the next want of a layer begins that has more tiles than a want names.
    continued: BTreeMap<LayerId, TileAddress>,
    debts: BTreeMap<LayerId, Debt>,
    /// What has just gone by, sent or heard: when, and which revision.
    passed: BTreeMap<(LayerId, TileAddress), (Time, u32)>,
    tiles_at: Time,
}

/// A layer of which somebody holds more.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
struct Lack {
    /// The furthest digest heard of it.
    digest: LayerDigest,
    ask_at: Time,
}

/// Tiles of a layer that somebody has asked for.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
struct Debt {
    due_at: Time,
    tiles: BTreeSet<TileAddress>,
}

impl Repair {
    /// Makes the repair of a node that writes the layer `own` (`None`: the ground station, which only listens).
    pub fn new(own: Option<LayerId>) -> Repair {
        let turns = |own: LayerId| u32::from(own.vehicle.0 % TURNS) + 1;
        Repair {
            own,
            turn: FIRST_TURN + own.map_or(Duration::ZERO, |own| TURN * turns(own)),
            lacks: BTreeMap::new(),
            asked: BTreeMap::new(),
            continued: BTreeMap::new(),
            debts: BTreeMap::new(),
            passed: BTreeMap::new(),
            tiles_at: Time::ZERO,
        }
    }

    /// Takes what another node holds.
    pub fn hear_digest(&mut self, now: Time, map: &Merged, digest: &Digest) {
        for theirs in digest.layers.iter().filter(|theirs| map.lacks(theirs)) {
            if self.lacks.len() >= LACKS_MAX && !self.lacks.contains_key(&theirs.layer) {
                continue;
            }
            let again = self
                .asked
                .get(&theirs.layer)
                .map_or(Time::ZERO, |asked| *asked + ASK_EVERY);
            let ask_at = again.max(now + GRACE);
            let lack = self.lacks.entry(theirs.layer).or_insert(Lack {
                digest: *theirs,
                ask_at,
            });
            let extent = |digest: &LayerDigest| (digest.revisions, digest.tiles, digest.hash);
            if extent(theirs) > extent(&lack.digest) {
                lack.digest = *theirs;
            }
        }
    }

    /// Takes what another node asks for.
    pub fn hear_want(&mut self, now: Time, map: &Merged, want: &TileRequest) {
        let room = OWED_MAX.saturating_sub(self.debts.values().map(|debt| debt.tiles.len()).sum());
        let is_missing =
            |address: &TileAddress| !self.has_just_passed(now, map, want.layer, *address);
        let tiles: Vec<TileAddress> = map
            .newer(want)
            .into_iter()
            .filter(is_missing)
            .take(room)
            .collect();
        if tiles.is_empty() {
            return;
        }
        let due_at = if self.own == Some(want.layer) {
            now
        } else {
            now + self.turn
        };
        let debt = self.debts.entry(want.layer).or_insert(Debt {
            due_at,
            tiles: BTreeSet::new(),
        });
        debt.tiles.extend(tiles);
    }

    fn has_just_passed(
        &self,
        now: Time,
        map: &Merged,
        layer: LayerId,
        address: TileAddress,
    ) -> bool {
        let passed = self.passed.get(&(layer, address));
        let held = held(map, layer, address);
        passed.is_some_and(|(at, revision)| now.since(*at) < RECENT && Some(*revision) >= held)
    }

    /// Takes a tile that goes over the bus, heard (once it is joined) or sent.
    pub fn pass(&mut self, now: Time, map: &Merged, report: &TileReport) {
        let TileReport {
            layer,
            address,
            revision,
            ..
        } = *report;
        // Only what is held is remembered: it bounds what others can make this node remember.
        if held(map, layer, address).is_none_or(|held| revision < held) {
            return;
        }
        self.passed.insert((layer, address), (now, revision));
        let Some(debt) = self.debts.get_mut(&layer) else {
            return;
        };
        if debt.tiles.remove(&address) && self.own != Some(layer) {
            // Somebody answers: what is left is left to it as long as it goes on.
            debt.due_at = debt.due_at.max(now + self.turn);
        }
        if debt.tiles.is_empty() {
            self.debts.remove(&layer);
        }
    }

    /// Returns when to wake it.
    pub fn deadline(&self) -> Option<Time> {
        let asks = self.lacks.values().map(|lack| lack.ask_at).min();
        let answers = self
            .debts
            .values()
            .map(|debt| debt.due_at.max(self.tiles_at))
            .min();
        asks.into_iter().chain(answers).min()
    }

    /// Says the wants and tiles that are due.
    pub fn wake(&mut self, now: Time, map: &Merged, out: &mut Vec<Message>) {
        self.passed.retain(|_, (at, _)| now.since(*at) < RECENT);
        self.asked.retain(|_, at| now.since(*at) < ASK_EVERY);
        self.ask(now, map, out);
        if now >= self.tiles_at {
            self.answer(now, map, out);
        }
    }

    fn ask(&mut self, now: Time, map: &Merged, out: &mut Vec<Message>) {
        let mut wants = 0;
        self.lacks.retain(|layer, lack| {
            if lack.ask_at > now {
                return true;
            }
            if !map.lacks(&lack.digest) {
                return false;
            }
            if wants == WANTS {
                lack.ask_at = now + WANTS_EVERY;
                return true;
            }
            wants += 1;
            self.asked.insert(*layer, now);
            let (want, next) = map.want(*layer, self.continued.remove(layer));
            self.continued.extend(next.map(|next| (*layer, next)));
            out.push(Message::Want(want));
            false
        });
    }

    fn answer(&mut self, now: Time, map: &Merged, out: &mut Vec<Message>) {
        let due = self.debts.iter().filter(|(_, debt)| debt.due_at <= now);
        let tiles =
            due.flat_map(|(layer, debt)| debt.tiles.iter().map(|address| (*layer, *address)));
        let tiles: Vec<(LayerId, TileAddress)> = tiles.take(TILES).collect();
        if tiles.is_empty() {
            return;
        }
        self.tiles_at = now + TILES_EVERY;
        for (layer, address) in tiles {
            if let Some(debt) = self.debts.get_mut(&layer) {
                debt.tiles.remove(&address);
            }
            let Some(report) = map.report(layer, address) else {
                continue;
            };
            self.passed.insert((layer, address), (now, report.revision));
            out.push(Message::Tile(report));
        }
        self.debts.retain(|_, debt| !debt.tiles.is_empty());
    }
}

/// Returns the revision that a map holds of a tile.
fn held(map: &Merged, layer: LayerId, address: TileAddress) -> Option<u32> {
    map.layer(layer)?.tile(address).map(|tile| tile.revision)
}

#[cfg(test)]
mod tests;
