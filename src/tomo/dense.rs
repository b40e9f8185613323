//! Dense symmetric matrices of up to a few thousand rows: Cholesky factor and inverse.
//!
//! Sums are split into as many parts as there are lanes, in a fixed order, so that results are the same on every machine; four
//! rows are worked on at a time, since the time goes into memory otherwise. Smaller systems that grow row by row are
//! [`super::cholesky`]'s.

/// A square matrix of which the lower triangle counts, row after row.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct LowerTriangle {
    rows: usize,
    values: Vec<f64>,
}

/// Rows that are worked on together.
const PANEL: usize = 4;

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
        let rows = self.rows;
        for first in (0..rows).step_by(PANEL) {
            let (known, panel) = self.values.split_at_mut(first * rows);
            let panel_rows = PANEL.min(rows - first);
            for (j, earlier) in known.chunks_exact(rows).enumerate() {
                subtract_products(panel, panel_rows, rows, earlier, j);
            }
            if !factor_corner(panel, panel_rows, rows, first) {
                return None;
            }
        }
        Some(self)
    }

    /// Turns a lower triangular matrix L with a positive diagonal into L⁻¹.
    pub(super) fn inverse_of_factor(mut self) -> LowerTriangle {
        let rows = self.rows;
        for i in 0..rows {
            let (known, rest) = self.values.split_at_mut(i * rows);
            let row = &mut rest[..=i];
            let coefficients: Vec<f64> = row[..i].to_vec();
            let diagonal = row[i];
            row[..i].fill(0.0);
            for (first, four) in coefficients.chunks(PANEL).enumerate() {
                add_rows(&mut row[..i], known, rows, first * PANEL, four);
            }
            row[..i].iter_mut().for_each(|value| *value /= -diagonal);
            row[i] = 1.0 / diagonal;
        }
        self
    }

    /// Returns Mᵀ M of a lower triangular matrix M.
    pub(super) fn gram(&self) -> LowerTriangle {
        let rows = self.rows;
        let mut gram = LowerTriangle {
            rows,
            values: vec![0.0; rows * rows],
        };
        for first in (0..rows).step_by(PANEL) {
            let last = (first + PANEL).min(rows);
            for i in 0..last {
                let coefficients: Vec<f64> =
                    (first..last).map(|k| self.values[k * rows + i]).collect();
                let target = &mut gram.values[i * rows..=i * rows + i];
                add_rows(target, &self.values, rows, first, &coefficients);
            }
        }
        gram
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

/// Divides column j of a panel of rows out: entry j less the product of all entries before it with those of an earlier row.
fn subtract_products(panel: &mut [f64], panel_rows: usize, rows: usize, earlier: &[f64], j: usize) {
    let before = &earlier[..j];
    if panel_rows == PANEL {
        let (a, rest) = panel.split_at_mut(rows);
        let (b, rest) = rest.split_at_mut(rows);
        let (c, d) = rest.split_at_mut(rows);
        let products = four_dots([&a[..j], &b[..j], &c[..j], &d[..j]], before);
        for (row, product) in [a, b, c, d].into_iter().zip(products) {
            row[j] = (row[j] - product) / earlier[j];
        }
        return;
    }
    for row in panel.chunks_exact_mut(rows).take(panel_rows) {
        let [product, ..] = four_dots([&row[..j], &[], &[], &[]], before);
        row[j] = (row[j] - product) / earlier[j];
    }
}

/// Factorizes the corner in which a panel of rows meets itself; returns whether it is positive definite.
fn factor_corner(panel: &mut [f64], panel_rows: usize, rows: usize, first: usize) -> bool {
    for own in 0..panel_rows {
        let (known, rest) = panel.split_at_mut(own * rows);
        let row = &mut rest[..rows];
        for (other, earlier) in known.chunks_exact(rows).enumerate() {
            let j = first + other;
            let [product, ..] = four_dots([&row[..j], &[], &[], &[]], &earlier[..j]);
            row[j] = (row[j] - product) / earlier[j];
        }
        let i = first + own;
        let [square, ..] = four_dots([&row[..i], &[], &[], &[]], &row[..i]);
        let left = row[i] - square;
        if !(left > 0.0 && left.is_finite()) {
            return false;
        }
        row[i] = left.sqrt();
    }
    true
}

/// Returns the inner products of up to four rows with one; an empty row has none.
fn four_dots(rows: [&[f64]; 4], with: &[f64]) -> [f64; 4] {
    if rows.iter().any(|row| row.len() != with.len()) {
        return rows.map(|row| lanes_dot(row, &with[..row.len().min(with.len())]));
    }
    let [a, b, c, d] = rows.map(|row| &row[..with.len()]);
    let mut sums = [[0.0; 2]; 4];
    let whole = with.len() / 2 * 2;
    for k in (0..whole).step_by(2) {
        let w = [with[k], with[k + 1]];
        for (sum, row) in sums.iter_mut().zip([a, b, c, d]) {
            sum[0] += row[k] * w[0];
            sum[1] += row[k + 1] * w[1];
        }
    }
    let mut totals = sums.map(|[even, odd]| even + odd);
    if let Some(last) = with.get(whole) {
        for (total, row) in totals.iter_mut().zip([a, b, c, d]) {
            *total += row[whole] * last;
        }
    }
    totals
}

/// Returns an inner product, summed up in the order of [`four_dots`].
fn lanes_dot(a: &[f64], b: &[f64]) -> f64 {
    let (mut even, mut odd) = (0.0, 0.0);
    let (a_pairs, b_pairs) = (a.chunks_exact(2), b.chunks_exact(2));
    let rest = a_pairs
        .remainder()
        .iter()
        .zip(b_pairs.remainder())
        .map(|(x, y)| x * y)
        .next();
    for (x, y) in a_pairs.zip(b_pairs) {
        even += x[0] * y[0];
        odd += x[1] * y[1];
    }
    even + odd + rest.unwrap_or(0.0)
}

/// Adds rows of a lower triangular matrix, from `first` on, each times its coefficient.
fn add_rows(target: &mut [f64], matrix: &[f64], rows: usize, first: usize, coefficients: &[f64]) {
    let row = |k: usize| &matrix[(first + k) * rows..(first + k + 1) * rows];
    let whole = target.len().min(first + 1);
    if let [a, b, c, d] = *coefficients {
        let (head, tail) = target.split_at_mut(whole);
        let four = row(0)[..whole]
            .iter()
            .zip(&row(1)[..whole])
            .zip(row(2)[..whole].iter().zip(&row(3)[..whole]));
        for (value, ((w, x), (y, z))) in head.iter_mut().zip(four) {
            *value += a * w + b * x + (c * y + d * z);
        }
        for (k, coefficient) in coefficients.iter().enumerate() {
            add_tail(tail, row(k), whole, first + k, *coefficient);
        }
        return;
    }
    for (k, coefficient) in coefficients.iter().enumerate() {
        add_tail(target, row(k), 0, first + k, *coefficient);
    }
}

/// Adds the entries of one row from a column on, up to its diagonal.
fn add_tail(target: &mut [f64], row: &[f64], from: usize, diagonal: usize, coefficient: f64) {
    if from <= diagonal {
        target
            .iter_mut()
            .zip(&row[from..=diagonal])
            .for_each(|(value, entry)| *value += coefficient * entry);
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
