//! What waits in front of an actor: plain data with two classes of input, so that a slow actor never
//! holds up a fast one and never grows without bound.

use std::collections::VecDeque;

/// How an unread input is treated when more arrive.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum InputClass<K> {
    /// Only the newest per key is kept; it takes the place of the one it replaces.
    Latest(K),
    /// Kept in order; the oldest of the queue is dropped, and counted, when there are too many.
    Queue,
}

/// An input that knows its class.
pub trait Input: Sized {
    /// What tells latest-only inputs apart.
    type Key: PartialEq;

    /// Returns the class.
    fn class(&self) -> InputClass<Self::Key>;

    /// Returns whether it may lie unread for a moment (live: 100 ms), so that several are read together and the actor's
    /// thread is not woken for each. What an actor takes the time of, or acts upon at once, must not wait.
    fn may_wait(&self) -> bool {
        false
    }

    /// Joins two unread inputs of one key; the newer one, unless the input knows better.
    fn join(_unread: Self, newer: Self) -> Self {
        newer
    }
}

/// Unread inputs of one actor, in order of arrival.
#[derive(Clone, Debug)]
pub struct Inbox<I> {
    unread: VecDeque<I>,
    capacity: usize,
    queued: usize,
    dropped: u64,
}

impl<I: Input> Inbox<I> {
    /// Makes an empty inbox that keeps at most `capacity` inputs of the queue class.
    pub fn new(capacity: usize) -> Inbox<I> {
        Inbox {
            unread: VecDeque::new(),
            capacity: capacity.max(1),
            queued: 0,
            dropped: 0,
        }
    }

    /// Puts an input in.
    pub fn push(&mut self, input: I) {
        match input.class() {
            InputClass::Latest(key) => self.replace(key, input),
            InputClass::Queue => self.append(input),
        }
    }

    /// Takes the oldest input out.
    pub fn pop(&mut self) -> Option<I> {
        let input = self.unread.pop_front()?;
        if matches!(input.class(), InputClass::Queue) {
            self.queued -= 1;
        }
        Some(input)
    }

    /// Returns how many inputs of the queue class were dropped unread.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Returns whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.unread.is_empty()
    }

    fn replace(&mut self, key: I::Key, input: I) {
        let same = |unread: &I| match unread.class() {
            InputClass::Latest(other) => other == key,
            InputClass::Queue => false,
        };
        let Some(place) = self.unread.iter().position(same) else {
            self.unread.push_back(input);
            return;
        };
        let Some(unread) = self.unread.remove(place) else {
            return;
        };
        self.unread.insert(place, I::join(unread, input));
    }

    fn append(&mut self, input: I) {
        if self.queued == self.capacity {
            let oldest = self
                .unread
                .iter()
                .position(|unread| matches!(unread.class(), InputClass::Queue));
            if let Some(place) = oldest {
                self.unread.remove(place);
                self.queued -= 1;
                self.dropped += 1;
            }
        }
        self.unread.push_back(input);
        self.queued += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[derive(Clone, Copy, PartialEq, Debug)]
    enum TestInput {
        State { of: u8, number: u32 },
        Scan(u32),
        Order(u8),
    }

    impl Input for TestInput {
        type Key = u8;
        fn class(&self) -> InputClass<u8> {
            match self {
                TestInput::State { of, .. } => InputClass::Latest(*of),
                TestInput::Scan(_) => InputClass::Queue,
                TestInput::Order(_) => InputClass::Latest(255),
            }
        }
        fn join(unread: TestInput, newer: TestInput) -> TestInput {
            match (unread, newer) {
                (TestInput::Order(a), TestInput::Order(b)) => TestInput::Order(a.max(b)),
                (_, newer) => newer,
            }
        }
    }

    #[test]
    fn a_newer_state_takes_the_place_of_the_unread_one() {
        let mut inbox = Inbox::new(4);
        inbox.push(TestInput::State { of: 1, number: 1 });
        inbox.push(TestInput::Scan(7));
        inbox.push(TestInput::State { of: 2, number: 1 });
        inbox.push(TestInput::State { of: 1, number: 2 });
        assert_eq!(inbox.pop(), Some(TestInput::State { of: 1, number: 2 }));
        assert_eq!(inbox.pop(), Some(TestInput::Scan(7)));
        assert_eq!(inbox.pop(), Some(TestInput::State { of: 2, number: 1 }));
        assert_eq!(inbox.pop(), None);
    }

    proptest! {
        #[test]
        fn no_order_is_lost_and_the_queue_stays_bounded(inputs in prop::collection::vec((0..3u8, 0..9u8), 0..200)) {
            let mut inbox = Inbox::new(5);
            let (mut strongest, mut scans) = (None, Vec::new());
            for (number, (kind, value)) in inputs.iter().enumerate() {
                let number = number as u32;
                match kind {
                    0 => inbox.push(TestInput::State { of: *value, number }),
                    1 => { scans.push(TestInput::Scan(number)); inbox.push(TestInput::Scan(number)) }
                    _ => { strongest = strongest.max(Some(*value)); inbox.push(TestInput::Order(*value)) }
                }
            }
            let dropped = inbox.dropped() as usize;
            let left: Vec<TestInput> = std::iter::from_fn(|| inbox.pop()).collect();
            let orders: Vec<_> = left.iter().filter(|inputs| matches!(inputs, TestInput::Order(_))).copied().collect();
            prop_assert_eq!(orders, strongest.map(TestInput::Order).into_iter().collect::<Vec<_>>());
            let kept: Vec<_> = left.iter().filter(|inputs| matches!(inputs, TestInput::Scan(_))).copied().collect();
            prop_assert_eq!(&kept[..], &scans[dropped..]);
            prop_assert!(kept.len() <= 5);
        }
    }
}
