//! What tests use that let an autopilot say something of itself.

use super::{AutopilotReport, FlightMode, Motion, StoredReport, SystemStatus};
use crate::geom::{Angle, Point, Pose};

/// A report of an autopilot at the datum: at rest on the ground, armed, in GUIDED.
pub(crate) fn resting_report() -> AutopilotReport {
    AutopilotReport {
        pose: Pose {
            at: Point::default(),
            heading: Angle::default(),
            sd_m: 0.1,
        },
        flight_state: Default::default(),
        speed_mps: 0.0,
        battery: Some(1.0),
        motion: Motion::Resting,
        is_landed: true,
        mode: FlightMode::Guided,
        is_armed: true,
        status: SystemStatus::Active,
        switch: None,
        stored: StoredReport::default(),
    }
}
