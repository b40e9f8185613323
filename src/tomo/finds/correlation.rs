//! How much the noise of links that were driven one after the other goes together, measured on the sweep itself.
//!
//! Fading has slow beats, and a whole lap may be too strong or too weak: neighbouring links deviate alike, and a sum over
//! the many links that cross one place is less sure than that of their variances. Where ends lie is told by two coordinates
//! along the ring; the correlation ρ(Δa, Δb) of standardized residuals is taken by lag, for pairs of links whose ends both
//! moved on in the same sense. Of a place that persons may stand at follows by how much its evidence is to be divided:
//!
//! ```text
//!   c = max(1, 1 + uᵀ R u / uᵀ u)          u = t(p) / √(κ v),  R = ρ of all pairs, zero diagonal
//! ```

use super::Driven;
use crate::geom::{Point, Rect};
use crate::tomo::Observation;

/// Lags to either side, a bin each.
const LAGS: i32 = 8;
/// The ends of a pair moved on alike within this, bins.
const ALIKE_BINS: f64 = 4.6;
/// Residuals count up to this, deviations.
const CLIP: f64 = 3.0;
/// A lag with fewer pairs says nothing; one with so many counts half.
const FEWEST_PAIRS: u32 = 50;
const HALF_PAIRS: f64 = 50.0;
/// A correlation lies within these.
const RHO: (f64, f64) = (-0.05, 0.9);
/// A link with an end farther from the ring than this, bins, was not driven along it.
const OFF_RING_BINS: f64 = 3.0;

/// A pair of links, and which lag it has.
#[derive(Clone, Copy)]
struct Pair {
    one: u32,
    other: u32,
    lag: u32,
}

/// Which links lie how far from each other along the ring, and how their noise goes together.
pub(super) struct Correlation {
    /// Whether each link was driven along the ring; the noise of others is taken for independent.
    are_on_ring: Vec<bool>,
    pairs: Vec<Pair>,
    /// By lag.
    rho: Vec<f64>,
}

impl Correlation {
    /// Makes the pairs of a sweep that was driven along a ring, without the links that were not: a vehicle that went around
    /// something. Of a sweep of which most links were not nothing is known, and there are none.
    pub(super) fn new(observations: &[Observation], driven: Option<Driven>) -> Correlation {
        let is_near = |at: Point| {
            driven.is_some_and(|driven| off_ring_m(at, driven.ring) <= OFF_RING_BINS * driven.bin_m)
        };
        let are_on_ring: Vec<bool> = observations
            .iter()
            .map(|one| is_near(one.from) && is_near(one.to))
            .collect();
        let on_ring = are_on_ring.iter().filter(|is_on_ring| **is_on_ring).count();
        let pairs = driven
            .filter(|_| 2 * on_ring > observations.len())
            .map(|driven| pairs_of(observations, &are_on_ring, driven))
            .unwrap_or_default();
        Correlation {
            are_on_ring,
            pairs,
            rho: vec![0.0; (side() * side()) as usize],
        }
    }

    /// Learns the correlation from standardized residuals, one for each link.
    pub(super) fn learn(&mut self, residuals: &[f64]) {
        let clipped: Vec<f64> = residuals.iter().map(|z| z.clamp(-CLIP, CLIP)).collect();
        let on_ring = || {
            let marked = clipped.iter().zip(&self.are_on_ring);
            marked.filter(|(_, is_on_ring)| **is_on_ring)
        };
        let squares: f64 = on_ring().map(|(z, _)| z * z).sum();
        let mean_square = squares / on_ring().count().max(1) as f64;
        let mut sums = vec![(0.0, 0u32); self.rho.len()];
        for pair in &self.pairs {
            let (sum, count) = &mut sums[pair.lag as usize];
            *sum += clipped[pair.one as usize] * clipped[pair.other as usize];
            *count += 1;
        }
        let rho = |(sum, count): (f64, u32)| {
            if count <= FEWEST_PAIRS || mean_square <= 0.0 {
                return 0.0;
            }
            let (count, mean) = (f64::from(count), sum / f64::from(count) / mean_square);
            (mean * count / (count + HALF_PAIRS)).clamp(RHO.0, RHO.1)
        };
        self.rho = sums.into_iter().map(rho).collect();
    }

    /// Returns uᵀ R v.
    pub(super) fn product(&self, u: &[f64], v: &[f64]) -> f64 {
        let of = |pair: &Pair| {
            let (i, j) = (pair.one as usize, pair.other as usize);
            self.rho[pair.lag as usize] * (u[i] * v[j] + u[j] * v[i])
        };
        self.pairs.iter().map(of).sum()
    }

    /// Returns by how much the evidence of a place is to be divided, whose chords over the deviations of the links are these.
    pub(super) fn overdispersion(&self, u: &[f64]) -> f64 {
        let square: f64 = u.iter().map(|value| value * value).sum();
        if square <= 0.0 {
            return 1.0;
        }
        (1.0 + self.product(u, u) / square).max(1.0)
    }
}

/// Lags to a row of the table.
fn side() -> i32 {
    2 * LAGS + 1
}

/// Returns how far a place is from the ring, metres.
fn off_ring_m(at: Point, ring: Rect) -> f64 {
    let (inner_x_m, inner_y_m) = (
        (at.x_m - ring.min.x_m).min(ring.max.x_m - at.x_m),
        (at.y_m - ring.min.y_m).min(ring.max.y_m - at.y_m),
    );
    inner_x_m.min(inner_y_m).abs()
}

/// Returns how far along the ring from its south-western corner, counter-clockwise, the place nearest to a point lies, metres.
fn along_ring_m(at: Point, ring: Rect) -> f64 {
    let (width_m, height_m) = (ring.width_m(), ring.height_m());
    let (x_m, y_m) = (at.x_m - ring.min.x_m, at.y_m - ring.min.y_m);
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

/// Returns the pairs of the links that are marked.
fn pairs_of(
    observations: &[Observation],
    are_on_ring: &[bool],
    Driven { ring, bin_m }: Driven,
) -> Vec<Pair> {
    let whole_m = 2.0 * (ring.width_m() + ring.height_m());
    let ends: Vec<(f64, f64)> = observations
        .iter()
        .map(|one| (along_ring_m(one.from, ring), along_ring_m(one.to, ring)))
        .collect();
    // Both orders of every link, by where the first end lies.
    let mut places: Vec<(f64, f64, u32, bool)> = Vec::with_capacity(2 * ends.len());
    let on_ring = (0u32..).zip(&ends).zip(are_on_ring);
    for ((link, (a_m, b_m)), _) in on_ring.filter(|(_, is_on_ring)| **is_on_ring) {
        places.push((*a_m, *b_m, link, false));
        places.push((*b_m, *a_m, link, true));
    }
    places.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.2.cmp(&other.2)));
    let wrapped = |difference_m: f64| {
        let turns = libm::floor(difference_m / whole_m + 0.5);
        difference_m - turns * whole_m
    };
    let reach_m = bin_m * (f64::from(LAGS) + 0.5);
    let mut pairs = Vec::new();
    for (index, (a_m, b_m, link, is_exchanged)) in places.iter().enumerate() {
        // Onward along the ring, around its seam once at most: every pair of places is met from one of its two.
        for step in 1..places.len() {
            let (other_a_m, other_b_m, other, is_other_exchanged) =
                places[(index + step) % places.len()];
            let da_m = other_a_m - a_m
                + if index + step < places.len() {
                    0.0
                } else {
                    whole_m
                };
            if da_m > reach_m {
                break;
            }
            // Exchanged both, or the one and not the other and vice versa: the same pair twice; one of them counts.
            let is_twin = match (*is_exchanged, is_other_exchanged) {
                (false, false) => false,
                (true, true) => true,
                (own, _) => own == (*link < other),
            };
            let db_m = wrapped(other_b_m - b_m);
            if is_twin
                || *link == other
                || db_m.abs() > reach_m
                || (da_m - db_m).abs() >= ALIKE_BINS * bin_m
            {
                continue;
            }
            pairs.push(Pair {
                one: *link,
                other,
                lag: lag(da_m / bin_m, db_m / bin_m),
            });
        }
    }
    pairs
}

/// Returns the place in the table of a lag, which is the same whichever link comes first and whichever end.
fn lag(a_bins: f64, b_bins: f64) -> u32 {
    let step = |bins: f64| (libm::round(bins) as i32).clamp(-LAGS, LAGS);
    let (a, b) = (step(a_bins), step(b_bins));
    let is_backward = a + b < 0 || (a + b == 0 && a < 0);
    let (a, b) = if is_backward { (-a, -b) } else { (a, b) };
    ((a.min(b) + LAGS) * side() + a.max(b) + LAGS).cast_unsigned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tomo::tests_support::Noise;

    const RING: Rect = Rect {
        min: Point::new(0.0, 0.0),
        max: Point::new(20.0, 20.0),
    };
    const DRIVEN: Driven = Driven {
        ring: RING,
        bin_m: 0.5,
    };

    fn at(along_m: f64) -> Point {
        let along_m = along_m.rem_euclid(80.0);
        match along_m {
            x_m if x_m < 20.0 => Point::new(x_m, 0.0),
            m if m < 40.0 => Point::new(20.0, m - 20.0),
            m if m < 60.0 => Point::new(60.0 - m, 20.0),
            m => Point::new(0.0, 80.0 - m),
        }
    }

    fn links() -> Vec<Observation> {
        (0..40)
            .flat_map(|i| {
                (0..40).map(move |j| (2.0 * f64::from(i) + 0.3, 2.0 * f64::from(j) + 1.1))
            })
            .map(|(a_m, b_m)| Observation {
                from: at(a_m),
                to: at(b_m),
                attenuation_db: 0.0,
                variance_db2: 1.0,
                packets: 10,
                misses: 0,
                is_at_floor: false,
            })
            .collect()
    }

    #[test]
    fn every_pair_is_met_once_also_over_the_seam_and_with_exchanged_ends() {
        let observations = links();
        let mut turned: Vec<Observation> = observations
            .iter()
            .enumerate()
            .map(|(k, one)| match k % 3 {
                0 => Observation {
                    from: one.to,
                    to: one.from,
                    ..*one
                },
                _ => *one,
            })
            .collect();
        let count = |observations: &[Observation]| {
            let mut pairs: Vec<(u32, u32, u32)> = Correlation::new(observations, Some(DRIVEN))
                .pairs
                .into_iter()
                .map(|pair| (pair.one.min(pair.other), pair.one.max(pair.other), pair.lag))
                .collect();
            pairs.sort_unstable();
            pairs
        };
        let straight = count(&observations);
        assert_eq!(straight, count(&turned), "exchanged ends change nothing");
        turned.reverse();
        assert_eq!(straight.len(), count(&turned).len(), "nor does their order");
        let mut once = straight.clone();
        once.dedup();
        assert_eq!(once.len(), straight.len());
        // Two links beside each other at the seam: both ends 2 m on.
        let seam: Vec<Observation> = [(79.5, 40.0), (1.5, 42.0)]
            .map(|(a_m, b_m)| Observation {
                from: at(a_m),
                to: at(b_m),
                ..observations[0]
            })
            .to_vec();
        assert_eq!(count(&seam), [(0, 1, lag(4.0, 4.0))]);
    }

    #[test]
    fn noise_that_goes_together_makes_evidence_less_sure() {
        let observations = links();
        let u = vec![1.0; observations.len()];
        let of = |noise: &mut dyn FnMut(&Observation) -> f64| {
            let mut correlation = Correlation::new(&observations, Some(DRIVEN));
            let residuals: Vec<f64> = observations.iter().map(noise).collect();
            correlation.learn(&residuals);
            correlation.overdispersion(&u)
        };
        let mut drawn = Noise::new(1);
        let independent = of(&mut |_| drawn.normal());
        let together = of(&mut |one| libm::sin(0.4 * along_ring_m(one.from, RING)));
        assert!(independent < 1.5, "{independent}");
        assert!(together > 3.0, "{together}");
    }

    #[test]
    fn of_a_sweep_that_was_not_driven_along_a_ring_nothing_is_known() {
        let mut observations = links();
        let count = |observations: &[Observation], driven| {
            Correlation::new(observations, driven).pairs.len()
        };
        assert!(count(&observations, Some(DRIVEN)) > 0);
        assert_eq!(count(&observations, None), 0);
        for index in 0..observations.len() / 2 {
            observations[index].from = Point::new(9.0, 9.0);
        }
        assert_eq!(count(&observations, Some(DRIVEN)), 0);
    }

    #[test]
    fn links_that_were_not_driven_along_the_ring_are_in_no_pair_and_the_others_are() {
        let mut observations = links();
        let all = Correlation::new(&observations, Some(DRIVEN)).pairs;
        for index in [3, 700, 1200] {
            observations[index].from = Point::new(9.0, 9.0);
        }
        let mut correlation = Correlation::new(&observations, Some(DRIVEN));
        let is_off = |link: u32| [3, 700, 1200].contains(&link);
        let others = all
            .iter()
            .filter(|pair| !is_off(pair.one) && !is_off(pair.other));
        assert_eq!(correlation.pairs.len(), others.count());
        assert!(correlation.pairs.len() < all.len());
        let slow = |one: &Observation| libm::sin(0.4 * along_ring_m(one.from, RING));
        let residuals: Vec<f64> = observations.iter().map(slow).collect();
        correlation.learn(&residuals);
        let together = correlation.overdispersion(&vec![1.0; residuals.len()]);
        assert!(together > 3.0, "{together}");
    }
}
