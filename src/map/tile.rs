//! Tiles of 32 × 32 cells, their values and their addresses. Who wrote a tile is the layer's business.

use std::sync::Arc;

use thiserror::Error;
use tomoswarm_proto::{LayerId, TILE_CELLS, TILE_SIDE, TileAddress, TileReport};

use crate::geom::Cell;

/// A layer's cell never leaves ± this value (0.1 log-odds): one vehicle, however often it looked, weighs less
/// than one fresh hit of 9 by each of two others. A hit that a cell shares with a wide arc weighs as little as 3;
/// of those it takes six.
pub const LAYER_CLAMP: i8 = 17;
/// A merged cell never leaves ± this value (0.1 log-odds).
pub const MERGED_CLAMP: i16 = 100;
/// A merged cell from this value up is occupied (0.1 log-odds).
pub const OCCUPIED_FROM: i16 = 9;
/// A cell of a layer from this value up is *confirmed*: nothing else can have given an echo (0.1 log-odds). Below it, an
/// occupied cell is *doubtful*: it is what explains an echo best.
pub const CONFIRMED_FROM: i8 = 13;
/// A merged cell from this value down is free (0.1 log-odds).
pub const FREE_TO: i16 = -8;
/// Tiles exist for columns and rows in −reach .. reach; what lies beyond stays unknown for ever.
pub const REACH_TILES: i32 = 1024;

/// Cells along one side of a tile, as a power of two.
pub(super) const SIDE_BITS: u32 = TILE_SIDE.trailing_zeros();
const SIDE_MASK: i32 = TILE_SIDE as i32 - 1;

/// What is known of a cell.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Occupancy {
    /// Nothing stands there.
    Free,
    /// Nobody has looked well enough.
    Unknown,
    /// Something stands there.
    Occupied,
}

impl Occupancy {
    /// Judges a merged value (0.1 log-odds, positive = occupied).
    #[inline]
    pub const fn of_value(value: i16) -> Occupancy {
        if value >= OCCUPIED_FROM {
            Occupancy::Occupied
        } else if value <= FREE_TO {
            Occupancy::Free
        } else {
            Occupancy::Unknown
        }
    }
}

/// Why a tile from outside is refused.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Error)]
pub enum TileError {
    /// The address lies outside the map.
    #[error("tile ({x}, {y}) lies more than {REACH_TILES} tiles from the datum")]
    OutOfReach {
        /// Tile column.
        x: i32,
        /// Tile row.
        y: i32,
    },
}

/// One layer's values in 32 × 32 cells. A copy shares the cells: snapshot, report and store row are one.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Tile {
    /// Counts the changes of this tile by its writer.
    pub revision: u32,
    /// Row-major, x fastest; 0.1 log-odds, within ± [`LAYER_CLAMP`].
    pub cells: Arc<[i8; TILE_CELLS]>,
}

impl Tile {
    /// Makes a tile of which nothing is known, revision 0.
    #[inline]
    pub fn unknown() -> Tile {
        Tile {
            revision: 0,
            cells: Arc::new([0; TILE_CELLS]),
        }
    }

    /// Reads a report; values beyond the layer clamp are clamped.
    ///
    /// # Errors
    /// [`TileError`] when the address is impossible.
    pub fn from_report(report: &TileReport) -> Result<Tile, TileError> {
        let TileAddress { slice: _, x, y } = report.address;
        if !in_reach(x) || !in_reach(y) {
            return Err(TileError::OutOfReach { x, y });
        }
        let mut cells = Arc::clone(&report.cells);
        if cells
            .iter()
            .any(|cell| !(-LAYER_CLAMP..=LAYER_CLAMP).contains(cell))
        {
            cells = Arc::new(cells.map(|cell| cell.clamp(-LAYER_CLAMP, LAYER_CLAMP)));
        }
        Ok(Tile {
            revision: report.revision,
            cells,
        })
    }

    /// Returns the tile as it travels.
    #[inline]
    pub fn report(&self, layer: LayerId, address: TileAddress) -> TileReport {
        TileReport {
            layer,
            address,
            revision: self.revision,
            cells: Arc::clone(&self.cells),
        }
    }

    /// Returns whether this tile replaces `other`: the higher revision, and on a tie (which one writer never
    /// makes) the larger cells, so that the outcome does not depend on the order of arrival.
    #[inline]
    pub fn replaces(&self, other: &Tile) -> bool {
        (self.revision, &self.cells) > (other.revision, &other.cells)
    }
}

/// Returns the tile that holds a cell; `None` when it lies beyond the map's reach.
#[inline]
pub fn address_of(slice: i16, cell: Cell) -> Option<TileAddress> {
    let (x, y) = (cell.x >> SIDE_BITS, cell.y >> SIDE_BITS);
    (in_reach(x) && in_reach(y)).then_some(TileAddress { slice, x, y })
}

/// Returns the place of a cell inside its tile, 0 to 1023.
#[inline]
pub const fn index_in_tile(cell: Cell) -> usize {
    (((cell.y & SIDE_MASK) as usize) << SIDE_BITS) | (cell.x & SIDE_MASK) as usize
}

/// Returns the cell with the smallest column and row of a tile within reach.
#[inline]
pub const fn origin_of(address: TileAddress) -> Cell {
    Cell::new(address.x << SIDE_BITS, address.y << SIDE_BITS)
}

#[inline]
fn in_reach(index: i32) -> bool {
    (-REACH_TILES..REACH_TILES).contains(&index)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(x: i32, cells: [i8; TILE_CELLS]) -> TileReport {
        let address = TileAddress { slice: 0, x, y: 0 };
        TileReport {
            layer: LayerId::default(),
            address,
            revision: 3,
            cells: Arc::new(cells),
        }
    }

    #[test]
    fn cells_left_of_the_datum_lie_in_negative_tiles() {
        for (cell, tile, index) in [
            ((0, 0), (0, 0), 0),
            ((-1, 33), (-1, 1), 63),
            ((-32, -33), (-1, -2), 992),
        ] {
            let cell = Cell::new(cell.0, cell.1);
            let address = address_of(2, cell).unwrap();
            assert_eq!((address.slice, address.x, address.y), (2, tile.0, tile.1));
            assert_eq!(index_in_tile(cell), index);
            let origin = origin_of(address);
            assert!(
                (0..32).contains(&(cell.x - origin.x)) && (0..32).contains(&(cell.y - origin.y))
            );
        }
        assert_eq!(address_of(0, Cell::new(i32::MAX, 0)), None);
        assert_eq!(address_of(0, Cell::new(0, i32::MIN)), None);
    }

    #[test]
    fn a_report_is_clamped_or_refused() {
        let mut cells = [0; TILE_CELLS];
        (cells[0], cells[1], cells[2]) = (127, -128, 5);
        let tile = Tile::from_report(&report(0, cells)).unwrap();
        assert_eq!((&tile.cells[..3], tile.revision), (&[17, -17, 5][..], 3));
        assert_eq!(
            Tile::from_report(&report(i32::MIN, cells)),
            Err(TileError::OutOfReach { x: i32::MIN, y: 0 })
        );
    }

    #[test]
    fn a_tile_and_its_report_share_their_cells() {
        let tile = Tile {
            revision: 9,
            cells: Arc::new([-13; TILE_CELLS]),
        };
        let sent = tile.report(
            LayerId::default(),
            TileAddress {
                slice: -1,
                x: 4,
                y: -5,
            },
        );
        let received = Tile::from_report(&sent).unwrap();
        assert_eq!(received, tile);
        assert!(Arc::ptr_eq(&received.cells, &tile.cells));
    }
}
