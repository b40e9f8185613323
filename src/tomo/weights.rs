//! How much each pixel weighs in each link: the forward model of the image.
//!
//! Rows are kept as runs of neighbouring pixels (a sparse matrix whose inner loops run over contiguous memory).
//! Models: line (Siddon 1985), ellipse (Wilson & Patwari 2010), inverse area (Hamilton et al. 2014), Fresnel zone. Nothing
//! is known here of noise or of solving.

use std::ops::Range;

use multiversion::multiversion;
use serde::{Deserialize, Serialize};

use super::fresnel::FresnelLink;
use crate::geom::{PixelGrid, Segment};

/// The weight of a pixel by its excess path e = |from − c| + |c − to| − d.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub enum WeightModel {
    /// The length of the link inside the pixel (Siddon 1985).
    Line,
    /// d^−½ where e < width (Wilson & Patwari 2010, eq. 12).
    Ellipse {
        /// Largest excess path, metres.
        width_m: f64,
    },
    /// One over the area of the ellipse through the pixel, where e < width (Hamilton et al. 2014), times the pixel's area.
    InverseArea {
        /// Largest excess path, metres; the smallest is a fiftieth of it.
        width_m: f64,
    },
    /// exp(−e² / 2 sd²), cut where it falls under 10⁻⁴.
    Gaussian {
        /// Standard deviation, metres.
        sd_m: f64,
    },
    /// exp(−e / decay), cut where it falls under 10⁻⁴.
    Exponential {
        /// Decay length, metres.
        decay_m: f64,
    },
    /// A bell across the link, half as wide as the first Fresnel zone (`src/tomo/fresnel.rs`).
    Fresnel {
        /// Wavelength, metres.
        wavelength_m: f64,
    },
}

/// ln 10⁴: where the soft models are cut.
const CUT: f64 = 9.21;

impl WeightModel {
    /// Returns the largest excess path that weighs anything, metres; 0 for those that do not go by it.
    fn reach_m(self) -> f64 {
        match self {
            WeightModel::Line | WeightModel::Fresnel { .. } => 0.0,
            WeightModel::Ellipse { width_m } | WeightModel::InverseArea { width_m } => width_m,
            WeightModel::Gaussian { sd_m } => sd_m * (2.0 * CUT).sqrt(),
            WeightModel::Exponential { decay_m } => decay_m * CUT,
        }
    }

    /// Returns the weight at an excess path (metres, within the model's reach) for a link of length `d_m`, before
    /// rescaling; the soft models are not cut here. 0 for line and Fresnel zone, which have no such weight.
    pub fn weight(self, excess_m: f64, d_m: f64, pixel_m2: f64) -> f64 {
        match self {
            WeightModel::Line | WeightModel::Fresnel { .. } => 0.0,
            WeightModel::Ellipse { .. } => 1.0 / d_m.sqrt(),
            WeightModel::InverseArea { width_m } => {
                pixel_m2 / ellipse_area_m2(excess_m.max(width_m / 50.0), d_m)
            }
            WeightModel::Gaussian { sd_m } => libm::exp(-excess_m * excess_m / (2.0 * sd_m * sd_m)),
            WeightModel::Exponential { decay_m } => libm::exp(-excess_m / decay_m),
        }
    }
}

/// A(e) = π/4 (d + e) √(e² + 2de).
fn ellipse_area_m2(excess_m: f64, d_m: f64) -> f64 {
    std::f64::consts::FRAC_PI_4
        * (d_m + excess_m)
        * (excess_m * excess_m + 2.0 * d_m * excess_m).sqrt()
}

/// A run of neighbouring pixels of one row of the matrix.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Run {
    first_pixel: u32,
    first_value: u32,
    length: u32,
}

/// Sparse weights: rows = links, columns = pixels (row-major, south-west first), metres after rescaling.
#[derive(Clone, PartialEq, Debug)]
pub struct WeightRows {
    row_starts: Vec<u32>,
    runs: Vec<Run>,
    values: Vec<f64>,
}

impl Default for WeightRows {
    fn default() -> WeightRows {
        WeightRows::new()
    }
}

impl WeightRows {
    /// Makes a matrix without rows.
    pub fn new() -> WeightRows {
        WeightRows {
            row_starts: vec![0],
            runs: Vec::new(),
            values: Vec::new(),
        }
    }

    /// Builds one row per link, each rescaled to sum to the link's length inside the grid's area, so that an
    /// image is in dB/m for every model. A link outside the area has an empty row; where pixels are so large that none has its
    /// middle near a link that runs through the area, they weigh by its length in them.
    pub fn rescaled(
        links: impl IntoIterator<Item = Segment>,
        grid: &PixelGrid,
        model: WeightModel,
    ) -> WeightRows {
        let mut rows = WeightRows::new();
        for link in links {
            rows.push_rescaled(link, grid, model);
        }
        rows
    }

    /// Appends the row of one link as [`Self::rescaled`] gives it.
    pub(super) fn push_rescaled(&mut self, link: Segment, grid: &PixelGrid, model: WeightModel) {
        let first = self.values.len();
        let inside_m = length_inside_m(link, grid);
        self.push(link, grid, model);
        if self.values.len() == first && inside_m > 0.0 {
            self.row_starts.pop();
            self.push(link, grid, WeightModel::Line);
        }
        let sum: f64 = self.values[first..].iter().sum();
        let factor = if sum > 0.0 { inside_m / sum } else { 0.0 };
        self.values[first..]
            .iter_mut()
            .for_each(|value| *value *= factor);
    }

    /// Returns about how many weights the rows of some links would have, at least as many as they have; it takes no memory.
    pub fn most_values(
        links: impl IntoIterator<Item = Segment>,
        grid: &PixelGrid,
        model: WeightModel,
    ) -> usize {
        let walked = |span: &dyn Fn(f64) -> Option<(f64, f64)>| -> usize {
            let of_row = |row: usize| columns_within(grid, span(middle_m(grid, row))).len();
            (0..grid.rows).map(of_row).sum()
        };
        let along_line = grid.columns + grid.rows + 3;
        let of_link = |link: Segment| {
            if !has_length(link) {
                return 0;
            }
            let near = match model {
                WeightModel::Line => 0,
                WeightModel::Fresnel { wavelength_m } => {
                    let zone = FresnelLink::new(link, grid, wavelength_m);
                    walked(&|y_m| zone.span(y_m))
                }
                WeightModel::Ellipse { .. }
                | WeightModel::InverseArea { .. }
                | WeightModel::Gaussian { .. }
                | WeightModel::Exponential { .. } => {
                    walked(&|y_m| ellipse_span(link, model.reach_m(), y_m))
                }
            };
            near.max(along_line)
        };
        links.into_iter().map(of_link).sum()
    }

    /// Appends a row of other weights of the same pixels.
    pub fn append(&mut self, other: &WeightRows, row: usize) {
        for run in other.runs_of(row) {
            let first_value = self.values.len() as u32;
            self.values.extend_from_slice(other.values_of(*run));
            self.runs.push(Run {
                first_value,
                ..*run
            });
        }
        self.row_starts.push(self.runs.len() as u32);
    }

    /// Returns how many weights there are.
    pub fn values(&self) -> usize {
        self.values.len()
    }

    /// Returns how many bytes they take, about.
    pub(super) fn bytes(&self) -> usize {
        self.values.len() * size_of::<f64>() + self.runs.len() * size_of::<Run>()
    }

    /// Multiplies every pixel's weights by its factor; pixels without a factor stay as they are.
    pub fn scale_pixels(&mut self, factors: &[f64]) {
        for run in &self.runs {
            let (first, length) = (run.first_value as usize, run.length as usize);
            let pixels = factors.iter().skip(run.first_pixel as usize);
            self.values[first..first + length]
                .iter_mut()
                .zip(pixels)
                .for_each(|(value, factor)| *value *= factor);
        }
    }

    /// Appends the row of one link, as the model gives it (not rescaled).
    pub fn push(&mut self, link: Segment, grid: &PixelGrid, model: WeightModel) {
        if has_length(link) {
            match model {
                WeightModel::Line => self.push_line(link, grid),
                WeightModel::Fresnel { wavelength_m } => {
                    self.push_zone(FresnelLink::new(link, grid, wavelength_m), grid);
                }
                WeightModel::Ellipse { .. }
                | WeightModel::InverseArea { .. }
                | WeightModel::Gaussian { .. }
                | WeightModel::Exponential { .. } => self.push_ellipse(link, grid, model),
            }
        }
        self.row_starts.push(self.runs.len() as u32);
    }

    fn push_line(&mut self, link: Segment, grid: &PixelGrid) {
        self.push_lengths(chords(link, grid));
    }

    /// Appends the row of a link with its length in each box of an image, metres.
    pub(super) fn push_row(&mut self, lengths_m: Vec<(u32, f64)>) {
        self.push_lengths(lengths_m);
        self.row_starts.push(self.runs.len() as u32);
    }

    fn push_lengths(&mut self, mut lengths_m: Vec<(u32, f64)>) {
        lengths_m.sort_by_key(|(pixel, _)| *pixel);
        for (pixel, length_m) in lengths_m {
            self.push_value(pixel, length_m, true);
        }
    }

    /// Appends a value; it joins the last run where the pixels are neighbours and the run is of this row.
    fn push_value(&mut self, pixel: u32, value: f64, may_join: bool) {
        let row_start = self.row_starts[self.row_starts.len() - 1] as usize;
        if let (true, Some(run)) = (may_join, self.runs[row_start..].last_mut()) {
            if run.first_pixel + run.length == pixel {
                run.length += 1;
                self.values.push(value);
                return;
            }
            if run.first_pixel + run.length == pixel + 1 {
                self.values[(run.first_value + run.length) as usize - 1] += value;
                return;
            }
        }
        self.runs.push(Run {
            first_pixel: pixel,
            first_value: self.values.len() as u32,
            length: 1,
        });
        self.values.push(value);
    }

    /// Walks only the pixels within the ellipse of the model's reach, one run per pixel row.
    fn push_ellipse(&mut self, link: Segment, grid: &PixelGrid, model: WeightModel) {
        let (d_m, reach_m) = (link.length_m(), model.reach_m());
        let pixel_m2 = grid.dx_m() * grid.dy_m();
        for row in 0..grid.rows {
            let mut joined = false;
            for column in columns_within(grid, ellipse_span(link, reach_m, middle_m(grid, row))) {
                let pixel = grid.index(column, row);
                let excess_m = link.excess_path_m(grid.centre(pixel));
                if excess_m < reach_m {
                    self.push_value(pixel as u32, model.weight(excess_m, d_m, pixel_m2), joined);
                    joined = true;
                }
            }
        }
    }

    /// Walks only the pixels within the zone, one run per pixel row.
    fn push_zone(&mut self, link: FresnelLink, grid: &PixelGrid) {
        for row in 0..grid.rows {
            let mut joined = false;
            for column in columns_within(grid, link.span(middle_m(grid, row))) {
                let pixel = grid.index(column, row);
                let weight = link.weight(grid.centre(pixel));
                if weight > 0.0 {
                    self.push_value(pixel as u32, weight, joined);
                    joined = true;
                }
            }
        }
    }

    /// Returns the number of rows (links).
    pub(crate) fn len(&self) -> usize {
        self.row_starts.len().saturating_sub(1)
    }

    /// Returns the pixels and weights of a row.
    pub fn row(&self, row: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.runs_of(row).iter().flat_map(move |run| {
            let values = self.values_of(*run);
            (run.first_pixel as usize..).zip(values.iter().copied())
        })
    }

    /// Returns the runs of neighbouring pixels of a row: the first pixel, and the weights.
    pub(super) fn runs(&self, row: usize) -> impl Iterator<Item = (u32, &[f64])> {
        let runs = self.runs_of(row).iter();
        runs.map(|run| (run.first_pixel, self.values_of(*run)))
    }

    /// Gives W x: one value per link.
    pub fn forward(&self, image: &[f64], links: &mut [f64]) {
        let rows = 0..self.len().min(links.len());
        self.forward_lanes(rows, image.as_chunks().0, |row, [there]| links[row] = there);
    }

    /// Gives Wᵀ a: one value per pixel.
    pub fn backward(&self, links: &[f64], image: &mut [f64]) {
        image.fill(0.0);
        for (row, link) in links.iter().enumerate() {
            add_row(
                self.runs_of(row),
                &self.values,
                image.as_chunks_mut().0,
                [*link],
            );
        }
    }

    /// Gives some rows of W x of several images at once, one lane for each.
    pub(super) fn forward_lanes<const LANES: usize>(
        &self,
        rows: Range<usize>,
        images: &[[f64; LANES]],
        mut of_link: impl FnMut(usize, [f64; LANES]),
    ) {
        for row in rows {
            of_link(row, row_dots(self.runs_of(row), &self.values, images));
        }
    }

    /// Gives Wᵀ f(W x) in one pass over the weights, of several images at once, one lane for each: `of_link` is told each link
    /// with its values, and says what goes back.
    pub(super) fn there_and_back<const LANES: usize>(
        &self,
        images: &[[f64; LANES]],
        output: &mut [[f64; LANES]],
        mut of_link: impl FnMut(usize, [f64; LANES]) -> [f64; LANES],
    ) {
        output.fill([0.0; LANES]);
        for row in 0..self.len() {
            let runs = self.runs_of(row);
            let back = of_link(row, row_dots(runs, &self.values, images));
            add_row(runs, &self.values, output, back);
        }
    }

    fn runs_of(&self, row: usize) -> &[Run] {
        &self.runs[self.row_starts[row] as usize..self.row_starts[row + 1] as usize]
    }

    fn values_of(&self, run: Run) -> &[f64] {
        run.of(&self.values)
    }
}

impl Run {
    #[inline(always)]
    fn of(self, values: &[f64]) -> &[f64] {
        &values[self.first_value as usize..(self.first_value + self.length) as usize]
    }

    #[inline(always)]
    fn pixels(self) -> Range<usize> {
        self.first_pixel as usize..(self.first_pixel + self.length) as usize
    }
}

/// Returns the scalar products of a row with each lane of the images. (Compiled for wide registers too, which change no bit: each
/// operation is the same one, and none are joined.)
#[multiversion(targets("x86_64+avx2"))]
fn row_dots<const LANES: usize>(
    runs: &[Run],
    values: &[f64],
    images: &[[f64; LANES]],
) -> [f64; LANES] {
    let mut there = [0.0; LANES];
    for run in runs {
        add_dots(&mut there, run.of(values), &images[run.pixels()]);
    }
    there
}

/// Adds a multiple of a row to each lane of the images.
#[multiversion(targets("x86_64+avx2"))]
fn add_row<const LANES: usize>(
    runs: &[Run],
    values: &[f64],
    images: &mut [[f64; LANES]],
    factors: [f64; LANES],
) {
    for run in runs {
        add_scaled_lanes(&mut images[run.pixels()], run.of(values), factors);
    }
}

/// Scalar product with four independent sums, so that it does not wait for each addition. (Loops over places here and
/// below: iterators in pairs are compiled apart from what uses them, and called for every run.)
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a_fours, a_rest), (b_fours, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let mut rest = -0.0;
    for place in 0..a_rest.len().min(b_rest.len()) {
        rest += a_rest[place] * b_rest[place];
    }
    let mut sums = [0.0; 4];
    for place in 0..a_fours.len().min(b_fours.len()) {
        let (x, y) = (&a_fours[place], &b_fours[place]);
        for lane in 0..4 {
            sums[lane] += x[lane] * y[lane];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// Adds a multiple of some values to others, one to one.
#[inline(always)]
fn add_scaled(to: &mut [f64], values: &[f64], factor: f64) {
    for place in 0..to.len().min(values.len()) {
        to[place] += factor * values[place];
    }
}

/// Adds the scalar products of some values with each lane.
#[inline(always)]
fn add_dots<const LANES: usize>(to: &mut [f64; LANES], values: &[f64], lanes: &[[f64; LANES]]) {
    if LANES == 1 {
        to[0] += dot(values, lanes.as_flattened());
        return;
    }
    for place in 0..values.len().min(lanes.len()) {
        let (value, pixel) = (values[place], &lanes[place]);
        for lane in 0..LANES {
            to[lane] += value * pixel[lane];
        }
    }
}

/// Adds a multiple of some values to each lane.
#[inline(always)]
fn add_scaled_lanes<const LANES: usize>(
    to: &mut [[f64; LANES]],
    values: &[f64],
    factors: [f64; LANES],
) {
    if LANES == 1 {
        add_scaled(to.as_flattened_mut(), values, factors[0]);
        return;
    }
    for place in 0..to.len().min(values.len()) {
        let (value, pixel) = (values[place], &mut to[place]);
        for lane in 0..LANES {
            pixel[lane] += factors[lane] * value;
        }
    }
}

/// Returns whether a link has a length that is one.
fn has_length(link: Segment) -> bool {
    let d_m = link.length_m();
    d_m > 0.0 && d_m.is_finite()
}

/// Returns how far north the middles of a row of pixels are, metres.
fn middle_m(grid: &PixelGrid, row: usize) -> f64 {
    grid.centre(grid.index(0, row)).y_m
}

/// Returns the columns of pixels whose middles may lie in a span of x.
fn columns_within(grid: &PixelGrid, span: Option<(f64, f64)>) -> Range<usize> {
    let Some((low_m, high_m)) = span else {
        return 0..0;
    };
    let column = |x_m: f64| (x_m - grid.area.min.x_m) / grid.dx_m() - 0.5;
    let first = libm::floor(column(low_m)).max(0.0) as usize;
    let last = libm::ceil(column(high_m)).min(grid.columns as f64 - 1.0);
    match last < 0.0 {
        true => 0..0,
        false => first..last as usize + 1,
    }
}

/// Returns the span of x in which a horizontal line lies inside the ellipse of points with excess path under `reach_m`.
fn ellipse_span(link: Segment, reach_m: f64, y_m: f64) -> Option<(f64, f64)> {
    let d_m = link.length_m();
    let middle = link.from.toward(link.to, 0.5);
    let (ux, uy) = (link.vector().x_m / d_m, link.vector().y_m / d_m);
    let long = 4.0 / ((d_m + reach_m) * (d_m + reach_m));
    let wide = 4.0 / (reach_m * reach_m + 2.0 * reach_m * d_m);
    let up_m = y_m - middle.y_m;
    let square = ux * ux * long + uy * uy * wide;
    let half_linear = ux * uy * up_m * (long - wide);
    let constant = up_m * up_m * (uy * uy * long + ux * ux * wide) - 1.0;
    let root = half_linear * half_linear - square * constant;
    if root < 0.0 {
        return None;
    }
    let (centre, half) = (middle.x_m - half_linear / square, root.sqrt() / square);
    Some((centre - half, centre + half))
}

/// Returns the shares of the link at which it enters and leaves the grid's area.
fn shares_inside(link: Segment, grid: &PixelGrid) -> Option<(f64, f64)> {
    let (enter, leave) = grid.area.line_shares(link)?;
    let (enter, leave) = (enter.max(0.0), leave.min(1.0));
    (enter < leave).then_some((enter, leave))
}

fn length_inside_m(link: Segment, grid: &PixelGrid) -> f64 {
    shares_inside(link, grid).map_or(0.0, |(enter, leave)| (leave - enter) * link.length_m())
}

/// Returns the pixels under a link and the length in each, metres (Siddon 1985: cut at all grid lines, sort).
fn chords(link: Segment, grid: &PixelGrid) -> Vec<(u32, f64)> {
    let Some((enter, leave)) = shares_inside(link, grid) else {
        return Vec::new();
    };
    let (vector, area) = (link.vector(), grid.area);
    let mut shares = vec![enter, leave];
    let mut cut = |start: f64, step: f64, low: f64, pitch: f64, count: usize| {
        if step != 0.0 {
            let lines = (0..=count).map(|line| (low + pitch * line as f64 - start) / step);
            shares.extend(lines.filter(|share| *share > enter && *share < leave));
        }
    };
    cut(
        link.from.x_m,
        vector.x_m,
        area.min.x_m,
        grid.dx_m(),
        grid.columns,
    );
    cut(
        link.from.y_m,
        vector.y_m,
        area.min.y_m,
        grid.dy_m(),
        grid.rows,
    );
    shares.sort_by(f64::total_cmp);
    let index = |offset_m: f64, pitch: f64, count: usize| {
        ((offset_m / pitch).max(0.0) as usize).min(count - 1)
    };
    shares
        .windows(2)
        .map(|pair| {
            let middle = link.from.toward(link.to, 0.5 * (pair[0] + pair[1]));
            let column = index(middle.x_m - area.min.x_m, grid.dx_m(), grid.columns);
            let row = index(middle.y_m - area.min.y_m, grid.dy_m(), grid.rows);
            (
                grid.index(column, row) as u32,
                (pair[1] - pair[0]) * link.length_m(),
            )
        })
        .filter(|(_, length_m)| *length_m > 0.0)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Point, Rect};
    use proptest::prelude::*;

    fn grid(columns: usize, rows: usize, width_m: f64, height_m: f64) -> PixelGrid {
        PixelGrid {
            area: Rect::new(Point::new(0.0, 0.0), Point::new(width_m, height_m)),
            columns,
            rows,
        }
    }

    fn link(x0: f64, y0: f64, x1: f64, y1: f64) -> Segment {
        Segment::new(Point::new(x0, y0), Point::new(x1, y1))
    }

    fn dense(model: WeightModel, link: Segment, grid: &PixelGrid) -> Vec<f64> {
        let mut rows = WeightRows::new();
        rows.push(link, grid, model);
        let mut image = vec![0.0; grid.len()];
        rows.row(0)
            .for_each(|(pixel, weight)| image[pixel] += weight);
        image
    }

    /// facts.json, weights-001.
    #[test]
    fn the_ellipse_model_gives_the_known_row() {
        let got = dense(
            WeightModel::Ellipse { width_m: 0.3 },
            link(0.0, 0.0, 4.0, 4.0),
            &grid(4, 4, 4.0, 4.0),
        );
        let w = 0.4204482076268573;
        let expected = [w, w, 0.0, 0.0, w, w, w, 0.0, 0.0, w, w, w, 0.0, 0.0, w, w];
        for (got, expected) in got.iter().zip(expected) {
            assert!((got - expected).abs() < 1e-9, "{got} {expected}");
        }
    }

    /// facts.json, weights-007; pixels under the cut of 1e-4 are left out.
    #[test]
    fn the_gaussian_model_gives_the_known_row() {
        let got = dense(
            WeightModel::Gaussian { sd_m: 0.3 },
            link(0.0, 0.0, 4.0, 2.0),
            &grid(4, 4, 4.0, 4.0),
        );
        let expected = [
            0.9898476920150027,
            0.9966765751133034,
            0.8030568290156612,
            0.09946679033337967,
            0.09946679033337967,
            0.8030568290156612,
            0.9966765751133034,
            0.9898476920150027,
            5.288197571015294e-07,
            0.004184398309593163,
            0.09946679033337967,
            0.20252664627507122,
        ];
        for (got, expected) in got.iter().zip(expected) {
            let tolerance = if expected < 1e-4 { 1e-4 } else { 1e-9 };
            assert!((got - expected).abs() < tolerance, "{got} {expected}");
        }
    }

    #[test]
    fn a_line_is_cut_at_pixel_borders() {
        let got = dense(
            WeightModel::Line,
            link(0.0, 0.5, 3.0, 0.5),
            &grid(4, 2, 4.0, 2.0),
        );
        assert_eq!(got, [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let diagonal = dense(
            WeightModel::Line,
            link(0.0, 0.0, 2.0, 2.0),
            &grid(2, 2, 2.0, 2.0),
        );
        for (got, expected) in diagonal
            .iter()
            .zip([2.0f64.sqrt(), 0.0, 0.0, 2.0f64.sqrt()])
        {
            assert!((got - expected).abs() < 1e-9);
        }
    }

    #[test]
    fn a_link_between_the_middles_of_large_pixels_weighs_by_its_length_in_them() {
        let (grid, link) = (grid(2, 2, 8.0, 8.0), link(0.0, 4.1, 8.0, 4.1));
        for model in [
            WeightModel::InverseArea { width_m: 0.1 },
            WeightModel::Ellipse { width_m: 0.1 },
        ] {
            let rows = WeightRows::rescaled([link], &grid, model);
            let row: Vec<(usize, f64)> = rows.row(0).collect();
            assert_eq!(row, [(2, 4.0), (3, 4.0)]);
        }
    }

    proptest! {
        #[test]
        fn rows_sum_to_the_length_inside(
            x0 in -2.0..8.0f64, y0 in -2.0..8.0f64, x1 in -2.0..8.0f64, y1 in -2.0..8.0f64,
        ) {
            let (grid, link) = (grid(12, 10, 6.0, 5.0), link(x0, y0, x1, y1));
            // Counted by walking, independently of the clipping.
            let steps = 20_000;
            let inside = (0..steps).filter(|step| {
                grid.area.contains(link.from.toward(link.to, (f64::from(*step) + 0.5) / f64::from(steps)))
            }).count();
            let expected_m = link.length_m() * inside as f64 / f64::from(steps);
            let line: f64 = dense(WeightModel::Line, link, &grid).iter().sum();
            prop_assert!((line - expected_m).abs() < 2e-3, "{line} {expected_m}");
            let rows = WeightRows::rescaled([link], &grid, WeightModel::InverseArea { width_m: 0.3 });
            let sum: f64 = rows.row(0).map(|(_, weight)| weight).sum();
            prop_assert!((sum - expected_m).abs() < 2e-3, "{sum} {expected_m}");
        }

        #[test]
        fn as_many_weights_are_expected_as_there_are_at_most(
            x0 in -2.0..8.0f64, y0 in -2.0..8.0f64, x1 in -2.0..8.0f64, y1 in -2.0..8.0f64,
        ) {
            let (grid, link) = (grid(60, 50, 6.0, 5.0), link(x0, y0, x1, y1));
            let models = [
                WeightModel::Line,
                WeightModel::InverseArea { width_m: 0.3 },
                WeightModel::Exponential { decay_m: 0.1 },
                WeightModel::Fresnel { wavelength_m: 0.125 },
            ];
            for model in models {
                let there = WeightRows::rescaled([link], &grid, model).values();
                let expected = WeightRows::most_values([link], &grid, model);
                let beside = 4 * (grid.columns + grid.rows);
                prop_assert!(there <= expected && expected <= 2 * there + beside, "{there} {expected}");
            }
        }

        #[test]
        fn every_pixel_within_reach_is_in_the_row(
            x0 in 0.0..6.0f64, y0 in 0.0..5.0f64, x1 in 0.0..6.0f64, y1 in 0.0..5.0f64,
        ) {
            let (grid, link) = (grid(12, 10, 6.0, 5.0), link(x0, y0, x1, y1));
            prop_assume!(link.length_m() > 0.1);
            let got = dense(WeightModel::Ellipse { width_m: 0.4 }, link, &grid);
            for (pixel, weight) in got.iter().enumerate() {
                let centre = grid.centre(pixel);
                let way_m = link.from.distance_to(centre) + centre.distance_to(link.to);
                prop_assert_eq!(*weight > 0.0, way_m - link.length_m() < 0.4);
            }
        }

        #[test]
        fn backward_is_the_transpose_of_forward(
            x0 in 0.0..6.0f64, y0 in 0.0..5.0f64, x1 in 0.0..6.0f64, y1 in 0.0..5.0f64, a in -3.0..3.0f64,
        ) {
            let grid = grid(12, 10, 6.0, 5.0);
            let links = [link(x0, y0, x1, y1), link(0.0, 1.0, 6.0, 4.0)];
            let rows = WeightRows::rescaled(links, &grid, WeightModel::InverseArea { width_m: 0.3 });
            let image: Vec<f64> = (0..grid.len()).map(|pixel| (pixel % 7) as f64 - 2.0).collect();
            let (mut forward, mut backward) = ([0.0; 2], vec![0.0; grid.len()]);
            rows.forward(&image, &mut forward);
            rows.backward(&[a, 1.0], &mut backward);
            let left = a * forward[0] + forward[1];
            let right: f64 = backward.iter().zip(&image).map(|(x, y)| x * y).sum();
            prop_assert!((left - right).abs() < 1e-9 * (1.0 + left.abs()));
        }
    }
}
