//! One mission item: numbers as they stand in a file, checked and given their meaning; and back.
//!
//! Parameters of a command that mean nothing to us (pass radius, yaw at a waypoint, throttle "no change") are not kept.

use std::ops::RangeInclusive;

use super::{Above, MissionItem, Notes, Origin, SpeedOf, Spot, Target, TurnDirection};
use crate::geom::Geodetic;

const LATITUDE_DEG: RangeInclusive<f64> = -90.0..=90.0;
const LONGITUDE_DEG: RangeInclusive<f64> = -180.0..=180.0;
const ALTITUDE_M: RangeInclusive<f64> = -10_000.0..=10_000.0;
const TIME_S: RangeInclusive<f64> = 0.0..=86_400.0;
const RADIUS_M: RangeInclusive<f64> = 0.0..=10_000.0;
const SPEED_MPS: RangeInclusive<f64> = 0.001..=100.0;
const PULSE_US: RangeInclusive<f64> = 500.0..=2500.0;

const COMMANDS: &str = "16 (waypoint), 17 (loiter), 19 (loiter for a time), 20 (return to launch), 21 (land), \
                        22 (take off), 93 (delay), 115 (yaw), 178 (change speed) and 183 (set servo) are known";
const FRAMES: &str = "0 (above the sea), 3 (above home) and 10 (above the ground) are known";
/// Frame of commands that have no place.
const MISSION_FRAME: u32 = 2;

/// The columns of a place, and their names.
const LATITUDE: usize = 4;
const LONGITUDE: usize = 5;
const ALTITUDE: usize = 6;
/// Names of the seven parameters of a line.
pub(super) const COLUMNS: [&str; 7] = [
    "param1",
    "param2",
    "param3",
    "param4",
    "latitude",
    "longitude",
    "altitude",
];

/// An item before its numbers have a meaning.
pub(super) struct RawItem {
    pub(super) origin: Origin,
    pub(super) frame: u32,
    pub(super) command: u32,
    /// `None` = not given (null in JSON); a number is finite.
    pub(super) params: [Option<f64>; 7],
}

/// Returns the name of a field of an item, as it stands in messages.
pub(super) fn key_of(origin: &Origin, field: &str) -> String {
    if origin.path.is_empty() {
        field.to_owned()
    } else {
        format!("{}.{field}", origin.path)
    }
}

/// Returns the name of a parameter of an item.
pub(super) fn param_key(origin: &Origin, index: usize) -> String {
    if origin.path.is_empty() {
        COLUMNS[index].to_owned()
    } else {
        format!("{}.params[{index}]", origin.path)
    }
}

/// Returns whether a place can be one of a mission.
pub(super) fn is_on_the_planet(place: Geodetic) -> bool {
    LATITUDE_DEG.contains(&place.latitude_deg)
        && LONGITUDE_DEG.contains(&place.longitude_deg)
        && ALTITUDE_M.contains(&place.altitude_m)
}

impl RawItem {
    /// Returns the item its meaning; notes all that is wrong.
    pub(super) fn typed(&self, notes: &mut Notes) -> Option<MissionItem> {
        match self.command {
            16 => self.waypoint(notes),
            17 => self.target(notes).map(|at| MissionItem::Loiter { at }),
            19 => {
                let (at, time_s) = (self.target(notes), self.number(0, TIME_S, "s", notes));
                Some(MissionItem::LoiterTime {
                    at: at?,
                    time_s: time_s?,
                })
            }
            20 => self
                .needs_no_place(notes)
                .then_some(MissionItem::ReturnToLaunch),
            21 => self.target(notes).map(|at| MissionItem::Land { at }),
            22 => self.target(notes).map(|to| MissionItem::Takeoff { to }),
            93 => {
                let (fits, time_s) = (
                    self.needs_no_place(notes),
                    self.number(0, TIME_S, "s", notes),
                );
                fits.then_some(MissionItem::Delay { time_s: time_s? })
            }
            115 => self.yaw(notes),
            178 => self.change_speed(notes),
            183 => self.set_servo(notes),
            177 if notes.takes_all => self.jump(notes),
            _ if notes.takes_all => self.other(notes),
            other => {
                notes.add(
                    self.origin.line,
                    &key_of(&self.origin, "command"),
                    &other.to_string(),
                    "is not known",
                    COMMANDS,
                );
                None
            }
        }
    }

    /// Reads item 0 of a text file.
    pub(super) fn home(&self, notes: &mut Notes) -> Option<Geodetic> {
        if self.command != 16 {
            let value = self.command.to_string();
            notes.add(
                self.origin.line,
                "command",
                &value,
                "is no home",
                "item 0 is home, a waypoint (16)",
            );
            return None;
        }
        let degrees = self.degrees(notes);
        let altitude_m = self.number(ALTITUDE, ALTITUDE_M, "m", notes);
        let (latitude_deg, longitude_deg) = degrees?;
        Some(Geodetic {
            latitude_deg,
            longitude_deg,
            altitude_m: altitude_m?,
        })
    }

    fn waypoint(&self, notes: &mut Notes) -> Option<MissionItem> {
        let (above, degrees) = (self.above(notes), self.degrees(notes));
        let altitude_m = self.number(ALTITUDE, ALTITUDE_M, "m", notes);
        let (hold_s, radius_m) = (
            self.number(0, TIME_S, "s", notes),
            self.number(1, RADIUS_M, "m", notes),
        );
        let (latitude_deg, longitude_deg) = degrees?;
        let spot = Some(Spot {
            latitude_deg,
            longitude_deg,
        });
        let to = Target {
            spot,
            altitude_m: altitude_m?,
            above: above?,
        };
        Some(MissionItem::Waypoint {
            to,
            hold_s: hold_s?,
            radius_m: radius_m?,
        })
    }

    /// A place where 0, 0, or none at all, means that of the vehicle.
    fn target(&self, notes: &mut Notes) -> Option<Target> {
        let above = self.above(notes);
        let is_left_out = self.params[LATITUDE].is_none() && self.params[LONGITUDE].is_none();
        let degrees = if is_left_out {
            Some((0.0, 0.0))
        } else {
            self.degrees(notes)
        };
        let altitude_m = self.number(ALTITUDE, ALTITUDE_M, "m", notes);
        let (latitude_deg, longitude_deg) = degrees?;
        let is_here = latitude_deg == 0.0 && longitude_deg == 0.0;
        let spot = (!is_here).then_some(Spot {
            latitude_deg,
            longitude_deg,
        });
        Some(Target {
            spot,
            altitude_m: altitude_m?,
            above: above?,
        })
    }

    fn yaw(&self, notes: &mut Notes) -> Option<MissionItem> {
        let fits = self.needs_no_place(notes);
        let angle_deg = self.number(0, 0.0..=360.0, "degrees", notes);
        let rate_dps = self.number(1, 0.0..=360.0, "degrees/s", notes);
        let turning = match self.whole(2, -1.0..=1.0, notes) {
            Some(-1) => Some(TurnDirection::CounterClockwise),
            Some(0) => Some(TurnDirection::Shortest),
            Some(_) => Some(TurnDirection::Clockwise),
            None => None,
        };
        let is_relative = self
            .whole(3, 0.0..=1.0, notes)
            .map(|relative| relative == 1);
        let yaw = MissionItem::Yaw {
            angle_deg: angle_deg?,
            rate_dps: rate_dps?,
            turning: turning?,
            is_relative: is_relative?,
        };
        fits.then_some(yaw)
    }

    fn change_speed(&self, notes: &mut Notes) -> Option<MissionItem> {
        let fits = self.needs_no_place(notes);
        let of = match self.whole(0, 0.0..=3.0, notes) {
            Some(0) => Some(SpeedOf::Air),
            Some(1) => Some(SpeedOf::Ground),
            Some(2) => Some(SpeedOf::Climb),
            Some(_) => Some(SpeedOf::Descent),
            None => None,
        };
        let speed_mps = self.number(1, SPEED_MPS, "m/s", notes);
        let change = MissionItem::ChangeSpeed {
            of: of?,
            speed_mps: speed_mps?,
        };
        fits.then_some(change)
    }

    fn set_servo(&self, notes: &mut Notes) -> Option<MissionItem> {
        let fits = self.needs_no_place(notes);
        let (channel, pulse_us) = (
            self.whole(0, 1.0..=32.0, notes),
            self.number(1, PULSE_US, "us", notes),
        );
        let servo = MissionItem::SetServo {
            channel: u8::try_from(channel?).ok()?,
            pulse_us: pulse_us?,
        };
        fits.then_some(servo)
    }

    fn jump(&self, notes: &mut Notes) -> Option<MissionItem> {
        let fits = self.needs_no_place(notes);
        let to = self.whole(0, 1.0..=10_000.0, notes);
        let times = self.whole(1, -1.0..=32_767.0, notes);
        let jump = MissionItem::Jump {
            to: usize::try_from(to?).ok()?,
            times: u16::try_from(times?).ok(),
        };
        fits.then_some(jump)
    }

    /// A command whose meaning is not known here. Without a place its last three parameters cannot be carried.
    fn other(&self, notes: &mut Notes) -> Option<MissionItem> {
        let Ok(command) = u16::try_from(self.command) else {
            let (key, value) = (key_of(&self.origin, "command"), self.command.to_string());
            let allowed = "a number of MAV_CMD, at most 65535, is allowed";
            notes.add(self.origin.line, &key, &value, "is none", allowed);
            return None;
        };
        let at = if self.frame == MISSION_FRAME {
            let given =
                (LATITUDE..=ALTITUDE).find(|index| self.params[*index].unwrap_or(0.0) != 0.0);
            if let Some(index) = given {
                self.refuse(
                    index,
                    &self.params[index].unwrap_or(0.0).to_string(),
                    "is given without a place",
                    &(0.0..=0.0),
                    "frame 2 has no place",
                    notes,
                );
                return None;
            }
            None
        } else {
            Some(self.target(notes)?)
        };
        let [first, second, third, fourth, ..] = self.params;
        Some(MissionItem::Other {
            command,
            at,
            parameters: [first, second, third, fourth],
        })
    }

    fn above(&self, notes: &mut Notes) -> Option<Above> {
        match self.frame {
            0 => Some(Above::Sea),
            3 => Some(Above::Home),
            10 => Some(Above::Ground),
            other => self.refuse_frame(other, FRAMES, notes),
        }
    }

    /// Checks the frame of a command without a place.
    fn needs_no_place(&self, notes: &mut Notes) -> bool {
        let is_known = matches!(self.frame, 0 | 3 | 10 | MISSION_FRAME);
        if !is_known {
            let _: Option<()> = self.refuse_frame(self.frame, "0, 2, 3 and 10 are known", notes);
        }
        is_known
    }

    fn refuse_frame<T>(&self, frame: u32, allowed: &str, notes: &mut Notes) -> Option<T> {
        let key = key_of(&self.origin, "frame");
        notes.add(
            self.origin.line,
            &key,
            &frame.to_string(),
            "is not known",
            allowed,
        );
        None
    }

    fn degrees(&self, notes: &mut Notes) -> Option<(f64, f64)> {
        let latitude = self.placed(LATITUDE, LATITUDE_DEG, notes);
        let longitude = self.placed(LONGITUDE, LONGITUDE_DEG, notes);
        Some((latitude?, longitude?))
    }

    /// A coordinate, which must be given.
    fn placed(&self, index: usize, range: RangeInclusive<f64>, notes: &mut Notes) -> Option<f64> {
        if self.params[index].is_none() {
            self.refuse(index, "null", "is needed", &range, "degrees", notes);
            return None;
        }
        self.number(index, range, "degrees", notes)
    }

    /// A whole number; 0 when it is not given.
    fn whole(&self, index: usize, range: RangeInclusive<f64>, notes: &mut Notes) -> Option<i32> {
        let number = self.number(index, range.clone(), "a whole number", notes)?;
        if number.fract() != 0.0 {
            self.refuse(
                index,
                &number.to_string(),
                "is not whole",
                &range,
                "a whole number",
                notes,
            );
            return None;
        }
        Some(number as i32)
    }

    /// A number; 0 when it is not given.
    fn number(
        &self,
        index: usize,
        range: RangeInclusive<f64>,
        unit: &str,
        notes: &mut Notes,
    ) -> Option<f64> {
        let number = self.params[index].unwrap_or(0.0);
        if range.contains(&number) {
            // A zero without a sign.
            return Some(number + 0.0);
        }
        self.refuse(
            index,
            &number.to_string(),
            "is out of range",
            &range,
            unit,
            notes,
        );
        None
    }

    fn refuse(
        &self,
        index: usize,
        value: &str,
        wrong: &str,
        range: &RangeInclusive<f64>,
        unit: &str,
        notes: &mut Notes,
    ) {
        let allowed = format!("{} to {} is allowed ({unit})", range.start(), range.end());
        notes.add(
            self.origin.line,
            &param_key(&self.origin, index),
            value,
            wrong,
            &allowed,
        );
    }
}

/// Returns frame, command and parameters of an item, as they are written.
pub(super) fn numbers(item: &MissionItem) -> (u32, u32, [f64; 7]) {
    let placed = |command: u32, [first, second]: [f64; 2], target: &Target| {
        let spot = target.spot.unwrap_or(Spot {
            latitude_deg: 0.0,
            longitude_deg: 0.0,
        });
        let frame = match target.above {
            Above::Sea => 0,
            Above::Home => 3,
            Above::Ground => 10,
        };
        let params = [
            first,
            second,
            0.0,
            0.0,
            spot.latitude_deg,
            spot.longitude_deg,
            target.altitude_m,
        ];
        (frame, command, params)
    };
    let plain = |command: u32, [a, b, c, d]: [f64; 4]| {
        (MISSION_FRAME, command, [a, b, c, d, 0.0, 0.0, 0.0])
    };
    match item {
        MissionItem::Waypoint {
            to,
            hold_s,
            radius_m,
        } => placed(16, [*hold_s, *radius_m], to),
        MissionItem::Loiter { at } => placed(17, [0.0; 2], at),
        MissionItem::LoiterTime { at, time_s } => placed(19, [*time_s, 0.0], at),
        MissionItem::ReturnToLaunch => plain(20, [0.0; 4]),
        MissionItem::Land { at } => placed(21, [0.0; 2], at),
        MissionItem::Takeoff { to } => placed(22, [0.0; 2], to),
        // The others: hour, minute and second of a time of day, which is not meant.
        MissionItem::Delay { time_s } => plain(93, [*time_s, -1.0, -1.0, -1.0]),
        MissionItem::Yaw {
            angle_deg,
            rate_dps,
            turning,
            is_relative,
        } => {
            let turning = match turning {
                TurnDirection::CounterClockwise => -1.0,
                TurnDirection::Shortest => 0.0,
                TurnDirection::Clockwise => 1.0,
            };
            plain(
                115,
                [
                    *angle_deg,
                    *rate_dps,
                    turning,
                    f64::from(u8::from(*is_relative)),
                ],
            )
        }
        MissionItem::ChangeSpeed { of, speed_mps } => {
            let of = match of {
                SpeedOf::Air => 0.0,
                SpeedOf::Ground => 1.0,
                SpeedOf::Climb => 2.0,
                SpeedOf::Descent => 3.0,
            };
            // No change of the throttle.
            plain(178, [of, *speed_mps, -1.0, 0.0])
        }
        MissionItem::SetServo { channel, pulse_us } => {
            plain(183, [f64::from(*channel), *pulse_us, 0.0, 0.0])
        }
        MissionItem::Jump { to, times } => {
            plain(177, [*to as f64, times.map_or(-1.0, f64::from), 0.0, 0.0])
        }
        MissionItem::Other {
            command,
            at,
            parameters,
        } => {
            let [first, second, third, fourth] = parameters.map(|number| number.unwrap_or(0.0));
            let command = u32::from(*command);
            match at {
                Some(at) => {
                    let (frame, command, placed) = placed(command, [first, second], at);
                    let [_, _, _, _, x, y, z] = placed;
                    (frame, command, [first, second, third, fourth, x, y, z])
                }
                None => plain(command, [first, second, third, fourth]),
            }
        }
    }
}

/// Returns an item in a few words, for messages.
pub(super) fn shown(item: &MissionItem) -> String {
    let (_, command, _) = numbers(item);
    match item.spot() {
        Some(Spot {
            latitude_deg,
            longitude_deg,
        }) => {
            format!("command {command} at {latitude_deg}, {longitude_deg}")
        }
        None => format!("command {command}"),
    }
}
