//! The cells near a segment, row by row: what a disc sweeps.

use std::ops::RangeInclusive;

use crate::geom::{Lattice, Segment, ceil_to_i32, floor_to_i32};

/// Every row there is.
pub(super) const ALL_ROWS: RangeInclusive<i32> = i32::MIN..=i32::MAX;

/// Returns, for each row that a disc of `radius_m` touches while it moves along a segment, the columns that may
/// have their middle inside. It is the disc's strip cut by its bounds, so near the ends a few columns too many:
/// who needs it exact tests the distance. Only rows within `rows` are given.
pub(super) fn rows_within(
    lattice: Lattice,
    along: Segment,
    radius_m: f64,
    rows: RangeInclusive<i32>,
) -> impl Iterator<Item = (i32, RangeInclusive<i32>)> {
    let Segment { from, to } = along;
    let cell_m = lattice.cell_m();
    let row_from = ceil_to_i32((from.y_m.min(to.y_m) - radius_m) / cell_m - 0.5);
    let row_from = row_from.max(*rows.start());
    let row_to = floor_to_i32((from.y_m.max(to.y_m) + radius_m) / cell_m - 0.5);
    let row_to = row_to.min(*rows.end());
    let bounds_m = (
        from.x_m.min(to.x_m) - radius_m,
        from.x_m.max(to.x_m) + radius_m,
    );
    let vector = along.vector();
    // Columns of the infinite strip at height y: middle ± half, moving by `slope` with y.
    let steep = vector.y_m.abs() > 1e-9;
    let slope = if steep { vector.x_m / vector.y_m } else { 0.0 };
    let half_m = if steep {
        radius_m * vector.length_m() / vector.y_m.abs()
    } else {
        f64::INFINITY
    };
    (row_from..=row_to).map(move |row| {
        let middle_m = from.x_m + ((f64::from(row) + 0.5) * cell_m - from.y_m) * slope;
        let low_m = (middle_m - half_m).max(bounds_m.0);
        let high_m = (middle_m + half_m).min(bounds_m.1);
        // Rounded outward a little, so that a middle exactly on the border is not lost to rounding.
        let low = ceil_to_i32(low_m / cell_m - 0.5 - 1e-9);
        let high = floor_to_i32(high_m / cell_m - 0.5 + 1e-9);
        (row, low..=high)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Cell, Point};
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #[test]
        fn rows_hold_every_cell_within_the_radius_and_few_more(
            x0 in -3.0..3.0f64, y0 in -3.0..3.0f64, x1 in -3.0..3.0f64, y1 in -3.0..3.0f64, radius_m in 0.0..0.9f64,
        ) {
            let lattice = Lattice::new(0.2);
            let along = Segment::new(Point::new(x0, y0), Point::new(x1, y1));
            let exact: BTreeSet<Cell> = lattice.cells_within(along, radius_m).collect();
            let rows: BTreeSet<Cell> = rows_within(lattice, along, radius_m, ALL_ROWS)
                .flat_map(|(y, columns)| columns.map(move |x| Cell::new(x, y)))
                .collect();
            prop_assert!(exact.is_subset(&rows));
            prop_assert!(rows.iter().all(|c| along.distance_to_point(lattice.centre(*c)) <= 1.5 * radius_m + 1e-6));
        }
    }
}
