//! What a vehicle says of itself, several times a second. This is the form on the wire: the state that a vehicle keeps
//! of itself is its own.

use serde::{Deserialize, Serialize};

use super::OrderKind;
use crate::{
    Boot, EmergencyName, Lease, Permille, PoseReport, Position, Revision, RunId, Tilt, VehicleId,
    Velocity,
};

/// What a vehicle is doing.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
pub enum VehicleMode {
    /// Standing, ready for a command.
    #[default]
    Idle,
    /// Moving along its leg.
    Driving,
    /// Turning on the spot.
    Turning,
    /// Stopped by its own reflex or envelope.
    Halted,
    /// Held by an order.
    Held,
    /// Leaving the ground.
    TakingOff,
    /// Changing its height where it is.
    Climbing,
    /// Coming down where it is.
    Landing,
    /// Stopped by an emergency stop that is open.
    Stopped,
    /// An order has cut its motors; only a start ends it.
    MotorsCut,
}

impl VehicleMode {
    /// Returns whether the vehicle goes somewhere or turns; how it leaves the ground and comes back to it does not count.
    pub fn moves(self) -> bool {
        matches!(self, VehicleMode::Driving | VehicleMode::Turning)
    }
}

/// Why a vehicle stands, or goes home, and does not go on by itself. Of several reasons State names the first in this
/// order; all open stops that a vehicle knows are in its Standing.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum StandReason {
    /// An emergency stop is open.
    Stop(EmergencyName),
    /// An order holds it.
    Held,
    /// Somebody steers it by remote control, or has until an operator's start that names it
    /// ([`EmergencyName::of_take_over`]) ends it.
    Remote,
    /// The autopilot does something of its own, or is silent.
    Autopilot,
    /// The battery is too low.
    Battery,
    /// It does not know well enough where it is.
    NoPlace,
    /// It hears nobody.
    Alone,
    /// Its range sensors do not answer.
    Blind,
}

/// Who steers a vehicle.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
pub enum Control {
    /// This software, through the autopilot.
    #[default]
    Ours,
    /// A person by remote control.
    Remote,
    /// The autopilot by itself, such as by a failsafe.
    Own,
    /// Not known: the autopilot is silent.
    Silent,
}

/// The route that a vehicle is committed to: from where it stands or stood, to where it may end.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct LegReport {
    /// Corners of the route, the first where it is.
    pub route: Vec<Position>,
}

/// The highest order that a vehicle has obeyed, over all starts of its software.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Ordered {
    /// By whose right.
    pub lease: Lease,
    /// Which of that lease's orders.
    pub revision: Revision,
    /// In which run.
    pub run: RunId,
    /// What was ordered; `None` = nothing since its software was started. The rest is what it remembers then.
    pub kind: Option<OrderKind>,
}

impl Ordered {
    /// Returns what orders are compared by: the higher one wins.
    pub fn edition(&self) -> (Lease, Revision) {
        (self.lease, self.revision)
    }
}

/// What a vehicle says of itself, several times a second.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct State {
    /// Who speaks.
    pub vehicle: VehicleId,
    /// Start of its software.
    pub boot: Boot,
    /// Counts the states of this boot.
    pub sequence: u64,
    /// Where it is; `None` = it has never known.
    pub pose: Option<PoseReport>,
    /// Turned about its forward axis: positive when its right side is low.
    pub roll: Tilt,
    /// Turned about its sideward axis: positive when its front is high.
    pub pitch: Tilt,
    /// How it moves.
    pub velocity: Velocity,
    /// What it is doing.
    pub mode: VehicleMode,
    /// Why it does not go on with its mission by itself; `None` = it may.
    pub stands_under: Option<StandReason>,
    /// Whether it has come to rest.
    pub is_at_rest: bool,
    /// Who steers it.
    pub control: Control,
    /// Whether the motors have current.
    pub is_armed: bool,
    /// Whether it is on the ground; always for what drives.
    pub is_landed: bool,
    /// Charge left; `None` = not known.
    pub battery: Option<Permille>,
    /// What it is committed to drive; `None` at rest.
    pub leg: Option<LegReport>,
    /// Run and revision of the plan it has accepted.
    pub accepted: (RunId, Revision),
    /// Highest order accepted.
    pub ordered: Ordered,
}
