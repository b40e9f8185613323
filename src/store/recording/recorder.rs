//! The recording of a live node: a thread that writes, fed by the threads of the actors, which it never holds up.
//!
//! ```text
//!   actor's thread: scribe.prepare ─► act_watched ─step─► scribe.step ─► bounded queue ─► thread ─► Flight ─► files
//! ```
//!
//! What does not fit into the queue is lost, and the segment with it: it is marked with a gap and ended, and every
//! actor hands in a snapshot for the next one before its next step. When nothing can be written the node goes on
//! without a recording, and the thread tries again after 10 s.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::flight::{About, Deed, Flight, Limits};
use super::segment::WriteError;
use crate::actor::Snapshot;
use crate::time::Time;

/// Steps and snapshots that may wait to be written.
const QUEUE: usize = 4096;
/// All is written out this often.
const FLUSH_EVERY: Duration = Duration::from_millis(500);
/// The thread looks up this often, when nothing comes.
const LOOK_EVERY: Duration = Duration::from_millis(100);
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
}

impl Shared {
    fn set_trouble(&self, trouble: Option<String>) {
        *self.trouble.lock().unwrap_or_else(PoisonError::into_inner) = trouble;
    }
}

/// What is handed to the writing thread, with the number of its segment.
enum Sent {
    Snapshot(u64, Time, Snapshot),
    Step(u64, Box<Deed>),
}

/// A recorder at work; dropped, it ends its files in order.
#[derive(Debug)]
pub struct Recorder {
    shared: Arc<Shared>,
    sender: SyncSender<Sent>,
    thread: Option<JoinHandle<()>>,
}

impl Recorder {
    /// Begins to record into a folder. A folder that cannot be written is a [`Recorder::trouble`] and no error.
    pub fn start(folder: PathBuf, about: About, limits: Limits) -> Recorder {
        Recorder::with_queue(folder, about, limits, QUEUE)
    }

    fn with_queue(folder: PathBuf, about: About, limits: Limits, queue: usize) -> Recorder {
        let shared = Arc::new(Shared::default());
        let (sender, receiver) = sync_channel(queue);
        let mut writing =
            Writing { folder, about, limits, flight: None, now: Time::ZERO, shared: shared.clone() };
        // The first segment is open before the first actor acts.
        let retry_at = writing.begin();
        let spawned = std::thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || writing.run(&receiver, retry_at));
        let thread = match spawned {
            Ok(thread) => Some(thread),
            Err(error) => {
                shared.segment.store(NONE, Ordering::Release);
                shared.set_trouble(Some(error.to_string()));
                None
            }
        };
        Recorder { shared, sender, thread }
    }

    /// Gives a scribe for one actor.
    pub fn scribe(&self) -> Scribe {
        Scribe { shared: self.shared.clone(), sender: self.sender.clone(), segment: NONE, broken: NONE }
    }

    /// Says why nothing is recorded at present, if so.
    pub fn trouble(&self) -> Option<String> {
        self.shared.trouble.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.shared.is_ended.store(true, Ordering::Release);
        // A thread that has panicked has nothing left to write.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// Writes down what one actor does. It never waits.
#[derive(Debug)]
pub struct Scribe {
    shared: Arc<Shared>,
    sender: SyncSender<Sent>,
    /// The segment that has this actor's snapshot.
    segment: u64,
    /// The segment that lost something of this actor.
    broken: u64,
}

impl Scribe {
    /// Hands in the actor's snapshot when a segment has begun since the last time. To be called before every
    /// [`crate::actor::Seat::act_watched`]; tells whether its steps are to be watched.
    pub fn prepare<A: Serialize>(&mut self, now: Time, name: &'static str, actor: &A) -> bool {
        let newest = self.shared.segment.load(Ordering::Acquire);
        if newest == NONE || newest == self.broken {
            return false;
        }
        if newest != self.segment {
            // What cannot be packed is a mistake of ours; the steps would be of no use without.
            let Ok(snapshot) = Snapshot::of(name, actor) else { return false };
            self.segment = newest;
            self.send(Sent::Snapshot(newest, now, snapshot));
        }
        self.segment != self.broken
    }

    /// Hands in what the actor did.
    pub fn step(&mut self, deed: Deed) {
        if self.segment != self.broken {
            self.send(Sent::Step(self.segment, Box::new(deed)));
        }
    }

    /// Forgets the snapshot: the actor has been made anew.
    pub fn restarted(&mut self) {
        self.segment = NONE;
    }

    fn send(&mut self, sent: Sent) {
        if self.sender.try_send(sent).is_err() {
            self.broken = self.segment;
            self.shared.is_overrun.store(true, Ordering::Release);
        }
    }
}

/// The writing thread.
struct Writing {
    folder: PathBuf,
    about: About,
    limits: Limits,
    flight: Option<Flight>,
    /// The latest moment that was handed in.
    now: Time,
    shared: Arc<Shared>,
}

impl Writing {
    fn run(mut self, receiver: &Receiver<Sent>, mut retry_at: Option<Instant>) {
        let mut flush_at = Instant::now() + FLUSH_EVERY;
        loop {
            let is_ended = self.shared.is_ended.load(Ordering::Acquire);
            let wait = if is_ended { Duration::ZERO } else { LOOK_EVERY };
            let written = match receiver.recv_timeout(wait) {
                Ok(sent) => self.write(&sent),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) if is_ended => break,
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => Ok(()),
            };
            let now = Instant::now();
            let kept = written.and_then(|()| if now >= flush_at { self.flush() } else { Ok(()) });
            if now >= flush_at {
                flush_at = now + FLUSH_EVERY;
            }
            if let Err(error) = kept {
                retry_at = self.give_up(&error);
            }
            if self.flight.is_none() && retry_at.is_none_or(|at| now >= at) {
                retry_at = self.begin();
            }
        }
        if let Some(Err(error)) = self.flight.take().map(Flight::end) {
            self.shared.set_trouble(Some(error.to_string()));
        }
    }

    /// Opens the first segment; gives when to try again when that fails.
    fn begin(&mut self) -> Option<Instant> {
        let mut flight = Flight::new(&self.folder, self.about.clone(), self.limits);
        match flight.begin(self.now, None) {
            Ok(number) => {
                self.flight = Some(flight);
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
            Sent::Step(_, deed) => match &**deed {
                Deed::Vehicle(acted) => acted.now(),
                Deed::Ground(acted) => acted.now(),
            },
        };
        self.now = self.now.max(now);
        let Some(flight) = &mut self.flight else { return Ok(()) };
        match sent {
            Sent::Snapshot(number, now, snapshot) => flight.snapshot(*number, *now, snapshot),
            Sent::Step(number, deed) => flight.step(*number, deed),
        }
    }

    fn flush(&mut self) -> Result<(), WriteError> {
        let Some(flight) = &mut self.flight else { return Ok(()) };
        let is_full = flight.flush(self.now)?;
        let is_overrun = self.shared.is_overrun.swap(false, Ordering::AcqRel);
        if is_full || is_overrun {
            let gap = is_overrun.then_some("more came than could be written");
            let number = flight.begin(self.now, gap)?;
            self.shared.segment.store(number, Ordering::Release);
        }
        Ok(())
    }
}
