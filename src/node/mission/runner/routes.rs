//! Where the vehicle may go: courses around what is seen and what peers claim. What is unknown counts as free until it was
//! looked at; the pilot looks before it drives.

use super::{RunnerContext, StepRunner};
use crate::geom::{Point, Segment};
use crate::map::{CellRect, Occupancy};
use crate::node::mission::kind::DriveRoute;
use crate::node::mission::pilot::RULES;
use crate::plan::{NoRoute, SearchGrid, shortest_route};

impl StepRunner {
    /// Returns a course to a place, clear of peers; unknown ground may be crossed or not.
    pub(super) fn course(
        &self,
        scene: &RunnerContext<'_>,
        goal: Point,
        unknown_allowed: bool,
    ) -> Result<DriveRoute, NoRoute> {
        self.course_clear_of(scene, goal, unknown_allowed, &scene.surroundings().claims())
    }

    /// Returns whether without peers a course would lead to a place.
    pub(super) fn is_open_without_peers(&self, scene: &RunnerContext<'_>, place: Point) -> bool {
        self.course_clear_of(scene, place, true, &[]).is_ok()
    }

    fn course_clear_of(
        &self,
        scene: &RunnerContext<'_>,
        goal: Point,
        unknown_allowed: bool,
        peers: &[Vec<Point>],
    ) -> Result<DriveRoute, NoRoute> {
        let mut grid = self
            .ground(scene, Some(goal), unknown_allowed, peers)
            .ok_or(NoRoute::GoalOutside)?;
        let from = scene.pose().at;
        let course = |grid: &SearchGrid, is_narrow: bool| {
            let route = shortest_route(grid, from, goal, &RULES)?;
            Ok(DriveRoute {
                corners: route.points[1..].to_vec(),
                is_narrow,
            })
        };
        course(&grid, false).or_else(|_: NoRoute| {
            grid.open_along(scene.pilot.driven());
            course(&grid, true)
        })
    }

    /// Returns where the vehicle may be, clear of what peers claim and of what was looked at in vain.
    pub(super) fn ground(
        &self,
        scene: &RunnerContext<'_>,
        goal: Option<Point>,
        unknown_allowed: bool,
        peers: &[Vec<Point>],
    ) -> Option<SearchGrid> {
        let pose = scene.pose();
        let mut grid = scene
            .pilot
            .ground(scene.now, pose, goal, unknown_allowed, peers)?;
        self.close_barred(&mut grid, scene);
        grid.stand_on(self.settings.lattice.cell_at(pose.at));
        Some(grid)
    }

    /// Closes what the pilot did not pass, but not where the vehicle has driven: that is its way back.
    fn close_barred(&self, grid: &mut SearchGrid, scene: &RunnerContext<'_>) {
        if self.barred.is_empty() {
            return;
        }
        let (lattice, keep_m) = (self.settings.lattice, scene.pilot.keep_m(scene.pose()));
        let track = scene
            .pilot
            .driven()
            .windows(2)
            .map(|pair| Segment::new(pair[0], pair[1]));
        let mut driven: Vec<(i32, i32)> = track
            .flat_map(|piece| lattice.cells_under(piece))
            .map(|cell| (cell.y, cell.x))
            .collect();
        driven.sort_unstable();
        let is_driven = |place: Point| {
            let cell = lattice.cell_at(place);
            driven.binary_search(&(cell.y, cell.x)).is_ok()
        };
        let is_near = |place: Point| self.barred.iter().any(|at| at.distance_to(place) <= keep_m);
        grid.close_where(|place| is_near(place) && !is_driven(place));
    }

    /// What the pilot does not pass is taken for barred: something stands there, or it was looked at and is still unknown.
    /// Returns whether that is news; a peer that makes no room is none.
    pub(super) fn note_barred(&mut self, scene: &RunnerContext<'_>, at: Point) -> bool {
        let cell = self.settings.lattice.cell_at(at);
        let view = scene
            .pilot
            .map()
            .view(self.settings.slice, CellRect::new(cell, cell));
        let is_new = view.occupancy(cell) != Occupancy::Free && !self.barred.contains(&at);
        if is_new {
            self.barred.push(at);
        }
        is_new
    }
}

/// Returns how many cells were searched in vain.
pub(super) fn searched(reason: NoRoute) -> usize {
    match reason {
        NoRoute::Unreachable { searched } => searched,
        NoRoute::TooLargeToTurn { .. }
        | NoRoute::StartOutside
        | NoRoute::GoalOutside
        | NoRoute::StartBarred
        | NoRoute::GoalBarred => 0,
    }
}
