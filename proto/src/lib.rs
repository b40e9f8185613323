//! What travels between the nodes of a tomoswarm: ids, key expressions, messages, and their bytes.
//!
//! This crate knows no transport and nothing of the program around it, so that another program can
//! speak to the swarm by depending on this small crate alone. Messages are plain data: units are in
//! the field names, places are in the venue's local frame (metres), times are nanoseconds of the
//! sender's own clock and decide nothing on another machine.

#![warn(missing_docs)]

mod cells;
mod check;
pub mod codec;
mod id;
mod key;
mod message;

pub use id::{Boot, LayerId, Lease, Revision, RunId, StopId, VehicleId};
pub use key::{Key, Sender};
pub use message::{
    Beacon, Digest, Have, Health, HeardFrom, Hello, LayerDigest, LegReport, Message, Mode, Order, OrderKind,
    Ordered, Plan, PoseReport, Position, Progress, Report, Sample, Samples, State, StationPhase, Stop,
    TILE_CELLS, TILE_SIDE, TileAddress, TileReport, Want,
};
