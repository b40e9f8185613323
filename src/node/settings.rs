//! What a vehicle is told about itself and its venue before it starts; validated by `config`.

use std::f64::consts::SQRT_2;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Boot, LayerId, OpenStops, TaskKind, VehicleId};

use super::memory::VehicleMemory;
use crate::autopilot;
use crate::config::{Safety, Swarm};
use crate::geom::{Angle, Lattice, Point, Polygon, Pose};
use crate::plan::{Mounts, SmallestPost};

/// Everything that the actors of one vehicle need to know.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct VehicleSettings {
    /// Which vehicle this is.
    pub vehicle: VehicleId,
    /// Which start of its software.
    pub boot: Boot,
    /// What its earlier starts have left.
    pub memory: VehicleMemory,
    /// The emergency stops that they knew.
    pub stops: OpenStops,
    /// How long it listens before it may be started.
    pub listens_for: Duration,
    /// Where vehicles may be.
    pub fence: Polygon,
    /// How far from the fence its home and the border of the area are, at least, metres.
    pub fence_room_m: f64,
    /// The deviation of its place that its file expects, metres.
    pub expected_sd_m: f64,
    /// Where it returns to.
    pub home: Point,
    /// The cells of the map.
    pub lattice: Lattice,
    /// Altitude slice that it drives in.
    pub slice: i16,
    /// What it is out for; `None` = it follows the plans of the ground station.
    #[serde(default)]
    pub task: Option<TaskKind>,
    /// Its body.
    pub body: BodySettings,
    /// Its range sensor.
    pub look: LookSettings,
    /// Its radio.
    pub radio: RadioSettings,
    /// How far wind may carry it from where it is sent, metres.
    #[serde(default)]
    pub carried_m: f64,
    /// Distances that it keeps.
    pub safety: Safety,
    /// What all nodes of the swarm agree on.
    pub swarm: Swarm,
    /// How long a search for a path takes before its result may be used.
    pub path_time: Duration,
    /// Its autopilot.
    pub autopilot: autopilot::AutopilotLinkSettings,
}

/// Size and motion of the body.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct BodySettings {
    /// Radius of the disc that holds the vehicle, metres.
    pub radius_m: f64,
    /// Speed to drive at, m/s; already limited by what the sensor allows.
    pub speed_mps: f64,
    /// Braking, m/s².
    pub braking_mps2: f64,
}

/// The range sensor and how it is pointed.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct LookSettings {
    /// Whether there is no range sensor at all: such a vehicle sees nothing, and is not driven.
    #[serde(default)]
    pub is_blind: bool,
    /// Directions looked at in turn, relative to the heading.
    pub beams: Vec<Angle>,
    /// Half the opening of the cone.
    pub half_angle: Angle,
    /// Nearest distance that gives an echo, metres.
    pub min_range_m: f64,
    /// Farthest distance from which an echo is believed, metres.
    pub max_range_m: f64,
    /// Up to where no echo means that nothing is there, metres.
    pub sure_range_m: f64,
    /// Time from one reading to the next.
    pub period: Duration,
    /// Time that the servo needs to come to rest, beyond that for turning.
    pub settle: Duration,
    /// Which sensor looks where.
    pub mounts: Mounts,
    /// The thinnest post that the vehicle must not touch, with how far away the sensor hears it (`heard_m`): an empty look
    /// proves that no such post stands in its cone up to there, and beyond, up to the sure range, nothing about posts. `None`
    /// when the sensor promises it of no post.
    #[serde(default)]
    pub smallest_post: Option<SmallestPost>,
}

impl LookSettings {
    /// Returns the time in which every beam is looked along once, the turns of the servos included.
    pub fn cycle(&self) -> Duration {
        self.period * self.beams.len() as u32 + self.mounts.slew_of_round(&self.beams)
    }
}

/// The radio and its place in the ring.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct RadioSettings {
    /// Channel number.
    pub channel: u8,
    /// Transmit power, dBm.
    pub power_dbm: i8,
    /// Length of one slot of the token ring.
    pub slot: Duration,
    /// What the direct successor of a vehicle that was heard waits; `None` = a slot.
    #[serde(default)]
    pub successor: Option<Duration>,
}

/// A place whose deviation is this many times the expected one is worse known.
const WORSE_THAN_EXPECTED: f64 = 1.2;
/// A deviation that is larger by less than this is none worse, metres.
const WORSE_THAN_EXPECTED_M: f64 = 0.02;
/// Who stands too near to the fence has left it after so much of a route, metres, if that is enough.
const LEAVES_FENCE_M: f64 = 1.0;
/// A way away from the fence is so much longer than what it gains, metres.
const LEAVES_SPARE_M: f64 = 0.2;

/// Returns how many times as far off as each coordinate a place may be across a side of a fence: both may be, and a corner that
/// points inwards has a side of every direction.
fn slant_of(fence: &Polygon) -> f64 {
    if !fence.is_convex() {
        return SQRT_2;
    }
    let slants = fence.edges().map(|edge| {
        let along = edge.vector();
        (along.x_m.abs() + along.y_m.abs()) / along.length_m()
    });
    slants.filter(|slant| slant.is_finite()).fold(1.0, f64::max)
}

impl LookSettings {
    /// Returns whether a close look along a heading shows what lies so far beside it.
    pub fn covers(&self, off: Angle) -> bool {
        let half_rad = self.half_angle.radians();
        let is_in = |beam: &Angle| (off - *beam).radians().abs() <= half_rad;
        self.beams.iter().any(is_in)
    }
}

impl VehicleSettings {
    /// Returns the layer of maps that it writes.
    pub fn layer(&self) -> LayerId {
        LayerId {
            vehicle: self.vehicle,
            boot: self.boot,
        }
    }

    /// Returns how far from where it is sent its body may be, metres: its radius, and what wind carries it aside.
    pub fn reach_m(&self) -> f64 {
        self.body.radius_m + self.carried_m
    }

    /// Returns how far the middle of a vehicle at a pose stays from the fence, metres: its reach, and what its place may be
    /// off. As long as that is what its file expects it is not more than the venue leaves at its home and around the area, where
    /// the vehicle has to be; what its place is worse known is kept everywhere.
    pub fn fence_reach_m(&self, pose: Pose) -> f64 {
        let reach_m = self.reach_m();
        let off_m = |pose: Pose| pose.off_m() * slant_of(&self.fence);
        let expected_m = off_m(Pose {
            sd_m: self.expected_sd_m.min(pose.sd_m),
            ..pose
        });
        let room_m = (reach_m + expected_m).min(self.fence_room_m).max(reach_m);
        match self.is_worse_known(pose) {
            true => room_m + off_m(pose) - expected_m,
            false => room_m,
        }
    }

    /// Returns whether the place of a pose is worse known than the vehicle's file expects.
    pub fn is_worse_known(&self, pose: Pose) -> bool {
        pose.sd_m > WORSE_THAN_EXPECTED * self.expected_sd_m + WORSE_THAN_EXPECTED_M
    }

    /// Returns after how much of its route a vehicle has left the fence that stands `here_m` from it, too near, metres.
    pub fn leaves_fence_m(&self, pose: Pose, here_m: f64) -> f64 {
        LEAVES_FENCE_M.max(self.fence_reach_m(pose) - here_m + LEAVES_SPARE_M)
    }

    /// Returns half the width of the corridor that must be free for a pose deviation, metres.
    pub fn corridor_m(&self, pose_sd_m: f64) -> f64 {
        self.reach_m() + self.safety.padding_m + 2.0 * pose_sd_m
    }
}
