//! Numbers that a sender counts up, when they come below the highest one heard: a few are late, but when they go on, one
//! after the other, and nothing higher comes any more, the highest was not its word.

use serde::{Deserialize, Serialize};

use super::VOID_AFTER;
use crate::time::Time;

/// So many must have come: two late ones are soon far apart.
const FEWEST: u32 = 5;

/// Numbers below the highest one, since that was heard.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct LowerNumbers(Option<Rise>);

/// How they have gone on.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
struct Rise {
    since: Time,
    last_at: Time,
    last: u64,
    count: u32,
}

impl LowerNumbers {
    /// Takes one of them; returns whether they are what is true.
    pub fn go_on(&mut self, now: Time, number: u64) -> bool {
        let first = Rise {
            since: now,
            last_at: now,
            last: number,
            count: 1,
        };
        let rise = self.0.get_or_insert(first);
        if now.since(rise.last_at) >= VOID_AFTER {
            *rise = first;
        } else if number > rise.last {
            *rise = Rise {
                since: rise.since,
                last_at: now,
                last: number,
                count: rise.count.saturating_add(1),
            };
        }
        rise.count >= FEWEST && rise.last == number && now.since(rise.since) >= VOID_AFTER
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    #[test]
    fn what_goes_on_for_ten_seconds_is_true() {
        let mut lower = LowerNumbers::default();
        for second in 0..10_u32 {
            assert!(
                !lower.go_on(at(f64::from(second)), u64::from(second)),
                "{second} s"
            );
        }
        assert!(!lower.go_on(at(10.0), 3), "it comes late itself");
        assert!(lower.go_on(at(10.0), 10));
    }

    #[test]
    fn late_ones_are_not_true_however_far_apart() {
        let mut lower = LowerNumbers::default();
        for turn in 0..20_u32 {
            assert!(
                !lower.go_on(at(f64::from(turn) * 10.0), u64::from(turn)),
                "{turn}"
            );
        }
        let mut again = LowerNumbers::default();
        assert!(
            (0..50).all(|turn| !again.go_on(at(f64::from(turn)), 7)),
            "one is said again and again"
        );
        let mut few = LowerNumbers::default();
        assert!(
            [0.0, 4.0, 8.0, 12.0]
                .iter()
                .all(|at_s| !few.go_on(at(*at_s), *at_s as u64)),
            "only four"
        );
    }
}
