//! Time as every pure part of the program sees it: nanoseconds since the node started, and the
//! reason for which somebody wants to be woken. Nothing here reads a clock.

use std::fmt;
use std::ops::{Add, Sub};
use std::time::Duration;

use serde::{Deserialize, Serialize};

/// A moment, in nanoseconds since the node (or the simulation) started.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
pub struct Time(u64);

impl Time {
    /// The start of the node.
    pub const ZERO: Time = Time(0);
    /// A moment that never comes.
    pub const NEVER: Time = Time(u64::MAX);

    /// Makes a moment from nanoseconds since the start.
    #[inline]
    pub const fn from_nanos(nanos: u64) -> Time {
        Time(nanos)
    }

    /// Makes a moment from seconds since the start; negative and non-finite values become zero.
    #[inline]
    pub fn from_secs_f64(seconds_s: f64) -> Time {
        Time((seconds_s * 1e9).round() as u64)
    }

    /// Returns the nanoseconds since the start.
    #[inline]
    pub const fn as_nanos(self) -> u64 {
        self.0
    }

    /// Returns the seconds since the start.
    #[inline]
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// Returns the span since `earlier`, or zero when `earlier` is later.
    #[inline]
    pub fn since(self, earlier: Time) -> Duration {
        Duration::from_nanos(self.0.saturating_sub(earlier.0))
    }
}

impl Add<Duration> for Time {
    type Output = Time;
    #[inline]
    fn add(self, span: Duration) -> Time {
        let nanos = u64::try_from(span.as_nanos()).unwrap_or(u64::MAX);
        Time(self.0.saturating_add(nanos))
    }
}

impl Sub<Duration> for Time {
    type Output = Time;
    #[inline]
    fn sub(self, span: Duration) -> Time {
        let nanos = u64::try_from(span.as_nanos()).unwrap_or(u64::MAX);
        Time(self.0.saturating_sub(nanos))
    }
}

impl fmt::Display for Time {
    #[inline]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3}", self.as_secs_f64())
    }
}

impl fmt::Debug for Time {
    #[inline]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self} s")
    }
}

/// When an actor wants to be woken, and why.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Deadline {
    /// The moment.
    pub at: Time,
    /// The reason, for logs and tests.
    pub why: &'static str,
}

impl Deadline {
    /// Returns the earlier of two optional deadlines; the first on a tie.
    #[inline]
    pub fn earlier(first: Option<Deadline>, second: Option<Deadline>) -> Option<Deadline> {
        match (first, second) {
            (Some(a), Some(b)) => Some(if b.at < a.at { b } else { a }),
            (a, b) => a.or(b),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_never_goes_below_zero_or_past_the_end() {
        assert_eq!(Time::from_nanos(5) - Duration::from_secs(1), Time::ZERO);
        assert_eq!(Time::NEVER + Duration::from_secs(1), Time::NEVER);
        assert_eq!(Time::from_secs_f64(f64::NAN), Time::ZERO);
    }

    #[test]
    fn the_earlier_deadline_wins_and_the_first_on_a_tie() {
        let at = |s, why| {
            Some(Deadline {
                at: Time::from_secs_f64(s),
                why,
            })
        };
        assert_eq!(Deadline::earlier(at(2.0, "a"), at(1.0, "b")), at(1.0, "b"));
        assert_eq!(Deadline::earlier(at(1.0, "a"), at(1.0, "b")), at(1.0, "a"));
        assert_eq!(Deadline::earlier(None, at(1.0, "b")), at(1.0, "b"));
        assert_eq!(Deadline::earlier(None, None), None);
    }
}
