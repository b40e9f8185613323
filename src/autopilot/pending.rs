//! A command that waits for its answer, and for how long. What becomes of it then is the link's matter.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::command::{Command, NumberedCommand};
use super::link::RESEND_AFTER;
use super::messages::CommandPurpose;
use super::motors::ARM_AGAIN;
use crate::time::Time;

/// A mission of 700 items over a slow link that loses packets takes a minute, and as long to be read back.
const UPLOADED_WITHIN: Duration = Duration::from_secs(180);
/// A command is said so often at most.
pub(super) const TRIES: u8 = 3;

/// A command that waits for its answer.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct Pending {
    /// What it is for.
    pub purpose: CommandPurpose,
    /// The command.
    pub sent: NumberedCommand,
    /// When it was said last.
    pub sent_at: Time,
    /// How often it was said.
    pub tries: u8,
}

impl Pending {
    /// Returns when the answer is late.
    pub(super) fn due(&self) -> Time {
        self.sent_at
            + match self.purpose {
                CommandPurpose::Arm => ARM_AGAIN,
                CommandPurpose::Stored if self.is_upload() => UPLOADED_WITHIN,
                CommandPurpose::ChangeMode | CommandPurpose::Move | CommandPurpose::Stored => {
                    RESEND_AFTER
                }
            }
    }

    /// Returns whether it is said again when the answer is late: an upload the driver sees through.
    pub(super) fn may_be_said_again(&self) -> bool {
        self.tries < TRIES && !self.is_upload()
    }

    /// Returns whether the vehicle may set out by it, or by what follows it.
    pub(super) fn sets_out(&self) -> bool {
        match self.purpose {
            CommandPurpose::Move | CommandPurpose::Stored => true,
            CommandPurpose::ChangeMode => self.sent.command.moves(),
            CommandPurpose::Arm => false,
        }
    }

    /// Returns whether nobody waits for it any more after a stop: all but a mode in which the vehicle stands.
    pub(super) fn ends_by_a_stop(&self) -> bool {
        self.purpose != CommandPurpose::ChangeMode || self.sent.command.moves()
    }

    fn is_upload(&self) -> bool {
        matches!(self.sent.command, Command::Upload(_))
    }
}
