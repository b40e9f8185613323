//! A non-negative image that is flat but for edges, and empty where nothing speaks against it:
//!
//! ```text
//!   least of ½ |S W x − d|² + weight · ∫ |∇x| dA + sparsity · ∫ x dA,   x ≥ 0
//! ```
//!
//! By the primal-dual method of Chambolle and Pock with the diagonal preconditioning of Pock and Chambolle (2011, lemma 2 with
//! α = 1); no matrix is formed, and both variables stay for a warm start. The integrals make the weights independent of the
//! pixels.

use serde::{Deserialize, Serialize};

use super::robust::Linearised;
use crate::geom::PixelGrid;
use crate::tomo::weights::WeightRows;

/// How much edges and attenuation itself cost.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Variation {
    /// Of the total variation, 1/dB.
    pub weight: f64,
    /// Of the sum of attenuation, 1/(dB m).
    pub sparsity: f64,
}

/// The dual variables, and memory that one step after another uses again.
#[derive(Clone, Debug)]
pub(super) struct PrimalDual<'a> {
    rows: &'a WeightRows,
    grid: &'a PixelGrid,
    variation: Variation,
    /// Sum of each row of the weights.
    row_sums: Vec<f64>,
    links: Vec<f64>,
    /// Of the differences from west to east and from south to north.
    edges: Vec<(f64, f64)>,
    ahead: Vec<f64>,
    back: Vec<f64>,
}

impl<'a> PrimalDual<'a> {
    pub(super) fn new(
        rows: &'a WeightRows,
        grid: &'a PixelGrid,
        variation: Variation,
    ) -> PrimalDual<'a> {
        let (links, pixels) = (rows.len(), grid.len());
        let mut row_sums = vec![0.0; links];
        rows.forward(&vec![1.0; pixels], &mut row_sums);
        PrimalDual {
            rows,
            grid,
            variation,
            row_sums,
            links: vec![0.0; links],
            edges: vec![(0.0, 0.0); pixels],
            ahead: vec![0.0; pixels],
            back: vec![0.0; pixels],
        }
    }

    /// Changes the weights; the variables stay.
    pub(super) fn set_variation(&mut self, variation: Variation) {
        self.variation = variation;
    }

    /// Takes some steps towards the solution of a linear problem.
    pub(super) fn improve(&mut self, problem: &Linearised, image: &mut [f64], steps: usize) {
        let grid = *self.grid;
        self.rows.backward(&problem.scale, &mut self.back);
        let of_edges = 2.0 * (grid.dx_m() + grid.dy_m());
        let image_steps: Vec<f64> = self
            .back
            .iter()
            .map(|column| 1.0 / (column + of_edges))
            .collect();
        let edge_step = 1.0 / (2.0 * grid.dx_m().max(grid.dy_m()));
        self.ahead.copy_from_slice(image);
        for _ in 0..steps {
            self.step_links(problem);
            self.step_edges(edge_step);
            self.step_image(&image_steps, image);
        }
    }

    /// Moves the dual variables of the links, and leaves Wᵀ of them in `back`.
    fn step_links(&mut self, problem: &Linearised) {
        let (duals, row_sums) = (&mut self.links, &self.row_sums);
        self.rows
            .there_and_back(&self.ahead, &mut self.back, |l, straight_db| {
                let scale = problem.scale[l];
                if scale <= 0.0 {
                    duals[l] = 0.0;
                    return 0.0;
                }
                let step = 1.0 / (scale * row_sums[l]).max(1e-9);
                let off = scale * straight_db - problem.data[l];
                duals[l] = (duals[l] + step * off) / (1.0 + step);
                scale * duals[l]
            });
    }

    fn step_edges(&mut self, step: f64) {
        let (columns, rows) = (self.grid.columns, self.grid.rows);
        let (east, north) = (self.grid.dy_m() * step, self.grid.dx_m() * step);
        let most = self.variation.weight;
        for row in 0..rows {
            for column in 0..columns {
                let here = row * columns + column;
                let value = self.ahead[here];
                let (mut x, mut y) = self.edges[here];
                if column + 1 < columns {
                    x += east * (self.ahead[here + 1] - value);
                }
                if row + 1 < rows {
                    y += north * (self.ahead[here + columns] - value);
                }
                let size = (x * x + y * y).sqrt();
                let share = if size > most { most / size } else { 1.0 };
                self.edges[here] = (x * share, y * share);
            }
        }
    }

    fn step_image(&mut self, steps: &[f64], image: &mut [f64]) {
        let (columns, rows) = (self.grid.columns, self.grid.rows);
        let (dx_m, dy_m) = (self.grid.dx_m(), self.grid.dy_m());
        let constant = self.variation.sparsity * dx_m * dy_m;
        for row in 0..rows {
            for column in 0..columns {
                let here = row * columns + column;
                let (x, y) = self.edges[here];
                let mut slope = self.back[here] + constant - dy_m * x - dx_m * y;
                if column > 0 {
                    slope += dy_m * self.edges[here - 1].0;
                }
                if row > 0 {
                    slope += dx_m * self.edges[here - columns].1;
                }
                let next = (image[here] - steps[here] * slope).max(0.0);
                self.ahead[here] = 2.0 * next - image[here];
                image[here] = next;
            }
        }
    }
}
