//! How strongly a beacon arrives: path loss, static multipath fading, packet noise, loss. The
//! attenuation by what stands between is given by the caller.
//!
//! The fading is a function of both positions and the channel, never a draw kept per link, so it
//! comes back when both vehicles come back. It is a steady wave plus a scattered field made of
//! plane waves at both ends: s(p, q) = Σ c_lm g_l(p) g_m(q), g_l(p) = exp(i k u_l·p), c symmetric
//! with random phases, |c| = 1/L. So |s|² has mean 1; moving one end by δ, s is correlated by J₀(kδ)
//! (Clarke 1968; first zero at 0.38 λ), moving both by the product; and p, q may be exchanged.

use std::f64::consts::PI;
use std::sync::OnceLock;

use super::noise::{Noise, NoisePurpose};
use crate::geom::Point;

/// Constants of the radio and of the place.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RadioConstants {
    /// Strength received at 1 m for a transmit power of 0 dBm, dBm.
    pub p0_dbm: f64,
    /// Exponent n of the path loss 10 n log10(d).
    pub exponent: f64,
    /// Wavelength, metres.
    pub wavelength_m: f64,
    /// Power of the steady wave over that of the scattered ones, linear; infinite = no fading.
    pub rician_k: f64,
    /// Standard deviation from packet to packet, dB.
    pub packet_sd_db: f64,
    /// Standard deviation from device to device, of what one sends and of what one reports, dB.
    pub device_sd_db: f64,
    /// Strength at which half of the packets are lost, dBm.
    pub sensitivity_dbm: f64,
    /// Standard deviation of the threshold that a packet must pass, dB.
    pub slope_db: f64,
}

impl Default for RadioConstants {
    /// 2.4 GHz, open air, an XBee.
    fn default() -> RadioConstants {
        RadioConstants {
            p0_dbm: -40.0,
            exponent: 2.0,
            wavelength_m: 0.125,
            rician_k: 8.0,
            packet_sd_db: 2.0,
            device_sd_db: 0.0,
            sensitivity_dbm: -100.0,
            slope_db: 2.0,
        }
    }
}

/// One packet on its way.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Transmission {
    /// Where the transmitter is.
    pub from: Point,
    /// Where the receiver is.
    pub to: Point,
    /// Radio channel.
    pub channel: u8,
    /// Transmit power, dBm.
    pub power_dbm: i8,
}

/// Nearer than this the path loss does not fall, metres.
const NEAREST_M: f64 = 0.5;
/// Plane waves at each end.
const WAVES: usize = 24;

/// The radio field of a place, for all channels.
#[derive(Debug)]
pub struct RadioField {
    noise: Noise,
    constants: RadioConstants,
    steady: f64,
    scattered: f64,
    /// Made when first asked for; each is a pure function of noise and channel.
    channels: Vec<OnceLock<Box<Waves>>>,
}

impl RadioField {
    /// Makes the field of a seed.
    pub fn new(noise: Noise, constants: RadioConstants) -> RadioField {
        let scattered = (1.0 / (1.0 + constants.rician_k.max(0.0))).sqrt();
        RadioField {
            noise,
            constants,
            steady: (1.0 - scattered * scattered).sqrt(),
            scattered,
            channels: std::iter::repeat_with(OnceLock::new).take(256).collect(),
        }
    }

    /// Returns the static fading between two places, dB, of mean power 1; the same both ways, bit for bit.
    pub fn fading_db(&self, p: Point, q: Point, channel: u8) -> f64 {
        let waves = self.channels[usize::from(channel)]
            .get_or_init(|| Box::new(Waves::new(self.noise, channel, self.constants.wavelength_m)));
        let swap = p
            .x_m
            .total_cmp(&q.x_m)
            .then(p.y_m.total_cmp(&q.y_m))
            .is_gt();
        let (re, im) = if swap {
            waves.scatter(q, p)
        } else {
            waves.scatter(p, q)
        };
        let (re, im) = (self.steady + self.scattered * re, self.scattered * im);
        10.0 * libm::log10((re * re + im * im).max(1e-12))
    }

    /// Returns the strength without packet noise, dBm: power and path loss, less `attenuation_db`, with
    /// fading.
    pub fn mean_dbm(&self, packet: &Transmission, attenuation_db: f64) -> f64 {
        let distance_m = packet.from.distance_to(packet.to).max(NEAREST_M);
        self.constants.p0_dbm + f64::from(packet.power_dbm)
            - 10.0 * self.constants.exponent * libm::log10(distance_m)
            - attenuation_db
            + self.fading_db(packet.from, packet.to, packet.channel)
    }

    /// Returns how much stronger than by the average of all devices a packet from `sender` is that `receiver` reports, dB;
    /// both are numbers of vehicles.
    fn devices_db(&self, sender: u64, receiver: u64) -> f64 {
        let sd_db = self.constants.device_sd_db;
        if sd_db == 0.0 {
            return 0.0;
        }
        let draw = |purpose, id| self.noise.gaussian(purpose, &[id]);
        sd_db
            * (draw(NoisePurpose::TransmitterOffset, sender)
                + draw(NoisePurpose::ReceiverOffset, receiver))
    }

    /// Returns the strength that the receiver reports, dBm in whole steps, or `None` when the packet is
    /// lost. `ids` name the sender, its start, the packet, and the receiver; the same ids give the same noise.
    pub fn received(
        &self,
        packet: &Transmission,
        attenuation_db: f64,
        ids: [u64; 4],
    ) -> Option<i16> {
        let Self {
            noise, constants, ..
        } = self;
        let strength_dbm = self.mean_dbm(packet, attenuation_db)
            + self.devices_db(ids[0], ids[3])
            + constants.packet_sd_db * noise.gaussian(NoisePurpose::PacketStrength, &ids);
        let threshold_dbm = constants.sensitivity_dbm
            + constants.slope_db * noise.gaussian(NoisePurpose::PacketLoss, &ids);
        (strength_dbm >= threshold_dbm)
            .then(|| libm::round(strength_dbm.clamp(-200.0, 100.0)) as i16)
    }
}

/// The plane waves of one channel.
#[derive(Debug)]
struct Waves {
    /// Wave vectors in turns per metre.
    x: [f64; WAVES],
    y: [f64; WAVES],
    /// Coefficients c, row l, column m.
    re: [[f64; WAVES]; WAVES],
    im: [[f64; WAVES]; WAVES],
}

impl Waves {
    fn new(noise: Noise, channel: u8, wavelength_m: f64) -> Waves {
        let draw = |ids: [u64; 2]| {
            noise.uniform(
                NoisePurpose::RadioField,
                &[u64::from(channel), ids[0], ids[1]],
            )
        };
        let mut waves = Waves {
            x: [0.0; WAVES],
            y: [0.0; WAVES],
            re: [[0.0; WAVES]; WAVES],
            im: [[0.0; WAVES]; WAVES],
        };
        for l in 0..WAVES {
            // One direction in each of L equal sectors.
            let turn = (l as f64 + draw([l as u64, 1000])) / WAVES as f64;
            let (sin, cos) = libm::sincos(2.0 * PI * turn);
            (waves.x[l], waves.y[l]) = (cos / wavelength_m, sin / wavelength_m);
            for m in 0..=l {
                let (sin, cos) = libm::sincos(2.0 * PI * draw([l as u64, m as u64]));
                for (row, column) in [(l, m), (m, l)] {
                    waves.re[row][column] = cos / WAVES as f64;
                    waves.im[row][column] = sin / WAVES as f64;
                }
            }
        }
        waves
    }

    /// The scattered field between two places, of mean power 1.
    fn scatter(&self, p: Point, q: Point) -> (f64, f64) {
        let (cos, sin) = self.phasors(p);
        let (mut re, mut im) = ([0.0; WAVES], [0.0; WAVES]);
        for l in 0..WAVES {
            let (row_re, row_im) = (&self.re[l], &self.im[l]);
            for m in 0..WAVES {
                re[m] += row_re[m] * cos[l] - row_im[m] * sin[l];
                im[m] += row_re[m] * sin[l] + row_im[m] * cos[l];
            }
        }
        let (cos, sin) = self.phasors(q);
        (0..WAVES).fold((0.0, 0.0), |sum, m| {
            (
                sum.0 + re[m] * cos[m] - im[m] * sin[m],
                sum.1 + re[m] * sin[m] + im[m] * cos[m],
            )
        })
    }

    /// Cosine and sine of the phase of every wave in a place.
    fn phasors(&self, at: Point) -> ([f64; WAVES], [f64; WAVES]) {
        let (mut cos, mut sin) = ([0.0; WAVES], [0.0; WAVES]);
        for l in 0..WAVES {
            (cos[l], sin[l]) = turn_cos_sin(self.x[l] * at.x_m + self.y[l] * at.y_m);
        }
        (cos, sin)
    }
}

/// Cosine and sine of a number of turns, to 1e-8: Taylor series of the half angle, doubled. Without a
/// branch or a call, so that it is computed for several waves at once, and the same on every machine.
fn turn_cos_sin(turns: f64) -> (f64, f64) {
    // Adding and subtracting 1.5 · 2⁵² rounds to the nearest whole number.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let half = PI * (turns - ((turns + ROUND) - ROUND));
    let z = half * half;
    let sin = half
        * (1.0
            + z * (-1.0 / 6.0
                + z * (1.0 / 120.0
                    + z * (-1.0 / 5040.0
                        + z * (1.0 / 362_880.0
                            + z * (-1.0 / 39_916_800.0 + z / 6_227_020_800.0))))));
    let cos = 1.0
        + z * (-1.0 / 2.0
            + z * (1.0 / 24.0
                + z * (-1.0 / 720.0
                    + z * (1.0 / 40_320.0
                        + z * (-1.0 / 3_628_800.0
                            + z * (1.0 / 479_001_600.0 - z / 87_178_291_200.0))))));
    (1.0 - 2.0 * sin * sin, 2.0 * sin * cos)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Angle, Vector};

    fn field(seed: u64) -> RadioField {
        RadioField::new(Noise::new(seed), RadioConstants::default())
    }

    fn somewhere(index: u64, what: u64) -> Point {
        let draw =
            |axis| 30.0 * Noise::new(99).uniform(NoisePurpose::Placement, &[index, what, axis]);
        Point::new(draw(0), draw(1))
    }

    /// Steps of a length in a direction that differs from index to index.
    fn step(index: u64, length_m: f64) -> Vector {
        let turn = Noise::new(98).uniform(NoisePurpose::Placement, &[index]);
        Vector::polar(Angle::from_radians(turn * 2.0 * PI), length_m)
    }

    fn correlation(pairs: &[(f64, f64)]) -> f64 {
        let count = pairs.len() as f64;
        let mean = |pick: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(pick).sum::<f64>() / count;
        let (a, b) = (mean(&|pair| pair.0), mean(&|pair| pair.1));
        let product = mean(&|pair| (pair.0 - a) * (pair.1 - b));
        let spread = mean(&|pair| (pair.0 - a).powi(2)) * mean(&|pair| (pair.1 - b).powi(2));
        product / spread.sqrt()
    }

    /// Correlation of the fading in dB between links and the same links with their ends moved.
    fn measured(seed: u64, p_step_m: f64, q_step_m: f64) -> f64 {
        let field = field(seed);
        let pairs: Vec<(f64, f64)> = (0..6000)
            .map(|index| {
                let (p, q) = (somewhere(index, 0), somewhere(index, 1));
                let (p2, q2) = (
                    p + step(index, p_step_m),
                    q + step(index + 1_000_000, q_step_m),
                );
                (field.fading_db(p, q, 11), field.fading_db(p2, q2, 11))
            })
            .collect();
        correlation(&pairs)
    }

    #[test]
    fn the_fast_sine_is_a_sine() {
        for index in -20_000..20_000 {
            let turns = f64::from(index) * 0.137;
            let (cos, sin) = turn_cos_sin(turns);
            let (true_sin, true_cos) = (2.0 * PI * turns).sin_cos();
            assert!(
                (cos - true_cos).abs() < 1e-8 && (sin - true_sin).abs() < 1e-8,
                "{turns} turns"
            );
        }
    }

    #[test]
    fn what_a_device_sends_and_reports_differs_from_device_to_device_and_never_changes() {
        let mean_of = |seed: u64, sender: u64, receiver: u64| -> f64 {
            let constants = RadioConstants {
                device_sd_db: 3.0,
                packet_sd_db: 0.0,
                ..RadioConstants::default()
            };
            let field = RadioField::new(Noise::new(seed), constants);
            let rssi_dbm = field
                .received(&packet(10.0), 0.0, [sender, 1, 1, receiver])
                .unwrap();
            f64::from(rssi_dbm) - field.mean_dbm(&packet(10.0), 0.0)
        };
        assert_eq!(mean_of(1, 1, 2), mean_of(1, 1, 2));
        assert!((mean_of(1, 1, 2) - mean_of(1, 2, 1)).abs() > 0.5);
        // What a sender adds it adds at every receiver: rows differ by the same, but for rounding.
        let step_db = |receiver: u64| mean_of(1, 1, receiver) - mean_of(1, 2, receiver);
        assert!((step_db(3) - step_db(4)).abs() <= 2.0);
        let offsets: Vec<f64> = (1..=400).map(|seed| mean_of(seed, 1, 2)).collect();
        let square = offsets.iter().map(|offset| offset * offset).sum::<f64>() / 400.0;
        assert!(
            (3.8..4.7).contains(&square.sqrt()),
            "{square}: of 2 × 3² dB²"
        );
    }

    #[test]
    fn fading_is_the_same_both_ways_and_every_time() {
        let (first, second) = (field(3), field(3));
        for index in 0..1000 {
            let (p, q) = (somewhere(index, 0), somewhere(index, 1));
            let there = first.fading_db(p, q, 11);
            assert_eq!(there, first.fading_db(q, p, 11));
            assert_eq!(there, second.fading_db(p, q, 11));
        }
    }

    #[test]
    fn fading_is_rician_with_k_eight() {
        for seed in 0..4 {
            let field = field(seed);
            let mut values: Vec<f64> = (0..40_000)
                .map(|index| field.fading_db(somewhere(index, 0), somewhere(index, 1), 11))
                .collect();
            let power = values
                .iter()
                .map(|value| 10f64.powf(value / 10.0))
                .sum::<f64>()
                / 40_000.0;
            let mean = values.iter().sum::<f64>() / 40_000.0;
            let square = values
                .iter()
                .map(|value| (value - mean).powi(2))
                .sum::<f64>()
                / 40_000.0;
            assert!((power - 1.0).abs() < 0.02, "mean power {power}");
            assert!(
                (square.sqrt() - 2.26).abs() < 0.1,
                "deviation {} dB",
                square.sqrt()
            );
            // Quantiles of 400,000 draws of a Rician variable, made apart from this program.
            values.sort_by(f64::total_cmp);
            for (share, expected_db, by_db) in [
                (0.01, -7.20, 0.5),
                (0.05, -4.55, 0.25),
                (0.25, -1.77, 0.12),
                (0.50, -0.24, 0.1),
                (0.75, 1.06, 0.1),
                (0.95, 2.64, 0.12),
                (0.99, 3.59, 0.2),
            ] {
                let got = values[(share * 40_000.0) as usize];
                assert!(
                    (got - expected_db).abs() < by_db,
                    "quantile {share}: {got} dB"
                );
            }
        }
    }

    #[test]
    fn moving_one_end_decorrelates_like_clarke() {
        // J0(2π δ / 0.125 m) from tables.
        for (step_m, expected) in [
            (0.0, 1.0),
            (0.02, 0.763),
            (0.0479, 0.0),
            (0.06, -0.257),
            (0.12, 0.155),
        ] {
            let got = measured(1, step_m, 0.0);
            assert!(
                (got - expected).abs() < 0.08,
                "{step_m} m: {got} instead of {expected}"
            );
        }
    }

    #[test]
    fn links_moved_by_half_a_metre_or_more_are_independent() {
        for seed in 0..3 {
            for step_m in [0.5, 0.7, 1.0, 3.0, 10.0] {
                let (one, both) = (measured(seed, step_m, 0.0), measured(seed, step_m, step_m));
                assert!(one.abs() < 0.2, "one end by {step_m} m: {one}");
                assert!(both.abs() < 0.06, "both ends by {step_m} m: {both}");
            }
        }
    }

    #[test]
    fn channels_and_seeds_fade_independently() {
        let (one, other) = (field(1), field(2));
        let pairs = |other: &RadioField, channel| -> Vec<(f64, f64)> {
            (0..4000)
                .map(|index| {
                    let (p, q) = (somewhere(index, 0), somewhere(index, 1));
                    (one.fading_db(p, q, 11), other.fading_db(p, q, channel))
                })
                .collect()
        };
        assert!(correlation(&pairs(&one, 12)).abs() < 0.06);
        assert!(correlation(&pairs(&other, 11)).abs() < 0.06);
    }

    fn packet(distance_m: f64) -> Transmission {
        let (from, to) = (Point::new(2.0, 1.0), Point::new(2.0 + distance_m, 1.0));
        Transmission {
            from,
            to,
            channel: 11,
            power_dbm: 3,
        }
    }

    #[test]
    fn without_fading_strength_follows_the_path_loss() {
        let constants = RadioConstants {
            rician_k: f64::INFINITY,
            ..RadioConstants::default()
        };
        let field = RadioField::new(Noise::new(1), constants);
        for (distance_m, expected_dbm) in [
            (1.0, -37.0),
            (10.0, -57.0),
            (100.0, -77.0),
            (0.1, -30.979_4),
        ] {
            assert!((field.mean_dbm(&packet(distance_m), 0.0) - expected_dbm).abs() < 1e-4);
        }
        assert!((field.mean_dbm(&packet(10.0), 12.5) + 69.5).abs() < 1e-9);
    }

    #[test]
    fn packets_scatter_around_the_mean_by_their_deviation() {
        let (field, packet) = (field(1), packet(10.0));
        let mean_dbm = field.mean_dbm(&packet, 0.0);
        let errors: Vec<f64> = (0..20_000)
            .filter_map(|id| field.received(&packet, 0.0, [1, 1, id, 2]))
            .map(|rssi| f64::from(rssi) - mean_dbm)
            .collect();
        assert_eq!(errors.len(), 20_000);
        let mean = errors.iter().sum::<f64>() / 20_000.0;
        let square = errors.iter().map(|error| error * error).sum::<f64>() / 20_000.0;
        // Rounding to whole steps adds a variance of 1/12.
        assert!(
            mean.abs() < 0.06 && (square - 4.0 - 1.0 / 12.0).abs() < 0.15,
            "{mean} {square}"
        );
    }

    #[test]
    fn half_of_the_packets_are_lost_at_the_sensitivity() {
        let (field, packet) = (field(1), packet(10.0));
        let share_at = |mean_dbm: f64| {
            let attenuation_db = field.mean_dbm(&packet, 0.0) - mean_dbm;
            (0..10_000)
                .filter(|id| {
                    field
                        .received(&packet, attenuation_db, [1, 1, *id, 2])
                        .is_some()
                })
                .count() as f64
                / 1e4
        };
        // Packet noise and slope together: 2√2 dB.
        for (mean_dbm, expected) in [
            (-100.0, 0.5),
            (-97.171_6, 0.841),
            (-102.828_4, 0.159),
            (-85.0, 1.0),
            (-115.0, 0.0),
        ] {
            let got = share_at(mean_dbm);
            assert!(
                (got - expected).abs() < 0.02,
                "at {mean_dbm} dBm {got} arrive"
            );
        }
    }

    #[test]
    fn impossible_places_lose_the_packet() {
        let lost = Transmission {
            to: Point::new(f64::NAN, 0.0),
            ..packet(1.0)
        };
        assert_eq!(field(1).received(&lost, 0.0, [1, 1, 1, 2]), None);
    }
}
