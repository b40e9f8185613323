//! From a checked file to what a vehicle is told. It decides nothing: what cannot be driven was refused by
//! [`crate::config`].

use std::time::Duration;

use tomoswarm_proto::{Boot, OpenStops, TaskKind, VehicleId};

use super::memory::VehicleMemory;
use super::mission::share;
use super::settings::{BodySettings, LookSettings, RadioSettings, VehicleSettings};
use crate::autopilot::{self, VehicleKind};
use crate::config::{
    BodySpec, Craft, Flight, OwnRadio, RangeDriver, Safety, SensorCoverage, Sim, VehicleFile, Venue,
};
use crate::geom::{Angle, Lattice, Point};
use crate::plan::SmallestPost;

/// How long a search for a path takes in real time beyond the search itself, which has run by then.
const PATH_TIME: Duration = Duration::from_millis(1);
/// A vehicle that was started listens this long before it may be started out.
const LISTENS_FOR: Duration = Duration::from_secs(2);

impl VehicleSettings {
    /// Returns what a vehicle is told by a simulation's file, but for its mission, which the operator gives; `boot`
    /// counts the starts of its software. It remembers nothing.
    pub fn from_config(sim: &Sim, vehicle: VehicleId, boot: Boot, home: Point) -> VehicleSettings {
        VehicleInputs {
            venue: &sim.venue,
            body: sim.vehicles.body,
            look: &sim.range.look,
            smallest_post: sim.smallest_post(),
            radio: sim.radio.own,
            safety: sim.safety,
            path_time: sim.durations.route(),
            has_ring: sim.is_planned_by_ground(),
            expected_sd_m: sim.vehicles.pose_sd_m,
            // The scenario's operator gives it.
            task: None,
            carried_m: sim.vehicles.flight.carried_m(),
            autopilot: autopilot_settings(&sim.vehicles.flight),
        }
        .settings(vehicle, boot, home)
    }

    /// Returns what a vehicle is told by the file of its own node; `boot` counts the starts of its software. It
    /// remembers nothing.
    pub fn from_vehicle_file(file: &VehicleFile, boot: Boot) -> VehicleSettings {
        let inputs = VehicleInputs {
            venue: &file.venue,
            body: file.body,
            look: &file.look,
            smallest_post: file.smallest_post(),
            radio: file.radio,
            safety: file.safety,
            path_time: PATH_TIME,
            has_ring: true,
            expected_sd_m: file.pose.expected_sd_m,
            // It knows of no others: it visits all places, and begins its legs by its number.
            task: file
                .task
                .as_ref()
                .map(|task| share(task, usize::from(file.id.0.saturating_sub(1)), 1)),
            carried_m: file.flight.carried_m(),
            autopilot: autopilot_settings(&file.flight),
        };
        let mut settings = inputs.settings(file.id, boot, file.home);
        settings.look.is_blind = file.drivers.range == RangeDriver::None;
        settings
    }
}

/// What both kinds of files say.
struct VehicleInputs<'f> {
    venue: &'f Venue,
    body: BodySpec,
    look: &'f SensorCoverage,
    smallest_post: Option<SmallestPost>,
    radio: OwnRadio,
    safety: Safety,
    path_time: Duration,
    /// Whether they may be sent to the border of the area.
    has_ring: bool,
    expected_sd_m: f64,
    task: Option<TaskKind>,
    carried_m: f64,
    autopilot: autopilot::AutopilotLinkSettings,
}

impl VehicleInputs<'_> {
    fn settings(&self, vehicle: VehicleId, boot: Boot, home: Point) -> VehicleSettings {
        let (fence, area) = (&self.venue.fence, self.venue.area.polygon());
        let around_area_m = fence
            .edges()
            .flat_map(|edge| area.edges().map(move |side| side.distance_to(edge)))
            .filter(|_| self.has_ring);
        VehicleSettings {
            vehicle,
            boot,
            memory: VehicleMemory::default(),
            stops: OpenStops::default(),
            listens_for: LISTENS_FOR,
            fence: fence.clone(),
            fence_room_m: around_area_m.fold(fence.distance_to_edge(home), f64::min),
            expected_sd_m: self.expected_sd_m,
            home,
            lattice: Lattice::new(self.venue.cell_m),
            slice: 0,
            task: self.task.clone(),
            body: body_settings(&self.body),
            look: look_settings(self.look, self.smallest_post),
            radio: RadioSettings {
                channel: self.venue.swarm.channel(),
                power_dbm: self.radio.power_dbm,
                slot: self.venue.swarm.slot(),
                successor: self.venue.swarm.successor(),
            },
            carried_m: self.carried_m,
            safety: self.safety,
            swarm: self.venue.swarm,
            path_time: self.path_time,
            autopilot: self.autopilot,
        }
    }
}

fn autopilot_settings(flight: &Flight) -> autopilot::AutopilotLinkSettings {
    match flight.craft {
        Craft::Rover => autopilot::AutopilotLinkSettings::default(),
        Craft::Copter => autopilot::AutopilotLinkSettings {
            kind: VehicleKind::Copter,
            altitude_m: flight.altitude_m,
        },
    }
}

fn body_settings(body: &BodySpec) -> BodySettings {
    BodySettings {
        radius_m: body.radius_m,
        speed_mps: body.max_speed_mps,
        braking_mps2: body.braking_mps2,
    }
}

fn look_settings(look: &SensorCoverage, smallest_post: Option<SmallestPost>) -> LookSettings {
    LookSettings {
        is_blind: false,
        beams: look.beams(),
        half_angle: Angle::from_radians(look.half_angle_rad()),
        min_range_m: look.min_range_m,
        max_range_m: look.max_range_m.min(look.farness_m),
        sure_range_m: look.sure_range_m,
        period: look.scan_period(),
        settle: look.settle(),
        mounts: look.mounts(),
        smallest_post,
    }
}
