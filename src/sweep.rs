//! Which positions to measure from, in which order, and who waits for whom.
//!
//! A planner ([`rotating_gap`], [`fan`]) makes one plan per vehicle with precedence between their
//! stops; [`validate`] and [`check_separation`] prove a set of plans; a [`Follower`] is the vehicle's
//! side of driving it, a [`Succession`] the ground's side of replacing it by the next revision.
//! Nothing here knows obstacles, maps or radios, and nothing measures time: the caller says what
//! time it is.

mod approach;
mod error;
mod fan;
mod follower;
mod lower_numbers;
mod objective;
mod pareto;
mod pattern;
mod pattern_plan;
mod precedence;
mod ring;
mod rotating_gap;
mod schedule;
mod separation;
mod snap;
mod succession;
#[cfg(test)]
mod tests;
mod vehicle_progress;
mod verdict;

pub use error::{PlanError, SweepError};
pub use fan::{FanRequest, fan};
pub use follower::Follower;
pub use lower_numbers::LowerNumbers;
pub use objective::LinkSetQuality;
pub use pareto::{dominates, hypervolume_contributions, non_dominated_layers};
pub use pattern::{
    LatticePoint, MAX_PATTERN_SIZE, MIN_PATTERN_SIZE, Pattern, PatternError, PatternKind, square,
};
pub use pattern_plan::{PatternRequest, pattern_sweep};
pub use precedence::{order_legs, tracks_of, validate};
pub use ring::{MAX_POSITIONS, MIN_POSITIONS, Ring};
pub use rotating_gap::{GapRequest, default_laps, rotating_gap};
pub use schedule::{
    ExpectedStop, Lap, PlannedSweep, Schedule, expected_duration_s, expected_stops, has_done,
    stops_done,
};
pub use separation::check_separation;
pub use snap::snap_to_boundary;
pub use succession::{RevisionPhase, Succession};
pub use vehicle_progress::VehicleProgress;
pub use verdict::{FollowError, OfferResult, PlanRefusal, WaitsFor};

/// A vehicle that is to follow a plan is out of service when its range sensors have not answered, or it has not known its
/// place, for this long: it leaves its plan, and the others go on without it. People read of it in docs/modules.md.
pub const OUT_OF_SERVICE_AFTER: std::time::Duration = std::time::Duration::from_secs(60);

/// After a silence this long of a vehicle a lower count of its starts is believed: its disk is a new one, and it counts from
/// the beginning. Nothing that an earlier start has said is under way for this long, so nothing old is taken for new; and a
/// rover with a new disk is not waited for any longer than this, by anyone who hears it.
pub const LOWER_BOOT_AFTER: std::time::Duration = std::time::Duration::from_secs(30);

/// A number that its sender does not say again for this long, while it says lower ones, was not its word: somebody else has
/// said it in its name.
pub const VOID_AFTER: std::time::Duration = std::time::Duration::from_secs(10);
