//! Messages as a stranger may say them: right checksums, and contents of which some make sense. The library is named here, and
//! nowhere else outside of `src/mavlink/`: what is tested does not make its own inputs.

use mavlink::{MavlinkVersion, Message, calculate_crc};
use tomoswarm::mavlink::dialect::MavMessage;
use tomoswarm::mavlink::frames::MavAddress;
use tomoswarm::mavlink::wire_message::EKF_STATUS;

use crate::chance::Chance;

/// Messages that somebody here listens to.
const HEARD: [u32; 52] = [
    0, 1, 2, 4, 11, 20, 21, 22, 22, 23, 24, 30, 32, 33, 39, 40, 41, 42, 43, 44, 45, 47, 47, 48, 49,
    51, 65, 66, 70, 73, 73, 75, 76, 76, 77, 77, 84, 86, 111, EKF_STATUS, 148, 230, 242, 245, 246,
    253, 132, 132, 132, 132, 330, 330,
];
/// Commands that somebody here carries out, and some that nobody does.
const COMMANDS: [u16; 30] = [
    16, 17, 19, 20, 21, 22, 93, 112, 115, 176, 177, 178, 179, 183, 192, 206, 222, 224, 300, 400,
    410, 510, 511, 512, 519, 520, 0, 2000, 31_000, 42_000,
];
const FLOATS: [f32; 16] = [
    0.0,
    1.0,
    -1.0,
    2.0,
    4.0,
    15.0,
    33.0,
    100_000.0,
    21_196.0,
    1e-30,
    1e9,
    -1e9,
    f32::MAX,
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
];
const INTEGERS: [i32; 8] = [
    0,
    1,
    -1,
    520_000_000,
    40_000_000,
    i32::MAX,
    i32::MIN,
    900_000_001,
];

/// A message before it is framed.
pub struct Payload {
    id: u32,
    bytes: Vec<u8>,
}

/// Draws a message with some of its fields drawn, too.
pub fn payload(chance: &mut Chance) -> Payload {
    let id = match chance.happens(0.9) {
        true => chance.one_of(&HEARD),
        false => chance.below(500) as u32,
    };
    payload_of(chance, id)
}

/// Draws a message of one number.
pub fn payload_of(chance: &mut Chance, id: u32) -> Payload {
    let mut bytes = [0; 255];
    if let Some(message) = MavMessage::default_message_from_id(id) {
        message.ser(MavlinkVersion::V2, &mut bytes);
    }
    for _ in 0..chance.below(10) {
        disturb(chance, &mut bytes);
    }
    let command_at = match id {
        73 => 30,
        _ => 28,
    };
    if [73, 75, 76].contains(&id) && chance.happens(0.9) {
        let command = chance.one_of(&COMMANDS);
        bytes[command_at..command_at + 2].copy_from_slice(&command.to_le_bytes());
    }
    if id == 77 && chance.happens(0.9) {
        bytes[..2].copy_from_slice(&chance.one_of(&COMMANDS).to_le_bytes());
    }
    if [20, 22, 23].contains(&id) && chance.happens(0.7) {
        let name = chance.one_of(&[
            "FS_ACTION",
            "FS_GCS_ENABLE",
            "FS_GCS_TIMEOUT",
            "WP_SPEED",
            "SYSID_MYGCS",
            "BATT_MONITOR",
        ]);
        let at = if id == 22 { 8 } else { id as usize % 10 * 2 };
        let at = if id == 23 { 6 } else { at.max(4) };
        bytes[at..at + name.len()].copy_from_slice(name.as_bytes());
    }
    if id == 132 && chance.happens(0.7) {
        // Limits and a distance, so that some of it is a reading.
        for (at, cm) in [(4, 20), (6, 700), (8, chance.below(900) as u16)] {
            bytes[at..at + 2].copy_from_slice(&cm.to_le_bytes());
        }
    }
    let used = bytes
        .iter()
        .rposition(|byte| *byte != 0)
        .map_or(1, |last| last + 1);
    Payload {
        id,
        bytes: bytes[..used].to_vec(),
    }
}

/// Writes something over one field, wherever that is.
fn disturb(chance: &mut Chance, bytes: &mut [u8]) {
    let (word, byte) = (4 * chance.below(10), chance.below(54));
    match chance.below(5) {
        0 | 1 => bytes[word..word + 4].copy_from_slice(&chance.one_of(&FLOATS).to_le_bytes()),
        2 => bytes[word..word + 4].copy_from_slice(&chance.one_of(&INTEGERS).to_le_bytes()),
        3 => bytes[byte] = chance.below(8) as u8,
        _ => bytes[byte] = chance.below(256) as u8,
    }
}

impl Payload {
    /// Returns it as a frame of MAVLink 2.
    pub fn framed(&self, from: MavAddress, sequence: u8) -> Vec<u8> {
        let id = self.id.to_le_bytes();
        let mut frame = vec![
            0xFD,
            self.bytes.len() as u8,
            0,
            0,
            sequence,
            from.system,
            from.component,
            id[0],
            id[1],
            id[2],
        ];
        frame.extend(&self.bytes);
        self.closed(frame)
    }

    /// Returns it as a frame of MAVLink 1.
    pub fn framed_as_1(&self, from: MavAddress, sequence: u8) -> Vec<u8> {
        let mut frame = vec![
            0xFE,
            self.bytes.len() as u8,
            sequence,
            from.system,
            from.component,
            self.id as u8,
        ];
        frame.extend(&self.bytes);
        self.closed(frame)
    }

    /// Returns what it says; `None` when it makes no sense.
    pub fn message(&self) -> Option<MavMessage> {
        MavMessage::parse(MavlinkVersion::V2, self.id, &self.bytes).ok()
    }

    fn closed(&self, mut frame: Vec<u8>) -> Vec<u8> {
        let crc = calculate_crc(&frame[1..], extra_crc(self.id));
        frame.extend(crc.to_le_bytes());
        frame
    }
}

/// What a checksum begins with; that of EKF_STATUS_REPORT is not in the dialect.
fn extra_crc(id: u32) -> u8 {
    match id {
        EKF_STATUS => 71,
        _ => MavMessage::extra_crc(id),
    }
}

/// Draws a message of these numbers that makes sense.
pub fn message_of(chance: &mut Chance, ids: &[u32]) -> MavMessage {
    loop {
        let id = chance.one_of(ids);
        if let Some(message) = payload_of(chance, id).message() {
            return message;
        }
    }
}

/// Damages a byte, cuts the end off or says a piece twice.
pub fn damage(chance: &mut Chance, bytes: &mut Vec<u8>) {
    let at = chance.below(bytes.len());
    match chance.below(4) {
        0 => bytes.truncate(at),
        1 => bytes.extend_from_within(at..),
        _ => bytes[at] ^= 1 << chance.below(8),
    }
}

/// Returns how many frames of MAVLink 2 these bytes are; `None` when they are anything else.
pub fn count_frames(mut bytes: &[u8]) -> Option<usize> {
    let mut count = 0;
    while !bytes.is_empty() {
        let end = 10 + usize::from(*bytes.get(1)?);
        let id = u32::from_le_bytes([*bytes.get(7)?, *bytes.get(8)?, *bytes.get(9)?, 0]);
        let crc = calculate_crc(bytes.get(1..end)?, extra_crc(id));
        if bytes[0] != 0xFD || *bytes.get(end..end + 2)? != crc.to_le_bytes() {
            return None;
        }
        (bytes, count) = (&bytes[end + 2..], count + 1);
    }
    Some(count)
}
