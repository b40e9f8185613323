//! What travels between the nodes of a tomoswarm: ids, keys, messages, and their bytes.
//!
//! This crate knows no transport and nothing of the program around it, so that another program can
//! speak to the swarm by depending on this small crate alone. Messages are plain data: whole numbers with the unit in
//! the field's name or in its type, places in the venue's local frame, times in nanoseconds of the
//! sender's own clock, which decide nothing on another machine. Floating-point numbers are not on the wire; `units`
//! says how they become whole ones.

#![cfg_attr(
    test,
    allow(clippy::restriction, unreachable_pub, reason = "tests may")
)]

mod cells;
mod check;
pub mod codec;
mod id;
mod key;
mod kind;
mod message;
mod units;

pub use cells::packed as packed_cells;
pub use check::{LOST_MAX, fitted, fitted_troubles};
pub use id::{Boot, EmergencyName, LayerId, Lease, OperatorId, Revision, RunId, StopId, VehicleId};
pub use key::{Key, MessageSubject, Sender, Topic};
pub use kind::MessageKind;
pub use message::{
    AutopilotFamily, AutopilotHealth, BEACON_BYTES_MAX, BEACON_MEMBERS_MAX, Beacon, BeaconTag,
    BodyKind, Capability, Control, Covariance, Digest, EmergencyStop, Estimator, FIX_AGE_MAX_MS,
    FailsafeAction, Failsafes, Find, Fix, GroundReport, Have, Health, HeardFrom, Hello,
    IMAGE_FINDS_MAX, IMAGE_PART_PIXELS, IMAGE_SIDE_MAX, Image, ImageSubject, Interest,
    LOG_LINE_BYTES_MAX, LOG_LINES_MAX, LOOK_READINGS_MAX, LayerDigest, LegReport, LogLine,
    LogLines, LogSeverity, Look, LookReading, LostSamples, Mark, Message, MissionEnd, MissionKind,
    MissionPhase, MissionProgress, MissionRefusal, NodeSettings, OpenStops, Order, OrderKind,
    Ordered, Parameter, PlaceSharing, Plan, Power, Progress, READING_AGE_MAX_MS, RadioHealth,
    RadioKind, RangeHealth, RangeSensorKind, RecordingHealth, Rectangle, RunEnd, RunReport,
    SETTINGS_PART_BYTES_MAX, SETTINGS_PARTS_MAX, STORED_ITEMS_MAX, Sample, Samples, SatelliteFix,
    SeenState, ServoKind, StandReason, State, StationPhase, Stop, StopScope, StoredItem,
    SweepPlanner, TASK_PLACES_MAX, TILE_CELLS, TILE_SIDE, Task, TaskKind, TaskNumber,
    TaskParameter, TaskUnit, TileAddress, TileReport, TileRequest, VehicleMode, WATERMARKS_ALWAYS,
};
pub use units::{Deviation, Heading, Permille, PoseReport, Position, Tilt, Velocity};
