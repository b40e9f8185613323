//! The shortest way over a grid: A* with the octile distance (Hart, Nilsson and Raphael 1968).
//!
//! Costs are whole numbers (2³² = one cell), so that sums are exact, ties are real ties, and the result is the same
//! on every machine. The queue is one of buckets, which are not sorted inside: a cell may be expanded again when a
//! cheaper way to it turns up within its bucket, and the search ends only when nothing cheaper than the way found is
//! left. Ways that also pay for turning are searched in [`super::turning`].

use std::f64::consts::{PI, SQRT_2};

use thiserror::Error;

use super::SearchGrid;
use super::buckets::Buckets;
use super::steps::{
    Choices, DIAGONAL, HIGHEST_LEVEL, NO_STEP, Rules, STEPS, STRAIGHT, least_cost, price,
    steps_to_look_at,
};
use super::terrain::{Escape, Terrain};
use super::turning;
use crate::geom::Cell;

/// Width of a bucket: 1/16 of a cell.
const BUCKET: u64 = STRAIGHT / 16;

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
    /// Headings are searched on smaller grids only.
    #[error("{cells} cells are too many to search with headings, at most {most} are allowed")]
    TooLargeToTurn {
        /// How many cells the grid has.
        cells: usize,
        /// How many it may have.
        most: usize,
    },
}

/// A shortest way over cells.
#[derive(Clone, PartialEq, Debug)]
pub struct GridPath {
    /// All cells from start to goal, both included.
    pub cells: Vec<Cell>,
    /// Length, in sides of a cell (steps of 1 and √2).
    pub length_cells: f64,
    /// All turns together, radians; with a given heading also the one before the first step.
    pub turned_rad: f64,
    /// What was made least, in sides of a cell: length, times more where the grid or an escape makes it dearer, and
    /// the price of the turns.
    pub cost_cells: f64,
    /// How many cells were expanded (with headings: cells and headings).
    pub expanded: usize,
}

/// Finds a cheapest way between two cells. Of several the same one is always found.
///
/// # Errors
/// [`NoRoute`]; `Unreachable` is a proof, not a surrender.
pub fn shortest_cells(
    grid: &SearchGrid,
    start: Cell,
    goal: Cell,
    rules: &Rules,
) -> Result<GridPath, NoRoute> {
    let terrain = entered(grid, start, Some(goal), rules)?;
    if let Some(turning) = rules.turning {
        return turning::cheapest_cells(
            &terrain,
            start,
            goal,
            rules,
            turning,
            grid.lattice().cell_m(),
        );
    }
    shortest_over(&terrain, start, goal, rules)
}

/// Finds a cheapest way without the price of turns.
pub(super) fn shortest_over(
    terrain: &Terrain,
    start: Cell,
    goal: Cell,
    rules: &Rules,
) -> Result<GridPath, NoRoute> {
    let mut search = Search::new(terrain, rules);
    search.begin(terrain, start);
    if search.run(terrain, Some(goal), u64::MAX) {
        return Ok(search.found(terrain, terrain.place(goal), rules));
    }
    Err(NoRoute::Unreachable {
        searched: search.expanded,
    })
}

/// Least costs from one cell to all others.
#[derive(Clone, Debug)]
pub(super) struct Flood {
    terrain: Terrain,
    search: Search,
    /// Greater costs are not known.
    most: u64,
}

/// Finds the least costs from one cell to all others (Dijkstra 1959), as far as these are not greater than so many sides of a
/// cell; turning costs nothing.
pub(super) fn flood(
    grid: &SearchGrid,
    start: Cell,
    rules: &Rules,
    most_cells: f64,
) -> Result<Flood, NoRoute> {
    let terrain = entered(grid, start, None, rules)?;
    let mut search = Search::new(&terrain, rules);
    search.begin(&terrain, start);
    let mut flood = Flood {
        terrain,
        search,
        most: 0,
    };
    flood.go_on(most_cells);
    Ok(flood)
}

impl Flood {
    /// Searches on from where it ended, up to costs of so many sides of a cell: the result is that of one search.
    pub(super) fn go_on(&mut self, most_cells: f64) {
        // Saturating: infinity is the largest number.
        let most = (most_cells * STRAIGHT as f64) as u64;
        if most < self.most {
            return;
        }
        self.search.run(&self.terrain, None, most);
        self.most = match self.search.queue.is_empty() {
            true => u64::MAX,
            false => most,
        };
    }

    /// Returns the least cost of a way to a cell within the grid, in sides of a cell.
    pub(super) fn cost_cells(&self, cell: Cell) -> Option<f64> {
        self.cost(self.terrain.place(cell)).map(in_cells)
    }

    /// Returns the least costs of ways to so many cells of a row within the grid, in sides of a cell.
    pub(super) fn row_cells(
        &self,
        first: Cell,
        width: usize,
    ) -> impl Iterator<Item = Option<f64>> + '_ {
        let place = self.terrain.place(first);
        let row = &self.search.nodes[place..place + width];
        row.iter().map(|node| self.known(*node).map(in_cells))
    }

    fn cost(&self, place: usize) -> Option<u64> {
        self.known(self.search.nodes[place])
    }

    fn known(&self, node: SearchCell) -> Option<u64> {
        node.cost().filter(|cost| *cost <= self.most)
    }

    /// Returns whether the costs of all cells are known that can be reached.
    pub(super) fn is_whole(&self) -> bool {
        self.most == u64::MAX
    }

    /// Returns a way of that cost, both ends included.
    pub(super) fn cells_to(&self, goal: Cell) -> Option<Vec<Cell>> {
        let place = self.terrain.place(goal);
        self.cost(place)?;
        Some(walk_back(&self.terrain, &self.search.nodes, place))
    }
}

/// Returns a cost in sides of a cell. (Costs have 59 bits: as numbers with a sign they are turned into floating point faster.)
fn in_cells(cost: u64) -> f64 {
    cost as i64 as f64 / STRAIGHT as f64
}

/// Finds the least costs from all cells to one.
pub(super) fn flood_back(terrain: &Terrain, goal: Cell, rules: &Rules) -> Vec<SearchCell> {
    let mut search = Search {
        backward: true,
        ..Search::new(terrain, rules)
    };
    search.begin(terrain, goal);
    search.run(terrain, None, u64::MAX);
    search.nodes
}

/// Checks the ends and reads the grid.
fn entered(
    grid: &SearchGrid,
    start: Cell,
    goal: Option<Cell>,
    rules: &Rules,
) -> Result<Terrain, NoRoute> {
    let start_index = grid.index(start).ok_or(NoRoute::StartOutside)?;
    let goal_index = goal
        .map(|goal| grid.index(goal).ok_or(NoRoute::GoalOutside))
        .transpose()?;
    let escaping = !grid.open(start_index);
    if escaping && !(rules.escape_m > 0.0 && grid.only_near(start_index)) {
        return Err(NoRoute::StartBarred);
    }
    if goal_index.is_some_and(|index| !grid.open(index)) {
        return Err(NoRoute::GoalBarred);
    }
    let reach_cells = rules.escape_m / grid.lattice().cell_m();
    Ok(Terrain::of_grid(
        grid,
        escaping.then_some(Escape {
            from: start,
            reach_cells,
        }),
    ))
}

/// What is known of a cell: the least cost so far (upper 59 bits), whether it was expanded with it, and one more than
/// the step that led there. Zero = not reached yet, so that fresh memory need not be written.
#[derive(Clone, Copy, Debug)]
pub(super) struct SearchCell(u64);

const EXPANDED: u64 = 16;

impl SearchCell {
    #[inline]
    fn reached(cost: u64, step: usize) -> SearchCell {
        SearchCell(cost << 5 | (step as u64 + 1))
    }

    /// Returns the least cost so far; greater than any where none is known.
    #[inline]
    pub(super) fn bound(self) -> u64 {
        self.0.wrapping_sub(1) >> 5
    }

    pub(super) fn cost(self) -> Option<u64> {
        (self.0 != 0).then(|| self.bound())
    }

    #[inline]
    fn came_by(self) -> usize {
        ((self.0 & 15) as usize).wrapping_sub(1)
    }
}

#[derive(Clone, Debug)]
struct Search {
    nodes: Vec<SearchCell>,
    queue: Buckets,
    /// What each step costs, by the level of the cell that it leads to.
    prices: [[u64; HIGHEST_LEVEL as usize + 1]; 2],
    offsets: [isize; 8],
    choices: &'static Choices,
    diagonal: bool,
    /// Whether steps are searched against their direction, so that costs are those of ways to the start.
    backward: bool,
    expanded: usize,
}

impl Search {
    fn new(terrain: &Terrain, rules: &Rules) -> Search {
        let uniform = terrain.levels().is_none();
        let most = price(1, if uniform { 0 } else { HIGHEST_LEVEL });
        Search {
            nodes: vec![SearchCell(0); terrain.len()],
            // A step raises the estimate at most by its cost and by one step away from the goal.
            queue: Buckets::new(most + DIAGONAL, BUCKET),
            prices: [0, 1].map(|step| std::array::from_fn(|level| price(step, level as u8))),
            offsets: terrain.offsets(),
            choices: steps_to_look_at(rules, uniform),
            diagonal: rules.diagonal,
            backward: false,
            expanded: 0,
        }
    }

    /// Puts the start into the queue.
    fn begin(&mut self, terrain: &Terrain, start: Cell) {
        let start = terrain.place(start);
        self.nodes[start] = SearchCell::reached(0, NO_STEP);
        self.queue.push(0, start as u32);
    }

    /// Searches until nothing is left that could be cheaper than a way to the goal, or all that can be reached at most at
    /// this cost; tells whether the goal was. Called again with a greater cost it goes on where it ended.
    fn run(&mut self, terrain: &Terrain, goal: Option<Cell>, most: u64) -> bool {
        // What waits in the queue is dearer then, but for what shares a bucket with it.
        let last = most.saturating_add(BUCKET);
        let goal_place = goal.map_or(usize::MAX, |goal| terrain.place(goal));
        let mut best = u64::MAX;
        while let Some(place) = self.queue.pop() {
            let place = place as usize;
            let node = self.nodes[place];
            if node.0 & EXPANDED != 0 {
                continue;
            }
            if node.bound() > last {
                self.queue.push(node.bound(), place as u32);
                break;
            }
            let cell = terrain.cell(place);
            if place == goal_place {
                best = node.bound();
            }
            if best != u64::MAX && node.bound() + self.remaining(cell, goal) >= best {
                continue;
            }
            self.nodes[place] = SearchCell(node.0 | EXPANDED);
            self.expanded += 1;
            self.expand(terrain, place, node, cell, goal);
        }
        best != u64::MAX
    }

    #[inline]
    fn expand(
        &mut self,
        terrain: &Terrain,
        place: usize,
        node: SearchCell,
        cell: Cell,
        goal: Option<Cell>,
    ) {
        let mut steps = self.choices[node.came_by()][usize::from(terrain.around(place))];
        while steps != 0 {
            let step = steps.trailing_zeros() as usize;
            steps &= steps - 1;
            let to = place.wrapping_add_signed(self.offsets[step]);
            let entered = if self.backward { place } else { to };
            let level = terrain.levels().map_or(0, |levels| levels[entered]);
            let cost = node.bound() + self.prices[step & 1][usize::from(level)];
            if cost < self.nodes[to].bound() {
                self.nodes[to] = SearchCell::reached(cost, step);
                let (dx, dy) = STEPS[step];
                let beside = Cell::new(cell.x + dx, cell.y + dy);
                self.queue
                    .push(cost + self.remaining(beside, goal), to as u32);
            }
        }
    }

    /// Returns the least cost that any way from a cell to the goal can have.
    #[inline]
    fn remaining(&self, from: Cell, goal: Option<Cell>) -> u64 {
        goal.map_or(0, |goal| {
            least_cost(
                from.x.abs_diff(goal.x),
                from.y.abs_diff(goal.y),
                self.diagonal,
            )
        })
    }

    fn found(&self, terrain: &Terrain, goal: usize, rules: &Rules) -> GridPath {
        let cells = walk_back(terrain, &self.nodes, goal);
        GridPath::of_cells(cells, self.nodes[goal].bound(), self.expanded, rules)
    }
}

/// Returns the way that led to a place, from its start on.
fn walk_back(terrain: &Terrain, nodes: &[SearchCell], goal: usize) -> Vec<Cell> {
    let (mut cells, mut place, offsets) = (vec![terrain.cell(goal)], goal, terrain.offsets());
    while let Some(offset) = offsets.get(nodes[place].came_by()) {
        place = place.wrapping_add_signed(-offset);
        cells.push(terrain.cell(place));
    }
    cells.reverse();
    cells
}

impl GridPath {
    /// Counts steps and turns of a way over cells.
    pub(super) fn of_cells(
        cells: Vec<Cell>,
        cost: u64,
        expanded: usize,
        rules: &Rules,
    ) -> GridPath {
        let (mut straights, mut diagonals, mut eighths, mut before, mut turned_rad) =
            (0, 0, 0, None, 0.0);
        for pair in cells.windows(2) {
            let step = step_between(pair[0], pair[1]);
            if step.is_multiple_of(2) {
                straights += 1
            } else {
                diagonals += 1
            }
            match before {
                Some(before) => eighths += eighths_between(before, step),
                None => {
                    turned_rad = rules
                        .turning
                        .map_or(0.0, |turning| turning.first_turn_rad(step))
                }
            }
            before = Some(step);
        }
        turned_rad += eighths as f64 * PI / 4.0;
        let length_cells = f64::from(straights) + f64::from(diagonals) * SQRT_2;
        let cost_cells = cost as f64 / STRAIGHT as f64;
        GridPath {
            cells,
            length_cells,
            turned_rad,
            cost_cells,
            expanded,
        }
    }
}

fn step_between(from: Cell, to: Cell) -> usize {
    STEPS
        .iter()
        .position(|(dx, dy)| (to.x - from.x, to.y - from.y) == (*dx, *dy))
        .unwrap_or(0)
}

/// Returns the turn between two directions, in eighths of a full one.
fn eighths_between(a: usize, b: usize) -> usize {
    let turn = (a + 8 - b) % 8;
    turn.min(8 - turn)
}

#[cfg(test)]
mod tests;
