//! How much a pixel weighs in a link whose energy fills half of the first Fresnel zone:
//!
//! ```text
//!   w ∝ N(h; 0, r²)        r² = (λ / 4) d q (1 − q) + (width of the pixel across the link)² / 12
//! ```
//!
//! h = distance of the pixel's middle from the line, q = its share of the way along the link, d = length, λ = wavelength: the
//! width that a person meets ([`super::person`]), and the blur of the pixel. Pixels beside the ends weigh nothing.

use crate::geom::{PixelGrid, Point, Segment};

/// Beyond this many widths nothing is counted; 1.2 % of the weight is there.
const REACH_WIDTHS: f64 = 2.5;

/// A link as its pixels meet it.
#[derive(Clone, Copy, Debug)]
pub(super) struct FresnelLink {
    from: Point,
    /// Direction, of length 1.
    ux: f64,
    uy: f64,
    length_m: f64,
    wavelength_m: f64,
    /// Variance of the places in a pixel across the link, m².
    pixel_m2: f64,
}

impl FresnelLink {
    /// Makes it for a link that is not empty.
    pub(super) fn new(link: Segment, grid: &PixelGrid, wavelength_m: f64) -> FresnelLink {
        let length_m = link.length_m();
        let (ux, uy) = (link.vector().x_m / length_m, link.vector().y_m / length_m);
        let (across_x, across_y) = (grid.dx_m() * uy, grid.dy_m() * ux);
        FresnelLink {
            from: link.from,
            ux,
            uy,
            length_m,
            wavelength_m,
            pixel_m2: (across_x * across_x + across_y * across_y) / 12.0,
        }
    }

    /// Returns the weight of a pixel by its middle, not rescaled.
    pub(super) fn weight(&self, centre: Point) -> f64 {
        let off = centre - self.from;
        let ahead_m = off.x_m * self.ux + off.y_m * self.uy;
        if !(ahead_m > 0.0 && ahead_m < self.length_m) {
            return 0.0;
        }
        let away_m = off.y_m * self.ux - off.x_m * self.uy;
        let share = ahead_m / self.length_m;
        let width_m2 =
            self.wavelength_m / 4.0 * self.length_m * share * (1.0 - share) + self.pixel_m2;
        let square = away_m * away_m / width_m2;
        if square > REACH_WIDTHS * REACH_WIDTHS {
            return 0.0;
        }
        libm::exp(-0.5 * square) / width_m2.sqrt()
    }

    /// Returns the span of x in which pixels of a row may weigh anything; `None` when none does.
    pub(super) fn span(&self, y_m: f64) -> Option<(f64, f64)> {
        let widest_m2 = self.wavelength_m * self.length_m / 16.0 + self.pixel_m2;
        let reach_m = REACH_WIDTHS * widest_m2.sqrt();
        let up_m = y_m - self.from.y_m;
        // −reach ≤ up·ux − x·uy ≤ reach, and 0 ≤ x·ux + up·uy ≤ length; x from the first end.
        let beside = between(-self.uy, up_m * self.ux, -reach_m, reach_m)?;
        let along = between(self.ux, up_m * self.uy, 0.0, self.length_m)?;
        let (low, high) = (beside.0.max(along.0), beside.1.min(along.1));
        (low <= high).then_some((low + self.from.x_m, high + self.from.x_m))
    }
}

/// Returns where `low ≤ slope · x + constant ≤ high`.
fn between(slope: f64, constant: f64, low: f64, high: f64) -> Option<(f64, f64)> {
    if slope.abs() < 1e-12 {
        let is_inside = (low..=high).contains(&constant);
        return is_inside.then_some((f64::NEG_INFINITY, f64::INFINITY));
    }
    let (one, other) = ((low - constant) / slope, (high - constant) / slope);
    Some((one.min(other), one.max(other)))
}

#[cfg(test)]
mod tests {
    use crate::geom::{PixelGrid, Point, Rect, Segment};
    use crate::tomo::{WeightModel, WeightRows};

    const GRID: PixelGrid = PixelGrid {
        area: Rect {
            min: Point::new(0.0, 0.0),
            max: Point::new(20.0, 20.0),
        },
        columns: 200,
        rows: 200,
    };

    fn row(link: Segment) -> Vec<(usize, f64)> {
        let model = WeightModel::Fresnel {
            wavelength_m: 0.125,
        };
        let rows = WeightRows::rescaled([link], &GRID, model);
        rows.row(0).collect()
    }

    /// Returns the deviation of the weights of a column of pixels across a link along x.
    fn width_m(weights: &[(usize, f64)], column: usize, y_m: f64) -> f64 {
        let of_column = weights.iter().filter(|(pixel, _)| pixel % 200 == column);
        let (mut sum, mut square) = (0.0, 0.0);
        for (pixel, weight) in of_column {
            let off_m = GRID.centre(*pixel).y_m - y_m;
            sum += weight;
            square += weight * off_m * off_m;
        }
        (square / sum).sqrt()
    }

    #[test]
    fn a_link_is_half_as_wide_as_the_first_fresnel_zone_and_narrow_at_its_ends() {
        let weights = row(Segment::new(Point::new(0.0, 10.0), Point::new(20.0, 10.0)));
        let sum: f64 = weights.iter().map(|(_, weight)| weight).sum();
        assert!((sum - 20.0).abs() < 1e-9, "{sum}");
        // Half of √(λ d) / 2, less what is cut off.
        let middle_m = width_m(&weights, 100, 10.0);
        assert!((0.35..0.41).contains(&middle_m), "{middle_m}");
        assert!(width_m(&weights, 1, 10.0) < 0.12);
    }

    #[test]
    fn every_pixel_with_weight_is_within_the_span_that_is_walked() {
        for (x_m, y_m) in [(20.0, 3.0), (0.0, 20.0), (7.0, 20.0), (20.0, 20.0)] {
            let link = Segment::new(Point::new(0.0, 0.0), Point::new(x_m, y_m));
            let zone = super::FresnelLink::new(link, &GRID, 0.125);
            let all = (0..200 * 200).filter(|pixel| zone.weight(GRID.centre(*pixel)) > 0.0);
            assert_eq!(all.count(), row(link).len(), "{x_m} {y_m}");
        }
    }
}
