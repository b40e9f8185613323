//! Some thousands of inputs of a history, after a snapshot of the board as it was before them.

use std::collections::BTreeSet;
use std::time::Duration;

use tomoswarm_proto::codec::{self, EncodeError};

use super::board_snapshot::BoardSnapshot;
use super::packed_input::{PackedInput, Replaced, replaced};
use crate::dash::board::BoardInput;
use crate::dash::deflate::{deflate, inflate};
use crate::time::Time;

/// A part is full with so many inputs, or so many bytes of them: a page that looks back has one of them uncompressed.
const INPUTS_MAX: usize = 8192;
const INPUT_BYTES_MAX: usize = 2 << 20;
/// Plans are long: of them the last of so much longer a time is kept.
const PLANS_RARER: u32 = 10;

/// Some thousands of inputs.
#[derive(Debug)]
pub(super) struct Part {
    from: Time,
    board: BoardSnapshot,
    inputs: usize,
    /// Of the inputs, uncompressed.
    input_bytes: usize,
    storage: InputStorage,
    thinned: usize,
    /// How often its inputs became fewer or more since it was full.
    changes: usize,
}

/// The inputs of a part, one after another.
#[derive(Debug)]
enum InputStorage {
    /// As they are: more may come.
    Open(Vec<u8>),
    /// All of them.
    Compressed(Box<[u8]>),
}

/// The compressed part of a history that somebody has read last, as it is uncompressed.
#[derive(Debug, Default)]
pub struct InflatedPart {
    part: Option<PartName>,
    inputs: Vec<u8>,
}

/// What tells a part, as it is now, from others.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct PartName {
    from: Time,
    changes: usize,
}

impl Part {
    /// Begins one with the board as it is; `buffer` = an empty one that has held inputs before.
    pub(super) fn new(from: Time, board: BoardSnapshot, buffer: Vec<u8>) -> Part {
        Part {
            from,
            board,
            inputs: 0,
            input_bytes: 0,
            storage: InputStorage::Open(buffer),
            thinned: 0,
            changes: 0,
        }
    }

    /// Adds an input to one that is open; returns how many bytes that took.
    ///
    /// # Errors
    /// It cannot be packed.
    pub(super) fn add(
        &mut self,
        at: Time,
        stays: bool,
        input: &BoardInput,
    ) -> Result<usize, EncodeError> {
        let bytes = &codec::pack(input)?;
        let InputStorage::Open(packed) = &mut self.storage else {
            debug_assert!(false, "it is compressed");
            return Ok(0);
        };
        let is_samples = matches!(replaced(input), Some(Replaced::Samples(_)));
        let input = PackedInput {
            at,
            stays,
            is_samples,
            bytes,
        };
        let taken = input.write(packed);
        self.inputs += 1;
        self.input_bytes += taken;
        Ok(taken)
    }

    /// Compresses its inputs; returns the empty buffer in which they were.
    pub(super) fn close(&mut self) -> Vec<u8> {
        let InputStorage::Open(packed) = &mut self.storage else {
            return Vec::new();
        };
        let mut packed = std::mem::take(packed);
        self.storage = InputStorage::Compressed(deflate(&packed));
        packed.clear();
        packed
    }

    /// Returns when its first input was told; all before it were told earlier.
    pub(super) fn from(&self) -> Time {
        self.from
    }

    /// Returns the board as it was before.
    pub(super) fn board(&self) -> &BoardSnapshot {
        &self.board
    }

    /// Returns whether it has as many inputs as one may have.
    pub(super) fn is_full(&self) -> bool {
        self.inputs >= INPUTS_MAX || self.input_bytes >= INPUT_BYTES_MAX
    }

    /// Returns whether all inputs of both are few enough for one. It may be twice as long as one that was not joined:
    /// plans, which are long, are the first of which later ones replace others.
    pub(super) fn fits_with(&self, other: &Part) -> bool {
        self.inputs + other.inputs <= INPUTS_MAX
            && self.input_bytes + other.input_bytes <= 2 * INPUT_BYTES_MAX
    }

    /// Returns how often it was thinned.
    pub(super) fn thinned(&self) -> usize {
        self.thinned
    }

    /// Returns the bytes that it takes, about, without what it shares with the one before.
    pub(super) fn bytes(&self, before: Option<&Part>) -> usize {
        let packed = match &self.storage {
            InputStorage::Open(packed) => packed.len(),
            InputStorage::Compressed(compressed) => compressed.len(),
        };
        self.board.bytes(before.map(Part::board)) + packed
    }

    /// Returns the bytes of its inputs as long as more may come; 0 when they are compressed.
    pub(super) fn open_bytes(&self) -> usize {
        match &self.storage {
            InputStorage::Open(packed) => packed.len(),
            InputStorage::Compressed(_) => 0,
        }
    }

    /// Returns its inputs, in their order.
    pub(super) fn inputs<'a>(
        &'a self,
        inflated: &'a mut InflatedPart,
    ) -> impl Iterator<Item = PackedInput<'a>> {
        let mut rest = self.packed(inflated);
        std::iter::from_fn(move || PackedInput::read(&mut rest))
    }

    /// Keeps only the last in each interval of what replaces itself, a longer interval than before; it is open then.
    pub(super) fn thin(&mut self, interval: Duration) {
        self.keep_last_of(interval);
        self.thinned += 1;
    }

    /// Adds all inputs of the part that follows, thinned with the same interval as it is; it is compressed then.
    pub(super) fn join(&mut self, newer: &Part, interval: Duration) {
        let mut both = self.packed(&mut InflatedPart::default()).to_vec();
        both.extend(newer.packed(&mut InflatedPart::default()));
        self.storage = InputStorage::Open(both);
        self.keep_last_of(interval);
        self.close();
    }

    fn keep_last_of(&mut self, interval: Duration) {
        let mut inflated = InflatedPart::default();
        let inputs: Vec<PackedInput<'_>> = self.inputs(&mut inflated).collect();
        let (mut kept, mut seen) = (Vec::new(), BTreeSet::new());
        for packed in inputs.iter().rev() {
            let replaced = packed.input().as_ref().and_then(replaced);
            let interval = match replaced {
                Some(Replaced::Plan(_)) => interval * PLANS_RARER,
                _ => interval,
            };
            let bucket = packed.at.since(Time::ZERO).as_nanos() / interval.as_nanos();
            let is_last = replaced.is_none_or(|what| seen.insert((bucket, what)));
            if is_last || packed.stays {
                kept.push(packed);
            }
        }
        let mut thin = Vec::new();
        for packed in kept.iter().rev() {
            packed.write(&mut thin);
        }
        (self.inputs, self.input_bytes) = (kept.len(), thin.len());
        self.changes += 1;
        self.storage = InputStorage::Open(thin);
    }

    fn packed<'a>(&'a self, inflated: &'a mut InflatedPart) -> &'a [u8] {
        match &self.storage {
            InputStorage::Open(packed) => packed,
            InputStorage::Compressed(compressed) => inflated.read(self.name(), compressed),
        }
    }

    fn name(&self) -> PartName {
        PartName {
            from: self.from,
            changes: self.changes,
        }
    }
}

impl InflatedPart {
    /// Returns the inputs of a part, which are inflated unless they were read last.
    fn read(&mut self, part: PartName, compressed: &[u8]) -> &[u8] {
        if self.part != Some(part) {
            inflate(compressed, &mut self.inputs);
            self.part = Some(part);
        }
        &self.inputs
    }
}
