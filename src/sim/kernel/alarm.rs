//! When somebody is to be woken. What is queued cannot be taken back, so that every wake carries a generation, and only the one
//! that was queued last counts. It queues nothing itself.

use crate::time::Time;

/// An alarm, and the generation of its latest wake.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Alarm {
    at: Option<Time>,
    generation: u64,
}

impl Alarm {
    /// Sets it to a moment, but not before now; returns the wake that must be queued, unless that was done already.
    pub(super) fn set(&mut self, now: Time, at: Option<Time>) -> Option<(Time, u64)> {
        let at = at.map(|at| at.max(now));
        if self.at == at {
            return None;
        }
        self.at = at;
        self.generation += 1;
        at.map(|at| (at, self.generation))
    }

    /// Makes void whatever is queued.
    pub(super) fn cancel(&mut self) {
        self.at = None;
        self.generation += 1;
    }

    /// Returns whether a wake counts that comes now; then it is no longer set.
    pub(super) fn rings(&mut self, generation: u64) -> bool {
        let rings = self.generation == generation;
        if rings {
            self.at = None;
        }
        rings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn secs(seconds_s: f64) -> Time {
        Time::from_secs_f64(seconds_s)
    }

    #[test]
    fn only_the_wake_that_was_queued_last_counts() {
        let (mut alarm, now) = (Alarm::default(), secs(1.0));
        let (_, first) = alarm.set(now, Some(secs(5.0))).unwrap();
        let (at, second) = alarm.set(now, Some(secs(3.0))).unwrap();
        assert_eq!(at, secs(3.0));
        assert!(!alarm.rings(first) && alarm.rings(second));
        assert!(
            alarm.set(secs(3.0), Some(secs(3.0))).is_some(),
            "it has rung"
        );
    }

    #[test]
    fn what_is_queued_already_is_not_queued_again() {
        let (mut alarm, now) = (Alarm::default(), secs(1.0));
        assert_eq!(alarm.set(now, None), None);
        let (at, generation) = alarm.set(now, Some(secs(0.5))).unwrap();
        assert_eq!(at, now, "nothing is queued for what has passed");
        assert_eq!(alarm.set(now, Some(now)), None);
        assert!(alarm.rings(generation));
    }

    #[test]
    fn a_cancelled_wake_does_not_count() {
        let (mut alarm, now) = (Alarm::default(), secs(1.0));
        let (_, generation) = alarm.set(now, Some(secs(5.0))).unwrap();
        alarm.cancel();
        assert!(!alarm.rings(generation));
        let (_, again) = alarm.set(now, Some(secs(5.0))).unwrap();
        assert_ne!(again, generation);
        assert_eq!(alarm.set(now, None), None);
        assert!(!alarm.rings(again));
    }
}
