//! What range readings say about cells: the inverse model of a sensor that hears a cone, written to its own layer.
//!
//! - **Empty** is what lies inside the cone, nearer than the echo and within `sure_range_m`: farther away a wall seen at a
//!   grazing angle gives no echo. A cell is free once all of it was seen empty, in two looks at least.
//! - An **echo** says that something on its arc answered and nothing nearer did. It is not spread over the arc: it is
//!   *assigned* to the part of a cell through which most arcs pass, and to a second one some way off if that has nearly as
//!   many. The cells of these are occupied, all others stay as they were. (Parts, since a whole cell would explain all arcs
//!   that touch half a metre of a straight wall, and leave holes in it.)
//! - **Near overrules far**: a cell drops out of an arc only when it was seen empty from as near as the echo came, and as a
//!   thin post is heard. Then the
//!   echoes that it explained, which are kept, are assigned anew, so what turns out to be empty hands its echoes to what is
//!   not. Ground seen empty from farther becomes unknown again at an echo that nothing certain explains.
//! - An echo of which the *whole* arc has been seen empty since, from well nearer than it came, is refuted and forgotten: a
//!   glitch, something that has gone, or a place or heading that was not what it was taken for.
//! - An assigned cell is *confirmed* when nothing else can have given one of its echoes: few cells were left, it is very
//!   near, or echoes from bearings well apart meet in it. Otherwise it is *doubtful*. Both are occupied.
//! - Echoes from near a peer are not mapped. Where the vehicle's own disc is, nothing else is.
//! - Who does not know the place by half a cell sees nothing *from near*: the empty cell may be the one beside.
//!
//! Every kept echo holds an occupied cell, so an obstacle is not lost by explaining; at worst it is drawn beside where it
//! stands. (What answers from afar answers from nearer too, within `sure_range_m`: so nothing that stands is refuted.) The
//! layer has one writer and tiles carry absolute values, so what others hold is simply replaced. (Hard assignment instead
//! of the shared weights of Moravec and Elfes 1985; the arcs' ambiguity as in Thrun 2003, *Learning occupancy grid maps
//! with forward sensor models*.)
//!
//! Not here: glitch filtering (the sensor's business), the reflex stop (the vehicle's).

mod cell_memory;
mod cone;
mod echoes;
mod own_memory;
mod reading;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{LayerId, TileAddress};

use self::cone::Cone;
use self::echoes::{Echo, cell_of_part, index_of_part};
use self::own_memory::{CellKey, OwnMemory};
pub use self::reading::{Changes, OwnDisc, PeerBody, ScanReading};
use super::tile::{address_of, index_in_tile};
use super::{CellRect, ClearedParts, Merged, PART_SIDE};
use crate::geom::{Cell, Lattice};

/// Echoes kept per tile; the oldest is dropped for a new one, and what it was assigned to stays as it is.
const ECHOES_KEPT: usize = 128;
/// So many kept echoes of the tile are assigned anew after each one that is heard, in turn.
const REASSIGNED: usize = 4;
/// An arc's votes, shared by the parts that are not excluded, and the most that each gets; the least is one.
const ARC_VOTES: usize = 96;
const MOST_VOTES: usize = 8;
/// A second part explains an echo too when it has at least this share of the first one's votes, in tenths.
const SECOND_TENTHS: u32 = 4;
/// It lies at least so many parts away.
const SECOND_PARTS: u32 = 6;
/// An echo from this near can be from nowhere else, centimetres.
const SURE_CM: u16 = 30;
/// Of arcs with at most so many cells left, the one that is chosen is sure.
const FEW_CELLS: usize = 2;
/// A cell seen empty from so much farther than an echo came from, or from nearer, cannot have given it, centimetres.
const NEAR_WINS_CM: u16 = 30;

/// An echo is refuted when its whole arc was seen empty from so much nearer than it came, centimetres.
const REFUTED_CM: u16 = 30;

/// Writes readings to its own layer of a map, and remembers what it needs to judge the next ones.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Mapper {
    own: LayerId,
    slice: i16,
    /// An echo from nearer may be of a post that is not heard from farther away, centimetres.
    #[serde(default)]
    post_heard_cm: u16,
    memory: OwnMemory,
    #[serde(skip)]
    scratch: Scratch,
}

/// What one reading needs, kept so that nothing is allocated for each.
#[derive(Clone, PartialEq, Debug, Default)]
struct Scratch {
    /// Cells whose published value may have changed.
    touched: Vec<CellKey>,
    /// Cells that explain an echo and have been seen empty from nearer.
    contradicted: Vec<CellKey>,
    /// Tiles with cells that are not free, of which more or fewer parts count as empty.
    cleared: Vec<usize>,
    /// The parts of the arc that is followed, counted in parts.
    arc: Vec<Cell>,
    /// The cells that they lie in.
    keys: Vec<Option<CellKey>>,
    writes: Vec<(usize, i8)>,
}

/// Which cells explain an echo.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Assignment {
    /// The one that explains most, and its place on the arc.
    best: usize,
    /// Another one that explains nearly as much.
    also: Option<usize>,
    /// How many cells could have given it.
    open: usize,
}

/// What became of a kept echo.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Reassigned {
    /// Cells explain it.
    Explained,
    /// Nothing can have given it.
    Refuted,
}

impl Mapper {
    /// Makes a mapper that writes the layer `own` at an altitude slice.
    pub fn new(own: LayerId, slice: i16) -> Mapper {
        Mapper {
            own,
            slice,
            post_heard_cm: 0,
            memory: OwnMemory::default(),
            scratch: Scratch::default(),
        }
    }

    /// Makes it count on posts that are heard from so far away and no farther, metres: what was seen empty from farther may
    /// be one.
    pub fn regard_posts(&mut self, heard_m: f64) {
        self.post_heard_cm = (heard_m * 100.0) as u16;
    }

    /// Returns from how far, or from nearer, a cell must have been seen empty that has not given an echo, centimetres.
    fn near_cm(&self, range_cm: u16) -> u16 {
        let near_cm = range_cm.saturating_add(NEAR_WINS_CM);
        if range_cm < self.post_heard_cm {
            near_cm.min(self.post_heard_cm)
        } else {
            near_cm
        }
    }

    /// Writes one reading. Readings with values that are not finite are ignored.
    pub fn record(
        &mut self,
        map: &mut Merged,
        scan: &ScanReading,
        body: OwnDisc,
        peers: &[PeerBody<'_>],
    ) -> Changes {
        let Some(cone) = Cone::of(scan, map.lattice()) else {
            return Changes::default();
        };
        self.scratch.touched.clear();
        self.scratch.contradicted.clear();
        self.scratch.cleared.clear();
        self.see_empty(map, &cone);
        self.cover(map, &cone, body.within_reach(&cone));
        self.reassign_contradicted(map.lattice(), scan);
        if let Some(range_m) = cone.echo_m {
            let echo = Echo::new(cone.origin, cone.axis, range_m, cone.half_width_rad);
            self.take_echo(map, echo, peers);
        }
        self.write(map)
    }

    /// Returns which parts of the cells of a tile it has seen empty although the cell is not free.
    pub fn cleared(&self, address: TileAddress) -> ClearedParts {
        self.memory.cleared(address)
    }

    /// Notes what the cone saw empty.
    fn see_empty(&mut self, map: &Merged, cone: &Cone) {
        let area = cone.area();
        let (columns, rows) = area.tiles();
        for y in rows {
            for x in columns.clone() {
                let address = TileAddress {
                    slice: self.slice,
                    x,
                    y,
                };
                if let Some(area) = CellRect::of_tile(address).overlap(area) {
                    self.see_empty_in(map, cone, address, area);
                }
            }
        }
    }

    /// Notes what the cone saw empty in a part of one tile.
    fn see_empty_in(&mut self, map: &Merged, cone: &Cone, address: TileAddress, area: CellRect) {
        let (mut tile, mut is_used) = (self.memory.find_tile(address), false);
        for cell in area.cells() {
            let index = index_in_tile(cell);
            let known = tile.map_or(0, |tile| self.memory.cell(CellKey { tile, index }).parts());
            let Some(seen) = cone.sees(cell, known) else {
                continue;
            };
            let tile = match tile {
                Some(tile) if is_used => tile,
                _ => *tile.insert(self.memory.tile(map, self.own, address)),
            };
            is_used = true;
            let key = CellKey { tile, index };
            let memory = self.memory.cell_mut(key);
            if memory.see_parts(seen.parts) && !memory.is_free() {
                self.scratch.cleared.push(tile);
            }
            if seen.quarters != 0 && memory.see_quarters(seen.quarters, seen.from_cm) {
                self.scratch.touched.push(key);
                if memory.explains_echoes() {
                    self.scratch.contradicted.push(key);
                }
            }
        }
    }

    /// Notes that nothing but the vehicle is where it stands.
    fn cover(&mut self, map: &Merged, cone: &Cone, body: OwnDisc) {
        let Some(area) = CellRect::around(cone.lattice, &[body.at], body.radius_m) else {
            return;
        };
        for cell in area.cells() {
            let quarters = body.covered_quarters(cone.lattice, cell);
            let parts = body.covered_parts(cone.lattice, cell);
            if quarters == 0 && parts == 0 {
                continue;
            }
            let Some(key) = self.key(map, cell) else {
                continue;
            };
            let memory = self.memory.cell_mut(key);
            if memory.cover_parts(parts) && !memory.is_free() {
                self.scratch.cleared.push(key.tile);
            }
            if quarters != 0 && memory.cover(quarters, cone.nearest_cm) {
                self.scratch.touched.push(key);
                if memory.explains_echoes() {
                    self.scratch.contradicted.push(key);
                }
            }
        }
    }

    /// Assigns anew the echoes of cells that have turned out to be empty.
    fn reassign_contradicted(&mut self, lattice: Lattice, scan: &ScanReading) {
        let contradicted = std::mem::take(&mut self.scratch.contradicted);
        for key in &contradicted {
            let memory = self.memory.cell(*key);
            if !memory.explains_echoes()
                || !memory.is_excluded(self.near_cm(memory.nearest_echo_cm()))
            {
                continue;
            }
            let (cell, reach_m) = (self.memory.cell_of(*key), 2.0 * scan.max_range_m);
            let chord_m = reach_m * libm::sin(scan.half_width_rad.clamp(0.0, 1.57));
            let (mut is_left, mut refuted) = (false, Vec::new());
            for (tile, echo) in self.memory.echoes_of(self.slice, cell, lattice, chord_m) {
                match self.reassign(lattice, tile, echo) {
                    Reassigned::Explained => {
                        is_left |= self.memory.echo(tile, echo).is_explained_by(cell);
                    }
                    Reassigned::Refuted => refuted.push((tile, echo)),
                }
            }
            // From the last of a tile on, so that the others keep their places.
            for (tile, echo) in refuted.into_iter().rev() {
                self.memory.remove_echo(tile, echo);
            }
            if !is_left {
                // Also what dropped echoes have left.
                self.memory.cell_mut(*key).clear_echoes();
                self.scratch.touched.push(*key);
            }
        }
        self.scratch.contradicted = contradicted;
    }

    /// Assigns an echo that was heard, and keeps it: unless a peer may have answered.
    fn take_echo(&mut self, map: &Merged, mut echo: Echo, peers: &[PeerBody<'_>]) {
        let lattice = map.lattice();
        self.follow(lattice, &echo);
        let half_cell_m = lattice.cell_m() / 2.0;
        let parts = part_lattice(lattice);
        let is_a_peers = |part: &Cell| {
            let middle = parts.centre(*part);
            peers.iter().any(|peer| peer.reaches(middle, half_cell_m))
        };
        if self.scratch.arc.iter().any(is_a_peers) {
            return;
        }
        let mut last = None;
        for index in 0..self.scratch.arc.len() {
            let cell = cell_of_part(self.scratch.arc[index]);
            let key = match last {
                Some((of, key)) if of == cell => key,
                _ => self.key(map, cell),
            };
            last = Some((cell, key));
            self.scratch.keys[index] = key;
        }
        let range_cm = echo.range_cm();
        self.vote(range_cm);
        let Some(assigned) = self.choose(lattice, &echo) else {
            return;
        };
        if self.scratch.keys[assigned.best].is_none_or(|key| !self.memory.cell(key).is_confirmed())
        {
            self.take_far_looks_back(range_cm);
        }
        if self.is_refuted(range_cm)
            && let Some(key) = self.scratch.keys[assigned.best]
        {
            // Something may have come there since: only later looks can refute it.
            self.memory.cell_mut(key).forget_looks();
        }
        (echo.to, echo.also) = self.parts_of(assigned);
        self.give(lattice, &echo, assigned);
        let Some(tile) = self.scratch.keys[assigned.best].map(|key| key.tile) else {
            return;
        };
        self.keep(tile, echo);
        self.reassign_some(lattice, tile);
    }

    /// Follows an echo's arc, and finds what is remembered of its cells.
    fn follow(&mut self, lattice: Lattice, echo: &Echo) {
        let Scratch { arc, keys, .. } = &mut self.scratch;
        echo.follow(part_lattice(lattice), arc);
        keys.clear();
        let mut last = None;
        for part in arc.iter() {
            let cell = cell_of_part(*part);
            let key = match last {
                Some((of, key)) if of == cell => key,
                _ => self.memory.find(self.slice, cell),
            };
            last = Some((cell, key));
            keys.push(key);
        }
    }

    /// Counts an arc for all of its cells that can have given its echo.
    fn vote(&mut self, range_cm: u16) {
        let near_cm = self.near_cm(range_cm);
        let Scratch { arc, keys, .. } = &self.scratch;
        let is_open = |key: &&CellKey| !self.memory.cell(**key).is_excluded(near_cm);
        let open = keys.iter().flatten().filter(is_open).count().max(1);
        let weight = (ARC_VOTES / open).clamp(1, MOST_VOTES) as u16;
        for (part, key) in arc.iter().zip(keys) {
            let Some(key) = key else { continue };
            let memory = self.memory.cell_mut(*key);
            if !memory.is_excluded(near_cm) {
                memory.vote(index_of_part(*part), weight);
            }
        }
    }

    /// Returns whether all of the arc that was followed was seen empty from well nearer than its echo came.
    fn is_refuted(&self, range_cm: u16) -> bool {
        let Some(near_cm) = range_cm.checked_sub(REFUTED_CM) else {
            return false;
        };
        let is_empty = |key: &Option<CellKey>| {
            key.is_some_and(|key| self.memory.cell(key).is_excluded(near_cm))
        };
        self.scratch.keys.iter().all(is_empty)
    }

    /// Chooses what on the arc that was followed explains its echo.
    fn choose(&self, lattice: Lattice, echo: &Echo) -> Option<Assignment> {
        let Scratch { arc, keys, .. } = &self.scratch;
        let (near_cm, parts) = (self.near_cm(echo.range_cm()), part_lattice(lattice));
        let (mut best, mut open, mut last) = (None, 0, None);
        for (index, key) in keys.iter().enumerate() {
            let Some(key) = key else { continue };
            let memory = self.memory.cell(*key);
            let is_open = !memory.is_excluded(near_cm);
            open += usize::from(is_open && last != Some(*key));
            last = Some(*key);
            // Of excluded cells the one that was looked at from the least near.
            let weight = match is_open {
                true => memory.votes(index_of_part(arc[index])),
                false => memory.seen_cm(),
            };
            let worth = (is_open, weight);
            let off_cm = |index: usize| echo.off_cm(parts.centre(arc[index]));
            // Of those that explain as much the one nearest to the middle of the arc, asked for seldom.
            let is_better = best.is_none_or(|(most, place)| {
                worth > most || (worth == most && off_cm(index) < off_cm(place))
            });
            if is_better {
                best = Some((worth, index));
            }
        }
        let ((is_open, votes), best) = best?;
        let needed = u32::from(votes) * SECOND_TENTHS;
        let mut also = None;
        for (index, key) in keys.iter().enumerate().filter(|_| is_open) {
            let Some(key) = key else { continue };
            let memory = self.memory.cell(*key);
            let votes = memory.votes(index_of_part(arc[index]));
            let is_far = arc[index].x.abs_diff(arc[best].x) >= SECOND_PARTS
                || arc[index].y.abs_diff(arc[best].y) >= SECOND_PARTS;
            let is_enough = u32::from(votes) * 10 >= needed && votes > 0;
            let is_more = also.is_none_or(|(most, _)| votes > most);
            if is_far && is_enough && is_more && !memory.is_excluded(near_cm) {
                also = Some((votes, index));
            }
        }
        Some(Assignment {
            best,
            also: also.map(|(_, index)| index),
            open,
        })
    }

    /// Returns the parts of an assignment.
    fn parts_of(&self, assigned: Assignment) -> (Cell, Option<Cell>) {
        let arc = &self.scratch.arc;
        (arc[assigned.best], assigned.also.map(|index| arc[index]))
    }

    /// What was seen empty from far less near than the echo of the arc that was followed came counts no more.
    fn take_far_looks_back(&mut self, range_cm: u16) {
        let near_cm = self.near_cm(range_cm);
        let Scratch { keys, touched, .. } = &mut self.scratch;
        for key in keys.iter().flatten() {
            let memory = self.memory.cell_mut(*key);
            if !memory.is_excluded(near_cm) && memory.is_seen_from_afar(near_cm) {
                memory.forget_looks();
                touched.push(*key);
            }
        }
    }

    /// Gives an echo to the cells that it is assigned to on the arc that was followed.
    fn give(&mut self, lattice: Lattice, echo: &Echo, assigned: Assignment) {
        let range_cm = echo.range_cm();
        let is_sure = (1..=FEW_CELLS).contains(&assigned.open) || range_cm <= SURE_CM;
        let cells = [
            Some((assigned.best, is_sure)),
            assigned.also.map(|index| (index, range_cm <= SURE_CM)),
        ];
        for (index, is_sure) in cells.into_iter().flatten() {
            let Some(key) = self.scratch.keys[index] else {
                continue;
            };
            let middle = lattice.centre(cell_of_part(self.scratch.arc[index]));
            let memory = self.memory.cell_mut(key);
            memory.give(range_cm, echo.sector_from(middle), is_sure);
            if memory.reopen_parts(echo.band_in(lattice, middle)) {
                self.scratch.cleared.push(key.tile);
            }
            self.scratch.touched.push(key);
        }
    }

    /// Takes an echo from the cells that it is assigned to.
    fn take(&mut self, echo: &Echo) {
        for part in [Some(echo.to), echo.also].into_iter().flatten() {
            if let Some(key) = self.memory.find(self.slice, cell_of_part(part)) {
                self.memory.cell_mut(key).take();
                self.scratch.touched.push(key);
            }
        }
    }

    /// Keeps an echo in a tile, in place of one that is like it, or of the oldest.
    fn keep(&mut self, tile: usize, echo: Echo) {
        let kept = self.memory.echoes(tile);
        match kept.iter().position(|one| one.is_like(&echo)) {
            Some(index) => {
                let old = kept[index];
                self.take(&old);
                self.memory.replace_echo(tile, index, echo);
            }
            None => self.memory.push_echo(tile, echo, ECHOES_KEPT),
        }
    }

    /// Assigns a few kept echoes of a tile anew: what has been learnt since may explain them better.
    fn reassign_some(&mut self, lattice: Lattice, tile: usize) {
        for _ in 0..REASSIGNED {
            if let Some(echo) = self.memory.next_turn(tile)
                && self.reassign(lattice, tile, echo) == Reassigned::Refuted
            {
                self.memory.remove_echo(tile, echo);
            }
        }
    }

    /// Assigns a kept echo anew, or takes it from its cells when it is refuted: then it is to be removed.
    fn reassign(&mut self, lattice: Lattice, tile: usize, index: usize) -> Reassigned {
        let mut echo = *self.memory.echo(tile, index);
        self.follow(lattice, &echo);
        let Some(assigned) = self.choose(lattice, &echo) else {
            return Reassigned::Explained;
        };
        if assigned.open == 0 && self.is_refuted(echo.range_cm()) {
            self.take(&echo);
            return Reassigned::Refuted;
        }
        let parts = self.parts_of(assigned);
        if parts != (echo.to, echo.also) {
            self.take(&echo);
            (echo.to, echo.also) = parts;
            self.give(lattice, &echo, assigned);
            self.memory.replace_echo(tile, index, echo);
        }
        Reassigned::Explained
    }

    /// Returns the key of a cell, of which is remembered from now on; `None` beyond the map's reach.
    fn key(&mut self, map: &Merged, cell: Cell) -> Option<CellKey> {
        let address = address_of(self.slice, cell)?;
        Some(CellKey {
            tile: self.memory.tile(map, self.own, address),
            index: index_in_tile(cell),
        })
    }

    /// Writes the values that have changed to its own layer.
    fn write(&mut self, map: &mut Merged) -> Changes {
        let Scratch {
            touched,
            writes,
            cleared,
            ..
        } = &mut self.scratch;
        touched.sort_unstable();
        touched.dedup();
        let mut changes = Changes::default();
        for keys in touched.chunk_by(|a, b| a.tile == b.tile) {
            let address = self.memory.address(keys[0].tile);
            let published = map.layer(self.own).and_then(|layer| layer.tile(address));
            writes.clear();
            for key in keys {
                let old = published.map_or(0, |tile| tile.cells[key.index]);
                let new = self.memory.cell(*key).value();
                if new != old {
                    writes.push((key.index, new));
                }
            }
            if writes.is_empty() {
                continue;
            }
            let newly_occupied = map.write(self.own, address, writes);
            changes.changed.push(address);
            if newly_occupied {
                changes.newly_occupied.push(address);
            }
        }
        changes.cleared = cleared
            .iter()
            .map(|tile| self.memory.address(*tile))
            .collect();
        changes.cleared.sort_unstable();
        changes.cleared.dedup();
        changes.changed.sort_unstable();
        changes.newly_occupied.sort_unstable();
        changes
    }
}

/// Returns the lattice of the parts of cells.
fn part_lattice(cells: Lattice) -> Lattice {
    Lattice::new(cells.cell_m() / f64::from(PART_SIDE))
}

#[cfg(test)]
mod tests;
