//! The autopilot link: an actor between a vehicle and any autopilot ([`link`]), and the terms that both speak.
//!
//! The vehicle says what it wants ([`Fly`]); the link makes of it commands in an autopilot's terms ([`Command`]), one at a
//! time, and sees them through. What an autopilot says of itself ([`Report`], [`Ack`]) becomes the vehicle's telemetry
//! ([`Telemetry`]) and what has changed ([`Status`]).
//!
//! The terms are those that ArduPilot has behind MAVLink, in local metres: the simulated autopilot (`sim/autopilot`) serves
//! exactly these, a driver only translates them to bytes. Nothing here knows a device, a world or an order of an operator.

mod command;
mod fly;
pub mod item;
pub mod link;
mod motors;
mod movement;
mod report;
mod steering;
#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) mod tests_support;

pub use command::{Ack, ArmRefusal, Command, CommandAck, Kind, Mode, NumberedCommand};
pub use fly::Fly;
pub use item::Item;
pub use link::{AutopilotLink, Purpose, Reason, Remark};
pub use report::{Motion, Report, Status, SystemStatus, Telemetry};

use serde::{Deserialize, Serialize};

/// What a link is told about its vehicle before it starts.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Settings {
    /// What the autopilot moves.
    pub kind: Kind,
    /// Altitude above home at which a copter flies, metres; no effect on rovers.
    pub altitude_m: f64,
}

impl Default for Settings {
    /// A rover.
    fn default() -> Settings {
        Settings {
            kind: Kind::Rover,
            altitude_m: 0.0,
        }
    }
}
