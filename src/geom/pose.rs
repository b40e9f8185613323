//! Where a vehicle is and looks, and how well that is known.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Deviation, Heading, PoseReport};

use super::{Angle, Point};

/// By so many deviations a coordinate of a place may be off at most, as far as anybody reckons with it.
pub const WORST_DEVIATIONS: f64 = 3.0;

/// A place with a heading and the standard deviation of the place.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Pose {
    /// The place, local frame.
    pub at: Point,
    /// The direction that the vehicle faces.
    pub heading: Angle,
    /// Standard deviation of each coordinate of the place, metres; infinite = not known.
    pub sd_m: f64,
}

impl Pose {
    /// Returns by how much each coordinate of the place may be off at most, metres.
    pub fn off_m(&self) -> f64 {
        WORST_DEVIATIONS * self.sd_m
    }
}

impl From<PoseReport> for Pose {
    #[inline]
    fn from(report: PoseReport) -> Pose {
        let heading = Angle::from_radians(report.heading.radians());
        Pose {
            at: report.at.into(),
            heading,
            sd_m: report.sd.metres().unwrap_or(f64::INFINITY),
        }
    }
}

impl From<Pose> for PoseReport {
    /// Rounds to millimetres and 1e-4 rad.
    #[inline]
    fn from(pose: Pose) -> PoseReport {
        let heading = Heading::from_radians(pose.heading.radians());
        PoseReport {
            at: pose.at.into(),
            heading,
            sd: Deviation::from_metres(pose.sd_m),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_comes_back_within_the_rounding_and_an_unknown_deviation_stays_unknown() {
        let pose = Pose {
            at: Point::new(1.0004, -7.5),
            heading: Angle::from_degrees(-30.0),
            sd_m: 0.0512,
        };
        let back = Pose::from(PoseReport::from(pose));
        assert!(back.at.distance_to(pose.at) < 1e-3);
        assert!((back.heading - pose.heading).radians().abs() < 1e-4);
        assert!((back.sd_m - 0.051).abs() < 1e-9);
        for sd_m in [f64::INFINITY, 1e6, f64::NAN] {
            assert_eq!(
                Pose::from(PoseReport::from(Pose { sd_m, ..pose })).sd_m,
                f64::INFINITY
            );
        }
    }
}
