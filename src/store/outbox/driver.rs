//! The thread that writes a vehicle's outbox: the driver behind `Effect::Keep`, `Forget` and `Recall`.
//!
//! Whoever hands it something never waits. Samples are written in groups, a group at least every 100 ms, and told
//! as `Event::SampleStored` after they are on disk. When the disk cannot be written they are kept in this thread's memory
//! instead, and told as well: a disk in trouble is reported by [`OutboxHealth`], and stops nothing. What is
//! in memory is written as soon as the disk lets it.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tomoswarm_proto::{Boot, RunId, Sample, VehicleId};

use super::file::OutboxFile;
use crate::node::Event;
use crate::node::outbox::{CHUNK, DroppedSamples, Recalled, SampleKey};
use crate::store::{StoreError, lost_thread};

/// Samples are written at least this often.
const GROUP: Duration = Duration::from_millis(100);
/// Samples of one group at most.
const GROUP_MOST: usize = 1024;
/// Samples that may wait to be written; about 1 MB.
const QUEUE: usize = 8192;
/// A disk in trouble is tried again this often.
const RETRY: Duration = Duration::from_secs(1);
/// Samples kept in memory at most while the disk is in trouble; about 3 MB.
const MEMORY_MOST: usize = 20_000;

/// Whose outbox it is, and where it lies.
#[derive(Clone, PartialEq, Debug)]
pub struct OutboxSettings {
    /// The file.
    pub path: PathBuf,
    /// The vehicle.
    pub vehicle: VehicleId,
    /// The present start of its software.
    pub boot: Boot,
    /// What the file may grow to, bytes.
    pub most_bytes: u64,
}

/// How an outbox fares.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct OutboxHealth {
    /// Why samples are not written to disk just now.
    pub trouble: Option<String>,
    /// What was found at the start and moved aside.
    pub moved_aside: Option<String>,
    /// Samples that are only in memory.
    pub not_durable: u64,
    /// Samples lost because the disk did not keep pace.
    pub overrun: u64,
}

/// What the thread is asked for.
#[derive(Debug)]
enum OutboxJob {
    Keep(RunId, Sample),
    Forget(Boot, RunId, u64),
    Recall(Option<SampleKey>),
}

/// A vehicle's outbox on a thread of its own; it ends, and writes what it has, when it is dropped.
#[derive(Debug)]
pub struct OutboxDriver {
    wanted: Option<SyncSender<OutboxJob>>,
    health: Arc<Mutex<OutboxHealth>>,
    thread: Option<JoinHandle<()>>,
}

impl OutboxDriver {
    /// Starts the thread, which opens the file; `tell` is given what the vehicle's actors are to be told.
    ///
    /// # Errors
    /// No thread can be started. (A file that cannot be opened is a trouble, and no error.)
    pub fn start(
        settings: OutboxSettings,
        tell: impl FnMut(Event) + Send + 'static,
    ) -> std::io::Result<OutboxDriver> {
        let (sender, receiver) = sync_channel(QUEUE);
        let health = Arc::new(Mutex::new(OutboxHealth::default()));
        let writer = Writer {
            settings,
            file: None,
            memory: BTreeMap::new(),
            retry_at: Instant::now(),
            health: health.clone(),
            tell: Box::new(tell),
        };
        let thread = std::thread::Builder::new()
            .name("outbox".to_owned())
            .spawn(move || writer.run(&receiver))?;
        Ok(OutboxDriver {
            wanted: Some(sender),
            health,
            thread: Some(thread),
        })
    }

    /// Keeps a sample of the present boot; it is told as `SampleStored`.
    pub fn keep(&self, run: RunId, sample: Sample) {
        self.want(OutboxJob::Keep(run, sample));
    }

    /// Forgets what the ground has of a closed run.
    pub fn forget(&self, boot: Boot, run: RunId, below: u64) {
        self.want(OutboxJob::Forget(boot, run, below));
    }

    /// Tells what is kept after a place, or the first of it, as one `Recalled`.
    pub fn recall(&self, after: Option<SampleKey>) {
        self.want(OutboxJob::Recall(after));
    }

    /// Returns how it fares.
    pub fn health(&self) -> OutboxHealth {
        let mut health = lock(&self.health).clone();
        health.trouble = lost_thread(self.thread.as_ref()).or(health.trouble);
        health
    }

    fn want(&self, wanted: OutboxJob) {
        let Some(sender) = &self.wanted else { return };
        match sender.try_send(wanted) {
            Ok(()) => {}
            // The actors ask again for what was not answered; only a sample is gone.
            Err(TrySendError::Full(wanted) | TrySendError::Disconnected(wanted)) => {
                lock(&self.health).overrun += u64::from(matches!(wanted, OutboxJob::Keep(..)));
            }
        }
    }
}

impl Drop for OutboxDriver {
    fn drop(&mut self) {
        self.wanted = None;
        // A thread that panicked has written what it could; there is nobody left to tell.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn lock(health: &Mutex<OutboxHealth>) -> MutexGuard<'_, OutboxHealth> {
    health.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The thread's side.
struct Writer {
    settings: OutboxSettings,
    file: Option<OutboxFile>,
    /// What is not on disk yet.
    memory: BTreeMap<SampleKey, Sample>,
    retry_at: Instant,
    health: Arc<Mutex<OutboxHealth>>,
    tell: Box<dyn FnMut(Event) + Send>,
}

impl Writer {
    fn run(mut self, wanted: &Receiver<OutboxJob>) {
        self.open();
        loop {
            let mut group = Vec::new();
            let (other, is_over) = collect(wanted, &mut group);
            self.keep(group);
            match other {
                Some(OutboxJob::Keep(run, sample)) => self.keep(vec![(run, sample)]),
                Some(OutboxJob::Forget(boot, run, below)) => self.forget(boot, run, below),
                Some(OutboxJob::Recall(after)) => self.recall(after),
                None => {}
            }
            if is_over {
                self.retry_at = Instant::now();
                self.write();
                return;
            }
        }
    }

    fn open(&mut self) {
        let OutboxSettings {
            path,
            vehicle,
            boot: _,
            most_bytes,
        } = &self.settings;
        match OutboxFile::open(path, *vehicle, *most_bytes) {
            Ok(opened) => {
                self.file = Some(opened.file);
                let mut health = lock(&self.health);
                health.trouble = None;
                health.moved_aside = opened.moved_aside.or(health.moved_aside.take());
            }
            Err(error) => self.trouble(&error),
        }
    }

    /// Puts samples into memory, writes what is there, and tells of the new ones, written or not.
    fn keep(&mut self, group: Vec<(RunId, Sample)>) {
        let boot = self.settings.boot;
        for (run, sample) in &group {
            self.memory.insert(
                SampleKey {
                    boot,
                    run: *run,
                    sequence: sample.sequence,
                },
                *sample,
            );
        }
        self.write();
        for (run, sample) in group {
            (self.tell)(Event::SampleStored(boot, run, sample));
        }
        self.bound();
        lock(&self.health).not_durable = self.memory.len() as u64;
    }

    fn write(&mut self) {
        if self.memory.is_empty() || Instant::now() < self.retry_at {
            return;
        }
        if self.file.is_none() {
            self.open();
        }
        let Some(file) = &mut self.file else { return };
        let samples: Vec<(Boot, RunId, Sample)> = self
            .memory
            .iter()
            .map(|(place, sample)| (place.boot, place.run, *sample))
            .collect();
        match file.append(&samples) {
            Ok(dropped) => {
                self.memory.clear();
                self.worked();
                dropped
                    .into_iter()
                    .for_each(|dropped| (self.tell)(Event::Dropped(dropped)));
            }
            Err(error) => self.failed(&error),
        }
    }

    /// Notes that the file could be used; samples that still wait in memory are another matter.
    fn worked(&mut self) {
        if self.memory.is_empty() {
            lock(&self.health).trouble = None;
        }
    }

    /// Notes that the file could not be used; one that went bad under way is opened, and moved aside, anew.
    fn failed(&mut self, error: &StoreError) {
        if matches!(
            error,
            StoreError::Damaged { .. } | StoreError::NoStore { .. }
        ) {
            self.file = None;
        }
        self.trouble(error);
    }

    fn trouble(&mut self, error: &StoreError) {
        self.retry_at = Instant::now() + RETRY;
        lock(&self.health).trouble = Some(format!("samples are not on disk: {error}"));
    }

    /// Drops the oldest samples that have no room in memory.
    fn bound(&mut self) {
        while self.memory.len() > MEMORY_MOST {
            let Some((first, _)) = self.memory.pop_first() else {
                return;
            };
            (self.tell)(Event::Dropped(DroppedSamples {
                first,
                below: first.sequence.saturating_add(1),
            }));
        }
    }

    fn forget(&mut self, boot: Boot, run: RunId, below: u64) {
        self.memory
            .retain(|place, _| (place.boot, place.run) != (boot, run) || place.sequence >= below);
        let Some(file) = &mut self.file else { return };
        match file.forget(boot, run, below) {
            Ok(_) => self.worked(),
            Err(error) => self.failed(&error),
        }
    }

    /// Tells what is kept after a place, on disk and in memory; when the disk cannot be read there is no answer, and it
    /// is asked again: what is in memory is not all.
    fn recall(&mut self, after: Option<SampleKey>) {
        if self.file.is_none() && Instant::now() >= self.retry_at {
            self.open();
        }
        let Some(file) = &self.file else { return };
        let on_disk = match file.after(after, CHUNK) {
            Ok(samples) => samples,
            Err(error) => return self.failed(&error),
        };
        self.worked();
        let mut all: BTreeMap<SampleKey, Sample> = on_disk
            .into_iter()
            .map(|(boot, run, sample)| {
                (
                    SampleKey {
                        boot,
                        run,
                        sequence: sample.sequence,
                    },
                    sample,
                )
            })
            .collect();
        let is_end = all.len() < CHUNK;
        let in_memory = self
            .memory
            .iter()
            .filter(|(place, _)| after.is_none_or(|after| **place > after));
        all.extend(in_memory.map(|(place, sample)| (*place, *sample)));
        let is_end = is_end && all.len() <= CHUNK;
        let chunk = all.into_iter().take(CHUNK);
        let samples = chunk
            .map(|(place, sample)| (place.boot, place.run, sample))
            .collect();
        (self.tell)(Event::Recalled(Recalled {
            after,
            samples,
            is_end,
        }));
    }
}

/// Waits for a group of samples; returns what else was wanted, and whether nobody wants anything any more.
fn collect(
    wanted: &Receiver<OutboxJob>,
    group: &mut Vec<(RunId, Sample)>,
) -> (Option<OutboxJob>, bool) {
    let mut until = None;
    while group.len() < GROUP_MOST {
        let wait = until.map_or(RETRY, |until: Instant| {
            until.saturating_duration_since(Instant::now())
        });
        match wanted.recv_timeout(wait) {
            Ok(OutboxJob::Keep(run, sample)) => group.push((run, sample)),
            Ok(other) => return (Some(other), false),
            Err(RecvTimeoutError::Timeout) => break,
            Err(RecvTimeoutError::Disconnected) => return (None, true),
        }
        until.get_or_insert_with(|| Instant::now() + GROUP);
    }
    (None, false)
}

#[cfg(test)]
mod tests {
    use super::super::file::tests::sample;
    use super::*;
    use std::path::Path;
    use std::sync::mpsc::channel;

    fn start(path: &Path) -> (OutboxDriver, Receiver<Event>) {
        let settings = OutboxSettings {
            path: path.to_owned(),
            vehicle: VehicleId(3),
            boot: Boot(5),
            most_bytes: 1 << 30,
        };
        let (sender, receiver) = channel();
        let driver = OutboxDriver::start(settings, move |event| drop(sender.send(event))).unwrap();
        (driver, receiver)
    }

    fn next(events: &Receiver<Event>) -> Event {
        events.recv_timeout(Duration::from_secs(20)).unwrap()
    }

    /// Returns the sequences of the next so many samples kept.
    fn kept(events: &Receiver<Event>, count: usize) -> Vec<u64> {
        let sequence = |event| match event {
            Event::SampleStored(Boot(5), RunId(1), sample) => sample.sequence,
            other => panic!("{other:?}"),
        };
        (0..count).map(|_| sequence(next(events))).collect()
    }

    fn recalled(
        driver: &OutboxDriver,
        events: &Receiver<Event>,
        after: Option<SampleKey>,
    ) -> (Vec<u64>, bool) {
        driver.recall(after);
        match next(events) {
            Event::Recalled(chunk) => (
                chunk
                    .samples
                    .iter()
                    .map(|(_, _, sample)| sample.sequence)
                    .collect(),
                chunk.is_end,
            ),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn what_is_kept_is_told_and_outlives_the_driver() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("outbox.db");
        let (driver, events) = start(&path);
        (0..3000).for_each(|sequence| driver.keep(RunId(1), sample(sequence)));
        assert_eq!(kept(&events, 3000), (0..3000).collect::<Vec<_>>());
        drop(driver);
        let (driver, events) = start(&path);
        let (first, is_end) = recalled(&driver, &events, None);
        assert_eq!((first.len(), is_end), (CHUNK, false));
        let place = SampleKey {
            boot: Boot(5),
            run: RunId(1),
            sequence: *first.last().unwrap(),
        };
        let (rest, is_end) = recalled(&driver, &events, Some(place));
        assert_eq!(
            ([first, rest].concat(), is_end),
            ((0..3000).collect(), true)
        );
        driver.forget(Boot(5), RunId(1), 2990);
        assert_eq!(
            recalled(&driver, &events, None),
            ((2990..3000).collect(), true)
        );
    }

    #[test]
    fn without_a_disk_samples_are_told_all_the_same_and_written_once_there_is_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("later/outbox.db");
        let (driver, events) = start(&path);
        (0..100).for_each(|sequence| driver.keep(RunId(1), sample(sequence)));
        assert_eq!(kept(&events, 100).len(), 100);
        // What is told is counted a moment later.
        let patience = Instant::now() + Duration::from_secs(10);
        while driver.health().not_durable < 100 && Instant::now() < patience {
            std::thread::sleep(Duration::from_millis(1));
        }
        let health = driver.health();
        assert_eq!(health.not_durable, 100);
        driver.recall(None);
        driver.keep(RunId(1), sample(100));
        assert_eq!(
            kept(&events, 1),
            [100],
            "no answer: what memory has is perhaps not all"
        );
        assert!(health.trouble.unwrap().contains("not on disk"));
        std::fs::create_dir(folder.path().join("later")).unwrap();
        drop(driver);
        let (driver, events) = start(&path);
        assert_eq!(recalled(&driver, &events, None), ((0..101).collect(), true));
        assert_eq!(driver.health(), OutboxHealth::default());
    }

    #[test]
    fn memory_is_bounded_while_the_disk_is_in_trouble_and_the_loss_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let (driver, events) = start(&folder.path().join("no/outbox.db"));
        let (mut confirmed, mut dropped) = (0, 0);
        let all = MEMORY_MOST as u64 + 500;
        for sequence in 0..all {
            driver.keep(RunId(1), sample(sequence));
            if sequence % 1000 == 999 {
                while confirmed < sequence + 1 {
                    match next(&events) {
                        Event::SampleStored(..) => confirmed += 1,
                        Event::Dropped(range) => dropped += range.below - range.first.sequence,
                        other => panic!("{other:?}"),
                    }
                }
            }
        }
        drop(driver);
        dropped += events
            .iter()
            .map(|event| match event {
                Event::Dropped(range) => range.below - range.first.sequence,
                _ => 0,
            })
            .sum::<u64>();
        assert_eq!(dropped, 500);
    }
}
