//! The world in virtual time: kernel, bodies, simulated drivers, radio field, bus.

pub mod body;
pub mod contact;
mod motion;
