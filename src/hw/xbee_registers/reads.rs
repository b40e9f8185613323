//! Reads the registers of a module one after the other. A pure machine; what they are to be is not known here.
//!
//! ```text
//!   Asked ─answer─► the next one asked …, after the last one ─► Read
//!     ├─ no answer for a while ─► asked again, thrice in all ─► Silent
//!     └─ answer of an error ─► asked again, thrice in all ─► noted as that, and the next one asked
//! ```
//!
//! The first question, which is for the mode, and its answer hold no byte that is escaped: they are understood in both modes.
//! So a module in the other one is known as such, and the rest is asked in its own.

use std::time::Duration;

use super::{AP, READ, RegisterAnswer, Registers, value_of};
use crate::hw::xbee_frame::{ApiMode, AtName, Frame, encode};
use crate::time::Time;

/// A register that is not answered is asked for again after this time.
const AGAIN: Duration = Duration::from_millis(200);
/// It is asked for so often at most.
const TRIES_MAX: u8 = 3;
/// The status of an answer to what the module does not know (Digi 90000982, frame 0x88).
const UNKNOWN: u8 = 2;
/// The numbers of questions: with these no byte of the first question and its answer is escaped.
const IDS: u8 = 8;

/// How reading goes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ReadState {
    /// An answer is awaited.
    Asked,
    /// All are read.
    Read,
    /// The module does not answer.
    Silent,
}

/// The reading of a module's registers.
#[derive(Clone, Debug)]
pub struct RegisterReads {
    mode: ApiMode,
    found: Registers,
    /// Index of the register that is asked for.
    next: usize,
    tries: u8,
    id: u8,
    due: Time,
}

impl RegisterReads {
    /// Asks for the first one; `mode` is what the module is believed to have.
    pub fn begin(now: Time, mode: ApiMode, bytes: &mut Vec<u8>) -> RegisterReads {
        let mut reads = RegisterReads {
            mode,
            found: Registers::default(),
            next: 0,
            tries: 0,
            id: 0,
            due: now,
        };
        reads.ask(now, bytes);
        reads
    }

    /// Hears an answer; one to another question changes nothing.
    pub fn hear(&mut self, now: Time, answer: &Answer, bytes: &mut Vec<u8>) -> ReadState {
        if READ.get(self.next) != Some(&answer.name) || answer.id != self.id {
            return ReadState::Asked;
        }
        let found = answer.of_register();
        // What cannot be told now may be told a moment later.
        if matches!(found, RegisterAnswer::Failed(_)) && self.tries < TRIES_MAX {
            return ReadState::Asked;
        }
        self.found.note(answer.name, found);
        if answer.name == AP {
            self.mode = answer
                .value
                .and_then(ApiMode::of_register)
                .unwrap_or(self.mode);
        }
        (self.next, self.tries) = (self.next + 1, 0);
        if self.next == READ.len() {
            return ReadState::Read;
        }
        self.ask(now, bytes);
        ReadState::Asked
    }

    /// Returns when the register is to be asked for again.
    pub fn deadline(&self) -> Time {
        self.due
    }

    /// Goes on when its deadline has come.
    pub fn due(&mut self, now: Time, bytes: &mut Vec<u8>) -> ReadState {
        if now < self.due {
            return ReadState::Asked;
        }
        if self.tries == TRIES_MAX {
            return ReadState::Silent;
        }
        self.ask(now, bytes);
        ReadState::Asked
    }

    /// Returns the mode that the module has said, or is believed to have before.
    pub fn mode(&self) -> ApiMode {
        self.mode
    }

    /// Returns what was read.
    pub fn found(&self) -> &Registers {
        &self.found
    }

    fn ask(&mut self, now: Time, bytes: &mut Vec<u8>) {
        let Some(name) = READ.get(self.next) else {
            return;
        };
        (self.tries, self.due) = (self.tries + 1, now + AGAIN);
        self.id = self.id % IDS + 1;
        command(self.id, *name, &[], self.mode, bytes);
    }
}

/// What a module answers to a command.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Answer {
    /// Which question.
    pub id: u8,
    /// Which register or command.
    pub name: AtName,
    /// 0 = done; others as in [`Frame::CommandAnswer`].
    pub status: u8,
    /// The value that was read; `None` = the answer has none, or its status is not 0.
    pub value: Option<u32>,
}

impl Answer {
    /// Returns the answer that a frame is, if it is one.
    pub fn of(frame: &Frame<'_>) -> Option<Answer> {
        let Frame::CommandAnswer {
            id,
            name,
            status,
            value,
        } = *frame
        else {
            return None;
        };
        let is_value = status == 0 && !value.is_empty();
        Some(Answer {
            id,
            name,
            status,
            value: is_value.then(|| value_of(value)),
        })
    }

    /// Returns what it says of a register that was asked for.
    fn of_register(&self) -> RegisterAnswer {
        match (self.value, self.status) {
            (Some(value), _) => RegisterAnswer::Value(value),
            (None, UNKNOWN) => RegisterAnswer::NotKnown,
            (None, status) => RegisterAnswer::Failed(status),
        }
    }
}

/// Appends a command, or a question for a register.
pub fn command(id: u8, name: AtName, value: &[u8], mode: ApiMode, bytes: &mut Vec<u8>) {
    // No value is so long that its frame would be too long.
    let _ = encode(&Frame::Command { id, name, value }, mode, bytes);
}

#[cfg(test)]
mod tests {
    use super::super::{AO, EE};
    use super::*;
    use crate::hw::xbee_frame::Decoder;

    fn at_ms(ms: u64) -> Time {
        Time::from_nanos(ms * 1_000_000)
    }

    /// The questions that bytes are.
    fn questions(mode: ApiMode, bytes: &mut Vec<u8>) -> Vec<(u8, String)> {
        let mut found = Vec::new();
        Decoder::new(mode).take(bytes, |frame| match frame {
            Frame::Command { id, name, .. } => found.push((id, name.to_string())),
            other => panic!("{other:?}"),
        });
        bytes.clear();
        found
    }

    fn answer(id: u8, name: AtName, value: u32) -> Answer {
        Answer {
            id,
            name,
            status: 0,
            value: Some(value),
        }
    }

    #[test]
    fn all_registers_are_read_one_after_the_other() {
        let mut bytes = Vec::new();
        let mut reads = RegisterReads::begin(at_ms(0), ApiMode::Escaped, &mut bytes);
        for (index, name) in READ.into_iter().enumerate() {
            let asked = questions(ApiMode::Escaped, &mut bytes);
            assert_eq!(asked.len(), 1);
            assert_eq!(asked[0].1, name.to_string());
            let wrong = [
                answer(asked[0].0 + 1, name, 9),
                answer(asked[0].0, AtName(*b"ZZ"), 9),
            ];
            for wrong in wrong {
                assert_eq!(reads.hear(at_ms(1), &wrong, &mut bytes), ReadState::Asked);
            }
            let state = reads.hear(at_ms(1), &answer(asked[0].0, name, 2), &mut bytes);
            let is_last = index + 1 == READ.len();
            assert_eq!(state == ReadState::Read, is_last);
        }
        assert!(bytes.is_empty());
        assert!(READ.iter().all(|name| reads.found().get(*name) == Some(2)));
    }

    #[test]
    fn a_question_is_said_thrice_and_then_the_module_is_silent() {
        let mut bytes = Vec::new();
        let mut reads = RegisterReads::begin(at_ms(0), ApiMode::Plain, &mut bytes);
        for ms in [100, 200, 300, 400] {
            assert_eq!(reads.due(at_ms(ms), &mut bytes), ReadState::Asked);
        }
        assert_eq!(questions(ApiMode::Plain, &mut bytes).len(), 3);
        assert_eq!(reads.due(at_ms(600), &mut bytes), ReadState::Silent);
    }

    /// Reads all registers of a module that answers AO with a status and no value, at the given time of asking.
    fn read_with(status_of_ao: impl Fn(usize) -> u8) -> (Registers, usize) {
        let mut bytes = Vec::new();
        let mut reads = RegisterReads::begin(at_ms(0), ApiMode::Plain, &mut bytes);
        let (mut ms, mut times) = (0, 0);
        for _ in 0..100 {
            for (id, name) in questions(ApiMode::Plain, &mut bytes) {
                let name = AtName(name.as_bytes().try_into().unwrap());
                let mut answer = answer(id, name, 2);
                if name == AO {
                    let status = status_of_ao(times);
                    answer.status = status;
                    answer.value = (status == 0).then_some(2);
                    times += 1;
                }
                if reads.hear(at_ms(ms), &answer, &mut bytes) == ReadState::Read {
                    return (reads.found().clone(), times);
                }
            }
            ms += 50;
            assert_eq!(reads.due(at_ms(ms), &mut bytes), ReadState::Asked);
        }
        panic!("it is asked for ever");
    }

    #[test]
    fn an_answer_of_an_error_is_asked_for_again_and_does_not_mean_that_a_register_is_not_known() {
        for (statuses, expected, asked) in [
            ([2, 2, 2], RegisterAnswer::NotKnown, 1),
            ([1, 1, 1], RegisterAnswer::Failed(1), 3),
            ([4, 3, 4], RegisterAnswer::Failed(4), 3),
            ([4, 0, 0], RegisterAnswer::Value(2), 2),
        ] {
            let (found, times) = read_with(|time| statuses[time]);
            assert_eq!((found.answer(AO), times), (Some(expected), asked));
            assert_eq!(found.answer(EE), Some(RegisterAnswer::Value(2)));
        }
    }

    #[test]
    fn the_mode_is_asked_for_and_answered_alike_in_both_modes() {
        for mode in [ApiMode::Plain, ApiMode::Escaped] {
            for id in 1..=IDS {
                let (mut plain, mut escaped) = (Vec::new(), Vec::new());
                command(id, AP, &[], ApiMode::Plain, &mut plain);
                command(id, AP, &[], ApiMode::Escaped, &mut escaped);
                assert_eq!(plain, escaped);
                let value = &[mode.register()];
                let frame = Frame::CommandAnswer {
                    id,
                    name: AP,
                    status: 0,
                    value,
                };
                let (mut plain, mut escaped) = (Vec::new(), Vec::new());
                encode(&frame, ApiMode::Plain, &mut plain).unwrap();
                encode(&frame, ApiMode::Escaped, &mut escaped).unwrap();
                assert_eq!(plain, escaped);
            }
        }
    }
}
