//! What an autopilot has said by itself and nobody has taken yet. It says nothing of its own.

use std::collections::VecDeque;

use super::messages::{DatedText, StatusText};
use crate::time::Time;

/// Texts that nobody takes are dropped, the oldest first, beyond this many.
const MOST: usize = 256;

/// Status texts in the order in which they were said.
#[derive(Clone, Debug, Default)]
pub(super) struct StatusTexts {
    unread: VecDeque<DatedText>,
}

impl StatusTexts {
    /// Says something.
    pub(super) fn say(&mut self, now: Time, text: StatusText) {
        if self.unread.len() >= MOST {
            self.unread.pop_front();
        }
        self.unread.push_back((now, text));
    }

    /// Returns what was said since the last call, in order.
    pub(super) fn take(&mut self) -> Vec<DatedText> {
        self.unread.drain(..).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_said_is_taken_once_and_of_too_much_the_oldest_is_lost() {
        let mut texts = StatusTexts::default();
        let output = |item: usize| (Time::from_nanos(item as u64), StatusText::Begun(item));
        for item in 0..MOST + 2 {
            let (now, text) = output(item);
            texts.say(now, text);
        }
        let taken = texts.take();
        assert_eq!(
            (taken.len(), taken[0], taken[MOST - 1]),
            (MOST, output(2), output(MOST + 1))
        );
        assert!(texts.take().is_empty());
    }
}
