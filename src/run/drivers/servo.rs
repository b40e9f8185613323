//! The servo of a live vehicle, behind the driver that its file chooses: a direction becomes a pulse, and a thread of its
//! own gives the servo that pulse until the next. Which directions there are is not decided here.
//!
//! A driver is a file in this folder and a variant of `Output` there; one that another device moves is a variant of
//! `Device`. Pulses for one on the autopilot are handed to whoever speaks with that.

#[cfg(feature = "hw")]
mod output;
#[cfg(feature = "hw")]
mod rppal_pwm;
#[cfg(feature = "hw")]
mod sysfs_pwm;
#[cfg(all(test, feature = "hw"))]
mod tests;

use std::io;
use std::time::Duration;

#[cfg(feature = "hw")]
use self::output::{Output, OutputServo};
use crate::config::{RealServo, SensorCoverage, ServoDriver, ServoOutput, ServoScale};
use crate::geom::Angle;
use crate::hw::pulse::{ServoError, ServoRange};
use crate::mavlink::autopilot_driver::ServoPulse;
use crate::plan::Mounts;

/// A servo.
pub struct Servo {
    device: Device,
}

/// Where a servo is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ServoPlace {
    /// In the simulated world.
    World,
    /// At an output of this machine.
    Machine,
    /// At an output of the autopilot.
    Autopilot,
    /// There is none.
    Nowhere,
}

/// The pulse by which a servo stands when it has turned to where it is to.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum WantedPulse {
    /// Of one at an output of this machine.
    Machine(Duration),
    /// Of one at an output of the autopilot, which is to give it.
    Autopilot(ServoPulse),
}

/// What turns range sensors.
enum Device {
    /// The simulated world, which is told by its link.
    World,
    /// An output of this machine.
    #[cfg(feature = "hw")]
    Output(Pulses, OutputServo),
    /// An output of the autopilot, by its number.
    Autopilot(Pulses, u8),
    /// Nothing does.
    None,
}

/// Which pulse turns the sensor to a direction.
struct Pulses {
    mounts: Mounts,
    range: ServoRange,
    /// The shortest and the longest pulse in whole microseconds.
    whole_us: [u16; 2],
}

impl Pulses {
    fn new(servo: &RealServo, look: &SensorCoverage) -> Result<Pulses, ServoError> {
        Ok(Pulses {
            mounts: look.mounts(),
            range: ServoRange::of(&servo.scale)?,
            whole_us: whole_us(&servo.scale),
        })
    }

    /// Returns the pulse for a direction in whole microseconds, never beyond the shortest and the longest.
    fn whole_to(&self, beam: Angle) -> Option<u16> {
        let [shortest_us, longest_us] = self.whole_us;
        let pulse_us = (self.to(beam)?.as_nanos() + 500) / 1000;
        let pulse_us = u16::try_from(pulse_us).unwrap_or(u16::MAX);
        Some(pulse_us.min(longest_us).max(shortest_us))
    }

    /// Returns the pulse for a direction against the heading; `None` where no servo is to turn.
    fn to(&self, beam: Angle) -> Option<Duration> {
        let aim = self.mounts.aim(beam)?;
        let mount = self.mounts.all().get(aim.sensor)?;
        if mount.from_rad == mount.to_rad {
            return None;
        }
        self.range.nearest_pulse(aim.offset_rad.to_degrees())
    }

    /// Returns the pulse with which it begins.
    fn at_rest(&self) -> Option<Duration> {
        let mut all = self.mounts.all().iter();
        let turned = all.find(|mount| mount.from_rad != mount.to_rad)?;
        self.to(turned.beam(turned.rest_rad()))
    }
}

/// Returns the whole microseconds nearest to the ends of a scale and within them.
fn whole_us(scale: &ServoScale) -> [u16; 2] {
    let ends = |list: &[f64]| match list {
        [shortest_us, longest_us] => [shortest_us.ceil() as u16, longest_us.floor() as u16],
        _ => [0, 0],
    };
    ends(&scale.pulse_us)
}

impl ServoPlace {
    /// Returns where the servo of a driver is.
    pub fn of(driver: &ServoDriver) -> ServoPlace {
        match driver {
            ServoDriver::Simulated => ServoPlace::World,
            ServoDriver::Real(servo) => match servo.output {
                ServoOutput::Autopilot { .. } => ServoPlace::Autopilot,
                ServoOutput::Pwm { .. } | ServoOutput::Gpio { .. } => ServoPlace::Machine,
            },
            ServoDriver::None => ServoPlace::Nowhere,
        }
    }
}

impl Servo {
    /// Looks whether the output at this machine that a driver names could be opened, without opening it: pulses that it gives
    /// now go on, and nothing moves.
    ///
    /// # Errors
    /// In words, why it could not.
    pub fn could_be_opened(driver: &ServoDriver) -> Result<(), String> {
        match driver {
            ServoDriver::Simulated | ServoDriver::None => Ok(()),
            ServoDriver::Real(servo) => output_could_be_opened(servo),
        }
    }

    /// Starts what gives pulses.
    ///
    /// # Errors
    /// No thread can be started, the servo cannot be, or the driver is not built in.
    pub fn start(driver: &ServoDriver, look: &SensorCoverage) -> io::Result<Servo> {
        Servo::begin(driver, look, Pulses::at_rest)
    }

    /// Starts what gives pulses, and gives none before it is steered: nothing moves.
    ///
    /// # Errors
    /// As [`Servo::start`].
    pub fn start_still(driver: &ServoDriver, look: &SensorCoverage) -> io::Result<Servo> {
        Servo::begin(driver, look, |_| None)
    }

    fn begin(
        driver: &ServoDriver,
        look: &SensorCoverage,
        first: fn(&Pulses) -> Option<Duration>,
    ) -> io::Result<Servo> {
        let device = match driver {
            ServoDriver::Simulated => Device::World,
            ServoDriver::Real(servo) => {
                let pulses = Pulses::new(servo, look).map_err(io::Error::other)?;
                match servo.output {
                    ServoOutput::Autopilot { output } => {
                        Device::Autopilot(pulses, u8::try_from(output).unwrap_or(u8::MAX))
                    }
                    ServoOutput::Pwm { .. } | ServoOutput::Gpio { .. } => {
                        device(servo, pulses, first)?
                    }
                }
            }
            ServoDriver::None => Device::None,
        };
        Ok(Servo { device })
    }

    /// Turns the sensor that looks along a direction against the heading; returns the pulse by which its servo stands then, if
    /// one is to turn. One on the autopilot is not told here.
    pub fn steer(&self, beam: Angle) -> Option<WantedPulse> {
        match &self.device {
            Device::World | Device::None => None,
            #[cfg(feature = "hw")]
            Device::Output(pulses, output) => {
                let pulse = pulses.to(beam)?;
                output.give(pulse);
                Some(WantedPulse::Machine(pulse))
            }
            Device::Autopilot(pulses, output) => {
                let width_us = pulses.whole_to(beam)?;
                Some(WantedPulse::Autopilot(ServoPulse {
                    output: *output,
                    width_us,
                }))
            }
        }
    }

    /// Returns whether a servo at an output of this machine has this pulse, and had it early enough to stand there.
    pub fn stands_by(&self, pulse: Duration) -> bool {
        match &self.device {
            Device::World | Device::Autopilot(..) | Device::None => {
                let _ = pulse;
                false
            }
            #[cfg(feature = "hw")]
            Device::Output(_, output) => output.stands_by(pulse),
        }
    }

    /// Returns where it is.
    pub fn place(&self) -> ServoPlace {
        match &self.device {
            Device::World => ServoPlace::World,
            #[cfg(feature = "hw")]
            Device::Output(..) => ServoPlace::Machine,
            Device::Autopilot(..) => ServoPlace::Autopilot,
            Device::None => ServoPlace::Nowhere,
        }
    }

    /// Returns what is wrong with it, in words.
    pub fn trouble(&self) -> Option<String> {
        match &self.device {
            // Of one on the autopilot that says it.
            Device::World | Device::Autopilot(..) | Device::None => None,
            #[cfg(feature = "hw")]
            Device::Output(_, output) => output.trouble(),
        }
    }
}

#[cfg(feature = "hw")]
fn device(
    servo: &RealServo,
    pulses: Pulses,
    first: fn(&Pulses) -> Option<Duration>,
) -> io::Result<Device> {
    let output = Output::of(&servo.output).ok_or(io::ErrorKind::Unsupported)?;
    let output = OutputServo::start(output, first(&pulses))?;
    Ok(Device::Output(pulses, output))
}

#[cfg(feature = "hw")]
fn output_could_be_opened(servo: &RealServo) -> Result<(), String> {
    Output::of(&servo.output).map_or(Ok(()), |output| output.could_be_opened())
}

/// Its name was refused when the file was read.
#[cfg(not(feature = "hw"))]
fn output_could_be_opened(_: &RealServo) -> Result<(), String> {
    Err("it is not built in".to_owned())
}

/// Its name was refused when the file was read.
#[cfg(not(feature = "hw"))]
fn device(
    _: &RealServo,
    pulses: Pulses,
    first: fn(&Pulses) -> Option<Duration>,
) -> io::Result<Device> {
    let _ = (first(&pulses), pulses.to(Angle::ZERO));
    Err(io::ErrorKind::Unsupported.into())
}
