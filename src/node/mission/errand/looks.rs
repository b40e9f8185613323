//! How often each cell was looked at in vain. Pure bookkeeping.

use serde::{Deserialize, Serialize};

use crate::geom::Cell;

/// So many looks at a cell that tell nothing, and it is looked at no more.
pub const LOOKS_MAX: u8 = 3;

/// Looks by cell.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Looks {
    /// Ascending by row and column.
    counts: Vec<((i32, i32), u8)>,
}

impl Looks {
    /// Counts a look.
    pub fn note(&mut self, cell: Cell) {
        match self.counts.binary_search_by_key(&key(cell), |(known, _)| *known) {
            Ok(index) => self.counts[index].1 = self.counts[index].1.saturating_add(1),
            Err(index) => self.counts.insert(index, (key(cell), 1)),
        }
    }

    /// Gives how often a cell was looked at.
    pub fn of(&self, cell: Cell) -> u8 {
        let found = self.counts.binary_search_by_key(&key(cell), |(known, _)| *known);
        found.map_or(0, |index| self.counts[index].1)
    }
}

fn key(cell: Cell) -> (i32, i32) {
    (cell.y, cell.x)
}
