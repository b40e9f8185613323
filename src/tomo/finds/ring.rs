//! The ring along which the ends of links were driven.

use super::Driven;
use crate::geom::{Point, Rect};
use crate::tomo::Observation;

/// Ends are farther from the ring than this, bins: then it is none.
const OFF_RING_BINS: f64 = 3.0;

/// A rectangle that is driven along.
#[derive(Clone, Copy)]
pub(super) struct Ring(Rect);

impl Ring {
    /// Returns the ring of a sweep whose ends all lie on it; `None` of any other one.
    pub(super) fn of(observations: &[Observation], driven: Driven) -> Option<Ring> {
        let ring = Ring(driven.ring);
        let is_near = |at: Point| ring.off_m(at) <= OFF_RING_BINS * driven.bin_m;
        let are_on_it = observations
            .iter()
            .all(|one| is_near(one.from) && is_near(one.to));
        are_on_it.then_some(ring)
    }

    /// Returns its length, metres.
    pub(super) fn length_m(self) -> f64 {
        2.0 * (self.0.width_m() + self.0.height_m())
    }

    /// Returns how far along it from its south-western corner, counter-clockwise, the place nearest to a point lies, metres.
    pub(super) fn along_m(self, at: Point) -> f64 {
        let Ring(rect) = self;
        let (width_m, height_m) = (rect.width_m(), rect.height_m());
        let (x_m, y_m) = (at.x_m - rect.min.x_m, at.y_m - rect.min.y_m);
        let to_side = [y_m, x_m - width_m, y_m - height_m, x_m].map(f64::abs);
        let (x_m, y_m) = (x_m.clamp(0.0, width_m), y_m.clamp(0.0, height_m));
        let nearest = (0..4).min_by(|a, b| to_side[*a].total_cmp(&to_side[*b]));
        match nearest {
            Some(0) => x_m,
            Some(1) => width_m + y_m,
            Some(2) => width_m + height_m + (width_m - x_m),
            _ => 2.0 * width_m + height_m + (height_m - y_m),
        }
    }

    /// Returns how far apart along it two ends are, the shorter way around, and where along it the middle between them is, metres.
    pub(super) fn spans_m(self, from: Point, to: Point) -> (f64, f64) {
        let (from_m, to_m) = (self.along_m(from), self.along_m(to));
        let onward_m = self.wrapped_m(to_m - from_m);
        let first_m = if onward_m < 0.0 { to_m } else { from_m };
        let apart_m = onward_m.abs();
        (apart_m, (first_m + 0.5 * apart_m) % self.length_m())
    }

    /// Returns a difference of two such places the shorter way around, metres.
    pub(super) fn wrapped_m(self, difference_m: f64) -> f64 {
        let turns = libm::floor(difference_m / self.length_m() + 0.5);
        difference_m - turns * self.length_m()
    }

    /// Returns how far a place is from it, metres.
    fn off_m(self, at: Point) -> f64 {
        let Ring(rect) = self;
        let (inner_x_m, inner_y_m) = (
            (at.x_m - rect.min.x_m).min(rect.max.x_m - at.x_m),
            (at.y_m - rect.min.y_m).min(rect.max.y_m - at.y_m),
        );
        inner_x_m.min(inner_y_m).abs()
    }
}
