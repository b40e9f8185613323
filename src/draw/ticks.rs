//! Ticks of an axis at steps of 1, 2 or 5 times a power of ten, and numbers as short text.

/// A mark on an axis.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Tick {
    /// Where, in the axis's unit.
    pub(super) value: f64,
    /// What is written there.
    pub(super) label: String,
}

/// Returns the smallest step of 1, 2 or 5 times a power of ten that cuts `span` into at most `most` pieces.
/// `None` when there is no such number (span not positive, not finite, or too small for f64).
pub(super) fn step(span: f64, most: usize) -> Option<f64> {
    let rough = span / most.max(1) as f64;
    if !rough.is_finite() || rough <= 0.0 {
        return None;
    }
    let power = power_of_ten(libm::floor(libm::log10(rough)) as i32);
    let factors = [1.0, 2.0, 5.0, 10.0];
    let factor = factors
        .into_iter()
        .find(|factor| factor * power >= rough * (1.0 - 1e-9))?;
    Some(factor * power).filter(|step| step.is_normal())
}

/// Returns the ticks between `low` and `high`, both ends included, at most `most` + 1 of them.
pub(super) fn ticks(low: f64, high: f64, most: usize) -> Vec<Tick> {
    let Some(step) = step(high - low, most) else {
        return Vec::new();
    };
    let (first, last) = (
        libm::ceil(low / step - 1e-6),
        libm::floor(high / step + 1e-6),
    );
    let count = last - first + 1.0;
    if !(first.abs() < 1e15 && last.abs() < 1e15 && count <= most as f64 + 2.0) {
        return Vec::new();
    }
    let size = low.abs().max(high.abs());
    let value = |index: usize| (first + index as f64) * step;
    (0..count.max(0.0) as usize)
        .map(|i| Tick {
            value: value(i),
            label: label(value(i), step, size),
        })
        .collect()
}

/// Writes a number with about three digits.
pub(super) fn number(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e5).contains(&size) {
        return format!("{value:.1e}");
    }
    let decimals = if size == 0.0 {
        2
    } else if size >= 100.0 {
        0
    } else if size >= 10.0 {
        1
    } else if size >= 0.1 {
        2
    } else if size >= 0.01 {
        3
    } else {
        4
    };
    plain(value, decimals)
}

/// Writes a tick's value with just the digits its step needs.
fn label(value: f64, step: f64, size: f64) -> String {
    let (step_power, size_power) = (exponent(step), exponent(size));
    if size_power >= 6 || step_power < -5 {
        let digits = (size_power - step_power).clamp(0, 6) as usize;
        return if value == 0.0 {
            "0".to_string()
        } else {
            format!("{value:.digits$e}")
        };
    }
    plain(value, (-step_power).max(0) as usize)
}

/// Writes a number with a fixed count of decimals, never as minus zero.
fn plain(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let zero = !text.contains(|c: char| ('1'..='9').contains(&c));
    if zero {
        text.trim_start_matches('-').to_string()
    } else {
        text
    }
}

fn exponent(value: f64) -> i32 {
    // The small surplus keeps 0.001, whose logarithm may fall just short, in its own decade.
    libm::floor(libm::log10(value) + 1e-9) as i32
}

fn power_of_ten(exponent: i32) -> f64 {
    // Dividing by an exact power gives the double nearest to 0.1, 0.01 and so on.
    if exponent < 0 {
        1.0 / libm::pow(10.0, f64::from(-exponent))
    } else {
        libm::pow(10.0, f64::from(exponent))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn check(low: f64, high: f64, most: usize, expected: &[&str]) {
        let labels: Vec<String> = ticks(low, high, most)
            .into_iter()
            .map(|tick| tick.label)
            .collect();
        assert_eq!(labels, expected);
    }

    #[test]
    fn ticks_stand_at_round_numbers() {
        check(0.0, 20.0, 5, &["0", "5", "10", "15", "20"]);
        check(-0.3, 0.31, 6, &["-0.2", "0.0", "0.2"]);
        check(
            -0.3,
            0.31,
            7,
            &["-0.3", "-0.2", "-0.1", "0.0", "0.1", "0.2", "0.3"],
        );
        check(
            0.0,
            0.004,
            4,
            &["0.000", "0.001", "0.002", "0.003", "0.004"],
        );
        check(0.0, 3e7, 3, &["0", "1e7", "2e7", "3e7"]);
        check(995.0, 1012.0, 4, &["995", "1000", "1005", "1010"]);
    }

    #[test]
    fn impossible_spans_have_no_ticks() {
        for (low, high) in [
            (1.0, 1.0),
            (2.0, 1.0),
            (0.0, f64::INFINITY),
            (f64::NAN, 1.0),
            (-1e308, 1e308),
            (1e15, 1e15 + 1.0),
        ] {
            let marks = ticks(low, high, 5);
            assert!(marks.len() <= 7, "{low} {high}");
        }
        assert_eq!(step(0.0, 5), None);
        assert_eq!(step(5e-324, 5), None);
    }

    #[test]
    fn numbers_are_short() {
        let texts: Vec<String> = [0.0, -0.0001, -0.346, 0.0742, 12.34, 250.0, 3e-7]
            .into_iter()
            .map(number)
            .collect();
        assert_eq!(
            texts,
            ["0.00", "-1.0e-4", "-0.35", "0.074", "12.3", "250", "3.0e-7"]
        );
    }

    proptest! {
        #[test]
        fn a_step_is_the_smallest_of_its_kind(span in 1e-9..1e9f64, most in 1usize..20) {
            let step = step(span, most).unwrap();
            prop_assert!(span / step <= most as f64 * (1.0 + 1e-6));
            let text = format!("{step:.3e}");
            prop_assert!(["1.000e", "2.000e", "5.000e"].iter().any(|head| text.starts_with(head)), "{}", text);
            // The next smaller step, at most 2.5 times smaller, would cut too often.
            let smaller = if text.starts_with('5') { step / 2.5 } else { step / 2.0 };
            prop_assert!(span / smaller > most as f64 * (1.0 - 1e-6));
        }
    }
}
