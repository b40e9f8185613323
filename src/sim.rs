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
mod ground_disk;
mod kernel;
pub mod log;
mod motion;
pub mod noise;
pub mod operator_script;
mod outcome;
pub mod queue;
pub mod radio_field;
pub mod range;
mod run_monitor;
mod run_view;
mod scenario;
pub mod staging;
pub mod visible;
mod visible_scene;
mod world;

pub use entry::SampleFile;
pub use kernel::RunProgress;
pub use operator_script::{EMPTY_RUN, RUN};
pub use outcome::{EndedMission, FoundObject, RunCounts, RunOutcome};
pub use run_view::{RunView, VehicleSnapshot};
pub use scenario::{RunError, Scenario, ScenarioError};
pub use visible_scene::{SLICE, VisibleScene};
pub use world::{Collision, FenceBreach, WorldContents};
