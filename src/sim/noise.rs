//! All chance of the simulation: a pure function of seed, purpose and ids. There is no state and no
//! stream, so asking twice changes nothing and a new observer changes nobody's noise.
//!
//! Not for secrets: the hash is SplitMix64's finaliser (Steele, Lea and Flood 2014), once per id.

use std::time::Duration;

use crate::time::Time;

/// What a piece of noise is for; the same ids give independent noise for different purposes. New
/// purposes come last, so that a seed goes on giving the same.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum NoisePurpose {
    /// Error of a vehicle's pose, along x.
    PoseX,
    /// Error of a vehicle's pose, along y.
    PoseY,
    /// Error of a range reading. (Number 2 is free.)
    Range = 3,
    /// Directions and phases of the waves of the radio field.
    RadioField,
    /// Strength of one radio packet.
    PacketStrength,
    /// Whether one radio packet is lost.
    PacketLoss,
    /// Delay of a message on the bus.
    BusDelay,
    /// Whether the bus drops a message.
    BusDrop,
    /// Whether the bus delivers a message twice.
    BusDuplicate,
    /// Order of events at the same moment.
    TieOrder,
    /// Where a scenario places persons and objects.
    Placement,
    /// When the nodes of a scenario start.
    Start,
    /// Whether a range reading is a glitch.
    Glitch,
    /// How far away a glitch seems to be.
    GlitchRange,
    /// By what a node is told from another one of its name.
    Instance,
    /// Whether a radio module finds the channel busy all the time.
    BusyChannel,
    /// How long a radio module waits for the channel.
    BackOff,
    /// Whether a radio module says a packet twice.
    PacketDuplicate,
    /// What is read of a byte at another baud rate.
    SerialGarbage,
    /// How much stronger than others a vehicle's radio sends.
    TransmitterOffset,
    /// How much stronger than others a vehicle's radio reports what it receives.
    ReceiverOffset,
}

/// The noise of one seed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Noise {
    seed: u64,
}

const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// SplitMix64's finaliser: a bijection in which every input bit moves half of the output bits.
#[inline]
fn mix(value: u64) -> u64 {
    let value = (value ^ (value >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    value ^ (value >> 31)
}

#[inline]
fn fold(state: u64, id: u64) -> u64 {
    mix(state.wrapping_add(GOLDEN) ^ mix(id.wrapping_add(GOLDEN)))
}

/// Middle of one of 2⁵³ equal parts of (0, 1), so neither 0 nor 1.
#[inline]
fn open_unit(bits: u64) -> f64 {
    ((bits >> 11) as f64 + 0.5) * (1.0 / (1u64 << 53) as f64)
}

impl Noise {
    /// Makes the noise of a seed.
    #[inline]
    pub const fn new(seed: u64) -> Noise {
        Noise { seed }
    }

    /// Returns 64 well mixed bits.
    #[inline]
    pub fn hash(&self, purpose: NoisePurpose, ids: &[u64]) -> u64 {
        ids.iter()
            .fold(fold(mix(self.seed), purpose as u64), |state, id| {
                fold(state, *id)
            })
    }

    /// Returns a number evenly distributed in [0, 1).
    #[inline]
    pub fn uniform(&self, purpose: NoisePurpose, ids: &[u64]) -> f64 {
        (self.hash(purpose, ids) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Returns a normally distributed number of mean 0 and standard deviation 1.
    #[inline]
    pub fn gaussian(&self, purpose: NoisePurpose, ids: &[u64]) -> f64 {
        normal_quantile(open_unit(self.hash(purpose, ids)))
    }

    /// Returns a function of time that is normally distributed with mean 0 and standard deviation 1 at
    /// every moment, twice differentiable, and correlated with itself by one half after `correlation`
    /// and not at all after four times that.
    ///
    /// Cubic B-spline over normal knots, divided by the root of the sum of its squared weights.
    pub fn smooth(
        &self,
        purpose: NoisePurpose,
        ids: &[u64],
        t: Time,
        correlation: Duration,
    ) -> f64 {
        let pitch_ns = u64::try_from(correlation.as_nanos())
            .unwrap_or(u64::MAX)
            .max(1);
        let (first, rest_ns) = (t.as_nanos() / pitch_ns, t.as_nanos() % pitch_ns);
        let f = rest_ns as f64 / pitch_ns as f64;
        let g = 1.0 - f;
        let weights = [
            g * g * g,
            4.0 + 3.0 * f * f * (f - 2.0),
            4.0 + 3.0 * g * g * (g - 2.0),
            f * f * f,
        ];
        let state = self.hash(purpose, ids);
        let (mut sum, mut square) = (0.0, 0.0);
        for (offset, weight) in (0..).zip(weights) {
            let knot = fold(state, first.wrapping_add(offset));
            sum += weight * normal_quantile(open_unit(knot));
            square += weight * weight;
        }
        sum / f64::sqrt(square)
    }
}

/// Inverse of the normal distribution function for 0 < p < 1, to about 1e-16 (Wichura 1988, AS 241,
/// PPND16).
pub fn normal_quantile(p: f64) -> f64 {
    let q = p - 0.5;
    if q.abs() <= 0.425 {
        let r = 0.180625 - q * q;
        return q * ratio(r, &CENTRE);
    }
    let r = (-libm::log(if q < 0.0 { p } else { 1.0 - p })).sqrt();
    let value = if r <= 5.0 {
        ratio(r - 1.6, &NEAR_TAIL)
    } else {
        ratio(r - 5.0, &FAR_TAIL)
    };
    value.copysign(q)
}

#[inline]
fn ratio(r: f64, coefficients: &[[f64; 8]; 2]) -> f64 {
    let [above, below] = coefficients.map(|row| row.iter().rev().fold(0.0, |sum, c| sum * r + c));
    above / below
}

const CENTRE: [[f64; 8]; 2] = [
    [
        3.387_132_872_796_366_5,
        133.141_667_891_784_38,
        1_971.590_950_306_551_3,
        13_731.693_765_509_46,
        45_921.953_931_549_87,
        67_265.770_927_008_7,
        33_430.575_583_588_13,
        2_509.080_928_730_122_7,
    ],
    [
        1.0,
        42.313_330_701_600_91,
        687.187_007_492_057_9,
        5_394.196_021_424_751,
        21_213.794_301_586_597,
        39_307.895_800_092_71,
        28_729.085_735_721_943,
        5_226.495_278_852_854,
    ],
];

const NEAR_TAIL: [[f64; 8]; 2] = [
    [
        1.423_437_110_749_683_5,
        4.630_337_846_156_546,
        5.769_497_221_460_691,
        3.647_848_324_763_204_5,
        1.270_458_252_452_368_4,
        0.241_780_725_177_450_6,
        0.022_723_844_989_269_184,
        7.745_450_142_783_414e-4,
    ],
    [
        1.0,
        2.053_191_626_637_759,
        1.676_384_830_183_803_8,
        0.689_767_334_985_1,
        0.148_103_976_427_480_08,
        0.015_198_666_563_616_457,
        5.475_938_084_995_345e-4,
        1.050_750_071_644_416_9e-9,
    ],
];

const FAR_TAIL: [[f64; 8]; 2] = [
    [
        6.657_904_643_501_103,
        5.463_784_911_164_114,
        1.784_826_539_917_291_3,
        0.296_560_571_828_504_87,
        0.026_532_189_526_576_124,
        0.001_242_660_947_388_078_4,
        2.711_555_568_743_487_6e-5,
        2.010_334_399_292_288_1e-7,
    ],
    [
        1.0,
        0.599_832_206_555_888,
        0.136_929_880_922_735_8,
        0.014_875_361_290_850_615,
        7.868_691_311_456_133e-4,
        1.846_318_317_510_054_8e-5,
        1.421_511_758_316_446e-7,
        2.044_263_103_389_939_8e-15,
    ],
];

#[cfg(test)]
mod tests {
    use super::*;

    const NOISE: Noise = Noise::new(7);

    /// Mean and variance.
    fn moments(values: &[f64]) -> (f64, f64) {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let square = values
            .iter()
            .map(|value| (value - mean).powi(2))
            .sum::<f64>();
        (mean, square / values.len() as f64)
    }

    fn correlation(pairs: &[(f64, f64)]) -> f64 {
        let (a, b): (Vec<f64>, Vec<f64>) = pairs.iter().copied().unzip();
        let ((mean_a, variance_a), (mean_b, variance_b)) = (moments(&a), moments(&b));
        let product: f64 = pairs.iter().map(|(a, b)| (a - mean_a) * (b - mean_b)).sum();
        product / pairs.len() as f64 / (variance_a * variance_b).sqrt()
    }

    #[test]
    fn asking_twice_gives_the_same_and_another_key_another() {
        let ask = |seed, purpose, ids: &[u64]| Noise::new(seed).hash(purpose, ids);
        let first = ask(7, NoisePurpose::Range, &[1, 2]);
        assert_eq!(first, ask(7, NoisePurpose::Range, &[1, 2]));
        for other in [
            ask(8, NoisePurpose::Range, &[1, 2]),
            ask(7, NoisePurpose::PoseX, &[1, 2]),
            ask(7, NoisePurpose::Range, &[2, 1]),
            ask(7, NoisePurpose::Range, &[1, 2, 0]),
            ask(7, NoisePurpose::Range, &[1]),
        ] {
            assert_ne!(first, other);
        }
    }

    #[test]
    fn one_bit_of_a_key_moves_half_of_the_bits() {
        for bit in 0..64 {
            let flips: u32 = (0..500)
                .map(|id| {
                    let there = NOISE.hash(NoisePurpose::Range, &[3, id ^ (1 << bit)]);
                    (NOISE.hash(NoisePurpose::Range, &[3, id]) ^ there).count_ones()
                })
                .sum();
            let mean = f64::from(flips) / 500.0;
            assert!((mean - 32.0).abs() < 1.0, "bit {bit} moves {mean}");
        }
    }

    #[test]
    fn uniform_numbers_fill_the_unit_evenly() {
        let mut bins = [0u32; 64];
        for id in 0..64_000 {
            bins[(NOISE.uniform(NoisePurpose::BusDrop, &[id]) * 64.0) as usize] += 1;
        }
        let chi: f64 = bins
            .iter()
            .map(|count| (f64::from(*count) - 1000.0).powi(2) / 1000.0)
            .sum();
        // 63 degrees of freedom: mean 63, deviation 11.
        assert!((25.0..110.0).contains(&chi), "chi squared {chi}");
    }

    #[test]
    fn neighbouring_keys_purposes_and_seeds_are_independent() {
        let ask = |seed, purpose, id| Noise::new(seed).gaussian(purpose, &[id]);
        let pairs = |other: &dyn Fn(u64) -> f64| -> Vec<(f64, f64)> {
            (0..20_000)
                .map(|id| (ask(7, NoisePurpose::PoseX, id), other(id)))
                .collect()
        };
        for other in [
            pairs(&|id| ask(7, NoisePurpose::PoseX, id + 1)),
            pairs(&|id| ask(7, NoisePurpose::PoseY, id)),
            pairs(&|id| ask(8, NoisePurpose::PoseX, id)),
        ] {
            assert!(correlation(&other).abs() < 0.03);
        }
    }

    #[test]
    fn gaussian_numbers_have_the_moments_of_a_normal_distribution() {
        let values: Vec<f64> = (0..100_000)
            .map(|id| NOISE.gaussian(NoisePurpose::Range, &[id]))
            .collect();
        let (mean, variance) = moments(&values);
        let fourth = values.iter().map(|value| value.powi(4)).sum::<f64>() / values.len() as f64;
        assert!(mean.abs() < 0.015 && (variance - 1.0).abs() < 0.02 && (fourth - 3.0).abs() < 0.15);
    }

    #[test]
    fn quantiles_are_those_of_the_normal_table() {
        for (p, expected) in [
            (0.5, 0.0),
            (0.975, 1.959_963_984_540_054),
            (0.025, -1.959_963_984_540_054),
            (0.841_344_746_068_542_9, 1.0),
            (0.999, 3.090_232_306_167_813_5),
            (1e-9, -5.997_807_015_007_687),
            (1e-20, -9.262_340_089_798_408),
        ] {
            let got = normal_quantile(p);
            assert!((got - expected).abs() < 1e-12, "{p} gave {got}");
        }
    }

    #[test]
    fn smooth_noise_keeps_its_variance_at_and_between_knots() {
        let correlation_time = Duration::from_secs(10);
        for offset_s in [0.0, 2.5, 5.0, 9.0] {
            let values: Vec<f64> = (0..20_000)
                .map(|id| {
                    let at = Time::from_secs_f64(100.0 + offset_s);
                    NOISE.smooth(NoisePurpose::PoseX, &[id], at, correlation_time)
                })
                .collect();
            let (mean, variance) = moments(&values);
            assert!(
                mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05,
                "at {offset_s}: {variance}"
            );
        }
    }

    #[test]
    fn smooth_noise_is_correlated_as_promised() {
        let at = |id, seconds_s: f64| {
            NOISE.smooth(
                NoisePurpose::PoseX,
                &[id],
                Time::from_secs_f64(seconds_s),
                Duration::from_secs(10),
            )
        };
        for (lag_s, low, high) in [
            (0.1, 0.999, 1.0),
            (10.0, 0.42, 0.56),
            (20.0, 0.0, 0.12),
            (40.0, -0.04, 0.04),
        ] {
            let pairs: Vec<(f64, f64)> = (0..20_000)
                .map(|id| {
                    let start_s = 50.0 + (id % 100) as f64 * 0.1;
                    (at(id, start_s), at(id, start_s + lag_s))
                })
                .collect();
            let got = correlation(&pairs);
            assert!((low..=high).contains(&got), "after {lag_s} s: {got}");
        }
    }

    #[test]
    fn smooth_noise_has_no_jumps() {
        let at = |ms: u64| {
            NOISE.smooth(
                NoisePurpose::PoseX,
                &[1],
                Time::from_nanos(ms * 1_000_000),
                Duration::from_secs(1),
            )
        };
        for ms in 0..20_000 {
            assert!((at(ms + 1) - at(ms)).abs() < 0.02, "at {ms} ms");
        }
        let end = NOISE.smooth(NoisePurpose::PoseX, &[1], Time::NEVER, Duration::ZERO);
        assert!(end.is_finite());
    }
}
