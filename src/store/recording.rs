//! The flight recording: per actor every step, in segments that open with snapshots, as MCAP files; and the replay.
//!
//! ```text
//!   flight-000001.mcap   metadata tomoswarm {format, software, node, start, segment, log_time,
//!                        utc_at_zero_ns}   metadata settings {toml, venue}   metadata utc {at_zero_ns}, when the clock was set
//!                        metadata gap {reason, at_ns}, when steps are missing
//!     /vehicle/3/mission/snapshot   tomoswarm.Snapshot  {now_ns, packed}
//!     /vehicle/3/mission/step       tomoswarm.Step      {now_ns, input | woken, outputs, fault?}
//!     /vehicle/3/pose, map, log     foxglove.PoseInFrame, foxglove.Grid, foxglove.Log: for people
//!     /ground/image, structure      foxglove.Grid
//! ```
//!
//! A step's `input` and `outputs` are the actor's own words, as JSON. A live actor's thread hands its snapshot in before its
//! first step of a segment; a simulated node opens every segment with all of them. Replay: [`replay()`].
//!
//! Any MCAP tool opens the files. To see that they still do, with the public Python package (`pip install mcap`):
//!
//! ```text
//!   from mcap.reader import make_reader
//!   for schema, channel, message in make_reader(open("flight-000001.mcap", "rb")).iter_messages(): ...
//! ```
//!
//! Log and publish times are the node's: nanoseconds since it started. Snapshots are read by the same version only.

mod actors;
mod flight;
mod folder;
mod json_exactness;
pub mod message;
mod reader;
mod recorder;
mod replay;
mod said;
mod schema;
mod segment;
mod view;

pub use flight::{OpenRecording, RecordingLimits, RecordingSubject};
pub use folder::give_way;
pub use reader::{ReadError, Reader, RecordingContents};
pub use recorder::{Recorder, RecordingUse, StepRecorder};
pub use replay::{Difference, ReplayError, ReplayResult, Replayed, replay};
pub use said::{RecordedRun, what_was_said};
pub use segment::WriteError;
#[cfg(feature = "dash")]
pub(crate) use {
    schema::Schema,
    view::{image_grid, log_line, map_grid, pose},
};

/// The version of what is written here: another one whenever an actor's snapshot takes another shape, since packed bytes
/// do not say whose they are.
const FORMAT: &str = "43";
/// The version of the software; snapshots are only read by the same.
const VERSION: &str = env!("CARGO_PKG_VERSION");
