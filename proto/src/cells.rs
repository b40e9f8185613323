//! The cells of a tile: runs of equal cells, as bytes where the format has bytes, as `[count, cell]` where people read it.
//!
//! Bytes are a sequence of pieces. A control byte c under 128 is followed by c + 1 cells as they are; from 128 up
//! one cell follows that stands c − 125 times (3 to 130). Together the pieces hold 1024 cells, neither more nor fewer.
//! A tile never takes more than [`BYTES_MAX`] bytes, and reading reserves no memory by what a length claims.

use std::fmt;
use std::sync::Arc;

use serde::de::{Deserializer, Error, SeqAccess, Visitor};
use serde::ser::{SerializeSeq as _, Serializer};

use crate::TILE_CELLS;

/// A tile takes at most this many bytes: all cells as they are, in pieces of 128.
pub(crate) const BYTES_MAX: usize = TILE_CELLS + TILE_CELLS / LITERALS;
/// Cells of a piece of cells as they are, at most.
const LITERALS: usize = 128;
/// Cells of a run, at least and at most.
const RUN: std::ops::RangeInclusive<usize> = 3..=130;
/// Control bytes from this one up stand for runs.
const RUN_FROM: usize = 128;

/// Writes cells.
pub(crate) fn serialize<S: Serializer>(
    cells: &[i8; TILE_CELLS],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    if serializer.is_human_readable() {
        let mut list = serializer.serialize_seq(None)?;
        for run in cells.chunk_by(|a, b| a == b) {
            list.serialize_element(&(run.len(), run[0]))?;
        }
        return list.end();
    }
    serializer.serialize_bytes(&packed(cells))
}

/// Reads cells.
pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Arc<[i8; TILE_CELLS]>, D::Error> {
    if deserializer.is_human_readable() {
        return deserializer.deserialize_seq(Cells);
    }
    deserializer.deserialize_bytes(Cells)
}

struct Cells;

impl<'de> Visitor<'de> for Cells {
    type Value = Arc<[i8; TILE_CELLS]>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the 1024 cells of a tile")
    }

    fn visit_bytes<E: Error>(self, bytes: &[u8]) -> Result<Self::Value, E> {
        unpacked(bytes).ok_or_else(|| E::custom("a tile has 1024 cells"))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
        let mut cells = [0; TILE_CELLS];
        let mut left = &mut cells[..];
        while let Some((count, cell)) = list.next_element::<(usize, i8)>()? {
            let (run, rest) = left
                .split_at_mut_checked(count)
                .ok_or_else(|| A::Error::custom("a tile has 1024 cells, these are more"))?;
            run.fill(cell);
            left = rest;
        }
        match left.len() {
            0 => Ok(Arc::new(cells)),
            lacking => Err(A::Error::invalid_length(
                TILE_CELLS - lacking,
                &"1024 cells",
            )),
        }
    }
}

/// Returns the cells of a tile as runs of equal cells: the bytes that a tile has on the wire, without their length.
pub fn packed(cells: &[i8; TILE_CELLS]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(BYTES_MAX);
    let (mut at, mut plain_from) = (0, 0);
    while at < TILE_CELLS {
        let value = cells[at];
        let run = cells[at..]
            .iter()
            .take(*RUN.end())
            .take_while(|cell| **cell == value)
            .count();
        if RUN.contains(&run) {
            put_plain(&cells[plain_from..at], &mut bytes);
            bytes.extend([(run - RUN.start() + RUN_FROM) as u8, value.cast_unsigned()]);
            plain_from = at + run;
        }
        at += run;
    }
    put_plain(&cells[plain_from..], &mut bytes);
    bytes
}

/// Puts cells as they are.
fn put_plain(cells: &[i8], bytes: &mut Vec<u8>) {
    for piece in cells.chunks(LITERALS) {
        bytes.push((piece.len() - 1) as u8);
        bytes.extend(piece.iter().map(|cell| cell.cast_unsigned()));
    }
}

/// Returns the cells, if there are exactly 1024.
fn unpacked(mut bytes: &[u8]) -> Option<Arc<[i8; TILE_CELLS]>> {
    let mut cells = Arc::new([0; TILE_CELLS]);
    let mut left: &mut [i8] = Arc::get_mut(&mut cells)?;
    while let Some((control, rest)) = bytes.split_first() {
        let control = usize::from(*control);
        let count = if control < RUN_FROM {
            control + 1
        } else {
            control - RUN_FROM + RUN.start()
        };
        let (filled, behind) = left.split_at_mut_checked(count)?;
        if control < RUN_FROM {
            let (plain, rest) = rest.split_at_checked(count)?;
            filled
                .iter_mut()
                .zip(plain)
                .for_each(|(cell, byte)| *cell = byte.cast_signed());
            bytes = rest;
        } else {
            let (value, rest) = rest.split_first()?;
            filled.fill(value.cast_signed());
            bytes = rest;
        }
        left = behind;
    }
    left.is_empty().then_some(cells)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Cells in stretches, as maps have them, with noise between.
    fn stretches() -> impl Strategy<Value = Vec<i8>> {
        let stretch = (prop_oneof![1..5_usize, 100..300_usize], any::<i8>());
        prop::collection::vec(stretch, 1..300).prop_map(|stretches| {
            let cells = stretches
                .into_iter()
                .flat_map(|(count, value)| std::iter::repeat_n(value, count));
            cells.chain(std::iter::repeat(0)).take(TILE_CELLS).collect()
        })
    }

    proptest! {
        #[test]
        fn cells_survive_and_never_take_more_than_the_limit(cells in stretches()) {
            let cells: [i8; TILE_CELLS] = cells.try_into().unwrap();
            let bytes = packed(&cells);
            prop_assert!(bytes.len() <= BYTES_MAX);
            prop_assert_eq!(unpacked(&bytes), Some(Arc::new(cells)));
            prop_assert_eq!(unpacked(&bytes[..bytes.len() - 1]), None);
            prop_assert_eq!(unpacked(&[&bytes[..], &[0, 1]].concat()), None);
        }

        #[test]
        fn whatever_is_read_stays_the_same_when_written_again(
            pieces in prop::collection::vec((any::<u8>(), prop::collection::vec(any::<u8>(), 128)), 1..200),
        ) {
            let pieces = pieces.iter().flat_map(|(control, cells)| {
                let cells = if *control < 128 { &cells[..=usize::from(*control)] } else { &cells[..1] };
                [*control].into_iter().chain(cells.iter().copied())
            });
            let bytes: Vec<u8> = pieces.collect();
            for end in 0..bytes.len().min(1200) {
                if let Some(cells) = unpacked(&bytes[..end]) {
                    prop_assert_eq!(unpacked(&packed(&cells)), Some(cells));
                }
            }
        }
    }

    #[test]
    fn the_worst_tile_takes_the_limit_and_an_even_one_next_to_nothing() {
        let worst: [i8; TILE_CELLS] = std::array::from_fn(|index| (index % 7) as i8);
        assert_eq!(packed(&worst).len(), BYTES_MAX);
        assert_eq!(packed(&[-17; TILE_CELLS]).len(), 16);
        let wall: [i8; TILE_CELLS] = std::array::from_fn(|index| if index < 32 { 17 } else { -17 });
        assert_eq!(
            packed(&wall),
            [
                [128 + 29, 17],
                [255, 239],
                [255, 239],
                [255, 239],
                [255, 239],
                [255, 239],
                [255, 239],
                [255, 239],
                [128 + 79, 239],
            ]
            .concat()
        );
    }

    #[test]
    fn too_few_or_too_many_cells_are_none() {
        for bytes in [&[][..], &[0, 1], &[255, 1], &[127], &[200]] {
            assert_eq!(unpacked(bytes), None, "{bytes:?}");
        }
        assert_eq!(unpacked(&[255, 3].repeat(8)), None);
        let full = [[255, 3].repeat(7), vec![128 + 111, 3]].concat();
        assert_eq!(unpacked(&full).as_deref(), Some(&[3; TILE_CELLS]));
    }
}
