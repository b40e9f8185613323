//! Which quarters and parts of cells lie inside the cone of a reading, and nearer than its echo: what it saw empty.
//!
//! A quarter is a fourth of a cell and counts when its middle lies well inside the cone; a part is a sixteenth and counts
//! when all of it does. Of a beam thinner than these, what its axis passes through counts.

use std::f64::consts::{FRAC_PI_2, SQRT_2};

use super::cell_memory::NEAR_CM;
use super::{OwnDisc, ScanReading};
use crate::geom::{Cell, Lattice, Point, Vector};
use crate::map::{CellRect, PARTS, part_offset};

/// Readings reach at most this many cells, whatever a sensor claims.
pub(super) const REACH_CELLS: f64 = 500.0;
/// Between an echo and what is empty in front of it lies at least this much more than half a cell's diagonal, metres.
const BEFORE_ECHO_M: f64 = 0.01;
/// Between an echo and the middle of a part that is empty lies at least this much more than half a part's diagonal, metres.
const PART_BEFORE_ECHO_M: f64 = 0.04;
/// So far inside the cone's edge lies the middle of a quarter that was seen, cells.
const QUARTER_INSET_CELLS: f64 = 0.15;
/// So far, the middle of a part: half of its diagonal.
const PART_INSET_CELLS: f64 = SQRT_2 / 8.0;
/// From a cell's middle to those of its quarters, and of its outermost parts, cells.
const TO_QUARTER_CELLS: f64 = SQRT_2 / 4.0;
const TO_PART_CELLS: f64 = SQRT_2 * 3.0 / 8.0;
/// All quarters of a cell.
pub(super) const ALL_QUARTERS: u8 = 0b1111;

/// What a reading saw empty of a cell.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Seen {
    /// From how far, centimetres, rounded up.
    pub(super) from_cm: u16,
    /// Its quarters, as bits: left and right of the lower row, then of the upper one.
    pub(super) quarters: u8,
    /// Its parts, as bits, row by row from below.
    pub(super) parts: u16,
}

/// A reading prepared for judging cells.
pub(super) struct Cone {
    pub(super) lattice: Lattice,
    pub(super) origin: Point,
    pub(super) axis: Vector,
    pub(super) half_width_rad: f64,
    /// Distance of the echo, metres.
    pub(super) echo_m: Option<f64>,
    sin: f64,
    cos: f64,
    /// Tangent of half of the half-width.
    tan_half: f64,
    /// A cell is empty whose middle is no farther away, metres.
    empty_to_m: f64,
    /// A part is empty whose middle is no farther away, metres.
    parts_to_m: f64,
    /// Nothing nearer is seen, metres.
    min_m: f64,
    /// What is empty counts as seen from no nearer than this, centimetres.
    pub(super) nearest_cm: u16,
}

impl Cone {
    /// Prepares a reading; `None` when its values are not finite.
    pub(super) fn of(scan: &ScanReading, lattice: Lattice) -> Option<Cone> {
        let bounds_m =
            scan.max_range_m + scan.sure_range_m + scan.min_range_m + scan.half_width_rad;
        let range_finite = scan
            .range_m
            .is_none_or(|range_m| range_m.is_finite() && range_m >= 0.0);
        if !scan.origin.is_finite() || !bounds_m.is_finite() || !range_finite {
            return None;
        }
        let cell_m = lattice.cell_m();
        let farthest_m = scan.max_range_m.min(REACH_CELLS * cell_m);
        let sure_m = scan.sure_range_m.min(farthest_m);
        let echo_m = scan.range_m.filter(|range_m| *range_m <= farthest_m);
        let before_m = |less_m: f64| echo_m.map_or(sure_m, |echo_m| sure_m.min(echo_m - less_m));
        // Just under a quarter turn, so that the tangent stays finite.
        let half_width_rad = scan.half_width_rad.clamp(0.0, FRAC_PI_2 - 1e-6);
        let (sin, cos) = libm::sincos(half_width_rad);
        Some(Cone {
            lattice,
            origin: scan.origin,
            axis: Vector::polar(scan.direction, 1.0),
            half_width_rad,
            echo_m,
            sin,
            cos,
            tan_half: sin / (1.0 + cos),
            empty_to_m: before_m(BEFORE_ECHO_M) - cell_m * SQRT_2 / 2.0,
            parts_to_m: before_m(PART_BEFORE_ECHO_M) - cell_m * PART_INSET_CELLS,
            min_m: scan.min_range_m.max(0.0),
            nearest_cm: match scan.origin_sd_m > cell_m / 2.0 {
                true => NEAR_CM + 1,
                false => 0,
            },
        })
    }

    /// Returns cells around all that can be seen empty: the cone lies within the hull of its tip, its edges and the
    /// tangents at half of its half-width.
    pub(super) fn area(&self) -> CellRect {
        let reach_m = self.empty_to_m.max(self.parts_to_m).max(0.0);
        let (ahead, aside) = (self.axis * reach_m, self.axis.left() * reach_m);
        let edge = |side: f64| ahead * self.cos + aside * (self.sin * side);
        let tangent = |side: f64| ahead + aside * (self.tan_half * side);
        let corners = [
            Vector::default(),
            edge(1.0),
            edge(-1.0),
            tangent(1.0),
            tangent(-1.0),
        ]
        .map(|to| self.origin + to);
        let tip = self.lattice.cell_at(self.origin);
        CellRect::around(self.lattice, &corners, self.lattice.cell_m() / 2.0)
            .unwrap_or(CellRect::new(tip, tip))
    }

    /// Returns what was seen empty of a cell; `None` = nothing of it. Of its parts those are left out that are `known` to be
    /// empty.
    #[inline]
    pub(super) fn sees(&self, cell: Cell, known: u16) -> Option<Seen> {
        let cell_m = self.lattice.cell_m();
        let to = self.lattice.centre(cell) - self.origin;
        let (ahead_m, depth_m) = self.depth_m(to);
        let spread_m = TO_PART_CELLS * cell_m;
        let is_beside = depth_m < PART_INSET_CELLS * cell_m - spread_m
            && self.axis.cross(to).abs() > 0.75 * cell_m;
        if ahead_m < -spread_m || is_beside {
            return None;
        }
        let distance_m = to.length_m();
        if distance_m - spread_m > self.parts_to_m {
            return None;
        }
        let is_wholly_inside = depth_m >= (PART_INSET_CELLS + TO_PART_CELLS) * cell_m;
        let quarters = if !(self.min_m..=self.empty_to_m).contains(&distance_m) {
            0
        } else if depth_m >= (QUARTER_INSET_CELLS + TO_QUARTER_CELLS) * cell_m {
            ALL_QUARTERS
        } else {
            self.quarters(to)
        };
        let is_near =
            distance_m + spread_m <= self.parts_to_m && distance_m - spread_m >= self.min_m;
        let parts = if is_wholly_inside && is_near {
            !known
        } else {
            self.parts(to, known)
        };
        (quarters != 0 || parts != 0).then(|| Seen {
            from_cm: ((distance_m * 100.0).ceil() as u16).max(self.nearest_cm),
            quarters,
            parts,
        })
    }

    /// Returns which quarters of the cell with its middle there lie inside.
    fn quarters(&self, middle: Vector) -> u8 {
        let cell_m = self.lattice.cell_m();
        (0..4).fold(0, |seen, quarter| {
            let to = middle + quarter_offset(quarter, cell_m);
            let is_inside = self.holds(to, QUARTER_INSET_CELLS * cell_m, 0.25 * cell_m);
            seen | u8::from(is_inside) << quarter
        })
    }

    /// Returns which parts of the cell with its middle there lie inside, and nearer than the echo, but for the known ones.
    fn parts(&self, middle: Vector, known: u16) -> u16 {
        let cell_m = self.lattice.cell_m();
        let unknown = (0..PARTS).filter(|part| known & (1 << part) == 0);
        unknown.fold(0, |seen, part| {
            let to = middle + part_offset(part, cell_m);
            let distance_m = to.length_m();
            let is_inside = (self.min_m..=self.parts_to_m).contains(&distance_m)
                && self.holds(to, PART_INSET_CELLS * cell_m, 0.125 * cell_m);
            seen | u16::from(is_inside) << part
        })
    }

    /// Returns whether something lies so far inside the cone, or its axis passes through it.
    fn holds(&self, to: Vector, inset_m: f64, half_side_m: f64) -> bool {
        let (ahead_m, depth_m) = self.depth_m(to);
        ahead_m > 0.0 && (depth_m >= inset_m || self.axis.cross(to).abs() <= half_side_m)
    }

    /// Returns how far ahead of the sensor a place lies, and how far inside the nearer edge of the cone, metres.
    #[inline]
    fn depth_m(&self, to: Vector) -> (f64, f64) {
        let (ahead_m, aside_m) = (self.axis.dot(to), self.axis.cross(to).abs());
        (ahead_m, ahead_m * self.sin - aside_m * self.cos)
    }
}

/// Returns where the middle of a quarter lies, seen from that of its cell.
fn quarter_offset(quarter: u8, cell_m: f64) -> Vector {
    let from_middle_m = |index: u8| (f64::from(index) - 0.5) * 0.5 * cell_m;
    Vector::new(from_middle_m(quarter % 2), from_middle_m(quarter / 2))
}

impl OwnDisc {
    /// Returns the body, or one of no size when it is impossibly large or far from the sensor.
    pub(super) fn within_reach(self, cone: &Cone) -> OwnDisc {
        let reach_m = REACH_CELLS * cone.lattice.cell_m();
        let near =
            self.at.distance_to(cone.origin) <= reach_m && (0.0..=reach_m).contains(&self.radius_m);
        if near {
            self
        } else {
            OwnDisc {
                at: cone.origin,
                radius_m: 0.0,
            }
        }
    }

    /// Returns which quarters of a cell it covers; all of them of the cell that its middle is in, if that is not larger.
    pub(super) fn covered_quarters(&self, lattice: Lattice, cell: Cell) -> u8 {
        let (cell_m, to) = (lattice.cell_m(), lattice.centre(cell) - self.at);
        if lattice.cell_at(self.at) == cell && self.radius_m >= cell_m * SQRT_2 / 2.0 {
            return ALL_QUARTERS;
        }
        (0..4).fold(0, |covered, quarter| {
            let to = to + quarter_offset(quarter, cell_m);
            covered | u8::from(to.dot(to) <= self.radius_m * self.radius_m) << quarter
        })
    }

    /// Returns which parts of a cell it covers wholly.
    pub(super) fn covered_parts(&self, lattice: Lattice, cell: Cell) -> u16 {
        let (cell_m, to) = (lattice.cell_m(), lattice.centre(cell) - self.at);
        let reach_m = (self.radius_m - PART_INSET_CELLS * cell_m).max(0.0);
        (0..PARTS).fold(0, |covered, part| {
            let to = to + part_offset(part, cell_m);
            covered | u16::from(to.dot(to) <= reach_m * reach_m) << part
        })
    }
}
