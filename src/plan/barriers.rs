//! What bars the way, part by part: for grids finer than the map's cells, where a doorway is as wide as it was seen.

use std::ops::RangeInclusive;

use super::RequiredClearance;
use super::swath::rows_within;
use crate::geom::{Cell, Lattice, Point, Segment};
use crate::map::{Bar, CellRect, PART_SIDE, View};

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

/// So much more than is required is wished for beside what was heard, cells: its echoes then halt nobody.
const WISHED_CELLS: f64 = 0.75;

/// How near a node lies to something.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Nearness {
    /// Nobody can be there.
    Solid,
    /// Nearer than is required: one may only leave over it.
    TooNear,
    /// Nearer than is wished for.
    Nearer,
}

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
    /// Where the vehicle stands that keeps this.
    stands: Point,
}

impl Barriers {
    /// Copies the parts of a rectangle of cells, as far as they bar for this reason or a surer one.
    pub(super) fn of_view(
        view: &View<'_>,
        area: CellRect,
        clearance: RequiredClearance,
        from: Bar,
        stands: Point,
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
            stands,
        };
        for cell in area.cells() {
            let Some(barred) = view.barred(cell) else {
                continue;
            };
            let kind = match barred.is_occupied() {
                true => OCCUPIED,
                false => UNKNOWN,
            };
            if barred.bar >= from {
                barriers.fill(cell, barred.parts, kind);
            }
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
                let Some(kept_m) = self.kept_m(part) else {
                    continue;
                };
                if along.distance_to_point(self.lattice.centre(part)) < kept_m - 1e-9 {
                    return false;
                }
            }
        }
        true
    }

    /// Calls `mark` with a row and a range of columns of nodes, and how near they lie to something.
    pub(super) fn mark(&self, mark: &mut dyn FnMut(usize, RangeInclusive<usize>, Nearness)) {
        for (index, kind) in self.kinds.iter().enumerate() {
            if *kind == OPEN {
                continue;
            }
            let (x, y) = (index % self.width, index / self.width);
            let column = x / NODE as usize;
            mark(y / NODE as usize, column..=column, Nearness::Solid);
            let part = Cell::new(self.area.low.x + x as i32, self.area.low.y + y as i32);
            let kept_m = self.kept_m(part).unwrap_or(0.0);
            // Around a vehicle that stands too near, each part has a distance of its own.
            let is_as_its_rim = kept_m == self.required_m(*kind);
            if is_as_its_rim && !self.is_on_rim(x, y, *kind) {
                continue;
            }
            let wished_m = kept_m + WISHED_CELLS * f64::from(SIDE) * self.lattice.cell_m();
            let rings = [
                (Nearness::Solid, self.clearance.body_m.min(kept_m)),
                (Nearness::TooNear, kept_m),
                (Nearness::Nearer, wished_m),
            ];
            let count = if *kind == OCCUPIED { 3 } else { 2 };
            for (nearness, within_m) in &rings[..count] {
                self.mark_near(x as i32, y as i32, *within_m, &mut |row, columns| {
                    mark(row, columns, *nearness);
                });
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
        near: &mut dyn FnMut(usize, RangeInclusive<usize>),
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

    fn required_m(&self, kind: u8) -> f64 {
        match kind {
            OCCUPIED => self.clearance.occupied_m,
            _ => self.clearance.unknown_m,
        }
    }

    /// Returns how far the vehicle keeps from a part; `None` when it does not bar.
    fn kept_m(&self, part: Cell) -> Option<f64> {
        let kind = self.kinds[self.index(part)?];
        if kind == OPEN {
            return None;
        }
        let required_m = self.required_m(kind);
        let here_m = self.lattice.centre(part).distance_to(self.stands);
        if here_m >= required_m {
            return Some(required_m);
        }
        let cell_m = f64::from(SIDE) * self.lattice.cell_m();
        let released = self.clearance.released(cell_m);
        let released_m = match kind {
            OCCUPIED => released.occupied_m,
            _ => released.unknown_m,
        };
        // What is released to it, and a little more: straight steps between nodes come nearer than these.
        let least_m = match here_m < released_m {
            true => self.clearance.leaving_m(here_m, cell_m / 2.0),
            false => released_m,
        };
        Some(RequiredClearance::with_sag(least_m, cell_m).min(required_m))
    }

    fn index(&self, part: Cell) -> Option<usize> {
        let (x, y) = (
            part.x.abs_diff(self.area.low.x) as usize,
            part.y.abs_diff(self.area.low.y) as usize,
        );
        self.area.contains(part).then(|| y * self.width + x)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proptest::prelude::*;
    use tomoswarm_proto::{LayerId, TILE_CELLS, TileAddress, TileReport};

    use crate::geom::{Cell, Lattice, Point};
    use crate::map::{Bar, CellRect, Merged};
    use crate::plan::{Corridor, RequiredClearance, Rules, SearchGrid, shortest_route};

    const CELL_M: f64 = 0.2;
    const RULES: Rules = Rules {
        diagonal: true,
        cut_corners: false,
        escape_m: 1.0,
        turning: None,
    };

    /// A free map of 6.4 m by 6.4 m but for some cells: occupied, or unknown.
    fn map(barred: &[(i32, i32, bool)]) -> Merged {
        let mut cells = [-17; TILE_CELLS];
        for (x, y, is_occupied) in barred {
            cells[(y * 32 + x) as usize] = if *is_occupied { 17 } else { 0 };
        }
        let mut map = Merged::new(Lattice::new(CELL_M), None);
        for (x, y) in (-1..=1).flat_map(|x| (-1..=1).map(move |y| (x, y))) {
            let is_middle = (x, y) == (0, 0);
            let cells = Arc::new(if is_middle { cells } else { [-17; TILE_CELLS] });
            map.join(&TileReport {
                layer: LayerId::default(),
                address: TileAddress { slice: 0, x, y },
                revision: 1,
                cells,
            })
            .unwrap();
        }
        map
    }

    proptest! {
        /// What is planned can be driven, also by who stands too near to something.
        #[test]
        fn a_planned_way_is_released_to_its_end(
            barred in proptest::collection::vec((2..30i32, 2..30i32, any::<bool>()), 0..14),
            from in (1.0..5.4f64, 1.0..5.4f64), to in (1.0..5.4f64, 1.0..5.4f64),
            safety_m in 0.25..1.2f64,
        ) {
            let map = map(&barred);
            let area = CellRect::new(Cell::new(0, 0), Cell::new(31, 31));
            let view = map.view(0, CellRect::new(Cell::new(-32, -32), Cell::new(63, 63)));
            let planned = RequiredClearance::planned(0.25, safety_m, 0.04, CELL_M);
            let (from, to) = (Point::new(from.0, from.1), Point::new(to.0, to.1));
            let grid = SearchGrid::of_parts(&view, area, planned, Bar::Unknown, from).unwrap();
            let Ok(route) = shortest_route(&grid, from, to, &RULES) else {
                return Ok(());
            };
            // Who is so near that its path must first lead out is judged by how far it gets; nobody stands in something.
            prop_assume!(grid.passable(grid.lattice().cell_at(from)));
            let parts = area.cells().filter_map(|cell| {
                Some(view.barred(cell)?.places(map.lattice(), cell).collect::<Vec<_>>())
            });
            prop_assume!(parts.flatten().all(|part| part.distance_to(from) >= 0.25));
            let corridor = Corridor { clearance: planned.released(CELL_M), ahead_m: 50.0 };
            let release = corridor.released(&view, &route.points, from);
            prop_assert!((release.free_until_m - route.length_m).abs() < 1e-6, "{release:?} of {:?}", route.points);
        }
    }

    #[test]
    fn who_stands_too_near_passes_what_it_is_near_to_and_keeps_its_distance_from_the_rest() {
        // It stands 0.6 m from the one, and must pass the other at 0.9 m.
        let map = map(&[(10, 10, true), (18, 8, true)]);
        let area = CellRect::new(Cell::new(0, 0), Cell::new(31, 31));
        let planned = RequiredClearance::planned(0.25, 0.9, 0.0, CELL_M);
        let from = Point::new(2.1, 1.4);
        let grid =
            SearchGrid::of_parts(&map.view(0, area), area, planned, Bar::Unknown, from).unwrap();
        let is_open = |x_m, y_m| grid.passable(grid.lattice().cell_at(Point::new(x_m, y_m)));
        assert!(
            is_open(2.1, 1.4) && is_open(1.6, 1.4),
            "where it stands, and aside of it"
        );
        assert!(!is_open(2.1, 1.7), "nearer still");
        assert!(
            !is_open(3.0, 1.4) && !is_open(3.7, 0.95),
            "near the other one"
        );
    }
}
