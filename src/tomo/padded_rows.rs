//! The rows of weights once more, for whoever passes over them many times: every run of pixels is padded with weights of 0 to
//! fours, and weights are rounded to single precision. Where runs are short, of three or four pixels as in an image of 40 × 40,
//! a loop over their lengths waits for the processor's guesses longer than it calculates; fours have no lengths. And what is
//! half as long stays in the processor's cache.

use multiversion::multiversion;

use super::weights::WeightRows;

/// Pixels of a piece.
const WIDTH: usize = 4;
/// Weights are wrong by this share of them at most.
pub(super) const ROUNDING: f64 = 6e-8;
/// Where runs are longer than this on the mean, padding gains nothing.
const SHORT: usize = 12;

/// Four neighbouring pixels of a row, of which the last ones may weigh nothing and lie beyond the image.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Piece {
    first_pixel: u32,
    weights: [f32; WIDTH],
}

/// A matrix as [`WeightRows`] is one: rows = links, columns = pixels; [`ROUNDING`] apart the same one.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct PaddedRows {
    row_starts: Vec<u32>,
    pieces: Vec<Piece>,
    pixels: usize,
}

impl PaddedRows {
    /// Copies rows of weights of so many pixels; `None` when that gains nothing.
    pub(super) fn of(rows: &WeightRows, pixels: usize) -> Option<PaddedRows> {
        let runs: usize = (0..rows.len()).map(|row| rows.runs(row).count()).sum();
        if rows.values() > SHORT * runs || runs == 0 {
            return None;
        }
        let mut padded = PaddedRows {
            row_starts: vec![0],
            pieces: Vec::with_capacity(runs + rows.values() / WIDTH),
            pixels,
        };
        for row in 0..rows.len() {
            for (first_pixel, weights) in rows.runs(row) {
                for (four, part) in weights.chunks(WIDTH).enumerate() {
                    let mut weights = [0.0; WIDTH];
                    let rounded = part.iter().map(|weight| *weight as f32);
                    weights
                        .iter_mut()
                        .zip(rounded)
                        .for_each(|(to, weight)| *to = weight);
                    padded.pieces.push(Piece {
                        first_pixel: first_pixel + (WIDTH * four) as u32,
                        weights,
                    });
                }
            }
            padded.row_starts.push(padded.pieces.len() as u32);
        }
        Some(padded)
    }

    /// Gives W x: one value per link.
    pub(super) fn forward(&self, image: &[f64], links: &mut [f64]) {
        let image = self.with_margin(image);
        for (row, link) in links.iter_mut().enumerate() {
            *link = scalar_product(self.row(row), &image);
        }
    }

    /// Gives Wᵀ a: one value per pixel.
    pub(super) fn backward(&self, links: &[f64], image: &mut [f64]) {
        let mut back = self.with_margin(&[]);
        for (row, link) in links.iter().enumerate() {
            add_multiple(self.row(row), &mut back, *link);
        }
        image.copy_from_slice(&back[..self.pixels]);
    }

    /// Gives Wᵀ f(W x) in one pass: `of_link` is told each link with its value, and says what goes back.
    pub(super) fn there_and_back(
        &self,
        image: &[f64],
        output: &mut [f64],
        mut of_link: impl FnMut(usize, f64) -> f64,
    ) {
        let (image, mut back) = (self.with_margin(image), self.with_margin(&[]));
        for link in 0..self.row_starts.len() - 1 {
            let row = self.row(link);
            add_multiple(row, &mut back, of_link(link, scalar_product(row, &image)));
        }
        output.copy_from_slice(&back[..self.pixels]);
    }

    /// Returns an image with room for pieces that reach beyond its last pixel.
    fn with_margin(&self, image: &[f64]) -> Vec<f64> {
        let mut wide = vec![0.0; self.pixels + WIDTH];
        wide[..image.len()].copy_from_slice(image);
        wide
    }

    fn row(&self, row: usize) -> &[Piece] {
        &self.pieces[self.row_starts[row] as usize..self.row_starts[row + 1] as usize]
    }
}

/// Returns the scalar product of a row with an image. (Compiled for wide registers too, which change no bit: each operation is the
/// same one, and none are joined.)
#[multiversion(targets("x86_64+avx2"))]
fn scalar_product(row: &[Piece], image: &[f64]) -> f64 {
    // Two sums of four, so that none waits for the addition before.
    let (mut even, mut odd) = ([0.0; WIDTH], [0.0; WIDTH]);
    let (pairs, rest) = row.as_chunks::<2>();
    for [first, second] in pairs {
        add_products(&mut even, first, image);
        add_products(&mut odd, second, image);
    }
    rest.iter()
        .for_each(|piece| add_products(&mut even, piece, image));
    let sum = |place: usize| even[place] + odd[place];
    (sum(0) + sum(1)) + (sum(2) + sum(3))
}

#[inline(always)]
fn add_products(sums: &mut [f64; WIDTH], piece: &Piece, image: &[f64]) {
    let first = piece.first_pixel as usize;
    let pixels = &image[first..first + WIDTH];
    for place in 0..WIDTH {
        sums[place] += f64::from(piece.weights[place]) * pixels[place];
    }
}

/// Adds a multiple of a row to an image.
#[multiversion(targets("x86_64+avx2"))]
fn add_multiple(row: &[Piece], image: &mut [f64], factor: f64) {
    for piece in row {
        let first = piece.first_pixel as usize;
        let (pixels, weights) = (&mut image[first..first + WIDTH], &piece.weights);
        for place in 0..WIDTH {
            pixels[place] += factor * f64::from(weights[place]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{PixelGrid, Point, Rect, Segment};
    use crate::tomo::WeightModel;
    use proptest::prelude::*;

    fn grid(columns: usize, rows: usize) -> PixelGrid {
        let (low, high) = (Point::new(0.0, 0.0), Point::new(6.0, 5.0));
        PixelGrid {
            area: Rect::new(low, high),
            columns,
            rows,
        }
    }

    fn place() -> impl Strategy<Value = Point> {
        (-1.0..7.0, -1.0..6.0).prop_map(|(x_m, y_m)| Point::new(x_m, y_m))
    }

    proptest! {
        #[test]
        fn padded_rows_are_the_same_matrix_but_for_their_rounding(
            links in prop::collection::vec((place(), place()), 1..40),
            (columns, rows) in (1_usize..24, 1_usize..24),
            is_line in any::<bool>(),
        ) {
            let grid = grid(columns, rows);
            let model = match is_line {
                true => WeightModel::Line,
                false => WeightModel::Fresnel { wavelength_m: 0.125 },
            };
            let links = links.into_iter().map(|(from, to)| Segment::new(from, to));
            let plain = WeightRows::rescaled(links, &grid, model);
            let Some(padded) = PaddedRows::of(&plain, grid.len()) else {
                return Ok(());
            };
            let image: Vec<f64> = (0..grid.len()).map(|at| (at as f64 * 0.7).sin()).collect();
            // Links of 10 m at most, values up to 1; 40 links of up to 40 times as much come back.
            let near = |one: &[f64], other: &[f64]| {
                let near = |(one, other): (&f64, &f64)| (one - other).abs() < ROUNDING * 16_000.0;
                one.iter().zip(other).all(near)
            };
            let (mut there, mut expected) = (vec![9.0; plain.len()], vec![9.0; plain.len()]);
            padded.forward(&image, &mut there);
            plain.forward(&image, &mut expected);
            prop_assert!(near(&there, &expected));
            let (mut back, mut expected) = (vec![9.0; grid.len()], vec![9.0; grid.len()]);
            padded.backward(&there, &mut back);
            plain.backward(&there, &mut expected);
            prop_assert!(near(&back, &expected));
            padded.there_and_back(&image, &mut back, |link, value| value * (link + 1) as f64);
            plain.there_and_back(image.as_chunks().0, expected.as_chunks_mut().0, |link, [value]| {
                [value * (link + 1) as f64]
            });
            prop_assert!(near(&back, &expected));
        }
    }

    #[test]
    fn long_runs_stay_as_they_are() {
        let link = Segment::new(Point::new(0.0, 2.5), Point::new(6.0, 2.5));
        let of = |columns| {
            let grid = grid(columns, 5);
            let rows = WeightRows::rescaled([link], &grid, WeightModel::Line);
            PaddedRows::of(&rows, grid.len())
        };
        assert!(of(8).is_some() && of(400).is_none());
        assert!(PaddedRows::of(&WeightRows::new(), 40).is_none());
    }
}
