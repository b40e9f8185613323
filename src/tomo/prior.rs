//! What is believed before measuring: attenuation of neighbouring pixels is alike.
//!
//! C_ij = σ² exp(−|ci − cj| / δ), applied by FFT on a grid padded with zeros, which is exact (no wrap-around).
//! The matrix itself is never formed.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

use super::lanes::{LANES, Lanes};
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
    /// Of the kernel, half the columns, [`LANES`] of them side by side; divided by the padded size.
    spectrum: Vec<Lanes>,
    row_forward: Arc<dyn Fft<Lanes>>,
    row_inverse: Arc<dyn Fft<Lanes>>,
    column_forward: Arc<dyn Fft<Lanes>>,
    column_inverse: Arc<dyn Fft<Lanes>>,
}

/// Rows that are transformed together: two real rows travel as one complex row, in each lane.
const ROWS_TOGETHER: usize = 2 * LANES;

/// Memory that one application after another uses again.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    row: Vec<Complex<Lanes>>,
    /// Column group after column group, each row after row.
    columns: Vec<Complex<Lanes>>,
    scratch: Vec<Complex<Lanes>>,
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

    /// Returns how many groups of columns there are: of half the columns, since those of a real image mirror each other.
    fn groups(&self) -> usize {
        (self.padded_columns / 2 + 1).div_ceil(LANES)
    }

    fn kernel_spectrum(&self, grid: &PixelGrid, prior: Prior) -> Vec<Lanes> {
        let (height, width) = (self.padded_rows, self.padded_columns);
        let apart =
            |index: usize, size: usize, pitch_m: f64| index.min(size - index) as f64 * pitch_m;
        let mut columns = vec![Complex::<Lanes>::default(); self.groups() * height];
        for row in 0..height {
            let y_m = apart(row, height, grid.dy_m());
            let mut line: Vec<Complex<Lanes>> = (0..width)
                .map(|column| {
                    let x_m = apart(column, width, grid.dx_m());
                    let distance_m = (x_m * x_m + y_m * y_m).sqrt();
                    let value = prior.variance * libm::exp(-distance_m / prior.length_m);
                    Complex::new(Lanes::all(value), Lanes::default())
                })
                .collect();
            self.row_forward.process(&mut line);
            for (column, value) in line[..=width / 2].iter().enumerate() {
                let to = &mut columns[column / LANES * height + row];
                let lane = column % LANES;
                (to.re.0[lane], to.im.0[lane]) = (value.re.0[lane], value.im.0[lane]);
            }
        }
        self.column_forward.process(&mut columns);
        let scale = Lanes::all(1.0 / (height * width) as f64);
        columns.iter().map(|value| value.re * scale).collect()
    }

    /// Returns the number of pixels.
    pub fn pixels(&self) -> usize {
        self.rows * self.columns
    }

    /// Gives C x.
    pub fn apply(&self, image: &[f64], output: &mut [f64], work: &mut Workspace) {
        work.row.resize(self.padded_columns, Complex::default());
        work.columns.clear();
        work.columns
            .resize(self.groups() * self.padded_rows, Complex::default());
        let needed = [
            &self.row_forward,
            &self.row_inverse,
            &self.column_forward,
            &self.column_inverse,
        ]
        .map(|fft| fft.get_inplace_scratch_len());
        work.scratch
            .resize(needed.into_iter().max().unwrap_or(0), Complex::default());
        for row in (0..self.rows).step_by(ROWS_TOGETHER) {
            self.forward_rows(image, row, work);
        }
        self.column_forward
            .process_with_scratch(&mut work.columns, &mut work.scratch);
        for (value, factor) in work.columns.iter_mut().zip(&self.spectrum) {
            *value = Complex::new(value.re * *factor, value.im * *factor);
        }
        self.column_inverse
            .process_with_scratch(&mut work.columns, &mut work.scratch);
        for row in (0..self.rows).step_by(ROWS_TOGETHER) {
            self.inverse_rows(output, row, work);
        }
    }

    /// Transforms rows of the image from `first` on; row `first + 2 lane` is real and the one after it imaginary.
    fn forward_rows(&self, image: &[f64], first: usize, work: &mut Workspace) {
        let (width, height) = (self.padded_columns, self.padded_rows);
        work.row.fill(Complex::default());
        let rows = image.chunks_exact(self.columns.max(1)).skip(first);
        for (at, row) in rows.take(ROWS_TOGETHER).enumerate() {
            let (lane, is_imaginary) = (at / 2, at % 2 == 1);
            for (to, value) in work.row.iter_mut().zip(row) {
                let part = if is_imaginary { &mut to.im } else { &mut to.re };
                part.0[lane] = *value;
            }
        }
        self.row_forward
            .process_with_scratch(&mut work.row, &mut work.scratch);
        let together = ROWS_TOGETHER.min(self.rows - first);
        for column in 0..=width / 2 {
            let (here, mirrored) = (work.row[column], work.row[(width - column) % width].conj());
            let half = Lanes::all(0.5);
            let (sum, difference) = (here + mirrored, here - mirrored);
            let even = Complex::new(sum.re * half, sum.im * half);
            let odd = Complex::new(difference.im * half, -(difference.re * half));
            let start = column / LANES * height + first;
            let to = &mut work.columns[start..start + together];
            for (at, to) in to.iter_mut().enumerate() {
                let from = if at % 2 == 0 { &even } else { &odd };
                let lane = column % LANES;
                (to.re.0[lane], to.im.0[lane]) = (from.re.0[at / 2], from.im.0[at / 2]);
            }
        }
    }

    /// Transforms rows back, as [`Covariance::forward_rows`] has put them.
    fn inverse_rows(&self, output: &mut [f64], first: usize, work: &mut Workspace) {
        let (width, height) = (self.padded_columns, self.padded_rows);
        let turned = |value: Complex<Lanes>| Complex::new(-value.im, value.re);
        let together = ROWS_TOGETHER.min(self.rows - first);
        for column in 0..=width / 2 {
            let (mut even, mut odd) = (Complex::<Lanes>::default(), Complex::<Lanes>::default());
            let start = column / LANES * height + first;
            for (at, from) in work.columns[start..start + together].iter().enumerate() {
                let to = if at % 2 == 0 { &mut even } else { &mut odd };
                let lane = column % LANES;
                (to.re.0[at / 2], to.im.0[at / 2]) = (from.re.0[lane], from.im.0[lane]);
            }
            // The first and the middle column have no mirrored partner of their own, and are written last.
            work.row[(width - column) % width] = even.conj() + turned(odd.conj());
            work.row[column] = even + turned(odd);
        }
        self.row_inverse
            .process_with_scratch(&mut work.row, &mut work.scratch);
        let rows = output.chunks_exact_mut(self.columns.max(1)).skip(first);
        for (at, row) in rows.take(ROWS_TOGETHER).enumerate() {
            let (lane, is_imaginary) = (at / 2, at % 2 == 1);
            for (value, from) in row.iter_mut().zip(&work.row) {
                let part = if is_imaginary { &from.im } else { &from.re };
                *value = part.0[lane];
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
