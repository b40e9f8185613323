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
/// Copies take no more memory than this; an image that would need more is not one of those that are made again and again.
const MOST_BYTES: usize = 128 << 20;

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
    /// Copies rows of weights of so many pixels; `None` when that gains nothing, or takes much memory.
    pub(super) fn of(rows: &WeightRows, pixels: usize) -> Option<PaddedRows> {
        let all_runs = (0..rows.len()).flat_map(|row| rows.runs(row));
        let (runs, pieces) = all_runs.fold((0, 0), |(runs, pieces), (_, weights)| {
            (runs + 1, pieces + weights.len().div_ceil(WIDTH))
        });
        let is_large = pieces * size_of::<Piece>() > MOST_BYTES;
        if rows.values() > SHORT * runs || runs == 0 || is_large {
            return None;
        }
        let mut padded = PaddedRows {
            row_starts: vec![0],
            pieces: Vec::with_capacity(pieces),
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

    /// Computes W x of several images at once, one lane for each.
    pub(super) fn forward_lanes<const LANES: usize>(
        &self,
        images: &[[f64; LANES]],
        mut of_link: impl FnMut(usize, [f64; LANES]),
    ) {
        let images = self.with_margin(images);
        for link in 0..self.row_starts.len() - 1 {
            of_link(link, products(self.row(link), &images));
        }
    }

    /// Computes Wᵀ a: one value per pixel.
    pub(super) fn backward(&self, links: &[f64], image: &mut [f64]) {
        let mut back = self.with_margin(&[]);
        for (row, link) in links.iter().enumerate() {
            add_multiple(self.row(row), &mut back, [*link]);
        }
        image.copy_from_slice(back[..self.pixels].as_flattened());
    }

    /// Computes Wᵀ f(W x) in one pass, of several images at once, one lane for each: `of_link` is told each link with its values,
    /// and says what goes back.
    pub(super) fn there_and_back<const LANES: usize>(
        &self,
        images: &[[f64; LANES]],
        output: &mut [[f64; LANES]],
        mut of_link: impl FnMut(usize, [f64; LANES]) -> [f64; LANES],
    ) {
        let (images, mut back) = (self.with_margin(images), self.with_margin(&[]));
        for link in 0..self.row_starts.len() - 1 {
            let row = self.row(link);
            add_multiple(row, &mut back, of_link(link, products(row, &images)));
        }
        output.copy_from_slice(&back[..self.pixels]);
    }

    /// Returns images with room for pieces that reach beyond the last pixel.
    fn with_margin<const LANES: usize>(&self, images: &[[f64; LANES]]) -> Vec<[f64; LANES]> {
        let mut wide = vec![[0.0; LANES]; self.pixels + WIDTH];
        wide[..images.len()].copy_from_slice(images);
        wide
    }

    fn row(&self, row: usize) -> &[Piece] {
        &self.pieces[self.row_starts[row] as usize..self.row_starts[row + 1] as usize]
    }
}

/// Returns the scalar products of a row with each lane of the images. (Compiled for wide registers too, which change no bit: each
/// operation is the same one, and none are joined.)
#[multiversion(targets("x86_64+avx2"))]
fn products<const LANES: usize>(row: &[Piece], images: &[[f64; LANES]]) -> [f64; LANES] {
    if LANES == 1 {
        return [scalar_product(row, images.as_flattened()); LANES];
    }
    // Two sums, so that none waits for the addition before.
    let (mut even, mut odd) = ([0.0; LANES], [0.0; LANES]);
    for piece in row {
        let first = piece.first_pixel as usize;
        let pixels = &images[first..first + WIDTH];
        for pair in 0..WIDTH / 2 {
            let (at, next) = (2 * pair, 2 * pair + 1);
            for lane in 0..LANES {
                even[lane] += f64::from(piece.weights[at]) * pixels[at][lane];
                odd[lane] += f64::from(piece.weights[next]) * pixels[next][lane];
            }
        }
    }
    for lane in 0..LANES {
        even[lane] += odd[lane];
    }
    even
}

/// Returns the scalar product of a row with an image.
#[inline(always)]
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

/// Adds a multiple of a row to each lane of the images.
#[multiversion(targets("x86_64+avx2"))]
fn add_multiple<const LANES: usize>(
    row: &[Piece],
    images: &mut [[f64; LANES]],
    factors: [f64; LANES],
) {
    for piece in row {
        let first = piece.first_pixel as usize;
        let (pixels, weights) = (&mut images[first..first + WIDTH], &piece.weights);
        for place in 0..WIDTH {
            let (pixel, weight) = (&mut pixels[place], f64::from(weights[place]));
            for lane in 0..LANES {
                pixel[lane] += factors[lane] * weight;
            }
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
            let images: Vec<[f64; 3]> = (0..grid.len())
                .map(|at| [0.7, 0.2, -1.3].map(|step| (at as f64 * step).sin()))
                .collect();
            // Links of 10 m at most, values up to 1; 40 links of up to 40 times as much come back.
            let near = |one: &[f64], other: &[f64]| {
                let near = |(one, other): (&f64, &f64)| (one - other).abs() < ROUNDING * 16_000.0;
                one.iter().zip(other).all(near)
            };
            let (mut there, mut expected) = (vec![[9.0; 3]; plain.len()], vec![[9.0; 3]; plain.len()]);
            padded.forward_lanes(&images, |link, lanes| there[link] = lanes);
            plain.forward_lanes(0..plain.len(), &images, |link, lanes| expected[link] = lanes);
            prop_assert!(near(there.as_flattened(), expected.as_flattened()));
            let first: Vec<[f64; 1]> = images.iter().map(|lanes| [lanes[0]]).collect();
            let mut alone = vec![[9.0]; plain.len()];
            padded.forward_lanes(&first, |link, lanes| alone[link] = lanes);
            let there: Vec<f64> = there.iter().map(|lanes| lanes[0]).collect();
            prop_assert!(near(alone.as_flattened(), &there));
            let (mut back, mut expected) = (vec![9.0; grid.len()], vec![9.0; grid.len()]);
            padded.backward(&there, &mut back);
            plain.backward(&there, &mut expected);
            prop_assert!(near(&back, &expected));
            let of_link = |link: usize, lanes: [f64; 3]| lanes.map(|value| value * (link + 1) as f64);
            let (mut back, mut expected) = (vec![[9.0; 3]; grid.len()], vec![[9.0; 3]; grid.len()]);
            padded.there_and_back(&images, &mut back, of_link);
            plain.there_and_back(&images, &mut expected, of_link);
            prop_assert!(near(back.as_flattened(), expected.as_flattened()));
            let mut alone = vec![[9.0]; grid.len()];
            padded.there_and_back(&first, &mut alone, |link, [value]| [value * (link + 1) as f64]);
            let back: Vec<f64> = back.iter().map(|lanes| lanes[0]).collect();
            prop_assert!(near(alone.as_flattened(), &back));
        }
    }

    #[test]
    fn long_runs_and_many_stay_as_they_are() {
        let link = Segment::new(Point::new(0.0, 2.5), Point::new(6.0, 2.5));
        let of = |columns| {
            let grid = grid(columns, 5);
            let rows = WeightRows::rescaled([link], &grid, WeightModel::Line);
            PaddedRows::of(&rows, grid.len())
        };
        assert!(of(8).is_some() && of(400).is_none());
        assert!(PaddedRows::of(&WeightRows::new(), 40).is_none());
        let short = WeightRows::rescaled([link], &grid(8, 5), WeightModel::Line);
        let mut many = WeightRows::new();
        let pieces = short.runs(0).count() * 2;
        (0..=MOST_BYTES / size_of::<Piece>() / pieces).for_each(|_| many.append(&short, 0));
        assert!(PaddedRows::of(&many, 40).is_none());
    }
}
