//! What the range sensors of a vehicle heard a moment ago. This is the form on the wire.

use serde::{Deserialize, Serialize};

use crate::{Heading, Position, VehicleId};

/// Readings that one look names at most.
pub const LOOK_READINGS_MAX: usize = 16;
/// An older reading is not said, milliseconds.
pub const READING_AGE_MAX_MS: u16 = 2000;

/// The last readings of a vehicle's range sensors; said only while an operator's greeting asks for looks.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Look {
    /// Whose.
    pub vehicle: VehicleId,
    /// Half of the angle of a sensor's cone, between its axis and its edge.
    pub half_angle: Heading,
    /// From farther away no echo comes, millimetres.
    pub max_range_mm: u32,
    /// In the order in which they were taken, each said once; at most [`LOOK_READINGS_MAX`].
    pub readings: Vec<LookReading>,
}

/// A reading of a range sensor.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct LookReading {
    /// Where the vehicle was, in the venue's frame.
    pub at: Position,
    /// Which way the sensor looked, in the venue's frame.
    pub toward: Heading,
    /// Distance to what gave the echo, millimetres; `None` = no echo came.
    pub range_mm: Option<u32>,
    /// Whether it jumped, and no other reading has confirmed it yet.
    pub is_suspect: bool,
    /// How long ago that was when it was said, milliseconds; at most [`READING_AGE_MAX_MS`].
    pub age_ms: u16,
}
