//! Position targets of clients: SET_POSITION_TARGET_LOCAL_NED and SET_POSITION_TARGET_GLOBAL_INT
//! (<https://ardupilot.org/dev/docs/mavlink-rover-commands.html>,
//! <https://ardupilot.org/dev/docs/copter-commands-in-guided-mode.html>). One that holds what is no number is passed over:
//! nothing is answered to targets.

use super::FlownVehicle;
use crate::autopilot::{Command, VehicleKind};
use crate::geom::{Bearing, Point, Vector};
use crate::mavlink::dialect::{
    MavFrame, PositionTargetTypemask as Ignored, SET_POSITION_TARGET_GLOBAL_INT_DATA,
    SET_POSITION_TARGET_LOCAL_NED_DATA,
};
use crate::mavlink::earth_frame::EarthFrame;
use crate::time::Time;

/// What of a target is wanted.
enum Wanted {
    Place,
    Velocity,
    Yaw,
    Nothing,
}

fn wanted(ignored: Ignored) -> Wanted {
    let place =
        Ignored::POSITION_TARGET_TYPEMASK_X_IGNORE | Ignored::POSITION_TARGET_TYPEMASK_Y_IGNORE;
    let velocity =
        Ignored::POSITION_TARGET_TYPEMASK_VX_IGNORE | Ignored::POSITION_TARGET_TYPEMASK_VY_IGNORE;
    if !ignored.intersects(place) {
        Wanted::Place
    } else if !ignored.intersects(velocity) {
        Wanted::Velocity
    } else if !ignored.contains(Ignored::POSITION_TARGET_TYPEMASK_YAW_IGNORE) {
        Wanted::Yaw
    } else {
        Wanted::Nothing
    }
}

/// Returns what a target in north, east and down wants; `None` = nothing that is known here.
pub(super) fn of_local(
    target: &SET_POSITION_TARGET_LOCAL_NED_DATA,
    kind: VehicleKind,
    frame: &EarthFrame,
    vehicle: &mut FlownVehicle<'_>,
    now: Time,
) -> Option<Command> {
    let readout = vehicle.readout(now);
    let north = Bearing::from_degrees(0.0);
    // From where places are counted, and where "north" of this frame is.
    let (origin, ahead) = match target.coordinate_frame {
        MavFrame::MAV_FRAME_LOCAL_NED => (Point::new(0.0, 0.0), north),
        MavFrame::MAV_FRAME_LOCAL_OFFSET_NED => (readout.pose.at, north),
        MavFrame::MAV_FRAME_BODY_NED
        | MavFrame::MAV_FRAME_BODY_OFFSET_NED
        | MavFrame::MAV_FRAME_BODY_FRD => (readout.pose.at, frame.bearing_of(readout.pose.heading)),
        _ => return None,
    };
    let along = |forward: f32, right: f32| {
        let ahead = frame.heading_of(ahead).radians();
        let (sin, cos) = (libm::sin(ahead), libm::cos(ahead));
        let (forward, right) = (f64::from(forward), f64::from(right));
        Vector::new(forward * cos + right * sin, forward * sin - right * cos)
    };
    let is_offset =
        origin != Point::new(0.0, 0.0) || target.coordinate_frame != MavFrame::MAV_FRAME_LOCAL_NED;
    match wanted(target.type_mask) {
        Wanted::Place => {
            let numbers = [target.x, target.y, target.z];
            let base_m = if is_offset { readout.altitude_m } else { 0.0 };
            let has_height = !target
                .type_mask
                .contains(Ignored::POSITION_TARGET_TYPEMASK_Z_IGNORE);
            are_numbers(&numbers).then(|| Command::Route {
                corners: vec![origin + along(target.x, target.y)],
                altitude_m: (kind == VehicleKind::Copter && has_height)
                    .then_some(base_m - f64::from(target.z)),
                speed_mps: None,
            })
        }
        Wanted::Velocity => are_numbers(&[target.vx, target.vy]).then(|| {
            let velocity = along(target.vx, target.vy);
            moving(velocity, kind, target.type_mask, frame)
        }),
        Wanted::Yaw => are_numbers(&[target.yaw])
            .then(|| Command::Yaw(frame.heading_of(Bearing::from_radians(f64::from(target.yaw))))),
        Wanted::Nothing => None,
    }
}

/// Returns what a target on the earth wants.
pub(super) fn of_global(
    target: &SET_POSITION_TARGET_GLOBAL_INT_DATA,
    kind: VehicleKind,
    frame: &EarthFrame,
) -> Option<Command> {
    let above_m = match target.coordinate_frame {
        MavFrame::MAV_FRAME_GLOBAL | MavFrame::MAV_FRAME_GLOBAL_INT => frame.datum.altitude_m,
        MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT | MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT => {
            0.0
        }
        _ => return None,
    };
    match wanted(target.type_mask) {
        Wanted::Place => {
            let has_height = !target
                .type_mask
                .contains(Ignored::POSITION_TARGET_TYPEMASK_Z_IGNORE);
            are_numbers(&[target.alt]).then(|| Command::Route {
                corners: vec![frame.local_place((target.lat_int, target.lon_int))],
                altitude_m: (kind == VehicleKind::Copter && has_height)
                    .then(|| f64::from(target.alt) - above_m),
                speed_mps: None,
            })
        }
        Wanted::Velocity => are_numbers(&[target.vx, target.vy]).then(|| {
            let to = frame.from_north_east(f64::from(target.vx), f64::from(target.vy));
            let velocity = to - Point::new(0.0, 0.0);
            moving(velocity, kind, target.type_mask, frame)
        }),
        Wanted::Yaw | Wanted::Nothing => None,
    }
}

/// Returns what a velocity wants. One of zero brakes; but a rover that is not told that it is not to turn turns to where a
/// velocity points, and one of zero points north.
fn moving(velocity: Vector, kind: VehicleKind, ignored: Ignored, frame: &EarthFrame) -> Command {
    let may_turn = Ignored::POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE;
    if velocity != Vector::default() {
        Command::Velocity(velocity)
    } else if kind == VehicleKind::Rover && ignored.contains(may_turn) {
        Command::Yaw(frame.heading_of(Bearing::from_degrees(0.0)))
    } else {
        Command::Stop
    }
}

fn are_numbers(values: &[f32]) -> bool {
    values.iter().all(|value| value.is_finite())
}
