//! What a recorded run hands out while it runs: every step of every actor, and from time to time everything afresh.
//! Who records it decides where it goes; the run is the same with and without.

use super::bus::NodeId;
use crate::actor::{ActorStep, Snapshot};
use crate::time::Time;

/// A piece of a recording.
#[derive(Clone, Debug)]
pub enum RecordingEntry {
    /// A new segment of a node begins; all its actors as they are.
    Segment {
        /// Of which node.
        node: NodeId,
        /// When.
        now: Time,
        /// All its actors.
        snapshots: Vec<Snapshot>,
    },
    /// A step of an actor of a node.
    Step(NodeId, ActorStep),
}
