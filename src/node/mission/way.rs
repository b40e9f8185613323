//! The way ahead of a vehicle: corners still to be passed, some of them stops, measured by an odometer
//! that never goes back. Pure bookkeeping; what is free or wise is decided elsewhere.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::StopId;

use crate::geom::{Point, Segment};

/// A corner within this distance counts as passed, metres.
const PASSED_M: f64 = 0.12;
/// A corner beside which the vehicle has come counts as passed up to this far away, metres.
const BESIDE_M: f64 = 0.6;

/// A corner of the way.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct Corner {
    /// Where it is.
    pub at: Point,
    /// Stops that are done when it is passed; more than one when a stop before it could not be reached.
    pub stops: Vec<StopId>,
    /// The piece that leads there is not that of the plan: a path that was found, or a short cut past what was left out.
    is_detour: bool,
}

/// The way ahead.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Way {
    /// The corner passed last: where the present piece begins.
    behind: Point,
    ahead: VecDeque<Corner>,
    /// Odometer at `behind`, metres.
    behind_m: f64,
    /// All that was ahead has been left out: what is added leads there from a place that no plan knows.
    has_left_plan: bool,
}

impl Way {
    /// Returns whether nothing is ahead.
    pub(super) fn is_empty(&self) -> bool {
        self.ahead.is_empty()
    }

    /// Returns the corners ahead.
    pub(super) fn ahead(&self) -> impl Iterator<Item = &Corner> {
        self.ahead.iter()
    }

    /// Returns the stops ahead.
    pub(super) fn stops(&self) -> impl Iterator<Item = StopId> {
        self.ahead
            .iter()
            .flat_map(|corner| corner.stops.iter().copied())
    }

    /// Returns the end of the way.
    pub(super) fn end(&self) -> Point {
        self.ahead.back().map_or(self.behind, |corner| corner.at)
    }

    /// Adds a leg to a stop at the end.
    pub(super) fn append(
        &mut self,
        route: impl IntoIterator<Item = Point>,
        to: Point,
        stop: Option<StopId>,
    ) {
        let ends = route.into_iter().map(|at| (at, None));
        for (at, stop) in ends.chain([(to, stop)]) {
            self.ahead.push_back(Corner {
                at,
                stops: stop.into_iter().collect(),
                is_detour: std::mem::take(&mut self.has_left_plan),
            });
        }
    }

    /// Replaces the first `count` corners ahead by other ones that lead from `from` to the last of them;
    /// their stops are done at its end.
    pub(super) fn replace(&mut self, from: Point, count: usize, corners: &[Point]) {
        let replaced: Vec<Corner> = self.ahead.drain(..count.min(self.ahead.len())).collect();
        let stops: Vec<StopId> = replaced
            .into_iter()
            .flat_map(|corner| corner.stops)
            .collect();
        for (index, at) in corners.iter().enumerate().rev() {
            let last = index + 1 == corners.len();
            let stops = if last { stops.clone() } else { Vec::new() };
            self.ahead.push_front(Corner {
                at: *at,
                stops,
                is_detour: true,
            });
        }
        self.behind = from;
    }

    /// Leaves out what is ahead up to the next stop, from a place where the vehicle rests; returns the stops there.
    pub(super) fn skip(&mut self, place: Point) -> Vec<StopId> {
        self.behind = place;
        let mut skipped = Vec::new();
        while skipped.is_empty()
            && let Some(corner) = self.ahead.pop_front()
        {
            skipped = corner.stops;
        }
        match self.ahead.front_mut() {
            Some(next) => next.is_detour = true,
            None => self.has_left_plan = true,
        }
        skipped
    }

    /// Returns whether the piece that is next is driven by no plan: then nothing says who goes first there.
    pub(super) fn is_off_plan(&self) -> bool {
        let is_detour = self.ahead.front().is_some_and(|corner| corner.is_detour);
        is_detour || self.stops().next().is_none()
    }

    /// Forgets everything ahead.
    pub(super) fn clear(&mut self, place: Point) {
        *self = Way {
            behind: place,
            ahead: VecDeque::new(),
            behind_m: self.behind_m,
            has_left_plan: false,
        };
    }

    /// Takes the place where the vehicle is; returns the stops that it has passed by that.
    pub(super) fn pass(&mut self, place: Point) -> Vec<StopId> {
        let mut passed = Vec::new();
        while let Some(next) = self.ahead.front() {
            let piece = Segment::new(self.behind, next.at);
            let off_m = next.at.distance_to(place);
            let beside =
                piece.nearest_share(place) >= 1.0 && off_m <= BESIDE_M && self.ahead.len() > 1;
            if off_m > PASSED_M && !beside {
                break;
            }
            passed.extend(next.stops.iter().copied());
            self.behind_m += piece.length_m();
            self.behind = next.at;
            self.ahead.pop_front();
        }
        passed
    }

    /// Ends the way here: the vehicle rests near enough to the end; returns the stops passed by that.
    pub(super) fn arrive(&mut self) -> Vec<StopId> {
        let passed = self
            .ahead
            .iter()
            .flat_map(|corner| corner.stops.iter().copied())
            .collect();
        let end = self.end();
        self.behind_m += self.length_m();
        self.behind = end;
        self.ahead.clear();
        passed
    }

    /// Returns the corners from the one passed last to the end.
    pub(super) fn points(&self) -> Vec<Point> {
        std::iter::once(self.behind)
            .chain(self.ahead.iter().map(|corner| corner.at))
            .collect()
    }

    /// Returns the straight pieces between the corners, from the one passed last to the end.
    fn pieces(&self) -> impl Iterator<Item = Segment> {
        let mut from = self.behind;
        self.ahead
            .iter()
            .map(move |corner| Segment::new(std::mem::replace(&mut from, corner.at), corner.at))
    }

    /// Returns the odometer at a length along [`Way::points`], metres.
    pub(super) fn odometer_m(&self, along_m: f64) -> f64 {
        self.behind_m + along_m
    }

    /// Returns the length along [`Way::points`] at an odometer value, metres.
    pub(super) fn along_m(&self, odometer_m: f64) -> f64 {
        odometer_m - self.behind_m
    }

    /// Returns the whole length, metres.
    pub(super) fn length_m(&self) -> f64 {
        self.pieces()
            .map(|piece| piece.from.distance_to(piece.to))
            .sum()
    }

    /// Returns the corners from a place on the way to a length along it: a route to command.
    pub(super) fn until(&self, from: Point, here_m: f64, until_m: f64) -> Vec<Point> {
        let mut route = vec![from];
        let mut start_m = 0.0;
        for Segment { from, to } in self.pieces() {
            let length_m = from.distance_to(to);
            let end_m = start_m + length_m;
            if end_m > here_m && start_m < until_m && length_m > 0.0 {
                let share = ((until_m - start_m) / length_m).min(1.0);
                route.push(from.toward(to, share));
            }
            start_m = end_m;
        }
        route
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn way() -> Way {
        let mut way = Way::default();
        way.append(
            [Point::new(1.0, 0.0)],
            Point::new(2.0, 0.0),
            Some(StopId(1)),
        );
        way.append([], Point::new(2.0, 3.0), Some(StopId(2)));
        way
    }

    #[test]
    fn stops_are_passed_in_order_and_the_odometer_grows() {
        let mut way = way();
        assert!(way.pass(Point::new(1.05, 0.0)).is_empty());
        assert_eq!(way.pass(Point::new(2.1, 0.05)), [StopId(1)]);
        assert_eq!(way.odometer_m(0.0), 2.0);
        assert_eq!(way.pass(Point::new(2.0, 2.0)), []);
        assert_eq!(way.arrive(), [StopId(2)]);
        assert_eq!(way.odometer_m(0.0), 5.0);
        assert!(way.is_empty());
    }

    #[test]
    fn a_stop_that_cannot_be_reached_is_done_at_the_next_corner_reached() {
        let mut way = way();
        way.replace(
            Point::new(0.5, 0.0),
            3,
            &[Point::new(0.5, 3.0), Point::new(2.0, 3.0)],
        );
        assert!(way.is_off_plan());
        assert_eq!(way.pass(Point::new(0.5, 2.95)), []);
        assert_eq!(way.pass(Point::new(2.0, 3.0)), [StopId(1), StopId(2)]);
    }

    #[test]
    fn what_is_not_the_plans_own_way_is_off_plan() {
        let mut way = way();
        assert!(!way.is_off_plan());
        way.replace(
            Point::new(0.5, 0.0),
            1,
            &[Point::new(0.5, 1.0), Point::new(1.0, 0.0)],
        );
        assert!(way.is_off_plan(), "on a path that was found");
        way.pass(Point::new(0.5, 1.0));
        assert!(way.is_off_plan());
        way.pass(Point::new(1.0, 0.0));
        assert!(!way.is_off_plan(), "back on the plan's way");
        assert_eq!(way.skip(Point::new(1.5, 0.5)), [StopId(1)]);
        assert!(
            way.is_off_plan(),
            "from where it stands, past what is left out"
        );
        assert_eq!(way.skip(Point::new(1.5, 0.5)), [StopId(2)]);
        way.append(
            [Point::new(4.0, 0.0)],
            Point::new(5.0, 0.0),
            Some(StopId(3)),
        );
        assert!(way.is_off_plan(), "all was left out");
        way.pass(Point::new(4.0, 0.0));
        assert!(!way.is_off_plan());
        way.arrive();
        way.append([], Point::new(5.0, 3.0), None);
        assert!(way.is_off_plan(), "to no stop");
    }

    #[test]
    fn a_route_is_cut_where_the_release_ends() {
        let route = way().until(Point::new(0.5, 0.0), 0.5, 3.5);
        assert_eq!(
            route,
            [(0.5, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 1.5)].map(|(x, y)| Point::new(x, y))
        );
    }
}
