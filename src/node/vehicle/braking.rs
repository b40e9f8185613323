//! Where the vehicle comes to rest if it brakes: what is still driven after a stop, or after another route was told.

use std::time::Duration;

use super::Vehicle;
use super::messages::{Motion, Telemetry};
use super::movement::{Braking, REST_GRACE};
use crate::geom::{Point, Vector};
use crate::time::Time;

impl Vehicle {
    /// Returns what is left of what it drives now, once it is told another route.
    pub(super) fn braking(&self, now: Time) -> Option<Braking> {
        let telemetry = self.telemetry.of_any_age();
        let drives = |telemetry: &&Telemetry| telemetry.motion == Motion::Driving;
        let speed_mps = telemetry.filter(drives)?.speed_mps;
        let braking_s = speed_mps / self.settings.body.braking_mps2;
        Some(Braking {
            end: self.rests_at(REST_GRACE.as_secs_f64())?,
            until: now + REST_GRACE + Duration::try_from_secs_f64(braking_s).ok()?,
        })
    }

    /// Returns where the vehicle comes to rest if it brakes now; `None` as long as nobody knows where it is.
    pub(super) fn braking_end(&self) -> Option<Point> {
        self.rests_at(0.0)
    }

    /// Returns where the vehicle comes to rest if it brakes after a reaction of some seconds.
    fn rests_at(&self, reaction_s: f64) -> Option<Point> {
        let Telemetry {
            pose, speed_mps, ..
        } = self.telemetry.of_any_age()?;
        let braking_s = speed_mps / self.settings.body.braking_mps2;
        let braking_m = speed_mps * (reaction_s + braking_s / 2.0);
        Some(pose.at + Vector::polar(pose.heading, braking_m))
    }
}
