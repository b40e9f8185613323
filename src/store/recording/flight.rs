//! The recording of one node: its segments, one after another, within a size.
//!
//! Whoever records says when a segment begins and hands in snapshots and steps with the number of the segment that
//! they belong to; the actors of a live node move on to a new segment one by one, so the one before stays open until
//! the next but one. Nothing here waits, retries or starts a thread.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tomoswarm_proto::Boot;

use super::actors;
use super::folder;
use super::message::{self, MessageError};
use super::schema::Schema;
use super::segment::{Segment, WriteError};
use super::view::{MessageLine, RecordingView};
use super::{FORMAT, VERSION};
use crate::actor::{ActorStep, Snapshot};
use crate::geom::Lattice;
use crate::store::DiskRoom;
use crate::time::Time;

/// UTC at the start of a node is noted anew when its machine's clock was set by so much, nanoseconds.
const UTC_STEP_NS: u64 = 1_000_000_000;

/// What a recording is of.
#[derive(Clone, Debug)]
pub struct RecordingSubject {
    /// The node as its channels name it: `vehicle/3`, `ground`.
    pub node: String,
    /// The text of its config.
    pub settings: String,
    /// The venue that it is in, as text of a venue file.
    pub venue: String,
    /// The cells of its map.
    pub lattice: Lattice,
    /// Which start of the node's software it is; `None` in a simulation, whose nodes share one time.
    pub start: Option<Boot>,
    /// UTC at the start of the node, nanoseconds since 1970, when it is known from the beginning; log times stay the node's.
    pub utc_at_zero_ns: Option<u64>,
}

/// How large a recording may be.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RecordingLimits {
    /// All segments together, bytes.
    pub cap_bytes: u64,
    /// One segment, bytes; a quarter of the cap at most.
    pub segment_bytes: u64,
    /// One segment, time.
    pub segment: Duration,
    /// Whether it gives way when the disk has less room than its reserve ([`DiskRoom`]).
    pub leaves_reserve: bool,
}

impl Default for RecordingLimits {
    /// 512 MiB in segments of 32 MiB or 5 minutes, whatever room the disk has.
    fn default() -> RecordingLimits {
        RecordingLimits {
            cap_bytes: 512 << 20,
            segment_bytes: 32 << 20,
            segment: Duration::from_secs(300),
            leaves_reserve: false,
        }
    }
}

/// A recording that is being written.
pub struct OpenRecording {
    folder: PathBuf,
    about: RecordingSubject,
    limits: RecordingLimits,
    view: RecordingView,
    /// The newest segment and the one before, by number.
    open: BTreeMap<u64, Segment>,
    last: u64,
    used_bytes: u64,
}

impl OpenRecording {
    /// Makes a recording in a folder of its own; segments that are there already count against its size.
    pub fn new(folder: &Path, about: RecordingSubject, limits: RecordingLimits) -> OpenRecording {
        let view = RecordingView::new(&about.node, about.lattice);
        OpenRecording {
            folder: folder.to_owned(),
            about,
            limits,
            view,
            open: BTreeMap::new(),
            last: 0,
            used_bytes: 0,
        }
    }

    /// Gives no segment a number up to this one: who records has sent what begins such a segment, and sends it once.
    pub fn after(self, last: u64) -> OpenRecording {
        OpenRecording { last, ..self }
    }

    /// Returns what all segments take together, bytes, as of the last [`OpenRecording::flush`] or beginning.
    pub fn used_bytes(&self) -> u64 {
        self.used_bytes
    }

    /// Begins a segment and gives its number; `gap` says what is missing before it.
    ///
    /// # Errors
    /// The file cannot be made, or an older one not ended, or the disk has no room beside its reserve.
    pub fn begin(&mut self, now: Time, gap: Option<&str>) -> Result<u64, WriteError> {
        while self.open.len() > 1 {
            self.end_oldest()?;
        }
        if let Some(gap) = gap
            && let Some((_, segment)) = self
                .open
                .last_entry()
                .map(|entry| (*entry.key(), entry.into_mut()))
        {
            let words = [
                ("reason", gap.to_owned()),
                ("at_ns", now.as_nanos().to_string()),
            ];
            segment.metadata(
                "gap",
                words.map(|(name, value)| (name.to_owned(), value)).into(),
            )?;
        }
        let (number, path) = folder::next(&self.folder, self.last)?;
        self.make_room(if self.open.is_empty() {
            self.segment_bytes()
        } else {
            0
        })?;
        let segment = Segment::create(&path, now, &self.preface(number))?;
        self.last = number;
        self.open.insert(number, segment);
        Ok(number)
    }

    /// Notes UTC at the start of the node, nanoseconds since 1970, in the newest segment, unless it says so already: its
    /// machine's clock may be set when the node has run for a while. Segments that begin later say it from the beginning.
    ///
    /// # Errors
    /// As for [`OpenRecording::snapshot`].
    pub fn note_utc(&mut self, at_zero_ns: u64) -> Result<(), WriteError> {
        let known_ns = self.about.utc_at_zero_ns.replace(at_zero_ns);
        if known_ns.is_some_and(|known_ns| known_ns.abs_diff(at_zero_ns) < UTC_STEP_NS) {
            return Ok(());
        }
        let Some(newest) = self.open.values_mut().next_back() else {
            return Ok(());
        };
        let words = [("at_zero_ns".to_owned(), at_zero_ns.to_string())];
        newest.metadata("utc", words.into())
    }

    fn preface(&self, number: u64) -> [(&'static str, BTreeMap<String, String>); 2] {
        let utc = self
            .about
            .utc_at_zero_ns
            .map_or("unknown".to_owned(), |nanos| nanos.to_string());
        let start = self
            .about
            .start
            .map_or("unknown".to_owned(), |start| start.0.to_string());
        let words = [
            ("format", FORMAT.to_owned()),
            ("software", VERSION.to_owned()),
            ("node", self.about.node.clone()),
            ("start", start),
            ("segment", number.to_string()),
            ("log_time", "nanoseconds since the node started".to_owned()),
            ("utc_at_zero_ns", utc),
        ];
        let settings = [
            ("toml".to_owned(), self.about.settings.clone()),
            ("venue".to_owned(), self.about.venue.clone()),
        ];
        let words = words.map(|(name, value)| (name.to_owned(), value));
        [("tomoswarm", words.into()), ("settings", settings.into())]
    }

    /// Writes an actor's snapshot; one for a segment that is closed already is left out.
    ///
    /// # Errors
    /// The disk is full, or the file went away.
    pub fn snapshot(
        &mut self,
        number: u64,
        now: Time,
        snapshot: &Snapshot,
    ) -> Result<(), WriteError> {
        let Some(segment) = self.open.get_mut(&number) else {
            return Ok(());
        };
        let text = written(segment, message::of_snapshot(now, snapshot))?;
        let topic = format!("/{}/{}/snapshot", self.about.node, snapshot.actor);
        segment.message(&topic, Schema::Snapshot, now, &text)
    }

    /// Writes what an actor did, and what people want to see of it.
    ///
    /// # Errors
    /// As for [`OpenRecording::snapshot`].
    pub fn step(&mut self, number: u64, step: &ActorStep) -> Result<(), WriteError> {
        let Some(segment) = self.open.get_mut(&number) else {
            return Ok(());
        };
        let (node, now) = (&self.about.node, step.now);
        let text = written(segment, actors::json(node, step))?;
        segment.message(
            &format!("/{node}/{}/step", step.actor),
            Schema::Step,
            now,
            &text,
        )?;
        for MessageLine {
            topic,
            schema,
            value,
        } in self.view.of(step)
        {
            segment.message(&topic, schema, now, &value.to_string())?;
        }
        Ok(())
    }

    /// Writes out all that was handed in and keeps the recording within its size. Tells whether the newest segment
    /// is large or old enough for the next one.
    ///
    /// # Errors
    /// As for [`OpenRecording::snapshot`].
    pub fn flush(&mut self, now: Time) -> Result<bool, WriteError> {
        let most = self.segment_bytes();
        let mut is_full = false;
        for segment in self.open.values_mut() {
            is_full =
                segment.flush()? >= most || now.since(segment.opened()) >= self.limits.segment;
        }
        self.make_room(0)?;
        Ok(is_full)
    }

    /// Ends all segments in order.
    ///
    /// # Errors
    /// As for [`OpenRecording::snapshot`].
    pub fn end(mut self) -> Result<(), WriteError> {
        while !self.open.is_empty() {
            self.end_oldest()?;
        }
        Ok(())
    }

    fn end_oldest(&mut self) -> Result<(), WriteError> {
        self.open
            .pop_first()
            .map_or(Ok(()), |(_, segment)| segment.finish())
    }

    fn segment_bytes(&self) -> u64 {
        self.limits.segment_bytes.min(self.limits.cap_bytes / 4)
    }

    /// Drops what is too much, also so that so many bytes are free beside the disk's reserve.
    fn make_room(&mut self, beside_bytes: u64) -> Result<(), WriteError> {
        let room = DiskRoom::of(&self.folder).filter(|_| self.limits.leaves_reserve);
        let missing_bytes = room.map_or(0, |room| room.missing_bytes(beside_bytes));
        let kept: Vec<&Path> = self.open.values().map(Segment::path).collect();
        let cap_bytes = self.limits.cap_bytes;
        let made = folder::make_room(&self.folder, cap_bytes, missing_bytes, &kept)?;
        self.used_bytes = made.used_bytes;
        match room.filter(|_| made.missing_bytes > 0) {
            None => Ok(()),
            Some(room) => Err(WriteError::at(&self.folder, no_room(room, beside_bytes))),
        }
    }
}

/// Says that a disk's reserve is not touched.
fn no_room(room: DiskRoom, beside_bytes: u64) -> String {
    let beside = match beside_bytes.div_ceil(1 << 20) {
        0 => String::new(),
        file_mb => format!(", and {file_mb} MB are needed for the next file"),
    };
    format!(
        "{} MB are free on its disk, of which {} MB are kept free for samples{beside}",
        room.free_mb(),
        room.reserve_bytes() >> 20
    )
}

fn written(segment: &Segment, text: Result<String, MessageError>) -> Result<String, WriteError> {
    text.map_err(|error| WriteError::at(segment.path(), error))
}
