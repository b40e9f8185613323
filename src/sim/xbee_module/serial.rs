//! The serial line of a simulated module: every byte takes its time, and at another baud rate than the other end's it is read
//! as something else or as nothing.

use std::collections::VecDeque;
use std::time::Duration;

use crate::sim::noise::{Noise, NoisePurpose};
use crate::time::Time;

/// Bits on the line for each byte.
const BITS: u64 = 10;
/// So many bytes wait to be said at most: of what is heard on the air no more is taken (Digi 90000982, DO buffer).
const WAITING_MOST: usize = 202;

/// One direction of the line.
#[derive(Clone, Debug, Default)]
pub(super) struct SerialLine {
    under_way: VecDeque<Piece>,
    is_free_at: Time,
    bytes_read: u64,
}

/// Bytes that are said without a pause.
#[derive(Clone, Debug)]
struct Piece {
    begins: Time,
    ends: Time,
    baud: u32,
    bytes: Vec<u8>,
}

/// Bytes that have come.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Come {
    /// When the first of them began.
    pub(super) begins: Time,
    /// As they are read.
    pub(super) bytes: Vec<u8>,
}

impl SerialLine {
    /// Says bytes behind those that are being said.
    pub(super) fn say(&mut self, now: Time, baud: u32, bytes: Vec<u8>) {
        let begins = self.is_free_at.max(now);
        let bits = BITS * bytes.len() as u64;
        let ends = begins + Duration::from_nanos(bits * 1_000_000_000 / u64::from(baud.max(1)));
        self.is_free_at = ends;
        self.under_way.push_back(Piece {
            begins,
            ends,
            baud,
            bytes,
        });
    }

    /// Returns when bytes come next.
    pub(super) fn deadline(&self) -> Option<Time> {
        self.under_way.front().map(|piece| piece.ends)
    }

    /// Returns when everything that is being said has come.
    pub(super) fn is_free_at(&self) -> Time {
        self.is_free_at
    }

    /// Returns whether so many bytes more can wait.
    pub(super) fn has_room(&self, bytes: usize) -> bool {
        let waiting: usize = self.under_way.iter().map(|piece| piece.bytes.len()).sum();
        waiting + bytes <= WAITING_MOST
    }

    /// Takes the next bytes that have come by now, as they are read at a baud rate.
    pub(super) fn come(
        &mut self,
        now: Time,
        baud: u32,
        noise: Noise,
        ids: [u64; 2],
    ) -> Option<Come> {
        if self.deadline().is_none_or(|at| now < at) {
            return None;
        }
        let piece = self.under_way.pop_front()?;
        let begins = piece.begins;
        if piece.baud == baud {
            return Some(Come {
                begins,
                bytes: piece.bytes,
            });
        }
        let mut bytes = Vec::new();
        for _ in &piece.bytes {
            self.bytes_read += 1;
            let drawn = noise.hash(
                NoisePurpose::SerialGarbage,
                &[ids[0], ids[1], self.bytes_read],
            );
            bytes.extend((drawn & 0x100 == 0).then_some(drawn as u8));
        }
        Some(Come { begins, bytes })
    }

    /// What is being said is not said.
    pub(super) fn clear(&mut self, now: Time) {
        self.under_way.clear();
        self.is_free_at = now;
    }
}
