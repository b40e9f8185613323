//! The most probable non-negative image under a smooth prior, that prefers to be empty:
//!
//! ```text
//!   least of ½ |S W x − d|² + ½ ∫ (a x² + b |∇x|²) dA + sparsity · ∫ x dA,   x ≥ 0
//!   a = 1 / (2π σ² δ²),  b = 3/2 δ² a
//! ```
//!
//! The quadratic form is the inverse of the exponential covariance σ² exp(−r/δ) up to the second power of the wave number:
//! (1 + δ²k²)^(3/2) ≈ 1 + 3/2 δ²k². By FISTA (Beck and Teboulle 2009) with restart, each pixel with a step of its own: for
//! weights that are not negative, the row sums of the curvature bound it from above.

use serde::{Deserialize, Serialize};

use super::robust::Linearised;
use crate::geom::PixelGrid;
use crate::tomo::prior::Prior;
use crate::tomo::weights::WeightRows;

/// What is believed of a non-negative image.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Sparse {
    /// σ² and δ.
    pub prior: Prior,
    /// Cost of the sum of attenuation, 1/(dB m).
    pub sparsity: f64,
}

/// Memory that one step after another uses again.
#[derive(Clone, Debug)]
pub(super) struct Descent<'a> {
    rows: &'a WeightRows,
    grid: &'a PixelGrid,
    sparse: Sparse,
    slope: Vec<f64>,
}

impl<'a> Descent<'a> {
    pub(super) fn new(rows: &'a WeightRows, grid: &'a PixelGrid, sparse: Sparse) -> Descent<'a> {
        Descent {
            rows,
            grid,
            sparse,
            slope: vec![0.0; grid.len()],
        }
    }

    /// Takes some steps towards the solution of a linear problem.
    pub(super) fn improve(&mut self, problem: &Linearised, image: &mut [f64], steps: usize) {
        let step_sizes = self.step_sizes(problem);
        let mut ahead = image.to_vec();
        let mut momentum = 1.0;
        for _ in 0..steps {
            self.find_slope(problem, &ahead);
            let mut turned = 0.0;
            let next_momentum = 0.5 * (1.0 + f64::sqrt(1.0 + 4.0 * momentum * momentum));
            let push = (momentum - 1.0) / next_momentum;
            for pixel in 0..image.len() {
                let next = (ahead[pixel] - step_sizes[pixel] * self.slope[pixel]).max(0.0);
                let move_ = next - image[pixel];
                turned += (ahead[pixel] - next) * move_;
                ahead[pixel] = next + push * move_;
                image[pixel] = next;
            }
            momentum = next_momentum;
            if turned > 0.0 {
                // The momentum has carried it past the lowest point.
                momentum = 1.0;
                ahead.copy_from_slice(image);
            }
        }
    }

    /// Returns one over the row sums of the curvature.
    fn step_sizes(&self, problem: &Linearised) -> Vec<f64> {
        let ones = vec![1.0; self.grid.len()];
        let mut sums = vec![0.0; self.grid.len()];
        self.rows.there_and_back(&ones, &mut sums, |l, sum| {
            problem.scale[l] * problem.scale[l] * sum
        });
        let (own, east, north) = self.precisions();
        let of_prior = own + 4.0 * (east + north);
        sums.into_iter().map(|sum| 1.0 / (sum + of_prior)).collect()
    }

    /// Returns the prior's cost of a pixel's square, and of the squares of the differences to east and to north.
    fn precisions(&self) -> (f64, f64, f64) {
        let Prior { variance, length_m } = self.sparse.prior;
        let (dx_m, dy_m) = (self.grid.dx_m(), self.grid.dy_m());
        let own = 1.0 / (2.0 * std::f64::consts::PI * variance * length_m * length_m);
        let smooth = 1.5 * length_m * length_m * own;
        (
            own * dx_m * dy_m,
            smooth * dy_m / dx_m,
            smooth * dx_m / dy_m,
        )
    }

    fn find_slope(&mut self, problem: &Linearised, image: &[f64]) {
        self.rows
            .there_and_back(image, &mut self.slope, |l, straight_db| {
                let scale = problem.scale[l];
                scale * (scale * straight_db - problem.data[l])
            });
        let (own, east, north) = self.precisions();
        let constant = self.sparse.sparsity * self.grid.dx_m() * self.grid.dy_m();
        let (columns, rows) = (self.grid.columns, self.grid.rows);
        for row in 0..rows {
            for column in 0..columns {
                let here = row * columns + column;
                self.slope[here] += constant + own * image[here];
                if column + 1 < columns {
                    let flow = east * (image[here] - image[here + 1]);
                    self.slope[here] += flow;
                    self.slope[here + 1] -= flow;
                }
                if row + 1 < rows {
                    let flow = north * (image[here] - image[here + columns]);
                    self.slope[here] += flow;
                    self.slope[here + columns] -= flow;
                }
            }
        }
    }
}
