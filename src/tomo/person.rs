//! What a person in the way of a link costs it: the mean chord of a disc over the link's width.
//!
//! ```text
//!   t(p) = ∫ chord(h + w) N(w; 0, r²) dw        chord(h) = 2 √(R² − h²)
//!   r²   = (λ / 4) d q (1 − q) + τ² [ (sin φ_a (1 − q))² + (sin φ_b q)² ]
//! ```
//!
//! h = distance of the person from the line, q = its share of the way along the link, d = length, R = radius of a person,
//! λ = wavelength; τ = bin / √12: the ends of a driven link are spread over a bin along the side that was driven, and φ is the
//! angle between link and side. Ends that are fixed have τ = 0. The first Fresnel zone is as wide as √(λ d q (1 − q)).

use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

use crate::geom::{Point, Rect, Vector};

/// The table covers distances from the line up to this, radii, in steps of one over [`PER_RADIUS`].
const FAR: usize = 10;
/// The table covers widths of the link from 2 of its steps to this, radii.
const WIDE: usize = 3;
/// Steps of the table to a radius.
const PER_RADIUS: usize = 30;
/// The narrowest width in the table, steps.
const NARROWEST: usize = 2;
/// Nodes of the quadrature over the disc.
const NODES: u32 = 64;
/// A person this many widths beside the disc costs nothing.
const TAIL_WIDTHS: f64 = 4.0;

/// What is believed of a person and of the radio.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct PersonModel {
    /// R: radius of a person, metres.
    pub radius_m: f64,
    /// λ: wavelength, metres.
    pub wavelength_m: f64,
}

/// A link as persons meet it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct PersonLink {
    from: Point,
    /// From the first end to the second one, of length 1.
    along: Vector,
    length_m: f64,
    /// τ sin φ at the first and at the second end, metres.
    smear_m: (f64, f64),
    /// Who is this far beside the line costs nothing, wherever along it, metres.
    reach_m: f64,
}

impl PersonLink {
    /// Returns whether a person within a distance of a place may cost the link anything.
    pub(super) fn is_within_reach(&self, at: Point, margin_m: f64) -> bool {
        let off = at - self.from;
        let away_m = (off.y_m * self.along.x_m - off.x_m * self.along.y_m).abs();
        away_m <= self.reach_m + margin_m
    }
}

impl PersonModel {
    /// Returns the link between two places as persons meet it. Its ends were driven along the sides of a ring; where in its bin
    /// an end was has this deviation τ, metres, 0 for fixed ends.
    pub(super) fn link(&self, from: Point, to: Point, ring: Rect, smear_m: f64) -> PersonLink {
        let length_m = from.distance_to(to);
        let along = (to - from) * (1.0 / length_m);
        let across_m = |end: Point| {
            let to_edge = |at: f64, low: f64, high: f64| (at - low).abs().min((at - high).abs());
            let is_along_x = to_edge(end.y_m, ring.min.y_m, ring.max.y_m)
                < to_edge(end.x_m, ring.min.x_m, ring.max.x_m);
            smear_m * if is_along_x { along.y_m } else { along.x_m }.abs()
        };
        let smear_m = (across_m(from), across_m(to));
        // The widest zone is in the middle, the widest smear at an end.
        let smear_m2 = (smear_m.0 * smear_m.0).max(smear_m.1 * smear_m.1);
        let widest_m = (self.wavelength_m / 16.0 * length_m + smear_m2).sqrt();
        PersonLink {
            from,
            along,
            length_m,
            smear_m,
            reach_m: self.radius_m + TAIL_WIDTHS * widest_m,
        }
    }

    /// Returns what a person at a place costs a link for each dB/m of attenuation, metres.
    pub(super) fn chord_m(&self, link: &PersonLink, at: Point) -> f64 {
        let off = at - link.from;
        let away_m = (off.y_m * link.along.x_m - off.x_m * link.along.y_m).abs();
        // Most links are out of reach; this says so before anything is divided.
        if away_m > link.reach_m {
            return 0.0;
        }
        let ahead_m = off.dot(link.along);
        if !(ahead_m > 0.0 && ahead_m < link.length_m) {
            return 0.0;
        }
        let share = ahead_m / link.length_m;
        let fresnel_m2 = self.wavelength_m / 4.0 * link.length_m * share * (1.0 - share);
        let (first_m, second_m) = (link.smear_m.0 * (1.0 - share), link.smear_m.1 * share);
        let width_m = (fresnel_m2 + first_m * first_m + second_m * second_m).sqrt();
        if away_m >= self.radius_m + TAIL_WIDTHS * width_m {
            return 0.0;
        }
        self.radius_m * mean_chord(away_m / self.radius_m, width_m / self.radius_m)
    }
}

/// Returns the mean chord of a disc of radius 1 about lines that pass it this far away on the mean, with this deviation.
fn mean_chord(away: f64, width: f64) -> f64 {
    static TABLE: OnceLock<Vec<[f64; FAR * PER_RADIUS + 1]>> = OnceLock::new();
    let table = TABLE.get_or_init(|| {
        let widths = NARROWEST..=WIDE * PER_RADIUS;
        let row = |width: usize| {
            std::array::from_fn(|away| {
                integral(
                    away as f64 / PER_RADIUS as f64,
                    width as f64 / PER_RADIUS as f64,
                )
            })
        };
        widths.map(row).collect()
    });
    let place = |value: f64, most: usize| {
        let value = value.clamp(0.0, most as f64 - 1e-9);
        let whole = value as usize;
        (whole, value - whole as f64)
    };
    let (column, x) = place(away * PER_RADIUS as f64, FAR * PER_RADIUS);
    let (row, y) = place(
        width * PER_RADIUS as f64 - NARROWEST as f64,
        table.len() - 1,
    );
    let between = |row: usize| (1.0 - x) * table[row][column] + x * table[row][column + 1];
    (1.0 - y) * between(row) + y * between(row + 1)
}

/// Returns ∫ 2 √(1 − u²) N(away − u; 0, width²) du by the quadrature of Gauss and Chebyshev of the second kind.
fn integral(away: f64, width: f64) -> f64 {
    let step = std::f64::consts::PI / f64::from(NODES + 1);
    let scale = 2.0 * step / (width * (2.0 * std::f64::consts::PI).sqrt());
    let node = |index: u32| {
        let (sine, cosine) = (
            libm::sin(f64::from(index) * step),
            libm::cos(f64::from(index) * step),
        );
        let off = (away - cosine) / width;
        sine * sine * libm::exp(-0.5 * off * off)
    };
    scale * (1..=NODES).map(node).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODEL: PersonModel = PersonModel {
        radius_m: 0.3,
        wavelength_m: 0.125,
    };
    const SMEAR_M: f64 = 0.144;
    const RING: Rect = Rect {
        min: Point::new(0.0, 0.0),
        max: Point::new(20.0, 20.0),
    };

    fn chord_m(smear_m: f64, at: Point) -> f64 {
        let link = MODEL.link(Point::new(0.0, 10.0), Point::new(20.0, 10.0), RING, smear_m);
        MODEL.chord_m(&link, at)
    }

    #[test]
    fn the_chords_of_all_lines_beside_each_other_make_up_the_disc() {
        let step_m = 0.01;
        for smear_m in [0.0, SMEAR_M] {
            let area_m2: f64 = (-300..=300)
                .map(|k| step_m * chord_m(smear_m, Point::new(7.0, 10.0 + step_m * f64::from(k))))
                .sum();
            let disc_m2 = std::f64::consts::PI * 0.3 * 0.3;
            assert!((area_m2 / disc_m2 - 1.0).abs() < 2e-3, "{area_m2}");
        }
    }

    #[test]
    fn near_an_end_the_chord_is_that_of_the_disc_and_in_the_middle_it_is_blurred() {
        let near_m = chord_m(0.0, Point::new(0.05, 10.0));
        let middle_m = chord_m(0.0, Point::new(10.0, 10.0));
        assert!((near_m - 0.6).abs() < 0.01, "{near_m}");
        assert!((0.2..0.4).contains(&middle_m), "{middle_m}");
        assert!(chord_m(SMEAR_M, Point::new(0.5, 10.0)) < chord_m(0.0, Point::new(0.5, 10.0)));
    }

    #[test]
    fn who_stands_far_beside_or_beyond_an_end_costs_nothing() {
        for at in [(10.0, 14.0), (-0.2, 10.0), (20.1, 10.0)] {
            assert_eq!(chord_m(0.0, Point::new(at.0, at.1)), 0.0);
        }
    }

    #[test]
    fn exchanged_ends_change_nothing() {
        let ends = (Point::new(0.0, 3.0), Point::new(12.0, 20.0));
        let at = Point::new(5.0, 10.3);
        let (one, other) = (
            MODEL.link(ends.0, ends.1, RING, SMEAR_M),
            MODEL.link(ends.1, ends.0, RING, SMEAR_M),
        );
        assert!((MODEL.chord_m(&one, at) - MODEL.chord_m(&other, at)).abs() < 1e-12);
    }
}
