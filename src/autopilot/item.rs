//! The items of a stored mission, and which of them are taken: as ArduPilot judges an upload. How they are carried out is
//! not known here.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Parameter, StoredItem};

use super::command::VehicleKind;
use crate::geom::{Angle, Point};

/// The most items that are stored, home included.
pub const ITEMS_MAX: usize = 718;
/// Places are nearer to the datum than this along each axis, metres.
const PLACE_MAX_M: f64 = 1e6;
/// Altitudes are between these, metres above home.
const ALTITUDE_M: std::ops::RangeInclusive<f64> = -1000.0..=10_000.0;

/// One item of a mission.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub enum Item {
    /// Go to a place.
    Waypoint {
        /// The place.
        at: Point,
        /// Altitude above home, metres; no effect on rovers.
        altitude_m: f64,
        /// How long to stay there.
        delay: Duration,
    },
    /// Climb where it is; copters only.
    Takeoff {
        /// Altitude above home, metres.
        altitude_m: f64,
    },
    /// Go to a place and stay there for a while.
    Loiter {
        /// The place.
        at: Point,
        /// Altitude above home, metres; no effect on rovers.
        altitude_m: f64,
        /// How long.
        time: Duration,
    },
    /// Stay where it is for a while.
    Delay(Duration),
    /// Come down, at a place or where it is; copters only.
    Land {
        /// The place.
        at: Option<Point>,
    },
    /// Return home; a copter lands there.
    Return,
    /// Travel at this speed from now on, m/s.
    Speed(f64),
    /// Set a servo output.
    Servo {
        /// Output, 1 to 16.
        channel: u8,
        /// Pulse width, microseconds.
        pulse_us: u16,
    },
    /// Face a direction.
    Yaw(Angle),
    /// Go on with another item.
    Jump {
        /// Which one; not home.
        to: usize,
        /// How often; `None` = for ever. After that the next item follows.
        times: Option<u16>,
    },
    /// A command of MAVLink that only an autopilot knows.
    Other {
        /// Its number (MAV_CMD).
        command: u16,
        /// The place, if it names one.
        at: Option<Point>,
        /// Altitude above home, metres.
        altitude_m: f64,
        /// Its first four parameters; one that is no number is the autopilot's own to choose.
        parameters: [f32; 4],
    },
}

impl From<&StoredItem> for Item {
    fn from(stored: &StoredItem) -> Item {
        let milliseconds = |time_ms: u32| Duration::from_millis(u64::from(time_ms));
        match *stored {
            StoredItem::Waypoint { at, stay_ms } => Item::Waypoint {
                at: at.into(),
                altitude_m: at.z_m(),
                delay: milliseconds(stay_ms),
            },
            StoredItem::Takeoff { height_mm } => Item::Takeoff {
                altitude_m: f64::from(height_mm) / 1000.0,
            },
            StoredItem::Loiter { at, time_ms } => Item::Loiter {
                at: at.into(),
                altitude_m: at.z_m(),
                time: milliseconds(time_ms),
            },
            StoredItem::Delay(time_ms) => Item::Delay(milliseconds(time_ms)),
            StoredItem::Land(at) => Item::Land {
                at: at.map(Point::from),
            },
            StoredItem::Return => Item::Return,
            StoredItem::Speed(speed_mmps) => Item::Speed(f64::from(speed_mmps) / 1000.0),
            StoredItem::Servo { channel, pulse_us } => Item::Servo { channel, pulse_us },
            StoredItem::Yaw(heading) => Item::Yaw(Angle::from_radians(heading.radians())),
            StoredItem::Jump { to, times } => Item::Jump {
                to: usize::from(to),
                times,
            },
            StoredItem::Other {
                command,
                at,
                parameters,
            } => Item::Other {
                command,
                at: at.map(Point::from),
                altitude_m: at.map_or(0.0, |at| at.z_m()),
                parameters: parameters.map(Parameter::number),
            },
        }
    }
}

/// Why a mission is not taken; the stored one stays.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ItemError {
    /// MAV_MISSION_NO_SPACE.
    #[error("{count} items are more than {ITEMS_MAX}")]
    TooMany {
        /// How many.
        count: usize,
    },
    /// MAV_MISSION_UNSUPPORTED.
    #[error("item {item} is not for this kind of vehicle")]
    Unsupported {
        /// Which one.
        item: usize,
    },
    /// MAV_MISSION_INVALID_PARAM5_X (a latitude on the wire).
    #[error("item {item}: x is not finite or too far")]
    X {
        /// Which one.
        item: usize,
    },
    /// MAV_MISSION_INVALID_PARAM6_Y (a longitude on the wire).
    #[error("item {item}: y is not finite or too far")]
    Y {
        /// Which one.
        item: usize,
    },
    /// MAV_MISSION_INVALID_PARAM7 or another parameter.
    #[error("item {item}: a parameter makes no sense")]
    Parameter {
        /// Which one.
        item: usize,
    },
}

impl ItemError {
    /// Returns the number of MAV_MISSION_RESULT.
    pub fn code(self) -> u8 {
        match self {
            ItemError::TooMany { .. } => 4,
            ItemError::Unsupported { .. } => 3,
            ItemError::X { .. } => 10,
            ItemError::Y { .. } => 11,
            ItemError::Parameter { .. } => 5,
        }
    }
}

impl Item {
    /// Returns the place to which it leads.
    pub fn place(&self) -> Option<Point> {
        match self {
            Item::Waypoint { at, .. } | Item::Loiter { at, .. } => Some(*at),
            Item::Land { at } | Item::Other { at, .. } => *at,
            Item::Takeoff { .. }
            | Item::Delay(_)
            | Item::Return
            | Item::Speed(_)
            | Item::Servo { .. }
            | Item::Yaw(_)
            | Item::Jump { .. } => None,
        }
    }

    /// Returns whether it takes its time (a NAV item, or a condition); the others are done at once.
    pub fn takes_time(&self) -> bool {
        match self {
            Item::Waypoint { .. }
            | Item::Takeoff { .. }
            | Item::Loiter { .. }
            | Item::Delay(_)
            | Item::Land { .. }
            | Item::Return
            | Item::Yaw(_) => true,
            Item::Speed(_) | Item::Servo { .. } | Item::Jump { .. } | Item::Other { .. } => false,
        }
    }

    /// `items` is how many there are.
    fn check(&self, item: usize, items: usize, kind: VehicleKind) -> Result<(), ItemError> {
        match self {
            Item::Waypoint { at, altitude_m, .. } | Item::Loiter { at, altitude_m, .. } => {
                check_place(item, *at)?;
                check_number(item, ALTITUDE_M.contains(altitude_m))
            }
            Item::Takeoff { .. } | Item::Land { .. } if kind == VehicleKind::Rover => {
                Err(ItemError::Unsupported { item })
            }
            Item::Takeoff { altitude_m } => {
                check_number(item, *altitude_m > 0.0 && ALTITUDE_M.contains(altitude_m))
            }
            Item::Land { at } => at.map_or(Ok(()), |at| check_place(item, at)),
            Item::Speed(speed_mps) => check_number(item, is_speed(*speed_mps)),
            Item::Servo { channel, pulse_us } => check_number(item, is_output(*channel, *pulse_us)),
            Item::Yaw(heading) => check_number(item, heading.radians().is_finite()),
            Item::Delay(_) | Item::Return => Ok(()),
            Item::Jump { to, .. } => check_number(item, (1..items).contains(to)),
            Item::Other { .. } => Err(ItemError::Unsupported { item }),
        }
    }
}

/// Returns whether a mission can be stored; item 0 is home and a waypoint.
///
/// # Errors
/// [`ItemError`], of the first item that is not taken.
pub fn check_items(items: &[Item], kind: VehicleKind) -> Result<(), ItemError> {
    if items.len() > ITEMS_MAX {
        return Err(ItemError::TooMany { count: items.len() });
    }
    if !matches!(items.first(), None | Some(Item::Waypoint { .. })) {
        return Err(ItemError::Parameter { item: 0 });
    }
    let mut numbered = items.iter().enumerate();
    numbered.try_for_each(|(index, item)| item.check(index, items.len(), kind))
}

/// Returns whether a speed can be travelled at.
pub fn is_speed(speed_mps: f64) -> bool {
    (0.001..=100.0).contains(&speed_mps)
}

/// Returns whether there is such a servo output.
pub fn is_output(channel: u8, pulse_us: u16) -> bool {
    (1..=16).contains(&channel) && (500..=2500).contains(&pulse_us)
}

/// Returns whether a place can be gone to.
pub fn is_place(at: Point) -> bool {
    check_place(0, at).is_ok()
}

/// Returns whether an altitude can be gone to.
pub fn is_altitude(altitude_m: f64) -> bool {
    ALTITUDE_M.contains(&altitude_m)
}

fn check_place(item: usize, at: Point) -> Result<(), ItemError> {
    let is_near = |coordinate_m: f64| coordinate_m.abs() < PLACE_MAX_M;
    if !is_near(at.x_m) {
        return Err(ItemError::X { item });
    }
    if is_near(at.y_m) {
        Ok(())
    } else {
        Err(ItemError::Y { item })
    }
}

fn check_number(item: usize, is_sound: bool) -> Result<(), ItemError> {
    if is_sound {
        Ok(())
    } else {
        Err(ItemError::Parameter { item })
    }
}
