//! Which of a vehicle's samples nobody has any more: ranges of sequences, said with every batch, so that whoever counts
//! sequences does not wait for them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{LOST_MAX, LostSamples};

use super::Source;

/// Ranges of a source that are known at most; the highest are passed over, and found again by another reading of the edge.
const RANGES_MAX: usize = 1024;
/// Sources of which they are known at most: the newest.
const SOURCES_MAX: usize = 256;

/// Ranges of every source: from their first sequence to the first one behind them, ascending and apart.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct LostRanges {
    of: BTreeMap<Source, BTreeMap<u64, u64>>,
}

impl LostRanges {
    /// Adds all from one sequence to another, exclusive, but for those that are held; returns how many that are.
    pub(super) fn add(
        &mut self,
        source: Source,
        from: u64,
        until: u64,
        held: impl Iterator<Item = u64>,
    ) -> u64 {
        let (mut from, mut count) = (from, 0_u64);
        for sequence in held {
            count = count.saturating_add(sequence.saturating_sub(from));
            self.insert(source, from, sequence);
            from = from.max(sequence.saturating_add(1));
        }
        self.insert(source, from, until);
        count.saturating_add(until.saturating_sub(from))
    }

    fn insert(&mut self, source: Source, from: u64, until: u64) {
        if from >= until {
            return;
        }
        let ranges = self.of.entry(source).or_default();
        let (mut from, mut until) = (from, until);
        // Those that touch it become one with it.
        while let Some((begun, ended)) = ranges
            .range(..=until)
            .next_back()
            .map(|(begun, ended)| (*begun, *ended))
            .filter(|(_, ended)| *ended >= from)
        {
            ranges.remove(&begun);
            (from, until) = (from.min(begun), until.max(ended));
        }
        ranges.insert(from, until);
        if ranges.len() > RANGES_MAX {
            ranges.pop_last();
        }
        if self.of.len() > SOURCES_MAX {
            self.of.pop_first();
        }
    }

    /// Forgets what lies below a watermark.
    pub(super) fn confirm(&mut self, source: Source, below: u64) {
        let Some(ranges) = self.of.get_mut(&source) else {
            return;
        };
        while let Some(range) = ranges.first_entry().filter(|range| *range.key() < below) {
            let (_, until) = range.remove_entry();
            if until > below {
                ranges.insert(below, until);
            }
        }
        if ranges.is_empty() {
            self.of.remove(&source);
        }
    }

    /// Returns the first ranges of a source, as many as a batch may say.
    pub(super) fn first_of(&self, source: Source) -> Vec<LostSamples> {
        let ranges = self.of.get(&source).into_iter().flatten();
        let said = ranges.map(|(from, until)| LostSamples {
            from: *from,
            until: *until,
        });
        said.take(LOST_MAX).collect()
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{Boot, RunId};

    use super::*;

    const SOURCE: Source = (Boot(1), RunId(1));

    fn said(lost: &LostRanges) -> Vec<(u64, u64)> {
        let ranges = lost.first_of(SOURCE);
        ranges
            .iter()
            .map(|range| (range.from, range.until))
            .collect()
    }

    #[test]
    fn ranges_that_touch_become_one_and_held_ones_part_them() {
        let mut lost = LostRanges::default();
        assert_eq!(lost.add(SOURCE, 10, 20, [12, 13, 19].into_iter()), 7);
        assert_eq!(said(&lost), [(10, 12), (14, 19)]);
        lost.add(SOURCE, 5, 10, std::iter::empty());
        lost.add(SOURCE, 11, 15, std::iter::empty());
        lost.add(SOURCE, 30, 30, std::iter::empty());
        assert_eq!(said(&lost), [(5, 19)]);
    }

    #[test]
    fn what_is_confirmed_is_forgotten() {
        let mut lost = LostRanges::default();
        lost.add(SOURCE, 0, 10, [3].into_iter());
        lost.confirm(SOURCE, 6);
        assert_eq!(said(&lost), [(6, 10)]);
        lost.confirm(SOURCE, 10);
        assert!(lost.of.is_empty());
    }

    #[test]
    fn no_more_is_kept_and_said_than_there_is_room_for() {
        let mut lost = LostRanges::default();
        for n in 0..2 * RANGES_MAX as u64 {
            lost.add(SOURCE, 3 * n, 3 * n + 1, std::iter::empty());
        }
        assert_eq!(lost.of[&SOURCE].len(), RANGES_MAX);
        assert_eq!(said(&lost).len(), LOST_MAX);
        assert_eq!(said(&lost)[1], (3, 4));
        for run in 0..2 * SOURCES_MAX as u32 {
            lost.add((Boot(2), RunId(run)), 0, 1, std::iter::empty());
        }
        assert_eq!(lost.of.len(), SOURCES_MAX);
    }
}
