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

/// The dual variables of several images, a lane for each, and memory that one step after another uses again.
#[derive(Clone, Debug)]
pub(super) struct PrimalDual<'a, const LANES: usize> {
    rows: &'a WeightRows,
    grid: &'a PixelGrid,
    variation: Variation,
    /// Sum of each row of the weights.
    row_sums: Vec<f64>,
    links: Vec<[f64; LANES]>,
    /// Of the differences from west to east and from south to north.
    edges: Vec<[[f64; LANES]; 2]>,
    ahead: Vec<[f64; LANES]>,
    back: Vec<[f64; LANES]>,
}

impl<'a, const LANES: usize> PrimalDual<'a, LANES> {
    pub(super) fn new(
        rows: &'a WeightRows,
        grid: &'a PixelGrid,
        variation: Variation,
    ) -> PrimalDual<'a, LANES> {
        let (links, pixels) = (rows.len(), grid.len());
        let mut row_sums = vec![0.0; links];
        rows.forward(&vec![1.0; pixels], &mut row_sums);
        PrimalDual {
            rows,
            grid,
            variation,
            row_sums,
            links: vec![[0.0; LANES]; links],
            edges: vec![[[0.0; LANES]; 2]; pixels],
            ahead: vec![[0.0; LANES]; pixels],
            back: vec![[0.0; LANES]; pixels],
        }
    }

    /// Changes the weights; the variables stay.
    pub(super) fn set_variation(&mut self, variation: Variation) {
        self.variation = variation;
    }

    /// Takes some steps towards the solutions of linear problems.
    pub(super) fn improve(
        &mut self,
        problem: &Linearised<LANES>,
        images: &mut [[f64; LANES]],
        steps: usize,
    ) {
        let grid = *self.grid;
        self.rows
            .there_and_back(images, &mut self.back, |l, _| problem.scale[l]);
        let of_edges = 2.0 * (grid.dx_m() + grid.dy_m());
        let columns = self.back.iter();
        let image_steps: Vec<[f64; LANES]> = columns
            .map(|lanes| lanes.map(|column| 1.0 / (column + of_edges)))
            .collect();
        let edge_step = 1.0 / (2.0 * grid.dx_m().max(grid.dy_m()));
        self.ahead.copy_from_slice(images);
        for _ in 0..steps {
            self.step_links(problem);
            self.step_edges(edge_step);
            self.step_images(&image_steps, images);
        }
    }

    /// Moves the dual variables of the links, and leaves Wᵀ of them in `back`.
    fn step_links(&mut self, problem: &Linearised<LANES>) {
        let (duals, row_sums) = (&mut self.links, &self.row_sums);
        self.rows
            .there_and_back(&self.ahead, &mut self.back, |l, straight_db| {
                let (scale, data) = (&problem.scale[l], &problem.data[l]);
                let dual = &mut duals[l];
                let mut back = [0.0; LANES];
                for lane in 0..LANES {
                    if scale[lane] <= 0.0 {
                        dual[lane] = 0.0;
                        continue;
                    }
                    let step = 1.0 / (scale[lane] * row_sums[l]).max(1e-9);
                    let off = scale[lane] * straight_db[lane] - data[lane];
                    dual[lane] = (dual[lane] + step * off) / (1.0 + step);
                    back[lane] = scale[lane] * dual[lane];
                }
                back
            });
    }

    fn step_edges(&mut self, step: f64) {
        let (columns, rows) = (self.grid.columns, self.grid.rows);
        let (east, north) = (self.grid.dy_m() * step, self.grid.dx_m() * step);
        let most = self.variation.weight;
        for row in 0..rows {
            for column in 0..columns {
                let here = row * columns + column;
                let values = self.ahead[here];
                // A lane is drawn to itself where there is no neighbour.
                let right = if column + 1 < columns { here + 1 } else { here };
                let above = if row + 1 < rows { here + columns } else { here };
                let (to_right, to_above) = (self.ahead[right], self.ahead[above]);
                let [x, y] = &mut self.edges[here];
                for lane in 0..LANES {
                    x[lane] += east * (to_right[lane] - values[lane]);
                    y[lane] += north * (to_above[lane] - values[lane]);
                    let size = (x[lane] * x[lane] + y[lane] * y[lane]).sqrt();
                    let share = if size > most { most / size } else { 1.0 };
                    x[lane] *= share;
                    y[lane] *= share;
                }
            }
        }
    }

    fn step_images(&mut self, steps: &[[f64; LANES]], images: &mut [[f64; LANES]]) {
        let (columns, rows) = (self.grid.columns, self.grid.rows);
        let (dx_m, dy_m) = (self.grid.dx_m(), self.grid.dy_m());
        let constant = self.variation.sparsity * dx_m * dy_m;
        for row in 0..rows {
            for column in 0..columns {
                let here = row * columns + column;
                let [x, y] = &self.edges[here];
                let before = match column {
                    0 => [0.0; LANES],
                    _ => self.edges[here - 1][0],
                };
                let below = match row {
                    0 => [0.0; LANES],
                    _ => self.edges[here - columns][1],
                };
                let (back, image, steps) = (&self.back[here], &mut images[here], &steps[here]);
                let ahead = &mut self.ahead[here];
                for lane in 0..LANES {
                    let slope = back[lane] + constant
                        - dy_m * (x[lane] - before[lane])
                        - dx_m * (y[lane] - below[lane]);
                    let next = (image[lane] - steps[lane] * slope).max(0.0);
                    ahead[lane] = 2.0 * next - image[lane];
                    image[lane] = next;
                }
            }
        }
    }
}
