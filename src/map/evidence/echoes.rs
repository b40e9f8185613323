//! Echoes that are kept, and the arcs that they may have come from. Something on an arc answered, and nothing nearer did;
//! where on the arc it stands is not known.

use serde::{Deserialize, Serialize};

use crate::geom::{Cell, Lattice, Point, Vector};
use crate::map::{PARTS, part_offset};

/// An arc is followed at the echo's range less and plus this much, metres: the spread of a reading.
const SPREAD_M: f64 = 0.02;
/// Half of the band around an arc from which its echo came, metres.
const BAND_M: f64 = 0.06;
/// Steps along an arc, parts.
const STEP_PARTS: f64 = 0.9;
/// A part is looked for among so many that were met last: arcs are convex, so it is met again soon or never.
const MET_LAST: usize = 6;
/// Points along an arc at most, whatever a sensor claims.
const MOST_STEPS: f64 = 2000.0;
/// Two echoes are alike when they come from within these: origin, metres; sine of the angle between the axes; range, metres.
const ALIKE_ORIGIN_M: f64 = 0.1;
const ALIKE_AXIS: f64 = 0.052;
const ALIKE_RANGE_M: f64 = 0.03;

/// An echo: from where, along which axis, from how far, and which cells explain it. Numbers are kept short, since there
/// are many of them.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct Echo {
    origin_m: [f32; 2],
    /// Unit vector.
    axis: [f32; 2],
    range_m: f32,
    half_width_rad: f32,
    /// The part that explains it, counted in parts.
    pub(super) to: Cell,
    /// A second one, which explains as much.
    pub(super) also: Option<Cell>,
}

impl Echo {
    /// Makes an echo that nothing explains yet.
    pub(super) fn new(origin: Point, axis: Vector, range_m: f64, half_width_rad: f64) -> Echo {
        Echo {
            origin_m: [origin.x_m as f32, origin.y_m as f32],
            axis: [axis.x_m as f32, axis.y_m as f32],
            range_m: range_m as f32,
            half_width_rad: half_width_rad as f32,
            to: Cell::new(0, 0),
            also: None,
        }
    }

    /// Returns where the sensor was.
    #[inline]
    pub(super) fn origin(&self) -> Point {
        Point::new(f64::from(self.origin_m[0]), f64::from(self.origin_m[1]))
    }

    /// Returns where it looked, a unit vector.
    #[inline]
    pub(super) fn axis(&self) -> Vector {
        Vector::new(f64::from(self.axis[0]), f64::from(self.axis[1]))
    }

    /// Returns its range, metres.
    #[inline]
    pub(super) fn range_m(&self) -> f64 {
        f64::from(self.range_m)
    }

    /// Returns its range, centimetres, rounded.
    #[inline]
    pub(super) fn range_cm(&self) -> u16 {
        (self.range_m() * 100.0 + 0.5) as u16
    }

    /// Returns the sector of 22.5° in which the sensor was as seen from a cell, as one of 16 bits.
    pub(super) fn sector_from(&self, middle: Point) -> u16 {
        let to = self.origin() - middle;
        let turns = libm::atan2(to.y_m, to.x_m) / std::f64::consts::TAU;
        1 << ((turns * 16.0).floor() as i32).rem_euclid(16)
    }

    /// Returns whether a cell explains it.
    #[inline]
    pub(super) fn is_explained_by(&self, cell: Cell) -> bool {
        cell_of_part(self.to) == cell || self.also.is_some_and(|part| cell_of_part(part) == cell)
    }

    /// Returns whether another one says the same.
    pub(super) fn is_like(&self, other: &Echo) -> bool {
        (self.range_m() - other.range_m()).abs() < ALIKE_RANGE_M
            && self.origin().distance_to(other.origin()) < ALIKE_ORIGIN_M
            && self.axis().dot(other.axis()) > 0.0
            && self.axis().cross(other.axis()).abs() < ALIKE_AXIS
    }

    /// Returns how far a place lies from the middle of the arc, centimetres, rounded.
    #[inline]
    pub(super) fn off_cm(&self, place: Point) -> u16 {
        let middle = self.origin() + self.axis() * self.range_m();
        (place.distance_to(middle) * 100.0 + 0.5) as u16
    }

    /// Returns the parts of the cell with its middle there from which it can have come: those within a band around its arc.
    pub(super) fn band_in(&self, cells: Lattice, middle: Point) -> u16 {
        let (origin, range_m) = (self.origin(), self.range_m());
        let band_m = BAND_M.max(0.3 * cells.cell_m());
        (0..PARTS).fold(0, |band, part| {
            let at = middle + part_offset(part, cells.cell_m());
            let is_within = (at.distance_to(origin) - range_m).abs() < band_m;
            band | u16::from(is_within) << part
        })
    }

    /// Writes the parts that the arc meets into `cells`, from its right end to its left one, each once; `lattice` is that of
    /// the parts.
    pub(super) fn follow(&self, lattice: Lattice, cells: &mut Vec<Cell>) {
        cells.clear();
        let (range_m, half_rad) = (self.range_m(), f64::from(self.half_width_rad));
        let wanted = 2.0 * half_rad * range_m / (STEP_PARTS * lattice.cell_m());
        let steps = wanted.min(MOST_STEPS).ceil() as u32;
        let (sin, cos) = libm::sincos(if steps == 0 { 0.0 } else { half_rad });
        let mut along = turned(self.axis(), (-sin, cos));
        let step = libm::sincos(2.0 * half_rad / f64::from(steps.max(1)));
        for _ in 0..=steps {
            for range_m in [range_m - SPREAD_M, range_m + SPREAD_M] {
                let cell = lattice.cell_at(self.origin() + along * range_m);
                let met = cells.len().saturating_sub(MET_LAST);
                if !cells[met..].contains(&cell) {
                    cells.push(cell);
                }
            }
            along = turned(along, step);
        }
    }
}

/// Returns the cell that a part lies in, counted in parts.
#[inline]
pub(super) fn cell_of_part(part: Cell) -> Cell {
    Cell::new(part.x >> 2, part.y >> 2)
}

/// Returns the place of a part in its cell, row by row from below.
#[inline]
pub(super) fn index_of_part(part: Cell) -> usize {
    (((part.y & 3) << 2) | (part.x & 3)) as usize
}

/// Turns a vector anticlockwise by an angle of this sine and cosine.
#[inline]
fn turned(vector: Vector, (sin, cos): (f64, f64)) -> Vector {
    vector * cos + vector.left() * sin
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Angle;
    use proptest::prelude::*;

    fn echo(origin: Point, degrees: f64, range_m: f64, half_degrees: f64) -> Echo {
        let axis = Vector::polar(Angle::from_degrees(degrees), 1.0);
        Echo::new(origin, axis, range_m, half_degrees.to_radians())
    }

    proptest! {
        #[test]
        fn an_arc_holds_each_part_that_it_passes_through_once(
            x_m in -20.0..20.0f64, y_m in -20.0..20.0f64, degrees in -180.0..180.0f64,
            range_m in 0.1..6.0f64, half_degrees in 0.0..30.0f64,
        ) {
            let (lattice, origin) = (Lattice::new(0.05), Point::new(x_m, y_m));
            let mut cells = Vec::new();
            echo(origin, degrees, range_m, half_degrees).follow(lattice, &mut cells);
            let mut once = cells.clone();
            once.sort_unstable();
            once.dedup();
            prop_assert_eq!(once.len(), cells.len());
            for cell in &cells {
                let middle = lattice.centre(*cell);
                prop_assert!((middle.distance_to(origin) - range_m).abs() < 0.036 + 0.021);
            }
            // No point of the arc is farther than a part from one of them.
            for step in 0..=100 {
                let turn_deg = half_degrees * (f64::from(step) / 50.0 - 1.0);
                let at = origin + Vector::polar(Angle::from_degrees(degrees + turn_deg), range_m);
                let is_near = |part: &Cell| lattice.centre(*part).distance_to(at) < 0.06;
                prop_assert!(cells.iter().any(is_near), "{at}");
            }
        }
    }

    #[test]
    fn the_sector_is_that_of_the_sensor_as_seen_from_the_cell() {
        let sector =
            |x_m, y_m| echo(Point::new(x_m, y_m), 0.0, 1.0, 15.0).sector_from(Point::default());
        assert_eq!(sector(1.0, 0.1), 1);
        assert_eq!(sector(0.1, 1.0), 1 << 3);
        assert_eq!(sector(-1.0, -0.1), 1 << 8);
        assert_eq!(sector(1.0, -0.1), 1 << 15);
    }

    #[test]
    fn alike_are_echoes_of_one_thing_from_one_place() {
        let one = echo(Point::new(1.0, 1.0), 10.0, 2.0, 15.0);
        assert!(one.is_like(&echo(Point::new(1.05, 1.0), 12.0, 2.02, 15.0)));
        for other in [
            echo(Point::new(1.2, 1.0), 10.0, 2.0, 15.0),
            echo(Point::new(1.0, 1.0), 20.0, 2.0, 15.0),
            echo(Point::new(1.0, 1.0), 190.0, 2.0, 15.0),
            echo(Point::new(1.0, 1.0), 10.0, 2.1, 15.0),
        ] {
            assert!(!one.is_like(&other));
        }
    }
}
