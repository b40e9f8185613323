//! How long the vehicles have done no stop, and how long that may be. It judges nothing.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::time::Time;

/// No way is taken to last longer than this, seconds.
const LONGEST_S: f64 = 3600.0;

/// The time without a stop, while the vehicles are to drive.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct IdleTime {
    total: Duration,
    /// Until when it is counted; `None` while nobody is to drive.
    counted_to: Option<Time>,
}

impl IdleTime {
    /// Returns how long it is.
    pub(super) fn total(&self) -> Duration {
        self.total
    }

    /// Records that the vehicles are to drive, and have done so since this was last called.
    pub(super) fn go_on(&mut self, now: Time) {
        let since = self.counted_to.replace(now).unwrap_or(now);
        self.total += now.since(since);
    }

    /// Records that nobody is to drive: until they are, nothing is counted.
    pub(super) fn pause(&mut self) {
        self.counted_to = None;
    }

    /// Begins anew: a stop was done, or others are planned for.
    pub(super) fn clear(&mut self) {
        self.total = Duration::ZERO;
    }
}

/// How long the vehicles may do no stop.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(in crate::ground::station) struct IdleLimits {
    /// Until everyone is planned for anew.
    pub retried_after: Duration,
    /// Until the sweep is given up, the time before they were planned for anew included.
    pub given_up_after: Duration,
}

impl IdleLimits {
    /// Where no way round is long.
    const LEAST: IdleLimits = IdleLimits {
        retried_after: Duration::from_secs(180),
        given_up_after: Duration::from_secs(260),
    };

    /// Gives the vehicles at least the time for a way along the whole fence, by the fastest that one of them was heard to
    /// drive: a way round to the next stop may be that long, and on it no stop is done.
    pub(in crate::ground::station) fn of(fence_m: f64, fastest_mps: f64) -> IdleLimits {
        let way_s = match fastest_mps > 0.0 {
            true => (fence_m / fastest_mps).clamp(0.0, LONGEST_S),
            false => 0.0,
        };
        let way = Duration::from_secs_f64(way_s);
        let IdleLimits {
            retried_after,
            given_up_after,
        } = IdleLimits::LEAST;
        IdleLimits {
            retried_after: retried_after.max(way),
            given_up_after: given_up_after.max(way * 5 / 4),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(at_s: f64) -> Time {
        Time::from_secs_f64(at_s)
    }

    #[test]
    fn times_in_which_nobody_is_to_drive_do_not_count() {
        let mut idle = IdleTime::default();
        idle.go_on(at(10.0));
        idle.go_on(at(40.0));
        idle.pause();
        idle.go_on(at(900.0));
        idle.go_on(at(905.0));
        assert_eq!(idle.total(), Duration::from_secs(35));
        idle.clear();
        assert_eq!(idle.total(), Duration::ZERO);
    }

    #[test]
    fn slow_vehicles_on_large_ground_have_longer() {
        let seconds = |fence_m, fastest_mps| {
            let limits = IdleLimits::of(fence_m, fastest_mps);
            (
                limits.retried_after.as_secs(),
                limits.given_up_after.as_secs(),
            )
        };
        assert_eq!(seconds(72.0, 0.5), (180, 260));
        assert_eq!(seconds(72.0, 0.1), (720, 900));
        assert_eq!(seconds(72.0, 0.0), (180, 260), "nobody has driven");
        assert_eq!(seconds(1e9, 1e-9), (3600, 4500));
    }
}
