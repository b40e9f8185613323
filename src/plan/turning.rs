//! The cheapest way over a grid when turning costs: A* over (cell, heading).
//!
//! Eight headings a cell (four without diagonal steps). From each one may step ahead, or turn by one heading on the
//! spot; a turn costs in proportion to its angle, so turning in eighths costs what one turn does. Ends at the goal
//! with whatever heading is cheapest. What is left to the goal is estimated by the least cost without turns, found by
//! one search back from it, so few states are looked at beside the way.

use std::f64::consts::FRAC_PI_4;

use super::astar::{GridPath, NoRoute, SearchCell, flood_back, shortest_over};
use super::buckets::Buckets;
use super::steps::{
    Choices, HIGHEST_LEVEL, NO_STEP, Rules, STRAIGHT, TurningCost, price, steps_to_look_at,
};
use super::terrain::Terrain;
use crate::geom::Cell;

/// A grid with headings has at most this many cells, eight states each.
const MAX_CELLS: usize = 2_000_000;
/// The dearest turn, cells per radian.
const MAX_CELLS_PER_RAD: f64 = 64.0;
/// Width of a bucket: 1/16 of a cell.
const BUCKET: u64 = STRAIGHT / 16;

/// How a state was reached: by a step ahead, a turn to the left, to the right, or as the start.
const AHEAD: u64 = 1;
const LEFT: u64 = 2;
const RIGHT: u64 = 3;
const START: u64 = 4;
const EXPANDED: u64 = 8;

/// Finds the cheapest way; the ends have been checked.
pub(super) fn cheapest_cells(
    terrain: &Terrain,
    start: Cell,
    goal: Cell,
    rules: &Rules,
    turning: TurningCost,
    cell_m: f64,
) -> Result<GridPath, NoRoute> {
    if terrain.len() > MAX_CELLS {
        return Err(NoRoute::TooLargeToTurn {
            cells: terrain.len(),
            most: MAX_CELLS,
        });
    }
    if start == goal {
        return shortest_over(terrain, start, goal, rules);
    }
    let per_rad = turning.cost_m_per_rad / cell_m;
    let cells_per_rad = if per_rad > 0.0 {
        per_rad.min(MAX_CELLS_PER_RAD)
    } else {
        0.0
    };
    let left = flood_back(terrain, goal, rules);
    let mut search = Search::new(terrain, rules, left, cells_per_rad);
    search.begin(terrain.place(start), &turning, cells_per_rad);
    match search.run(terrain.place(goal)) {
        Some(state) => {
            let (cells, cost) = (search.walk_back(state), search.states[state].bound());
            Ok(GridPath::of_cells(cells, cost, search.expanded, rules))
        }
        // Turns bar no way: without them none leads there either.
        None => shortest_over(terrain, start, goal, rules),
    }
}

/// What is known of a state: the least cost so far (upper 60 bits), whether it was expanded with it, and how it was
/// reached. Zero = not reached yet.
#[derive(Clone, Copy)]
struct State(u64);

impl State {
    #[inline]
    fn bound(self) -> u64 {
        self.0.wrapping_sub(1) >> 4
    }

    #[inline]
    fn came_by(self) -> u64 {
        self.0 & 7
    }
}

struct Search<'a> {
    terrain: &'a Terrain,
    /// Least cost from each place to the goal, turns not counted.
    left: Vec<SearchCell>,
    /// By place × 8 + heading.
    states: Vec<State>,
    queue: Buckets,
    offsets: [isize; 8],
    choices: &'static Choices,
    /// Headings between two neighbouring ones: 1, or 2 without diagonal steps.
    turn: usize,
    turn_cost: u64,
    prices: [[u64; HIGHEST_LEVEL as usize + 1]; 2],
    /// Cost of the cheapest way found so far, and its last state.
    best: u64,
    best_state: Option<usize>,
    expanded: usize,
}

impl<'a> Search<'a> {
    fn new(
        terrain: &'a Terrain,
        rules: &Rules,
        left: Vec<SearchCell>,
        cells_per_rad: f64,
    ) -> Search<'a> {
        let most = price(
            1,
            if terrain.levels().is_none() {
                0
            } else {
                HIGHEST_LEVEL
            },
        );
        let turn = if rules.diagonal { 1 } else { 2 };
        let turn_cost = turn as u64 * cost_of(cells_per_rad * FRAC_PI_4);
        Search {
            terrain,
            left,
            states: vec![State(0); terrain.len() * 8],
            // A step raises the estimate at most by what it costs there and back, the first turn by half a round.
            queue: Buckets::new((2 * most).max(4 * turn_cost), BUCKET),
            offsets: terrain.offsets(),
            choices: steps_to_look_at(rules, false),
            turn,
            turn_cost,
            prices: [0, 1].map(|step| std::array::from_fn(|level| price(step, level as u8))),
            best: u64::MAX,
            best_state: None,
            expanded: 0,
        }
    }

    /// Enters the start with every heading, at the price of turning there.
    fn begin(&mut self, start: usize, turning: &TurningCost, cells_per_rad: f64) {
        for heading in (0..8).step_by(self.turn) {
            let cost = cost_of(cells_per_rad * turning.first_turn_rad(heading));
            self.reach(start * 8 + heading, cost, START);
        }
    }

    /// Searches until nothing is left that could be cheaper than the way found; returns its last state.
    fn run(&mut self, goal: usize) -> Option<usize> {
        while let Some(state) = self.queue.pop() {
            let state = state as usize;
            let node = self.states[state];
            let place = state / 8;
            if node.0 & EXPANDED != 0 || node.bound() + self.left[place].bound() >= self.best {
                continue;
            }
            if place == goal {
                (self.best, self.best_state) = (node.bound(), Some(state));
                continue;
            }
            self.states[state] = State(node.0 | EXPANDED);
            self.expanded += 1;
            self.expand(state, node);
        }
        self.best_state
    }

    #[inline]
    fn expand(&mut self, state: usize, node: State) {
        let (place, heading) = (state / 8, state % 8);
        let steps = self.choices[NO_STEP][usize::from(self.terrain.around(place))];
        if steps & (1 << heading) != 0 {
            let to = place.wrapping_add_signed(self.offsets[heading]);
            let level = self.terrain.levels().map_or(0, |levels| levels[to]);
            self.reach(
                to * 8 + heading,
                node.bound() + self.prices[heading & 1][usize::from(level)],
                AHEAD,
            );
        }
        // Who has just turned one way need not turn back; the start has all headings already.
        let (came_by, turned) = (node.came_by(), node.bound() + self.turn_cost);
        if came_by == AHEAD || came_by == LEFT {
            self.reach(place * 8 + (heading + self.turn) % 8, turned, LEFT);
        }
        if came_by == AHEAD || came_by == RIGHT {
            self.reach(place * 8 + (heading + 8 - self.turn) % 8, turned, RIGHT);
        }
    }

    #[inline]
    fn reach(&mut self, state: usize, cost: u64, came_by: u64) {
        if cost >= self.states[state].bound() {
            return;
        }
        // From where no way leads to the goal nothing is searched.
        if let Some(left) = self.left[state / 8].cost() {
            self.states[state] = State(cost << 4 | came_by);
            self.queue.push(cost + left, state as u32);
        }
    }

    /// Returns the cells of the way that led to a state.
    fn walk_back(&self, last: usize) -> Vec<Cell> {
        let (mut cells, mut state) = (vec![self.terrain.cell(last / 8)], last);
        loop {
            let (place, heading) = (state / 8, state % 8);
            match self.states[state].came_by() {
                AHEAD => {
                    let before = place.wrapping_add_signed(-self.offsets[heading]);
                    cells.push(self.terrain.cell(before));
                    state = before * 8 + heading;
                }
                LEFT => state = place * 8 + (heading + 8 - self.turn) % 8,
                RIGHT => state = place * 8 + (heading + self.turn) % 8,
                _ => break,
            }
        }
        cells.reverse();
        cells
    }
}

/// Returns a cost in whole numbers.
fn cost_of(cells: f64) -> u64 {
    libm::round(cells * STRAIGHT as f64) as u64
}

#[cfg(test)]
mod tests;
