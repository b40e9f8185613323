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

/// Memory that one step after another uses again, of several images, a lane for each.
#[derive(Clone, Debug)]
pub(super) struct Descent<'a, const LANES: usize> {
    rows: &'a WeightRows,
    grid: &'a PixelGrid,
    sparse: Sparse,
    slope: Vec<[f64; LANES]>,
}

impl<'a, const LANES: usize> Descent<'a, LANES> {
    pub(super) fn new(
        rows: &'a WeightRows,
        grid: &'a PixelGrid,
        sparse: Sparse,
    ) -> Descent<'a, LANES> {
        Descent {
            rows,
            grid,
            sparse,
            slope: vec![[0.0; LANES]; grid.len()],
        }
    }

    /// Takes some steps towards the solutions of linear problems.
    pub(super) fn improve(
        &mut self,
        problem: &Linearised<LANES>,
        images: &mut [[f64; LANES]],
        steps: usize,
    ) {
        let step_sizes = self.step_sizes(problem);
        let mut ahead = images.to_vec();
        let mut momentum = [1.0; LANES];
        for _ in 0..steps {
            self.find_slope(problem, &ahead);
            let mut turned = [0.0; LANES];
            let next_momentum = momentum.map(|of| 0.5 * (1.0 + f64::sqrt(1.0 + 4.0 * of * of)));
            let mut push = [0.0; LANES];
            for lane in 0..LANES {
                push[lane] = (momentum[lane] - 1.0) / next_momentum[lane];
            }
            for pixel in 0..images.len() {
                let (image, ahead) = (&mut images[pixel], &mut ahead[pixel]);
                let (size, slope) = (&step_sizes[pixel], &self.slope[pixel]);
                for lane in 0..LANES {
                    let next = (ahead[lane] - size[lane] * slope[lane]).max(0.0);
                    let move_ = next - image[lane];
                    turned[lane] += (ahead[lane] - next) * move_;
                    ahead[lane] = next + push[lane] * move_;
                    image[lane] = next;
                }
            }
            momentum = next_momentum;
            for lane in (0..LANES).filter(|lane| turned[*lane] > 0.0) {
                // The momentum has carried it past the lowest point.
                momentum[lane] = 1.0;
                let places = ahead.iter_mut().zip(images.iter());
                places.for_each(|(ahead, image)| ahead[lane] = image[lane]);
            }
        }
    }

    /// Returns one over the row sums of the curvature.
    fn step_sizes(&self, problem: &Linearised<LANES>) -> Vec<[f64; LANES]> {
        let ones = vec![[1.0; LANES]; self.grid.len()];
        let mut sums = vec![[0.0; LANES]; self.grid.len()];
        self.rows.there_and_back(&ones, &mut sums, |l, mut sum| {
            let lanes = sum.iter_mut().zip(&problem.scale[l]);
            lanes.for_each(|(sum, scale)| *sum *= scale * scale);
            sum
        });
        let (own, east, north) = self.precisions();
        let of_prior = own + 4.0 * (east + north);
        let steps = sums.into_iter();
        steps
            .map(|lanes| lanes.map(|sum| 1.0 / (sum + of_prior)))
            .collect()
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

    fn find_slope(&mut self, problem: &Linearised<LANES>, images: &[[f64; LANES]]) {
        self.rows
            .there_and_back(images, &mut self.slope, |l, mut straight_db| {
                let (scale, data) = (&problem.scale[l], &problem.data[l]);
                for lane in 0..LANES {
                    straight_db[lane] =
                        scale[lane] * (scale[lane] * straight_db[lane] - data[lane]);
                }
                straight_db
            });
        let (own, east, north) = self.precisions();
        let constant = self.sparse.sparsity * self.grid.dx_m() * self.grid.dy_m();
        let (columns, rows) = (self.grid.columns, self.grid.rows);
        for row in 0..rows {
            for column in 0..columns {
                let here = row * columns + column;
                let lanes = self.slope[here].iter_mut().zip(&images[here]);
                lanes.for_each(|(slope, value)| *slope += constant + own * value);
                if column + 1 < columns {
                    self.flow(images, [here, here + 1], east);
                }
                if row + 1 < rows {
                    self.flow(images, [here, here + columns], north);
                }
            }
        }
    }

    /// Adds the slope of the square of the difference between two pixels.
    #[inline]
    fn flow(&mut self, images: &[[f64; LANES]], [from, to]: [usize; 2], precision: f64) {
        let lanes = images[from].iter().zip(&images[to]).enumerate();
        for (lane, (from_value, to_value)) in lanes {
            let flow = precision * (from_value - to_value);
            self.slope[from][lane] += flow;
            self.slope[to][lane] -= flow;
        }
    }
}
