//! Sums and differences of numbers that people wrote in decimals, as people would have written them.

/// Returns a number to nine decimals: 8.3 − 0.1 is 8.2 and not 8.200000000000001.
pub fn without_dust(number: f64) -> f64 {
    (number * 1e9).round() / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_of_decimals_reads_like_one() {
        assert_eq!((8.3_f64 - 0.1).to_string(), "8.200000000000001");
        assert_eq!(without_dust(8.3 - 0.1).to_string(), "8.2");
        assert_eq!(without_dust(-0.325_75), -0.325_75);
    }
}
