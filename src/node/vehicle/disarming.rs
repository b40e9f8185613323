//! Taking the current from the motors after an order: at rest first, since braking needs it, then said again until
//! telemetry shows it, since a link that is made anew loses what was said meanwhile. Arming is not here: it is said once,
//! so that whoever disarms a rover by hand is not overruled.
//!
//! ```text
//!   landing, emergency ──► [AtRest] ──rests──► [Ordered] ◄── motors cut
//! ```

use serde::{Deserialize, Serialize};

use super::messages::{Motion, Telemetry};
use super::movement::{RESEND_AFTER, REST_GRACE};
use crate::time::Time;

/// How far the disarming of a vehicle has come.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(super) enum DisarmingState {
    /// It is to be disarmed as soon as it rests.
    AtRest {
        /// When that was ordered.
        since: Time,
    },
    /// The autopilot was told to disarm.
    Ordered {
        /// When it was told last.
        at: Time,
        /// When it was ordered anew after that: at rest it is told once more.
        ordered_again: Option<Time>,
    },
}

impl DisarmingState {
    /// Begins with the order: it is disarmed at rest.
    pub(super) fn at_rest(now: Time) -> DisarmingState {
        DisarmingState::AtRest { since: now }
    }

    /// Begins with the autopilot being told now.
    pub(super) fn ordered(now: Time) -> DisarmingState {
        DisarmingState::Ordered {
            at: now,
            ordered_again: None,
        }
    }

    /// Returns what becomes of it by another order to disarm at rest.
    pub(super) fn again(self, now: Time) -> DisarmingState {
        match self {
            DisarmingState::AtRest { since: _ } => DisarmingState::AtRest { since: now },
            DisarmingState::Ordered {
                at,
                ordered_again: _,
            } => DisarmingState::Ordered {
                at,
                ordered_again: Some(now),
            },
        }
    }

    /// Takes what telemetry shows; returns whether the autopilot is to be told now.
    pub(super) fn take(&mut self, now: Time, telemetry: &Telemetry) -> bool {
        let has_come_to_rest =
            |since: Time| telemetry.motion == Motion::Resting && now.since(since) > REST_GRACE;
        let is_due = match *self {
            DisarmingState::AtRest { since } => has_come_to_rest(since),
            DisarmingState::Ordered { at, ordered_again } => {
                let was_lost = telemetry.is_armed && now.since(at) >= RESEND_AFTER;
                was_lost || ordered_again.is_some_and(has_come_to_rest)
            }
        };
        if is_due {
            *self = DisarmingState::ordered(now);
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Angle, Point, Pose};

    /// Returns the tenths of a second at which the autopilot is told.
    fn fed(mut disarming: DisarmingState, motion: Motion, is_armed: bool) -> Vec<u32> {
        let pose = Pose {
            at: Point::new(0.0, 0.0),
            heading: Angle::default(),
            sd_m: 0.05,
        };
        let telemetry = Telemetry {
            pose,
            flight_state: Default::default(),
            speed_mps: 0.0,
            battery: Some(1.0),
            motion,
            is_armed,
            stored: None,
        };
        let now = |tenth: u32| Time::from_secs_f64(0.1 * f64::from(tenth));
        (1..=10)
            .filter(|tenth| disarming.take(now(*tenth), &telemetry))
            .collect()
    }

    #[test]
    fn it_waits_for_rest_and_then_for_telemetry() {
        let ordered = DisarmingState::at_rest(Time::ZERO);
        assert!(
            fed(ordered, Motion::Driving, true).is_empty(),
            "braking needs the motors"
        );
        assert!(fed(ordered, Motion::Turning, true).is_empty());
        assert_eq!(fed(ordered, Motion::Resting, false), [4], "once");
        assert_eq!(
            fed(ordered, Motion::Resting, true),
            [4, 7, 10],
            "until telemetry shows it"
        );
        assert_eq!(
            fed(DisarmingState::ordered(Time::ZERO), Motion::Driving, true),
            [3, 6, 9],
            "motors cut on the way"
        );
        assert!(fed(DisarmingState::ordered(Time::ZERO), Motion::Driving, false).is_empty());
    }

    #[test]
    fn ordered_again_it_is_told_again_at_rest() {
        let again = DisarmingState::ordered(Time::ZERO).again(Time::ZERO);
        assert_eq!(fed(again, Motion::Resting, false), [4]);
        assert!(fed(again, Motion::Driving, false).is_empty());
        let later = DisarmingState::at_rest(Time::ZERO).again(Time::from_secs_f64(0.5));
        assert_eq!(fed(later, Motion::Resting, false), [9]);
    }
}
