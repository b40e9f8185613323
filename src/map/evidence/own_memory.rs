//! The memory behind one vehicle's own layer, tile by tile: cells and kept echoes. Bounded: beyond [`TILES`] tiles the one
//! that was used the longest ago is forgotten, and what it published stays.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{LayerId, TILE_SIDE, TileAddress};

use super::cell_memory::{CellMemory, TileMemory};
use super::echoes::Echo;
use crate::geom::{Cell, Lattice};
use crate::map::tile::{address_of, index_in_tile, origin_of};
use crate::map::{ClearedParts, Merged};

/// Tiles that are remembered; one takes 51 kB, and up to 6 kB more for its echoes: about 115 MB in all.
const TILES: usize = 2048;

/// A cell: its tile's place in the memory, and its place in the tile.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) struct CellKey {
    pub(super) tile: usize,
    pub(super) index: usize,
}

/// What a vehicle remembers of its own layer.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(from = "Vec<TileMemory>", into = "Vec<TileMemory>")]
pub(super) struct OwnMemory {
    tiles: Vec<TileMemory>,
    places: BTreeMap<TileAddress, usize>,
    /// Counts uses of tiles.
    uses: u64,
}

impl From<Vec<TileMemory>> for OwnMemory {
    fn from(tiles: Vec<TileMemory>) -> OwnMemory {
        let places = tiles
            .iter()
            .enumerate()
            .map(|(place, tile)| (tile.address, place));
        OwnMemory {
            places: places.collect(),
            uses: tiles.iter().map(|tile| tile.used).max().unwrap_or(0),
            tiles,
        }
    }
}

impl From<OwnMemory> for Vec<TileMemory> {
    fn from(memory: OwnMemory) -> Vec<TileMemory> {
        memory.tiles
    }
}

impl OwnMemory {
    /// Returns the place of a tile, of which is remembered from now on what its own layer shows.
    pub(super) fn tile(&mut self, map: &Merged, own: LayerId, address: TileAddress) -> usize {
        self.uses += 1;
        if let Some(place) = self.find_tile(address) {
            self.tiles[place].used = self.uses;
            return place;
        }
        let published = map.layer(own).and_then(|layer| layer.tile(address));
        let mut tile = TileMemory::new(address, published);
        tile.used = self.uses;
        let place = match self.tiles.len() {
            TILES.. => self.forget_one(),
            count => count,
        };
        if place < self.tiles.len() {
            self.tiles[place] = tile;
        } else {
            self.tiles.push(tile);
        }
        self.places.insert(address, place);
        place
    }

    /// Forgets the tile that was used the longest ago; returns its place.
    fn forget_one(&mut self) -> usize {
        let oldest = self
            .tiles
            .iter()
            .enumerate()
            .min_by_key(|(_, tile)| tile.used);
        let place = oldest.map_or(0, |(place, _)| place);
        self.places.remove(&self.tiles[place].address);
        place
    }

    /// Returns the place of a tile of which something is remembered.
    pub(super) fn find_tile(&self, address: TileAddress) -> Option<usize> {
        self.places.get(&address).copied()
    }

    /// Returns the key of a cell of which something is remembered.
    pub(super) fn find(&self, slice: i16, cell: Cell) -> Option<CellKey> {
        Some(CellKey {
            tile: self.find_tile(address_of(slice, cell)?)?,
            index: index_in_tile(cell),
        })
    }

    /// Returns what is remembered of a cell.
    #[inline]
    pub(super) fn cell(&self, key: CellKey) -> &CellMemory {
        &self.tiles[key.tile].cells[key.index]
    }

    /// Returns what is remembered of a cell, to be changed.
    #[inline]
    pub(super) fn cell_mut(&mut self, key: CellKey) -> &mut CellMemory {
        &mut self.tiles[key.tile].cells[key.index]
    }

    /// Returns the cell of a key.
    pub(super) fn cell_of(&self, key: CellKey) -> Cell {
        let (first, side) = (origin_of(self.tiles[key.tile].address), TILE_SIDE);
        Cell::new(
            first.x + (key.index % side) as i32,
            first.y + (key.index / side) as i32,
        )
    }

    /// Returns which parts of the cells of a tile were seen empty although the cell is not free.
    pub(super) fn cleared(&self, address: TileAddress) -> ClearedParts {
        let Some(place) = self.places.get(&address) else {
            return ClearedParts::default();
        };
        let cells = self.tiles[*place].cells.iter().enumerate();
        let cleared = cells.filter(|(_, cell)| cell.parts() != 0 && !cell.is_free());
        ClearedParts::new(
            cleared
                .map(|(index, cell)| (index as u16, cell.parts()))
                .collect(),
        )
    }

    /// Returns the address of a tile.
    pub(super) fn address(&self, tile: usize) -> TileAddress {
        self.tiles[tile].address
    }

    /// Returns the echoes that are kept in a tile, oldest first.
    pub(super) fn echoes(&self, tile: usize) -> &[Echo] {
        &self.tiles[tile].echoes
    }

    /// Returns a kept echo.
    pub(super) fn echo(&self, tile: usize, index: usize) -> &Echo {
        &self.tiles[tile].echoes[index]
    }

    /// Puts an echo in place of another one.
    pub(super) fn replace_echo(&mut self, tile: usize, index: usize, echo: Echo) {
        self.tiles[tile].echoes[index] = echo;
    }

    /// Keeps an echo in a tile; of so many the oldest is dropped.
    pub(super) fn push_echo(&mut self, tile: usize, echo: Echo, most: usize) {
        let TileMemory { echoes, turn, .. } = &mut self.tiles[tile];
        if echoes.len() >= most {
            echoes.remove(0);
            *turn = turn.saturating_sub(1);
        }
        echoes.push(echo);
    }

    /// Drops an echo; those after it move up by a place.
    pub(super) fn remove_echo(&mut self, tile: usize, index: usize) {
        let TileMemory { echoes, turn, .. } = &mut self.tiles[tile];
        echoes.remove(index);
        if index <= *turn {
            *turn = turn.saturating_sub(1);
        }
    }

    /// Returns the kept echo of a tile whose turn it is.
    pub(super) fn next_turn(&mut self, tile: usize) -> Option<usize> {
        let TileMemory { echoes, turn, .. } = &mut self.tiles[tile];
        let count = echoes.len();
        if count == 0 {
            return None;
        }
        *turn = (*turn + 1) % count;
        Some(*turn)
    }

    /// Returns the echoes that a cell explains, by tile and place. An echo is kept in the tile of the cell that it was
    /// assigned to first; the other cells of its arc are at most a chord away.
    pub(super) fn echoes_of(
        &self,
        slice: i16,
        cell: Cell,
        lattice: Lattice,
        chord_m: f64,
    ) -> Vec<(usize, usize)> {
        let mut found = Vec::new();
        let tile_m = lattice.cell_m() * TILE_SIDE as f64;
        let reach = (chord_m / tile_m) as i32 + 1;
        let Some(TileAddress { slice, x, y }) = address_of(slice, cell) else {
            return found;
        };
        for y in y - reach..=y + reach {
            for place in (x - reach..=x + reach)
                .filter_map(|x| self.places.get(&TileAddress { slice, x, y }))
            {
                let kept = self.tiles[*place].echoes.iter().enumerate();
                let explained = kept.filter(|(_, echo)| echo.is_explained_by(cell));
                found.extend(explained.map(|(index, _)| (*place, index)));
            }
        }
        found
    }
}
