//! The most probable image under a Gaussian prior: x = C Wᵀ (W C Wᵀ + H B Hᵀ + S)⁻¹ y.
//!
//! Solved in link space by preconditioned conjugate gradients with a warm start; the covariance is applied by
//! FFT, so no matrix is formed. Student-t noise by iterative reweighting, w = (ν+1) / (ν + r²/s²). Non-negativity is not
//! imposed here.

use serde::{Deserialize, Serialize};

use super::cholesky::dot;
use super::prior::{Covariance, Workspace};
use super::student;
use super::weights::WeightRows;

/// A column H of unknowns that are not pixels (path loss), with the prior variance of its coefficient.
#[derive(Clone, PartialEq, Debug)]
pub struct Nuisance {
    /// The effect of one unit on each link, dB.
    pub column: Vec<f64>,
    /// Prior variance of the coefficient.
    pub variance: f64,
}

/// When the iterations end.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct MapSettings {
    /// Degrees of freedom ν of the Student-t noise; `None` for Gaussian noise.
    pub student_degrees: Option<f64>,
    /// How often the links are reweighted.
    pub reweightings: usize,
    /// Norm of the residual, relative to that of the data, at which a solve ends.
    pub tolerance: f64,
    /// Most conjugate-gradient steps of one solve.
    pub most_steps: usize,
}

impl Default for MapSettings {
    fn default() -> MapSettings {
        MapSettings {
            student_degrees: Some(4.0),
            reweightings: 4,
            tolerance: 1e-3,
            most_steps: 200,
        }
    }
}

/// The linear problem: what was measured, and how it depends on the image.
#[derive(Clone, Copy, Debug)]
pub struct MapProblem<'a> {
    /// W: rows = links, columns = pixels.
    pub rows: &'a WeightRows,
    /// C: what is believed of the image.
    pub covariance: &'a Covariance,
    /// y: attenuation of each link, dB.
    pub attenuation_db: &'a [f64],
    /// S: variance of each link, dB².
    pub variance_db2: &'a [f64],
    /// H and B.
    pub nuisance: &'a [Nuisance],
}

/// The solved problem.
#[derive(Clone, PartialEq, Debug)]
pub struct MapSolution {
    /// The image, dB/m, row-major from the south-west.
    pub image: Vec<f64>,
    /// y − W x − H b, dB, one per link.
    pub residual_db: Vec<f64>,
    /// The dual variables, one per link: the warm start of a later solve.
    pub dual: Vec<f64>,
    /// The Student-t weight of each link; 1 for Gaussian noise.
    pub trust: Vec<f64>,
    /// The coefficients of the nuisance columns.
    pub nuisance: Vec<f64>,
    /// Conjugate-gradient steps of all solves together.
    pub steps: usize,
}

impl MapProblem<'_> {
    /// Solves; `start` holds dual variables and trusts of an earlier, similar problem.
    pub fn solve(&self, settings: MapSettings, start: Option<(Vec<f64>, Vec<f64>)>) -> MapSolution {
        let links = self.attenuation_db.len();
        let (mut dual, mut trust) = start.unwrap_or_else(|| (vec![0.0; links], vec![1.0; links]));
        let mut solver = Solver::new(self);
        let mut steps = 0;
        let reweightings = if settings.student_degrees.is_some() {
            settings.reweightings
        } else {
            0
        };
        for round in 0..=reweightings {
            solver.set_noise(self.variance_db2, &trust);
            steps += solver.solve(&mut dual, settings.tolerance, settings.most_steps);
            let Some(degrees) = settings.student_degrees.filter(|_| round < reweightings) else {
                break;
            };
            let change = self.reweight(&solver.noise, &dual, degrees, &mut trust);
            if change < 0.02 {
                break;
            }
        }
        let residual_db = dual
            .iter()
            .zip(&solver.noise)
            .map(|(dual, noise)| dual * noise)
            .collect();
        let nuisance = self
            .nuisance
            .iter()
            .map(|column| column.variance * dot(&column.column, &dual))
            .collect();
        let image = solver.image(&dual);
        MapSolution {
            image,
            residual_db,
            dual,
            trust,
            nuisance,
            steps,
        }
    }

    /// Sets each link's trust to (ν + 1) / (ν + r²/s²), where the residual r is noise times dual; returns the mean change.
    fn reweight(&self, noise: &[f64], dual: &[f64], degrees: f64, trust: &mut [f64]) -> f64 {
        let mut change = 0.0;
        for (link, trust) in trust.iter_mut().enumerate() {
            let residual_db = noise[link] * dual[link];
            let square = residual_db * residual_db / self.variance_db2[link];
            let next = student::trust(square, degrees);
            change += (next - *trust).abs();
            *trust = next;
        }
        change / noise.len().max(1) as f64
    }
}

/// Conjugate gradients on K = W C Wᵀ + H B Hᵀ + S, with its memory.
struct Solver<'a> {
    problem: &'a MapProblem<'a>,
    noise: Vec<f64>,
    pixels: Vec<f64>,
    smoothed: Vec<f64>,
    work: Workspace,
}

impl<'a> Solver<'a> {
    fn new(problem: &'a MapProblem<'a>) -> Solver<'a> {
        let pixels = problem.covariance.pixels();
        Solver {
            problem,
            noise: problem.variance_db2.to_vec(),
            pixels: vec![0.0; pixels],
            smoothed: vec![0.0; pixels],
            work: Workspace::default(),
        }
    }

    fn set_noise(&mut self, variance_db2: &[f64], trust: &[f64]) {
        self.noise
            .iter_mut()
            .zip(variance_db2.iter().zip(trust))
            .for_each(|(noise, (s2, trust))| *noise = s2 / trust);
    }

    fn image(&mut self, dual: &[f64]) -> Vec<f64> {
        self.problem.rows.backward(dual, &mut self.pixels);
        self.problem
            .covariance
            .apply(&self.pixels, &mut self.smoothed, &mut self.work);
        self.smoothed.clone()
    }

    fn apply(&mut self, dual: &[f64], output: &mut [f64]) {
        self.problem.rows.backward(dual, &mut self.pixels);
        self.problem
            .covariance
            .apply(&self.pixels, &mut self.smoothed, &mut self.work);
        self.problem.rows.forward(&self.smoothed, output);
        for (link, value) in output.iter_mut().enumerate() {
            *value += self.noise[link] * dual[link];
        }
        for column in self.problem.nuisance {
            let share = column.variance * dot(&column.column, dual);
            output
                .iter_mut()
                .zip(&column.column)
                .for_each(|(value, unit)| *value += share * unit);
        }
    }

    /// Improves `dual` until K·dual = y within the tolerance, preconditioned by the noise; returns the steps taken.
    fn solve(&mut self, dual: &mut [f64], tolerance: f64, most_steps: usize) -> usize {
        let data = self.problem.attenuation_db;
        let mut product = vec![0.0; dual.len()];
        self.apply(dual, &mut product);
        let mut residual: Vec<f64> = data
            .iter()
            .zip(&product)
            .map(|(y, product)| y - product)
            .collect();
        let preconditioned = |residual: &[f64], noise: &[f64]| -> Vec<f64> {
            residual
                .iter()
                .zip(noise)
                .map(|(value, noise)| value / noise)
                .collect()
        };
        let goal = tolerance * tolerance * dot(data, &preconditioned(data, &self.noise));
        let mut scaled = preconditioned(&residual, &self.noise);
        let mut direction = scaled.clone();
        let mut square = dot(&residual, &scaled);
        for step in 0..most_steps {
            if square <= goal || square <= f64::MIN_POSITIVE {
                return step;
            }
            self.apply(&direction, &mut product);
            let length = square / dot(&direction, &product);
            for link in 0..dual.len() {
                dual[link] += length * direction[link];
                residual[link] -= length * product[link];
                scaled[link] = residual[link] / self.noise[link];
            }
            let next = dot(&residual, &scaled);
            let share = next / square;
            direction
                .iter_mut()
                .zip(&scaled)
                .for_each(|(direction, scaled)| *direction = scaled + share * *direction);
            square = next;
        }
        most_steps
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{PixelGrid, Point, Rect, Segment};
    use crate::tomo::{Prior, WeightModel};
    use nalgebra::{DMatrix, DVector};

    fn ring_links() -> Vec<Segment> {
        let at = |k: i32| {
            let angle = f64::from(k) * 0.51;
            Point::new(3.0 + 3.0 * angle.cos(), 2.5 + 2.5 * angle.sin())
        };
        (0..90)
            .map(|k| Segment::new(at(k), at(k * 3 + 4)))
            .filter(|link| link.length_m() > 1.0)
            .collect()
    }

    /// The same formula with dense matrices and a Cholesky factor.
    fn batch(
        grid: &PixelGrid,
        rows: &WeightRows,
        y: &[f64],
        s2: &[f64],
        h: &[Nuisance],
    ) -> (DVector<f64>, DVector<f64>) {
        let mut w = DMatrix::zeros(rows.len(), grid.len());
        for row in 0..rows.len() {
            rows.row(row)
                .for_each(|(pixel, weight)| w[(row, pixel)] = weight);
        }
        let c = DMatrix::from_fn(grid.len(), grid.len(), |i, j| {
            0.3 * (-grid.centre(i).distance_to(grid.centre(j)) / 1.0).exp()
        });
        let mut k =
            &w * &c * w.transpose() + DMatrix::from_diagonal(&DVector::from_column_slice(s2));
        for nuisance in h {
            let column = DVector::from_column_slice(&nuisance.column);
            k += &column * column.transpose() * nuisance.variance;
        }
        let dual = k.cholesky().unwrap().solve(&DVector::from_column_slice(y));
        (c * w.transpose() * &dual, dual)
    }

    #[test]
    fn conjugate_gradients_equal_the_batch_solve() {
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(6.0, 5.0));
        let grid = PixelGrid {
            area,
            columns: 12,
            rows: 10,
        };
        let links = ring_links();
        let rows = WeightRows::rescaled(
            links.iter().copied(),
            &grid,
            WeightModel::InverseArea { width_m: 0.3 },
        );
        let y: Vec<f64> = (0..links.len())
            .map(|k| ((k * 29) % 13) as f64 - 3.0)
            .collect();
        let s2: Vec<f64> = (0..links.len()).map(|k| 1.0 + (k % 5) as f64).collect();
        let h = vec![
            Nuisance {
                column: vec![1.0; links.len()],
                variance: 4.0,
            },
            Nuisance {
                column: links
                    .iter()
                    .map(|link| link.length_m().log10() * 10.0)
                    .collect(),
                variance: 0.04,
            },
        ];
        let (image, dual) = batch(&grid, &rows, &y, &s2, &h);
        let covariance = Covariance::new(
            &grid,
            Prior {
                variance: 0.3,
                length_m: 1.0,
            },
        );
        let problem = MapProblem {
            rows: &rows,
            covariance: &covariance,
            attenuation_db: &y,
            variance_db2: &s2,
            nuisance: &h,
        };
        let settings = MapSettings {
            student_degrees: None,
            reweightings: 0,
            tolerance: 1e-10,
            most_steps: 500,
        };
        let got = problem.solve(settings, None);
        let error = (DVector::from_vec(got.image.clone()) - &image).norm() / image.norm();
        assert!(error < 1e-6, "{error}");
        for (k, residual) in got.residual_db.iter().enumerate() {
            assert!((residual - dual[k] * s2[k]).abs() < 1e-6);
            let explained: f64 = rows
                .row(k)
                .map(|(pixel, weight)| weight * image[pixel])
                .sum::<f64>()
                + got.nuisance[0]
                + got.nuisance[1] * h[1].column[k];
            assert!((y[k] - explained - residual).abs() < 1e-5);
        }
        let again = problem.solve(settings, Some((got.dual.clone(), got.trust.clone())));
        assert!(again.steps <= 2, "a warm start took {} steps", again.steps);
    }

    #[test]
    fn a_wild_link_is_trusted_less() {
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(6.0, 5.0));
        let grid = PixelGrid {
            area,
            columns: 12,
            rows: 10,
        };
        let links = ring_links();
        let rows = WeightRows::rescaled(links.iter().copied(), &grid, WeightModel::Line);
        let mut y = vec![0.1; links.len()];
        y[7] = 40.0;
        let s2 = vec![2.0; links.len()];
        let covariance = Covariance::new(
            &grid,
            Prior {
                variance: 0.3,
                length_m: 1.0,
            },
        );
        let problem = MapProblem {
            rows: &rows,
            covariance: &covariance,
            attenuation_db: &y,
            variance_db2: &s2,
            nuisance: &[],
        };
        let gaussian = problem.solve(
            MapSettings {
                student_degrees: None,
                ..MapSettings::default()
            },
            None,
        );
        let robust = problem.solve(MapSettings::default(), None);
        let highest = |image: &[f64]| image.iter().copied().fold(0.0, f64::max);
        assert!(robust.trust[7] < 0.1 && robust.trust[8] > 1.0);
        assert!(highest(&robust.image) < 0.3 * highest(&gaussian.image));
    }
}
