//! Reads a range sensor on a serial line, on a thread of its own: opens the port for itself alone and hands its bytes to the
//! decoder. What bytes mean, and which ping a reading answers, is not known here.
//!
//! A byte in the port's queue may be old. So the thread remembers when the queue was empty last: what is read came later
//! than that, and no reading is taken for younger than it is.

use std::io;
use std::time::Duration;

use super::{EventSink, SharedPings};
use crate::config::{SensorCoverage, SerialSensor};
use crate::hw::{DroppedReadings, RangeDecoder};
use crate::node::Event;
use crate::run::clock::Clock;
use crate::run::drivers::device_thread::{DeviceThread, Gone, Shared};
use crate::run::drivers::serial_port::{LineFormat, in_words, open};
use crate::run::mailbox::lock;
use crate::time::Time;

/// The queue is looked at this often at least.
const LOOKS_EVERY: Duration = Duration::from_millis(5);

/// A sensor on a serial line and the thread that reads it; dropping it ends the thread.
pub(super) struct SerialReader(DeviceThread<DroppedReadings>);

/// What the thread has.
struct Work {
    sensor: SerialSensor,
    decoder: RangeDecoder,
    clock: Clock,
    pings: SharedPings,
    events: EventSink,
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
        let decoder = RangeDecoder::new(&sensor.protocol, look);
        let mut work = Work {
            sensor: sensor.clone(),
            decoder,
            clock,
            pings,
            events,
        };
        let (port, dropped) = (sensor.port.clone(), DroppedReadings::default());
        let session = move |shared: &Shared<DroppedReadings>| work.session(shared);
        DeviceThread::start("range sensor", port, dropped, session).map(SerialReader)
    }

    /// Returns why the port is closed; `None` while it is open.
    pub(super) fn trouble(&self) -> Option<String> {
        self.0.trouble()
    }

    /// Returns what was dropped of what the sensor said.
    pub(super) fn dropped(&self) -> DroppedReadings {
        self.0.with(|dropped| *dropped)
    }
}

impl Work {
    /// Opens the port and reads until the end, or until it is gone.
    fn session(&mut self, shared: &Shared<DroppedReadings>) -> Result<(), Gone> {
        let mut has_worked = false;
        self.read(shared, &mut has_worked).map_err(|error| Gone {
            why: in_words(&error),
            has_worked,
        })
    }

    fn read(&mut self, shared: &Shared<DroppedReadings>, has_read: &mut bool) -> io::Result<()> {
        let mut queue_empty_at = self.clock.now();
        let baud = u32::try_from(self.sensor.baud).unwrap_or(u32::MAX);
        let port = open(&self.sensor.port, LineFormat::of_device(baud), LOOKS_EVERY)?;
        shared.opened();
        self.decoder.restart();
        let mut bytes = [0; 512];
        while !shared.is_ended() {
            let began = self.clock.now();
            match port.read(&mut bytes) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(count) => {
                    *has_read = true;
                    self.take(shared, queue_empty_at, &bytes[..count]);
                    if count < bytes.len() {
                        queue_empty_at = began;
                    }
                }
                // All that time nothing was there.
                Err(error) if error.kind() == io::ErrorKind::TimedOut => {
                    queue_empty_at = began + LOOKS_EVERY
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    fn take(&mut self, shared: &Shared<DroppedReadings>, since: Time, bytes: &[u8]) {
        let mut readings = Vec::new();
        self.decoder.take(since, bytes, &mut readings);
        shared.with(|dropped| *dropped = self.decoder.dropped());
        let Some(newest) = readings.last() else {
            return;
        };
        let echo = lock(&self.pings.0).answer(*newest);
        if let Some(echo) = echo {
            (self.events)(Event::Echo(echo));
        }
    }
}
