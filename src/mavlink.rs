//! MAVLink, as vehicles in the field speak it: bytes to messages ([`frames`], [`signing`]), and the protocols that take more than one
//! message, each a pure machine that is told what came and what time it is ([`command_call`], [`mission_upload`], [`mission_download`],
//! [`parameter_list`], [`parameter_reads`]).
//!
//! ```text
//!   bytes ─► FrameReader ─► messages ─► machines ─► messages ─► FrameWriter ─► bytes
//! ```
//!
//! Nothing outside of this folder names the library that it is made of. What a vehicle makes of all this is decided by whoever
//! speaks: the driver of an autopilot (`run/drivers`), the simulated one (`sim/mavlink_vehicle`).

pub mod autopilot_driver;
pub mod command_call;
pub mod dialect;
pub mod earth_frame;
pub mod frames;
pub mod items;
pub mod mission_download;
pub mod mission_upload;
pub mod modes;
pub mod parameter_list;
pub mod parameter_reads;
pub mod signing;
pub mod wire_message;
