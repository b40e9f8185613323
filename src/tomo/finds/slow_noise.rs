//! Noise that changes slowly along a lap, and how it is taken out.
//!
//! Fading has beats of metres, so that the links of a lap deviate alike for a while. Standardized residuals along a lap are taken
//! for a slow part and a fresh one (Ornstein and Uhlenbeck 1930; an autoregression of first order when places are evenly apart):
//!
//! ```text
//!   z_i = s_i + w_i      cov(s_i, s_j) = γ e^(−Δ/ℓ)      var w_i = 1 − γ      Δ = how far from each other along the lap, bins
//! ```
//!
//! γ and ℓ come from the residuals' own correlation by distance. Of this covariance C the Cholesky factor L is known by a Kalman
//! filter along the lap, and L⁻¹ makes noise independent in one pass: e_i = z_i − m_i, z̃_i = e_i / √F_i, m ← φ (m + K e).

use super::laps::Laps;

/// Correlations are taken at distances up to this, a bin each.
const DISTANCES: usize = 12;
/// Residuals count up to this, deviations.
const CLIP: f64 = 3.0;
/// A distance with fewer pairs says nothing.
const FEWEST_PAIRS: f64 = 50.0;
/// Lengths that are tried, bins.
const LENGTHS: [f64; 8] = [2.0, 3.0, 4.5, 6.0, 8.0, 11.0, 16.0, 24.0];
/// γ is at most this.
const MOST: f64 = 0.8;
/// What follows from something this much weaker is left out.
const QUIET: f64 = 1e-3;

/// One step of the filter.
#[derive(Clone, Copy)]
struct Step {
    /// K: how much of what is new is taken for slow.
    gain: f64,
    /// 1 / √F.
    scale: f64,
    /// φ towards the next link; 0 at the end of a lap.
    keep: f64,
}

/// The filter of a sweep, link by link, in the order of its laps.
pub(super) struct SlowNoise(Vec<Step>);

impl SlowNoise {
    /// Returns that of noise without a slow part.
    pub(super) fn none(links: usize) -> SlowNoise {
        let step = Step {
            gain: 0.0,
            scale: 1.0,
            keep: 0.0,
        };
        SlowNoise(vec![step; links])
    }

    /// Learns it from standardized residuals, in the order of laps.
    pub(super) fn learned(laps: &Laps, residuals: &[f64]) -> SlowNoise {
        let (share, length) = fitted(&correlations(laps, residuals));
        SlowNoise::of(laps, share, length)
    }

    /// Returns that of a slow part γ that is forgotten over a length ℓ, bins.
    fn of(laps: &Laps, share: f64, length: f64) -> SlowNoise {
        let mut steps = Vec::with_capacity(laps.steps().len());
        // P: variance of the slow part before a link is seen.
        let mut variance = share;
        for to_next in laps.steps() {
            let of_new = variance + 1.0 - share;
            let gain = variance / of_new;
            let keep = to_next.map_or(0.0, |apart| libm::exp(-apart / length));
            steps.push(Step {
                gain,
                scale: 1.0 / of_new.sqrt(),
                keep,
            });
            variance = keep * keep * (1.0 - gain) * variance + (1.0 - keep * keep) * share;
        }
        SlowNoise(steps)
    }

    /// Applies L⁻¹ to values that some links have, `None` being 0; returns those of the links that come to have one, by link.
    pub(super) fn whitened<const N: usize>(
        &self,
        of_link: impl Fn(usize) -> Option<[f64; N]>,
    ) -> Vec<(usize, [f64; N])> {
        let mut whitened = Vec::new();
        let (mut slow, mut loudest, mut is_quiet) = ([0.0; N], [0.0f64; N], true);
        for (link, step) in self.0.iter().enumerate() {
            let value = of_link(link);
            if is_quiet && value.is_none() {
                continue;
            }
            let value = value.unwrap_or([0.0; N]);
            let mut fresh = [0.0; N];
            is_quiet = true;
            for n in 0..N {
                fresh[n] = value[n] - slow[n];
                loudest[n] = loudest[n].max(value[n].abs());
                slow[n] = step.keep * (slow[n] + step.gain * fresh[n]);
                is_quiet &= slow[n].abs() <= QUIET * loudest[n];
            }
            if is_quiet {
                slow = [0.0; N];
            }
            whitened.push((link, fresh.map(|fresh| fresh * step.scale)));
        }
        whitened
    }
}

/// Returns the mean products of residuals by how far apart along a lap their links are, with the pairs of each.
fn correlations(laps: &Laps, residuals: &[f64]) -> [(f64, f64); DISTANCES] {
    let clipped: Vec<f64> = residuals.iter().map(|z| z.clamp(-CLIP, CLIP)).collect();
    let squares: f64 = clipped.iter().map(|z| z * z).sum();
    let mean_square = (squares / clipped.len().max(1) as f64).max(1e-12);
    let mut sums = [(0.0f64, 0.0f64); DISTANCES];
    for first in 0..clipped.len() {
        let mut apart = 0.0;
        for next in first + 1..clipped.len() {
            let Some(step) = laps.steps()[next - 1] else {
                break;
            };
            apart += step;
            let distance = libm::round(apart) as usize;
            if distance > DISTANCES {
                break;
            }
            if distance > 0 {
                let (sum, count) = &mut sums[distance - 1];
                *sum += clipped[first] * clipped[next] / mean_square;
                *count += 1.0;
            }
        }
    }
    sums.map(|(sum, count)| (sum / count.max(1.0), count))
}

/// Returns γ and ℓ, bins, by least squares over the pairs.
fn fitted(correlations: &[(f64, f64); DISTANCES]) -> (f64, f64) {
    let fit = |length: f64| {
        let (mut across, mut square, mut of_data) = (0.0, 0.0, 0.0);
        for (index, (rho, pairs)) in correlations.iter().enumerate() {
            if *pairs < FEWEST_PAIRS {
                continue;
            }
            let shape = libm::exp(-((index + 1) as f64) / length);
            across += pairs * shape * rho;
            square += pairs * shape * shape;
            of_data += pairs * rho * rho;
        }
        let share = (across / f64::max(square, 1e-12)).clamp(0.0, MOST);
        let rest = of_data - 2.0 * share * across + share * share * square;
        (rest, share, length)
    };
    let best = LENGTHS
        .map(fit)
        .into_iter()
        .reduce(|best, next| if next.0 < best.0 { next } else { best });
    best.map_or((0.0, 1.0), |(_, share, length)| (share, length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Point, Rect};
    use crate::tomo::Observation;
    use crate::tomo::finds::Driven;
    use crate::tomo::tests_support::Noise;

    const LAPS: usize = 20;
    const OF_A_LAP: usize = 80;

    /// Laps around a ring of 80 m, in bins of 0.5 m, each 1.5 m farther apart than the one before; a link every second bin.
    fn laps() -> Laps {
        let at = |along_m: f64| match along_m % 80.0 {
            x_m if x_m < 20.0 => Point::new(x_m, 0.0),
            m if m < 40.0 => Point::new(20.0, m - 20.0),
            m if m < 60.0 => Point::new(60.0 - m, 20.0),
            m => Point::new(0.0, 80.0 - m),
        };
        let link = |(lap, step): (usize, usize)| Observation {
            from: at(step as f64),
            to: at(step as f64 + 5.0 + 1.5 * lap as f64),
            attenuation_db: 0.0,
            variance_db2: 1.0,
            is_at_floor: false,
        };
        let all = (0..LAPS).flat_map(|lap| (0..OF_A_LAP).map(move |step| (lap, step)));
        let driven = Driven {
            ring: Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 20.0)),
            bin_m: 0.5,
        };
        let laps = Laps::of(&all.map(link).collect::<Vec<_>>(), driven).unwrap();
        let ends = laps.steps().iter().filter(|step| step.is_none());
        assert_eq!(ends.count(), LAPS);
        laps
    }

    /// Noise with a slow part γ that is forgotten over a length, bins.
    fn noise(laps: &Laps, share: f64, length: f64, seed: u64) -> Vec<f64> {
        let mut drawn = Noise::new(seed);
        let mut slow = share.sqrt() * drawn.normal();
        let mut value = |step: &Option<f64>| {
            let z = slow + (1.0 - share).sqrt() * drawn.normal();
            let keep = step.map_or(0.0, |step| libm::exp(-step / length));
            slow = keep * slow + (share * (1.0 - keep * keep)).sqrt() * drawn.normal();
            z
        };
        laps.steps().iter().map(&mut value).collect()
    }

    fn correlation_of_neighbours(laps: &Laps, values: &[f64]) -> f64 {
        let pairs = values.windows(2).zip(laps.steps());
        let of_laps = pairs.filter(|(_, step)| step.is_some());
        let product: f64 = of_laps.map(|(pair, _)| pair[0] * pair[1]).sum();
        product / values.iter().map(|z| z * z).sum::<f64>()
    }

    #[test]
    fn how_slow_noise_is_is_learned_and_taken_out() {
        let laps = laps();
        let values = noise(&laps, 0.5, 6.0, 5);
        let (share, length) = fitted(&correlations(&laps, &values));
        assert!((0.35..0.65).contains(&share), "{share}");
        assert!((3.0..=11.0).contains(&length), "{length}");
        assert!(correlation_of_neighbours(&laps, &values) > 0.25);
        let learned = SlowNoise::learned(&laps, &values);
        let white: Vec<f64> = learned
            .whitened(|link| Some([values[link]]))
            .into_iter()
            .map(|(_, [value])| value)
            .collect();
        assert_eq!(white.len(), values.len());
        assert!(correlation_of_neighbours(&laps, &white).abs() < 0.06);
        let square = white.iter().map(|z| z * z).sum::<f64>() / white.len() as f64;
        assert!((0.85..1.15).contains(&square), "{square}");
    }

    #[test]
    fn noise_that_is_independent_stays_what_it_is() {
        let laps = laps();
        let values = noise(&laps, 0.0, 1.0, 6);
        let (share, _) = fitted(&correlations(&laps, &values));
        assert!(share < 0.1, "{share}");
        let none = SlowNoise::none(values.len());
        let white = none.whitened(|link| Some([values[link]]));
        assert!(white.iter().all(|(link, [value])| *value == values[*link]));
    }

    #[test]
    fn the_filter_is_the_inverse_factor_of_the_covariance() {
        // C = L Lᵀ: columns of L⁻¹ from unit vectors, and L⁻¹ C L⁻ᵀ = 1 for the first links of a lap.
        const SIZE: usize = 12;
        let laps = laps();
        let (share, length) = (0.4, 5.0);
        let slow = SlowNoise::of(&laps, share, length);
        let mut columns = [[0.0; SIZE]; SIZE];
        for (unit, column) in columns.iter_mut().enumerate() {
            for (link, [value]) in slow.whitened(|link| (link == unit).then_some([1.0])) {
                if link < SIZE {
                    column[link] = value;
                }
            }
        }
        let covariance = |i: usize, j: usize| {
            let apart: f64 = laps.steps()[i.min(j)..i.max(j)].iter().flatten().sum();
            let own = if i == j { 1.0 - share } else { 0.0 };
            own + share * libm::exp(-apart / length)
        };
        for i in 0..SIZE {
            for j in 0..SIZE {
                let mut sum = 0.0;
                for (a, of_a) in columns.iter().enumerate() {
                    for (b, of_b) in columns.iter().enumerate() {
                        sum += of_a[i] * covariance(a, b) * of_b[j];
                    }
                }
                let wanted = if i == j { 1.0 } else { 0.0 };
                assert!((sum - wanted).abs() < 2e-3, "{i} {j}: {sum}");
            }
        }
    }

    #[test]
    fn values_of_a_few_links_are_followed_until_nothing_is_left_of_them() {
        let laps = laps();
        let slow = SlowNoise::of(&laps, 0.5, 3.0);
        let white = slow.whitened(|link| (link == 100).then_some([1.0, -2.0]));
        let links: Vec<usize> = white.iter().map(|(link, _)| *link).collect();
        assert_eq!(links.first(), Some(&100));
        assert!(links.len() > 2 && links.len() < 40, "{}", links.len());
        assert!(links.windows(2).all(|pair| pair[1] == pair[0] + 1));
        assert!(slow.whitened(|_| None::<[f64; 1]>).is_empty());
    }
}
