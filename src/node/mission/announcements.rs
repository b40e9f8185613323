//! What the mission has told the other actors last, so that only news is told; and when its progress is told again although
//! nothing has changed.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Position, RunId, StandReason, VehicleId};

use super::Out;
use crate::time::{Deadline, Time};

/// Progress is repeated this often.
const REPEAT_EVERY: Duration = Duration::from_secs(1);
/// So much later than the one before it each vehicle begins to repeat, so that they do not all speak at once.
const REPEAT_APART: Duration = Duration::from_millis(53);

/// What was told last.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Announcements {
    holds: Option<StandReason>,
    measure: Option<RunId>,
    goal: Option<Position>,
    repeat_at: Time,
}

impl Announcements {
    /// Makes those of a vehicle that has told nothing.
    pub(super) fn new(own: VehicleId) -> Announcements {
        Announcements {
            holds: None,
            measure: None,
            goal: None,
            repeat_at: Time::ZERO + REPEAT_EVERY + REPEAT_APART * u32::from(own.0),
        }
    }

    /// Records for which run is measured; returns what is to be said if that has changed.
    pub(super) fn measure(&mut self, run: Option<RunId>) -> Option<Out> {
        let is_news = run != std::mem::replace(&mut self.measure, run);
        is_news.then_some(Out::Measure(run))
    }

    /// Records why the vehicle stands and does not go on by itself; returns what is to be said if that has changed.
    pub(super) fn holds(&mut self, why: Option<StandReason>) -> Option<Out> {
        let is_news = why != std::mem::replace(&mut self.holds, why);
        is_news.then_some(Out::Holds(why))
    }

    /// Records where the vehicle is going; returns whether that has changed.
    pub(super) fn goal(&mut self, goal: Option<Position>) -> bool {
        goal != std::mem::replace(&mut self.goal, goal)
    }

    /// Returns whether progress is to be told again now, and no more until later.
    pub(super) fn repeats(&mut self, now: Time) -> bool {
        let is_due = self.repeat_at <= now;
        if is_due {
            self.repeat_at = now + REPEAT_EVERY;
        }
        is_due
    }

    /// Returns when progress is told again.
    pub(super) fn deadline(&self) -> Deadline {
        Deadline {
            at: self.repeat_at,
            why: "repeat progress",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_news_is_told() {
        let mut announcements = Announcements::new(VehicleId(1));
        let run = Some(RunId(3));
        assert_eq!(
            (announcements.measure(None), announcements.holds(None)),
            (None, None)
        );
        assert_eq!(announcements.measure(run), Some(Out::Measure(run)));
        assert_eq!(announcements.measure(run), None);
        assert_eq!(announcements.measure(None), Some(Out::Measure(None)));
        let why = Some(StandReason::Held);
        assert_eq!(announcements.holds(why), Some(Out::Holds(why)));
        assert_eq!(announcements.holds(why), None);
    }

    #[test]
    fn a_goal_is_told_when_it_changes() {
        let mut announcements = Announcements::new(VehicleId(1));
        let goal = Some(Position::from_metres(1.0, 2.0, 0.0));
        let told = [None, goal, goal, None].map(|goal| announcements.goal(goal));
        assert_eq!(told, [false, true, false, true]);
    }

    #[test]
    fn progress_is_repeated_once_a_second_and_by_no_two_vehicles_at_once() {
        let mut announcements = Announcements::new(VehicleId(1));
        let due = announcements.deadline().at;
        assert_ne!(due, Announcements::new(VehicleId(2)).deadline().at);
        assert!(
            !announcements.repeats(Time::ZERO)
                && announcements.repeats(due)
                && !announcements.repeats(due)
        );
        assert_eq!(announcements.deadline().at.since(due), REPEAT_EVERY);
    }
}
