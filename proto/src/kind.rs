//! The kinds of messages, their numbers on the wire and their words.

use std::fmt;

/// A kind of message that this version knows. A number is never used again for something else; new kinds take the next
/// one, and nodes that do not know them drop them.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
#[repr(u8)]
#[allow(missing_docs, reason = "each variant is named as the message is")]
pub enum Kind {
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
}

impl Kind {
    /// All kinds, in the order of their numbers.
    pub const ALL: [Kind; 16] = [
        Kind::Hello,
        Kind::State,
        Kind::Tile,
        Kind::Digest,
        Kind::Want,
        Kind::Plan,
        Kind::Mission,
        Kind::Order,
        Kind::Samples,
        Kind::Have,
        Kind::Beacon,
        Kind::Health,
        Kind::Report,
        Kind::Standing,
        Kind::Task,
        Kind::Image,
    ];

    /// Returns the number in a frame's header.
    pub fn number(self) -> u8 {
        self as u8
    }

    /// Returns the kind of a number; `None` when this version does not know it.
    pub fn from_number(number: u8) -> Option<Kind> {
        Kind::ALL.get(usize::from(number)).copied()
    }

    /// Returns the word that keys, files and tables name it by.
    pub fn word(self) -> &'static str {
        match self {
            Kind::Hello => "hello",
            Kind::State => "state",
            Kind::Tile => "tile",
            Kind::Digest => "digest",
            Kind::Want => "want",
            Kind::Plan => "plan",
            Kind::Mission => "mission",
            Kind::Order => "order",
            Kind::Samples => "samples",
            Kind::Have => "have",
            Kind::Beacon => "beacon",
            Kind::Health => "health",
            Kind::Report => "report",
            Kind::Standing => "standing",
            Kind::Task => "task",
            Kind::Image => "image",
        }
    }
}

impl fmt::Display for Kind {
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
            let kind = Kind::from_number(number);
            assert_eq!(
                kind.is_some(),
                usize::from(number) < Kind::ALL.len(),
                "{number}"
            );
            assert!(kind.is_none_or(|kind| kind.number() == number), "{number}");
        }
    }
}
