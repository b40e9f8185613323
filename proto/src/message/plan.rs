//! Plans, and how far a vehicle is with its plan or its mission.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::MissionKind;
use crate::{Boot, Lease, Permille, Position, Revision, RunId, StopId, VehicleId};

/// The newest State that was heard of a vehicle, so that it can judge by its own clock how old an order or a plan is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
pub struct SeenState {
    /// Start of the vehicle's software.
    pub boot: Boot,
    /// Sequence of the State.
    pub sequence: u64,
}

/// A position with what happens there and what it waits for.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Stop {
    /// Name of the stop, stable across revisions.
    pub id: StopId,
    /// Where it is.
    pub at: Position,
    /// Corners of the route that leads here from the stop before, without both ends.
    pub route: Vec<Position>,
    /// How long to stay, milliseconds; 0 = drive on.
    pub dwell_ms: u32,
    /// How long to stay at most when partners do not come, milliseconds.
    pub dwell_limit_ms: u32,
    /// Who should be at rest at the same time.
    pub partners: Vec<VehicleId>,
    /// Stops of others that must be done before the leg to this stop is entered.
    pub after: Vec<(VehicleId, StopId)>,
}

/// The whole list of stops of one vehicle.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Plan {
    /// Whose plan.
    pub vehicle: VehicleId,
    /// Of which run.
    pub run: RunId,
    /// Of which revision; all vehicles' plans of a revision belong together.
    pub revision: Revision,
    /// By whose right; a vehicle follows no plan of a lower lease than the highest it has heard.
    pub lease: Lease,
    /// Newest state heard from the vehicle; `None` = it was never heard.
    pub seen: Option<SeenState>,
    /// Every vehicle of the revision, ascending; it is complete when all their plans are there.
    pub members: Vec<VehicleId>,
    /// Where the vehicle must stand to begin.
    pub start: Position,
    /// The stops, in order.
    pub stops: Vec<Stop>,
}

/// How far a vehicle is with its plan.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
pub struct Progress {
    /// Of which run.
    pub run: RunId,
    /// The revision it follows.
    pub revision: Revision,
    /// Last stop done of this revision.
    pub done: Option<StopId>,
    /// The stop whose leg it has entered, if any.
    pub leg: Option<StopId>,
}

/// What a vehicle does for its mission now.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
pub enum MissionPhase {
    /// It waits for a start, or for its plans.
    #[default]
    Waiting,
    /// It chooses where to go next.
    Choosing,
    /// It is on its way to its goal.
    Going,
    /// It stays at a stop, for its dwell or for its partners.
    Dwelling,
    /// It looks at something.
    Looking,
    /// It waits for its peers, or makes room for them.
    Yielding,
    /// It stands and does not go on by itself.
    Held,
    /// It is on its way home, or waits for its turn.
    Returning,
    /// The mission has ended and nothing is left to do.
    Over,
}

/// How a mission ended.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum MissionEnd {
    /// Everything was done.
    Done,
    /// It stopped in front of something.
    Stopped,
    /// No way leads to so many of its places; the others were visited.
    NoWay(u16),
    /// So many of its places were given up although a way may lead there.
    GaveUp(u16),
    /// It was never begun.
    Refused(MissionRefusal),
}

/// Why a vehicle does not begin a mission.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum MissionRefusal {
    /// It lacks what the mission needs.
    NotCapable,
    /// It has a run under way.
    Busy,
    /// A place, or its way there, lies outside the fence.
    OutsideFence,
    /// The task names no place for this vehicle.
    NoPlace,
    /// The plans are not valid together, or do not begin where it stands.
    BadPlans,
    /// The autopilot does not take the mission.
    Autopilot,
}

impl fmt::Display for MissionRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            MissionRefusal::NotCapable => "it lacks what the mission needs",
            MissionRefusal::Busy => "it has a run under way",
            MissionRefusal::OutsideFence => "a place lies outside the fence",
            MissionRefusal::NoPlace => "the task names no place for it",
            MissionRefusal::BadPlans => "its plans are not valid",
            MissionRefusal::Autopilot => "its autopilot does not take it",
        })
    }
}

impl fmt::Display for MissionEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MissionEnd::Done => f.write_str("done"),
            MissionEnd::Stopped => f.write_str("stopped"),
            MissionEnd::NoWay(places) => write!(f, "no way to {places}"),
            MissionEnd::GaveUp(places) => write!(f, "gave up {places}"),
            MissionEnd::Refused(why) => write!(f, "refused: {why}"),
        }
    }
}

/// How far a vehicle is with its mission.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct MissionProgress {
    /// Who speaks.
    pub vehicle: VehicleId,
    /// Start of its software.
    pub boot: Boot,
    /// How far it is with its plan; of a mission of its own only the run is said.
    pub progress: Progress,
    /// What it is out for.
    pub kind: MissionKind,
    /// What it does for it now.
    pub phase: MissionPhase,
    /// Share of the mission that is done; `None` = not known.
    pub share: Option<Permille>,
    /// Places, or stops of a plan, that are still to be visited.
    pub places_left: u16,
    /// Where it is going: the place that its mission wants to come to, or the middle of what it is going to look at, also
    /// while it waits for something; its home once the mission has ended; of a plan the end of the legs that it has entered.
    /// `None` = nowhere.
    pub goal: Option<Position>,
    /// Altitude slice that it moves in.
    pub slice: i16,
    /// How the mission ended; `None` = it has not.
    pub end: Option<MissionEnd>,
    /// Whether it stands at its home.
    pub is_at_home: bool,
    /// Number of the greatest lease of the orders and plans that it was given: who takes a lease takes a higher one.
    pub lease_number: u32,
}
