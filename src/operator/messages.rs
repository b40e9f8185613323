//! What the operator actor is told and says. No decisions.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{EmergencyStop, Fix, Hello, Interest, Message, VehicleId};

use super::HeardMessage;
use super::given_marks::{MarkOutcome, MarkRequest};
use super::order_goal::{GoalId, OrderGoal, StopRequest};
use super::outcome::OrderOutcome;
use super::script::{ScriptEnd, ScriptStep};
use crate::actor::{Input, InputClass};
use crate::stops;

/// Who an operator is, and what it knows before it hears anything.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct OperatorSettings {
    /// How it greets; in it who it is and which venue file it has.
    pub hello: Hello,
    /// Whether it greets; who only looks does not.
    pub greets: bool,
    /// Its id as the holder of a lease, drawn by whoever starts it; 0 is that of no operator.
    pub holder: u64,
    /// Vehicles that are there though they may not be heard.
    pub expected: BTreeSet<VehicleId>,
}

/// What the operator can be told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum In {
    /// What came over the bus.
    Bus(HeardMessage),
    /// Whether anyone can be reached.
    Linked(bool),
    /// What is wanted by hand, under a number of its own.
    Want(u32, OrderGoal),
    /// An emergency stop that is wanted by hand, under a number of its own.
    Stop(u32, StopRequest),
    /// What is not wanted by hand any more.
    Withdraw(u32),
    /// A script to follow from now on; one that is followed already ends.
    Follow(Vec<ScriptStep>),
    /// What the last cue asked for is done.
    CueDone,
    /// Where something outside has measured a vehicle to be; it is passed on at once.
    Fix(Fix),
    /// A true position that is to be marked, under a number of its own.
    Mark(u32, MarkRequest),
    /// Whether it wants to be told something that is said only to those who ask.
    Ask(Interest, bool),
}

/// What the operator can say.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Out {
    /// To everyone on the bus.
    Publish(Message),
    /// To the keeper of the emergency stops: these are given.
    Give(Vec<EmergencyStop>),
    /// Emergency stops were opened or lifted: worth a line.
    StopEvent(stops::StopEvent),
    /// Every vehicle shows a want of the script, which goes on standing.
    InForce(GoalId, OrderOutcome),
    /// A want is over.
    Ended(GoalId, OrderOutcome),
    /// A mark is over.
    Marked(u32, MarkOutcome),
    /// The script asks for something outside the bus; [`In::CueDone`] says that it is done.
    Announce(String),
    /// The script is over.
    ScriptEnded(ScriptEnd),
}

impl Out {
    /// Returns a line for people of what was brought about; `None` of what is for somebody else.
    pub fn in_words(&self) -> Option<String> {
        match self {
            Out::Publish(_) | Out::Announce(_) | Out::Give(_) => None,
            Out::StopEvent(event) => Some(event.to_string()),
            Out::Marked(_, outcome) => Some(outcome.to_string()),
            Out::InForce(want, outcome) => Some(format!(
                "{want}, run {}, is in force",
                outcome.run.unwrap_or_default()
            )),
            Out::Ended(want, outcome) => {
                let why = Some(outcome.undone()).filter(|why| !why.is_empty());
                Some(format!(
                    "{want} is over{}",
                    why.map_or(String::new(), |why| format!(": {why}"))
                ))
            }
            Out::ScriptEnded(end) => Some(format!("its script has ended: {end}")),
        }
    }
}

/// Which inputs replace unread ones.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Key {
    /// The newest state of a vehicle.
    State(VehicleId),
    /// The newest report of a ground station, by its store.
    Report(u64),
    /// Whether anyone can be reached.
    Linked,
    /// A want by hand.
    Want(u32),
    /// That a want by hand is withdrawn.
    Withdraw(u32),
    /// The script to follow.
    Follow,
    /// The last cue.
    CueDone,
    /// The newest fix of a vehicle.
    Fix(VehicleId),
    /// A mark.
    Mark(u32),
    /// Whether something is wanted that is said only to those who ask.
    Ask(Interest),
}

impl Input for In {
    type Key = Key;

    fn class(&self) -> InputClass<Key> {
        match self {
            In::Bus(HeardMessage::Message(_, Message::State(state))) => {
                InputClass::Latest(Key::State(state.vehicle))
            }
            In::Bus(HeardMessage::Message(_, Message::Report(report))) => {
                InputClass::Latest(Key::Report(report.store))
            }
            In::Bus(
                HeardMessage::Message(..) | HeardMessage::Greeting(..) | HeardMessage::Unknown(_),
            ) => InputClass::Queue,
            In::Linked(_) => InputClass::Latest(Key::Linked),
            In::Want(number, _) | In::Stop(number, _) => InputClass::Latest(Key::Want(*number)),
            In::Withdraw(number) => InputClass::Latest(Key::Withdraw(*number)),
            In::Follow(_) => InputClass::Latest(Key::Follow),
            In::CueDone => InputClass::Latest(Key::CueDone),
            In::Fix(fix) => InputClass::Latest(Key::Fix(fix.vehicle)),
            In::Mark(number, _) => InputClass::Latest(Key::Mark(*number)),
            In::Ask(of, _) => InputClass::Latest(Key::Ask(*of)),
        }
    }

    /// Of two states of one start of a vehicle's software the later one stays, whichever came last; which start counts is
    /// judged by who has heard both.
    fn join(unread: In, newer: In) -> In {
        let state = |input: &In| match input {
            In::Bus(HeardMessage::Message(_, Message::State(state))) => {
                Some((state.boot, state.sequence))
            }
            In::Bus(_)
            | In::Linked(_)
            | In::Want(..)
            | In::Stop(..)
            | In::Withdraw(_)
            | In::Follow(_)
            | In::CueDone
            | In::Fix(_)
            | In::Mark(..)
            | In::Ask(..) => None,
        };
        match (state(&unread), state(&newer)) {
            (Some(was), Some(is)) if was.0 == is.0 && was > is => unread,
            (_, _) => newer,
        }
    }
}
