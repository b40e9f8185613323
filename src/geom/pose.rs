//! Where a vehicle is and looks, and how well that is known.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::PoseReport;

use super::{Angle, Point};

/// A place with a heading and the standard deviation of the place.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Pose {
    /// The place, local frame.
    pub at: Point,
    /// The direction that the vehicle faces.
    pub heading: Angle,
    /// Standard deviation of each coordinate of the place, metres.
    pub sd_m: f64,
}

impl From<PoseReport> for Pose {
    fn from(report: PoseReport) -> Pose {
        let heading = Angle::from_radians(report.heading_rad);
        Pose { at: report.at.into(), heading, sd_m: report.sd_m }
    }
}

impl From<Pose> for PoseReport {
    fn from(pose: Pose) -> PoseReport {
        PoseReport { at: pose.at.into(), heading_rad: pose.heading.radians(), sd_m: pose.sd_m }
    }
}
