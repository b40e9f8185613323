//! What an autopilot is asked, what it answers, and what it reports: words only, no decisions. Positions are in the
//! local frame; what MAVLink makes of them is not known here.

use std::collections::BTreeMap;
use std::time::Duration;

use super::super::motion::Limits;
use super::item::Item;
use crate::geom::{Angle, Attitude, Point, Pose, Vector};
use crate::time::Time;

/// What kind of vehicle it steers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// On the ground: turns on the spot and drives.
    Rover,
    /// In the air: climbs, turns, then flies level.
    Copter,
}

/// What it does by itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Mode {
    /// As it boots (MANUAL, STABILIZE): nobody steers, it stays where it is.
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

impl Mode {
    /// Tells whether a kind of vehicle has it.
    pub fn is_of(self, kind: Kind) -> bool {
        match self {
            Mode::Hold => kind == Kind::Rover,
            Mode::Land => kind == Kind::Copter,
            Mode::Manual | Mode::Loiter | Mode::Guided | Mode::Auto | Mode::Return => true,
        }
    }

    /// Tells whether it is of no use to who does not know its place.
    pub fn needs_place(self) -> bool {
        match self {
            Mode::Loiter | Mode::Guided | Mode::Auto | Mode::Return => true,
            Mode::Manual | Mode::Hold | Mode::Land => false,
        }
    }
}

/// What a ground station or companion asks.
#[derive(Clone, PartialEq, Debug)]
pub enum Ask {
    /// Change the mode.
    Mode(Mode),
    /// Let the motors turn; `force` skips the checks.
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

/// What it answers: MAV_RESULT.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Answer {
    /// Done, or under way.
    Accepted,
    /// What is asked makes no sense.
    Denied,
    /// This kind of vehicle does not know it.
    Unsupported,
    /// Not now.
    Failed,
}

impl Answer {
    /// Gives the number of MAV_RESULT.
    pub fn code(self) -> u8 {
        match self {
            Answer::Accepted => 0,
            Answer::Denied => 2,
            Answer::Unsupported => 3,
            Answer::Failed => 4,
        }
    }
}

/// How the vehicle is, as a whole: MAV_STATE.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SystemStatus {
    /// It is not ready to be armed yet.
    Booting,
    /// It stands on the ground.
    Standby,
    /// It moves, or may move at any time.
    Active,
    /// A failsafe is in force.
    Critical,
}

/// Something that it says once.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Notice {
    /// The mode has changed, by whatever cause.
    Mode(Mode),
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

/// What it reports of itself.
#[derive(Clone, PartialEq, Debug)]
pub struct Report {
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
    pub mode: Mode,
    /// Whether the motors have current.
    pub is_armed: bool,
    /// Whether it stands on the ground.
    pub is_landed: bool,
    /// How it is, as a whole.
    pub status: SystemStatus,
    /// The current item of the mission; 0 = none yet.
    pub item: usize,
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
pub struct Settings {
    /// What it is.
    pub kind: Kind,
    /// Motion in the plane.
    pub limits: Limits,
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

impl Settings {
    /// Gives what ArduPilot 4.5 does by default, for a vehicle with this drive.
    pub fn new(kind: Kind, limits: Limits) -> Settings {
        Settings {
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

/// A notice and its moment.
pub type Noticed = (Time, Notice);
