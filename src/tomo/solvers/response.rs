//! What a radio shows of the attenuation on the straight way between two ends.
//!
//! ```text
//!   shown(u) = −10 log₁₀(10^(−u/10) + 10^(−L/10))        L = 30 dB
//! ```
//!
//! u = attenuation on the straight way, dB. Energy that goes around an obstacle adds to what comes through it, so nothing shows
//! more than about L. What a receiver's floor hides is not its business: `robust` knows which links show a least value only.

/// L: what comes around an obstacle is weaker than the free signal by this much, dB.
pub(super) const LEAK_DB: f64 = 30.0;

/// What is shown at an attenuation, and how much of one more decibel is.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Shown {
    /// dB.
    pub attenuation_db: f64,
    /// 1 for weak obstacles, towards 0 for strong ones.
    pub slope: f64,
}

/// Returns what is shown of an attenuation.
pub(super) fn shown(attenuation_db: f64) -> Shown {
    let power = |decibel: f64| libm::exp(-decibel * std::f64::consts::LN_10 / 10.0);
    let through = power(attenuation_db);
    let all = through + power(LEAK_DB);
    Shown {
        attenuation_db: -10.0 * libm::log10(all),
        slope: through / all,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weak_obstacles_show_as_they_are_and_strong_ones_no_more_than_the_leak() {
        assert!((shown(3.0).attenuation_db - 3.0).abs() < 0.02 && shown(3.0).slope > 0.99);
        assert!((shown(LEAK_DB).attenuation_db - (LEAK_DB - 3.01)).abs() < 0.01);
        assert!((shown(LEAK_DB).slope - 0.5).abs() < 1e-12);
        assert!(shown(200.0).attenuation_db < LEAK_DB + 1e-9 && shown(200.0).slope < 1e-12);
    }

    #[test]
    fn the_slope_is_the_derivative() {
        for at_db in [-4.0, 0.0, 12.0, 29.0, 41.0] {
            let step = shown(at_db + 1e-4).attenuation_db - shown(at_db - 1e-4).attenuation_db;
            assert!((step / 2e-4 - shown(at_db).slope).abs() < 1e-6, "{at_db}");
        }
    }
}
