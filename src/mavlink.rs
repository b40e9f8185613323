//! MAVLink, as vehicles in the field speak it: bytes to messages ([`frames`], [`signing`]), and the protocols that take
//! more than one message, each a pure machine that is told what came and what time it is ([`command_call`],
//! [`mission_upload`], [`mission_download`], [`parameter_list`], [`parameter_reads`], [`parameter_visit`]).
//!
//! ```text
//!   bytes ─► FrameReader ─► messages ─► machines ─► messages ─► FrameWriter ─► bytes
//! ```
//!
//! Nothing outside of this folder names the library that it is made of. What a vehicle makes of all this is decided by whoever
//! speaks: the driver of an autopilot ([`autopilot_driver`]), the simulated one (`sim/mavlink_vehicle`), the swarm as a ground
//! station sees it ([`swarm_server`]). What those two have in common who serve vehicles is [`vehicle_messages`],
//! [`asked_command`], [`message_requests`], [`streams`], [`parameter_table`], [`status_text`] and [`client_link`].

pub mod asked_command;
pub mod autopilot_driver;
pub mod client_link;
pub mod command_call;
pub mod dialect;
pub mod earth_frame;
pub mod frames;
pub mod items;
pub mod message_requests;
pub mod mission_download;
pub mod mission_upload;
pub mod modes;
pub mod parameter_list;
pub mod parameter_reads;
pub mod parameter_table;
pub mod parameter_visit;
pub mod signing;
pub mod status_text;
pub mod streams;
pub mod swarm_server;
pub mod vehicle_messages;
pub mod wire_message;
