//! What a run shows of itself while it goes on, for whoever watches: how far it is, where everybody truly is, and what
//! the ground station knows of the place. Watching changes nothing.

use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::kernel::RunProgress;
use crate::geom::{Angle, Point};
use crate::map::Merged;
use crate::node::mission::MissionStatus;
use crate::time::Time;

/// A run at one moment.
#[derive(Clone, Debug)]
pub struct RunView<'a> {
    /// How far it is.
    pub status: RunProgress,
    /// The map that the ground station holds.
    pub map: &'a Merged,
    /// Everybody, in the order of their ids.
    pub vehicles: Vec<VehicleSnapshot>,
}

/// A vehicle at one moment.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct VehicleSnapshot {
    /// Which one.
    pub id: VehicleId,
    /// Where it truly is.
    pub at: Point,
    /// Where it faces.
    pub heading: Angle,
    /// What it does; `None` while its software does not run.
    pub status: Option<MissionStatus>,
}

/// When a run shows itself next.
#[derive(Clone, Copy, Debug)]
pub(super) struct ViewSchedule {
    every: Duration,
    next: Time,
}

impl ViewSchedule {
    pub(super) fn every(every: Duration) -> ViewSchedule {
        let every = every.max(Duration::from_millis(1));
        ViewSchedule {
            every,
            next: Time::ZERO + every,
        }
    }

    /// Returns whether it is time, and then waits for the next one.
    pub(super) fn is_due(&mut self, now: Time) -> bool {
        let is_due = now >= self.next;
        if is_due {
            let missed = now.since(self.next).as_nanos() / self.every.as_nanos() + 1;
            self.next = self.next + self.every * u32::try_from(missed).unwrap_or(u32::MAX);
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_shows_itself_once_a_step_and_skips_what_was_missed() {
        let at = Time::from_secs_f64;
        let mut shows = ViewSchedule::every(Duration::from_secs(2));
        let due: Vec<bool> = [1.9, 2.0, 2.1, 3.9, 4.5, 5.9, 9.0, 9.9, 10.0]
            .map(|now_s| shows.is_due(at(now_s)))
            .to_vec();
        assert_eq!(
            due,
            [false, true, false, false, true, false, true, false, true]
        );
    }
}
