//! The thread that stores samples and all that the station does not wait for, and tells the station of samples and marks
//! once they are stored. Its groups are small, so that the station's memory never waits long for the store. What could not
//! be stored last is tried again, so that it is known when the store works again, whether or not anybody repeats anything.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use tomoswarm_proto::{Boot, Mark, Message, Samples, Sender, TileReport, VehicleId};

use super::archive::Archive;
use super::utc::Clocks;
use crate::ground::Event;

/// Samples are stored in groups, a group at least this often.
const GROUP: Duration = Duration::from_millis(50);
/// Batches of one group at most.
const GROUP_MOST: usize = 32;
/// Samples that are written at once, unless one batch has more: about 20 ms.
const SAMPLES_MOST: usize = 2000;
/// Marks that wait at most while the store cannot keep them.
const MARKS_WAITING_MAX: usize = 1000;
/// Marks that an operator who has just come is told at most: those of the newest runs.
const MARKS_TOLD_MAX: usize = 50;
/// They are told this often at most, however many come.
const MARKS_EVERY: Duration = Duration::from_secs(1);
/// Tiles are stored this often, and what could not be stored is tried again.
const EVERY: Duration = Duration::from_secs(2);

/// What waits for the store.
pub(super) enum StoreJob {
    Samples(Samples),
    Tile(TileReport),
    Software(VehicleId, Boot, String),
    Mark(Sender, Mark),
    /// An operator has come who does not know what is marked.
    TellMarks,
    /// Nothing more: what came before is stored, and the thread ends.
    End,
}

/// Starts the thread; `tell` reaches the station with what its vehicle has said and is stored, and with whether samples can be.
pub(super) fn keeper(
    archive: Arc<Archive>,
    wanted: Receiver<StoreJob>,
    tell: impl Fn(Event) + Send + 'static,
) -> std::io::Result<JoinHandle<()>> {
    let keep = move || {
        let began = Instant::now();
        let mut keeper = StoreThread {
            archive,
            tell,
            began,
            tried: began,
            is_well: true,
            unstored: Vec::new(),
            unstored_marks: VecDeque::new(),
            clocks: Clocks::default(),
            marks_wanted: false,
            marks_told: None,
        };
        loop {
            let first = match wanted.recv_timeout(GROUP) {
                Ok(first) => Some(first),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => break,
            };
            let group: Vec<StoreJob> = first
                .into_iter()
                .chain(wanted.try_iter().take(GROUP_MOST))
                .collect();
            let is_end = group.iter().any(|wanted| matches!(wanted, StoreJob::End));
            keeper.keep(group);
            if is_end {
                break;
            }
        }
        keeper.archive.keep(true);
    };
    std::thread::Builder::new()
        .name("store".to_owned())
        .spawn(keep)
}

struct StoreThread<T> {
    archive: Arc<Archive>,
    tell: T,
    began: Instant,
    /// When everything was tried last.
    tried: Instant,
    is_well: bool,
    /// The last group of samples, if it could not be stored; earlier ones their vehicles repeat.
    unstored: Vec<Samples>,
    /// Marks that could not be stored, in order: who has said them says them again only as long as somebody waits for them.
    unstored_marks: VecDeque<(Sender, Mark)>,
    clocks: Clocks,
    /// An operator has come and was told no marks yet.
    marks_wanted: bool,
    marks_told: Option<Instant>,
}

impl<T: Fn(Event)> StoreThread<T> {
    fn keep(&mut self, group: Vec<StoreJob>) {
        let mut batches: Vec<Samples> = Vec::new();
        for wanted in group {
            match wanted {
                StoreJob::Samples(batch) => {
                    self.set_clock(&batch);
                    let count: usize = batches.iter().map(|batch| batch.samples.len()).sum();
                    if count + batch.samples.len() > SAMPLES_MOST {
                        self.keep_samples(std::mem::take(&mut batches));
                    }
                    batches.push(batch);
                }
                StoreJob::Tile(tile) => self.archive.hold_tile(tile),
                StoreJob::Software(vehicle, boot, software) => {
                    self.clocks.hear(vehicle, boot);
                    self.archive.hold_software(vehicle, boot, software);
                }
                StoreJob::Mark(sender, mark) => self.keep_mark(sender, mark),
                StoreJob::TellMarks => self.marks_wanted = true,
                StoreJob::End => {}
            }
        }
        self.keep_samples(batches);
        self.tell_marks();
        let is_due = self.tried.elapsed() >= EVERY;
        if is_due {
            let again = std::mem::take(&mut self.unstored);
            self.keep_samples(again);
            for (sender, mark) in std::mem::take(&mut self.unstored_marks) {
                self.keep_mark(sender, mark);
            }
        }
        // A store in trouble is not asked all the time.
        if is_due || self.is_well {
            self.is_well = self.archive.keep(is_due);
        }
        if is_due {
            self.tried = Instant::now();
        }
    }

    /// Keeps a mark after those that wait, so that one that is taken back stays so.
    fn keep_mark(&mut self, sender: Sender, mark: Mark) {
        if self.unstored_marks.is_empty() && self.archive.keep_mark(mark) {
            (self.tell)(Event::Bus(sender, Message::Mark(mark)));
        } else {
            // What was said of the same place before does not count any more.
            let is_of_it = |known: &Mark| (known.run, known.at) == (mark.run, mark.at);
            self.unstored_marks.retain(|(_, known)| !is_of_it(known));
            self.unstored_marks.push_back((sender, mark));
            if self.unstored_marks.len() > MARKS_WAITING_MAX {
                self.unstored_marks.pop_front();
            }
        }
    }

    /// Has the station say again what is marked, when somebody has come who does not know it.
    fn tell_marks(&mut self) {
        let is_soon = self
            .marks_told
            .is_some_and(|told| told.elapsed() < MARKS_EVERY);
        if !self.marks_wanted || is_soon {
            return;
        }
        (self.marks_wanted, self.marks_told) = (false, Some(Instant::now()));
        for mark in self.archive.newest_marks(MARKS_TOLD_MAX) {
            (self.tell)(Event::Bus(Sender::Ground, Message::Mark(mark)));
        }
    }

    /// What cannot be stored is not acknowledged: its vehicles repeat it.
    fn keep_samples(&mut self, batches: Vec<Samples>) {
        if batches.is_empty() {
            return;
        }
        let is_stored = self.archive.keep_samples(&batches);
        (self.tell)(Event::StoresSamples(is_stored));
        if is_stored {
            self.unstored.clear();
            for batch in batches {
                let sender = Sender::Vehicle(batch.vehicle);
                (self.tell)(Event::Bus(sender, Message::Samples(batch)));
            }
        } else {
            self.unstored = batches;
        }
    }

    fn set_clock(&mut self, batch: &Samples) {
        let Ok(utc) = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH) else {
            return;
        };
        if let Some(clock) = self
            .clocks
            .take(self.began.elapsed(), utc.as_secs_f64(), batch)
        {
            self.archive.hold_clock(batch.vehicle, batch.boot, clock);
        }
    }
}
