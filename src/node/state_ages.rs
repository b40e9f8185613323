//! How old is what answers its own states: when each of them was made, by its own clock. No other clock is asked.

use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::time::Duration;

use crate::time::Time;

/// What answers an older state than this is too old.
const ANSWERS_WITHIN: Duration = Duration::from_secs(15);

/// When recent states were made.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct StateAges {
    made: VecDeque<(u64, Time)>,
}

impl StateAges {
    /// Notes that a state was made; numbers ascend, and some may be left out.
    pub(super) fn note(&mut self, now: Time, sequence: u64) {
        self.made.push_back((sequence, now));
        while self
            .made
            .front()
            .is_some_and(|(_, at)| now.since(*at) > ANSWERS_WITHIN)
        {
            self.made.pop_front();
        }
    }

    /// Returns whether what answers a state is fresh; of a number left out, by the state noted before it.
    pub(super) fn is_fresh(&self, now: Time, answers: u64) -> bool {
        self.made_at(answers)
            .is_some_and(|at| now.since(at) <= ANSWERS_WITHIN)
    }

    /// Returns when a state was made, as far as that is remembered; of a number left out, the one noted before it.
    pub(super) fn made_at(&self, sequence: u64) -> Option<Time> {
        self.made.back().filter(|(newest, _)| *newest >= sequence)?;
        self.made
            .iter()
            .rev()
            .find(|(noted, _)| *noted <= sequence)
            .map(|(_, at)| *at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_answers_a_state_of_the_last_seconds_is_fresh() {
        let mut ages = StateAges::default();
        for (second, sequence) in [(1, 10), (2, 12), (20, 30)] {
            ages.note(Time::from_secs_f64(f64::from(second)), sequence);
        }
        let fresh = |answers| ages.is_fresh(Time::from_secs_f64(21.0), answers);
        assert!(fresh(30));
        assert!(!fresh(31), "a state that was never made");
        assert!(!fresh(12) && !fresh(11) && !fresh(0));
    }
}
