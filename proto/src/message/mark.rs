//! Where a person, or whatever is looked for, truly stands. This is the form on the wire.

use serde::{Deserialize, Serialize};

use crate::{Position, RunId};

/// A true position, marked during a run or after it: images and finds are judged by it, and nothing else. Operators say it
/// until the ground station says the same, which has stored it then. A place is marked once in a run, however often that is
/// said.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Mark {
    /// In which run.
    pub run: RunId,
    /// Where, in the venue's frame.
    pub at: Position,
    /// Whether it is a mark; `false` = the mark there was a mistake, and is taken back.
    pub stands: bool,
}
