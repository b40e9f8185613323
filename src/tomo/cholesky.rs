//! The Cholesky factor of a symmetric positive definite matrix, A = L Lᵀ, which grows row by row. The order of sums is
//! fixed, so that results are the same on every machine.

/// The lower triangle L of the rows so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Cholesky {
    /// Row after row, each up to its diagonal.
    packed: Vec<f64>,
    rows: usize,
}

impl Cholesky {
    /// Makes the factor of a matrix without rows.
    pub(super) fn new() -> Cholesky {
        Cholesky::default()
    }

    /// Factorizes a matrix of which `entry(i, j)` is told for j ≤ i; `None` when it is not positive definite.
    pub(super) fn of(rows: usize, entry: impl Fn(usize, usize) -> f64) -> Option<Cholesky> {
        let mut factor = Cholesky::new();
        factor.packed.reserve_exact(rows * (rows + 1) / 2);
        for i in 0..rows {
            let is_definite = factor.push((0..=i).map(|j| entry(i, j)));
            if !is_definite {
                return None;
            }
        }
        Some(factor)
    }

    /// Adds a row of the matrix: its entries up to the diagonal. Returns whether the matrix is still positive definite; if not,
    /// nothing is added.
    pub(super) fn push(&mut self, row: impl IntoIterator<Item = f64>) -> bool {
        let (first, rows) = (self.packed.len(), self.rows);
        self.packed.extend(row.into_iter().take(rows + 1));
        let (known, new) = self.packed.split_at_mut(first);
        let [entries @ .., diagonal] = new else {
            return false;
        };
        debug_assert_eq!(entries.len(), rows);
        let mut start = 0;
        let mut square = 0.0;
        for j in 0..rows {
            let earlier = &known[start..=start + j];
            start += j + 1;
            let value = (entries[j] - dot(&entries[..j], &earlier[..j])) / earlier[j];
            entries[j] = value;
            square += value * value;
        }
        let rest = *diagonal - square;
        if !(rest > 0.0 && rest.is_finite()) {
            self.packed.truncate(first);
            return false;
        }
        *diagonal = rest.sqrt();
        self.rows += 1;
        true
    }

    /// Turns b into A⁻¹ b.
    pub(super) fn solve(&self, b: &mut [f64]) {
        let mut start = 0;
        for i in 0..self.rows {
            let row = &self.packed[start..=start + i];
            b[i] = (b[i] - dot(&row[..i], &b[..i])) / row[i];
            start += i + 1;
        }
        for i in (0..self.rows).rev() {
            start -= i + 1;
            let row = &self.packed[start..=start + i];
            b[i] /= row[i];
            let solved = b[i];
            b[..i]
                .iter_mut()
                .zip(row)
                .for_each(|(value, entry)| *value -= entry * solved);
        }
    }
}

/// Returns the inner product, summed up in order.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Adds a multiple of some values to as many others.
pub(super) fn add_scaled(to: &mut [f64], values: &[f64], factor: f64) {
    to.iter_mut()
        .zip(values)
        .for_each(|(to, value)| *to += factor * value);
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    fn matrix(rows: usize) -> DMatrix<f64> {
        let any = DMatrix::from_fn(rows, rows, |i, j| {
            ((i * 7 + j * 13) % 11) as f64 / 11.0 - 0.5
        });
        &any * any.transpose() + DMatrix::identity(rows, rows) * 0.3
    }

    #[test]
    fn it_solves_as_a_dense_solver_does() {
        for rows in [1, 2, 7, 33] {
            let a = matrix(rows);
            let b = DVector::from_fn(rows, |i, _| (i as f64 * 0.7).sin());
            let expected = a.clone().lu().solve(&b).unwrap();
            let factor = Cholesky::of(rows, |i, j| a[(i, j)]).unwrap();
            let mut got: Vec<f64> = b.iter().copied().collect();
            factor.solve(&mut got);
            assert!((DVector::from_vec(got) - expected).amax() < 1e-10, "{rows}");
        }
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_is_refused() {
        assert!(Cholesky::of(2, |i, j| if i == j { 1.0 } else { 2.0 }).is_none());
        assert!(Cholesky::of(1, |_, _| f64::NAN).is_none());
        let mut factor = Cholesky::of(1, |_, _| 4.0).unwrap();
        assert!(!factor.push([2.0, 1.0]) && factor.push([2.0, 5.0]));
        let mut b = [4.0, 6.0];
        factor.solve(&mut b);
        assert_eq!(b, [0.5, 1.0]);
    }
}
