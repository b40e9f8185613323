//! What became of an order, for every vehicle that it was for.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    EmergencyName, EmergencyStop, Lease, MissionRefusal, OperatorId, Ordered, RunId, VehicleId,
};

use super::fleet_view::Incompatibility;
use super::names::ordered;
use super::order_goal::MissionMisfit;

/// How an order ended for one vehicle.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum VehicleOutcome {
    /// Its state shows the order, so long after it was first sent.
    Obeyed {
        /// From the first sending to the state that shows it.
        after: Duration,
        /// The ground station has gone on from there already.
        by_ground: bool,
    },
    /// It shows the emergency stop that was given, so long after anyone could be reached.
    Stopped {
        /// From when anyone could be reached to what shows it.
        after: Duration,
        /// Whether it has come to rest.
        is_at_rest: bool,
    },
    /// The emergency stop that was given is lifted again: somebody has started the vehicle, or may.
    StopLifted,
    /// An emergency stop is open that the order does not lift.
    UnderStop(EmergencyName),
    /// A higher order of somebody else came in between.
    Overruled(Ordered),
    /// It has obeyed a start that goes on with the mission of a run, of which it shows nothing: it has no part in it, or was started
    /// anew since.
    NoPart {
        /// From the order to the State that showed it.
        after: Duration,
        /// The run.
        run: RunId,
    },
    /// It has obeyed the start of a mission, and does not show that it is out for it.
    NotOut,
    /// It has obeyed the start of a mission, and does not begin it.
    Refused(MissionRefusal),
    /// It is heard, and has not obeyed in time.
    Ignored,
    /// Nothing was heard of it.
    Unheard,
    /// It does not listen to this operator, and was not sent the order.
    Foreign(Incompatibility),
    /// The operator wants something else of it since.
    Withdrawn,
}

impl VehicleOutcome {
    /// Returns whether the vehicle does what was wanted. One that shows a stop and moves still has not stopped.
    pub fn is_done(&self) -> bool {
        match self {
            VehicleOutcome::Obeyed { .. } | VehicleOutcome::NoPart { .. } => true,
            VehicleOutcome::Stopped {
                after: _,
                is_at_rest,
            } => *is_at_rest,
            VehicleOutcome::StopLifted
            | VehicleOutcome::UnderStop(_)
            | VehicleOutcome::Overruled(_)
            | VehicleOutcome::NotOut
            | VehicleOutcome::Refused(_)
            | VehicleOutcome::Ignored
            | VehicleOutcome::Unheard
            | VehicleOutcome::Foreign(_)
            | VehicleOutcome::Withdrawn => false,
        }
    }
}

/// What the vehicle does, to be read after its number.
impl fmt::Display for VehicleOutcome {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            VehicleOutcome::Obeyed { after, by_ground } => {
                write!(to, "has obeyed after {} ms", after.as_millis())?;
                match by_ground {
                    true => write!(to, "; the ground station has gone on from there"),
                    false => Ok(()),
                }
            }
            VehicleOutcome::Stopped { after, is_at_rest } => {
                let rests = if *is_at_rest { "stands" } else { "moves still" };
                let after_ms = after.as_millis();
                write!(to, "shows the stop after {after_ms} ms, {rests}")
            }
            VehicleOutcome::StopLifted => {
                write!(
                    to,
                    "stands under it no more: a start of an operator has lifted the stop"
                )
            }
            VehicleOutcome::UnderStop(name) => write!(
                to,
                "stands under emergency stop {name}, which this does not lift"
            ),
            VehicleOutcome::Overruled(by) => {
                let holder = by.lease.holder;
                write!(
                    to,
                    "is overruled by {} (holder {holder:016x})",
                    ordered(*by)
                )
            }
            VehicleOutcome::NoPart { after, run } => write!(
                to,
                "has obeyed after {} ms, but shows no mission of run {run}: it has no part in it, or was started anew since; \
                 start with a mission gives it one",
                after.as_millis()
            ),
            VehicleOutcome::NotOut => write!(to, "has started, but does not show the mission"),
            VehicleOutcome::Refused(why) => write!(to, "refuses the mission: {why}"),
            VehicleOutcome::Ignored => write!(to, "is heard, but has not obeyed"),
            VehicleOutcome::Unheard => write!(to, "is not heard"),
            VehicleOutcome::Foreign(misfit) => write!(to, "{misfit}"),
            VehicleOutcome::Withdrawn => write!(to, "was told something else since"),
        }
    }
}

/// Why an order is not sent at all.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error, Serialize, Deserialize)]
pub enum OrderRefusal {
    /// The ground station drives another run than the one that is to be started.
    #[error(
        "run {under_way} is under way: let it end before run {asked} begins, or give it up for that (--end-run)"
    )]
    UnderWay {
        /// The run that is driven.
        under_way: RunId,
        /// The run that was asked for.
        asked: RunId,
    },
    /// The mission that is begun lacks something of the ground station.
    #[error(transparent)]
    Mission(#[from] MissionMisfit),
    /// A start would lift emergency stops although a vehicle is not heard.
    #[error(
        "an emergency stop is open and vehicle {0} has not been heard for 2 s: name it with --although-unheard if the others are to be started all the same"
    )]
    Unheard(VehicleId),
    /// An emergency stop is open.
    #[error("emergency stop {0} is open: only a start lifts it")]
    StopOpen(EmergencyName),
    /// A start would lift an emergency stop that was given after it.
    #[error(
        "emergency stop {name} was given by operator {by} after this start: if it is to be lifted, give the start again"
    )]
    StoppedSince {
        /// Its name.
        name: EmergencyName,
        /// Who gave it.
        by: OperatorId,
    },
    /// The run that is to be started has ended.
    #[error(
        "run {0} has ended: a start without a run begins the next one, as does --run with a number above all that were"
    )]
    Ended(RunId),
}

/// What became of an order.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct OrderOutcome {
    /// By vehicle, ascending.
    pub vehicles: BTreeMap<VehicleId, VehicleOutcome>,
    /// The lease of the orders to those that were heard; `None` when nothing was sent.
    pub lease: Option<Lease>,
    /// Their run.
    pub run: Option<RunId>,
    /// Why nothing was sent, if it was refused.
    pub refused: Option<OrderRefusal>,
    /// The emergency stops that it lifts.
    pub lifts: Vec<EmergencyStop>,
}

impl OrderOutcome {
    /// Returns whether every vehicle has obeyed, and there is one.
    pub fn is_done(&self) -> bool {
        !self.vehicles.is_empty() && self.vehicles.values().all(|outcome| outcome.is_done())
    }

    /// Returns who has not obeyed, and why; empty when it is done.
    pub fn undone(&self) -> String {
        if let Some(refused) = self.refused {
            return refused.to_string();
        }
        let undone = self.vehicles.iter().filter(|(_, of)| !of.is_done());
        let all: Vec<String> = undone
            .map(|(id, of)| format!("vehicle {id} {of}"))
            .collect();
        if self.vehicles.is_empty() {
            "nobody is heard".to_owned()
        } else {
            all.join("; ")
        }
    }
}
