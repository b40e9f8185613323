//! The items of a stored mission as they travel: what an autopilot carries out by itself, one after the other. What each means
//! to an autopilot, and which it takes, is not known here.

use serde::{Deserialize, Serialize};

use crate::check::{CheckResult, require};
use crate::{Heading, Position};

/// Items of a stored mission at most, home not counted: as many as an ArduPilot stores beside its home.
pub const STORED_ITEMS_MAX: usize = 717;

/// One item. Heights are above home, and mean nothing to what drives.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum StoredItem {
    /// Go to a place, and stay there.
    Waypoint {
        /// The place; z is its height.
        at: Position,
        /// How long to stay, milliseconds.
        stay_ms: u32,
    },
    /// Climb.
    Takeoff {
        /// To which height, millimetres.
        height_mm: i32,
    },
    /// Stay at a place for a time.
    Loiter {
        /// The place; z is its height.
        at: Position,
        /// How long, milliseconds.
        time_ms: u32,
    },
    /// Wait, milliseconds.
    Delay(u32),
    /// Land, at a place or where it is.
    Land(Option<Position>),
    /// Go home.
    Return,
    /// Travel at this speed from now on, mm/s.
    Speed(u32),
    /// Set a servo output.
    Servo {
        /// The output, counted from 1.
        channel: u8,
        /// Pulse width, microseconds.
        pulse_us: u16,
    },
    /// Face a direction of the venue's frame.
    Yaw(Heading),
    /// Go on with another item.
    Jump {
        /// Which, counted from 1.
        to: u16,
        /// How often; `None` = for ever.
        times: Option<u16>,
    },
    /// Whatever else an autopilot may know: a command of MAVLink as it stands in the file.
    Other {
        /// Its number (MAV_CMD).
        command: u16,
        /// The place, if it names one; z is its height.
        at: Option<Position>,
        /// Its first four parameters.
        parameters: [Parameter; 4],
    },
}

impl StoredItem {
    /// Returns the place that it names.
    pub fn place(&self) -> Option<Position> {
        match self {
            StoredItem::Waypoint { at, .. } | StoredItem::Loiter { at, .. } => Some(*at),
            StoredItem::Land(at) | StoredItem::Other { at, .. } => *at,
            StoredItem::Takeoff { .. }
            | StoredItem::Delay(_)
            | StoredItem::Return
            | StoredItem::Speed(_)
            | StoredItem::Servo { .. }
            | StoredItem::Yaw(_)
            | StoredItem::Jump { .. } => None,
        }
    }
}

/// A parameter of a command, by the bits of its number: what is not given is no number (NaN), and equals itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Parameter(u32);

impl From<f32> for Parameter {
    fn from(number: f32) -> Parameter {
        Parameter(number.to_bits())
    }
}

impl Parameter {
    /// Returns its number.
    pub fn number(self) -> f32 {
        f32::from_bits(self.0)
    }
}

/// Returns why a mission is impossible, if it is; `from` is the item that it begins with.
pub(super) fn check(items: &[StoredItem], from: u16) -> CheckResult {
    let count = items.len();
    require(
        (1..=STORED_ITEMS_MAX).contains(&count),
        "a stored mission has 1 to 717 items",
    )?;
    let is_one = |item: u16| (1..=count).contains(&usize::from(item));
    require(
        is_one(from),
        "a stored mission begins with one of its items",
    )?;
    for item in items {
        item.place().iter().try_for_each(Position::check)?;
        if let StoredItem::Yaw(heading) = item {
            require(
                *heading <= Heading::LAST,
                "a direction is less than a full turn",
            )?;
        }
        if let StoredItem::Jump { to, .. } = item {
            require(is_one(*to), "a jump leads to an item")?;
        }
    }
    Ok(())
}
