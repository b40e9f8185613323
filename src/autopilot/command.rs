//! What an autopilot is told, and what it answers: words only, no decisions. Positions are in the local frame; what MAVLink
//! makes of them is not known here.

use std::fmt;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::BodyKind;

use super::item::Item;
use crate::geom::{Angle, Point, Vector};

/// What kind of vehicle an autopilot steers.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum VehicleKind {
    /// On the ground: turns on the spot and drives.
    Rover,
    /// In the air: climbs, turns, then flies level.
    Copter,
}

impl VehicleKind {
    /// Returns what its Health calls such a body.
    pub fn body(self) -> BodyKind {
        match self {
            VehicleKind::Rover => BodyKind::Rover,
            VehicleKind::Copter => BodyKind::Copter,
        }
    }
}

/// What an autopilot does by itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum FlightMode {
    /// As it boots (MANUAL, STABILIZE): it does what the remote control says; without one it stays where it is.
    Manual,
    /// Stands still; rovers only.
    Hold,
    /// Stays at its place.
    Loiter,
    /// Goes where it is told.
    Guided,
    /// Follows its stored mission.
    Auto,
    /// Goes home in a straight line (RTL); a copter lands there.
    Return,
    /// Comes down where it is; copters only.
    Land,
}

impl FlightMode {
    /// Returns the mode in which a kind of vehicle stays where it is.
    pub fn staying(kind: VehicleKind) -> FlightMode {
        match kind {
            VehicleKind::Rover => FlightMode::Hold,
            VehicleKind::Copter => FlightMode::Loiter,
        }
    }
}

impl fmt::Display for FlightMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            FlightMode::Manual => "manual",
            FlightMode::Hold => "hold",
            FlightMode::Loiter => "loiter",
            FlightMode::Guided => "guided",
            FlightMode::Auto => "auto",
            FlightMode::Return => "return",
            FlightMode::Land => "land",
        })
    }
}

impl FlightMode {
    /// Returns whether a kind of vehicle has it.
    pub fn is_of(self, kind: VehicleKind) -> bool {
        match self {
            FlightMode::Hold => kind == VehicleKind::Rover,
            FlightMode::Land => kind == VehicleKind::Copter,
            FlightMode::Manual
            | FlightMode::Loiter
            | FlightMode::Guided
            | FlightMode::Auto
            | FlightMode::Return => true,
        }
    }

    /// Returns whether it is of no use to one that does not know its place.
    pub fn needs_place(self) -> bool {
        match self {
            FlightMode::Loiter | FlightMode::Guided | FlightMode::Auto | FlightMode::Return => true,
            FlightMode::Manual | FlightMode::Hold | FlightMode::Land => false,
        }
    }
}

/// What a companion or a ground station tells an autopilot.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Command {
    /// Change the mode.
    Mode(FlightMode),
    /// Let the motors turn; `force` skips the checks. The link never forces.
    Arm {
        /// With the magic number.
        force: bool,
    },
    /// Cut the motors; in the air only by `force`.
    Disarm {
        /// With the magic number.
        force: bool,
    },
    /// Climb to an altitude above home, metres; a copter on the ground in GUIDED.
    Takeoff {
        /// Altitude, metres.
        altitude_m: f64,
    },
    /// Go through places; in GUIDED.
    Route {
        /// Places, one after the other.
        corners: Vec<Point>,
        /// Altitude above home, metres; `None` = the present one, and always for rovers.
        altitude_m: Option<f64>,
        /// Speed limit, m/s; `None` = the standing one.
        speed_mps: Option<f64>,
    },
    /// Move with this velocity, m/s, for 3 s from the last time that it was said; in GUIDED.
    Velocity(Vector),
    /// Turn on the spot; in GUIDED.
    Yaw(Angle),
    /// Brake and stay; in GUIDED.
    Stop,
    /// Take this mission in place of the stored one. Item 0 is home.
    Upload(Vec<Item>),
    /// Forget the stored mission.
    Clear,
    /// Begin the stored mission.
    Begin,
    /// Go on with this item of the stored mission.
    SetCurrent(usize),
    /// Travel at this speed from now on, m/s.
    Speed(f64),
    /// Set a servo output.
    Servo {
        /// Output, 1 to 16.
        channel: u8,
        /// Pulse width, microseconds, 500 to 2500.
        pulse_us: u16,
    },
    /// This is home.
    SetHome(Point),
}

impl Command {
    /// Returns whether the vehicle may set out by it. Coming down where it is counts as little as standing.
    pub fn moves(&self) -> bool {
        match self {
            Command::Takeoff { .. }
            | Command::Route { .. }
            | Command::Velocity(_)
            | Command::Yaw(_)
            | Command::Begin
            | Command::SetCurrent(_)
            | Command::Mode(FlightMode::Auto | FlightMode::Return) => true,
            Command::Mode(
                FlightMode::Manual
                | FlightMode::Hold
                | FlightMode::Loiter
                | FlightMode::Guided
                | FlightMode::Land,
            )
            | Command::Arm { .. }
            | Command::Disarm { .. }
            | Command::Stop
            | Command::Upload(_)
            | Command::Clear
            | Command::Speed(_)
            | Command::Servo { .. }
            | Command::SetHome(_) => false,
        }
    }

    /// Returns whether it brings a vehicle that moves to rest.
    pub fn stops(&self) -> bool {
        match self {
            Command::Stop
            | Command::Disarm { .. }
            | Command::Mode(
                FlightMode::Manual | FlightMode::Hold | FlightMode::Loiter | FlightMode::Guided,
            ) => true,
            Command::Takeoff { .. }
            | Command::Route { .. }
            | Command::Velocity(_)
            | Command::Yaw(_)
            | Command::Begin
            | Command::SetCurrent(_)
            | Command::Mode(FlightMode::Auto | FlightMode::Return | FlightMode::Land)
            | Command::Arm { .. }
            | Command::Upload(_)
            | Command::Clear
            | Command::Speed(_)
            | Command::Servo { .. }
            | Command::SetHome(_) => false,
        }
    }
}

/// A command with the number that its answer names. One that is said again keeps its number.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct NumberedCommand {
    /// The number; 0 when nobody waits for the answer.
    pub number: u32,
    /// The command.
    pub command: Command,
}

/// What an autopilot answers: MAV_RESULT.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum CommandAck {
    /// Done, or under way.
    Accepted,
    /// What it was told makes no sense.
    Denied,
    /// This kind of vehicle does not know it.
    Unsupported,
    /// Not now.
    Failed,
}

impl fmt::Display for CommandAck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            CommandAck::Accepted => "accepted",
            CommandAck::Denied => "denied",
            CommandAck::Unsupported => "unsupported",
            CommandAck::Failed => "not possible now",
        })
    }
}

impl CommandAck {
    /// Returns the number of MAV_RESULT.
    pub fn code(self) -> u8 {
        match self {
            CommandAck::Accepted => 0,
            CommandAck::Denied => 2,
            CommandAck::Unsupported => 3,
            CommandAck::Failed => 4,
        }
    }
}

/// Why an autopilot does not arm: what ArduPilot says as `PreArm: …`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum ArmRefusal {
    /// It has not started up yet.
    #[error("the autopilot is not ready yet")]
    NotReady,
    /// Nobody is armed in this mode.
    #[error("nobody is armed in the mode {0}")]
    Mode(FlightMode),
    /// The mode needs a place, and it does not know its own.
    #[error("it does not know where it is, and its mode needs that")]
    NoPlace,
    /// The battery is empty.
    #[error("its battery is empty")]
    BatteryEmpty,
    /// What it does when something fails is not known, or leads away.
    #[error("its failsafes for battery, companion and fence have to keep it where it is")]
    Failsafes,
}

/// An autopilot's answer to a command.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Ack {
    /// The number of the command.
    pub number: u32,
    /// The answer.
    pub result: CommandAck,
    /// Why it does not arm, if that is what it was told and it says so.
    pub arm_refusal: Option<ArmRefusal>,
}
