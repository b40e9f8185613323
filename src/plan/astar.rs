//! The shortest way over a grid: A* with the octile distance (Hart, Nilsson and Raphael 1968).
//!
//! Costs are whole numbers (2³² = one cell), so that sums are exact, ties are real ties, and the result is the same
//! on every machine. The heuristic is consistent, so a cell is expanded once and the cost is the least.
//! Turning costs nothing here.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use thiserror::Error;

use super::Grid;
use crate::geom::Cell;
use crate::map::CellRect;

/// Cost of a step to one of the four nearest neighbours.
pub(super) const STRAIGHT: u64 = 1 << 32;
/// Cost of a diagonal step: √2 · 2³², rounded.
const DIAGONAL: u64 = 6_074_001_000;
/// In cells too near to something, where only leaving is allowed, a step costs this many times as much.
const ESCAPE_FACTOR: u64 = 4;
pub(super) const UNSEEN: u64 = u64::MAX;
const NO_STEP: u8 = 8;
/// The eight steps: first the straight ones, then the diagonals.
const STEPS: [(i32, i32); 8] = [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)];

/// How one may drive over a grid.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Rules {
    /// Whether diagonal steps are allowed.
    pub diagonal: bool,
    /// Whether a diagonal step may pass a barred cell at its side.
    pub cut_corners: bool,
    /// A start too near to something may be left through cells that are too near as well, up to this far from it,
    /// metres; 0 = refused.
    pub escape_m: f64,
}

impl Default for Rules {
    fn default() -> Rules {
        Rules { diagonal: true, cut_corners: false, escape_m: 0.0 }
    }
}

/// Why there is no route.
#[derive(Clone, Copy, PartialEq, Debug, Error)]
pub enum NoRoute {
    /// The start lies outside the searched rectangle.
    #[error("the start lies outside the searched area")]
    StartOutside,
    /// The goal lies outside the searched rectangle.
    #[error("the goal lies outside the searched area")]
    GoalOutside,
    /// The vehicle cannot be at the start, or may not leave it.
    #[error("the start is barred")]
    StartBarred,
    /// The vehicle cannot be at the goal.
    #[error("the goal is barred")]
    GoalBarred,
    /// Everything that can be reached was searched, and the goal is not part of it.
    #[error("no way leads to the goal: all {searched} cells that can be reached were searched")]
    Unreachable {
        /// How many cells were searched.
        searched: usize,
    },
}

/// A shortest way over cells.
#[derive(Clone, PartialEq, Debug)]
pub struct Found {
    /// All cells from start to goal, both included.
    pub cells: Vec<Cell>,
    /// Length, in sides of a cell (steps of 1 and √2).
    pub length_cells: f64,
    /// How many cells were expanded.
    pub expanded: usize,
}

/// An entry of the queue: least estimate first, then the one farthest on its way, then the lowest cell.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Entry {
    estimate: u64,
    cost: Reverse<u64>,
    index: usize,
}

/// Finds a shortest way between two cells. Of several the same one is always found.
///
/// # Errors
/// [`NoRoute`]; `Unreachable` is a proof, not a surrender.
pub fn shortest_cells(grid: &Grid, start: Cell, goal: Cell, rules: &Rules) -> Result<Found, NoRoute> {
    let start_index = grid.index(start).ok_or(NoRoute::StartOutside)?;
    let goal_index = grid.index(goal).ok_or(NoRoute::GoalOutside)?;
    let escape = escape_from(grid, start, start_index, rules)?;
    if !grid.open(goal_index) {
        return Err(NoRoute::GoalBarred);
    }
    let mut search = Search::new(grid, rules, escape);
    if search.run(start_index, Some(goal)) {
        return Ok(search.found(goal_index));
    }
    Err(NoRoute::Unreachable { searched: search.expanded })
}

/// Least costs from one cell to all others, and the steps that led there.
#[derive(Clone, Debug)]
pub(super) struct Flood {
    /// Least cost of each cell; [`UNSEEN`] where none leads.
    pub(super) costs: Vec<u64>,
    /// The step that led to each cell, as an index of [`STEPS`]; [`NO_STEP`] for the start.
    pub(super) came_by: Vec<u8>,
    /// How many cells were reached.
    pub(super) reached: usize,
}

/// Finds the least costs from one cell to all others (Dijkstra 1959).
pub(super) fn flood(grid: &Grid, start: Cell, rules: &Rules) -> Result<Flood, NoRoute> {
    let start_index = grid.index(start).ok_or(NoRoute::StartOutside)?;
    let escape = escape_from(grid, start, start_index, rules)?;
    let mut search = Search::new(grid, rules, escape);
    search.run(start_index, None);
    Ok(Flood { costs: search.costs, came_by: search.came_by, reached: search.expanded })
}

/// Gives the escape that a start too near to something needs; refuses one that is barred.
fn escape_from(grid: &Grid, start: Cell, index: usize, rules: &Rules) -> Result<Option<Escape>, NoRoute> {
    let escaping = !grid.open(index);
    if escaping && !(rules.escape_m > 0.0 && grid.only_near(index)) {
        return Err(NoRoute::StartBarred);
    }
    Ok(escaping.then(|| Escape { from: start, reach_cells: rules.escape_m / grid.lattice().cell_m() }))
}

/// The cells around a start through which one may leave it, although they are too near to something.
#[derive(Clone, Copy)]
struct Escape {
    from: Cell,
    reach_cells: f64,
}

struct Search<'a> {
    grid: &'a Grid,
    rules: &'a Rules,
    escape: Option<Escape>,
    /// Least known cost of each cell.
    costs: Vec<u64>,
    /// The step that led to each cell, as an index of `STEPS`.
    came_by: Vec<u8>,
    queue: BinaryHeap<Reverse<Entry>>,
    /// How many cells were expanded.
    expanded: usize,
}

impl<'a> Search<'a> {
    fn new(grid: &'a Grid, rules: &'a Rules, escape: Option<Escape>) -> Search<'a> {
        let (width, height) = grid.size();
        Search {
            grid,
            rules,
            escape,
            costs: vec![UNSEEN; width * height],
            came_by: vec![NO_STEP; width * height],
            queue: BinaryHeap::new(),
            expanded: 0,
        }
    }

    /// Searches until the goal is expanded, or all that can be reached; tells whether the goal was.
    fn run(&mut self, start: usize, goal: Option<Cell>) -> bool {
        self.costs[start] = 0;
        self.queue.push(Reverse(Entry { estimate: 0, cost: Reverse(0), index: start }));
        while let Some(Reverse(entry)) = self.queue.pop() {
            if entry.cost.0 > self.costs[entry.index] {
                continue;
            }
            if Some(self.grid.cell(entry.index)) == goal {
                return true;
            }
            self.expanded += 1;
            self.expand(entry.index, entry.cost.0, goal);
        }
        false
    }

    fn expand(&mut self, index: usize, cost: u64, goal: Option<Cell>) {
        let cell = self.grid.cell(index);
        let beside = |step: usize| {
            let (dx, dy) = STEPS[step];
            self.grid
                .index(Cell::new(cell.x.saturating_add(dx), cell.y.saturating_add(dy)))
                .filter(|to| self.enterable(*to))
        };
        let straight = [beside(0), beside(1), beside(2), beside(3)];
        for (step, to) in straight.into_iter().enumerate() {
            self.reach(to, step, cost, STRAIGHT, goal);
        }
        if !self.rules.diagonal {
            return;
        }
        for step in 4..8 {
            // The diagonal after straight step k lies between k and k + 1.
            let sides_open = straight[step - 4].is_some() && straight[(step - 3) % 4].is_some();
            if self.rules.cut_corners || sides_open {
                let (dx, dy) = STEPS[step];
                let to = self
                    .grid
                    .index(Cell::new(cell.x.saturating_add(dx), cell.y.saturating_add(dy)))
                    .filter(|to| self.enterable(*to));
                self.reach(to, step, cost, DIAGONAL, goal);
            }
        }
    }

    #[inline]
    fn reach(&mut self, to: Option<usize>, step: usize, cost: u64, step_cost: u64, goal: Option<Cell>) {
        let Some(to) = to else {
            return;
        };
        let dear = self.escape.is_some() && !self.grid.open(to);
        let new = cost + step_cost * if dear { ESCAPE_FACTOR } else { 1 };
        if new < self.costs[to] {
            self.costs[to] = new;
            self.came_by[to] = step as u8;
            let estimate = new + goal.map_or(0, |goal| self.remaining(self.grid.cell(to), goal));
            self.queue.push(Reverse(Entry { estimate, cost: Reverse(new), index: to }));
        }
    }

    #[inline]
    fn enterable(&self, index: usize) -> bool {
        self.grid.open(index)
            || self
                .escape
                .is_some_and(|escape| self.grid.only_near(index) && escape.reaches(self.grid.cell(index)))
    }

    /// Gives the least cost that any way from a cell to the goal can have.
    #[inline]
    fn remaining(&self, from: Cell, goal: Cell) -> u64 {
        let (dx, dy) = (u64::from(from.x.abs_diff(goal.x)), u64::from(from.y.abs_diff(goal.y)));
        if self.rules.diagonal {
            STRAIGHT * dx.abs_diff(dy) + DIAGONAL * dx.min(dy)
        } else {
            STRAIGHT * (dx + dy)
        }
    }

    fn found(&self, goal: usize) -> Found {
        let (cells, diagonals) = walk_back(self.grid.area(), &self.came_by, goal);
        let straights = cells.len() - 1 - diagonals;
        let length_cells = straights as f64 + diagonals as f64 * std::f64::consts::SQRT_2;
        Found { cells, length_cells, expanded: self.expanded }
    }
}

/// Gives the way that led to a cell, from its start on, and how many of its steps are diagonal.
pub(super) fn walk_back(area: CellRect, came_by: &[u8], goal: usize) -> (Vec<Cell>, usize) {
    let width = area.width_cells() as usize;
    let cell_of =
        |index: usize| Cell::new(area.low.x + (index % width) as i32, area.low.y + (index / width) as i32);
    let (mut cells, mut diagonals, mut index) = (vec![cell_of(goal)], 0, goal);
    while came_by[index] != NO_STEP {
        let step = usize::from(came_by[index]);
        diagonals += usize::from(step >= 4);
        let (dx, dy) = STEPS[step];
        index = (index as i64 - i64::from(dy) * width as i64 - i64::from(dx)) as usize;
        cells.push(cell_of(index));
    }
    cells.reverse();
    (cells, diagonals)
}

impl Escape {
    fn reaches(self, cell: Cell) -> bool {
        let (dx, dy) = (f64::from(cell.x - self.from.x), f64::from(cell.y - self.from.y));
        dx * dx + dy * dy <= self.reach_cells * self.reach_cells
    }
}

#[cfg(test)]
mod tests;
