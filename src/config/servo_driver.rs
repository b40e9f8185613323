//! Drivers of the servo that turns a range sensor: their names, and what each is told in a table of its name. How far the servo
//! turns the sensor, and how long that takes, is in `range.rs`.

use tomoswarm_proto::ServoKind;

use super::drivers::{DriverChoice, DriverKey, Known, always};
use super::forms::{LineName, PortName};
use super::keys::{Form, KeyEntry, Keyed, Keys, MaybeTable, Numbers, Whole};
use super::range::{SensorCoverage, SensorMount};
use super::section::Section;
use super::source::Source;

/// What turns range sensors.
#[derive(Clone, PartialEq, Debug, Default)]
pub enum ServoDriver {
    /// The simulated world.
    #[default]
    Simulated,
    /// A servo of the real world.
    Real(RealServo),
    /// Nothing: the sensors are fixed.
    None,
}

/// A servo of the real world.
#[derive(Clone, PartialEq, Debug)]
pub struct RealServo {
    /// What gives it its pulses.
    pub output: ServoOutput,
    /// What a pulse means.
    pub scale: ServoScale,
}

/// What gives a servo its pulses.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum ServoOutput {
    /// A channel of a PWM chip that the kernel drives.
    Pwm {
        /// The folder of the chip, such as `/sys/class/pwm/pwmchip0`.
        chip: String,
        /// The number of its channel.
        channel: usize,
    },
    /// A pin of a Raspberry Pi.
    Gpio {
        /// The name that the kernel has for its line.
        pin: String,
    },
    /// An output of the autopilot.
    Autopilot {
        /// Its number, as SERVOn_FUNCTION counts.
        output: usize,
    },
}

/// What the pulses of a servo mean, linear from one end to the other.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct ServoScale {
    /// The shortest and the longest pulse, microseconds; the servo never gets another.
    pub pulse_us: Vec<f64>,
    /// The angles that they stand for, degrees against the servo's zero, counter-clockwise; the second may be the smaller one.
    pub angle_deg: Vec<f64>,
}

impl ServoOutput {
    fn name(&self) -> &'static str {
        match self {
            ServoOutput::Pwm { .. } => "pwm",
            ServoOutput::Gpio { .. } => "gpio",
            ServoOutput::Autopilot { .. } => "autopilot",
        }
    }

    fn kind(&self) -> ServoKind {
        match self {
            ServoOutput::Pwm { .. } | ServoOutput::Gpio { .. } => ServoKind::Pwm,
            ServoOutput::Autopilot { .. } => ServoKind::Autopilot,
        }
    }

    /// Returns whether its settings are there.
    fn is_told(&self) -> bool {
        match self {
            ServoOutput::Pwm { chip, .. } => !chip.is_empty(),
            ServoOutput::Gpio { pin } => !pin.is_empty(),
            ServoOutput::Autopilot { output } => *output > 0,
        }
    }

    /// Returns where it is, in words.
    fn in_words(&self) -> String {
        match self {
            ServoOutput::Pwm { chip, channel } => format!("channel {channel} of {chip}"),
            ServoOutput::Gpio { pin } => pin.clone(),
            ServoOutput::Autopilot { output } => format!("output {output}"),
        }
    }
}

impl DriverChoice for ServoDriver {
    fn all() -> Vec<Known<ServoDriver>> {
        let real = |output: ServoOutput, is_built| Known {
            name: output.name(),
            is_built,
            driver: ServoDriver::Real(RealServo {
                output,
                scale: ServoScale::default(),
            }),
        };
        let pwm = ServoOutput::Pwm {
            chip: String::new(),
            channel: 0,
        };
        vec![
            always("sim", ServoDriver::Simulated),
            real(pwm, cfg!(feature = "hw")),
            real(
                ServoOutput::Gpio { pin: String::new() },
                cfg!(feature = "hw"),
            ),
            real(ServoOutput::Autopilot { output: 0 }, cfg!(feature = "net")),
            always("none", ServoDriver::None),
        ]
    }

    fn name(&self) -> &'static str {
        match self {
            ServoDriver::Simulated => "sim",
            ServoDriver::Real(servo) => servo.output.name(),
            ServoDriver::None => "none",
        }
    }
}

impl ServoDriver {
    /// Returns what a vehicle says of its servo; `None` = it has none.
    pub(super) fn kind(&self) -> Option<ServoKind> {
        match self {
            ServoDriver::Simulated => Some(ServoKind::Simulated),
            ServoDriver::Real(servo) => Some(servo.output.kind()),
            ServoDriver::None => None,
        }
    }

    /// Returns the pin of this machine that it takes, if it takes one.
    pub(super) fn pin(&self) -> Option<&str> {
        match self {
            ServoDriver::Real(servo) => match &servo.output {
                ServoOutput::Gpio { pin } => Some(pin),
                ServoOutput::Pwm { .. } | ServoOutput::Autopilot { .. } => None,
            },
            ServoDriver::Simulated | ServoDriver::None => None,
        }
    }

    /// Returns it in words, for people.
    pub fn in_words(&self) -> String {
        match self {
            ServoDriver::Simulated | ServoDriver::None => self.name().to_owned(),
            ServoDriver::Real(servo) => format!("{} on {}", self.name(), servo.output.in_words()),
        }
    }

    /// Returns whether it hangs on the autopilot.
    pub(super) fn is_on_autopilot(&self) -> bool {
        match self {
            ServoDriver::Simulated | ServoDriver::None => false,
            ServoDriver::Real(servo) => matches!(servo.output, ServoOutput::Autopilot { .. }),
        }
    }

    /// Completes where the sensors look, once the keys are read: without any there is one that it turns as far as it can.
    pub(super) fn complete(&self, source: &Source<'_>, look: &mut SensorCoverage) {
        match self {
            ServoDriver::Simulated => {}
            ServoDriver::Real(servo) => servo.complete(source, look),
            ServoDriver::None => look.fix(source),
        }
    }
}

impl RealServo {
    fn complete(&self, source: &Source<'_>, look: &mut SensorCoverage) {
        let table = format!("servo.{}", self.output.name());
        if !source.is_sound(&[&table]) {
            return;
        }
        if !self.output.is_told() {
            source.require(&table, &format!("a table [{table}] is needed"));
            return;
        }
        let Some([low_deg, high_deg]) = self.scale.check(source, &table) else {
            return;
        };
        if look.sensors.is_empty() {
            look.sensors.push(SensorMount {
                servo_from_deg: low_deg,
                servo_to_deg: high_deg,
                slew_s_per_60_deg: 0.15,
                ..SensorMount::default()
            });
        }
        let is_turned = |sensor: &SensorMount| sensor.servo_from_deg != sensor.servo_to_deg;
        if look
            .sensors
            .iter()
            .filter(|sensor| is_turned(sensor))
            .count()
            > 1
        {
            let wrong = "has several that are turned, and there is one servo";
            source.refuse(
                "range.sensor",
                wrong,
                "one is allowed beside those that are fixed",
            );
        }
        for (index, sensor) in look.sensors.iter().enumerate() {
            let is_reached = |deg: f64| (low_deg..=high_deg).contains(&deg);
            if is_turned(sensor)
                && !(is_reached(sensor.servo_from_deg) && is_reached(sensor.servo_to_deg))
            {
                source.refuse(
                    &format!("range.sensor[{index}].servo_to_deg"),
                    "is beyond what the servo's pulses reach",
                    &format!("{low_deg} to {high_deg} is allowed"),
                );
            }
        }
    }
}

impl ServoScale {
    /// Checks it; returns the lower and the higher of its angles, degrees, when it is one.
    fn check(&self, source: &Source<'_>, table: &str) -> Option<[f64; 2]> {
        let ([shortest_us, longest_us], [first_deg, last_deg]) =
            (self.pulse_us.as_slice(), self.angle_deg.as_slice())
        else {
            return None;
        };
        if shortest_us >= longest_us {
            source.refuse(
                &format!("{table}.pulse_us"),
                "does not rise",
                "the shorter pulse first is allowed; for a servo that turns the other way angle_deg falls",
            );
            return None;
        }
        if first_deg == last_deg {
            let key = format!("{table}.angle_deg");
            source.refuse(&key, "is one angle", "two different ones are allowed");
            return None;
        }
        Some([first_deg.min(*last_deg), first_deg.max(*last_deg)])
    }
}

/// The table `[servo]`.
pub(super) struct ServoTable<'a>(pub(super) &'a mut ServoDriver);

impl Keyed for ServoTable<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        DriverKey(&mut *self.0).show(to);
        for Known { name, driver, .. } in ServoDriver::all() {
            if let ServoDriver::Real(unused) = driver {
                let mut table = OneDriver {
                    driver: self.0,
                    unused,
                };
                let means = "what its driver of this name is told; checked and not used while another one is chosen";
                let left_out = "";
                to.maybe_table(
                    &mut table,
                    KeyEntry {
                        name,
                        left_out,
                        means,
                    },
                );
            }
        }
    }
}

/// The table of one driver.
struct OneDriver<'a> {
    driver: &'a mut ServoDriver,
    /// What stands in for it while another driver is chosen.
    unused: RealServo,
}

impl OneDriver<'_> {
    fn chosen(&mut self) -> Option<&mut RealServo> {
        let name = self.unused.output.name();
        match self.driver {
            ServoDriver::Real(servo) if servo.output.name() == name => Some(servo),
            ServoDriver::Real(_) | ServoDriver::Simulated | ServoDriver::None => None,
        }
    }
}

impl MaybeTable for OneDriver<'_> {
    fn get(&mut self) -> Option<&mut dyn Keyed> {
        self.chosen().map(|servo| servo as &mut dyn Keyed)
    }

    fn fill(&mut self) -> &mut dyn Keyed {
        if self.chosen().is_none() {
            return &mut self.unused;
        }
        match self.driver {
            ServoDriver::Real(servo) => servo,
            ServoDriver::Simulated | ServoDriver::None => &mut self.unused,
        }
    }
}

impl Keyed for RealServo {
    fn keys(&mut self, to: &mut dyn Keys) {
        let RealServo { output, scale } = self;
        match output {
            ServoOutput::Pwm { chip, channel } => {
                let means = "the folder of a PWM chip: of a Raspberry Pi (overlay `pwm`), of a PCA9685, or `pwm-gpio`";
                let (name, left_out) = ("chip", "needed");
                to.form(
                    &mut PortName(chip),
                    KeyEntry {
                        name,
                        left_out,
                        means,
                    },
                );
                to.whole(
                    channel,
                    Whole {
                        name: "channel",
                        default: 0,
                        allowed: 0..=255,
                        means: "the number of its channel",
                    },
                );
            }
            ServoOutput::Gpio { pin } => {
                let means = "a pin of a Raspberry Pi, by the name that the kernel has for its line: its PWM hardware (12, 13, \
                             18, 19, with the overlay `pwm`), else a thread";
                let (name, left_out) = ("pin", "needed");
                let mut line = Some(std::mem::take(pin));
                let needed = Some("the name of a GPIO line such as \"GPIO18\" is needed");
                let mut form = LineName {
                    line: &mut line,
                    needed,
                };
                to.form(
                    &mut form,
                    KeyEntry {
                        name,
                        left_out,
                        means,
                    },
                );
                *pin = line.unwrap_or_default();
            }
            ServoOutput::Autopilot { output } => {
                let means = "the number of the autopilot's output, with SERVOn_FUNCTION = 0";
                let (name, left_out) = ("output", "needed");
                to.form(
                    &mut OutputNumber(output),
                    KeyEntry {
                        name,
                        left_out,
                        means,
                    },
                );
            }
        }
        scale.keys(to);
    }
}

/// The number of an output of an autopilot; 0 = not given yet.
struct OutputNumber<'a>(&'a mut usize);

impl Form for OutputNumber<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(self.0.to_string())
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        section.require(key, "a whole number from 1 to 32 is needed");
        let is_given = section.has(key);
        let output = section.whole(key, 1, 1..=32);
        *self.0 = if is_given { output } else { 0 };
    }

    fn allowed(&self) -> String {
        "1 to 32".to_owned()
    }
}

impl Keyed for ServoScale {
    fn keys(&mut self, to: &mut dyn Keys) {
        let ServoScale {
            pulse_us,
            angle_deg,
        } = self;
        to.numbers(
            pulse_us,
            Numbers {
                name: "pulse_us",
                default: &[1000.0, 2000.0],
                count: 2..=2,
                allowed: 300.0..=3000.0,
                means: "the shortest and the longest pulse; the servo never gets another",
            },
        );
        to.numbers(
            angle_deg,
            Numbers {
                name: "angle_deg",
                default: &[-90.0, 90.0],
                count: 2..=2,
                allowed: -180.0..=180.0,
                means: "the angles that they stand for, against the servo's zero, counter-clockwise; falling for a servo \
                        that turns the other way",
            },
        );
    }
}
