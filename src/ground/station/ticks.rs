//! The station's ticks: everything is looked at and repeated once a second.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::time::Time;

const EVERY: Duration = Duration::from_secs(1);

/// When the next tick is due, and how many there were.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Ticks {
    next_at: Time,
    count: u64,
}

impl Default for Ticks {
    fn default() -> Ticks {
        Ticks {
            next_at: Time::ZERO + EVERY,
            count: 0,
        }
    }
}

impl Ticks {
    /// Returns whether a tick is due now; it is taken then.
    pub(super) fn take_due(&mut self, now: Time) -> bool {
        let is_due = self.next_at <= now;
        if is_due {
            (self.next_at, self.count) = (now + EVERY, self.count + 1);
        }
        is_due
    }

    /// Returns when the next one is due.
    pub(super) fn next_at(&self) -> Time {
        self.next_at
    }

    /// Returns how many were taken.
    pub(super) fn count(&self) -> u64 {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_due_a_second_after_the_one_before_also_when_that_was_late() {
        let at = |at_s: f64| Time::from_secs_f64(at_s);
        let mut ticks = Ticks::default();
        assert!(!ticks.take_due(at(0.9)) && ticks.take_due(at(1.5)));
        assert_eq!((ticks.next_at(), ticks.count()), (at(2.5), 1));
        assert!(!ticks.take_due(at(2.4)) && ticks.take_due(at(2.5)));
        assert_eq!(ticks.count(), 2);
    }
}
