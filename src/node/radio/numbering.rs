//! The numbers of its own beacons, without gaps, so that a gap is a miss. Knows no times, and not what beacons say.
//!
//! A beacon that never went on the air gives its number back: at once when nothing was said since, or else when all that
//! was said since comes back as well. Behind one that was sent it stays a gap.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

/// So many beacons that were not sent are remembered while newer ones were said already.
const UNSENT_MAX: usize = 16;

/// Numbers beacons.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct BeaconNumbers {
    /// Of the last beacon said that has not been taken back.
    last: u32,
    /// Beacons that were not sent, but newer ones were said before that was known.
    unsent: BTreeSet<u32>,
}

impl BeaconNumbers {
    /// Returns the number of the next beacon, which is said with it.
    pub(super) fn next_number(&mut self) -> u32 {
        self.last = self.last.saturating_add(1);
        self.last
    }

    /// Takes the number of a beacon back that was not sent, so that peers see no gap.
    pub(super) fn take_back(&mut self, number: u32) {
        if number == 0 || number > self.last {
            return;
        }
        self.unsent.insert(number);
        while self.unsent.remove(&self.last) {
            self.last -= 1;
        }
        if self.unsent.len() > UNSENT_MAX {
            self.unsent.pop_first();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Numbers of which the first ones are given.
    fn given(count: u32) -> BeaconNumbers {
        let mut numbers = BeaconNumbers::default();
        (1..=count).for_each(|number| assert_eq!(numbers.next_number(), number));
        numbers
    }

    #[test]
    fn a_beacon_that_was_not_sent_gives_its_number_to_the_next_one() {
        let mut numbers = given(2);
        numbers.take_back(2);
        assert_eq!((numbers.next_number(), numbers.next_number()), (2, 3));
        numbers.take_back(9);
        numbers.take_back(0);
        assert_eq!(
            numbers.next_number(),
            4,
            "what it never said cannot come back"
        );
    }

    #[test]
    fn behind_a_beacon_that_was_sent_no_number_comes_back() {
        let mut numbers = given(3);
        numbers.take_back(2);
        assert_eq!(
            numbers.next_number(),
            4,
            "3 is on the air: it stays what it is"
        );
    }

    #[test]
    fn beacons_queued_behind_one_that_was_not_sent_come_back_with_it() {
        for order in [[2, 3], [3, 2]] {
            let mut numbers = given(3);
            order.iter().for_each(|number| numbers.take_back(*number));
            assert_eq!(numbers.next_number(), 2, "{order:?}");
        }
    }

    proptest! {
        #[test]
        fn numbers_on_the_air_rise_and_what_was_not_sent_leaves_a_gap_only_before_one_that_was(
            tries in prop::collection::vec((any::<bool>(), 0..3usize), 1..60),
        ) {
            let mut numbers = BeaconNumbers::default();
            // What was not sent since something was last sent, and whether that is known; what is not known yet.
            let (mut open, mut late) = (Vec::<(u32, bool)>::new(), Vec::<(usize, u32)>::new());
            let (mut on_air, mut gaps) = (Vec::new(), 0);
            for (index, (is_sent, delay)) in tries.iter().enumerate() {
                for (_, number) in late.extract_if(.., |(at, _)| *at <= index) {
                    numbers.take_back(number);
                    open.iter_mut().filter(|(of, _)| *of == number).for_each(|(_, is_known)| *is_known = true);
                    while open.pop_if(|(_, is_known)| *is_known).is_some() {}
                }
                let number = numbers.next_number();
                if *is_sent {
                    gaps += open.drain(..).count() as u32;
                    on_air.push(number);
                } else {
                    open.push((number, false));
                    late.push((index + 1 + delay, number));
                }
            }
            prop_assert!(on_air.is_sorted_by(|one, next| one < next), "{:?}", on_air);
            prop_assert_eq!(on_air.last().map_or(0, |last| last - on_air.len() as u32), gaps);
        }
    }
}
