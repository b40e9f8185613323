//! Which operators have come lately and must be told what was said once, before they came. Each is told when its first
//! greeting is heard, and once more at a later one: a link that has just come up may carry greetings before it carries
//! answers. Bounded.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Operators that are remembered, the last that came.
const KNOWN_MAX: usize = 64;
/// The second time is this much later at least; operators greet every two seconds.
const AGAIN: Duration = Duration::from_millis(1500);

/// Operators that have come, the last one last.
#[derive(Debug, Default)]
pub(super) struct Newcomers {
    known: VecDeque<Newcomer>,
}

#[derive(Debug)]
struct Newcomer {
    /// Drawn anew at each start of an operator.
    instance: u64,
    came: Instant,
    was_told_again: bool,
}

impl Newcomers {
    /// Takes a greeting; returns whether its operator is to be told now.
    pub(super) fn greets(&mut self, now: Instant, instance: u64) -> bool {
        let known = self.known.iter_mut().find(|of| of.instance == instance);
        if let Some(known) = known {
            let is_due = !known.was_told_again && now.duration_since(known.came) >= AGAIN;
            known.was_told_again |= is_due;
            return is_due;
        }
        self.known.push_back(Newcomer {
            instance,
            came: now,
            was_told_again: false,
        });
        if self.known.len() > KNOWN_MAX {
            self.known.pop_front();
        }
        true
    }

    /// Takes that an operator could not be told: its next greeting counts as the first.
    pub(super) fn forget(&mut self, instance: u64) {
        self.known.retain(|of| of.instance != instance);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_operator_is_told_twice_also_two_of_one_number_and_not_for_ever() {
        let mut newcomers = Newcomers::default();
        let began = Instant::now();
        let mut told = Vec::new();
        for tick in 0..20 {
            for instance in [7, 8] {
                if newcomers.greets(began + Duration::from_secs(tick), instance) {
                    told.push((tick, instance));
                }
            }
        }
        assert_eq!(told, [(0, 7), (0, 8), (2, 7), (2, 8)]);
        newcomers.forget(7);
        assert!(newcomers.greets(began, 7), "it could not be told");
        for instance in 100..1000 {
            assert!(newcomers.greets(began, instance));
        }
        assert_eq!(newcomers.known.len(), KNOWN_MAX);
    }
}
