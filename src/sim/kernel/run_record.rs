//! What is written down of a run while it goes on: the log, counts, tracks, pictures, and why it failed. It changes nothing
//! in the world, and decides nothing.

use tomoswarm_proto::VehicleId;

use crate::geom::Point;
use crate::ground::imager::ReconstructedImage;
use crate::sim::body::BodyState;
use crate::sim::environment::DeviceCounts;
use crate::sim::log::{Log, image_hash};
use crate::sim::outcome::{Recorded, RunCounts};
use crate::sim::world::Collision;
use crate::time::Time;
use crate::tomo::{Find, Finds, Peak};

/// A track has a place only this far from the one before, metres.
const TRACK_STEP_M: f64 = 0.05;

/// The record of a run.
pub(super) struct RunRecord {
    log: Log,
    counts: RunCounts,
    tracks: Vec<(VehicleId, Vec<Point>)>,
    pictures: Vec<ReconstructedImage>,
    failure: Option<String>,
}

impl RunRecord {
    /// Makes an empty record of a run of these vehicles.
    pub(super) fn new(vehicles: impl Iterator<Item = VehicleId>) -> RunRecord {
        RunRecord {
            log: Log::default(),
            counts: RunCounts::default(),
            tracks: vehicles.map(|id| (id, Vec::new())).collect(),
            pictures: Vec::new(),
            failure: None,
        }
    }

    /// Writes a line into the log.
    pub(super) fn line(&mut self, now: Time, who: &str, what: std::fmt::Arguments<'_>) {
        self.log.line(now, who, what);
    }

    /// Counts an event of the kernel.
    pub(super) fn count_event(&mut self) {
        self.counts.events += 1;
    }

    /// Counts a message that the bus has delivered to a vehicle or to the ground station.
    pub(super) fn count_message(&mut self) {
        self.counts.messages += 1;
    }

    /// Keeps where a vehicle truly is.
    pub(super) fn track(&mut self, vehicle: usize, at: Point) {
        let track = &mut self.tracks[vehicle].1;
        let is_new = |last: &Point| last.distance_to(at) > TRACK_STEP_M;
        if track.last().is_none_or(is_new) {
            track.push(at);
        }
    }

    /// Keeps where everybody truly is, and logs it every tenth time.
    pub(super) fn track_all(&mut self, now: Time, states: &[BodyState]) {
        for (vehicle, state) in states.iter().enumerate() {
            self.track(vehicle, state.at);
        }
        if now.as_nanos() % 10_000_000_000 >= 1_000_000_000 {
            return;
        }
        for (vehicle, state) in states.iter().enumerate() {
            let who = format!("vehicle {}", self.tracks[vehicle].0);
            let (at, degrees) = (state.at, state.heading.degrees());
            self.log.line(
                now,
                &who,
                format_args!(
                    "at {:.3},{:.3} faces {degrees:.1} drives {:.3}",
                    at.x_m, at.y_m, state.speed_mps
                ),
            );
        }
    }

    /// Logs a contact; the run has failed by it.
    pub(super) fn collision(&mut self, now: Time, collision: &Collision) {
        let place = collision.place;
        let with = collision.with;
        let with = with.map_or("the scene".to_owned(), |peer| peer.to_string());
        self.log.line(
            now,
            "referee",
            format_args!(
                "collision of {} with {with} at {:.3},{:.3}",
                collision.vehicle, place.x_m, place.y_m
            ),
        );
        self.fail(collision.in_words());
    }

    /// Keeps a picture in place of an earlier one of its kind, and logs it with values in steps.
    pub(super) fn picture(&mut self, now: Time, picture: ReconstructedImage) {
        match &picture.result {
            Err(reason) => {
                self.log
                    .line(now, "imager", format_args!("{}: {reason}", picture.subject))
            }
            Ok(made) => self.log.line(
                now,
                "imager",
                format_args!(
                    "{} of run {} after {} laps: {} links, hash {:016x}, peaks {}{}",
                    picture.subject,
                    picture.run,
                    picture.laps,
                    made.used,
                    image_hash(&made.image),
                    peaks_in_words(&made.peaks),
                    finds_in_words(made.finds.as_ref())
                ),
            ),
        }
        self.pictures
            .retain(|known| (known.run, known.subject) != (picture.run, picture.subject));
        self.pictures.push(picture);
    }

    /// Keeps why the run has failed; of several reasons the first counts.
    pub(super) fn fail(&mut self, reason: String) {
        self.failure.get_or_insert(reason);
    }

    /// Closes the record, with what was counted of devices.
    pub(super) fn close(self, devices: DeviceCounts) -> Recorded {
        Recorded {
            log: self.log,
            counts: RunCounts {
                scans: devices.scans,
                beacons_heard: devices.beacons_heard,
                collided_beacons: devices.collided_beacons,
                dropped_commands: devices.dropped,
                ..self.counts
            },
            tracks: self.tracks,
            pictures: self.pictures,
            failure: self.failure,
        }
    }

    /// Returns the log so far.
    #[cfg(test)]
    pub fn log_text(&self) -> &str {
        self.log.text()
    }

    /// Returns why the run has failed, if it has.
    #[cfg(test)]
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }
}

fn peaks_in_words(peaks: &[Peak]) -> String {
    let word = |peak: &Peak| format!("{:.2},{:.2}:{:.2}", peak.at.x_m, peak.at.y_m, peak.strength);
    peaks.iter().take(4).map(word).collect::<Vec<_>>().join(" ")
}

/// Returns who was found, in steps as the places of peaks are.
fn finds_in_words(finds: Option<&Finds>) -> String {
    let Some(finds) = finds else {
        return String::new();
    };
    let word = |find: &Find| {
        let Find { at, evidence, .. } = find;
        format!(" {:.2},{:.2}:{evidence:.1}", at.x_m, at.y_m)
    };
    let found: String = finds.found.iter().map(word).collect();
    format!(
        ", finds{}",
        if found.is_empty() { " nobody" } else { &found }
    )
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::RunId;

    use super::*;
    use crate::geom::Angle;
    use crate::ground::imager::{ImageStage, Subject};

    fn secs(seconds_s: f64) -> Time {
        Time::from_secs_f64(seconds_s)
    }

    fn record() -> RunRecord {
        RunRecord::new([VehicleId(4)].into_iter())
    }

    #[test]
    fn a_track_has_no_place_twice_and_the_log_every_tenth() {
        let mut record = record();
        for (now_s, x_m) in [(9.0, 0.0), (10.0, 0.04), (11.0, 0.06), (20.5, 5.0)] {
            let state = BodyState {
                at: Point::new(x_m, 1.0),
                heading: Angle::ZERO,
                speed_mps: 0.5,
            };
            record.track_all(secs(now_s), &[state]);
        }
        assert_eq!(record.log_text().lines().count(), 2);
        assert!(
            record
                .log_text()
                .ends_with("vehicle 4 at 5.000,1.000 faces 0.0 drives 0.500\n")
        );
        let recorded = record.close(DeviceCounts::default());
        assert_eq!(recorded.tracks[0].1.len(), 3);
    }

    #[test]
    fn the_first_reason_to_fail_counts() {
        let mut record = record();
        let (vehicle, with, place) = (VehicleId(4), None, Point::new(1.0, 2.0));
        let at = secs(3.0);
        record.collision(
            at,
            &Collision {
                at,
                vehicle,
                with,
                place,
            },
        );
        record.fail("another".to_owned());
        assert_eq!(
            record.log_text(),
            format!("{at} referee collision of 4 with the scene at 1.000,2.000\n")
        );
        assert!(record.failure().unwrap().contains("touched the scene"));
    }

    #[test]
    fn a_picture_takes_the_place_of_the_one_before() {
        let mut record = record();
        let picture = |run: u32, laps| ReconstructedImage {
            run: RunId(run),
            subject: Subject::Structure,
            laps,
            stage: ImageStage::Last,
            result: Err("no links".to_owned()),
        };
        for (run, laps) in [(1, 1), (2, 1), (2, 2)] {
            record.picture(secs(1.0), picture(run, laps));
        }
        let recorded = record.close(DeviceCounts::default());
        let kept: Vec<_> = recorded
            .pictures
            .iter()
            .map(|kept| (kept.run.0, kept.laps))
            .collect();
        assert_eq!(kept, [(1, 1), (2, 2)]);
    }

    #[test]
    fn counts_of_devices_are_added_at_the_end() {
        let mut record = record();
        record.count_event();
        (0..2).for_each(|_| record.count_message());
        let devices = DeviceCounts {
            scans: 7,
            ..DeviceCounts::default()
        };
        let counts = record.close(devices).counts;
        assert_eq!((counts.events, counts.messages, counts.scans), (1, 2, 7));
    }
}
