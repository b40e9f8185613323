//! The shared map: tiles, what a node holds of them, and what it lacks. How tiles join is not said here.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::LayerId;

/// Cells along one side of a tile.
pub const TILE_SIDE: usize = 32;
/// Cells of a tile.
pub const TILE_CELLS: usize = TILE_SIDE * TILE_SIDE;

/// Where a tile lies: altitude slice, then tile column and row.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct TileAddress {
    /// Altitude slice.
    pub slice: i16,
    /// Tile column: floor(cell x / 32).
    pub x: i32,
    /// Tile row: floor(cell y / 32).
    pub y: i32,
}

/// One whole tile of one layer, in absolute values.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct TileReport {
    /// Whose layer.
    pub layer: LayerId,
    /// Where the tile lies.
    pub address: TileAddress,
    /// Counts the changes of this tile; the highest wins.
    pub revision: u32,
    /// 1024 cells, row-major, x fastest; one unit = 0.1 log-odds, positive = occupied.
    #[serde(with = "crate::cells")]
    pub cells: Arc<[i8; TILE_CELLS]>,
}

/// What a node holds of one layer.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct LayerDigest {
    /// Which layer.
    pub layer: LayerId,
    /// How many tiles of it.
    pub tiles: u32,
    /// Sum of their revisions: who has the lower one lacks something.
    pub revisions: u64,
    /// Hash over (address, revision) of all of them.
    pub hash: u64,
}

/// What a node holds of all layers, once a second.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Digest {
    /// One entry a layer, ascending.
    pub layers: Vec<LayerDigest>,
}

/// Asks for the tiles of a layer that are newer than those known.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct TileRequest {
    /// Which layer.
    pub layer: LayerId,
    /// Revisions already held, ascending by address. 4,096 of them are not all: they are those from one address on, the least
    /// following on the greatest, and the request is for what lies from the first to the last of them alone.
    pub known: Vec<(TileAddress, u32)>,
}
