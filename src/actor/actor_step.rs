//! A step of any actor of a node, for whoever watches: a recording. Nothing here writes.

use std::any::Any;
use std::sync::Arc;

use super::{NodeActor, RecordedStep};
use crate::time::Time;

/// A step of an actor, whichever it is. A copy is cheap.
#[derive(Clone, Debug)]
pub struct ActorStep {
    /// The name of the actor within its node.
    pub actor: &'static str,
    /// When.
    pub now: Time,
    /// Why the actor could not go on.
    pub fault: Option<String>,
    step: Arc<dyn Any + Send + Sync>,
}

impl ActorStep {
    /// Makes it of a step of the actor of this name.
    pub fn new<A: NodeActor>(actor: &'static str, step: RecordedStep<A::In, A::Out>) -> ActorStep {
        let (now, fault) = (step.now, step.fault.clone());
        ActorStep {
            actor,
            now,
            fault,
            step: Arc::new(step),
        }
    }

    /// Returns the step, if it is one of an actor of this type.
    pub fn of<A: NodeActor>(&self) -> Option<&RecordedStep<A::In, A::Out>> {
        self.step.downcast_ref()
    }
}
