//! Routes on the map: A*, corridors, and what is released to be driven.
//!
//! Three questions, each with its file: where could one drive ([`Grid`] and its search), how much of that is
//! known to be free right now ([`Corridor`], *look before you drive*), and how fast may one go so that the last
//! look still leaves room to stop ([`Sight`]). Peers, plans and time are not known here.

mod astar;
mod buckets;
mod clearance;
mod corridor;
mod distance;
mod frontier;
mod grid;
#[cfg(test)]
mod looking;
mod mounts;
mod smooth;
mod speed;
mod steps;
mod swath;
mod terrain;
mod turning;

pub use astar::{Found, NoRoute, Rules, Turning, shortest_cells};
pub use clearance::Clearance;
pub use corridor::{Corridor, Release};
pub use distance::Distances;
pub use frontier::{Cluster, FrontierError, Frontiers};
pub use grid::{Grid, GridError, MAX_GRID_CELLS, swept_clearance_m};
pub use mounts::{Aim, Choice, Mount, Mounts, Pointing};
pub use smooth::{Route, route_along, shortest_route};
pub use speed::{Sight, SpeedError, stopping_distance_m};
