//! The world in virtual time: kernel, bodies, simulated drivers, radio field, bus.

pub mod body;
pub mod bus;
pub mod contact;
mod motion;
pub mod noise;
pub mod queue;
pub mod radio_field;
pub mod range;
