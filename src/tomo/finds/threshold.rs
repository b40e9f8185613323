//! How strong evidence must be so that places where nobody stands pass seldom enough.
//!
//! What the links say of one person, place by place, is a smooth random field of unit variance when nobody is there. The
//! expected number of its maxima above a high level u is (Adler 1981, theorem 5.4.1; Worsley 1994)
//!
//! ```text
//!   N(u) = I · u e^(−u²/2) / (2π)^(3/2)      I = ∫ √det Λ dA      Λ = Jᵀ J,  J = ∂/∂(x, y) of t(p) / √(κ v), of length 1
//! ```
//!
//! and a gain g of the logarithm of the likelihood is u²/2.

use super::evidence::Evidence;
use crate::geom::{Point, Rect};
use crate::tomo::cholesky::dot;

/// Places along a side at which Λ is taken.
const PLACES: usize = 8;
/// Half the step of the derivatives, radii of a person.
const HALF_STEP: f64 = 0.1;
/// Under this I the links do not tell any place from another.
const LEAST_RESELS: f64 = 1e-3;
/// A part of the area that is smaller than what the links resolve is one place, of which the formula does not know.
const ONE_PLACE: f64 = 1.0;
/// Levels lie within these.
const LEVELS: (f64, f64) = (1.5, 40.0);

/// How often places where nobody stands are as strong as something.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct FalseRate {
    /// I.
    resels: f64,
}

impl FalseRate {
    /// Takes the links and the area in which places are looked for; `None` when the links do not tell its places apart.
    pub(super) fn new(evidence: &Evidence<'_>, area: Rect) -> Option<FalseRate> {
        let share = |index: usize| index as f64 / (PLACES - 1) as f64;
        let at = |index: usize| {
            Point::new(
                area.min.x_m + area.width_m() * share(index % PLACES),
                area.min.y_m + area.height_m() * share(index / PLACES),
            )
        };
        let sum: f64 = (0..PLACES * PLACES)
            .map(|index| density(evidence, at(index)))
            .sum();
        let mean = sum / (PLACES * PLACES) as f64;
        let resels = mean * area.width_m() * area.height_m();
        (resels >= LEAST_RESELS).then_some(FalseRate {
            resels: resels.max(ONE_PLACE),
        })
    }

    /// Returns how many places where nobody stands are expected to gain this much, or more, in one image.
    pub(super) fn expected(&self, gain: f64) -> f64 {
        let level = (2.0 * gain.max(0.0)).sqrt();
        self.at_level(level.max(LEVELS.0))
    }

    /// Returns the gain above which so many are expected in one image.
    pub(super) fn gain_for(&self, rate: f64) -> f64 {
        let (mut low, mut high) = LEVELS;
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            match self.at_level(middle) > rate {
                true => low = middle,
                false => high = middle,
            }
        }
        0.5 * high * high
    }

    fn at_level(&self, level: f64) -> f64 {
        let turn = 2.0 * std::f64::consts::PI;
        self.resels * level * libm::exp(-0.5 * level * level) / (turn * turn.sqrt())
    }
}

/// Returns √det Λ at a place, 1/m².
fn density(evidence: &Evidence<'_>, at: Point) -> f64 {
    let unit = |x_m: f64, y_m: f64| -> Vec<f64> {
        let chords_m = evidence.chords_m(Point::new(at.x_m + x_m, at.y_m + y_m));
        let scaled: Vec<f64> = chords_m
            .iter()
            .zip(&evidence.sd_db)
            .map(|(chord_m, sd_db)| chord_m / sd_db)
            .collect();
        let length = scaled.iter().map(|value| value * value).sum::<f64>().sqrt() + 1e-12;
        scaled.into_iter().map(|value| value / length).collect()
    };
    let half_m = HALF_STEP * evidence.settings.person.radius_m;
    let slope = |x_m: f64, y_m: f64| -> Vec<f64> {
        let (more, less) = (unit(x_m, y_m), unit(-x_m, -y_m));
        let steps = more.iter().zip(&less);
        steps
            .map(|(more, less)| (more - less) / (2.0 * half_m))
            .collect()
    };
    let (x, y) = (slope(half_m, 0.0), slope(0.0, half_m));
    let across = dot(&x, &y);
    (dot(&x, &x) * dot(&y, &y) - across * across)
        .max(0.0)
        .sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threshold_is_where_the_expected_number_is_the_rate() {
        let rate = FalseRate { resels: 645.0 };
        for (wanted, gain) in [(0.02, 9.1), (0.1, 7.36), (0.002, 11.49)] {
            let got = rate.gain_for(wanted);
            assert!((got - gain).abs() < 0.1, "{wanted}: {got}");
            assert!((rate.expected(got) / wanted - 1.0).abs() < 1e-6);
        }
        assert!(rate.expected(0.0) > 1.0 && rate.expected(20.0) < 1e-6);
        // A single place of which the links say something by chance: 1.9 deviations are seldom.
        let gain = FalseRate { resels: ONE_PLACE }.gain_for(0.02);
        assert!((1.6..2.0).contains(&gain), "{gain}");
    }
}
