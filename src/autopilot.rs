//! The autopilot link: an actor between a vehicle and any autopilot ([`link`]), and the terms that both speak.
//!
//! The vehicle says what it wants ([`AutopilotCommand`]); the link makes of it commands in an autopilot's terms
//! ([`Command`]), one at a time, and sees them through. What an autopilot says of itself ([`AutopilotReport`], [`Ack`])
//! becomes the vehicle's telemetry ([`Telemetry`]) and what has changed ([`ControlStatus`]).
//!
//! The terms are those that ArduPilot has behind MAVLink, in local metres: the simulated autopilot (`sim/autopilot`) serves
//! exactly these, a driver only translates them to bytes. Nothing here knows a device, a world or an order of an operator.

mod autopilot_command;
pub(crate) mod charge;
mod command;
pub mod item;
pub mod link;
mod messages;
mod motors;
mod movement;
mod pending;
mod report;
mod steering;
mod stored;
#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) mod tests_support;

pub use autopilot_command::AutopilotCommand;
pub use command::{Ack, ArmRefusal, Command, CommandAck, FlightMode, NumberedCommand, VehicleKind};
pub use item::Item;
pub use link::{AutopilotLink, CommandPurpose, LinkEvent, Reason};
pub use report::{
    AutopilotReport, ControlStatus, FlightState, Motion, RemoteSwitch, StoredPhase, StoredProgress,
    StoredReport, SystemStatus, Telemetry,
};

use serde::{Deserialize, Serialize};

/// What a link is told about its vehicle before it starts.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct AutopilotLinkSettings {
    /// What the autopilot moves.
    pub kind: VehicleKind,
    /// Altitude above home at which a copter flies, metres; no effect on rovers.
    pub altitude_m: f64,
}

impl Default for AutopilotLinkSettings {
    /// A rover.
    fn default() -> AutopilotLinkSettings {
        AutopilotLinkSettings {
            kind: VehicleKind::Rover,
            altitude_m: 0.0,
        }
    }
}
