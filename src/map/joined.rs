//! What all layers say together of the cells of a tile: the sum, and what a sum hides.

use tomoswarm_proto::{TILE_CELLS, TILE_SIDE};

use super::tile::{CONFIRMED_FROM, FREE_TO, LAYER_CLAMP, OCCUPIED_FROM, Occupancy};

/// What layers say together of a cell.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct SaidTogether {
    /// The sum, unclamped, 0.1 log-odds; at most `MAX_LAYERS` × `LAYER_CLAMP`, so it fits. But silence from afar counts once,
    /// however many have heard it: a wall is silent to all who look along it. And what one layer has confirmed is occupied as
    /// long as nobody has seen it empty from near. The trusted layer's vehicle drives by what it heard from where it takes
    /// itself to be, and the places of others deviate from that: where it has heard nothing, from afar, that is unknown to it
    /// and not occupied, so that it looks itself; what it holds for occupied is not free as long, and what it has confirmed is
    /// not free at all; what it has seen empty from near is free, whatever the others heard there: often its vehicle.
    pub sum: i16,
    /// Whether some layer holds it for confirmed.
    pub is_confirmed: bool,
    /// Whether the sum leaves it unknown although one layer alone would know it: the layers contradict each other.
    pub is_disputed: bool,
}

impl SaidTogether {
    /// Joins what each layer says; `trusted` is what the trusted one says, 0 if there is none.
    pub(super) fn of(values: impl Iterator<Item = i8>, trusted: i8) -> SaidTogether {
        let (mut sum, mut from_afar) = (0, 0);
        let (mut is_confirmed, mut is_surely_free, mut is_known) = (false, false, false);
        for value in values {
            match value > -LAYER_CLAMP && value < 0 {
                true => from_afar = from_afar.min(i16::from(value)),
                false => sum += i16::from(value),
            }
            is_confirmed |= value >= CONFIRMED_FROM;
            is_surely_free |= value <= -LAYER_CLAMP;
            is_known |= Occupancy::of_value(i16::from(value)) != Occupancy::Unknown;
        }
        sum += from_afar;
        let is_trusted = Occupancy::of_value(i16::from(trusted)) == Occupancy::Occupied;
        if is_confirmed && !is_surely_free {
            sum = sum.max(if trusted < 0 {
                FREE_TO + 1
            } else {
                OCCUPIED_FROM
            });
        }
        if (is_trusted && !is_surely_free) || trusted >= CONFIRMED_FROM {
            sum = sum.max(FREE_TO + 1);
        }
        if trusted <= -LAYER_CLAMP {
            sum = sum.min(FREE_TO);
        }
        SaidTogether {
            sum,
            is_confirmed,
            is_disputed: is_known && Occupancy::of_value(sum) == Occupancy::Unknown,
        }
    }
}

/// The same of all cells of a tile.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct JoinedTile {
    /// Row-major, x fastest.
    pub sums: [i16; TILE_CELLS],
    confirmed: CellBits,
    disputed: CellBits,
}

impl Default for JoinedTile {
    fn default() -> JoinedTile {
        JoinedTile {
            sums: [0; TILE_CELLS],
            confirmed: CellBits::default(),
            disputed: CellBits::default(),
        }
    }
}

impl JoinedTile {
    /// Sets what is said of a cell, by its place in the tile.
    pub(super) fn set(&mut self, place: usize, said: SaidTogether) {
        self.sums[place] = said.sum;
        self.confirmed.set(place, said.is_confirmed);
        self.disputed.set(place, said.is_disputed);
    }

    /// Returns whether some layer holds a cell for confirmed.
    #[inline]
    pub(super) fn is_confirmed(&self, place: usize) -> bool {
        self.confirmed.has(place)
    }

    /// Returns whether a cell is unknown because layers contradict each other about it.
    #[inline]
    pub(super) fn is_disputed(&self, place: usize) -> bool {
        self.disputed.has(place)
    }
}

/// A bit for each cell of a tile, a word for each row.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
struct CellBits([u32; TILE_SIDE]);

impl CellBits {
    fn set(&mut self, place: usize, is_set: bool) {
        let (row, bit) = (place / TILE_SIDE, 1 << (place % TILE_SIDE));
        match is_set {
            true => self.0[row] |= bit,
            false => self.0[row] &= !bit,
        }
    }

    #[inline]
    fn has(self, place: usize) -> bool {
        self.0[place / TILE_SIDE] & (1 << (place % TILE_SIDE)) != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(values: &[i8]) -> SaidTogether {
        SaidTogether::of(values.iter().copied(), 0)
    }

    #[test]
    fn what_one_has_confirmed_others_free_from_near_only() {
        let sum = |values: &[i8]| said(values).sum;
        assert_eq!(sum(&[17, -12, -12, -12]), OCCUPIED_FROM);
        assert_eq!(sum(&[17, -12, -17, -12]), -12, "one has been near");
        assert_eq!(sum(&[17, 17, -12]), 22);
        assert_eq!(sum(&[17, -17, -17]), -17);
    }

    #[test]
    fn silence_from_afar_counts_once() {
        let sum = |values: &[i8]| said(values).sum;
        assert_eq!(sum(&[-12, -12]), -12);
        assert_eq!(sum(&[-3, -12, -6]), -12);
        assert_eq!(sum(&[9, -12, -12, -12]), -3, "what is doubtful is unknown");
        assert_eq!(sum(&[9, 9, -12, -12]), 6, "still");
        assert_eq!(sum(&[9, 9, 9, -12]), 15);
        assert_eq!(sum(&[-17, -17, -12]), -46);
        let doubtful = said(&[9, -12, -12]);
        assert!(doubtful.is_disputed);
    }

    #[test]
    fn the_trusted_layer_is_outvoted_neither_in_what_it_has_confirmed_nor_in_what_it_saw_empty_from_near()
     {
        let said = |values: &[i8], trusted| SaidTogether::of(values.iter().copied(), trusted);
        let kept = said(&[17, -17, -17, -17], 17);
        assert_eq!((kept.sum, kept.is_disputed), (FREE_TO + 1, true));
        assert_eq!(said(&[9, -17, -17], 9).sum, -25, "one has been near");
        assert_eq!(said(&[9, -12, -12], 9).sum, -3);
        assert_eq!(said(&[17, -17, -17], -17).sum, -17, "a peer confirmed it");
        let seen_empty = said(&[-17, 17, 17, 17], -17);
        assert_eq!((seen_empty.sum, seen_empty.is_disputed), (FREE_TO, false));
        let afar = said(&[-12, 17], -12);
        assert_eq!(
            (afar.sum, afar.is_disputed),
            (5, true),
            "it looked from afar"
        );
        assert_eq!(said(&[-12, -17, 17], -12).sum, -12);
        assert_eq!(said(&[17, -12], 0).sum, OCCUPIED_FROM, "it has not looked");
        assert_eq!(said(&[17, 17, -9], 17).sum, 25);
    }

    #[test]
    fn a_cell_is_disputed_when_one_layer_alone_would_know_it() {
        for (values, is_disputed) in [
            (&[][..], false),
            (&[-3, 4], false),
            (&[-3, -4], false),
            (&[-17, 17], true),
            (&[-12, 9], true),
            (&[-12, 4], false),
            (&[-12, 5], true),
            (&[17, -9], false),
            (&[9, -9], true),
            (&[17, 17, -9], false),
        ] {
            assert_eq!(said(values).is_disputed, is_disputed, "{values:?}");
        }
    }

    #[test]
    fn what_is_said_of_a_cell_anew_takes_the_place_of_what_was_said() {
        let mut tile = JoinedTile::default();
        for (values, is_confirmed, is_disputed) in
            [(&[17, -17][..], true, true), (&[-17], false, false)]
        {
            for place in [0, 33, TILE_CELLS - 1] {
                tile.set(place, said(values));
                assert_eq!(tile.is_confirmed(place), is_confirmed);
                assert_eq!(tile.is_disputed(place), is_disputed);
                assert!(!tile.is_confirmed(place ^ 1) && !tile.is_disputed(place ^ 1));
            }
        }
        assert_eq!(tile.sums[33], -17);
    }
}
