//! The operator: what it hears, what it wants of the swarm, and how it brings that about. State machines and tables
//! without I/O; the command line, a scenario and a page are its faces.
//!
//! [`operator_actor`] is the actor: it keeps a [`fleet_view`] of everyone, brings each want about by an [`ordering`], gives
//! tasks ([`given_tasks`]), and follows a [`script`]; [`wiring`] makes a node of it. [`status`] and [`preflight`] judge what
//! is known. Emergency stops
//! are given by [`stopping`]. An operator says nothing but its greeting, tasks, orders, and which stops stand.

pub mod fleet_view;
pub mod given_tasks;
pub mod names;
pub mod operator_actor;
pub mod ordering;
pub mod outcome;
pub mod preflight;
pub mod script;
pub mod status;
pub mod stopping;
#[cfg(test)]
pub(crate) mod tests_support;
pub mod want;
pub mod wiring;

pub use crate::exchange::ingress::Heard;
