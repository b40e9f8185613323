//! Student-t noise with ν = 4: how little a link that is far off weighs, and how much all variances are off together.

/// ν: degrees of freedom of the noise.
pub(super) const DEGREES: f64 = 4.0;
/// The median of z² when κ is 1.
const MEDIAN_SQUARE: f64 = 0.55;
/// The least κ that is told.
const LEAST_SCALE: f64 = 1e-9;
/// Rounds in which κ is found.
const NOISE_ROUNDS: usize = 15;

/// Returns how far a residual is trusted, from its square over its variance: (ν + 1) / (ν + z²).
pub(super) fn trust(square: f64, degrees: f64) -> f64 {
    (degrees + 1.0) / (degrees + square)
}

/// Returns the variance of a link, larger the farther its residual is off.
pub(super) fn doubted(variance_db2: f64, residual_db: f64) -> f64 {
    variance_db2 / trust(residual_db * residual_db / variance_db2, DEGREES)
}

/// Returns κ, the factor on all variances under which squares of residuals over variances are most probable; it is at least
/// `least`. Iterative reweighting from a start, which is returned when there are no squares.
pub(super) fn noise_scale(squares: &[f64], start: f64, least: f64) -> f64 {
    if squares.is_empty() {
        return start;
    }
    let mut kappa = start;
    for _ in 0..NOISE_ROUNDS {
        let weighted = |square: &f64| trust(square / kappa, DEGREES) * square;
        let mean = squares.iter().map(weighted).sum::<f64>() / squares.len() as f64;
        kappa = mean.max(least);
    }
    kappa
}

/// Returns the κ under which squares of residuals over variances are most probable, whatever it was thought to be; 1 when there
/// are none.
pub(super) fn most_probable_scale(squares: &[f64]) -> f64 {
    let (mut parted, middle) = (squares.to_vec(), squares.len() / 2);
    let median = if parted.is_empty() {
        MEDIAN_SQUARE
    } else {
        *parted.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    noise_scale(squares, median / MEDIAN_SQUARE + LEAST_SCALE, LEAST_SCALE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variances_that_are_off_together_are_told() {
        // Of |t| with ν = 4 the quantiles at 0.1, 0.3, … 0.9, each as often as the others.
        let quantiles: [f64; 5] = [0.134, 0.414, 0.741, 1.190, 2.132];
        let squares: Vec<f64> = quantiles.iter().flat_map(|t| [9.0 * t * t; 20]).collect();
        let kappa = noise_scale(&squares, 1.0, 0.25);
        assert!((7.5..10.5).contains(&kappa), "{kappa}");
        // One that is wild moves it little.
        let wild: Vec<f64> = squares.iter().copied().chain([1e6]).collect();
        assert!(noise_scale(&wild, 1.0, 0.25) < 1.1 * kappa);
        assert_eq!(noise_scale(&[0.0; 3], 1.0, 0.25), 0.25);
        assert_eq!(noise_scale(&[], 2.0, 0.25), 2.0);
        assert!((most_probable_scale(&squares) - kappa).abs() < 0.01 * kappa);
        assert!((most_probable_scale(&[]) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_residual_far_off_is_trusted_by_its_square() {
        assert_eq!(trust(0.0, DEGREES), 1.25);
        assert_eq!(trust(1.0, DEGREES), 1.0);
        assert_eq!(trust(96.0, DEGREES), 0.05);
        assert_eq!(doubted(2.0, 0.0), 1.6);
        assert_eq!(doubted(2.0, 20.0), 81.6);
    }
}
