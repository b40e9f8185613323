//! What is written the fast way, asked cell by cell.

use std::sync::Arc;

use proptest::prelude::*;
use tomoswarm_proto::{LayerId, TILE_CELLS, TileAddress, TileReport};

use super::*;
use crate::map::Merged;

const CELL_M: f64 = 0.2;

/// A map of one tile, which holds these cells' values and is free elsewhere; around it nothing is known.
fn map(values: &[((usize, usize), i8)]) -> Merged {
    let mut cells = [-17; TILE_CELLS];
    for ((x, y), value) in values {
        cells[y * 32 + x] = *value;
    }
    let mut map = Merged::new(Lattice::new(CELL_M), None);
    map.join(&TileReport {
        layer: LayerId::default(),
        address: TileAddress {
            slice: 0,
            x: 0,
            y: 0,
        },
        revision: 1,
        cells: Arc::new(cells),
    })
    .unwrap();
    map
}

fn values() -> impl Strategy<Value = Vec<((usize, usize), i8)>> {
    let value = prop_oneof![Just(0_i8), Just(17)];
    proptest::collection::vec(((0..32_usize, 0..32_usize), value), 0..40)
}

proptest! {
    #[test]
    fn what_is_closed_along_the_fence_lies_nearer_to_it_or_outside(
        corners in proptest::collection::vec((-3.0..5.0f64, -3.0..5.0f64), 3..8), radius_m in 0.0..1.5f64,
    ) {
        let fence = Polygon::new(corners.iter().map(|(x, y)| Point::new(*x, *y)).collect());
        let area = CellRect::new(Cell::new(-20, -17), Cell::new(30, 22));
        let mut grid = SearchGrid::of_cells(Lattice::new(CELL_M), area, 0.0, |_| false).unwrap();
        let mut slow = grid.clone();
        grid.close_outside(&fence, radius_m);
        slow.close_where(|middle| !fence.contains_disc(middle, radius_m));
        prop_assert_eq!(grid.flags, slow.flags);
    }

    #[test]
    fn a_grid_of_the_map_is_that_of_its_cells(values in values(), unknown_allowed in any::<bool>()) {
        let (map, area) = (map(&values), CellRect::new(Cell::new(-9, -3), Cell::new(40, 35)));
        let view = map.view(0, area.grown(-4));
        let grid = SearchGrid::of_map(&view, area, 0.3, unknown_allowed).unwrap();
        let solid = |cell| match view.occupancy(cell) {
            Occupancy::Free => false,
            Occupancy::Unknown => !unknown_allowed,
            Occupancy::Occupied => true,
        };
        let clearance_m = swept_clearance_m(0.3, view.lattice());
        let slow = SearchGrid::of_cells(view.lattice(), area, clearance_m, solid).unwrap();
        prop_assert_eq!(&grid.flags, &slow.flags);
        let copied = view.occupancy_grid(area);
        for cell in area.grown(2).cells() {
            let known = if area.contains(cell) { view.occupancy(cell) } else { Occupancy::Unknown };
            prop_assert_eq!(copied.occupancy(cell), known);
            let around = CellRect::new(cell, cell).grown(2).overlap(area);
            let is_occupied = |cell| view.occupancy(cell) == Occupancy::Occupied;
            let has_occupied = around.is_some_and(|around| around.cells().any(is_occupied));
            prop_assert_eq!(copied.has_occupied_around(cell, 2), has_occupied);
        }
    }

}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_node_is_open_that_keeps_what_is_required_from_every_part(
        values in values(), safety_m in 0.25..0.9f64, stands in (0.5..6.0f64, 0.5..6.0f64),
        spacing in prop_oneof![Just(NodeSpacing::HalfCell), Just(NodeSpacing::Part)],
    ) {
        let (map, area) = (map(&values), CellRect::new(Cell::new(0, 0), Cell::new(31, 31)));
        let view = map.view(0, area);
        let clearance = RequiredClearance::planned(0.25, safety_m, 0.04, CELL_M);
        let stands = Point::new(stands.0, stands.1);
        let grid = SearchGrid::of_parts(&view, area, clearance, |_, _| true, stands, spacing).unwrap();
        let parts = || area.cells().filter_map(|cell| Some((cell, view.barred(cell)?)));
        for node in grid.area().cells() {
            let middle = grid.lattice().centre(node);
            let (mut is_near, mut is_beside_vehicle) = (false, false);
            for (cell, barred) in parts() {
                let kept_m = clearance.from_cell_m(barred);
                for part in barred.places(view.lattice(), cell) {
                    is_near |= part.distance_to(middle) < kept_m * (1.0 - 1e-9);
                    is_beside_vehicle |= part.distance_to(stands) < kept_m;
                }
            }
            // Who stands too near to something may leave it.
            prop_assume!(!is_beside_vehicle);
            prop_assert_eq!(grid.passable(node), !is_near, "{:?}", node);
        }
    }
}
