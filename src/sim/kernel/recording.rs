//! A recording of a run: it hands out what the actors of all nodes do. It changes nothing in the run.

use std::time::Duration;

use super::nodes::Nodes;
use crate::actor::Fault;
use crate::sim::entry::RecordingEntry;
use crate::time::Time;

/// Where a recording goes, and when its next segment begins.
pub(in crate::sim) struct Recording<'a> {
    record: &'a mut dyn FnMut(RecordingEntry),
    every: Duration,
    next_at: Time,
}

impl<'a> Recording<'a> {
    /// Makes a recording that goes where `record` says; a new segment begins `every` so often.
    pub(crate) fn to(record: &'a mut dyn FnMut(RecordingEntry), every: Duration) -> Recording<'a> {
        Recording {
            record,
            every,
            next_at: Time::ZERO,
        }
    }

    /// Begins to record; the first segment begins now.
    ///
    /// # Errors
    /// An actor cannot be written, which is a mistake of this program.
    pub(super) fn begin(&mut self, now: Time, nodes: &mut Nodes) -> Result<(), Fault> {
        nodes.watch();
        self.hand_out(now, nodes)
    }

    /// Hands out what the actors have done since the last time. Who was started anew does not go on from the steps before: a
    /// segment of it begins.
    ///
    /// # Errors
    /// As for [`Recording::begin`].
    pub(super) fn hand_out(&mut self, now: Time, nodes: &mut Nodes) -> Result<(), Fault> {
        nodes.steps(|node, steps| {
            let entries = steps
                .into_iter()
                .map(|step| RecordingEntry::Step(node, step));
            entries.for_each(&mut *self.record);
        });
        let is_due = now >= self.next_at;
        if is_due {
            self.next_at = now + self.every;
        }
        let written = nodes.snapshots(is_due, |node, snapshots| {
            (self.record)(RecordingEntry::Segment {
                node,
                now,
                snapshots,
            });
        });
        written.map_err(|error| Fault {
            actor: "snapshot",
            reason: error.to_string(),
        })
    }
}
