//! The failsafe of a silent ground station, as `FS_GCS_ENABLE` wants it: the heartbeats of the one that `SYSID_MYGCS` names are
//! missed once they were heard.

use std::time::Duration;

use crate::autopilot::{Command, FlightMode, VehicleKind};
use crate::mavlink::dialect::{HEARTBEAT_DATA, MavType};
use crate::mavlink::frames::MavAddress;
use crate::mavlink::parameter_table::ParameterTable;
use crate::time::Time;

/// When the ground station was heard last.
#[derive(Clone, Debug, Default)]
pub(super) struct GroundStation {
    /// `None` = never, or its silence has been acted upon.
    heard: Option<Time>,
}

impl GroundStation {
    /// Hears a heartbeat.
    pub(super) fn hear(
        &mut self,
        now: Time,
        from: MavAddress,
        heartbeat: &HEARTBEAT_DATA,
        parameters: &ParameterTable,
    ) {
        let is_ours = parameters.value_of("SYSID_MYGCS") == Some(f32::from(from.system));
        let is_station = matches!(
            heartbeat.mavtype,
            MavType::MAV_TYPE_GCS | MavType::MAV_TYPE_ONBOARD_CONTROLLER
        );
        if is_ours && is_station {
            self.heard = Some(now);
        }
    }

    /// Returns when its silence is acted upon.
    pub(super) fn deadline(&self, parameters: &ParameterTable) -> Option<Time> {
        let is_on = parameters
            .value_of("FS_GCS_ENABLE")
            .is_some_and(|enabled| enabled > 0.0);
        let after_s = parameters
            .value_of("FS_GCS_TIMEOUT")
            .unwrap_or(5.0)
            .clamp(1.0, 120.0);
        let heard = self.heard.filter(|_| is_on)?;
        Some(heard + Duration::from_secs_f32(after_s))
    }

    /// Returns what its silence leads to, once.
    pub(super) fn due(
        &mut self,
        now: Time,
        kind: VehicleKind,
        parameters: &ParameterTable,
    ) -> Option<Command> {
        if self.deadline(parameters).is_none_or(|at| now < at) {
            return None;
        }
        self.heard = None;
        // https://ardupilot.org/rover/docs/parameters.html#fs-action,
        // https://ardupilot.org/copter/docs/parameters.html#fs-gcs-enable
        let mode = match (kind, kind_of_action(kind, parameters)) {
            (VehicleKind::Rover, 1) => FlightMode::Return,
            (VehicleKind::Rover, 2) => FlightMode::Hold,
            (VehicleKind::Rover, _) => return None,
            (VehicleKind::Copter, 5) => FlightMode::Land,
            (VehicleKind::Copter, _) => FlightMode::Return,
        };
        Some(Command::Mode(mode))
    }
}

/// A rover is told what to do by `FS_ACTION`, a copter by `FS_GCS_ENABLE` itself.
fn kind_of_action(kind: VehicleKind, parameters: &ParameterTable) -> i32 {
    let name = match kind {
        VehicleKind::Rover => "FS_ACTION",
        VehicleKind::Copter => "FS_GCS_ENABLE",
    };
    parameters.value_of(name).unwrap_or(0.0) as i32
}
