//! What a simulated autopilot says by itself, what it knows of itself, and what it is told before it starts: messages only, no
//! decisions. What it is told later, and what it answers, are the terms of any autopilot ([`crate::autopilot`]).

use std::collections::BTreeMap;
use std::time::Duration;

use super::super::motion::DriveLimits;
use crate::autopilot::{FlightMode, SystemStatus, VehicleKind};
use crate::geom::{Attitude, Point, Pose, Vector};
use crate::time::Time;

/// Something that it says once.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum StatusText {
    /// The mode has changed, by whatever cause.
    Mode(FlightMode),
    /// The motors have current, or have it no more.
    Armed(bool),
    /// An item of the mission was begun.
    Begun(usize),
    /// An item of the mission was done.
    Reached(usize),
    /// The mission is over.
    MissionDone,
    /// The battery is low.
    BatteryLow,
    /// The battery is empty: nothing moves any more.
    BatteryEmpty,
    /// It does not know its place any more.
    PlaceLost,
}

/// All that it knows of itself. What of it goes out, and how late, is not its matter.
#[derive(Clone, PartialEq, Debug)]
pub struct Readout {
    /// Where it believes to be, facing where, and how sure it is of that.
    pub pose: Pose,
    /// Altitude above home, metres.
    pub altitude_m: f64,
    /// How it lies.
    pub attitude: Attitude,
    /// Speed over ground, m/s.
    pub speed_mps: f64,
    /// Climb, m/s, negative when it sinks.
    pub climb_mps: f64,
    /// Charge left, 0 to 1.
    pub battery: f64,
    /// What it does.
    pub mode: FlightMode,
    /// Whether the motors have current.
    pub is_armed: bool,
    /// Whether it stands on the ground.
    pub is_landed: bool,
    /// How it is, as a whole.
    pub status: SystemStatus,
    /// The current item of the mission; 0 = none yet.
    pub item: usize,
    /// Whether the last one is done.
    pub is_over: bool,
    /// Where home is; `None` = not known before it was armed.
    pub home: Option<Point>,
    /// Servo outputs that were set, microseconds by output.
    pub servos: BTreeMap<u8, u16>,
}

/// What happens when the battery is low.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LowBattery {
    /// It says so: what is to be done is the companion's business.
    Warn,
    /// It returns.
    Return,
    /// It lands; a rover holds.
    Land,
}

/// What the vehicle can do, and when its autopilot acts on its own.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct AutopilotSettings {
    /// What it is.
    pub kind: VehicleKind,
    /// Motion in the plane.
    pub limits: DriveLimits,
    /// Climbing, m/s.
    pub climb_mps: f64,
    /// Sinking, m/s.
    pub descent_mps: f64,
    /// Sinking below 10 m while it lands, m/s.
    pub landing_mps: f64,
    /// A copter returns at least this high, metres.
    pub return_m: f64,
    /// How long a full battery lasts while it moves, or flies.
    pub endurance_driving: Duration,
    /// How long a full battery lasts at rest on the ground.
    pub endurance_resting: Duration,
    /// Below this charge the battery is low, 0 to 1.
    pub low_battery: f64,
    /// What happens then.
    pub on_low_battery: LowBattery,
    /// Above this deviation it does not know its place, metres.
    pub place_sd_max_m: f64,
    /// It can be armed this long after it was switched on, in modes that need no place.
    pub ready_after: Duration,
    /// It knows its place this long after it was switched on.
    pub place_after: Duration,
    /// A copter that is armed and does not take off is disarmed after this time.
    pub disarm_after: Duration,
    /// Wind, m/s, where it blows to.
    pub wind: Vector,
}

impl AutopilotSettings {
    /// Returns what ArduPilot 4.5 does by default, for a vehicle with this drive.
    pub fn new(kind: VehicleKind, limits: DriveLimits) -> AutopilotSettings {
        AutopilotSettings {
            kind,
            limits,
            climb_mps: 2.5,
            descent_mps: 1.5,
            landing_mps: 0.5,
            return_m: 15.0,
            endurance_driving: Duration::from_secs(1200),
            endurance_resting: Duration::from_secs(36_000),
            low_battery: 0.2,
            on_low_battery: LowBattery::Warn,
            place_sd_max_m: 5.0,
            ready_after: Duration::from_secs(22),
            place_after: Duration::from_secs(42),
            disarm_after: Duration::from_secs(10),
            wind: Vector::default(),
        }
    }
}

/// A status text and its moment.
pub type DatedText = (Time, StatusText);
