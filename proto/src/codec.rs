//! Messages to bytes and back; the only file that names bincode.
//!
//! A frame is magic (2 bytes), wire version (1 byte), kind (1 byte), then the message of that kind in bincode's
//! standard configuration. A Hello (kind 0) has fourteen bytes before its body that are the same in all versions, so
//! that nodes of different versions can name each other; [`greeting`] reads them. Input from outside never panics: a
//! frame is refused when it is too long, truncated, followed by trailing bytes, of another version, or holds impossible
//! values. A frame of this version whose kind is not known is no mistake of its sender, who may be newer: it is
//! [`Decoded::Unknown`], to be counted and dropped.

use bincode::config::{Configuration, Limit, LittleEndian, Varint};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::{Boot, Hello, Message, MessageKind, OperatorId, Sender, VehicleId};

/// First bytes of every frame.
pub const MAGIC: [u8; 2] = *b"tS";
/// Version of the wire; frames of another version are refused.
pub const VERSION: u8 = 2;
/// Longest frame, bytes.
pub const LIMIT: usize = 256 * 1024;
/// What a body may claim to hold while it is read, bytes. A small number is counted as wide as its type, which is up to
/// eight times the byte that it takes, so every frame that can be written can be read; a false length reserves no more.
const READ_LIMIT: usize = 8 * LIMIT;
/// Longest value that [`unpack`] reads, bytes: what a spoilt file claims must not take all memory.
const UNPACK_LIMIT: usize = 256 * 1024 * 1024;
const HEADER: usize = 4;
/// Bytes of a greeting behind the header: node (2), boot (4), venue (8).
const GREETING: usize = 14;
/// Numbers of nodes that are no vehicle in a greeting: the ground, then 256 operators.
const GROUND: u16 = 256;
const FIRST_OPERATOR: u16 = 257;

/// What a frame holds.
#[derive(Clone, PartialEq, Eq, Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "nearly every frame is a message, and is taken out at once"
)]
pub enum Decoded {
    /// A message that has passed [`Message::check`].
    Message(Message),
    /// A message of a kind, by its number, that this version does not know; its body was not looked at.
    Unknown(u8),
}

/// What a Hello says in every version of the wire.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
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

/// Encodes a message into a frame.
///
/// # Errors
/// The message does not fit into [`LIMIT`] bytes.
pub fn encode(message: &Message) -> Result<Vec<u8>, EncodeError> {
    let mut frame = Vec::with_capacity(128);
    frame.extend_from_slice(&[MAGIC[0], MAGIC[1], VERSION, message.kind().number()]);
    if let Message::Hello(hello) = message {
        greet(hello, &mut frame);
    }
    write_body(message, &mut frame)?;
    if frame.len() > LIMIT {
        return Err(EncodeError {
            reason: format!("{} bytes", frame.len()),
        });
    }
    Ok(frame)
}

/// Decodes a frame.
///
/// # Errors
/// The frame is not one, or of another version, or holds impossible values.
pub fn decode(frame: &[u8]) -> Result<Decoded, DecodeError> {
    if frame.len() > LIMIT {
        return Err(DecodeError::TooLong {
            length: frame.len(),
        });
    }
    let (header, body) = split(frame)?;
    if header[2] != VERSION {
        return Err(DecodeError::Version { found: header[2] });
    }
    let Some(kind) = MessageKind::from_number(header[3]) else {
        return Ok(Decoded::Unknown(header[3]));
    };
    let message = read_body(kind, body)?;
    message
        .check()
        .map_err(|reason| DecodeError::Impossible { reason })?;
    if let Message::Hello(hello) = &message
        && greeting(frame)? != greeting_of(hello)
    {
        return Err(DecodeError::Impossible {
            reason: "a greeting and its body name the same node",
        });
    }
    Ok(Decoded::Message(message))
}

fn write_body(message: &Message, frame: &mut Vec<u8>) -> Result<(), EncodeError> {
    match message {
        Message::Hello(hello) => write(hello, frame),
        Message::State(state) => write(state, frame),
        Message::Tile(tile) => write(tile, frame),
        Message::Digest(digest) => write(digest, frame),
        Message::Want(want) => write(want, frame),
        Message::Plan(plan) => write(plan, frame),
        Message::Mission(mission) => write(mission, frame),
        Message::Order(order) => write(order, frame),
        Message::Samples(batch) => write(batch, frame),
        Message::Have(have) => write(have, frame),
        Message::Beacon(beacon) => write(beacon, frame),
        Message::Health(health) => write(health, frame),
        Message::Report(report) => write(report, frame),
        Message::Standing(standing) => write(standing, frame),
        Message::Task(task) => write(task, frame),
        Message::Image(image) => write(image, frame),
        Message::Fix(fix) => write(fix, frame),
        Message::Mark(mark) => write(mark, frame),
        Message::Look(look) => write(look, frame),
        Message::Log(log) => write(log, frame),
        Message::Settings(settings) => write(settings, frame),
    }
}

fn read_body(kind: MessageKind, body: &[u8]) -> Result<Message, DecodeError> {
    match kind {
        MessageKind::Hello => read(body.get(GREETING..).unwrap_or_default()).map(Message::Hello),
        MessageKind::State => read(body).map(Message::State),
        MessageKind::Tile => read(body).map(Message::Tile),
        MessageKind::Digest => read(body).map(Message::Digest),
        MessageKind::Want => read(body).map(Message::Want),
        MessageKind::Plan => read(body).map(Message::Plan),
        MessageKind::Mission => read(body).map(Message::Mission),
        MessageKind::Order => read(body).map(Message::Order),
        MessageKind::Samples => read(body).map(Message::Samples),
        MessageKind::Have => read(body).map(Message::Have),
        MessageKind::Beacon => read(body).map(Message::Beacon),
        MessageKind::Health => read(body).map(Message::Health),
        MessageKind::Report => read(body).map(Message::Report),
        MessageKind::Standing => read(body).map(Message::Standing),
        MessageKind::Task => read(body).map(Message::Task),
        MessageKind::Image => read(body).map(Message::Image),
        MessageKind::Fix => read(body).map(Message::Fix),
        MessageKind::Mark => read(body).map(Message::Mark),
        MessageKind::Look => read(body).map(Message::Look),
        MessageKind::Log => read(body).map(Message::Log),
        MessageKind::Settings => read(body).map(Message::Settings),
    }
}

/// Writes a value behind what is there already.
fn write<T: Serialize>(value: &T, frame: &mut Vec<u8>) -> Result<(), EncodeError> {
    bincode::serde::encode_into_std_write(value, frame, config())
        .map(|_| ())
        .map_err(|error| EncodeError {
            reason: error.to_string(),
        })
}

/// Reads a value that takes all the bytes.
fn read<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, DecodeError> {
    let config = bincode::config::standard().with_limit::<READ_LIMIT>();
    let (value, used) =
        bincode::serde::decode_from_slice(bytes, config).map_err(|error| DecodeError::Body {
            reason: error.to_string(),
        })?;
    if used == bytes.len() {
        Ok(value)
    } else {
        Err(DecodeError::Trailing {
            count: bytes.len() - used,
        })
    }
}

/// Reads what a Hello says in every version of the wire.
///
/// # Errors
/// The frame is no Hello of any version.
pub fn greeting(frame: &[u8]) -> Result<Greeting, DecodeError> {
    let (header, rest) = split(frame)?;
    let Some(bytes) = rest
        .first_chunk::<GREETING>()
        .filter(|_| header[3] == MessageKind::Hello.number())
    else {
        return Err(DecodeError::NotOurs);
    };
    let [n0, n1, b0, b1, b2, b3, venue @ ..] = *bytes;
    let node = match u16::from_le_bytes([n0, n1]) {
        GROUND => Sender::Ground,
        id if id < GROUND => Sender::Vehicle(VehicleId(n0)),
        id => match u8::try_from(id - FIRST_OPERATOR) {
            Ok(id) => Sender::Operator(OperatorId(id)),
            Err(_) => {
                return Err(DecodeError::Impossible {
                    reason: "a node is a vehicle, the ground or an operator",
                });
            }
        },
    };
    let boot = Boot(u32::from_le_bytes([b0, b1, b2, b3]));
    Ok(Greeting {
        version: header[2],
        node,
        boot,
        venue_hash: u64::from_le_bytes(venue),
    })
}

/// Returns what a Hello of this version has to begin with.
fn greeting_of(hello: &Hello) -> Greeting {
    Greeting {
        version: VERSION,
        node: hello.node,
        boot: hello.boot,
        venue_hash: hello.venue_hash,
    }
}

fn greet(hello: &Hello, frame: &mut Vec<u8>) {
    let node = match hello.node {
        Sender::Vehicle(id) => u16::from(id.0),
        Sender::Ground => GROUND,
        Sender::Operator(id) => FIRST_OPERATOR + u16::from(id.0),
    };
    frame.extend_from_slice(&node.to_le_bytes());
    frame.extend_from_slice(&hello.boot.0.to_le_bytes());
    frame.extend_from_slice(&hello.venue_hash.to_le_bytes());
}

fn split(frame: &[u8]) -> Result<(&[u8], &[u8]), DecodeError> {
    let (header, body) = frame.split_at_checked(HEADER).ok_or(DecodeError::NotOurs)?;
    if header[..2] == MAGIC {
        Ok((header, body))
    } else {
        Err(DecodeError::NotOurs)
    }
}

/// Writes a value that only programs of one version read, such as an actor's snapshot.
///
/// # Errors
/// The value cannot be written.
pub fn pack<T: Serialize>(value: &T) -> Result<Vec<u8>, EncodeError> {
    bincode::serde::encode_to_vec(value, bincode::config::standard()).map_err(|error| EncodeError {
        reason: error.to_string(),
    })
}

/// Reads what [`pack`] wrote.
///
/// # Errors
/// The bytes are not such a value, or it is longer than 256 MiB, or bytes are left over.
pub fn unpack<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, DecodeError> {
    let config = bincode::config::standard().with_limit::<UNPACK_LIMIT>();
    let (value, used) =
        bincode::serde::decode_from_slice(bytes, config).map_err(|error| DecodeError::Body {
            reason: error.to_string(),
        })?;
    if used == bytes.len() {
        Ok(value)
    } else {
        Err(DecodeError::Trailing {
            count: bytes.len() - used,
        })
    }
}
