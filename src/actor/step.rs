//! One step of an actor: what it was told, or why it was woken, and what it said. This is what a recording is made of,
//! and what a replay takes again. Nothing here writes or reads anything.

use super::{Actor, Fault};
use crate::time::Time;

/// One step of an actor.
#[derive(Clone, PartialEq, Debug)]
pub struct RecordedStep<I, O> {
    /// When.
    pub now: Time,
    /// What made it act.
    pub cause: StepCause<I>,
    /// What it said, in order.
    pub outputs: Vec<O>,
    /// Why it could not go on; nothing that it said was handed on then.
    pub fault: Option<String>,
}

/// What makes an actor act.
#[derive(Clone, PartialEq, Debug)]
pub enum StepCause<I> {
    /// An input from its inbox.
    Input(I),
    /// Its deadline, with the reason that the actor gave for it.
    Woken(&'static str),
}

/// The reason of a wake that nobody asked for; only a replay that has gone astray sees it.
pub const NOT_DUE: &str = "nothing is due";

/// Lets an actor take one input, or what its deadline is for when there is none.
///
/// # Errors
/// The actor cannot go on, or its deadline did not move although it was due.
pub(super) fn take<A: Actor>(
    actor: &mut A,
    now: Time,
    input: Option<A::In>,
    output: &mut Vec<A::Out>,
) -> Result<(), Fault> {
    let Some(input) = input else {
        actor.wake(now, output)?;
        return match actor.deadline().filter(|next| next.at <= now) {
            Some(vain) => Err(fault::<A>(format!(
                "woken in vain at {now} s: {} is still due",
                vain.why
            ))),
            None => Ok(()),
        };
    };
    actor.handle(now, input, output)
}

pub(super) fn fault<A>(reason: String) -> Fault {
    let path = std::any::type_name::<A>();
    Fault {
        actor: path.rsplit("::").next().unwrap_or(path),
        reason,
    }
}

/// Lets an actor take a recorded step again: what it was `told` at `now`, or a wake. Gives what it does this time,
/// by the rules of every runtime: a due deadline goes before an input, and nobody is woken before it.
pub fn again<A: Actor>(
    actor: &mut A,
    now: Time,
    given: Option<A::In>,
) -> RecordedStep<A::In, A::Out>
where
    A::In: Clone,
{
    let due = actor.deadline().filter(|deadline| deadline.at <= now);
    let (cause, input) = match (due, given) {
        (Some(deadline), _) => (StepCause::Woken(deadline.why), None),
        (None, Some(input)) => (StepCause::Input(input.clone()), Some(input)),
        (None, None) => {
            return RecordedStep {
                now,
                cause: StepCause::Woken(NOT_DUE),
                outputs: Vec::new(),
                fault: None,
            };
        }
    };
    let mut output = Vec::new();
    let fault = take(actor, now, input, &mut output)
        .err()
        .map(|fault| fault.to_string());
    RecordedStep {
        now,
        cause,
        outputs: output,
        fault,
    }
}
