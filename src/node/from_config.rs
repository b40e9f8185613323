//! From a checked file to what a vehicle is told. It decides nothing: what cannot be driven was refused by
//! [`crate::config`].

use tomoswarm_proto::{Boot, VehicleId};

use super::settings::{BodySettings, LookSettings, RadioSettings, SafetySettings, Settings};
use crate::config::Sim;
use crate::geom::{Angle, Lattice, Point};

impl Settings {
    /// Gives what a vehicle is told by a simulation's file; `boot` counts the starts of its software.
    pub fn from_config(sim: &Sim, vehicle: VehicleId, boot: Boot, home: Point) -> Settings {
        let range = &sim.range;
        Settings {
            vehicle,
            boot,
            fence: sim.venue.fence.clone(),
            home,
            lattice: Lattice::new(sim.venue.cell_m),
            slice: 0,
            body: BodySettings {
                radius_m: sim.vehicles.radius_m,
                speed_mps: sim.vehicles.max_speed_mps,
                braking_mps2: sim.vehicles.braking_mps2,
            },
            look: LookSettings {
                beams: range.beams.clone(),
                half_angle: Angle::from_radians(range.half_angle_rad),
                min_range_m: range.min_range_m,
                max_range_m: range.max_range_m,
                sure_range_m: range.sure_range_m,
                period: range.scan_period,
                settle: range.settle,
            },
            radio: RadioSettings {
                channel: sim.radio.channel,
                power_dbm: sim.radio.power_dbm,
                slot: sim.radio.slot,
            },
            safety: SafetySettings {
                padding_m: sim.safety.padding_m,
                separation_m: sim.safety.separation_m,
                pose_sd_max_m: sim.safety.pose_sd_max_m,
                autonomy: sim.safety.autonomy,
                battery_return: sim.safety.battery_return,
                battery_hold: sim.safety.battery_hold,
            },
            path_time: sim.durations.route,
        }
    }
}
