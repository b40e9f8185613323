//! From where each small part of the ground was looked at in vain, so that nothing is looked at for ever: from every
//! place once, and from a few places only ([`Rigour`]). Pure bookkeeping.

use serde::{Deserialize, Serialize};

use crate::geom::{Cell, Lattice, Point};

/// Side of a part, metres.
const PART_M: f64 = 0.6;

/// How thoroughly what is unknown is looked at: first what promises much, in few looks; when nothing of that is left, the rest.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) enum Rigour {
    /// Long frontiers, from a few places.
    Quick,
    /// Every frontier with ground behind it on which nothing is known to stand, from more places.
    Thorough,
    /// Faces of what stands that were never looked at from in front.
    Faces,
}

impl Rigour {
    /// Returns after how many looks at a part that tell nothing it is looked at no more.
    fn looks_max(self) -> usize {
        match self {
            Rigour::Quick => 4,
            Rigour::Thorough => 6,
            Rigour::Faces => 2,
        }
    }

    /// Returns how far apart the places of two looks are that may tell different things, metres.
    fn apart_m(self) -> f64 {
        match self {
            Rigour::Quick => 0.8,
            Rigour::Thorough | Rigour::Faces => 0.5,
        }
    }

    /// Returns how long a frontier must be to be worth a look, metres.
    pub(super) fn frontier_m(self) -> f64 {
        match self {
            Rigour::Quick => 0.6,
            Rigour::Thorough | Rigour::Faces => 0.0,
        }
    }

    /// Returns whether a look from a place at what was looked at from others would tell something new.
    pub(super) fn is_new(self, looked_from: &[Point], from: Point) -> bool {
        looked_from
            .iter()
            .all(|place| place.distance_to(from) >= self.apart_m())
    }
}

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
    pub(super) fn is_spent(&self, cell: Cell, rigour: Rigour) -> bool {
        self.places_of(cell).len() >= rigour.looks_max()
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
        let (cell, beside, far) = (Cell::new(-1, 4), Cell::new(-3, 5), Cell::new(0, 4));
        for (rigour, looks_max, apart_m) in [(Rigour::Quick, 4, 0.8), (Rigour::Thorough, 6, 0.5)] {
            let mut looks = LookHistory::new(Lattice::new(0.2));
            let is_new = |looks: &LookHistory, cell, x_m| {
                rigour.is_new(looks.places_of(cell), Point::new(x_m, 0.0))
            };
            for place in 0..looks_max {
                let x_m = f64::from(place) * (apart_m + 0.01);
                assert!(is_new(&looks, cell, x_m) && !looks.is_spent(cell, rigour));
                looks.note(&[cell, beside], Point::new(x_m, 0.0));
                assert!(!is_new(&looks, beside, x_m), "it belongs to the same part");
            }
            assert!(looks.is_spent(cell, rigour) && looks.is_spent(beside, rigour));
            assert!(!looks.is_spent(far, rigour) && is_new(&looks, far, 0.0));
        }
    }
}
