//! The search for a path: over what, and what is kept clear of. It is a pure function of the map, what made the reflex
//! halt, the places driven, and peers' claims. When to search, where to, and what becomes of the result is decided by
//! whoever asks.

use std::collections::BTreeSet;
use std::f64::consts::FRAC_1_SQRT_2;

use super::driven_places::back_over;
use super::peer_clearance::PeerClearance;
use crate::geom::{Cell, Lattice, Point, Pose, Segment};
use crate::map::{Bar, CellRect, Merged, Occupancy, View};
use crate::node::VehicleSettings;
use crate::node::mission::home::HOME_M;
use crate::node::mission::pilot::ARRIVED_M;
use crate::node::vehicle::ReflexObstacle;
use crate::plan::{
    Component, Distances, MAX_GRID_CELLS, NodeSpacing, RequiredClearance, Rules, SearchGrid,
    shortest_route,
};

/// Paths are searched in a rectangle this much larger than start and goal, metres.
const SEARCH_MARGIN_M: f64 = 6.0;
/// A vehicle too near to something may leave it this far, metres.
const ESCAPE_M: f64 = 1.0;
/// A rectangle of more cells is not searched from part to part.
const FINE_CELLS_MAX: u64 = 250_000;
/// How paths are searched.
pub(crate) const RULES: Rules = Rules {
    diagonal: true,
    cut_corners: false,
    escape_m: ESCAPE_M,
    turning: None,
};

/// How finely a path is searched.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Resolution {
    /// From cell to cell, with room to spare: fast, and enough in the open.
    Cells,
    /// From half cell to half cell, past what stands in parts of cells: through most doorways that are wide enough.
    Parts,
    /// From part to part: through every doorway that is wide enough, wherever it lies against the cells. Four times as many
    /// nodes; over ground too large for so many, the same as the one before.
    FineParts,
}

impl Resolution {
    /// Returns how far apart nodes lie in a rectangle; `None` = as far as cells.
    fn spacing(self, area: CellRect) -> Option<NodeSpacing> {
        let cells = area.width_cells().saturating_mul(area.height_cells());
        match self {
            Resolution::Cells => None,
            Resolution::FineParts if cells <= FINE_CELLS_MAX => Some(NodeSpacing::Part),
            Resolution::Parts | Resolution::FineParts => Some(NodeSpacing::HalfCell),
        }
    }
}

/// Between places of the track that are farther apart nobody knows how it has come from one to the other, metres.
pub(super) const JUMP_M: f64 = 2.0;
/// Ground of this size is worth to wait for until it can be driven to again, square metres.
const CUT_OFF_M2: f64 = 1.0;

/// How a way is searched, try by try; and whether over places that the vehicle has driven, however near to something these are.
pub(crate) const WAYS: [(Resolution, bool); 4] = [
    (Resolution::Cells, false),
    (Resolution::Parts, false),
    (Resolution::FineParts, false),
    (Resolution::Parts, true),
];

/// Returns what a way keeps that is planned for a vehicle at a pose.
pub(super) fn planned(settings: &VehicleSettings, pose: Pose) -> RequiredClearance {
    let reach_m = settings.reach_m();
    RequiredClearance::planned(
        reach_m,
        reach_m + settings.safety.padding_m,
        2.0 * pose.sd_m,
        settings.lattice.cell_m(),
    )
}

/// Returns how far the middle of a vehicle at a pose keeps from what stands there, metres, on a path from cell to cell.
/// (Cells are judged by their middle, hence half of a cell's diagonal.)
pub(super) fn keep_m(settings: &VehicleSettings, pose: Pose) -> f64 {
    settings.corridor_m(pose.sd_m) + settings.lattice.cell_m() * FRAC_1_SQRT_2
}

/// Returns whether an area is small enough to be searched.
pub(crate) fn is_small(area: &CellRect) -> bool {
    area.width_cells().saturating_mul(area.height_cells()) <= MAX_GRID_CELLS
}

/// Ground, and the ways from where the vehicle is to all places on it that can be reached.
pub(crate) struct ReachedGround {
    pub(crate) grid: SearchGrid,
    pub(crate) ways: Distances,
}

impl ReachedGround {
    /// Returns whether a place can be reached.
    pub(crate) fn is_reached(&self, place: Point) -> bool {
        let nodes = self.ways.lattice();
        self.ways.cost_m(nodes.cell_at(place)).is_some()
    }

    /// Returns whether more than a little of its open ground cannot be reached on it, but can on another one of the same nodes.
    pub(crate) fn is_cut_off_from(&self, all: &OpenGround) -> bool {
        is_cut_off(&self.grid, |node| self.ways.cost_m(node).is_some(), all)
    }
}

/// Ground, and which of it can be reached from where the vehicle is, by whatever way.
pub(crate) struct OpenGround {
    pub(crate) grid: SearchGrid,
    pub(crate) reached: Component,
}

/// Returns whether more than a little of a grid's open ground cannot be reached, but can on another one of the same nodes.
fn is_cut_off(grid: &SearchGrid, is_reached: impl Fn(Cell) -> bool, all: &OpenGround) -> bool {
    let is_beyond =
        |node: &Cell| grid.passable(*node) && !is_reached(*node) && all.reached.contains(*node);
    let beyond = grid.area().cells().filter(is_beyond).count();
    let node_m = grid.lattice().cell_m();
    beyond as f64 * node_m * node_m > CUT_OFF_M2
}

/// Searches paths from where a vehicle is.
pub(crate) struct PathSearch<'a> {
    pub(super) settings: &'a VehicleSettings,
    pub(super) map: &'a Merged,
    /// What made the reflex halt and is believed to be there still.
    pub(super) obstacles: Vec<ReflexObstacle>,
    /// The places where the vehicle has driven.
    pub(super) driven: &'a [Point],
    /// Whether it searches over these places alone.
    pub(super) is_on_track: bool,
    pub(super) pose: Pose,
}

impl PathSearch<'_> {
    /// Returns a search that does not regard what made the reflex halt.
    pub(crate) fn but_for_reflex(&self) -> Self {
        PathSearch {
            obstacles: Vec::new(),
            ..*self
        }
    }

    /// Returns whether something that made the reflex halt is regarded.
    pub(crate) fn regards_reflex(&self) -> bool {
        !self.obstacles.is_empty()
    }

    /// Returns what can be reached over known ground, from part to part; `None` when the fence is too large to search, or the
    /// vehicle cannot set out.
    pub(crate) fn reached_finely(&self, peers: &[Vec<Point>]) -> Option<ReachedGround> {
        let grid = self.ground(None, Resolution::FineParts, false, peers)?;
        let start = grid.lattice().cell_at(self.pose.at);
        let ways = Distances::from_start(&grid, start, &RULES).ok()?;
        Some(ReachedGround { grid, ways })
    }

    /// Returns which ground can be reached from part to part; `None` when the fence is too large to search.
    pub(crate) fn open_finely(&self, peers: &[Vec<Point>]) -> Option<OpenGround> {
        let grid = self.ground(None, Resolution::FineParts, false, peers)?;
        let reached = Component::around(&grid, grid.lattice().cell_at(self.pose.at), &RULES);
        Some(OpenGround { grid, reached })
    }

    /// Returns whether what only the reflex has met cuts the vehicle off from ground where it might be: that is soon forgotten.
    pub(crate) fn is_cut_off(&self, peers: &[Vec<Point>]) -> bool {
        self.regards_reflex()
            && self
                .but_for_reflex()
                .open_finely(peers)
                .is_some_and(|all| self.is_cut_off_from(&all, peers))
    }

    /// Returns whether more than a little of some ground, which can be reached on it, cannot be reached.
    pub(crate) fn is_cut_off_from(&self, all: &OpenGround, peers: &[Vec<Point>]) -> bool {
        let near = self.open_finely(peers);
        let near = near.filter(|near| !near.reached.is_empty());
        near.is_some_and(|near| is_cut_off(&near.grid, |node| near.reached.contains(node), all))
    }

    /// Returns where the search begins.
    pub(crate) fn from(&self) -> Point {
        self.pose.at
    }

    /// Returns how far the middle of the vehicle keeps from what stands there, metres.
    pub(crate) fn keep_m(&self) -> f64 {
        keep_m(self.settings, self.pose)
    }

    /// Returns the lattice of the map.
    pub(crate) fn lattice(&self) -> Lattice {
        self.settings.lattice
    }

    /// Returns how far a planned way keeps from what was heard, metres.
    pub(crate) fn planned_m(&self) -> f64 {
        planned(self.settings, self.pose).most_m()
    }

    /// Returns the map of all of the fence and of what is just beside it; `None` when the fence is too large to search.
    pub(crate) fn fenced_map(&self) -> Option<View<'_>> {
        let area = self.fenced(self.pose.at)?.grown(1);
        Some(self.map.view(self.settings.slice, area))
    }

    /// Returns whether nothing that was heard hides a cell's middle from a place, but for what lies just before it.
    pub(crate) fn sees_close(&self, from: Point, middle: Point) -> bool {
        let (away_m, lattice) = (from.distance_to(middle), self.settings.lattice);
        let clear_m = away_m - 2.0 * lattice.cell_m();
        if clear_m <= 0.0 {
            return true;
        }
        let along = Segment::new(from, from.toward(middle, clear_m / away_m));
        let is_heard = |cell| self.map.occupancy(self.settings.slice, cell) == Occupancy::Occupied;
        !lattice.cells_under(along).any(is_heard)
    }

    /// Returns the places where the vehicle has driven, in order.
    pub(crate) fn driven(&self) -> &[Point] {
        self.driven
    }

    /// Returns whether a place is the vehicle's home.
    pub(crate) fn is_home(&self, place: Point) -> bool {
        place == self.settings.home
    }

    /// Returns a path to a goal, over unknown ground too or not, clear of what peers claim; `None` when there is none.
    pub(crate) fn path(
        &self,
        goal: Point,
        unknown_allowed: bool,
        peers: &[Vec<Point>],
    ) -> Option<Vec<Point>> {
        let area = self.area(goal)?;
        let mut past_all = WAYS.into_iter().filter(|(_, is_narrow)| !is_narrow);
        past_all.find_map(|(resolution, _)| {
            let grid = self.grid(Some(goal), area, resolution, unknown_allowed, peers)?;
            if self.is_cramped(&grid, resolution) {
                return None;
            }
            self.path_over(&grid, goal, peers)
        })
    }

    /// Returns a path over known ground and the places where the vehicle has driven, however near to something these are:
    /// it came through there.
    pub(crate) fn driven_path(&self, goal: Point, peers: &[Vec<Point>]) -> Option<Vec<Point>> {
        let mut grid = self.ground(Some(goal), Resolution::Parts, false, peers)?;
        // Opened last, and only what is too near to something: what is solid, or closed for a peer, stays so.
        grid.open_along(self.driven);
        self.path_over(&grid, self.end_near(&grid, goal), peers)
    }

    /// Returns where a way to a goal ends: there, or where the vehicle has driven beside its home if by now something is
    /// taken for standing too near to that; but not where it would arrive without having come home.
    fn end_near(&self, grid: &SearchGrid, goal: Point) -> Point {
        if !self.is_home(goal) || grid.has_room_at(goal) {
            return goal;
        }
        let nodes = grid.lattice();
        let driven = self.driven.iter().map(|place| nodes.cell_at(*place));
        let middles = driven
            .filter(|node| grid.passable(*node))
            .map(|node| nodes.centre(node));
        let away_m = |middle: Point| (middle.distance_to(goal), middle);
        let nearest = middles.map(away_m).min_by(|a, b| a.0.total_cmp(&b.0));
        let is_home = |place: Point| place.distance_to(goal) <= HOME_M;
        let arrives_elsewhere =
            |end: Point| !is_home(self.pose.at) && self.pose.at.distance_to(end) <= ARRIVED_M;
        nearest
            .map(|(_, middle)| middle)
            .filter(|end| is_home(*end) && !arrives_elsewhere(*end))
            .unwrap_or(goal)
    }

    /// Returns the way back over the vehicle's own track alone, whatever the map shows there by now, to the first place
    /// from which a goal can be reached over known ground and places driven; `None` when the vehicle is at such a place, or
    /// none is near. Where no such way can be begun the place lies `at_least_m` away, and the vehicle may stand at another
    /// one.
    pub(crate) fn back_over_track(
        &self,
        goal: Point,
        peers: &[Vec<Point>],
        at_least_m: Option<f64>,
    ) -> Option<Vec<Point>> {
        let clear = self.ground(Some(goal), Resolution::Parts, false, peers)?;
        let mut driven = clear.clone();
        driven.open_along(self.driven);
        let nodes = clear.lattice();
        let end = nodes.cell_at(self.end_near(&driven, goal));
        let ways = Distances::from_start(&driven, end, &RULES).ok()?;
        let leads_on = |place: Point| ways.cost_m(nodes.cell_at(place)).is_some();
        if at_least_m.is_none() && leads_on(self.pose.at) {
            return None;
        }
        let has_room = |place: Point| {
            let is_far =
                at_least_m.is_none_or(|least_m| place.distance_to(self.pose.at) >= least_m);
            is_far && clear.passable(nodes.cell_at(place)) && leads_on(place)
        };
        let points = self.moved_off_fence(back_over(self.driven, self.pose.at, has_room)?)?;
        self.keeps_clear(&points, nodes, peers).then_some(points)
    }

    /// Returns the way back over the vehicle's own track alone to the first place that is one ground with its home, with room
    /// all the way; `None` where the vehicle is at such a place, or none is near.
    pub(crate) fn back_to_open(&self, peers: &[Vec<Point>]) -> Option<Vec<Point>> {
        let clear = self.ground(None, Resolution::Parts, false, peers)?;
        let nodes = clear.lattice();
        let open = Component::around(&clear, nodes.cell_at(self.settings.home), &RULES);
        let is_open = |place: Point| {
            let node = nodes.cell_at(place);
            clear.passable(node) && open.contains(node)
        };
        if is_open(self.pose.at) {
            return None;
        }
        // Nearer than this it would have arrived as it stands.
        let is_far = |place: Point| place.distance_to(self.pose.at) >= HOME_M + nodes.cell_m();
        let points = back_over(self.driven, self.pose.at, |place| {
            is_far(place) && is_open(place)
        })?;
        let points = self.moved_off_fence(points)?;
        self.keeps_clear(&points, nodes, peers).then_some(points)
    }

    /// Returns where the vehicle may be in all of the fence, on its way to a goal if it has one, clear of what peers claim;
    /// `None` when the fence is too large to search.
    pub(crate) fn ground(
        &self,
        goal: Option<Point>,
        resolution: Resolution,
        unknown_allowed: bool,
        peers: &[Vec<Point>],
    ) -> Option<SearchGrid> {
        let area = self.fenced(goal.unwrap_or(self.pose.at))?;
        self.grid(goal, area, resolution, unknown_allowed, peers)
    }

    /// Returns whether the vehicle stands too near to something for such a search: one from cell to cell knows too little
    /// of what is near it to lead out, and one from part to part is for ways on which all is kept that is required.
    pub(crate) fn is_cramped(&self, grid: &SearchGrid, resolution: Resolution) -> bool {
        let here = grid.lattice().cell_at(self.pose.at);
        resolution != Resolution::Parts && !grid.passable(here)
    }

    /// Returns whether a look along a straight line at a place from near shows another place as well.
    pub(crate) fn covers(&self, from: Point, at: Point, place: Point) -> bool {
        let off = from.angle_to(place) - from.angle_to(at);
        self.settings.look.covers(off) && self.sees_close(from, place)
    }

    /// Returns the confirmed cells of all of the fence that belong to small things, ascending: to no more than `most` cells
    /// side by side.
    pub(crate) fn small_things(&self, most: usize) -> Vec<Cell> {
        let mut left: BTreeSet<Cell> = self.confirmed_cells().into_iter().collect();
        let mut small = Vec::new();
        while let Some(first) = left.pop_first() {
            let mut thing = vec![first];
            let mut next = 0;
            while let Some(cell) = thing.get(next).copied() {
                let beside = CellRect::new(cell, cell).grown(1);
                thing.extend(beside.cells().filter(|cell| left.remove(cell)));
                next += 1;
            }
            if thing.len() <= most {
                small.extend(thing);
            }
        }
        small.sort_unstable();
        small
    }

    /// Returns the cells that bar a place for a planned way, or come within `spare_m` of that, for this reason or a surer one,
    /// the nearest first.
    pub(crate) fn barring(&self, place: Point, from: Bar, spare_m: f64) -> Vec<Cell> {
        let (lattice, clearance) = (self.settings.lattice, planned(self.settings, self.pose));
        let reach_m = clearance.most_m() + spare_m + lattice.cell_m();
        let Some(area) = CellRect::around(lattice, &[place], reach_m) else {
            return Vec::new();
        };
        let view = self.map.view(self.settings.slice, area);
        let nearest_m = |cell: Cell| {
            let barred = view.barred(cell).filter(|barred| barred.bar >= from)?;
            let nearest_m = barred.distance_m(lattice, cell, place);
            (nearest_m < clearance.from_cell_m(barred) + spare_m).then_some((nearest_m, cell))
        };
        let mut found: Vec<(f64, Cell)> = area.cells().filter_map(nearest_m).collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.into_iter().map(|(_, cell)| cell).collect()
    }

    /// Returns the parts of a cell that bar a planned way, and what it keeps from them, metres.
    pub(crate) fn barring_parts(&self, cell: Cell) -> Vec<(Point, f64)> {
        let (lattice, clearance) = (self.settings.lattice, planned(self.settings, self.pose));
        let view = self
            .map
            .view(self.settings.slice, CellRect::new(cell, cell));
        let Some(barred) = view.barred(cell) else {
            return Vec::new();
        };
        let kept_m = clearance.from_cell_m(barred);
        barred
            .places(lattice, cell)
            .map(|part| (part, kept_m))
            .collect()
    }

    /// Returns whether what made the reflex halt is so near to a place that a vehicle there must first back off from it.
    pub(crate) fn hems_in(&self, place: Point) -> bool {
        let near_m = 2.0 * self.settings.lattice.cell_m();
        self.obstacles
            .iter()
            .any(|obstacle| obstacle.at.distance_to(place) < obstacle.keep_m + near_m)
    }

    fn path_over(
        &self,
        grid: &SearchGrid,
        goal: Point,
        peers: &[Vec<Point>],
    ) -> Option<Vec<Point>> {
        let points = shortest_route(grid, self.pose.at, goal, &RULES)
            .ok()?
            .points;
        // Cells are left open for the vehicle to leave a peer that it is too near to; a path must not go along that peer.
        self.keeps_clear(&points, grid.lattice(), peers)
            .then_some(points)
    }

    /// Returns whether a way that was searched over nodes keeps clear of what peers claim.
    fn keeps_clear(&self, way: &[Point], nodes: Lattice, peers: &[Vec<Point>]) -> bool {
        let clearance = self.peer_clearance(nodes);
        peers.iter().all(|claim| clearance.holds_along(way, claim))
    }

    /// Returns whether a straight way to a place keeps clear of what a peer claims, as the vehicle actor asks.
    pub(crate) fn is_clear_of(&self, to: Point, claim: &[Point]) -> bool {
        self.is_way_clear_of(&[self.pose.at, to], claim)
    }

    /// Returns the same of a way with corners.
    pub(crate) fn is_way_clear_of(&self, way: &[Point], claim: &[Point]) -> bool {
        self.peer_clearance(self.settings.lattice)
            .holds_along(way, claim)
    }

    pub(super) fn peer_clearance(&self, lattice: Lattice) -> PeerClearance {
        PeerClearance {
            from: self.pose.at,
            lattice,
            separation_m: self.settings.swarm.separation_m,
            spare_m: lattice.cell_m().min(self.settings.lattice.cell_m() / 4.0),
        }
    }

    /// Returns where to search: around start and goal, and for the way home in all of the fence, since what is known may
    /// lead the long way round; `None` when that is too large. (Asked before the view is made: that of a far-off place
    /// would be as large as the way to it.)
    fn area(&self, goal: Point) -> Option<CellRect> {
        let ends = [self.pose.at, goal];
        let near = CellRect::around(self.settings.lattice, &ends, SEARCH_MARGIN_M).filter(is_small);
        if goal != self.settings.home {
            return near;
        }
        self.fenced(goal).or(near)
    }

    /// Returns the cells of the fence, and of start and goal; `None` when these are too many.
    pub(super) fn fenced(&self, goal: Point) -> Option<CellRect> {
        let fence = self.settings.fence.corners().iter().copied();
        let places: Vec<Point> = fence.chain([self.pose.at, goal]).collect();
        CellRect::around(self.settings.lattice, &places, 0.0).filter(is_small)
    }

    /// Returns where the vehicle may be within an area, on its way to a goal; `None` when the area is too large.
    fn grid(
        &self,
        goal: Option<Point>,
        area: CellRect,
        resolution: Resolution,
        unknown_allowed: bool,
        peers: &[Vec<Point>],
    ) -> Option<SearchGrid> {
        let view = self.map.view(self.settings.slice, area);
        let (grid, keep_m) = match resolution.spacing(area) {
            None => {
                let keep_m = self.keep_m();
                (
                    SearchGrid::of_map(&view, area, keep_m, unknown_allowed),
                    keep_m,
                )
            }
            Some(nodes) => {
                let clearance = planned(self.settings, self.pose);
                let from = match unknown_allowed {
                    true => Bar::Doubtful,
                    false => Bar::Unknown,
                };
                let bars = |_, bar| bar >= from;
                let grid = SearchGrid::of_parts(&view, area, clearance, bars, self.pose.at, nodes);
                (grid, self.settings.corridor_m(self.pose.sd_m))
            }
        };
        let mut grid = grid.ok()?;
        // What the map does not show is closed: fence, peers, and what only the reflex has met.
        self.close_fence(&mut grid, keep_m, goal);
        let clearance = self.peer_clearance(grid.lattice());
        peers
            .iter()
            .for_each(|claim| clearance.close(&mut grid, claim));
        self.close_obstacles(&mut grid);
        if self.is_on_track {
            grid.close_beside(self.driven);
        }
        // Last: whatever was closed, the vehicle stands there and must be able to set out.
        grid.stand_on(grid.lattice().cell_at(self.pose.at));
        Some(grid)
    }

    /// Closes what lies too near to what made the reflex halt; where the vehicle is nearer already, only what is nearer
    /// still.
    fn close_obstacles(&self, grid: &mut SearchGrid) {
        let (cell_m, node_m) = (self.settings.lattice.cell_m(), grid.lattice().cell_m());
        for obstacle in &self.obstacles {
            let away_m = obstacle.at.distance_to(self.pose.at);
            // From cell to cell with room to spare; over finer nodes, as the vehicle itself is going to judge the way.
            let spare_m = if node_m < cell_m { 0.0 } else { cell_m };
            let keep_m = (obstacle.keep_m + spare_m).min(away_m - spare_m);
            grid.close_within(Segment::new(obstacle.at, obstacle.at), keep_m);
        }
    }
}

#[cfg(test)]
mod tests;
