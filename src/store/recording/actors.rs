//! The actors that a recording can be of, by the names that its topics give them: `vehicle/3/mission` is the mission
//! of a vehicle. The lists are those of the nodes; nothing here knows an actor.

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::message::{self, MessageError};
use crate::actor::{Actor, ActorStep, Fill, Names, NodeActor, Wire, Wiring, again};
use crate::ground::GroundWiring;
use crate::node::VehicleWiring;
use crate::operator::OperatorWiring;
use crate::time::Time;

/// What one step came out as; `None` when as recorded.
pub(super) type StepOutcome = Result<Option<(Time, [String; 3])>, MessageError>;
/// A restored actor, which takes a recorded step again.
pub(super) type RestoredActor = Box<dyn FnMut(&[u8]) -> StepOutcome>;

/// Returns an actor restored from a packed snapshot; `None` when such a node has no actor of this name.
pub(super) fn restore(
    node: &str,
    actor: &str,
    packed: &str,
) -> Option<Result<RestoredActor, MessageError>> {
    let mut restore = Restore {
        actor,
        packed,
        restored: None,
    };
    every_actor(node, &mut restore);
    restore.restored
}

/// Returns a step as JSON.
///
/// # Errors
/// A value that JSON cannot hold, or a step of no actor of such a node; both are mistakes of this program.
pub(super) fn json(node: &str, step: &ActorStep) -> Result<String, MessageError> {
    let mut write = Write { step, text: None };
    every_actor(node, &mut write);
    write
        .text
        .unwrap_or_else(|| Err(MessageError::NoActor(format!("{node}/{}", step.actor))))
}

/// Shows every actor of a node to `fill`; none, when there is no such kind of node.
fn every_actor<F>(node: &str, fill: &mut F)
where
    F: Fill<VehicleWiring, Names> + Fill<GroundWiring, Names> + Fill<OperatorWiring, Names>,
{
    match node.split('/').next() {
        Some(VehicleWiring::KIND) => drop(VehicleWiring::fill(fill)),
        Some(GroundWiring::KIND) => drop(GroundWiring::fill(fill)),
        Some(OperatorWiring::KIND) => drop(OperatorWiring::fill(fill)),
        Some(_) | None => {}
    }
}

struct Restore<'a> {
    actor: &'a str,
    packed: &'a str,
    restored: Option<Result<RestoredActor, MessageError>>,
}

impl<W: Wiring> Fill<W, Names> for Restore<'_> {
    fn actor<A: NodeActor>(&mut self, wire: Wire<A, W>) {
        if wire.name == self.actor {
            self.restored = Some(restored::<A>(self.packed));
        }
    }
}

fn restored<A: NodeActor>(packed: &str) -> Result<RestoredActor, MessageError> {
    let mut actor: A = message::unpacked(packed)?;
    Ok(Box::new(move |recorded| take_again(&mut actor, recorded)))
}

struct Write<'a> {
    step: &'a ActorStep,
    text: Option<Result<String, MessageError>>,
}

impl<W: Wiring> Fill<W, Names> for Write<'_> {
    fn actor<A: NodeActor>(&mut self, wire: Wire<A, W>) {
        if wire.name == self.step.actor {
            self.text = self.step.of::<A>().map(message::of_step);
        }
    }
}

fn take_again<A>(actor: &mut A, recorded: &[u8]) -> StepOutcome
where
    A: Actor,
    A::In: Clone + Serialize + DeserializeOwned,
    A::Out: Serialize,
{
    let step = message::read_step::<A::In>(recorded)?;
    let now = message::of_step(&again(actor, step.now, step.input))?;
    if now.as_bytes() == recorded {
        return Ok(None);
    }
    // Other tools may have written the same with other spaces.
    let (then, now): (Value, Value) = (
        serde_json::from_slice(recorded)?,
        serde_json::from_str(&now)?,
    );
    if then == now {
        return Ok(None);
    }
    let input = if then["input"].is_null() {
        format!("woken: {}", then["woken"])
    } else {
        then["input"].to_string()
    };
    Ok(Some((step.now, [input, came_of(&then), came_of(&now)])))
}

/// Returns what came of a step in words: the outputs, the fault, and another cause.
fn came_of(step: &Value) -> String {
    let outputs = step["outputs"].to_string();
    let part = |name: &str| {
        step.get(name)
            .map(|value| format!(" {name}: {value}"))
            .unwrap_or_default()
    };
    format!("{outputs}{}{}", part("woken"), part("fault"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actor::{Fault, RecordedStep, StepCause};
    use crate::time::Deadline;
    use serde::Deserialize;

    /// Multiplies its input by a constant, and adds the inputs before.
    #[derive(Serialize, Deserialize)]
    struct Scales<const BY: u64> {
        sum: u64,
    }

    impl<const BY: u64> Actor for Scales<BY> {
        type In = u64;
        type Out = u64;
        fn handle(&mut self, _now: Time, input: u64, out: &mut Vec<u64>) -> Result<(), Fault> {
            self.sum += input;
            out.push(self.sum * BY);
            Ok(())
        }
        fn deadline(&self) -> Option<Deadline> {
            None
        }
        fn wake(&mut self, _now: Time, _out: &mut Vec<u64>) -> Result<(), Fault> {
            Ok(())
        }
    }

    #[test]
    fn an_actor_with_another_constant_differs_where_it_matters() {
        let recorded = [(1, 0, 6), (2, 3, 12)].map(|(at, input, outputs)| {
            let now = Time::from_nanos(at);
            message::of_step(&RecordedStep {
                now,
                cause: StepCause::Input(input),
                outputs: vec![outputs],
                fault: None,
            })
            .unwrap()
        });
        let (mut same, mut other) = (Scales::<2> { sum: 3 }, Scales::<4> { sum: 3 });
        for text in &recorded {
            assert_eq!(take_again(&mut same, text.as_bytes()).unwrap(), None);
        }
        let (at, [input, then, now]) = take_again(&mut other, recorded[0].as_bytes())
            .unwrap()
            .unwrap();
        assert_eq!(
            (at, input.as_str(), then.as_str(), now.as_str()),
            (Time::from_nanos(1), "0", "[6]", "[12]")
        );
    }

    #[test]
    fn spaces_do_not_matter_and_a_wake_out_of_turn_does() {
        let mut scales = Scales::<2> { sum: 0 };
        let spaced = b"{ \"outputs\": [4], \"input\": 2, \"now_ns\": 5 }";
        assert_eq!(take_again(&mut scales, spaced).unwrap(), None);
        let woken = b"{\"now_ns\":6,\"woken\":\"tick\",\"outputs\":[]}";
        let (_, [input, _, now]) = take_again(&mut scales, woken).unwrap().unwrap();
        assert_eq!(input, "woken: \"tick\"");
        assert!(now.contains("nothing is due"), "{now}");
    }
}
