//! Subcommands as types, one file each; the only layer that touches files and the terminal.

pub mod image;
pub mod recording;
