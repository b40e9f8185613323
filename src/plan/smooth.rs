//! From cells to a route that a vehicle drives: the exact ends, and corners pulled straight where the whole strip
//! stays clear.

use super::astar::{NoRoute, shortest_cells};
use super::grid::SearchGrid;
use super::steps::Rules;
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
pub fn shortest_route(
    grid: &SearchGrid,
    start: Point,
    goal: Point,
    rules: &Rules,
) -> Result<Route, NoRoute> {
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
pub fn route_along(
    grid: &SearchGrid,
    start: Point,
    cells: &[Cell],
    goal: Point,
) -> Result<Route, NoRoute> {
    let lattice = grid.lattice();
    let middles: Vec<Point> = cells.iter().map(|cell| lattice.centre(*cell)).collect();
    let Some(last) = middles.last() else {
        return Err(NoRoute::GoalBarred);
    };
    let cells_length_m = middles
        .windows(2)
        .map(|pair| pair[0].distance_to(pair[1]))
        .sum();
    let arrival = Segment::new(*last, goal);
    // The middle of the last cell has room if the cell has.
    if arrival.length_m() > 0.0 && !grid.sweeps_clear(arrival) {
        return Err(NoRoute::GoalBarred);
    }
    let mut points = Vec::with_capacity(middles.len() + 2);
    points.push(start);
    // Who stands too near to something leaves at once: the middle of its cell may be nearer still.
    let is_cramped = !grid.passable(lattice.cell_at(start)) && middles.len() > 1;
    points.extend(&middles[usize::from(is_cramped)..]);
    points.push(goal);
    points.dedup();
    let points = pulled_straight(grid, &points);
    let length_m = points
        .windows(2)
        .map(|pair| pair[0].distance_to(pair[1]))
        .sum();
    Ok(Route {
        points,
        length_m,
        cells_length_m,
    })
}

/// Leaves out every corner that can be passed in a straight line from the last corner kept. Where some cells are dearer
/// than others a line may lead through none that is dearer than all those it replaces.
fn pulled_straight(grid: &SearchGrid, points: &[Point]) -> Vec<Point> {
    let level_at = |point: Point| grid.level(grid.lattice().cell_at(point));
    let mut kept = vec![points[0]];
    let mut at = 0;
    while at + 1 < points.len() {
        let mut next = at + 1;
        let mut level = level_at(points[at]).max(level_at(points[next]));
        while next + 1 < points.len() {
            level = level.max(level_at(points[next + 1]));
            let along = Segment::new(points[at], points[next + 1]);
            if !grid.sweeps_clear(along) || grid.highest_level(along) > level {
                break;
            }
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
    use crate::map::{CellRect, Merged};
    use crate::plan::Clearance;
    use proptest::prelude::*;
    use std::collections::BTreeSet;
    use std::sync::Arc;
    use tomoswarm_proto::{Boot, LayerId, TILE_CELLS, TileAddress, TileReport, VehicleId};

    const CLEARANCE_M: f64 = 0.45;

    /// A map of one tile in which everything is free but the stones.
    fn map_of(stones: &BTreeSet<(i32, i32)>) -> Merged {
        let mut cells = [-17; TILE_CELLS];
        stones
            .iter()
            .for_each(|(x, y)| cells[(y * 32 + x) as usize] = 17);
        let mut map = Merged::new(Lattice::new(0.2), None);
        let layer = LayerId {
            vehicle: VehicleId(1),
            boot: Boot(1),
        };
        let address = TileAddress {
            slice: 0,
            x: 0,
            y: 0,
        };
        map.join(&TileReport {
            layer,
            address,
            revision: 1,
            cells: Arc::new(cells),
        })
        .unwrap();
        map
    }

    fn grid(solid: impl Fn(Cell) -> bool) -> SearchGrid {
        let area = CellRect::new(Cell::new(-20, -20), Cell::new(19, 19));
        SearchGrid::of_cells(Lattice::new(0.2), area, CLEARANCE_M, solid).unwrap()
    }

    #[test]
    fn a_route_over_open_ground_is_one_straight_line() {
        let (start, goal) = (Point::new(-3.03, -2.2), Point::new(3.1, 1.77));
        let route = shortest_route(&grid(|_| false), start, goal, &Rules::default()).unwrap();
        assert_eq!(route.points, vec![start, goal]);
        assert!((route.length_m - start.distance_to(goal)).abs() < 1e-9);
        let here = shortest_route(&grid(|_| false), start, start, &Rules::default()).unwrap();
        assert_eq!(
            (here.points.first(), here.points.last()),
            (Some(&start), Some(&start))
        );
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
            shortest_route(
                &grid,
                Point::new(x0, 0.0),
                Point::new(x1, 0.0),
                &Rules::default(),
            )
            .map(|_| ())
        };
        assert_eq!(go(f64::NAN, 1.0), Err(NoRoute::StartOutside));
        assert_eq!(go(1.0, 1e300), Err(NoRoute::GoalOutside));
        assert_eq!(go(0.3, 2.0), Err(NoRoute::StartBarred));
        assert_eq!(go(2.0, 0.3), Err(NoRoute::GoalBarred));
        assert!(matches!(
            go(2.0, -2.0),
            Err(NoRoute::Unreachable { searched: 600..800 })
        ));
    }

    #[test]
    fn a_vehicle_too_near_to_a_wall_finds_its_way_out() {
        let grid = grid(|cell| cell.x == 0);
        let rules = Rules {
            escape_m: 0.5,
            ..Rules::default()
        };
        let (start, goal) = (Point::new(0.3, 0.0), Point::new(2.0, 2.0));
        let route = shortest_route(&grid, start, goal, &rules).unwrap();
        assert!(
            route.points.len() >= 2 && route.points.iter().all(|point| point.x_m >= 0.3 - 1e-9)
        );
        let on_wall = shortest_route(&grid, Point::new(0.1, 0.0), goal, &rules);
        assert_eq!(on_wall, Err(NoRoute::StartBarred));
    }

    #[test]
    fn closed_ground_is_never_crossed() {
        let mut grid = grid(|_| false);
        let leg = Segment::new(Point::new(0.0, -3.9), Point::new(0.0, 2.0));
        grid.close_within(leg, 0.6);
        grid.close_where(|point| point.y_m > 3.0);
        grid.close_within(
            Segment::new(Point::new(0.0, 1e9), Point::new(0.0, 2e9)),
            0.6,
        );
        let route = shortest_route(
            &grid,
            Point::new(-2.0, 0.0),
            Point::new(2.0, 0.0),
            &Rules::default(),
        )
        .unwrap();
        for pair in route.points.windows(2) {
            let part = Segment::new(pair[0], pair[1]);
            assert!(part.distance_to(leg) > 0.6 - 0.15, "{:?}", route.points);
            assert!(pair[1].y_m < 3.2);
        }
    }

    proptest! {
        #[test]
        fn a_route_leads_through_no_closed_cell_and_none_dearer_than_its_cells(
            stones in proptest::collection::btree_set((0..32i32, 0..32i32), 0..25),
            closed in proptest::collection::btree_set((0..32i32, 0..32i32), 0..60),
            wished_m in proptest::option::of(0.5..1.6f64),
            from in (0..32i32, 0..32i32), to in (0..32i32, 0..32i32),
        ) {
            let lattice = Lattice::new(0.2);
            let area = CellRect::new(Cell::new(0, 0), Cell::new(31, 31));
            let mut grid = SearchGrid::of_cells(lattice, area, 0.2, |cell| stones.contains(&(cell.x, cell.y))).unwrap();
            let is_closed = |cell: Cell| closed.contains(&(cell.x, cell.y));
            grid.close_where(|place| is_closed(lattice.cell_at(place)));
            if let Some(wished_m) = wished_m {
                let mut clearance = Clearance::new(lattice, 0, area, 1.6, false).unwrap();
                clearance.update(&map_of(&stones), area);
                grid.prefer_clearance(&clearance, wished_m, 2.0);
            }
            let near_m = |place: Point| {
                let stones = stones.iter().map(|(x, y)| lattice.centre(Cell::new(*x, *y)));
                stones.map(|stone| stone.distance_to(place)).fold(f64::INFINITY, f64::min)
            };
            let (start, goal) = (Cell::new(from.0, from.1), Cell::new(to.0, to.1));
            let rules = Rules::default();
            let (from, to) = (lattice.centre(start), lattice.centre(goal));
            if let Ok(route) = shortest_route(&grid, from, to, &rules) {
                let cells = shortest_cells(&grid, start, goal, &rules).unwrap().cells;
                let nearest_m = cells.iter().map(|cell| near_m(lattice.centre(*cell))).fold(f64::INFINITY, f64::min);
                prop_assert!(route.length_m <= route.cells_length_m + 1e-9);
                for pair in route.points.windows(2) {
                    for share in 1..200 {
                        let place = pair[0] + (pair[1] - pair[0]) * (f64::from(share) / 200.0);
                        let cell = lattice.cell_at(place);
                        // A corner of four cells belongs to none of them alone.
                        if place.distance_to(lattice.centre(cell)) > 0.2 * 0.5_f64.sqrt() - 1e-9 {
                            continue;
                        }
                        prop_assert!(!is_closed(cell) && !stones.contains(&(cell.x, cell.y)));
                        // A level is an eighth of the price, which falls by two over the wished distance.
                        let wished_m = wished_m.unwrap_or(0.0);
                        let kept_m = nearest_m.min(wished_m) - wished_m / 16.0 - 1e-9;
                        prop_assert!(wished_m == 0.0 || near_m(lattice.centre(cell)) >= kept_m);
                    }
                }
            }
        }

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
