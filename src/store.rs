//! What must outlive a process: the ground station's store, a vehicle's outbox and memory on disk, the emergency stops that a
//! node knows, and flight recordings.
//!
//! Nothing here decides; it writes what it is handed, and gives it back after a restart.

mod checked_file;
mod disk_room;
mod durable;
mod error;
pub mod ground;
mod lost_thread;
pub mod memory;
pub mod outbox;
pub mod recording;
mod sample_row;
pub mod stops;

pub use checked_file::CheckedFileError;
pub use disk_room::DiskRoom;
pub use durable::replace;
pub use error::StoreError;
pub use lost_thread::lost_thread;
