//! What a run shows of itself while it goes on, for whoever watches: how far it is, where everybody truly is, and what
//! the ground station knows of the place. Watching changes nothing.

use tomoswarm_proto::VehicleId;

use super::kernel::RunProgress;
use crate::geom::{Angle, Point};
use crate::map::Merged;
use crate::node::mission::MissionStatus;

/// A run at one moment.
#[derive(Clone, Debug)]
pub struct RunView<'a> {
    /// How far it is.
    pub status: RunProgress,
    /// The map that the ground station holds.
    pub map: &'a Merged,
    /// Everybody, in the order of their ids.
    pub vehicles: Vec<VehicleSnapshot>,
}

/// A vehicle at one moment.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct VehicleSnapshot {
    /// Which one.
    pub id: VehicleId,
    /// Where it truly is.
    pub at: Point,
    /// Where it faces.
    pub heading: Angle,
    /// What it does; `None` while its software does not run.
    pub status: Option<MissionStatus>,
}
