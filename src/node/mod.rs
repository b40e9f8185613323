//! A vehicle: its actors, the list of them ([`wiring`]), and the one place that says who hears whom ([`route`]).
//!
//! Nothing here knows a device or a network. What reaches a vehicle from outside is an [`Event`],
//! what it wants done outside is an [`Effect`]; drivers and the bus at the edge turn them into real things.

mod ages;
pub mod echo;
mod from_config;
pub mod map;
pub mod memory;
pub mod mission;
pub mod outbox;
mod own_state;
mod peers;
mod place;
pub mod radio;
pub mod route;
pub mod sensor;
pub mod servo;
mod settings;
#[cfg(test)]
mod tests_support;
pub mod vehicle;
mod vehicle_node;
pub mod wiring;

pub use memory::{Memory, Remembered};
pub use own_state::OwnState;
pub use route::{Effect, Event};
pub use settings::{BodySettings, LookSettings, RadioSettings, Settings};
pub use vehicle_node::VehicleNode;
pub use wiring::VehicleWiring;
