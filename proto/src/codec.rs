//! Messages to bytes and back; the only file that names bincode.
//!
//! A frame is magic (2 bytes), wire version (1 byte), kind (1 byte), then the body in bincode's
//! standard configuration. Input from outside never panics: a frame is refused when it is too
//! long, truncated, followed by trailing bytes, of another version, or holds impossible values.

use bincode::config::{Configuration, Limit, LittleEndian, Varint};

use crate::Message;

/// First bytes of every frame.
pub const MAGIC: [u8; 2] = *b"tS";
/// Version of the wire; frames of another version are refused.
pub const VERSION: u8 = 1;
/// Longest frame, bytes.
pub const LIMIT: usize = 256 * 1024;
const HEADER: usize = 4;

/// Why bytes are not a message.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum DecodeError {
    /// The frame is longer than any message may be.
    #[error("frame of {length} bytes is longer than {LIMIT}")]
    TooLong {
        /// Length found.
        length: usize,
    },
    /// The frame does not begin with the magic bytes.
    #[error("frame does not begin with the magic bytes of tomoswarm")]
    NotOurs,
    /// The frame is of another wire version.
    #[error("frame of wire version {found}, expected {VERSION}")]
    Version {
        /// Version found.
        found: u8,
    },
    /// The kind in the header is not that of the body.
    #[error("header says kind {header}, body is of kind {body}")]
    Kind {
        /// Kind in the header.
        header: u8,
        /// Kind of the body.
        body: u8,
    },
    /// The body cannot be read.
    #[error("body cannot be read: {reason}")]
    Body {
        /// What the codec found.
        reason: String,
    },
    /// Bytes are left over behind the body.
    #[error("{count} bytes left over behind the body")]
    Trailing {
        /// How many.
        count: usize,
    },
    /// The body is well-formed but impossible.
    #[error("impossible message: {reason}")]
    Impossible {
        /// What was expected.
        reason: &'static str,
    },
}

/// Why a message cannot be sent.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error("message cannot be encoded within {LIMIT} bytes: {reason}")]
pub struct EncodeError {
    reason: String,
}

fn config() -> Configuration<LittleEndian, Varint, Limit<LIMIT>> {
    bincode::config::standard().with_limit::<LIMIT>()
}

fn kind(message: &Message) -> u8 {
    match message {
        Message::Hello(_) => 0,
        Message::State(_) => 1,
        Message::Tile(_) => 2,
        Message::Digest(_) => 3,
        Message::Want(_) => 4,
        Message::Plan(_) => 5,
        Message::Progress(_) => 6,
        Message::Order(_) => 7,
        Message::Samples(_) => 8,
        Message::Have(_) => 9,
        Message::Beacon(_) => 10,
    }
}

/// Encodes a message into a frame.
///
/// # Errors
/// The message does not fit into [`LIMIT`] bytes.
pub fn encode(message: &Message) -> Result<Vec<u8>, EncodeError> {
    let mut frame = Vec::with_capacity(128);
    frame.extend_from_slice(&[MAGIC[0], MAGIC[1], VERSION, kind(message)]);
    bincode::serde::encode_into_std_write(message, &mut frame, config())
        .map_err(|error| EncodeError { reason: error.to_string() })?;
    if frame.len() > LIMIT {
        return Err(EncodeError { reason: format!("{} bytes", frame.len()) });
    }
    Ok(frame)
}

/// Decodes a frame into a message that has passed [`Message::check`].
///
/// # Errors
/// The frame is not one, or of another version, or holds impossible values.
pub fn decode(frame: &[u8]) -> Result<Message, DecodeError> {
    if frame.len() > LIMIT {
        return Err(DecodeError::TooLong { length: frame.len() });
    }
    let Some((header, body)) = frame.split_at_checked(HEADER) else {
        return Err(DecodeError::NotOurs);
    };
    if header[..2] != MAGIC {
        return Err(DecodeError::NotOurs);
    }
    if header[2] != VERSION {
        return Err(DecodeError::Version { found: header[2] });
    }
    let (message, used): (Message, usize) = bincode::serde::decode_from_slice(body, config())
        .map_err(|error| DecodeError::Body { reason: error.to_string() })?;
    if kind(&message) != header[3] {
        return Err(DecodeError::Kind { header: header[3], body: kind(&message) });
    }
    if used != body.len() {
        return Err(DecodeError::Trailing { count: body.len() - used });
    }
    message.check().map_err(|reason| DecodeError::Impossible { reason })?;
    Ok(message)
}
