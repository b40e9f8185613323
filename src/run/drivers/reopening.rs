//! When a connection to a device that is gone is opened again: soon, and then ever more seldom as long as nothing was heard
//! on it.

use std::time::Duration;

use crate::time::Time;

/// A connection that is gone is opened again after this long at first.
pub(super) const SOONEST: Duration = Duration::from_millis(250);
/// And this often in the end.
pub(super) const LATEST: Duration = Duration::from_secs(1);

/// Why a connection is closed, and when it is opened again.
#[derive(Clone, Debug)]
pub(super) struct Reopening {
    closed: Option<String>,
    at: Time,
    after: Duration,
}

impl Default for Reopening {
    /// It has not been opened yet, and may be at once.
    fn default() -> Reopening {
        Reopening {
            closed: Some("not open yet".to_owned()),
            at: Time::ZERO,
            after: SOONEST,
        }
    }
}

impl Reopening {
    /// Returns why it is closed, in words; `None` while it is open.
    pub(super) fn closed(&self) -> Option<&String> {
        self.closed.as_ref()
    }

    /// Returns when it is to be opened; `None` while it is open.
    pub(super) fn deadline(&self) -> Option<Time> {
        self.closed.as_ref().map(|_| self.at)
    }

    /// Notes that it is open.
    pub(super) fn opened(&mut self) {
        self.closed = None;
    }

    /// Notes that it is gone, or could not be opened, and whether anything was heard on the last one: of one that could not be
    /// opened that says nothing.
    pub(super) fn gone(&mut self, now: Time, why: String, has_heard: bool) {
        let was_open = self.closed.replace(why).is_none();
        self.at = now + self.after;
        self.after = match has_heard && was_open {
            true => SOONEST,
            false => (self.after * 2).min(LATEST),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_connection_is_tried_ever_more_seldom_until_something_was_heard_on_it() {
        let mut reopening = Reopening::default();
        assert_eq!(reopening.deadline(), Some(Time::ZERO));
        let mut waits_ms = |at_s: f64, has_heard| {
            let now = Time::from_secs_f64(at_s);
            reopening.gone(now, "it has gone".to_owned(), has_heard);
            reopening.deadline().unwrap().since(now).as_millis()
        };
        let waits: Vec<u128> = (0..4).map(|_| waits_ms(10.0, false)).collect();
        assert_eq!(waits, [250, 500, 1000, 1000]);
        assert_eq!(waits_ms(20.0, true), 1000, "it was not open");
        reopening.opened();
        reopening.gone(Time::from_secs_f64(29.0), "it has gone".to_owned(), true);
        let waits: Vec<u128> = (0..3)
            .map(|_| {
                // What was heard before it went counts once.
                let now = Time::from_secs_f64(30.0);
                reopening.gone(now, "it has gone".to_owned(), true);
                reopening.deadline().unwrap().since(now).as_millis()
            })
            .collect();
        assert_eq!(waits, [250, 500, 1000]);
        reopening.opened();
        assert_eq!((reopening.deadline(), reopening.closed()), (None, None));
    }
}
