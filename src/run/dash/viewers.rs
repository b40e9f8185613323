//! The connections of Foxglove and Lichtblick, and what is due to each. What they are sent is `foxglove`'s.

use std::collections::BTreeMap;

use tokio::sync::mpsc;

use super::foxglove::{FoxgloveFrame, FoxgloveViewer};
use super::http::Outbound;
use crate::dash::board::Board;
use crate::dash::gate::GateRefusal;
use crate::time::Time;

/// Viewers at a time at most.
const VIEWERS_MAX: usize = 4;
/// Frames that wait for a viewer's connection at most.
pub(super) const FRAMES_WAITING: usize = 256;
/// A viewer for which more wait is sent nothing new.
const ROOM: usize = FRAMES_WAITING / 2;

/// All viewers.
#[derive(Default)]
pub(super) struct Viewers {
    open: BTreeMap<u32, (FoxgloveViewer, mpsc::Sender<Outbound>)>,
    last: u32,
}

impl Viewers {
    /// Takes a connection that may look; returns its number.
    ///
    /// # Errors
    /// There are too many.
    pub(super) fn open(
        &mut self,
        now: Time,
        venue: &str,
        frames: mpsc::Sender<Outbound>,
    ) -> Result<u32, GateRefusal> {
        if self.open.len() >= VIEWERS_MAX {
            let reason = format!("{VIEWERS_MAX} viewers are open already");
            return Err(GateRefusal::Unreadable(reason));
        }
        self.last += 1;
        let (viewer, first) = FoxgloveViewer::new(now, venue);
        send(&frames, first);
        self.open.insert(self.last, (viewer, frames));
        Ok(self.last)
    }

    /// Takes what a viewer says; one that is not understood is closed.
    pub(super) fn hear(&mut self, id: u32, text: &str) {
        if let Some((viewer, frames)) = self.open.get_mut(&id)
            && let Err(reason) = viewer.hear(text)
        {
            // One that is gone says so itself.
            let _ = frames.try_send(Outbound::Close(GateRefusal::Unreadable(reason)));
        }
    }

    /// Takes that a connection is gone.
    pub(super) fn closed(&mut self, id: u32) {
        self.open.remove(&id);
    }

    /// Returns when something is due.
    pub(super) fn deadline(&self) -> Option<Time> {
        self.open
            .values()
            .map(|(viewer, _)| viewer.deadline())
            .min()
    }

    /// Sends what is due of a board as it is at a moment.
    pub(super) fn send_due(&mut self, now: Time, moment: Time, board: &Board) {
        for (viewer, frames) in self.open.values_mut() {
            if frames.capacity() < ROOM {
                viewer.wait(now);
                continue;
            }
            let is_idle = frames.capacity() == FRAMES_WAITING;
            let due = viewer.due(now, (moment, board), is_idle);
            due.into_iter().for_each(|frame| send(frames, frame));
        }
    }
}

fn send(frames: &mpsc::Sender<Outbound>, frame: FoxgloveFrame) {
    // A viewer for which there is no room has been asked about before.
    let _ = frames.try_send(match frame {
        FoxgloveFrame::Text(text) => Outbound::Text(text),
        FoxgloveFrame::Binary(bytes) => Outbound::Frame(bytes),
    });
}
