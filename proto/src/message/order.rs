//! What operators say: orders and emergency stops; missions are tasks ([`super::Task`]). Who wins when two contradict each
//! other is decided by lease, revision and name, and not here.

use serde::{Deserialize, Serialize};

use super::SeenState;
use crate::{EmergencyName, Lease, OperatorId, Revision, RunId, VehicleId};

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
        if other.strength() > self.strength() {
            other
        } else {
            self
        }
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

impl EmergencyStop {
    /// Returns whether it stops a vehicle.
    #[must_use]
    pub fn concerns(&self, vehicle: VehicleId) -> bool {
        match self.scope {
            StopScope::All => true,
            StopScope::One(one) => one == vehicle,
        }
    }
}

/// The emergency stops that a node knows. Nodes join what they hear by union, and lifted wins.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct OpenStops {
    /// Those in force, ascending by name, each once.
    pub open: Vec<EmergencyStop>,
    /// The names lifted last, the latest at the end, each once.
    pub lifted: Vec<EmergencyName>,
}
