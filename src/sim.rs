//! The world in virtual time: kernel, bodies, simulated drivers, radio field, bus.

mod air;
pub mod autopilot;
mod axes;
pub mod body;
pub mod bus;
pub mod contact;
mod disk;
mod entry;
pub mod environment;
mod faults;
#[cfg(feature = "mavlink")]
pub mod free_space;
mod ground_disk;
mod kernel;
pub mod log;
#[cfg(feature = "mavlink")]
pub mod mavlink_fleet;
#[cfg(feature = "mavlink")]
pub mod mavlink_vehicle;
mod motion;
pub mod noise;
pub mod operator_script;
mod outcome;
mod place_results;
pub mod queue;
pub mod radio_field;
pub mod range;
pub mod reachable;
mod run_monitor;
mod run_view;
mod scenario;
mod silence;
pub mod staging;
mod unmet;
pub mod visible;
mod visible_scene;
mod walking;
mod world;
pub mod xbee_air;
pub mod xbee_module;

pub use entry::RecordingEntry;
pub use kernel::RunProgress;
pub use operator_script::{EMPTY_RUN, RUN};
pub use outcome::{EndedMission, FoundObject, NEAR_M, RunCounts, RunOutcome};
pub use place_results::{PlaceFate, PlaceResult};
pub use run_view::{RunView, VehicleSnapshot};
pub use scenario::{RunError, Scenario, ScenarioError};
pub use silence::{QUIET, Silence};
pub use unmet::unended;
pub use visible_scene::{PlaceCounts, SLICE, VisibleScene, narrowest_gap_m};
pub use world::{Collision, FenceBreach, WorldContents};
