//! Visiting places on paths around what is seen. What is unknown counts as free until it was looked at; the pilot looks
//! before it drives. No way to a place means: everything that can be reached was searched.

use super::{Aim, End, Errand, Scene, WAIT};
use crate::geom::{Point, Segment};
use crate::map::{CellRect, Occupancy};
use crate::node::mission::Remark;
use crate::node::mission::pilot::RULES;
use crate::plan::{Grid, NoRoute, shortest_route};

impl Errand {
    /// Sets out to the next place, or ends.
    pub(super) fn visit_next(&mut self, scene: &mut Scene<'_>) {
        let Some(place) = self.places.front().copied() else {
            let end = match (self.given_up, self.no_way) {
                (0, 0) => End::Done,
                (0, places) => End::NoWay(places),
                (places, _) => End::GaveUp(places),
            };
            return self.finish(scene, end);
        };
        if self.is_stuck() {
            self.given_up += 1;
            return self.skip_place(scene, place);
        }
        match self.route(scene, place, true) {
            Ok((corners, is_narrow)) => {
                self.waits = 0;
                self.drive(scene, &corners, is_narrow, Aim::Place(place));
            }
            Err(_) if self.is_open_without_peers(scene, place) => self.wait(scene),
            Err(NoRoute::StartBarred) => self.is_hemmed_in(scene),
            Err(reason) => {
                self.no_way += 1;
                scene.remark(Remark::NoWay(place, searched(reason)));
                self.skip_place(scene, place);
            }
        }
    }

    /// Something stands too near to where the vehicle is: looks again, later.
    fn is_hemmed_in(&mut self, scene: &Scene<'_>) {
        self.blocked = (scene.pose().at, self.blocked.1 + 1);
        self.choose_at(scene.now + WAIT);
    }

    fn skip_place(&mut self, scene: &mut Scene<'_>, place: Point) {
        self.places.pop_front();
        self.barred.clear();
        self.blocked.1 = 0;
        scene.remark(Remark::Passed(place));
        self.think(scene.now);
    }

    fn is_open_without_peers(&self, scene: &Scene<'_>, place: Point) -> bool {
        self.route_clear_of(scene, place, true, &[]).is_ok()
    }

    /// Gives the corners of a route to a place, clear of what peers claim, and whether it leads over places that are open
    /// only since the vehicle has driven there.
    pub(super) fn route_clear_of(
        &self,
        scene: &Scene<'_>,
        goal: Point,
        unknown_allowed: bool,
        peers: &[Vec<Point>],
    ) -> Result<(Vec<Point>, bool), NoRoute> {
        let mut grid = self.ground(scene, Some(goal), unknown_allowed, peers).ok_or(NoRoute::GoalOutside)?;
        let from = scene.pose().at;
        let corners = |route: crate::plan::Route| route.points[1..].to_vec();
        shortest_route(&grid, from, goal, &RULES).map(|route| (corners(route), false)).or_else(|_| {
            grid.open_along(scene.pilot.driven());
            shortest_route(&grid, from, goal, &RULES).map(|route| (corners(route), true))
        })
    }

    /// Gives where the vehicle may be, clear of what peers claim and of what was looked at in vain.
    pub(super) fn ground(
        &self,
        scene: &Scene<'_>,
        goal: Option<Point>,
        unknown_allowed: bool,
        peers: &[Vec<Point>],
    ) -> Option<Grid> {
        let pose = scene.pose();
        let mut grid = scene.pilot.ground(scene.now, pose, goal, unknown_allowed, peers)?;
        self.close_barred(&mut grid, scene);
        grid.stand_on(self.settings.lattice.cell_at(pose.at));
        Some(grid)
    }

    /// Closes what the pilot did not pass, but not where the vehicle has driven: that is its way back.
    fn close_barred(&self, grid: &mut Grid, scene: &Scene<'_>) {
        if self.barred.is_empty() {
            return;
        }
        let (lattice, keep_m) = (self.settings.lattice, scene.pilot.keep_m(scene.pose()));
        let track = scene.pilot.driven().windows(2).map(|pair| Segment::new(pair[0], pair[1]));
        let mut driven: Vec<(i32, i32)> =
            track.flat_map(|piece| lattice.cells_under(piece)).map(|cell| (cell.y, cell.x)).collect();
        driven.sort_unstable();
        let is_driven = |place: Point| {
            let cell = lattice.cell_at(place);
            driven.binary_search(&(cell.y, cell.x)).is_ok()
        };
        let is_near = |place: Point| self.barred.iter().any(|at| at.distance_to(place) <= keep_m);
        grid.close_where(|place| is_near(place) && !is_driven(place));
    }

    /// What the pilot does not pass is taken for barred: something stands there, or it was looked at and is still unknown.
    /// Tells whether that is news; a peer that makes no room is none.
    pub(super) fn note_barred(&mut self, scene: &Scene<'_>, at: Point) -> bool {
        let cell = self.settings.lattice.cell_at(at);
        let view = scene.pilot.map().view(self.settings.slice, CellRect::new(cell, cell));
        let is_new = view.occupancy(cell) != Occupancy::Free && !self.barred.contains(&at);
        if is_new {
            self.barred.push(at);
        }
        is_new
    }
}

/// Gives how many cells were searched in vain.
fn searched(reason: NoRoute) -> usize {
    match reason {
        NoRoute::Unreachable { searched } => searched,
        NoRoute::TooLargeToTurn { .. }
        | NoRoute::StartOutside
        | NoRoute::GoalOutside
        | NoRoute::StartBarred
        | NoRoute::GoalBarred => 0,
    }
}
