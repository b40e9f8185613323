//! All layers and their sum. Joining a report is commutative, associative and idempotent, so all nodes that
//! have heard the same tiles, in whatever order and however often, hold the same map.
//!
//! Deliberately absent: forgetting. Layers of earlier boots stay, read-only.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use thiserror::Error;
use tomoswarm_proto::{
    Digest, LayerDigest, LayerId, TILE_CELLS, TileAddress, TileReport, TileRequest,
};

use super::joined::{JoinedTile, SaidTogether};
use super::map_snapshot::MapSnapshot;
use super::tile::{MERGED_CLAMP, Occupancy, Tile, TileError, address_of, index_in_tile};
use super::window::{CellRect, View, ViewTile};
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
    trusted: Option<LayerId>,
    layers: BTreeMap<LayerId, Layer>,
    tiles: usize,
    /// What the layers say together.
    joined: BTreeMap<TileAddress, Box<JoinedTile>>,
    /// Which parts of cells that are not free one vehicle has seen empty.
    cleared: BTreeMap<TileAddress, ClearedParts>,
    /// The same by cell.
    parts: BTreeMap<TileAddress, Box<[u16; TILE_CELLS]>>,
}

impl Merged {
    /// Makes an empty map; `own` is the layer that this node writes, and trusts (`None`: it only listens, and trusts none).
    pub fn new(lattice: Lattice, own: Option<LayerId>) -> Merged {
        Merged::with_layers(lattice, own, own)
    }

    /// Makes an empty map that only listens, and by which the vehicle is driven that writes a layer: what that layer has
    /// confirmed is not free, and what it has seen empty from near is, whatever the others say.
    pub fn trusting(lattice: Lattice, layer: LayerId) -> Merged {
        Merged::with_layers(lattice, None, Some(layer))
    }

    /// Makes an empty map that writes one layer and trusts one.
    pub(super) fn with_layers(
        lattice: Lattice,
        own: Option<LayerId>,
        trusted: Option<LayerId>,
    ) -> Merged {
        Merged {
            lattice,
            own,
            trusted,
            layers: BTreeMap::new(),
            tiles: 0,
            joined: BTreeMap::new(),
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

    /// Returns the layer that this node trusts.
    pub(super) fn trusted(&self) -> Option<LayerId> {
        self.trusted
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

    /// Takes of all that another map holds what is newer than what is known here; what [`Merged::join`] refuses is left out.
    pub fn join_all(&mut self, other: &Merged) {
        for (id, layer) in other.layers() {
            for (address, tile) in layer.tiles() {
                // A full map, and one that writes this layer itself, stay as they are.
                let _ = self.join(&tile.report(id, address));
            }
        }
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
        self.layers.entry(layer).or_default().put(address, tile);
        self.join_layers(address, changed.into_iter())
    }

    /// Finds anew what the layers say together of cells of a tile, by their places in it; returns whether one became occupied.
    fn join_layers(&mut self, address: TileAddress, places: impl Iterator<Item = usize>) -> bool {
        let of_layers: Vec<&Tile> = self
            .layers
            .values()
            .filter_map(|layer| layer.tile(address))
            .collect();
        let trusted = self
            .trusted
            .and_then(|id| self.layers.get(&id)?.tile(address));
        let joined = self.joined.entry(address).or_default();
        let mut newly_occupied = false;
        for place in places {
            let trusted = trusted.map_or(0, |tile| tile.cells[place]);
            let said = SaidTogether::of(of_layers.iter().map(|tile| tile.cells[place]), trusted);
            newly_occupied |= joined.sums[place] < OCCUPIED_FROM && said.sum >= OCCUPIED_FROM;
            joined.set(place, said);
        }
        newly_occupied
    }

    /// Writes cells (index in tile, value) of a layer; returns whether one became occupied.
    /// Does nothing when the map is full.
    pub(super) fn write(
        &mut self,
        layer: LayerId,
        address: TileAddress,
        cells: &[(usize, i8)],
    ) -> bool {
        let known = self
            .layers
            .get(&layer)
            .is_some_and(|layer| layer.tile(address).is_some());
        if !known && self.tiles >= MAX_TILES {
            return false;
        }
        self.tiles += usize::from(!known);
        self.layers
            .entry(layer)
            .or_default()
            .write(address, cells.iter().copied());
        self.join_layers(address, cells.iter().map(|(index, _)| *index))
    }

    /// Returns the merged value of a cell, 0.1 log-odds within ± [`MERGED_CLAMP`]; 0 where nothing is known.
    pub fn value(&self, slice: i16, cell: Cell) -> i16 {
        let joined = address_of(slice, cell).and_then(|address| self.joined.get(&address));
        joined.map_or(0, |joined| {
            joined.sums[index_in_tile(cell)].clamp(-MERGED_CLAMP, MERGED_CLAMP)
        })
    }

    /// Returns what is known of a cell. For many cells take a [`Merged::view`].
    pub fn occupancy(&self, slice: i16, cell: Cell) -> Occupancy {
        Occupancy::of_value(self.value(slice, cell))
    }

    /// Returns where tiles lie of which something is known, ascending.
    pub fn addresses(&self) -> impl Iterator<Item = TileAddress> {
        self.joined.keys().copied()
    }

    /// Returns how many bytes a copy of it takes, about: the cells of layers are shared among copies.
    pub fn bytes(&self) -> usize {
        self.tiles * size_of::<(TileAddress, Tile)>()
            + self.joined.len() * size_of::<(TileAddress, JoinedTile)>()
            + self.cleared.len() * size_of::<(TileAddress, ClearedParts)>()
            + self.parts.len() * size_of::<[u16; TILE_CELLS]>()
    }

    /// Returns the merged values of a tile, as [`Merged::value`] has them, row-major, x fastest; `None` where nothing is
    /// known.
    pub fn values(&self, address: TileAddress) -> Option<[i8; TILE_CELLS]> {
        let joined = self.joined.get(&address)?;
        let clamped = |place: usize| joined.sums[place].clamp(-MERGED_CLAMP, MERGED_CLAMP) as i8;
        Some(std::array::from_fn(clamped))
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
            .joined
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
                joined: self.joined.get(&address)?,
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

    /// Returns what to ask for to complete a layer. Of more tiles than a message names it names those from an address on,
    /// the least following on the greatest, and speaks for what lies between them alone. With it comes where the next one
    /// is to begin; `None` = it speaks for all.
    pub fn want(
        &self,
        layer: LayerId,
        from: Option<TileAddress>,
    ) -> (TileRequest, Option<TileAddress>) {
        let all = || self.layers.get(&layer).into_iter().flat_map(Layer::tiles);
        let revision = |(address, tile): (TileAddress, &Tile)| (address, tile.revision);
        let is_whole = all().nth(WANT_TILES - 1).is_none();
        let from = from.filter(|_| !is_whole);
        let later = all().filter(|(address, _)| from.is_none_or(|from| *address >= from));
        let earlier = all().filter(|(address, _)| from.is_some_and(|from| *address < from));
        let named = later.chain(earlier).map(revision);
        let known: Vec<(TileAddress, u32)> = named.take(WANT_TILES).collect();
        // The next one begins with the last tile of this one, so that what lies between is asked for as well.
        let next = known.last().map(|(address, _)| *address);
        (TileRequest { layer, known }, next.filter(|_| !is_whole))
    }

    /// Returns the tiles newer than those known to who asks, ascending.
    pub fn newer(&self, want: &TileRequest) -> Vec<TileAddress> {
        let ends = want.known.first().zip(want.known.last());
        let ends = ends.filter(|_| want.known.len() >= WANT_TILES);
        let ends = ends.map(|((first, _), (last, _))| (*first, *last));
        let is_asked = |address: TileAddress| match ends {
            None => true,
            Some((first, last)) if first <= last => first <= address && address <= last,
            Some((first, last)) => first <= address || address <= last,
        };
        let known: BTreeMap<TileAddress, u32> = want.known.iter().copied().collect();
        let held = self
            .layers
            .get(&want.layer)
            .into_iter()
            .flat_map(Layer::tiles);
        let newer = held.filter(|(address, tile)| {
            let known = known.get(address);
            is_asked(*address) && known.is_none_or(|revision| tile.revision > *revision)
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

#[cfg(test)]
mod tests;
