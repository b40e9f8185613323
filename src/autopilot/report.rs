//! What an autopilot says of itself, and what the vehicle is told of it: words only, no decisions.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::Control;

use super::command::FlightMode;
use crate::geom::{Angle, Pose};

/// What an autopilot has said of itself by now, ten times a second. Its mode, whether it is armed, and how it is as a whole
/// come with its heartbeat: they may be a second old.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct AutopilotReport {
    /// Where it believes to be, facing where, and how sure it is of that.
    pub pose: Pose,
    /// What its pose leaves out.
    pub flight_state: FlightState,
    /// Speed over ground, m/s.
    pub speed_mps: f64,
    /// Charge left, 0 to 1; `None` = the autopilot has ceased to say it.
    #[serde(with = "crate::autopilot::charge")]
    pub battery: Option<f64>,
    /// Whether and how it moves.
    pub motion: Motion,
    /// Whether it stands on the ground; always for what drives.
    pub is_landed: bool,
    /// What it does.
    pub mode: FlightMode,
    /// Whether the motors have current.
    pub is_armed: bool,
    /// How it is, as a whole.
    pub status: SystemStatus,
    /// Where the switch of its remote control stands; `None` = nowhere that means something.
    pub switch: Option<RemoteSwitch>,
    /// How far it is with the mission that it stores.
    pub stored: StoredReport,
}

/// How a body flies, as far as a pose in the plane leaves it out.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct FlightState {
    /// Altitude above home, metres; 0 for what drives.
    pub altitude_m: f64,
    /// Upward speed, m/s.
    pub climb_mps: f64,
    /// Which way it moves over ground; `None` = the way it faces.
    pub course: Option<Angle>,
    /// Roll (positive = the right side is down) and pitch (positive = the nose is up); `None` = not told.
    pub tilt: Option<(Angle, Angle)>,
}

/// How far an autopilot is with the mission that it stores, as it says itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct StoredReport {
    /// The item under way, or begun last; 0 = none.
    pub item: u16,
    /// Whether the last one is done.
    pub is_over: bool,
}

/// How far an autopilot is with the mission that the vehicle wants.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct StoredProgress {
    /// The item under way, counted from 1; 0 before the first.
    pub item: u16,
    /// What becomes of it.
    pub phase: StoredPhase,
}

/// What becomes of a stored mission.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum StoredPhase {
    /// It is on its way into the autopilot, or about to begin.
    Preparing,
    /// It is being carried out.
    UnderWay,
    /// Its last item is done.
    Over,
    /// The autopilot does not take it, or does not begin it.
    Failed,
}

/// Where a switch of a remote control stands: what a person beside the vehicle wants of it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum RemoteSwitch {
    /// Stand.
    Hold,
    /// Go home, on ways that are known to be free.
    Return,
}

/// How an autopilot is, as a whole: MAV_STATE.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
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

/// Whether and how a body moves.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Motion {
    /// Standing.
    Resting,
    /// Turning on the spot, or changing its altitude there.
    Turning,
    /// Driving.
    Driving,
}

/// What the vehicle is told with every report.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Telemetry {
    /// Where the autopilot believes to be.
    pub pose: Pose,
    /// What its pose leaves out.
    pub flight_state: FlightState,
    /// Speed over ground, m/s.
    pub speed_mps: f64,
    /// Charge left, 0 to 1; `None` = the autopilot has ceased to say it.
    #[serde(with = "crate::autopilot::charge")]
    pub battery: Option<f64>,
    /// Whether and how the body moves.
    pub motion: Motion,
    /// Whether the motors have current.
    pub is_armed: bool,
    /// How far the mission is that the autopilot was told to store; `None` = none is wanted.
    pub stored: Option<StoredProgress>,
}

/// What the vehicle is told when it changes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct ControlStatus {
    /// Who steers.
    pub control: Control,
    /// Whether the vehicle stands on the ground; always for what drives.
    pub is_landed: bool,
    /// Where the switch of the remote control stands.
    pub switch: Option<RemoteSwitch>,
}

impl Default for ControlStatus {
    /// On the ground, and nobody else steers, as far as is known before the autopilot was heard.
    fn default() -> ControlStatus {
        ControlStatus {
            control: Control::Ours,
            is_landed: true,
            switch: None,
        }
    }
}

impl AutopilotReport {
    /// Returns what of it the vehicle is told every time, and how far the mission is that it was told to store.
    pub fn telemetry(&self, stored: Option<StoredProgress>) -> Telemetry {
        let AutopilotReport {
            pose,
            flight_state,
            speed_mps,
            battery,
            motion,
            is_armed,
            ..
        } = *self;
        Telemetry {
            pose,
            flight_state,
            speed_mps,
            battery,
            motion,
            is_armed,
            stored,
        }
    }
}
