//! The frames of an XBee with 802.15.4 firmware, in API modes 1 and 2, to bytes and back. Knows neither what a payload says
//! nor which frame answers which.
//!
//! `7E length length data… checksum`, numbers big endian, the checksum FF less the sum of the data (Digi 90000982, 90001500,
//! 90002273). In mode 2 the bytes 7E, 7D, 11 and 13 behind the first one are said as 7D and the byte with bit 5 turned, so a
//! 7E is always a beginning. In mode 1 it may stand anywhere: what a broken frame held is searched for another beginning.
//!
//! ```text
//!   [between frames] ──7E──► [length] ──1 to 256──► [data, checksum] ──right──► a frame; [between frames]
//!          ▲                    │ other                    │ wrong; mode 2: 7E
//!          └──── counted, the next 7E of what came ────────┘
//! ```

mod frame;

use std::fmt;

pub use frame::{AtName, EncodeError, Frame, FrameError};

/// The most bytes of data in a frame; 802.15.4 firmware says at most 130.
pub const DATA_MOST: usize = 256;
/// The byte at which a frame begins.
const BEGIN: u8 = 0x7E;
/// The byte that says that the next one is escaped.
const ESCAPE: u8 = 0x7D;
/// What is turned of an escaped byte.
const TURNED: u8 = 0x20;
/// The first byte and the length.
const HEAD: usize = 3;

/// How a module marks its frames: register AP.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ApiMode {
    /// AP=1: as they are.
    Plain,
    /// AP=2: escaped.
    Escaped,
}

impl ApiMode {
    /// Returns the value of register AP.
    pub fn register(self) -> u8 {
        match self {
            ApiMode::Plain => 1,
            ApiMode::Escaped => 2,
        }
    }

    /// Returns the mode of a value of register AP; `None` = a module that speaks no frames.
    pub fn of_register(value: u32) -> Option<ApiMode> {
        [ApiMode::Plain, ApiMode::Escaped]
            .into_iter()
            .find(|mode| u32::from(mode.register()) == value)
    }
}

/// What could not be read, since the beginning.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct BadFrames {
    /// Their checksum is wrong.
    pub checksum: u64,
    /// Their length is 0 or over [`DATA_MOST`], they are too short or too long for what they are, or another
    /// one began within them.
    pub length: u64,
    /// They are sound, and of a type that is not known.
    pub unknown_type: u64,
}

impl BadFrames {
    /// Returns how many there were.
    pub fn total(self) -> u64 {
        self.checksum + self.length + self.unknown_type
    }
}

impl fmt::Display for BadFrames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let BadFrames {
            checksum,
            length,
            unknown_type,
        } = self;
        write!(
            f,
            "{checksum} with a wrong checksum, {length} of a wrong length, {unknown_type} of an unknown type"
        )
    }
}

/// Finds frames in bytes that may be anything. It holds at most [`DATA_MOST`] + 4 bytes whatever comes.
#[derive(Clone, Debug)]
pub struct Decoder {
    mode: ApiMode,
    /// What has come of a frame, from its first byte on, not escaped.
    begun: Vec<u8>,
    /// The last byte was an escape.
    is_escaped: bool,
    bad: BadFrames,
}

impl Decoder {
    /// Makes the decoder of a mode.
    pub fn new(mode: ApiMode) -> Decoder {
        Decoder {
            mode,
            begun: Vec::with_capacity(HEAD + DATA_MOST + 1),
            is_escaped: false,
            bad: BadFrames::default(),
        }
    }

    /// Drops what was begun, on a port that was opened anew or a module that has changed its mode.
    pub fn restart(&mut self, mode: ApiMode) {
        self.mode = mode;
        self.begun.clear();
        self.is_escaped = false;
    }

    /// Returns the mode whose frames it finds.
    pub fn mode(&self) -> ApiMode {
        self.mode
    }

    /// Takes bytes as they came, in any pieces, and gives each frame that they end.
    pub fn take(&mut self, bytes: &[u8], mut give: impl FnMut(Frame<'_>)) {
        match self.mode {
            ApiMode::Plain => self.take_plain(bytes, &mut give),
            ApiMode::Escaped => self.take_escaped(bytes, &mut give),
        }
    }

    /// Returns what could not be read.
    pub fn bad(&self) -> BadFrames {
        self.bad
    }

    /// Returns how many bytes of an unfinished frame it holds.
    pub fn held(&self) -> usize {
        self.begun.len()
    }

    fn take_plain(&mut self, mut bytes: &[u8], give: &mut impl FnMut(Frame<'_>)) {
        while !bytes.is_empty() {
            if self.begun.is_empty() {
                let Some(begin) = bytes.iter().position(|byte| *byte == BEGIN) else {
                    return;
                };
                bytes = &bytes[begin..];
            }
            let (next, rest) = bytes.split_at(self.missing().min(bytes.len()));
            self.begun.extend_from_slice(next);
            bytes = rest;
            while self.ends(give) {}
        }
    }

    fn take_escaped(&mut self, bytes: &[u8], give: &mut impl FnMut(Frame<'_>)) {
        for byte in bytes {
            match *byte {
                BEGIN => {
                    self.bad.length += u64::from(self.begun.len() > 1);
                    self.begun.clear();
                    self.begun.push(BEGIN);
                    self.is_escaped = false;
                    continue;
                }
                _ if self.begun.is_empty() => continue,
                ESCAPE if !self.is_escaped => {
                    self.is_escaped = true;
                    continue;
                }
                byte if self.is_escaped => self.begun.push(byte ^ TURNED),
                byte => self.begun.push(byte),
            }
            self.is_escaped = false;
            if self.missing() == 0 || self.begun.len() == HEAD {
                self.ends(give);
            }
        }
    }

    /// Returns how many bytes are missing until more can be said of the frame that was begun.
    fn missing(&self) -> usize {
        let whole = match self.length() {
            Some(length) => HEAD + length + 1,
            None => HEAD,
        };
        whole.saturating_sub(self.begun.len())
    }

    /// Returns how many bytes of data the frame says that it has, once that is known.
    fn length(&self) -> Option<usize> {
        let [_, high, low, ..] = self.begun[..] else {
            return None;
        };
        Some(usize::from(u16::from_be_bytes([high, low])))
    }

    /// Gives the frame that was begun if it is whole, or drops it if it can be none; returns whether either was so.
    fn ends(&mut self, give: &mut impl FnMut(Frame<'_>)) -> bool {
        let Some(length) = self.length() else {
            return false;
        };
        if length == 0 || length > DATA_MOST {
            self.bad.length += 1;
            self.drop_first();
            return true;
        }
        let end = HEAD + length;
        let Some(sum) = self.begun.get(end) else {
            return false;
        };
        let data = &self.begun[HEAD..end];
        if checksum(data) != *sum {
            self.bad.checksum += 1;
            self.drop_first();
            return true;
        }
        match Frame::parse(data) {
            Ok(frame) => give(frame),
            Err(FrameError::Length { .. } | FrameError::Empty) => self.bad.length += 1,
            Err(FrameError::UnknownType { .. }) => self.bad.unknown_type += 1,
        }
        self.drop_until(end + 1);
        true
    }

    /// Drops what was begun up to the next byte at which a frame may begin.
    fn drop_first(&mut self) {
        match self.mode {
            ApiMode::Plain => self.drop_until(1),
            // None of what came behind the first byte was one.
            ApiMode::Escaped => self.begun.clear(),
        }
    }

    fn drop_until(&mut self, from: usize) {
        let begin = self.begun[from..].iter().position(|byte| *byte == BEGIN);
        let until = begin.map_or(self.begun.len(), |begin| from + begin);
        self.begun.drain(..until);
    }
}

/// Returns the checksum of a frame's data.
fn checksum(data: &[u8]) -> u8 {
    0xFF - data.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte))
}

/// Appends the bytes of a frame in a mode.
///
/// # Errors
/// It is longer than [`DATA_MOST`]; then nothing is appended.
pub fn encode(frame: &Frame<'_>, mode: ApiMode, bytes: &mut Vec<u8>) -> Result<(), EncodeError> {
    let data = frame.data()?;
    let length = u16::try_from(data.len()).unwrap_or(u16::MAX);
    bytes.push(BEGIN);
    let behind = length
        .to_be_bytes()
        .into_iter()
        .chain(data.iter().copied())
        .chain([checksum(&data)]);
    match mode {
        ApiMode::Plain => bytes.extend(behind),
        ApiMode::Escaped => behind.for_each(|byte| match byte {
            BEGIN | ESCAPE | 0x11 | 0x13 => bytes.extend([ESCAPE, byte ^ TURNED]),
            byte => bytes.push(byte),
        }),
    }
    Ok(())
}

#[cfg(test)]
mod tests;
