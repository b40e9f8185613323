//! Messages to bytes and back; the only file that names bincode.
//!
//! A frame is magic (2 bytes), wire version (1 byte), kind (1 byte), then the body in bincode's
//! standard configuration. A Hello (kind 0) has fourteen bytes before its body that are the same in all versions, so
//! that nodes of different versions can name each other; [`greeting`] reads them. Input from outside never panics: a frame is refused when it is too
//! long, truncated, followed by trailing bytes, of another version, or holds impossible values.

use bincode::config::{Configuration, Limit, LittleEndian, Varint};

use crate::{Boot, Hello, Message, Sender, VehicleId};

/// First bytes of every frame.
pub const MAGIC: [u8; 2] = *b"tS";
/// Version of the wire; frames of another version are refused.
pub const VERSION: u8 = 1;
/// Longest frame, bytes.
pub const LIMIT: usize = 256 * 1024;
/// Longest value that [`unpack`] reads, bytes: what a spoilt file claims must not take all memory.
const UNPACK_LIMIT: usize = 256 * 1024 * 1024;
const HEADER: usize = 4;
/// Kind of a Hello.
const HELLO: u8 = 0;
/// Bytes of a greeting behind the header: node (2), boot (4), venue (8).
const GREETING: usize = 14;
/// Numbers of nodes that are no vehicle in a greeting.
const GROUND: u16 = 256;
const OPERATOR: u16 = 257;

/// What a Hello says in every version of the wire.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Greeting {
    /// Its version of the wire.
    pub version: u8,
    /// Who speaks.
    pub node: Sender,
    /// Start of its software.
    pub boot: Boot,
    /// Hash of its venue file.
    pub venue_hash: u64,
}

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
        Message::Hello(_) => HELLO,
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
        Message::Health(_) => 11,
        Message::Report(_) => 12,
    }
}

/// Encodes a message into a frame.
///
/// # Errors
/// The message does not fit into [`LIMIT`] bytes.
pub fn encode(message: &Message) -> Result<Vec<u8>, EncodeError> {
    let mut frame = Vec::with_capacity(128);
    frame.extend_from_slice(&[MAGIC[0], MAGIC[1], VERSION, kind(message)]);
    if let Message::Hello(hello) = message {
        greet(hello, &mut frame);
    }
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
    let (header, body) = split(frame)?;
    if header[2] != VERSION {
        return Err(DecodeError::Version { found: header[2] });
    }
    let body = if header[3] == HELLO { body.get(GREETING..).unwrap_or_default() } else { body };
    let (message, used): (Message, usize) = bincode::serde::decode_from_slice(body, config())
        .map_err(|error| DecodeError::Body { reason: error.to_string() })?;
    if kind(&message) != header[3] {
        return Err(DecodeError::Kind { header: header[3], body: kind(&message) });
    }
    if used != body.len() {
        return Err(DecodeError::Trailing { count: body.len() - used });
    }
    message.check().map_err(|reason| DecodeError::Impossible { reason })?;
    if let Message::Hello(hello) = &message
        && greeting(frame)?
            != (Greeting {
                version: VERSION,
                node: hello.node,
                boot: hello.boot,
                venue_hash: hello.venue_hash,
            })
    {
        return Err(DecodeError::Impossible { reason: "a greeting and its body name the same node" });
    }
    Ok(message)
}

/// Reads what a Hello says in every version of the wire.
///
/// # Errors
/// The frame is no Hello of any version.
pub fn greeting(frame: &[u8]) -> Result<Greeting, DecodeError> {
    let (header, rest) = split(frame)?;
    let Some(bytes) = rest.first_chunk::<GREETING>().filter(|_| header[3] == HELLO) else {
        return Err(DecodeError::NotOurs);
    };
    let [n0, n1, b0, b1, b2, b3, venue @ ..] = *bytes;
    let node = match u16::from_le_bytes([n0, n1]) {
        GROUND => Sender::Ground,
        OPERATOR => Sender::Operator,
        number => match u8::try_from(number) {
            Ok(id) => Sender::Vehicle(VehicleId(id)),
            Err(_) => {
                return Err(DecodeError::Impossible {
                    reason: "a node is a vehicle, the ground or an operator",
                });
            }
        },
    };
    let boot = Boot(u32::from_le_bytes([b0, b1, b2, b3]));
    Ok(Greeting { version: header[2], node, boot, venue_hash: u64::from_le_bytes(venue) })
}

fn greet(hello: &Hello, frame: &mut Vec<u8>) {
    let node = match hello.node {
        Sender::Vehicle(id) => u16::from(id.0),
        Sender::Ground => GROUND,
        Sender::Operator => OPERATOR,
    };
    frame.extend_from_slice(&node.to_le_bytes());
    frame.extend_from_slice(&hello.boot.0.to_le_bytes());
    frame.extend_from_slice(&hello.venue_hash.to_le_bytes());
}

fn split(frame: &[u8]) -> Result<(&[u8], &[u8]), DecodeError> {
    let (header, body) = frame.split_at_checked(HEADER).ok_or(DecodeError::NotOurs)?;
    if header[..2] == MAGIC { Ok((header, body)) } else { Err(DecodeError::NotOurs) }
}

/// Writes a value that only programs of one version read, such as an actor's snapshot.
///
/// # Errors
/// The value cannot be written.
pub fn pack<T: serde::Serialize>(value: &T) -> Result<Vec<u8>, EncodeError> {
    bincode::serde::encode_to_vec(value, bincode::config::standard())
        .map_err(|error| EncodeError { reason: error.to_string() })
}

/// Reads what [`pack`] wrote.
///
/// # Errors
/// The bytes are not such a value, or it is longer than 256 MiB, or bytes are left over.
pub fn unpack<T: serde::de::DeserializeOwned>(bytes: &[u8]) -> Result<T, DecodeError> {
    let config = bincode::config::standard().with_limit::<UNPACK_LIMIT>();
    let (value, used) = bincode::serde::decode_from_slice(bytes, config)
        .map_err(|error| DecodeError::Body { reason: error.to_string() })?;
    if used == bytes.len() { Ok(value) } else { Err(DecodeError::Trailing { count: bytes.len() - used }) }
}
