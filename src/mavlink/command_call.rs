//! A command that is told until it is answered (<https://mavlink.io/en/services/command.html>). A pure machine: said again
//! with a higher confirmation when no answer comes; one that is under way keeps it waiting.
//!
//! ```text
//!   Said ─ no answer for a while ─► Said again …, at most so often ─► Silent
//!   Said ─ in progress ─► UnderWay ─ an answer ─► Answered
//! ```

use std::time::Duration;

use super::dialect::{COMMAND_ACK_DATA, COMMAND_LONG_DATA, MavMessage, MavResult};
use super::frames::MavAddress;
use crate::time::Time;

/// A command that is not answered is said again after this time.
const AGAIN: Duration = Duration::from_millis(500);
/// It is said so often at most.
const TRIES_MAX: u8 = 4;
/// One that is under way says so again within this time.
const UNDER_WAY: Duration = Duration::from_secs(10);

/// How a command has ended.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum CallEnd {
    /// What was answered.
    Answered(MavResult),
    /// Nobody answers.
    Silent,
}

/// A command that waits for its answer.
#[derive(Clone, Debug)]
pub struct CommandCall {
    to: MavAddress,
    command: COMMAND_LONG_DATA,
    due: Time,
    is_under_way: bool,
}

impl CommandCall {
    /// Says a command; whom it is for is set here.
    pub fn begin(
        now: Time,
        to: MavAddress,
        command: COMMAND_LONG_DATA,
        out: &mut Vec<MavMessage>,
    ) -> CommandCall {
        let command = COMMAND_LONG_DATA {
            target_system: to.system,
            target_component: to.component,
            confirmation: 0,
            ..command
        };
        out.push(MavMessage::COMMAND_LONG(command.clone()));
        CommandCall {
            to,
            command,
            due: now + AGAIN,
            is_under_way: false,
        }
    }

    /// Hears an answer of a system; returns how it has ended, if it has.
    pub fn hear(&mut self, now: Time, from: MavAddress, ack: &COMMAND_ACK_DATA) -> Option<CallEnd> {
        if from != self.to || ack.command != self.command.command {
            return None;
        }
        if ack.result == MavResult::MAV_RESULT_IN_PROGRESS {
            (self.is_under_way, self.due) = (true, now + UNDER_WAY);
            return None;
        }
        Some(CallEnd::Answered(ack.result))
    }

    /// Returns when it is to be asked again without an answer.
    pub fn deadline(&self) -> Time {
        self.due
    }

    /// Goes on when its deadline has come; returns how it has ended, if it has.
    pub fn due(&mut self, now: Time, out: &mut Vec<MavMessage>) -> Option<CallEnd> {
        if now < self.due {
            return None;
        }
        if self.is_under_way || self.command.confirmation + 1 >= TRIES_MAX {
            return Some(CallEnd::Silent);
        }
        self.command.confirmation += 1;
        self.due = now + AGAIN;
        out.push(MavMessage::COMMAND_LONG(self.command.clone()));
        None
    }
}

/// Returns what an answer means, in words.
pub fn in_words(result: MavResult) -> &'static str {
    match result {
        MavResult::MAV_RESULT_ACCEPTED => "accepted",
        MavResult::MAV_RESULT_TEMPORARILY_REJECTED => "not possible just now",
        MavResult::MAV_RESULT_DENIED => "refused, since it makes no sense",
        MavResult::MAV_RESULT_UNSUPPORTED => "not known to this autopilot",
        MavResult::MAV_RESULT_FAILED => "not possible now",
        MavResult::MAV_RESULT_IN_PROGRESS => "under way",
        MavResult::MAV_RESULT_CANCELLED => "cancelled",
        MavResult::MAV_RESULT_COMMAND_LONG_ONLY => "known as COMMAND_LONG only",
        MavResult::MAV_RESULT_COMMAND_INT_ONLY => "known as COMMAND_INT only",
        MavResult::MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME => "not known in this frame",
        MavResult::MAV_RESULT_NOT_IN_CONTROL => "refused, since somebody else is in control",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mavlink::dialect::MavCmd;

    const TO: MavAddress = MavAddress {
        system: 1,
        component: 1,
    };

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    fn ack(command: MavCmd, result: MavResult) -> COMMAND_ACK_DATA {
        COMMAND_ACK_DATA {
            command,
            result,
            ..Default::default()
        }
    }

    fn said() -> (CommandCall, Vec<MavMessage>) {
        let mut out = Vec::new();
        let command = COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_NAV_LAND,
            ..Default::default()
        };
        (CommandCall::begin(at(1.0), TO, command, &mut out), out)
    }

    #[test]
    fn it_is_said_again_with_a_higher_confirmation_until_nobody_answers() {
        let (mut call, mut out) = said();
        assert_eq!(call.due(at(1.4), &mut out), None);
        let ends: Vec<_> = (1..8)
            .map(|turn| call.due(at(1.0 + 0.5 * f64::from(turn)), &mut out))
            .collect();
        assert_eq!(ends[..3], [None; 3]);
        assert_eq!(ends[3], Some(CallEnd::Silent));
        let confirmations: Vec<u8> = out
            .iter()
            .map(|message| match message {
                MavMessage::COMMAND_LONG(long) => long.confirmation,
                other => panic!("{other:?}"),
            })
            .collect();
        assert_eq!(confirmations, [0, 1, 2, 3]);
    }

    #[test]
    fn only_its_own_answer_ends_it_and_what_is_under_way_is_waited_for() {
        let (mut call, mut out) = said();
        let (land, arm) = (
            MavCmd::MAV_CMD_NAV_LAND,
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM,
        );
        let stranger = MavAddress {
            system: 2,
            component: 1,
        };
        assert_eq!(
            call.hear(at(1.1), TO, &ack(arm, MavResult::MAV_RESULT_ACCEPTED)),
            None
        );
        assert_eq!(
            call.hear(
                at(1.1),
                stranger,
                &ack(land, MavResult::MAV_RESULT_ACCEPTED)
            ),
            None
        );
        assert_eq!(
            call.hear(at(1.2), TO, &ack(land, MavResult::MAV_RESULT_IN_PROGRESS)),
            None
        );
        assert_eq!(
            (call.due(at(9.0), &mut out), out.len()),
            (None, 1),
            "it is not said again"
        );
        let failed = CallEnd::Answered(MavResult::MAV_RESULT_FAILED);
        assert_eq!(
            call.clone()
                .hear(at(9.1), TO, &ack(land, MavResult::MAV_RESULT_FAILED)),
            Some(failed)
        );
        assert_eq!(call.due(at(11.2), &mut out), Some(CallEnd::Silent));
    }
}
