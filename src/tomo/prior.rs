//! What is believed before measuring: attenuation of neighbouring pixels is alike.
//!
//! C_ij = σ² exp(−|ci − cj| / δ), applied by FFT on a grid padded with zeros, which is exact (no wrap-around).
//! The matrix itself is never formed.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlanner};

use crate::geom::PixelGrid;

/// The exponential covariance: σ² and δ.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Prior {
    /// σ²: variance of a pixel, (dB/m)².
    pub variance: f64,
    /// δ: distance at which the correlation falls to 1/e, metres.
    pub length_m: f64,
}

/// The covariance of a grid's pixels, ready to be applied.
#[derive(Clone)]
pub struct Covariance {
    rows: usize,
    columns: usize,
    padded_rows: usize,
    padded_columns: usize,
    /// Of the kernel, half the columns, column by column; divided by the padded size.
    spectrum: Vec<f64>,
    row_forward: Arc<dyn Fft<f64>>,
    row_inverse: Arc<dyn Fft<f64>>,
    column_forward: Arc<dyn Fft<f64>>,
    column_inverse: Arc<dyn Fft<f64>>,
}

/// Memory that one application after another uses again.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    row: Vec<Complex64>,
    columns: Vec<Complex64>,
    scratch: Vec<Complex64>,
}

impl std::fmt::Debug for Covariance {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "Covariance({}x{})", self.columns, self.rows)
    }
}

impl Covariance {
    /// Makes the covariance of a grid's pixels.
    pub fn new(grid: &PixelGrid, prior: Prior) -> Covariance {
        let padded_rows = smooth_size(2 * grid.rows);
        let padded_columns = smooth_size(2 * grid.columns);
        let mut planner = FftPlanner::new();
        let mut covariance = Covariance {
            rows: grid.rows,
            columns: grid.columns,
            padded_rows,
            padded_columns,
            spectrum: Vec::new(),
            row_forward: planner.plan_fft_forward(padded_columns),
            row_inverse: planner.plan_fft_inverse(padded_columns),
            column_forward: planner.plan_fft_forward(padded_rows),
            column_inverse: planner.plan_fft_inverse(padded_rows),
        };
        covariance.spectrum = covariance.kernel_spectrum(grid, prior);
        covariance
    }

    fn kernel_spectrum(&self, grid: &PixelGrid, prior: Prior) -> Vec<f64> {
        let (height, width) = (self.padded_rows, self.padded_columns);
        let apart =
            |index: usize, size: usize, pitch_m: f64| index.min(size - index) as f64 * pitch_m;
        let half = width / 2 + 1;
        let mut columns = vec![Complex64::default(); half * height];
        for row in 0..height {
            let y_m = apart(row, height, grid.dy_m());
            let mut line: Vec<Complex64> = (0..width)
                .map(|column| {
                    let x_m = apart(column, width, grid.dx_m());
                    let distance_m = (x_m * x_m + y_m * y_m).sqrt();
                    Complex64::new(
                        prior.variance * libm::exp(-distance_m / prior.length_m),
                        0.0,
                    )
                })
                .collect();
            self.row_forward.process(&mut line);
            (0..half).for_each(|column| columns[column * height + row] = line[column]);
        }
        self.column_forward.process(&mut columns);
        let scale = 1.0 / (height * width) as f64;
        columns.iter().map(|value| value.re * scale).collect()
    }

    /// Returns the number of pixels.
    pub fn pixels(&self) -> usize {
        self.rows * self.columns
    }

    /// Gives C x; two real rows travel as one complex row, and only half of the columns are needed.
    pub fn apply(&self, image: &[f64], output: &mut [f64], work: &mut Workspace) {
        let (height, half) = (self.padded_rows, self.padded_columns / 2 + 1);
        work.row.resize(self.padded_columns, Complex64::default());
        work.columns.clear();
        work.columns.resize(half * height, Complex64::default());
        let needed = [
            &self.row_forward,
            &self.row_inverse,
            &self.column_forward,
            &self.column_inverse,
        ]
        .map(|fft| fft.get_inplace_scratch_len());
        work.scratch
            .resize(needed.into_iter().max().unwrap_or(0), Complex64::default());
        for row in (0..self.rows).step_by(2) {
            self.forward_pair(image, row, work);
        }
        self.column_forward
            .process_with_scratch(&mut work.columns, &mut work.scratch);
        work.columns
            .iter_mut()
            .zip(&self.spectrum)
            .for_each(|(value, factor)| *value *= factor);
        self.column_inverse
            .process_with_scratch(&mut work.columns, &mut work.scratch);
        for row in (0..self.rows).step_by(2) {
            self.inverse_pair(output, row, work);
        }
    }

    fn forward_pair(&self, image: &[f64], row: usize, work: &mut Workspace) {
        let (width, height) = (self.padded_columns, self.padded_rows);
        let pixel = |row: usize, column: usize| {
            image
                .get(row * self.columns + column)
                .copied()
                .unwrap_or(0.0)
        };
        for column in 0..self.columns {
            work.row[column] = Complex64::new(pixel(row, column), pixel(row + 1, column));
        }
        work.row[self.columns..].fill(Complex64::default());
        self.row_forward
            .process_with_scratch(&mut work.row, &mut work.scratch);
        for column in 0..=width / 2 {
            let (here, mirrored) = (work.row[column], work.row[(width - column) % width].conj());
            let (sum, difference) = ((here + mirrored) * 0.5, (here - mirrored) * 0.5);
            work.columns[column * height + row] = sum;
            if row + 1 < self.rows {
                work.columns[column * height + row + 1] =
                    Complex64::new(difference.im, -difference.re);
            }
        }
    }

    fn inverse_pair(&self, output: &mut [f64], row: usize, work: &mut Workspace) {
        let (width, height) = (self.padded_columns, self.padded_rows);
        let turned = |value: Complex64| Complex64::new(-value.im, value.re);
        for column in 0..=width / 2 {
            let (even, odd) = (
                work.columns[column * height + row],
                work.columns[column * height + row + 1],
            );
            work.row[column] = even + turned(odd);
            work.row[(width - column) % width] = even.conj() + turned(odd.conj());
        }
        // The first and the middle column have no mirrored partner of their own.
        for column in [0, width / 2] {
            if (width - column) % width == column {
                let (even, odd) = (
                    work.columns[column * height + row],
                    work.columns[column * height + row + 1],
                );
                work.row[column] = even + turned(odd);
            }
        }
        self.row_inverse
            .process_with_scratch(&mut work.row, &mut work.scratch);
        for (column, value) in work.row[..self.columns].iter().enumerate() {
            output[row * self.columns + column] = value.re;
            if row + 1 < self.rows {
                output[(row + 1) * self.columns + column] = value.im;
            }
        }
    }
}

/// Returns the smallest size of at least `least` without prime factors above 5.
fn smooth_size(least: usize) -> usize {
    let is_smooth = |mut size: usize| {
        for factor in [2, 3, 5] {
            while size.is_multiple_of(factor) {
                size /= factor;
            }
        }
        size == 1
    };
    (least.max(2)..)
        .find(|size| is_smooth(*size))
        .unwrap_or(least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Point, Rect};

    fn check_against_the_matrix(columns: usize, rows: usize) {
        let area = Rect::new(Point::new(-1.0, 0.0), Point::new(2.0, 5.0));
        let grid = PixelGrid {
            area,
            columns,
            rows,
        };
        let prior = Prior {
            variance: 0.7,
            length_m: 1.3,
        };
        let covariance = Covariance::new(&grid, prior);
        let image: Vec<f64> = (0..grid.len())
            .map(|pixel| ((pixel * 37) % 11) as f64 - 4.0)
            .collect();
        let mut got = vec![0.0; grid.len()];
        covariance.apply(&image, &mut got, &mut Workspace::default());
        for (pixel, got) in got.iter().enumerate() {
            let weigh = |other: usize| {
                let distance_m = grid.centre(pixel).distance_to(grid.centre(other));
                0.7 * (-distance_m / 1.3).exp() * image[other]
            };
            let expected: f64 = (0..grid.len()).map(weigh).sum();
            assert!(
                (got - expected).abs() < 1e-10,
                "{columns}x{rows} {pixel}: {got} {expected}"
            );
        }
    }

    #[test]
    fn the_transform_equals_the_matrix() {
        for (columns, rows) in [(1, 1), (4, 4), (7, 5), (5, 8), (13, 9), (1, 6), (6, 1)] {
            check_against_the_matrix(columns, rows);
        }
    }
}
