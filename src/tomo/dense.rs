//! Dense symmetric matrices of up to a few thousand rows: Cholesky factor and inverse.
//!
//! All of it adds multiples of four rows to another, in a fixed order, so that results are the same on every machine, with
//! wide registers or without; and to a block of rows that stays in a core's own memory, since the time goes into memory
//! otherwise. Smaller systems that grow row by row are [`super::cholesky`]'s.

use std::ops::Range;

use multiversion::multiversion;

/// A square matrix of which the lower triangle counts, row after row.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct LowerTriangle {
    rows: usize,
    values: Vec<f64>,
}

/// Rows that are added together.
const PANEL: usize = 4;
/// Rows that others are read once for: of 4,000 columns they are half a megabyte.
const BLOCK: usize = 4 * PANEL;

impl LowerTriangle {
    /// Makes a matrix of `entry(i, j)`, told for j ≤ i.
    pub(super) fn of(rows: usize, entry: impl Fn(usize, usize) -> f64) -> LowerTriangle {
        let mut values = vec![0.0; rows * rows];
        for (i, row) in values.chunks_exact_mut(rows.max(1)).enumerate() {
            row[..=i]
                .iter_mut()
                .enumerate()
                .for_each(|(j, value)| *value = entry(i, j));
        }
        LowerTriangle { rows, values }
    }

    /// Returns row i up to its diagonal.
    pub(super) fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.rows..=i * self.rows + i]
    }

    /// Returns row i up to its diagonal, to be changed.
    pub(super) fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.values[i * self.rows..=i * self.rows + i]
    }

    /// Turns a symmetric positive definite matrix A = L Lᵀ into L; `None` when it is not positive definite.
    pub(super) fn factor(mut self) -> Option<LowerTriangle> {
        // Rows of Lᵀ are what is added; they stand above the diagonal meanwhile.
        let rows = self.rows;
        self.mirror(|above, below| *above = *below);
        for first in (0..rows).step_by(BLOCK) {
            let (known, rest) = self.values.split_at_mut(first * rows);
            let block = &mut rest[..BLOCK.min(rows - first) * rows];
            for four in known.chunks_exact(PANEL * rows) {
                for (own, row) in block.chunks_exact_mut(rows).enumerate() {
                    let factor = |k: usize| -four[k * rows + first + own];
                    add_rows(row, four, first..rows, factor);
                }
            }
            for own in 0..block.len() / rows {
                let (above, rest) = block.split_at_mut(own * rows);
                let (i, row) = (first + own, &mut rest[..rows]);
                add_rows(row, above, i..rows, |k| -above[k * rows + i]);
                let left = row[i];
                if !(left > 0.0 && left.is_finite()) {
                    return None;
                }
                let diagonal = left.sqrt();
                row[i] = diagonal;
                row[i + 1..].iter_mut().for_each(|value| *value /= diagonal);
            }
        }
        self.mirror(|above, below| (*below, *above) = (*above, 0.0));
        Some(self)
    }

    /// Does something with each entry above the diagonal and that below it; tile by tile, since those lie far apart.
    fn mirror(&mut self, change: impl Fn(&mut f64, &mut f64)) {
        let rows = self.rows;
        for first in (0..rows).step_by(BLOCK) {
            for left in (0..=first).step_by(BLOCK) {
                for i in first..rows.min(first + BLOCK) {
                    let (known, rest) = self.values.split_at_mut(i * rows);
                    for j in left..i.min(left + BLOCK) {
                        change(&mut known[j * rows + i], &mut rest[j]);
                    }
                }
            }
        }
    }

    /// Turns a lower triangular matrix L with a positive diagonal into L⁻¹.
    pub(super) fn inverse_of_factor(mut self) -> LowerTriangle {
        let rows = self.rows;
        let mut factor = Vec::with_capacity(BLOCK * rows);
        for first in (0..rows).step_by(BLOCK) {
            let (known, rest) = self.values.split_at_mut(first * rows);
            let block = &mut rest[..BLOCK.min(rows - first) * rows];
            factor.clear();
            factor.extend_from_slice(block);
            block.fill(0.0);
            for (panel, four) in known.chunks_exact(PANEL * rows).enumerate() {
                let k = panel * PANEL;
                for (row, of_row) in block.chunks_exact_mut(rows).zip(factor.chunks_exact(rows)) {
                    add_rows(row, four, 0..k + PANEL, |own| of_row[k + own]);
                }
            }
            for (own, of_row) in factor.chunks_exact(rows).enumerate() {
                let (above, rest) = block.split_at_mut(own * rows);
                let (i, row) = (first + own, &mut rest[..rows]);
                add_rows(row, above, 0..i, |k| of_row[first + k]);
                row[..i].iter_mut().for_each(|value| *value /= -of_row[i]);
                row[i] = 1.0 / of_row[i];
            }
        }
        self
    }

    /// Returns Mᵀ M of a lower triangular matrix M.
    pub(super) fn gram(&self) -> LowerTriangle {
        let rows = self.rows;
        let mut values = vec![0.0; rows * rows];
        for (index, block) in values.chunks_mut(BLOCK * rows.max(1)).enumerate() {
            let first = index * BLOCK;
            let below = &self.values[first * rows..];
            for four in below.chunks(PANEL * rows) {
                for (own, row) in block.chunks_exact_mut(rows).enumerate() {
                    let i = first + own;
                    add_rows(row, four, 0..i + 1, |k| four[k * rows + i]);
                }
            }
        }
        LowerTriangle { rows, values }
    }

    /// Returns the diagonal of Mᵀ M of a lower triangular matrix M.
    pub(super) fn gram_diagonal(&self) -> Vec<f64> {
        let mut squares = vec![0.0; self.rows];
        for i in 0..self.rows {
            squares
                .iter_mut()
                .zip(self.row(i))
                .for_each(|(square, value)| *square += value * value);
        }
        squares
    }
}

/// Adds other rows to one, each times its factor: the columns of a range, four rows at a time.
fn add_rows(to: &mut [f64], others: &[f64], columns: Range<usize>, factor: impl Fn(usize) -> f64) {
    let length = to.len();
    let to = &mut to[columns.clone()];
    let row = |k: usize| &others[k * length + columns.start..k * length + columns.end];
    let count = others.len() / length;
    let whole = count / PANEL * PANEL;
    for k in (0..whole).step_by(PANEL) {
        let four = [row(k), row(k + 1), row(k + 2), row(k + 3)];
        let factors = [factor(k), factor(k + 1), factor(k + 2), factor(k + 3)];
        add_four(to, four, factors);
    }
    for k in whole..count {
        let factor = factor(k);
        to.iter_mut()
            .zip(row(k))
            .for_each(|(to, value)| *to += factor * value);
    }
}

/// Adds the beginnings of four rows, each times its factor. (Compiled for wide registers too, which change no bit.)
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn add_four(to: &mut [f64], rows: [&[f64]; PANEL], factors: [f64; PANEL]) {
    let length = to.len();
    let [w, x, y, z] = rows.map(|row| &row[..length]);
    let [a, b, c, d] = factors;
    for k in 0..length {
        to[k] += (a * w[k] + b * x[k]) + (c * y[k] + d * z[k]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    fn matrix(rows: usize) -> DMatrix<f64> {
        let any = DMatrix::from_fn(rows, rows, |i, j| {
            ((i * 7 + j * 13) % 11) as f64 / 11.0 - 0.5
        });
        &any * any.transpose() + DMatrix::identity(rows, rows) * 0.3
    }

    #[test]
    fn the_factor_and_the_inverse_are_those_of_a_dense_solver() {
        for rows in [1, 2, 3, 4, 5, 7, 8, 9, 33, 50] {
            let a = matrix(rows);
            let factor = LowerTriangle::of(rows, |i, j| a[(i, j)]).factor().unwrap();
            let expected = a.clone().cholesky().unwrap().l();
            let inverse = a.try_inverse().unwrap();
            let half = factor.clone().inverse_of_factor();
            let whole = half.gram();
            let diagonal = half.gram_diagonal();
            for i in 0..rows {
                for j in 0..=i {
                    assert!(
                        (factor.row(i)[j] - expected[(i, j)]).abs() < 1e-10,
                        "{rows} {i} {j}"
                    );
                    assert!(
                        (whole.row(i)[j] - inverse[(i, j)]).abs() < 1e-9,
                        "{rows} {i} {j}"
                    );
                }
                assert!((diagonal[i] - inverse[(i, i)]).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_has_no_factor() {
        let of = |diagonal: f64, other: f64| {
            LowerTriangle::of(6, |i, j| if i == j { diagonal } else { other }).factor()
        };
        assert!(of(1.0, 1.5).is_none() && of(f64::NAN, 0.0).is_none() && of(0.0, 0.0).is_none());
        assert!(of(1.0, 0.5).is_some());
    }
}
