//! When an actor that has failed may begin again: after 1, 2 and 4 s; more than three times within a minute it stays
//! down. Pure: it is told the time.

use std::collections::VecDeque;
use std::time::Duration;

use crate::time::Time;

/// Restarts within [`WITHIN`] at most.
const MOST: usize = 3;
/// What is longer ago than this is forgotten.
const WITHIN: Duration = Duration::from_secs(60);

/// The recent failures of one actor.
#[derive(Clone, Debug, Default)]
pub struct Restarts {
    recent: VecDeque<Time>,
}

impl Restarts {
    /// Records a failure; returns how long to wait before the next start, or `None` when it stays down.
    pub fn failed(&mut self, now: Time) -> Option<Duration> {
        while self
            .recent
            .front()
            .is_some_and(|at| now.since(*at) > WITHIN)
        {
            self.recent.pop_front();
        }
        let before = self.recent.len();
        self.recent.push_back(now);
        (before < MOST).then(|| Duration::from_secs(1 << before))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_fails_a_fourth_time_within_a_minute_stays_down() {
        let mut restarts = Restarts::default();
        let waits: Vec<Option<u64>> = (0..4)
            .map(|number| restarts.failed(Time::from_secs_f64(f64::from(number))))
            .map(|wait| wait.map(|wait| wait.as_secs()))
            .collect();
        assert_eq!(waits, [Some(1), Some(2), Some(4), None]);
    }

    #[test]
    fn who_fails_once_in_a_while_is_always_started_again() {
        let mut restarts = Restarts::default();
        for minute in 0..20 {
            let wait = restarts.failed(Time::from_secs_f64(61.0 * f64::from(minute)));
            assert_eq!(wait, Some(Duration::from_secs(1)));
        }
    }
}
