//! How far a run is, as far as the ground station says it, and when that is shown. Showing it changes nothing.

use std::time::Duration;

use crate::ground::station::StationEvent as GroundNote;
use crate::time::Time;

/// How a run goes on, for a progress line.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RunProgress {
    /// Virtual time.
    pub now: Time,
    /// Laps done by all vehicles, over all sweeps.
    pub laps_done: usize,
    /// Laps of all sweeps, as far as planned.
    pub laps: usize,
    /// Samples stored.
    pub samples: u64,
}

/// The progress of a run.
pub(super) struct ProgressMeter {
    laps_done: usize,
    laps: usize,
    samples: u64,
    shows: ViewSchedule,
}

impl ProgressMeter {
    /// Begins at nothing; it is shown every so often, in virtual time.
    pub(super) fn shown_every(every: Duration) -> ProgressMeter {
        ProgressMeter {
            laps_done: 0,
            laps: 0,
            samples: 0,
            shows: ViewSchedule::every(every),
        }
    }

    /// Takes a note of the ground station; so many sweeps are still to be driven, the present one included.
    pub(super) fn hear(&mut self, note: &GroundNote, sweeps_left: usize) {
        match note {
            GroundNote::Planned { laps, .. } => {
                self.laps = self.laps_done + laps * sweeps_left;
            }
            GroundNote::LapDone { samples, .. } => {
                self.laps_done += 1;
                self.samples = self.samples.max(*samples);
            }
            GroundNote::RunClosed { .. }
            | GroundNote::NoPlan(_)
            | GroundNote::MadeWay { .. }
            | GroundNote::Stalled(_)
            | GroundNote::Replans(_)
            | GroundNote::Waits(_)
            | GroundNote::Lost(_)
            | GroundNote::Found(_)
            | GroundNote::DroppedOut(_)
            | GroundNote::IsBack(_)
            | GroundNote::Restarted(_)
            | GroundNote::Leads(_)
            | GroundNote::StandsBy(_)
            | GroundNote::Overtaken(_) => {}
        }
    }

    /// Returns whether it is to be shown, and then waits for the next time.
    pub(super) fn is_shown(&mut self, now: Time) -> bool {
        self.shows.is_due(now)
    }

    /// Returns how far the run is.
    pub(super) fn status(&self, now: Time) -> RunProgress {
        RunProgress {
            now,
            laps_done: self.laps_done,
            laps: self.laps,
            samples: self.samples,
        }
    }
}

/// When a run shows itself next.
#[derive(Clone, Copy, Debug)]
struct ViewSchedule {
    every: Duration,
    next: Time,
}

impl ViewSchedule {
    fn every(every: Duration) -> ViewSchedule {
        let every = every.max(Duration::from_millis(1));
        ViewSchedule {
            every,
            next: Time::ZERO + every,
        }
    }

    /// Returns whether it is time, and then waits for the next one.
    fn is_due(&mut self, now: Time) -> bool {
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
    use tomoswarm_proto::RunId;

    use super::*;

    #[test]
    fn laps_are_those_of_all_sweeps_that_are_still_to_be_driven() {
        let mut progress = ProgressMeter::shown_every(Duration::from_secs(1));
        let planned = |laps| GroundNote::Planned {
            run: RunId(1),
            laps,
            stops: 10,
        };
        let lap_done = |samples| GroundNote::LapDone {
            run: RunId(1),
            laps: 1,
            links: 1,
            samples,
        };
        let now = Time::from_secs_f64(4.0);
        let seen = |progress: &ProgressMeter| {
            let status = progress.status(now);
            (status.laps_done, status.laps, status.samples)
        };
        progress.hear(&planned(3), 2);
        assert_eq!(seen(&progress), (0, 6, 0));
        progress.hear(&lap_done(90), 2);
        progress.hear(&lap_done(70), 2);
        progress.hear(&planned(3), 1);
        assert_eq!(seen(&progress), (2, 5, 90));
        assert_eq!(progress.status(now).now, now);
    }

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
