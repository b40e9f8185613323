//! A mission file as an autopilot is to store it: places in the venue's frame, heights above home.

use tomoswarm_proto::{Heading, Parameter, Position, STORED_ITEMS_MAX, StoredItem};

use super::item::numbers;
use super::{Above, MissionItem, SpeedOf, Spot, Target, TurnDirection, WaypointFile};
use crate::config::problem::{Problem, Problems};
use crate::config::venue::Venue;
use crate::geom::{Bearing, Geodetic, TangentPlane};

impl WaypointFile {
    /// Returns its items as they travel, in the frame of a venue.
    ///
    /// # Errors
    ///
    /// More items than an autopilot stores, a height that cannot be told from home, by file and line.
    pub fn stored_items(
        &self,
        file_name: &str,
        venue: &Venue,
    ) -> Result<Vec<StoredItem>, Problems> {
        let place = Places {
            file: self,
            frame: &venue.plane(),
            x_axis: venue.x_axis_bearing(),
        };
        let items = self.items.iter().enumerate();
        let (mut stored, mut problems): (Vec<StoredItem>, Vec<Problem>) = Default::default();
        for (index, item) in items {
            match place.stored(item) {
                Ok(item) => stored.push(item),
                Err(wrong) => {
                    let allowed = "heights above home (frame 3), or above the sea (0) in a file with a home, are allowed";
                    problems.push(self.problem(file_name, index, wrong, allowed));
                }
            }
        }
        if self.items.len() > STORED_ITEMS_MAX {
            let allowed = format!("an autopilot stores at most {STORED_ITEMS_MAX} items");
            problems.push(self.problem(file_name, STORED_ITEMS_MAX, "is one too many", &allowed));
        }
        match problems.is_empty() {
            true => Ok(stored),
            false => Err(Problems::new(file_name, problems)),
        }
    }
}

/// Where the places of a file are.
struct Places<'a> {
    file: &'a WaypointFile,
    frame: &'a TangentPlane,
    x_axis: Bearing,
}

impl Places<'_> {
    fn stored(&self, item: &MissionItem) -> Result<StoredItem, &'static str> {
        Ok(match *item {
            MissionItem::Waypoint { to, hold_s, .. } => match self.position(&to)? {
                Some(at) => StoredItem::Waypoint {
                    at,
                    stay_ms: thousandths(hold_s),
                },
                None => return Err("has no place"),
            },
            MissionItem::LoiterTime { at, time_s } => match self.position(&at)? {
                Some(at) => StoredItem::Loiter {
                    at,
                    time_ms: thousandths(time_s),
                },
                None => StoredItem::Delay(thousandths(time_s)),
            },
            MissionItem::ReturnToLaunch => StoredItem::Return,
            MissionItem::Land { at } => StoredItem::Land(self.position(&at)?),
            MissionItem::Takeoff { to } => StoredItem::Takeoff {
                height_mm: Position::from_metres(0.0, 0.0, self.height_m(&to)?).z_mm,
            },
            MissionItem::Delay { time_s } => StoredItem::Delay(thousandths(time_s)),
            MissionItem::Yaw {
                angle_deg,
                rate_dps: 0.0,
                turning: TurnDirection::Shortest,
                is_relative: false,
            } => StoredItem::Yaw(Heading::from_radians(
                self.x_axis.radians() - angle_deg.to_radians(),
            )),
            MissionItem::ChangeSpeed {
                of: SpeedOf::Ground,
                speed_mps,
            } => StoredItem::Speed(thousandths(speed_mps)),
            MissionItem::SetServo { channel, pulse_us } => StoredItem::Servo {
                channel,
                pulse_us: pulse_us.round() as u16,
            },
            MissionItem::Jump { to, times } => StoredItem::Jump {
                to: u16::try_from(to).unwrap_or(u16::MAX),
                times,
            },
            MissionItem::Other {
                command,
                at,
                parameters,
            } => StoredItem::Other {
                command,
                at: match at {
                    Some(at) => self.position(&at)?,
                    None => None,
                },
                // What is not given is the autopilot's own to choose.
                parameters: parameters
                    .map(|number| Parameter::from(number.map_or(f32::NAN, |number| number as f32))),
            },
            MissionItem::Loiter { at } => self.other(item, self.position(&at)?),
            MissionItem::Yaw { .. } | MissionItem::ChangeSpeed { .. } => self.other(item, None),
        })
    }

    /// An item by its numbers.
    fn other(&self, item: &MissionItem, at: Option<Position>) -> StoredItem {
        let (_, command, [first, second, third, fourth, ..]) = numbers(item);
        StoredItem::Other {
            command: u16::try_from(command).unwrap_or(u16::MAX),
            at,
            parameters: [first, second, third, fourth].map(|number| Parameter::from(number as f32)),
        }
    }

    /// Returns where it is to be done; z is the height above home.
    fn position(&self, target: &Target) -> Result<Option<Position>, &'static str> {
        let Some(Spot {
            latitude_deg,
            longitude_deg,
        }) = target.spot
        else {
            return Ok(None);
        };
        let height_m = self.height_m(target)?;
        let altitude_m = self.file.home.map_or(0.0, |home| home.altitude_m);
        let [x_m, y_m, _] = self.frame.to_local_m(Geodetic {
            latitude_deg,
            longitude_deg,
            altitude_m,
        });
        Ok(Some(Position::from_metres(x_m, y_m, height_m)))
    }

    fn height_m(&self, target: &Target) -> Result<f64, &'static str> {
        match (target.above, self.file.home) {
            (Above::Home, _) => Ok(target.altitude_m),
            (Above::Sea, Some(home)) => Ok(target.altitude_m - home.altitude_m),
            (Above::Sea, None) => Err("has a height above the sea, and the file has no home"),
            (Above::Ground, _) => Err("has a height above the ground, which is not known here"),
        }
    }
}

fn thousandths(number: f64) -> u32 {
    (number * 1000.0).round() as u32
}
