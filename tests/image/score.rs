//! How good an image is: relative error, structural similarity and correlation with the truth. Written from the
//! definitions, without code of the project.

/// Standard deviation of the window of the structural similarity, pixels.
const WINDOW_SD: f64 = 1.5;
/// Pixels at each side of the window's middle: four deviations.
const WINDOW_REACH: i64 = 6;

/// Returns the factor that brings an image nearest to the truth; never negative.
pub fn gain(image: &[f64], truth: &[f64]) -> f64 {
    (dot(image, truth) / dot(image, image).max(1e-12)).max(0.0)
}

/// Returns |a x − t| / |t| with the best gain a.
pub fn relative_error(image: &[f64], truth: &[f64]) -> f64 {
    let gain = gain(image, truth);
    let rest: Vec<f64> = image.iter().zip(truth).map(|(x, t)| gain * x - t).collect();
    (dot(&rest, &rest) / dot(truth, truth)).sqrt()
}

/// Returns the correlation coefficient of two images.
pub fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let centred = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values
            .iter()
            .map(|value| value - mean)
            .collect::<Vec<f64>>()
    };
    let (a, b) = (centred(a), centred(b));
    dot(&a, &b) / (dot(&a, &a) * dot(&b, &b)).sqrt()
}

/// Returns the mean structural similarity of an image, with its best gain and without negative values, to the truth.
pub fn structural_similarity(image: &[f64], truth: &[f64], columns: usize) -> f64 {
    let gain = gain(image, truth);
    let image: Vec<f64> = image.iter().map(|x| (gain * x).max(0.0)).collect();
    let highest = truth.iter().copied().fold(f64::MIN, f64::max);
    let range = highest - truth.iter().copied().fold(f64::MAX, f64::min);
    let (c1, c2) = ((0.01 * range).powi(2), (0.03 * range).powi(2));
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).collect::<Vec<f64>>();
    let smooth = |values: &[f64]| smoothed(values, columns);
    let (mean_a, mean_b) = (smooth(&image), smooth(truth));
    let (square_a, square_b) = (
        smooth(&product(&image, &image)),
        smooth(&product(truth, truth)),
    );
    let both = smooth(&product(&image, truth));
    let local = |k: usize| {
        let (a, b) = (mean_a[k], mean_b[k]);
        let (variance_a, variance_b) = (square_a[k] - a * a, square_b[k] - b * b);
        let covariance = both[k] - a * b;
        (2.0 * a * b + c1) * (2.0 * covariance + c2)
            / ((a * a + b * b + c1) * (variance_a + variance_b + c2))
    };
    (0..truth.len()).map(local).sum::<f64>() / truth.len() as f64
}

/// Returns the overlap, as a share of the union, of the pixels above Otsu's threshold with those above 15 % of the truth's
/// highest value.
pub fn overlap_by_otsu(image: &[f64], truth: &[f64]) -> f64 {
    let highest = truth.iter().copied().fold(f64::MIN, f64::max);
    let threshold = otsu(image);
    let pairs = image.iter().zip(truth);
    let marked = pairs.map(|(x, t)| (*x > threshold, *t > 0.15 * highest));
    let (mut both, mut either) = (0.0, 0.0);
    for (seen, there) in marked {
        both += f64::from(u8::from(seen && there));
        either += f64::from(u8::from(seen || there));
    }
    both / f64::max(either, 1.0)
}

/// Returns the middle of the bin, of 128, that parts an image's values best into two classes (Otsu 1979).
fn otsu(image: &[f64]) -> f64 {
    const BINS: usize = 128;
    let low = image.iter().copied().fold(f64::MAX, f64::min);
    let high = image.iter().copied().fold(f64::MIN, f64::max);
    let width = (high - low) / BINS as f64;
    let mut counts = [0.0; BINS];
    for value in image {
        counts[(((value - low) / width) as usize).min(BINS - 1)] += 1.0;
    }
    let middle = |bin: usize| low + (bin as f64 + 0.5) * width;
    let all: f64 = counts.iter().sum();
    let sum: f64 = (0..BINS).map(|bin| counts[bin] * middle(bin)).sum();
    let (mut below, mut sum_below, mut best) = (0.0, 0.0, (f64::MIN, low));
    for (bin, count) in counts.iter().enumerate() {
        below += count;
        sum_below += count * middle(bin);
        if below > 0.0 && below < all {
            let apart = sum_below / below - (sum - sum_below) / (all - below);
            let between = below * (all - below) * apart * apart;
            if between > best.0 {
                best = (between, middle(bin));
            }
        }
    }
    best.1
}

/// A bell-shaped mean along both axes; beyond its border the image goes on mirrored, the border pixel twice.
fn smoothed(values: &[f64], columns: usize) -> Vec<f64> {
    let rows = values.len() / columns;
    let across = along(values, rows, columns, |row, column| row * columns + column);
    let up = along(&across, columns, rows, |column, row| row * columns + column);
    (0..values.len())
        .map(|k| up[(k % columns) * rows + k / columns])
        .collect()
}

/// Smooths each of `lines` of some length; the answer holds them one after the other.
fn along(
    values: &[f64],
    lines: usize,
    length: usize,
    index: impl Fn(usize, usize) -> usize,
) -> Vec<f64> {
    let bell: Vec<f64> = (-WINDOW_REACH..=WINDOW_REACH)
        .map(|step| (-0.5 * (step as f64 / WINDOW_SD).powi(2)).exp())
        .collect();
    let total: f64 = bell.iter().sum();
    let mirrored = |at: i64| {
        let around = at.rem_euclid(2 * length as i64) as usize;
        if around < length {
            around
        } else {
            2 * length - 1 - around
        }
    };
    let mean = |line: usize, at: usize| {
        let steps = (-WINDOW_REACH..=WINDOW_REACH).zip(&bell);
        steps
            .map(|(step, weight)| weight * values[index(line, mirrored(at as i64 + step))])
            .sum::<f64>()
            / total
    };
    (0..lines)
        .flat_map(|line| (0..length).map(move |at| (line, at)))
        .map(|(line, at)| mean(line, at))
        .collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// A ramp with a bump, and a copy that is shifted and weaker: figures from a separate program.
#[test]
fn the_scores_are_those_of_the_definition() {
    let image = |shift: f64, height: f64| -> Vec<f64> {
        (0..40 * 40)
            .map(|k| {
                let (column, row) = ((k % 40) as f64, (k / 40) as f64);
                let away = (column - 20.0 - shift).powi(2) + (row - 10.0).powi(2);
                height * (-away / 20.0).exp() + 0.01 * row
            })
            .collect()
    };
    let (truth, other) = (image(0.0, 1.0), image(3.0, 0.8));
    assert!((structural_similarity(&truth, &truth, 40) - 1.0).abs() < 1e-12);
    assert!((structural_similarity(&other, &truth, 40) - 0.90459516).abs() < 1e-6);
    assert!((relative_error(&other, &truth) - 0.30024028).abs() < 1e-6);
    assert!((correlation(&other, &truth) - 0.84139267).abs() < 1e-6);
    assert!((overlap_by_otsu(&other, &truth) - 0.71247740).abs() < 1e-6);
}
