//! Who speaks with vehicles that are served, and the bytes of each: a reader and the writers of one client. What is said is not
//! known here.

use std::collections::BTreeMap;

use super::dialect::{EstimatorStatusFlags, MavMessage};
use super::frames::{Frame, FrameReader, FrameWriter, MavAddress};
use super::signing::{KEY_BYTES, Signing};

/// The link number in signatures of ours.
const SIGNED_LINK: u8 = 0;

/// Who is connected.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct ClientId(pub u32);

/// Bytes for a client.
pub type ClientBytes = (ClientId, Vec<u8>);

/// What goes out.
#[derive(Clone, PartialEq, Debug)]
pub struct Outgoing {
    /// To whom; `None` = to all clients.
    pub to: Option<ClientId>,
    /// What is said.
    pub said: Said,
}

/// What is said.
#[derive(Clone, PartialEq, Debug)]
pub enum Said {
    /// A message of the dialect.
    Message(Box<MavMessage>),
    /// What its estimator knows.
    EkfStatus(EstimatorStatusFlags),
    /// That a command is not known, whose number the dialect has no name for.
    Unsupported {
        /// The number.
        command: u16,
        /// Who gave it.
        to: MavAddress,
    },
}

impl Outgoing {
    /// Returns a message for a client, or for all.
    pub fn message(to: Option<ClientId>, message: MavMessage) -> Outgoing {
        Outgoing {
            to,
            said: Said::Message(Box::new(message)),
        }
    }
}

/// A client, and how far it is with its bytes.
pub struct ClientLink {
    reader: FrameReader,
    /// Of each vehicle that has said something to it.
    writers: BTreeMap<MavAddress, FrameWriter>,
    signing: Option<Signing>,
}

impl ClientLink {
    /// Begins; with a key only what is signed with it is heard. `clock` is the time of signatures, units of 10 µs since 2015.
    pub fn new(key: Option<[u8; KEY_BYTES]>, clock: u64) -> ClientLink {
        ClientLink {
            reader: FrameReader::default(),
            writers: BTreeMap::new(),
            signing: key.map(|key| Signing::new(key, SIGNED_LINK, clock)),
        }
    }

    /// Takes bytes as they came, in any pieces.
    pub fn push(&mut self, bytes: &[u8]) {
        self.reader.push(bytes);
    }

    /// Returns the next message that is whole; `None` when more bytes are needed.
    pub fn next_frame(&mut self) -> Option<Frame> {
        self.reader.next(self.signing.as_mut())
    }

    /// Returns how many frames were not signed as they should be.
    pub fn untrusted(&self) -> u64 {
        self.reader.dropped().untrusted
    }

    /// Appends the frame of what a vehicle says.
    pub fn write(&mut self, from: MavAddress, said: &Said, bytes: &mut Vec<u8>) {
        let writer = self
            .writers
            .entry(from)
            .or_insert_with(|| FrameWriter::new(from));
        match said {
            Said::Message(message) => writer.write(message, self.signing.as_mut(), bytes),
            Said::EkfStatus(flags) => {
                writer.write_ekf_status(*flags, self.signing.as_mut(), bytes);
            }
            Said::Unsupported { command, to } => {
                writer.write_unsupported(*command, *to, self.signing.as_mut(), bytes);
            }
        }
    }
}

/// Returns what is gathered for a client; the last one is asked for most.
pub fn bytes_for(client: ClientId, out: &mut Vec<ClientBytes>) -> &mut Vec<u8> {
    let index = match out.iter().rposition(|(to, _)| *to == client) {
        Some(index) => index,
        None => {
            out.push((client, Vec::new()));
            out.len() - 1
        }
    };
    &mut out[index].1
}
