//! How far off the place of a person may be, by the likelihood around it. Of whoever is barely seen it falls off less than its
//! curvature at the top says: an ellipse by that alone holds too few of the weak.
//!
//! ```text
//!   covariance = Σ_q w_q (q − p)(q − p)ᵀ / Σ_q w_q          w_q = exp(−(loss(q) − loss(p)) / c)
//!   c = max(1, √(det V / det V₁))
//! ```
//!
//! p = place of the person; q = places of a lattice p + V^½ t around it, each with the strength that explains most there, while
//! all other persons stay as they are. V = covariance by the curvature, V₁ = the same if the noise of each link were its own:
//! noise that goes together makes the likelihood too sharp by c.

use super::evidence::{Evidence, STRENGTHS, Target, sum_of_logarithms};
use crate::geom::Point;
use crate::tomo::student::{self, DEGREES};

/// The lattice reaches so many deviations by the curvature to either side, along both of its axes, in so many steps.
const REACH: f64 = 5.0;
const STEPS: i32 = 10;
/// Rounds in which a strength is improved.
const ROUNDS: usize = 4;

/// A variance by x, covariance, and variance by y, m².
pub(super) type Covariance = [f64; 3];

/// A link near a person: how much is left of it without this person, and its deviation, dB.
struct NearLink {
    link: usize,
    rest_db: f64,
    sd_db: f64,
}

/// Returns the covariance of the place of one of some targets, given the covariances by the curvature of the loss: with noise
/// that goes together as it does, and with noise of each link on its own. `None` when these are no covariances.
pub(super) fn covariance(
    evidence: &Evidence<'_>,
    targets: &[Target],
    index: usize,
    curvature: Covariance,
    independent: Covariance,
) -> Option<Covariance> {
    let [xx, _, yy] = curvature;
    let sharpness = (determinant(curvature) / determinant(independent)).sqrt();
    let is_sound = |value: f64| value.is_finite() && value > 0.0;
    if ![xx, yy, determinant(curvature), sharpness]
        .into_iter()
        .all(is_sound)
    {
        return None;
    }
    let sharpness = sharpness.max(1.0);
    let target = targets[index];
    let [axis_xx_m, axis_xy_m, axis_yy_m] = root(curvature);
    // At the corners of the lattice at most.
    let reach_m = REACH * 2.0 * (xx + yy).sqrt();
    let near = links_near(evidence, targets, index, reach_m);
    let least = least_loss(evidence, &near, target);
    let mut sums = [0.0; 4];
    for column in -STEPS..=STEPS {
        for row in -STEPS..=STEPS {
            let [s, t] = [column, row].map(|step| REACH * f64::from(step) / f64::from(STEPS));
            let (x_m, y_m) = (axis_xx_m * s + axis_xy_m * t, axis_xy_m * s + axis_yy_m * t);
            let at = Point::new(target.at.x_m + x_m, target.at.y_m + y_m);
            if !evidence.area.contains(at) {
                continue;
            }
            let loss = least_loss(evidence, &near, Target { at, ..target });
            let weight = libm::exp((least - loss) / sharpness);
            let moments = [1.0, x_m * x_m, x_m * y_m, y_m * y_m];
            for (sum, moment) in sums.iter_mut().zip(moments) {
                *sum += weight * moment;
            }
        }
    }
    let [sum, xx, xy, yy] = sums;
    Some([xx, xy, yy].map(|moment| moment / sum))
}

fn determinant([xx, xy, yy]: Covariance) -> f64 {
    xx * yy - xy * xy
}

/// Returns the symmetric root of a covariance: (V + √det V) / √(tr V + 2 √det V).
fn root([xx, xy, yy]: Covariance) -> [f64; 3] {
    let side = determinant([xx, xy, yy]).sqrt();
    let scale = (xx + yy + 2.0 * side).sqrt();
    [xx + side, xy, yy + side].map(|entry| entry / scale)
}

/// Returns the links that a person within a distance of a target touches, without that target.
fn links_near(
    evidence: &Evidence<'_>,
    targets: &[Target],
    index: usize,
    reach_m: f64,
) -> Vec<NearLink> {
    let at = targets[index].at;
    let others = || targets.iter().enumerate().filter(|(k, _)| *k != index);
    let links = evidence.links.iter().enumerate();
    links
        .filter(|(_, link)| link.is_within_reach(at, reach_m))
        .map(|(link, path)| {
            let chord_m = |at: Point| evidence.settings.person.chord_m(path, at);
            let explained = others().map(|(_, other)| other.strength * chord_m(other.at));
            NearLink {
                link,
                rest_db: evidence.attenuation_db[link] - explained.sum::<f64>(),
                sd_db: evidence.sd_db[link],
            }
        })
        .collect()
}

/// Returns the loss of these links by a person at a place, at the strength that makes it least, sought from the given one.
fn least_loss(evidence: &Evidence<'_>, near: &[NearLink], Target { at, strength }: Target) -> f64 {
    let settings = evidence.settings;
    let chord_m = |one: &NearLink| settings.person.chord_m(&evidence.links[one.link], at);
    let chords_m: Vec<f64> = near.iter().map(chord_m).collect();
    let left = |one: &NearLink, chord_m: f64, strength: f64| {
        evidence.left_db(one.link, one.rest_db - strength * chord_m) / one.sd_db
    };
    let (least, most) = STRENGTHS;
    let expected = settings.strength_db_per_m;
    let mut best = strength;
    for _ in 0..ROUNDS {
        let off = libm::log(best / expected);
        let of_prior = evidence.prior_curvature(best);
        let (mut gradient, mut curvature) = (-off * of_prior * best, of_prior);
        for (one, chord_m) in near.iter().zip(&chords_m) {
            let z = left(one, *chord_m, best);
            // What is at the floor and explained says nothing.
            if *chord_m > 0.0 && z != 0.0 {
                let slope = chord_m / one.sd_db;
                let trust = student::trust(z * z, DEGREES);
                gradient += trust * slope * z;
                curvature += trust * slope * slope;
            }
        }
        best = (best + gradient / curvature).clamp(least * expected, most * expected);
    }
    let ratios = near.iter().zip(&chords_m).map(|(one, chord_m)| {
        let z = left(one, *chord_m, best);
        1.0 + z * z / DEGREES
    });
    (DEGREES + 1.0) / 2.0 * sum_of_logarithms(ratios) + evidence.penalty(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_root_of_a_covariance_times_itself_is_the_covariance() {
        for covariance in [[4.0, 0.0, 9.0], [0.02, -0.013, 0.01], [1.0, 0.999, 1.0]] {
            let [a, b, c] = root(covariance);
            let squared = [a * a + b * b, b * (a + c), b * b + c * c];
            for (found, expected) in squared.into_iter().zip(covariance) {
                assert!((found - expected).abs() < 1e-12, "{squared:?}");
            }
        }
    }
}
