//! The recording of a live node: a thread that writes, fed by the threads of the actors, which it never holds up.
//!
//! ```text
//!   actor's thread: scribe.prepare ─► act_watched ─step─► scribe.step ─► bounded queue ─► thread ─► Flight ─► files
//! ```
//!
//! What does not fit into the queue is lost, and the segment with it: it is marked with a gap and ended, and every
//! actor hands in a snapshot for the next one before its next step. When nothing can be written, or the disk has no room
//! beside its reserve, the node goes on without a recording, and the thread tries again after 10 s.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread::{JoinHandle, Thread};
use std::time::{Duration, Instant};

use serde::Serialize;

use super::flight::{OpenRecording, RecordingLimits, RecordingSubject};
use super::segment::WriteError;
use crate::actor::{ActorStep, Snapshot};
use crate::store::lost_thread;
use crate::time::Time;

/// Steps and snapshots that may wait to be written.
const QUEUE: usize = 4096;
/// So many are written before the thread looks for anything else.
const BATCH: usize = 256;
/// All is written out this often.
const FLUSH_EVERY: Duration = Duration::from_millis(500);
/// The thread is woken before that when so many wait.
const WAKES_AT: usize = 1024;
/// After this long it is tried again to write.
const RETRY_AFTER: Duration = Duration::from_secs(10);
/// No segment is open: nothing is recorded.
const NONE: u64 = 0;

/// What the actors' threads and the writing thread share.
#[derive(Debug, Default)]
struct Shared {
    /// The newest segment; [`NONE`] while nothing is recorded.
    segment: AtomicU64,
    /// Something did not fit into the queue.
    is_overrun: AtomicBool,
    is_ended: AtomicBool,
    trouble: Mutex<Option<String>>,
    /// What all segments take, bytes.
    used_bytes: AtomicU64,
    /// UTC at the start of the node, nanoseconds since 1970; 0 = not known.
    utc_at_zero_ns: AtomicU64,
    /// Steps and snapshots that wait to be written.
    waiting: AtomicUsize,
    /// The writing thread.
    writer: OnceLock<Thread>,
}

impl Shared {
    fn wake_writer(&self) {
        self.writer.get().into_iter().for_each(Thread::unpark);
    }

    fn set_use(&self, flight: &OpenRecording) {
        self.used_bytes
            .store(flight.used_bytes(), Ordering::Relaxed);
    }

    fn utc_at_zero_ns(&self) -> Option<u64> {
        let utc_ns = self.utc_at_zero_ns.load(Ordering::Relaxed);
        (utc_ns > 0).then_some(utc_ns)
    }

    fn set_trouble(&self, trouble: Option<String>) {
        *self.trouble.lock().unwrap_or_else(PoisonError::into_inner) = trouble;
    }
}

/// What is handed to the writing thread, with the number of its segment.
enum Sent {
    Snapshot(u64, Time, Snapshot),
    Step(u64, ActorStep),
}

/// What a recording takes of the disk.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RecordingUse {
    /// All segments together, bytes.
    pub used_bytes: u64,
    /// What they may take together, bytes.
    pub cap_bytes: u64,
}

/// A recorder at work; dropped, it ends its files in order.
#[derive(Debug)]
pub struct Recorder {
    shared: Arc<Shared>,
    sender: SyncSender<Sent>,
    cap_bytes: u64,
    thread: Option<JoinHandle<()>>,
}

impl Recorder {
    /// Begins to record into a folder. A folder that cannot be written is a [`Recorder::trouble`] and no error.
    pub fn start(folder: PathBuf, about: RecordingSubject, limits: RecordingLimits) -> Recorder {
        Recorder::with_queue(folder, about, limits, QUEUE)
    }

    fn with_queue(
        folder: PathBuf,
        about: RecordingSubject,
        limits: RecordingLimits,
        queue: usize,
    ) -> Recorder {
        let shared = Arc::new(Shared::default());
        let (sender, receiver) = sync_channel(queue);
        let cap_bytes = limits.cap_bytes;
        let mut writing = Writing {
            folder,
            about,
            limits,
            flight: None,
            given: NONE,
            now: Time::ZERO,
            shared: shared.clone(),
        };
        // The first segment is open before the first actor acts.
        let retry_at = writing.begin();
        let spawned = std::thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || writing.run(&receiver, retry_at));
        let thread = match spawned {
            Ok(thread) => {
                // Nobody else sets it.
                let _ = shared.writer.set(thread.thread().clone());
                Some(thread)
            }
            Err(error) => {
                shared.segment.store(NONE, Ordering::Release);
                shared.set_trouble(Some(error.to_string()));
                None
            }
        };
        Recorder {
            shared,
            sender,
            cap_bytes,
            thread,
        }
    }

    /// Returns a scribe for one actor.
    pub fn scribe(&self) -> StepRecorder {
        StepRecorder {
            shared: self.shared.clone(),
            sender: self.sender.clone(),
            segment: NONE,
            broken: NONE,
        }
    }

    /// Notes UTC at the start of the node, nanoseconds since 1970, by a clock that is believed.
    pub fn note_utc(&self, at_zero_ns: u64) {
        self.shared
            .utc_at_zero_ns
            .store(at_zero_ns, Ordering::Relaxed);
    }

    /// Returns what it takes of the disk, and what it may take.
    pub fn disk_use(&self) -> RecordingUse {
        RecordingUse {
            used_bytes: self.shared.used_bytes.load(Ordering::Relaxed),
            cap_bytes: self.cap_bytes,
        }
    }

    /// Returns why nothing is recorded at present, if so.
    pub fn trouble(&self) -> Option<String> {
        let told = self.shared.trouble.lock();
        let told = told.unwrap_or_else(PoisonError::into_inner).clone();
        lost_thread(self.thread.as_ref()).or(told)
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.shared.is_ended.store(true, Ordering::Release);
        self.shared.wake_writer();
        // A thread that has panicked has nothing left to write.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// Writes down what one actor does. It never waits.
#[derive(Debug)]
pub struct StepRecorder {
    shared: Arc<Shared>,
    sender: SyncSender<Sent>,
    /// The segment that has this actor's snapshot.
    segment: u64,
    /// The segment that lost something of this actor.
    broken: u64,
}

impl StepRecorder {
    /// Hands in the actor's snapshot when a segment has begun since the last time. To be called before every
    /// [`crate::actor::ActorCell::act_watched`]; returns whether its steps are to be watched.
    pub fn prepare<A: Serialize>(&mut self, now: Time, name: &'static str, actor: &A) -> bool {
        let newest = self.shared.segment.load(Ordering::Acquire);
        if newest == NONE || newest == self.broken {
            return false;
        }
        if newest != self.segment {
            // What cannot be packed is a mistake of ours; the steps would be of no use without.
            let Ok(snapshot) = Snapshot::of(name, actor) else {
                return false;
            };
            self.segment = newest;
            self.send(Sent::Snapshot(newest, now, snapshot));
        }
        self.segment != self.broken
    }

    /// Hands in what the actor did.
    pub fn step(&mut self, step: ActorStep) {
        if self.segment != self.broken {
            self.send(Sent::Step(self.segment, step));
        }
    }

    /// Forgets the snapshot: the actor has been made anew.
    pub fn restarted(&mut self) {
        self.segment = NONE;
    }

    fn send(&mut self, sent: Sent) {
        // Counted first, so that it is never taken before it is counted.
        let waiting = self.shared.waiting.fetch_add(1, Ordering::AcqRel) + 1;
        if self.sender.try_send(sent).is_err() {
            self.shared.waiting.fetch_sub(1, Ordering::AcqRel);
            self.broken = self.segment;
            self.shared.is_overrun.store(true, Ordering::Release);
            self.shared.wake_writer();
        } else if waiting == WAKES_AT {
            self.shared.wake_writer();
        }
    }
}

/// The writing thread.
struct Writing {
    folder: PathBuf,
    about: RecordingSubject,
    limits: RecordingLimits,
    flight: Option<OpenRecording>,
    /// The highest number that a segment was given, also of one that was dropped since.
    given: u64,
    /// The latest moment that was handed in.
    now: Time,
    shared: Arc<Shared>,
}

impl Writing {
    fn run(mut self, receiver: &Receiver<Sent>, mut retry_at: Option<Instant>) {
        let mut flush_at = Instant::now() + FLUSH_EVERY;
        loop {
            let is_ended = self.shared.is_ended.load(Ordering::Acquire);
            let waiting: Vec<Sent> = receiver.try_iter().take(BATCH).collect();
            self.shared
                .waiting
                .fetch_sub(waiting.len(), Ordering::AcqRel);
            if is_ended && waiting.is_empty() {
                break;
            }
            let written = waiting.iter().try_for_each(|sent| self.write(sent));
            let now = Instant::now();
            let kept = written.and_then(|()| {
                if now >= flush_at {
                    self.flush()
                } else {
                    Ok(())
                }
            });
            if now >= flush_at {
                flush_at = now + FLUSH_EVERY;
            }
            if let Err(error) = kept {
                retry_at = self.give_up(&error);
            }
            if self.flight.is_none() && retry_at.is_none_or(|at| now >= at) {
                retry_at = self.begin();
            }
            // It is not woken for every step: a node at rest would do little else.
            if waiting.len() < BATCH && !is_ended {
                std::thread::park_timeout(flush_at.saturating_duration_since(Instant::now()));
            }
        }
        if let Some(Err(error)) = self.flight.take().map(OpenRecording::end) {
            self.shared.set_trouble(Some(error.to_string()));
        }
    }

    /// Opens the first segment; returns when to try again when that fails.
    fn begin(&mut self) -> Option<Instant> {
        let known_ns = self.shared.utc_at_zero_ns();
        self.about.utc_at_zero_ns = known_ns.or(self.about.utc_at_zero_ns);
        let mut flight =
            OpenRecording::new(&self.folder, self.about.clone(), self.limits).after(self.given);
        match flight.begin(self.now, None) {
            Ok(number) => {
                self.shared.set_use(&flight);
                self.flight = Some(flight);
                self.given = number;
                self.shared.is_overrun.store(false, Ordering::Release);
                self.shared.segment.store(number, Ordering::Release);
                self.shared.set_trouble(None);
                None
            }
            Err(error) => self.give_up(&error),
        }
    }

    fn give_up(&mut self, error: &WriteError) -> Option<Instant> {
        self.flight = None;
        self.shared.segment.store(NONE, Ordering::Release);
        self.shared.set_trouble(Some(error.to_string()));
        Some(Instant::now() + RETRY_AFTER)
    }

    fn write(&mut self, sent: &Sent) -> Result<(), WriteError> {
        let now = match sent {
            Sent::Snapshot(_, now, _) => *now,
            Sent::Step(_, step) => step.now,
        };
        self.now = self.now.max(now);
        let Some(flight) = &mut self.flight else {
            return Ok(());
        };
        match sent {
            Sent::Snapshot(number, now, snapshot) => flight.snapshot(*number, *now, snapshot),
            Sent::Step(number, step) => flight.step(*number, step),
        }
    }

    fn flush(&mut self) -> Result<(), WriteError> {
        let Some(flight) = &mut self.flight else {
            return Ok(());
        };
        if let Some(utc_ns) = self.shared.utc_at_zero_ns() {
            flight.note_utc(utc_ns)?;
        }
        let is_full = flight.flush(self.now)?;
        self.shared.set_use(flight);
        let is_overrun = self.shared.is_overrun.swap(false, Ordering::AcqRel);
        if is_full || is_overrun {
            let gap = is_overrun.then_some("more came than could be written");
            let number = flight.begin(self.now, gap)?;
            self.given = number;
            self.shared.segment.store(number, Ordering::Release);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::reader::{ReadError, Reader, RecordingContents};
    use super::*;
    use crate::actor::{RecordedStep, StepCause};
    use crate::geom::Lattice;
    use crate::node::radio::{self, Radio};
    use std::path::Path;

    fn about() -> RecordingSubject {
        let settings = "kind = \"vehicle\"".to_owned();
        RecordingSubject {
            node: "vehicle/1".to_owned(),
            settings,
            venue: String::new(),
            lattice: Lattice::new(0.2),
            start: None,
            utc_at_zero_ns: None,
        }
    }

    fn step(number: u64) -> ActorStep {
        let cause = StepCause::Input(radio::In::Measure(None));
        let step = RecordedStep {
            now: Time::from_nanos(number),
            cause,
            outputs: Vec::new(),
            fault: None,
        };
        ActorStep::new::<Radio>("radio", step)
    }

    /// What stands in a segment: the ends of the topics, in order, and how the file ends.
    fn read(folder: &Path, number: u64) -> (Vec<String>, Option<ReadError>) {
        let path = folder.join(format!("flight-{number:06}.mcap"));
        let mut reader = Reader::new(std::fs::File::open(path).unwrap());
        let mut found = Vec::new();
        loop {
            match reader.next_found() {
                Ok(None) => return (found, None),
                Ok(Some(RecordingContents::Metadata { name, .. })) => found.push(name),
                Ok(Some(RecordingContents::Message { topic, .. })) => found.push(topic),
                Err(error) => return (found, Some(error)),
            }
        }
    }

    fn wait_until(mut what: impl FnMut() -> bool) {
        for _ in 0..500 {
            if what() {
                return;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        panic!("it never comes");
    }

    #[test]
    fn a_segment_is_readable_while_it_is_written_and_whole_in_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let recorder = Recorder::start(
            folder.path().to_owned(),
            about(),
            RecordingLimits::default(),
        );
        let mut scribe = recorder.scribe();
        assert!(scribe.prepare(Time::ZERO, "radio", &7_u32));
        (1..=100).for_each(|number| scribe.step(step(number)));
        wait_until(|| read(folder.path(), 1).0.len() == 3 + 100);
        assert!(
            matches!(read(folder.path(), 1).1, Some(ReadError::Truncated { .. })),
            "as after a kill"
        );
        drop(recorder);
        let (found, end) = read(folder.path(), 1);
        assert!(end.is_none(), "{end:?}");
        assert_eq!(
            found[..4],
            [
                "tomoswarm",
                "settings",
                "/vehicle/1/radio/snapshot",
                "/vehicle/1/radio/step"
            ]
        );
        assert_eq!(found.len(), 3 + 100);
    }

    #[test]
    fn what_comes_too_fast_ends_the_segment_and_the_next_opens_with_a_snapshot() {
        let folder = tempfile::tempdir().unwrap();
        let recorder = Recorder::with_queue(
            folder.path().to_owned(),
            about(),
            RecordingLimits::default(),
            8,
        );
        let mut scribe = recorder.scribe();
        assert!(scribe.prepare(Time::ZERO, "radio", &7_u32));
        (1..=20_000).for_each(|number| scribe.step(step(number)));
        assert!(
            !scribe.prepare(Time::ZERO, "radio", &7_u32),
            "nothing more of it in a broken segment"
        );
        wait_until(|| scribe.prepare(Time::ZERO, "radio", &8_u32));
        scribe.step(step(20_001));
        drop(recorder);
        let (first, second) = (read(folder.path(), 1).0, read(folder.path(), 2).0);
        assert_eq!(first.last().unwrap(), "gap");
        assert_eq!(
            second[2..],
            ["/vehicle/1/radio/snapshot", "/vehicle/1/radio/step"]
        );
    }

    #[test]
    fn utc_that_is_known_late_is_noted_once() {
        let folder = tempfile::tempdir().unwrap();
        let recorder = Recorder::start(
            folder.path().to_owned(),
            about(),
            RecordingLimits::default(),
        );
        let begun = ["tomoswarm", "settings"];
        wait_until(|| read(folder.path(), 1).0 == begun);
        recorder.note_utc(7_000_000_000);
        let noted = ["tomoswarm", "settings", "utc"];
        wait_until(|| read(folder.path(), 1).0 == noted);
        // A clock that is slewed is not set.
        recorder.note_utc(7_900_000_000);
        std::thread::sleep(2 * FLUSH_EVERY);
        drop(recorder);
        assert_eq!(read(folder.path(), 1).0, noted);
    }

    #[test]
    fn where_nothing_can_be_written_the_node_goes_on_without() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, "in the way").unwrap();
        let recorder = Recorder::start(path, about(), RecordingLimits::default());
        assert!(recorder.trouble().unwrap().contains("cannot be written"));
        assert!(!recorder.scribe().prepare(Time::ZERO, "radio", &7_u32));
    }

    #[test]
    fn a_writing_thread_that_has_ended_is_a_trouble() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().to_owned();
        let mut recorder = Recorder::start(path, about(), RecordingLimits::default());
        assert_eq!(recorder.trouble(), None);
        let ended = std::thread::spawn(|| {});
        let writing = recorder.thread.replace(ended);
        wait_until(|| recorder.trouble().is_some());
        assert!(recorder.trouble().unwrap().contains("has ended"));
        recorder.thread = writing;
        assert_eq!(recorder.trouble(), None);
    }

    #[test]
    fn no_segment_has_the_number_of_one_that_was_begun_before() {
        let folder = tempfile::tempdir().unwrap();
        let flight = OpenRecording::new(folder.path(), about(), RecordingLimits::default());
        assert_eq!(flight.after(3).begin(Time::ZERO, None).unwrap(), 4);
        let flight = OpenRecording::new(folder.path(), about(), RecordingLimits::default());
        assert_eq!(flight.after(NONE).begin(Time::ZERO, None).unwrap(), 5);
    }

    #[test]
    fn the_oldest_segments_go_when_all_are_too_large() {
        let folder = tempfile::tempdir().unwrap();
        let limits = RecordingLimits {
            cap_bytes: 60_000,
            segment_bytes: 10_000,
            segment: Duration::from_secs(300),
            leaves_reserve: false,
        };
        let mut flight = OpenRecording::new(folder.path(), about(), limits);
        let mut segment = flight.begin(Time::ZERO, None).unwrap();
        for number in 0..4000 {
            flight.step(segment, &step(number)).unwrap();
            if number % 50 == 0 && flight.flush(Time::from_nanos(number)).unwrap() {
                segment = flight.begin(Time::from_nanos(number), None).unwrap();
            }
        }
        flight.end().unwrap();
        let sizes = std::fs::read_dir(folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().metadata().unwrap().len());
        let total: u64 = sizes.sum();
        assert!(
            segment > 6 && (20_000..80_000).contains(&total),
            "{segment} segments, {total} bytes left"
        );
        assert!(!folder.path().join("flight-000001.mcap").exists());
    }
}
