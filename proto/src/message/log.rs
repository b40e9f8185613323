//! What a node says of itself to operators who ask: the lines of its log, and its settings. This is the form on the wire.

use serde::{Deserialize, Serialize};

use crate::Sender;

/// Lines that one message has at most.
pub const LOG_LINES_MAX: usize = 16;
/// Bytes of a line at most.
pub const LOG_LINE_BYTES_MAX: usize = 240;
/// Bytes of a part of a node's settings at most.
pub const SETTINGS_PART_BYTES_MAX: usize = 4096;
/// Parts of a node's settings at most.
pub const SETTINGS_PARTS_MAX: u8 = 16;

/// The newest lines of a node's log; said only while an operator's greeting asks for them, each more than once.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct LogLines {
    /// Whose.
    pub node: Sender,
    /// The start of its software that they are of, as in its Hello: nodes of one name are told apart by it.
    pub instance: u64,
    /// Ascending by number; at most [`LOG_LINES_MAX`].
    pub lines: Vec<LogLine>,
}

/// A line of a node's log.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct LogLine {
    /// Counted from 1 since the start of its software; one that is left out was not said.
    pub number: u32,
    /// How long ago it was written when it was said, milliseconds.
    pub age_ms: u32,
    /// How bad it is.
    pub severity: LogSeverity,
    /// At most [`LOG_LINE_BYTES_MAX`] bytes.
    pub text: String,
}

/// How bad it is what a line says.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum LogSeverity {
    /// It does or meets something.
    Info,
    /// Something is not as it should be.
    Warning,
    /// Something has failed.
    Error,
}

/// A part of the settings of a node; said only while an operator's greeting asks for them.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct NodeSettings {
    /// Whose.
    pub node: Sender,
    /// The start of its software that runs with them, as in its Hello.
    pub instance: u64,
    /// Which part, counted from 0.
    pub part: u8,
    /// How many parts there are; 1 to [`SETTINGS_PARTS_MAX`].
    pub parts: u8,
    /// Of its file with all defaults (TOML), without the venue; at most [`SETTINGS_PART_BYTES_MAX`] bytes.
    pub text: String,
}
