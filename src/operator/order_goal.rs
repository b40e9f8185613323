//! What an operator is asked for, and what it says of it: plain values.

use std::collections::BTreeSet;
use std::fmt;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{GroundReport, MissionKind, OrderKind, RunId, TaskKind, VehicleId};

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
    /// Whether a run that is under way is given up for the one that a start begins; otherwise such a start is refused.
    pub ends_run: bool,
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
            ends_run: false,
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

/// What a mission lacks of a ground station.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error, Serialize, Deserialize)]
pub enum MissionMisfit {
    /// It is swept, and nobody plans it.
    #[error("a sweep is planned by a ground station, and none is heard")]
    NobodyPlans,
    /// It is compared with a run, and nobody does that.
    #[error("a ground station compares with run {0}, and none is heard")]
    NobodyCompares(RunId),
    /// The run that it is compared with goes on.
    #[error("compare_with: run {0} is not over yet")]
    NotOver(RunId),
    /// Nothing was measured in that run.
    #[error("compare_with: run {0} has no samples: nothing was measured")]
    NoSamples(RunId),
    /// There is no such run.
    #[error("compare_with: run {0} is none that the ground station has; its newest is run {1}")]
    NoRun(RunId, RunId),
}

impl MissionRequest {
    /// Judges it by what a ground station says, if one is heard: it plans sweeps, and compares with a run that is over and of
    /// which it has samples. It names its last runs only: an earlier one is taken as it is.
    ///
    /// # Errors
    /// What it lacks.
    pub fn judge(&self, ground: Option<&GroundReport>) -> Result<(), MissionMisfit> {
        let is_swept = MissionKind::from(&self.kind) == MissionKind::Sweep;
        let Some(report) = ground else {
            return match (is_swept, self.compare_with) {
                (true, _) => Err(MissionMisfit::NobodyPlans),
                (false, Some(run)) => Err(MissionMisfit::NobodyCompares(run)),
                (false, None) => Ok(()),
            };
        };
        let Some(wanted) = self.compare_with else {
            return Ok(());
        };
        let runs = &report.runs;
        match runs.iter().find(|run| run.run == wanted) {
            Some(run) if run.end.is_none() => Err(MissionMisfit::NotOver(wanted)),
            Some(run) if run.samples == 0 => Err(MissionMisfit::NoSamples(wanted)),
            Some(_) => Ok(()),
            None if runs.first().is_some_and(|first| wanted < first.run) => Ok(()),
            None => {
                let newest = runs.last().map_or(report.run, |run| run.run);
                Err(MissionMisfit::NoRun(wanted, newest))
            }
        }
    }
}

/// An emergency stop that is wanted.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct StopRequest {
    /// Whom it stops; empty = all.
    pub vehicles: BTreeSet<VehicleId>,
    /// How long to watch whether they stop. What is given stays in force after that.
    pub within: Duration,
}
