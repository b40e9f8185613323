//! Looking around on the spot: which headings to turn to, one after the other, until what was unknown has
//! been seen or everything has been looked at.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::geom::Angle;
use crate::node::LookSettings;
use crate::time::Time;

/// Headings of a look all around, against the one toward what is unknown, degrees.
const AROUND_DEG: [f64; 6] = [0.0, 60.0, -60.0, 120.0, -120.0, 180.0];
/// Headings of a close look: the edges of the cones then sweep over what stands beside.
const CLOSELY_DEG: [f64; 5] = [0.0, 8.0, -8.0, 16.0, -16.0];
/// The heading of a single look.
const ONCE_DEG: [f64; 1] = [0.0];
/// A heading within this of the wanted one has been reached, radians.
const REACHED_RAD: f64 = 0.1;
/// A turn that is not obeyed is given up after this long.
const TURN_MAX: Duration = Duration::from_secs(12);

/// Returns how long a look takes once its heading is reached: every beam twice.
pub(super) fn dwell(look: &LookSettings) -> Duration {
    2 * look.cycle() + look.period
}

/// One look around.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct LookAround {
    toward: Angle,
    turn: usize,
    kind: LookKind,
    since: Time,
    seen_from: Option<Time>,
    /// To how many of its headings it has turned.
    turned: usize,
}

/// Which headings are looked along.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
enum LookKind {
    Around,
    Closely,
    Once,
}

impl LookKind {
    fn offsets_deg(self) -> &'static [f64] {
        match self {
            LookKind::Around => &AROUND_DEG,
            LookKind::Closely => &CLOSELY_DEG,
            LookKind::Once => &ONCE_DEG,
        }
    }
}

/// What to do next.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Next {
    /// Turn to this heading.
    Turn(Angle),
    /// Stay, the sensor is looking.
    Stay,
    /// All headings have been looked at.
    Over,
}

impl LookAround {
    /// Begins with the heading toward what is unknown.
    pub(super) fn toward(angle: Angle, now: Time) -> LookAround {
        LookAround {
            toward: angle,
            turn: 0,
            kind: LookKind::Around,
            since: now,
            seen_from: None,
            turned: 0,
        }
    }

    /// Looks along one heading only.
    pub(super) fn once(angle: Angle, now: Time) -> LookAround {
        LookAround {
            kind: LookKind::Once,
            ..LookAround::toward(angle, now)
        }
    }

    /// Looks from near at what lies along a heading.
    pub(super) fn closely(angle: Angle, now: Time) -> LookAround {
        LookAround {
            kind: LookKind::Closely,
            ..LookAround::toward(angle, now)
        }
    }

    /// Returns the heading that it began with.
    pub(super) fn toward_heading(&self) -> Angle {
        self.toward
    }

    /// Returns the heading looked at now.
    pub(super) fn heading(&self) -> Angle {
        let offsets_deg = self.kind.offsets_deg();
        self.toward + Angle::from_degrees(offsets_deg[self.turn.min(offsets_deg.len() - 1)])
    }

    /// Returns whether it has turned to half of its headings at least.
    pub(super) fn has_looked(&self) -> bool {
        2 * self.turned >= self.kind.offsets_deg().len()
    }

    /// Goes on: `dwell` is how long to look once a heading is reached.
    pub(super) fn next(
        &mut self,
        now: Time,
        heading: Angle,
        resting: bool,
        dwell: Duration,
    ) -> Next {
        let turned = (heading - self.heading()).radians().abs() <= REACHED_RAD;
        if turned && resting && self.seen_from.is_none() {
            self.seen_from = Some(now);
        }
        let seen = self.seen_from.is_some_and(|from| now.since(from) >= dwell);
        if !seen && now.since(self.since) < TURN_MAX {
            return Next::Stay;
        }
        self.turn += 1;
        self.turned += usize::from(turned || self.seen_from.is_some());
        self.since = now;
        self.seen_from = None;
        if self.turn >= self.kind.offsets_deg().len() {
            Next::Over
        } else {
            Next::Turn(self.heading())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_headings_are_looked_at_and_then_it_is_over() {
        let mut look = LookAround::toward(Angle::from_degrees(90.0), Time::ZERO);
        let dwell = Duration::from_millis(600);
        let (mut heading, mut turns, mut tick) = (look.heading(), 0, 0u32);
        loop {
            tick += 1;
            assert!(tick < 200, "a look ends");
            let now = Time::ZERO + Duration::from_millis(100) * tick;
            match look.next(now, heading, true, dwell) {
                Next::Turn(wanted) => {
                    turns += 1;
                    heading = wanted;
                }
                Next::Stay => {}
                Next::Over => break,
            }
        }
        assert_eq!(turns, 5);
    }

    #[test]
    fn a_turn_that_is_not_obeyed_is_given_up() {
        let mut look = LookAround::toward(Angle::default(), Time::ZERO);
        let away = Angle::from_degrees(170.0);
        let late = Time::from_secs_f64(13.0);
        assert!(matches!(
            look.next(late, away, true, Duration::ZERO),
            Next::Turn(_)
        ));
    }

    #[test]
    fn who_turned_to_half_of_the_headings_has_looked() {
        for (obeyed, has_looked) in [(1, false), (3, true), (6, true)] {
            let mut look = LookAround::toward(Angle::default(), Time::ZERO);
            let (mut heading, mut turns) = (look.heading(), 1);
            for second in 0..100 {
                match look.next(
                    Time::from_secs_f64(f64::from(second)),
                    heading,
                    true,
                    Duration::ZERO,
                ) {
                    Next::Turn(wanted) if turns < obeyed => (heading, turns) = (wanted, turns + 1),
                    Next::Turn(_) | Next::Stay => {}
                    Next::Over => break,
                }
            }
            assert_eq!(look.has_looked(), has_looked, "{obeyed}");
        }
    }
}
