//! The command mode of a simulated module that speaks no frames: `+++` with silence before and behind it, then lines `AT…`. It
//! says what a line asks for; what that does is not known here.

use std::time::Duration;

use crate::hw::xbee_frame::AtName;
use crate::time::Time;

/// What a line ends with.
const END: u8 = b'\r';
/// The longest line, bytes.
const LINE_MOST: usize = 64;

/// Whether lines are read.
#[derive(Clone, Debug, Default)]
pub(super) struct CommandMode {
    /// When the host was last heard.
    heard_at: Option<Time>,
    state: State,
}

#[derive(Clone, Debug, Default)]
enum State {
    /// What comes is sent on the air.
    #[default]
    Off,
    /// `+++` has come behind a silence.
    Attention,
    /// Lines are read.
    On { line: Vec<u8> },
}

/// What the host has said.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum HostWords {
    /// Nothing that asks for anything.
    Nothing,
    /// What is to be sent on the air.
    Payload(Vec<u8>),
    /// Orders.
    Lines(Vec<Order>),
}

/// A line.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum Order {
    /// A register or command with a value, empty = none.
    Command(AtName, Vec<u8>),
    /// None.
    Unreadable,
}

impl CommandMode {
    /// Takes bytes of the host that began and have ended now; `guard` is the silence around `+++`.
    pub(super) fn take(
        &mut self,
        begins: Time,
        now: Time,
        guard: Duration,
        bytes: Vec<u8>,
    ) -> HostWords {
        let silence = self
            .heard_at
            .replace(now)
            .map_or(guard, |at| begins.since(at));
        match &mut self.state {
            State::On { line } => {
                line.extend_from_slice(&bytes);
                HostWords::Lines(orders(line))
            }
            State::Off | State::Attention if bytes == b"+++" && silence >= guard => {
                self.state = State::Attention;
                HostWords::Nothing
            }
            State::Off | State::Attention => {
                self.state = State::Off;
                HostWords::Payload(bytes)
            }
        }
    }

    /// Returns when it is entered or left if nothing comes.
    pub(super) fn deadline(&self, guard: Duration, timeout: Duration) -> Option<Time> {
        let heard_at = self.heard_at?;
        match self.state {
            State::Off => None,
            State::Attention => Some(heard_at + guard),
            State::On { .. } => Some(heard_at + timeout),
        }
    }

    /// It is entered or left; returns whether it is entered.
    pub(super) fn go_on(&mut self, now: Time) -> bool {
        let enters = matches!(self.state, State::Attention);
        self.heard_at = Some(now);
        self.state = match enters {
            true => State::On { line: Vec::new() },
            false => State::Off,
        };
        enters
    }

    /// It is left.
    pub(super) fn leave(&mut self) {
        self.state = State::Off;
    }
}

/// Takes whole lines out of what has come.
fn orders(text: &mut Vec<u8>) -> Vec<Order> {
    let mut found = Vec::new();
    while let Some(end) = text.iter().position(|byte| *byte == END) {
        let line: Vec<u8> = text.drain(..=end).collect();
        found.push(order(&line[..end]).unwrap_or(Order::Unreadable));
    }
    if text.len() > LINE_MOST {
        text.clear();
    }
    found
}

fn order(line: &[u8]) -> Option<Order> {
    let text = std::str::from_utf8(line).ok()?.trim();
    let rest = text
        .strip_prefix("AT")
        .or_else(|| text.strip_prefix("at"))?;
    let (name, value) = rest.split_at_checked(2)?;
    let name = AtName(name.to_ascii_uppercase().into_bytes().try_into().ok()?);
    let value = value.trim();
    if name == AtName(*b"NI") || value.is_empty() {
        return Some(Order::Command(name, value.as_bytes().to_vec()));
    }
    let number = u32::from_str_radix(value, 16).ok()?;
    Some(Order::Command(name, number.to_be_bytes().to_vec()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const GUARD: Duration = Duration::from_secs(1);

    fn at_ms(ms: u64) -> Time {
        Time::from_nanos(ms * 1_000_000)
    }

    fn take(mode: &mut CommandMode, ms: u64, bytes: &[u8]) -> HostWords {
        mode.take(at_ms(ms), at_ms(ms), GUARD, bytes.to_vec())
    }

    #[test]
    fn only_with_silence_around_it_it_is_entered() {
        let mut mode = CommandMode::default();
        assert_eq!(
            take(&mut mode, 5_000, b"x"),
            HostWords::Payload(b"x".to_vec())
        );
        assert_eq!(
            take(&mut mode, 5_500, b"+++"),
            HostWords::Payload(b"+++".to_vec())
        );
        assert_eq!(take(&mut mode, 6_500, b"+++"), HostWords::Nothing);
        assert_eq!(
            take(&mut mode, 7_000, b"x"),
            HostWords::Payload(b"x".to_vec())
        );
        assert_eq!(mode.deadline(GUARD, GUARD), None);
        take(&mut mode, 8_000, b"+++");
        assert_eq!(mode.deadline(GUARD, GUARD), Some(at_ms(9_000)));
        assert!(mode.go_on(at_ms(9_000)));
        assert!(!mode.go_on(at_ms(19_000)), "it is left when nothing comes");
    }

    #[test]
    fn lines_are_orders_in_whatever_pieces_they_come() {
        let mut mode = CommandMode::default();
        take(&mut mode, 5_000, b"+++");
        mode.go_on(at_ms(6_000));
        assert_eq!(take(&mut mode, 6_001, b"ATM"), HostWords::Lines(vec![]));
        let value = 2_u32.to_be_bytes().to_vec();
        let expected = vec![
            Order::Command(AtName(*b"MY"), value),
            Order::Command(AtName(*b"VR"), vec![]),
            Order::Unreadable,
            Order::Unreadable,
            Order::Command(AtName(*b"NI"), b"AB".to_vec()),
        ];
        let lines = b"Y 2\ratvr\rhello\rAT\xC3\xA9\xC3\xA9\rATNIAB\r";
        assert_eq!(take(&mut mode, 6_002, lines), HostWords::Lines(expected));
    }
}
