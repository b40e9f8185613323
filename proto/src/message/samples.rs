//! Measurements, and which of them the ground station has stored.

use serde::{Deserialize, Serialize};

use crate::{Boot, PoseReport, RunId, VehicleId};

/// One beacon heard, or missed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Sample {
    /// Counts the samples of this vehicle, boot and run.
    pub sequence: u64,
    /// When it was heard, nanoseconds of the receiver's clock.
    pub heard_at_ns: u64,
    /// Who sent the beacon.
    pub transmitter: VehicleId,
    /// Where the transmitter was (for a miss: where it was last heard to be).
    pub transmitter_pose: PoseReport,
    /// Where the receiver was.
    pub receiver_pose: PoseReport,
    /// Radio channel.
    pub channel: u8,
    /// Transmit power, dBm.
    pub power_dbm: i8,
    /// Received signal strength, dBm; `None` = missed.
    pub rssi_dbm: Option<i16>,
}

/// Sequences of samples that nobody has any more.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub struct LostSamples {
    /// The first one lost.
    pub from: u64,
    /// The first one behind them that is not.
    pub until: u64,
}

/// Samples of one vehicle, kept by it until the ground has them.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Samples {
    /// Who measured.
    pub vehicle: VehicleId,
    /// Start of its software.
    pub boot: Boot,
    /// In which run.
    pub run: RunId,
    /// The samples, ascending by sequence.
    pub samples: Vec<Sample>,
    /// Sequences that will never come, ascending and apart: a watermark may pass them.
    pub lost: Vec<LostSamples>,
}

/// So many watermarks, of its newest sources, a store says every time; who hears fewer has heard all.
pub const WATERMARKS_ALWAYS: usize = 1024;

/// How many samples of a vehicle a store has without a gap.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct HeardFrom {
    /// Who measured.
    pub vehicle: VehicleId,
    /// Start of its software.
    pub boot: Boot,
    /// In which run.
    pub run: RunId,
    /// Every sample with a lower sequence is stored, or lost for good.
    pub below: u64,
}

/// What the ground has stored, so that vehicles may forget it.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Have {
    /// Which store speaks; a new disk has a new id.
    pub store: u64,
    /// Per vehicle, boot and run.
    pub watermarks: Vec<HeardFrom>,
    /// Runs that are closed, ascending: only of these may covered samples be forgotten for good.
    pub closed: Vec<RunId>,
}
