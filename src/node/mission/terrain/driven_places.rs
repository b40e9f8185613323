//! Where the vehicle has been: the last few places, to go back to out of a dead end, and all places that it has driven,
//! since it came through there and may go there again. Pure bookkeeping.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use crate::geom::Point;

/// Places remembered to go back to, and how far apart they are, metres.
const RECENT: usize = 16;
const RECENT_STEP_M: f64 = 0.5;
/// All places driven that are remembered, and how far apart they are, metres.
const ALL: usize = 8192;
const ALL_STEP_M: f64 = 0.2;

/// The places of a vehicle.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct DrivenPlaces {
    /// Oldest first.
    recent: VecDeque<Point>,
    /// Oldest first.
    all: Vec<Point>,
}

impl DrivenPlaces {
    /// Records where the vehicle is.
    pub(super) fn note(&mut self, place: Point) {
        self.note_recent(place);
        self.note_driven(place);
    }

    /// Returns the places that were passed last, oldest first.
    pub(super) fn recent(&self) -> impl DoubleEndedIterator<Item = Point> {
        self.recent.iter().copied()
    }

    /// Returns all places, oldest first; the older ones are farther apart.
    pub(super) fn all(&self) -> &[Point] {
        &self.all
    }

    fn note_recent(&mut self, place: Point) {
        if is_new(self.recent.back(), place, RECENT_STEP_M) {
            self.recent.push_back(place);
        }
        if self.recent.len() > RECENT {
            self.recent.pop_front();
        }
    }

    fn note_driven(&mut self, place: Point) {
        if is_new(self.all.last(), place, ALL_STEP_M) {
            self.all.push(place);
        }
        if self.all.len() > ALL {
            // The older half is kept in larger steps.
            let old = ALL / 2;
            let thinned: Vec<Point> = self.all[..old].iter().copied().step_by(2).collect();
            self.all.splice(..old, thinned);
        }
    }
}

fn is_new(last: Option<&Point>, place: Point, step_m: f64) -> bool {
    last.is_none_or(|last| last.distance_to(place) >= step_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn driven(length_m: f64) -> DrivenPlaces {
        let mut places = DrivenPlaces::default();
        for step in 0..=(length_m * 10.0) as usize {
            places.note(Point::new(step as f64 * 0.1, 0.0));
        }
        places
    }

    #[test]
    fn the_last_places_are_kept_half_a_metre_apart() {
        let recent: Vec<Point> = driven(20.0).recent().collect();
        assert_eq!(recent.len(), RECENT);
        assert_eq!(recent.last(), Some(&Point::new(20.0, 0.0)));
        let steps = recent.windows(2).map(|pair| pair[0].distance_to(pair[1]));
        assert!(
            steps
                .into_iter()
                .all(|step_m| (0.4999..0.61).contains(&step_m))
        );
    }

    #[test]
    fn a_vehicle_that_stands_adds_nothing() {
        let mut places = driven(1.0);
        let before = places.all().len();
        (0..9).for_each(|_| places.note(Point::new(1.05, 0.0)));
        assert_eq!(places.all().len(), before);
    }

    #[test]
    fn a_long_drive_keeps_its_beginning_in_larger_steps_and_never_grows_over_the_limit() {
        let places = driven(4000.0);
        let all = places.all();
        assert!(all.len() <= ALL, "{} places", all.len());
        assert_eq!(all[0], Point::default());
        let gap_m = |index: usize| all[index].distance_to(all[index + 1]);
        assert!(gap_m(0) > 1.5 * gap_m(all.len() - 2));
    }
}
