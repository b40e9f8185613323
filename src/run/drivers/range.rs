//! The range sensors of a live vehicle, behind the drivers that its file chooses: the one that looks where it was steered
//! last is asked. It counts pings that nothing answers, whatever the driver, and never makes an echo of silence.
//!
//! A driver that reads a device in its own way is a file in this folder, a variant of `Reader` and an arm of each match
//! here; a sensor on a serial line needs no more than its decoder in `hw`.

#[cfg(feature = "hw")]
mod hcsr04;
mod on_autopilot;
#[cfg(feature = "hw")]
mod serial;
#[cfg(all(test, feature = "hw"))]
mod tests;

use std::collections::BTreeMap;
use std::io;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use tomoswarm_proto::RangeHealth;

#[cfg(feature = "hw")]
use self::hcsr04::HcSr04Reader;
#[cfg(feature = "hw")]
pub use self::hcsr04::record_edges;
pub use self::on_autopilot::AutopilotReadings;
use self::on_autopilot::SharedTally;
pub(super) use self::on_autopilot::range_settings;
#[cfg(feature = "hw")]
use self::serial::SerialReader;
use super::EventSink;
use crate::config::{Drivers, RangeDriver, SensorCoverage};
use crate::geom::Angle;
use crate::hw::Pings;
#[cfg(feature = "hw")]
use crate::hw::echo_edges::EchoFaults;
use crate::node::sensor::Ping;
use crate::plan::Mounts;
use crate::run::clock::Clock;
use crate::run::mailbox::lock;
use crate::time::Time;

/// The range sensors of a vehicle.
pub struct Range {
    clock: Clock,
    mounts: Mounts,
    /// Of each mount; a single one is at all of them.
    sensors: Vec<Sensor>,
    /// The mount whose sensor looks where it was steered last.
    aimed: AtomicUsize,
    on_autopilot: Option<AutopilotReadings>,
}

/// One range sensor.
struct Sensor {
    pings: SharedPings,
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
    /// A sensor that hangs on the autopilot.
    Autopilot(SharedTally),
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
    /// Starts what measures; `events` gets echoes.
    ///
    /// # Errors
    /// No thread can be started, or the driver is not built in.
    pub fn start(
        drivers: &Drivers,
        look: &SensorCoverage,
        clock: Clock,
        events: &EventSink,
    ) -> io::Result<Range> {
        let mounts = look.mounts();
        let count = match drivers.range {
            // One world measures whatever sensor is asked.
            RangeDriver::Simulated | RangeDriver::None => 1,
            RangeDriver::Serial(_) | RangeDriver::HcSr04(_) | RangeDriver::Autopilot(_) => {
                mounts.all().len()
            }
        };
        let sensors: Vec<Sensor> = (0..count)
            .map(|sensor| Sensor::start(drivers.range_of(sensor), look, clock, events))
            .collect::<io::Result<_>>()?;
        Ok(Range {
            clock,
            mounts,
            on_autopilot: on_autopilot(&sensors, events),
            sensors,
            aimed: AtomicUsize::new(0),
        })
    }

    /// Returns the pings that the simulated world answers, if it does.
    pub fn simulated_pings(&self) -> Option<SharedPings> {
        let simulated = self.sensors.iter().find(|sensor| sensor.is_simulated());
        simulated.map(|sensor| sensor.pings.clone())
    }

    /// Returns how many there are; one that the simulated world measures with, or none, is one.
    pub fn count(&self) -> usize {
        self.sensors.len()
    }

    /// Asks a sensor, by its number, for the next echo, wherever it looks.
    pub fn aim(&self, sensor: usize) {
        self.aimed.store(sensor, Ordering::Relaxed);
    }

    /// Returns what is wrong with a sensor, by its number.
    pub fn trouble_of(&self, sensor: usize) -> Option<String> {
        self.sensors.get(sensor)?.trouble(self.clock.now())
    }

    /// Returns who takes the readings of sensors that hang on the autopilot, if any do.
    pub fn on_autopilot(&self) -> Option<&AutopilotReadings> {
        self.on_autopilot.as_ref()
    }

    /// Returns whether the simulated world measures.
    pub fn is_simulated(&self) -> bool {
        self.sensors.iter().any(Sensor::is_simulated)
    }

    /// Notes where a sensor is to look, against the heading: the one that looks there is asked for the next echo.
    pub fn steer(&self, beam: Angle) {
        if let Some(aim) = self.mounts.aim(beam) {
            self.aimed.store(aim.sensor, Ordering::Relaxed);
        }
    }

    /// Notes that an echo is asked for.
    pub fn ping(&self, ping: Ping) {
        let last = self.sensors.len().saturating_sub(1);
        let aimed = self.aimed.load(Ordering::Relaxed).min(last);
        if let Some(sensor) = self.sensors.get(aimed) {
            sensor.ping(self.clock.now(), ping);
        }
    }

    /// Returns what is wrong with them, in words.
    pub fn troubles(&self) -> impl Iterator<Item = (usize, String)> {
        let (now, are_several) = (self.clock.now(), self.sensors.len() > 1);
        let all = self.sensors.iter().zip(self.mounts.all()).enumerate();
        all.filter_map(move |(nth, (sensor, mount))| {
            let trouble = sensor.trouble(now)?;
            let told = match are_several {
                false => trouble,
                true => format!("at {:.0}°: {trouble}", mount.zero.degrees()),
            };
            Some((nth, told))
        })
    }

    /// Returns what they have done together; `None` when there is none.
    pub fn health(&self) -> Option<RangeHealth> {
        let all = self.sensors.iter().filter_map(Sensor::health);
        all.reduce(|one, other| RangeHealth {
            glitches: one.glitches + other.glitches,
            faults: one.faults + other.faults,
        })
    }
}

/// Returns who takes the readings of those sensors that hang on the autopilot, if any do.
fn on_autopilot(sensors: &[Sensor], events: &EventSink) -> Option<AutopilotReadings> {
    let those: BTreeMap<usize, (SharedPings, SharedTally)> = sensors
        .iter()
        .enumerate()
        .filter_map(|(index, sensor)| match &sensor.reader {
            Reader::Autopilot(tally) => Some((index, (sensor.pings.clone(), tally.clone()))),
            _ => None,
        })
        .collect();
    (!those.is_empty()).then(|| AutopilotReadings::new(those, events.clone()))
}

impl Sensor {
    fn start(
        driver: &RangeDriver,
        look: &SensorCoverage,
        clock: Clock,
        events: &EventSink,
    ) -> io::Result<Sensor> {
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
                let _ = (look, clock, events);
                return Err(io::ErrorKind::Unsupported.into());
            }
            RangeDriver::Autopilot(_) => Reader::Autopilot(SharedTally::default()),
            RangeDriver::None => Reader::None,
        };
        Ok(Sensor { pings, reader })
    }

    fn is_simulated(&self) -> bool {
        matches!(self.reader, Reader::World)
    }

    /// Notes that an echo is asked for. A sensor that measures all the time needs not be told.
    fn ping(&self, now: Time, ping: Ping) {
        if !matches!(self.reader, Reader::None) {
            lock(&self.pings.0).ping(now, ping);
        }
        match &self.reader {
            Reader::World | Reader::Autopilot(_) | Reader::None => {}
            #[cfg(feature = "hw")]
            Reader::Serial(_) => {}
            #[cfg(feature = "hw")]
            Reader::HcSr04(reader) => reader.ping(now),
        }
    }

    fn trouble(&self, now: Time) -> Option<String> {
        let silent = || match self.dropped_in_words() {
            None => "it answers nothing".to_owned(),
            Some(dropped) => format!("it answers nothing; {dropped}"),
        };
        let is_silent = lock(&self.pings.0).is_silent(now);
        self.closed().or_else(|| is_silent.then(silent))
    }

    /// Returns why it is closed, if it is.
    fn closed(&self) -> Option<String> {
        match &self.reader {
            // That a link is down is a trouble of the world or of the autopilot.
            Reader::World | Reader::Autopilot(_) | Reader::None => None,
            #[cfg(feature = "hw")]
            Reader::Serial(reader) => reader.trouble(),
            #[cfg(feature = "hw")]
            Reader::HcSr04(reader) => reader.trouble(),
        }
    }

    /// Returns what became of what it said and was no answer.
    fn dropped_in_words(&self) -> Option<String> {
        match &self.reader {
            Reader::World | Reader::None => None,
            #[cfg(feature = "hw")]
            Reader::Serial(reader) => {
                let dropped = reader.dropped();
                (dropped.total() > 0).then(|| format!("of what it said {dropped}"))
            }
            #[cfg(feature = "hw")]
            Reader::HcSr04(reader) => {
                let faults = reader.faults();
                (faults != EchoFaults::default()).then(|| faults.to_string())
            }
            Reader::Autopilot(tally) => Some(tally.get().to_string()),
        }
    }

    fn health(&self) -> Option<RangeHealth> {
        let faults = lock(&self.pings.0).faults();
        let glitches = match &self.reader {
            Reader::None => return None,
            // What the world answers wrongly cannot be told from what it answers rightly.
            Reader::World => 0,
            #[cfg(feature = "hw")]
            Reader::Serial(reader) => reader.dropped().total(),
            #[cfg(feature = "hw")]
            Reader::HcSr04(reader) => reader.faults().glitches,
            Reader::Autopilot(tally) => tally.get().dropped,
        };
        Some(RangeHealth { glitches, faults })
    }
}
