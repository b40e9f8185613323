//! What it costs a link that its ends were elsewhere than they are said to be.
//!
//! A vehicle knows its place to some centimetres, other ones in each sweep, and a link is the mean over the bins in which its
//! ends were driven. Where nothing stands that is nothing; beside a wall the loss of a link changes by many dB with a metre.
//! What a displacement across the link costs is told by how steep the level of the empty sweep is there, and how far ends are
//! displaced by the links themselves: σ is where they are most probable (Student noise, ν = 4; errors in variables, Fuller
//! 1987).
//!
//! ```text
//!   v_l ← v_l + σ² (g_a² + g_b²)         g = change of the level of the empty sweep by metre of an end, across the link
//!   σ = arg min Σ_l ½ ln(κ v_l) + (ν + 1)/2 ln(1 + y_l² / (ν κ v_l))       κ by v
//! ```
//!
//! Nothing is known of how displacements of neighbouring links go together; that is left to
//! [`super::finds`], which measures how much noise does.

use super::student::{DEGREES, most_probable_scale};
use super::{Link, Observation};

/// Ends are moved by this to either side to tell how steep the level is, bins.
const MOVED_BINS: f64 = 0.4;
/// Displacements that are compared, bins: none, and up to the last one; first every so many, then those around the best.
const STEP_BINS: f64 = 0.02;
const STEPS: u32 = 40;
const COARSE: u32 = 4;

/// Returns g_a² + g_b² of each link, dB²/m²; bins are of this size, metres. `level_dbm` tells what links had in the empty sweep
/// but for their distance; `None` of those where nothing is known.
pub(super) fn slopes(
    links: &[Link],
    bin_m: f64,
    level_dbm: impl Fn(&[Link]) -> Vec<Option<f64>>,
) -> Vec<f64> {
    let half_step_m = MOVED_BINS * bin_m;
    let mut slopes = vec![0.0; links.len()];
    for end in [End::From, End::To] {
        let [back, forth] =
            [-half_step_m, half_step_m].map(|by_m| level_dbm(&moved(links, end, by_m)));
        for ((sum, back), forth) in slopes.iter_mut().zip(back).zip(forth) {
            let step_db = back.zip(forth).map_or(0.0, |(back, forth)| forth - back);
            let slope = step_db / (2.0 * half_step_m);
            *sum += slope * slope;
        }
    }
    slopes
}

/// Adds to the variances of observations what it costs that the ends of their links, which were pooled in bins of this size, are
/// displaced, metres; by the [`slopes`] of each.
pub(super) fn add_displacement(observations: &mut [Observation], slopes: &[f64], bin_m: f64) {
    let sd_m = displacement_m(observations, slopes, bin_m);
    for (one, slope) in observations.iter_mut().zip(slopes) {
        one.variance_db2 += sd_m * sd_m * slope;
    }
}

#[derive(Clone, Copy)]
enum End {
    From,
    To,
}

/// Moves an end of each link across it, metres.
fn moved(links: &[Link], end: End, by_m: f64) -> Vec<Link> {
    let one = |link: &Link| {
        let along = link.to - link.from;
        let across = along.left() * (by_m / link.length_m().max(f64::MIN_POSITIVE));
        match end {
            End::From => Link {
                from: link.from + across,
                ..*link
            },
            End::To => Link {
                to: link.to + across,
                ..*link
            },
        }
    };
    links.iter().map(one).collect()
}

/// Returns σ, by the sums of squares of the slopes of each link, dB²/m².
fn displacement_m(observations: &[Observation], slopes: &[f64], bin_m: f64) -> f64 {
    let sd_m = |step: u32| bin_m * STEP_BINS * f64::from(step);
    let loss = |step: u32| loss(observations, slopes, sd_m(step));
    let near = best_of((0..=STEPS).step_by(COARSE as usize), loss);
    let around = near.saturating_sub(COARSE - 1)..=(near + COARSE - 1).min(STEPS);
    sd_m(best_of(around, loss))
}

/// Returns minus the logarithm of how probable the links are when ends are displaced by so much.
fn loss(observations: &[Observation], slopes: &[f64], sd_m: f64) -> f64 {
    let variances = observations.iter().zip(slopes);
    let variances: Vec<f64> = variances
        .map(|(one, slope)| one.variance_db2 + sd_m * sd_m * slope)
        .collect();
    let lost = observations.iter().zip(&variances);
    let squares: Vec<f64> = lost
        .map(|(one, variance_db2)| one.attenuation_db * one.attenuation_db / variance_db2)
        .collect();
    let kappa = most_probable_scale(&squares);
    let terms = squares
        .iter()
        .zip(&variances)
        .map(|(square, variance_db2)| {
            0.5 * libm::log(kappa * variance_db2)
                + 0.5 * (DEGREES + 1.0) * libm::log(1.0 + square / kappa / DEGREES)
        });
    terms.sum::<f64>()
}

/// Returns the step with the least loss, the first of several.
fn best_of(steps: impl Iterator<Item = u32>, loss: impl Fn(u32) -> f64) -> u32 {
    let judged = steps.map(|step| (loss(step), step));
    let best = judged.reduce(|best, next| if next.0 < best.0 { next } else { best });
    best.map_or(0, |(_, step)| step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Point;
    use crate::tomo::tests_support::Noise;

    /// Links from the west to the east whose level falls by `steep_db_per_m` with each metre to the north, of either end, where
    /// they begin north of the middle.
    fn level_dbm(links: &[Link], steep_db_per_m: f64) -> Vec<Option<f64>> {
        let steep = |at: Point| -steep_db_per_m * at.y_m;
        let of = |link: &Link| match link.from.y_m.min(link.to.y_m) > 9.0 {
            true => Some(steep(link.from) + steep(link.to)),
            false => Some(0.0),
        };
        links.iter().map(of).collect()
    }

    fn links() -> Vec<Link> {
        let at = |step: u32, share: f64| 20.0 * (f64::from(step) * share).fract();
        let ends = |k: u32| {
            (
                Point::new(0.0, at(k, 0.618_034)),
                Point::new(20.0, at(k, 0.414_214)),
            )
        };
        (0..800)
            .map(|k| Link::fixed(ends(k).0, ends(k).1, 10, -60.0))
            .collect()
    }

    /// What is measured when each end was displaced by so much on the mean.
    fn measured(links: &[Link], displacement_m: f64) -> Vec<Observation> {
        let mut noise = Noise::new(5);
        let mut of = |link: &Link, is_steep: bool| {
            let steep_db_per_m = if is_steep { 12.0 } else { 0.0 };
            let off_m = displacement_m * (noise.normal() + noise.normal());
            Observation {
                from: link.from,
                to: link.to,
                attenuation_db: noise.normal() + steep_db_per_m * off_m,
                variance_db2: 1.0,
                packets: 10,
                misses: 0,
                is_at_floor: false,
            }
        };
        let levels = level_dbm(links, 1.0);
        let all = links.iter().zip(levels);
        all.map(|(link, level)| of(link, level != Some(0.0)))
            .collect()
    }

    #[test]
    fn how_far_ends_are_displaced_is_told_by_the_links() {
        let links = links();
        for displacement_m in [0.0, 0.1, 0.25] {
            let mut observations = measured(&links, displacement_m);
            let slopes = slopes(&links, 0.5, |links| level_dbm(links, 12.0));
            add_displacement(&mut observations, &slopes, 0.5);
            let steep = observations
                .iter()
                .filter(|one| one.from.y_m.min(one.to.y_m) > 9.5);
            for one in steep {
                // Two ends of 12 dB/m; a Student of 4 degrees is narrower than a normal noise of its variance.
                let found_m = ((one.variance_db2 - 1.0) / 288.0).sqrt();
                assert!(
                    (found_m - displacement_m).abs() < 0.03 + 0.2 * displacement_m,
                    "{found_m} of {displacement_m}"
                );
            }
            let level = observations
                .iter()
                .filter(|one| one.from.y_m.min(one.to.y_m) < 8.0);
            assert!(level.clone().count() > 100);
            assert!(level.clone().all(|one| one.variance_db2 == 1.0));
        }
    }

    #[test]
    fn the_most_probable_displacement_of_all_is_found() {
        let links = links();
        for displacement_m in [0.0, 0.03, 0.07, 0.13, 0.2, 0.31, 0.39] {
            let observations = measured(&links, displacement_m);
            for part in [
                &observations[..],
                &observations[..60],
                &observations[300..340],
            ] {
                let slopes = slopes(&links[..part.len()], 0.5, |links| level_dbm(links, 12.0));
                let all = best_of(0..=STEPS, |step| {
                    loss(part, &slopes, 0.01 * f64::from(step))
                });
                let found_m = super::displacement_m(part, &slopes, 0.5);
                assert!(
                    (found_m - 0.01 * f64::from(all)).abs() < 1e-9,
                    "{found_m}: {all}"
                );
            }
        }
    }

    #[test]
    fn exchanged_ends_change_nothing_and_where_nothing_is_known_nothing_is_added() {
        let links = links();
        let turned: Vec<Link> = links
            .iter()
            .map(|link| Link {
                from: link.to,
                to: link.from,
                ..*link
            })
            .collect();
        let of = |links: &[Link]| {
            let mut observations = measured(links, 0.2);
            let slopes = slopes(links, 0.5, |links| level_dbm(links, 12.0));
            add_displacement(&mut observations, &slopes, 0.5);
            observations
        };
        for (one, other) in of(&links).iter().zip(of(&turned)) {
            assert!((one.variance_db2 - other.variance_db2).abs() < 1e-6 * one.variance_db2);
        }
        let mut observations = measured(&links, 0.2);
        let none = |links: &[Link]| vec![None; links.len()];
        add_displacement(&mut observations, &slopes(&links, 0.5, none), 0.5);
        assert!(observations.iter().all(|one| one.variance_db2 == 1.0));
        add_displacement(&mut [], &slopes(&[], 0.5, none), 0.5);
    }
}
