//! One person on a lattice of places: probabilities that spread while time passes and are weighed by what links say. Which
//! links, and how many persons there are, is not decided here.

use super::{LinkLoss, TrackingSettings};
use crate::geom::{Point, Rect};
use crate::tomo::student::DEGREES;

/// The probability before anything was measured.
const PRIOR: f64 = 0.5;
/// Probabilities of presence stay this far from 0 and 1, so that everybody may come and go.
const LEAST_PRESENCE: f64 = 1e-4;
/// While a second passes, this share of a person's probability is spread over the whole place: who was lost is found again.
const LOST_HZ: f64 = 1e-3;
/// A spread wider than this many places is done in steps.
const WIDEST: f64 = 4.0;

/// Places in rows, from the south-west, in the middle of squares that fill an area.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Lattice {
    area: Rect,
    columns: usize,
    rows: usize,
}

impl Lattice {
    pub(super) fn new(area: Rect, pitch_m: f64) -> Lattice {
        let count = |length_m: f64| (libm::ceil(length_m / pitch_m - 1e-9) as usize).max(1);
        Lattice {
            area,
            columns: count(area.width_m()),
            rows: count(area.height_m()),
        }
    }

    pub(super) fn len(&self) -> usize {
        self.columns * self.rows
    }

    /// Returns the size of a square, metres.
    fn pitch_m(&self) -> (f64, f64) {
        let (columns, rows) = (self.columns as f64, self.rows as f64);
        (self.area.width_m() / columns, self.area.height_m() / rows)
    }

    pub(super) fn at(&self, place: usize) -> Point {
        let (dx_m, dy_m) = self.pitch_m();
        Point::new(
            self.area.min.x_m + ((place % self.columns) as f64 + 0.5) * dx_m,
            self.area.min.y_m + ((place / self.columns) as f64 + 0.5) * dy_m,
        )
    }
}

/// What is believed of one person.
#[derive(Clone, Debug)]
pub(super) struct PersonFilter {
    lattice: Lattice,
    /// Probability of each place, given that the person is there; they sum to 1.
    places: Vec<f64>,
    presence: f64,
}

impl PersonFilter {
    /// Makes the filter of somebody who may be anywhere, or not be there.
    pub(super) fn anywhere(lattice: Lattice) -> PersonFilter {
        PersonFilter {
            lattice,
            places: vec![1.0 / lattice.len() as f64; lattice.len()],
            presence: PRIOR,
        }
    }

    pub(super) fn lattice(&self) -> Lattice {
        self.lattice
    }

    /// Returns the probability that there is such a person.
    pub(super) fn probability(&self) -> f64 {
        self.presence
    }

    /// Returns the expected place, and variance by x, covariance, variance by y, m².
    pub(super) fn place(&self) -> (Point, [f64; 3]) {
        let weighted = || (0..self.places.len()).map(|k| (self.lattice.at(k), self.places[k]));
        let (x_m, y_m) = weighted().fold((0.0, 0.0), |(x_m, y_m), (at, weight)| {
            (x_m + weight * at.x_m, y_m + weight * at.y_m)
        });
        let mut covariance_m2 = [0.0; 3];
        for (at, weight) in weighted() {
            let (dx_m, dy_m) = (at.x_m - x_m, at.y_m - y_m);
            let squares = [dx_m * dx_m, dx_m * dy_m, dy_m * dy_m];
            covariance_m2
                .iter_mut()
                .zip(squares)
                .for_each(|(sum, square)| *sum += weight * square);
        }
        (Point::new(x_m, y_m), covariance_m2)
    }

    /// Returns what the person is expected to cost a link, and the variance of that, dB and dB².
    pub(super) fn expected_cost(&self, chords: &[(u32, f64)], strength: f64) -> (f64, f64) {
        let sum = |of: fn(f64) -> f64| -> f64 {
            let terms = chords
                .iter()
                .map(|(place, chord_m)| self.places[*place as usize] * of(strength * chord_m));
            terms.sum()
        };
        let mean = self.presence * sum(|cost| cost);
        let square = self.presence * sum(|cost| cost * cost);
        (mean, (square - mean * mean).max(0.0))
    }

    /// Lets time pass: the person walks, may have come, and may have gone.
    pub(super) fn walk(&mut self, elapsed_s: f64, settings: &TrackingSettings) {
        if elapsed_s <= 0.0 {
            return;
        }
        let moved = (1.0 - libm::exp(-2.0 * settings.exchange_hz * elapsed_s)) / 2.0;
        self.presence = self.presence * (1.0 - moved) + (1.0 - self.presence) * moved;
        let lost = 1.0 - libm::exp(-LOST_HZ * elapsed_s);
        let even = lost / self.places.len() as f64;
        self.places
            .iter_mut()
            .for_each(|weight| *weight = *weight * (1.0 - lost) + even);
        let sd_m = settings.walk_m * elapsed_s.sqrt();
        let (dx_m, dy_m) = self.lattice.pitch_m();
        let columns = self.lattice.columns;
        for row in self.places.chunks_exact_mut(columns) {
            spread(row, sd_m / dx_m);
        }
        let mut line = vec![0.0; self.lattice.rows];
        for column in 0..columns {
            let of = |row: usize| row * columns + column;
            line.iter_mut()
                .enumerate()
                .for_each(|(row, value)| *value = self.places[of(row)]);
            spread(&mut line, sd_m / dy_m);
            line.iter()
                .enumerate()
                .for_each(|(row, value)| self.places[of(row)] = *value);
        }
        self.normalize();
    }

    /// Takes away all probability within a distance of a place.
    pub(super) fn leave_out(&mut self, at: Point, within_m: f64) {
        let lattice = self.lattice;
        for (place, weight) in self.places.iter_mut().enumerate() {
            if lattice.at(place).distance_to(at) < within_m {
                *weight = 0.0;
            }
        }
        self.normalize();
    }

    /// Weighs all places by what links say.
    pub(super) fn weigh(&mut self, links: &[LinkLoss<'_>], settings: &TrackingSettings) {
        let mut gains = vec![0.0; self.places.len()];
        for link in links {
            let off = log_likelihood(link.lost_db, link.noise_db2);
            for (place, chord_m) in link.chords {
                let cost_db = settings.strength_db_per_m * chord_m;
                let error_db = settings.cost_error * cost_db;
                let variance_db2 = link.noise_db2 + error_db * error_db;
                let on = log_likelihood(link.lost_db - cost_db, variance_db2);
                gains[*place as usize] += settings.novelty * (on - off);
            }
        }
        let most = gains.iter().copied().fold(0.0, f64::max);
        for (weight, gain) in self.places.iter_mut().zip(&gains) {
            *weight *= libm::exp(gain - most);
        }
        // Σ places · gain: how much more probable the measurement is with the person than without.
        let total: f64 = self.places.iter().sum();
        let factor_log = libm::log(total.max(f64::MIN_POSITIVE)) + most;
        let odds_log = libm::log(self.presence / (1.0 - self.presence)) + factor_log;
        let presence = 1.0 / (1.0 + libm::exp(-odds_log));
        self.presence = presence.clamp(LEAST_PRESENCE, 1.0 - LEAST_PRESENCE);
        self.normalize();
    }

    fn normalize(&mut self) {
        let total: f64 = self.places.iter().sum();
        if total > 0.0 && total.is_finite() {
            self.places.iter_mut().for_each(|weight| *weight /= total);
        } else {
            self.places.fill(1.0 / self.lattice.len() as f64);
        }
    }
}

/// Returns the logarithm of a Student-t density, but for what is the same for all.
fn log_likelihood(error_db: f64, variance_db2: f64) -> f64 {
    let square = error_db * error_db / variance_db2;
    -(DEGREES + 1.0) / 2.0 * libm::log1p(square / DEGREES) - 0.5 * libm::log(variance_db2)
}

/// Spreads a line of probabilities by a normal distribution of this deviation, places; its ends reflect.
fn spread(line: &mut [f64], sd: f64) {
    // Farther than the line is long it is even.
    let sd = sd.min(line.len() as f64);
    let mut variance = sd * sd;
    while variance > 0.0 {
        let step = variance.min(WIDEST * WIDEST);
        blur(line, step.sqrt());
        variance -= step;
    }
}

/// Spreads a line at once.
fn blur(line: &mut [f64], sd: f64) {
    let reach = libm::ceil(3.0 * sd) as usize + 1;
    let below = |edge: f64| 0.5 * (1.0 + libm::erf(edge / (sd * std::f64::consts::SQRT_2)));
    let kernel: Vec<f64> = (0..=reach)
        .map(|away| below(away as f64 + 0.5) - below(away as f64 - 0.5))
        .collect();
    let length = line.len() as i64;
    let reflected = |index: i64| {
        let period = 2 * length;
        let index = index.rem_euclid(period);
        (if index < length {
            index
        } else {
            period - 1 - index
        }) as usize
    };
    let before = line.to_vec();
    for (index, value) in (0i64..).zip(line.iter_mut()) {
        let both = |away: i64| before[reflected(index - away)] + before[reflected(index + away)];
        let wings = (1i64..).zip(&kernel[1..]);
        *value = kernel[0] * before[index as usize]
            + wings.map(|(away, share)| share * both(away)).sum::<f64>();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_keeps_the_sum_and_adds_its_variance() {
        for sd in [0.1, 0.5, 1.7, 5.0, 9.0] {
            let mut line = vec![0.0; 121];
            line[60] = 1.0;
            spread(&mut line, sd);
            let sum: f64 = line.iter().sum();
            let variance: f64 = (0i32..)
                .zip(&line)
                .map(|(k, value)| value * f64::from((k - 60) * (k - 60)))
                .sum();
            assert!((sum - 1.0).abs() < 0.02, "{sd}: {sum}");
            // What lies on a lattice has a twelfth more.
            let expected = sd * sd + 1.0 / 12.0;
            assert!(
                (variance / expected - 1.0).abs() < 0.15 || sd < 0.3,
                "{sd}: {variance}"
            );
        }
    }

    #[test]
    fn at_an_edge_nothing_is_lost() {
        let mut line = vec![1.0, 0.0, 0.0, 0.0, 0.0];
        spread(&mut line, 1.0);
        assert!((line.iter().sum::<f64>() - 1.0).abs() < 0.01);
        assert!(line[0] > line[1] && line[1] > line[2]);
    }

    #[test]
    fn without_measurements_presence_forgets_and_places_even_out() {
        let area = Rect::new(Point::new(0.0, 0.0), Point::new(6.0, 4.0));
        let mut filter = PersonFilter::anywhere(Lattice::new(area, 0.5));
        filter.places.fill(0.0);
        filter.places[0] = 1.0;
        filter.presence = 0.999;
        let settings = TrackingSettings::default();
        filter.walk(1.0, &settings);
        assert!(filter.presence < 0.99 && filter.places[0] < 0.9);
        filter.walk(1000.0, &settings);
        assert!((filter.presence - 0.5).abs() < 1e-6);
        let even = 1.0 / filter.places.len() as f64;
        assert!(
            filter
                .places
                .iter()
                .all(|weight| (weight / even - 1.0).abs() < 0.05)
        );
    }
}
