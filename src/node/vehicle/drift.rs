//! What wind does to a copter: it comes to rest beside where it was sent, again and again by the same. The offset is learnt
//! from where telemetry shows it at rest at the end of a leg, and made allowance for in the corners that the autopilot is
//! told. How large it can be at most is part of the margins (`VehicleSettings::carried_m`); nothing larger is believed.
//!
//! Deliberately absent: what wind does on the way. There the margins hold it alone.

use serde::{Deserialize, Serialize};

use crate::geom::{Point, Vector};

/// Share of a new offset in what is believed.
const SHARE: f64 = 0.3;

/// The offset of a vehicle from where it is sent.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) struct Drift {
    /// The offset believed, metres; `None` = nothing was learnt yet.
    by: Option<Vector>,
}

impl Drift {
    /// Returns the corners that the autopilot is told so that a vehicle comes to these.
    pub(super) fn corrected(&self, corners: &[Point]) -> Vec<Point> {
        let by = self.by.unwrap_or_default();
        corners.iter().map(|corner| *corner - by).collect()
    }

    /// Learns from where a vehicle came to rest that was to come to a place; `most_m` = how far it is carried at most.
    pub(super) fn learn(&mut self, wanted: Point, rests_at: Point, most_m: f64) {
        let before = self.by.unwrap_or_default();
        let seen = before + (rests_at - wanted);
        if most_m <= 0.0 || seen.length_m() > 2.0 * most_m {
            return;
        }
        let share = if self.by.is_some() { SHARE } else { 1.0 };
        let by = before + (seen - before) * share;
        let too_long = (by.length_m() / most_m).max(1.0);
        self.by = Some(by * (1.0 / too_long));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLACE: Point = Point::new(3.0, 1.0);

    #[test]
    fn a_steady_offset_is_made_allowance_for_after_one_leg() {
        let (mut drift, wind) = (Drift::default(), Vector::new(0.2, -0.1));
        assert_eq!(drift.corrected(&[PLACE]), [PLACE]);
        for leg in 0..5 {
            let rests_at = drift.corrected(&[PLACE])[0] + wind;
            if leg > 0 {
                assert!(rests_at.distance_to(PLACE) < 1e-9, "leg {leg}");
            }
            drift.learn(PLACE, rests_at, 0.25);
        }
    }

    #[test]
    fn no_more_is_believed_than_wind_can_do() {
        let mut drift = Drift::default();
        drift.learn(PLACE, PLACE + Vector::new(0.3, 0.0), 0.0);
        drift.learn(PLACE, PLACE + Vector::new(0.6, 0.0), 0.25);
        assert_eq!(drift, Drift::default(), "no wind, or no wind does that");
        drift.learn(PLACE, PLACE + Vector::new(0.4, 0.0), 0.25);
        let told = drift.corrected(&[PLACE])[0];
        assert!((told.distance_to(PLACE) - 0.25).abs() < 1e-9);
    }
}
