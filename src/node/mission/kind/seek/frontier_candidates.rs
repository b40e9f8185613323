//! From where to look at what: of all places that can be reached, the best one to see one of the candidates from.

use std::cell::RefCell;
use std::ops::Range;

use crate::geom::{Cell, Lattice, Point, Segment, Vector};
use crate::map::{CellRect, Occupancy, OccupancyGrid};
use crate::node::mission::terrain::ReachedGround;
use crate::plan::{Component, Distances, SearchGrid};

use super::look_history::{LookHistory, Rigour};
use super::shadow::Shadow;

/// A metre more between the vehicle and what it looks at counts as so many metres of way.
const AWAY_FACTOR: f64 = 2.0;
/// Ways that differ by less count as equal, metres.
const COST_STEP_M: f64 = 0.1;
/// Up to which cost places are read at a time, in such steps.
const RING_STEPS: [usize; 4] = [0, 32, 128, usize::MAX];
/// Side of the squares by which candidates are found, metres.
const SQUARE_M: f64 = 1.0;
/// More than what is lost when squares of distances are rounded, square metres.
const ROUNDED_M2: f64 = 1e-6;

/// A frontier cell that is worth a look.
#[derive(Clone, Copy)]
pub(super) struct FrontierCandidate {
    /// The cell.
    pub cell: Cell,
    /// Its middle.
    pub at: Point,
    /// It is chosen although it is so much farther away than another one, metres; less than nothing = as if nearer.
    pub penalty_m: f64,
    /// Which way the face looks that it lies before, a unit vector; `None` when it is none.
    pub normal: Option<Vector>,
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
    /// What is known of them.
    pub occupancy: &'a OccupancyGrid,
    /// Where the vehicle may be.
    pub grid: &'a SearchGrid,
    /// From where things were looked at already.
    pub looks: &'a LookHistory,
    /// How thoroughly they are looked at.
    pub rigour: Rigour,
    /// Grounds from which nothing can be seen: no look is sought there again.
    pub in_vain: Vec<&'a ReachedGround>,
}

impl Ground<'_> {
    /// Returns the best look from a place at one of the candidates, and the ways to where it is taken from, of which some
    /// may be known. When nothing of them can be seen from anywhere, the ways to all places; to those near by when there
    /// are none.
    pub(super) fn best_look(
        &self,
        start: Point,
        candidates: &[FrontierCandidate],
        reach: Reach,
        mut reached: Distances,
    ) -> Result<(LookCandidate, Distances), Box<Distances>> {
        let nodes = self.grid.lattice();
        let mut squares = self.squares(candidates, reach);
        let start_cell = nodes.cell_at(start);
        let least_m = candidates
            .iter()
            .map(|one| one.penalty_m)
            .fold(f64::INFINITY, f64::min);
        let (mut best, mut best_m) = (None, f64::INFINITY);
        let all_known = reached.is_whole();
        // Ring by ring: what lies far away is searched only when nothing near is as good.
        for ring in RING_STEPS.windows(2).map(|ring| ring[0]..ring[1]) {
            let most_m = ring.end as f64 * COST_STEP_M;
            reached.search_to(most_m);
            let is_promising = |cell| {
                (cell == start_cell || squares.has_near(cell))
                    && !self.is_in_vain(nodes.centre(cell))
            };
            for (cost_m, cell) in by_cost(&reached, start_cell, ring, is_promising) {
                // By cost upwards: from here on the way alone costs more than the best look that is known.
                if cost_m + least_m >= best_m {
                    break;
                }
                let from = if cell == start_cell {
                    start
                } else {
                    nodes.centre(cell)
                };
                // What is farther away cannot be better.
                let spare_m = (best_m - cost_m - least_m) / AWAY_FACTOR;
                let within_m = reach.far_m.min(reach.near_m + spare_m);
                for sought in squares.near(from, within_m) {
                    let one = &sought.one;
                    let away_m = one.at.distance_to(from);
                    let score_m =
                        cost_m + one.penalty_m + AWAY_FACTOR * (away_m - reach.near_m).max(0.0);
                    // What is cheap to ask comes first: the ray through the map is asked last, and seldom.
                    let is_better = away_m <= reach.far_m
                        && score_m < best_m
                        && one.is_in_front(from)
                        && self.rigour.is_new(sought.looked_from, from);
                    if is_better && self.is_seen(sought, from) {
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
            let is_last = reached.is_whole() && !all_known;
            if is_last || most_m + least_m >= best_m {
                break;
            }
        }
        match best {
            Some(best) => Ok((best, reached)),
            None => Err(Box::new(reached)),
        }
    }

    fn is_in_vain(&self, place: Point) -> bool {
        self.in_vain.iter().any(|ground| ground.is_reached(place))
    }

    /// Returns whether one of the candidates can be seen from a place that can be reached.
    pub(super) fn is_any_seen(
        &self,
        (start, reached): (Point, &Component),
        candidates: &[FrontierCandidate],
        reach: Reach,
    ) -> bool {
        let nodes = self.grid.lattice();
        let (start_cell, mut squares) = (nodes.cell_at(start), self.squares(candidates, reach));
        let is_reached =
            |cell: &Cell| reached.contains(*cell) && !self.is_in_vain(nodes.centre(*cell));
        self.grid.area().cells().filter(is_reached).any(|cell| {
            let from = match cell == start_cell {
                true => start,
                false => nodes.centre(cell),
            };
            squares.near(from, reach.far_m).any(|sought| {
                sought.one.at.distance_to(from) <= reach.far_m
                    && sought.one.is_in_front(from)
                    && self.rigour.is_new(sought.looked_from, from)
                    && self.is_seen(sought, from)
            })
        })
    }

    /// Returns whether a candidate is seen from a place; what hides it is remembered.
    fn is_seen(&self, sought: &Sought<'_>, from: Point) -> bool {
        let at = sought.one.at;
        if sought.shadow.borrow().holds(at, from) {
            return false;
        }
        let is_seen = sees(self.occupancy, self.lattice, from, at);
        if !is_seen {
            let mut toward = self.lattice.cells_under(Segment::new(at, from));
            let is_free = |cell: Cell| self.occupancy.occupancy(cell) == Occupancy::Free;
            if let Some(hiding) = toward.find(|cell| !is_free(*cell)) {
                sought.shadow.borrow_mut().add(at, self.lattice, hiding);
            }
        }
        is_seen
    }

    /// Returns candidates by place, each with the places from where it was looked at.
    fn squares(&self, candidates: &[FrontierCandidate], reach: Reach) -> Squares<'_> {
        let mut squares = Squares::new(self.grid.lattice(), self.grid.area(), reach.far_m);
        for one in candidates {
            squares.add(*one, self.looks.places_of(one.cell));
        }
        squares
    }
}

/// Returns whether something unknown may stand beside a frontier cell: one of the two cells behind it in some direction is
/// neither occupied nor beside one that is. What stands beside a known surface is that surface.
pub(super) fn hides_something(occupancy: &OccupancyGrid, cell: Cell) -> bool {
    [(1, 0), (0, 1), (-1, 0), (0, -1)]
        .into_iter()
        .any(|(x, y)| {
            let behind = |steps: i32| Cell::new(cell.x + steps * x, cell.y + steps * y);
            let is_bare = |cell: Cell| !occupancy.has_occupied_around(cell, 1);
            occupancy.occupancy(behind(1)) == Occupancy::Unknown
                && (is_bare(behind(1)) || is_bare(behind(2)))
        })
}

/// Returns whether only free ground lies between a place and a free cell.
pub(super) fn sees(occupancy: &OccupancyGrid, lattice: Lattice, from: Point, to: Point) -> bool {
    lattice
        .cells_under(Segment::new(from, to))
        .all(|cell| occupancy.occupancy(cell) == Occupancy::Free)
}

/// Returns those cells of a kind that can be reached within a ring of costs, each with its cost in metres, the nearest
/// first (in steps of [`COST_STEP_M`]).
fn by_cost(
    reached: &Distances,
    start: Cell,
    ring: Range<usize>,
    mut is_wanted: impl FnMut(Cell) -> bool,
) -> Vec<(f64, Cell)> {
    // No way costs less than it is long.
    let far_cells = ring.end as f64 * COST_STEP_M / reached.lattice().cell_m();
    let around = CellRect::new(start, start).grown(far_cells.min(1e9) as i32 + 1);
    let in_ring = reached.costs_m(around).filter_map(|(cell, cost_m)| {
        let step = (cost_m / COST_STEP_M) as i64 as usize;
        (ring.contains(&step) && is_wanted(cell)).then(|| (step - ring.start, cell))
    });
    let found: Vec<(usize, Cell)> = in_ring.collect();
    // Sorted by counting: of equal costs the cells stay in their order.
    let steps = found.iter().map(|(step, _)| step + 1).max().unwrap_or(0);
    let mut places = vec![0; steps + 1];
    for (step, _) in &found {
        places[step + 1] += 1;
    }
    for step in 0..steps {
        places[step + 1] += places[step];
    }
    let mut sorted = vec![(0.0, start); found.len()];
    for (step, cell) in found {
        sorted[places[step]] = ((ring.start + step) as f64 * COST_STEP_M, cell);
        places[step] += 1;
    }
    sorted
}

/// A candidate, and what is known of looks at it.
#[derive(Clone)]
struct Sought<'a> {
    one: FrontierCandidate,
    /// The places from where it was looked at.
    looked_from: &'a [Point],
    /// From where it is surely not seen.
    shadow: RefCell<Shadow>,
}

/// Candidates by place.
struct Squares<'a> {
    low: Point,
    columns: usize,
    rows: usize,
    of: Vec<Vec<Sought<'a>>>,
    /// How many squares away candidates count.
    reach: usize,
    /// For each square that was asked for, those around it with candidates.
    around: Vec<Option<Vec<usize>>>,
    /// The lowest cell of those that may be asked for, and the column of each column of cells and the row of each row.
    first: Cell,
    columns_of: Vec<usize>,
    rows_of: Vec<usize>,
}

impl<'a> Squares<'a> {
    fn new(lattice: Lattice, area: CellRect, reach_m: f64) -> Squares<'a> {
        let (low, high) = (lattice.centre(area.low), lattice.centre(area.high));
        let count = |from_m: f64, to_m: f64| ((to_m - from_m) / SQUARE_M).floor() as usize + 1;
        let (columns, rows) = (count(low.x_m, high.x_m), count(low.y_m, high.y_m));
        let mut squares = Squares {
            low,
            columns,
            rows,
            of: vec![Vec::new(); columns * rows],
            reach: (reach_m / SQUARE_M).ceil() as usize,
            around: vec![None; columns * rows],
            first: area.low,
            columns_of: Vec::new(),
            rows_of: Vec::new(),
        };
        let place = |x, y| squares.place(lattice.centre(Cell::new(x, y)));
        let columns_of = (area.low.x..=area.high.x).map(|x| place(x, area.low.y).0);
        let rows_of = (area.low.y..=area.high.y).map(|y| place(area.low.x, y).1);
        (squares.columns_of, squares.rows_of) = (columns_of.collect(), rows_of.collect());
        squares
    }

    fn add(&mut self, one: FrontierCandidate, looked_from: &'a [Point]) {
        let (column, row) = self.place(one.at);
        self.of[row * self.columns + column].push(Sought {
            one,
            looked_from,
            shadow: RefCell::default(),
        });
    }

    /// Returns the column and row of the square of a place, or of the one nearest to it.
    fn place(&self, at: Point) -> (usize, usize) {
        let index = |from_m: f64, to_m: f64, count: usize| {
            (((to_m - from_m) / SQUARE_M).floor().max(0.0) as usize).min(count - 1)
        };
        (
            index(self.low.x_m, at.x_m, self.columns),
            index(self.low.y_m, at.y_m, self.rows),
        )
    }

    /// Returns whether something lies in the squares around the middle of a cell of the area.
    fn has_near(&mut self, cell: Cell) -> bool {
        let column = self.columns_of[cell.x.abs_diff(self.first.x) as usize];
        let row = self.rows_of[cell.y.abs_diff(self.first.y) as usize];
        !self.around(column, row).0.is_empty()
    }

    /// Returns the squares around one with candidates, and all squares.
    fn around(&mut self, column: usize, row: usize) -> (&[usize], &[Vec<Sought<'a>>]) {
        let (of, width, reach) = (&self.of, self.columns, self.reach);
        let columns = column.saturating_sub(reach)..=(column + reach).min(width - 1);
        let rows = row.saturating_sub(reach)..=(row + reach).min(self.rows - 1);
        let around = self.around[row * width + column].get_or_insert_with(|| {
            let squares =
                rows.flat_map(|row| columns.clone().map(move |column| row * width + column));
            squares.filter(|square| !of[*square].is_empty()).collect()
        });
        (around, of)
    }

    /// Returns what lies in the squares around a place of which some ground is this near to it.
    fn near(&mut self, at: Point, within_m: f64) -> impl Iterator<Item = &Sought<'a>> {
        let (low, width) = (self.low, self.columns);
        let (column, row) = self.place(at);
        let (around, of) = self.around(column, row);
        let is_near = move |square: &&usize| {
            let (column, row) = (**square % width, **square / width);
            let beside_m = |at_m: f64, low_m: f64, index: usize| {
                let from_m = low_m + index as f64 * SQUARE_M;
                (from_m - at_m).max(at_m - from_m - SQUARE_M).max(0.0)
            };
            let (x_m, y_m) = (
                beside_m(at.x_m, low.x_m, column),
                beside_m(at.y_m, low.y_m, row),
            );
            x_m * x_m + y_m * y_m <= within_m * within_m + ROUNDED_M2
        };
        around
            .iter()
            .filter(is_near)
            .flat_map(|square| &of[*square])
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::map::Merged;
    use crate::node::mission::terrain::tests::tiles_of;

    /// Makes the map of free ground below a row of cells and of nothing known above it; in the row stands what is named.
    fn map_below(row: i32, stands: impl Fn(i32) -> bool) -> OccupancyGrid {
        let mut map = Merged::new(Lattice::new(0.2), None);
        for mut tile in tiles_of(|_, _| false) {
            let (left, low) = (tile.address.x * 32, tile.address.y * 32);
            let value = |index: usize| match low + index as i32 / 32 - row {
                ..0 => -17,
                0 if stands(left + index as i32 % 32) => 17,
                0.. => 0,
            };
            tile.cells = Arc::new(std::array::from_fn(value));
            map.join(&tile).unwrap();
        }
        let area = CellRect::new(Cell::new(-20, -20), Cell::new(20, 20));
        map.view(0, area).occupancy_grid(area)
    }

    #[test]
    fn what_stands_beside_a_known_surface_is_that_surface() {
        let hides = |gap: Range<i32>, x: i32, y: i32| {
            hides_something(&map_below(5, |x| !gap.contains(&x)), Cell::new(x, y))
        };
        assert!(
            !hides(0..0, 0, 4),
            "behind it stands something that is known"
        );
        assert!(
            hides(-20..21, 0, 4),
            "nothing is known of what is behind it"
        );
        assert!(!hides(-20..21, 0, 0), "everything beside it is free");
        assert!(!hides(0..1, 0, 4), "a gap as wide as a cell");
        assert!(hides(0..3, 1, 4) && !hides(0..2, 1, 4));
    }
}
