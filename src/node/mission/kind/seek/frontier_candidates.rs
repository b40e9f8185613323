//! From where to look at what: of all places that can be reached, the best one to see one of the candidates from.

use crate::geom::{Cell, Lattice, Point, Segment};
use crate::map::{CellRect, Occupancy, View};
use crate::plan::{Distances, SearchGrid};

use super::look_history::LookHistory;

/// A metre more between the vehicle and what it looks at counts as so many metres of way.
const AWAY_FACTOR: f64 = 2.0;
/// Ways that differ by less count as equal, metres.
const COST_STEP_M: f64 = 0.1;
/// Side of the squares by which candidates are found, metres.
const SQUARE_M: f64 = 1.0;

/// A frontier cell that is worth a look.
#[derive(Clone, Copy)]
pub(super) struct FrontierCandidate {
    /// The cell.
    pub cell: Cell,
    /// Its middle.
    pub at: Point,
    /// It is chosen although it is so much farther away than another one, metres; less than nothing = as if nearer.
    pub penalty_m: f64,
}

/// Where to look from, and at what.
pub(super) struct LookCandidate {
    /// Where to stand, a cell of the grid that was searched.
    pub from: Cell,
    /// The cell to look at.
    pub at: Cell,
}

/// From how far away things are looked at, metres.
#[derive(Clone, Copy)]
pub(super) struct Reach {
    /// Going nearer than this is worth nothing.
    pub near_m: f64,
    /// From farther away it is not surely seen.
    pub far_m: f64,
}

/// What is known of the ground around where a look is chosen.
pub(super) struct Ground<'a> {
    /// The cells of the map.
    pub lattice: Lattice,
    /// What stands where.
    pub view: &'a View<'a>,
    /// Where the vehicle may be.
    pub grid: &'a SearchGrid,
    /// The ways to all places that can be reached.
    pub reached: &'a Distances,
    /// From where things were looked at already.
    pub looks: &'a LookHistory,
}

impl Ground<'_> {
    /// Returns the best look from a place at one of the candidates; `None` when nothing of them can be seen from anywhere.
    pub(super) fn best_look(
        &self,
        start: Point,
        candidates: &[FrontierCandidate],
        reach: Reach,
    ) -> Option<LookCandidate> {
        let nodes = self.grid.lattice();
        let squares = Squares::new(nodes, self.grid.area(), candidates);
        let start_cell = nodes.cell_at(start);
        let least_m = candidates
            .iter()
            .map(|one| one.penalty_m)
            .fold(f64::INFINITY, f64::min);
        let (mut best, mut best_m) = (None, f64::INFINITY);
        for (cost_m, cell) in by_cost(self.grid, self.reached) {
            // By cost upwards: from here on the way alone costs more than the best look that is known.
            if cost_m + least_m >= best_m {
                break;
            }
            let from = if cell == start_cell {
                start
            } else {
                nodes.centre(cell)
            };
            for one in squares.near(from, reach.far_m) {
                let away_m = one.at.distance_to(from);
                let score_m =
                    cost_m + one.penalty_m + AWAY_FACTOR * (away_m - reach.near_m).max(0.0);
                // What is cheap to ask comes first: the ray through the map is asked last, and seldom.
                let is_better =
                    away_m <= reach.far_m && score_m < best_m && self.looks.is_new(one.cell, from);
                if is_better && sees(self.view, self.lattice, from, one.at) {
                    (best, best_m) = (
                        Some(LookCandidate {
                            from: cell,
                            at: one.cell,
                        }),
                        score_m,
                    );
                }
            }
        }
        best
    }
}

/// Returns whether only free ground lies between a place and a free cell.
pub(super) fn sees(view: &View<'_>, lattice: Lattice, from: Point, to: Point) -> bool {
    lattice
        .cells_under(Segment::new(from, to))
        .all(|cell| view.occupancy(cell) == Occupancy::Free)
}

/// Returns what can be reached with its cost in metres, the nearest first (in steps of [`COST_STEP_M`]).
fn by_cost(grid: &SearchGrid, reached: &Distances) -> impl Iterator<Item = (f64, Cell)> {
    let mut steps: Vec<Vec<Cell>> = Vec::new();
    for cell in grid.area().cells() {
        let Some(cost_m) = reached.cost_m(cell) else {
            continue;
        };
        let step = (cost_m / COST_STEP_M) as usize;
        if step >= steps.len() {
            steps.resize_with(step + 1, Vec::new);
        }
        steps[step].push(cell);
    }
    let step_m = |(step, cells): (usize, Vec<Cell>)| {
        cells
            .into_iter()
            .map(move |cell| (step as f64 * COST_STEP_M, cell))
    };
    steps.into_iter().enumerate().flat_map(step_m)
}

/// Candidates by place.
struct Squares {
    low: Point,
    columns: usize,
    rows: usize,
    of: Vec<Vec<FrontierCandidate>>,
}

impl Squares {
    fn new(lattice: Lattice, area: CellRect, candidates: &[FrontierCandidate]) -> Squares {
        let (low, high) = (lattice.centre(area.low), lattice.centre(area.high));
        let count = |from_m: f64, to_m: f64| ((to_m - from_m) / SQUARE_M).floor() as usize + 1;
        let (columns, rows) = (count(low.x_m, high.x_m), count(low.y_m, high.y_m));
        let mut squares = Squares {
            low,
            columns,
            rows,
            of: vec![Vec::new(); columns * rows],
        };
        for one in candidates {
            let (column, row) = squares.place(one.at);
            let (column, row) = (
                column.clamp(0, columns as i64 - 1),
                row.clamp(0, rows as i64 - 1),
            );
            squares.of[row as usize * columns + column as usize].push(*one);
        }
        squares
    }

    fn place(&self, at: Point) -> (i64, i64) {
        let index = |from_m: f64, to_m: f64| ((to_m - from_m) / SQUARE_M).floor() as i64;
        (index(self.low.x_m, at.x_m), index(self.low.y_m, at.y_m))
    }

    /// Returns what lies in the squares around a place.
    fn near(&self, at: Point, reach_m: f64) -> impl Iterator<Item = &FrontierCandidate> {
        let (column, row) = self.place(at);
        let reach = (reach_m / SQUARE_M).ceil() as i64;
        let columns = (column - reach).max(0)..=(column + reach).min(self.columns as i64 - 1);
        let rows = (row - reach).max(0)..=(row + reach).min(self.rows as i64 - 1);
        rows.flat_map(move |row| columns.clone().map(move |column| (row, column)))
            .flat_map(|(row, column)| &self.of[row as usize * self.columns + column as usize])
    }
}
