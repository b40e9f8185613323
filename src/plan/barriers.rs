//! What bars the way, part by part: for grids finer than the map's cells, where a doorway is as wide as it was seen.

use std::ops::{Range, RangeInclusive};

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
/// So much more than is required is wished for beside what was heard, cells: its echoes then halt nobody.
const WISHED_CELLS: f64 = 0.75;

/// How far apart the nodes of a grid lie that is finer than the map's cells.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum NodeSpacing {
    /// Half a cell.
    HalfCell,
    /// A part of a cell: four times as many nodes, and ways between those of half cells.
    Part,
}

impl NodeSpacing {
    /// Returns the number of parts along the side of a node's square.
    fn parts(self) -> i32 {
        match self {
            NodeSpacing::HalfCell => SIDE / 2,
            NodeSpacing::Part => 1,
        }
    }

    /// Returns the number of nodes along the side of a cell.
    pub(super) fn per_cell(self) -> i32 {
        SIDE / self.parts()
    }
}

/// A row of nodes, and some of its columns, both counted from another node.
type NodeRow = (i32, RangeInclusive<i32>);

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
    nodes: NodeSpacing,
    /// Row-major, x fastest.
    kinds: Vec<u8>,
    clearance: RequiredClearance,
    /// Where the vehicle stands that keeps this.
    stands: Point,
}

impl Barriers {
    /// Copies the parts of a rectangle of cells, of those that `bars` says bar.
    pub(super) fn of_view(
        view: &View<'_>,
        area: CellRect,
        clearance: RequiredClearance,
        bars: impl Fn(Cell, Bar) -> bool,
        stands: Point,
        nodes: NodeSpacing,
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
            nodes,
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
            if bars(cell, barred.bar) {
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
    pub(super) fn mark(&self, mut mark: impl FnMut(usize, RangeInclusive<usize>, Nearness)) {
        let rims = [UNKNOWN, OCCUPIED].map(|kind| self.rims(kind));
        let side = self.nodes.parts() as usize;
        for (y, line) in self.kinds.chunks_exact(self.width).enumerate() {
            let beside_vehicle = self.beside_vehicle(y);
            for (x, kind) in line.iter().enumerate() {
                if *kind == OPEN {
                    continue;
                }
                let (column, row) = (x / side, y / side);
                mark(row, column..=column, Nearness::Solid);
                // Around a vehicle that stands too near, each part has a distance of its own.
                let required_m = self.required_m(*kind);
                let kept_m = match beside_vehicle.contains(&x) {
                    true => self.kept_m(self.part(x, y)).unwrap_or(0.0),
                    false => required_m,
                };
                if kept_m != required_m {
                    for (nearness, kept_m) in self.rings(*kind, kept_m) {
                        let place = ((x % side) as i32, (y % side) as i32);
                        let near = self.nodes_within(place, kept_m);
                        self.mark_nodes((column, row), near, |row, columns| {
                            mark(row, columns, nearness);
                        });
                    }
                } else if self.is_on_rim(x, y, *kind) {
                    let place = (y % side) * side + x % side;
                    for (nearness, near) in &rims[usize::from(*kind - UNKNOWN)][place] {
                        self.mark_nodes((column, row), near.iter().cloned(), |row, columns| {
                            mark(row, columns, *nearness);
                        });
                    }
                }
            }
        }
    }

    /// Returns how far around a part of this kind its nodes are marked, metres.
    fn rings(&self, kind: u8, kept_m: f64) -> impl Iterator<Item = (Nearness, f64)> + use<> {
        let wished_m = kept_m + WISHED_CELLS * f64::from(SIDE) * self.lattice.cell_m();
        let rings = [
            (Nearness::Solid, self.clearance.body_m.min(kept_m)),
            (Nearness::TooNear, kept_m),
            (Nearness::Nearer, wished_m),
        ];
        let count = if kind == OCCUPIED { 3 } else { 2 };
        rings.into_iter().take(count)
    }

    /// Returns the nodes around a part of this kind that keeps what is required, for each place of a part in its node.
    fn rims(&self, kind: u8) -> Vec<Vec<(Nearness, Vec<NodeRow>)>> {
        let side = self.nodes.parts();
        let places = (0..side).flat_map(|y| (0..side).map(move |x| (x, y)));
        let around = |place| {
            let rings = self.rings(kind, self.required_m(kind));
            rings
                .map(|(nearness, kept_m)| (nearness, self.nodes_within(place, kept_m).collect()))
                .collect()
        };
        places.map(around).collect()
    }

    /// Returns the nodes that are nearer to a part than `kept_m`, by row, counted from the node that holds the part at this
    /// place. In units of half a part: parts lie at odd places, nodes of half a cell at every fourth from 2 on, those of a part
    /// where the parts are.
    fn nodes_within(
        &self,
        (x, y): (i32, i32),
        kept_m: f64,
    ) -> impl Iterator<Item = NodeRow> + use<> {
        let unit_m = self.lattice.cell_m() / 2.0;
        let reach = kept_m / unit_m * (1.0 - 1e-12);
        let parts = self.nodes.parts();
        // All places are whole numbers of units, so of a reach its whole part counts.
        let between = move |at: i32, reach: f64| {
            let (at, reach, apart) = (2 * at + 1 - parts, reach as i32, 2 * parts);
            (at - reach + apart - 1).div_euclid(apart)..=(at + reach).div_euclid(apart)
        };
        between(y, reach).map(move |row| {
            let up = f64::from(2 * parts * row + parts - (2 * y + 1));
            let aside = (reach * reach - up * up).max(0.0).sqrt();
            (row, between(x, aside))
        })
    }

    /// Calls `mark` with those of the nodes around one that lie in the grid.
    fn mark_nodes(
        &self,
        (column, row): (usize, usize),
        near: impl Iterator<Item = NodeRow>,
        mut mark: impl FnMut(usize, RangeInclusive<usize>),
    ) {
        let (columns, rows) = (
            self.width as i32 / self.nodes.parts(),
            (self.kinds.len() / self.width) as i32 / self.nodes.parts(),
        );
        for (up, aside) in near {
            let row = row as i32 + up;
            let (first, last) = (
                (column as i32 + aside.start()).max(0),
                (column as i32 + aside.end()).min(columns - 1),
            );
            if (0..rows).contains(&row) && first <= last {
                mark(row as usize, first as usize..=last as usize);
            }
        }
    }

    /// Returns the columns of a row in which a part may lie nearer to the vehicle than is required, and a few more.
    fn beside_vehicle(&self, y: usize) -> Range<usize> {
        let middle = self.lattice.centre(self.part(0, y));
        let reach_m = self.clearance.most_m();
        if (middle.y_m - self.stands.y_m).abs() > reach_m {
            return 0..0;
        }
        let column = |x_m: f64| ((x_m - middle.x_m) / self.lattice.cell_m()).max(0.0) as usize;
        column(self.stands.x_m - reach_m)..column(self.stands.x_m + reach_m) + 2
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

    fn part(&self, x: usize, y: usize) -> Cell {
        Cell::new(self.area.low.x + x as i32, self.area.low.y + y as i32)
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
    use crate::map::{CellRect, Merged};
    use crate::plan::{
        Corridor, NodeSpacing, RequiredClearance, Rules, SearchGrid, shortest_route,
    };

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
            nodes in prop::sample::select(vec![NodeSpacing::HalfCell, NodeSpacing::Part]),
        ) {
            let map = map(&barred);
            let area = CellRect::new(Cell::new(0, 0), Cell::new(31, 31));
            let view = map.view(0, CellRect::new(Cell::new(-32, -32), Cell::new(63, 63)));
            let planned = RequiredClearance::planned(0.25, safety_m, 0.04, CELL_M);
            let (from, to) = (Point::new(from.0, from.1), Point::new(to.0, to.1));
            let grid = SearchGrid::of_parts(&view, area, planned, |_, _| true, from, nodes).unwrap();
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
        let (view, nodes) = (map.view(0, area), NodeSpacing::HalfCell);
        let grid = SearchGrid::of_parts(&view, area, planned, |_, _| true, from, nodes).unwrap();
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

    #[test]
    fn a_way_between_the_nodes_of_half_cells_is_found_over_those_of_parts() {
        // A wall with a gap of 0.8 m.
        let wall = |x: i32| {
            (0..32)
                .filter(move |y| (14..=16).contains(y))
                .map(move |y| (x, y, true))
        };
        let barred: Vec<(i32, i32, bool)> = (0..32)
            .filter(|x| !(13..=16).contains(x))
            .flat_map(wall)
            .collect();
        let map = map(&barred);
        let area = CellRect::new(Cell::new(0, 0), Cell::new(31, 31));
        let view = map.view(0, area);
        let (from, to) = (Point::new(3.0, 1.0), Point::new(3.0, 5.0));
        // The middles of its parts lie 0.85 m apart: a node of half a cell 0.375 m from one, a node of a part 0.4 m.
        let is_passed = |kept_m: f64, nodes| {
            let clearance = RequiredClearance::everywhere(kept_m);
            let grid = SearchGrid::of_parts(&view, area, clearance, |_, _| true, from, nodes);
            shortest_route(&grid.unwrap(), from, to, &RULES).is_ok()
        };
        assert!(is_passed(0.37, NodeSpacing::HalfCell));
        assert!(!is_passed(0.39, NodeSpacing::HalfCell) && is_passed(0.39, NodeSpacing::Part));
        assert!(!is_passed(0.41, NodeSpacing::Part));
    }
}
