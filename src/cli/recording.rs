//! Reads recordings: CSV files of links or samples, and the JSON dumps of the 2016 two-rover system, told apart by content.
//!
//! Pure: bytes in, links out. Every mistake names the line (or packet), what was found and what was expected.

use std::collections::{BTreeMap, BTreeSet};
use std::iter;

use serde::Deserialize;
use serde_json::Value;
use tomoswarm_proto::RunId;

use super::csv::{self, CsvHeader};
use super::imaging_comments::{comments, read_comments};
use super::keyed_samples::KeyedSample;
use super::samples_csv::{NEEDED, POWER_DBM, read_samples};
use crate::config::LinksFile;
use crate::geom::{Point, Rect};
use crate::tomo::{
    self, DeviceOffsets, Devices, LINKS_HEADER, Link, LinkBins, MISSED_POWER, SAMPLES_HEADER,
    SPOT_M,
};

/// The header that a links file has at least.
pub const CSV_HEADER: &str = "tx_x_m,tx_y_m,rx_x_m,rx_y_m,packets,rssi_dbm";

/// The columns that may stand there as well: how high the ends are.
pub(super) const HEIGHTS: [&str; 2] = ["tx_z_m", "rx_z_m"];

/// Farthest coordinate that is believed, metres.
pub(super) const FARTHEST_M: f64 = 1e7;
/// Smallest and largest side of an area that is believed, cells.
const SIDE_CELLS: (f64, f64) = (1.0, 10_000.0);
/// Weakest and strongest signal that are believed, dBm.
pub(super) const STRENGTH_DBM: (f64, f64) = (-200.0, 40.0);

/// What is wrong in a recording.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{place}found {found}, expected {expected}")]
pub struct RecordingError {
    /// Where: `"17: "` for a line, `"packets[3]: "` for a packet, empty for the whole file.
    pub place: String,
    /// What is there.
    pub found: String,
    /// What should be there.
    pub expected: String,
}

impl RecordingError {
    /// Returns what parts the name of the file from the problem: a line number stands right after it.
    pub fn gap(&self) -> &'static str {
        if self.place.starts_with(|first: char| first.is_ascii_digit()) {
            ""
        } else {
            " "
        }
    }
}

pub(super) fn wrong(
    place: String,
    found: impl Into<String>,
    expected: impl Into<String>,
) -> RecordingError {
    RecordingError {
        place,
        found: found.into(),
        expected: expected.into(),
    }
}

/// Which unit the positions of a recording have.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LengthUnit {
    /// Metres.
    Metre,
    /// Cells of a lattice of unknown size.
    Cell,
}

impl LengthUnit {
    /// Returns the unit's word.
    pub fn word(self) -> &'static str {
        match self {
            LengthUnit::Metre => "m",
            LengthUnit::Cell => "cell",
        }
    }
}

/// The links of one file.
#[derive(Clone, PartialEq, Debug)]
pub struct Recording {
    /// What was measured, pooled only where a line or a packet repeats the very same two places.
    pub links: Vec<Link>,
    /// Unit of the positions.
    pub unit: LengthUnit,
    /// The area that the recording itself names.
    pub area: Option<Rect>,
    /// How the links are to be imaged, as the recording itself says it.
    pub imaging: Option<LinksFile>,
    /// The side of the bins in which the links are pooled already, metres.
    pub pooled_in_m: Option<f64>,
    /// Whether what radios differ by has been taken out of the links already, as a simulation does of what it writes
    /// and an export does not.
    pub is_without_offsets: bool,
    /// Whether it is a file of samples.
    pub is_of_samples: bool,
    /// Of which runs it is, as far as it says so.
    pub runs: BTreeSet<RunId>,
    /// The channels on which it was measured, as far as it says so.
    pub channels: BTreeSet<u8>,
    /// How high both ends of each link are, metres; empty when the recording does not say it of all.
    pub heights_m: Vec<(f64, f64)>,
    /// The line of the first sample that does not say how high both ends are.
    pub without_heights: Option<usize>,
    /// The links in the order in which they were measured; empty when that is how they stand.
    pub in_time: Vec<usize>,
    /// Who measured each link, as far as it is known; empty when it is known of none.
    pub devices: Vec<Option<Devices>>,
    /// Which samples the links are; empty when they are none, or it is not known.
    pub keyed: Vec<KeyedSample>,
    /// How many samples were left out because they had been given already.
    pub repeated: usize,
}

impl Recording {
    /// Pools what lies in the same bins without what radios differ by, unless it is pooled in such already, and so the
    /// recording that it is compared with; returns the links of both, and by how much the radios differ. See
    /// [`LinkBins::links_against`]; of what is pooled already nobody knows who measured it. Where that has been taken out
    /// of one of them already, it is found from the other alone: what all radios have in common is no offset in either.
    pub(super) fn pooled_for(
        &self,
        empty: Option<&Recording>,
        bin_m: f64,
    ) -> (Vec<Link>, Option<Vec<Link>>, Option<DeviceOffsets>) {
        let Some(empty) = empty else {
            let (links, offsets) = match self.bins(bin_m) {
                Some(bins) => bins.links_and_offsets(),
                None => (self.links.clone(), None),
            };
            return (links, None, offsets);
        };
        let bins = [self, empty].map(|recording| recording.bins(bin_m));
        let is_mixed = self.is_without_offsets != empty.is_without_offsets;
        if let ([Some(now), Some(empty)], false) = (&bins, is_mixed) {
            let (now, empty, offsets) = now.links_against(empty);
            return (now, Some(empty), offsets);
        }
        let links = |bins: &Option<LinkBins>, recording: &Recording, other: &Recording| match bins {
            Some(bins) if other.is_without_offsets => bins.links_and_offsets(),
            Some(bins) => (bins.measured_links(), None),
            None => (recording.links.clone(), None),
        };
        let (now, of_now) = links(&bins[0], self, empty);
        let (empty, of_empty) = links(&bins[1], empty, self);
        (now, Some(empty), of_now.or(of_empty))
    }

    /// Returns the bins of its links; `None` when they are pooled in such already.
    fn bins(&self, bin_m: f64) -> Option<LinkBins> {
        // A line that comes again is no link of its own.
        let is_pooled = self.pooled_in_m == Some(bin_m) && !self.has_repeated_places();
        if is_pooled || bin_m <= 0.0 {
            return None;
        }
        let spot_m = match self.unit {
            LengthUnit::Metre => SPOT_M,
            LengthUnit::Cell => SPOT_M.min(bin_m / 8.0),
        };
        let mut bins = LinkBins::new(bin_m, spot_m);
        let devices = self.devices.iter().copied().chain(iter::repeat(None));
        for (link, devices) in self.links.iter().zip(devices) {
            bins.record_link(devices, link);
        }
        Some(bins)
    }

    /// Returns whether two links have the same ends.
    fn has_repeated_places(&self) -> bool {
        let bits = |at: Point| (at.x_m.to_bits(), at.y_m.to_bits());
        let ends = |link: &Link| {
            let (from, to) = (bits(link.from), bits(link.to));
            (from.min(to), from.max(to))
        };
        let different: BTreeSet<_> = self.links.iter().map(ends).collect();
        different.len() < self.links.len()
    }
}

/// Reads a recording.
///
/// # Errors
/// [`RecordingError`] for the first line or packet that is not as expected.
pub fn read_recording(bytes: &[u8]) -> Result<Recording, RecordingError> {
    let text = std::str::from_utf8(bytes).map_err(|error| {
        wrong(
            String::new(),
            format!("a byte that is not UTF-8 at {}", error.valid_up_to()),
            "text",
        )
    })?;
    let text = text.trim_start_matches('\u{feff}');
    match text.trim_start().chars().next() {
        None => Err(wrong(
            "1: ".into(),
            "an empty file",
            format!("the header {CSV_HEADER} or a JSON recording"),
        )),
        Some('{' | '[') => read_json(text, 1.0),
        Some(_) => read_csv(text),
    }
}

/// Reads the first share (0 to 1) of the packets of a recording, in recorded order; `None` when it holds no single packets.
///
/// # Errors
/// As for [`read_recording`].
pub(super) fn read_share(text: &str, share: f64) -> Result<Option<Recording>, RecordingError> {
    let is_json = text
        .trim_start_matches('\u{feff}')
        .trim_start()
        .starts_with(['{', '[']);
    if is_json {
        return read_json(text, share).map(Some);
    }
    let mut recording = read_recording(text.as_bytes())?;
    let is_single = |link: &Link| link.packets + link.misses == 1 && link.spots == 1;
    let count = share_of(recording.links.len(), share);
    let is_of_packets = recording.pooled_in_m.is_none() && recording.links.iter().all(is_single);
    let in_time = std::mem::take(&mut recording.in_time);
    recording.keyed.clear();
    match in_time.is_empty() {
        true => recording.links.truncate(count),
        false => {
            let first = &in_time[..count.min(in_time.len())];
            recording.links = first.iter().map(|index| recording.links[*index]).collect();
            let devices = |index: &usize| recording.devices.get(*index).copied().flatten();
            recording.devices = first.iter().map(devices).collect();
        }
    }
    Ok(is_of_packets.then_some(recording))
}

/// Returns a share of a number of things, at least one.
fn share_of(count: usize, share: f64) -> usize {
    (libm::round(count as f64 * share) as usize).clamp(1, count.max(1))
}

/// Returns a links file: how it is to be imaged as comments, if that is known, then the links.
pub fn links_csv(links: &[Link], imaging: Option<&LinksFile>) -> String {
    comments(imaging) + &tomo::links_csv(links)
}

fn read_csv(text: &str) -> Result<Recording, RecordingError> {
    let mut lines = csv::numbered(text);
    let imaging = read_comments(text)?;
    let Some((number, line)) = lines.next() else {
        return Err(wrong("1: ".into(), csv::nothing_in(text), CSV_HEADER));
    };
    let of_links = format!("{LINKS_HEADER},{MISSED_POWER},{}", HEIGHTS.join(","));
    let is_of_links = |name: &str| csv::names(&of_links).any(|known| known == name);
    let mut of_samples = csv::names(SAMPLES_HEADER).filter(|name| !is_of_links(name));
    let are_samples = of_samples.any(|known| csv::names(line).any(|name| name == known));
    let (mut heights_m, mut in_time, mut devices) = (Vec::new(), Vec::new(), Vec::new());
    let (mut runs, mut keyed, mut repeated) = (BTreeSet::new(), Vec::new(), 0);
    let mut without_heights = None;
    let (links, channels, pooled_in_m) = if are_samples {
        let expected = format!("a header of samples, with {NEEDED} at least");
        let header = CsvHeader::read(number, line, SAMPLES_HEADER, expected)?;
        let samples = read_samples(&header, lines)?;
        (in_time, devices) = (samples.in_time, samples.devices);
        (keyed, repeated) = (samples.keyed, samples.repeated);
        (heights_m, without_heights) = (samples.heights_m, samples.without_heights);
        runs.extend(samples.run);
        (samples.links, samples.channels, None)
    } else {
        let expected = expected_of_links(line);
        let header = CsvHeader::read(number, line, &of_links, expected)?;
        let bin_m = imaging.as_ref().map(|head| head.imaging.bin_m);
        let channels = imaging.iter().filter_map(|head| head.channel).collect();
        (read_links(&header, lines, &mut heights_m)?, channels, bin_m)
    };
    let as_measured = imaging.as_ref().is_some_and(|imaging| imaging.as_measured);
    Ok(Recording {
        links,
        unit: LengthUnit::Metre,
        area: imaging.as_ref().map(|imaging| imaging.area),
        is_without_offsets: pooled_in_m.is_some() && !as_measured,
        imaging,
        pooled_in_m,
        is_of_samples: are_samples,
        runs,
        channels,
        heights_m,
        without_heights,
        in_time,
        devices,
        keyed,
        repeated,
    })
}

/// Returns what is expected where the header of a links file should stand.
fn expected_of_links(line: &str) -> String {
    let header = format!(
        "the header {CSV_HEADER}, optionally with spots,misses,spread_db,{MISSED_POWER},{}",
        HEIGHTS.join(",")
    );
    // Lines of a fixed network are numbers from the first one on.
    let are_numbers = csv::names(line).all(|field| field.parse::<f64>().is_ok());
    match are_numbers {
        true => header + "; a recording of a fixed network needs --nodes",
        false => header,
    }
}

/// More packets of a link than this are no count: in a hundred days with one every second there are fewer.
const MOST_RECORDS: u32 = 10_000_000;

fn read_links<'a>(
    header: &CsvHeader<'_>,
    lines: impl Iterator<Item = (usize, &'a str)>,
    heights_m: &mut Vec<(f64, f64)>,
) -> Result<Vec<Link>, RecordingError> {
    let (tx_x, tx_y) = (header.needed("tx_x_m")?, header.needed("tx_y_m")?);
    let (rx_x, rx_y) = (header.needed("rx_x_m")?, header.needed("rx_y_m")?);
    let rssi = header.needed("rssi_dbm")?;
    let [packets, spots, misses, spread, missed_power] =
        ["packets", "spots", "misses", "spread_db", MISSED_POWER].map(|name| header.column(name));
    let heights = HEIGHTS.map(|name| header.column(name));
    let read = |(number, line): (usize, &str)| {
        let fields = header.fields(number, line)?;
        if let [Some(from), Some(to)] = heights {
            let height = |column| fields.ranged(column, (-FARTHEST_M, FARTHEST_M), "a height");
            heights_m.push((height(from)?, height(to)?));
        }
        let whole = |column: Option<usize>, default: u32, least: u32, what: &str| match column {
            Some(column) => fields.whole(column, least, what),
            None => Ok(default),
        };
        let ranged = |column: Option<usize>, limits: (f64, f64), what: &str| {
            column.map_or(Ok(0.0), |column| fields.ranged(column, limits, what))
        };
        let misses = whole(misses, 0, 0, "misses")?;
        let packets = whole(packets, 1, u32::from(misses == 0), "packets")?;
        if packets.max(misses) > MOST_RECORDS {
            let found = format!("{packets} packets and {misses} misses");
            let expected = format!("at most {MOST_RECORDS} of each");
            return Err(wrong(format!("{number}: "), found, expected));
        }
        Ok(Link {
            from: fields.place([tx_x, tx_y])?,
            to: fields.place([rx_x, rx_y])?,
            packets,
            spots: whole(spots, 1, 1, "spots")?,
            misses,
            mean_dbm: match packets {
                0 => f64::NAN,
                _ => fields.ranged(rssi, STRENGTH_DBM, "dBm")?,
            },
            spread_db: ranged(spread, (0.0, 200.0), "dB")?,
            missed_power_dbm: ranged(missed_power, POWER_DBM, "dBm")?,
        })
    };
    let links = lines.map(read).collect::<Result<Vec<Link>, _>>()?;
    if links.is_empty() {
        let expected = "at least one line of numbers";
        return Err(wrong("2: ".into(), "the end of the file", expected));
    }
    Ok(links)
}

/// Quotes what was found, cut to a readable length.
pub(super) fn quoted(text: &str) -> String {
    const LONGEST: usize = 40;
    let cut: String = text.chars().take(LONGEST).collect();
    let dots = if cut.len() < text.len() { "..." } else { "" };
    format!("{:?}", cut + dots)
}

/// The parts of a dump that are used.
#[derive(Deserialize)]
struct Dump {
    packets: Vec<Value>,
    /// South-west corner of the area: north, east.
    #[serde(default)]
    origin: Option<Value>,
    /// Extent of the area: to the north, to the east.
    #[serde(default)]
    size: Option<Value>,
}

const PACKET: &str =
    "[receiver id, from_north, from_east, from_valid, to_north, to_east, to_valid, rssi_dbm]";

fn read_json(text: &str, share: f64) -> Result<Recording, RecordingError> {
    let refused = |line: usize, found: String| {
        let expected = format!("an object with \"packets\": [{PACKET}, ...]");
        wrong(format!("{}: ", line.max(1)), found, expected)
    };
    // The parser would take the parts of an object from a list as well.
    let before = text.len() - text.trim_start().len();
    if text[before..].starts_with('[') {
        let line = 1 + text[..before].matches('\n').count();
        return Err(refused(line, "a list".to_owned()));
    }
    let dump: Dump =
        serde_json::from_str(text).map_err(|error| refused(error.line(), error.to_string()))?;
    let area = read_area(&dump)?;
    let mut pairs = BTreeMap::new();
    let count = share_of(dump.packets.len(), share);
    for (index, packet) in dump.packets.iter().take(count).enumerate() {
        let packet = read_packet(packet)
            .map_err(|(found, expected)| wrong(format!("packets[{index}]: "), found, expected))?;
        pairs
            .entry(packet.key())
            .or_insert_with(|| Pair::at(&packet))
            .add(&packet);
    }
    if pairs.is_empty() {
        return Err(wrong(
            String::new(),
            "no packets",
            format!("\"packets\": [{PACKET}, ...]"),
        ));
    }
    Ok(Recording {
        links: pairs.values().map(Pair::link).collect(),
        unit: LengthUnit::Cell,
        area,
        imaging: None,
        pooled_in_m: None,
        is_without_offsets: false,
        is_of_samples: false,
        runs: BTreeSet::new(),
        channels: BTreeSet::new(),
        heights_m: Vec::new(),
        without_heights: None,
        in_time: Vec::new(),
        devices: Vec::new(),
        keyed: Vec::new(),
        repeated: 0,
    })
}

/// Returns the area of a dump; without a size there is none.
fn read_area(dump: &Dump) -> Result<Option<Rect>, RecordingError> {
    let (north, east) =
        pair_of(dump.origin.as_ref(), "origin", (-FARTHEST_M, FARTHEST_M))?.unwrap_or((0.0, 0.0));
    let size = pair_of(dump.size.as_ref(), "size", SIDE_CELLS)?;
    Ok(size.map(|(to_north, to_east)| {
        Rect::new(
            Point::new(east, north),
            Point::new(east + to_east, north + to_north),
        )
    }))
}

/// Reads two numbers within limits; `None` where the key is missing.
fn pair_of(
    value: Option<&Value>,
    name: &str,
    (low, high): (f64, f64),
) -> Result<Option<(f64, f64)>, RecordingError> {
    let Some(value) = value else { return Ok(None) };
    let number = |value: &Value| {
        value
            .as_f64()
            .filter(|number| (low..=high).contains(number))
    };
    let numbers: Option<Vec<f64>> = value
        .as_array()
        .and_then(|list| list.iter().map(number).collect());
    match numbers.as_deref() {
        Some(&[north, east]) => Ok(Some((north, east))),
        Some(_) | None => Err(wrong(
            format!("\"{name}\": "),
            quoted(&value.to_string()),
            format!("[north, east], two numbers from {low} to {high}"),
        )),
    }
}

/// One packet of a dump; x = east, y = north.
struct Packet {
    from: Point,
    to: Point,
    /// Ends (0 to 2) that did not stand at their lattice point.
    loose_ends: u32,
    rssi_dbm: f64,
}

fn read_packet(packet: &Value) -> Result<Packet, (String, String)> {
    let shown = |value: &Value| quoted(&value.to_string());
    let fields = packet.as_array().filter(|fields| fields.len() == 8);
    let fields = fields.ok_or_else(|| (shown(packet), format!("8 fields {PACKET}")))?;
    let number = |index: usize, (low, high): (f64, f64), what: &str| {
        let value = fields[index]
            .as_f64()
            .filter(|value| (low..=high).contains(value));
        value.ok_or_else(|| {
            (
                format!("{} in field {index}", shown(&fields[index])),
                format!("{what} from {low} to {high}"),
            )
        })
    };
    let flag = |index: usize| {
        let expected = || {
            (
                format!("{} in field {index}", shown(&fields[index])),
                "true or false".to_owned(),
            )
        };
        fields[index].as_bool().ok_or_else(expected)
    };
    let place = |north: usize, east: usize| {
        let limits = (-FARTHEST_M, FARTHEST_M);
        Ok::<_, (String, String)>(Point::new(
            number(east, limits, "a coordinate")?,
            number(north, limits, "a coordinate")?,
        ))
    };
    Ok(Packet {
        from: place(1, 2)?,
        to: place(4, 5)?,
        loose_ends: u32::from(!flag(3)?) + u32::from(!flag(6)?),
        rssi_dbm: number(7, STRENGTH_DBM, "dBm")?,
    })
}

impl Packet {
    /// Names the two places, direction-free; the bits of a float serve only to tell places apart.
    fn key(&self) -> [u64; 4] {
        let bits = |at: Point| [at.y_m.to_bits(), at.x_m.to_bits()];
        let (a, b) = (bits(self.from), bits(self.to));
        let (low, high) = if a <= b { (a, b) } else { (b, a) };
        [low[0], low[1], high[0], high[1]]
    }
}

/// All packets between two lattice points.
struct Pair {
    from: Point,
    to: Point,
    weight: f64,
    sum: f64,
    square_sum: f64,
}

impl Pair {
    fn at(packet: &Packet) -> Pair {
        Pair {
            from: packet.from,
            to: packet.to,
            weight: 0.0,
            sum: 0.0,
            square_sum: 0.0,
        }
    }

    /// A vehicle that did not say that it stood at its point was within a cell of it: such a packet tells
    /// about the same path, but each loose end halves its weight.
    fn add(&mut self, packet: &Packet) {
        let weight = LOOSE_WEIGHT.powi(packet.loose_ends.min(2) as i32);
        self.weight += weight;
        self.sum += weight * packet.rssi_dbm;
        self.square_sum += weight * packet.rssi_dbm * packet.rssi_dbm;
    }

    fn link(&self) -> Link {
        let mean_dbm = self.sum / self.weight;
        let variance = (self.square_sum / self.weight - mean_dbm * mean_dbm).max(0.0);
        // That of a sample tells too little of what it was drawn from.
        let unbiased = match self.weight > 1.0 {
            true => variance * self.weight / (self.weight - 1.0),
            false => 0.0,
        };
        let packets = libm::round(self.weight).max(1.0) as u32;
        Link {
            spread_db: unbiased.sqrt(),
            ..Link::fixed(self.from, self.to, packets, mean_dbm)
        }
    }
}

/// Weight of a packet for each end that was under way.
const LOOSE_WEIGHT: f64 = 0.5;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Imaging, Reception};

    /// Samples of three vehicles, of which the third sends 6 dB more strongly; every other square two of them have measured
    /// alone.
    fn samples() -> String {
        let mut text =
            "run,sequence,vehicle,boot,transmitter,tx_x_m,tx_y_m,rx_x_m,rx_y_m,rssi_dbm\n"
                .to_owned();
        let mut sequence = 0;
        for step in 0..60_i32 {
            for (transmitter, receiver) in [(1, 2), (2, 1), (1, 3), (3, 1), (2, 3), (3, 2)] {
                if step % 2 == 1 && transmitter + receiver == 3 {
                    continue;
                }
                sequence += 1;
                let rssi = -60 - step % 7 + if transmitter == 3 { 6 } else { 0 };
                text += &format!(
                    "2,{sequence},{receiver},1,{transmitter},{step},0.2,0.2,30.2,{rssi}\n"
                );
            }
        }
        text
    }

    #[test]
    fn samples_and_the_links_of_the_same_sweep_without_offsets_show_no_change() {
        let samples = read_recording(samples().as_bytes()).unwrap();
        assert!(samples.devices.iter().all(Option::is_some));
        let (pooled, _, offsets) = samples.pooled_for(None, 0.5);
        assert!(offsets.is_some());
        let imaging = LinksFile {
            area: Rect::new(Point::new(0.0, 0.0), Point::new(60.0, 30.0)),
            as_measured: false,
            channel: Some(11),
            reception: Reception::default(),
            imaging: Imaging {
                bin_m: 0.5,
                ..Imaging::default()
            },
        };
        let written = Recording {
            links: pooled,
            imaging: Some(imaging),
            pooled_in_m: Some(0.5),
            is_without_offsets: true,
            devices: Vec::new(),
            ..samples.clone()
        };
        let most_db = |bin_m: f64, now: &Recording, empty: &Recording| {
            let (now, empty, offsets) = now.pooled_for(Some(empty), bin_m);
            assert!(offsets.is_some());
            let pairs = now.iter().zip(empty.as_deref().unwrap_or_default());
            let changes = pairs.map(|(now, empty)| (now.mean_dbm - empty.mean_dbm).abs());
            changes.fold(0.0, f64::max)
        };
        // In other bins than it is pooled in nobody knows who measured it, and it is without offsets all the same.
        for bin_m in [0.5, 0.25] {
            assert!(most_db(bin_m, &samples, &written) < 1e-6);
            assert!(most_db(bin_m, &written, &samples) < 1e-6);
        }
    }

    #[test]
    fn links_are_read_as_they_were_written_whatever_power_they_were_sent_with() {
        let (from, to) = (Point::new(0.0, 1.0), Point::new(6.0, 6.0));
        let missed = Link::of_packet(from, to, 8.0, None);
        let heard = Link::fixed(to, Point::new(0.0, 9.0), 4, -68.0);
        for links in [vec![heard], vec![heard, missed]] {
            let text = links_csv(&links, None);
            let read = read_recording(text.as_bytes()).unwrap().links;
            let told = |link: &Link| (link.packets, link.misses, link.missed_power_dbm);
            let [read, links] = [read, links].map(|all| all.iter().map(told).collect::<Vec<_>>());
            assert_eq!(read, links);
        }
    }

    #[test]
    fn lines_that_come_again_are_pooled_and_counts_beyond_all_are_refused() {
        let head = "tx_x_m,tx_y_m,rx_x_m,rx_y_m,rssi_dbm,packets,spread_db\n";
        let line = "0,0,6,6,-60,4,2\n0,6,6,0,-62,4,2\n";
        let pooled = |lines: &str| {
            let mut recording = read_recording(format!("{head}{lines}").as_bytes()).unwrap();
            recording.pooled_in_m = Some(0.5);
            recording.pooled_for(None, 0.5).0
        };
        let (once, twice) = (pooled(line), pooled(&line.repeat(2)));
        assert_eq!((once.len(), twice.len()), (2, 2));
        assert_eq!((once[0].packets, twice[0].packets), (4, 8));
        // Four values with a deviation of 2 dB, twice: 6/7 of the variance, since there are seven to tell it by, not three.
        assert!((twice[0].spread_db - 2.0 * (6.0f64 / 7.0).sqrt()).abs() < 1e-6);
        let many = format!("{head}0,0,6,6,-60,4294967295,0\n");
        let said = read_recording(many.as_bytes()).unwrap_err().to_string();
        assert!(
            said.contains("2: ") && said.contains("at most 10000000 of each"),
            "{said}"
        );
    }
}
