//! One search, many goals: the least cost from one cell to every other, and the way there.
//!
//! Who chooses among goals (frontiers, vantage points, ways home) asks here once instead of searching for each.
//! It is a picture of the grid it was made of: what changes later is not seen.

use super::SearchGrid;
use super::astar::{Flood, NoRoute, flood};
use super::smooth::{Route, route_along};
use super::steps::Rules;
use crate::geom::{Cell, Lattice, Point};
use crate::map::CellRect;

/// Least costs from one start to all cells of a grid.
#[derive(Clone, Debug)]
pub struct Distances {
    lattice: Lattice,
    area: CellRect,
    flood: Flood,
}

impl Distances {
    /// Searches everything that can be reached from a start.
    ///
    /// # Errors
    /// [`NoRoute::StartOutside`] and [`NoRoute::StartBarred`].
    #[inline]
    pub fn from_start(grid: &SearchGrid, start: Cell, rules: &Rules) -> Result<Distances, NoRoute> {
        Distances::within(grid, start, rules, f64::INFINITY)
    }

    /// Searches what can be reached from a start at a cost of at most `most_m`, metres: of what is dearer nothing is known
    /// then.
    ///
    /// # Errors
    /// [`NoRoute::StartOutside`] and [`NoRoute::StartBarred`].
    pub fn within(
        grid: &SearchGrid,
        start: Cell,
        rules: &Rules,
        most_m: f64,
    ) -> Result<Distances, NoRoute> {
        let lattice = grid.lattice();
        Ok(Distances {
            lattice,
            area: grid.area(),
            flood: flood(grid, start, rules, most_m / lattice.cell_m())?,
        })
    }

    /// Searches on, up to a cost of `most_m`, metres: then it is what [`Distances::within`] that cost gives.
    pub fn search_to(&mut self, most_m: f64) {
        self.flood.go_on(most_m / self.lattice.cell_m());
    }

    /// Returns whether all that can be reached was searched.
    #[inline]
    pub fn is_whole(&self) -> bool {
        self.flood.is_whole()
    }

    /// Returns the lattice of the grid that was searched.
    #[inline]
    pub fn lattice(&self) -> Lattice {
        self.lattice
    }

    /// Returns the least cost of a way to a cell, metres (length, and more where [`Rules`] make a step dearer);
    /// `None` where no way leads: that is a proof when all was searched. Ways here are those that [`super::shortest_cells`]
    /// finds.
    #[inline]
    pub fn cost_m(&self, cell: Cell) -> Option<f64> {
        let cost_cells = self
            .area
            .contains(cell)
            .then(|| self.flood.cost_cells(cell))
            .flatten()?;
        Some(cost_cells * self.lattice.cell_m())
    }

    /// Returns the cells of a rectangle to which ways are known, row by row, each with the least cost of a way, metres.
    pub fn costs_m(&self, area: CellRect) -> impl Iterator<Item = (Cell, f64)> + '_ {
        let cell_m = self.lattice.cell_m();
        let area = area.overlap(self.area);
        let rows = area.into_iter().flat_map(|area| {
            (area.low.y..=area.high.y).map(move |y| (Cell::new(area.low.x, y), area.width_cells()))
        });
        rows.flat_map(move |(first, width)| {
            let costs = self.flood.row_cells(first, width as usize);
            (first.x..).zip(costs).filter_map(move |(x, cost_cells)| {
                Some((Cell::new(x, first.y), cost_cells? * cell_m))
            })
        })
    }

    /// Returns a way of that cost, from the start to the cell, both included.
    #[inline]
    pub fn cells_to(&self, goal: Cell) -> Option<Vec<Cell>> {
        self.area
            .contains(goal)
            .then(|| self.flood.cells_to(goal))
            .flatten()
    }

    /// Returns the straightened route to a point; `start` must lie in the start's cell and `grid` be the one that was
    /// searched. `None` where no way leads, or the goal's own place in its cell is too near to something.
    #[inline]
    pub fn route_to(&self, grid: &SearchGrid, start: Point, goal: Point) -> Option<Route> {
        if !start.is_finite() || !goal.is_finite() {
            return None;
        }
        let cells = self.cells_to(self.lattice.cell_at(goal))?;
        route_along(grid, start, &cells, goal).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::shortest_cells;
    use proptest::prelude::*;

    const SIDE: i32 = 20;

    fn grid(stones: &[(i32, i32)], clearance_m: f64) -> SearchGrid {
        let area = CellRect::new(Cell::new(-3, -5), Cell::new(SIDE - 4, SIDE - 6));
        SearchGrid::of_cells(Lattice::new(0.2), area, clearance_m, |cell| {
            stones.contains(&(cell.x, cell.y))
        })
        .unwrap()
    }

    proptest! {
        #[test]
        fn every_cost_is_that_of_a_single_search(
            stones in proptest::collection::vec((-3..SIDE - 3, -5..SIDE - 5), 0..120),
            diagonal in any::<bool>(), escape_m in 0.0..0.6f64, clearance_m in 0.0..0.5f64,
            from in (-3..SIDE - 3, -5..SIDE - 5),
        ) {
            let grid = grid(&stones, clearance_m);
            let rules = Rules { diagonal, escape_m, ..Rules::default() };
            let start = Cell::new(from.0, from.1);
            let Ok(distances) = Distances::from_start(&grid, start, &rules) else {
                prop_assert_eq!(shortest_cells(&grid, start, start, &rules).is_err(), true);
                return Ok(());
            };
            for (x, y) in (-3..SIDE - 3).flat_map(|x| (-5..SIDE - 5).map(move |y| (x, y))) {
                let goal = Cell::new(x, y);
                match shortest_cells(&grid, start, goal, &rules) {
                    Ok(found) => {
                        let cells = distances.cells_to(goal).unwrap();
                        prop_assert_eq!((cells[0], cells[cells.len() - 1]), (start, goal));
                        let cost_m = distances.cost_m(goal).unwrap();
                        if grid.passable(start) {
                            prop_assert!((cost_m - found.length_cells * 0.2).abs() < 1e-7);
                        }
                    }
                    Err(NoRoute::Unreachable { .. }) => prop_assert_eq!(distances.cost_m(goal), None),
                    Err(_) => prop_assert!(grid.passable(start) <= distances.cost_m(goal).is_none()),
                }
            }
        }
    }

    proptest! {
        #[test]
        fn what_is_searched_up_to_a_cost_is_as_if_all_were_searched(
            stones in proptest::collection::vec((-3..SIDE - 3, -5..SIDE - 5), 0..120), most_m in 0.0..5.0f64,
            first_m in 0.0..5.0f64,
        ) {
            let (grid, rules) = (grid(&stones, 0.3), Rules { escape_m: 0.4, ..Rules::default() });
            let Ok(all) = Distances::from_start(&grid, Cell::new(0, 0), &rules) else {
                return Ok(());
            };
            let near = Distances::within(&grid, Cell::new(0, 0), &rules, most_m).unwrap();
            let mut in_steps = Distances::within(&grid, Cell::new(0, 0), &rules, first_m).unwrap();
            in_steps.search_to(most_m);
            prop_assert!(in_steps.is_whole() >= near.is_whole());
            let cells = || grid.area().cells();
            prop_assert_eq!(near.is_whole(), cells().all(|cell| near.cost_m(cell) == all.cost_m(cell)));
            for cell in cells() {
                let within = all.cost_m(cell).filter(|cost_m| near.is_whole() || *cost_m <= most_m);
                prop_assert_eq!(near.cost_m(cell), within);
                if near.cost_m(cell).is_some() {
                    prop_assert_eq!(in_steps.cost_m(cell), within);
                    prop_assert_eq!(in_steps.cells_to(cell), near.cells_to(cell));
                }
                if within.is_some() {
                    prop_assert_eq!(near.cells_to(cell), all.cells_to(cell));
                }
            }
        }
    }

    #[test]
    fn one_search_gives_routes_to_many_places() {
        let wall: Vec<(i32, i32)> = (-5..10).map(|y| (5, y)).collect();
        let grid = grid(&wall, 0.3);
        let lattice = grid.lattice();
        let start = lattice.centre(Cell::new(0, 0));
        let distances = Distances::from_start(&grid, Cell::new(0, 0), &Rules::default()).unwrap();
        let near = distances
            .route_to(&grid, start, lattice.centre(Cell::new(-2, 5)))
            .unwrap();
        assert_eq!(near.points.len(), 2);
        let round = distances
            .route_to(&grid, start, lattice.centre(Cell::new(10, 0)))
            .unwrap();
        assert!(round.points.len() > 2 && round.length_m < round.cells_length_m);
        assert!(
            distances
                .route_to(&grid, start, lattice.centre(Cell::new(5, 0)))
                .is_none()
        );
        assert!(
            distances
                .route_to(&grid, start, Point::new(1e9, f64::NAN))
                .is_none()
        );
        assert_eq!(distances.cost_m(Cell::new(i32::MAX, i32::MIN)), None);
    }
}
