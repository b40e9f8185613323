//! What the readings of range sensors on an autopilot mean: the table `[range.autopilot]` of a vehicle's file. Opens nothing.

use std::time::Duration;

use super::forms::seconds;
use super::keys::{Keyed, Keys, MaybeTable, Number, NumberBounds};
use super::range::SensorCoverage;
use super::range_driver::RangeDriver;
use super::source::Source;

/// Range sensors that hang on the autopilot and come over its MAVLink.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct AutopilotRange {
    /// From here on a DISTANCE_SENSOR says that it has heard nothing, metres; `None` = it never says that.
    pub nothing_from_m: Option<f64>,
    /// Time from measuring to the message, seconds.
    pub delay_s: f64,
}

impl Default for AutopilotRange {
    fn default() -> AutopilotRange {
        AutopilotRange {
            nothing_from_m: None,
            delay_s: DELAY_S,
        }
    }
}

/// ArduPilot measures 20 times a second and more, and its messages wait for their turn.
const DELAY_S: f64 = 0.04;
/// Within this time one of its messages comes at least: ArduPilot says them 40 times a second.
const MESSAGE_WITHIN: Duration = Duration::from_millis(25);
/// Messages are asked for so often, times a second.
const RATES_HZ: std::ops::RangeInclusive<f64> = 10.0..=40.0;

impl AutopilotRange {
    /// Returns the time from measuring to the message.
    pub fn delay(&self) -> Duration {
        seconds(self.delay_s)
    }

    /// Returns how often a second its messages are wanted: twice in the time that a ping has for its answer.
    pub fn rate_hz(&self, look: &SensorCoverage) -> u16 {
        let rate_hz = 2.0 / self.answers_within(look).as_secs_f64().max(1e-3);
        rate_hz.clamp(*RATES_HZ.start(), *RATES_HZ.end()).ceil() as u16
    }

    /// Returns the time from a ping to the last message that can answer it, less that in which none can.
    fn answers_within(&self, look: &SensorCoverage) -> Duration {
        let ping = look.scan_period().saturating_sub(look.settle());
        ping.saturating_sub(self.delay())
    }

    /// Checks its settings together with where the sensors look; `table` is its own.
    pub(super) fn check(&self, source: &Source<'_>, table: &str, look: &SensorCoverage) {
        if !source.is_sound(&[table]) {
            return;
        }
        if self
            .nothing_from_m
            .is_some_and(|nothing_from_m| nothing_from_m < look.max_range_m)
        {
            let wrong = "is nearer than max_range_m: what stands there would be taken for free";
            let allowed = "at least max_range_m is allowed";
            source.refuse(&format!("{table}.nothing_from_m"), wrong, allowed);
        }
        if self.answers_within(look) < MESSAGE_WITHIN {
            let wrong = "leaves no time for an answer: its messages come every 0.025 s";
            let allowed = "0.025 s more than settle_s and the driver's delay_s is allowed";
            source.refuse("range.scan_period_s", wrong, allowed);
        }
    }
}

impl Keyed for AutopilotRange {
    fn keys(&mut self, to: &mut dyn Keys) {
        let AutopilotRange {
            nothing_from_m,
            delay_s,
        } = self;
        let means = "from here on a DISTANCE_SENSOR says that its sensor has measured and heard nothing; known of the sensor, \
                     since the message does not say it. An OBSTACLE_DISTANCE says it by itself";
        to.maybe_number(
            nothing_from_m,
            NumberBounds {
                name: "nothing_from_m",
                left_out: "none",
                allowed: 0.1..=655.0,
                means,
            },
        );
        let means = "from measuring to the message; a reading that is older than the ping does not answer it";
        to.number(delay_s, Number::new("delay_s", DELAY_S, 0.0..=5.0, means));
    }
}

/// The table `[range.autopilot]`; it is read, and not used, while another driver is chosen.
pub(super) struct AutopilotRangeTable<'a> {
    /// What is chosen.
    pub(super) driver: &'a mut RangeDriver,
    /// What stands in for it while another driver is chosen.
    pub(super) unused: AutopilotRange,
}

impl MaybeTable for AutopilotRangeTable<'_> {
    fn get(&mut self) -> Option<&mut dyn Keyed> {
        match self.driver {
            RangeDriver::Autopilot(range) => Some(range),
            RangeDriver::Simulated
            | RangeDriver::Serial(_)
            | RangeDriver::HcSr04(_)
            | RangeDriver::None => None,
        }
    }

    fn fill(&mut self) -> &mut dyn Keyed {
        match self.driver {
            RangeDriver::Autopilot(range) => range,
            RangeDriver::Simulated
            | RangeDriver::Serial(_)
            | RangeDriver::HcSr04(_)
            | RangeDriver::None => &mut self.unused,
        }
    }
}
