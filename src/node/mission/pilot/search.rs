//! The pilot's search for a path: where to, over what, and what is kept clear of. When to search, and what becomes of
//! the result, is decided by [`super::Pilot`].

use super::{Doing, Pilot, Unknown};
use crate::geom::{Point, Pose, Segment, Track};
use crate::map::CellRect;
use crate::node::OwnState;
use crate::node::vehicle::ReflexObstacle;
use crate::plan::{MAX_GRID_CELLS, Rules, SearchGrid, shortest_route};
use crate::time::Time;

/// A place to go back to is at least this far away, metres.
const RETREAT_M: f64 = 1.0;
/// Paths are searched in a rectangle this much larger than start and goal, metres.
const SEARCH_MARGIN_M: f64 = 6.0;
/// A vehicle too near to something may leave it this far, metres.
const ESCAPE_M: f64 = 1.0;
/// Between body and fence stays this much more than the deviation of the place asks for, metres.
const FENCE_M: f64 = 0.05;
/// Who stands too near to a peer may leave it over places this near, metres.
const LEAVE_M: f64 = 0.6;

/// How paths are searched.
pub const RULES: Rules = Rules {
    diagonal: true,
    cut_corners: false,
    escape_m: ESCAPE_M,
    turning: None,
};

fn is_small(area: &CellRect) -> bool {
    area.width_cells().saturating_mul(area.height_cells()) <= MAX_GRID_CELLS
}

impl Pilot {
    /// Searches a path to the nearest corner ahead that can be reached; the result may be used later.
    pub(super) fn search(&mut self, now: Time, pose: Pose) {
        let mut found = None;
        if self.is_hemmed_in(now, pose) {
            found = self.retreat(self.trail.iter().rev(), now, pose);
        }
        if found.is_none() {
            found = self.detour(now, pose);
        }
        self.is_narrow = false;
        if found.is_none() && self.way.end() == self.settings.home {
            let count = self.way.ahead().count();
            found = self
                .driven_path(now, pose, self.settings.home, &self.peers)
                .map(|points| (count, points));
            self.is_narrow = found.is_some();
        }
        if found.is_none() && self.failures % 3 == 2 {
            found = self.retreat(self.trail.iter(), now, pose);
        }
        self.retreat_m = None;
        self.doing = Doing::Planning {
            ready: now + self.settings.path_time,
            found,
        };
    }

    /// Searches a path to the first corner ahead that can be reached; with it, how many corners it replaces.
    fn detour(&self, now: Time, pose: Pose) -> Option<(usize, Vec<Point>)> {
        let over = |unknown_allowed: bool| {
            self.way.ahead().enumerate().find_map(|(index, corner)| {
                let points = self.path(now, pose, corner.at, unknown_allowed, &self.peers)?;
                Some((index + 1, points))
            })
        };
        match self.unknown {
            Unknown::Free => over(!self.looked),
            Unknown::LastResort if !self.looked => over(false).or_else(|| over(true)),
            Unknown::LastResort | Unknown::Barred => over(false),
        }
    }

    /// Searches a path to the first of the places from where the vehicle came that is some way back: things look
    /// different from there.
    fn retreat<'a>(
        &self,
        mut places: impl Iterator<Item = &'a Point>,
        now: Time,
        pose: Pose,
    ) -> Option<(usize, Vec<Point>)> {
        places.find_map(|place| {
            let far = place.distance_to(pose.at) >= RETREAT_M;
            far.then(|| self.path(now, pose, *place, true, &self.peers))
                .flatten()
                .map(|points| (0, points))
        })
    }

    /// Returns whether what made the reflex halt is so near that one must first back off from it.
    fn is_hemmed_in(&self, now: Time, pose: Pose) -> bool {
        let near_m = 2.0 * self.settings.lattice.cell_m();
        let is_near = |bump: &ReflexObstacle| bump.at.distance_to(pose.at) < bump.keep_m + near_m;
        self.bumps
            .iter()
            .any(|bump| bump.until > now && is_near(bump))
    }

    /// Returns whether a place could be reached, as far as is known; unknown cells count as free.
    pub fn can_reach(&self, now: Time, state: &OwnState, place: Point) -> bool {
        self.path(now, state.pose, place, true, &self.peers)
            .is_some()
    }

    pub(super) fn path(
        &self,
        now: Time,
        pose: Pose,
        goal: Point,
        unknown_allowed: bool,
        peers: &[Vec<Point>],
    ) -> Option<Vec<Point>> {
        let area = self.area(pose.at, goal)?;
        let grid = self.grid(now, pose, Some(goal), area, unknown_allowed, peers)?;
        let points = shortest_route(&grid, pose.at, goal, &RULES).ok()?.points;
        peers
            .iter()
            .all(|claim| self.keeps_clear_of(claim, &points))
            .then_some(points)
    }

    /// Searches a path over known ground and the places where the vehicle has driven, however near to something these
    /// are: it came through there.
    pub(super) fn driven_path(
        &self,
        now: Time,
        pose: Pose,
        goal: Point,
        peers: &[Vec<Point>],
    ) -> Option<Vec<Point>> {
        let mut grid = self.ground(now, pose, Some(goal), false, peers)?;
        grid.open_along(&self.driven);
        let points = shortest_route(&grid, pose.at, goal, &RULES).ok()?.points;
        peers
            .iter()
            .all(|claim| self.keeps_clear_of(claim, &points))
            .then_some(points)
    }

    /// Returns the places where the vehicle has driven, in order.
    pub fn driven(&self) -> &[Point] {
        &self.driven
    }

    /// Returns where the vehicle may be within an area, on its way to a goal; `None` when the area is too large.
    fn grid(
        &self,
        now: Time,
        pose: Pose,
        goal: Option<Point>,
        area: CellRect,
        unknown_allowed: bool,
        peers: &[Vec<Point>],
    ) -> Option<SearchGrid> {
        let view = self.map.view(self.settings.slice, area);
        let mut grid =
            SearchGrid::of_map(&view, area, self.half_width_m(pose), unknown_allowed).ok()?;
        self.close(&mut grid, now, pose, goal, peers);
        Some(grid)
    }

    /// Returns where the vehicle may be in all of the fence, on its way to a goal if it has one, clear of what `peers`
    /// claim; `None` when the fence is too large to search.
    pub fn ground(
        &self,
        now: Time,
        pose: Pose,
        goal: Option<Point>,
        unknown_allowed: bool,
        peers: &[Vec<Point>],
    ) -> Option<SearchGrid> {
        let area = self.fenced(pose.at, goal.unwrap_or(pose.at))?;
        self.grid(now, pose, goal, area, unknown_allowed, peers)
    }

    /// Returns whether a route keeps its distance from a peer, or leads away from it, as the vehicle actor asks.
    fn keeps_clear_of(&self, claim: &[Point], route: &[Point]) -> bool {
        let (Some(claim), Some(route)) = (Track::new(claim.to_vec()), Track::new(route.to_vec()))
        else {
            return true;
        };
        let (nearest_m, here_m) = (
            route.distance_to(&claim),
            claim.distance_to_point(route.start()),
        );
        let leads_away =
            nearest_m >= here_m - 1e-3 && claim.distance_to_point(route.end()) > here_m;
        leads_away || nearest_m >= self.settings.swarm.separation_m
    }

    /// Returns where to search: around start and goal, and for the way home in all of the fence, since what is known may
    /// lead the long way round; `None` when that is too large. (Asked before the view is made: that of a far-off place
    /// would be as large as the way to it.)
    fn area(&self, start: Point, goal: Point) -> Option<CellRect> {
        let lattice = self.settings.lattice;
        let near = CellRect::around(lattice, &[start, goal], SEARCH_MARGIN_M).filter(is_small);
        if goal != self.settings.home {
            return near;
        }
        self.fenced(start, goal).or(near)
    }

    /// Returns the cells of the fence, and of start and goal; `None` when these are too many.
    fn fenced(&self, start: Point, goal: Point) -> Option<CellRect> {
        let fence = self.settings.fence.corners().iter().copied();
        let places: Vec<Point> = fence.chain([start, goal]).collect();
        CellRect::around(self.settings.lattice, &places, 0.0).filter(is_small)
    }

    /// Closes what the map does not know: the fence, peers that stand, and what made the reflex halt. Where the
    /// vehicle stands, or the goal lies, nearer than wished, that much must do.
    fn close(
        &self,
        grid: &mut SearchGrid,
        now: Time,
        pose: Pose,
        goal: Option<Point>,
        peers: &[Vec<Point>],
    ) {
        let cell_m = self.settings.lattice.cell_m();
        let (fence, radius_m) = (&self.settings.fence, self.settings.body.radius_m);
        let edge_m = |at: Point| fence.distance_to_edge(at) - cell_m;
        // A goal may lie near the fence; but nobody comes nearer to it step by step.
        let least_m = radius_m + 3.0 * pose.sd_m + FENCE_M;
        let goal_m = goal.map_or(f64::INFINITY, edge_m);
        let fence_m = self
            .half_width_m(pose)
            .min(edge_m(pose.at).max(least_m))
            .min(goal_m)
            .max(radius_m);
        grid.close_outside(fence, fence_m);
        for claim in peers {
            claim
                .first()
                .iter()
                .for_each(|at| self.keep_from(grid, pose.at, Segment::new(**at, **at)));
            let pieces = claim.windows(2).map(|pair| Segment::new(pair[0], pair[1]));
            pieces.for_each(|piece| self.keep_from(grid, pose.at, piece));
        }
        for bump in self.bumps.iter().filter(|bump| bump.until > now) {
            let keep_m = (bump.keep_m + cell_m).min(bump.at.distance_to(pose.at) - cell_m);
            grid.close_within(Segment::new(bump.at, bump.at), keep_m);
        }
        grid.stand_on(self.settings.lattice.cell_at(pose.at));
    }

    /// Closes what lies too near to a peer's claim. Who stands too near already may leave: through the cells beside it
    /// to which a straight line does not lead any nearer.
    fn keep_from(&self, grid: &mut SearchGrid, from: Point, claim: Segment) {
        let (lattice, separation_m) = (self.settings.lattice, self.settings.swarm.separation_m);
        let keep_m = separation_m + lattice.cell_m();
        let here_m = claim.distance_to_point(from);
        if here_m > keep_m + lattice.cell_m() {
            return grid.close_within(claim, keep_m);
        }
        let start = lattice.cell_at(from);
        let leaves = |place: Point| {
            let leads_m = Segment::new(from, place).distance_to(claim);
            let is_beside = place.distance_to(from) <= LEAVE_M;
            is_beside
                && claim.distance_to_point(place) >= here_m
                && leads_m >= here_m.min(separation_m)
        };
        grid.close_where(|place| {
            claim.distance_to_point(place) <= keep_m
                && lattice.cell_at(place) != start
                && !leaves(place)
        });
    }
}
