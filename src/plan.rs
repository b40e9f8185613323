//! Routes on the map: A*, corridors, and what is released to be driven.
//!
//! Three questions, each with its file: where could one drive ([`SearchGrid`] and its search), how much of that is
//! known to be free right now ([`Corridor`], *look before you drive*), and how fast may one go so that the last
//! look still leaves room to stop ([`SensingLimits`]). Peers, plans and time are not known here.

mod astar;
mod barriers;
mod buckets;
mod clearance;
mod component;
mod corridor;
mod detection;
mod distance;
mod echo;
mod frontier;
mod grid;
#[cfg(test)]
mod looking;
mod mounts;
mod required;
mod smooth;
mod speed;
mod steps;
mod swath;
mod terrain;
mod turning;

pub use astar::{GridPath, NoRoute, shortest_cells};
pub use barriers::NodeSpacing;
pub use clearance::Clearance;
pub use component::Component;
pub use corridor::{Corridor, Release};
pub use detection::{ContactLimits, PostDetection, REACTION_S, SmallestPost};
pub use distance::Distances;
pub use echo::{SOUND_MPS, echo_time_s};
pub use frontier::{Cluster, FrontierError, Frontiers};
pub use grid::{GridError, MAX_GRID_CELLS, SearchGrid, swept_clearance_m};
pub use mounts::{Aim, Mount, Mounts, Pointing};
pub use required::RequiredClearance;
pub use smooth::{Route, route_along, shortest_route};
pub use speed::{SensingLimits, SpeedError, stopping_distance_m};
pub use steps::{Rules, TurningCost};
