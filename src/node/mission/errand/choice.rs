//! Where to go and look next, for search and exploration: the nearest place from which something unknown beside known
//! free ground can be seen. (Frontier-based exploration, Yamauchi 1997; the frontiers near a peer are left to it.)
//!
//! Only ground known to be free is driven over; what stays unknown after some looks, each from nearer by, is left.

use super::{Aim, End, Errand, Scene};
use crate::geom::{Angle, Cell, Lattice, Point, Segment};
use crate::map::{CellRect, Occupancy, View};
use crate::node::Task;
use crate::node::mission::pilot::{Pilot, RULES};
use crate::plan::{Distances, Frontiers, Grid};

/// The vehicle goes this much nearer to what it looks at than it must keep from it, metres; when it cannot, it looks
/// from as near as it can.
const NEARER_M: f64 = 0.5;
/// A frontier shorter than this is not worth a look, metres.
const FRONTIER_M: f64 = 0.6;
/// What is this near to an object is searched first, metres.
const NEAR_OBJECT_M: f64 = 1.5;
/// By so much farther ways a search goes to what is near to objects, metres.
const OBJECT_BONUS_M: f64 = 8.0;
/// What a peer is going to see is looked at only when nothing else is left, metres.
const PEER_PENALTY_M: f64 = 1e4;
/// A metre more between the vehicle and what it looks at counts as so many metres of way.
const AWAY_FACTOR: f64 = 2.0;
/// Ways that differ by less count as equal, metres.
const COST_STEP_M: f64 = 0.1;
/// A peer that is nearer to something than this share of the own way there gets it.
const PEER_SHARE: f64 = 0.9;
/// What is farther than this from where a peer is going is not left to it, metres.
const PEER_M: f64 = 12.0;
/// A peer that has not moved for so long is not going anywhere.
const PEER_GOES: std::time::Duration = std::time::Duration::from_secs(30);
/// Side of the squares by which frontiers are found, metres.
const BUCKET_M: f64 = 1.0;

/// A frontier cell that is worth a look.
#[derive(Clone, Copy)]
struct Wanted {
    cell: Cell,
    at: Point,
    /// It is chosen although it is so much farther away than another one, metres; less than nothing = as if nearer.
    penalty_m: f64,
}

/// Frontiers by place.
struct Buckets {
    low: Point,
    columns: usize,
    rows: usize,
    of: Vec<Vec<Wanted>>,
}

/// Where to look from, and at what.
struct Sight {
    from: Cell,
    at: Cell,
}

impl Errand {
    /// Chooses the next look, or ends.
    pub(super) fn seek(&mut self, scene: &mut Scene<'_>) {
        let Some(mut grid) = self.ground(scene, None, false, &scene.claims()) else {
            return self.finish(scene, End::GaveUp(0));
        };
        self.keep_frontiers(scene.pilot);
        let wanted = self.rated(scene, grid.area());
        for is_narrow in [false, true] {
            if is_narrow {
                grid.open_along(scene.pilot.driven());
            }
            if let Some((sight, reached)) = self.choose_sight(scene, &grid, &wanted) {
                return self.go_and_look(scene, &grid, &reached, is_narrow, sight);
            }
        }
        if self.is_barred_by_peers(scene) { self.wait(scene) } else { self.finish(scene, End::Done) }
    }

    /// Gives where to look from and at what, and the ways to all places.
    fn choose_sight(&self, scene: &Scene<'_>, grid: &Grid, wanted: &[Wanted]) -> Option<(Sight, Distances)> {
        let (pose, lattice) = (scene.pose(), self.settings.lattice);
        let start = lattice.cell_at(pose.at);
        let reached = Distances::from_start(grid, start, &RULES).ok()?;
        let buckets = Buckets::new(lattice, grid.area(), wanted);
        let view = scene.pilot.map().view(self.settings.slice, grid.area());
        let (near_m, far_m) = self.reaches_m(scene.pilot.keep_m(pose));
        let least_m = wanted.iter().map(|one| one.penalty_m).fold(f64::INFINITY, f64::min);
        let (mut best, mut best_m) = (None, f64::INFINITY);
        for (cost_m, cell) in by_cost(grid, &reached) {
            if cost_m + least_m >= best_m {
                break;
            }
            let from = if cell == start { pose.at } else { lattice.centre(cell) };
            for one in buckets.near(from, far_m) {
                let away_m = one.at.distance_to(from);
                let score_m = cost_m + one.penalty_m + AWAY_FACTOR * (away_m - near_m).max(0.0);
                let is_better = away_m <= far_m && score_m < best_m && self.looks.is_new(one.cell, from);
                if is_better && sees(&view, lattice, from, one.at) {
                    (best, best_m) = (Some(Sight { from: cell, at: one.cell }), score_m);
                }
            }
        }
        best.map(|sight| (sight, reached))
    }

    fn go_and_look(
        &mut self,
        scene: &mut Scene<'_>,
        grid: &Grid,
        reached: &Distances,
        is_narrow: bool,
        sight: Sight,
    ) {
        let (from, lattice) = (scene.pose().at, self.settings.lattice);
        self.waits = 0;
        if sight.from == lattice.cell_at(from) {
            return self.look_at(scene, sight.at);
        }
        let to = lattice.centre(sight.from);
        match reached.route_to(grid, from, to) {
            Some(route) => self.drive(scene, &route.points[1..], is_narrow, Aim::Sight(sight.at)),
            None => {
                self.looks.note(&[sight.at], to);
                self.think(scene.now);
            }
        }
    }

    /// Tells whether without peers there would be something to look at.
    fn is_barred_by_peers(&self, scene: &Scene<'_>) -> bool {
        if scene.peers.iter().next().is_none() {
            return false;
        }
        let Some(mut grid) = self.ground(scene, None, false, &[]) else { return false };
        grid.open_along(scene.pilot.driven());
        self.choose_sight(scene, &grid, &self.wanted()).is_some()
    }

    /// Gives from how far away to look, best and at most, metres: nothing is looked at from where it is not surely seen.
    fn reaches_m(&self, keep_m: f64) -> (f64, f64) {
        let far_m = self.settings.look.sure_range_m;
        ((keep_m + NEARER_M).min(far_m), far_m)
    }

    /// Gives all frontier cells that are worth another look.
    fn wanted(&self) -> Vec<Wanted> {
        let lattice = self.settings.lattice;
        let least = (FRONTIER_M / lattice.cell_m()).round().max(1.0) as usize;
        let clusters = self.frontiers.iter().flat_map(Frontiers::clusters);
        let cells = clusters.filter(|cluster| cluster.size() >= least).flat_map(|cluster| cluster.cells);
        cells
            .filter(|cell| !self.looks.is_spent(*cell))
            .map(|cell| Wanted { cell, at: lattice.centre(cell), penalty_m: 0.0 })
            .collect()
    }

    /// Brings the frontiers up to date.
    fn keep_frontiers(&mut self, pilot: &Pilot) {
        let (slice, lattice) = (self.settings.slice, self.settings.lattice);
        let map = pilot.map();
        if let Some(frontiers) = &mut self.frontiers {
            for address in std::mem::take(&mut self.changed) {
                frontiers.update(map, CellRect::of_tile(address));
            }
            return;
        }
        let Some(area) = CellRect::around(lattice, self.settings.fence.corners(), 0.0) else { return };
        let inside = |at: Point| self.settings.fence.contains(at);
        let Ok(mut frontiers) = Frontiers::new(lattice, slice, area, inside) else { return };
        frontiers.update(map, area);
        self.frontiers = Some(frontiers);
    }

    /// Tells whether a cell is still a frontier.
    pub(super) fn is_frontier(&mut self, pilot: &Pilot, cell: Cell) -> bool {
        self.keep_frontiers(pilot);
        self.frontiers.as_ref().is_some_and(|frontiers| frontiers.contains(cell))
    }

    /// Gives what is worth a look, and what is rather looked at: by a search what is near to objects, by an explorer what
    /// no peer is going to see anyway.
    fn rated(&self, scene: &Scene<'_>, area: CellRect) -> Vec<Wanted> {
        let view = scene.pilot.map().view(self.settings.slice, area);
        let mut wanted = self.wanted();
        for one in &mut wanted {
            one.penalty_m = match self.settings.task {
                Task::Search if self.is_near_object(&view, one.cell) => -OBJECT_BONUS_M,
                Task::Explore if self.is_a_peers(scene, one.at) => PEER_PENALTY_M,
                _ => 0.0,
            };
        }
        wanted
    }

    fn is_near_object(&self, view: &View<'_>, cell: Cell) -> bool {
        let reach = (NEAR_OBJECT_M / self.settings.lattice.cell_m()).ceil() as i32;
        let mut near = (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)));
        near.any(|(dx, dy)| view.occupancy(Cell::new(cell.x + dx, cell.y + dy)) == Occupancy::Occupied)
    }

    /// Tells whether a peer is going to see a place anyway.
    fn is_a_peers(&self, scene: &Scene<'_>, at: Point) -> bool {
        let own_m = scene.pose().at.distance_to(at);
        let goes = |moved_at| scene.now.since(moved_at) <= PEER_GOES;
        let ends = scene.peers.iter().filter(|(_, peer)| goes(peer.moved_at) && !peer.is_silent(scene.now));
        let mut ends = ends.filter_map(|(_, peer)| peer.claim.last());
        ends.any(|end| end.distance_to(at) < (PEER_SHARE * own_m).min(PEER_M))
    }

    /// Notes a look from a place along a heading at everything unknown that it covered, and at one cell surely.
    pub(super) fn note_look(&mut self, pilot: &Pilot, from: Point, heading: Angle, at: Option<Cell>) {
        let look = &self.settings.look;
        let widest_rad = look.beams.iter().map(|beam| beam.radians().abs()).fold(0.0, f64::max);
        let half_rad = widest_rad + 0.5 * look.half_angle.radians();
        let reach_m = look.sure_range_m;
        let lattice = self.settings.lattice;
        let Some(area) = CellRect::around(lattice, &[from], reach_m) else { return };
        self.keep_frontiers(pilot);
        let view = pilot.map().view(self.settings.slice, area);
        let is_covered = |wanted: &Wanted| {
            let off = from.angle_to(wanted.at) - heading;
            wanted.at.distance_to(from) <= reach_m
                && off.radians().abs() <= half_rad
                && sees(&view, lattice, from, wanted.at)
        };
        let covered = self.wanted().into_iter().filter(is_covered).map(|one| one.cell);
        let cells: Vec<Cell> = covered.chain(at).collect();
        self.looks.note(&cells, from);
    }
}

/// Gives what can be reached with its cost in metres, the nearest first (in steps of [`COST_STEP_M`]).
fn by_cost(grid: &Grid, reached: &Distances) -> impl Iterator<Item = (f64, Cell)> {
    let mut steps: Vec<Vec<Cell>> = Vec::new();
    for cell in grid.area().cells() {
        let Some(cost_m) = reached.cost_m(cell) else { continue };
        let step = (cost_m / COST_STEP_M) as usize;
        if step >= steps.len() {
            steps.resize_with(step + 1, Vec::new);
        }
        steps[step].push(cell);
    }
    let step_m = |(step, cells): (usize, Vec<Cell>)| {
        cells.into_iter().map(move |cell| (step as f64 * COST_STEP_M, cell))
    };
    steps.into_iter().enumerate().flat_map(step_m)
}

/// Tells whether only free ground lies between a place and a free cell.
fn sees(view: &View<'_>, lattice: Lattice, from: Point, to: Point) -> bool {
    lattice.cells_under(Segment::new(from, to)).all(|cell| view.occupancy(cell) == Occupancy::Free)
}

impl Buckets {
    fn new(lattice: Lattice, area: CellRect, wanted: &[Wanted]) -> Buckets {
        let (low, high) = (lattice.centre(area.low), lattice.centre(area.high));
        let count = |from_m: f64, to_m: f64| ((to_m - from_m) / BUCKET_M).floor() as usize + 1;
        let (columns, rows) = (count(low.x_m, high.x_m), count(low.y_m, high.y_m));
        let mut buckets = Buckets { low, columns, rows, of: vec![Vec::new(); columns * rows] };
        for one in wanted {
            let (column, row) = buckets.place(one.at);
            let (column, row) = (column.clamp(0, columns as i64 - 1), row.clamp(0, rows as i64 - 1));
            buckets.of[row as usize * columns + column as usize].push(*one);
        }
        buckets
    }

    fn place(&self, at: Point) -> (i64, i64) {
        let index = |from_m: f64, to_m: f64| ((to_m - from_m) / BUCKET_M).floor() as i64;
        (index(self.low.x_m, at.x_m), index(self.low.y_m, at.y_m))
    }

    /// Gives what lies in the squares around a place.
    fn near(&self, at: Point, reach_m: f64) -> impl Iterator<Item = &Wanted> {
        let (column, row) = self.place(at);
        let reach = (reach_m / BUCKET_M).ceil() as i64;
        let columns = (column - reach).max(0)..=(column + reach).min(self.columns as i64 - 1);
        let rows = (row - reach).max(0)..=(row + reach).min(self.rows as i64 - 1);
        rows.flat_map(move |row| columns.clone().map(move |column| (row, column)))
            .flat_map(|(row, column)| &self.of[row as usize * self.columns + column as usize])
    }
}
