//! Gives a servo its pulses at an output of this machine, on a thread of its own, newest pulse first; opens the output anew for ever
//! when it is gone. When it ends, hardware goes on with its last pulse: a servo without one would let the sensor swing.

use std::io;
use std::time::Duration;

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

/// The pulses of a servo.
#[derive(Default)]
pub(super) struct Pulse {
    /// The newest; `None` before the first.
    wanted: Option<Duration>,
    /// The one that the servo has.
    given: Option<Duration>,
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

/// Gives each pulse that is wanted, until the end.
fn gives(
    shared: &Shared<Pulse>,
    mut give: impl FnMut(Duration) -> Result<(), String>,
) -> Result<(), String> {
    shared.with(|pulse| pulse.given = None);
    shared.opened();
    while let Some(pulse) = shared.wait(Pulse::take) {
        give(pulse)?;
    }
    Ok(())
}

impl Pulse {
    /// Returns the pulse that is to be given.
    fn take(&mut self) -> Option<Duration> {
        let new = self.wanted.filter(|_| self.wanted != self.given);
        self.given = self.wanted;
        new
    }
}

impl OutputServo {
    /// Begins to give pulses, this one first.
    ///
    /// # Errors
    /// No thread can be started.
    pub(super) fn start(mut output: Output, first: Option<Duration>) -> io::Result<OutputServo> {
        let (name, pulse) = (
            output.name(),
            Pulse {
                wanted: first,
                given: None,
            },
        );
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
        self.0.with(|shared| shared.wanted = Some(pulse));
    }

    /// Returns why the output is closed; `None` while it is open.
    pub(super) fn trouble(&self) -> Option<String> {
        self.0.trouble()
    }
}
