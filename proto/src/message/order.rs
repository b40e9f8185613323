//! What operators say: orders, emergency stops, tasks. Who wins when two contradict each other is decided by lease,
//! revision and name, and not here. All that the wire knows of a kind of mission stands here: parameters, bounds, word.

use serde::{Deserialize, Serialize};

use super::SeenState;
use crate::check::{COORDINATE_MAX_MM, Verdict, require};
use crate::{EmergencyName, Lease, OperatorId, Position, Revision, RunId, VehicleId};

/// Places of a task at most.
const PLACES_MAX: usize = 1000;

/// What an operator wants of a vehicle. What stops the whole swarm is no order: see [`EmergencyStop`].
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum OrderKind {
    /// Begin or go on with the mission.
    Start,
    /// Stand still, keep the mission.
    Hold,
    /// Go home.
    Return,
    /// Come down where it is.
    Land,
    /// Cut the motors at once, whatever falls; asked for separately and confirmed.
    CutMotors,
}

impl OrderKind {
    /// Returns how much it stops: of two orders of one right the stronger one counts. The order of the variants is that
    /// of the wire and says nothing about it.
    pub fn strength(self) -> u8 {
        match self {
            OrderKind::Start => 0,
            OrderKind::Hold => 1,
            OrderKind::Return => 2,
            OrderKind::Land => 3,
            OrderKind::CutMotors => 4,
        }
    }

    /// Returns the stronger of two.
    pub fn stronger(self, other: OrderKind) -> OrderKind {
        if other.strength() > self.strength() { other } else { self }
    }
}

/// An order, repeated until its effect shows in State.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Order {
    /// For whom.
    pub vehicle: VehicleId,
    /// By whose right.
    pub lease: Lease,
    /// In which run.
    pub run: RunId,
    /// The higher one wins once handled.
    pub revision: Revision,
    /// Newest state heard from the vehicle; `None` = it was never heard.
    pub seen: Option<SeenState>,
    /// What to do.
    pub kind: OrderKind,
    /// The emergency stops that a start lifts, ascending; empty for every other kind.
    pub ends: Vec<EmergencyName>,
}

/// Whom an emergency stop stops.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum StopScope {
    /// Every vehicle.
    All,
    /// This vehicle alone.
    One(VehicleId),
}

/// An emergency stop: once given it holds, for whomever hears of it, until its name is lifted.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub struct EmergencyStop {
    /// Its name.
    pub name: EmergencyName,
    /// Whom it stops.
    pub scope: StopScope,
    /// The operator that gave it.
    pub by: OperatorId,
}

/// The emergency stops that a node knows. Nodes join what they hear by union, and lifted wins.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Standing {
    /// Those in force, ascending by name, each once.
    pub open: Vec<EmergencyStop>,
    /// The names lifted last, the latest at the end, each once.
    pub lifted: Vec<EmergencyName>,
}

/// How the next stops of a sweep are chosen.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum SweepPlanner {
    /// All drive laps at a constant gap and measure while driving; the gap changes between laps.
    RotatingGap,
    /// One stands, the others drive.
    Fan,
    /// Each of two drives round to all points but the other's.
    Calibrate,
    /// One of two stands on a corner while the other drives the three sides before it.
    FanCorners,
    /// Two drive along opposite sides, then one along the two sides opposite to the other.
    FanStraight,
}

/// A mission with its parameters.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum TaskKind {
    /// Vehicles follow the plans of the ground station and measure.
    Sweep {
        /// How the stops are chosen.
        planner: SweepPlanner,
        /// Positions on the border of the area.
        positions: u16,
        /// Laps or rounds; `None` = as many as the planner needs.
        laps: Option<u16>,
        /// How long a vehicle stays at a stop, milliseconds.
        dwell_ms: u32,
        /// How long it stays at most while it waits for a partner, milliseconds.
        dwell_limit_ms: u32,
    },
    /// Straight from place to place, ending in front of what stands there. The members begin at different places: the
    /// first member at the first, the second at the second, and so on.
    Legs {
        /// The places, in order.
        places: Vec<Position>,
    },
    /// Straight ahead as each stands.
    Forward {
        /// How far, millimetres.
        distance_mm: u32,
    },
    /// Each looks around where it stands.
    Browse,
    /// Each looks at everything that it can get to, what is near to objects first.
    Search,
    /// The members share the places and visit them on paths around what they see.
    Pathfind {
        /// The places.
        places: Vec<Position>,
    },
    /// All together look at everything that can be reached.
    Explore,
}

impl From<&TaskKind> for MissionKind {
    fn from(task: &TaskKind) -> MissionKind {
        match task {
            TaskKind::Sweep { .. } => MissionKind::Sweep,
            TaskKind::Legs { .. } => MissionKind::Legs,
            TaskKind::Forward { .. } => MissionKind::Forward,
            TaskKind::Browse => MissionKind::Browse,
            TaskKind::Search => MissionKind::Search,
            TaskKind::Pathfind { .. } => MissionKind::Pathfind,
            TaskKind::Explore => MissionKind::Explore,
        }
    }
}

impl TaskKind {
    /// Returns why it is impossible, if it is.
    pub(crate) fn check(&self) -> Verdict {
        match self {
            TaskKind::Legs { places } | TaskKind::Pathfind { places } => {
                require((1..=PLACES_MAX).contains(&places.len()), "a task of places has 1 to 1000 of them")?;
                places.iter().try_for_each(Position::check)
            }
            TaskKind::Forward { distance_mm } => {
                require(*distance_mm < COORDINATE_MAX_MM.unsigned_abs(), "a distance ahead is under 1000 km")
            }
            TaskKind::Sweep { dwell_ms, dwell_limit_ms, .. } => {
                require(dwell_ms <= dwell_limit_ms, "a dwell is at most its limit")
            }
            TaskKind::Browse | TaskKind::Search | TaskKind::Explore => Ok(()),
        }
    }
}

/// What a vehicle is out for, without its parameters (see [`TaskKind`]).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
pub enum MissionKind {
    /// It follows the plans of the ground station and measures.
    #[default]
    Sweep,
    /// Straight from place to place.
    Legs,
    /// Straight ahead as it stands.
    Forward,
    /// It looks around where it stands.
    Browse,
    /// It looks at everything that it can get to.
    Search,
    /// It visits places on paths around what it sees.
    Pathfind,
    /// All vehicles together look at everything that can be reached.
    Explore,
}

impl MissionKind {
    /// Returns the word that people read.
    pub fn word(self) -> &'static str {
        match self {
            MissionKind::Sweep => "sweep",
            MissionKind::Legs => "legs",
            MissionKind::Forward => "forward",
            MissionKind::Browse => "browse",
            MissionKind::Search => "search",
            MissionKind::Pathfind => "pathfind",
            MissionKind::Explore => "explore",
        }
    }
}

/// A mission for some vehicles, given by an operator to them and to the ground station. It moves nobody: that takes an
/// order to start.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Task {
    /// By whose right.
    pub lease: Lease,
    /// The run that it is; another task is another run.
    pub run: RunId,
    /// Who takes part, ascending; at least one.
    pub members: Vec<VehicleId>,
    /// The run whose samples stand for the place without what is looked for; `None` = no such run.
    pub compare_with: Option<RunId>,
    /// What is to be done.
    pub kind: TaskKind,
}
