//! A command as a client gives it, whichever message it came in.

#![allow(
    deprecated,
    reason = "clients still say what the dialect has superseded, and ArduPilot still takes it"
)]

use super::dialect::{
    COMMAND_ACK_DATA, COMMAND_INT_DATA, COMMAND_LONG_DATA, MavCmd, MavFrame, MavMessage, MavResult,
};
use super::frames::MavAddress;

/// The magic number of whoever insists on arming or disarming.
pub const FORCE: f32 = 21_196.0;
/// Degrees as they are sent.
const PER_DEGREE: f64 = 1e7;

/// A command with its parameters, whichever message it came in.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct AskedCommand {
    /// What is to be done.
    pub command: MavCmd,
    /// Parameters 1 to 7; 5 and 6 in degrees where they are a place.
    pub parameters: [f32; 7],
    /// Latitude and longitude, 1e-7 degrees, if it has a place.
    pub place: Option<(i32, i32)>,
}

impl AskedCommand {
    /// Reads a COMMAND_LONG.
    pub fn of_long(long: &COMMAND_LONG_DATA) -> AskedCommand {
        let place = [long.param5, long.param6].map(f64::from);
        let is_place = place
            .iter()
            .all(|degrees| degrees.is_finite() && degrees.abs() <= 180.0)
            && place != [0.0, 0.0];
        AskedCommand {
            command: long.command,
            parameters: [
                long.param1,
                long.param2,
                long.param3,
                long.param4,
                long.param5,
                long.param6,
                long.param7,
            ],
            place: is_place.then(|| {
                let [latitude, longitude] =
                    place.map(|degrees| (degrees * PER_DEGREE).round() as i32);
                (latitude, longitude)
            }),
        }
    }

    /// Reads a COMMAND_INT.
    pub fn of_int(int: &COMMAND_INT_DATA) -> AskedCommand {
        let is_global = matches!(
            int.frame,
            MavFrame::MAV_FRAME_GLOBAL
                | MavFrame::MAV_FRAME_GLOBAL_INT
                | MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT
                | MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
        );
        let is_within = |degrees: i32, most: f64| f64::from(degrees).abs() <= most * PER_DEGREE;
        let is_place = is_global
            && (int.x, int.y) != (0, 0)
            && is_within(int.x, 90.0)
            && is_within(int.y, 180.0);
        AskedCommand {
            command: int.command,
            parameters: [
                int.param1, int.param2, int.param3, int.param4, 0.0, 0.0, int.z,
            ],
            place: is_place.then_some((int.x, int.y)),
        }
    }

    /// Returns a parameter, counted from 1, as a whole number; `None` when it is none.
    pub fn whole(&self, number: usize) -> Option<u32> {
        let value = self.parameters[number - 1];
        ((0.0..1e6).contains(&value) && value.fract() == 0.0).then_some(value as u32)
    }

    /// Returns a parameter, counted from 1, if it is a number.
    pub fn number(&self, number: usize) -> Option<f64> {
        let value = self.parameters[number - 1];
        value.is_finite().then_some(f64::from(value))
    }
}

/// Returns what a command is answered.
pub fn command_ack(to: MavAddress, command: MavCmd, result: MavResult) -> MavMessage {
    MavMessage::COMMAND_ACK(COMMAND_ACK_DATA {
        command,
        result,
        target_system: to.system,
        target_component: to.component,
        ..COMMAND_ACK_DATA::default()
    })
}
