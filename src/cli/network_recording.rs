//! Recordings of fixed networks as `tomoswarm image` takes them: the links of an image, and the persons who walk.
//!
//! Files in, links and tracks out; lines are read by [`super::fixed_network`], persons are followed by `tomo`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::config::SourceFile;
use crate::geom::Rect;
use crate::tomo::{TrackedPerson, Tracker, TrackingSettings};

use super::error::CliError;
use super::fixed_network::{NodePlaces, Round};
use super::image::read_with;
use super::recording::{LengthUnit, Recording};

/// The header of a file of tracks.
const TRACK_HEADER: &str = "time_s,person,x_m,y_m,sd_x_m,sd_y_m,probability";
/// Where persons are is written this often, seconds.
const WRITTEN_EVERY_S: f64 = 0.2;
/// The noise of measurements that is believed, dB.
const NOISE_DB: (f64, f64) = (1.0, 6.0);
/// Of normal noise, the standard deviation over the median of its size.
const SD_OF_MEDIAN: f64 = 1.4826;

/// A network and what it has recorded.
pub(super) struct NetworkRecording {
    places: NodePlaces,
    now: Vec<Round>,
    empty: Vec<Round>,
}

/// Who was where.
pub(super) struct Tracks {
    lines: Vec<(f64, TrackedPerson)>,
    noise_sd_db: f64,
}

impl NetworkRecording {
    /// Reads the places of the nodes and the recordings; of several the later ones go on where the earlier ones end.
    ///
    /// # Errors
    /// A file that cannot be read or is not as expected.
    pub(super) fn read(
        nodes: &Path,
        now: &[PathBuf],
        empty: &[PathBuf],
        made_from: &mut Vec<SourceFile>,
    ) -> Result<NetworkRecording, CliError> {
        let places = read_with(nodes, made_from, NodePlaces::read)?;
        let mut rounds = |paths: &[PathBuf]| -> Result<Vec<Round>, CliError> {
            let mut all: Vec<Round> = Vec::new();
            for path in paths {
                let begins_s = all.last().map_or(0.0, |round| round.at_s);
                let more = read_with(path, made_from, |text| places.read_rounds(text))?;
                all.extend(more.into_iter().map(|round| Round {
                    at_s: round.at_s + begins_s,
                    ..round
                }));
            }
            Ok(all)
        };
        let (now, empty) = (rounds(now)?, rounds(empty)?);
        Ok(NetworkRecording { places, now, empty })
    }

    /// Returns the links of the recording.
    pub(super) fn now(&self) -> Recording {
        self.recording(&self.now)
    }

    /// Returns the links of the empty place.
    pub(super) fn empty(&self) -> Recording {
        self.recording(&self.empty)
    }

    /// Returns a size of bins in which no two nodes lie, metres.
    pub(super) fn bin_m(&self) -> f64 {
        self.places.nearest_m() / 2f64.sqrt() / 1.01
    }

    fn recording(&self, rounds: &[Round]) -> Recording {
        Recording {
            links: self.places.links(rounds),
            unit: LengthUnit::Metre,
            area: None,
            imaging: None,
            pooled_in_m: None,
            is_without_offsets: false,
            is_of_samples: false,
            runs: Default::default(),
            channels: Default::default(),
            heights_m: Vec::new(),
            without_heights: None,
            in_time: Vec::new(),
            devices: Vec::new(),
            keyed: Vec::new(),
            repeated: 0,
        }
    }

    /// Follows the persons who walk within an area. What a link would have without them is what it has most of the time, in the
    /// empty place and in the recording together: who walks is in the way of a link for a moment only, and a single look at the
    /// empty place is wrong by several dB.
    pub(super) fn track(&self, area: Rect) -> Tracks {
        let usual_dbm = self.medians_dbm();
        let lost_db = |round: &Round| -> Vec<Option<f64>> {
            let usual = &usual_dbm[round.receiver * self.places.0.len()..];
            let pairs = round.rssi_dbm.iter().zip(usual);
            pairs
                .map(|(rssi_dbm, usual_dbm)| Some((*usual_dbm)? - (*rssi_dbm)?))
                .collect()
        };
        let losses: Vec<Vec<Option<f64>>> = self.now.iter().map(lost_db).collect();
        let sizes = losses.iter().flatten().flatten().map(|db| db.abs());
        let noise_sd_db = median(sizes.collect()).map_or(NOISE_DB.1, |median_db| {
            (SD_OF_MEDIAN * median_db).clamp(NOISE_DB.0, NOISE_DB.1)
        });
        let settings = TrackingSettings {
            noise_sd_db,
            ..TrackingSettings::default()
        };
        let mut tracker = Tracker::new(&self.places.0, area, settings);
        let mut lines = Vec::new();
        let mut write_at_s = 0.0;
        for (round, lost_db) in self.now.iter().zip(&losses) {
            tracker.take(round.at_s, round.receiver, lost_db);
            if round.at_s >= write_at_s {
                write_at_s = round.at_s + WRITTEN_EVERY_S;
                lines.extend(tracker.persons().into_iter().map(|one| (round.at_s, one)));
            }
        }
        Tracks { lines, noise_sd_db }
    }

    /// Returns by receiver and transmitter the median of what is heard.
    fn medians_dbm(&self) -> Vec<Option<f64>> {
        let nodes = self.places.0.len();
        let mut values = vec![Vec::new(); nodes * nodes];
        for round in self.empty.iter().chain(&self.now) {
            for (transmitter, rssi_dbm) in round.rssi_dbm.iter().enumerate() {
                values[round.receiver * nodes + transmitter].extend(*rssi_dbm);
            }
        }
        values.into_iter().map(median).collect()
    }
}

impl Tracks {
    /// Returns the file of tracks.
    pub(super) fn csv(&self) -> String {
        let mut text = format!("{TRACK_HEADER}\n");
        for (at_s, person) in &self.lines {
            let [xx, _, yy] = person.covariance_m2;
            // Writing to a String cannot fail.
            let _ = writeln!(
                text,
                "{at_s:.3},{},{:.3},{:.3},{:.3},{:.3},{:.4}",
                person.number,
                person.at.x_m,
                person.at.y_m,
                xx.sqrt(),
                yy.sqrt(),
                person.probability
            );
        }
        text
    }

    /// Returns who was followed, a line each.
    pub(super) fn words(&self) -> String {
        let mut numbers: Vec<u32> = self.lines.iter().map(|(_, one)| one.number).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let mut text = format!(
            "persons followed: {}, noise {:.1} dB\n",
            numbers.len(),
            self.noise_sd_db
        );
        for number in numbers {
            let of_person: Vec<_> = self
                .lines
                .iter()
                .filter(|(_, one)| one.number == number)
                .collect();
            let way_m = way_m(of_person.iter().map(|(_, one)| one));
            if let (Some((first_s, _)), Some((last_s, last))) =
                (of_person.first(), of_person.last())
            {
                text += &format!(
                    "  person {number}: {first_s:.1} to {last_s:.1} s, {way_m:.1} m, last at ({:.2}, {:.2}) m\n",
                    last.at.x_m, last.at.y_m
                );
            }
        }
        text
    }
}

/// Returns how far a person went, metres: from place to place that lie further apart than the deviations of a place, whose
/// noise would be summed up otherwise.
fn way_m<'a>(mut places: impl Iterator<Item = &'a TrackedPerson>) -> f64 {
    const SURE: f64 = 3.0;
    let Some(first) = places.next() else {
        return 0.0;
    };
    let (mut from, mut way_m) = (first.at, 0.0);
    for place in places {
        let [xx, _, yy] = place.covariance_m2;
        let step_m = from.distance_to(place.at);
        if step_m > SURE * (xx + yy).sqrt() {
            way_m += step_m;
            from = place.at;
        }
    }
    way_m
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
