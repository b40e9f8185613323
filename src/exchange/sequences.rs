//! Which numbered samples of one source have come, each counted once, however often and in whatever order they come.
//!
//! Memory is bounded: a number that comes while too many stand above a gap has no room. Who counts says what is lost and will
//! never come, or passes over a gap by itself.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::LostSamples;

/// Sequences above a gap that are kept.
pub const BEYOND_MAX: usize = 65_536;

/// What has come of one source.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct ReceivedSequences {
    /// Every sequence below has come, or is lost.
    below: u64,
    /// Those that have come above a gap.
    beyond: BTreeSet<u64>,
}

impl ReceivedSequences {
    /// Returns below which sequence nothing is waited for.
    pub fn below(&self) -> u64 {
        self.below
    }

    /// Returns whether something is missing below what has come.
    pub fn has_gap(&self) -> bool {
        !self.beyond.is_empty()
    }

    /// Returns whether a sequence has not come yet and is not lost.
    pub fn is_new(&self, sequence: u64) -> bool {
        sequence >= self.below && !self.beyond.contains(&sequence)
    }

    /// Records a new sequence; returns whether there was room for it.
    pub fn take(&mut self, sequence: u64) -> bool {
        let is_room = sequence == self.below || self.beyond.len() < BEYOND_MAX;
        if !is_room || sequence == u64::MAX {
            return false;
        }
        self.beyond.insert(sequence);
        self.go_on();
        true
    }

    /// Waits no longer for what is lost, as far as nothing else is missing below it.
    pub fn pass_over(&mut self, lost: &[LostSamples]) {
        for range in lost {
            if range.from <= self.below && range.until > self.below {
                self.below = range.until;
                self.beyond = self.beyond.split_off(&self.below);
                self.go_on();
            }
        }
    }

    /// Waits no longer for what is missing below the first that has come above the gap.
    pub fn pass_gap(&mut self) {
        if let Some(first) = self.beyond.first() {
            self.below = *first;
            self.go_on();
        }
    }

    fn go_on(&mut self) {
        while self.beyond.remove(&self.below) {
            self.below += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lost(ranges: &[(u64, u64)]) -> Vec<LostSamples> {
        let range = |(from, until): &(u64, u64)| LostSamples {
            from: *from,
            until: *until,
        };
        ranges.iter().map(range).collect()
    }

    #[test]
    fn what_is_lost_is_passed_over_and_nothing_else() {
        let mut received = ReceivedSequences::default();
        assert!([0, 1, 4, 5, 9].into_iter().all(|one| received.take(one)));
        received.pass_over(&lost(&[(3, 4), (6, 9)]));
        assert_eq!(received.below(), 2, "2 may come");
        received.pass_over(&lost(&[(2, 4), (6, 9)]));
        assert_eq!((received.below(), received.has_gap()), (10, false));
        received.pass_over(&lost(&[(0, 7)]));
        assert_eq!(received.below(), 10);
        assert!(!received.is_new(3), "nothing comes of what was lost");
    }

    #[test]
    fn a_lost_range_that_is_said_to_go_on_beyond_what_came_takes_that_with_it() {
        let mut received = ReceivedSequences::default();
        assert!(received.take(7));
        received.pass_over(&lost(&[(0, u64::MAX)]));
        assert_eq!((received.below(), received.has_gap()), (u64::MAX, false));
        assert!(!received.take(u64::MAX));
    }

    #[test]
    fn above_a_gap_there_is_only_so_much_room_until_it_is_passed() {
        let mut received = ReceivedSequences::default();
        let most = BEYOND_MAX as u64;
        assert!((1..=most).all(|one| received.take(one)));
        assert!(!received.take(most + 2));
        assert!(received.is_new(most + 2));
        received.pass_gap();
        assert_eq!((received.below(), received.is_new(0)), (most + 1, false));
        assert!(received.take(most + 2));
        assert!(received.has_gap());
    }
}
