//! A body in space: it moves in the plane as [`Body`] does, and changes its altitude on the spot at an even rate. Closed
//! form; nothing is known of modes and missions.

use std::time::Duration;

use super::super::body::{Body, BodyState};
use crate::geom::{Angle, Attitude, Vector};
use crate::time::Time;

/// Gravity, m/s².
const GRAVITY_MPS2: f64 = 9.80665;
/// Drag of a small copter: acceleration for each m/s of air speed, 1/s.
const DRAG_PER_S: f64 = 0.3;

/// A copter counts as landed at or below this altitude, metres.
pub(super) const LANDED_M: f64 = 0.05;

/// A change of altitude at an even rate.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Climb {
    /// When it begins.
    pub since: Time,
    /// Altitude then, metres.
    pub from_m: f64,
    /// Altitude at its end, metres.
    pub to_m: f64,
    /// How fast, m/s, positive.
    pub rate_mps: f64,
}

impl Climb {
    /// Returns an altitude that does not change.
    pub fn level(altitude_m: f64) -> Climb {
        Climb {
            since: Time::ZERO,
            from_m: altitude_m,
            to_m: altitude_m,
            rate_mps: 1.0,
        }
    }

    /// Returns the change from the altitude that it has at a moment to another one, metres, at a rate, m/s.
    pub fn towards(&self, now: Time, to_m: f64, rate_mps: f64) -> Climb {
        Climb {
            since: now,
            from_m: self.altitude_m(now),
            to_m,
            rate_mps,
        }
    }

    /// Returns the altitude at which it ends when it is given up at a moment, as a change that is over.
    pub fn halted(&self, now: Time) -> Climb {
        let altitude_m = if now >= self.until() {
            self.to_m
        } else {
            self.altitude_m(now)
        };
        Climb {
            since: now,
            ..Climb::level(altitude_m)
        }
    }

    /// Returns when it is over.
    pub fn until(&self) -> Time {
        self.since + Duration::from_secs_f64((self.to_m - self.from_m).abs() / self.rate_mps)
    }

    /// Returns the altitude at a moment, metres.
    pub fn altitude_m(&self, at: Time) -> f64 {
        let way_m = at.since(self.since).as_secs_f64() * self.rate_mps;
        let whole_m = self.to_m - self.from_m;
        if way_m >= whole_m.abs() {
            self.to_m
        } else {
            self.from_m + way_m.copysign(whole_m)
        }
    }

    /// Returns how fast the altitude changes at a moment, m/s.
    pub fn climb_mps(&self, at: Time) -> f64 {
        if at < self.since || at >= self.until() {
            0.0
        } else {
            self.rate_mps.copysign(self.to_m - self.from_m)
        }
    }
}

/// Returns how a copter lies that faces and moves like this in a wind: it leans so that its thrust carries its
/// acceleration and the drag of its air speed.
pub(super) fn leaning(body: &Body, state: BodyState, at: Time, wind: Vector) -> Attitude {
    let moves = Vector::polar(state.heading, state.speed_mps);
    let needed = body.acceleration_at(at) + (moves - wind) * DRAG_PER_S;
    let ahead = Vector::polar(state.heading, 1.0);
    let (forward, left) = (ahead.dot(needed), ahead.cross(needed));
    Attitude {
        // Thrust to the right comes of a lowered right side, thrust ahead of a lowered nose.
        roll: -Angle::from_radians(libm::atan2(left, GRAVITY_MPS2)),
        pitch: -Angle::from_radians(libm::atan2(forward, GRAVITY_MPS2)),
        yaw: state.heading,
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{LIMITS, secs};
    use super::*;

    #[test]
    fn a_climb_goes_on_evenly_and_is_given_up_where_it_is() {
        let climb = Climb::level(1.0).towards(secs(10.0), 5.0, 2.0);
        assert_eq!(climb.until(), secs(12.0));
        assert_eq!(climb.altitude_m(secs(11.0)), 3.0);
        assert_eq!(
            (climb.climb_mps(secs(11.0)), climb.climb_mps(secs(12.0))),
            (2.0, 0.0)
        );
        let halted = climb.halted(secs(11.0));
        assert_eq!(
            (halted.altitude_m(secs(20.0)), halted.until()),
            (3.0, secs(11.0))
        );
        assert_eq!(climb.halted(secs(30.0)).altitude_m(secs(30.0)), 5.0);
        let sinking = climb.towards(secs(11.0), 0.0, 1.5);
        assert_eq!(
            (sinking.until(), sinking.climb_mps(secs(12.0))),
            (secs(13.0), -1.5)
        );
    }

    #[test]
    fn a_copter_at_rest_lies_level_without_wind_and_leans_against_it() {
        let body = Body::at_rest(Default::default(), Angle::ZERO, LIMITS).unwrap();
        let lies = |wind| leaning(&body, body.pose_at(Time::ZERO), Time::ZERO, wind);
        let calm = lies(Vector::default());
        assert_eq!(
            (calm.roll.radians().abs(), calm.pitch.radians().abs()),
            (0.0, 0.0)
        );
        let head_wind = lies(Vector::new(-4.0, 0.0));
        let expected_rad = libm::atan(4.0 * DRAG_PER_S / GRAVITY_MPS2);
        assert!(
            (head_wind.pitch.radians() + expected_rad).abs() < 1e-9,
            "nose down: {head_wind:?}"
        );
    }
}
