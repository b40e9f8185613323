//! What is still to happen, in order of time. Events of one moment come in the order in which they
//! were put in, or shuffled by the noise, which finds code that depends on that order.
//!
//! Nothing can be taken back: an event that may have become void carries a generation number, and
//! its receiver compares.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::noise::{Noise, NoisePurpose};
use crate::time::Time;

/// Events by time.
#[derive(Clone, Debug)]
pub struct EventQueue<E> {
    heap: BinaryHeap<Entry<E>>,
    serial: u64,
    shuffle: Option<Noise>,
}

#[derive(Clone, Debug)]
struct Entry<E> {
    at: Time,
    /// Decides between events of one moment; unique.
    rank: (u64, u64),
    event: E,
}

impl<E> EventQueue<E> {
    /// Makes an empty queue; with noise given, events of one moment come in an order drawn from it.
    pub fn new(shuffle: Option<Noise>) -> EventQueue<E> {
        EventQueue {
            heap: BinaryHeap::new(),
            serial: 0,
            shuffle,
        }
    }

    /// Puts an event in. A moment that has passed already is allowed: it comes next.
    pub fn push(&mut self, at: Time, event: E) {
        let first = self.shuffle.map_or(0, |noise| {
            noise.hash(NoisePurpose::TieOrder, &[self.serial])
        });
        self.heap.push(Entry {
            at,
            rank: (first, self.serial),
            event,
        });
        self.serial += 1;
    }

    /// Takes out the earliest event.
    pub fn pop(&mut self) -> Option<(Time, E)> {
        self.heap.pop().map(|entry| (entry.at, entry.event))
    }

    /// Returns the number of events still to come.
    #[cfg(test)]
    pub(crate) fn len(&self) -> usize {
        self.heap.len()
    }

    /// Returns when the earliest event is to come.
    pub fn next_at(&self) -> Option<Time> {
        self.heap.peek().map(|entry| entry.at)
    }
}

/// Reversed, since the heap gives its greatest entry first.
impl<E> Ord for Entry<E> {
    fn cmp(&self, other: &Self) -> Ordering {
        (other.at, other.rank).cmp(&(self.at, self.rank))
    }
}

impl<E> PartialOrd for Entry<E> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<E> PartialEq for Entry<E> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl<E> Eq for Entry<E> {}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn drain<E>(queue: &mut EventQueue<E>) -> Vec<(Time, E)> {
        std::iter::from_fn(|| queue.pop()).collect()
    }

    fn ten_at_once(shuffle: Option<Noise>) -> Vec<u32> {
        let mut queue = EventQueue::new(shuffle);
        (0..10).for_each(|event| queue.push(Time::from_nanos(5), event));
        drain(&mut queue)
            .into_iter()
            .map(|(_, event)| event)
            .collect()
    }

    #[test]
    fn events_of_one_moment_come_as_they_were_put_in() {
        assert_eq!(ten_at_once(None), (0..10).collect::<Vec<_>>());
    }

    #[test]
    fn a_shuffle_depends_on_the_seed_alone_and_loses_nothing() {
        let mut shuffled = ten_at_once(Some(Noise::new(1)));
        assert_eq!(shuffled, ten_at_once(Some(Noise::new(1))));
        assert_ne!(shuffled, ten_at_once(Some(Noise::new(2))));
        assert_ne!(shuffled, ten_at_once(None));
        shuffled.sort();
        assert_eq!(shuffled, ten_at_once(None));
    }

    proptest! {
        #[test]
        fn events_come_in_order_of_time(
            times in prop::collection::vec(0..20u64, 0..100), shuffled in any::<bool>(),
        ) {
            let mut queue = EventQueue::new(shuffled.then_some(Noise::new(3)));
            for (index, nanos) in times.iter().enumerate() {
                queue.push(Time::from_nanos(*nanos), index);
            }
            let got = drain(&mut queue);
            prop_assert_eq!(got.len(), times.len());
            for (at, index) in &got {
                prop_assert_eq!(*at, Time::from_nanos(times[*index]));
            }
            for pair in got.windows(2) {
                prop_assert!(pair[0].0 < pair[1].0 || (pair[0].0 == pair[1].0 && (shuffled || pair[0].1 < pair[1].1)));
            }
        }
    }
}
