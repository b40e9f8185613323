//! Where a vehicle's HC-SR04 is wired: the table `[range.hcsr04]` of its file. Opens nothing.

use super::forms::LineName;
use super::keys::{KeyEntry, Keyed, Keys, MaybeTable, Number};
use super::range::SensorCoverage;
use super::range_driver::RangeDriver;
use super::source::Source;

/// The lines of an ultrasonic sensor, by the names that the kernel has for them, and the air that it is in.
#[derive(Clone, PartialEq, Debug)]
pub struct HcSr04Lines {
    /// Makes it measure.
    pub trigger: String,
    /// Is high while the sound is under way.
    pub echo: String,
    /// Supplies it, high = on, and is low for a moment when it is stuck; `None` = its supply is not switched.
    pub power: Option<String>,
    /// Temperature of the air, °C.
    pub air_temperature_c: f64,
}

impl Default for HcSr04Lines {
    fn default() -> HcSr04Lines {
        HcSr04Lines {
            trigger: String::new(),
            echo: String::new(),
            power: None,
            air_temperature_c: 20.0,
        }
    }
}

/// It hears no farther, metres.
const FARTHEST_M: f64 = 4.0;
/// An answer takes so long at most, seconds: the longest pulse and what it takes to begin and end one.
const ANSWERS_WITHIN_S: f64 = 0.067;

impl HcSr04Lines {
    /// Checks its settings together with where the sensor looks; `table` is its own.
    pub(super) fn check(&self, source: &Source<'_>, table: &str, look: &SensorCoverage) {
        if !source.is_sound(&[table]) {
            return;
        }
        if self.trigger.is_empty() || self.echo.is_empty() {
            let needed = format!("a table [{table}] with its trigger and echo is needed");
            source.require(table, &needed);
            return;
        }
        let wrong = "is another line of this sensor, too";
        let allowed = "a line of its own is allowed";
        if self.trigger == self.echo {
            source.refuse(&format!("{table}.echo"), wrong, allowed);
        }
        if [&self.trigger, &self.echo]
            .into_iter()
            .any(|line| Some(line) == self.power.as_ref())
        {
            source.refuse(&format!("{table}.power"), wrong, allowed);
        }
        if look.max_range_m > FARTHEST_M {
            let allowed = "at most 4 m is allowed with this driver";
            source.refuse("range.max_range_m", "is farther than it hears", allowed);
        }
        let left_s = look
            .scan_period()
            .saturating_sub(look.settle())
            .as_secs_f64();
        if left_s < ANSWERS_WITHIN_S {
            let wrong = "leaves no time for an answer, which takes up to 0.067 s";
            let allowed = "0.067 s more than settle_s is allowed";
            source.refuse("range.scan_period_s", wrong, allowed);
        }
    }
}

impl Keyed for HcSr04Lines {
    fn keys(&mut self, to: &mut dyn Keys) {
        let HcSr04Lines {
            trigger,
            echo,
            power,
            air_temperature_c,
        } = self;
        let needed = Some("the name of a GPIO line such as \"GPIO23\" is needed");
        let mut lines = [
            Some(std::mem::take(trigger)),
            Some(std::mem::take(echo)),
            power.take(),
        ];
        let [made, heard, supplied] = &mut lines;
        let mut line = |line, needed, name, left_out, means| {
            to.form(
                &mut LineName { line, needed },
                KeyEntry {
                    name,
                    left_out,
                    means,
                },
            );
        };
        let means = "the GPIO line that makes it measure, by the name that the kernel has for it";
        line(made, needed, "trigger", "needed", means);
        let means = "the line that is high while the sound is under way; of 5 V, through a divider";
        line(heard, needed, "echo", "needed", means);
        let means =
            "a line that supplies it, high = on: it is off for a moment when the sensor is stuck";
        line(supplied, None, "power", "not switched", means);
        let [made, heard, supplied] = lines;
        (*trigger, *echo, *power) = (
            made.unwrap_or_default(),
            heard.unwrap_or_default(),
            supplied,
        );
        to.number(
            air_temperature_c,
            Number {
                name: "air_temperature_c",
                default: 20.0,
                allowed: -40.0..=60.0,
                means: "temperature of the air: 20 °C off is 15 cm at 4 m",
            },
        );
    }
}

/// The table `[range.hcsr04]`; it is read, and not used, while another driver is chosen.
pub(super) struct HcSr04Table<'a> {
    /// What is chosen.
    pub(super) driver: &'a mut RangeDriver,
    /// What stands in for it while another driver is chosen.
    pub(super) unused: HcSr04Lines,
}

impl MaybeTable for HcSr04Table<'_> {
    fn get(&mut self) -> Option<&mut dyn Keyed> {
        match self.driver {
            RangeDriver::HcSr04(lines) => Some(lines),
            RangeDriver::Simulated
            | RangeDriver::Serial(_)
            | RangeDriver::Autopilot(_)
            | RangeDriver::None => None,
        }
    }

    fn fill(&mut self) -> &mut dyn Keyed {
        match self.driver {
            RangeDriver::HcSr04(lines) => lines,
            RangeDriver::Simulated
            | RangeDriver::Serial(_)
            | RangeDriver::Autopilot(_)
            | RangeDriver::None => &mut self.unused,
        }
    }
}
