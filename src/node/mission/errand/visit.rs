//! Visiting places on paths around what is seen. What is unknown counts as free until it was looked at; the pilot looks
//! before it drives. No way to a place means: everything that can be reached was searched.

use super::{Aim, End, Errand, Scene};
use crate::geom::{Point, Segment};
use crate::map::{CellRect, Occupancy};
use crate::node::mission::Remark;
use crate::plan::{NoRoute, shortest_route};

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
            Ok(corners) => {
                self.waits = 0;
                self.drive(scene, &corners, Aim::Place(place));
            }
            Err(_) if self.is_open_without_peers(scene, place) => self.wait(scene),
            Err(reason) => {
                self.no_way += 1;
                scene.remark(Remark::NoWay(place, searched(reason)));
                self.skip_place(scene, place);
            }
        }
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

    /// Gives the corners of a route to a place, clear of what peers claim.
    pub(super) fn route_clear_of(
        &self,
        scene: &Scene<'_>,
        goal: Point,
        unknown_allowed: bool,
        peers: &[Vec<Point>],
    ) -> Result<Vec<Point>, NoRoute> {
        let pose = scene.pose();
        let ground = scene.pilot.ground(scene.now, pose, goal, unknown_allowed, peers);
        let mut grid = ground.ok_or(NoRoute::GoalOutside)?;
        for at in &self.barred {
            let keep_m =
                scene.pilot.keep_m(pose).min(at.distance_to(pose.at) - self.settings.lattice.cell_m());
            grid.close_within(Segment::new(*at, *at), keep_m);
        }
        let route = shortest_route(&grid, pose.at, goal, &self.rules())?;
        Ok(route.points[1..].to_vec())
    }

    /// What was looked at on the way and is still unknown is taken for barred.
    pub(super) fn note_barred(&mut self, scene: &Scene<'_>, at: Point) {
        let cell = self.settings.lattice.cell_at(at);
        let view = scene.pilot.map().view(self.settings.slice, CellRect::new(cell, cell));
        if view.occupancy(cell) == Occupancy::Unknown {
            self.barred.push(at);
        }
    }
}

/// Gives how many cells were searched in vain.
fn searched(reason: NoRoute) -> usize {
    match reason {
        NoRoute::Unreachable { searched } => searched,
        NoRoute::StartOutside | NoRoute::GoalOutside | NoRoute::StartBarred | NoRoute::GoalBarred => 0,
    }
}
