//! A vehicle's memory on disk: by whose right it was ordered and planned for, over all starts of its software.
//!
//! [`MemoryFile`] is the file; [`MemoryDriver`] is the thread that writes it, so that no actor ever waits for a disk. What
//! has to be remembered, and what follows from it, is decided by [`crate::node::memory`] and the actors.

mod driver;
mod file;

pub use driver::MemoryDriver;
pub use file::MemoryFile;
