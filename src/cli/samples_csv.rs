//! Samples as CSV, one beacon heard or missed a line: what `tomoswarm sim --samples` and `tomoswarm export` write, and what
//! `tomoswarm image` reads.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

use tomoswarm_proto::{RunId, VehicleId};

use super::csv::CsvHeader;
use super::imaging_comments::comments;
use super::keyed_samples::{KeyedSample, SampleKey};
use super::recording::{HEIGHTS, RecordingError, STRENGTH_DBM, wrong};
use crate::config::LinksFile;
use crate::ground::MeasuredSample;
use crate::tomo::{Devices, Link, SAMPLES_HEADER, SampleLine};

/// The columns that one must have to be read.
pub(super) const NEEDED: &str = "run,tx_x_m,tx_y_m,rx_x_m,rx_y_m,rssi_dbm";

/// Least and most transmit power that are believed, dBm.
pub(super) const POWER_DBM: (f64, f64) = (-128.0, 127.0);
/// Times of a clock that are believed, seconds.
const SECONDS: (f64, f64) = (-1e12, 1e12);

/// Returns a file of samples: how they are to be imaged as comments, then a line for each.
pub(super) fn samples_csv<'a>(
    samples: impl Iterator<Item = &'a MeasuredSample>,
    imaging: &LinksFile,
) -> String {
    let mut text = comments(Some(imaging));
    text += SAMPLES_HEADER;
    text.push('\n');
    samples.for_each(|sample| sample_line(&mut text, sample));
    text
}

/// Appends a sample as a line; what is not known is empty.
pub(super) fn sample_line(text: &mut String, measured: &MeasuredSample) {
    let MeasuredSample {
        vehicle,
        boot,
        run,
        sample,
        utc_s,
    } = measured;
    let line = SampleLine {
        vehicle: *vehicle,
        boot: *boot,
        run: *run,
        sample,
        utc_s: *utc_s,
    };
    line.write(text);
}

/// Numbers of a sample that no image asks for: what each counts, and its limits. They must be numbers all the same: a file
/// that holds something else there was not written by us.
const UNASKED: [(&str, &str, (f64, f64)); 5] = [
    ("utc_error_s", "seconds", (0.0, SECONDS.1)),
    ("tx_heading_rad", "radians", HEADING_RAD),
    ("tx_sd_m", "metres", (0.0, HEIGHT_M.1)),
    ("rx_heading_rad", "radians", HEADING_RAD),
    ("rx_sd_m", "metres", (0.0, HEIGHT_M.1)),
];
const HEIGHT_M: (f64, f64) = (-1e7, 1e7);
const HEADING_RAD: (f64, f64) = (-1e3, 1e3);

/// What a file of samples holds.
pub(super) struct SampleLinks {
    /// Links of one packet or one miss, in the order of the file.
    pub(super) links: Vec<Link>,
    /// Of which run they are.
    pub(super) run: Option<RunId>,
    /// The channels on which they were measured, as far as it says so.
    pub(super) channels: BTreeSet<u8>,
    /// The links in the order in which they were measured: by UTC where all lines have it, else by the clocks of their
    /// vehicles.
    pub(super) in_time: Vec<usize>,
    /// Who measured each of them, as far as the file says so.
    pub(super) devices: Vec<Option<Devices>>,
    /// How high both ends are, metres; empty when a sample does not say it of both.
    pub(super) heights_m: Vec<(f64, f64)>,
    /// The line of the first sample that does not.
    pub(super) without_heights: Option<usize>,
    /// Which samples they are; empty when the file does not say it.
    pub(super) keyed: Vec<KeyedSample>,
    /// How many lines were left out because their samples stand above already.
    pub(super) repeated: usize,
}

/// Reads lines of samples below their header as links of one packet, or of one miss, and on which channels that was. A sample
/// that comes again and one whose ends are not both known are passed over. A power that is not told is 0 dBm.
///
/// # Errors
/// The first line that is not as expected, lines of several runs, or a sample that comes again otherwise.
pub(super) fn read_samples<'a>(
    header: &CsvHeader<'_>,
    lines: impl Iterator<Item = (usize, &'a str)>,
) -> Result<SampleLinks, RecordingError> {
    let ends = [
        [header.needed("tx_x_m")?, header.needed("tx_y_m")?],
        [header.needed("rx_x_m")?, header.needed("rx_y_m")?],
    ];
    let (run, rssi) = (header.needed("run")?, header.needed("rssi_dbm")?);
    let key = match (
        header.column("vehicle"),
        header.column("boot"),
        header.column("sequence"),
    ) {
        (Some(vehicle), Some(boot), Some(sequence)) => Some((vehicle, boot, sequence)),
        _ => None,
    };
    let (channel, power) = (header.column("channel"), header.column("power_dbm"));
    let (transmitter, receiver) = (header.column("transmitter"), header.column("vehicle"));
    let (mut links, mut read, mut of_file) = (Vec::new(), BTreeMap::new(), None);
    let (mut keyed, mut repeated) = (Vec::new(), 0);
    let (mut heights_m, mut without_heights) = (Vec::new(), None);
    let height_columns = HEIGHTS.map(|name| header.column(name));
    let [utc, heard_at] = ["utc", "heard_at_s"].map(|name| header.column(name));
    let (mut channels, mut times, mut devices) = (BTreeSet::new(), Vec::new(), Vec::new());
    let of_header = |(name, what, limits)| Some((header.column(name)?, what, limits));
    let unasked: Vec<(usize, &str, (f64, f64))> =
        UNASKED.into_iter().filter_map(of_header).collect();
    for (number, line) in lines {
        let fields = header.fields(number, line)?;
        let of_line = RunId(fields.whole(run, 0, "a run")?);
        let expected = *of_file.get_or_insert(of_line);
        if of_line != expected {
            let expected = format!("run {expected} as above: one run a file");
            return Err(fields.mistake(format!("run {of_line}"), expected));
        }
        let key = match key {
            Some((vehicle, boot, sequence)) => Some(SampleKey {
                run: of_line,
                vehicle: VehicleId(fields.whole(vehicle, 1, "a vehicle")?),
                boot: fields.whole(boot, 0, "a start")?,
                sequence: fields.whole(sequence, 0, "samples")?,
            }),
            None => None,
        };
        for (column, what, limits) in &unasked {
            if !fields.is_empty(*column) {
                fields.ranged(*column, *limits, what)?;
            }
        }
        // They must be numbers also where no image asks for them, as what is unasked.
        let height = |column: Option<usize>| match column.filter(|z| !fields.is_empty(*z)) {
            Some(column) => fields.ranged(column, HEIGHT_M, "metres").map(Some),
            None => Ok(None),
        };
        let [from_z_m, to_z_m] = [height(height_columns[0])?, height(height_columns[1])?];
        if ends.as_flattened().iter().any(|end| fields.is_empty(*end)) {
            continue;
        }
        if let Some(channel) = channel.filter(|channel| !fields.is_empty(*channel)) {
            channels.insert(fields.whole(channel, 0, "a channel")?);
        }
        let (from, to) = (fields.place(ends[0])?, fields.place(ends[1])?);
        let power_dbm = match power.filter(|power| !fields.is_empty(*power)) {
            Some(power) => fields.ranged(power, POWER_DBM, "dBm")?,
            None => 0.0,
        };
        let rssi_dbm = match fields.is_empty(rssi) {
            true => None,
            false => Some(fields.ranged(rssi, STRENGTH_DBM, "dBm")?),
        };
        let vehicle = |column: usize| match fields.is_empty(column) {
            true => Ok(None),
            false => fields
                .whole(column, 1, "a vehicle")
                .map(|id| Some(VehicleId(id))),
        };
        let known = |column: Option<usize>| column.map_or(Ok(None), vehicle);
        let (transmitter, receiver) = (known(transmitter)?, known(receiver)?);
        let heard_at_s = match heard_at.filter(|heard_at| !fields.is_empty(*heard_at)) {
            Some(heard_at) => fields.ranged(heard_at, SECONDS, "seconds")?,
            None => 0.0,
        };
        if let Some(key) = key {
            let sample = KeyedSample {
                key,
                line: number,
                heard_at_s,
                transmitter,
                link: (from, to, rssi_dbm.map(|rssi_dbm| rssi_dbm - power_dbm)),
                heights_m: (from_z_m, to_z_m),
            };
            if let Some(known) = read.get(&key) {
                let known: &KeyedSample = known;
                known.check_same(&sample, &format!("line {}", known.line))?;
                repeated += 1;
                continue;
            }
            read.insert(key, sample);
            keyed.push(sample);
        }
        links.push(Link::of_packet(from, to, power_dbm, rssi_dbm));
        match (from_z_m, to_z_m) {
            (Some(from_z_m), Some(to_z_m)) => heights_m.push((from_z_m, to_z_m)),
            (None, _) | (_, None) => without_heights = without_heights.or(Some(number)),
        }
        devices.push(match (transmitter, receiver) {
            (Some(transmitter), Some(receiver)) => Some(Devices {
                transmitter,
                receiver,
            }),
            _ => None,
        });
        let utc = utc.filter(|utc| !fields.is_empty(*utc));
        times.push((utc.map(|utc| fields.moment(utc)).transpose()?, heard_at_s));
    }
    if links.is_empty() {
        let expected = "at least one sample with both places";
        return Err(wrong("2: ".into(), "the end of the file", expected));
    }
    if without_heights.is_some() {
        heights_m.clear();
    }
    let has_utc = times.iter().all(|(utc, _)| utc.is_some());
    let mut in_time: Vec<usize> = (0..links.len()).collect();
    in_time.sort_by(|a, b| {
        let ((utc_a, clock_a), (utc_b, clock_b)) = (times[*a], times[*b]);
        let by_utc = if has_utc {
            utc_a.cmp(&utc_b)
        } else {
            Ordering::Equal
        };
        by_utc.then(clock_a.total_cmp(&clock_b))
    });
    Ok(SampleLinks {
        links,
        run: of_file,
        channels,
        in_time,
        devices,
        heights_m,
        without_heights,
        keyed,
        repeated,
    })
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{Boot, Deviation, Heading, PoseReport, Position, Sample, VehicleId};

    use super::*;
    use crate::cli::recording::{read_recording, read_share};
    use crate::tomo::floor_dbm;

    fn sample(sequence: u64, x_m: f64, rssi_dbm: Option<i16>) -> MeasuredSample {
        let pose = |x_m: f64| PoseReport {
            at: Position::from_metres(x_m, 0.25, 0.0),
            heading: Heading::from_radians(1.5),
            sd: Deviation::from_metres(0.02),
        };
        MeasuredSample {
            vehicle: VehicleId(2),
            boot: Boot(7),
            run: RunId(3),
            sample: Sample {
                sequence,
                heard_at_ns: 1_500_000_000,
                transmitter: VehicleId(1),
                transmitter_pose: pose(x_m),
                receiver_pose: pose(12.0),
                channel: 11,
                power_dbm: 0,
                rssi_dbm,
            },
            utc_s: None,
        }
    }

    fn file(samples: &[MeasuredSample]) -> String {
        let mut text = format!("{SAMPLES_HEADER}\n");
        samples.iter().for_each(|one| sample_line(&mut text, one));
        text
    }

    #[test]
    fn what_is_written_is_read_each_sample_once_and_misses_as_misses() {
        let text = file(&[
            sample(0, 1.234, Some(-60)),
            sample(1, 2.0, None),
            sample(0, 1.234, Some(-60)),
            sample(2, f64::NAN, Some(-70)),
        ]);
        assert!(!text.contains("NaN"), "{text}");
        let Ok(recording) = read_recording(text.as_bytes()) else {
            panic!("{text}");
        };
        let links: Vec<_> = recording
            .links
            .iter()
            .map(|link| (link.from.x_m, link.packets, link.misses, link.mean_dbm))
            .collect();
        assert_eq!(links[0], (1.234, 1, 0, -60.0));
        assert_eq!((links[1].0, links[1].1, links[1].2), (2.0, 0, 1));
        assert_eq!((links.len(), recording.pooled_in_m), (2, None));
    }

    #[test]
    fn samples_of_another_power_show_no_change() {
        let swept = |power_dbm: i8| {
            let samples: Vec<MeasuredSample> = (0..9)
                .map(|sequence| {
                    let rssi_dbm = -60 - sequence as i16 + i16::from(power_dbm);
                    let mut one = sample(sequence, 1.25, (sequence < 3).then_some(rssi_dbm));
                    one.sample.power_dbm = power_dbm;
                    one
                })
                .collect();
            read_recording(file(&samples).as_bytes()).unwrap()
        };
        let (now, empty) = (swept(8), swept(0));
        let (now, empty, _) = now.pooled_for(Some(&empty), 0.5);
        let (now, empty) = (now[0], empty.unwrap()[0]);
        assert_eq!((now.mean_dbm, now.misses), (-61.0, 6));
        assert_eq!(empty.mean_dbm, -61.0);
        let floor_dbm = floor_dbm([&now, &empty].into_iter(), -95.0);
        let [was, is] = [empty, now].map(|link| link.censored(floor_dbm, 2.5));
        assert_eq!(was, is);
    }

    #[test]
    fn the_first_share_is_that_of_the_time_and_not_of_the_first_vehicle() {
        let at = |sequence: u64, heard_at_ns: u64, x_m: f64| {
            let mut one = sample(sequence, x_m, Some(-60));
            one.sample.heard_at_ns = heard_at_ns;
            one
        };
        let text = file(&[
            at(0, 3_000_000_000, 1.0),
            at(1, 4_000_000_000, 2.0),
            at(2, 1_000_000_000, 3.0),
            at(3, 2_000_000_000, 4.0),
        ]);
        let first = read_share(&text, 0.5).ok().flatten().unwrap();
        let places: Vec<f64> = first.links.iter().map(|link| link.from.x_m).collect();
        assert_eq!(places, [3.0, 4.0]);
    }

    #[test]
    fn a_sample_that_comes_again_otherwise_is_named_with_both_lines() {
        let (one, mut other) = (sample(0, 1.0, Some(-60)), sample(0, 1.0, Some(-61)));
        let said = problem(&file(&[one, sample(1, 2.0, None), other]));
        assert_eq!(
            said,
            "4: found sample 0 of vehicle 2, start 7, run 3 otherwise than in line 2, expected the same again, or a key (run, \
             vehicle, boot, sequence) of its own"
        );
        other.sample.rssi_dbm = None;
        assert!(problem(&file(&[one, other])).starts_with("3: found sample 0 of"));
        // A later export knows better at which moment of UTC it was.
        let mut later = one;
        later.utc_s = Some((1.8e9, 0.01));
        let read = read_recording(file(&[one, later]).as_bytes()).unwrap();
        assert_eq!((read.links.len(), read.repeated), (1, 1));
    }

    fn problem(text: &str) -> String {
        match read_recording(text.as_bytes()) {
            Ok(recording) => panic!("read: {recording:?}"),
            Err(problem) => problem.to_string(),
        }
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        let good = file(&[sample(0, 1.0, Some(-60))]);
        let row = good.lines().nth(1).unwrap();
        for (row, expected) in [
            (
                row.replace("1.0000,0.2500", "NaN,0.2500"),
                "3: found \"NaN\", expected a coordinate from",
            ),
            (
                row.replace(",-60", ",NaN"),
                "3: found \"NaN\", expected dBm from",
            ),
            (
                row.replace(",-60", ",-600"),
                "3: found \"-600\", expected dBm from",
            ),
            (
                row.replace("2,7,3,0,", "2,7,4,0,"),
                "3: found run 4, expected run 3 as above: one run a file",
            ),
            (
                row.replace("2,7,3,0,", "2,7,3,-1,"),
                "3: found \"-1\", expected a whole number of samples",
            ),
            (
                row.replace("2,7,3,0,", "2,7,3,"),
                "3: found 20 fields, expected 21 as the header has",
            ),
        ] {
            let said = problem(&format!("{good}{row}\n"));
            assert!(said.starts_with(expected), "{row}: {said}");
        }
        let mut timed = sample(0, 1.0, Some(-60));
        timed.utc_s = Some((1.8e9, 0.01));
        let timed = file(&[timed]);
        let utc = "2027-01-15T08:00:00.000Z";
        assert!(
            read_recording(timed.as_bytes()).is_ok() && timed.contains(utc),
            "{timed}"
        );
        for wrong in [
            "banana",
            "2027-01-15",
            "08:00:00Z",
            "2027-01-15T08:00:00",
            "2027-01-15T08:00:00+01:00",
            "2027-13-15T08:00:00Z",
        ] {
            let said = problem(&timed.replace(utc, wrong));
            let expected = format!(
                "2: found \"{wrong}\", expected a moment in UTC such as 2026-11-20T09:05:00.250Z"
            );
            assert_eq!(said, expected);
        }
        for (text, expected) in [
            (SAMPLES_HEADER.to_owned(), "2: found the end of the file"),
            (
                good.replace("tx_x_m", "tx_x"),
                "1: found the column \"tx_x\"",
            ),
            (
                good.replace("rssi_dbm", "packets"),
                "1: found the column \"packets\"",
            ),
            (
                good.replace("heard_at_s", "run"),
                "1: found the column \"run\" twice",
            ),
            (
                "sequence,tx_x_m\n1,2\n".to_owned(),
                "1: found no column \"tx_y_m\"",
            ),
        ] {
            let said = problem(&text);
            assert!(said.starts_with(expected), "{text}: {said}");
        }
    }
}
