//! What bars the way, part by part: for grids finer than the map's cells, where a doorway is as wide as it was seen.

use super::RequiredClearance;
use super::swath::rows_within;
use crate::geom::{Cell, Lattice, Segment};
use crate::map::{CellRect, PART_SIDE, View};

/// Nothing bars there.
const OPEN: u8 = 0;
/// Nobody has seen it.
const UNKNOWN: u8 = 1;
/// Something was heard there.
const OCCUPIED: u8 = 2;
/// Parts along the side of a cell.
const SIDE: i32 = PART_SIDE as i32;
/// Parts along the side of a node's square: nodes lie half a cell apart.
const NODE: i32 = SIDE / 2;

/// The parts of all cells of a rectangle.
#[derive(Clone, Debug)]
pub(super) struct Barriers {
    /// Of parts.
    lattice: Lattice,
    area: CellRect,
    width: usize,
    /// Row-major, x fastest.
    kinds: Vec<u8>,
    clearance: RequiredClearance,
}

impl Barriers {
    /// Copies the parts of a rectangle of cells; with `unknown_allowed` only what was heard bars.
    pub(super) fn of_view(
        view: &View<'_>,
        area: CellRect,
        clearance: RequiredClearance,
        unknown_allowed: bool,
    ) -> Barriers {
        let parts = CellRect::new(
            Cell::new(area.low.x * SIDE, area.low.y * SIDE),
            Cell::new(area.high.x * SIDE + SIDE - 1, area.high.y * SIDE + SIDE - 1),
        );
        let width = parts.width_cells() as usize;
        let mut barriers = Barriers {
            lattice: Lattice::new(view.lattice().cell_m() / f64::from(SIDE)),
            area: parts,
            width,
            kinds: vec![OPEN; width * parts.height_cells() as usize],
            clearance,
        };
        for cell in area.cells() {
            let Some(barred) = view.barred(cell) else {
                continue;
            };
            let kind = match (barred.is_occupied, unknown_allowed) {
                (true, _) => OCCUPIED,
                (false, false) => UNKNOWN,
                (false, true) => continue,
            };
            barriers.fill(cell, barred.parts, kind);
        }
        barriers
    }

    fn fill(&mut self, cell: Cell, parts: u16, kind: u8) {
        let first = Cell::new(cell.x * SIDE, cell.y * SIDE);
        for row in 0..SIDE {
            let Some(start) = self.index(Cell::new(first.x, first.y + row)) else {
                return;
            };
            let line = &mut self.kinds[start..start + SIDE as usize];
            for (column, place) in line.iter_mut().enumerate() {
                if parts & (1 << (row as usize * SIDE as usize + column)) != 0 {
                    *place = kind;
                }
            }
        }
    }

    /// Returns whether nothing lies nearer to a segment than is required.
    pub(super) fn is_clear(&self, along: Segment) -> bool {
        let rows = self.area.low.y..=self.area.high.y;
        for (y, columns) in rows_within(self.lattice, along, self.clearance.most_m(), rows) {
            let (from, to) = (
                (*columns.start()).max(self.area.low.x),
                (*columns.end()).min(self.area.high.x),
            );
            for x in from..=to {
                let part = Cell::new(x, y);
                let Some(kept_m) = self.index(part).and_then(|index| self.kept_m(index)) else {
                    continue;
                };
                if along.distance_to_point(self.lattice.centre(part)) < kept_m - 1e-9 {
                    return false;
                }
            }
        }
        true
    }

    /// Calls `solid` with each node (by its place in the rectangle) in whose square something bars, and `near` with a row and
    /// the range of columns of nodes that lie nearer to something than is required.
    pub(super) fn mark(
        &self,
        solid: &mut dyn FnMut(usize),
        near: &mut dyn FnMut(usize, std::ops::RangeInclusive<usize>),
    ) {
        let columns = self.width / NODE as usize;
        for (index, kind) in self.kinds.iter().enumerate() {
            if *kind == OPEN {
                continue;
            }
            let (x, y) = (index % self.width, index / self.width);
            solid(y / NODE as usize * columns + x / NODE as usize);
            if self.is_on_rim(x, y, *kind) {
                let kept_m = self.kept_m(index).unwrap_or(0.0);
                self.mark_near(x as i32, y as i32, kept_m, near);
            }
        }
    }

    /// Calls `near` with the nodes that are nearer to a part than `kept_m`. In units of half a part: parts lie at odd places,
    /// nodes at every fourth from 2 on.
    fn mark_near(
        &self,
        x: i32,
        y: i32,
        kept_m: f64,
        near: &mut dyn FnMut(usize, std::ops::RangeInclusive<usize>),
    ) {
        let unit_m = self.lattice.cell_m() / 2.0;
        let reach = kept_m / unit_m * (1.0 - 1e-12);
        let (at_x, at_y) = (2 * x + 1, 2 * y + 1);
        let between = |at: i32, reach: f64, count: i32| {
            let first = libm::ceil((f64::from(at - 2) - reach) / 4.0) as i32;
            let last = libm::floor((f64::from(at - 2) + reach) / 4.0) as i32;
            (first.max(0), last.min(count - 1))
        };
        let (columns, rows) = (
            self.width as i32 / NODE,
            self.area.height_cells() as i32 / NODE,
        );
        let (first_row, last_row) = between(at_y, reach, rows);
        for row in first_row..=last_row {
            let up = f64::from(4 * row + 2 - at_y);
            let aside = (reach * reach - up * up).max(0.0).sqrt();
            let (first, last) = between(at_x, aside, columns);
            if first <= last {
                near(row as usize, first as usize..=last as usize);
            }
        }
    }

    /// Returns whether a part of this kind lies beside one that bars less: what is near to its inside is near to its rim.
    fn is_on_rim(&self, x: usize, y: usize, kind: u8) -> bool {
        let height = self.kinds.len() / self.width;
        if x == 0 || y == 0 || x + 1 == self.width || y + 1 == height {
            return true;
        }
        let index = y * self.width + x;
        [index - 1, index + 1, index - self.width, index + self.width]
            .into_iter()
            .any(|beside| self.kinds[beside] < kind)
    }

    fn kept_m(&self, index: usize) -> Option<f64> {
        match self.kinds[index] {
            OCCUPIED => Some(self.clearance.occupied_m),
            UNKNOWN => Some(self.clearance.unknown_m),
            _ => None,
        }
    }

    fn index(&self, part: Cell) -> Option<usize> {
        let (x, y) = (
            part.x.abs_diff(self.area.low.x) as usize,
            part.y.abs_diff(self.area.low.y) as usize,
        );
        self.area.contains(part).then(|| y * self.width + x)
    }
}
