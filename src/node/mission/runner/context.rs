//! What a runner is told and may use in one step. It decides nothing.

use crate::geom::Pose;
use crate::node::OwnState;
use crate::node::mission::kind::MissionContext;
use crate::node::mission::pilot::Pilot;
use crate::node::mission::place_watch::PlaceWatch;
use crate::node::mission::terrain::Terrain;
use crate::node::mission::{MissionEvent, Out};
use crate::node::peers::Peers;
use crate::time::Time;

/// What a runner is told and may use.
pub(in crate::node::mission) struct RunnerContext<'a> {
    /// Now.
    pub now: Time,
    /// The own state.
    pub state: &'a OwnState,
    /// What is known of the ground.
    pub terrain: &'a Terrain,
    /// Drives.
    pub pilot: &'a mut Pilot,
    /// The others.
    pub peers: &'a Peers,
    /// How well the own place is known.
    pub place: &'a mut PlaceWatch,
    /// What is said.
    pub out: &'a mut Vec<Out>,
}

impl RunnerContext<'_> {
    pub(super) fn pose(&self) -> Pose {
        self.state.pose
    }

    pub(super) fn rests(&self) -> bool {
        self.state.leg.is_none() && !self.state.mode.moves()
    }

    pub(super) fn surroundings(&self) -> MissionContext<'_> {
        MissionContext {
            now: self.now,
            pose: self.pose(),
            terrain: self.terrain,
            peers: self.peers,
        }
    }

    pub(super) fn emit(&mut self, event: MissionEvent) {
        self.out.push(Out::MissionEvent(event));
    }
}
