//! Where the vehicle has been: the last few places, to go back to out of a dead end, and all places that it has driven,
//! since it came through there and may go there again. Pure bookkeeping.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use crate::geom::{Point, Segment};

/// Places remembered to go back to, and how far apart they are, metres.
const RECENT: usize = 16;
const RECENT_STEP_M: f64 = 0.5;
/// All places driven that are remembered, and how far apart they are, metres.
const ALL: usize = 8192;
const ALL_STEP_M: f64 = 0.2;
/// Of a track so many places are looked at, the last ones.
const LOOKED_BACK: usize = 200;
/// A place this near to another one of its track can be driven to from there, metres.
const BESIDE_M: f64 = 0.25;
/// Nearer than this to where it has driven a way leads over its track: track and way have corners, metres.
const ON_TRACK_M: f64 = 0.4;
/// Between places of the track that are farther apart, and than the oldest ones are, nobody knows how it has come from one to
/// the other, metres.
const GAP_M: f64 = 2.0;
/// A way is looked at in steps of this length, metres.
const STEP_M: f64 = 0.1;

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

    /// Returns how far a route leads over places that the vehicle has driven, metres, and the first place beyond; `None` =
    /// all of it does.
    pub(super) fn leaves_track_at(&self, route: &[Point]) -> Option<(f64, Point)> {
        let is_off = |at: &Point| !self.is_on_track(*at);
        let mut start_m = 0.0;
        for pair in route.windows(2) {
            let length_m = Segment::new(pair[0], pair[1]).length_m();
            let steps = (length_m / STEP_M).ceil().max(1.0) as u32;
            let share = |step: u32| f64::from(step) / f64::from(steps);
            let off = (1..=steps).find(|step| is_off(&pair[0].toward(pair[1], share(*step))));
            if let Some(step) = off {
                let until_m = start_m + length_m * share(step - 1);
                return Some((until_m, pair[0].toward(pair[1], share(step))));
            }
            start_m += length_m;
        }
        None
    }

    /// Returns whether it has driven over a place; older places of the track lie farther apart than it is wide.
    fn is_on_track(&self, at: Point) -> bool {
        let is_near = |one: &Point| one.distance_to(at) < ON_TRACK_M;
        // The oldest places are the farthest apart.
        let oldest = self.all.windows(2).next();
        let gap_m = oldest.map_or(0.0, |pair| 1.5 * pair[0].distance_to(pair[1]));
        let is_between = |pair: &[Point]| {
            let piece = Segment::new(pair[0], pair[1]);
            piece.length_m() <= gap_m.max(GAP_M) && piece.distance_to_point(at) < ON_TRACK_M
        };
        self.all.iter().any(is_near) || self.all.windows(2).any(is_between)
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
            // The older ones are kept in larger steps, where they are in smaller ones first.
            let old = ALL / 4 * 3;
            let steps = (1..).map(|doubled| ALL_STEP_M * f64::from(1 << doubled));
            let thinned = steps.map(|step_m| thinned(&self.all[..old], step_m));
            let enough = thinned.take(8).find(|left| left.len() <= old / 4 * 3);
            self.all.splice(..old, enough.unwrap_or_default());
        }
    }
}

/// Returns the way back over a track (oldest place first) alone, from where the vehicle is to the first place that will do,
/// and that first; `None` when none of the places looked at does. Where the track comes near itself the loop is left out.
pub(super) fn back_over(
    track: &[Point],
    from: Point,
    will_do: impl Fn(Point) -> bool,
) -> Option<Vec<Point>> {
    let oldest = track.len().saturating_sub(LOOKED_BACK);
    let track = &track[oldest..];
    let mut points = vec![from];
    let mut index = track.len();
    while index > 0 {
        let here = points[points.len() - 1];
        let is_beside = |place: &Point| place.distance_to(here) <= BESIDE_M;
        index = track[..index]
            .iter()
            .position(is_beside)
            .unwrap_or(index - 1);
        points.push(track[index]);
        if will_do(track[index]) {
            return Some(points);
        }
    }
    None
}

/// Returns places of a track that are so far apart at least, metres.
fn thinned(track: &[Point], step_m: f64) -> Vec<Point> {
    let mut left: Vec<Point> = Vec::new();
    for place in track {
        // Steps are somewhat longer than they must be: two of them make one.
        if is_new(left.last(), *place, 0.99 * step_m) {
            left.push(*place);
        }
    }
    left
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
    fn the_way_back_leads_over_the_track_alone_and_leaves_its_loops_out() {
        let corners = [
            (0.0, 0.0),
            (4.0, 0.0),
            (4.0, 2.0),
            (3.0, 2.0),
            (3.0, 1.0),
            (4.0, 1.0),
        ];
        let corners = corners.map(|(x_m, y_m)| Point::new(x_m, y_m));
        let mut places = DrivenPlaces::default();
        for pair in corners.windows(2) {
            let steps = (pair[0].distance_to(pair[1]) / 0.1).round() as u32;
            (0..steps).for_each(|step| {
                places.note(pair[0].toward(pair[1], f64::from(step) / f64::from(steps)));
            });
        }
        let (track, from) = (places.all(), corners[5]);
        let back = back_over(track, from, |place| place.x_m < 2.0).unwrap();
        assert_eq!(back[0], from);
        assert!(
            back.windows(2)
                .all(|pair| pair[0].distance_to(pair[1]) <= 0.31)
        );
        let is_beside_loop = |place: &Point| place.y_m > 1.3;
        assert!(!back.iter().any(is_beside_loop), "{back:?}");
        let length_m: f64 = back
            .windows(2)
            .map(|pair| pair[0].distance_to(pair[1]))
            .sum();
        assert!((2.9..3.4).contains(&length_m), "{length_m} m");
        assert_eq!(back_over(track, from, |_| false), None);
        assert_eq!(back_over(&[], from, |_| true), None);
    }

    #[test]
    fn a_route_leads_over_the_track_as_far_as_the_vehicle_has_driven() {
        let places = driven(4.0);
        let route = |corners: &[(f64, f64)]| -> Vec<Point> {
            corners
                .iter()
                .map(|(x_m, y_m)| Point::new(*x_m, *y_m))
                .collect()
        };
        assert_eq!(
            places.leaves_track_at(&route(&[(4.0, 0.1), (0.0, -0.1)])),
            None
        );
        assert_eq!(places.leaves_track_at(&route(&[(2.0, 0.0)])), None);
        let (until_m, at) = places
            .leaves_track_at(&route(&[(1.0, 0.0), (2.0, 0.0), (2.0, 3.0)]))
            .unwrap();
        assert!((1.2..1.41).contains(&until_m), "{until_m} m");
        assert!((0.3..0.51).contains(&at.y_m), "{at:?}");
        let nowhere = DrivenPlaces::default();
        let off = nowhere.leaves_track_at(&route(&[(0.0, 0.0), (1.0, 0.0)]));
        assert_eq!(off.map(|(until_m, _)| until_m), Some(0.0));
    }

    #[test]
    fn a_long_drive_keeps_its_beginning_in_larger_steps_and_never_grows_over_the_limit() {
        let places = driven(4000.0);
        let all = places.all();
        assert!(all.len() <= ALL, "{} places", all.len());
        assert_eq!(all[0], Point::default());
        let gap_m = |index: usize| all[index].distance_to(all[index + 1]);
        assert!(gap_m(0) > 1.5 * gap_m(all.len() - 2));
        let along = [Point::new(50.0, 0.1), Point::default()];
        assert_eq!(places.leaves_track_at(&along), None, "it has driven there");
        let far = driven(20_000.0);
        assert_eq!(far.leaves_track_at(&along), None, "nor after 20 km");
        let mut jumped = driven(1.0);
        jumped.note(Point::new(9.0, 0.0));
        let across = [Point::new(9.0, 0.0), Point::new(1.0, 0.0)];
        assert!(jumped.leaves_track_at(&across).is_some());
    }
}
