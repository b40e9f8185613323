//! From where each small part of the ground was looked at in vain, so that nothing is looked at for ever: from every
//! place once, and from a few places only. Pure bookkeeping.

use serde::{Deserialize, Serialize};

use crate::geom::{Cell, Lattice, Point};

/// So many looks at a part that tell nothing, and it is looked at no more.
const LOOKS_MAX: usize = 4;
/// Side of a part, metres.
const PART_M: f64 = 0.6;
/// Two looks are from different places when these are so far apart, metres.
const APART_M: f64 = 0.8;

/// Looks by part of the ground.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct LookHistory {
    /// Cells along the side of a part.
    side_cells: i32,
    /// Ascending by row and column.
    from: Vec<((i32, i32), Vec<Point>)>,
}

impl LookHistory {
    /// Makes the table of a map on which nothing was looked at.
    pub(super) fn new(lattice: Lattice) -> LookHistory {
        let side_cells = ((PART_M / lattice.cell_m()).round() as i32).max(1);
        LookHistory {
            side_cells,
            from: Vec::new(),
        }
    }

    /// Notes a look at cells from a place; each part that holds some of them was looked at once.
    pub(super) fn note(&mut self, cells: &[Cell], from: Point) {
        let mut parts: Vec<(i32, i32)> = cells.iter().map(|cell| self.part(*cell)).collect();
        parts.sort_unstable();
        parts.dedup();
        for part in parts {
            match self.from.binary_search_by_key(&part, |(known, _)| *known) {
                Ok(index) => self.from[index].1.push(from),
                Err(index) => self.from.insert(index, (part, vec![from])),
            }
        }
    }

    /// Returns whether a cell was looked at often enough.
    pub(super) fn is_spent(&self, cell: Cell) -> bool {
        self.places_of(cell).len() >= LOOKS_MAX
    }

    /// Returns whether a look from a place at what was looked at from others would tell something new.
    pub(super) fn is_new(looked_from: &[Point], from: Point) -> bool {
        looked_from
            .iter()
            .all(|place| place.distance_to(from) >= APART_M)
    }

    /// Returns from where the part was looked at that a cell belongs to.
    pub(super) fn places_of(&self, cell: Cell) -> &[Point] {
        let found = self
            .from
            .binary_search_by_key(&self.part(cell), |(known, _)| *known);
        found.map_or(&[], |index| &self.from[index].1)
    }

    fn part(&self, cell: Cell) -> (i32, i32) {
        (
            cell.y.div_euclid(self.side_cells),
            cell.x.div_euclid(self.side_cells),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_looked_at_from_a_few_places_and_from_each_once() {
        let mut looks = LookHistory::new(Lattice::new(0.2));
        let is_new =
            |looks: &LookHistory, cell, from| LookHistory::is_new(looks.places_of(cell), from);
        let (cell, beside, far) = (Cell::new(-1, 4), Cell::new(-3, 5), Cell::new(0, 4));
        for place in 0..4 {
            let from = Point::new(f64::from(place), 0.0);
            assert!(is_new(&looks, cell, from) && !looks.is_spent(cell));
            looks.note(&[cell, beside], from);
            assert!(!is_new(&looks, beside, from), "it belongs to the same part");
        }
        assert!(looks.is_spent(cell) && looks.is_spent(beside));
        assert!(!looks.is_spent(far) && is_new(&looks, far, Point::default()));
    }
}
