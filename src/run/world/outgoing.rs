//! What is still to be written to one connection: a short queue between the world, which never waits, and a writer,
//! which may. When it is full the oldest report makes room, or else the oldest frame of all.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// Frames that wait for a slow reader.
const FRAMES_WAITING: usize = 64;

/// What kind of frame waits.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum FramePriority {
    /// A newer one says it all.
    Report,
    /// Nothing else says it.
    Word,
}

/// Frames on their way to one connection.
#[derive(Debug, Default)]
pub(super) struct Outgoing {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Waiting {
    frames: VecDeque<(FramePriority, Vec<u8>)>,
    dropped: u64,
    is_closed: bool,
}

impl Outgoing {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a frame in; never waits.
    pub(super) fn push(&self, worth: FramePriority, frame: Vec<u8>) {
        let mut waiting = self.lock();
        if waiting.is_closed {
            return;
        }
        if waiting.frames.len() >= FRAMES_WAITING {
            let oldest = waiting
                .frames
                .iter()
                .position(|(worth, _)| *worth == FramePriority::Report)
                .unwrap_or(0);
            waiting.frames.remove(oldest);
            waiting.dropped += 1;
        }
        waiting.frames.push_back((worth, frame));
        self.changed.notify_one();
    }

    /// Takes no more; what waits is still written.
    pub(super) fn close(&self) {
        self.lock().is_closed = true;
        self.changed.notify_all();
    }

    /// Waits for the next frame; `None` when it is closed and all is written.
    pub(super) fn next(&self) -> Option<Vec<u8>> {
        let mut waiting = self.lock();
        loop {
            if let Some((_, frame)) = waiting.frames.pop_front() {
                return Some(frame);
            }
            if waiting.is_closed {
                return None;
            }
            waiting = self
                .changed
                .wait(waiting)
                .unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Returns how many frames were dropped.
    #[cfg(test)]
    pub fn dropped(&self) -> u64 {
        self.lock().dropped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drain(outgoing: &Outgoing) -> Vec<Vec<u8>> {
        outgoing.close();
        std::iter::from_fn(|| outgoing.next()).collect()
    }

    #[test]
    fn a_full_queue_loses_its_oldest_telemetry_and_keeps_the_words() {
        let outgoing = Outgoing::default();
        for number in 0..100u8 {
            let worth = if number % 10 == 0 {
                FramePriority::Word
            } else {
                FramePriority::Report
            };
            outgoing.push(worth, vec![number]);
        }
        let kept: Vec<u8> = drain(&outgoing).into_iter().flatten().collect();
        assert_eq!(
            (kept.len(), outgoing.dropped()),
            (FRAMES_WAITING, 100 - FRAMES_WAITING as u64)
        );
        assert!((0..10).all(|word| kept.contains(&(word * 10))), "{kept:?}");
        assert!(kept.is_sorted() && kept.ends_with(&[98, 99]), "{kept:?}");
    }

    #[test]
    fn a_queue_of_words_alone_does_not_grow_either() {
        let outgoing = Outgoing::default();
        (0..=255u8).for_each(|number| outgoing.push(FramePriority::Word, vec![number]));
        let kept = drain(&outgoing);
        assert_eq!(
            (kept.len(), kept.last()),
            (FRAMES_WAITING, Some(&vec![255]))
        );
    }
}
