//! What the vehicle actor hears of its autopilot and its mission, and what it answers: messages only, no decisions.

use std::fmt;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::VehicleId;

pub use crate::autopilot::{AutopilotCommand, Motion, Telemetry};
use crate::autopilot::{Item, RemoteSwitch};
use crate::geom::{Angle, Point, Segment};
use crate::time::Time;

/// What the mission wants done.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum MoveCommand {
    /// Drive along a route to its end; a later one replaces it at once.
    Drive {
        /// No plan says who goes first there: it yields to whoever claims what lies ahead.
        is_off_plan: bool,
        /// Corners, the first near the present place.
        route: Vec<Point>,
    },
    /// Turn on the spot.
    Turn(Angle),
    /// Let the autopilot store a mission and carry it out.
    FollowStored {
        /// Its items; item 0 is home.
        items: Vec<Item>,
        /// The item that it begins with.
        from: usize,
    },
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
    /// Somebody has turned the switch of the remote control.
    Switched(RemoteSwitch),
}

impl fmt::Display for SafetyEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SafetyEvent::Halted { ahead_m, obstacle } => write!(
                f,
                "halts {ahead_m:.3} m before an obstacle at {}, kept clear of by {:.3} m until {} s",
                obstacle.at, obstacle.keep_m, obstacle.until
            ),
            SafetyEvent::Refused(why) => write!(f, "does not drive: {why}"),
            SafetyEvent::AutopilotSilent => f.write_str("hears its autopilot no more"),
            SafetyEvent::Switched(RemoteSwitch::Hold) => {
                f.write_str("is held by the switch of its remote control")
            }
            SafetyEvent::Switched(RemoteSwitch::Return) => {
                f.write_str("is sent home by the switch of its remote control")
            }
        }
    }
}

/// Something that made the reflex halt: an echo from somewhere in the beam's cone.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ReflexObstacle {
    /// The middle of the arc that the echo may have come from.
    pub at: Point,
    /// How near the vehicle's middle may come, wherever on the arc it stands, metres.
    pub keep_m: f64,
    /// How near the vehicle's middle may come if it stands in the middle, metres.
    pub middle_keep_m: f64,
    /// Until when it is believed to be there.
    pub until: Time,
}

/// A step of 0.3 m beside something 0.5 m away comes so much nearer to it than its ends, metres.
const CUT_OFF_M: f64 = 0.025;

impl ReflexObstacle {
    /// Returns the same, taken to stand in the middle of its arc.
    pub fn in_the_middle(self) -> ReflexObstacle {
        ReflexObstacle {
            keep_m: self.middle_keep_m,
            ..self
        }
    }

    /// Returns whether a way keeps clear, or at least comes no nearer than `here_m`, metres (but for what a straight step
    /// between two places that are no nearer cuts off).
    pub fn is_passed_by(&self, way: Segment, here_m: f64) -> bool {
        way.distance_to_point(self.at) >= self.keep_m.min(here_m) - CUT_OFF_M
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

impl fmt::Display for CommandRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CommandRefusal::NoPose => f.write_str("it does not know where it is"),
            CommandRefusal::PoseUncertain => f.write_str("its pose is too uncertain"),
            CommandRefusal::NoRoute => f.write_str("the route is none"),
            CommandRefusal::NotHere => f.write_str("the route does not begin where it is"),
            CommandRefusal::Fence => f.write_str("the route leaves the fence"),
            CommandRefusal::Separation(peer) => {
                write!(f, "the route comes too near to vehicle {peer}")
            }
            CommandRefusal::ReflexObstacle => {
                f.write_str("the route leads to what the reflex halted for")
            }
            CommandRefusal::Emergency => {
                f.write_str("an emergency stop is open, or no start has come since")
            }
            CommandRefusal::Disarmed => f.write_str("its motors are cut until a start"),
            CommandRefusal::Old => {
                f.write_str("the command is old, or of before an order that stopped it")
            }
            CommandRefusal::Held => f.write_str("an order to hold or to land stands"),
            CommandRefusal::Blind => f.write_str("it has no range sensor"),
            CommandRefusal::NotInControl => {
                f.write_str("somebody else steers until a start names the take-over")
            }
        }
    }
}
