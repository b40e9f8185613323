//! What can be wrong with plans, and with the wish for a sweep.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Revision, RunId, StopId, VehicleId};

/// Why a set of plans cannot be driven.
#[derive(Clone, PartialEq, Debug, thiserror::Error, Serialize, Deserialize)]
pub enum PlanError {
    /// There is no plan at all.
    #[error("no plans")]
    Empty,
    /// Two plans are of different runs, revisions or member lists.
    #[error(
        "plan of vehicle {vehicle} does not belong to run {run} revision {revision} with the same members"
    )]
    Mixed {
        /// Whose plan differs.
        vehicle: VehicleId,
        /// Run of the first plan.
        run: RunId,
        /// Revision of the first plan.
        revision: Revision,
    },
    /// Members are not ascending, or not exactly the vehicles of the plans.
    #[error(
        "members must be the vehicles of the plans, ascending, each once; vehicle {vehicle} does not fit"
    )]
    Members {
        /// Who does not fit.
        vehicle: VehicleId,
    },
    /// A stop id occurs twice in a plan.
    #[error("stop {stop} occurs twice in the plan of vehicle {vehicle}")]
    Repeated {
        /// Whose plan.
        vehicle: VehicleId,
        /// Which stop.
        stop: StopId,
    },
    /// A stop waits for one that no plan has, or for one of its own plan.
    #[error(
        "stop {stop} of vehicle {vehicle} waits for stop {after} of vehicle {of}, which no other plan has"
    )]
    UnknownStop {
        /// Whose plan.
        vehicle: VehicleId,
        /// Which stop.
        stop: StopId,
        /// Whose stop it waits for.
        of: VehicleId,
        /// What it waits for.
        after: StopId,
    },
    /// Some stops wait for each other in a circle.
    #[error("stops wait for each other in a circle, among them stop {stop} of vehicle {vehicle}")]
    Circle {
        /// Whose plan.
        vehicle: VehicleId,
        /// A stop that can never be entered.
        stop: StopId,
    },
    /// The order of legs does not name every leg exactly once.
    #[error("the order of legs names {named} legs of vehicle {vehicle}, its plan has {planned}")]
    Sequence {
        /// Whose legs.
        vehicle: VehicleId,
        /// How many the order names.
        named: usize,
        /// How many the plan has.
        planned: usize,
    },
    /// Two vehicles can come too close.
    #[error(
        "vehicle {vehicle} on the leg to {} can come within {distance_m:.3} m of vehicle {other} at {}, \
         expected {separation_m:.3} m",
        name(.stop), name(.at)
    )]
    TooClose {
        /// Who drives (or stands at its start).
        vehicle: VehicleId,
        /// To which stop; `None` = standing at its start.
        stop: Option<StopId>,
        /// Who is in the way.
        other: VehicleId,
        /// On the leg to, or at, which stop; `None` = its start.
        at: Option<StopId>,
        /// How close, metres.
        distance_m: f64,
        /// How far apart they must be, metres.
        separation_m: f64,
    },
}

fn name(stop: &Option<StopId>) -> String {
    stop.map_or_else(|| "its start".to_owned(), |stop| format!("stop {stop}"))
}

/// Why no sweep can be planned.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum SweepError {
    /// There is no such pattern.
    #[error(transparent)]
    Pattern(#[from] super::PatternError),
    /// The area has no inside.
    #[error("an area of {width_m} m by {height_m} m has no border to drive along")]
    EmptyArea {
        /// Its width, metres.
        width_m: f64,
        /// Its height, metres.
        height_m: f64,
    },
    /// Too few or too many positions.
    #[error("a ring has 4 to 4000 positions, not {positions}")]
    Positions {
        /// How many were asked for.
        positions: usize,
    },
    /// Too few or too many vehicles.
    #[error("this planner drives 2 to 8 vehicles, not {vehicles}")]
    Vehicles {
        /// How many were given.
        vehicles: usize,
    },
    /// A pattern is for two vehicles.
    #[error("a pattern is driven by 2 vehicles, not {vehicles}")]
    NotTwo {
        /// How many were given.
        vehicles: usize,
    },
    /// Such plans are too long to travel.
    #[error(
        "this sweep needs {stops} stops of a vehicle, at most {limit} are allowed; take fewer positions or laps"
    )]
    TooManyStops {
        /// How many it needs.
        stops: usize,
        /// How many a plan may have.
        limit: usize,
    },
    /// A vehicle is given twice, or its place is not finite.
    #[error("vehicle {vehicle} is given twice or its place is not finite")]
    Vehicle {
        /// Which vehicle.
        vehicle: VehicleId,
    },
    /// The ring is too small for so many vehicles.
    #[error(
        "{vehicles} vehicles need a ring of at least {needed} positions, this one has {positions}"
    )]
    RingTooSmall {
        /// How many vehicles.
        vehicles: usize,
        /// Positions there are.
        positions: usize,
        /// Positions needed.
        needed: usize,
    },
    /// There is no lap (or round) left to drive.
    #[error("a sweep has at least one lap and at most {limit}; asked for laps {first} to {end}")]
    Laps {
        /// First lap asked for.
        first: usize,
        /// The lap behind the last.
        end: usize,
        /// Most laps that can be planned.
        limit: usize,
    },
    /// No way was found to bring the vehicles to their first positions in their order.
    #[error(
        "the vehicles cannot reach first positions in the order in which they stand around the area"
    )]
    NoApproach,
    /// The plan made cannot be driven safely here, for example because the area is too narrow.
    #[error("the sweep cannot be driven safely: {0}")]
    Unsafe(#[from] PlanError),
}
