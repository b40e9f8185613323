//! The classical reference: minimise |W x − y|² + α |D x|², D the differences of neighbouring pixels.
//!
//! Of pixels that are not square each square of a difference counts with their width across it over that along it, as in
//! ∫ |∇x|² dA, so that the image is as smooth in one direction as in the other.
//!
//! Conjugate gradients on the normal equations; all links weigh the same. Not meant for daily use.

use crate::geom::PixelGrid;

use super::box_grid::BoxGrid;
use super::cholesky::dot;
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
    smoothed(rows, &BoxGrid::of_pixels(grid), attenuation_db, alpha_m2)
}

/// Returns the image on pixels or voxels, dB/m; α is in m² of pixels, in m of voxels.
pub(super) fn smoothed(
    rows: &WeightRows,
    boxes: &BoxGrid,
    attenuation_db: &[f64],
    alpha: f64,
) -> Vec<f64> {
    let mut right = vec![0.0; boxes.len()];
    rows.backward(attenuation_db, &mut right);
    let mut image = vec![0.0; boxes.len()];
    let mut product = vec![0.0; boxes.len()];
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
        add_roughness(boxes, &direction, alpha, &mut product);
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
fn add_roughness(boxes: &BoxGrid, image: &[f64], alpha: f64, output: &mut [f64]) {
    let of_faces = boxes.of_faces(alpha);
    boxes.each_box(|here, next| {
        for (next, weight) in next.into_iter().zip(of_faces) {
            let Some(next) = next else { continue };
            let flow = weight * (image[here] - image[next]);
            output[here] += flow;
            output[next] -= flow;
        }
    });
    output
        .iter_mut()
        .zip(image)
        .for_each(|(output, value)| *output += RIDGE * alpha * value);
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
    #[test]
    fn an_image_of_flat_pixels_is_as_smooth_to_the_east_as_to_the_north() {
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(12.0, 12.0));
        let at = |k: i32| 0.6 + 1.2 * f64::from(k);
        let up = (0..10).map(|k| Segment::new(Point::new(at(k), 0.0), Point::new(at(k), 12.0)));
        let across = (0..10).map(|k| Segment::new(Point::new(0.0, at(k)), Point::new(12.0, at(k))));
        let links: Vec<Segment> = up.chain(across).collect();
        let y: Vec<f64> = (0..20)
            .map(|k| if k % 10 == 5 { 6.0 } else { 0.0 })
            .collect();
        // The image turned by a quarter is that of the grid turned by a quarter.
        let image = |columns: usize, rows: usize| {
            let grid = PixelGrid {
                area,
                columns,
                rows,
            };
            let rows = WeightRows::rescaled(links.iter().copied(), &grid, WeightModel::Line);
            (grid, tikhonov(&rows, &grid, &y, 8.0))
        };
        let ((_, square), (flat_grid, flat)) = (image(24, 24), image(24, 12));
        for (pixel, value) in flat.iter().enumerate() {
            let (column, row) = (pixel % 24, 2 * (pixel / 24));
            let fine = 0.5 * (square[row * 24 + column] + square[(row + 1) * 24 + column]);
            let scale = square.iter().copied().fold(0.0, f64::max);
            assert!(
                (value - fine).abs() < 0.1 * scale,
                "{:?}",
                flat_grid.centre(pixel)
            );
        }
    }
}
