//! Whether what is in the way is a peer or the world, and what a vehicle does about peers: it waits, steps aside, or gives up
//! what it goes for. When it does which is decided by [`super::yield_to_peers`].

use super::yield_to_peers::{Turn, Yield};
use super::{Destination, RunnerContext, StepRunner, WAIT};
use crate::geom::{Point, Segment};
use crate::node::mission::MissionEvent;
use crate::node::mission::aside::{Bound, PeerWay, way_aside, way_aside_for};
use crate::node::mission::kind::{DriveRoute, PassedOver, RouteRoom};
use crate::node::mission::obstruction::{Obstruction, ObstructionKind};
use crate::node::mission::pilot::AHEAD_M;
use crate::node::mission::terrain::Resolution;
use crate::node::vehicle::CommandRefusal;

impl StepRunner {
    /// Waits for peers to make room; steps aside when that takes long, and gives up when it takes too long.
    pub(super) fn yield_to_peers(&mut self, scene: &mut RunnerContext<'_>) {
        let from = scene.pose().at;
        let ways = self.ways_of_peers(scene);
        let is_in_the_way = ways.iter().any(|way| way.is_barred_from(from));
        let turn = Turn {
            own: self.settings.vehicle,
            left_m: self.left_m(from),
            is_in_the_way,
        };
        match (
            self.yields.once_more(&turn, scene.peers),
            self.mission.under_way(),
            self.sought,
        ) {
            (Yield::InVain, Some(_), Some(sought)) => {
                self.pass_over(scene, sought, PassedOver::GivenUp);
            }
            (Yield::InVain, Some(mission), None) => {
                let end = mission.give_up();
                self.finish(scene, end);
            }
            (Yield::StepAside, ..) => match self.course_aside(scene, &ways) {
                Some(course) => self.step_aside(scene, &course),
                None => self.choose_at(scene.now + WAIT),
            },
            (Yield::Wait, ..) | (Yield::InVain, None, _) => {
                if self.yields.in_a_row() == 1 {
                    scene.emit(MissionEvent::WaitsForPeers);
                }
                self.choose_at(scene.now + WAIT);
            }
        }
    }

    pub(super) fn step_aside(&mut self, scene: &mut RunnerContext<'_>, course: &DriveRoute) {
        let to = course.corners.last().copied().unwrap_or(scene.pose().at);
        scene.emit(MissionEvent::StepsAside(to));
        self.drive(scene, course, Destination::Aside);
    }

    /// Returns where the peers are, and where they want to go from there as far as that is known.
    fn ways_of_peers(&self, scene: &RunnerContext<'_>) -> Vec<PeerWay> {
        let separation_m = self.settings.swarm.separation_m;
        scene
            .peers
            .iter()
            .map(|(_, peer)| PeerWay::of(peer, scene.now, separation_m))
            .collect()
    }

    /// Returns whether what a peer claims bars the way straight to a place.
    pub(super) fn is_barred_by_peers(&self, scene: &RunnerContext<'_>, place: Point) -> bool {
        let at = scene.pose().at;
        let share = AHEAD_M / at.distance_to(place).max(AHEAD_M);
        let search = scene.terrain.search(scene.now, scene.pose());
        scene
            .peers
            .iter()
            .any(|(_, peer)| !search.is_clear_of(at.toward(place, share), &peer.claim))
    }

    /// Returns whether what is in the way is a peer, its way, or ground that is not seen since it stands before it.
    pub(super) fn is_a_peer(&self, scene: &RunnerContext<'_>, by: Obstruction) -> bool {
        let pose = scene.pose();
        let body_m = self.settings.body.radius_m + self.settings.lattice.cell_m();
        let is_peer_near = |to: Segment| {
            scene.peers.iter().any(|(_, peer)| {
                let met_m = peer.met_within_m(body_m, pose.sd_m);
                met_m.is_some_and(|met_m| to.distance_to_point(peer.at) <= met_m)
            })
        };
        match by.kind {
            ObstructionKind::Refusal(CommandRefusal::Separation(_)) => true,
            ObstructionKind::Obstacle | ObstructionKind::ReflexObstacle => {
                is_peer_near(Segment::new(by.at, by.at))
            }
            ObstructionKind::UnseenGround => is_peer_near(Segment::new(pose.at, by.at)),
            ObstructionKind::Refusal(_)
            | ObstructionKind::DeadEnd
            | ObstructionKind::NoPathHome
            | ObstructionKind::BesideItsWay
            | ObstructionKind::Unreported => false,
        }
    }

    pub(super) fn course_aside(
        &self,
        scene: &RunnerContext<'_>,
        ways: &[PeerWay],
    ) -> Option<DriveRoute> {
        let claims = scene.surroundings().claims();
        let grid = self
            .courses(scene)
            .ground(None, Resolution::Cells, false, &claims)?;
        let room_m = self.yields.room_m(ways);
        let search = scene.terrain.search(scene.now, scene.pose());
        let peers: Vec<Bound<'_>> = Bound::all(scene.peers, scene.now).collect();
        let clear = way_aside_for(&search, &grid, (ways, room_m), &peers, |_| true);
        let corners =
            clear.or_else(|| way_aside(&grid, scene.pose().at, ways, room_m, |_| true))?;
        Some(DriveRoute {
            corners,
            room: RouteRoom::Kept,
        })
    }
}
