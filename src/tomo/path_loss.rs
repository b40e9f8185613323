//! The strength that a link would have with nothing in between: P0 − 10 n log10 d, fitted robustly.

use serde::{Deserialize, Serialize};

use super::Link;
use super::map_solver::Nuisance;
use super::student::{self, DEGREES};

/// Which links of a sweep a law was fitted to.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum LawBasis {
    /// Those along the sides of the ring, with nothing in between.
    Sides,
    /// All that there are, or all that are long enough where too few run along the sides.
    All,
}

/// Path loss, and how well it is known.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct PathLoss {
    /// P0: strength at one metre (or one unit of the input), dBm.
    pub p0_dbm: f64,
    /// n: exponent, 2 in free space.
    pub exponent: f64,
    /// Mean of 10 log10 d of the fitted links; level and exponent are uncorrelated there.
    pub centre_db: f64,
    /// Standard deviation of the level at the centre, dB.
    pub level_sd_db: f64,
    /// Standard deviation of the exponent.
    pub exponent_sd: f64,
    /// Robust standard deviation of the fitted links about the law, dB.
    pub residual_db: f64,
    /// Links that were fitted.
    pub links: usize,
    /// Which these are.
    pub basis: LawBasis,
}

/// What is believed of the exponent before fitting.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ExponentPrior {
    /// Mean.
    pub mean: f64,
    /// Standard deviation; infinite for a free fit.
    pub sd: f64,
}

impl ExponentPrior {
    /// Free space with little doubt: n = 2.0 ± 0.2; long links through walls cannot pull it away.
    pub const NEAR_FREE_SPACE: ExponentPrior = ExponentPrior { mean: 2.0, sd: 0.2 };
    /// Nothing is believed.
    #[cfg(test)]
    pub const FREE: ExponentPrior = ExponentPrior {
        mean: 2.0,
        sd: f64::INFINITY,
    };
}

const REWEIGHTINGS: usize = 20;

impl PathLoss {
    /// Returns the strength without obstacles at a distance, dBm.
    pub fn strength_dbm(&self, distance_m: f64) -> f64 {
        self.p0_dbm - self.exponent * spread_db(distance_m)
    }

    /// Returns the law with its level at the centre raised by `level_db` and its exponent by `exponent`.
    pub fn corrected(self, level_db: f64, exponent: f64) -> PathLoss {
        let p0_dbm = self.p0_dbm + level_db + exponent * self.centre_db;
        PathLoss {
            p0_dbm,
            exponent: self.exponent + exponent,
            ..self
        }
    }

    /// Returns what the fit leaves open, level and exponent, as columns over links of these lengths, metres:
    /// y = W x − δP0 + 10 δn (log d − centre).
    pub(super) fn nuisance(&self, lengths_m: impl Iterator<Item = f64>) -> Vec<Nuisance> {
        let slopes: Vec<f64> = lengths_m
            .map(|length_m| spread_db(length_m) - self.centre_db)
            .collect();
        let column = |column: Vec<f64>, sd: f64| Nuisance {
            column,
            variance: sd * sd,
        };
        vec![
            column(vec![1.0; slopes.len()], self.level_sd_db),
            column(slopes, self.exponent_sd),
        ]
    }

    /// Fits links (their means as given) with Student-t noise, ν = 4, by iterative reweighting;
    /// `None` with fewer than three usable links.
    pub fn fit(links: &[Link], prior: ExponentPrior) -> Option<PathLoss> {
        let points: Vec<(f64, f64)> = links
            .iter()
            .filter(|link| link.packets > 0 && link.length_m() > 0.0 && link.mean_dbm.is_finite())
            .map(|link| (spread_db(link.length_m()), link.mean_dbm))
            .collect();
        if points.len() < 3 {
            return None;
        }
        let mut weights = vec![1.0; points.len()];
        let mut residual_db = 3.0;
        let mut fitted = weighted_fit(&points, &weights, prior, residual_db);
        for _ in 0..REWEIGHTINGS {
            let count = points.len() as f64;
            let square = |(point, weight): (&(f64, f64), &f64)| {
                let residual_db = fitted.residual_db(*point);
                weight * (residual_db * residual_db)
            };
            residual_db = (points.iter().zip(&weights).map(square).sum::<f64>() / count)
                .sqrt()
                .max(0.1);
            for (weight, point) in weights.iter_mut().zip(&points) {
                let ratio = fitted.residual_db(*point) / residual_db;
                *weight = student::trust(ratio * ratio, DEGREES);
            }
            fitted = weighted_fit(&points, &weights, prior, residual_db);
        }
        Some(PathLoss {
            p0_dbm: fitted.level_dbm + fitted.exponent * fitted.centre_db,
            exponent: fitted.exponent,
            centre_db: fitted.centre_db,
            level_sd_db: fitted.level_sd_db,
            exponent_sd: fitted.exponent_sd,
            residual_db,
            links: points.len(),
            basis: LawBasis::All,
        })
    }
}

/// Returns 10 log10 d.
pub(super) fn spread_db(distance_m: f64) -> f64 {
    10.0 * libm::log10(distance_m)
}

/// A weighted line through the points, about their centre.
struct Fit {
    centre_db: f64,
    level_dbm: f64,
    exponent: f64,
    level_sd_db: f64,
    exponent_sd: f64,
}

impl Fit {
    fn residual_db(&self, (spread_db, strength_dbm): (f64, f64)) -> f64 {
        strength_dbm - self.level_dbm + self.exponent * (spread_db - self.centre_db)
    }
}

fn weighted_fit(
    points: &[(f64, f64)],
    weights: &[f64],
    prior: ExponentPrior,
    residual_db: f64,
) -> Fit {
    let sum = |value: &dyn Fn(f64, f64) -> f64| -> f64 {
        points
            .iter()
            .zip(weights)
            .map(|((spread, strength), weight)| weight * value(*spread, *strength))
            .sum()
    };
    let total = sum(&|_, _| 1.0);
    let centre_db = sum(&|spread, _| spread) / total;
    let level_dbm = sum(&|_, strength| strength) / total;
    let noise = residual_db * residual_db;
    // A sliver of prior keeps links of one length solvable.
    let prior_precision = 1.0 / (prior.sd * prior.sd) + 1e-9;
    let squares = sum(&|spread, _| (spread - centre_db) * (spread - centre_db));
    let precision = squares / noise + prior_precision;
    let slope = -sum(&|spread, strength| (spread - centre_db) * (strength - level_dbm)) / noise;
    let exponent = (slope + prior.mean * prior_precision) / precision;
    let (level_sd_db, exponent_sd) = ((noise / total).sqrt(), 1.0 / precision.sqrt());
    Fit {
        centre_db,
        level_dbm,
        exponent,
        level_sd_db,
        exponent_sd,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Point;

    fn links(exponent: f64, outliers: usize) -> Vec<Link> {
        (0..60)
            .map(|k| {
                let d_m = 2.0 + 0.3 * k as f64;
                let noise_db = ((k * 37 % 11) as f64 - 5.0) * 0.4;
                let blocked_db = if k % 7 == 0 && k / 7 < outliers {
                    25.0
                } else {
                    0.0
                };
                let mean_dbm = -40.0 - 10.0 * exponent * d_m.log10() + noise_db - blocked_db;
                Link::fixed(Point::new(0.0, 0.0), Point::new(d_m, 0.0), 4, mean_dbm)
            })
            .collect()
    }

    #[test]
    fn the_law_is_found_in_spite_of_blocked_links() {
        let fitted = PathLoss::fit(&links(2.4, 6), ExponentPrior::FREE).unwrap();
        assert!((fitted.exponent - 2.4).abs() < 0.15, "{fitted:?}");
        assert!(
            (fitted.strength_dbm(10.0) - -64.0).abs() < 0.6,
            "{fitted:?}"
        );
        assert!((0.8..2.5).contains(&fitted.residual_db));
    }

    #[test]
    fn a_narrow_prior_keeps_the_exponent_physical_where_errors_go_together() {
        // Long links all cross a wall: a free fit gives nonsense, and a prior counts as little against sixty links.
        let mut links = links(2.0, 0);
        for link in links.iter_mut().filter(|link| link.length_m() > 10.0) {
            link.mean_dbm -= 12.0;
        }
        let free = PathLoss::fit(&links, ExponentPrior::FREE).unwrap();
        let pulled = PathLoss::fit(&links, ExponentPrior::NEAR_FREE_SPACE).unwrap();
        let narrow = ExponentPrior {
            sd: 1e-3,
            ..ExponentPrior::NEAR_FREE_SPACE
        };
        let held = PathLoss::fit(&links, narrow).unwrap();
        assert!(
            free.exponent > 3.0 && pulled.exponent < free.exponent - 0.1,
            "{free:?} {pulled:?}"
        );
        assert!((1.6..2.4).contains(&held.exponent), "{held:?}");
    }

    #[test]
    fn too_few_links_give_no_law() {
        assert_eq!(
            PathLoss::fit(&links(2.0, 0)[..2], ExponentPrior::FREE),
            None
        );
    }
}
