//! Small makers of inputs for the tests of the node's actors.

use std::time::Duration;

use tomoswarm_proto::{Beacon, Boot, Permille, Progress, RunId, State, VehicleId, VehicleMode};

use super::{BodySettings, LookSettings, OwnState, RadioSettings, VehicleSettings};
pub use crate::actor::tests_support::{drawn, variant_of, variants};
use crate::geom::{Angle, Lattice, Point, Pose, Rect};

/// The own vehicle, standing at a place, facing along x, as the other actors of it are told.
pub fn own_state(x_m: f64, y_m: f64) -> OwnState {
    OwnState {
        sequence: 1,
        pose: Pose {
            at: Point::new(x_m, y_m),
            heading: Angle::default(),
            sd_m: 0.05,
        },
        flight_state: Default::default(),
        speed_mps: 0.0,
        mode: VehicleMode::Idle,
        is_at_rest: true,
        may_move: true,
        sees: true,
        is_armed: true,
        is_landed: true,
        battery: Some(1.0),
        leg: None,
        stored: None,
        accepted: Default::default(),
        ordered: Default::default(),
    }
}

/// Another vehicle standing at a place, facing along x, as it travels.
pub fn state(vehicle: u8, x_m: f64, y_m: f64) -> State {
    State {
        vehicle: VehicleId(vehicle),
        boot: Boot(1),
        sequence: 1,
        pose: Some(own_state(x_m, y_m).pose.into()),
        is_at_rest: true,
        is_landed: true,
        mode: VehicleMode::Idle,
        battery: Some(Permille::WHOLE),
        leg: None,
        accepted: Default::default(),
        ordered: Default::default(),
        ..State::default()
    }
}

/// A beacon of another vehicle at (`x_m`, 0), in run 4.
pub fn beacon(sender: u8, sequence: u32, x_m: f64, members: Vec<VehicleId>) -> Beacon {
    Beacon {
        sender: VehicleId(sender),
        boot: Boot(1),
        sequence,
        pose: state(sender, x_m, 0.0).pose,
        channel: 11,
        power_dbm: 0,
        members,
        progress: Progress {
            run: RunId(4),
            ..Progress::default()
        },
        ..Beacon::default()
    }
}

/// Settings of a small rover in a fence from (−5, −5) to (25, 25).
pub fn settings(vehicle: u8) -> VehicleSettings {
    VehicleSettings {
        vehicle: VehicleId(vehicle),
        boot: Boot(1),
        memory: Default::default(),
        stops: Default::default(),
        listens_for: Duration::from_secs(2),
        fence: Rect::new(Point::new(-5.0, -5.0), Point::new(25.0, 25.0)).polygon(),
        fence_room_m: 5.0,
        expected_sd_m: 0.02,
        home: Point::new(0.0, 0.0),
        lattice: Lattice::new(0.2),
        slice: 0,
        body: BodySettings {
            radius_m: 0.25,
            speed_mps: 0.5,
            braking_mps2: 1.0,
        },
        look: LookSettings {
            is_blind: false,
            beams: vec![
                Angle::from_degrees(-30.0),
                Angle::default(),
                Angle::from_degrees(30.0),
            ],
            half_angle: Angle::from_degrees(15.0),
            min_range_m: 0.1,
            max_range_m: 4.0,
            sure_range_m: 3.0,
            period: Duration::from_millis(100),
            settle: Duration::from_millis(50),
            mounts: crate::plan::Mounts::default(),
            smallest_post: None,
        },
        radio: RadioSettings {
            channel: 11,
            power_dbm: 0,
            slot: Duration::from_millis(50),
            successor: None,
        },
        carried_m: 0.0,
        safety: crate::config::Safety {
            padding_m: 0.15,
            ..Default::default()
        },
        swarm: crate::config::Swarm::default(),
        task: None,
        path_time: Duration::from_millis(20),
        autopilot: crate::autopilot::AutopilotLinkSettings::default(),
    }
}
