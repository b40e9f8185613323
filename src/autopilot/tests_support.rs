//! What tests use that let an autopilot say something of itself.

use super::{Mode, Motion, Report, SystemStatus};
use crate::geom::{Angle, Point, Pose};

/// A report of an autopilot at the datum: at rest on the ground, armed, in GUIDED.
pub(crate) fn resting_report() -> Report {
    Report {
        pose: Pose {
            at: Point::default(),
            heading: Angle::default(),
            sd_m: 0.1,
        },
        altitude_m: 0.0,
        speed_mps: 0.0,
        battery: 1.0,
        motion: Motion::Resting,
        is_landed: true,
        mode: Mode::Guided,
        is_armed: true,
        status: SystemStatus::Active,
    }
}
