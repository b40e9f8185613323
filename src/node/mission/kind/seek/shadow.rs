//! From where a place is surely not seen: what hides it from one direction hides it from all directions in which it stands,
//! from farther away. Most rays need not be asked so; what is not surely hidden is asked.

use crate::geom::{Cell, Lattice, Point};

/// Into so many parts all directions are divided.
const PARTS: usize = 128;
/// All directions together, as [`direction`] counts them.
const ALL_AROUND: f64 = 4.0;
/// More than what is lost by rounding, in directions.
const ROUNDED: f64 = 1e-6;

/// What hides a place.
#[derive(Clone, Default)]
pub(super) struct Shadow {
    /// By direction the square of the distance from which on the place is hidden, square metres; empty while nothing hides it.
    beyond_m2: Vec<f64>,
}

impl Shadow {
    /// Returns whether the place is surely hidden from another one.
    #[inline]
    pub(super) fn holds(&self, place: Point, from: Point) -> bool {
        if self.beyond_m2.is_empty() {
            return false;
        }
        let (x_m, y_m) = (from.x_m - place.x_m, from.y_m - place.y_m);
        let part = (direction(x_m, y_m) * (PARTS as f64 / ALL_AROUND)) as usize;
        let beyond_m2 = self.beyond_m2.get(part);
        beyond_m2.is_some_and(|beyond_m2| x_m * x_m + y_m * y_m > *beyond_m2)
    }

    /// Notes that a cell, another one than that of the place, hides what is behind it.
    pub(super) fn add(&mut self, place: Point, lattice: Lattice, hiding: Cell) {
        let (middle, half_m) = (lattice.centre(hiding), 0.5 * lattice.cell_m());
        let (x_m, y_m) = (middle.x_m - place.x_m, middle.y_m - place.y_m);
        let toward = direction(x_m, y_m);
        let (mut low, mut high, mut beyond_m2) = (0.0f64, 0.0f64, 0.0f64);
        for (x, y) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
            let (x_m, y_m) = (x_m + x * half_m, y_m + y * half_m);
            let off = direction(x_m, y_m) - toward;
            // The short way around: from outside a square is seen under less than half of all directions.
            let off = off - ALL_AROUND * (off / ALL_AROUND).round();
            (low, high) = (low.min(off), high.max(off));
            beyond_m2 = beyond_m2.max(x_m * x_m + y_m * y_m);
        }
        if self.beyond_m2.is_empty() {
            self.beyond_m2 = vec![f64::INFINITY; PARTS];
        }
        // Whole parts alone.
        let in_parts = PARTS as f64 / ALL_AROUND;
        let first = ((toward + low + ROUNDED) * in_parts).ceil() as i64;
        let end = ((toward + high - ROUNDED) * in_parts).floor() as i64;
        for part in first..end {
            let known = &mut self.beyond_m2[part.rem_euclid(PARTS as i64) as usize];
            *known = known.min(beyond_m2);
        }
    }
}

/// Returns a number that grows with the direction, from 0 along x over 1 along y to 4, without an angle's price.
#[inline]
fn direction(x_m: f64, y_m: f64) -> f64 {
    let share = y_m / (x_m.abs() + y_m.abs());
    match (x_m < 0.0, y_m < 0.0) {
        (true, _) => 2.0 - share,
        (false, true) => ALL_AROUND + share,
        (false, false) => share,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Segment;
    use proptest::prelude::*;

    #[test]
    fn a_cell_beside_a_place_hides_what_is_behind_it() {
        let lattice = Lattice::new(0.2);
        let place = lattice.centre(Cell::new(-3, 2));
        let mut shadow = Shadow::default();
        let behind = Point::new(place.x_m - 1.0, place.y_m + 0.1);
        assert!(!shadow.holds(place, behind));
        shadow.add(place, lattice, Cell::new(-4, 2));
        assert!(shadow.holds(place, behind));
        let before = Point::new(place.x_m - 0.09, place.y_m);
        let beside = Point::new(place.x_m - 1.0, place.y_m + 1.1);
        let opposite = Point::new(place.x_m + 1.0, place.y_m + 0.1);
        for from in [before, beside, opposite, place] {
            assert!(!shadow.holds(place, from), "{from:?}");
        }
    }

    proptest! {
        #[test]
        fn what_a_shadow_holds_no_ray_reaches(
            hiding in (-12..12i32, -12..12i32),
            places in prop::collection::vec((-4.0..4.0f64, -4.0..4.0f64), 1..60),
        ) {
            let lattice = Lattice::new(0.2);
            let (place, hiding) = (lattice.centre(Cell::new(0, 0)), Cell::new(hiding.0, hiding.1));
            prop_assume!(hiding != Cell::new(0, 0));
            let mut shadow = Shadow::default();
            shadow.add(place, lattice, hiding);
            let mut held = 0;
            for (x_m, y_m) in places {
                // Places on the lattice too: their rays go through corners.
                for from in [Point::new(x_m, y_m), lattice.centre(lattice.cell_at(Point::new(x_m, y_m)))] {
                    if shadow.holds(place, from) {
                        held += 1;
                        let ray = Segment::new(from, place);
                        prop_assert!(lattice.cells_under(ray).any(|cell| cell == hiding));
                    }
                }
            }
            // A cell beside the place hides a sixth of all directions and more.
            let away = hiding.x.abs().max(hiding.y.abs());
            prop_assert!(held > 0 || away > 1 || shadow.beyond_m2.iter().any(|beyond| beyond.is_finite()));
        }
    }
}
