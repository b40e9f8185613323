//! A world with nothing in it but vehicles: for who only wants autopilots to talk to.

use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::environment::Environment;
use super::faults::Faults;
use super::motion::DriveLimits;
use super::noise::Noise;
use super::radio_field::{RadioConstants, RadioField};
use super::range::{RangeModel, RangeSensor};
use super::world::{FlightConditions, VehicleBuild, World, WorldContents};
use crate::autopilot::VehicleKind;
use crate::geom::{Angle, Point, Polygon};
use crate::scene::{Attenuation, Material, Scene, SceneParts};

/// Vehicles stand this far from each other, metres.
pub const APART_M: f64 = 5.0;
/// Nothing goes further than this from the middle, metres.
const EDGE_M: f64 = 1e5;
/// How fast a kind of vehicle is unless it is told otherwise, m/s, and how fast it gains that, m/s².
const ROVER: (f64, f64) = (2.0, 2.0);
const COPTER: (f64, f64) = (5.0, 2.5);

/// Makes a world of so many vehicles that stand in rows, switched on and disarmed; vehicle 1 stands at the origin. The same
/// seed gives the same errors of their places.
///
/// # Errors
/// There are too many vehicles.
pub fn free_space(kind: VehicleKind, count: u8, seed: u64) -> Result<Environment, String> {
    let noise = Noise::new(seed);
    let (speed_mps, acceleration_mps2) = match kind {
        VehicleKind::Rover => ROVER,
        VehicleKind::Copter => COPTER,
    };
    let build = VehicleBuild {
        radius_m: 0.3,
        height_m: 0.4,
        sensor_m: 0.2,
        limits: DriveLimits {
            speed_mps,
            acceleration_mps2,
            braking_mps2: acceleration_mps2,
            turn_rate_radps: std::f64::consts::FRAC_PI_2,
        },
        pose_sd_m: 0.02,
        pose_drift: Duration::from_secs(20),
        endurance_driving: Duration::from_secs(3600),
        endurance_resting: Duration::from_secs(36_000),
    };
    let fence = Polygon::new(vec![
        Point::new(-EDGE_M, -EDGE_M),
        Point::new(EDGE_M, -EDGE_M),
        Point::new(EDGE_M, EDGE_M),
        Point::new(-EDGE_M, EDGE_M),
    ]);
    let nothing = SceneParts {
        shapes: &[],
        offset_m: [0.0; 3],
        materials: &Default::default(),
        default_material: Material::default(),
        posts: &[],
        persons: &[],
    };
    let scene = Scene::build(&nothing).map_err(|error| error.to_string())?;
    let radio = RadioConstants::default();
    let attenuation = Attenuation::new(&scene, build.height_m, radio.wavelength_m, 0.0);
    let flying = FlightConditions {
        kind,
        altitude_m: 0.0,
        climb_mps: 2.5,
        ..FlightConditions::default()
    };
    let mut world = World::new(
        WorldContents { scene, attenuation },
        build,
        fence,
        noise,
        RadioField::new(noise, radio),
        RangeSensor::new(RangeModel::default()),
    )
    .with_flying(flying)
    .with_cold_start();
    let a_row = (1..=u8::MAX)
        .find(|side| side.saturating_mul(*side) >= count)
        .unwrap_or(u8::MAX);
    for index in 0..count {
        let at = Point::new(
            f64::from(index % a_row) * APART_M,
            f64::from(index / a_row) * APART_M,
        );
        world.place(VehicleId(index + 1), at, Angle::default())?;
    }
    Ok(Environment::new(world, noise, Faults::default(), None))
}
