//! Where a vehicle is between two states: its last pose, carried on along its motion for a short while.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{PoseReport, Position};

use super::OwnState;
use crate::geom::{Pose, Vector};
use crate::time::Time;

/// A pose older than this is not extrapolated any further.
const POSE_AGE_MAX: Duration = Duration::from_millis(500);

/// The last known place of the vehicle itself.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct LastPose {
    pose_sd_max_m: f64,
    last: Option<(Time, Pose, f64)>,
    /// Above home, metres.
    altitude_m: f64,
}

impl LastPose {
    /// Makes a place that is not known yet; poses with a larger deviation than `pose_sd_max_m` never are.
    pub(super) fn unknown(pose_sd_max_m: f64) -> LastPose {
        LastPose {
            pose_sd_max_m,
            last: None,
            altitude_m: 0.0,
        }
    }

    /// Takes the newest state.
    pub(super) fn take(&mut self, now: Time, state: &OwnState) {
        self.last = Some((now, state.pose, state.speed_mps));
        self.altitude_m = state.flight_state.altitude_m;
    }

    /// Returns the pose now as it travels, with the last altitude.
    pub(super) fn report(&self, now: Time) -> Option<PoseReport> {
        let pose = self.pose(now)?;
        Some(PoseReport {
            at: Position::from_metres(pose.at.x_m, pose.at.y_m, self.altitude_m),
            ..pose.into()
        })
    }

    /// Returns the pose now, carried on along its heading; `None` when it is unknown, too old or too uncertain.
    pub(super) fn pose(&self, now: Time) -> Option<Pose> {
        let (at, pose, speed_mps) = self.last?;
        let age = now.since(at);
        let moved = Vector::polar(pose.heading, speed_mps * age.as_secs_f64());
        let known = age <= POSE_AGE_MAX && pose.sd_m <= self.pose_sd_max_m;
        known.then_some(Pose {
            at: pose.at + moved,
            ..pose
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests_support::own_state;
    use super::*;

    #[test]
    fn a_place_is_carried_on_for_half_a_second_and_then_unknown() {
        let mut place = LastPose::unknown(0.5);
        assert_eq!(place.pose(Time::ZERO), None);
        let mut moving = own_state(2.0, 0.0);
        moving.speed_mps = 0.5;
        place.take(Time::ZERO, &moving);
        let later = place.pose(Time::from_secs_f64(0.4)).unwrap();
        assert!((later.at.x_m - 2.2).abs() < 1e-9);
        assert_eq!(place.pose(Time::from_secs_f64(0.6)), None);
    }

    #[test]
    fn it_travels_with_its_altitude() {
        let mut place = LastPose::unknown(0.5);
        let mut flying = own_state(2.0, 1.0);
        flying.flight_state.altitude_m = 3.5;
        place.take(Time::ZERO, &flying);
        let at = place.report(Time::ZERO).unwrap().at;
        assert_eq!((at.x_m(), at.y_m(), at.z_m()), (2.0, 1.0, 3.5));
    }

    #[test]
    fn an_uncertain_pose_is_no_place() {
        let mut place = LastPose::unknown(0.5);
        let mut lost = own_state(2.0, 0.0);
        lost.pose.sd_m = 0.6;
        place.take(Time::ZERO, &lost);
        assert_eq!(place.pose(Time::ZERO), None);
    }
}
