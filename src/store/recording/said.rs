//! What nodes said to each other, from their recordings: of each recorded node what it said and noted, and of the others
//! what the ground station or an operator heard of them. Nothing is computed again.
//!
//! Times are those of the run: of simulated nodes the virtual time, otherwise the time since the first of the nodes started, by
//! the nodes' own clocks.

use std::any::{Any, TypeId};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::{Path, PathBuf};

use tomoswarm_proto::{
    LOG_LINE_BYTES_MAX, LogLine, LogLines, LogSeverity, Message, OperatorId, Sender, VehicleId,
    codec, fitted,
};

use super::actors::{self, BusStep};
use super::reader::{ReadError, Reader, RecordingContents};
use super::replay::{FOREIGN, ReplayError, check_version, gap_note};
use crate::operator::HeardMessage;
use crate::time::Time;

/// What was said in a run.
#[derive(Clone, Debug, Default)]
pub struct RecordedRun {
    /// What was said and when, ascending.
    pub heard: Vec<(Time, HeardMessage)>,
    /// The venue, as text of a venue file; empty = no recording says it.
    pub venue: String,
    /// Files that end unfinished, or with a gap; in words.
    pub notes: Vec<String>,
}

/// Reads recordings of the nodes of one run.
///
/// # Errors
/// A file cannot be read, or is no recording of this version.
pub fn what_was_said(files: &[PathBuf]) -> Result<RecordedRun, ReplayError> {
    let mut run = RecordedRun::default();
    let (mut all, mut folders) = (Vec::new(), BTreeMap::new());
    for path in files {
        let refused = |reason: String| ReplayError {
            path: path.clone(),
            reason,
        };
        let Some(segment) = read(path, &mut run).map_err(refused)? else {
            continue;
        };
        let folder = path.parent();
        if let Some(node) = segment.node
            && *folders.entry(node).or_insert(folder) != folder
        {
            let reason =
                "is of a node that another folder has, too: recordings of one run are expected";
            return Err(refused(reason.to_owned()));
        }
        all.push(segment);
    }
    settle_utc(&mut all);
    run.notes.extend(place_starts(&mut all));
    let recorded: BTreeSet<Sender> = all.iter().filter_map(|segment| segment.node).collect();
    let hears_for_all = hears_for_all(&recorded);
    let starts_ns = all.iter().map(|segment| segment.utc_at_zero_ns);
    let first_ns = starts_ns.clone().flatten().min().unwrap_or(0);
    if starts_ns.clone().any(|start| start.is_some())
        && starts_ns.clone().any(|start| start.is_none())
    {
        let note =
            "not all nodes say when they started; those are shown as if they had started first";
        run.notes.push(note.to_owned());
    }
    let mut lines = Vec::new();
    for segment in all {
        let offset_ns = segment.utc_at_zero_ns.map_or(0, |start| start - first_ns);
        let shifted = |at: Time| Time::from_nanos(at.as_nanos().saturating_add(offset_ns));
        let said = segment.said.into_iter().filter_map(|(at, message)| {
            Some((shifted(at), HeardMessage::Message(segment.node?, message)))
        });
        let is_wanted = |heard: &HeardMessage| match heard {
            HeardMessage::Message(sender, _) => !recorded.contains(sender),
            HeardMessage::Greeting(..) => true,
            HeardMessage::Unknown(_) => false,
        };
        let heard = segment.heard.into_iter();
        let heard = heard.filter(|(_, heard)| is_wanted(heard) && segment.node == hears_for_all);
        let heard = heard.map(|(at, heard)| (shifted(at), heard));
        run.heard.extend(said.chain(heard));
        let node = segment.node;
        let of_node = segment.lines.into_iter();
        let of_node = of_node.filter_map(|(at, text)| Some((shifted(at), node?, text)));
        lines.extend(of_node);
    }
    run.heard.extend(numbered(lines));
    run.heard.sort_by_key(|(at, _)| *at);
    Ok(run)
}

/// Gives all segments of one start of a node the UTC that it noted last: until its clock was set it knew none, or a wrong one.
fn settle_utc(all: &mut [SegmentContents]) {
    let mut noted = BTreeMap::<(Sender, u32), (u64, u64)>::new();
    for segment in all.iter() {
        if let (Some(start), Some(utc_ns)) = (segment.start(), segment.utc_at_zero_ns) {
            let newest = noted.entry(start).or_default();
            *newest = (segment.number, utc_ns).max(*newest);
        }
    }
    for segment in all.iter_mut() {
        let newest = segment.start().and_then(|start| noted.get(&start));
        if let Some((_, utc_ns)) = newest {
            segment.utc_at_zero_ns = Some(*utc_ns);
        }
    }
}

/// Places starts of which no UTC was noted by those of the same node that noted one: after the last words of the one before,
/// or else so that they end where the next one begins. Returns a note of each; how long the node was away nobody knows.
fn place_starts(all: &mut [SegmentContents]) -> Vec<String> {
    let mut starts = BTreeMap::<(Sender, u32), StartTimes>::new();
    for segment in all.iter() {
        if let Some(start) = segment.start() {
            let times = starts.entry(start).or_default();
            times.utc_at_zero_ns = segment.utc_at_zero_ns;
            times.last_ns = times.last_ns.max(segment.last_ns());
        }
    }
    let mut in_order: Vec<((Sender, u32), StartTimes)> = starts.into_iter().collect();
    let mut placed = BTreeMap::new();
    let onwards = (1..in_order.len()).map(|at| (at - 1, at));
    let backwards = (1..in_order.len()).rev().map(|at| (at, at - 1));
    for (known, open) in onwards.chain(backwards) {
        let ((node, _), beside) = in_order[known];
        let (start, times) = &mut in_order[open];
        let Some(utc_ns) = beside.utc_at_zero_ns.filter(|_| start.0 == node) else {
            continue;
        };
        if times.utc_at_zero_ns.is_none() {
            let placed_ns = match known < open {
                true => utc_ns.saturating_add(beside.last_ns),
                false => utc_ns.saturating_sub(times.last_ns),
            };
            times.utc_at_zero_ns = Some(placed_ns);
            placed.insert(*start, placed_ns);
        }
    }
    for segment in all.iter_mut() {
        let utc_ns = segment.start().and_then(|start| placed.get(&start));
        segment.utc_at_zero_ns = utc_ns.copied().or(segment.utc_at_zero_ns);
    }
    let note = |(node, start): &(Sender, u32)| {
        format!(
            "{node}: its start {start} noted no time of day; it is shown right beside one that did"
        )
    };
    placed.keys().map(note).collect()
}

/// When a start of a node was, and how long it said something.
#[derive(Clone, Copy, Default)]
struct StartTimes {
    utc_at_zero_ns: Option<u64>,
    last_ns: u64,
}

/// Returns lines of nodes' logs as they would have been said to operators, numbered for each node over all its starts.
fn numbered(mut lines: Vec<(Time, Sender, String)>) -> Vec<(Time, HeardMessage)> {
    lines.sort_by_key(|(at, ..)| *at);
    let mut counts = BTreeMap::<Sender, u32>::new();
    let said = lines.into_iter().map(|(at, node, text)| {
        let number = counts.entry(node).or_default();
        *number = number.saturating_add(1);
        let line = LogLine {
            number: *number,
            age_ms: 0,
            severity: LogSeverity::Info,
            text: fitted(text, LOG_LINE_BYTES_MAX),
        };
        let log = LogLines {
            node,
            instance: 1,
            lines: vec![line],
        };
        (at, HeardMessage::Message(node, Message::Log(log)))
    });
    said.collect()
}

/// Returns a line that a recording shows people; `None` = it cannot be read, and nothing depends on it.
fn line(data: &[u8]) -> Option<(Time, String)> {
    let line: serde_json::Value = serde_json::from_slice(data).ok()?;
    let of = |name: &str| line["timestamp"][name].as_u64();
    let at = Time::from_nanos(
        of("sec")?
            .checked_mul(1_000_000_000)?
            .checked_add(of("nsec")?)?,
    );
    Some((at, line["message"].as_str()?.to_owned()))
}

/// Returns by whom is told what those said who were not recorded: the ground station, or else the first operator.
fn hears_for_all(recorded: &BTreeSet<Sender>) -> Option<Sender> {
    let is_operator = |node: &&Sender| matches!(node, Sender::Operator(_));
    let ground = recorded.get(&Sender::Ground);
    ground
        .or_else(|| recorded.iter().find(is_operator))
        .copied()
}

/// What one file holds.
#[derive(Default)]
struct SegmentContents {
    node: Option<Sender>,
    /// Which start of its software it is, and which segment; recordings of simulations, and old ones, do not say the start.
    software_start: Option<u32>,
    number: u64,
    /// UTC at that start, nanoseconds since 1970, as it says last.
    utc_at_zero_ns: Option<u64>,
    is_known: bool,
    said: Vec<(Time, Message)>,
    heard: Vec<(Time, HeardMessage)>,
    /// What it noted for people.
    lines: Vec<(Time, String)>,
}

/// Reads a file as far as it goes; `None` = it ends before it says of which node it is.
fn read(path: &Path, run: &mut RecordedRun) -> Result<Option<SegmentContents>, String> {
    let file = File::open(path).map_err(|error| format!("cannot be read: {error}"))?;
    let (mut reader, mut segment) = (Reader::new(file), SegmentContents::default());
    loop {
        match reader.next_found() {
            Ok(None) => break,
            Ok(Some(found)) => {
                let offset = reader.offset();
                let at = |reason: String| format!("before byte {offset}: {reason}");
                segment.take(path, found, run).map_err(at)?;
            }
            Err(error @ ReadError::Truncated { .. }) => {
                let shown = match segment.is_known {
                    true => "shown up to there",
                    false => "nothing of it is shown",
                };
                run.notes
                    .push(format!("{}: {error}; {shown}", path.display()));
                return Ok(segment.is_known.then_some(segment));
            }
            Err(error) => return Err(error.to_string()),
        }
    }
    match segment.is_known {
        true => Ok(Some(segment)),
        false => Err(FOREIGN.to_owned()),
    }
}

impl SegmentContents {
    /// Returns which start of which node it is of, if it says so.
    fn start(&self) -> Option<(Sender, u32)> {
        self.node.zip(self.software_start)
    }

    /// Returns the time since its start of the last that it holds.
    fn last_ns(&self) -> u64 {
        let said = self.said.iter().map(|(at, _)| at);
        let heard = self.heard.iter().map(|(at, _)| at);
        let all = said.chain(heard).chain(self.lines.iter().map(|(at, _)| at));
        all.map(|at| at.as_nanos()).max().unwrap_or(0)
    }

    fn take(
        &mut self,
        path: &Path,
        found: RecordingContents,
        run: &mut RecordedRun,
    ) -> Result<(), String> {
        let (topic, data) = match found {
            RecordingContents::Metadata { name, values } => {
                return self.metadata(path, &name, &values, run);
            }
            RecordingContents::Message { .. } if !self.is_known => return Err(FOREIGN.to_owned()),
            RecordingContents::Message { topic, data } => (topic, data),
        };
        if topic.ends_with("/log") {
            self.lines.extend(line(&data));
            return Ok(());
        }
        let Some(name) = topic.trim_start_matches('/').strip_suffix("/step") else {
            return Ok(());
        };
        let (node, actor) = name.rsplit_once('/').unwrap_or(("", name));
        let step = actors::bus_step(node, actor, &data);
        let Some(step) = step.map_err(|error| format!("{topic} {error}"))? else {
            return Ok(());
        };
        let BusStep { now, said, heard } = step;
        self.said
            .extend(said.into_iter().map(|message| (now, message)));
        self.heard.extend(heard.map(|heard| (now, heard)));
        Ok(())
    }

    fn metadata(
        &mut self,
        path: &Path,
        name: &str,
        values: &BTreeMap<String, String>,
        run: &mut RecordedRun,
    ) -> Result<(), String> {
        let value = |key: &str| values.get(key).map_or("unknown", String::as_str);
        match name {
            "tomoswarm" => {
                check_version(values)?;
                self.is_known = true;
                self.utc_at_zero_ns = value("utc_at_zero_ns").parse().ok();
                self.software_start = value("start").parse().ok();
                self.number = value("segment").parse().unwrap_or(0);
                let node = value("node");
                self.node =
                    Some(sender(node).ok_or_else(|| format!("is of the unknown node {node}"))?);
            }
            "settings" => {
                let venue = values.get("venue").map_or("", String::as_str);
                if run.venue.is_empty() {
                    run.venue = venue.to_owned();
                } else if !venue.is_empty() && venue != run.venue {
                    return Err("is of another venue than the files before".to_owned());
                }
            }
            "utc" => {
                let noted_ns = value("at_zero_ns").parse().ok();
                self.utc_at_zero_ns = noted_ns.or(self.utc_at_zero_ns);
            }
            "gap" => run.notes.push(gap_note(path, values)),
            _ => {}
        }
        Ok(())
    }
}

/// Returns who a node is, by the name that its topics give it.
fn sender(node: &str) -> Option<Sender> {
    match node.split_once('/') {
        None => (node == "ground").then_some(Sender::Ground),
        Some(("vehicle", id)) => Some(Sender::Vehicle(VehicleId(id.parse().ok()?))),
        Some(("operator", id)) => Some(Sender::Operator(OperatorId(id.parse().ok()?))),
        Some(_) => None,
    }
}

/// Returns what the bus brought, if an input is that, and who said it is known.
pub(super) fn brought<I: Any>(input: &I) -> Option<HeardMessage> {
    use crate::ground::station;
    use crate::operator::operator_actor;
    let input: &dyn Any = input;
    if let Some(operator_actor::In::Bus(heard)) = input.downcast_ref() {
        return Some(heard.clone());
    }
    let Some(station::In::Bus(message)) = input.downcast_ref() else {
        return None;
    };
    if let Message::Hello(hello) = message {
        let frame = codec::encode(message).ok()?;
        let greeting = codec::greeting(&frame).ok()?;
        return Some(HeardMessage::Greeting(greeting, Some(hello.clone())));
    }
    let author = match message {
        // A layer is mostly said by its writer; whoever repeats it says the same.
        Message::Tile(tile) => Some(Sender::Vehicle(tile.layer.vehicle)),
        other => other.author(),
    };
    Some(HeardMessage::Message(author?, message.clone()))
}

/// Returns whether an actor with such inputs is told by the bus what others said.
pub(super) fn hears<I: Any>() -> bool {
    use crate::ground::station;
    use crate::operator::operator_actor;
    let of = TypeId::of::<I>();
    of == TypeId::of::<station::In>() || of == TypeId::of::<operator_actor::In>()
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::Boot;

    use super::super::{OpenRecording, RecordingLimits, RecordingSubject};
    use super::*;
    use crate::geom::Lattice;

    fn recording(folder: &Path, start: Option<Boot>, utc_at_zero_ns: Option<u64>) -> OpenRecording {
        let about = RecordingSubject {
            node: "vehicle/1".to_owned(),
            settings: String::new(),
            venue: String::new(),
            lattice: Lattice::new(0.2),
            start,
            utc_at_zero_ns,
        };
        OpenRecording::new(folder, about, RecordingLimits::default())
    }

    #[test]
    fn a_file_cut_before_it_says_its_node_is_named_and_the_others_are_shown() {
        let folder = tempfile::tempdir().unwrap();
        let mut whole = recording(folder.path(), Some(Boot(7)), Some(1_000));
        whole.begin(Time::ZERO, None).unwrap();
        whole.end().unwrap();
        let whole = folder.path().join("flight-000001.mcap");
        let cut = folder.path().join("flight-000002.mcap");
        std::fs::write(&cut, &std::fs::read(&whole).unwrap()[..20]).unwrap();
        let run = what_was_said(&[cut.clone(), whole]).unwrap();
        let note = format!(
            "{}: ends unfinished at byte 20; nothing of it is shown",
            cut.display()
        );
        assert_eq!(run.notes, [note]);
    }

    #[test]
    fn a_start_whose_clock_was_set_late_has_the_time_that_it_noted_last() {
        let folder = tempfile::tempdir().unwrap();
        let mut set_late = recording(folder.path(), Some(Boot(7)), None);
        set_late.begin(Time::ZERO, None).unwrap();
        set_late.begin(Time::ZERO, None).unwrap();
        set_late.note_utc(5_000_000_000_000).unwrap();
        set_late.begin(Time::ZERO, None).unwrap();
        set_late.note_utc(5_020_000_000_000).unwrap();
        set_late.end().unwrap();
        // The next start never knows; one that says no start does so by its beginning alone, as recordings of before.
        for (start, utc_ns) in [(Some(Boot(8)), None), (None, Some(1_000))] {
            let mut other = recording(folder.path(), start, utc_ns);
            other.begin(Time::ZERO, None).unwrap();
            other.end().unwrap();
        }
        let mut run = RecordedRun::default();
        let mut all: Vec<SegmentContents> = (1..=5)
            .map(|number| folder.path().join(format!("flight-{number:06}.mcap")))
            .map(|path| read(&path, &mut run).unwrap().unwrap())
            .collect();
        let utc_ns = |all: &[SegmentContents]| -> Vec<Option<u64>> {
            all.iter().map(|segment| segment.utc_at_zero_ns).collect()
        };
        let (first, set) = (Some(5_000_000_000_000), Some(5_020_000_000_000));
        assert_eq!(utc_ns(&all), [None, first, set, None, Some(1_000)]);
        settle_utc(&mut all);
        assert_eq!(utc_ns(&all), [set, set, set, None, Some(1_000)]);
    }

    #[test]
    fn a_start_without_utc_stands_after_the_last_words_of_the_one_before_or_else_before_the_next() {
        let of = |vehicle: u8, start: Option<u32>, utc_at_zero_ns: Option<u64>, last_ns: u64| {
            SegmentContents {
                node: Some(Sender::Vehicle(VehicleId(vehicle))),
                software_start: start,
                utc_at_zero_ns,
                lines: vec![(Time::from_nanos(last_ns), String::new())],
                ..SegmentContents::default()
            }
        };
        let mut all = vec![
            of(1, Some(1), None, 30),
            of(1, Some(2), Some(1_000), 40),
            // A start of two segments, and one after it.
            of(1, Some(3), None, 20),
            of(1, Some(3), None, 70),
            of(1, Some(4), None, 5),
            of(1, Some(5), Some(9_000), 100),
            // One that says no start is shown from the beginning, as is a node that never knew.
            of(1, None, None, 1),
            of(2, Some(6), None, 1),
        ];
        let notes = place_starts(&mut all);
        let placed: Vec<Option<u64>> = all.iter().map(|segment| segment.utc_at_zero_ns).collect();
        let expected = [970, 1_000, 1_040, 1_040, 1_110, 9_000];
        let known = expected.into_iter().map(Some);
        assert_eq!(placed, known.chain([None, None]).collect::<Vec<_>>());
        let note = |start: u32| {
            format!(
                "vehicle 1: its start {start} noted no time of day; it is shown right beside one that did"
            )
        };
        assert_eq!(notes, [1, 3, 4].map(note));
    }
}
