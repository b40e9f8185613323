//! Kept distances against looking at every cell, and grids made from them against grids made from the map.

use super::*;
use crate::geom::{Point, Polygon};
use crate::plan::SearchGrid;
use proptest::prelude::*;
use std::sync::Arc;
use tomoswarm_proto::{Boot, LayerId, TILE_CELLS, TileAddress, TileReport, VehicleId};

const CELL_M: f64 = 0.5;

fn bounds() -> CellRect {
    CellRect::new(Cell::new(-25, -30), Cell::new(41, 50))
}

/// Writes a rectangle of one tile; returns the tile's cells.
fn write(
    map: &mut Merged,
    revision: u32,
    (x, y): (i32, i32),
    corners: [(usize, usize); 2],
    value: i8,
) -> CellRect {
    let layer = LayerId {
        vehicle: VehicleId(1),
        boot: Boot(1),
    };
    let address = TileAddress { slice: 0, x, y };
    let old = map.layer(layer).and_then(|layer| layer.tile(address));
    let mut cells: [i8; TILE_CELLS] = old.map_or([0; TILE_CELLS], |tile| *tile.cells);
    let [a, b] = corners;
    for row in a.1.min(b.1)..=a.1.max(b.1) {
        cells[row * 32 + a.0.min(b.0)..=row * 32 + a.0.max(b.0)].fill(value);
    }
    map.join(&TileReport {
        layer,
        address,
        revision,
        cells: Arc::new(cells),
    })
    .unwrap();
    CellRect::new(
        Cell::new(32 * x, 32 * y),
        Cell::new(32 * x + 31, 32 * y + 31),
    )
}

fn is_solid(map: &Merged, cell: Cell, unknown_is_solid: bool) -> bool {
    match map.occupancy(0, cell) {
        Occupancy::Free => false,
        Occupancy::Unknown => unknown_is_solid,
        Occupancy::Occupied => true,
    }
}

/// Squared distances by looking at every cell of the bounds within the reach.
fn brute(map: &Merged, cell: Cell, reach: i32, unknown_is_solid: bool) -> Option<i32> {
    let around = (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)));
    let near = around.filter(|(dx, dy)| {
        let other = Cell::new(cell.x + dx, cell.y + dy);
        bounds().contains(other) && is_solid(map, other, unknown_is_solid)
    });
    near.map(|(dx, dy)| dx * dx + dy * dy)
        .min()
        .filter(|square| *square <= reach * reach)
}

type Write = ((i32, i32), [(usize, usize); 2], usize);

fn writes() -> impl Strategy<Value = Vec<Write>> {
    let corner = || (0..32usize, 0..32usize);
    proptest::collection::vec(
        ((-1..2i32, -1..2i32), [corner(), corner()], 0..5usize),
        1..8,
    )
}

fn value(kind: usize) -> i8 {
    [-17, -17, 17, 17, 0][kind]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn kept_distances_are_those_counted_from_scratch(
        writes in writes(), reach in 0..9i32, unknown_is_solid in any::<bool>(),
    ) {
        let mut map = Merged::new(Lattice::new(CELL_M), None);
        let reach_m = f64::from(reach) * CELL_M;
        let mut clearance = Clearance::new(map.lattice(), 0, bounds(), reach_m, unknown_is_solid).unwrap();
        for (count, (tile, corners, kind)) in writes.into_iter().enumerate() {
            let changed = write(&mut map, count as u32 + 1, tile, corners, value(kind));
            clearance.update(&map, changed);
            let area = bounds();
            for (x, y) in (area.low.y..=area.high.y).flat_map(|y| (area.low.x..=area.high.x).map(move |x| (x, y))) {
                let cell = Cell::new(x, y);
                let expected = brute(&map, cell, reach, unknown_is_solid).map(|square| f64::from(square).sqrt() * CELL_M);
                prop_assert_eq!(clearance.distance_m(cell), expected, "{:?}", cell);
            }
        }
    }

    #[test]
    fn a_grid_of_kept_distances_is_the_grid_of_the_map(
        writes in writes(), half_width_m in 0.0..2.0f64, unknown_is_solid in any::<bool>(),
    ) {
        let mut map = Merged::new(Lattice::new(CELL_M), None);
        let mut clearance = Clearance::new(map.lattice(), 0, bounds(), 3.0, unknown_is_solid).unwrap();
        for (count, (tile, corners, kind)) in writes.into_iter().enumerate() {
            let changed = write(&mut map, count as u32 + 1, tile, corners, value(kind));
            clearance.update(&map, changed);
        }
        let area = bounds();
        let kept = SearchGrid::of_clearance(&clearance, area, half_width_m).unwrap();
        let fresh = SearchGrid::of_map(&map.view(0, area), area, half_width_m, !unknown_is_solid).unwrap();
        for (x, y) in (area.low.y..=area.high.y).flat_map(|y| (area.low.x..=area.high.x).map(move |x| (x, y))) {
            let cell = Cell::new(x, y);
            let (kept_index, fresh_index) = (kept.index(cell).unwrap(), fresh.index(cell).unwrap());
            prop_assert_eq!(kept.passable(cell), fresh.passable(cell), "{:?}", cell);
            prop_assert_eq!(kept.only_near(kept_index), fresh.only_near(fresh_index), "{:?}", cell);
        }
    }

    #[test]
    fn what_lies_outside_a_fence_is_closed_as_the_fence_says(
        corners in proptest::collection::vec((-15.0..22.0f64, -17.0..27.0f64), 3..8), radius_m in 0.0..2.0f64,
    ) {
        let fence = Polygon::new(corners.into_iter().map(|(x_m, y_m)| Point::new(x_m, y_m)).collect());
        let area = bounds();
        let mut swept = SearchGrid::of_cells(Lattice::new(CELL_M), area, 0.0, |_| false).unwrap();
        let mut asked = swept.clone();
        swept.close_outside(&fence, radius_m);
        asked.close_where(|place| !fence.contains_disc(place, radius_m));
        for (x, y) in (area.low.y..=area.high.y).flat_map(|y| (area.low.x..=area.high.x).map(move |x| (x, y))) {
            let cell = Cell::new(x, y);
            prop_assert_eq!(swept.passable(cell), asked.passable(cell), "{:?}", cell);
        }
    }
}

#[test]
fn what_is_impossible_is_refused() {
    let lattice = Lattice::new(CELL_M);
    let all = CellRect::new(Cell::new(i32::MIN, 0), Cell::new(i32::MAX, 9));
    assert!(Clearance::new(lattice, 0, all, 1.0, true).is_err());
    assert!(Clearance::new(lattice, 0, bounds(), f64::NAN, true).is_err());
    assert!(Clearance::new(lattice, 0, bounds(), 51.0, true).is_err());
    let mut clearance = Clearance::new(lattice, 0, bounds(), 1.0, true).unwrap();
    assert!(SearchGrid::of_clearance(&clearance, bounds(), 0.4).is_ok());
    assert!(SearchGrid::of_clearance(&clearance, bounds(), 1.0).is_err());
    let everywhere = CellRect::new(Cell::new(i32::MIN, i32::MIN), Cell::new(i32::MAX, i32::MAX));
    clearance.update(&Merged::new(lattice, None), everywhere);
    assert_eq!(clearance.distance_m(Cell::new(0, 0)), Some(0.0));
    assert_eq!(clearance.distance_m(Cell::new(i32::MAX, 0)), None);
}
