//! What an autopilot knows of its place: an error that drifts slowly, and grows while it hears no satellites. A pure
//! function of time, in closed form.

use std::time::Duration;

use super::super::noise::{Noise, NoisePurpose};
use crate::geom::{Vector, WORST_DEVIATIONS};
use crate::time::Time;

/// A time without satellites.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Outage {
    /// From when.
    pub from: Time,
    /// Until when; the place is known again at once.
    pub until: Time,
}

/// How well an autopilot knows its place.
#[derive(Clone, PartialEq, Debug)]
pub struct Navigation {
    noise: Noise,
    id: u64,
    sd_m: f64,
    drift: Duration,
    outages: Vec<Outage>,
    growth_mps: f64,
}

impl Navigation {
    /// Makes the navigation of a vehicle: the deviation of each coordinate, metres, and the time over which its error
    /// drifts.
    pub fn new(noise: Noise, id: u64, sd_m: f64, drift: Duration) -> Navigation {
        Navigation {
            noise,
            id,
            sd_m,
            drift,
            outages: Vec::new(),
            growth_mps: 0.0,
        }
    }

    /// Adds times without satellites, in which the deviation grows by `growth_mps`, metres a second.
    pub fn with_outages(self, outages: Vec<Outage>, growth_mps: f64) -> Navigation {
        Navigation {
            outages,
            growth_mps,
            ..self
        }
    }

    /// Returns the standard deviation of each coordinate, metres.
    pub fn sd_m(&self, now: Time) -> f64 {
        let lost = self
            .outages
            .iter()
            .filter(|outage| outage.from <= now && now < outage.until);
        let longest_s = lost
            .map(|outage| now.since(outage.from).as_secs_f64())
            .fold(0.0, f64::max);
        self.sd_m + self.growth_mps * longest_s
    }

    /// Returns the believed place less the true one. A receiver's filter does not believe outliers: the error ends at
    /// [`WORST_DEVIATIONS`].
    pub fn error(&self, now: Time) -> Vector {
        let sd_m = self.sd_m(now);
        let drift = |purpose| {
            let smooth = self.noise.smooth(purpose, &[self.id], now, self.drift);
            sd_m * smooth.clamp(-WORST_DEVIATIONS, WORST_DEVIATIONS)
        };
        Vector::new(drift(NoisePurpose::PoseX), drift(NoisePurpose::PoseY))
    }

    /// Returns the first moment after `after` at which the deviation comes to exceed a limit.
    pub fn lost_at(&self, after: Time, limit_m: f64) -> Option<Time> {
        if self.growth_mps <= 0.0 {
            return None;
        }
        let grows_s = ((limit_m - self.sd_m) / self.growth_mps).max(0.0);
        let crossed = |outage: &Outage| {
            let at = outage.from + Duration::from_secs_f64(grows_s.min(1e9));
            (at > after && at < outage.until).then_some(at)
        };
        self.outages.iter().filter_map(crossed).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn secs(seconds_s: f64) -> Time {
        Time::from_secs_f64(seconds_s)
    }

    #[test]
    fn the_deviation_grows_while_no_satellite_is_heard_and_not_longer() {
        let outage = Outage {
            from: secs(100.0),
            until: secs(130.0),
        };
        let plain = Navigation::new(Noise::new(3), 1, 0.1, Duration::from_secs(20));
        let navigation = plain.clone().with_outages(vec![outage], 0.05);
        for (now_s, expected_m) in [
            (99.9, 0.1),
            (100.0, 0.1),
            (110.0, 0.6),
            (129.0, 1.55),
            (130.0, 0.1),
        ] {
            assert!(
                (navigation.sd_m(secs(now_s)) - expected_m).abs() < 1e-9,
                "{now_s} s"
            );
        }
        assert_eq!(navigation.lost_at(Time::ZERO, 0.6), Some(secs(110.0)));
        assert_eq!(navigation.lost_at(secs(110.0), 0.6), None);
        assert_eq!(navigation.lost_at(Time::ZERO, 2.0), None);
        assert_eq!(plain.lost_at(Time::ZERO, 0.6), None);
        // The error is spread as the deviation says, and the same whenever it is asked.
        let (now, ratio) = (secs(110.0), 6.0);
        let (with, without) = (navigation.error(now), plain.error(now));
        assert!(
            (with.x_m - ratio * without.x_m).abs() < 1e-9
                && (with.y_m - ratio * without.y_m).abs() < 1e-9
        );
    }
}
