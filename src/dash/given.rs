//! What pages have asked for, numbered, with what became of it: the last of each kind, to be shown.

use std::collections::VecDeque;

use crate::time::Time;

/// So many are shown.
const SHOWN: usize = 16;

/// A request of a page.
#[derive(Clone, PartialEq, Debug)]
pub struct Given<Request, Outcome> {
    /// Its number.
    pub number: u32,
    /// What was asked for.
    pub request: Request,
    /// When.
    pub at: Time,
    /// What became of it; `None` = it is on its way.
    pub outcome: Option<Outcome>,
}

/// The last requests of a kind.
#[derive(Clone, Debug)]
pub struct GivenBook<Request, Outcome> {
    given: VecDeque<Given<Request, Outcome>>,
    last: u32,
}

impl<Request, Outcome> Default for GivenBook<Request, Outcome> {
    fn default() -> Self {
        GivenBook {
            given: VecDeque::new(),
            last: 0,
        }
    }
}

impl<Request, Outcome> GivenBook<Request, Outcome> {
    /// Enters a request; returns its number.
    pub fn enter(&mut self, now: Time, request: Request) -> u32 {
        self.last = self.last.wrapping_add(1);
        self.given.push_back(Given {
            number: self.last,
            request,
            at: now,
            outcome: None,
        });
        if self.given.len() > SHOWN {
            self.given.pop_front();
        }
        self.last
    }

    /// Takes what became of a request; of one that is not shown any more nothing is kept.
    pub fn end(&mut self, number: u32, outcome: Outcome) {
        if let Some(given) = self.given.iter_mut().find(|given| given.number == number) {
            given.outcome = Some(outcome);
        }
    }

    /// Returns the number of the last request; 0 = none.
    pub fn last(&self) -> u32 {
        self.last
    }

    /// Returns the last requests, oldest first.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &Given<Request, Outcome>> {
        self.given.iter()
    }

    /// Returns whether nothing was asked for.
    pub fn is_empty(&self) -> bool {
        self.given.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_requests_are_kept_with_how_they_fared_and_the_oldest_forgotten() {
        let mut book = GivenBook::default();
        assert_eq!((book.last(), book.is_empty()), (0, true));
        for number in 1..=20 {
            assert_eq!(book.enter(Time::ZERO, number * 10), number);
        }
        book.end(20, "done");
        book.end(1, "done");
        let given: Vec<(u32, u32, bool)> = book
            .iter()
            .map(|given| (given.number, given.request, given.outcome.is_some()))
            .collect();
        assert_eq!((given.len(), book.last()), (SHOWN, 20));
        assert_eq!((given[0], given[15]), ((5, 50, false), (20, 200, true)));
    }
}
