//! The venue's lattice of square cells; cell (0, 0) has its lower corner at the datum.

use serde::{Deserialize, Serialize};

use super::{Point, Segment};

/// A cell of the lattice, by column (x) and row (y).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
pub struct Cell {
    /// Column, growing along x.
    pub x: i32,
    /// Row, growing along y.
    pub y: i32,
}

impl Cell {
    /// Makes a cell from its column and row.
    #[inline]
    pub const fn new(x: i32, y: i32) -> Cell {
        Cell { x, y }
    }
}

/// Square cells of one size over the whole plane.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Lattice {
    cell_m: f64,
}

impl Lattice {
    /// Makes a lattice of cells with the given side, metres; it must be positive.
    #[inline]
    pub fn new(cell_m: f64) -> Lattice {
        debug_assert!(cell_m > 0.0);
        Lattice { cell_m }
    }

    /// Returns the side of a cell, metres.
    #[inline]
    pub fn cell_m(self) -> f64 {
        self.cell_m
    }

    /// Returns the cell that holds a point (floor, so cells left of the datum are negative). What is too far away, or no
    /// number, is in a cell at the very edge, far outside any map.
    pub fn cell_at(self, point: Point) -> Cell {
        let index = |metres: f64| {
            let cells = metres / self.cell_m;
            if cells.is_nan() {
                i32::MIN
            } else {
                floor_to_i32(cells)
            }
        };
        Cell::new(index(point.x_m), index(point.y_m))
    }

    /// Returns the middle of a cell.
    #[inline]
    pub fn centre(self, cell: Cell) -> Point {
        let middle = |index: i32| (f64::from(index) + 0.5) * self.cell_m;
        Point::new(middle(cell.x), middle(cell.y))
    }

    /// Returns all cells whose middle lies within `radius_m` of a segment, row by row.
    #[cfg(test)]
    pub fn cells_within(self, along: Segment, radius_m: f64) -> impl Iterator<Item = Cell> {
        let Segment { from, to } = along;
        let low = self.cell_at(Point::new(
            from.x_m.min(to.x_m) - radius_m,
            from.y_m.min(to.y_m) - radius_m,
        ));
        let high = self.cell_at(Point::new(
            from.x_m.max(to.x_m) + radius_m,
            from.y_m.max(to.y_m) + radius_m,
        ));
        (low.y..=high.y)
            .flat_map(move |y| (low.x..=high.x).map(move |x| Cell::new(x, y)))
            .filter(move |cell| along.distance_to_point(self.centre(*cell)) <= radius_m)
    }

    /// Returns the cells that a segment passes through, in order, each once (Amanatides and Woo 1987); none when an end is
    /// not finite.
    #[inline]
    pub fn cells_under(self, along: Segment) -> CellsUnder {
        CellsUnder::new(self, along)
    }
}

/// Returns the largest whole number that is not greater, the outermost one for what is beyond all; 0 for what is no number.
#[inline]
pub(crate) fn floor_to_i32(value: f64) -> i32 {
    let toward_zero = value as i32;
    toward_zero.saturating_sub(i32::from(f64::from(toward_zero) > value))
}

/// Returns the smallest whole number that is not less, the outermost one for what is beyond all; 0 for what is no number.
#[inline]
pub(crate) fn ceil_to_i32(value: f64) -> i32 {
    let toward_zero = value as i32;
    toward_zero.saturating_add(i32::from(f64::from(toward_zero) < value))
}

/// The cells under a segment, from its start to its end.
#[derive(Clone, Debug)]
pub struct CellsUnder {
    next: Option<Cell>,
    last: Cell,
    step: (i32, i32),
    /// Share of the segment at which the next border in x and in y is crossed.
    border: (f64, f64),
    /// Share of the segment between two borders in x and in y.
    pitch: (f64, f64),
}

impl CellsUnder {
    fn new(lattice: Lattice, along: Segment) -> CellsUnder {
        let (first, last) = (lattice.cell_at(along.from), lattice.cell_at(along.to));
        let axis = |from_m: f64, length_m: f64, cell: i32| {
            if length_m == 0.0 {
                return (0, f64::INFINITY, f64::INFINITY);
            }
            let edge = if length_m > 0.0 { cell + 1 } else { cell };
            let border = (f64::from(edge) * lattice.cell_m - from_m) / length_m;
            (
                if length_m > 0.0 { 1 } else { -1 },
                border,
                (lattice.cell_m / length_m).abs(),
            )
        };
        let vector = along.vector();
        let (step_x, border_x, pitch_x) = axis(along.from.x_m, vector.x_m, first.x);
        let (step_y, border_y, pitch_y) = axis(along.from.y_m, vector.y_m, first.y);
        CellsUnder {
            next: (along.from.is_finite() && along.to.is_finite()).then_some(first),
            last,
            step: (step_x, step_y),
            border: (border_x, border_y),
            pitch: (pitch_x, pitch_y),
        }
    }

    /// Moves to the next cell; never past the last one in either axis, whatever rounding does.
    fn advance(&mut self, from: Cell) -> Option<Cell> {
        let (done_x, done_y) = (from.x == self.last.x, from.y == self.last.y);
        if done_x && done_y {
            return None;
        }
        if done_y || (!done_x && self.border.0 <= self.border.1) {
            self.border.0 += self.pitch.0;
            return Some(Cell::new(from.x + self.step.0, from.y));
        }
        self.border.1 += self.pitch.1;
        Some(Cell::new(from.x, from.y + self.step.1))
    }
}

impl Iterator for CellsUnder {
    type Item = Cell;
    #[inline]
    fn next(&mut self) -> Option<Cell> {
        let cell = self.next?;
        self.next = self.advance(cell);
        Some(cell)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn cells_left_of_the_datum_are_negative() {
        let lattice = Lattice::new(0.2);
        assert_eq!(lattice.cell_at(Point::new(-0.01, 0.39)), Cell::new(-1, 1));
        assert_eq!(
            lattice.cell_at(lattice.centre(Cell::new(-7, 12))),
            Cell::new(-7, 12)
        );
    }

    #[test]
    fn whole_numbers_below_and_above_are_those_of_libm() {
        for value in [
            0.0,
            -0.0,
            0.5,
            -0.5,
            3.0,
            -3.0,
            2.9999,
            -2.0001,
            1e300,
            -1e300,
            2147483647.5,
        ] {
            assert_eq!(floor_to_i32(value), libm::floor(value) as i32, "{value}");
            assert_eq!(ceil_to_i32(value), libm::ceil(value) as i32, "{value}");
        }
    }

    #[test]
    fn what_is_no_place_is_not_filed_under_the_first_cell() {
        let lattice = Lattice::new(0.2);
        let edge = Cell::new(i32::MIN, i32::MIN);
        assert_eq!(
            lattice.cell_at(Point::new(f64::NAN, f64::NEG_INFINITY)),
            edge
        );
        assert_eq!(
            lattice.cell_at(Point::new(1e300, 0.1)),
            Cell::new(i32::MAX, 0)
        );
        let nowhere = Segment::new(Point::default(), Point::new(f64::NAN, 1.0));
        assert_eq!(lattice.cells_under(nowhere).count(), 0);
    }

    proptest! {
        #[test]
        fn a_walk_joins_both_ends_without_a_gap(
            x0 in -9.0..9.0f64, y0 in -9.0..9.0f64, x1 in -9.0..9.0f64, y1 in -9.0..9.0f64,
        ) {
            let lattice = Lattice::new(0.2);
            let along = Segment::new(Point::new(x0, y0), Point::new(x1, y1));
            let cells: Vec<Cell> = lattice.cells_under(along).collect();
            prop_assert_eq!(cells[0], lattice.cell_at(along.from));
            prop_assert_eq!(cells[cells.len() - 1], lattice.cell_at(along.to));
            for pair in cells.windows(2) {
                prop_assert_eq!((pair[1].x - pair[0].x).abs() + (pair[1].y - pair[0].y).abs(), 1);
            }
            for cell in cells {
                prop_assert!(along.distance_to_point(lattice.centre(cell)) < 0.2);
            }
        }
    }
}
