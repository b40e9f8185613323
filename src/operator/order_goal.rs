//! What an operator is asked for, and what it says of it: plain values.

use std::collections::BTreeSet;
use std::fmt;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{OrderKind, RunId, TaskKind, VehicleId};

/// Names a want.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum GoalId {
    /// By hand; the number is given by whoever wants it.
    Hand(u32),
    /// The script's, counted from 0.
    Script(u32),
}

impl fmt::Display for GoalId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            GoalId::Hand(number) => write!(f, "want {number} by hand"),
            GoalId::Script(number) => write!(f, "want {number} of the script"),
        }
    }
}

/// What is wanted of vehicles.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct OrderGoal {
    /// What they shall do.
    pub kind: OrderKind,
    /// Which vehicles; empty = all.
    pub vehicles: BTreeSet<VehicleId>,
    /// In which run; `None` = the present one, or the next one if the want begins one.
    pub run: Option<RunId>,
    /// Whether a start begins a new run when the ground station is idle; otherwise it goes on with the present one.
    pub begins: bool,
    /// The mission that a start begins, as the task of a new run; `None` = what the run is already.
    pub mission: Option<MissionRequest>,
    /// Whether the lease is taken from whoever holds it; otherwise the one in force is joined.
    pub take_over: bool,
    /// These may be unheard when a start lifts emergency stops.
    pub although_unheard: BTreeSet<VehicleId>,
    /// Whether a start also lifts what stands for many stops.
    pub lifts_many: bool,
    /// When it is given up.
    pub within: Duration,
}

impl OrderGoal {
    /// Returns what is wanted of some vehicles, or of all if none is named, in the present run, joining the lease in force.
    pub fn new(kind: OrderKind, vehicles: BTreeSet<VehicleId>, within: Duration) -> OrderGoal {
        OrderGoal {
            kind,
            vehicles,
            run: None,
            begins: false,
            mission: None,
            take_over: false,
            although_unheard: BTreeSet::new(),
            lifts_many: false,
            within,
        }
    }
}

/// A mission that is wanted of whoever is started.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct MissionRequest {
    /// What is to be done.
    pub kind: TaskKind,
    /// The run that it is compared with; `None` = with none.
    pub compare_with: Option<RunId>,
}

/// An emergency stop that is wanted.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct StopRequest {
    /// Whom it stops; empty = all.
    pub vehicles: BTreeSet<VehicleId>,
    /// How long to watch whether they stop. What is given stays in force after that.
    pub within: Duration,
}
