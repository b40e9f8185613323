//! Where one gets to at all, whatever it costs: the connected component of the open cells around a start.
//!
//! It takes a small part of the time of [`super::Distances`], and says of every cell the same: reached or not.

use super::SearchGrid;
use super::steps::Rules;
use super::terrain::Escape;
use crate::geom::Cell;
use crate::map::CellRect;

/// The cells that can be reached from a start.
#[derive(Clone, Debug)]
pub struct Component {
    area: CellRect,
    width: usize,
    /// Row-major, x fastest; empty when the vehicle cannot set out.
    reached: Vec<bool>,
}

impl Component {
    /// Finds all cells that can be reached from a start by ways that cut no corners; of the rules only the escape is heeded: a
    /// start too near to something may be left over what is too near as well. None can be reached from a start that is
    /// barred or outside.
    pub fn around(grid: &SearchGrid, start: Cell, rules: &Rules) -> Component {
        debug_assert!(!rules.cut_corners);
        let (width, height) = grid.size();
        let mut component = Component {
            area: grid.area(),
            width,
            reached: Vec::new(),
        };
        let Some(first) = grid.index(start) else {
            return component;
        };
        let escape = Escape {
            from: start,
            reach_cells: rules.escape_m / grid.lattice().cell_m(),
        };
        let is_escaping = !grid.open(first);
        let is_near = |index: usize| grid.only_near(index) && escape.reaches(grid.cell(index));
        if is_escaping && !(escape.reach_cells > 0.0 && is_near(first)) {
            return component;
        }
        // A step aside past two open cells leads nowhere where steps straight ahead do not lead as well: rows do.
        let is_open = |index: usize| grid.open(index) || (is_escaping && is_near(index));
        component.reached = vec![false; width * height];
        let mut seeds = vec![first];
        while let Some(seed) = seeds.pop() {
            if component.reached[seed] {
                continue;
            }
            let row = seed / width * width;
            let mut low = seed;
            while low > row && is_open(low - 1) {
                low -= 1;
            }
            let mut high = seed;
            while high + 1 < row + width && is_open(high + 1) {
                high += 1;
            }
            component.reached[low..=high].fill(true);
            let (below, above) = (row.checked_sub(width), row + width);
            let beside = below
                .into_iter()
                .chain((above < width * height).then_some(above));
            for beside in beside {
                let mut was_open = false;
                for index in (low..=high).map(|index| index - row + beside) {
                    let is_new = is_open(index) && !component.reached[index];
                    if is_new && !was_open {
                        seeds.push(index);
                    }
                    was_open = is_new;
                }
            }
        }
        component
    }

    /// Returns whether the vehicle cannot set out at all.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.reached.is_empty()
    }

    /// Returns whether a cell can be reached; `false` outside the grid.
    #[inline]
    pub fn contains(&self, cell: Cell) -> bool {
        if !self.area.contains(cell) {
            return false;
        }
        let (x, y) = (
            cell.x.abs_diff(self.area.low.x) as usize,
            cell.y.abs_diff(self.area.low.y) as usize,
        );
        self.reached
            .get(y * self.width + x)
            .is_some_and(|reached| *reached)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Lattice;
    use crate::plan::Distances;
    use proptest::prelude::*;

    const SIDE: i32 = 20;

    proptest! {
        #[test]
        fn what_is_reached_is_what_a_search_for_ways_reaches(
            stones in proptest::collection::vec((-3..SIDE - 3, -5..SIDE - 5), 0..160),
            escape_m in 0.0..0.8f64, clearance_m in 0.0..0.5f64,
            from in (-4..SIDE - 2, -6..SIDE - 4), diagonal in any::<bool>(),
        ) {
            let area = CellRect::new(Cell::new(-3, -5), Cell::new(SIDE - 4, SIDE - 6));
            let grid = SearchGrid::of_cells(Lattice::new(0.2), area, clearance_m, |cell| {
                stones.contains(&(cell.x, cell.y))
            })
            .unwrap();
            let rules = Rules { escape_m, diagonal, ..Rules::default() };
            let start = Cell::new(from.0, from.1);
            let component = Component::around(&grid, start, &rules);
            let ways = Distances::from_start(&grid, start, &rules);
            for cell in area.grown(1).cells() {
                let is_reached = ways.as_ref().is_ok_and(|ways| ways.cost_m(cell).is_some());
                prop_assert_eq!(component.contains(cell), is_reached, "{:?}", cell);
            }
        }
    }
}
