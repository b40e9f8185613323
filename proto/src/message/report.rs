//! What the ground station says of itself, and of the runs that it has seen.

use serde::{Deserialize, Serialize};

use super::{MissionKind, OrderKind};
use crate::{Boot, Lease, RunId, VehicleId};

/// What the ground station is doing.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
pub enum StationPhase {
    /// Nothing is wished, or all is done.
    #[default]
    Idle,
    /// A sweep is wished; not every vehicle has been heard yet.
    Waiting,
    /// Everyone is brought to rest.
    Stopping,
    /// Plans are made.
    Planning,
    /// The sweep is driven.
    Running,
    /// All stops are done; the last samples come in.
    Closing,
}

/// How a run ended.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum RunEnd {
    /// Everything was done.
    Done,
    /// It was ended by an order, or by another run.
    Stopped,
    /// It could not be brought to its end.
    Failed,
}

/// What became of a run.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct RunReport {
    /// Which run.
    pub run: RunId,
    /// What its vehicles were out for.
    pub kind: MissionKind,
    /// The run that its images are compared with.
    pub compared_with: Option<RunId>,
    /// How it ended; `None` = it is still to begin or under way, or its last images are being made.
    pub end: Option<RunEnd>,
    /// Samples stored.
    pub samples: u64,
    /// Images made of it, also while it lasts (of those of an earlier start of the station the last few may be missing).
    pub images: u32,
}

/// What the ground station says of itself, once a second.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct GroundReport {
    /// Start of its software.
    pub boot: Boot,
    /// By which right it gives orders and plans.
    pub lease: Lease,
    /// Which store it writes.
    pub store: u64,
    /// What it is doing.
    pub phase: StationPhase,
    /// The run it is doing that for.
    pub run: RunId,
    /// Laps done of the run.
    pub laps_done: u32,
    /// Laps of the run, as far as planned.
    pub laps: u32,
    /// Samples stored of the run.
    pub samples: u64,
    /// Images made of the run, also while it lasts.
    pub images: u32,
    /// The vehicles that it expects to hear, ascending.
    pub expected: Vec<VehicleId>,
    /// The vehicles that it plans for, ascending.
    pub members: Vec<VehicleId>,
    /// The vehicles that it has given up for now, ascending.
    pub lost: Vec<VehicleId>,
    /// What was ordered and not ended by a start.
    pub in_force: Option<OrderKind>,
    /// The last runs, ascending, at most 16.
    pub runs: Vec<RunReport>,
    /// What is wrong, in words; empty when all is well.
    pub troubles: Vec<String>,
}
