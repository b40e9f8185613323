//! A vehicle's samples on disk: kept from the moment they are made until the ground has them and their run is closed.
//!
//! [`OutboxFile`] is the file; [`OutboxDriver`] is the thread that writes it, so that no actor ever waits for a disk.
//! What is sent when is decided by [`crate::node::outbox`], not here.

mod driver;
mod file;

pub use driver::{OutboxDriver, OutboxHealth, OutboxSettings};
pub use file::{Opened, OutboxFile};
