//! Finds a module: asks for its mode by a frame at every baud rate, and where none answers tries to get its attention by `+++`,
//! which a module takes that speaks no frames. The frame and its answer are the same in both API modes.
//!
//! ```text
//!   [asking, at each baud rate] ─answer─► found
//!        │ none at any
//!        ▼
//!   [quiet 1.1 s] ─► "+++" ─► [quiet, "OK"] ─► "ATAP2" "ATCN" ─► [asking] ─answer─► found
//!        ▲                        │ none                            │ none
//!        └──── the next baud rate ┴─────────────────────────────────┘
//! ```

use std::time::Duration;

use super::SetupOut;
use crate::hw::xbee_frame::{ApiMode, Decoder};
use crate::hw::xbee_registers::{AP, Answer, command};
use crate::time::Time;

/// Where it is looked for first: where modules come from the factory or were left by a set-up.
const LIKELY_BAUDS: [u32; 9] = [
    115_200, 57_600, 9_600, 230_400, 38_400, 19_200, 4_800, 2_400, 1_200,
];
/// An answer comes within this time, at any baud rate.
const ANSWER_WITHIN: Duration = Duration::from_millis(350);
/// At each baud rate it is asked so often.
const TRIES_MAX: u8 = 2;
/// Before and behind `+++` nothing may be said for a second (register GT).
const QUIET: Duration = Duration::from_millis(1100);
/// Behind `+++` the answer comes within this time.
const ATTENTION: Duration = Duration::from_millis(1600);
/// What a module answers to an order in words.
const OK: &[u8] = b"OK\r";
/// More than this of its words is not kept.
const WORDS_MOST: usize = 16;

/// How a search has ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum SearchEnd {
    /// It speaks frames of this mode now, at the baud rate that was said last.
    Found { mode: ApiMode },
    /// Nothing answers.
    Nowhere,
}

/// The search for a module.
#[derive(Clone, Debug)]
pub(super) struct Search {
    decoder: Decoder,
    /// The last bytes that came.
    words: Vec<u8>,
    /// Index of the baud rate.
    index: usize,
    /// Whether it is looked for by `+++`.
    by_words: bool,
    phase: Phase,
    due: Time,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Phase {
    /// It was asked by a frame, so often.
    Asked(u8),
    /// Nothing is said.
    Quiet,
    /// `+++` was said.
    Attention,
    /// It was told to speak frames.
    Mode,
    /// It was told to leave its command mode.
    Leave,
}

impl Search {
    /// Begins at the likeliest baud rate.
    pub(super) fn begin(now: Time, out: &mut Vec<SetupOut>) -> Search {
        let mut search = Search {
            // Both modes are understood: see `RegisterReads`.
            decoder: Decoder::new(ApiMode::Escaped),
            words: Vec::new(),
            index: 0,
            by_words: false,
            phase: Phase::Quiet,
            due: now,
        };
        search.set_baud(out);
        search.ask(now, 1, out);
        search
    }

    /// Takes bytes; returns how it has ended, if it has.
    pub(super) fn take(
        &mut self,
        now: Time,
        bytes: &[u8],
        out: &mut Vec<SetupOut>,
    ) -> Option<SearchEnd> {
        if let Phase::Asked(_) = self.phase {
            let mode = self.mode_said(bytes)?;
            let baud = self.baud();
            let said = (!self.by_words).then_some(mode);
            out.push(SetupOut::Found { baud, mode: said });
            return Some(SearchEnd::Found { mode });
        }
        self.words.extend_from_slice(bytes);
        let over = self.words.len().saturating_sub(WORDS_MOST);
        self.words.drain(..over);
        if self.words.ends_with(OK) {
            self.words.clear();
            self.go_on_in_words(now, out);
        }
        None
    }

    /// Returns when it goes on without an answer.
    pub(super) fn deadline(&self) -> Time {
        self.due
    }

    /// Goes on when its deadline has come; returns how it has ended, if it has.
    pub(super) fn due(&mut self, now: Time, out: &mut Vec<SetupOut>) -> Option<SearchEnd> {
        match self.phase {
            Phase::Asked(tries) if tries < TRIES_MAX => self.ask(now, tries + 1, out),
            Phase::Quiet => {
                out.push(SetupOut::Write(b"+++".to_vec()));
                (self.phase, self.due) = (Phase::Attention, now + ATTENTION);
                self.words.clear();
            }
            Phase::Asked(_) | Phase::Attention | Phase::Mode | Phase::Leave => {
                return self.next_baud(now, out);
            }
        }
        None
    }

    fn next_baud(&mut self, now: Time, out: &mut Vec<SetupOut>) -> Option<SearchEnd> {
        self.index += 1;
        if self.index == LIKELY_BAUDS.len() {
            if self.by_words {
                return Some(SearchEnd::Nowhere);
            }
            (self.index, self.by_words) = (0, true);
        }
        self.set_baud(out);
        match self.by_words {
            true => (self.phase, self.due) = (Phase::Quiet, now + QUIET),
            false => self.ask(now, 1, out),
        }
        None
    }

    fn go_on_in_words(&mut self, now: Time, out: &mut Vec<SetupOut>) {
        let (words, phase): (&[u8], Phase) = match self.phase {
            Phase::Attention => (b"ATAP2\r", Phase::Mode),
            Phase::Mode => (b"ATCN\r", Phase::Leave),
            Phase::Leave => return self.ask(now, 1, out),
            Phase::Asked(_) | Phase::Quiet => return,
        };
        out.push(SetupOut::Write(words.to_vec()));
        (self.phase, self.due) = (phase, now + ATTENTION);
    }

    /// Asks for the mode by a frame.
    fn ask(&mut self, now: Time, tries: u8, out: &mut Vec<SetupOut>) {
        let mut bytes = Vec::new();
        command(tries, AP, &[], ApiMode::Escaped, &mut bytes);
        out.push(SetupOut::Write(bytes));
        (self.phase, self.due) = (Phase::Asked(tries), now + ANSWER_WITHIN);
    }

    fn set_baud(&mut self, out: &mut Vec<SetupOut>) {
        self.decoder.restart(ApiMode::Escaped);
        out.push(SetupOut::Baud(self.baud()));
    }

    fn baud(&self) -> u32 {
        LIKELY_BAUDS
            .get(self.index)
            .copied()
            .unwrap_or(LIKELY_BAUDS[0])
    }

    /// Returns the mode that the module says that it has, if these bytes say so.
    fn mode_said(&mut self, bytes: &[u8]) -> Option<ApiMode> {
        let mut mode = None;
        self.decoder.take(bytes, |frame| {
            let said = Answer::of(&frame).filter(|answer| answer.name == AP);
            let value = said.and_then(|answer| answer.value);
            mode = value.and_then(ApiMode::of_register).or(mode);
        });
        mode
    }
}
