//! A budget of bytes per second that may be saved up for a while: what a node may send, and what is taken from one sender.
//! It is told the time, and knows nothing of messages.

use crate::time::Time;

/// A token bucket that counts bytes.
#[derive(Clone, Copy, Debug)]
pub struct TokenBucket {
    per_s: f64,
    most: f64,
    left: f64,
    at: Time,
}

impl TokenBucket {
    /// Makes a full budget of `per_s` bytes a second, of which at most `most` bytes are saved up.
    pub fn new(per_s: f64, most: f64) -> TokenBucket {
        TokenBucket {
            per_s,
            most,
            left: most,
            at: Time::ZERO,
        }
    }

    /// Spends bytes if any budget is left at all; the rest is owed. So what is larger than the budget passes too.
    pub fn spend(&mut self, now: Time, bytes: usize) -> bool {
        self.refill(now);
        let may = self.left > 0.0;
        if may {
            self.left -= bytes as f64;
        }
        may
    }

    /// Spends bytes in any case.
    pub fn owe(&mut self, now: Time, bytes: usize) {
        self.refill(now);
        self.left = (self.left - bytes as f64).max(-self.most);
    }

    /// Returns when something may be spent again.
    pub fn next(&self) -> Time {
        let lacking_s = (-self.left).max(0.0) / self.per_s;
        // A nanosecond later, so that a rounding never wakes anyone in vain.
        self.at
            + std::time::Duration::from_secs_f64(lacking_s)
            + std::time::Duration::from_nanos(1000)
    }

    fn refill(&mut self, now: Time) {
        let since_s = now.since(self.at).as_secs_f64();
        self.left = (self.left + since_s * self.per_s).min(self.most);
        self.at = self.at.max(now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn over_a_long_time_no_more_is_spent_than_allowed() {
        let mut bucket = TokenBucket::new(1000.0, 500.0);
        let mut spent = 0;
        for millisecond in 0..10_000_u64 {
            if bucket.spend(Time::from_nanos(millisecond * 1_000_000), 100) {
                spent += 100;
            }
        }
        assert!((10_000..=10_700).contains(&spent), "{spent} bytes in 10 s");
    }

    #[test]
    fn who_waits_until_next_may_spend() {
        let mut bucket = TokenBucket::new(1000.0, 500.0);
        assert!(bucket.spend(Time::ZERO, 2000));
        assert!(!bucket.spend(Time::from_secs_f64(1.0), 1));
        assert!(bucket.spend(bucket.next(), 1));
    }
}
