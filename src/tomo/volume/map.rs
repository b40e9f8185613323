//! The most probable volume under a smooth prior with robust noise, as the solver `map` does it for pixels, by the links:
//!
//! ```text
//!   K = W C Wᵀ + H B Hᵀ + S        x = C Wᵀ K⁻¹ y        C = σ² exp(−r / δ)
//! ```
//!
//! H, B = what the path loss leaves open and its variances; S = noise of the links, made larger for those that contradict the volume (Student-t). Time grows with the cube of the links.

use super::VoxelGrid;
use crate::tomo::cholesky::Cholesky;
use crate::tomo::map_solver::Nuisance;
use crate::tomo::prior::Prior;
use crate::tomo::progress::ImagingStep;
use crate::tomo::solvers::{LinkProblem, Solved};
use crate::tomo::student::doubted;
use crate::tomo::weights::WeightRows;

/// Rounds of robust weights.
const ROUNDS: usize = 6;

/// Solves; `None` when the numbers of the links leave no answer.
pub(super) fn solve(problem: &LinkProblem<'_>, grid: &VoxelGrid, prior: Prior) -> Option<Solved> {
    let (rows, links) = (problem.projector.rows(), problem.observations);
    let covariance = Covariance::new(grid, prior);
    let gram = gram(rows, &covariance);
    let mut noise_db2: Vec<f64> = links.iter().map(|link| link.variance_db2).collect();
    let mut dual = vec![0.0; links.len()];
    let mut residual_db = vec![0.0; links.len()];
    for done in 0..ROUNDS {
        problem
            .watch
            .tell(ImagingStep::Solving { done, of: ROUNDS });
        let open_db2 = |i: usize, j: usize| -> f64 {
            let of = |one: &Nuisance| one.variance * one.column[i] * one.column[j];
            problem.nuisance.iter().map(of).sum()
        };
        let entry = |i: usize, j: usize| {
            gram[i][j] + open_db2(i, j) + if i == j { noise_db2[i] } else { 0.0 }
        };
        let factor = Cholesky::of(links.len(), entry)?;
        dual = links.iter().map(|link| link.attenuation_db).collect();
        factor.solve(&mut dual);
        // What is left of y is S α; volumes do not ask what the path loss was found to be.
        residual_db = noise_db2
            .iter()
            .zip(&dual)
            .map(|(s2, dual)| s2 * dual)
            .collect();
        for ((noise, rest), link) in noise_db2.iter_mut().zip(&residual_db).zip(links) {
            *noise = doubted(link.variance_db2, *rest);
        }
    }
    let mut weighted = vec![0.0; grid.voxels()];
    rows.backward(&dual, &mut weighted);
    Some(Solved {
        image: covariance.times(&weighted),
        residual_db,
        noise_db2,
        nuisance: Vec::new(),
        dual,
        choice: None,
        are_persons_drawn: false,
    })
}

/// Returns W C Wᵀ, row by row up to the diagonal.
fn gram(rows: &WeightRows, covariance: &Covariance) -> Vec<Vec<f64>> {
    let mut spread = vec![0.0; covariance.grid.voxels()];
    let row_to_diagonal = |i: usize| {
        spread.fill(0.0);
        covariance.add(rows.row(i), &mut spread);
        let product = |other: usize| -> f64 {
            let lengths = rows.row(other);
            lengths
                .map(|(voxel, length_m)| spread[voxel] * length_m)
                .sum()
        };
        (0..=i).map(product).collect()
    };
    (0..rows.len()).map(row_to_diagonal).collect()
}

/// C, by how many voxels two lie apart along each axis.
struct Covariance {
    grid: VoxelGrid,
    table: Vec<f64>,
}

impl Covariance {
    fn new(grid: &VoxelGrid, prior: Prior) -> Covariance {
        let value = |index: usize| {
            let apart = grid.place(index);
            let [x_m, y_m, z_m] = [0, 1, 2].map(|axis| apart[axis] as f64 * grid.side_m(axis));
            let apart_m = (x_m * x_m + y_m * y_m + z_m * z_m).sqrt();
            prior.variance * libm::exp(-apart_m / prior.length_m)
        };
        Covariance {
            grid: *grid,
            table: (0..grid.voxels()).map(value).collect(),
        }
    }

    /// Adds C w.
    fn add(&self, sparse: impl Iterator<Item = (usize, f64)>, output: &mut [f64]) {
        let [columns, rows, layers] = self.grid.counts;
        for (voxel, weight) in sparse {
            let [column, row, layer] = self.grid.place(voxel);
            for other_layer in 0..layers {
                for other_row in 0..rows {
                    let apart = [0, row.abs_diff(other_row), layer.abs_diff(other_layer)];
                    let near = &self.table[self.grid.index(apart)..][..columns];
                    let first = self.grid.index([0, other_row, other_layer]);
                    let line = &mut output[first..first + columns];
                    for (other, value) in line.iter_mut().enumerate() {
                        *value += weight * near[column.abs_diff(other)];
                    }
                }
            }
        }
    }

    /// Returns C v.
    fn times(&self, values: &[f64]) -> Vec<f64> {
        let mut output = vec![0.0; values.len()];
        let weights = values.iter().copied().enumerate();
        self.add(weights.filter(|(_, weight)| *weight != 0.0), &mut output);
        output
    }
}
