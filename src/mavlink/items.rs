//! The items of a stored mission on the wire: MISSION_ITEM_INT, with places on the earth, and our own items, with places in
//! the local frame. Commands are those of the dialect; which of them an autopilot carries out is said here once.

#![allow(
    deprecated,
    reason = "ground stations still write frames that the dialect has superseded"
)]

use std::time::Duration;

use num_traits::FromPrimitive;

use super::dialect::{MISSION_ITEM_INT_DATA, MavCmd, MavFrame, MavMissionResult};
use super::earth_frame::EarthFrame;
use crate::autopilot::Item;
use crate::geom::{Bearing, Point};

/// Degrees on the wire are whole numbers of this many.
const PER_DEGREE: f64 = 1e7;
/// The longest stay, seconds.
const STAY_MAX_S: f64 = 86_400.0;

/// So much of a degree is a few centimetres, 1e-7 degrees.
const PLACE_KEPT: u32 = 5;
/// Autopilots keep places in 1e-7 degrees, heights in centimetres, times in whole seconds and headings in whole degrees.
const PLACE_KEPT_M: f64 = 0.05;
const HEIGHT_KEPT_M: f64 = 0.02;
const TIME_KEPT: Duration = Duration::from_secs(1);
const SPEED_KEPT_MPS: f64 = 0.01;
const HEADING_KEPT_RAD: f64 = 0.02;

/// Returns an item as it stands on the wire; its number and whom it is for are not set. `None` = the dialect has no such
/// command.
pub fn to_wire(item: &Item, frame: &EarthFrame) -> Option<MISSION_ITEM_INT_DATA> {
    let base = |command| MISSION_ITEM_INT_DATA {
        command,
        frame: MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT,
        autocontinue: 1,
        ..MISSION_ITEM_INT_DATA::default()
    };
    let at = |command, at: Point, altitude_m: f64| {
        let (x, y) = frame.wire_place(at);
        MISSION_ITEM_INT_DATA {
            x,
            y,
            z: altitude_m as f32,
            ..base(command)
        }
    };
    let seconds = |time: Duration| time.as_secs_f64() as f32;
    Some(match *item {
        Item::Waypoint {
            at: place,
            altitude_m,
            delay,
        } => MISSION_ITEM_INT_DATA {
            param1: seconds(delay),
            ..at(MavCmd::MAV_CMD_NAV_WAYPOINT, place, altitude_m)
        },
        Item::Takeoff { altitude_m } => MISSION_ITEM_INT_DATA {
            z: altitude_m as f32,
            ..base(MavCmd::MAV_CMD_NAV_TAKEOFF)
        },
        Item::Loiter {
            at: place,
            altitude_m,
            time,
        } => MISSION_ITEM_INT_DATA {
            param1: seconds(time),
            ..at(MavCmd::MAV_CMD_NAV_LOITER_TIME, place, altitude_m)
        },
        Item::Delay(time) => MISSION_ITEM_INT_DATA {
            param1: seconds(time),
            ..base(MavCmd::MAV_CMD_NAV_DELAY)
        },
        Item::Land { at: Some(place) } => at(MavCmd::MAV_CMD_NAV_LAND, place, 0.0),
        Item::Land { at: None } => base(MavCmd::MAV_CMD_NAV_LAND),
        Item::Return => base(MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH),
        Item::Speed(speed_mps) => MISSION_ITEM_INT_DATA {
            param1: 1.0,
            param2: speed_mps as f32,
            param3: -1.0,
            ..base(MavCmd::MAV_CMD_DO_CHANGE_SPEED)
        },
        Item::Servo { channel, pulse_us } => MISSION_ITEM_INT_DATA {
            param1: f32::from(channel),
            param2: f32::from(pulse_us),
            ..base(MavCmd::MAV_CMD_DO_SET_SERVO)
        },
        Item::Jump { to, times } => MISSION_ITEM_INT_DATA {
            param1: to as f32,
            param2: times.map_or(-1.0, f32::from),
            ..base(MavCmd::MAV_CMD_DO_JUMP)
        },
        Item::Yaw(heading) => MISSION_ITEM_INT_DATA {
            param1: frame.bearing_of(heading).degrees() as f32,
            ..base(MavCmd::MAV_CMD_CONDITION_YAW)
        },
        Item::Other {
            command,
            at: place,
            altitude_m,
            parameters: [param1, param2, param3, param4],
        } => {
            let command = MavCmd::from_u16(command)?;
            MISSION_ITEM_INT_DATA {
                param1,
                param2,
                param3,
                param4,
                ..place.map_or(base(command), |place| at(command, place, altitude_m))
            }
        }
    })
}

/// Returns whether what is stored is the command that was sent, there: its parameters an autopilot keeps as it likes.
pub fn is_same_command(sent: &MISSION_ITEM_INT_DATA, stored: &MISSION_ITEM_INT_DATA) -> bool {
    let is_near = |sent: i32, stored: i32| sent.abs_diff(stored) <= PLACE_KEPT;
    let has_height = (sent.z - stored.z).abs() < HEIGHT_KEPT_M as f32;
    sent.command == stored.command
        && is_near(sent.x, stored.x)
        && is_near(sent.y, stored.y)
        && has_height
}

/// Returns the item that stands on the wire.
///
/// # Errors
/// What an autopilot answers: which part of it makes no sense, or that it does not know the command or the frame.
pub fn from_wire(
    wire: &MISSION_ITEM_INT_DATA,
    frame: &EarthFrame,
) -> Result<Item, MavMissionResult> {
    let number = |value: f32, refusal| match value.is_finite() {
        true => Ok(f64::from(value)),
        false => Err(refusal),
    };
    let time = || {
        let time_s = number(wire.param1, MavMissionResult::MAV_MISSION_INVALID_PARAM1)?;
        match (0.0..=STAY_MAX_S).contains(&time_s) {
            true => Ok(Duration::from_secs_f64(time_s)),
            false => Err(MavMissionResult::MAV_MISSION_INVALID_PARAM1),
        }
    };
    let has_place = wire.x != 0 || wire.y != 0;
    let altitude = || {
        let above_m = match wire.frame {
            MavFrame::MAV_FRAME_GLOBAL | MavFrame::MAV_FRAME_GLOBAL_INT => frame.datum.altitude_m,
            _ => 0.0,
        };
        Ok(number(wire.z, MavMissionResult::MAV_MISSION_INVALID_PARAM7)? - above_m)
    };
    let place = || {
        check_frame(wire.frame)?;
        let is_within = |value: i32, degrees: f64| f64::from(value).abs() <= degrees * PER_DEGREE;
        if !is_within(wire.x, 90.0) {
            return Err(MavMissionResult::MAV_MISSION_INVALID_PARAM5_X);
        }
        if !is_within(wire.y, 180.0) {
            return Err(MavMissionResult::MAV_MISSION_INVALID_PARAM6_Y);
        }
        Ok(frame.local_place((wire.x, wire.y)))
    };
    Ok(match wire.command {
        MavCmd::MAV_CMD_NAV_WAYPOINT => Item::Waypoint {
            at: place()?,
            altitude_m: altitude()?,
            delay: time()?,
        },
        MavCmd::MAV_CMD_NAV_LOITER_TIME => Item::Loiter {
            at: place()?,
            altitude_m: altitude()?,
            time: time()?,
        },
        MavCmd::MAV_CMD_NAV_TAKEOFF => Item::Takeoff {
            altitude_m: altitude()?,
        },
        MavCmd::MAV_CMD_NAV_DELAY => Item::Delay(time()?),
        MavCmd::MAV_CMD_NAV_LAND => Item::Land {
            at: has_place.then(place).transpose()?,
        },
        MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH => Item::Return,
        MavCmd::MAV_CMD_DO_CHANGE_SPEED => Item::Speed(number(
            wire.param2,
            MavMissionResult::MAV_MISSION_INVALID_PARAM2,
        )?),
        MavCmd::MAV_CMD_DO_SET_SERVO => Item::Servo {
            channel: whole(wire.param1).ok_or(MavMissionResult::MAV_MISSION_INVALID_PARAM1)? as u8,
            pulse_us: whole(wire.param2).ok_or(MavMissionResult::MAV_MISSION_INVALID_PARAM2)?,
        },
        MavCmd::MAV_CMD_DO_JUMP => Item::Jump {
            to: usize::from(
                whole(wire.param1).ok_or(MavMissionResult::MAV_MISSION_INVALID_PARAM1)?,
            ),
            times: match wire.param2 {
                -1.0 => None,
                times => Some(whole(times).ok_or(MavMissionResult::MAV_MISSION_INVALID_PARAM2)?),
            },
        },
        MavCmd::MAV_CMD_CONDITION_YAW => {
            let bearing_deg = number(wire.param1, MavMissionResult::MAV_MISSION_INVALID_PARAM1)?;
            Item::Yaw(frame.heading_of(Bearing::from_degrees(bearing_deg)))
        }
        _ => return Err(MavMissionResult::MAV_MISSION_UNSUPPORTED),
    })
}

/// Returns whether an item is stored as it was sent, as far as autopilots keep it: places by a few centimetres, whole seconds.
pub fn is_stored_as(sent: &Item, stored: &Item) -> bool {
    let is_place = |sent: Point, stored: Point| sent.distance_to(stored) < PLACE_KEPT_M;
    let is_height = |sent_m: f64, stored_m: f64| (sent_m - stored_m).abs() < HEIGHT_KEPT_M;
    let is_time = |sent: Duration, stored: Duration| sent.abs_diff(stored) < TIME_KEPT;
    match (*sent, *stored) {
        (
            Item::Waypoint {
                at,
                altitude_m,
                delay: time,
            },
            Item::Waypoint {
                at: stored_at,
                altitude_m: stored_m,
                delay: stored_time,
            },
        )
        | (
            Item::Loiter {
                at,
                altitude_m,
                time,
            },
            Item::Loiter {
                at: stored_at,
                altitude_m: stored_m,
                time: stored_time,
            },
        ) => {
            is_place(at, stored_at) && is_height(altitude_m, stored_m) && is_time(time, stored_time)
        }
        (
            Item::Takeoff { altitude_m },
            Item::Takeoff {
                altitude_m: stored_m,
            },
        ) => is_height(altitude_m, stored_m),
        (Item::Delay(time), Item::Delay(stored)) => is_time(time, stored),
        (Item::Land { at: Some(at) }, Item::Land { at: Some(stored) }) => is_place(at, stored),
        (Item::Speed(speed_mps), Item::Speed(stored_mps)) => {
            (speed_mps - stored_mps).abs() < SPEED_KEPT_MPS
        }
        (Item::Yaw(heading), Item::Yaw(stored)) => heading.is_near(stored, HEADING_KEPT_RAD),
        (sent, stored) => sent == stored,
    }
}

fn check_frame(frame: MavFrame) -> Result<(), MavMissionResult> {
    match frame {
        MavFrame::MAV_FRAME_GLOBAL
        | MavFrame::MAV_FRAME_GLOBAL_INT
        | MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT
        | MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT => Ok(()),
        _ => Err(MavMissionResult::MAV_MISSION_UNSUPPORTED_FRAME),
    }
}

/// Returns the whole number that a parameter stands for; `None` when it is none that an output or a pulse can have.
fn whole(parameter: f32) -> Option<u16> {
    ((0.0..=65_535.0).contains(&parameter) && parameter.fract() == 0.0).then_some(parameter as u16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Angle, Geodetic};

    fn frame() -> EarthFrame {
        let datum = Geodetic {
            latitude_deg: 52.0,
            longitude_deg: 4.0,
            altitude_m: 10.0,
        };
        EarthFrame::new(datum, Bearing::from_degrees(75.0))
    }

    #[test]
    fn every_item_comes_back_as_it_went() {
        let (at, altitude_m) = (Point::new(12.0, -7.5), 4.0);
        let time = Duration::from_millis(1500);
        let items = [
            Item::Waypoint {
                at,
                altitude_m,
                delay: time,
            },
            Item::Takeoff { altitude_m },
            Item::Loiter {
                at,
                altitude_m,
                time,
            },
            Item::Delay(time),
            Item::Land { at: None },
            Item::Return,
            Item::Speed(0.5),
            Item::Servo {
                channel: 9,
                pulse_us: 1700,
            },
            Item::Jump {
                to: 3,
                times: Some(2),
            },
            Item::Jump { to: 1, times: None },
        ];
        for item in items {
            let back = from_wire(&to_wire(&item, &frame()).unwrap(), &frame());
            match (item, back) {
                (Item::Waypoint { .. } | Item::Loiter { .. }, Ok(back)) => {
                    let (Item::Waypoint { at: there, .. } | Item::Loiter { at: there, .. }) = back
                    else {
                        panic!("{back:?}")
                    };
                    assert!(there.distance_to(at) < 0.012, "{there:?}");
                }
                (item, back) => assert_eq!(back, Ok(item)),
            }
        }
        let yaw = Item::Yaw(Angle::from_degrees(30.0));
        let Ok(Item::Yaw(back)) = from_wire(&to_wire(&yaw, &frame()).unwrap(), &frame()) else {
            panic!("a yaw")
        };
        assert!(back.is_near(Angle::from_degrees(30.0), 1e-6));
    }

    #[test]
    fn a_command_that_is_none_of_ours_goes_as_it_is() {
        let other = |command, at| Item::Other {
            command,
            at,
            altitude_m: 4.0,
            parameters: [1.0, f32::NAN, 3.0, -1.0],
        };
        let wire = to_wire(&other(82, Some(Point::new(12.0, -7.5))), &frame()).unwrap();
        assert_eq!(wire.command, MavCmd::MAV_CMD_NAV_SPLINE_WAYPOINT);
        assert!(wire.param2.is_nan() && (wire.param4, wire.z) == (-1.0, 4.0));
        assert!(
            frame()
                .local_place((wire.x, wire.y))
                .distance_to(Point::new(12.0, -7.5))
                < 0.012
        );
        let without = to_wire(&other(82, None), &frame()).unwrap();
        assert_eq!((without.x, without.y), (0, 0));
        assert!(is_same_command(&wire, &wire) && !is_same_command(&wire, &without));
        assert_eq!(to_wire(&other(60_000, None), &frame()), None);
    }

    #[test]
    fn what_makes_no_sense_is_refused_as_an_autopilot_does() {
        let wire = to_wire(
            &Item::Waypoint {
                at: Point::new(1.0, 1.0),
                altitude_m: 0.0,
                delay: Duration::ZERO,
            },
            &frame(),
        )
        .unwrap();
        let refused = |change: fn(&mut MISSION_ITEM_INT_DATA)| {
            let mut wire = wire.clone();
            change(&mut wire);
            from_wire(&wire, &frame()).unwrap_err() as u8
        };
        assert_eq!(refused(|wire| wire.x = 900_000_001), 10);
        assert_eq!(refused(|wire| wire.y = -1_800_000_001), 11);
        assert_eq!(refused(|wire| wire.z = f32::NAN), 12);
        assert_eq!(refused(|wire| wire.param1 = -1.0), 6);
        assert_eq!(refused(|wire| wire.frame = MavFrame::MAV_FRAME_BODY_NED), 2);
        assert_eq!(refused(|wire| wire.command = MavCmd::MAV_CMD_NAV_FOLLOW), 3);
    }
}
