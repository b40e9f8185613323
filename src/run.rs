//! The live runtime: the actors of [`crate::node`] and [`crate::ground`] as threads of a real process, on real time.
//!
//! It decides nothing: what is safe, planned or measured is said by the actors. `bus.rs` is the only file that names
//! zenoh. Everything here is the imperative shell, so clocks, threads, files and sockets are allowed.

pub mod bus;
pub mod clock;
#[cfg(feature = "dash")]
pub mod dash;
#[cfg(feature = "hw")]
pub mod device_check;
pub mod drivers;
pub mod ground_process;
mod later_start;
pub mod link;
pub mod live;
pub mod live_operator;
pub mod log_book;
pub mod machine;
pub mod mailbox;
pub mod mavlink_port;
pub mod mavlink_sockets;
pub mod member;
pub mod membership;
pub mod mock_autopilot;
mod newcomers;
pub mod node_threads;
pub mod operator_session;
pub mod process;
mod program_file;
mod reach;
pub mod roster_watch;
mod self_report;
pub mod state_dir;
pub mod subjects;
pub mod swarm_mavlink;
pub mod tap;
pub mod trust;
pub mod vehicle_process;
pub mod world;
