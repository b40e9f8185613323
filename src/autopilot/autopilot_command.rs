//! What a vehicle wants of its autopilot: words only, no decisions.

use serde::{Deserialize, Serialize};

use super::item::Item;
use crate::geom::{Angle, Point};

/// What the autopilot shall do.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum AutopilotCommand {
    /// Drive through the corners and stop at the last. A copter on the ground takes off first, and is to be told again.
    Drive {
        /// Corners, without the present place.
        corners: Vec<Point>,
        /// Speed limit, m/s.
        speed_mps: f64,
    },
    /// Turn on the spot.
    Turn(Angle),
    /// Store this mission, and carry it out.
    FollowStored {
        /// Its items; item 0 is home.
        items: Vec<Item>,
        /// The item that it begins with.
        from: usize,
    },
    /// Brake and stand.
    Stop,
    /// Let the motors turn again; no effect on one that is armed, nor while somebody else steers. It follows from an order
    /// of an operator that frees the vehicle.
    Arm,
    /// End what somebody else has begun with the autopilot: a person by remote control, or the autopilot by itself. It
    /// follows from an operator's start that names the take-over.
    TakeBack,
    /// Cut the motors; nothing moves before it is armed. In the air: come down, then cut them.
    Disarm,
}
