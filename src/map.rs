//! The memory map: evidence, tiles, layers and their merge.
//!
//! Each vehicle writes one layer per boot; everybody holds all layers and adds them up. A tile travels whole,
//! with absolute values, and the highest revision wins, so late, doubled, reordered or lost reports do no harm.
//! What the network lost is asked for and sent again by [`Repair`]. Nothing here knows a bus, a clock or a route.

mod cleared;
mod evidence;
mod joined;
mod layer;
mod map_snapshot;
mod merged;
mod repair;
mod tile;
mod window;

pub use cleared::{Bar, BarredCell, ClearedParts, MapTile, PART_SIDE, PARTS, part_offset};
pub use evidence::{Changes, Mapper, OwnDisc, PeerBody, ScanReading};
pub use layer::Layer;
pub use merged::{ANY_REVISION_UNTIL, JoinResult, MAX_LAYERS, MAX_TILES, Merged, TileRefusal};
pub use repair::Repair;
pub use tile::{
    CONFIRMED_FROM, FREE_TO, LAYER_CLAMP, MERGED_CLAMP, OCCUPIED_FROM, Occupancy, REACH_TILES,
    Tile, TileError, address_of, index_in_tile, origin_of,
};
pub use window::{CellRect, OccupancyGrid, View};
