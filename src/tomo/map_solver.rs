//! The most probable image under a Gaussian prior: x = C Wᵀ (W C Wᵀ + H B Hᵀ + S)⁻¹ y.
//!
//! Solved as the same image's least (y − W x − H b)ᵀ S⁻¹ (y − W x − H b) + xᵀ C⁻¹ x + bᵀ B⁻¹ b, by conjugate gradients
//! preconditioned with C and B: a step is one pass over the weights and one application of the covariance (by FFT), no matrix
//! is formed, and C⁻¹ x is kept beside x, so that C is never inverted. Student-t noise by iterative reweighting,
//! w = (ν+1) / (ν + r²/s²). Non-negativity is not imposed here.

use serde::{Deserialize, Serialize};

use super::cholesky::{add_scaled, dot};
use super::prior::{Covariance, Workspace};
use super::projector::Projector;
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
    /// Norm of the preconditioned gradient, relative to that without any image, at which a solve ends.
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

impl MapSettings {
    /// Returns settings with which an image equals the sum of its links' shares to about nine digits.
    pub(super) fn exact(self) -> MapSettings {
        MapSettings {
            tolerance: 1e-11,
            most_steps: 2_000,
            ..self
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

/// Where a solution begins: what an earlier one has come to. It asks nothing of the links, which may be others.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct MapStart {
    /// C⁻¹ x, a value for each pixel, and B⁻¹ b.
    whitened: Vec<f64>,
}

/// The solved problem.
#[derive(Clone, PartialEq, Debug)]
pub struct MapSolution {
    /// The image, dB/m, row-major from the south-west.
    pub image: Vec<f64>,
    /// y − W x − H b, dB, one per link.
    pub residual_db: Vec<f64>,
    /// The dual variables, one per link: residual over variance, 1/dB.
    pub dual: Vec<f64>,
    /// The Student-t weight of each link; 1 for Gaussian noise.
    pub trust: Vec<f64>,
    /// The coefficients of the nuisance columns.
    pub nuisance: Vec<f64>,
    /// Conjugate-gradient steps of all solves together.
    pub steps: usize,
    /// Where a later, similar problem may begin.
    pub start: MapStart,
}

impl MapProblem<'_> {
    /// Solves; `start` is what a similar problem on the same pixels has come to.
    pub fn solve(&self, settings: MapSettings, start: Option<&MapStart>) -> MapSolution {
        let mut solver = Solver::new(self, settings.tolerance);
        let is_warm = start.is_some_and(|start| solver.begin_at(start));
        let degrees = settings.student_degrees;
        let mut trust = vec![1.0; self.attenuation_db.len()];
        if let (Some(degrees), true) = (degrees, is_warm) {
            self.reweight(&solver.residual_db, degrees, &mut trust);
        }
        let reweightings = degrees.map_or(0, |_| settings.reweightings);
        let mut goal = None;
        let mut steps = 0;
        for round in 0..=reweightings {
            solver.set_noise(&trust);
            let goal = *goal.get_or_insert_with(|| solver.goal(settings.tolerance));
            steps += solver.solve(goal, settings.most_steps);
            let Some(degrees) = degrees.filter(|_| round < reweightings) else {
                break;
            };
            if self.reweight(&solver.residual_db, degrees, &mut trust) < 0.02 {
                break;
            }
        }
        let noise = &solver.noise;
        let dual = solver.residual_db.iter().zip(noise).map(|(r, s2)| r / s2);
        let mut image = solver.unknowns;
        let nuisance = image.split_off(solver.pixels);
        MapSolution {
            image,
            dual: dual.collect(),
            residual_db: solver.residual_db,
            trust,
            nuisance,
            steps,
            start: MapStart {
                whitened: solver.whitened,
            },
        }
    }

    /// Sets each link's trust to (ν + 1) / (ν + r²/s²); returns the mean change.
    fn reweight(&self, residual_db: &[f64], degrees: f64, trust: &mut [f64]) -> f64 {
        let mut change = 0.0;
        for (link, trust) in trust.iter_mut().enumerate() {
            let square = residual_db[link] * residual_db[link] / self.variance_db2[link];
            let next = student::trust(square, degrees);
            change += (next - *trust).abs();
            *trust = next;
        }
        change / residual_db.len().max(1) as f64
    }
}

/// Conjugate gradients on W'ᵀ S⁻¹ W' + C'⁻¹, where W' = [W H] and C' = diag(C, B), with its memory. Vectors over the
/// unknowns hold the pixels and behind them the coefficients of the nuisance columns.
struct Solver<'a> {
    problem: &'a MapProblem<'a>,
    pixels: usize,
    /// S over the trusts, dB².
    noise: Vec<f64>,
    /// x and b.
    unknowns: Vec<f64>,
    /// C'⁻¹ of these.
    whitened: Vec<f64>,
    /// y − W x − H b.
    residual_db: Vec<f64>,
    projector: Projector<'a>,
    work: Workspace,
}

impl<'a> Solver<'a> {
    fn new(problem: &'a MapProblem<'a>, tolerance: f64) -> Solver<'a> {
        let pixels = problem.covariance.pixels();
        let unknowns = vec![0.0; pixels + problem.nuisance.len()];
        Solver {
            problem,
            pixels,
            noise: problem.variance_db2.to_vec(),
            whitened: unknowns.clone(),
            unknowns,
            residual_db: problem.attenuation_db.to_vec(),
            projector: Projector::of(problem.rows, pixels, tolerance),
            work: Workspace::default(),
        }
    }

    /// Begins where an earlier solution was; false if that one has no place here (other pixels, other columns).
    fn begin_at(&mut self, start: &MapStart) -> bool {
        if start.whitened.len() != self.whitened.len() {
            return false;
        }
        self.whitened.copy_from_slice(&start.whitened);
        let mut unknowns = std::mem::take(&mut self.unknowns);
        self.apply_prior(&start.whitened, &mut unknowns);
        self.unknowns = unknowns;
        self.set_residuals();
        true
    }

    fn set_noise(&mut self, trust: &[f64]) {
        self.noise
            .iter_mut()
            .zip(self.problem.variance_db2.iter().zip(trust))
            .for_each(|(noise, (s2, trust))| *noise = s2 / trust);
    }

    /// Gives C' of a vector.
    fn apply_prior(&mut self, vector: &[f64], output: &mut [f64]) {
        let (image, nuisance) = vector.split_at(self.pixels);
        let (smoothed, scaled) = output.split_at_mut(self.pixels);
        let MapProblem {
            covariance,
            nuisance: columns,
            ..
        } = *self.problem;
        covariance.apply(image, smoothed, &mut self.work);
        for (k, column) in columns.iter().enumerate() {
            scaled[k] = column.variance * nuisance[k];
        }
    }

    /// Returns W'ᵀ S⁻¹ of values of the links.
    fn weighed_back(&self, links: &[f64]) -> Vec<f64> {
        let weighed = links.iter().zip(&self.noise).map(|(value, s2)| value / s2);
        let weighed: Vec<f64> = weighed.collect();
        let mut back = vec![0.0; self.unknowns.len()];
        let (pixels, nuisance) = back.split_at_mut(self.pixels);
        self.projector.backward(&weighed, pixels);
        for (coefficient, column) in nuisance.iter_mut().zip(self.problem.nuisance) {
            *coefficient = dot(&column.column, &weighed);
        }
        back
    }

    /// Computes the residuals of the unknowns as they are.
    fn set_residuals(&mut self) {
        let (image, nuisance) = self.unknowns.split_at(self.pixels);
        self.projector.forward(image, &mut self.residual_db);
        for (link, value) in self.residual_db.iter_mut().enumerate() {
            let columns = self.problem.nuisance.iter().zip(nuisance);
            let level_db: f64 = columns.map(|(of, factor)| of.column[link] * factor).sum();
            *value = self.problem.attenuation_db[link] - *value - level_db;
        }
    }

    /// Returns the square of the preconditioned gradient at which a solve ends: a share of that without any image.
    fn goal(&mut self, tolerance: f64) -> f64 {
        let back = self.weighed_back(self.problem.attenuation_db);
        let mut smoothed = vec![0.0; back.len()];
        self.apply_prior(&back, &mut smoothed);
        tolerance * tolerance * dot(&back, &smoothed)
    }

    /// Gives W'ᵀ S⁻¹ W' of a vector in one pass over the weights, and adds `whitened`.
    fn apply(&self, vector: &[f64], whitened: &[f64], output: &mut [f64]) {
        let (image, factors) = vector.split_at(self.pixels);
        let (back, sums) = output.split_at_mut(self.pixels);
        sums.fill(0.0);
        let columns = self.problem.nuisance;
        let of_link = |link: usize, [there]: [f64; 1]| {
            let of_columns = columns.iter().zip(factors);
            let level: f64 = of_columns
                .map(|(of, factor)| of.column[link] * factor)
                .sum();
            let weighed = (there + level) / self.noise[link];
            for (sum, of) in sums.iter_mut().zip(columns) {
                *sum += of.column[link] * weighed;
            }
            [weighed]
        };
        let (image, back) = (image.as_chunks().0, back.as_chunks_mut().0);
        self.projector.there_and_back(image, back, of_link);
        add_scaled(output, whitened, 1.0);
    }

    /// Improves the unknowns until the square of their preconditioned gradient is no more than `goal`; returns the steps taken.
    fn solve(&mut self, goal: f64, most_steps: usize) -> usize {
        let mut gradient = self.weighed_back(&self.residual_db);
        add_scaled(&mut gradient, &self.whitened, -1.0);
        let mut smoothed = vec![0.0; gradient.len()];
        self.apply_prior(&gradient, &mut smoothed);
        let mut square = dot(&gradient, &smoothed);
        let (mut direction, mut whitened) = (smoothed.clone(), gradient.clone());
        let mut product = vec![0.0; gradient.len()];
        let mut steps = 0;
        while steps < most_steps && square > goal && square > f64::MIN_POSITIVE {
            self.apply(&direction, &whitened, &mut product);
            let length = square / dot(&direction, &product);
            add_scaled(&mut self.unknowns, &direction, length);
            add_scaled(&mut self.whitened, &whitened, length);
            add_scaled(&mut gradient, &product, -length);
            self.apply_prior(&gradient, &mut smoothed);
            let next = dot(&gradient, &smoothed);
            let share = next / square;
            turn(&mut direction, &smoothed, share);
            turn(&mut whitened, &gradient, share);
            square = next;
            steps += 1;
        }
        self.set_residuals();
        steps
    }
}

/// Replaces a direction by a new one and a share of what it was.
fn turn(direction: &mut [f64], new: &[f64], share: f64) {
    direction
        .iter_mut()
        .zip(new)
        .for_each(|(direction, new)| *direction = new + share * *direction);
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
        let error = |got: &MapSolution| {
            (DVector::from_vec(got.image.clone()) - &image).norm() / image.norm()
        };
        assert!(error(&got) < 1e-6, "{}", error(&got));
        // One that ends earlier, on rounded weights, is as good as it is asked to be, and no better.
        let early = MapSettings {
            tolerance: 1e-4,
            ..settings
        };
        let draft = problem.solve(early, None);
        let warm = problem.solve(early, Some(&draft.start));
        assert!((1e-9..1e-3).contains(&error(&draft)), "{}", error(&draft));
        assert!(error(&warm) < 1e-3 && warm.steps <= 2, "{}", error(&warm));
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
        let again = problem.solve(settings, Some(&got.start));
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
