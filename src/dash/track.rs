//! Where a vehicle has been: places some way apart, and the farther apart the longer the way is. Bounded.

use tomoswarm_proto::Position;

/// Places kept at most.
pub const PLACES_MAX: usize = 1000;
/// Two places are this far apart at first, metres.
const STEP_M: f64 = 0.1;

/// Where a vehicle has been.
#[derive(Clone, PartialEq, Debug)]
pub struct Track {
    places: Vec<Position>,
    step_m: f64,
}

impl Default for Track {
    fn default() -> Track {
        Track {
            places: Vec::new(),
            step_m: STEP_M,
        }
    }
}

impl Track {
    /// Adds where the vehicle is, unless that is near the place before.
    pub fn add(&mut self, at: Position) {
        let is_near = |last: &Position| {
            let (dx_m, dy_m) = (at.x_m() - last.x_m(), at.y_m() - last.y_m());
            libm::hypot(dx_m, dy_m) < self.step_m
        };
        if self.places.last().is_some_and(is_near) {
            return;
        }
        self.places.push(at);
        if self.places.len() > PLACES_MAX {
            self.step_m *= 2.0;
            let mut place = 0;
            self.places.retain(|_| {
                place += 1;
                place % 2 == 1
            });
        }
    }

    /// Returns the places, in the order in which it was there.
    pub fn places(&self) -> &[Position] {
        &self.places
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vehicle_that_stands_adds_nothing_and_a_long_way_is_told_more_coarsely() {
        let mut track = Track::default();
        let at = |x_m| Position::from_metres(x_m, 2.0, 0.0);
        (0..50).for_each(|tick| track.add(at(1.0 + f64::from(tick % 2) / 100.0)));
        assert_eq!(track.places(), [at(1.0)]);
        for place in 0..10_000 {
            track.add(at(1.0 + f64::from(place) * 0.1));
            assert!(track.places().len() <= PLACES_MAX);
        }
        let places = track.places();
        assert_eq!(places[0], at(1.0), "the beginning stays");
        assert!(places.last().unwrap().x_m() > 999.0, "{places:?}");
        let gaps = places.windows(2).map(|two| two[1].x_m() - two[0].x_m());
        assert!(gaps.fold(0.0, f64::max) < 3.4, "no gap in the way");
    }
}
