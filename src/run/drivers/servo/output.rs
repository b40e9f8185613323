//! Gives a servo its pulses at an output of this machine, on a thread of its own, newest pulse first; opens the output anew
//! for ever when it is gone. When it ends, hardware goes on with its last pulse: a servo without one would let the sensor
//! swing.
//!
//! Who measures with what the servo turns must know where it stands: a pulse counts as given when it was given in time
//! while the output is open, or is wanted once more after that.

use std::io;
use std::time::{Duration, Instant};

use super::rppal_pwm::RppalPwm;
use super::sysfs_pwm::{Chip, Files, SysfsPwm};
use crate::config::ServoOutput;
use crate::run::drivers::device_thread::{DeviceThread, Gone, Shared};

/// An output that gives pulses.
pub(super) enum Output {
    /// A channel of a PWM chip of the kernel.
    Sysfs(Chip, Files),
    /// A pin of a Raspberry Pi, by its name.
    Pin(String),
}

/// A servo that gets its pulse later than this is not where it is expected when it has settled.
const GIVEN_WITHIN: Duration = Duration::from_millis(20);

/// The pulses of a servo.
pub(super) struct Pulse {
    /// The newest; `None` before the first.
    wanted: Option<Duration>,
    /// Since when it is wanted.
    since: Instant,
    /// The one that the servo has; `None` while the output is closed.
    given: Option<Duration>,
    /// Whether it got that in time.
    is_in_time: bool,
}

/// A servo at an output and the thread that moves it.
pub(super) struct OutputServo(DeviceThread<Pulse>);

impl Output {
    /// Makes the output that a file names, if it is one of this machine; opens nothing.
    pub(super) fn of(output: &ServoOutput) -> Option<Output> {
        Some(match output {
            ServoOutput::Autopilot { .. } => return None,
            ServoOutput::Pwm { chip, channel } => Output::Sysfs(
                Chip {
                    folder: chip.into(),
                    channel: *channel,
                },
                Files::Kernel,
            ),
            ServoOutput::Gpio { pin } => Output::Pin(pin.clone()),
        })
    }

    fn name(&self) -> String {
        match self {
            Output::Sysfs(chip, _) => chip.folder.display().to_string(),
            Output::Pin(name) => name.clone(),
        }
    }

    /// Looks whether the output could be opened, and opens it not: what it gives now goes on.
    ///
    /// # Errors
    /// In words, why it could not.
    pub(super) fn could_be_opened(&self) -> Result<(), String> {
        match self {
            Output::Sysfs(chip, _) => chip.could_be_opened(),
            Output::Pin(name) => RppalPwm::could_be_opened(name),
        }
        .map_err(|why| format!("{}: {why}", self.name()))
    }

    /// Opens the output and gives pulses until the end, or until it is gone.
    fn session(&mut self, shared: &Shared<Pulse>) -> Result<(), String> {
        match self {
            Output::Sysfs(chip, files) => {
                let pause = |lasts| {
                    shared.pause(lasts);
                    shared.is_ended()
                };
                let pwm = SysfsPwm::open(chip, files, pause)?;
                gives(shared, |pulse| pwm.give(files, pulse))
            }
            Output::Pin(name) => {
                let mut pin = RppalPwm::open(name)?;
                gives(shared, |pulse| pin.give(pulse))
            }
        }
    }
}

/// Gives each pulse that is wanted, until the end, or until one cannot be given.
fn gives(
    shared: &Shared<Pulse>,
    mut give: impl FnMut(Duration) -> Result<(), String>,
) -> Result<(), String> {
    shared.opened();
    while let Some(pulse) = shared.wait(Pulse::next) {
        let given = give(pulse);
        let now = Instant::now();
        shared.with(|pulses| pulses.note(now, given.is_ok().then_some(pulse)));
        given?;
    }
    Ok(())
}

impl Pulse {
    fn new(now: Instant, first: Option<Duration>) -> Pulse {
        Pulse {
            wanted: first,
            since: now,
            given: None,
            is_in_time: false,
        }
    }

    /// Wants a pulse from now on.
    fn want(&mut self, now: Instant, pulse: Duration) {
        if self.wanted == Some(pulse) {
            // The servo has stood there since.
            self.is_in_time = self.given == Some(pulse);
        }
        (self.wanted, self.since) = (Some(pulse), now);
    }

    /// Returns the pulse that is to be given.
    fn next(&mut self) -> Option<Duration> {
        self.wanted.filter(|_| self.wanted != self.given)
    }

    /// Notes which pulse the servo has now; `None` = the output is gone.
    fn note(&mut self, now: Instant, given: Option<Duration>) {
        self.given = given;
        let after = now.saturating_duration_since(self.since);
        self.is_in_time = given == self.wanted && after <= GIVEN_WITHIN;
    }

    /// Returns whether the servo stands by a pulse.
    fn stands_by(&self, pulse: Duration) -> bool {
        self.wanted == Some(pulse) && self.given == Some(pulse) && self.is_in_time
    }
}

impl OutputServo {
    /// Begins to give pulses, this one first.
    ///
    /// # Errors
    /// No thread can be started.
    pub(super) fn start(mut output: Output, first: Option<Duration>) -> io::Result<OutputServo> {
        let (name, pulse) = (output.name(), Pulse::new(Instant::now(), first));
        let session = move |shared: &Shared<Pulse>| {
            output.session(shared).map_err(|why| Gone {
                why,
                has_worked: false,
            })
        };
        DeviceThread::start("servo", name, pulse, session).map(OutputServo)
    }

    /// Gives a pulse from now on.
    pub(super) fn give(&self, pulse: Duration) {
        let now = Instant::now();
        self.0.with(|pulses| pulses.want(now, pulse));
    }

    /// Returns whether the servo has this pulse, and had it early enough to stand there.
    pub(super) fn stands_by(&self, pulse: Duration) -> bool {
        self.0.with(|pulses| pulses.stands_by(pulse))
    }

    /// Returns why the output is closed; `None` while it is open.
    pub(super) fn trouble(&self) -> Option<String> {
        self.0.trouble()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_servo_stands_by_the_pulse_that_it_got_in_time_while_its_output_is_open() {
        let begin = Instant::now();
        let at = |ms| begin + Duration::from_millis(ms);
        let [left, right] = [1000, 2000].map(Duration::from_micros);
        let mut pulses = Pulse::new(begin, Some(left));
        assert!(!pulses.stands_by(left), "it is not open yet");
        let given = pulses.next();
        pulses.note(at(5), given);
        assert!(pulses.stands_by(left) && !pulses.stands_by(right));
        assert_eq!(pulses.next(), None);
        pulses.want(at(100), right);
        assert!(!pulses.stands_by(right), "it is not given yet");
        let given = pulses.next();
        pulses.note(at(200), given);
        assert!(!pulses.stands_by(right), "it may be turning still");
        pulses.want(at(300), right);
        assert!(pulses.stands_by(right) && !pulses.stands_by(left));
        pulses.note(at(301), None);
        assert!(!pulses.stands_by(right), "the output is gone");
        pulses.want(at(400), right);
        assert!(!pulses.stands_by(right));
        assert_eq!(pulses.next(), Some(right));
    }
}
