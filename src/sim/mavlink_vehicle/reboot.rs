//! Starting anew (MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN): it brakes, is disarmed, says and hears nothing for a while, and has
//! forgotten then what was asked of it; parameters and mission are stored. Its estimator starts up at once, unlike a real
//! one's.

use std::time::Duration;

use super::{FlownVehicle, MavlinkVehicle};
use crate::autopilot::{Command, CommandAck, FlightMode, VehicleKind};
use crate::mavlink::asked_command::AskedCommand;
use crate::time::Time;

/// The magic number of whoever insists on it.
const FORCE: f32 = 20_190_226.0;
/// A start takes this long.
const TAKES: Duration = Duration::from_secs(1);

impl MavlinkVehicle {
    /// Starts anew, unless it is armed and not forced to, or may be in the air.
    pub(super) fn reboot(
        &mut self,
        now: Time,
        asked: &AskedCommand,
        vehicle: &mut FlownVehicle<'_>,
    ) -> CommandAck {
        if asked.whole(1) != Some(1) {
            return CommandAck::Unsupported;
        }
        let is_armed = vehicle.readout(now).is_armed;
        let is_forced = self.kind == VehicleKind::Rover && asked.parameters[5] == FORCE;
        if is_armed && !is_forced {
            return CommandAck::Failed;
        }
        let grounded = Command::Mode(match self.kind {
            VehicleKind::Rover => FlightMode::Manual,
            VehicleKind::Copter => FlightMode::Land,
        });
        for command in [grounded, Command::Disarm { force: true }] {
            vehicle.command(now, &command);
        }
        self.booted = now + TAKES;
        self.heartbeat_due = self.booted;
        self.target = None;
        self.streams = Default::default();
        self.ground_station = Default::default();
        self.remote_control = Default::default();
        CommandAck::Accepted
    }

    /// Returns whether it is starting, and neither hears nor says anything.
    pub(super) fn is_starting(&self, now: Time) -> bool {
        now < self.booted
    }
}
