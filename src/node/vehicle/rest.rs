//! Coming to rest, and cutting the motors: both are said again until telemetry shows them, since a link that has to be made
//! anew loses what was said meanwhile. Arming is said once: whoever disarms a rover by hand must not be overruled.

use std::collections::VecDeque;
use std::time::Duration;

use super::words::{Fly, Motion, Telemetry};
use super::{Leg, Out, REST_GRACE, Vehicle};
use crate::geom::{Point, Vector};
use crate::time::Time;

/// What telemetry does not show yet is said again this often.
const SAY_AGAIN: Duration = Duration::from_millis(300);

impl Vehicle {
    pub(super) fn stop(&mut self, now: Time, out: &mut Vec<Out>) {
        if let Some((_, telemetry)) = self.telemetry {
            let corners = VecDeque::from([self.brakes_until(telemetry)]);
            self.leg = self.leg.is_some().then_some(Leg { since: now, is_off_plan: false, corners });
        }
        self.stop_said = Some(now);
        out.push(Out::Fly(Fly::Stop));
    }

    fn brakes_until(&self, telemetry: Telemetry) -> Point {
        let braking_m = telemetry.speed_mps * telemetry.speed_mps / (2.0 * self.settings.body.braking_mps2);
        telemetry.pose.at + Vector::polar(telemetry.pose.heading, braking_m)
    }

    pub(super) fn arm(&mut self, out: &mut Vec<Out>) {
        (self.disarm_since, self.is_disarmed) = (None, false);
        out.push(Out::Fly(Fly::Arm));
    }

    pub(super) fn disarm(&mut self, now: Time, out: &mut Vec<Out>) {
        (self.disarm_since, self.is_disarmed, self.disarm_said) = (None, true, Some(now));
        out.push(Out::Fly(Fly::Disarm));
    }

    /// Disarms a vehicle that was to hold first, once: braking needs its motors.
    pub(super) fn disarm_at_rest(&mut self, now: Time, telemetry: Telemetry, out: &mut Vec<Out>) {
        let is_due = self.disarm_since.is_some_and(|since| now.since(since) > REST_GRACE);
        if is_due && telemetry.motion == Motion::Resting {
            self.disarm(now, out);
        }
    }

    /// Says again what the autopilot was told and does not do.
    pub(super) fn say_again(&mut self, now: Time, telemetry: Telemetry, out: &mut Vec<Out>) {
        let is_due = |said: Option<Time>| said.is_some_and(|at| now.since(at) >= SAY_AGAIN);
        if telemetry.motion != Motion::Resting && is_due(self.stop_said) {
            self.stop(now, out);
        }
        if self.is_disarmed && telemetry.is_armed && is_due(self.disarm_said) {
            self.disarm(now, out);
        }
    }
}
