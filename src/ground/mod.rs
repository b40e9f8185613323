//! The ground station: fleet, schedule and samples ([`station`]), the next stops ([`planner`]), the
//! picture ([`imager`]), the list of them ([`wiring`]), and the one place that says who hears whom ([`route`]).
//!
//! Like a vehicle it knows no device and no network: what reaches it is an [`Event`], what it wants
//! done is an [`Effect`].

mod fleet;
pub mod from_config;
mod ground_node;
pub mod imager;
pub mod planner;
pub mod route;
mod samples;
pub mod station;
pub mod wiring;

pub use ground_node::GroundNode;
pub use route::{Effect, Event};
pub use samples::SampleStore;
pub use wiring::GroundWiring;
