//! What an autopilot says of its attitude (ATTITUDE), the newest of it. What is old is not known any more: who drives on by it
//! does not drive where it believes to.

use std::time::Duration;

use super::MavlinkDriverSettings;
use crate::geom::{Angle, Bearing};
use crate::mavlink::dialect::ATTITUDE_DATA;
use crate::time::Time;

/// Slower than this is steady, rad/s.
const STEADY_BELOW_RADPS: f64 = 0.06;

/// An attitude is believed for this long: it is asked for ten times a second, and comes once a second before it is.
const LASTS: Duration = Duration::from_millis(1500);

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

    fn fresh(&self, now: Time) -> Option<&ATTITUDE_DATA> {
        let (at, said) = self.0.as_ref()?;
        (now.since(*at) <= LASTS).then_some(said)
    }

    /// Returns where it points, by its own compass; `None` when it has not said so lately.
    pub(super) fn heading(&self, now: Time, settings: &MavlinkDriverSettings) -> Option<Angle> {
        let said = self.fresh(now)?;
        let yaw_rad = f64::from(said.yaw);
        yaw_rad
            .is_finite()
            .then(|| settings.frame.heading_of(Bearing::from_radians(yaw_rad)))
    }

    /// Returns its roll and its pitch; `None` when it has not said so lately.
    pub(super) fn tilt(&self, now: Time) -> Option<(Angle, Angle)> {
        let said = self.fresh(now)?;
        let (roll_rad, pitch_rad) = (f64::from(said.roll), f64::from(said.pitch));
        let are_numbers = roll_rad.is_finite() && pitch_rad.is_finite();
        are_numbers.then(|| {
            (
                Angle::from_radians(roll_rad),
                Angle::from_radians(pitch_rad),
            )
        })
    }

    /// Returns whether it turns on the spot, or while it moves, as far as it has said so lately.
    pub(super) fn turns(&self, now: Time) -> bool {
        let said = self.fresh(now);
        said.is_some_and(|said| f64::from(said.yawspeed).abs() > STEADY_BELOW_RADPS)
    }
}
