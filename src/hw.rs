//! The pure halves of drivers: what the bytes of a device mean. They open no port and read no clock, and are built without
//! features; the thin halves are in `run/drivers`.
//!
//! A range sensor that measures all the time and says so on a serial line is a file beside this one and a variant of
//! [`RangeDecoder`]. A radio is an XBee: its frames, what its registers must say, the modem that carries beacons over it, and
//! its set-up.

pub mod echo_edges;
pub mod edge_recording;
mod lines;
pub mod pin_name;
mod pings;
pub mod pulse;
mod serial_text;
mod tf_frame;
pub mod xbee_frame;
pub mod xbee_modem;
pub mod xbee_registers;
pub mod xbee_setup;

use std::fmt;

pub use pings::Pings;

use self::serial_text::TextDecoder;
use self::tf_frame::TfDecoder;
use crate::config::{SensorCoverage, SerialProtocol};
use crate::time::Time;

/// What a range sensor has measured.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum RangeReading {
    /// Something gives an echo, so far away, metres.
    Range(f64),
    /// The sensor says that it has measured and heard nothing within its range. A sensor that is silent says no such thing.
    Nothing,
}

/// A reading and when it was measured.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TimedReading {
    /// It was measured at this time or later, as far as its bytes show.
    pub measured: Time,
    /// What was measured.
    pub reading: RangeReading,
}

/// What was dropped of what a range sensor said.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct DroppedReadings {
    /// Lines or frames that are longer than any is.
    pub too_long: u64,
    /// Lines or frames that are no reading.
    pub unreadable: u64,
    /// Readings that the sensor cannot have measured.
    pub out_of_range: u64,
    /// Readings that the sensor itself does not trust.
    pub unreliable: u64,
}

impl DroppedReadings {
    /// Returns how much was dropped.
    pub fn total(self) -> u64 {
        self.too_long + self.unreadable + self.out_of_range + self.unreliable
    }
}

impl fmt::Display for DroppedReadings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let DroppedReadings {
            too_long,
            unreadable,
            out_of_range,
            unreliable,
        } = self;
        write!(
            f,
            "{too_long} too long, {unreadable} unreadable, {out_of_range} out of range, {unreliable} unreliable"
        )
    }
}

/// Turns the bytes of a range sensor into readings.
#[derive(Clone, Debug)]
pub enum RangeDecoder {
    /// Lines of text.
    Text(TextDecoder),
    /// Frames of a TF-Luna or TFmini.
    Tf(TfDecoder),
}

impl RangeDecoder {
    /// Makes the decoder of a protocol, for a sensor that looks so far.
    pub fn new(protocol: &SerialProtocol, look: &SensorCoverage) -> RangeDecoder {
        match protocol {
            SerialProtocol::Text(text) => RangeDecoder::Text(TextDecoder::new(text, look)),
            SerialProtocol::Tf(sensor) => RangeDecoder::Tf(TfDecoder::new(*sensor, look)),
        }
    }

    /// Begins anew, on a port that was opened anew: what was begun is never ended.
    pub fn restart(&mut self) {
        match self {
            RangeDecoder::Text(decoder) => decoder.restart(),
            RangeDecoder::Tf(decoder) => decoder.restart(),
        }
    }

    /// Takes bytes that came at `since` or later, and adds the readings that they end.
    pub fn take(&mut self, since: Time, bytes: &[u8], readings: &mut Vec<TimedReading>) {
        match self {
            RangeDecoder::Text(decoder) => decoder.take(since, bytes, readings),
            RangeDecoder::Tf(decoder) => decoder.take(since, bytes, readings),
        }
    }

    /// Returns what was dropped so far.
    pub fn dropped(&self) -> DroppedReadings {
        match self {
            RangeDecoder::Text(decoder) => decoder.dropped(),
            RangeDecoder::Tf(decoder) => decoder.dropped(),
        }
    }
}
