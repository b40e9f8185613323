//! What the vehicle actor hears of its autopilot and its mission, and what it answers: messages only, no decisions.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{StopId, VehicleId};

pub use crate::autopilot::{AutopilotCommand, Motion, Telemetry};
use crate::geom::{Angle, Point, Segment};
use crate::time::Time;

/// What the mission wants done.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum MoveCommand {
    /// Drive along a route to its end; a later one replaces it at once.
    Drive {
        /// The stop that the route leads to, for the log.
        stop: Option<StopId>,
        /// Corners, the first near the present place.
        route: Vec<Point>,
    },
    /// Turn on the spot.
    Turn(Angle),
    /// Stand still.
    Hold,
}

/// What the envelope or the reflex decided.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum SafetyEvent {
    /// The reflex stopped the vehicle: something is this near ahead, metres.
    Halted {
        /// Distance from the body to the object, metres.
        ahead_m: f64,
        /// What is kept clear of for a while.
        obstacle: ReflexObstacle,
    },
    /// A command was not obeyed.
    Refused(CommandRefusal),
    /// The autopilot says nothing any more.
    AutopilotSilent,
}

/// Something that made the reflex halt: an echo from somewhere in the beam's cone.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ReflexObstacle {
    /// Where the echo came from, on the beam's axis.
    pub at: Point,
    /// How near the vehicle's middle may come, metres.
    pub keep_m: f64,
    /// Until when it is believed to be there.
    pub until: Time,
}

impl ReflexObstacle {
    /// Returns whether a way keeps clear, or at least never comes nearer than `here_m`, metres.
    pub fn is_passed_by(&self, way: Segment, here_m: f64) -> bool {
        way.distance_to_point(self.at) >= self.keep_m.min(here_m) - 1e-3
    }
}

/// Why a command was not obeyed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum CommandRefusal {
    /// No telemetry yet, or too old.
    NoPose,
    /// The pose deviation is too large.
    PoseUncertain,
    /// The route has fewer than two corners, or one that is not finite.
    NoRoute,
    /// The route does not begin where the vehicle is.
    NotHere,
    /// The route leaves the fence.
    Fence,
    /// The route comes too near to another vehicle or its route.
    Separation(VehicleId),
    /// The route leads to what made the reflex halt.
    ReflexObstacle,
    /// An emergency stop is open, or was lifted and no start has come since.
    Emergency,
    /// The motors are cut, until a start.
    Disarmed,
    /// The command was decided too long ago, or before an order that stopped the vehicle.
    Old,
    /// An order to hold or to land stands, until a start or a return.
    Held,
    /// There is no range sensor.
    Blind,
    /// A person steers by remote control, or the autopilot by itself, until an operator's start that names it.
    NotInControl,
}
