//! The other classical reference: the least-squares image of the large singular values of W alone.
//!
//! ```text
//!   x = Σ_{s_i > share · s_1} v_i (u_iᵀ y) / s_i
//! ```
//!
//! By Lanczos' method on Wᵀ W from Wᵀ y, with full reorthogonalisation: only what the data excite is ever needed, so the
//! matrix is not decomposed. All links weigh the same. Not meant for daily use.

use super::cholesky::dot;
use super::weights::WeightRows;

/// Most singular values that are looked at.
pub(super) const MOST_VALUES: usize = 300;
/// Rounds in which one eigenvalue is isolated.
const MOST_ROUNDS: usize = 60;

/// Returns the image, dB/m, of the singular values above a share of the largest one.
pub fn tsvd(rows: &WeightRows, pixels: usize, attenuation_db: &[f64], share: f64) -> Vec<f64> {
    let mut start = vec![0.0; pixels];
    rows.backward(attenuation_db, &mut start);
    let size = dot(&start, &start).sqrt();
    let mut image = vec![0.0; pixels];
    if size <= 0.0 {
        return image;
    }
    let (basis, diagonal, beside) = lanczos(rows, &start, size);
    let (values, firsts, vectors) = eigen(diagonal, beside);
    let largest = values.iter().copied().fold(0.0, f64::max);
    for (k, value) in values.iter().enumerate() {
        if *value <= share * share * largest {
            continue;
        }
        let factor = size * firsts[k] / value;
        for (row, of_basis) in basis.iter().enumerate() {
            let factor = factor * vectors[row][k];
            image
                .iter_mut()
                .zip(of_basis)
                .for_each(|(pixel, of)| *pixel += factor * of);
        }
    }
    image
}

/// Returns an orthonormal basis, and the diagonal and the side diagonal of Wᵀ W in it.
fn lanczos(rows: &WeightRows, start: &[f64], size: f64) -> (Vec<Vec<f64>>, Vec<f64>, Vec<f64>) {
    let mut links = vec![0.0; rows.len()];
    let mut basis: Vec<Vec<f64>> = vec![start.iter().map(|value| value / size).collect()];
    let (mut diagonal, mut beside) = (Vec::new(), Vec::new());
    let mut next = vec![0.0; start.len()];
    loop {
        let newest = &basis[basis.len() - 1];
        rows.forward(newest, &mut links);
        rows.backward(&links, &mut next);
        diagonal.push(dot(newest, &next));
        let scale = diagonal[0];
        // Twice is enough (Kahan and Parlett).
        for _ in 0..2 {
            for known in &basis {
                let share = dot(known, &next);
                next.iter_mut()
                    .zip(known)
                    .for_each(|(value, of)| *value -= share * of);
            }
        }
        let rest = dot(&next, &next).sqrt();
        if basis.len() >= MOST_VALUES.min(start.len()) || rest <= 1e-10 * scale {
            return (basis, diagonal, beside);
        }
        beside.push(rest);
        basis.push(next.iter().map(|value| value / rest).collect());
    }
}

/// Returns the eigenvalues of a symmetric tridiagonal matrix, the first component of each eigenvector, and all components
/// (rows = components, columns = vectors), by the QL method with implicit shifts (Bowdler and others 1968, tql2).
fn eigen(mut diagonal: Vec<f64>, mut beside: Vec<f64>) -> (Vec<f64>, Vec<f64>, Vec<Vec<f64>>) {
    let size = diagonal.len();
    beside.push(0.0);
    let mut vectors: Vec<Vec<f64>> = (0..size)
        .map(|row| (0..size).map(|k| f64::from(u8::from(row == k))).collect())
        .collect();
    for low in 0..size {
        for _ in 0..MOST_ROUNDS {
            let is_split = |k: usize| {
                beside[k].abs() <= f64::EPSILON * (diagonal[k].abs() + diagonal[k + 1].abs())
            };
            let high = (low..size - 1).find(|k| is_split(*k)).unwrap_or(size - 1);
            if high == low {
                break;
            }
            chase(&mut diagonal, &mut beside, &mut vectors, low, high);
        }
    }
    let firsts = vectors[0].clone();
    (diagonal, firsts, vectors)
}

/// One implicit QL step between two places where the matrix falls apart.
fn chase(d: &mut [f64], e: &mut [f64], vectors: &mut [Vec<f64>], low: usize, high: usize) {
    let half = (d[low + 1] - d[low]) / (2.0 * e[low]);
    let root = (half * half + 1.0).sqrt().copysign(half);
    let mut g = d[high] - d[low] + e[low] / (half + root);
    let (mut sine, mut cosine, mut p) = (1.0, 1.0, 0.0);
    for k in (low..high).rev() {
        let f = sine * e[k];
        let b = cosine * e[k];
        let r = (f * f + g * g).sqrt();
        e[k + 1] = r;
        if r <= 0.0 {
            d[k + 1] -= p;
            e[high] = 0.0;
            return;
        }
        (sine, cosine) = (f / r, g / r);
        g = d[k + 1] - p;
        let turned = (d[k] - g) * sine + 2.0 * cosine * b;
        p = sine * turned;
        d[k + 1] = g + p;
        g = cosine * turned - b;
        for row in vectors.iter_mut() {
            let (one, other) = (row[k + 1], row[k]);
            row[k + 1] = sine * other + cosine * one;
            row[k] = cosine * other - sine * one;
        }
    }
    d[low] -= p;
    e[low] = g;
    e[high] = 0.0;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{PixelGrid, Point, Rect, Segment};
    use crate::tomo::WeightModel;
    use nalgebra::{DMatrix, DVector};

    fn rows() -> (WeightRows, PixelGrid) {
        let grid = PixelGrid {
            area: Rect::new(Point::new(0.0, 0.0), Point::new(6.0, 5.0)),
            columns: 8,
            rows: 6,
        };
        let at = |k: i32| {
            let angle = f64::from(k) * 0.51;
            Point::new(3.0 + 3.0 * angle.cos(), 2.5 + 2.5 * angle.sin())
        };
        let links = (0..70).map(|k| Segment::new(at(k), at(k * 3 + 4)));
        let long = links.filter(|link| link.length_m() > 1.0);
        (WeightRows::rescaled(long, &grid, WeightModel::Line), grid)
    }

    #[test]
    fn it_is_the_dense_truncated_decomposition() {
        let (rows, grid) = rows();
        let mut dense = DMatrix::zeros(rows.len(), grid.len());
        for row in 0..rows.len() {
            rows.row(row)
                .for_each(|(pixel, weight)| dense[(row, pixel)] = weight);
        }
        let y: Vec<f64> = (0..rows.len()).map(|k| ((k * 29) % 13) as f64).collect();
        let parts = dense.svd(true, true);
        let (u, v) = (parts.u.unwrap(), parts.v_t.unwrap());
        let largest = parts.singular_values.max();
        for share in [0.5, 0.2, 0.1] {
            let mut expected = DVector::zeros(grid.len());
            for (k, value) in parts.singular_values.iter().enumerate() {
                if *value > share * largest {
                    let part = u.column(k).dot(&DVector::from_column_slice(&y)) / value;
                    expected += v.row(k).transpose() * part;
                }
            }
            let got = DVector::from_vec(tsvd(&rows, grid.len(), &y, share));
            let error = (got - &expected).norm() / expected.norm();
            assert!(error < 1e-6, "{share}: {error}");
        }
    }

    #[test]
    fn no_attenuation_gives_an_empty_image() {
        let (rows, grid) = rows();
        let image = tsvd(&rows, grid.len(), &vec![0.0; rows.len()], 0.1);
        assert!(image.iter().all(|value| *value == 0.0));
    }
}
