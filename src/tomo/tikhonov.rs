//! The classical reference: minimise |W x − y|² + α |D x|², D the differences of neighbouring pixels.
//!
//! Conjugate gradients on the normal equations; all links weigh the same. Not meant for daily use.

use crate::geom::PixelGrid;

use super::weights::WeightRows;

const TOLERANCE: f64 = 1e-6;
const MOST_STEPS: usize = 500;
/// Keeps pixels that no link sees, and the constant image, determined.
const RIDGE: f64 = 1e-9;

/// Returns the image, dB/m; `alpha_m2` is α, m².
pub fn tikhonov(
    rows: &WeightRows,
    grid: &PixelGrid,
    attenuation_db: &[f64],
    alpha_m2: f64,
) -> Vec<f64> {
    let mut right = vec![0.0; grid.len()];
    rows.backward(attenuation_db, &mut right);
    let mut image = vec![0.0; grid.len()];
    let mut product = vec![0.0; grid.len()];
    let mut links = vec![0.0; rows.len()];
    let mut direction = right.clone();
    let mut square = dot(&right, &right);
    let goal = TOLERANCE * TOLERANCE * square;
    for _ in 0..MOST_STEPS {
        if square <= goal || square <= f64::MIN_POSITIVE {
            break;
        }
        rows.forward(&direction, &mut links);
        rows.backward(&links, &mut product);
        add_roughness(grid, &direction, alpha_m2, &mut product);
        let length = square / dot(&direction, &product);
        image
            .iter_mut()
            .zip(&direction)
            .for_each(|(image, step)| *image += length * step);
        right
            .iter_mut()
            .zip(&product)
            .for_each(|(right, product)| *right -= length * product);
        let next = dot(&right, &right);
        direction
            .iter_mut()
            .zip(&right)
            .for_each(|(step, right)| *step = right + next / square * *step);
        square = next;
    }
    image
}

/// Adds α Dᵀ D x, and the ridge.
fn add_roughness(grid: &PixelGrid, image: &[f64], alpha_m2: f64, output: &mut [f64]) {
    let mut join = |a: usize, b: usize| {
        let flow = alpha_m2 * (image[a] - image[b]);
        output[a] += flow;
        output[b] -= flow;
    };
    for pixel in 0..grid.len() {
        if (pixel + 1) % grid.columns != 0 {
            join(pixel, pixel + 1);
        }
        if pixel + grid.columns < grid.len() {
            join(pixel, pixel + grid.columns);
        }
    }
    output
        .iter_mut()
        .zip(image)
        .for_each(|(output, value)| *output += RIDGE * alpha_m2 * value);
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Point, Rect, Segment};
    use crate::tomo::WeightModel;
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn the_image_solves_the_normal_equations() {
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(4.0, 3.0));
        let grid = PixelGrid {
            area,
            columns: 8,
            rows: 6,
        };
        let links: Vec<Segment> = (0..30)
            .map(|k| {
                let far = Point::new(4.0, 3.0 - f64::from(k * 7 % 30) / 10.0);
                Segment::new(Point::new(f64::from(k) / 10.0, 0.0), far)
            })
            .collect();
        let rows = WeightRows::rescaled(links, &grid, WeightModel::Line);
        let y: Vec<f64> = (0..30).map(|k| f64::from(k * 11 % 7)).collect();
        let image = tikhonov(&rows, &grid, &y, 2.0);

        let w = DMatrix::from_fn(30, 48, |row, pixel| {
            rows.row(row)
                .filter(|(at, _)| *at == pixel)
                .map(|(_, weight)| weight)
                .sum::<f64>()
        });
        let mut d = DMatrix::<f64>::zeros(2 * 48, 48);
        for pixel in 0..48 {
            if pixel % 8 != 7 {
                (d[(pixel, pixel)], d[(pixel, pixel + 1)]) = (1.0, -1.0);
            }
            if pixel + 8 < 48 {
                (d[(48 + pixel, pixel)], d[(48 + pixel, pixel + 8)]) = (1.0, -1.0);
            }
        }
        let a = w.transpose() * &w + d.transpose() * &d * 2.0;
        let expected = a
            .lu()
            .solve(&(w.transpose() * DVector::from_vec(y)))
            .unwrap();
        let error = (DVector::from_vec(image) - &expected).norm() / expected.norm();
        assert!(error < 1e-4, "{error}");
    }
}
