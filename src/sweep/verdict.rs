//! What a follower says of plans and of itself: verdicts, refusals, and what it waits for.

use std::fmt;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Revision, StopId, VehicleId};

use super::PlanError;

/// Why a complete newer revision was not adopted; the vehicle rests until a newer one fits.
#[derive(Clone, PartialEq, Debug, thiserror::Error, Serialize, Deserialize)]
pub enum PlanRefusal {
    /// The plans are not valid together.
    #[error("the plans of revision {revision} are not valid: {error}")]
    Invalid {
        /// Which revision.
        revision: Revision,
        /// What is wrong.
        error: PlanError,
    },
    /// The plan starts elsewhere.
    #[error("revision {revision} starts {distance_m:.2} m from where this vehicle rests")]
    Elsewhere {
        /// Which revision.
        revision: Revision,
        /// How far away, metres.
        distance_m: f64,
    },
    /// It has stops, and no empty revision was adopted since this vehicle's software started.
    #[error(
        "revision {revision} has stops, but this vehicle has restarted and adopts an empty one first"
    )]
    NotStopped {
        /// Which revision.
        revision: Revision,
    },
    /// This vehicle is not one of its members.
    #[error("revision {revision} is without this vehicle")]
    NotMember {
        /// Which revision.
        revision: Revision,
    },
}

/// What became of an offered plan.
#[derive(Clone, PartialEq, Debug)]
pub enum OfferResult {
    /// Of a revision that is older than, or the same as, the one followed: ignored.
    Old,
    /// Kept; the revision is not complete, or this vehicle does not rest yet.
    Unchanged,
    /// The revision is followed from now on.
    Adopted,
    /// The revision is complete but does not fit.
    Refused(PlanRefusal),
}

/// A call that the state does not allow; nothing was changed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum FollowError {
    /// The leg is not the next one, or may not be entered now.
    #[error("the leg to stop {0} may not be entered now")]
    NotYet(StopId),
    /// The stop is not the one whose leg is driven.
    #[error("stop {0} is not the one being driven to")]
    NotThere(StopId),
}

/// Why no leg may be entered now.
#[derive(Clone, PartialEq, Debug)]
pub enum WaitsFor {
    /// No revision is followed yet.
    Plans,
    /// A newer revision is known; until it is adopted no leg is entered.
    Revision {
        /// Which one.
        revision: Revision,
        /// Why it was refused, if it was.
        refusal: Option<PlanRefusal>,
    },
    /// This vehicle has not been heard to follow the same revision.
    Member {
        /// Who.
        vehicle: VehicleId,
    },
    /// This stop of another vehicle is not known to be done.
    Stop {
        /// Whose.
        vehicle: VehicleId,
        /// Which stop.
        stop: StopId,
    },
    /// The dwell at this stop has not ended.
    Dwell {
        /// Where.
        stop: StopId,
    },
    /// All stops are done (or their legs entered).
    Nothing,
}

impl fmt::Display for WaitsFor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            WaitsFor::Plans => f.write_str("waits for plans"),
            WaitsFor::Revision {
                revision,
                refusal: None,
            } => write!(f, "waits to adopt revision {revision}"),
            WaitsFor::Revision {
                refusal: Some(refusal),
                ..
            } => write!(f, "holds: {refusal}"),
            WaitsFor::Member { vehicle } => {
                write!(f, "waits for vehicle {vehicle} to follow the same revision")
            }
            WaitsFor::Stop { vehicle, stop } => {
                write!(f, "waits for stop {stop} of vehicle {vehicle}")
            }
            WaitsFor::Dwell { stop } => write!(f, "dwells at stop {stop}"),
            WaitsFor::Nothing => f.write_str("has driven its plan"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_waited_for_can_be_read() {
        let check = |waits: WaitsFor, expected: &str| assert_eq!(waits.to_string(), expected);
        check(
            WaitsFor::Stop {
                vehicle: VehicleId(2),
                stop: StopId(160),
            },
            "waits for stop 160 of vehicle 2",
        );
        let revision = Revision(3);
        let refusal = Some(PlanRefusal::Elsewhere {
            revision,
            distance_m: 1.25,
        });
        let text = "holds: revision 3 starts 1.25 m from where this vehicle rests";
        check(WaitsFor::Revision { revision, refusal }, text);
    }
}
