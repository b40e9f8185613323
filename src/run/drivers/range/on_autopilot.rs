//! Range sensors that hang on the autopilot: what its driver hears of them answers their pings. What the messages mean is not
//! known here.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use super::{EventSink, SharedPings};
use crate::config::{RangeDriver, VehicleFile};
use crate::geom::Angle;
use crate::hw::{RangeReading, TimedReading};
use crate::mavlink::autopilot_driver::{
    AutopilotReading, AutopilotSensor, RangeSettings, RangeTally,
};
use crate::node::Event;
use crate::run::mailbox::lock;

/// What became of the messages for one sensor, shared with who hears them.
#[derive(Clone, Default)]
pub(super) struct SharedTally(Arc<Mutex<RangeTally>>);

impl SharedTally {
    /// Returns it.
    pub(super) fn get(&self) -> RangeTally {
        *lock(&self.0)
    }
}

/// Takes readings of the autopilot's driver for the range sensors that hang on it.
#[derive(Clone)]
pub struct AutopilotReadings {
    /// By the number of the sensor.
    sensors: BTreeMap<usize, (SharedPings, SharedTally)>,
    events: EventSink,
}

impl AutopilotReadings {
    /// Takes readings for sensors, by their numbers; `events` gets echoes.
    pub(super) fn new(
        sensors: BTreeMap<usize, (SharedPings, SharedTally)>,
        events: EventSink,
    ) -> AutopilotReadings {
        AutopilotReadings { sensors, events }
    }

    /// Takes a reading; it is an echo when a ping waits for it.
    pub(in crate::run::drivers) fn take(&self, reading: AutopilotReading) {
        let Some((pings, _)) = self.sensors.get(&reading.sensor) else {
            return;
        };
        let timed = TimedReading {
            measured: reading.measured,
            reading: reading
                .range_m
                .map_or(RangeReading::Nothing, RangeReading::Range),
        };
        let echo = lock(&pings.0).answer(timed);
        if let Some(echo) = echo {
            (self.events)(Event::Echo(echo));
        }
    }

    /// Notes what became of the messages for each sensor.
    pub(in crate::run::drivers) fn tell(&self, tallies: impl Iterator<Item = (usize, RangeTally)>) {
        for (sensor, tally) in tallies {
            if let Some((_, shared)) = self.sensors.get(&sensor) {
                *lock(&shared.0) = tally;
            }
        }
    }
}

/// Returns what the driver of an autopilot is told of the range sensors that hang on it; `None` when none does.
pub(in crate::run::drivers) fn range_settings(file: &VehicleFile) -> Option<RangeSettings> {
    let mut settings = RangeSettings {
        sensors: Vec::new(),
        half_angle: Angle::from_degrees(file.look.half_angle_deg),
        max_range_m: file.look.max_range_m,
        rate_hz: 0,
    };
    for (sensor, mount) in file.look.mounts().all().iter().enumerate() {
        if let RangeDriver::Autopilot(range) = file.drivers.range_of(sensor) {
            settings.rate_hz = settings.rate_hz.max(range.rate_hz(&file.look));
            settings.sensors.push(AutopilotSensor {
                sensor,
                mounted: mount.zero,
                is_turned: mount.from_rad != mount.to_rad,
                nothing_from_m: range.nothing_from_m,
                delay: range.delay(),
            });
        }
    }
    (!settings.sensors.is_empty()).then_some(settings)
}
