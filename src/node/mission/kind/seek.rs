//! Search and exploration: it looks from place to place at everything unknown that lies beside known free ground, the
//! nearest first. (Frontier-based exploration, Yamauchi 1997; what is near a peer is left to it.)
//!
//! ```text
//!   [Fresh]    ─ looked around ─► [Choosing]
//!   [Choosing] ─ a place to look from ─► [Going]
//!   [Going]    ─ looked, seen on the way, or blocked ─► [Choosing]
//!   [Choosing] ─ nothing unknown is left, but a face that nobody met from in front ─► [Facing]
//!   [Facing]   ─ looked, or blocked ─► [Choosing]
//!   [Choosing] ─ nothing is left, but something that may bar the way and may not ─► [Doubting]
//!   [Doubting] ─ looked at it from near, or blocked ─► [Choosing]
//!   [Choosing] ─ peers bar the way to where it would look from ─► [Barred] ─ waited ─► [Choosing]
//! ```
//!
//! Only ground known to be free is driven over; what stays unknown after some looks, each from elsewhere, is left: at first
//! after a few, and when nothing else is left to be seen, after some more. An exploration looks at last at what stands from all
//! sides. Who looks at what is judged by where the peers
//! say that they are going, of one that does not say it by its place and way. Deliberately absent: agreements. A goal is
//! said, not asked for: two that choose at once may choose alike for a moment.

mod doubting;
mod faces;
mod frontier_candidates;
mod known_frontiers;
mod look_history;
mod look_search;
mod peer_looks;
mod shadow;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{TileAddress, VehicleId};

use self::faces::Sweeps;
use self::frontier_candidates::{FrontierCandidate, Reach, hides_something, sees};
use self::known_frontiers::KnownFrontiers;
use self::look_history::{LookHistory, Rigour};
use self::look_search::{FoundLook, LookSearch, NoLook};
use self::peer_looks::{PeerLook, PeerLooks};
use super::{Behaviour, DriveRoute, MissionContext, MissionInput, MissionStep, RouteRoom};
use crate::geom::{Angle, Cell, Point};
use crate::map::{CellRect, OccupancyGrid};
use crate::node::VehicleSettings;
use crate::node::mission::doubts::Doubts;
use crate::node::mission::terrain::{OpenGround, ReachedGround, Terrain, is_small};
use crate::node::mission::{EndReason, look_around};
use crate::node::peers::{GoalPurpose, Peer};
use crate::time::Time;

/// The vehicle goes this much nearer to what it looks at than it must keep from it, metres; when it cannot, it looks
/// from as near as it can.
const NEARER_M: f64 = 0.5;
/// What is this near to an object is searched first, metres.
const NEAR_OBJECT_M: f64 = 1.5;
/// By so much farther ways a search goes to what is near to objects, metres.
const OBJECT_BONUS_M: f64 = 8.0;
/// What a peer is going to see is looked at only when nothing else is left, metres.
const PEER_PENALTY_M: f64 = 1e4;
/// A peer that is nearer to something than this share of its own way there gets it.
const PEER_SHARE: f64 = 0.9;
/// What a peer has more way to than this is not left to it, metres.
const PEER_M: f64 = 12.0;
/// What is this near to where a peer is going is the same goal, metres: one of the two has it.
const SAME_GOAL_M: f64 = 2.0;
/// Ways that differ by less are equal, metres: both must judge alike, by numbers that were rounded on the way.
const EQUAL_M: f64 = 0.1;
/// Who has no way known to more than this share of the ground that might be reached has not explored it. Of explorations of the
/// bundled places 0.11 was left at most, mostly less than 0.01; by vehicles that see no way anywhere 0.95 and more.
const UNSEEN_SHARE: f64 = 0.25;
/// Peers for which it waited in vain are not waited for again for this long, unless it has got on.
const PEERS_STAY: std::time::Duration = std::time::Duration::from_secs(180);
/// A peer that has not moved for this long is not going anywhere.
const PEER_GOES: std::time::Duration = std::time::Duration::from_secs(30);

/// What is rather looked at.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(crate) enum Preference {
    /// What is near to objects: a search.
    NearObjects,
    /// What no peer is going to see anyway; what peers look at counts as looked at: an exploration.
    FarFromPeers,
}

impl Preference {
    /// Returns how thoroughly it looks, one after the other: a search wants to know what stands there, an exploration
    /// where all of it ends.
    fn rigours(self) -> &'static [Rigour] {
        match self {
            Preference::NearObjects => &[Rigour::Quick],
            Preference::FarFromPeers => &[Rigour::Quick, Rigour::Thorough, Rigour::Faces],
        }
    }
}

/// How far it is with the look that comes next.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
enum Stage {
    /// It has not looked around where it begins.
    Fresh,
    Choosing,
    /// On its way to where this cell can be seen.
    Going(Cell),
    /// On its way to where the face behind this cell is met from in front.
    Facing(Cell),
    /// On its way to where this cell, which may bar the way and may not, can be looked at from near.
    Doubting(Cell),
    /// Peers bar the way to where it would look from: it waits for them.
    Barred(Point),
}

/// A search or an exploration.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Seek {
    settings: VehicleSettings,
    prefers: Preference,
    stage: Stage,
    looks: LookHistory,
    /// From where faces were looked at.
    face_looks: LookHistory,
    /// From where beams have swept.
    sweeps: Sweeps,
    /// How thoroughly it looks now.
    rigour: Rigour,
    /// The frontiers that were sought in vain before a face was looked at, ascending.
    sought_in_vain: Vec<Cell>,
    /// What may bar the way, and was looked at from near.
    doubts: Doubts,
    #[serde(skip)]
    frontiers: KnownFrontiers,
    /// What peers look at.
    peer_looks: PeerLooks,
    /// When it last waited for peers in vain, if it has not got on since.
    waited_in_vain: Option<Time>,
}

impl Behaviour for Seek {
    fn next(&mut self, seen: MissionInput, around: &MissionContext<'_>) -> MissionStep {
        match (seen, self.stage) {
            (MissionInput::Ready, Stage::Fresh) => {
                self.stage = Stage::Choosing;
                MissionStep::LookAround
            }
            (
                MissionInput::Ready,
                Stage::Choosing
                | Stage::Going(_)
                | Stage::Facing(_)
                | Stage::Doubting(_)
                | Stage::Barred(_),
            ) => self.choose(around),
            (MissionInput::UnderWay, Stage::Going(cell))
                if !self.is_frontier(around.terrain, cell) =>
            {
                self.choose(around)
            }
            (
                MissionInput::UnderWay | MissionInput::Autopilot(_),
                Stage::Fresh
                | Stage::Choosing
                | Stage::Going(_)
                | Stage::Facing(_)
                | Stage::Doubting(_)
                | Stage::Barred(_),
            ) => MissionStep::GoOn,
            (MissionInput::Arrived, Stage::Going(cell)) => MissionStep::LookAt(cell),
            (MissionInput::Arrived, Stage::Facing(cell)) => MissionStep::LookAtFace(cell),
            (MissionInput::Arrived, Stage::Doubting(cell)) => {
                self.doubts
                    .note(self.settings.lattice, cell, around.pose.at);
                MissionStep::LookClosely(cell)
            }
            (MissionInput::Arrived, Stage::Fresh | Stage::Choosing | Stage::Barred(_)) => {
                MissionStep::Think
            }
            (MissionInput::Blocked(_), Stage::Going(cell)) => {
                self.looks.note(&[cell], around.pose.at);
                MissionStep::TryAgain
            }
            (MissionInput::Blocked(_), Stage::Facing(cell)) => {
                self.face_looks.note(&[cell], around.pose.at);
                MissionStep::TryAgain
            }
            (MissionInput::Blocked(_), Stage::Doubting(cell)) => {
                self.doubts
                    .note(self.settings.lattice, cell, around.pose.at);
                MissionStep::TryAgain
            }
            (MissionInput::Blocked(_), Stage::Fresh | Stage::Choosing | Stage::Barred(_)) => {
                MissionStep::TryAgain
            }
            (MissionInput::Looked { from, toward, at }, stage) => {
                self.sweeps
                    .look(self.settings.vehicle, around.now, from, toward);
                match stage {
                    Stage::Facing(cell) => self.face_looks.note(&[cell], from),
                    Stage::Fresh
                    | Stage::Choosing
                    | Stage::Going(_)
                    | Stage::Doubting(_)
                    | Stage::Barred(_) => {
                        if at.is_some() {
                            self.note_look(around.terrain, from, toward, at);
                        }
                    }
                }
                MissionStep::Think
            }
        }
    }

    fn goal(&self) -> Option<Point> {
        match self.stage {
            Stage::Fresh | Stage::Choosing => None,
            Stage::Going(cell) | Stage::Facing(cell) | Stage::Doubting(cell) => {
                Some(self.settings.lattice.centre(cell))
            }
            Stage::Barred(from) => Some(from),
        }
    }

    fn give_up(&self) -> EndReason {
        EndReason::NoRoom
    }

    fn goes_on_without(&mut self, now: Time) -> bool {
        let goes_on = matches!(self.stage, Stage::Barred(_)) && !self.peers_stay(now);
        if goes_on {
            self.waited_in_vain = Some(now);
        }
        goes_on
    }

    fn tile_changed(&mut self, address: TileAddress) {
        self.frontiers.tile_changed(address);
    }

    /// Notes what it sees on its way, and what peers look at, so that it is not looked at by all of them in vain.
    fn watch(&mut self, around: &MissionContext<'_>) {
        if self.prefers != Preference::FarFromPeers {
            return;
        }
        self.note_sweeps(around);
        let dwell = look_around::dwell(&self.settings.look);
        for (id, peer) in around.peers.iter() {
            if !peer.resting || around.now.since(peer.moved_at) < dwell {
                continue;
            }
            let Some(PeerLook {
                from,
                toward,
                closely,
            }) = self.peer_looks.take(around.now, id, peer)
            else {
                continue;
            };
            self.note_look(around.terrain, from, toward, None);
            if let Some(at) = closely {
                let search = around.terrain.search(around.now, around.pose);
                self.doubts.note_peers(&search, at, from);
            }
        }
    }
}

impl Seek {
    /// Makes a mission that has seen nothing.
    pub(crate) fn new(settings: &VehicleSettings, prefers: Preference) -> Seek {
        Seek {
            settings: settings.clone(),
            prefers,
            stage: Stage::Fresh,
            looks: LookHistory::new(settings.lattice),
            face_looks: LookHistory::new(settings.lattice),
            sweeps: Sweeps::default(),
            rigour: Rigour::Quick,
            sought_in_vain: Vec::new(),
            doubts: Doubts::default(),
            frontiers: KnownFrontiers::default(),
            peer_looks: PeerLooks::default(),
            waited_in_vain: None,
        }
    }

    /// Notes that the beams of all vehicles sweep from where these are; peers are taken to have a sensor like its own.
    fn note_sweeps(&mut self, around: &MissionContext<'_>) {
        let (settings, now) = (&self.settings, around.now);
        let (own, pose) = (settings.vehicle, around.pose);
        let mut note = |id, at, heading| self.sweeps.note((id, &settings.look), now, at, heading);
        note(own, pose.at, pose.heading);
        for (id, peer) in around.peers.iter() {
            note(id, peer.at, peer.heading);
        }
    }

    /// Chooses the next look, or ends.
    fn choose(&mut self, around: &MissionContext<'_>) -> MissionStep {
        self.stage = Stage::Choosing;
        self.frontiers.update(around.terrain.map(), &self.settings);
        let occupancy = self.occupancy(around);
        let claims = around.claims();
        let search = around.terrain.search(around.now, around.pose);
        let reach = self.reach(search.keep_m());
        let mut ways = LookSearch::new(&search, &occupancy, &claims, reach);
        let mut in_vain = Vec::new();
        // From face to face what is unknown is not sought again everywhere, unless there is something new.
        let is_old = |cell: Cell| self.sought_in_vain.binary_search(&cell).is_ok();
        if self.rigour == Rigour::Faces && self.frontiers.cells(0).all(is_old) {
            let faces = self.rated(around, &occupancy);
            if let Ok(found) = ways.best(&self.face_looks, Rigour::Faces, &faces) {
                return self.go_and_look(around, found);
            }
        }
        for rigour in self.prefers.rigours().iter().copied() {
            self.rigour = rigour;
            let candidates = self.rated(around, &occupancy);
            match ways.best(self.looks_of(rigour), rigour, &candidates) {
                Ok(found) => {
                    self.sought_in_vain = match rigour {
                        Rigour::Quick | Rigour::Thorough => Vec::new(),
                        Rigour::Faces => sorted(self.frontiers.cells(0).collect()),
                    };
                    return self.go_and_look(around, found);
                }
                Err(NoLook::TooLarge) => return MissionStep::End(EndReason::TooLarge),
                Err(NoLook::InVain) => in_vain.push((rigour, candidates)),
            }
        }
        // For faces alone nobody waits.
        in_vain.retain(|(rigour, _)| *rigour != Rigour::Faces);
        // Peers bar what would be seen without them, on the same ways.
        let gone = around.peers.claims_of_gone(around.now);
        if gone.len() < claims.len() && !self.peers_stay(around.now) {
            let mut alone = LookSearch::new(&search, &occupancy, &gone, reach);
            let seen = in_vain.iter().find_map(|(rigour, sought)| {
                alone.best(self.looks_of(*rigour), *rigour, sought).ok()
            });
            if let Some(FoundLook { look, ground, .. }) = seen {
                let from = ground.grid.lattice().centre(look.from);
                // What may bar the way where it stands can be looked at meanwhile: a peer may wait for that.
                let near = ways.into_finely();
                let look = near.and_then(|near| self.doubts.look_meanwhile(&search, near, &claims));
                return match look {
                    Some(look) => self.look_closely(&search, look),
                    None => self.wait_for_peers(from),
                };
            }
        }
        if search.regards_reflex() {
            let all = search.but_for_reflex().open_finely(&claims);
            let is_worth_a_wait = |all: &OpenGround| {
                let is_cut_off = match ways.finely() {
                    Some(near) => near.is_cut_off_from(all),
                    None => search.is_cut_off_from(all, &claims),
                };
                let is_seen = |(rigour, sought): &(Rigour, Vec<_>)| {
                    ways.is_any_seen(self.looks_of(*rigour), *rigour, sought, all)
                };
                is_cut_off || in_vain.iter().any(is_seen)
            };
            if all.as_ref().is_some_and(is_worth_a_wait) {
                return MissionStep::Wait;
            }
        }
        let finely = ways.into_finely();
        self.doubt(around.now, &search, finely, (&claims, &gone))
    }

    fn go_and_look(&mut self, around: &MissionContext<'_>, found: FoundLook) -> MissionStep {
        let FoundLook {
            look,
            ground: ReachedGround { grid, ways },
            is_narrow,
        } = found;
        let (from, lattice) = (around.pose.at, grid.lattice());
        let (stage, step, looks) = match self.rigour {
            Rigour::Quick | Rigour::Thorough => (
                Stage::Going(look.at),
                MissionStep::LookAt(look.at),
                &mut self.looks,
            ),
            Rigour::Faces => (
                Stage::Facing(look.at),
                MissionStep::LookAtFace(look.at),
                &mut self.face_looks,
            ),
        };
        self.waited_in_vain = None;
        if look.from == lattice.cell_at(from) {
            self.stage = stage;
            return step;
        }
        let to = lattice.centre(look.from);
        let Some(route) = ways.route_to(&grid, from, to) else {
            looks.note(&[look.at], to);
            return MissionStep::Think;
        };
        self.stage = stage;
        MissionStep::GoAlong(DriveRoute {
            corners: route.points[1..].to_vec(),
            room: RouteRoom::searched(is_narrow),
        })
    }

    /// Returns from how far away to look: nothing is looked at from where it is not surely seen.
    fn reach(&self, keep_m: f64) -> Reach {
        let far_m = self.settings.look.sure_range_m;
        Reach {
            near_m: (keep_m + NEARER_M).min(far_m),
            far_m,
        }
    }

    /// Returns all frontier cells that are worth another look.
    fn candidates(&self) -> Vec<FrontierCandidate> {
        let lattice = self.settings.lattice;
        let least = (self.rigour.frontier_m() / lattice.cell_m())
            .round()
            .max(1.0) as usize;
        self.frontiers
            .cells(least)
            .filter(|cell| !self.looks.is_spent(*cell, self.rigour))
            .map(|cell| FrontierCandidate {
                cell,
                at: lattice.centre(cell),
                penalty_m: 0.0,
                normal: None,
            })
            .collect()
    }

    /// Returns the faces that are worth another look.
    fn faces(&self, occupancy: &OccupancyGrid) -> Vec<FrontierCandidate> {
        let settings = &self.settings;
        let mut faces = self.sweeps.unmet(
            &settings.look,
            &settings.fence,
            occupancy,
            settings.lattice,
            settings.look.sure_range_m,
        );
        faces.retain(|one| !self.face_looks.is_spent(one.cell, Rigour::Faces));
        faces
    }

    /// Returns from where what such looks look at was looked at.
    fn looks_of(&self, rigour: Rigour) -> &LookHistory {
        match rigour {
            Rigour::Quick | Rigour::Thorough => &self.looks,
            Rigour::Faces => &self.face_looks,
        }
    }

    /// Returns whether a cell is still a frontier.
    fn is_frontier(&mut self, terrain: &Terrain, cell: Cell) -> bool {
        self.frontiers.update(terrain.map(), &self.settings);
        self.frontiers.contains(cell)
    }

    /// Returns what is known of the cells of the fence, and of that in which the vehicle is.
    fn occupancy(&self, around: &MissionContext<'_>) -> OccupancyGrid {
        let (lattice, corners) = (self.settings.lattice, self.settings.fence.corners());
        let here = lattice.cell_at(around.pose.at);
        let here = CellRect::new(here, here);
        let fenced = CellRect::around(lattice, corners, 0.0).map(|fenced| fenced.join(here));
        // What is too large is not searched either.
        let area = fenced.filter(is_small).unwrap_or(here);
        let map = around.terrain.map();
        map.view(self.settings.slice, area).occupancy_grid(area)
    }

    /// Returns what is worth a look, and what is rather looked at.
    fn rated(
        &self,
        around: &MissionContext<'_>,
        occupancy: &OccupancyGrid,
    ) -> Vec<FrontierCandidate> {
        let near_cells = (NEAR_OBJECT_M / self.settings.lattice.cell_m()).ceil() as i32;
        let mut candidates = match self.rigour {
            Rigour::Quick | Rigour::Thorough => self.candidates(),
            Rigour::Faces => self.faces(occupancy),
        };
        if self.rigour == Rigour::Thorough {
            candidates.retain(|one| hides_something(occupancy, one.cell));
        }
        for one in &mut candidates {
            one.penalty_m = match self.prefers {
                Preference::NearObjects if has_a_peers_goal(around, one.at) => PEER_PENALTY_M,
                Preference::NearObjects if occupancy.has_occupied_around(one.cell, near_cells) => {
                    -OBJECT_BONUS_M
                }
                Preference::FarFromPeers if is_a_peers(around, one.at) => PEER_PENALTY_M,
                Preference::NearObjects | Preference::FarFromPeers => 0.0,
            };
        }
        candidates
    }

    /// Notes a look from a place along a heading at everything unknown that it covered, and at one cell surely.
    fn note_look(&mut self, terrain: &Terrain, from: Point, heading: Angle, at: Option<Cell>) {
        let look = &self.settings.look;
        let widest_rad = look
            .beams
            .iter()
            .map(|beam| beam.radians().abs())
            .fold(0.0, f64::max);
        let half_rad = widest_rad + 0.5 * look.half_angle.radians();
        let reach_m = look.sure_range_m;
        let lattice = self.settings.lattice;
        let Some(area) = CellRect::around(lattice, &[from], reach_m) else {
            return;
        };
        self.frontiers.update(terrain.map(), &self.settings);
        let view = terrain.map().view(self.settings.slice, area);
        let occupancy = view.occupancy_grid(area);
        let is_covered = |one: &FrontierCandidate| {
            let off = from.angle_to(one.at) - heading;
            one.at.distance_to(from) <= reach_m
                && off.radians().abs() <= half_rad
                && sees(&occupancy, lattice, from, one.at)
        };
        let covered = self
            .candidates()
            .into_iter()
            .filter(is_covered)
            .map(|one| one.cell);
        let cells: Vec<Cell> = covered.chain(at).collect();
        self.looks.note(&cells, from);
    }
}

fn sorted(mut cells: Vec<Cell>) -> Vec<Cell> {
    cells.sort_unstable();
    cells
}

/// What a peer is about to do, as far as that is known.
enum PeerAim {
    /// It says where it is going; its way there, metres.
    Goal(Point, f64),
    /// It does not say it; this is where the way ends that it is committed to.
    WayEnd(Point),
}

/// Returns what those peers are about to do that go somewhere, but not home; one that waits for others does nothing yet.
fn aims<'a>(around: &'a MissionContext<'_>) -> impl Iterator<Item = (VehicleId, PeerAim)> + 'a {
    let goes =
        |peer: &Peer| around.now.since(peer.moved_at) <= PEER_GOES && !peer.is_silent(around.now);
    let aim = |peer: &Peer| match peer.goal(around.now) {
        Some(goal) if goal.waits => None,
        Some(goal) if goal.purpose == GoalPurpose::Home => None,
        Some(goal) => Some(PeerAim::Goal(goal.at, peer.at.distance_to(goal.at))),
        None => peer.claim.last().copied().map(PeerAim::WayEnd),
    };
    let peers = around.peers.iter().filter(move |(_, peer)| goes(peer));
    peers.filter_map(move |(id, peer)| Some((id, aim(peer)?)))
}

/// Returns whether a place is where a peer is going that has less way there; of two with equal ways the lower id has it.
fn has_a_peers_goal(around: &MissionContext<'_>, at: Point) -> bool {
    aims(around).any(|(id, aim)| match aim {
        PeerAim::Goal(goal, way_m) => is_taken(around, at, (id, goal, way_m)),
        PeerAim::WayEnd(_) => false,
    })
}

fn is_taken(
    around: &MissionContext<'_>,
    at: Point,
    (id, goal, way_m): (VehicleId, Point, f64),
) -> bool {
    let own_m = around.pose.at.distance_to(at);
    let is_lower = id < around.peers.own();
    let comes_first = way_m < own_m - EQUAL_M || (way_m <= own_m + EQUAL_M && is_lower);
    goal.distance_to(at) <= SAME_GOAL_M && comes_first
}

/// Returns whether a peer is going to see a place anyway: it goes there, or comes there sooner by way of its goal.
fn is_a_peers(around: &MissionContext<'_>, at: Point) -> bool {
    let own_m = around.pose.at.distance_to(at);
    let comes_sooner = |way_m: f64| way_m < (PEER_SHARE * own_m).min(PEER_M);
    aims(around).any(|(id, aim)| match aim {
        PeerAim::Goal(goal, way_m) if goal.distance_to(at) <= SAME_GOAL_M => {
            is_taken(around, at, (id, goal, way_m))
        }
        PeerAim::Goal(goal, way_m) => comes_sooner(way_m + goal.distance_to(at)),
        PeerAim::WayEnd(end) => comes_sooner(end.distance_to(at)),
    })
}

#[cfg(test)]
mod tests;
