//! One writer's tiles, with a running digest. Whether a tile may be joined is for [`super::Merged`] to say.

use std::collections::BTreeMap;
use std::sync::Arc;

use tomoswarm_proto::{LayerDigest, LayerId, TileAddress};

use super::Tile;

/// All tiles of one vehicle and boot.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Layer {
    tiles: BTreeMap<TileAddress, Tile>,
    /// Sum of all tiles' revisions.
    revisions: u64,
    /// Sum of all tiles' hashes; a sum, so that it can be kept up to date tile by tile.
    hash: u64,
}

impl Layer {
    /// Returns a tile.
    pub fn tile(&self, address: TileAddress) -> Option<&Tile> {
        self.tiles.get(&address)
    }

    /// Returns all tiles, ascending by address.
    pub fn tiles(&self) -> impl Iterator<Item = (TileAddress, &Tile)> {
        self.tiles.iter().map(|(address, tile)| (*address, tile))
    }

    /// Returns what this layer holds in a few bytes: equal digests mean equal tiles and revisions.
    pub fn digest(&self, layer: LayerId) -> LayerDigest {
        let tiles = u32::try_from(self.tiles.len()).unwrap_or(u32::MAX);
        LayerDigest {
            layer,
            tiles,
            revisions: self.revisions,
            hash: self.hash,
        }
    }

    /// Puts a tile in place of what was there.
    pub(super) fn put(&mut self, address: TileAddress, tile: Tile) {
        self.count(address, tile.revision);
        if let Some(old) = self.tiles.insert(address, tile) {
            self.discount(address, old.revision);
        }
    }

    /// Writes cells (index in tile, new value) and counts one change of the tile.
    pub(super) fn write(&mut self, address: TileAddress, cells: impl Iterator<Item = (usize, i8)>) {
        let tile = self.tiles.entry(address).or_insert_with(Tile::unknown);
        let old = tile.revision;
        // Who holds the cells still, in a report or a snapshot, keeps them as they are.
        let own = Arc::make_mut(&mut tile.cells);
        for (index, value) in cells {
            own[index] = value;
        }
        tile.revision = old.saturating_add(1);
        let new = tile.revision;
        // A tile of revision 0 has just been made and is not yet counted.
        if old > 0 {
            self.discount(address, old);
        }
        self.count(address, new);
    }

    /// Gives a tile another revision, a higher one.
    pub(super) fn raise(&mut self, address: TileAddress, revision: u32) {
        let Some(tile) = self.tiles.get_mut(&address) else {
            return;
        };
        let old = std::mem::replace(&mut tile.revision, revision);
        self.discount(address, old);
        self.count(address, revision);
    }

    fn count(&mut self, address: TileAddress, revision: u32) {
        self.hash = self.hash.wrapping_add(tile_hash(address, revision));
        self.revisions = self.revisions.wrapping_add(u64::from(revision));
    }

    fn discount(&mut self, address: TileAddress, revision: u32) {
        self.hash = self.hash.wrapping_sub(tile_hash(address, revision));
        self.revisions = self.revisions.wrapping_sub(u64::from(revision));
    }
}

/// Mixes address and revision into 64 bits, the same on every machine and in every version.
fn tile_hash(address: TileAddress, revision: u32) -> u64 {
    let TileAddress { slice, x, y } = address;
    let place = mix(u64::from(x.cast_unsigned()) << 32 | u64::from(y.cast_unsigned()));
    mix(place ^ (u64::from(slice.cast_unsigned()) << 32 | u64::from(revision)))
}

/// SplitMix64's finaliser (Steele, Lea and Flood 2014).
fn mix(seed: u64) -> u64 {
    let mut z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: i32, y: i32) -> TileAddress {
        TileAddress { slice: 0, x, y }
    }

    #[test]
    fn a_digest_depends_on_tiles_and_revisions_only() {
        let (mut one, mut other) = (Layer::default(), Layer::default());
        one.write(at(0, 0), [(3, 9)].into_iter());
        one.write(at(1, 0), [(3, 9)].into_iter());
        one.write(at(1, 0), [(4, 9)].into_iter());
        let tiles: Vec<_> = one
            .tiles()
            .map(|(address, tile)| (address, tile.clone()))
            .collect();
        for (address, tile) in tiles.iter().rev() {
            other.put(*address, tile.clone());
        }
        let id = LayerId::default();
        assert_eq!(one.digest(id), other.digest(id));
        one.write(at(1, 0), [(4, 10)].into_iter());
        assert_ne!(one.digest(id), other.digest(id));
        assert_ne!(tile_hash(at(1, 2), 3), tile_hash(at(2, 1), 3));
    }

    #[test]
    fn a_snapshot_does_not_see_later_changes() {
        let mut layer = Layer::default();
        layer.write(at(0, 0), [(3, 9)].into_iter());
        let snapshot = layer.clone();
        layer.write(at(0, 0), [(3, -4)].into_iter());
        assert_eq!(snapshot.tile(at(0, 0)).unwrap().cells[3], 9);
        assert_eq!(layer.tile(at(0, 0)).unwrap().revision, 2);
    }
}
