//! From cells to a route that a vehicle drives: the exact ends, and corners pulled straight where the whole strip
//! stays clear.

use super::astar::{NoRoute, Rules, shortest_cells};
use super::grid::Grid;
use crate::geom::{Cell, Point, Segment};

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
    route_along(grid, start, &found.cells, goal)
}

/// Makes a route of a way over cells of this grid: from a point in its first cell to a point in its last one, and
/// straightened.
///
/// # Errors
/// [`NoRoute::GoalBarred`] when the goal's own place in its cell is too near to something, or there are no cells.
pub fn route_along(grid: &Grid, start: Point, cells: &[Cell], goal: Point) -> Result<Route, NoRoute> {
    let lattice = grid.lattice();
    let middles: Vec<Point> = cells.iter().map(|cell| lattice.centre(*cell)).collect();
    let Some(last) = middles.last() else {
        return Err(NoRoute::GoalBarred);
    };
    let cells_length_m = middles.windows(2).map(|pair| pair[0].distance_to(pair[1])).sum();
    let arrival = Segment::new(*last, goal);
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
    Ok(Route { points, length_m, cells_length_m })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Lattice;
    use crate::map::CellRect;
    use proptest::prelude::*;

    const CLEARANCE_M: f64 = 0.45;

    fn grid(solid: impl Fn(Cell) -> bool) -> Grid {
        let area = CellRect::new(Cell::new(-20, -20), Cell::new(19, 19));
        Grid::of_cells(Lattice::new(0.2), area, CLEARANCE_M, solid).unwrap()
    }

    #[test]
    fn a_route_over_open_ground_is_one_straight_line() {
        let (start, goal) = (Point::new(-3.03, -2.2), Point::new(3.1, 1.77));
        let route = shortest_route(&grid(|_| false), start, goal, &Rules::default()).unwrap();
        assert_eq!(route.points, vec![start, goal]);
        assert!((route.length_m - start.distance_to(goal)).abs() < 1e-9);
        let here = shortest_route(&grid(|_| false), start, start, &Rules::default()).unwrap();
        assert_eq!((here.points.first(), here.points.last()), (Some(&start), Some(&start)));
        assert!(here.length_m < 0.3);
    }

    #[test]
    fn a_route_round_a_wall_bends_at_its_end() {
        let grid = grid(|cell| cell.x == 0 && cell.y > -8);
        let (start, goal) = (Point::new(-2.1, 2.1), Point::new(2.3, 2.1));
        let route = shortest_route(&grid, start, goal, &Rules::default()).unwrap();
        assert!((3..=6).contains(&route.points.len()), "{:?}", route.points);
        assert!(route.length_m < route.cells_length_m);
    }

    #[test]
    fn ends_that_are_nowhere_or_barred_are_told_apart() {
        let grid = grid(|cell| cell.x == 0);
        let go = |x0: f64, x1: f64| {
            shortest_route(&grid, Point::new(x0, 0.0), Point::new(x1, 0.0), &Rules::default()).map(|_| ())
        };
        assert_eq!(go(f64::NAN, 1.0), Err(NoRoute::StartOutside));
        assert_eq!(go(1.0, 1e300), Err(NoRoute::GoalOutside));
        assert_eq!(go(0.3, 2.0), Err(NoRoute::StartBarred));
        assert_eq!(go(2.0, 0.3), Err(NoRoute::GoalBarred));
        assert!(matches!(go(2.0, -2.0), Err(NoRoute::Unreachable { searched: 600..800 })));
    }

    #[test]
    fn a_vehicle_too_near_to_a_wall_finds_its_way_out() {
        let grid = grid(|cell| cell.x == 0);
        let rules = Rules { escape_m: 0.5, ..Rules::default() };
        let (start, goal) = (Point::new(0.3, 0.0), Point::new(2.0, 2.0));
        let route = shortest_route(&grid, start, goal, &rules).unwrap();
        assert!(route.points.len() >= 2 && route.points.iter().all(|point| point.x_m >= 0.3 - 1e-9));
        let on_wall = shortest_route(&grid, Point::new(0.1, 0.0), goal, &rules);
        assert_eq!(on_wall, Err(NoRoute::StartBarred));
    }

    #[test]
    fn closed_ground_is_never_crossed() {
        let mut grid = grid(|_| false);
        let leg = Segment::new(Point::new(0.0, -3.9), Point::new(0.0, 2.0));
        grid.close_within(leg, 0.6);
        grid.close_where(|point| point.y_m > 3.0);
        grid.close_within(Segment::new(Point::new(0.0, 1e9), Point::new(0.0, 2e9)), 0.6);
        let route =
            shortest_route(&grid, Point::new(-2.0, 0.0), Point::new(2.0, 0.0), &Rules::default()).unwrap();
        for pair in route.points.windows(2) {
            let part = Segment::new(pair[0], pair[1]);
            assert!(part.distance_to(leg) > 0.6 - 0.15, "{:?}", route.points);
            assert!(pair[1].y_m < 3.2);
        }
    }

    proptest! {
        #[test]
        fn the_whole_route_keeps_its_distance_and_is_no_longer_than_the_cells(
            stones in proptest::collection::vec((-20..20i32, -20..20i32), 0..60),
            ends in (-19..19i32, -19..19i32, -19..19i32, -19..19i32),
        ) {
            let lattice = Lattice::new(0.2);
            let grid = grid(|cell| stones.contains(&(cell.x, cell.y)));
            let (start, goal) =
                (lattice.centre(Cell::new(ends.0, ends.1)), lattice.centre(Cell::new(ends.2, ends.3)));
            if let Ok(route) = shortest_route(&grid, start, goal, &Rules::default()) {
                prop_assert_eq!((route.points[0], *route.points.last().unwrap()), (start, goal));
                prop_assert!(route.length_m <= route.cells_length_m + 1e-9);
                let half_width_m = (CLEARANCE_M * CLEARANCE_M - 0.02).sqrt();
                for pair in route.points.windows(2) {
                    let part = Segment::new(pair[0], pair[1]);
                    for (x, y) in &stones {
                        let stone = lattice.centre(Cell::new(*x, *y));
                        prop_assert!(part.distance_to_point(stone) >= half_width_m - 1e-6);
                    }
                }
            }
        }
    }
}
