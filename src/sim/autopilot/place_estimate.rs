//! What an autopilot knows of its own place, and whether it has lost it. What it does without one is not known here.

use super::messages::AutopilotSettings;
use super::navigation::Navigation;
use crate::geom::{Point, Vector};
use crate::time::Time;

/// The estimate of its own place.
#[derive(Clone, Debug)]
pub(super) struct PlaceEstimate {
    navigation: Navigation,
    is_lost: bool,
}

impl PlaceEstimate {
    /// Records how well it knows its place; it is not lost.
    pub(super) fn new(navigation: Navigation) -> PlaceEstimate {
        PlaceEstimate {
            navigation,
            is_lost: false,
        }
    }

    /// Returns the believed place less the true one.
    pub(super) fn error(&self, now: Time) -> Vector {
        self.navigation.error(now)
    }

    /// Returns the standard deviation of each coordinate, metres.
    pub(super) fn sd_m(&self, now: Time) -> f64 {
        self.navigation.sd_m(now)
    }

    /// Returns whether the place is known: for this long after it was switched on, and well enough.
    pub(super) fn is_known(&self, now: Time, settings: &AutopilotSettings) -> bool {
        self.is_near_enough(now, settings) && now >= Time::ZERO + settings.place_after
    }

    /// Returns whether it has lost its place.
    pub(super) fn is_lost(&self) -> bool {
        self.is_lost
    }

    /// Returns when it loses its place next.
    pub(super) fn lost_at(&self, now: Time, settings: &AutopilotSettings) -> Option<Time> {
        self.navigation.lost_at(now, settings.place_sd_max_m)
    }

    /// Loses its place.
    pub(super) fn lose(&mut self) {
        self.is_lost = true;
    }

    /// Finds its place again, if it is known well enough.
    pub(super) fn refresh(&mut self, now: Time, settings: &AutopilotSettings) {
        self.is_lost &= !self.is_near_enough(now, settings);
    }

    /// Turns believed places into the true ones that are reached when it steers for them, beside which it may be carried.
    pub(super) fn turn_to_true(&self, now: Time, places: &mut [Point], carried: Option<Vector>) {
        let error = self.error(now);
        for place in places {
            let steered_for = *place - error;
            *place = carried.map_or(steered_for, |carried| steered_for + carried);
        }
    }

    fn is_near_enough(&self, now: Time, settings: &AutopilotSettings) -> bool {
        self.navigation.sd_m(now) <= settings.place_sd_max_m
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::super::navigation::Outage;
    use super::super::tests::{LIMITS, secs};
    use super::*;
    use crate::autopilot::VehicleKind;
    use crate::sim::noise::Noise;

    fn settings() -> AutopilotSettings {
        AutopilotSettings {
            place_sd_max_m: 2.1,
            ..AutopilotSettings::new(VehicleKind::Rover, LIMITS)
        }
    }

    fn estimate() -> PlaceEstimate {
        let outage = Outage {
            from: secs(100.0),
            until: secs(200.0),
        };
        let navigation = Navigation::new(Noise::new(1), 1, 0.1, Duration::from_secs(20));
        PlaceEstimate::new(navigation.with_outages(vec![outage], 0.1))
    }

    #[test]
    fn it_is_known_after_a_while_and_as_long_as_it_is_sure_enough() {
        let (estimate, settings) = (estimate(), settings());
        for (now_s, is_known) in [
            (41.9, false),
            (42.0, true),
            (119.0, true),
            (121.0, false),
            (200.0, true),
        ] {
            assert_eq!(
                estimate.is_known(secs(now_s), &settings),
                is_known,
                "{now_s} s"
            );
        }
    }

    #[test]
    fn it_is_lost_until_it_is_known_well_again() {
        let (mut estimate, settings) = (estimate(), settings());
        assert_eq!(estimate.lost_at(secs(50.0), &settings), Some(secs(120.0)));
        estimate.lose();
        estimate.refresh(secs(150.0), &settings);
        assert!(estimate.is_lost());
        estimate.refresh(secs(200.0), &settings);
        assert!(!estimate.is_lost());
        estimate.refresh(secs(150.0), &settings);
        assert!(!estimate.is_lost(), "it is lost when that is noticed");
    }

    #[test]
    fn the_true_place_is_the_believed_one_less_the_error_and_carried_aside() {
        let (estimate, now) = (estimate(), secs(110.0));
        let error = estimate.error(now);
        assert!(error.length_m() > 0.1, "{error:?}");
        for carried in [None, Some(Vector::new(0.0, 2.0))] {
            let mut places = [Point::new(5.0, 6.0)];
            estimate.turn_to_true(now, &mut places, carried);
            let believed = places[0] + error;
            let aside_m = carried.map_or(0.0, |carried| carried.y_m);
            assert!(believed.distance_to(Point::new(5.0, 6.0 + aside_m)) < 1e-9);
        }
    }
}
