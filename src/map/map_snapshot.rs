//! A map as a snapshot keeps it: its tiles. Sums and digests are counted anew when it is read, so what is kept can
//! never contradict itself.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{LayerId, TileAddress, TileReport};

use super::{ClearedParts, Merged, Tile, TileError};
use crate::geom::Lattice;

/// What is kept of a [`Merged`].
#[derive(Serialize, Deserialize)]
pub(super) struct MapSnapshot {
    lattice: Lattice,
    own: Option<LayerId>,
    trusted: Option<LayerId>,
    tiles: Vec<TileReport>,
    cleared: Vec<(TileAddress, ClearedParts)>,
}

impl From<Merged> for MapSnapshot {
    fn from(map: Merged) -> MapSnapshot {
        let tiles = map.layers().flat_map(|(id, layer)| {
            layer
                .tiles()
                .map(move |(address, tile)| tile.report(id, address))
        });
        MapSnapshot {
            lattice: map.lattice(),
            own: map.own(),
            trusted: map.trusted(),
            tiles: tiles.collect(),
            cleared: map
                .cleared()
                .map(|(address, cleared)| (address, cleared.clone()))
                .collect(),
        }
    }
}

impl TryFrom<MapSnapshot> for Merged {
    type Error = TileError;

    fn try_from(kept: MapSnapshot) -> Result<Merged, TileError> {
        let mut map = Merged::with_layers(kept.lattice, kept.own, kept.trusted);
        for report in &kept.tiles {
            map.put(report.layer, report.address, Tile::from_report(report)?);
        }
        for (address, cleared) in kept.cleared {
            map.clear_parts(address, cleared);
        }
        Ok(map)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Mapper;
    use super::*;
    use crate::geom::{Angle, Point};
    use crate::map::{OwnDisc, ScanReading};
    use tomoswarm_proto::{Boot, TILE_CELLS, VehicleId, codec};

    fn layer(vehicle: u8) -> LayerId {
        LayerId {
            vehicle: VehicleId(vehicle),
            boot: Boot(1),
        }
    }

    fn scanned(map: &mut Merged, mapper: &mut Mapper, degrees: f64) {
        let reading = ScanReading {
            origin: Point::new(1.0, 1.0),
            direction: Angle::from_degrees(degrees),
            half_width_rad: 0.2,
            range_m: Some(2.5),
            max_range_m: 4.0,
            sure_range_m: 2.0,
            min_range_m: 0.0,
            origin_sd_m: 0.0,
        };
        mapper.record(
            map,
            &reading,
            OwnDisc {
                at: reading.origin,
                radius_m: 0.2,
            },
            &[],
        );
    }

    #[test]
    fn a_map_read_back_is_the_map_and_goes_on_alike() {
        let mut map = Merged::new(Lattice::new(0.2), Some(layer(1)));
        let mut mapper = Mapper::new(layer(1), 0);
        (0..12).for_each(|turn| scanned(&mut map, &mut mapper, 30.0 * f64::from(turn)));
        let address = TileAddress {
            slice: 0,
            x: 0,
            y: -1,
        };
        map.join(&TileReport {
            layer: layer(2),
            address,
            revision: 0,
            cells: std::sync::Arc::new([-9; TILE_CELLS]),
        })
        .unwrap();
        let mut read: Merged = codec::unpack(&codec::pack(&map).unwrap()).unwrap();
        assert_eq!(read, map);
        let mut mapper_read: Mapper = codec::unpack(&codec::pack(&mapper).unwrap()).unwrap();
        scanned(&mut map, &mut mapper, 45.0);
        scanned(&mut read, &mut mapper_read, 45.0);
        assert_eq!(read, map);
    }
}
