//! What a vehicle of the swarm has said of itself, in the terms of an autopilot.

use tomoswarm_proto::{
    BodyKind, Capability, Control, Health, Hello, MissionPhase, MissionProgress, OrderKind,
    SatelliteFix, StandReason, State, VehicleMode,
};

use crate::autopilot::{FlightMode, SystemStatus, VehicleKind};
use crate::geom::{Angle, Point};
use crate::mavlink::dialect::{GpsFixType, MavProtocolCapability, MissionState};
use crate::mavlink::vehicle_messages::{BatteryReadout, MissionReadout, VehicleReadout};
use crate::time::Time;

/// The newest that a vehicle has said of itself.
#[derive(Clone, Copy, Debug)]
pub struct VehicleReport<'a> {
    /// When its state came.
    pub at: Time,
    /// Its state.
    pub state: &'a State,
    /// How far it is with its mission; `None` = it has not said.
    pub mission: Option<&'a MissionProgress>,
    /// How it fares; `None` = it has not said.
    pub health: Option<&'a Health>,
    /// Its greeting; `None` = it has not greeted.
    pub hello: Option<&'a Hello>,
}

/// Translates a report; `home` is the vehicle's in the venue.
pub(super) fn readout(report: &VehicleReport<'_>, home: Option<Point>) -> VehicleReadout {
    let VehicleReport {
        state,
        mission,
        health,
        ..
    } = *report;
    let kind = kind(report);
    let autopilot = health.and_then(|health| health.autopilot.as_ref());
    let tilt = |angle_rad: Option<f64>| Angle::from_radians(angle_rad.unwrap_or_default());
    let firmware = autopilot.map_or("", |autopilot| autopilot.firmware.as_str());
    VehicleReadout {
        kind,
        mode: mode(kind, state, mission),
        is_armed: state.is_armed,
        is_landed: state.is_landed,
        status: status(state),
        pose: state.pose.map(Into::into),
        altitude_m: state.pose.map_or(0.0, |pose| pose.at.z_m()),
        tilt: (tilt(state.roll.radians()), tilt(state.pitch.radians())),
        velocity_mps: (state.velocity.x_mps(), state.velocity.y_mps()),
        climb_mps: state.velocity.z_mps(),
        battery: BatteryReadout {
            charge: state.battery.map(|charge| charge.fraction()),
            volts: autopilot
                .and_then(|autopilot| autopilot.battery_mv)
                .map(|millivolts| f64::from(millivolts) * 1e-3),
            amperes: autopilot
                .and_then(|autopilot| autopilot.battery_ma)
                .map(|milliamperes| f64::from(milliamperes) * 1e-3),
        },
        fix: fix(
            state,
            autopilot.map_or(SatelliteFix::Unknown, |autopilot| autopilot.fix),
        ),
        satellites: autopilot.and_then(|autopilot| autopilot.satellites),
        home,
        mission: mission_readout(mission),
        version: version(firmware),
        capabilities: MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MISSION_INT
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2,
    }
}

/// What does not fly is shown as a rover.
fn kind(report: &VehicleReport<'_>) -> VehicleKind {
    let said = report.health.and_then(|health| health.autopilot.as_ref());
    let greeted = report.hello.and_then(|hello| {
        hello.capabilities.iter().find_map(|can| match can {
            Capability::Autopilot(_, body) => Some(*body),
            Capability::RangeSensor(_)
            | Capability::Servo(_)
            | Capability::Radio(_)
            | Capability::StoredMissions => None,
        })
    });
    match said.map(|autopilot| autopilot.body).or(greeted) {
        Some(BodyKind::Copter) => VehicleKind::Copter,
        Some(BodyKind::Rover | BodyKind::Boat | BodyKind::Plane | BodyKind::Other) | None => {
            VehicleKind::Rover
        }
    }
}

/// Returns whether a mission is under way that was not ended.
pub(super) fn is_under_way(state: &State, mission: Option<&MissionProgress>) -> bool {
    state.ordered.kind == Some(OrderKind::Start)
        && mission.is_none_or(|mission| mission.end.is_none())
}

/// The mode that says best what it does: what moves by an order is in AUTO or RTL, what stands by one in HOLD.
fn mode(kind: VehicleKind, state: &State, mission: Option<&MissionProgress>) -> FlightMode {
    let at_rest = FlightMode::staying(kind);
    let lands = state.mode == VehicleMode::Landing || state.ordered.kind == Some(OrderKind::Land);
    let returns = state.ordered.kind == Some(OrderKind::Return)
        || mission.is_some_and(|mission| mission.phase == MissionPhase::Returning);
    match (state.control, state.stands_under) {
        (Control::Remote, _) => FlightMode::Manual,
        (Control::Own | Control::Silent, _) => at_rest,
        (Control::Ours, _) if lands && kind == VehicleKind::Copter => FlightMode::Land,
        (Control::Ours, Some(StandReason::Battery | StandReason::Blind)) if returns => {
            FlightMode::Return
        }
        (Control::Ours, Some(_)) => at_rest,
        (Control::Ours, None) if returns => FlightMode::Return,
        (Control::Ours, None) if is_under_way(state, mission) => FlightMode::Auto,
        (Control::Ours, None) => at_rest,
    }
}

fn status(state: &State) -> SystemStatus {
    match (state.stands_under, state.pose) {
        (Some(StandReason::Stop(_) | StandReason::NoPlace), _) | (_, None) => {
            SystemStatus::Critical
        }
        (_, Some(_)) if state.is_armed => SystemStatus::Active,
        (_, Some(_)) => SystemStatus::Standby,
    }
}

/// What knows its place has a fix, by whatever it knows it.
fn fix(state: &State, said: SatelliteFix) -> GpsFixType {
    let has_place = state.pose.is_some() && state.stands_under != Some(StandReason::NoPlace);
    match said {
        SatelliteFix::Unknown | SatelliteFix::NoReceiver if has_place => {
            GpsFixType::GPS_FIX_TYPE_3D_FIX
        }
        SatelliteFix::NoReceiver => GpsFixType::GPS_FIX_TYPE_NO_GPS,
        SatelliteFix::Unknown | SatelliteFix::NoFix => GpsFixType::GPS_FIX_TYPE_NO_FIX,
        SatelliteFix::TwoD => GpsFixType::GPS_FIX_TYPE_2D_FIX,
        SatelliteFix::ThreeD => GpsFixType::GPS_FIX_TYPE_3D_FIX,
        SatelliteFix::Differential => GpsFixType::GPS_FIX_TYPE_DGPS,
        SatelliteFix::RtkFloat => GpsFixType::GPS_FIX_TYPE_RTK_FLOAT,
        SatelliteFix::RtkFixed => GpsFixType::GPS_FIX_TYPE_RTK_FIXED,
    }
}

/// Of a plan the stop that it goes to, and the last one; of a mission of its own the places that are left.
fn mission_readout(mission: Option<&MissionProgress>) -> MissionReadout {
    let Some(mission) = mission else {
        return MissionReadout::default();
    };
    let done = mission
        .progress
        .done
        .map_or(0, |stop| stop.0.saturating_add(1));
    let item = u16::try_from(done).unwrap_or(u16::MAX);
    let state = match (mission.end, mission.phase) {
        (Some(_), _) | (None, MissionPhase::Over) => MissionState::MISSION_STATE_COMPLETE,
        (None, MissionPhase::Waiting) => MissionState::MISSION_STATE_NOT_STARTED,
        (None, MissionPhase::Held) => MissionState::MISSION_STATE_PAUSED,
        (
            None,
            MissionPhase::Choosing
            | MissionPhase::Going
            | MissionPhase::Dwelling
            | MissionPhase::Looking
            | MissionPhase::Yielding
            | MissionPhase::Returning,
        ) => MissionState::MISSION_STATE_ACTIVE,
    };
    MissionReadout {
        item,
        total: item.saturating_add(mission.places_left),
        state,
    }
}

/// Reads a version such as `4.5.4`; zeros where it is not known.
fn version(firmware: &str) -> [u8; 3] {
    let mut parts = firmware.split('.').map(|part| part.parse().unwrap_or(0));
    [(); 3].map(|()| parts.next().unwrap_or(0))
}
