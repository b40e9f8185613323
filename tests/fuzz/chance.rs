//! Numbers that look random and follow from a seed alone (SplitMix64, Steele et al. 2014).

/// A source of numbers.
pub struct Chance(u64);

impl Chance {
    /// Begins the numbers of a seed.
    pub fn new(seed: u64) -> Chance {
        Chance(seed.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ 0x5851_f42d_4c95_7f2d)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^ (bits >> 31)
    }

    /// Returns a number from 0 to below 1.
    pub fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns a number between two, to two decimals.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        ((low + (high - low) * self.share()) * 100.0).round() / 100.0
    }

    /// Returns a whole number below another.
    pub fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    /// Returns whether something of this probability happens.
    pub fn happens(&mut self, share: f64) -> bool {
        self.share() < share
    }

    /// Returns one of these.
    pub fn one_of<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }
}
