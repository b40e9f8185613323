//! The most probable image link by link: after each link it is that of the batch, x = C Wᵀ (W C Wᵀ + S)⁻¹ y, with its
//! deviation.
//!
//! Of the two forms of the same formula the one is taken whose memory fits the image ([`MOST_IN_PIXELS`]):
//!
//! ```text
//!   pixels   p = P w,  κ = wᵀp + s²,  x += p (y − wᵀx) / κ,  P −= p pᵀ / κ               N² / 2 numbers, N pixels
//!   links    k = W C w,  l = J k,  d² = wᵀC w + s² − lᵀl,  J gets the row [−lᵀJ, 1] / d  M² / 2 numbers, M links
//! ```
//!
//! P = posterior covariance, C = prior covariance, S = noise of the links, J = the inverse of the Cholesky factor of W C Wᵀ +
//! S, which is read once for each link: l_i and l_i J_i by the same row. Nuisance columns H with prior variances B are
//! unknowns beside the pixels. Links that are known together are taken together ([`StreamingMap::add`]), which costs less
//! than one by one. Noise is Gaussian here; robust weights are [`super::map_solver`]'s.

use super::cholesky::add_scaled;
use super::dense::{LowerTriangle, add_four};
use super::map_solver::Nuisance;
use super::prior::{Covariance, Prior, Workspace};
use super::weights::WeightRows;
use crate::geom::PixelGrid;

/// Images of at most so many pixels are held as a covariance of pixels: 50 MB. Larger ones would need more than the links do.
pub const MOST_IN_PIXELS: usize = 2_500;
/// Changes of the covariance that are collected before they are applied in one pass over it.
const PENDING: usize = 16;

/// Links of which the products with all others are found in one pass.
const TOGETHER: usize = 16;

/// A link to be added: a row of the weights, what it lost, and how surely.
#[derive(Clone, Copy, Debug)]
pub struct StreamedLink<'a> {
    /// Weights, of which the row counts.
    pub rows: &'a WeightRows,
    /// Which row.
    pub row: usize,
    /// H: the effect of one unit of each nuisance on this link, dB; as many as the image was made with.
    pub effects: &'a [f64],
    /// Attenuation, dB.
    pub attenuation_db: f64,
    /// Its variance, dB²; positive.
    pub variance_db2: f64,
}

/// An image that links are added to.
#[derive(Clone, Debug)]
pub struct StreamingMap {
    covariance: Covariance,
    prior: Prior,
    /// B: prior variances of the nuisances.
    nuisance_variances: Vec<f64>,
    form: Form,
    image: Vec<f64>,
    nuisance: Vec<f64>,
    work: Workspace,
}

#[derive(Clone, Debug)]
enum Form {
    Pixels(OfPixels),
    Links(OfLinks),
}

/// P, of pixels and then nuisances, as a full matrix, since its rows are read as columns.
#[derive(Clone, Debug)]
struct OfPixels {
    size: usize,
    values: Vec<f64>,
    /// p / √κ of links that are not in the matrix yet.
    pending: Vec<Vec<f64>>,
}

/// J with what it was made of.
#[derive(Clone, Debug)]
struct OfLinks {
    rows: WeightRows,
    /// H, a row for each link.
    effects: Vec<Vec<f64>>,
    /// J row after row, each up to its diagonal.
    inverse: Vec<f64>,
    /// α = K⁻¹ y.
    dual: Vec<f64>,
    /// y.
    attenuation_db: Vec<f64>,
}

impl StreamingMap {
    /// Makes the image of no link; the nuisances have these prior variances.
    pub fn new(grid: &PixelGrid, prior: Prior, nuisance_variances: &[f64]) -> StreamingMap {
        let pixels = grid.len();
        let form = if pixels <= MOST_IN_PIXELS {
            Form::Pixels(OfPixels::of_prior(grid, prior, nuisance_variances))
        } else {
            Form::Links(OfLinks::new())
        };
        StreamingMap {
            covariance: Covariance::new(grid, prior),
            prior,
            nuisance_variances: nuisance_variances.to_vec(),
            form,
            image: vec![0.0; pixels],
            nuisance: vec![0.0; nuisance_variances.len()],
            work: Workspace::default(),
        }
    }

    /// Adds a link; returns whether the numbers allowed that. If not, nothing has changed.
    pub fn push(&mut self, link: StreamedLink<'_>) -> bool {
        let is_sound = link.variance_db2 > 0.0
            && link.variance_db2.is_finite()
            && link.attenuation_db.is_finite()
            && link.effects.len() == self.nuisance.len();
        if !is_sound {
            return false;
        }
        match &mut self.form {
            Form::Pixels(form) => form.push(link, &mut self.image, &mut self.nuisance),
            Form::Links(_) => self.push_in_links(link),
        }
    }

    /// Takes a link out again that was added with just these numbers; only where the image is held by pixels
    /// ([`MOST_IN_PIXELS`]). Returns whether it was.
    pub fn remove(&mut self, link: StreamedLink<'_>) -> bool {
        let is_sound = link.variance_db2 > 0.0 && link.effects.len() == self.nuisance.len();
        match &mut self.form {
            Form::Pixels(form) if is_sound => {
                let negative = StreamedLink {
                    variance_db2: -link.variance_db2,
                    ..link
                };
                form.push(negative, &mut self.image, &mut self.nuisance)
            }
            Form::Pixels(_) | Form::Links(_) => false,
        }
    }

    /// Applies what was put off, while nothing waits for an image.
    pub fn settle(&mut self) {
        match &mut self.form {
            Form::Pixels(form) => form.settle(),
            Form::Links(_) => {}
        }
    }

    /// Returns the image, dB/m, row-major from the south-west.
    pub fn image(&self) -> &[f64] {
        &self.image
    }

    /// Returns the coefficients of the nuisances.
    pub fn nuisance(&self) -> &[f64] {
        &self.nuisance
    }

    /// Returns the standard deviation of a pixel, dB/m.
    pub fn deviation(&mut self, pixel: usize) -> f64 {
        let variance = match &self.form {
            Form::Pixels(form) => form.variance(pixel),
            Form::Links(form) => {
                let mut unit = vec![0.0; self.image.len()];
                unit[pixel] = 1.0;
                let mut alike = unit.clone();
                self.covariance.apply(&unit, &mut alike, &mut self.work);
                let mut known = vec![0.0; form.rows.len()];
                form.rows.forward(&alike, &mut known);
                self.prior.variance - form.forward(&known).iter().map(|l| l * l).sum::<f64>()
            }
        };
        variance.max(0.0).sqrt()
    }

    /// Returns how many bytes it holds, all but the constant ones.
    pub fn bytes(&self) -> usize {
        8 * match &self.form {
            Form::Pixels(form) => form.values.len() + form.pending.len() * form.size,
            Form::Links(form) => form.inverse.len() + form.rows.values() + form.dual.len() * 2,
        }
    }

    fn push_in_links(&mut self, link: StreamedLink<'_>) -> bool {
        let Form::Links(form) = &mut self.form else {
            return false;
        };
        let mut weights = vec![0.0; self.image.len()];
        link.rows
            .row(link.row)
            .for_each(|(pixel, weight)| weights[pixel] += weight);
        let mut alike = vec![0.0; self.image.len()];
        self.covariance.apply(&weights, &mut alike, &mut self.work);
        let mut column = vec![0.0; form.rows.len()];
        form.rows.forward(&alike, &mut column);
        let shared = |effects: &[f64]| -> f64 {
            let of_link = effects.iter().zip(link.effects);
            let terms = of_link.zip(&self.nuisance_variances);
            terms
                .map(|((own, other), variance)| own * other * variance)
                .sum()
        };
        let own: f64 = link
            .rows
            .row(link.row)
            .map(|(pixel, weight)| weight * alike[pixel])
            .sum();
        column
            .iter_mut()
            .zip(&form.effects)
            .for_each(|(entry, effects)| *entry += shared(effects));
        let diagonal = own + shared(link.effects) + link.variance_db2;
        if !form.border(&column, diagonal, link) {
            return false;
        }
        form.rows.append(link.rows, link.row);
        form.effects.push(link.effects.to_vec());
        self.find_image();
        true
    }

    /// Finds image and nuisances by the dual variables.
    fn find_image(&mut self) {
        let Form::Links(form) = &self.form else {
            return;
        };
        let mut back = vec![0.0; self.image.len()];
        form.rows.backward(&form.dual, &mut back);
        self.covariance
            .apply(&back, &mut self.image, &mut self.work);
        for (k, (value, variance)) in self
            .nuisance
            .iter_mut()
            .zip(&self.nuisance_variances)
            .enumerate()
        {
            let shares = form.effects.iter().zip(&form.dual);
            *value = variance * shares.map(|(effects, dual)| effects[k] * dual).sum::<f64>();
        }
    }

    /// Adds links that are known together: rows of weights, attenuations, variances, and a column for each nuisance. Returns
    /// whether the numbers allowed that; if not, nothing has changed.
    pub fn add(
        &mut self,
        rows: &WeightRows,
        attenuation_db: &[f64],
        variance_db2: &[f64],
        nuisance: &[Nuisance],
    ) -> bool {
        let effects: Vec<Vec<f64>> = (0..rows.len())
            .map(|row| nuisance.iter().map(|column| column.column[row]).collect())
            .collect();
        let is_first = matches!(&self.form, Form::Links(form) if form.rows.len() == 0);
        if is_first {
            return self.begin(rows, attenuation_db, variance_db2, effects);
        }
        let before = self.clone();
        for row in 0..rows.len() {
            let link = StreamedLink {
                rows,
                row,
                effects: &effects[row],
                attenuation_db: attenuation_db[row],
                variance_db2: variance_db2[row],
            };
            if !self.push(link) {
                *self = before;
                return false;
            }
        }
        true
    }

    /// Takes the first links in link space: K as a whole, then its factor and the inverse of that.
    fn begin(
        &mut self,
        rows: &WeightRows,
        attenuation_db: &[f64],
        variance_db2: &[f64],
        effects: Vec<Vec<f64>>,
    ) -> bool {
        let gram = self.gram(rows);
        let entry = |i: usize, j: usize| {
            let of_links = effects[i]
                .iter()
                .zip(&effects[j])
                .zip(&self.nuisance_variances);
            let shared: f64 = of_links
                .map(|((own, other), variance)| own * other * variance)
                .sum();
            gram[i * (i + 1) / 2 + j] + shared + if i == j { variance_db2[i] } else { 0.0 }
        };
        let Some(factor) = LowerTriangle::of(rows.len(), entry).factor() else {
            return false;
        };
        drop(gram);
        let inverse = factor.inverse_of_factor();
        let mut form = OfLinks {
            rows: rows.clone(),
            effects,
            inverse: Vec::with_capacity(rows.len() * (rows.len() + 1) / 2),
            dual: vec![0.0; rows.len()],
            attenuation_db: attenuation_db.to_vec(),
        };
        for i in 0..rows.len() {
            let row = inverse.row(i);
            let told = dot(row, &attenuation_db[..=i]);
            add_scaled(&mut form.dual, row, told);
            form.inverse.extend_from_slice(row);
        }
        self.form = Form::Links(form);
        self.find_image();
        true
    }

    /// Returns the lower triangle of W C Wᵀ, row after row: some links at a time, so that all weights are read once for those.
    fn gram(&mut self, rows: &WeightRows) -> Vec<f64> {
        let triangle = |i: usize| i * (i + 1) / 2;
        let mut gram = vec![0.0; triangle(rows.len())];
        let mut weights = vec![0.0; self.image.len()];
        let mut alike = vec![0.0; self.image.len()];
        let mut together = vec![[0.0; TOGETHER]; self.image.len()];
        for first in (0..rows.len()).step_by(TOGETHER) {
            let last = rows.len().min(first + TOGETHER);
            for i in first..last {
                weights.fill(0.0);
                rows.row(i)
                    .for_each(|(pixel, weight)| weights[pixel] += weight);
                self.covariance.apply(&weights, &mut alike, &mut self.work);
                for (lanes, value) in together.iter_mut().zip(&alike) {
                    lanes[i - first] = *value;
                }
            }
            rows.forward_lanes(0..last, &together, |j, entries| {
                for i in first.max(j)..last {
                    gram[triangle(i) + j] = entries[i - first];
                }
            });
        }
        gram
    }
}

impl OfPixels {
    fn of_prior(grid: &PixelGrid, prior: Prior, nuisance_variances: &[f64]) -> OfPixels {
        let (pixels, columns) = (grid.len(), grid.columns);
        let size = pixels + nuisance_variances.len();
        let covariance_at = |x: usize, y: usize| {
            let (x_m, y_m) = (x as f64 * grid.dx_m(), y as f64 * grid.dy_m());
            prior.variance * libm::exp(-(x_m * x_m + y_m * y_m).sqrt() / prior.length_m)
        };
        let table: Vec<f64> = (0..pixels)
            .map(|apart| covariance_at(apart % columns, apart / columns))
            .collect();
        let mut values = vec![0.0; size * size];
        for (i, row) in values.chunks_exact_mut(size).enumerate() {
            if i >= pixels {
                row[i] = nuisance_variances[i - pixels];
                continue;
            }
            for (j, value) in row[..pixels].iter_mut().enumerate() {
                let x = (i % columns).abs_diff(j % columns);
                *value = table[(i / columns).abs_diff(j / columns) * columns + x];
            }
        }
        OfPixels {
            size,
            values,
            pending: Vec::new(),
        }
    }

    /// Adds a link, or takes one out, if its variance is negative.
    fn push(&mut self, link: StreamedLink<'_>, image: &mut [f64], nuisance: &mut [f64]) -> bool {
        if self.pending.len() >= PENDING || link.variance_db2 < 0.0 {
            self.settle();
        }
        let pixels = image.len();
        let weights: Vec<(usize, f64)> = link
            .rows
            .row(link.row)
            .chain((pixels..).zip(link.effects.iter().copied()))
            .collect();
        let mut gain = vec![0.0; self.size];
        for (unknown, weight) in &weights {
            let row = &self.values[unknown * self.size..(unknown + 1) * self.size];
            add_scaled(&mut gain, row, *weight);
        }
        for known in &self.pending {
            let along: f64 = weights
                .iter()
                .map(|(unknown, weight)| weight * known[*unknown])
                .sum();
            add_scaled(&mut gain, known, -along);
        }
        let expected = |(unknown, weight): &(usize, f64)| {
            let value = image
                .get(*unknown)
                .or_else(|| nuisance.get(unknown - pixels));
            weight * value.copied().unwrap_or(0.0)
        };
        let off_db = link.attenuation_db - weights.iter().map(expected).sum::<f64>();
        let spread: f64 = weights
            .iter()
            .map(|(unknown, weight)| weight * gain[*unknown])
            .sum();
        let total = spread + link.variance_db2;
        let is_sound = total.is_finite() && (total > 0.0) == (link.variance_db2 > 0.0);
        if !is_sound || total == 0.0 {
            return false;
        }
        add_scaled(image, &gain[..pixels], off_db / total);
        add_scaled(nuisance, &gain[pixels..], off_db / total);
        if total > 0.0 {
            let scale = 1.0 / total.sqrt();
            gain.iter_mut().for_each(|value| *value *= scale);
            self.pending.push(gain);
            return true;
        }
        for (i, row) in self.values.chunks_exact_mut(self.size).enumerate() {
            add_scaled(row, &gain, -gain[i] / total);
        }
        true
    }

    fn variance(&self, unknown: usize) -> f64 {
        let known = self
            .pending
            .iter()
            .map(|gain| gain[unknown] * gain[unknown]);
        self.values[unknown * self.size + unknown] - known.sum::<f64>()
    }

    /// Applies the changes that were collected: four at a time, so that the matrix is read a quarter as often.
    fn settle(&mut self) {
        let size = self.size;
        for four in self.pending.chunks(4) {
            for (i, row) in self.values.chunks_exact_mut(size).enumerate() {
                if let [a, b, c, d] = four {
                    add_four(row, [a, b, c, d], [-a[i], -b[i], -c[i], -d[i]]);
                } else {
                    four.iter().for_each(|gain| add_scaled(row, gain, -gain[i]));
                }
            }
        }
        self.pending.clear();
    }
}

impl OfLinks {
    fn new() -> OfLinks {
        OfLinks {
            rows: WeightRows::new(),
            effects: Vec::new(),
            inverse: Vec::new(),
            dual: Vec::new(),
            attenuation_db: Vec::new(),
        }
    }

    /// Returns J k.
    fn forward(&self, column: &[f64]) -> Vec<f64> {
        let mut start = 0;
        (0..column.len())
            .map(|i| {
                let row = &self.inverse[start..=start + i];
                start += i + 1;
                dot(row, &column[..=i])
            })
            .collect()
    }

    /// Adds a row and a column to K, and with them a row to J and an entry to α; returns whether K stays positive definite.
    fn border(&mut self, column: &[f64], diagonal: f64, link: StreamedLink<'_>) -> bool {
        let mut turned = vec![0.0; column.len()];
        let mut square = 0.0;
        let whole = column.len() / 4 * 4;
        let mut unread = self.inverse.as_slice();
        for first in (0..whole).step_by(4) {
            let rows: [&[f64]; 4] = std::array::from_fn(|own| {
                let (row, rest) = unread.split_at(first + own + 1);
                unread = rest;
                row
            });
            let known = four_products(rows, column);
            square += known.iter().map(|l| l * l).sum::<f64>();
            add_four_growing(&mut turned, rows, known);
        }
        for i in whole..column.len() {
            let (row, rest) = unread.split_at(i + 1);
            unread = rest;
            let l = dot(row, &column[..=i]);
            square += l * l;
            add_scaled(&mut turned, row, l);
        }
        let rest = diagonal - square;
        if !(rest > 0.0 && rest.is_finite()) {
            return false;
        }
        let scale = 1.0 / rest.sqrt();
        turned.iter_mut().for_each(|value| *value *= -scale);
        turned.push(scale);
        self.attenuation_db.push(link.attenuation_db);
        self.dual.push(0.0);
        let told = dot(&turned, &self.attenuation_db);
        add_scaled(&mut self.dual, &turned, told);
        self.inverse.extend_from_slice(&turned);
        true
    }
}

/// Returns the inner products of four rows, each one longer than that before it, with the beginning of a column: what they have
/// in common is read once.
fn four_products(rows: [&[f64]; 4], column: &[f64]) -> [f64; 4] {
    let common = rows[0].len();
    let [a, b, c, d] = rows.map(|row| &row[..common]);
    let mut sums = [[0.0; 2]; 4];
    let pairs = a.chunks_exact(2).zip(b.chunks_exact(2));
    let pairs = pairs.zip(c.chunks_exact(2).zip(d.chunks_exact(2)));
    for (((a, b), (c, d)), with) in pairs.zip(column.chunks_exact(2)) {
        for lane in 0..2 {
            sums[0][lane] += a[lane] * with[lane];
            sums[1][lane] += b[lane] * with[lane];
            sums[2][lane] += c[lane] * with[lane];
            sums[3][lane] += d[lane] * with[lane];
        }
    }
    let from = common / 2 * 2;
    std::array::from_fn(|own| {
        let rest = rows[own][from..].iter().zip(&column[from..]);
        let rest: f64 = rest.map(|(value, with)| value * with).sum();
        sums[own][0] + sums[own][1] + rest
    })
}

/// Adds four rows, each one longer than that before it, each times a factor.
fn add_four_growing(to: &mut [f64], rows: [&[f64]; 4], factors: [f64; 4]) {
    let common = rows[0].len();
    add_four(&mut to[..common], rows, factors);
    for (row, factor) in rows.into_iter().zip(factors) {
        add_scaled(&mut to[common..], &row[common..], factor);
    }
}

/// Returns the inner product with four independent sums, in a fixed order.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a_fours, a_rest), (b_fours, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let mut sums = [0.0; 4];
    for (x, y) in a_fours.iter().zip(b_fours) {
        for lane in 0..4 {
            sums[lane] += x[lane] * y[lane];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

#[cfg(test)]
mod tests;
