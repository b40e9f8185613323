//! Chance as a pure function of seed, purpose and numbers: asking twice changes nothing.

/// The chance of one seed.
#[derive(Clone, Copy, Debug)]
pub struct Chance {
    seed: u64,
}

impl Chance {
    /// Makes the chance of a seed.
    pub fn new(seed: u64) -> Chance {
        Chance { seed }
    }

    /// Returns a number evenly distributed in [0, 1).
    pub fn share(&self, purpose: &str, ids: &[u64]) -> f64 {
        (self.bits(purpose, ids) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns a number below `end`.
    pub fn below(&self, purpose: &str, ids: &[u64], end: usize) -> usize {
        (self.share(purpose, ids) * end as f64) as usize
    }

    fn bits(&self, purpose: &str, ids: &[u64]) -> u64 {
        let words = purpose.bytes().map(u64::from).chain(ids.iter().copied());
        words.fold(mix(self.seed), |state, word| {
            mix(state.wrapping_add(0x9E37_79B9_7F4A_7C15)
                ^ mix(word.wrapping_add(0x9E37_79B9_7F4A_7C15)))
        })
    }
}

/// SplitMix64's finaliser (Steele, Lea and Flood 2014).
fn mix(value: u64) -> u64 {
    let value = (value ^ (value >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    value ^ (value >> 31)
}
