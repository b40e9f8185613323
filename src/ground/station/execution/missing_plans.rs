//! Plans that cannot be made from where the vehicles rest: they are asked for again when something has changed, and not for
//! ever. It asks nobody itself.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::VehicleId;

use crate::geom::Point;
use crate::time::Time;

/// A vehicle that rests this far from where it was has moved, metres.
const MOVED_M: f64 = 0.1;
/// Plans are asked for again no sooner than this.
const AGAIN_AFTER: Duration = Duration::from_secs(5);
/// Without plans the sweep is given up after this long. People read of it in docs/modules.md.
const GIVEN_UP_AFTER: Duration = Duration::from_secs(60);

/// What plans are made from: where the vehicles rest, and how often the map has changed.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct PlannedFrom {
    pub places: Vec<(VehicleId, Point)>,
    pub map_changes: u64,
}

impl PlannedFrom {
    fn has_changed(&self, before: &PlannedFrom) -> bool {
        let stays = |((id, at), (known, was)): (&(VehicleId, Point), &(VehicleId, Point))| {
            id == known && at.distance_to(*was) < MOVED_M
        };
        self.map_changes != before.map_changes
            || self.places.len() != before.places.len()
            || !self.places.iter().zip(&before.places).all(stays)
    }
}

/// That there are no plans.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct MissingPlans {
    since: Time,
    tried: (Time, PlannedFrom),
    pub why: String,
}

/// What is to be done about it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum MissingPlansStep {
    Wait,
    AskAgain,
    GiveUp,
}

impl MissingPlans {
    /// There are none for the first time.
    pub(super) fn new(now: Time, from: PlannedFrom, why: String) -> MissingPlans {
        MissingPlans {
            since: now,
            tried: (now, from),
            why,
        }
    }

    /// There are none again.
    pub(super) fn try_in_vain(&mut self, now: Time, from: PlannedFrom, why: String) {
        (self.tried, self.why) = ((now, from), why);
    }

    /// Returns what is to be done as things are now.
    pub(super) fn step(&self, now: Time, from: &PlannedFrom) -> MissingPlansStep {
        let (tried_at, before) = &self.tried;
        if now.since(self.since) >= GIVEN_UP_AFTER {
            MissingPlansStep::GiveUp
        } else if now.since(*tried_at) >= AGAIN_AFTER && from.has_changed(before) {
            MissingPlansStep::AskAgain
        } else {
            MissingPlansStep::Wait
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn from(x_m: f64, map_changes: u64) -> PlannedFrom {
        PlannedFrom {
            places: vec![(VehicleId(1), Point::new(x_m, 0.0))],
            map_changes,
        }
    }

    #[test]
    fn it_is_tried_again_when_the_map_or_a_place_has_changed_and_not_for_ever() {
        let at = Time::from_secs_f64;
        let mut missing = MissingPlans::new(at(10.0), from(0.0, 3), "no room".to_owned());
        let step = |missing: &MissingPlans, now_s, from| missing.step(at(now_s), &from);
        use MissingPlansStep::{AskAgain, GiveUp, Wait};
        assert_eq!(step(&missing, 20.0, from(0.05, 3)), Wait, "nothing new");
        assert_eq!(step(&missing, 12.0, from(0.0, 4)), Wait, "too soon");
        assert_eq!(step(&missing, 15.0, from(0.0, 4)), AskAgain);
        assert_eq!(step(&missing, 15.0, from(0.2, 3)), AskAgain);
        missing.try_in_vain(at(16.0), from(0.0, 4), "no room".to_owned());
        assert_eq!(step(&missing, 30.0, from(0.0, 4)), Wait);
        assert_eq!(step(&missing, 70.0, from(0.0, 5)), GiveUp);
    }
}
