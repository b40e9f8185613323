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

/// Cost of a step to one of the four nearest neighbours.
const STRAIGHT: u64 = 1 << 32;
/// Cost of a diagonal step: √2 · 2³², rounded.
const DIAGONAL: u64 = 6_074_001_000;
/// In cells too near to something, where only leaving is allowed, a step costs this many times as much.
const ESCAPE_FACTOR: u64 = 4;
const UNSEEN: u64 = u64::MAX;
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
    let escaping = !grid.open(start_index);
    if escaping && !(rules.escape_m > 0.0 && grid.only_near(start_index)) {
        return Err(NoRoute::StartBarred);
    }
    if !grid.open(goal_index) {
        return Err(NoRoute::GoalBarred);
    }
    let escape =
        escaping.then(|| Escape { from: start, reach_cells: rules.escape_m / grid.lattice().cell_m() });
    Search::new(grid, rules, escape).run(start_index, goal)
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
        }
    }

    fn run(mut self, start: usize, goal: Cell) -> Result<Found, NoRoute> {
        self.costs[start] = 0;
        self.queue.push(Reverse(Entry { estimate: 0, cost: Reverse(0), index: start }));
        let mut expanded = 0;
        while let Some(Reverse(entry)) = self.queue.pop() {
            if entry.cost.0 > self.costs[entry.index] {
                continue;
            }
            if self.grid.cell(entry.index) == goal {
                return Ok(self.found(entry.index, expanded));
            }
            expanded += 1;
            self.expand(entry.index, entry.cost.0, goal);
        }
        Err(NoRoute::Unreachable { searched: expanded })
    }

    fn expand(&mut self, index: usize, cost: u64, goal: Cell) {
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
    fn reach(&mut self, to: Option<usize>, step: usize, cost: u64, step_cost: u64, goal: Cell) {
        let Some(to) = to else {
            return;
        };
        let dear = self.escape.is_some() && !self.grid.open(to);
        let new = cost + step_cost * if dear { ESCAPE_FACTOR } else { 1 };
        if new < self.costs[to] {
            self.costs[to] = new;
            self.came_by[to] = step as u8;
            let estimate = new + self.remaining(self.grid.cell(to), goal);
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

    fn found(&self, goal: usize, expanded: usize) -> Found {
        let (mut cells, mut diagonals) = (vec![self.grid.cell(goal)], 0);
        let mut index = goal;
        while self.came_by[index] != NO_STEP {
            let step = usize::from(self.came_by[index]);
            diagonals += usize::from(step >= 4);
            let (cell, (dx, dy)) = (self.grid.cell(index), STEPS[step]);
            let Some(before) = self.grid.index(Cell::new(cell.x - dx, cell.y - dy)) else {
                break;
            };
            index = before;
            cells.push(self.grid.cell(index));
        }
        cells.reverse();
        let straights = cells.len() - 1 - diagonals;
        let length_cells = straights as f64 + diagonals as f64 * std::f64::consts::SQRT_2;
        Found { cells, length_cells, expanded }
    }
}

impl Escape {
    fn reaches(self, cell: Cell) -> bool {
        let (dx, dy) = (f64::from(cell.x - self.from.x), f64::from(cell.y - self.from.y));
        dx * dx + dy * dy <= self.reach_cells * self.reach_cells
    }
}

#[cfg(test)]
mod tests;
