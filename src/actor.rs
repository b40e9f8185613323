//! The actor contract, the inbox in front of every actor, and how the actors of a node are wired ([`Wiring`]). Nothing
//! here waits for anything: when actors act is the work of a runtime (`sim` in virtual time, `run` on real time).
//!
//! An actor is a state machine: a closed set of inputs, a closed set of outputs, and a deadline. It
//! performs no I/O, owns no device, starts no task, reads no clock and holds no handle to another actor.
//!
//! ```text
//!   inputs ─► Inbox ─► handle(now, input) ─► outputs ─► route ─► other inboxes, drivers, bus
//!                       wake(now) ▲ deadline()
//! ```
//!
//! Contract, kept by every runtime: `out` is drained, then `deadline` is asked again; `now` never goes
//! back; a due deadline goes before the inbox; after `wake(now)` the deadline is later than `now`.

mod actor_cell;
mod actor_step;
mod inbox;
mod local_node;
mod snapshot;
mod step;
#[cfg(test)]
pub(crate) mod tests_support;
mod wiring;

pub use actor_cell::ActorCell;
pub use actor_step::ActorStep;
pub use inbox::{Inbox, Input, InputClass};
pub use local_node::{Cells, LocalNode};
pub use snapshot::Snapshot;
pub use step::{NOT_DUE, RecordedStep, StepCause, again};
pub use wiring::{
    ActingTime, Fill, Names, NodeActor, Place, Recipient, RestartPolicy, Visitor, Wire, Wired,
    Wiring,
};

use crate::time::{Deadline, Time};

/// A state machine that is told things and says things.
pub trait Actor {
    /// All that it can be told.
    type In;
    /// All that it can say.
    type Out;

    /// Takes one input.
    ///
    /// # Errors
    /// A fault that the actor cannot go on from; input from outside never is one.
    fn handle(&mut self, now: Time, input: Self::In, out: &mut Vec<Self::Out>)
    -> Result<(), Fault>;

    /// Returns when to be woken, and why.
    fn deadline(&self) -> Option<Deadline>;

    /// Does what the deadline was for; afterwards the deadline is later than `now`.
    ///
    /// # Errors
    /// As for [`Actor::handle`].
    fn wake(&mut self, now: Time, out: &mut Vec<Self::Out>) -> Result<(), Fault>;
}

/// Why an actor cannot go on.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{actor} cannot go on: {reason}")]
pub struct Fault {
    /// Which actor.
    pub actor: &'static str,
    /// What happened.
    pub reason: String,
}
