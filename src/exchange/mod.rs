//! A node's side of the bus, without the bus.

pub mod egress;
pub mod joining;
pub mod restarts;
pub mod table;
pub mod token_bucket;

/// One message of every kind, as the wire's own tests have them.
#[cfg(test)]
#[path = "../../proto/tests/examples/mod.rs"]
pub(crate) mod examples;
