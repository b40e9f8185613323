//! The servo of a live vehicle, behind the driver that its file chooses: a direction becomes a pulse, and a thread of its own gives
//! the servo that pulse until the next. Which directions there are is not decided here.
//!
//! A driver is a file in this folder and a variant of `Output` there; one that another device moves is a variant of `Device`.

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
use crate::config::{RealServo, SensorCoverage, ServoDriver};
use crate::geom::Angle;
use crate::hw::pulse::{ServoError, ServoRange};
use crate::plan::Mounts;

/// A servo.
pub struct Servo {
    device: Device,
}

/// What turns range sensors.
enum Device {
    /// The simulated world, which is told by its link.
    World,
    /// An output of this machine.
    #[cfg(feature = "hw")]
    Output(Pulses, OutputServo),
    /// Nothing does.
    None,
}

/// Which pulse turns the sensor to a direction.
struct Pulses {
    mounts: Mounts,
    range: ServoRange,
}

impl Pulses {
    fn new(servo: &RealServo, look: &SensorCoverage) -> Result<Pulses, ServoError> {
        Ok(Pulses {
            mounts: look.mounts(),
            range: ServoRange::of(&servo.scale)?,
        })
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

impl Servo {
    /// Starts what gives pulses.
    ///
    /// # Errors
    /// No thread can be started, the servo cannot be, or the driver is not built in.
    pub fn start(driver: &ServoDriver, look: &SensorCoverage) -> io::Result<Servo> {
        let device = match driver {
            ServoDriver::Simulated => Device::World,
            ServoDriver::Real(servo) => {
                let pulses = Pulses::new(servo, look).map_err(io::Error::other)?;
                device(servo, pulses)?
            }
            ServoDriver::None => Device::None,
        };
        Ok(Servo { device })
    }

    /// Turns the sensor that looks along a direction against the heading.
    pub fn steer(&self, beam: Angle) {
        match &self.device {
            Device::World | Device::None => {}
            #[cfg(feature = "hw")]
            Device::Output(pulses, output) => {
                if let Some(pulse) = pulses.to(beam) {
                    output.give(pulse);
                }
            }
        }
    }

    /// Returns what is wrong with it, in words.
    pub fn trouble(&self) -> Option<String> {
        match &self.device {
            Device::World | Device::None => None,
            #[cfg(feature = "hw")]
            Device::Output(_, output) => output.trouble(),
        }
    }
}

#[cfg(feature = "hw")]
fn device(servo: &RealServo, pulses: Pulses) -> io::Result<Device> {
    let output = OutputServo::start(Output::of(&servo.output), pulses.at_rest())?;
    Ok(Device::Output(pulses, output))
}

/// Its name was refused when the file was read.
#[cfg(not(feature = "hw"))]
fn device(_: &RealServo, pulses: Pulses) -> io::Result<Device> {
    let _ = (pulses.at_rest(), pulses.to(Angle::ZERO));
    Err(io::ErrorKind::Unsupported.into())
}
