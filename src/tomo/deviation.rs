//! How sure an image is: the standard deviation of every pixel under the prior and the links, exact for small images.
//!
//! ```text
//!   P = C⁻¹ + D Wᵀ S̃⁻¹ W D        S̃⁻¹ = S⁻¹ − S⁻¹ H (B⁻¹ + Hᵀ S⁻¹ H)⁻¹ Hᵀ S⁻¹        sd = D √diag(P⁻¹)
//! ```
//!
//! C = prior covariance, W = weights, D = room for a change, S = noise of the links, H and B = nuisance columns and their prior
//! variances (as in [`super::map_solver`]; Rasmussen & Williams 2006, eq. A.9). Of an image of more pixels than are wanted the
//! same is done for blocks of k × k pixels; what the prior leaves open within a block is added to its variance, so that the
//! deviation is never told too small.
//!
//! Images that are mostly zero ([`sparse_deviation`]) have no noise where nothing is, which one variance for all pixels cannot
//! say. There each pixel gets a variance of its own, γ = m² + P (one step of sparse Bayesian learning, Tipping 2001; m = the
//! largest of the image within a pixel, since an edge may lie beside), and D = √(γ / σ²) takes the place of the room.

use super::dense::LowerTriangle;
use super::map_solver::Nuisance;
use super::prior::Prior;
use super::settings::ImagingSettings;
use super::weights::WeightRows;
use crate::geom::PixelGrid;

/// Added to the diagonal of the prior, a share of it: blocks that touch are nearly the same to a long prior.
const JITTER: f64 = 1e-9;

/// What the deviation of an image follows from, beside its links.
#[derive(Clone, Copy, Debug)]
pub(super) struct DeviationInputs<'a> {
    /// How it was made.
    pub settings: &'a ImagingSettings,
    /// Most blocks: time grows with their cube, memory with their square.
    pub most_blocks: usize,
    /// W D: rows = links, columns = pixels.
    pub rows: &'a WeightRows,
    /// D, per pixel; empty = 1 everywhere.
    pub room: &'a [f64],
    /// H and B.
    pub nuisance: &'a [Nuisance],
}

/// What the posterior deviation follows from.
#[derive(Clone, Copy, Debug)]
struct PosteriorInputs<'a> {
    /// Where the pixels lie.
    pub grid: PixelGrid,
    /// Most blocks.
    pub most_blocks: usize,
    /// What is believed of the image before it is measured.
    pub prior: Prior,
    /// W D: rows = links, columns = pixels.
    pub rows: &'a WeightRows,
    /// D, per pixel; empty = 1 everywhere.
    pub room: &'a [f64],
    /// S: variance of each link, dB².
    pub noise_db2: &'a [f64],
    /// H and B.
    pub nuisance: &'a [Nuisance],
}

/// Pixels pooled in blocks of `side` × `side`.
struct Blocks {
    side: usize,
    columns: usize,
    rows: usize,
    grid: PixelGrid,
}

/// Returns the standard deviation of every pixel, dB/m, row-major as the image: under the prior of `map`, and of an image that
/// is mostly zero under one that knows it. Of each link the variance is told with which the solver took it for a measurement of
/// the attenuation on its straight way, dB². `None` when the numbers leave no answer.
pub(super) fn deviation(
    inputs: &DeviationInputs<'_>,
    noise_db2: &[f64],
    image: &[f64],
) -> Option<Vec<f64>> {
    let (prior, _) = inputs.settings.belief();
    let posterior = PosteriorInputs {
        grid: inputs.settings.grid,
        most_blocks: inputs.most_blocks,
        prior,
        rows: inputs.rows,
        room: inputs.room,
        noise_db2,
        nuisance: inputs.nuisance,
    };
    match inputs.settings.solver.is_non_negative() {
        true => sparse_deviation(&posterior, image),
        false => posterior_deviation(&posterior),
    }
}

/// Returns the standard deviation of every pixel, dB/m, row-major as the image; `None` when the numbers leave no answer.
fn posterior_deviation(inputs: &PosteriorInputs<'_>) -> Option<Vec<f64>> {
    let blocks = Blocks::of(inputs.grid, inputs.most_blocks);
    let covariance = blocks.covariance(inputs.prior);
    let mut precision = covariance.factor()?.inverse_of_factor().gram();
    blocks.add_information(&mut precision, inputs);
    let variances = precision.factor()?.inverse_of_factor().gram_diagonal();
    let open = (inputs.prior.variance - blocks.variance(inputs.prior)).max(0.0);
    let of_pixel = |pixel: usize| {
        let room = inputs.room.get(pixel).copied().unwrap_or(1.0);
        room * (variances[blocks.block_of(pixel)] + open).max(0.0).sqrt()
    };
    Some((0..inputs.grid.len()).map(of_pixel).collect())
}

/// Returns the standard deviation of every pixel of an image that is mostly zero, dB/m: large where something is or may be;
/// `None` when the numbers leave no answer. The inputs are those without anything known of the pixels: no room.
fn sparse_deviation(inputs: &PosteriorInputs<'_>, image: &[f64]) -> Option<Vec<f64>> {
    let sd = posterior_deviation(inputs)?;
    let prior_sd = inputs.prior.variance.sqrt();
    let content: Vec<f64> = (0..image.len())
        .map(|pixel| libm::hypot(largest_around(inputs.grid, image, pixel), sd[pixel]) / prior_sd)
        .collect();
    let mut rows = inputs.rows.clone();
    rows.scale_pixels(&content);
    posterior_deviation(&PosteriorInputs {
        rows: &rows,
        room: &content,
        ..*inputs
    })
}

/// Returns the largest size of a value among a pixel and its eight neighbours.
fn largest_around(grid: PixelGrid, image: &[f64], pixel: usize) -> f64 {
    let (column, row) = (pixel % grid.columns, pixel / grid.columns);
    let rows = row.saturating_sub(1)..=(row + 1).min(grid.rows - 1);
    let columns = column.saturating_sub(1)..=(column + 1).min(grid.columns - 1);
    let around = rows.flat_map(|row| {
        columns
            .clone()
            .map(move |column| row * grid.columns + column)
    });
    around.fold(0.0, |most, pixel| image[pixel].abs().max(most))
}

impl Blocks {
    fn of(grid: PixelGrid, most: usize) -> Blocks {
        let blocks = |side: usize| Blocks {
            side,
            columns: grid.columns.div_ceil(side),
            rows: grid.rows.div_ceil(side),
            grid,
        };
        let is_small = |side: &usize| blocks(*side).len() <= most.max(1);
        blocks((1..).find(is_small).unwrap_or(1))
    }

    fn len(&self) -> usize {
        self.columns * self.rows
    }

    fn block_of(&self, pixel: usize) -> usize {
        let (column, row) = (pixel % self.grid.columns, pixel / self.grid.columns);
        row / self.side * self.columns + column / self.side
    }

    /// Returns the covariance of the means of two blocks so many blocks apart.
    fn covariance_at(&self, prior: Prior, columns_apart: usize, rows_apart: usize) -> f64 {
        let side = self.side as i64;
        let offset_m = |apart: usize, within: i64, pitch_m: f64| {
            (apart as i64 * side + within) as f64 * pitch_m
        };
        let mut sum = 0.0;
        for y in 1 - side..side {
            for x in 1 - side..side {
                let pairs = ((side - x.abs()) * (side - y.abs())) as f64;
                let x_m = offset_m(columns_apart, x, self.grid.dx_m());
                let y_m = offset_m(rows_apart, y, self.grid.dy_m());
                sum += pairs * libm::exp(-(x_m * x_m + y_m * y_m).sqrt() / prior.length_m);
            }
        }
        let pairs = (side * side) as f64;
        prior.variance * sum / (pairs * pairs)
    }

    fn variance(&self, prior: Prior) -> f64 {
        self.covariance_at(prior, 0, 0)
    }

    fn covariance(&self, prior: Prior) -> LowerTriangle {
        let table: Vec<f64> = (0..self.len())
            .map(|apart| self.covariance_at(prior, apart % self.columns, apart / self.columns))
            .collect();
        let jitter = JITTER * prior.variance;
        LowerTriangle::of(self.len(), |i, j| {
            let columns = (i % self.columns).abs_diff(j % self.columns);
            let rows = (i / self.columns).abs_diff(j / self.columns);
            table[rows * self.columns + columns] + if i == j { jitter } else { 0.0 }
        })
    }

    /// Adds what the links say: D Wᵀ S̃⁻¹ W D.
    fn add_information(&self, precision: &mut LowerTriangle, inputs: &PosteriorInputs<'_>) {
        let mut of_nuisance = vec![vec![0.0; self.len()]; inputs.nuisance.len()];
        let mut pooled: Vec<(usize, f64)> = Vec::new();
        for (link, noise_db2) in inputs.noise_db2.iter().enumerate() {
            self.pool(inputs.rows, link, &mut pooled);
            for (index, (i, weight)) in pooled.iter().enumerate() {
                let scaled = weight / noise_db2;
                let row = precision.row_mut(*i);
                for (j, other) in &pooled[..=index] {
                    row[*j] += scaled * other;
                }
                for (sums, column) in of_nuisance.iter_mut().zip(inputs.nuisance) {
                    sums[*i] += scaled * column.column[link];
                }
            }
        }
        subtract_nuisance(precision, &of_nuisance, inputs);
    }

    /// Sums a link's weights up by block, in the order of the blocks.
    fn pool(&self, rows: &WeightRows, link: usize, pooled: &mut Vec<(usize, f64)>) {
        pooled.clear();
        pooled.extend(
            rows.row(link)
                .map(|(pixel, weight)| (self.block_of(pixel), weight)),
        );
        // Stable: of one block the sum has always the same order.
        pooled.sort_by_key(|(block, _)| *block);
        pooled.dedup_by(|next, kept| {
            let is_same = next.0 == kept.0;
            if is_same {
                kept.1 += next.1;
            }
            is_same
        });
    }
}

/// Takes out what the nuisance columns could explain as well: V (B⁻¹ + Hᵀ S⁻¹ H)⁻¹ Vᵀ with V = D Wᵀ S⁻¹ H.
fn subtract_nuisance(
    precision: &mut LowerTriangle,
    of_nuisance: &[Vec<f64>],
    inputs: &PosteriorInputs<'_>,
) {
    let count = of_nuisance.len();
    let inner = |a: usize, b: usize| {
        let (one, other) = (&inputs.nuisance[a], &inputs.nuisance[b]);
        let products = one.column.iter().zip(&other.column).zip(inputs.noise_db2);
        let sum: f64 = products.map(|((x, y), noise_db2)| x * y / noise_db2).sum();
        sum + if a == b { 1.0 / one.variance } else { 0.0 }
    };
    let Some(half) = LowerTriangle::of(count, inner)
        .factor()
        .map(LowerTriangle::inverse_of_factor)
    else {
        return;
    };
    for a in 0..count {
        let turned: Vec<f64> = (0..of_nuisance[0].len())
            .map(|block| {
                let terms = half.row(a).iter().zip(of_nuisance);
                terms.map(|(factor, column)| factor * column[block]).sum()
            })
            .collect();
        for (i, value) in turned.iter().enumerate() {
            precision
                .row_mut(i)
                .iter_mut()
                .zip(&turned)
                .for_each(|(entry, other)| *entry -= value * other);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Point, Rect, Segment};
    use crate::tomo::WeightModel;
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    fn grid(columns: usize, rows: usize) -> PixelGrid {
        PixelGrid {
            area: Rect::new(Point::new(0.0, 0.0), Point::new(6.0, 5.0)),
            columns,
            rows,
        }
    }

    fn links() -> Vec<Segment> {
        let at = |k: i32| {
            let angle = f64::from(k) * 0.51;
            Point::new(3.0 + 3.0 * angle.cos(), 2.5 + 2.5 * angle.sin())
        };
        (0..60)
            .map(|k| Segment::new(at(k), at(k * 3 + 4)))
            .collect()
    }

    const PRIOR: Prior = Prior {
        variance: 0.3,
        length_m: 1.0,
    };

    fn rows(grid: &PixelGrid, links: &[Segment]) -> WeightRows {
        let model = WeightModel::InverseArea { width_m: 0.3 };
        WeightRows::rescaled(links.iter().copied(), grid, model)
    }

    /// C − C Wᵀ (W C Wᵀ + H B Hᵀ + S)⁻¹ W C with dense matrices.
    fn in_link_space(inputs: &PosteriorInputs<'_>) -> Vec<f64> {
        let (grid, pixels) = (&inputs.grid, inputs.grid.len());
        let mut w = DMatrix::zeros(inputs.rows.len(), pixels);
        for row in 0..inputs.rows.len() {
            inputs
                .rows
                .row(row)
                .for_each(|(pixel, weight)| w[(row, pixel)] += weight);
        }
        let c = DMatrix::from_fn(pixels, pixels, |i, j| {
            let distance_m = grid.centre(i).distance_to(grid.centre(j));
            PRIOR.variance * (-distance_m / PRIOR.length_m).exp()
        });
        let mut k = &w * &c * w.transpose()
            + DMatrix::from_diagonal(&DVector::from_column_slice(inputs.noise_db2));
        for nuisance in inputs.nuisance {
            let column = DVector::from_column_slice(&nuisance.column);
            k += &column * column.transpose() * nuisance.variance;
        }
        let gain = &c * w.transpose() * k.try_inverse().unwrap() * &w * &c;
        (0..pixels)
            .map(|pixel| {
                let room = inputs.room.get(pixel).copied().unwrap_or(1.0);
                room * (c[(pixel, pixel)] - gain[(pixel, pixel)]).sqrt()
            })
            .collect()
    }

    #[test]
    fn it_equals_the_formula_in_link_space() {
        let (grid, links) = (grid(12, 10), links());
        let mut rows = rows(&grid, &links);
        let room: Vec<f64> = (0..grid.len())
            .map(|pixel| 1.0 / (1.0 + (pixel % 3) as f64))
            .collect();
        rows.scale_pixels(&room);
        let noise_db2: Vec<f64> = (0..links.len()).map(|k| 1.0 + (k % 5) as f64).collect();
        let nuisance = [
            Nuisance {
                column: vec![1.0; links.len()],
                variance: 4.0,
            },
            Nuisance {
                column: links
                    .iter()
                    .map(|link| 10.0 * link.length_m().max(0.1).log10())
                    .collect(),
                variance: 0.04,
            },
        ];
        for nuisance in [&nuisance[..], &nuisance[..1], &[]] {
            let inputs = PosteriorInputs {
                grid,
                most_blocks: 1600,
                prior: PRIOR,
                rows: &rows,
                room: &room,
                noise_db2: &noise_db2,
                nuisance,
            };
            let got = posterior_deviation(&inputs).unwrap();
            let expected = in_link_space(&inputs);
            let worst = got
                .iter()
                .zip(&expected)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max);
            assert!(worst < 1e-6, "{worst}");
        }
    }

    #[test]
    fn it_never_grows_with_another_link() {
        let (grid, links) = (grid(9, 8), links());
        let of = |count: usize| {
            let rows = rows(&grid, &links[..count]);
            posterior_deviation(&PosteriorInputs {
                grid,
                most_blocks: 1600,
                prior: PRIOR,
                rows: &rows,
                room: &[],
                noise_db2: &vec![2.0; count],
                nuisance: &[],
            })
            .unwrap()
        };
        let mut before = of(0);
        assert!(
            before
                .iter()
                .all(|sd| (sd * sd - PRIOR.variance).abs() < 1e-6)
        );
        for count in [1, 2, 5, 20, 60] {
            let after = of(count);
            assert!(
                after
                    .iter()
                    .zip(&before)
                    .all(|(after, before)| *after <= before + 1e-12)
            );
            before = after;
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 8, ..ProptestConfig::default() })]

        #[test]
        fn that_of_a_sparse_image_does_not_grow_with_other_links_but_for_traces(
            values in prop::collection::vec(prop_oneof![3 => Just(0.0), 1 => 0.0..4.0], 72),
            noise_db2 in prop::collection::vec(0.3..5.0, 60),
            (fewer, more) in (0_usize..60, 1_usize..60),
        ) {
            let (grid, links) = (grid(9, 8), links());
            let of = |count: usize| {
                let rows = rows(&grid, &links[..count]);
                let inputs = PosteriorInputs {
                    grid,
                    most_blocks: 1600,
                    prior: PRIOR,
                    rows: &rows,
                    room: &[],
                    noise_db2: &noise_db2[..count],
                    nuisance: &[],
                };
                sparse_deviation(&inputs, &values).unwrap()
            };
            let (before, after) = (of(fewer), of((fewer + more).min(60)));
            for (after, before) in after.iter().zip(&before) {
                // The prior is narrower where links say that nothing is: that of a neighbour says less of a pixel then.
                prop_assert!(*after <= before * 1.01, "{after} of {before}");
            }
        }
    }

    #[test]
    fn a_sparse_image_is_unsure_where_something_is_and_sure_where_nothing_is() {
        let (grid, links) = (grid(12, 10), links());
        let rows = rows(&grid, &links);
        let inputs = PosteriorInputs {
            grid,
            most_blocks: 1600,
            prior: PRIOR,
            rows: &rows,
            room: &[],
            noise_db2: &vec![1.0; links.len()],
            nuisance: &[],
        };
        let alike = posterior_deviation(&inputs).unwrap();
        let empty = sparse_deviation(&inputs, &vec![0.0; grid.len()]).unwrap();
        let less = empty.iter().zip(&alike).all(|(empty, alike)| empty < alike);
        assert!(less, "nothing was found anywhere");
        // A person in the middle, another one in a corner.
        let mut image = vec![0.0; grid.len()];
        (image[5 * 12 + 6], image[0]) = (3.0, 3.0);
        let sd = sparse_deviation(&inputs, &image).unwrap();
        for near in [5 * 12 + 6, 4 * 12 + 5, 6 * 12 + 7, 0, 1, 12, 13] {
            assert!(sd[near] > 1.5 * empty[near], "{near}: {}", sd[near]);
        }
        let far = 2 * 12 + 9;
        assert!((sd[far] / empty[far] - 1.0).abs() < 0.2, "{}", sd[far]);
        assert!(sd.iter().all(|sd| sd.is_finite() && *sd > 0.0));
    }

    #[test]
    fn a_large_image_is_surer_where_links_cross_and_nowhere_less_sure_than_before() {
        let (fine, links) = (grid(82, 41), links());
        let rows = rows(&fine, &links);
        let sd = posterior_deviation(&PosteriorInputs {
            grid: fine,
            most_blocks: 1600,
            prior: PRIOR,
            rows: &rows,
            room: &[],
            noise_db2: &vec![0.1; links.len()],
            nuisance: &[],
        })
        .unwrap();
        assert_eq!(sd.len(), fine.len());
        let most = PRIOR.variance.sqrt();
        assert!(sd.iter().all(|sd| *sd > 0.0 && *sd <= most + 1e-6));
        let middle = sd[20 * 82 + 41];
        assert!(middle < 0.9 * most, "{middle} of {most}");
        assert!(
            sd[0] > 0.93 * most,
            "the corner is seen from afar only: {}",
            sd[0]
        );
    }
}
