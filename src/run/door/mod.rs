//! The operator's door: what the tools `order`, `status`, `tap` and `preflight` know and decide.
//!
//! All but [`session`] is pure: it is told what was heard and when, and opens nothing. The tools are members of the bus as
//! [`tomoswarm_proto::Sender::Operator`]; they hear everything and say nothing but orders.

pub mod ordering;
pub mod preflight;
pub mod roll;
pub mod session;
pub mod status;
pub mod table;
pub mod tapping;
#[cfg(test)]
mod tests_support;
