//! A kind of node for tests: what it is told is doubled by one actor and summed up by the next. And what compares a
//! drawn state machine with its enum.

use std::collections::BTreeSet;
use std::fmt::Debug;

use serde::de::value::{Error, StrDeserializer};
use serde::{Deserialize, Serialize};

use super::{
    ActingTime, Actor, Fault, Fill, Input, InputClass, Place, Recipient, RestartPolicy, Visitor,
    Wire, Wiring,
};
use crate::time::{Deadline, Time};

/// Says the double of what it is told; 7 is a fault.
#[derive(Serialize, Deserialize)]
pub struct Doubler;

/// Adds up what it is told, and says the sum; one that is too large is a fault.
#[derive(Serialize, Deserialize)]
pub struct Summer(pub u32);

/// What both are told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Number(pub u32);

impl Input for Number {
    type Key = ();
    fn class(&self) -> InputClass<()> {
        InputClass::Queue
    }
}

impl Actor for Doubler {
    type In = Number;
    type Out = u32;
    fn handle(
        &mut self,
        _now: Time,
        Number(number): Number,
        out: &mut Vec<u32>,
    ) -> Result<(), Fault> {
        if number == 7 {
            return Err(Fault {
                actor: "doubler",
                reason: "seven".to_owned(),
            });
        }
        out.push(2 * number);
        Ok(())
    }
    fn deadline(&self) -> Option<Deadline> {
        None
    }
    fn wake(&mut self, _now: Time, _out: &mut Vec<u32>) -> Result<(), Fault> {
        Ok(())
    }
}

impl Actor for Summer {
    type In = Number;
    type Out = (u32,);
    fn handle(
        &mut self,
        _now: Time,
        Number(number): Number,
        out: &mut Vec<(u32,)>,
    ) -> Result<(), Fault> {
        let too_much = || Fault {
            actor: "summer",
            reason: "too much".to_owned(),
        };
        self.0 = self.0.checked_add(number).ok_or_else(too_much)?;
        out.push((self.0,));
        Ok(())
    }
    fn deadline(&self) -> Option<Deadline> {
        (self.0 > 100).then_some(Deadline {
            at: Time::ZERO,
            why: "over a hundred",
        })
    }
    fn wake(&mut self, _now: Time, _out: &mut Vec<(u32,)>) -> Result<(), Fault> {
        self.0 -= 100;
        Ok(())
    }
}

pub enum Adding {}

pub struct Actors<P: Place<Adding>> {
    pub doubler: P::Of<Doubler>,
    pub summer: P::Of<Summer>,
}

impl<P: Place<Adding>> Clone for Actors<P>
where
    P::Of<Doubler>: Clone,
    P::Of<Summer>: Clone,
{
    fn clone(&self) -> Actors<P> {
        Actors {
            doubler: self.doubler.clone(),
            summer: self.summer.clone(),
        }
    }
}

pub enum Output {
    Edge(u32),
    Doubled(u32),
    Sum(u32),
}

pub enum Destination {
    Doubler(Number),
    Summer(Number),
    Edge(u32),
}

impl Wiring for Adding {
    const KIND: &'static str = "adding";
    /// What the sum begins with.
    type Source = u32;
    type Event = u32;
    type Effect = u32;
    type Output = Output;
    type Destination = Destination;
    type Actors<P: Place<Self>> = Actors<P>;

    fn fill<P: Place<Self>>(fill: &mut impl Fill<Self, P>) -> Actors<P> {
        Actors {
            doubler: fill.actor(Wire {
                name: "doubler",
                restart: RestartPolicy::Restart,
                acting: ActingTime::Instant,
                make: |_| Doubler,
                output: Output::Doubled,
            }),
            summer: fill.actor(Wire {
                name: "summer",
                restart: RestartPolicy::StopNode,
                acting: ActingTime::Short,
                make: |start| Summer(*start),
                output: |(sum,)| Output::Sum(sum),
            }),
        }
    }

    fn visit<P: Place<Self>>(actors: &mut Actors<P>, visitor: &mut impl Visitor<Self, P>) {
        visitor.actor::<Doubler>(&mut actors.doubler);
        visitor.actor::<Summer>(&mut actors.summer);
    }

    fn event(event: u32) -> Output {
        Output::Edge(event)
    }

    fn route(output: Output, to: &mut Vec<Destination>) {
        to.push(match output {
            Output::Edge(number) => Destination::Doubler(Number(number)),
            Output::Doubled(number) => Destination::Summer(Number(number)),
            Output::Sum(sum) => Destination::Edge(sum),
        });
    }

    fn deliver<P: Recipient<Self>>(
        actors: &mut Actors<P>,
        destination: Destination,
        carry_out: &mut impl FnMut(u32),
    ) {
        match destination {
            Destination::Doubler(input) => P::tell::<Doubler>(&mut actors.doubler, input),
            Destination::Summer(input) => P::tell::<Summer>(&mut actors.summer, input),
            Destination::Edge(sum) => carry_out(sum),
        }
    }

    fn published(_effect: u32) -> Option<tomoswarm_proto::Message> {
        None
    }
}

/// Returns the name of a value's variant.
pub fn variant_of(value: &impl Debug) -> String {
    format!("{value:?}")
        .chars()
        .take_while(|letter| letter.is_alphanumeric())
        .collect()
}

/// Returns the names of all variants of an enum: serde lists them to whoever asks for one that is not there.
pub fn variants<'a, T: Deserialize<'a> + Debug>() -> BTreeSet<String> {
    let refusal = T::deserialize(StrDeserializer::<Error>::new("none of them"))
        .unwrap_err()
        .to_string();
    refusal
        .split('`')
        .skip(3)
        .step_by(2)
        .map(str::to_owned)
        .collect()
}

/// Returns the names in brackets within the drawings of a file's doc.
pub fn drawn(source: &str) -> BTreeSet<String> {
    let doc: Vec<&str> = source
        .lines()
        .map_while(|line| line.strip_prefix("//!"))
        .collect();
    let doc = doc.join("\n");
    let drawings = doc
        .split("```")
        .skip(1)
        .step_by(2)
        .flat_map(|drawing| drawing.split('[').skip(1));
    drawings
        .filter_map(|from| Some(from.split_once(']')?.0.to_owned()))
        .collect()
}
