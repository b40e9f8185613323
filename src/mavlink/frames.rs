//! Bytes to messages and back: frames of MAVLink 1 and 2 in any pieces, with garbage between them; out go frames of MAVLink 2.
//! What a message means is not known here.

use std::collections::VecDeque;
use std::io::{self, Read};

use mavlink::error::MessageReadError;

use mavlink::{
    MAVLinkMessageRaw, MAVLinkV2MessageRaw, MavHeader, MavlinkReader, Message, MessageData,
    calculate_crc,
};

use num_traits::FromPrimitive;

use super::dialect::{
    COMMAND_ACK_DATA, COMMAND_INT_DATA, COMMAND_LONG_DATA, EstimatorStatusFlags, MavCmd,
    MavMessage, MavResult,
};
use super::signing::Signing;
use super::wire_message::WireMessage;

/// Bytes of an unfinished frame are kept, of what is not read more than this is dropped, the oldest first.
const UNREAD_MAX: usize = 64 * 1024;
/// Where the payload of a frame of MAVLink 2 begins.
const PAYLOAD_FROM: usize = 10;

/// The component of an autopilot.
pub const AUTOPILOT: u8 = 1;

/// Who says a message: a system (a vehicle, a ground station) and a component of it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct MavAddress {
    /// 1 to 255.
    pub system: u8,
    /// 1 to 255; see [`AUTOPILOT`].
    pub component: u8,
}

/// A message as it came.
#[derive(Clone, PartialEq, Debug)]
pub struct Frame {
    /// Who says it.
    pub from: MavAddress,
    /// It counts up by one with every message of its sender: gaps are losses.
    pub sequence: u8,
    /// What it says.
    pub content: Content,
}

/// What a frame holds.
#[derive(Clone, PartialEq, Debug)]
pub enum Content {
    /// A message of the dialect.
    Message(Box<MavMessage>),
    /// What ArduPilot's estimator knows.
    EkfStatus(EstimatorStatusFlags),
    /// A command that the dialect does not know: it is answered all the same.
    UnknownCommand {
        /// Its number.
        command: u16,
        /// Who is to carry it out; 0 = everybody.
        target_system: u8,
    },
}

/// What was not taken, since the beginning.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct DroppedFrames {
    /// With a right checksum, and a content that makes no sense.
    pub unreadable: u64,
    /// Not signed, or not as they should be.
    pub untrusted: u64,
    /// Bytes that were not read in time.
    pub unread_bytes: u64,
}

/// Reads frames out of bytes.
pub struct FrameReader {
    reader: MavlinkReader<ByteQueue>,
    dropped: DroppedFrames,
}

impl Default for FrameReader {
    fn default() -> FrameReader {
        FrameReader {
            reader: MavlinkReader::new(ByteQueue::default()),
            dropped: DroppedFrames::default(),
        }
    }
}

impl FrameReader {
    /// Takes bytes as they came, in any pieces.
    pub fn push(&mut self, bytes: &[u8]) {
        let queue = &mut self.reader.get_mut().0;
        queue.extend(bytes);
        let over = queue.len().saturating_sub(UNREAD_MAX);
        queue.drain(..over);
        self.dropped.unread_bytes += over as u64;
    }

    /// Returns the next message that is whole; `None` when more bytes are needed. With `signing` those that are not signed
    /// rightly are dropped.
    pub fn next(&mut self, mut signing: Option<&mut Signing>) -> Option<Frame> {
        loop {
            let raw = match self.reader.read_any_raw_message::<WireMessage>() {
                Ok(raw) => raw,
                Err(MessageReadError::Io(_)) => return None,
                Err(_) => {
                    self.dropped.unreadable += 1;
                    continue;
                }
            };
            if let Some(signing) = &mut signing
                && signing.check(&raw).is_err()
            {
                self.dropped.untrusted += 1;
                continue;
            }
            match frame_of(&raw) {
                Some(frame) => return Some(frame),
                None => self.dropped.unreadable += 1,
            }
        }
    }

    /// Returns what was not taken.
    pub fn dropped(&self) -> DroppedFrames {
        self.dropped
    }
}

fn frame_of(raw: &MAVLinkMessageRaw) -> Option<Frame> {
    let content = match WireMessage::parse(raw.version(), raw.message_id(), raw.payload()) {
        Ok(WireMessage::Dialect(message)) => Content::Message(message),
        Ok(WireMessage::EkfStatus(flags)) => Content::EkfStatus(flags),
        Err(_) => unknown_command(raw)?,
    };
    Some(Frame {
        from: MavAddress {
            system: u8::try_from(raw.system_id()).ok()?,
            component: raw.component_id(),
        },
        sequence: raw.sequence(),
        content,
    })
}

/// Reads the command of a COMMAND_INT or COMMAND_LONG whose number the dialect has no name for.
fn unknown_command(raw: &MAVLinkMessageRaw) -> Option<Content> {
    // Both begin with 28 bytes of parameters; MAVLink 2 leaves out zeros at the end.
    let byte = |index: usize| raw.payload().get(index).copied().unwrap_or(0);
    let command = u16::from_le_bytes([byte(28), byte(29)]);
    let is_command = [COMMAND_INT_DATA::ID, COMMAND_LONG_DATA::ID].contains(&raw.message_id());
    let is_unknown = MavCmd::from_u16(command).is_none();
    (is_command && is_unknown).then(|| Content::UnknownCommand {
        command,
        target_system: byte(30),
    })
}

/// Returns whom a message is for; `None` when its kind names nobody.
pub fn target_of(message: &MavMessage) -> Option<u8> {
    message.target_system_id()
}

/// Returns how many bytes of these, which begin with a frame of MAVLink 2, belong to whole frames that fit into a packet of so
/// many bytes; at least the first.
pub fn fitting(bytes: &[u8], most: usize) -> usize {
    let frame_at = |at: usize| {
        let flags_and_length = (bytes.get(at + 2)?, bytes.get(at + 1)?);
        let signature = if flags_and_length.0 & 1 == 1 { 13 } else { 0 };
        Some(at + PAYLOAD_FROM + usize::from(*flags_and_length.1) + 2 + signature)
    };
    let mut end = frame_at(0).unwrap_or(bytes.len());
    while let Some(next) = frame_at(end).filter(|next| *next <= most.min(bytes.len())) {
        end = next;
    }
    end.min(bytes.len())
}

/// Makes frames of the messages of one sender.
pub struct FrameWriter {
    from: MavAddress,
    sequence: u8,
}

impl FrameWriter {
    /// Makes the writer of a sender that has said nothing yet.
    pub fn new(from: MavAddress) -> FrameWriter {
        FrameWriter { from, sequence: 0 }
    }

    /// Appends the frame of a message to some bytes.
    pub fn write(
        &mut self,
        message: &MavMessage,
        signing: Option<&mut Signing>,
        bytes: &mut Vec<u8>,
    ) {
        self.write_patched(message, None, signing, bytes);
    }

    /// Appends what an estimator knows, as ArduPilot says it.
    pub fn write_ekf_status(
        &mut self,
        flags: EstimatorStatusFlags,
        signing: Option<&mut Signing>,
        bytes: &mut Vec<u8>,
    ) {
        self.write_patched(&WireMessage::EkfStatus(flags), None, signing, bytes);
    }

    /// Appends the answer that a command is not known, whose number the dialect has no name for.
    pub fn write_unsupported(
        &mut self,
        command: u16,
        to: MavAddress,
        signing: Option<&mut Signing>,
        bytes: &mut Vec<u8>,
    ) {
        let answer = COMMAND_ACK_DATA {
            result: MavResult::MAV_RESULT_UNSUPPORTED,
            target_system: to.system,
            target_component: to.component,
            ..COMMAND_ACK_DATA::default()
        };
        self.write_patched(
            &MavMessage::COMMAND_ACK(answer),
            Some(command),
            signing,
            bytes,
        );
    }

    /// Appends a frame, with a number in the place of the first field if one is given.
    fn write_patched(
        &mut self,
        message: &impl Message,
        first: Option<u16>,
        signing: Option<&mut Signing>,
        bytes: &mut Vec<u8>,
    ) {
        let header = MavHeader {
            system_id: u32::from(self.from.system),
            component_id: self.from.component,
            sequence: self.sequence,
        };
        self.sequence = self.sequence.wrapping_add(1);
        let mut raw = MAVLinkV2MessageRaw::new();
        match signing {
            None => raw.serialize_message(header, message),
            Some(_) => raw.serialize_message_for_signing(header, message),
        }
        if let Some(first) = first {
            let end = PAYLOAD_FROM + usize::from(raw.payload_length());
            let frame = raw.as_mut_slice();
            frame[PAYLOAD_FROM..PAYLOAD_FROM + 2].copy_from_slice(&first.to_le_bytes());
            // The checksum leaves out the byte at which a frame begins.
            let crc = calculate_crc(&frame[1..end], WireMessage::extra_crc(message.message_id()));
            frame[end..end + 2].copy_from_slice(&crc.to_le_bytes());
        }
        if let Some(signing) = signing {
            signing.sign(&mut raw);
        }
        bytes.extend_from_slice(raw.raw_bytes());
    }
}

/// Bytes that wait to be read; when none are left a reader is to come again.
#[derive(Default)]
struct ByteQueue(VecDeque<u8>);

impl Read for ByteQueue {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        match self.0.read(into)? {
            0 if !into.is_empty() => Err(io::ErrorKind::WouldBlock.into()),
            count => Ok(count),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mavlink::dialect::{HEARTBEAT_DATA, PARAM_SET_DATA};

    const FROM: MavAddress = MavAddress {
        system: 7,
        component: 1,
    };

    fn messages() -> Vec<MavMessage> {
        let mut set = PARAM_SET_DATA::default();
        (set.target_system, set.param_value) = (3, 2.5);
        vec![
            MavMessage::HEARTBEAT(HEARTBEAT_DATA::default()),
            MavMessage::PARAM_SET(set),
        ]
    }

    fn bytes_of(messages: &[MavMessage], mut signing: Option<Signing>) -> Vec<u8> {
        let (mut writer, mut bytes) = (FrameWriter::new(FROM), Vec::new());
        for message in messages {
            writer.write(message, signing.as_mut(), &mut bytes);
        }
        bytes
    }

    /// All that is read out of bytes that come so many at a time.
    fn read(bytes: &[u8], at_a_time: usize, signing: &mut Option<Signing>) -> Vec<Frame> {
        let mut reader = FrameReader::default();
        let mut frames = Vec::new();
        for piece in bytes.chunks(at_a_time) {
            reader.push(piece);
            frames.extend(std::iter::from_fn(|| reader.next(signing.as_mut())));
        }
        frames
    }

    #[test]
    fn what_is_written_is_read_in_whatever_pieces_it_comes() {
        let bytes = bytes_of(&messages(), None);
        for at_a_time in 1..bytes.len() {
            let frames = read(&bytes, at_a_time, &mut None);
            let read: Vec<MavMessage> = frames
                .iter()
                .map(|frame| message_of(frame).clone())
                .collect();
            assert_eq!(read, messages());
            let heads: Vec<_> = frames
                .iter()
                .map(|frame| (frame.from, frame.sequence))
                .collect();
            assert_eq!(heads, [(FROM, 0), (FROM, 1)]);
        }
    }

    #[test]
    fn garbage_and_damage_cost_no_other_frame() {
        let frame = bytes_of(&messages()[1..], None);
        let mut bytes = b"\r\n\xfd\xfe Ready to FLY \xfd\x09".to_vec();
        bytes.extend(&frame);
        for flip in 0..frame.len() {
            let mut damaged = frame.clone();
            damaged[flip] ^= 0x10;
            bytes.extend(damaged);
            bytes.extend(&frame);
        }
        let frames = read(&bytes, 11, &mut None);
        let whole = frames
            .iter()
            .filter(|frame| *message_of(frame) == messages()[1]);
        // One byte is not covered by the checksum: that at which a frame begins, and it is no frame then.
        assert_eq!(whole.count(), frame.len() + 1);
    }

    fn message_of(frame: &Frame) -> &MavMessage {
        match &frame.content {
            Content::Message(message) => message,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_command_without_a_name_is_read_and_answered_by_its_number() {
        let (mut writer, mut bytes) = (FrameWriter::new(FROM), Vec::new());
        let message = MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
            target_system: 9,
            ..Default::default()
        });
        writer.write(&message, None, &mut bytes);
        let end = bytes.len() - 2;
        bytes[PAYLOAD_FROM + 28..PAYLOAD_FROM + 30].copy_from_slice(&31_999_u16.to_le_bytes());
        let crc = calculate_crc(&bytes[1..end], MavMessage::extra_crc(76));
        bytes[end..].copy_from_slice(&crc.to_le_bytes());
        let frames = read(&bytes, 5, &mut None);
        let unknown = Content::UnknownCommand {
            command: 31_999,
            target_system: 9,
        };
        assert_eq!(frames[0].content, unknown);
        for mut signing in [None, Some(Signing::new([3; 32], 0, 1))] {
            let mut answer = Vec::new();
            writer.write_unsupported(31_999, FROM, signing.as_mut(), &mut answer);
            assert_eq!(answer[PAYLOAD_FROM..PAYLOAD_FROM + 3], [0xFF, 0x7C, 3]);
            let crc = calculate_crc(
                &answer[1..PAYLOAD_FROM + usize::from(answer[1])],
                MavMessage::extra_crc(77),
            );
            let at = PAYLOAD_FROM + usize::from(answer[1]);
            assert_eq!(answer[at..at + 2], crc.to_le_bytes());
        }
    }

    #[test]
    fn a_packet_holds_whole_frames() {
        for signing in [None, Some(Signing::new([3; 32], 0, 1))] {
            let bytes = bytes_of(&messages(), signing);
            let first = bytes.len() - bytes_of_last(&bytes);
            assert_eq!(fitting(&bytes, 1), first);
            assert_eq!(fitting(&bytes, bytes.len() - 1), first);
            assert_eq!(fitting(&bytes, bytes.len()), bytes.len());
            assert_eq!(fitting(&bytes[..5], 100), 5, "no whole frame");
        }
        assert_eq!(fitting(&[], 100), 0);
    }

    fn bytes_of_last(bytes: &[u8]) -> usize {
        let last = bytes.iter().rposition(|byte| *byte == 0xFD).unwrap();
        bytes.len() - last
    }

    #[test]
    fn what_nobody_reads_is_bounded() {
        let mut reader = FrameReader::default();
        reader.push(&vec![0xFD; UNREAD_MAX * 3]);
        assert_eq!(reader.dropped().unread_bytes, UNREAD_MAX as u64 * 2);
        while reader.next(None).is_some() {}
        reader.push(&bytes_of(&messages(), None));
        assert!(std::iter::from_fn(|| reader.next(None)).count() >= 1);
    }

    #[test]
    fn with_a_key_only_frames_of_that_key_are_believed_each_once() {
        let signing = |key: u8| Signing::new([key; 32], 0, 5_000);
        let signed = bytes_of(&messages(), Some(signing(1)));
        let believed = |bytes: &[u8], key| read(bytes, 9, &mut Some(signing(key))).len();
        assert_eq!(believed(&signed, 1), 2);
        assert_eq!(believed(&signed, 2), 0, "another key");
        assert_eq!(believed(&bytes_of(&messages(), None), 1), 0, "not signed");
        assert_eq!(
            believed(&[signed.clone(), signed.clone()].concat(), 1),
            2,
            "played again"
        );
        let late = Some(Signing::new([1; 32], 0, 7_000_000));
        assert_eq!(
            read(&signed, 9, &mut late.clone()).len(),
            0,
            "of more than a minute ago"
        );
        assert_eq!(
            read(&signed, 9, &mut None).len(),
            2,
            "who knows no key hears all"
        );
    }
}
