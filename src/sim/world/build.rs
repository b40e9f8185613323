//! What the vehicles of a world are: their bodies, their drives, and how their autopilots are set.

use std::time::Duration;

use crate::autopilot::VehicleKind;
use crate::geom::Vector;
use crate::sim::autopilot::{AutopilotSettings, LowBattery};
use crate::sim::body::DriveLimits;

/// One that starts cold can be armed after this time, in modes that need no place (on real hardware after 22 s).
const READY_AFTER: Duration = Duration::from_millis(200);
/// And knows its place after this one (on real hardware after 42 s).
const PLACE_AFTER: Duration = Duration::from_millis(500);

/// Figures of the world's vehicles, all alike.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct VehicleBuild {
    /// Radius of the body, metres.
    pub radius_m: f64,
    /// Height of the body, metres.
    pub height_m: f64,
    /// Height of the range sensor, metres.
    pub sensor_m: f64,
    /// What the drive can do.
    pub limits: DriveLimits,
    /// Standard deviation of each believed coordinate, metres.
    pub pose_sd_m: f64,
    /// Time over which the error of the believed place drifts.
    pub pose_drift: Duration,
    /// How long a full battery lasts while driving.
    pub endurance_driving: Duration,
    /// How long a full battery lasts at rest.
    pub endurance_resting: Duration,
}

/// Whether vehicles fly, and what the air does to them.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FlightConditions {
    /// What they are.
    pub kind: VehicleKind,
    /// Altitude above the ground at which copters begin, metres.
    pub altitude_m: f64,
    /// Climbing and sinking, m/s.
    pub climb_mps: f64,
    /// Wind, m/s, where it blows to.
    pub wind: Vector,
}

impl Default for FlightConditions {
    /// Rovers.
    fn default() -> FlightConditions {
        FlightConditions {
            kind: VehicleKind::Rover,
            altitude_m: 0.0,
            climb_mps: 1.0,
            wind: Vector::default(),
        }
    }
}

impl FlightConditions {
    /// Returns how their autopilots are set. The companion decides about batteries and lost places: it knows a safer way
    /// home than a straight line. One that starts cold stands on the ground, just switched on, with ArduPilot's own rules.
    pub(super) fn autopilot(&self, build: &VehicleBuild, starts_cold: bool) -> AutopilotSettings {
        let of_its_own = AutopilotSettings::new(self.kind, build.limits);
        if starts_cold {
            return AutopilotSettings {
                climb_mps: self.climb_mps,
                endurance_driving: build.endurance_driving,
                endurance_resting: build.endurance_resting,
                ready_after: READY_AFTER,
                place_after: PLACE_AFTER,
                wind: self.wind,
                ..of_its_own
            };
        }
        AutopilotSettings {
            climb_mps: self.climb_mps,
            descent_mps: self.climb_mps,
            endurance_driving: build.endurance_driving,
            endurance_resting: build.endurance_resting,
            on_low_battery: LowBattery::Warn,
            place_sd_max_m: f64::INFINITY,
            ready_after: Duration::ZERO,
            place_after: Duration::ZERO,
            disarm_after: Duration::from_secs(1_000_000_000),
            wind: self.wind,
            ..of_its_own
        }
    }
}
