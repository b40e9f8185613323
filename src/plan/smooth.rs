//! From cells to a route that a vehicle drives: the exact ends, and corners pulled straight where the whole strip
//! stays clear.

use super::astar::{NoRoute, Rules, shortest_cells};
use super::grid::Grid;
use crate::geom::{Point, Segment};

/// A route over the plane.
#[derive(Clone, PartialEq, Debug)]
pub struct Route {
    /// Corners from start to goal, both included exactly as asked for.
    pub points: Vec<Point>,
    /// Length, metres.
    pub length_m: f64,
    /// Length of the way over cells before it was straightened, metres, between the middles of the end cells.
    pub cells_length_m: f64,
}

/// Finds a route between two points: the shortest way over cells, then straightened. Not the shortest of all routes
/// over the plane, but never longer than the way over cells.
///
/// # Errors
/// [`NoRoute`]; `GoalBarred` also when the goal's own place in its cell is too near to something.
pub fn shortest_route(grid: &Grid, start: Point, goal: Point, rules: &Rules) -> Result<Route, NoRoute> {
    if !start.is_finite() {
        return Err(NoRoute::StartOutside);
    }
    if !goal.is_finite() {
        return Err(NoRoute::GoalOutside);
    }
    let lattice = grid.lattice();
    let found = shortest_cells(grid, lattice.cell_at(start), lattice.cell_at(goal), rules)?;
    let middles: Vec<Point> = found.cells.iter().map(|cell| lattice.centre(*cell)).collect();
    let arrival = Segment::new(middles[middles.len() - 1], goal);
    if !grid.sweeps_clear(arrival) {
        return Err(NoRoute::GoalBarred);
    }
    let mut points = Vec::with_capacity(middles.len() + 2);
    points.push(start);
    points.extend(middles);
    points.push(goal);
    points.dedup();
    let points = pulled_straight(grid, &points);
    let length_m = points.windows(2).map(|pair| pair[0].distance_to(pair[1])).sum();
    Ok(Route { points, length_m, cells_length_m: found.length_cells * lattice.cell_m() })
}

/// Leaves out every corner that can be passed in a straight line from the last corner kept.
fn pulled_straight(grid: &Grid, points: &[Point]) -> Vec<Point> {
    let mut kept = vec![points[0]];
    let mut at = 0;
    while at + 1 < points.len() {
        let clear = |to: usize| grid.sweeps_clear(Segment::new(points[at], points[to]));
        let mut next = at + 1;
        while next + 1 < points.len() && clear(next + 1) {
            next += 1;
        }
        kept.push(points[next]);
        at = next;
    }
    kept
}
