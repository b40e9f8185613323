//! What a vehicle may be out for when the ground station does not plan for it: one type and one file per kind of mission.
//! Each is told what is seen and says the next step. How a step is carried out, how room is made for peers and how the
//! vehicle goes home is the same for all kinds: see `runner`.
//!
//! Adding a kind: its declaration in `proto/src/message/task.rs` (how it travels, its word, its parameters), its file here,
//! and its lines in the lists below. The rest follows from these three.
//!
//! Deliberately absent: commands. A kind neither drives nor waits by itself, and knows of no order.

mod browse;
mod pathfind;
mod patrol;
mod seek;
mod stored;
mod straight;

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Position, TaskKind, TileAddress};

use self::browse::Browse;
use self::pathfind::Pathfind;
use self::patrol::Patrol;
use self::seek::{Preference, Seek};
use self::stored::Stored;
use self::straight::Straight;
use super::EndReason;
use super::obstruction::Obstruction;
use super::terrain::Terrain;
use crate::autopilot::{Item, StoredProgress};
use crate::geom::{Angle, Cell, Point, Pose};
use crate::node::VehicleSettings;
use crate::node::peers::Peers;
use crate::time::Time;

/// What a mission is told.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum MissionInput {
    /// Nothing is being done: the last step is over, or was interrupted.
    Ready,
    /// It is under way to where it said; told about once a second.
    UnderWay,
    /// It is where it said to go.
    Arrived,
    /// Something is in the way; the vehicle stands before it.
    Blocked(Obstruction),
    /// A look is over.
    Looked {
        /// From where it looked.
        from: Point,
        /// The heading that the look began with.
        toward: Angle,
        /// At what, unless it looked all around.
        at: Option<Cell>,
    },
    /// How far the autopilot is with the mission that it stores; `None` = the vehicle follows it no more.
    Autopilot(Option<StoredProgress>),
}

/// What a mission wants done next.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum MissionStep {
    /// What is being done goes on.
    GoOn,
    /// Nothing yet: it says a step when it has thought.
    Think,
    /// Go straight to a place of the mission.
    GoStraight(Point),
    /// Go to a place of the mission on a path around what is seen; what is unknown may be crossed. A place to which no
    /// way leads is passed over, see [`Behaviour::pass_over`].
    GoTo(Point),
    /// Go along a course, to where something can be looked at.
    GoAlong(DriveRoute),
    /// Look all around.
    LookAround,
    /// Look at one cell.
    LookAt(Cell),
    /// Look at one cell before a face of what stands.
    LookAtFace(Cell),
    /// Look from near at one cell that may bar the way.
    LookClosely(Cell),
    /// Something was in the way: wait, longer every time, and be ready then.
    TryAgain,
    /// Only peers are in the way: make room, or wait until they do, and be ready then.
    YieldToPeers,
    /// What is in the way is believed for a short time only: wait, and be ready then.
    Wait,
    /// Let the autopilot store a mission and carry it out.
    FollowStored {
        /// Its items; item 0 is home.
        items: Vec<Item>,
        /// The item that it begins with.
        from: usize,
    },
    /// The mission has ended: go home.
    End(EndReason),
    /// The mission has ended where the vehicle is: it stays there.
    EndHere(EndReason),
}

/// A way to drive as it is.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct DriveRoute {
    /// Its corners after where the vehicle is.
    pub corners: Vec<Point>,
    /// What is known of the room along it.
    pub room: RouteRoom,
}

/// What is known of the room along a route.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum RouteRoom {
    /// All that a vehicle keeps.
    Kept,
    /// Of some places only that the vehicle has driven there.
    DrivenBefore,
    /// It is the vehicle's own track, whatever the map shows there by now.
    OwnTrack,
}

impl RouteRoom {
    /// Returns the room along a route that was searched over the places driven too, or not.
    pub(super) fn searched(over_driven: bool) -> RouteRoom {
        match over_driven {
            true => RouteRoom::DrivenBefore,
            false => RouteRoom::Kept,
        }
    }
}

/// Why a place of a mission is passed over.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) enum PassedOver {
    /// No way leads there: all that can be reached was searched.
    NoWay,
    /// Something was in the way too often, although a way may lead there.
    GivenUp,
}

/// What a mission may look at when it decides.
pub(super) struct MissionContext<'a> {
    /// Now.
    pub now: Time,
    /// Where the vehicle is.
    pub pose: Pose,
    /// What is known of the world, and where the vehicle may be in it.
    pub terrain: &'a Terrain,
    /// The others.
    pub peers: &'a Peers,
}

impl MissionContext<'_> {
    /// Returns what peers claim, whether they move or not.
    pub(super) fn claims(&self) -> Vec<Vec<Point>> {
        self.peers
            .iter()
            .map(|(_, peer)| peer.claim.clone())
            .collect()
    }
}

/// A kind of mission: told what is seen, it says the next step. Every mission ends: a look is counted, a wait has a limit.
pub(super) trait Behaviour {
    /// Returns the next step.
    fn next(&mut self, seen: MissionInput, around: &MissionContext<'_>) -> MissionStep;

    /// Returns where it is going, or what it is going to see; `None` = nowhere yet.
    fn goal(&self) -> Option<Point>;

    /// Returns how the mission ends now that its peers have not made room for very long.
    fn give_up(&self) -> EndReason;

    /// Records that its peers have not made room for very long; returns whether it goes on without what they bar.
    fn goes_on_without(&mut self, _: Time) -> bool {
        false
    }

    /// Records that the place to which it wanted to go is passed over.
    fn pass_over(&mut self, _why: PassedOver) {}

    /// Records that a tile of the map has changed.
    fn tile_changed(&mut self, _address: TileAddress) {}

    /// Records where it and its peers are, before anything else is decided.
    fn watch(&mut self, _around: &MissionContext<'_>) {}
}

/// The list of all kinds.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) enum AnyBehaviour {
    /// Straight legs.
    Straight(Straight),
    /// A look around.
    Browse(Browse),
    /// Visits on paths around what is seen.
    Pathfind(Pathfind),
    /// A search, or an exploration.
    Seek(Box<Seek>),
    /// Rounds over places.
    Patrol(Patrol),
    /// What the autopilot stores.
    Stored(Box<Stored>),
}

impl AnyBehaviour {
    /// Makes the mission of a task; `None` when the ground station plans.
    pub(super) fn of(settings: &VehicleSettings) -> Option<AnyBehaviour> {
        let points =
            |places: &[Position]| places.iter().map(|at| Point::from(*at)).collect::<Vec<_>>();
        let metres = |length_mm: u32| f64::from(length_mm) / 1000.0;
        Some(match settings.task.as_ref()? {
            TaskKind::Sweep { .. } | TaskKind::ConfiguredSweep { .. } => return None,
            TaskKind::Legs { places } => AnyBehaviour::Straight(Straight::along(&points(places))),
            TaskKind::Forward { distance_mm } => {
                AnyBehaviour::Straight(Straight::ahead(metres(*distance_mm)))
            }
            TaskKind::Browse => AnyBehaviour::Browse(Browse::default()),
            TaskKind::Pathfind { places } => AnyBehaviour::Pathfind(Pathfind::to(&points(places))),
            TaskKind::Search => {
                AnyBehaviour::Seek(Box::new(Seek::new(settings, Preference::NearObjects)))
            }
            TaskKind::Explore => {
                AnyBehaviour::Seek(Box::new(Seek::new(settings, Preference::FarFromPeers)))
            }
            TaskKind::Patrol {
                places,
                rounds,
                duration_ms,
            } => {
                let rounds = (*rounds > 0).then_some(*rounds as usize);
                let duration =
                    (*duration_ms > 0).then(|| Duration::from_millis(u64::from(*duration_ms)));
                AnyBehaviour::Patrol(Patrol::over(&points(places), rounds, duration))
            }
            TaskKind::Stored { items, from } => {
                AnyBehaviour::Stored(Box::new(Stored::new(settings.home, items, *from)))
            }
        })
    }

    /// Returns how many places are still to be visited; a search has no list of places.
    pub(super) fn places_left(&self) -> usize {
        match self {
            AnyBehaviour::Straight(straight) => straight.places_left(),
            AnyBehaviour::Pathfind(pathfind) => pathfind.places_left(),
            AnyBehaviour::Patrol(patrol) => patrol.places_left(),
            AnyBehaviour::Stored(stored) => stored.places_left(),
            AnyBehaviour::Browse(_) | AnyBehaviour::Seek(_) => 0,
        }
    }

    /// Returns where it is going, or what it is going to see.
    pub(super) fn goal(&self) -> Option<Point> {
        match self {
            AnyBehaviour::Straight(straight) => straight.goal(),
            AnyBehaviour::Browse(browse) => browse.goal(),
            AnyBehaviour::Pathfind(pathfind) => pathfind.goal(),
            AnyBehaviour::Seek(seek) => seek.goal(),
            AnyBehaviour::Patrol(patrol) => patrol.goal(),
            AnyBehaviour::Stored(stored) => stored.goal(),
        }
    }

    /// Returns the mission, of whatever kind.
    pub(super) fn mission(&mut self) -> &mut dyn Behaviour {
        match self {
            AnyBehaviour::Straight(straight) => straight,
            AnyBehaviour::Browse(browse) => browse,
            AnyBehaviour::Pathfind(pathfind) => pathfind,
            AnyBehaviour::Seek(seek) => seek.as_mut(),
            AnyBehaviour::Patrol(patrol) => patrol,
            AnyBehaviour::Stored(stored) => stored.as_mut(),
        }
    }
}

#[cfg(test)]
pub(super) mod tests_support {
    //! A mission alone, without a vehicle that carries out what it says.

    use super::*;
    use crate::node::mission::ObstructionKind;
    use crate::node::tests_support::settings;

    /// Tells a mission of a vehicle at a place, facing along x, that knows nothing of the world; returns the next step.
    pub fn step(mission: &mut dyn Behaviour, seen: MissionInput, at: (f64, f64)) -> MissionStep {
        step_at(mission, seen, at, Time::ZERO)
    }

    /// The same at a time.
    pub fn step_at(
        mission: &mut dyn Behaviour,
        seen: MissionInput,
        at: (f64, f64),
        now: Time,
    ) -> MissionStep {
        let settings = settings(1);
        let peers = Peers::new(settings.vehicle);
        let terrain = Terrain::new(settings);
        let pose = Pose {
            at: Point::new(at.0, at.1),
            heading: Angle::default(),
            sd_m: 0.05,
        };
        mission.next(
            seen,
            &MissionContext {
                now,
                pose,
                terrain: &terrain,
                peers: &peers,
            },
        )
    }

    /// An obstacle of the map in the way.
    pub fn obstacle(x_m: f64, y_m: f64) -> Obstruction {
        Obstruction {
            at: Point::new(x_m, y_m),
            kind: ObstructionKind::Obstacle,
        }
    }

    /// The end of a look all around.
    pub const LOOKED: MissionInput = MissionInput::Looked {
        from: Point { x_m: 0.0, y_m: 0.0 },
        toward: Angle::ZERO,
        at: None,
    };
}
