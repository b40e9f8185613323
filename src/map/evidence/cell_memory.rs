//! What one vehicle remembers of the cells of a tile beyond what it publishes: from how near each was seen empty, and
//! which echoes are explained by it. Which cell explains which echo is decided in [`super::echoes`].

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{TILE_CELLS, TileAddress};

use super::echoes::Echo;
use crate::map::tile::{FREE_TO, OCCUPIED_FROM};
use crate::map::{PARTS, Tile};

/// Looks after which a cell that was seen empty counts as empty.
const LOOKS_LEAST: u8 = 2;
/// What was seen empty from this near is published as surely free, centimetres.
pub(super) const NEAR_CM: u16 = 100;
/// No distance is as large, centimetres.
const NEVER: u16 = u16::MAX;
/// Published: an echo came from here and from nowhere else.
const CONFIRMED: i8 = 17;
/// Published: an echo is best explained by this cell.
const DOUBTFUL: i8 = 9;
/// Published: seen empty from near.
const SURELY_FREE: i8 = -17;
/// Published of a cell that was seen empty from afar: so much for each look, up to a few.
const FREE_LOOK: i8 = -4;
const FREE_LOOKS: u8 = 3;
/// All parts of a cell.
const ALL_PARTS: u16 = u16::MAX;

/// What is remembered of a cell.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) struct CellMemory {
    /// The nearest distance from which each quarter was seen empty, centimetres.
    near_cm: [u16; 4],
    /// Looks that saw a quarter of it empty, at least; saturating.
    looks: u8,
    /// Which of its 4 × 4 parts were seen empty, row by row.
    parts: u16,
    /// How many arcs of echoes pass through each part, weighted; saturating.
    votes: [u16; PARTS as usize],
    /// How many echoes it explains; saturating.
    echoes: u16,
    /// The shortest of their ranges, centimetres.
    nearest_echo_cm: u16,
    /// The sectors of 22.5° in which the sensor was when it heard them.
    bearings: u16,
    /// Nothing else can have given one of them.
    confirmed: bool,
}

impl Default for CellMemory {
    fn default() -> CellMemory {
        CellMemory {
            near_cm: [NEVER; 4],
            looks: 0,
            parts: 0,
            votes: [0; PARTS as usize],
            echoes: 0,
            nearest_echo_cm: NEVER,
            bearings: 0,
            confirmed: false,
        }
    }
}

impl CellMemory {
    /// Returns the distance from which every quarter was seen empty, centimetres; the largest number if one never was.
    #[inline]
    pub(super) fn seen_cm(&self) -> u16 {
        let [a, b, c, d] = self.near_cm;
        a.max(b).max(c.max(d))
    }

    /// Returns whether it was seen empty from so near, centimetres, or nearer: it cannot have given an echo.
    #[inline]
    pub(super) fn is_excluded(&self, near_cm: u16) -> bool {
        self.looks >= LOOKS_LEAST && self.seen_cm() <= near_cm
    }

    /// Returns whether it was seen empty, but only from farther than this, centimetres: an echo counts more.
    #[inline]
    pub(super) fn is_seen_from_afar(&self, near_cm: u16) -> bool {
        self.looks > 0 && self.seen_cm() > near_cm
    }

    /// Returns how many arcs pass through a part, weighted.
    #[inline]
    pub(super) fn votes(&self, part: usize) -> u16 {
        self.votes[part]
    }

    /// Returns whether it explains an echo.
    #[inline]
    pub(super) fn explains_echoes(&self) -> bool {
        self.echoes > 0
    }

    /// Returns whether nothing else can have given an echo that it explains.
    #[inline]
    pub(super) fn is_confirmed(&self) -> bool {
        self.confirmed
    }

    /// Returns the shortest range of the echoes that it explains, centimetres.
    #[inline]
    pub(super) fn nearest_echo_cm(&self) -> u16 {
        self.nearest_echo_cm
    }

    /// Returns which of its parts were seen empty, as bits, row by row.
    #[inline]
    pub(super) fn parts(&self) -> u16 {
        self.parts
    }

    /// Takes a look that saw some quarters empty from a distance; returns whether it was seen nearer, or better, than before.
    #[inline]
    pub(super) fn see_quarters(&mut self, quarters: u8, from_cm: u16) -> bool {
        let (looks, seen_cm) = (self.looks, self.seen_cm());
        for (quarter, near_cm) in self.near_cm.iter_mut().enumerate() {
            if quarters & (1 << quarter) != 0 {
                *near_cm = from_cm.min(*near_cm);
            }
        }
        self.looks = looks.saturating_add(1);
        looks < LOOKS_LEAST.max(FREE_LOOKS) || self.seen_cm() < seen_cm
    }

    /// Takes that a body covers some quarters: nothing else is there, which counts as seen from a distance. Returns whether
    /// that is news.
    pub(super) fn cover(&mut self, quarters: u8, from_cm: u16) -> bool {
        let before = *self;
        for (quarter, near_cm) in self.near_cm.iter_mut().enumerate() {
            if quarters & (1 << quarter) != 0 {
                *near_cm = from_cm.min(*near_cm);
            }
        }
        self.looks = self.looks.max(FREE_LOOKS);
        *self != before
    }

    /// Takes that parts were seen empty; returns whether that is news. What explains an echo stands in one of them: the last
    /// ones are not taken away.
    #[inline]
    pub(super) fn see_parts(&mut self, parts: u16) -> bool {
        let (before, after) = (self.parts, self.parts | parts);
        if after != ALL_PARTS || !self.explains_echoes() {
            self.parts = after;
        }
        self.parts != before
    }

    /// Takes that a body covers parts, so what explains an echo stands in others; returns whether that is news.
    pub(super) fn cover_parts(&mut self, parts: u16) -> bool {
        let (before, after) = (self.parts, self.parts | parts);
        let is_contradiction = after == ALL_PARTS && self.explains_echoes();
        self.parts = if is_contradiction { parts } else { after };
        self.parts != before
    }

    /// Takes back that parts were seen empty when all of a band, from which an echo came, were; returns whether it did.
    pub(super) fn reopen_parts(&mut self, band: u16) -> bool {
        let is_contradiction = band != 0 && self.parts & band == band;
        if is_contradiction {
            self.parts &= !band;
        }
        is_contradiction
    }

    /// Forgets that it was seen empty.
    pub(super) fn forget_looks(&mut self) {
        (self.looks, self.near_cm) = (0, [NEVER; 4]);
    }

    /// Counts an arc that passes through a part.
    #[inline]
    pub(super) fn vote(&mut self, part: usize, weight: u16) {
        self.votes[part] = self.votes[part].saturating_add(weight);
    }

    /// Takes an echo that it explains: from a range, heard in a sector; `sure` = nothing else can have given it.
    pub(super) fn give(&mut self, range_cm: u16, sector: u16, sure: bool) {
        self.echoes = self.echoes.saturating_add(1);
        self.nearest_echo_cm = self.nearest_echo_cm.min(range_cm);
        self.bearings |= sector;
        self.confirmed |= sure || are_apart(self.bearings);
    }

    /// Gives an echo away that something else explains.
    pub(super) fn take(&mut self) {
        self.echoes = self.echoes.saturating_sub(1);
        if self.echoes == 0 {
            self.clear_echoes();
        }
    }

    /// Forgets all echoes.
    pub(super) fn clear_echoes(&mut self) {
        (self.echoes, self.nearest_echo_cm, self.bearings) = (0, NEVER, 0);
        self.confirmed = false;
    }

    /// Returns whether it is published as free.
    #[inline]
    pub(super) fn is_free(&self) -> bool {
        i16::from(self.value()) <= FREE_TO
    }

    /// Returns what is published of it, 0.1 log-odds.
    #[inline]
    pub(super) fn value(&self) -> i8 {
        if self.echoes > 0 {
            if self.confirmed { CONFIRMED } else { DOUBTFUL }
        } else if self.looks >= LOOKS_LEAST && self.seen_cm() < NEVER {
            if self.seen_cm() <= NEAR_CM {
                SURELY_FREE
            } else {
                FREE_LOOK * self.looks.min(FREE_LOOKS) as i8
            }
        } else {
            0
        }
    }

    /// Returns what can be remembered of a cell of which only the published value is left.
    fn of_value(value: i8) -> CellMemory {
        let mut cell = CellMemory::default();
        if i16::from(value) >= OCCUPIED_FROM {
            cell.echoes = 1;
            cell.nearest_echo_cm = NEAR_CM;
            cell.confirmed = value >= CONFIRMED;
        } else if i16::from(value) <= FREE_TO {
            let near = if value <= SURELY_FREE {
                NEAR_CM
            } else {
                3 * NEAR_CM
            };
            cell.near_cm = [near; 4];
            cell.looks = (value / FREE_LOOK).unsigned_abs().min(FREE_LOOKS);
            cell.parts = ALL_PARTS;
        }
        cell
    }
}

/// Returns whether echoes came from bearings at least about 25° apart: from two of 16 sectors that are no neighbours.
fn are_apart(sectors: u16) -> bool {
    (2..=8).any(|turn| sectors & sectors.rotate_left(turn) != 0)
}

/// What is remembered of a tile.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct TileMemory {
    pub(super) address: TileAddress,
    /// Row-major, x fastest.
    pub(super) cells: Vec<CellMemory>,
    /// The echoes that were stored here, oldest first.
    pub(super) echoes: Vec<Echo>,
    /// The echo whose turn it is to be explained anew.
    pub(super) turn: usize,
    /// When it was used last, counted in uses of tiles.
    pub(super) used: u64,
}

impl TileMemory {
    /// Makes what can be remembered of a tile of which only what was published is left.
    pub(super) fn new(address: TileAddress, published: Option<&Tile>) -> TileMemory {
        let cells = match published {
            Some(tile) => tile
                .cells
                .iter()
                .map(|value| CellMemory::of_value(*value))
                .collect(),
            None => vec![CellMemory::default(); TILE_CELLS],
        };
        TileMemory {
            address,
            cells,
            echoes: Vec::new(),
            turn: 0,
            used: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_parts_of_what_explains_an_echo_are_not_taken_away() {
        let mut cell = CellMemory::default();
        assert!(cell.see_parts(ALL_PARTS) && cell.parts() == ALL_PARTS);
        cell.give(200, 1, false);
        assert!(
            cell.reopen_parts(0b1111),
            "the echo came from somewhere in it"
        );
        assert!(cell.see_parts(0b0011) && cell.parts() == !0b1100);
        assert!(!cell.see_parts(0b1100) && cell.parts() == !0b1100);
        cell.take();
        assert!(cell.see_parts(0b1100) && cell.parts() == ALL_PARTS);
    }

    #[test]
    fn what_explains_an_echo_stands_beside_the_body_that_covers_the_last_parts() {
        let mut cell = CellMemory::default();
        cell.see_parts(!0b0110);
        cell.give(200, 1, false);
        assert!(
            cell.cover_parts(0b1110),
            "nothing else is where the body is"
        );
        assert_eq!(cell.parts(), 0b1110);
        assert!(!cell.cover_parts(0b0110) && cell.parts() == 0b1110);
    }

    #[test]
    fn near_overrules_far_and_not_the_other_way_round() {
        let mut cell = CellMemory::default();
        for _ in 0..LOOKS_LEAST {
            cell.see_quarters(0b1111, 150);
        }
        assert!(cell.is_excluded(150) && !cell.is_excluded(149));
        assert!(cell.is_seen_from_afar(149) && !cell.is_seen_from_afar(150));
    }

    #[test]
    fn what_somebody_has_seen_empty_from_near_outweighs_what_another_one_supposes() {
        assert!(i16::from(SURELY_FREE) + i16::from(DOUBTFUL) <= FREE_TO);
        assert!(i16::from(SURELY_FREE) + i16::from(CONFIRMED) > FREE_TO);
        assert!(i16::from(DOUBTFUL) >= OCCUPIED_FROM);
    }
}
