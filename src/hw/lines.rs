//! Lines of text out of a stream of bytes that may be anything. It holds 128 bytes whatever comes, and does not know what
//! a line means.
//!
//! ```text
//!   [Skipping] ──end of line──► [Taking] ──end of line──► a line; [Taking]
//!       ▲                          │
//!       └──── begun anew, 129 bytes┘
//! ```
//!
//! It begins by skipping: what it is told first may be the end of a line whose beginning nobody heard.

use crate::time::Time;

/// The longest line, bytes without its end.
pub(super) const LONGEST_LINE: usize = 128;

/// Cuts bytes into lines, which end with CR, LF or both.
#[derive(Clone, Debug)]
pub(super) struct Lines {
    state: State,
    too_long: u64,
}

#[derive(Clone, Debug)]
enum State {
    /// What comes belongs to a line that is not wanted.
    Skipping,
    /// What has come of a line.
    Taking {
        /// Its first byte came then or later.
        since: Time,
        line: Vec<u8>,
    },
}

impl Lines {
    /// Makes it; the first line that it gives is the first one whose beginning was heard.
    pub(super) fn new() -> Lines {
        Lines {
            state: State::Skipping,
            too_long: 0,
        }
    }

    /// Drops what was begun; the next line that it gives is the next one whose beginning is heard.
    pub(super) fn restart(&mut self) {
        self.state = State::Skipping;
    }

    /// Takes bytes that came at `since` or later, and gives each line that they end: when its first byte came at the
    /// earliest, and its bytes. Empty lines are passed over.
    pub(super) fn take(&mut self, since: Time, bytes: &[u8], mut give: impl FnMut(Time, &[u8])) {
        for byte in bytes {
            if matches!(byte, b'\r' | b'\n') {
                match &mut self.state {
                    State::Skipping => {
                        let line = Vec::with_capacity(LONGEST_LINE);
                        self.state = State::Taking { since, line };
                    }
                    State::Taking { line, since } => {
                        if !line.is_empty() {
                            give(*since, line);
                        }
                        line.clear();
                    }
                }
                continue;
            }
            let State::Taking { line, since: begun } = &mut self.state else {
                continue;
            };
            if line.len() >= LONGEST_LINE {
                self.state = State::Skipping;
                self.too_long += 1;
                continue;
            }
            if line.is_empty() {
                *begun = since;
            }
            line.push(*byte);
        }
    }

    /// Returns how many lines were too long.
    pub(super) fn too_long(&self) -> u64 {
        self.too_long
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(time_ms: u64) -> Time {
        Time::from_nanos(time_ms * 1_000_000)
    }

    /// Returns what lines come of chunks, one every millisecond.
    fn lines(lines: &mut Lines, chunks: &[&[u8]]) -> Vec<(Time, String)> {
        let mut found = Vec::new();
        for (time_ms, chunk) in (0..).zip(chunks) {
            let give = |since, line: &[u8]| {
                found.push((since, String::from_utf8_lossy(line).into_owned()))
            };
            lines.take(at(time_ms), chunk, give);
        }
        found
    }

    fn texts(chunks: &[&[u8]]) -> Vec<String> {
        lines(&mut Lines::new(), chunks)
            .into_iter()
            .map(|(_, text)| text)
            .collect()
    }

    #[test]
    fn what_comes_before_the_first_end_of_a_line_is_no_line() {
        assert_eq!(texts(&[b"34\rR1200\rR13"]), ["R1200"]);
        let mut begun = Lines::new();
        assert_eq!(lines(&mut begun, &[b"\rR1200\rR1"]).len(), 1);
        begun.restart();
        assert_eq!(
            lines(&mut begun, &[b"300\rR1400\r"]),
            [(at(0), "R1400".to_owned())]
        );
    }

    #[test]
    fn every_end_of_a_line_ends_it_and_empty_lines_are_passed_over() {
        assert_eq!(texts(&[b"\n1\r\n2\n\n\n3\r4\n"]), ["1", "2", "3", "4"]);
    }

    #[test]
    fn a_line_is_as_old_as_its_first_byte() {
        let found = lines(
            &mut Lines::new(),
            &[b"\rR1", b"23", b"4\r", b"R5", b"000\rR1\r"],
        );
        let expected = [(at(0), "R1234"), (at(3), "R5000"), (at(4), "R1")];
        assert_eq!(
            found,
            expected.map(|(since, text)| (since, text.to_owned()))
        );
    }

    #[test]
    fn a_line_that_is_too_long_is_counted_once_and_the_next_one_comes_whole() {
        let mut split = Lines::new();
        let long = [b"\r".as_slice(), &[b'7'; 10_000], b"\rR1000\r"].concat();
        assert_eq!(lines(&mut split, &[&long]), [(at(0), "R1000".to_owned())]);
        assert_eq!(split.too_long(), 1);
        let just_so = [b"".as_slice(), &[b'7'; LONGEST_LINE], b"\r"].concat();
        assert_eq!(lines(&mut split, &[&just_so]).len(), 1);
        assert_eq!(split.too_long(), 1);
        let one_more = [b"".as_slice(), &[b'7'; LONGEST_LINE + 1], b"\r"].concat();
        assert_eq!(lines(&mut split, &[&one_more]), []);
        assert_eq!(split.too_long(), 2);
    }

    proptest! {
        #[test]
        fn lines_come_the_same_however_the_bytes_are_cut(
            bytes in prop::collection::vec(prop_oneof![any::<u8>(), Just(b'\r'), Just(b'\n'), Just(b'1')], 0..600),
            cuts in prop::collection::vec(1..200_usize, 1..10),
        ) {
            let (mut chunks, mut rest) = (Vec::new(), &bytes[..]);
            for cut in cuts.iter().cycle() {
                let (chunk, after) = rest.split_at((*cut).min(rest.len()));
                chunks.push(chunk);
                rest = after;
                if rest.is_empty() {
                    break;
                }
            }
            prop_assert_eq!(texts(&chunks), texts(&[&bytes]));
            let mut split = Lines::new();
            for (_, line) in lines(&mut split, &chunks) {
                prop_assert!(!line.is_empty());
            }
            let State::Taking { line, .. } = &split.state else { return Ok(()) };
            prop_assert!(line.len() <= LONGEST_LINE && line.capacity() <= LONGEST_LINE);
        }
    }
}
