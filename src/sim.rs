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
mod judge;
mod kernel;
pub mod log;
mod motion;
pub mod noise;
pub mod operator_script;
mod outcome;
pub mod queue;
pub mod radio_field;
pub mod range;
mod scenario;
mod seen;
mod shown;
pub mod staging;
pub mod visible;
mod world;

pub use entry::Entry;
pub use kernel::Status;
pub use operator_script::{EMPTY_RUN, RUN};
pub use outcome::{Counts, Found, Mission, Outcome};
pub use scenario::{RunError, Scenario, ScenarioError};
pub use seen::{SLICE, Seen};
pub use shown::{Shown, ShownVehicle};
pub use world::{Collision, Stage};
