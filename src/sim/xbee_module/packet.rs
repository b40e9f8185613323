//! What simulated modules say to each other.

use std::time::Duration;

use crate::hw::xbee_frame::AtName;

/// Time on the air of a packet without payload, and of each byte (Digi, "802.15.4 latency", less the listening).
const AIR_TIME: Duration = Duration::from_micros(416);
const AIR_TIME_BYTE: Duration = Duration::from_micros(32);
/// The address, and the serial number, of everybody.
const EVERYBODY: u16 = 0xFFFF;

/// A packet on the air.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Packet {
    /// The sender's address; FFFE and FFFF = it has none.
    pub from16: u16,
    /// The sender's serial number.
    pub from64: u64,
    /// For whom it is.
    pub to: Recipient,
    /// Its network: modules of another one do not hear it.
    pub network: u16,
    /// Radio channel.
    pub channel: u8,
    /// Transmit power, dBm.
    pub power_dbm: i8,
    /// Whether the maker's two bytes come before the payload (register MM): modules of the other kind do not understand it.
    pub has_header: bool,
    /// What it says.
    pub content: Content,
}

/// For whom a packet is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Recipient {
    /// An address; FFFF = everybody.
    Address(u16),
    /// A serial number; FFFF = everybody.
    Serial(u64),
}

/// What a packet says.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Content {
    /// What a host has said.
    Payload(Vec<u8>),
    /// A command for the module itself.
    Command {
        /// By what the sender calls it.
        id: u8,
        /// What.
        name: AtName,
        /// The value; empty = read, or a command.
        value: Vec<u8>,
    },
    /// The answer to a command.
    Answer {
        /// That of the command.
        id: u8,
        /// What.
        name: AtName,
        /// 0 = done.
        status: u8,
        /// What was read.
        value: Vec<u8>,
    },
}

impl Packet {
    /// Returns how long it is on the air.
    pub fn air_time(&self) -> Duration {
        let bytes = u32::try_from(self.content.length()).unwrap_or(u32::MAX);
        AIR_TIME + AIR_TIME_BYTE * bytes
    }
}

impl Content {
    /// Returns how many bytes it is.
    pub(super) fn length(&self) -> usize {
        match self {
            Content::Payload(payload) => payload.len(),
            Content::Command { value, .. } | Content::Answer { value, .. } => 4 + value.len(),
        }
    }
}

impl Recipient {
    /// Returns whether it is everybody.
    pub fn is_everybody(self) -> bool {
        match self {
            Recipient::Address(address) => address == EVERYBODY,
            Recipient::Serial(serial) => serial == u64::from(EVERYBODY),
        }
    }

    /// Returns whether a module of this address and serial number is meant.
    pub(super) fn includes(self, address: u16, serial: u64) -> bool {
        self.is_everybody()
            || self == Recipient::Address(address)
            || self == Recipient::Serial(serial)
    }
}
