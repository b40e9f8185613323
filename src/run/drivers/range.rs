//! The range sensor of a live vehicle, behind the driver that its file chooses. It counts pings that nothing answers,
//! whatever the driver, and never makes an echo of silence.
//!
//! A driver that reads a device in its own way is a file in this folder, a variant of `Reader` and an arm of each match
//! here; a sensor on a serial line needs no more than its decoder in `hw`.

#[cfg(feature = "hw")]
mod hcsr04;
#[cfg(feature = "hw")]
mod serial;
#[cfg(all(test, feature = "hw"))]
mod tests;

use std::io;
use std::sync::{Arc, Mutex};

use tomoswarm_proto::RangeHealth;

#[cfg(feature = "hw")]
use self::hcsr04::HcSr04Reader;
#[cfg(feature = "hw")]
use self::serial::SerialReader;
use super::EventSink;
use crate::config::{RangeDriver, SensorCoverage};
use crate::hw::Pings;
#[cfg(feature = "hw")]
use crate::hw::echo_edges::EchoFaults;
use crate::node::sensor::Ping;
use crate::run::clock::Clock;
use crate::run::mailbox::lock;

/// A range sensor.
pub struct Range {
    pings: SharedPings,
    clock: Clock,
    reader: Reader,
}

/// What measures.
enum Reader {
    /// The simulated world, which is told by its link.
    World,
    /// A sensor on a serial line.
    #[cfg(feature = "hw")]
    Serial(SerialReader),
    /// A sensor with trigger and echo lines.
    #[cfg(feature = "hw")]
    HcSr04(HcSr04Reader),
    /// Nothing does.
    None,
}

/// The pings of a range sensor, shared with who answers them.
#[derive(Clone, Default)]
pub struct SharedPings(Arc<Mutex<Pings>>);

impl SharedPings {
    /// Notes an answer of a sensor that says which ping it answers.
    pub fn answered(&self, number: u64) {
        lock(&self.0).answered(number);
    }
}

impl Range {
    /// Starts what measures; `told` gets echoes.
    ///
    /// # Errors
    /// No thread can be started, or the driver is not built in.
    pub fn start(
        driver: &RangeDriver,
        look: &SensorCoverage,
        clock: Clock,
        events: &EventSink,
    ) -> io::Result<Range> {
        let pings = SharedPings::default();
        let reader = match driver {
            RangeDriver::Simulated => Reader::World,
            #[cfg(feature = "hw")]
            RangeDriver::Serial(sensor) => Reader::Serial(SerialReader::start(
                sensor,
                look,
                clock,
                pings.clone(),
                events.clone(),
            )?),
            #[cfg(feature = "hw")]
            RangeDriver::HcSr04(lines) => Reader::HcSr04(HcSr04Reader::start(
                lines,
                clock,
                pings.clone(),
                events.clone(),
            )?),
            #[cfg(not(feature = "hw"))]
            RangeDriver::Serial(_) | RangeDriver::HcSr04(_) => {
                // Its name was refused when the file was read.
                let _ = (look, events);
                return Err(io::ErrorKind::Unsupported.into());
            }
            RangeDriver::None => Reader::None,
        };
        Ok(Range {
            pings,
            clock,
            reader,
        })
    }

    /// Returns its pings, for who answers them.
    pub fn pings(&self) -> SharedPings {
        self.pings.clone()
    }

    /// Returns whether the simulated world measures.
    pub fn is_simulated(&self) -> bool {
        matches!(self.reader, Reader::World)
    }

    /// Notes that an echo is asked for. A sensor that measures all the time needs not be told.
    pub fn ping(&self, ping: Ping) {
        let now = self.clock.now();
        if !matches!(self.reader, Reader::None) {
            lock(&self.pings.0).ping(now, ping);
        }
        match &self.reader {
            Reader::World | Reader::None => {}
            #[cfg(feature = "hw")]
            Reader::Serial(_) => {}
            #[cfg(feature = "hw")]
            Reader::HcSr04(reader) => reader.ping(now),
        }
    }

    /// Returns what is wrong with it, in words.
    pub fn trouble(&self) -> Option<String> {
        let (dropped, is_closed): (Option<String>, Option<String>) = match &self.reader {
            Reader::None => return None,
            Reader::World => (None, None),
            #[cfg(feature = "hw")]
            Reader::Serial(reader) => {
                let dropped = reader.dropped();
                let some = dropped.total() > 0;
                let said = some.then(|| format!("of what it said {dropped}"));
                (said, reader.trouble())
            }
            #[cfg(feature = "hw")]
            Reader::HcSr04(reader) => {
                let faults = reader.faults();
                let some = faults != EchoFaults::default();
                (some.then(|| faults.to_string()), reader.trouble())
            }
        };
        let is_silent = lock(&self.pings.0).is_silent(self.clock.now());
        let silent = || match dropped {
            None => "it answers nothing".to_owned(),
            Some(dropped) => format!("it answers nothing; {dropped}"),
        };
        is_closed.or_else(|| is_silent.then(silent))
    }

    /// Returns what it has done; `None` when there is none.
    pub fn health(&self) -> Option<RangeHealth> {
        let faults = lock(&self.pings.0).faults();
        match &self.reader {
            Reader::None => None,
            // What the world answers wrongly cannot be told from what it answers rightly.
            Reader::World => Some(RangeHealth {
                glitches: 0,
                faults,
            }),
            #[cfg(feature = "hw")]
            Reader::Serial(reader) => Some(RangeHealth {
                glitches: reader.dropped().total(),
                faults,
            }),
            #[cfg(feature = "hw")]
            Reader::HcSr04(reader) => Some(RangeHealth {
                glitches: reader.faults().glitches,
                faults,
            }),
        }
    }
}
