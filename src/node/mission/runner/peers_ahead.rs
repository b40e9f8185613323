//! Whether what is in the way is a peer or the world, and what a vehicle does about peers: it waits, steps aside, or gives up
//! what it goes for. When it does which is decided by [`super::yield_to_peers`].

use super::yield_to_peers::{Turn, Yield};
use super::{Destination, RunnerContext, StepRunner, WAIT};
use crate::geom::{Cell, Point, Segment, Track};
use crate::map::CellRect;
use crate::node::mission::MissionEvent;
use crate::node::mission::aside::{
    Bound, PeerWay, aside_in_turn, peers_on_way, way_aside, way_aside_for, way_past,
    way_without_peers, ways_of, ways_of_peers,
};
use crate::node::mission::kind::{DriveRoute, PassedOver, RouteRoom};
use crate::node::mission::obstruction::{Obstruction, ObstructionKind};
use crate::node::mission::pilot::AHEAD_M;
use crate::node::mission::terrain::{PathSearch, RULES, Resolution};
use crate::node::vehicle::CommandRefusal;
use crate::plan::Distances;

/// Nearer than so many separations nobody comes to peers to see more.
const NEAR_PEERS: f64 = 2.0;
/// It is worth the way to see more from so much farther along the way, metres.
const NEARER_M: f64 = 0.5;
/// So much of a border between what was seen and what was not is worth to be gone to, metres.
const UNSEEN_M: f64 = 0.6;
/// So often it looks whether those for whom it waits are gone, in waits.
const LOOK_WHO_IS_GONE: u32 = 15;
/// Ways are followed in steps of this length, metres.
const STEP_M: f64 = 0.1;

impl StepRunner {
    /// Waits for peers to make room; steps aside when that takes long, and gives up when it takes too long.
    pub(super) fn yield_to_peers(&mut self, scene: &mut RunnerContext<'_>) {
        self.yield_saying(scene, |runner, scene| {
            let search = scene.terrain.search(scene.now, scene.pose());
            let on_way = |to| peers_on_way(&search, to, scene.peers);
            MissionEvent::WaitsForPeers(runner.goal().map_or_else(Vec::new, on_way))
        });
    }

    /// The same, and what it says when it begins to wait.
    pub(super) fn yield_saying(
        &mut self,
        scene: &mut RunnerContext<'_>,
        event: impl FnOnce(&StepRunner, &RunnerContext<'_>) -> MissionEvent,
    ) {
        let from = scene.pose().at;
        let turn = Turn {
            own: self.settings.vehicle,
            left_m: self.left_m(from),
            is_in_the_way: self.is_in_the_way(scene),
        };
        let mut what = self.yields.once_more(&turn, scene.peers);
        let looks = self.yields.in_a_row().is_multiple_of(LOOK_WHO_IS_GONE);
        if looks && self.is_barred_by_gone(scene) {
            what = Yield::InVain;
        }
        match (what, self.mission.under_way(), self.sought) {
            (Yield::InVain, Some(_), Some(sought)) => {
                self.pass_over(scene, sought, PassedOver::GivenUp);
            }
            (Yield::InVain, Some(mission), None) => match mission.goes_on_without(scene.now) {
                true => {
                    self.yields.end();
                    self.think(scene.now);
                }
                false => {
                    let end = mission.give_up();
                    self.finish(scene, end);
                }
            },
            (Yield::StepAside, ..) => match self.course_aside(scene) {
                Some(course) => self.step_aside(scene, &course),
                None => match self.course_nearer(scene) {
                    Some(course) => self.drive(scene, &course, Destination::Aside),
                    None => self.choose_at(scene.now + WAIT),
                },
            },
            (Yield::Wait, ..) | (Yield::InVain, None, _) => {
                if self.yields.in_a_row() == 1 {
                    scene.emit(event(self, scene));
                }
                self.choose_at(scene.now + WAIT);
            }
        }
    }

    /// Returns whether those alone bar every way to the place that it goes for of whom nothing was heard for long.
    fn is_barred_by_gone(&self, scene: &RunnerContext<'_>) -> bool {
        let gone = scene.peers.claims_of_gone(scene.now);
        let Some(to) = self.sought.filter(|_| !gone.is_empty()) else {
            return false;
        };
        let search = scene.terrain.search(scene.now, scene.pose());
        way_past(&search, to, &gone).is_none() && way_without_peers(&search, to).is_some()
    }

    pub(super) fn step_aside(&mut self, scene: &mut RunnerContext<'_>, course: &DriveRoute) {
        let to = course.corners.last().copied().unwrap_or(scene.pose().at);
        scene.emit(MissionEvent::StepsAside(to));
        self.drive(scene, course, Destination::Aside);
    }

    /// Returns whether it stands on the way of a peer, as far as that is known.
    fn is_in_the_way(&self, scene: &RunnerContext<'_>) -> bool {
        let separation_m = self.settings.swarm.separation_m;
        scene.peers.iter().any(|(_, peer)| {
            PeerWay::of(peer, scene.now, separation_m).is_barred_from(scene.pose().at)
        })
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

    /// Returns the way to a place aside, where it bars nobody's way; or that of no lower id, or of one peer; or any that is farther
    /// off all ways.
    pub(super) fn course_aside(&self, scene: &RunnerContext<'_>) -> Option<DriveRoute> {
        let claims = scene.surroundings().claims();
        let grid = self
            .courses(scene)
            .ground(None, Resolution::Parts, false, &claims)?;
        let search = scene.terrain.search(scene.now, scene.pose());
        let separation_m = self.settings.swarm.separation_m;
        let all_ways = ways_of_peers(scene.peers, scene.now, &search, separation_m);
        let peers: Vec<Bound<'_>> = Bound::all(scene.peers, scene.now).collect();
        let aside = aside_in_turn(&search, self.settings.vehicle, &peers, false, |first| {
            let ways = ways_of(&all_ways, first, peers.len());
            let room_m = self.yields.room_m(ways.iter().copied());
            way_aside_for(&search, &grid, (&ways, room_m), first, |_| true)
        });
        let anywhere = || {
            let ways: Vec<&PeerWay> = all_ways.values().collect();
            let room_m = self.yields.room_m(ways.iter().copied());
            way_aside(&grid, scene.pose().at, &ways, room_m, |_| true)
        };
        let corners = aside.or_else(anywhere)?;
        Some(DriveRoute {
            corners,
            room: RouteRoom::Kept,
        })
    }

    /// Returns the way to where it sees more of the ground around the peers that bar its way: along the way that there would be
    /// without them, as far as that is known, and not near to them. `None` where that is no farther than here.
    fn course_nearer(&self, scene: &RunnerContext<'_>) -> Option<DriveRoute> {
        let (at, to) = (scene.pose().at, self.goal()?);
        let search = scene.terrain.search(scene.now, scene.pose());
        let way = Track::new(way_without_peers(&search, to)?)?;
        let claims = scene.surroundings().claims();
        let grid = self
            .courses(scene)
            .ground(None, Resolution::Parts, false, &claims)?;
        let nodes = grid.lattice();
        let reached = Distances::from_start(&grid, nodes.cell_at(at), &RULES).ok()?;
        let keep_m = NEAR_PEERS * self.settings.swarm.separation_m;
        let claims: Vec<Track> = claims.into_iter().filter_map(Track::new).collect();
        let may_go = |place: &Point| {
            let is_far = |claim: &Track| claim.distance_to_point(*place) >= keep_m;
            reached.cost_m(nodes.cell_at(*place)).is_some() && claims.iter().all(is_far)
        };
        let last = way.places(STEP_M).skip(1).take_while(may_go).last()?;
        let route = reached.route_to(&grid, at, last)?;
        let is_worth = last.distance_to(at) >= NEARER_M && self.sees_more(&search, last);
        is_worth.then(|| DriveRoute {
            corners: route.points[1..].to_vec(),
            room: RouteRoom::Kept,
        })
    }

    /// Returns whether ground that nobody has seen begins where it is seen from a place.
    fn sees_more(&self, search: &PathSearch<'_>, place: Point) -> bool {
        let lattice = search.lattice();
        let area = CellRect::around(lattice, &[place], self.settings.look.sure_range_m);
        let (Some(area), Some(map)) = (area, search.fenced_map()) else {
            return false;
        };
        let begins = |cell: &Cell| {
            let mut beside = CellRect::new(*cell, *cell).grown(1).cells();
            let is_near =
                lattice.centre(*cell).distance_to(place) <= self.settings.look.sure_range_m;
            is_near
                && map.barred(*cell).is_none()
                && beside.any(|beside| map.is_unseen(beside))
                && search.sees_close(place, lattice.centre(*cell))
        };
        let begin_m = area.cells().filter(begins).count() as f64 * lattice.cell_m();
        begin_m >= UNSEEN_M
    }
}
