//! The autopilot of a live vehicle, behind the driver that its file chooses.
//!
//! A driver is a file in this folder, a variant of `Pilot` and an arm of each match here. What a command means is not known
//! here.

mod connection;
mod mavlink;
pub mod parameters;

use std::io;

use tomoswarm_proto::{AutopilotHealth, Fix, Sender};

use self::mavlink::MavlinkAutopilot;
use super::EventSink;
use super::range::AutopilotReadings;
use crate::autopilot::NumberedCommand;
use crate::config::{AutopilotDriver, VehicleFile};
use crate::mavlink::autopilot_driver::ServoPulse;
use crate::run::clock::Clock;

/// An autopilot.
pub struct Autopilot {
    pilot: Pilot,
}

/// What moves the vehicle.
enum Pilot {
    /// The simulated world, which is told by its link.
    World,
    /// An autopilot that speaks MAVLink.
    Mavlink(MavlinkAutopilot),
}

impl Autopilot {
    /// Starts what speaks with it; `events` gets its reports and answers, `readings` what range sensors on it measure.
    ///
    /// # Errors
    /// No thread can be started, or the key of signatures cannot be read.
    pub fn start(
        file: &VehicleFile,
        clock: Clock,
        events: &EventSink,
        readings: Option<&AutopilotReadings>,
    ) -> io::Result<Autopilot> {
        let pilot = match &file.drivers.autopilot {
            AutopilotDriver::Simulated => Pilot::World,
            AutopilotDriver::Mavlink(connection) => {
                let told = (events, readings);
                Pilot::Mavlink(MavlinkAutopilot::start(connection, file, clock, told)?)
            }
        };
        Ok(Autopilot { pilot })
    }

    /// Returns whether the simulated world moves the vehicle.
    pub fn is_simulated(&self) -> bool {
        matches!(self.pilot, Pilot::World)
    }

    /// Tells it what the link wants.
    pub fn command(&self, command: &NumberedCommand) {
        match &self.pilot {
            Pilot::World => {}
            Pilot::Mavlink(autopilot) => autopilot.command(command),
        }
    }

    /// Tells it where something outside has measured the vehicle to be.
    pub fn fix(&self, from: Sender, fix: Fix) {
        match &self.pilot {
            Pilot::World => {}
            Pilot::Mavlink(autopilot) => autopilot.fix(from, fix),
        }
    }

    /// Gives a servo on it a pulse.
    pub fn give_pulse(&self, pulse: ServoPulse) {
        match &self.pilot {
            Pilot::World => {}
            Pilot::Mavlink(autopilot) => autopilot.give_pulse(pulse),
        }
    }

    /// Returns the pulse by which a servo on it stands; `None` while that is not known.
    pub fn given_pulse(&self) -> Option<ServoPulse> {
        match &self.pilot {
            Pilot::World => None,
            Pilot::Mavlink(autopilot) => autopilot.given_pulse(),
        }
    }

    /// Returns why a servo on it does not stand where it should, in words.
    pub fn servo_trouble(&self) -> Option<String> {
        match &self.pilot {
            Pilot::World => None,
            Pilot::Mavlink(autopilot) => autopilot.servo_trouble(),
        }
    }

    /// Returns what is wrong with it, in words.
    pub fn trouble(&self) -> Option<String> {
        match &self.pilot {
            Pilot::World => None,
            Pilot::Mavlink(autopilot) => autopilot.trouble(),
        }
    }

    /// Returns what it has said of its health; `None` before it was heard, and of a simulated one, which has none to tell.
    pub fn health(&self) -> Option<AutopilotHealth> {
        match &self.pilot {
            Pilot::World => None,
            Pilot::Mavlink(autopilot) => autopilot.health(),
        }
    }
}
