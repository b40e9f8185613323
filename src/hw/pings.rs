//! Which ping waits for its answer, which reading of a sensor that measures all the time answers it, and what was never
//! answered. Silence stays silence here: no echo is ever made of it.

use std::time::Duration;

use super::{RangeReading, TimedReading};
use crate::node::sensor::{Echo, Ping};
use crate::time::Time;

/// A range sensor that answered before, and then none of more than [`MANY`] pings for this long, is silent.
const SILENT: Duration = Duration::from_millis(800);
/// So many pings without an answer may be chance: a glitch, a late frame, a sensor that was blinded for a moment.
const MANY: u32 = 5;
/// And so is one that has answered none for this long, however seldom it is asked, and when it was just switched on.
const SILENT_FOR_LONG: Duration = Duration::from_secs(3);

/// The pings of a vehicle's range sensor.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pings {
    /// The newest ping and when it was said; `None` once it is answered.
    awaited: Option<(Ping, Time)>,
    /// When the first of the pings since the last answer was said, and how many there are.
    unanswered: Option<(Time, u32)>,
    has_answered: bool,
    faults: u64,
}

impl Pings {
    /// Notes that a ping was said; one before it that has no answer yet gets none any more.
    pub fn ping(&mut self, now: Time, ping: Ping) {
        if self.awaited.replace((ping, now)).is_some() {
            self.faults += 1;
        }
        let (_, count) = self.unanswered.get_or_insert((now, 0));
        *count = count.saturating_add(1);
    }

    /// Notes an answer of a sensor that says which ping it answers.
    pub fn answered(&mut self, number: u64) {
        self.awaited.take_if(|(ping, _)| ping.number == number);
        (self.unanswered, self.has_answered) = (None, true);
    }

    /// Returns the echo that a reading is, if a ping waits for it: one that was measured before the ping says nothing of
    /// where the sensor looks now.
    pub fn answer(&mut self, timed: TimedReading) -> Option<Echo> {
        let (ping, _) = self
            .awaited
            .take_if(|(_, sent_at)| *sent_at <= timed.measured)?;
        (self.unanswered, self.has_answered) = (None, true);
        let range_m = match timed.reading {
            RangeReading::Range(range_m) => Some(range_m),
            RangeReading::Nothing => None,
        };
        Some(Echo {
            number: ping.number,
            range_m,
        })
    }

    /// Returns whether pings have gone without any answer for too long; never when nothing was asked.
    pub fn is_silent(&self, now: Time) -> bool {
        self.unanswered.is_some_and(|(at, count)| {
            let silent = now.since(at);
            let is_many = self.has_answered && count > MANY;
            silent > SILENT_FOR_LONG || (silent > SILENT && is_many)
        })
    }

    /// Returns how many pings were never answered.
    pub fn faults(&self) -> u64 {
        self.faults
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    fn range(measured_s: f64, range_m: f64) -> TimedReading {
        TimedReading {
            measured: at(measured_s),
            reading: RangeReading::Range(range_m),
        }
    }

    #[test]
    fn a_reading_answers_the_ping_before_it_once_and_no_later_one() {
        let mut pings = Pings::default();
        assert_eq!(pings.answer(range(0.5, 1.0)), None, "nobody has asked");
        pings.ping(at(1.0), Ping { number: 7 });
        assert_eq!(
            pings.answer(range(0.999, 1.0)),
            None,
            "it is older than the ping"
        );
        assert_eq!(
            pings.answer(range(1.0, 1.5)),
            Some(Echo {
                number: 7,
                range_m: Some(1.5)
            })
        );
        assert_eq!(pings.answer(range(1.1, 1.6)), None, "it is answered");
        pings.ping(at(2.0), Ping { number: 8 });
        let nothing = TimedReading {
            measured: at(2.1),
            reading: RangeReading::Nothing,
        };
        assert_eq!(
            pings.answer(nothing),
            Some(Echo {
                number: 8,
                range_m: None
            })
        );
        assert_eq!(pings.faults(), 0);
    }

    #[test]
    fn a_ping_without_an_answer_is_a_fault_and_gets_none_later() {
        let mut pings = Pings::default();
        pings.ping(at(1.0), Ping { number: 1 });
        pings.ping(at(1.1), Ping { number: 2 });
        assert_eq!(pings.faults(), 1);
        assert_eq!(pings.answer(range(1.05, 1.0)), None);
        assert_eq!(
            pings.answer(range(1.15, 1.0)).map(|echo| echo.number),
            Some(2)
        );
        pings.ping(at(1.2), Ping { number: 3 });
        pings.answered(2);
        pings.ping(at(1.3), Ping { number: 4 });
        assert_eq!(
            pings.faults(),
            2,
            "a late answer to another ping is none to this one"
        );
        pings.answered(4);
        pings.ping(at(1.4), Ping { number: 5 });
        assert_eq!(pings.faults(), 2);
    }

    #[test]
    fn silence_is_counted_from_the_first_ping_that_nothing_answers() {
        let mut pings = Pings::default();
        assert!(!pings.is_silent(at(5.0)), "it was not asked");
        let ask = |pings: &mut Pings, from_s: f64| {
            for number in 0..35 {
                pings.ping(at(from_s + 0.1 * number as f64), Ping { number });
            }
        };
        ask(&mut pings, 5.0);
        let is_silent_at = |pings: &Pings, all: [f64; 2]| all.map(|at_s| pings.is_silent(at(at_s)));
        assert_eq!(
            is_silent_at(&pings, [8.0, 8.1]),
            [false, true],
            "as it begins"
        );
        assert!(pings.answer(range(8.5, 1.0)).is_some());
        ask(&mut pings, 9.0);
        assert_eq!(is_silent_at(&pings, [9.8, 9.9]), [false, true]);
        assert!(pings.answer(range(13.0, 1.0)).is_some());
        assert!(!pings.is_silent(at(99.0)));
        for number in 40..45 {
            pings.ping(at(100.0), Ping { number });
        }
        assert!(
            !pings.is_silent(at(103.0)) && pings.is_silent(at(103.1)),
            "few pings, and long"
        );
    }
}
