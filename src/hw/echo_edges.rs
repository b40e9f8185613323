//! What the edges of an HC-SR04's echo line mean. Its pulse is as long as the sound was under way. A sensor that is silent,
//! stuck or disturbed gives no reading: only a pulse that ends, and is too long for an echo, says that nothing is there.
//!
//! ```text
//!   [Idle] ──trigger──► [Triggered] ──rises within 5 ms──► [High] ──falls──► [Fallen] ──1 ms quiet──► a reading; [Idle]
//!                            │                               │                  │
//!                            ├─ 5 ms: silent; [Idle]         ├─ 60 ms: stuck    └─ rises again: a glitch
//!                            └───────── whatever else comes: a glitch; [Idle] ──┘
//! ```
//!
//! Times are those of the kernel's stamps, of any fixed origin. Opens no line. Edges may be taken late, but in their order and
//! before [`EchoEdges::wake`] is told a time after them.

use std::fmt;
use std::time::Duration;

use super::RangeReading;
use crate::time::Time;

/// The line rises at the latest so long after a trigger.
const RISES_WITHIN: Duration = Duration::from_millis(5);
/// A shorter pulse is none of the sensor's.
const SHORTEST: Duration = Duration::from_micros(100);
/// From here on a pulse says that nothing was heard.
pub const NOTHING_FROM: Duration = Duration::from_millis(25);
/// A longer pulse is none of the sensor's: it is stuck.
const LONGEST: Duration = Duration::from_millis(60);
/// A pulse counts when the line was quiet for so long after it.
const QUIET: Duration = Duration::from_millis(1);
/// What is due up to a time is over after it.
const MOMENT: Duration = Duration::from_nanos(1);

/// Returns the speed of sound in dry air, m/s, at a temperature in °C.
pub fn sound_mps(air_temperature_c: f64) -> f64 {
    331.3 + 0.606 * air_temperature_c
}

/// An edge of the echo line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Edge {
    /// When the kernel saw it.
    pub at: Time,
    /// Whether the line is high after it.
    pub is_rising: bool,
    /// Its number among the line's edges; one that is missing was lost.
    pub number: u32,
}

/// What came of a trigger.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum EchoAnswer {
    /// A measurement.
    Reading(RangeReading),
    /// The line did not rise: a wire, or no power.
    Silent,
    /// The line does not fall.
    Stuck,
    /// Edges that are no echo.
    Glitch,
}

/// How often triggers came to nothing.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct EchoFaults {
    /// The line did not rise.
    pub silent: u64,
    /// The line did not fall.
    pub stuck: u64,
    /// Edges that are no echo, after a trigger or unasked.
    pub glitches: u64,
}

impl fmt::Display for EchoFaults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let EchoFaults {
            silent,
            stuck,
            glitches,
        } = self;
        write!(
            f,
            "the echo line did not rise {silent} times (wire, power), did not fall {stuck} times, {glitches} glitches"
        )
    }
}

/// The echo line of one sensor.
#[derive(Clone, Debug)]
pub struct EchoEdges {
    sound_mps: f64,
    state: State,
    /// The number of the last edge.
    last: Option<u32>,
    faults: EchoFaults,
}

#[derive(Clone, Copy, Debug)]
enum State {
    /// Nothing is awaited.
    Idle,
    /// The line is to rise.
    Triggered { at: Time },
    /// The line is to fall.
    High { since: Time },
    /// The pulse is over if nothing more comes.
    Fallen { at: Time, width: Duration },
}

impl EchoEdges {
    /// Makes it for air of a temperature, °C.
    pub fn new(air_temperature_c: f64) -> EchoEdges {
        EchoEdges {
            sound_mps: sound_mps(air_temperature_c),
            state: State::Idle,
            last: None,
            faults: EchoFaults::default(),
        }
    }

    /// Forgets the line: it was opened anew, and its edges are numbered anew.
    pub fn restart(&mut self) {
        (self.state, self.last) = (State::Idle, None);
    }

    /// Notes that the sensor is about to be triggered; one before has no answer any more. A line that is high is stuck, and the
    /// sensor is not to be triggered.
    pub fn trigger(&mut self, now: Time, is_high: bool) -> Option<EchoAnswer> {
        if is_high {
            return Some(self.fault(EchoAnswer::Stuck));
        }
        self.state = State::Triggered { at: now };
        None
    }

    /// Takes an edge; what nobody asked for is counted, and no answer.
    pub fn edge(&mut self, edge: Edge) -> Option<EchoAnswer> {
        let expected = self
            .last
            .replace(edge.number)
            .map(|last| last.wrapping_add(1));
        let has_lost = expected.is_some_and(|number| number != edge.number);
        // What was due before it comes first: how late edges are taken changes nothing.
        let due = match has_lost {
            true => None,
            false => self.wake(edge.at),
        };
        match (self.state, edge.is_rising) {
            _ if has_lost => self.glitch(due),
            (State::Triggered { at }, true) if edge.at >= at => {
                self.state = State::High { since: edge.at };
                due
            }
            (State::High { since }, false) if edge.at >= since + SHORTEST => {
                let width = edge.at.since(since);
                self.state = State::Fallen { at: edge.at, width };
                due
            }
            // A line that was stuck falls at last.
            (State::Idle, false) => due,
            (State::Idle, true)
            | (State::Triggered { .. }, _)
            | (State::High { .. }, _)
            | (State::Fallen { .. }, _) => self.glitch(due),
        }
    }

    /// Counts an edge that is none of an echo; it answers the trigger that waits, if one does.
    fn glitch(&mut self, due: Option<EchoAnswer>) -> Option<EchoAnswer> {
        let is_awaited = !matches!(self.state, State::Idle);
        let glitch = self.fault(EchoAnswer::Glitch);
        due.or(is_awaited.then_some(glitch))
    }

    /// Returns when it wants to be woken.
    pub fn deadline(&self) -> Option<Time> {
        match self.state {
            State::Idle => None,
            State::Triggered { at } => Some(at + RISES_WITHIN + MOMENT),
            State::High { since } => Some(since + LONGEST + MOMENT),
            State::Fallen { at, .. } => Some(at + QUIET + MOMENT),
        }
    }

    /// Says what no edge up to `now` means.
    pub fn wake(&mut self, now: Time) -> Option<EchoAnswer> {
        self.deadline().filter(|deadline| *deadline <= now)?;
        match self.state {
            State::Idle => None,
            State::Triggered { .. } => Some(self.fault(EchoAnswer::Silent)),
            State::High { .. } => Some(self.fault(EchoAnswer::Stuck)),
            State::Fallen { width, .. } => {
                self.state = State::Idle;
                Some(EchoAnswer::Reading(self.reading(width)))
            }
        }
    }

    /// Returns how often triggers came to nothing so far.
    pub fn faults(&self) -> EchoFaults {
        self.faults
    }

    fn reading(&self, width: Duration) -> RangeReading {
        match width < NOTHING_FROM {
            true => RangeReading::Range(width.as_secs_f64() * self.sound_mps / 2.0),
            false => RangeReading::Nothing,
        }
    }

    /// Counts what is no reading; nothing is awaited after it.
    fn fault(&mut self, answer: EchoAnswer) -> EchoAnswer {
        self.state = State::Idle;
        match answer {
            EchoAnswer::Reading(_) => {}
            EchoAnswer::Silent => self.faults.silent += 1,
            EchoAnswer::Stuck => self.faults.stuck += 1,
            EchoAnswer::Glitch => self.faults.glitches += 1,
        }
        answer
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(time_us: u64) -> Time {
        Time::from_nanos(time_us * 1000)
    }

    fn echo(edges: &mut EchoEdges, width_us: u64) -> Option<EchoAnswer> {
        assert_eq!(edges.trigger(at(0), false), None);
        for (number, time_us, is_rising) in [(1, 450, true), (2, 450 + width_us, false)] {
            let edge = Edge {
                at: at(time_us),
                is_rising,
                number,
            };
            assert_eq!(edges.edge(edge), None);
        }
        edges.wake(at(100_000))
    }

    #[test]
    fn a_pulse_of_5824_microseconds_is_a_metre_and_one_of_38_000_says_that_nothing_is_there() {
        for (width_us, expected_m) in [
            (116, Some(0.020)),
            (580, Some(0.100)),
            (5824, Some(1.0)),
            (11_648, Some(2.0)),
            (23_296, Some(4.0)),
            (38_000, None),
        ] {
            match (echo(&mut EchoEdges::new(20.0), width_us), expected_m) {
                (Some(EchoAnswer::Reading(RangeReading::Range(range_m))), Some(expected_m)) => {
                    assert!((range_m - expected_m).abs() < 0.001, "{range_m}");
                }
                (Some(EchoAnswer::Reading(RangeReading::Nothing)), None) => {}
                other => panic!("{width_us}: {other:?}"),
            }
        }
    }

    #[test]
    fn a_line_that_is_high_before_a_trigger_is_stuck() {
        let mut edges = EchoEdges::new(20.0);
        assert_eq!(edges.trigger(at(0), true), Some(EchoAnswer::Stuck));
        assert_eq!((edges.deadline(), edges.faults().stuck), (None, 1));
    }

    proptest! {
        #[test]
        fn each_trigger_has_one_answer_and_it_is_a_reading_only_of_a_whole_pulse(
            times_us in prop::collection::vec((0..100_000_u64, any::<bool>(), prop::sample::select(vec![0_u32, 1, 1, 1, 1, 2])), 0..6),
        ) {
            let mut edges = EchoEdges::new(20.0);
            edges.trigger(at(0), false);
            let (mut answers, mut number) = (Vec::new(), 0_u32);
            for (time_us, is_rising, step) in &times_us {
                number = number.wrapping_add(*step);
                answers.extend(edges.edge(Edge { at: at(*time_us), is_rising: *is_rising, number }));
            }
            answers.extend(edges.wake(at(1_000_000)));
            prop_assert!(answers.len() == 1 && edges.deadline().is_none(), "{:?}", answers);
            if let EchoAnswer::Reading(_) = answers[0] {
                let [(rise_us, true, _), (fall_us, false, _), ..] = times_us[..] else {
                    panic!("{times_us:?}");
                };
                let is_long = fall_us - rise_us >= 25_000;
                prop_assert!(rise_us <= 5_000 && fall_us - rise_us <= 60_000);
                prop_assert_eq!(is_long, answers[0] == EchoAnswer::Reading(RangeReading::Nothing));
            }
        }
    }
}
