//! What an autopilot says of its attitude (ATTITUDE), the newest of it.

use super::MavlinkDriverSettings;
use crate::geom::{Angle, Bearing};
use crate::mavlink::dialect::ATTITUDE_DATA;
use crate::time::Time;

/// Slower than this is steady, rad/s.
const STEADY_BELOW_RADPS: f64 = 0.06;

/// The newest attitude.
#[derive(Clone, Debug, Default)]
pub(super) struct HeardAttitude(Option<(Time, ATTITUDE_DATA)>);

impl HeardAttitude {
    /// Takes a newer one.
    pub(super) fn take(&mut self, now: Time, said: &ATTITUDE_DATA) {
        self.0 = Some((now, said.clone()));
    }

    /// Returns when it was said.
    pub(super) fn at(&self) -> Option<Time> {
        self.0.as_ref().map(|(at, _)| *at)
    }

    /// Returns where it points, by its own compass.
    pub(super) fn heading(&self, settings: &MavlinkDriverSettings) -> Option<Angle> {
        let (_, said) = self.0.as_ref()?;
        let yaw_rad = f64::from(said.yaw);
        yaw_rad
            .is_finite()
            .then(|| settings.frame.heading_of(Bearing::from_radians(yaw_rad)))
    }

    /// Returns its roll and its pitch.
    pub(super) fn tilt(&self) -> Option<(Angle, Angle)> {
        let (_, said) = self.0.as_ref()?;
        let (roll_rad, pitch_rad) = (f64::from(said.roll), f64::from(said.pitch));
        let are_numbers = roll_rad.is_finite() && pitch_rad.is_finite();
        are_numbers.then(|| {
            (
                Angle::from_radians(roll_rad),
                Angle::from_radians(pitch_rad),
            )
        })
    }

    /// Returns whether it turns on the spot, or while it moves.
    pub(super) fn turns(&self) -> bool {
        let said = self.0.as_ref();
        said.is_some_and(|(_, said)| f64::from(said.yawspeed).abs() > STEADY_BELOW_RADPS)
    }
}
