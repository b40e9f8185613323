//! The actors that a recording can be of, by the names that its topics give them: `vehicle/3/mission` is the mission
//! of a vehicle. The lists are those of the nodes; nothing here knows an actor.

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use tomoswarm_proto::Message;

use super::message::{self, MessageError};
use super::said;
use crate::actor::{Actor, ActorStep, Fill, Names, NodeActor, Wire, Wiring, again};
use crate::ground::GroundWiring;
use crate::node::VehicleWiring;
use crate::operator::{HeardMessage, OperatorWiring};
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

/// What passed between an actor and the bus in one step.
pub(super) struct BusStep {
    /// When.
    pub now: Time,
    /// What the bus was given.
    pub said: Vec<Message>,
    /// What it brought, to actors that are told all of it.
    pub heard: Option<HeardMessage>,
}

/// Returns what passed between an actor and the bus in a step as JSON; `None` = nothing.
///
/// # Errors
/// It is no step, or not of this actor.
pub(super) fn bus_step(
    node: &str,
    actor: &str,
    step: &[u8],
) -> Result<Option<BusStep>, MessageError> {
    let mut read = ReadBus {
        actor,
        step,
        read: None,
    };
    every_actor(node, &mut read);
    let no_actor = || Err(MessageError::NoActor(format!("{node}/{actor}")));
    read.read.unwrap_or_else(no_actor)
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

struct ReadBus<'a> {
    actor: &'a str,
    step: &'a [u8],
    read: Option<Result<Option<BusStep>, MessageError>>,
}

impl<W: Wiring> Fill<W, Names> for ReadBus<'_> {
    fn actor<A: NodeActor>(&mut self, wire: Wire<A, W>) {
        if wire.name == self.actor {
            self.read = Some(read_bus(&wire, self.step));
        }
    }
}

/// Lists the actors of a node, and does nothing with them.
struct List;

impl<W: Wiring> Fill<W, Names> for List {
    fn actor<A: NodeActor>(&mut self, _wire: Wire<A, W>) {}
}

fn read_bus<A: NodeActor, W: Wiring>(
    wire: &Wire<A, W>,
    step: &[u8],
) -> Result<Option<BusStep>, MessageError> {
    let heard = match said::hears::<A::In>() {
        true => message::read_step::<A::In>(step)?.input,
        false => None,
    };
    let heard = heard.as_ref().and_then(said::brought);
    let (now, outputs) = message::read_outputs::<A::Out>(step)?;
    let (mut actors, mut to, mut published) = (W::fill(&mut List), Vec::new(), Vec::new());
    for output in outputs {
        W::route((wire.output)(output), &mut to);
    }
    for destination in to {
        W::deliver::<Names>(&mut actors, destination, &mut |effect| {
            published.extend(W::published(effect));
        });
    }
    let is_nothing = heard.is_none() && published.is_empty();
    Ok((!is_nothing).then_some(BusStep {
        now,
        said: published,
        heard,
    }))
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
