//! For how long in a sweep no beacon was heard between any two vehicles: a sweep in which radios fall silent is driven to
//! its end, and shows less than it seems to. It only looks at what the ground station was sent, and judges nothing.

use std::collections::BTreeSet;
use std::time::Duration;

use tomoswarm_proto::{RunId, Samples};

use crate::ground::station::StationEvent;
use crate::time::Time;

/// A silence this long or shorter is none.
pub const QUIET: Duration = Duration::from_secs(60);

const NANOS_A_SECOND: u64 = 1_000_000_000;

/// A stretch of a sweep in which no beacon was heard between any two vehicles, as far as the ground station was told.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Silence {
    /// In which run.
    pub run: RunId,
    /// Since when, virtual time.
    pub from: Time,
    /// Until when, virtual time.
    pub until: Time,
}

/// The whole seconds in which beacons were heard, by what the ground station was sent.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct HeardSeconds {
    of_runs: BTreeSet<(RunId, u64)>,
}

impl HeardSeconds {
    /// Takes samples of a vehicle; beacons that were missed do not count.
    pub(super) fn record(&mut self, batch: &Samples) {
        let heard = batch.samples.iter().filter(|one| one.rssi_dbm.is_some());
        let seconds = heard.map(|one| (batch.run, one.heard_at_ns / NANOS_A_SECOND));
        self.of_runs.extend(seconds);
    }

    /// Returns the beginnings of those of a run, in order.
    fn of(&self, run: RunId) -> impl Iterator<Item = Time> + '_ {
        let seconds = self.of_runs.range((run, 0)..=(run, u64::MAX));
        seconds.map(|(_, second)| Time::from_nanos(second * NANOS_A_SECOND))
    }
}

/// When a sweep was driven.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct SweepSpan {
    run: RunId,
    /// When it was planned first.
    from: Time,
    /// When all vehicles had done their last lap so far.
    lap_done: Option<Time>,
    is_closed: bool,
}

/// When sweeps were driven, as the ground station says it.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct SweepTimes {
    spans: Vec<SweepSpan>,
}

impl SweepTimes {
    /// Takes a note of the ground station.
    pub(super) fn hear(&mut self, now: Time, note: &StationEvent) {
        match note {
            StationEvent::Planned { run, .. } => {
                if self.of(*run).is_none() {
                    self.spans.push(SweepSpan {
                        run: *run,
                        from: now,
                        lap_done: None,
                        is_closed: false,
                    });
                }
            }
            StationEvent::LapDone { run, .. } => {
                if let Some(span) = self.of(*run) {
                    span.lap_done = Some(now);
                }
            }
            StationEvent::RunClosed { run, .. } => {
                if let Some(span) = self.of(*run) {
                    span.is_closed = true;
                }
            }
            StationEvent::NoPlan(_)
            | StationEvent::MadeWay { .. }
            | StationEvent::Stalled(_)
            | StationEvent::Replans(_)
            | StationEvent::Waits(_)
            | StationEvent::Lost(_)
            | StationEvent::Found(_)
            | StationEvent::DroppedOut(_)
            | StationEvent::IsBack(_)
            | StationEvent::Restarted(_)
            | StationEvent::Leads(_)
            | StationEvent::StandsBy(_)
            | StationEvent::Overtaken(_) => {}
        }
    }

    fn of(&mut self, run: RunId) -> Option<&mut SweepSpan> {
        self.spans.iter_mut().find(|span| span.run == run)
    }

    /// Returns the silences of all sweeps that are longer than [`QUIET`], in order; a sweep that was not closed was driven
    /// until `ended`.
    pub(super) fn silences(&self, ended: Time, heard: &HeardSeconds) -> Vec<Silence> {
        let of_span = |(index, span): (usize, &SweepSpan)| {
            let next = self.spans.get(index + 1).map_or(ended, |next| next.from);
            let until = span
                .lap_done
                .filter(|_| span.is_closed)
                .unwrap_or(next)
                .max(span.from);
            let within = heard
                .of(span.run)
                .filter(|at| (span.from..until).contains(at));
            let mut moments: Vec<Time> = within.collect();
            moments.extend([span.from, until]);
            moments.sort_unstable();
            gaps(span.run, &moments)
        };
        self.spans.iter().enumerate().flat_map(of_span).collect()
    }
}

/// Returns the gaps between moments in order that are too long.
fn gaps(run: RunId, moments: &[Time]) -> Vec<Silence> {
    let gap = |pair: &[Time]| Silence {
        run,
        from: pair[0],
        until: pair[1],
    };
    let is_long = |gap: &Silence| gap.until.since(gap.from) > QUIET;
    moments.windows(2).map(gap).filter(is_long).collect()
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{PoseReport, Sample, VehicleId};

    use super::*;

    const RUN: RunId = RunId(2);

    fn secs(seconds_s: f64) -> Time {
        Time::from_secs_f64(seconds_s)
    }

    /// The silences of a sweep from 100 s on whose last lap ends at 400 s, by when a beacon was heard or missed.
    fn check(samples: &[(f64, bool)], is_closed: bool, expected: &[(f64, f64)]) {
        let mut times = SweepTimes::default();
        times.hear(
            secs(100.0),
            &StationEvent::Planned {
                run: RUN,
                laps: 1,
                stops: 2,
            },
        );
        let (laps, links) = (1, 1);
        let lap = StationEvent::LapDone {
            run: RUN,
            laps,
            links,
            samples: 1,
        };
        times.hear(secs(400.0), &lap);
        if is_closed {
            let closed = StationEvent::RunClosed {
                run: RUN,
                links,
                samples: 1,
            };
            times.hear(secs(600.0), &closed);
        }
        let sample = |(at_s, is_heard): &(f64, bool)| Sample {
            sequence: 0,
            heard_at_ns: secs(*at_s).as_nanos(),
            transmitter: VehicleId(2),
            transmitter_pose: PoseReport::default(),
            receiver_pose: PoseReport::default(),
            channel: 15,
            power_dbm: 0,
            rssi_dbm: is_heard.then_some(-70),
        };
        let mut heard = HeardSeconds::default();
        heard.record(&Samples {
            run: RUN,
            samples: samples.iter().map(sample).collect(),
            ..Samples::default()
        });
        let found: Vec<(Time, Time)> = times
            .silences(secs(500.0), &heard)
            .iter()
            .map(|silence| (silence.from, silence.until))
            .collect();
        let expected: Vec<(Time, Time)> = expected
            .iter()
            .map(|(from_s, until_s)| (secs(*from_s), secs(*until_s)))
            .collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn a_sweep_in_which_radios_fall_silent_has_silences_of_more_than_a_minute() {
        let heard: Vec<(f64, bool)> = (0..6)
            .map(|step| (110.0 + 55.0 * f64::from(step), true))
            .collect();
        check(&heard, true, &[]);
        check(&heard, false, &[(385.0, 500.0)]);
        // Beacons that are missed break no silence.
        let missed: Vec<(f64, bool)> = (200..390).map(|at_s| (f64::from(at_s), false)).collect();
        check(
            &[&heard[..2], &missed[..]].concat(),
            true,
            &[(165.0, 400.0)],
        );
        check(&[], true, &[(100.0, 400.0)]);
    }
}
