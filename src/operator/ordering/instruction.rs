//! What one order is to bring about, and for whom. It sends nothing.

use std::collections::BTreeSet;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{EmergencyName, OrderKind, RunId, VehicleId};

use super::super::fleet_view::FleetView;
use super::super::order_goal::MissionRequest;
use crate::time::Time;

/// The stops that one start lifts at most.
pub(super) const ENDS_MAX: usize = 8;

/// What one ordering is to bring about, and what its operator knew before.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Instruction {
    /// What to do.
    pub kind: OrderKind,
    /// Whether a start begins a new run when the ground station is idle (otherwise it goes on with the present one).
    pub begins: bool,
    /// The mission that a start begins, as a run of its own; `None` = what the run is already.
    pub mission: Option<MissionRequest>,
    /// Whom it is for; empty = all.
    pub vehicles: BTreeSet<VehicleId>,
    /// When it is for all: who is known to be there without being heard.
    pub expected: BTreeSet<VehicleId>,
    /// In which run; `None` = as above.
    pub run: Option<RunId>,
    /// Whether a run that is under way is given up for the one that a start begins.
    pub ends_run: bool,
    /// Whether a lease is taken from whoever holds it.
    pub take_over: bool,
    /// Random id of this operator.
    pub holder: u64,
    /// Hash of the operator's venue file: who has another one does not listen to it.
    pub venue_hash: u64,
    /// These may be unheard when a start lifts emergency stops.
    pub although_unheard: BTreeSet<VehicleId>,
    /// Whether a start also lifts what stands for many stops.
    pub lifts_many: bool,
    /// When it is given up.
    pub timeout: Duration,
}

impl Instruction {
    /// Returns who must obey: those named, otherwise all who are expected, heard, or members of the ground station's sweep.
    pub(super) fn targets(&self, view: &FleetView, now: Time) -> BTreeSet<VehicleId> {
        if !self.vehicles.is_empty() {
            return self.vehicles.clone();
        }
        let members = view
            .ground(now)
            .map(|report| report.value.members.clone())
            .unwrap_or_default();
        let heard = view
            .vehicles()
            .filter(|(_, seen)| seen.state.is_some())
            .map(|(id, _)| id);
        let expected = self.expected.iter().copied();
        expected.chain(members).chain(heard).collect()
    }
}

/// Returns the names that a start ends, ascending: emergency stops, and the vehicle's take-over. A list that is full leaves
/// a stop to the next start.
pub(super) fn ended(
    stops: &[EmergencyName],
    take_over: Option<EmergencyName>,
) -> Vec<EmergencyName> {
    let most = ENDS_MAX - usize::from(take_over.is_some());
    let names: BTreeSet<EmergencyName> =
        stops.iter().copied().take(most).chain(take_over).collect();
    names.into_iter().collect()
}

/// Returns whether what came above an order may be the ground station bringing that about: it lets everyone hold who was
/// started.
pub(super) fn may_be_brought_about(ours: OrderKind, theirs: OrderKind) -> bool {
    (ours, theirs) == (OrderKind::Start, OrderKind::Hold)
}
