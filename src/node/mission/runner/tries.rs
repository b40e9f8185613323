//! How often something was in the way although the vehicle has not moved, so that nothing is tried for ever. Pure
//! bookkeeping.

use serde::{Deserialize, Serialize};

use crate::geom::Point;

/// So often in a row something may be in the way without the vehicle having moved.
const TRIES_MAX: u32 = 16;
/// So many tries follow each other at once; before every further one it is waited longer.
const AT_ONCE: u32 = 2;
/// The longest wait, in shortest ones.
const WAIT_MAX: u32 = 5;
/// The vehicle has moved when it is this far from where something was in the way, metres.
const MOVED_M: f64 = 0.5;

/// Tries in vain at one place.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Tries {
    at: Point,
    count: u32,
}

impl Tries {
    /// Counts that something is in the way of the vehicle at a place; returns how many shortest waits to wait before the
    /// next try, none at first.
    pub(super) fn again(&mut self, place: Point) -> u32 {
        let has_moved = self.at.distance_to(place) > MOVED_M;
        *self = Tries {
            at: place,
            count: if has_moved { 1 } else { self.count + 1 },
        };
        self.count.saturating_sub(AT_ONCE).min(WAIT_MAX)
    }

    /// Returns whether the vehicle has tried so often that it must give up what it is going for.
    pub(super) fn are_spent(&self) -> bool {
        self.count >= TRIES_MAX
    }

    /// Forgets the tries: it goes for something else.
    pub(super) fn clear(&mut self) {
        self.count = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_tries_follow_at_once_and_the_others_later_and_later() {
        let mut tries = Tries::default();
        let waits: Vec<u32> = (0..10).map(|_| tries.again(Point::new(0.1, 0.0))).collect();
        assert_eq!(waits, [0, 0, 1, 2, 3, 4, 5, 5, 5, 5]);
        assert!(!tries.are_spent());
    }

    #[test]
    fn who_moves_between_tries_never_spends_them_and_who_stands_does() {
        let (mut moving, mut standing) = (Tries::default(), Tries::default());
        for step in 0..16 {
            assert!(!moving.are_spent() && !standing.are_spent(), "{step}");
            moving.again(Point::new(f64::from(step), 0.0));
            standing.again(Point::new(3.0, 0.0));
        }
        assert!(!moving.are_spent() && standing.are_spent());
        standing.clear();
        assert!(!standing.are_spent());
    }
}
