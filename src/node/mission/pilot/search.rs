//! The pilot's search for a path: where to, over what, and what is kept clear of. When to search, and what becomes of
//! the result, is decided by [`super::Pilot`].

use tomoswarm_proto::State;

use super::{Doing, Pilot, Unknown};
use crate::geom::{Point, Pose, Segment};
use crate::map::CellRect;
use crate::node::vehicle::Bump;
use crate::plan::{Grid, MAX_GRID_CELLS, Rules, shortest_route};
use crate::time::Time;

/// A place to go back to is at least this far away, metres.
const RETREAT_M: f64 = 1.0;
/// Paths are searched in a rectangle this much larger than start and goal, metres.
const SEARCH_MARGIN_M: f64 = 6.0;
/// A vehicle too near to something may leave it this far, metres.
const ESCAPE_M: f64 = 1.0;

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
        if found.is_none() && self.failures % 3 == 2 {
            found = self.retreat(self.trail.iter(), now, pose);
        }
        self.retreat_m = None;
        self.doing = Doing::Planning { ready: now + self.settings.path_time, found };
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
            far.then(|| self.path(now, pose, *place, true, &self.peers)).flatten().map(|points| (0, points))
        })
    }

    /// Tells whether what made the reflex halt is so near that one must first back off from it.
    fn is_hemmed_in(&self, now: Time, pose: Pose) -> bool {
        let near_m = 2.0 * self.settings.lattice.cell_m();
        let is_near = |bump: &Bump| bump.at.distance_to(pose.at) < bump.keep_m + near_m;
        self.bumps.iter().any(|bump| bump.until > now && is_near(bump))
    }

    /// Tells whether a place could be reached, as far as is known; unknown cells count as free.
    pub fn can_reach(&self, now: Time, state: &State, place: Point) -> bool {
        self.path(now, Pose::from(state.pose), place, true, &self.peers).is_some()
    }

    pub(super) fn path(
        &self,
        now: Time,
        pose: Pose,
        goal: Point,
        unknown_allowed: bool,
        peers: &[Vec<Point>],
    ) -> Option<Vec<Point>> {
        let rules = Rules { escape_m: ESCAPE_M, ..Rules::default() };
        let area = self.area(pose.at, goal)?;
        let view = self.map.view(self.settings.slice, area);
        let mut grid = Grid::of_map(&view, area, self.half_width_m(pose), unknown_allowed).ok()?;
        self.close(&mut grid, now, pose, goal, peers);
        shortest_route(&grid, pose.at, goal, &rules).ok().map(|route| route.points)
    }

    /// Gives where to search: around start and goal, and for the way home in all of the fence, since what is known may
    /// lead the long way round; `None` when that is too large. (Asked before the view is made: that of a far-off place
    /// would be as large as the way to it.)
    fn area(&self, start: Point, goal: Point) -> Option<CellRect> {
        let lattice = self.settings.lattice;
        let is_small =
            |area: &CellRect| area.width_cells().saturating_mul(area.height_cells()) <= MAX_GRID_CELLS;
        let near = CellRect::around(lattice, &[start, goal], SEARCH_MARGIN_M).filter(is_small);
        if goal != self.settings.home {
            return near;
        }
        let fence = self.settings.fence.corners().iter().copied();
        let places: Vec<Point> = fence.chain([start, goal]).collect();
        CellRect::around(lattice, &places, 0.0).filter(is_small).or(near)
    }

    /// Closes what the map does not know: the fence, peers that stand, and what made the reflex halt. Where the
    /// vehicle stands, or the goal lies, nearer than wished, that much must do.
    fn close(&self, grid: &mut Grid, now: Time, pose: Pose, goal: Point, peers: &[Vec<Point>]) {
        let cell_m = self.settings.lattice.cell_m();
        let (fence, radius_m) = (&self.settings.fence, self.settings.body.radius_m);
        let edge_m = fence.distance_to_edge(pose.at).min(fence.distance_to_edge(goal)) - cell_m;
        let fence_m = self.half_width_m(pose).min(edge_m).max(radius_m);
        grid.close_outside(fence, fence_m);
        let mut keep = |claim: Segment, keep_m: f64| {
            let keep_m = (keep_m + cell_m).min(claim.distance_to_point(pose.at) - cell_m);
            grid.close_within(claim, keep_m);
        };
        for claim in peers {
            let separation_m = self.settings.safety.separation_m;
            claim.first().iter().for_each(|at| keep(Segment::new(**at, **at), separation_m));
            claim.windows(2).for_each(|pair| keep(Segment::new(pair[0], pair[1]), separation_m));
        }
        for bump in self.bumps.iter().filter(|bump| bump.until > now) {
            keep(Segment::new(bump.at, bump.at), bump.keep_m);
        }
    }
}
