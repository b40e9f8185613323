//! The radio of a live vehicle, behind the driver that its file chooses.
//!
//! A driver is a file in this folder, a variant of `Device` and an arm of each match here. What a beacon says is not known
//! here.

#[cfg(feature = "hw")]
mod xbee;
#[cfg(feature = "hw")]
pub mod xbee_tool;

use std::io;

use tomoswarm_proto::{Beacon, RadioHealth};

use super::EventSink;
use crate::config::{RadioDriver, VehicleFile};
use crate::run::clock::Clock;

/// A radio.
pub struct Radio {
    device: Device,
}

/// What sends and hears.
enum Device {
    /// The simulated world, which is told by its link.
    World,
    /// An XBee.
    #[cfg(feature = "hw")]
    Xbee(xbee::XbeeRadio),
}

impl Radio {
    /// Starts what speaks with it; `events` gets what it hears and what it has not sent.
    ///
    /// # Errors
    /// No thread can be started, or this build has no such driver.
    pub fn start(file: &VehicleFile, clock: Clock, events: &EventSink) -> io::Result<Radio> {
        let device = match &file.drivers.radio {
            RadioDriver::Simulated => Device::World,
            #[cfg(feature = "hw")]
            RadioDriver::Xbee(port) => {
                Device::Xbee(xbee::XbeeRadio::start(port, file, clock, events.clone())?)
            }
            #[cfg(not(feature = "hw"))]
            RadioDriver::Xbee(_) => {
                // Files are refused before that.
                let _ = (clock, events);
                return Err(io::ErrorKind::Unsupported.into());
            }
        };
        Ok(Radio { device })
    }

    /// Returns whether the simulated world carries its beacons.
    pub fn is_simulated(&self) -> bool {
        matches!(self.device, Device::World)
    }

    /// Sends a beacon.
    pub fn transmit(&self, beacon: &Beacon) {
        match &self.device {
            Device::World => {}
            #[cfg(feature = "hw")]
            Device::Xbee(radio) => radio.transmit(beacon),
        }
    }

    /// Returns what is wrong with it, in words.
    pub fn trouble(&self) -> Option<String> {
        match &self.device {
            Device::World => None,
            #[cfg(feature = "hw")]
            Device::Xbee(radio) => radio.trouble(),
        }
    }

    /// Returns what it has done; `None` of a simulated one, which has nothing to tell.
    pub fn health(&self) -> Option<RadioHealth> {
        match &self.device {
            Device::World => None,
            #[cfg(feature = "hw")]
            Device::Xbee(radio) => Some(radio.health()),
        }
    }
}
