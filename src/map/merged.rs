//! All layers and their sum. Joining a report is commutative, associative and idempotent, so all nodes that
//! have heard the same tiles, in whatever order and however often, hold the same map.
//!
//! Deliberately absent: forgetting. Layers of earlier boots stay, read-only.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use thiserror::Error;
use tomoswarm_proto::{
    Digest, LayerDigest, LayerId, TILE_CELLS, TILE_SIDE, TileAddress, TileReport, TileRequest,
};

use super::map_snapshot::MapSnapshot;
use super::tile::CONFIRMED_FROM;
use super::tile::{
    FREE_TO, LAYER_CLAMP, MERGED_CLAMP, Occupancy, Tile, TileError, address_of, index_in_tile,
};
use super::window::{CellRect, ConfirmedCells, Sums, View, ViewTile};
use super::{ClearedParts, Layer, MapTile, OCCUPIED_FROM};
use crate::geom::{Cell, Lattice};

/// A map holds at most this many layers, as many as a digest may name; more are refused.
pub const MAX_LAYERS: usize = 256;
/// A map holds at most this many tiles over all layers; more are refused.
pub const MAX_TILES: usize = 65_536;

/// Up to this a tile may have any revision: what a vehicle changes twenty times a second for nine days.
pub const ANY_REVISION_UNTIL: u32 = 1 << 24;
/// Beyond that it may be so far above the one that is held: a tile with the last revision of all could never be put right.
const REVISION_STEP: u32 = 4096;
/// Of a map with more tiles the writer of a layer disowns only those that it has written.
const DISOWNS_WITHIN: usize = MAX_TILES / 2;

/// Tiles named in a want at most; the wire carries no more.
const WANT_TILES: usize = 4096;

/// What a report did to the map.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum JoinResult {
    /// Nothing: the same or a newer tile was known.
    Known,
    /// The tile was taken.
    Newer {
        /// Whether a merged cell became occupied by it.
        newly_occupied: bool,
    },
}

/// Why a report is refused.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Error)]
pub enum TileRefusal {
    /// The tile itself is impossible.
    #[error(transparent)]
    Tile(#[from] TileError),
    /// Somebody else reports a revision of the layer which only this node writes.
    #[error("only this node writes its own layer")]
    Own,
    /// Its revision is too far above the one that is held.
    #[error("revision {revision} of a tile is too far above {held}, which is held")]
    Leaps {
        /// The revision that is reported.
        revision: u32,
        /// The one that is held, 0 = none.
        held: u32,
    },
    /// The map is full.
    #[error("a map holds at most {MAX_LAYERS} layers and {MAX_TILES} tiles")]
    Full,
}

/// The map of one node: all layers, and the sum over them.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(try_from = "MapSnapshot", into = "MapSnapshot")]
pub struct Merged {
    lattice: Lattice,
    own: Option<LayerId>,
    layers: BTreeMap<LayerId, Layer>,
    tiles: usize,
    /// What the layers say together ([`said_together`]): unclamped sums; at most `MAX_LAYERS` × `LAYER_CLAMP`, so they fit.
    sums: BTreeMap<TileAddress, Box<Sums>>,
    /// The cells that some layer holds for confirmed.
    confirmed: BTreeMap<TileAddress, Box<ConfirmedCells>>,
    /// Which parts of cells that are not free one vehicle has seen empty.
    cleared: BTreeMap<TileAddress, ClearedParts>,
    /// The same by cell.
    parts: BTreeMap<TileAddress, Box<[u16; TILE_CELLS]>>,
}

impl Merged {
    /// Makes an empty map; `own` is the layer that this node writes (`None`: it only listens).
    pub fn new(lattice: Lattice, own: Option<LayerId>) -> Merged {
        Merged {
            lattice,
            own,
            layers: BTreeMap::new(),
            tiles: 0,
            sums: BTreeMap::new(),
            confirmed: BTreeMap::new(),
            cleared: BTreeMap::new(),
            parts: BTreeMap::new(),
        }
    }

    /// Returns the lattice of the cells.
    pub fn lattice(&self) -> Lattice {
        self.lattice
    }

    /// Returns the layer that this node writes.
    pub fn own(&self) -> Option<LayerId> {
        self.own
    }

    /// Returns a layer.
    pub fn layer(&self, id: LayerId) -> Option<&Layer> {
        self.layers.get(&id)
    }

    /// Returns all layers, ascending by id.
    pub fn layers(&self) -> impl Iterator<Item = (LayerId, &Layer)> {
        self.layers.iter().map(|(id, layer)| (*id, layer))
    }

    /// Returns a tile as it travels.
    pub fn report(&self, layer: LayerId, address: TileAddress) -> Option<TileReport> {
        self.layers
            .get(&layer)?
            .tile(address)
            .map(|tile| tile.report(layer, address))
    }

    /// Takes a tile from elsewhere when it is newer than what is known.
    ///
    /// # Errors
    /// [`TileRefusal`] when the tile is impossible, of its own layer, its revision leaps, or the map is full; nothing changes
    /// then.
    pub fn join(&mut self, report: &TileReport) -> Result<JoinResult, TileRefusal> {
        if self.own == Some(report.layer) {
            return Err(TileRefusal::Own);
        }
        let tile = Tile::from_report(report)?;
        let old = self
            .layers
            .get(&report.layer)
            .and_then(|layer| layer.tile(report.address))
            .cloned();
        check_revision(report, old.as_ref())?;
        if old.as_ref().is_some_and(|old| !tile.replaces(old)) {
            return Ok(JoinResult::Known);
        }
        let new_layer = !self.layers.contains_key(&report.layer);
        if (new_layer && self.layers.len() >= MAX_LAYERS)
            || (old.is_none() && self.tiles >= MAX_TILES)
        {
            return Err(TileRefusal::Full);
        }
        let newly_occupied = self.put(report.layer, report.address, tile);
        Ok(JoinResult::Newer { newly_occupied })
    }

    /// Takes a tile of the map actor of the same vehicle: see [`Merged::join`].
    ///
    /// # Errors
    /// [`TileRefusal`]; nothing changes then.
    pub fn learn(&mut self, tile: &MapTile) -> Result<JoinResult, TileRefusal> {
        let joined = self.join(&tile.report)?;
        if let Some(cleared) = &tile.cleared {
            self.clear_parts(tile.report.address, cleared.clone());
        }
        Ok(joined)
    }

    /// Takes which parts of a tile are empty, in place of what was known of that.
    pub(super) fn clear_parts(&mut self, address: TileAddress, cleared: ClearedParts) {
        self.parts.insert(address, cleared.by_cell());
        self.cleared.insert(address, cleared);
    }

    /// Returns which parts of cells are known to be empty, by tile.
    pub(super) fn cleared(&self) -> impl Iterator<Item = (TileAddress, &ClearedParts)> {
        self.cleared
            .iter()
            .map(|(address, cleared)| (*address, cleared))
    }

    /// Takes what somebody else says of its own layer: where that would count more than what this node has written, its own
    /// tile is raised above it, and the others take it again. Returns whether it was.
    pub fn disown(&mut self, report: &TileReport) -> bool {
        let (Some(own), Ok(output)) = (self.own, Tile::from_report(report)) else {
            return false;
        };
        let held = self
            .layers
            .get(&own)
            .and_then(|layer| layer.tile(report.address))
            .cloned();
        let is_harmless = held
            .as_ref()
            .is_some_and(|held| output.revision < held.revision || output == *held);
        let has_room = held.is_some() || self.tiles < DISOWNS_WITHIN;
        if own != report.layer
            || is_harmless
            || !has_room
            || check_revision(report, held.as_ref()).is_err()
        {
            return false;
        }
        if held.is_none() {
            self.write(own, report.address, &[]);
        }
        if let Some(layer) = self.layers.get_mut(&own) {
            layer.raise(report.address, output.revision.saturating_add(1));
        }
        true
    }

    /// Puts a tile in place of what was there; returns whether a merged cell became occupied.
    pub(super) fn put(&mut self, layer: LayerId, address: TileAddress, tile: Tile) -> bool {
        let old = self
            .layers
            .get(&layer)
            .and_then(|layer| layer.tile(address))
            .cloned();
        self.tiles += usize::from(old.is_none());
        let before = |place: usize| old.as_ref().map_or(0, |old| old.cells[place]);
        let changed: Vec<usize> = (0..TILE_CELLS)
            .filter(|place| before(*place) != tile.cells[*place])
            .collect();
        let was_confirmed = |place: usize| {
            old.as_ref()
                .is_some_and(|old| old.cells[place] >= CONFIRMED_FROM)
        };
        let turned =
            |place: &usize| was_confirmed(*place) != (tile.cells[*place] >= CONFIRMED_FROM);
        let turned: Vec<usize> = (0..TILE_CELLS).filter(turned).collect();
        self.layers.entry(layer).or_default().put(address, tile);
        self.confirm(address, &turned);
        self.join_layers(address, changed.into_iter())
    }

    /// Finds anew which cells of a tile, by their places in it, some layer holds for confirmed.
    fn confirm(&mut self, address: TileAddress, places: &[usize]) {
        if places.is_empty() {
            return;
        }
        let of_layers = || self.layers.values().filter_map(|layer| layer.tile(address));
        let is_confirmed =
            |place: usize| of_layers().any(|tile| tile.cells[place] >= CONFIRMED_FROM);
        let mut rows = self
            .confirmed
            .get(&address)
            .map_or([0; TILE_SIDE], |rows| **rows);
        for place in places {
            let (row, bit) = (place / TILE_SIDE, 1 << (place % TILE_SIDE));
            rows[row] = match is_confirmed(*place) {
                true => rows[row] | bit,
                false => rows[row] & !bit,
            };
        }
        if rows == [0; TILE_SIDE] {
            self.confirmed.remove(&address);
        } else {
            self.confirmed.insert(address, Box::new(rows));
        }
    }

    /// Finds anew what the layers say together of cells of a tile, by their places in it; returns whether one became occupied.
    fn join_layers(&mut self, address: TileAddress, places: impl Iterator<Item = usize>) -> bool {
        let of_layers: Vec<&Tile> = self
            .layers
            .values()
            .filter_map(|layer| layer.tile(address))
            .collect();
        let sums = self
            .sums
            .entry(address)
            .or_insert_with(|| Box::new([0; TILE_CELLS]));
        let mut newly_occupied = false;
        for place in places {
            let sum = said_together(of_layers.iter().map(|tile| tile.cells[place]));
            newly_occupied |= sums[place] < OCCUPIED_FROM && sum >= OCCUPIED_FROM;
            sums[place] = sum;
        }
        newly_occupied
    }

    /// Writes cells (index in tile, old value, new value) of a layer; returns whether one became occupied.
    /// Does nothing when the map is full.
    pub(super) fn write(
        &mut self,
        layer: LayerId,
        address: TileAddress,
        cells: &[(usize, i8, i8)],
    ) -> bool {
        let known = self
            .layers
            .get(&layer)
            .is_some_and(|layer| layer.tile(address).is_some());
        if !known && self.tiles >= MAX_TILES {
            return false;
        }
        self.tiles += usize::from(!known);
        let written = cells.iter().map(|(index, _, new)| (*index, *new));
        self.layers
            .entry(layer)
            .or_default()
            .write(address, written);
        let turned =
            |(_, old, new): &&(usize, i8, i8)| (*old >= CONFIRMED_FROM) != (*new >= CONFIRMED_FROM);
        let turned: Vec<usize> = cells
            .iter()
            .filter(turned)
            .map(|(index, ..)| *index)
            .collect();
        self.confirm(address, &turned);
        self.join_layers(address, cells.iter().map(|(index, ..)| *index))
    }

    /// Returns the sums of a tile over all layers.
    pub(super) fn sums(&self, address: TileAddress) -> Option<&Sums> {
        self.sums.get(&address).map(|sums| &**sums)
    }

    /// Returns the merged value of a cell, 0.1 log-odds within ± [`MERGED_CLAMP`]; 0 where nothing is known.
    pub fn value(&self, slice: i16, cell: Cell) -> i16 {
        let sums = address_of(slice, cell).and_then(|address| self.sums(address));
        sums.map_or(0, |sums| {
            sums[index_in_tile(cell)].clamp(-MERGED_CLAMP, MERGED_CLAMP)
        })
    }

    /// Returns what is known of a cell. For many cells take a [`Merged::view`].
    pub fn occupancy(&self, slice: i16, cell: Cell) -> Occupancy {
        Occupancy::of_value(self.value(slice, cell))
    }

    /// Returns the smallest rectangle of whole tiles that holds all that is known at a slice.
    pub fn extent(&self, slice: i16) -> Option<CellRect> {
        let low = TileAddress {
            slice,
            x: i32::MIN,
            y: i32::MIN,
        };
        let high = TileAddress {
            slice,
            x: i32::MAX,
            y: i32::MAX,
        };
        let tiles = self
            .sums
            .range(low..=high)
            .map(|(address, _)| CellRect::of_tile(*address));
        tiles.reduce(CellRect::join)
    }

    /// Borrows a rectangle for fast reading. Its cost is that of the tiles it touches, not of its cells.
    pub fn view(&self, slice: i16, rect: CellRect) -> View<'_> {
        let (columns, rows) = rect.tiles();
        let first = (columns.start, rows.start);
        let tiles = rows.flat_map(|y| columns.clone().map(move |x| TileAddress { slice, x, y }));
        let tile = |address| {
            Some(ViewTile {
                sums: self.sums(address)?,
                confirmed: self.confirmed.get(&address).map(|rows| &**rows),
                cleared: self.parts.get(&address).map(|parts| &**parts),
            })
        };
        View {
            lattice: self.lattice,
            first,
            columns: columns.len(),
            tiles: tiles.map(tile).collect(),
        }
    }

    /// Returns what this node holds of every layer.
    pub fn digest(&self) -> Digest {
        Digest {
            layers: self
                .layers
                .iter()
                .map(|(id, layer)| layer.digest(*id))
                .collect(),
        }
    }

    /// Returns whether a node with this digest holds something that this one does not. A layer has one writer, and
    /// what is known of it only grows: so of two nodes that differ the one with fewer revisions asks, or both
    /// where these are equal. Of its own layer a node asks for what others hold beyond it, to disown that.
    pub fn lacks(&self, theirs: &LayerDigest) -> bool {
        if self.own == Some(theirs.layer) {
            let ours = self
                .layers
                .get(&theirs.layer)
                .map_or(0, |layer| layer.digest(theirs.layer).revisions);
            return theirs.revisions > ours;
        }
        let Some(ours) = self
            .layers
            .get(&theirs.layer)
            .map(|layer| layer.digest(theirs.layer))
        else {
            return theirs.tiles > 0;
        };
        let (known, heard) = (
            (ours.revisions, ours.tiles),
            (theirs.revisions, theirs.tiles),
        );
        known < heard || (known == heard && ours.hash != theirs.hash)
    }

    /// Returns what to ask for to complete a layer.
    pub fn want(&self, layer: LayerId) -> TileRequest {
        let tiles = self.layers.get(&layer).into_iter().flat_map(Layer::tiles);
        let known = tiles
            .map(|(address, tile)| (address, tile.revision))
            .take(WANT_TILES)
            .collect();
        TileRequest { layer, known }
    }

    /// Returns the tiles newer than those known to who asks, ascending.
    pub fn newer(&self, want: &TileRequest) -> Vec<TileAddress> {
        let known: BTreeMap<TileAddress, u32> = want.known.iter().copied().collect();
        let held = self
            .layers
            .get(&want.layer)
            .into_iter()
            .flat_map(Layer::tiles);
        let newer = held.filter(|(address, tile)| {
            known
                .get(address)
                .is_none_or(|revision| tile.revision > *revision)
        });
        newer.map(|(address, _)| address).collect()
    }
}

/// Checks that a revision can be that of the tile that is held.
fn check_revision(report: &TileReport, held: Option<&Tile>) -> Result<(), TileRefusal> {
    let (revision, held) = (report.revision, held.map_or(0, |held| held.revision));
    match revision > ANY_REVISION_UNTIL.max(held.saturating_add(REVISION_STEP)) {
        true => Err(TileRefusal::Leaps { revision, held }),
        false => Ok(()),
    }
}

/// Returns what layers say together of a cell: the sum. But what one of them has confirmed is not free as long as nobody has
/// seen it empty from near: however many have from afar, all of them may have looked along the same wall.
fn said_together(values: impl Iterator<Item = i8>) -> i16 {
    let (mut sum, mut is_confirmed, mut is_surely_free) = (0, false, false);
    for value in values {
        sum += i16::from(value);
        is_confirmed |= value >= CONFIRMED_FROM;
        is_surely_free |= value <= -LAYER_CLAMP;
    }
    match is_confirmed && !is_surely_free {
        true => sum.max(FREE_TO + 1),
        false => sum,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Point;
    use proptest::prelude::*;
    use std::sync::Arc;
    use tomoswarm_proto::{Boot, VehicleId};

    fn layer(vehicle: u8, boot: u32) -> LayerId {
        LayerId {
            vehicle: VehicleId(vehicle),
            boot: Boot(boot),
        }
    }

    fn listener() -> Merged {
        Merged::new(Lattice::new(0.2), None)
    }

    /// A report of few layers, places and revisions, so that they meet; cells all of one value, so that also
    /// two different tiles of one revision meet.
    fn any_report() -> impl Strategy<Value = TileReport> {
        (0..3u8, 0..2u32, -1..1i32, 0..3u32, any::<i8>()).prop_map(
            |(vehicle, boot, x, revision, value)| TileReport {
                layer: layer(vehicle, boot),
                address: TileAddress { slice: 0, x, y: 0 },
                revision,
                cells: Arc::new([value; TILE_CELLS]),
            },
        )
    }

    fn joined<'a>(reports: impl Iterator<Item = &'a TileReport>) -> Merged {
        let mut map = listener();
        for report in reports {
            map.join(report).unwrap();
        }
        map
    }

    proptest! {
        #[test]
        fn order_and_repetition_of_reports_do_not_matter(
            reports in proptest::collection::vec(any_report(), 1..20), order in any::<prop::sample::Index>(),
        ) {
            let straight = joined(reports.iter());
            let turn = order.index(reports.len());
            let shuffled = reports[turn..].iter().rev().chain(&reports[..turn]).chain(&reports[turn..]);
            prop_assert_eq!(&straight, &joined(shuffled));
        }

        #[test]
        fn the_merged_cell_is_the_clamped_sum_of_the_newest_but_what_is_confirmed_is_freed_from_near_only(reports in proptest::collection::vec(any_report(), 1..20)) {
            let map = joined(reports.iter());
            for x in -1..1i32 {
                let layers = (0..3).flat_map(|vehicle| (0..2).map(move |boot| layer(vehicle, boot)));
                let newest = layers.filter_map(|id| {
                    let of_layer = reports.iter().filter(|r| r.layer == id && r.address.x == x);
                    of_layer.map(|r| (r.revision, r.cells[5].clamp(-17, 17))).max()
                });
                let values: Vec<i8> = newest.map(|(_, value)| value).collect();
                let sum: i16 = values.iter().map(|value| i16::from(*value)).sum();
                let is_held = values.iter().any(|value| *value >= 13) && !values.contains(&-17);
                let expected = if is_held { sum.max(-7) } else { sum };
                prop_assert_eq!(map.value(0, Cell::new(x * 32 + 5, 0)), expected.clamp(-100, 100));
            }
        }

        #[test]
        fn nodes_agree_once_the_bus_is_quiet(
            writes in proptest::collection::vec((0..3usize, -2..2i32, 0..TILE_CELLS, -17..=17i8, any::<bool>()), 1..60),
        ) {
            let mut nodes: Vec<Merged> =
                (0..3).map(|node| Merged::new(Lattice::new(0.2), Some(layer(node, 1)))).collect();
            for (node, x, index, value, lost) in writes {
                let (own, address) = (layer(node as u8, 1), TileAddress { slice: 0, x, y: 0 });
                let old = nodes[node].layer(own).and_then(|l| l.tile(address)).map_or(0, |tile| tile.cells[index]);
                nodes[node].write(own, address, &[(index, old, value)]);
                let report = nodes[node].report(own, address).unwrap();
                if !lost {
                    nodes[(node + 1) % 3].join(&report).unwrap();
                }
            }
            let rounds = repair(&mut nodes);
            prop_assert!(rounds < 20);
            prop_assert_eq!(nodes[0].digest(), nodes[1].digest());
            prop_assert_eq!(&nodes[0].sums, &nodes[1].sums);
            prop_assert_eq!(&nodes[2].sums, &nodes[1].sums);
            prop_assert_eq!(&nodes[2].layers, &nodes[1].layers);
        }
    }

    #[test]
    fn what_one_has_confirmed_others_free_from_near_only() {
        let said = |values: &[i8]| said_together(values.iter().copied());
        assert_eq!(said(&[17, -12, -12, -12]), FREE_TO + 1, "unknown");
        assert_eq!(said(&[17, -12, -17, -12]), -24, "one has been near");
        assert_eq!(said(&[9, -12, -12]), -15, "it was doubtful");
        assert_eq!(said(&[17, 17, -12]), 22);
        assert_eq!(said(&[-12, -12]), -24);
    }

    /// Exchanges digests, wants and answers (two tiles at a time) until nobody sends a tile; returns the rounds.
    fn repair(nodes: &mut [Merged]) -> usize {
        for round in 0..100 {
            let mut sent = 0;
            for (hearer, speaker) in (0..3)
                .flat_map(|a| (0..3).map(move |b| (a, b)))
                .filter(|(a, b)| a != b)
            {
                let digest = nodes[speaker].digest();
                for theirs in &digest.layers {
                    if !nodes[hearer].lacks(theirs) {
                        continue;
                    }
                    let want = nodes[hearer].want(theirs.layer);
                    for address in nodes[speaker].newer(&want).into_iter().take(2) {
                        let report = nodes[speaker].report(theirs.layer, address).unwrap();
                        nodes[hearer].join(&report).unwrap();
                        sent += 1;
                    }
                }
            }
            if sent == 0 {
                return round;
            }
        }
        100
    }

    #[test]
    fn who_holds_fewer_revisions_lacks_something_and_who_holds_other_ones_too() {
        let tile = |x, revision| {
            let address = TileAddress { slice: 0, x, y: 0 };
            TileReport {
                layer: layer(1, 1),
                address,
                revision,
                cells: Arc::new([9; TILE_CELLS]),
            }
        };
        let digest = |map: &Merged| map.digest().layers[0];
        let (all, one) = (
            joined([tile(0, 2), tile(1, 1)].iter()),
            joined([tile(0, 2)].iter()),
        );
        assert!(one.lacks(&digest(&all)) && !all.lacks(&digest(&one)) && !all.lacks(&digest(&all)));
        let other = joined([tile(1, 2)].iter());
        assert!(one.lacks(&digest(&other)) && other.lacks(&digest(&one)));
        assert!(listener().lacks(&digest(&one)));
        let mut writer = Merged::new(Lattice::new(0.2), Some(layer(1, 1)));
        assert!(
            writer.lacks(&digest(&one)),
            "what it has not written it asks for, to disown it"
        );
        (0..2).for_each(|_| assert!(!writer.write(layer(1, 1), TileAddress::default(), &[])));
        assert!(
            !writer.lacks(&digest(&one)),
            "nobody but the writer is ahead of it"
        );
        let (fresh, none) = (
            joined([tile(0, 2), tile(3, 0)].iter()),
            joined([tile(0, 2)].iter()),
        );
        assert!(
            none.lacks(&digest(&fresh)) && !fresh.lacks(&digest(&none)),
            "a tile of revision 0 counts"
        );
    }

    #[test]
    fn nobody_else_writes_the_own_layer_and_a_full_map_takes_no_more() {
        let mut map = Merged::new(Lattice::new(0.2), Some(layer(1, 4)));
        let mut report = TileReport {
            layer: layer(1, 4),
            address: TileAddress::default(),
            revision: 1,
            cells: Arc::new([17; TILE_CELLS]),
        };
        assert_eq!(map.join(&report), Err(TileRefusal::Own));
        for boot in 0..MAX_LAYERS as u32 {
            report.layer = layer(2, boot);
            assert!(map.join(&report).is_ok());
        }
        report.layer = layer(3, 0);
        assert_eq!(map.join(&report), Err(TileRefusal::Full));
        assert_eq!(map.value(0, Cell::new(0, 0)), MERGED_CLAMP);
    }

    #[test]
    fn what_others_say_of_the_own_layer_is_disowned_and_everybody_holds_the_own_tile_again() {
        let own = layer(1, 4);
        let mut writer = Merged::new(Lattice::new(0.2), Some(own));
        writer.write(own, TileAddress::default(), &[(7, 0, -9)]);
        let elsewhere = TileAddress {
            x: 3,
            ..TileAddress::default()
        };
        for (address, revision) in [
            (TileAddress::default(), 1),
            (TileAddress::default(), 900),
            (elsewhere, ANY_REVISION_UNTIL),
        ] {
            let mut other = listener();
            writer
                .report(own, address)
                .inspect(|report| assert!(other.join(report).is_ok()));
            let forged = TileReport {
                layer: own,
                address,
                revision,
                cells: Arc::new([17; TILE_CELLS]),
            };
            other.join(&forged).unwrap();
            assert!(writer.lacks(&digest_of(&other, own)) || revision == 1);
            assert!(writer.disown(&forged), "{revision}");
            let put_right = writer.report(own, address).unwrap();
            assert!(!writer.disown(&put_right), "its own word comes back to it");
            assert!(matches!(
                other.join(&put_right),
                Ok(JoinResult::Newer { .. })
            ));
            assert_eq!(
                other.layer(own).unwrap().tile(address),
                writer.layer(own).unwrap().tile(address)
            );
        }
        assert_eq!(
            writer.value(0, Cell::new(7, 0)),
            -9,
            "and the writer's map is what it was"
        );
    }

    fn digest_of(map: &Merged, id: LayerId) -> LayerDigest {
        map.layer(id).unwrap().digest(id)
    }

    #[test]
    fn a_revision_that_leaps_is_refused() {
        let mut map = listener();
        let mut report = TileReport {
            layer: layer(1, 1),
            address: TileAddress::default(),
            revision: u32::MAX,
            cells: Arc::new([17; TILE_CELLS]),
        };
        assert_eq!(
            map.join(&report),
            Err(TileRefusal::Leaps {
                revision: u32::MAX,
                held: 0
            })
        );
        for step in [ANY_REVISION_UNTIL, ANY_REVISION_UNTIL + REVISION_STEP] {
            report.revision = step;
            assert!(map.join(&report).is_ok());
        }
        report.revision += REVISION_STEP + 1;
        assert!(matches!(map.join(&report), Err(TileRefusal::Leaps { .. })));
    }

    #[test]
    fn an_earlier_boot_of_the_own_vehicle_stays_readable() {
        let mut before = Merged::new(Lattice::new(0.2), Some(layer(1, 4)));
        before.write(layer(1, 4), TileAddress::default(), &[(7, 0, 9)]);
        let mut map = Merged::new(Lattice::new(0.2), Some(layer(1, 5)));
        let report = before.report(layer(1, 4), TileAddress::default()).unwrap();
        assert_eq!(
            map.join(&report),
            Ok(JoinResult::Newer {
                newly_occupied: true
            })
        );
        assert_eq!(map.join(&report), Ok(JoinResult::Known));
        assert_eq!(map.occupancy(0, Cell::new(7, 0)), Occupancy::Occupied);
        assert_eq!(map.occupancy(1, Cell::new(7, 0)), Occupancy::Unknown);
    }

    #[test]
    fn the_weight_of_one_vehicle_is_less_than_one_fresh_hit_by_two() {
        let mut map = listener();
        let mut report = TileReport {
            layer: layer(1, 1),
            address: TileAddress::default(),
            revision: 1,
            cells: Arc::new([-128; TILE_CELLS]),
        };
        map.join(&report).unwrap();
        assert_eq!(map.occupancy(0, Cell::new(0, 0)), Occupancy::Free);
        for vehicle in 2..4 {
            (report.layer, report.cells) = (layer(vehicle, 1), Arc::new([9; TILE_CELLS]));
            map.join(&report).unwrap();
        }
        assert!(map.value(0, Cell::new(0, 0)) > 0);
        assert_ne!(map.occupancy(0, Cell::new(0, 0)), Occupancy::Free);
    }

    #[test]
    fn a_view_reads_as_the_map_does() {
        let mut map = listener();
        for (x, y, value) in [(-1, 0, 17), (0, 0, -9), (1, -1, 3)] {
            let (address, cells) = (
                TileAddress { slice: 0, x, y },
                Arc::new([value; TILE_CELLS]),
            );
            map.join(&TileReport {
                layer: layer(1, 1),
                address,
                revision: 1,
                cells,
            })
            .unwrap();
        }
        let rect = CellRect::around(
            map.lattice(),
            &[Point::new(-2.0, -2.0), Point::new(3.0, 3.0)],
            0.0,
        )
        .unwrap();
        let view = map.view(0, rect);
        for cell in (-80..80).flat_map(|x| (-80..80).map(move |y| Cell::new(x, y))) {
            let inside = (-32..32).contains(&cell.x) && (-32..32).contains(&cell.y);
            let expected = if inside {
                map.occupancy(0, cell)
            } else {
                Occupancy::Unknown
            };
            assert_eq!(view.occupancy(cell), expected, "{cell:?}");
        }
        assert_eq!(
            view.occupancy(Cell::new(i32::MIN, i32::MAX)),
            Occupancy::Unknown
        );
        assert_eq!(
            map.extent(0),
            Some(CellRect::new(Cell::new(-32, -32), Cell::new(63, 31)))
        );
        assert_eq!(map.extent(3), None);
    }
}
