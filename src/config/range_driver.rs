//! Drivers of range sensors: their names, and what each is told in a table of its name. To add one is to add a variant
//! here, and what its bytes mean in `hw/` (a sensor on a serial line) or what reads it in `run/drivers/range/`.
//!
//! Where the sensors sit and how far they look is in `range.rs`, whatever reads them.

use std::time::Duration;

use tomoswarm_proto::RangeSensorKind;

use super::autopilot_range::{AutopilotRange, AutopilotRangeTable};
use super::drivers::{DriverChoice, Known, always};
use super::forms::{PortName, seconds};
use super::hcsr04_lines::{HcSr04Lines, HcSr04Table};
use super::keys::{
    KeyEntry, Keyed, Keys, MaybeTable, Number, NumberBounds, Whole, WordChoice, Words,
};
use super::range::SensorCoverage;
use super::source::Source;

/// What reads the range sensors of a vehicle.
#[derive(Clone, PartialEq, Debug, Default)]
pub enum RangeDriver {
    /// The simulated world.
    #[default]
    Simulated,
    /// A sensor on a serial line, which measures all the time.
    Serial(SerialSensor),
    /// An ultrasonic sensor with trigger and echo lines.
    HcSr04(HcSr04Lines),
    /// Sensors that hang on the autopilot.
    Autopilot(AutopilotRange),
    /// Nothing: the vehicle sees nothing, and is not driven.
    None,
}

/// A range sensor on a serial line.
#[derive(Clone, PartialEq, Debug)]
pub struct SerialSensor {
    /// The port, a file of the machine such as `/dev/serial/by-id/usb-…`.
    pub port: String,
    /// Bits per second.
    pub baud: usize,
    /// What its bytes mean.
    pub protocol: SerialProtocol,
}

/// What the bytes of a range sensor on a serial line mean.
#[derive(Clone, PartialEq, Debug)]
pub enum SerialProtocol {
    /// Lines of text.
    Text(SerialText),
    /// Frames of one of Benewake's lidars.
    Tf(TfSensor),
}

/// A lidar of Benewake that says frames of nine bytes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum TfSensor {
    /// TF-Luna.
    Luna,
    /// TFmini, TFmini-S and TFmini Plus.
    Mini,
}

impl TfSensor {
    /// Returns how far it looks at most, metres.
    fn farthest_m(self) -> f64 {
        match self {
            TfSensor::Luna => 8.0,
            TfSensor::Mini => 12.0,
        }
    }

    /// Checks where it looks.
    fn check(self, source: &Source<'_>, look: &SensorCoverage) {
        let farthest_m = self.farthest_m();
        if look.max_range_m > farthest_m {
            let allowed = format!("at most {farthest_m} m is allowed with this driver");
            source.refuse("range.max_range_m", "is farther than it measures", &allowed);
        }
        if look.scan_period().saturating_sub(look.settle()) < TF_ANSWERS_WITHIN {
            let wrong = "leaves no time for an answer, which takes 0.03 s";
            let allowed = "0.03 s more than settle_s is allowed";
            source.refuse("range.scan_period_s", wrong, allowed);
        }
    }
}

/// A lidar averages over 10 ms, says a frame every 10 ms, and the frame must be read.
const TF_ANSWERS_WITHIN: Duration = Duration::from_millis(30);

/// The lines of a range sensor.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SerialText {
    /// How a line says a distance.
    pub format: TextFormat,
    /// What a number counts.
    pub unit: LengthUnit,
    /// From here on a number says that the sensor has heard nothing, in its unit; `None` = as the format has it.
    pub nothing_from: Option<f64>,
    /// Time from measuring to the first byte of its line, seconds.
    pub delay_s: f64,
}

impl Default for SerialText {
    fn default() -> SerialText {
        let (format, unit) = (TextFormat::MaxBotix, LengthUnit::Millimetres);
        SerialText {
            format,
            unit,
            nothing_from: None,
            delay_s: 0.0,
        }
    }
}

/// How a line of text says a distance.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum TextFormat {
    /// `R` and four digits, millimetres.
    MaxBotix,
    /// A number.
    Number,
}

impl WordChoice for TextFormat {
    const WORDS: &'static [(&'static str, TextFormat)] = &[
        ("maxbotix", TextFormat::MaxBotix),
        ("number", TextFormat::Number),
    ];
}

/// What a number of a range sensor counts.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LengthUnit {
    /// mm
    Millimetres,
    /// cm
    Centimetres,
    /// m
    Metres,
    /// in
    Inches,
}

impl WordChoice for LengthUnit {
    const WORDS: &'static [(&'static str, LengthUnit)] = &[
        ("mm", LengthUnit::Millimetres),
        ("cm", LengthUnit::Centimetres),
        ("m", LengthUnit::Metres),
        ("in", LengthUnit::Inches),
    ];
}

impl LengthUnit {
    /// Returns its length, metres.
    pub fn metres(self) -> f64 {
        match self {
            LengthUnit::Millimetres => 1e-3,
            LengthUnit::Centimetres => 1e-2,
            LengthUnit::Metres => 1.0,
            LengthUnit::Inches => 0.0254,
        }
    }
}

/// The farthest that four digits of millimetres can say, metres.
const MAXBOTIX_FARTHEST_M: f64 = 9.999;

impl SerialText {
    /// Returns from where on a reading says that nothing was heard, metres; `None` = none says so. A MaxBotix that hears
    /// nothing says its farthest reading, which depends on its model: all beyond `max_range_m` counts as that.
    pub fn nothing_from_m(&self, look: &SensorCoverage) -> Option<f64> {
        match (self.nothing_from, self.format) {
            (Some(nothing_from), _) => Some(nothing_from * self.unit.metres()),
            (None, TextFormat::MaxBotix) => Some(look.max_range_m),
            (None, TextFormat::Number) => None,
        }
    }

    /// Returns the time from measuring to the first byte of its line.
    pub fn delay(&self) -> Duration {
        seconds(self.delay_s)
    }

    /// Checks its keys together with where the sensor looks; `table` is its own.
    fn check(&self, source: &Source<'_>, table: &str, look: &SensorCoverage) {
        if self.format == TextFormat::MaxBotix && self.unit != LengthUnit::Millimetres {
            let wrong = "is not what a line such as R1234 counts";
            source.refuse(
                &format!("{table}.unit"),
                wrong,
                "unit = \"mm\" is allowed with format \"maxbotix\"",
            );
        }
        if self.format == TextFormat::MaxBotix && look.max_range_m > MAXBOTIX_FARTHEST_M {
            let wrong = "is farther than a line such as R9999 says: it would never say that nothing is there";
            source.refuse(
                "range.max_range_m",
                wrong,
                "at most 9.999 m is allowed with format \"maxbotix\"",
            );
        }
        if self
            .nothing_from_m(look)
            .is_some_and(|nothing_from_m| nothing_from_m < look.max_range_m)
        {
            let wrong = "is nearer than max_range_m: what stands there would be taken for free";
            source.refuse(
                &format!("{table}.nothing_from"),
                wrong,
                "at least max_range_m is allowed",
            );
        }
        if self.delay() >= look.scan_period().saturating_sub(look.settle()) {
            let wrong = "leaves no time for an answer before the next ping";
            let allowed = "less than scan_period_s without settle_s is allowed";
            source.refuse(&format!("{table}.delay_s"), wrong, allowed);
        }
    }
}

impl SerialProtocol {
    /// Returns the name of the driver that speaks it.
    fn name(&self) -> &'static str {
        match self {
            SerialProtocol::Text(_) => "serial-text",
            SerialProtocol::Tf(TfSensor::Luna) => "tf-luna",
            SerialProtocol::Tf(TfSensor::Mini) => "tfmini",
        }
    }

    fn kind(&self) -> RangeSensorKind {
        match self {
            SerialProtocol::Text(_) => RangeSensorKind::SerialText,
            SerialProtocol::Tf(_) => RangeSensorKind::TfLuna,
        }
    }

    /// Returns a sensor that speaks it, its port not read yet.
    fn sensor(self) -> SerialSensor {
        let baud = match self {
            SerialProtocol::Text(_) => 9600,
            SerialProtocol::Tf(_) => 115_200,
        };
        SerialSensor {
            port: String::new(),
            baud,
            protocol: self,
        }
    }

    fn check(&self, source: &Source<'_>, table: &str, look: &SensorCoverage) {
        match self {
            SerialProtocol::Text(text) => text.check(source, table, look),
            SerialProtocol::Tf(sensor) => sensor.check(source, look),
        }
    }
}

impl DriverChoice for RangeDriver {
    fn all() -> Vec<Known<RangeDriver>> {
        let serial = |protocol: SerialProtocol| Known {
            name: protocol.name(),
            is_built: cfg!(feature = "hw"),
            driver: RangeDriver::Serial(protocol.sensor()),
        };
        vec![
            always("sim", RangeDriver::Simulated),
            serial(SerialProtocol::Text(SerialText::default())),
            serial(SerialProtocol::Tf(TfSensor::Luna)),
            serial(SerialProtocol::Tf(TfSensor::Mini)),
            Known {
                name: "hcsr04",
                is_built: cfg!(feature = "hw"),
                driver: RangeDriver::HcSr04(HcSr04Lines::default()),
            },
            Known {
                name: "autopilot",
                is_built: cfg!(feature = "net"),
                driver: RangeDriver::Autopilot(AutopilotRange::default()),
            },
            always("none", RangeDriver::None),
        ]
    }

    fn name(&self) -> &'static str {
        match self {
            RangeDriver::Simulated => "sim",
            RangeDriver::Serial(sensor) => sensor.protocol.name(),
            RangeDriver::HcSr04(_) => "hcsr04",
            RangeDriver::Autopilot(_) => "autopilot",
            RangeDriver::None => "none",
        }
    }
}

impl RangeDriver {
    /// Returns what a vehicle says of its range sensor; `None` = it has none.
    pub fn kind(&self) -> Option<RangeSensorKind> {
        match self {
            RangeDriver::Simulated => Some(RangeSensorKind::Simulated),
            RangeDriver::Serial(sensor) => Some(sensor.protocol.kind()),
            RangeDriver::HcSr04(_) => Some(RangeSensorKind::HcSr04),
            RangeDriver::Autopilot(_) => Some(RangeSensorKind::Autopilot),
            RangeDriver::None => None,
        }
    }

    /// Returns whether a sensor of the real world is read.
    pub(super) fn is_real(&self) -> bool {
        match self {
            RangeDriver::Simulated | RangeDriver::None => false,
            RangeDriver::Serial(_) | RangeDriver::HcSr04(_) | RangeDriver::Autopilot(_) => true,
        }
    }

    /// Returns it in words, for people.
    pub fn in_words(&self) -> String {
        let devices = match self {
            RangeDriver::Simulated | RangeDriver::Autopilot(_) | RangeDriver::None => {
                return self.name().to_owned();
            }
            RangeDriver::Serial(sensor) => sensor.port.clone(),
            RangeDriver::HcSr04(lines) => format!("{} and {}", lines.trigger, lines.echo),
        };
        format!("{} on {devices}", self.name())
    }

    /// Returns the port or the lines that it opens, each with its key; `table` holds its own table.
    pub(super) fn devices(&self, table: &str) -> Vec<(String, String)> {
        let table = format!("{table}.{}", self.name());
        let named = |name: &str, device: &str| (format!("{table}.{name}"), device.to_owned());
        let all = match self {
            RangeDriver::Simulated | RangeDriver::Autopilot(_) | RangeDriver::None => Vec::new(),
            RangeDriver::Serial(sensor) => vec![named("port", &sensor.port)],
            RangeDriver::HcSr04(lines) => {
                let power = lines.power.iter().map(|power| named("power", power));
                [named("trigger", &lines.trigger), named("echo", &lines.echo)]
                    .into_iter()
                    .chain(power)
                    .collect()
            }
        };
        let is_told = |(_, device): &(String, String)| !device.is_empty();
        all.into_iter().filter(is_told).collect()
    }

    /// Checks its settings together with where the sensors look; `within` holds its own table, and so many sensors have it.
    pub(super) fn check(
        &self,
        source: &Source<'_>,
        within: &str,
        look: &SensorCoverage,
        sensors: usize,
    ) {
        let several = |wrong: &str| {
            if sensors > 1 {
                let allowed = "one is allowed, or each with a driver of its own";
                source.refuse("range.sensor", wrong, allowed);
            }
        };
        let table = format!("{within}.{}", self.name());
        let sensor = match self {
            RangeDriver::Simulated | RangeDriver::None => return,
            RangeDriver::HcSr04(lines) => {
                several("has several, and one pair of lines is one sensor");
                return lines.check(source, &table, look);
            }
            RangeDriver::Autopilot(range) => return range.check(source, &table, look),
            RangeDriver::Serial(sensor) => sensor,
        };
        if sensor.port.is_empty() && source.is_sound(&[&table]) {
            source.require(
                &table,
                &format!("a table [{table}] with its port is needed"),
            );
        }
        several("has several, and one port is one sensor");
        sensor.protocol.check(source, &table, look);
    }

    /// Shows the tables of all drivers that have one.
    pub(super) fn show_tables(&mut self, to: &mut dyn Keys) {
        for Known {
            name,
            driver: blank,
            ..
        } in RangeDriver::all()
        {
            let driver = &mut *self;
            let mut table: Box<dyn MaybeTable> = match blank {
                RangeDriver::Serial(unused) => Box::new(SerialTable { driver, unused }),
                RangeDriver::HcSr04(unused) => Box::new(HcSr04Table { driver, unused }),
                RangeDriver::Autopilot(unused) => Box::new(AutopilotRangeTable { driver, unused }),
                RangeDriver::Simulated | RangeDriver::None => continue,
            };
            let means = "what its driver of this name is told; checked and not used while another one is chosen";
            let left_out = "";
            to.maybe_table(
                &mut *table,
                KeyEntry {
                    name,
                    left_out,
                    means,
                },
            );
        }
    }
}

/// The table of one driver of sensors on serial lines.
struct SerialTable<'a> {
    driver: &'a mut RangeDriver,
    /// What stands in for it while another driver is chosen.
    unused: SerialSensor,
}

impl SerialTable<'_> {
    fn chosen(&mut self) -> Option<&mut SerialSensor> {
        let name = self.unused.protocol.name();
        match self.driver {
            RangeDriver::Serial(sensor) if sensor.protocol.name() == name => Some(sensor),
            RangeDriver::Serial(_)
            | RangeDriver::Simulated
            | RangeDriver::HcSr04(_)
            | RangeDriver::Autopilot(_)
            | RangeDriver::None => None,
        }
    }
}

impl MaybeTable for SerialTable<'_> {
    fn get(&mut self) -> Option<&mut dyn Keyed> {
        self.chosen().map(|sensor| sensor as &mut dyn Keyed)
    }

    fn fill(&mut self) -> &mut dyn Keyed {
        if self.chosen().is_none() {
            return &mut self.unused;
        }
        match self.driver {
            RangeDriver::Serial(sensor) => sensor,
            RangeDriver::Simulated
            | RangeDriver::HcSr04(_)
            | RangeDriver::Autopilot(_)
            | RangeDriver::None => &mut self.unused,
        }
    }
}

impl Keyed for SerialSensor {
    fn keys(&mut self, to: &mut dyn Keys) {
        let SerialSensor {
            port,
            baud,
            protocol,
        } = self;
        let means =
            "the port, a file of the machine; names under `/dev/serial/by-id` outlast replugging";
        to.form(
            &mut PortName(port),
            KeyEntry {
                name: "port",
                left_out: "needed",
                means,
            },
        );
        let default = protocol.clone().sensor().baud;
        to.whole(
            baud,
            Whole {
                name: "baud",
                default,
                allowed: 300..=4_000_000,
                means: "bits per second",
            },
        );
        match protocol {
            SerialProtocol::Text(text) => text.keys(to),
            // Its frames leave nothing to be said.
            SerialProtocol::Tf(_) => {}
        }
    }
}

impl Keyed for SerialText {
    fn keys(&mut self, to: &mut dyn Keys) {
        let SerialText {
            format,
            unit,
            nothing_from,
            delay_s,
        } = self;
        let means = "how a line says a distance: `R` and four digits of millimetres, or a number";
        to.word(
            format,
            Words {
                name: "format",
                default: "maxbotix",
                means,
            },
        );
        to.word(
            unit,
            Words {
                name: "unit",
                default: "mm",
                means: "what a number counts",
            },
        );
        let means = "from here on a number, in its unit, says that the sensor has measured and heard nothing; what lies \
                     between max_range_m and this is dropped and counted";
        let left_out = "maxbotix: max_range_m; number: none";
        let allowed = 0.0..=1e6;
        to.maybe_number(
            nothing_from,
            NumberBounds {
                name: "nothing_from",
                left_out,
                allowed,
                means,
            },
        );
        let means = "from measuring to the first byte of its line; a reading that is older than the ping does not answer it";
        to.number(
            delay_s,
            Number {
                name: "delay_s",
                default: 0.0,
                allowed: 0.0..=5.0,
                means,
            },
        );
    }
}
