//! Reads a range sensor on a serial line, on a thread of its own: opens the port for itself alone, hands its bytes to the
//! decoder, and opens it anew for ever when it is gone. What bytes mean, and which ping a reading answers, is not known here.
//!
//! ```text
//!   closed ──opened and locked──► open ──read fails, or gives nothing as a closed port does──► closed
//!     └──── not there, in use: again after 250 ms, then 500 ms, then every second
//! ```
//!
//! A byte in the port's queue may be old. So the thread remembers when the queue was empty last: what is read came later
//! than that, and no reading is taken for younger than it is.

use std::io;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use super::{EventSink, SharedPings};
use crate::config::{SensorCoverage, SerialSensor};
use crate::hw::{DroppedReadings, RangeDecoder};
use crate::node::Event;
use crate::run::clock::Clock;
use crate::run::drivers::reopening::{LATEST, SOONEST};
use crate::run::drivers::serial_port::{in_words, open};
use crate::run::mailbox::lock;
use crate::time::Time;

/// The queue is looked at this often at least.
const LOOKS_EVERY: Duration = Duration::from_millis(5);

/// A sensor on a serial line and the thread that reads it; dropping it ends the thread.
pub(super) struct SerialReader {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    state: Mutex<State>,
    ended: Condvar,
}

#[derive(Default)]
struct State {
    is_ended: bool,
    /// Why the port is closed, while it is.
    trouble: Option<String>,
    /// How often it was opened.
    opened: u64,
    dropped: DroppedReadings,
}

/// What the thread has.
struct Work {
    sensor: SerialSensor,
    decoder: RangeDecoder,
    clock: Clock,
    pings: SharedPings,
    events: EventSink,
    shared: Arc<Shared>,
}

impl SerialReader {
    /// Begins to read; `told` gets echoes on the reader's thread.
    ///
    /// # Errors
    /// No thread can be started.
    pub(super) fn start(
        sensor: &SerialSensor,
        look: &SensorCoverage,
        clock: Clock,
        pings: SharedPings,
        events: EventSink,
    ) -> io::Result<SerialReader> {
        let shared = Arc::<Shared>::default();
        lock(&shared.state).trouble = Some(format!("{}: not open yet", sensor.port));
        let decoder = RangeDecoder::new(&sensor.protocol, look);
        let mut work = Work {
            sensor: sensor.clone(),
            decoder,
            clock,
            pings,
            events,
            shared: shared.clone(),
        };
        let thread = std::thread::Builder::new()
            .name("range sensor".to_owned())
            .spawn(move || work.run())?;
        Ok(SerialReader {
            shared,
            thread: Some(thread),
        })
    }

    /// Returns why the port is closed; `None` while it is open.
    pub(super) fn trouble(&self) -> Option<String> {
        lock(&self.shared.state).trouble.clone()
    }

    /// Returns what was dropped of what the sensor said.
    pub(super) fn dropped(&self) -> DroppedReadings {
        lock(&self.shared.state).dropped
    }
}

impl Drop for SerialReader {
    fn drop(&mut self) {
        lock(&self.shared.state).is_ended = true;
        self.shared.ended.notify_all();
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has ended, too.
            let _ = thread.join();
        }
    }
}

impl Work {
    fn run(&mut self) {
        let mut wait = SOONEST;
        loop {
            let (trouble, has_read) = match self.session() {
                Ok(()) => return,
                Err((error, has_read)) => (in_words(&error), has_read),
            };
            wait = if has_read { SOONEST } else { wait };
            if self.waits(trouble, wait) {
                return;
            }
            wait = (wait * 2).min(LATEST);
        }
    }

    /// Says that the port is closed, and waits before it is opened again; returns whether the end has come.
    fn waits(&self, trouble: String, wait: Duration) -> bool {
        let mut state = lock(&self.shared.state);
        let port = &self.sensor.port;
        state.trouble = Some(match state.opened {
            0 => format!("{port}: {trouble}"),
            1 => format!("{port}: {trouble}; opened once before"),
            opened => format!("{port}: {trouble}; opened {opened} times before"),
        });
        let waited = self
            .shared
            .ended
            .wait_timeout_while(state, wait, |state| !state.is_ended);
        waited.unwrap_or_else(PoisonError::into_inner).0.is_ended
    }

    /// Opens the port and reads until the end, or until it is gone: then why, and whether anything was read.
    fn session(&mut self) -> Result<(), (io::Error, bool)> {
        let mut queue_empty_at = self.clock.now();
        let baud = u32::try_from(self.sensor.baud).unwrap_or(u32::MAX);
        let port = open(&self.sensor.port, baud, LOOKS_EVERY).map_err(|error| (error, false))?;
        let mut state = lock(&self.shared.state);
        (state.trouble, state.opened) = (None, state.opened + 1);
        drop(state);
        self.decoder.restart();
        let (mut bytes, mut has_read) = ([0; 512], false);
        while !lock(&self.shared.state).is_ended {
            let began = self.clock.now();
            match port.read(&mut bytes) {
                Ok(0) => return Err((io::ErrorKind::UnexpectedEof.into(), has_read)),
                Ok(count) => {
                    has_read = true;
                    self.take(queue_empty_at, &bytes[..count]);
                    if count < bytes.len() {
                        queue_empty_at = began;
                    }
                }
                // All that time nothing was there.
                Err(error) if error.kind() == io::ErrorKind::TimedOut => {
                    queue_empty_at = began + LOOKS_EVERY
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err((error, has_read)),
            }
        }
        Ok(())
    }

    fn take(&mut self, since: Time, bytes: &[u8]) {
        let mut readings = Vec::new();
        self.decoder.take(since, bytes, &mut readings);
        lock(&self.shared.state).dropped = self.decoder.dropped();
        let Some(newest) = readings.last() else {
            return;
        };
        let echo = lock(&self.pings.0).answer(*newest);
        if let Some(echo) = echo {
            (self.events)(Event::Echo(echo));
        }
    }
}
