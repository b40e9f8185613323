//! The kinds of messages, their numbers on the wire and their words.

use std::fmt;

/// A kind of message that this version knows. A number is never used again for something else; new kinds take the next
/// one, and nodes that do not know them drop them.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
#[repr(u8)]
#[allow(missing_docs, reason = "each variant is named as the message is")]
pub enum MessageKind {
    Hello = 0,
    State = 1,
    Tile = 2,
    Digest = 3,
    Want = 4,
    Plan = 5,
    Mission = 6,
    Order = 7,
    Samples = 8,
    Have = 9,
    Beacon = 10,
    Health = 11,
    Report = 12,
    Standing = 13,
    Task = 14,
    Image = 15,
    Fix = 16,
    Mark = 17,
    Look = 18,
    Log = 19,
    Settings = 20,
}

impl MessageKind {
    /// All kinds, in the order of their numbers.
    pub const ALL: [MessageKind; 21] = [
        MessageKind::Hello,
        MessageKind::State,
        MessageKind::Tile,
        MessageKind::Digest,
        MessageKind::Want,
        MessageKind::Plan,
        MessageKind::Mission,
        MessageKind::Order,
        MessageKind::Samples,
        MessageKind::Have,
        MessageKind::Beacon,
        MessageKind::Health,
        MessageKind::Report,
        MessageKind::Standing,
        MessageKind::Task,
        MessageKind::Image,
        MessageKind::Fix,
        MessageKind::Mark,
        MessageKind::Look,
        MessageKind::Log,
        MessageKind::Settings,
    ];

    /// Returns the number in a frame's header.
    pub fn number(self) -> u8 {
        self as u8
    }

    /// Returns the kind of a number; `None` when this version does not know it.
    pub fn from_number(number: u8) -> Option<MessageKind> {
        MessageKind::ALL.get(usize::from(number)).copied()
    }

    /// Returns the word that keys, files and tables name it by.
    pub fn word(self) -> &'static str {
        match self {
            MessageKind::Hello => "hello",
            MessageKind::State => "state",
            MessageKind::Tile => "tile",
            MessageKind::Digest => "digest",
            MessageKind::Want => "want",
            MessageKind::Plan => "plan",
            MessageKind::Mission => "mission",
            MessageKind::Order => "order",
            MessageKind::Samples => "samples",
            MessageKind::Have => "have",
            MessageKind::Beacon => "beacon",
            MessageKind::Health => "health",
            MessageKind::Report => "report",
            MessageKind::Standing => "standing",
            MessageKind::Task => "task",
            MessageKind::Image => "image",
            MessageKind::Fix => "fix",
            MessageKind::Mark => "mark",
            MessageKind::Look => "look",
            MessageKind::Log => "log",
            MessageKind::Settings => "settings",
        }
    }
}

impl fmt::Display for MessageKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_is_found_by_its_number_and_no_other_number_is_one() {
        for number in 0..=u8::MAX {
            let kind = MessageKind::from_number(number);
            assert_eq!(
                kind.is_some(),
                usize::from(number) < MessageKind::ALL.len(),
                "{number}"
            );
            assert!(kind.is_none_or(|kind| kind.number() == number), "{number}");
        }
    }
}
