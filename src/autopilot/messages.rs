//! What an autopilot link is told and says, in words for people where they are for people. No decisions.

use std::fmt;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Fix, Sender};

use super::autopilot_command::AutopilotCommand;
use super::command::{Ack, ArmRefusal, CommandAck, FlightMode, NumberedCommand};
use super::report::{AutopilotReport, ControlStatus, Telemetry};
use crate::actor::{Input, InputClass};

/// What the link can be told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum In {
    /// What the vehicle wants.
    AutopilotCommand(AutopilotCommand),
    /// What the autopilot says of itself.
    Report(AutopilotReport),
    /// What it answers to a command.
    Ack(Ack),
    /// Where something outside has measured the vehicle to be, and who says so.
    Fix(Sender, Fix),
}

/// What the link can say.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Out {
    /// To the autopilot.
    Command(NumberedCommand),
    /// To the vehicle, with every report.
    Telemetry(Telemetry),
    /// To the vehicle, when it has changed.
    Status(ControlStatus),
    /// For people.
    LinkEvent(LinkEvent),
    /// To the autopilot, for its own estimate of its place.
    Fix(Sender, Fix),
}

/// What became of commands, and what somebody else has done.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum LinkEvent {
    /// A person has taken over by remote control, and chosen this mode.
    TakenOver(FlightMode),
    /// The autopilot has taken this mode by itself.
    ActsByItself(FlightMode),
    /// The autopilot does not do what it was told.
    GivenUp(CommandPurpose, Reason),
}

impl fmt::Display for LinkEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LinkEvent::TakenOver(mode) => {
                write!(f, "a person has taken over by remote control, mode {mode}")
            }
            LinkEvent::ActsByItself(mode) => write!(f, "it has taken mode {mode} by itself"),
            LinkEvent::GivenUp(purpose, why) => write!(f, "{purpose} is given up: {why}"),
        }
    }
}

/// What a command that waits for its answer is for.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum CommandPurpose {
    /// The mode in which the autopilot goes where it is told.
    ChangeMode,
    /// Current for the motors.
    Arm,
    /// A drive, a turn, a take-off.
    Move,
    /// A mission that the autopilot is to store, or the item with which it is to go on.
    Stored,
}

impl fmt::Display for CommandPurpose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            CommandPurpose::ChangeMode => "the change of its mode",
            CommandPurpose::Arm => "arming",
            CommandPurpose::Move => "a movement",
            CommandPurpose::Stored => "a stored mission",
        })
    }
}

/// Why something was given up.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum Reason {
    /// The autopilot has refused it.
    #[error("the autopilot says that it is {0}")]
    Refused(CommandAck),
    /// It has refused to arm, and said why.
    #[error("{0}")]
    WillNotArm(ArmRefusal),
    /// It does not answer, or does not do what it has accepted.
    #[error("the autopilot does not do it")]
    NotDone,
    /// The motors have no current.
    #[error("the motors have no current")]
    NotArmed,
    /// It could not be begun in time.
    #[error("it could not be begun in time")]
    TooLate,
}

/// Which inputs replace unread ones.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Key {
    /// The autopilot's report.
    Report,
    /// The newest place that somebody has measured.
    Fix(Sender),
}

impl Input for In {
    type Key = Key;

    fn class(&self) -> InputClass<Key> {
        match self {
            In::Report(_) => InputClass::Latest(Key::Report),
            In::Fix(from, _) => InputClass::Latest(Key::Fix(*from)),
            In::AutopilotCommand(_) | In::Ack(_) => InputClass::Queue,
        }
    }
}
