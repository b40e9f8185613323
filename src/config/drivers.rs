//! Which driver speaks with each device of a vehicle: autopilot, servo, range sensor and radio are chosen each by itself. The
//! choices of range sensors and servos, and what their drivers are told, have files of their own. Opens no device.

use tomoswarm_proto::{AutopilotFamily, BodyKind, Capability, RadioKind};

use super::keys::{Form, KeyEntry, Keys, quoted};
use super::mavlink_connection::MavlinkConnection;
use super::range::SensorCoverage;
use super::range_driver::RangeDriver;
use super::section::Section;
use super::servo_driver::ServoDriver;
use super::source::Source;
use super::vehicle::Craft;
use super::xbee_port::XbeePort;

/// A servo on an autopilot has come to rest after this time at the earliest: it hears of a turn up to 0.08 s late.
const AUTOPILOT_SERVO_SETTLE_S: f64 = 0.11;

/// What speaks with the devices of a vehicle.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Drivers {
    /// The autopilot.
    pub autopilot: AutopilotDriver,
    /// The servo of the range sensor.
    pub servo: ServoDriver,
    /// The range sensors, but for those that have a driver of their own.
    pub range: RangeDriver,
    /// Of each `[[range.sensor]]` its own driver, if it has one; those after the last that has one are left out.
    pub own_range: Vec<Option<RangeDriver>>,
    /// The radio.
    pub radio: RadioDriver,
}

/// What speaks with an autopilot.
#[derive(Clone, PartialEq, Debug, Default)]
pub enum AutopilotDriver {
    /// The simulated world.
    #[default]
    Simulated,
    /// An ArduPilot, over MAVLink.
    Mavlink(Box<MavlinkConnection>),
}

/// What speaks with a radio.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub enum RadioDriver {
    /// The simulated world.
    #[default]
    Simulated,
    /// An XBee with 802.15.4 firmware.
    Xbee(XbeePort),
}

impl Drivers {
    /// All of them simulated.
    pub const SIMULATED: Drivers = Drivers {
        autopilot: AutopilotDriver::Simulated,
        servo: ServoDriver::Simulated,
        range: RangeDriver::Simulated,
        own_range: Vec::new(),
        radio: RadioDriver::Simulated,
    };

    /// Returns whether a device is simulated: then a world is needed.
    pub fn has_simulated(&self) -> bool {
        let Drivers {
            autopilot,
            servo,
            range,
            // Only real sensors have drivers of their own.
            own_range: _,
            radio,
        } = self;
        *autopilot == AutopilotDriver::Simulated
            || *servo == ServoDriver::Simulated
            || *range == RangeDriver::Simulated
            || *radio == RadioDriver::Simulated
    }

    /// Returns what reads a range sensor, by its number.
    pub fn range_of(&self, sensor: usize) -> &RangeDriver {
        let own = self.own_range.get(sensor).and_then(Option::as_ref);
        own.unwrap_or(&self.range)
    }

    /// Returns what a vehicle of a kind with these drivers has, ascending.
    pub fn capabilities(&self, craft: Craft) -> Vec<Capability> {
        let family = match self.autopilot {
            AutopilotDriver::Simulated => AutopilotFamily::Simulated,
            AutopilotDriver::Mavlink(_) => AutopilotFamily::ArduPilot,
        };
        let body = match craft {
            Craft::Rover => BodyKind::Rover,
            Craft::Copter => BodyKind::Copter,
        };
        let autopilot = Capability::Autopilot(family, body);
        let servo = self.servo.kind().map(Capability::Servo);
        let radio = match &self.radio {
            RadioDriver::Simulated => Capability::Radio(RadioKind::Simulated),
            RadioDriver::Xbee(_) => Capability::Radio(RadioKind::XBee),
        };
        let ranges = [&self.range]
            .into_iter()
            .chain(self.own_range.iter().flatten());
        let ranges = ranges.map(|range| range.kind().map(Capability::RangeSensor));
        let mut all: Vec<Capability> = [Some(autopilot), servo, Some(radio)]
            .into_iter()
            .chain(ranges)
            .flatten()
            .collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Returns the drivers in words, for people.
    pub fn in_words(&self) -> String {
        let Drivers {
            autopilot,
            servo,
            range,
            own_range,
            radio,
        } = self;
        let connection = match autopilot {
            AutopilotDriver::Simulated => String::new(),
            AutopilotDriver::Mavlink(connection) => {
                format!(" at {}", connection.endpoint.in_words())
            }
        };
        let ranges = [range].into_iter().chain(own_range.iter().flatten());
        let ranges: Vec<String> = ranges.map(RangeDriver::in_words).collect();
        let ranges = ranges.join(" and ");
        let radio_port = match radio {
            RadioDriver::Simulated => String::new(),
            RadioDriver::Xbee(xbee) => format!(" on {}", xbee.port),
        };
        let (autopilot, servo, radio) = (autopilot.name(), servo.in_words(), radio.name());
        format!(
            "autopilot {autopilot}{connection}, range {ranges}, servo {servo}, radio {radio}{radio_port}"
        )
    }

    /// Leaves out what stands after the last sensor that has a driver of its own, once the keys are read.
    pub(super) fn complete_own_range(&mut self) {
        let last = self.own_range.iter().rposition(Option::is_some);
        self.own_range.truncate(last.map_or(0, |last| last + 1));
    }

    /// Checks the choices together, and with where the range sensors look.
    pub(super) fn check(&self, source: &Source<'_>, look: &SensorCoverage) {
        let is_simulated = self.servo == ServoDriver::Simulated && source.is_sound(&["servo"]);
        if self.range.is_real() && is_simulated {
            let wrong = "turns no real range sensor: its readings would be taken for beams that it does not look along";
            source.refuse(
                "servo.driver",
                wrong,
                "the driver of a real servo is allowed, or \"none\" for a sensor that is fixed",
            );
        }
        if let AutopilotDriver::Mavlink(connection) = &self.autopilot
            && connection.endpoint.is_blank()
            && source.is_sound(&["autopilot.mavlink"])
        {
            source.require(
                "autopilot.mavlink",
                "a table [autopilot.mavlink] with its connection is needed",
            );
        }
        if let RadioDriver::Xbee(xbee) = &self.radio
            && xbee.port.is_empty()
            && source.is_sound(&["radio.xbee"])
        {
            source.require("radio.xbee", "a table [radio.xbee] with its port is needed");
        }
        self.check_servo(source, look);
        self.check_ranges(source, look);
        self.check_devices(source);
    }

    /// Refuses a port or a line that is named for two devices: this program would take it once, and be in its own way.
    fn check_devices(&self, source: &Source<'_>) {
        let mut devices = self.range.devices("range");
        for (sensor, own) in self.own_range.iter().enumerate() {
            let own = own.iter();
            devices.extend(own.flat_map(|own| own.devices(&format!("range.sensor[{sensor}]"))));
        }
        let serial = match &self.autopilot {
            AutopilotDriver::Mavlink(connection) => connection.endpoint.serial_port(),
            AutopilotDriver::Simulated => None,
        };
        let radio = match &self.radio {
            RadioDriver::Xbee(xbee) => Some(xbee.port.as_str()),
            RadioDriver::Simulated => None,
        };
        for (key, device) in [
            ("servo.gpio.pin", self.servo.pin()),
            ("autopilot.mavlink.connection", serial),
            ("radio.xbee.port", radio),
        ] {
            let Some(device) = device.filter(|device| !device.is_empty()) else {
                continue;
            };
            if let Some((other, _)) = devices.iter().find(|(_, other)| other == device) {
                let wrong = format!("is that of {other}, too");
                source.refuse(key, &wrong, "one of its own is allowed");
            }
            devices.push((key.to_owned(), device.to_owned()));
        }
    }

    /// Checks a servo that hangs on the autopilot: it begins to turn when that has heard of it.
    fn check_servo(&self, source: &Source<'_>, look: &SensorCoverage) {
        if !self.servo.is_on_autopilot() || !source.is_sound(&["servo"]) {
            return;
        }
        if self.autopilot == AutopilotDriver::Simulated {
            source.refuse(
                "servo.driver",
                "hangs on an autopilot that is simulated, and turns nothing",
                "[autopilot] driver = \"mavlink\" is needed with it",
            );
        }
        if look.settle_s < AUTOPILOT_SERVO_SETTLE_S {
            let wrong = "leaves no time for the way to the autopilot, which takes up to 0.08 s";
            let allowed = "at least 0.11 is allowed with a servo on an autopilot";
            source.refuse("range.settle_s", wrong, allowed);
        }
    }

    /// Checks the drivers of range sensors, each and together.
    fn check_ranges(&self, source: &Source<'_>, look: &SensorCoverage) {
        let has_own = |sensor: &usize| matches!(self.own_range.get(*sensor), Some(Some(_)));
        // One whose own driver was refused is not taken for one without.
        let without = match source.is_sound(&["range.sensor"]) {
            true => (0..look.sensors.len())
                .filter(|sensor| !has_own(sensor))
                .count(),
            false => 1,
        };
        self.range.check(source, "range", look, without);
        let mut devices = self.range.devices("range");
        for (sensor, own) in self.own_range.iter().enumerate() {
            let Some(own) = own else { continue };
            let table = format!("range.sensor[{sensor}]");
            own.check(source, &table, look, 1);
            let found = own.devices(&table);
            for (key, device) in &found {
                if devices.iter().any(|(_, other)| other == device) {
                    let allowed = "a device of its own is allowed";
                    source.refuse(key, "is of another range sensor, too", allowed);
                }
            }
            devices.extend(found);
        }
        if !self.range.is_real() && self.own_range.iter().flatten().next().is_some() {
            source.refuse(
                "range.driver",
                "is none of a real sensor, and a [[range.sensor]] has one",
                "the driver of those sensors that name none of their own is allowed",
            );
        }
        if self.autopilot != AutopilotDriver::Simulated {
            return;
        }
        let each = self.own_range.iter().enumerate();
        let own = each
            .filter_map(|(sensor, own)| Some((format!("range.sensor[{sensor}]"), own.as_ref()?)));
        for (table, driver) in own.chain([("range".to_owned(), &self.range)]) {
            if matches!(driver, RangeDriver::Autopilot(_)) {
                source.refuse(
                    &format!("{table}.driver"),
                    "hangs on an autopilot that is simulated, and says nothing",
                    "[autopilot] driver = \"mavlink\" is needed with it",
                );
            }
        }
    }
}

/// A driver that this program knows.
pub(super) struct Known<D> {
    /// Its name in files.
    pub(super) name: &'static str,
    /// Whether it is built in.
    pub(super) is_built: bool,
    /// The driver, its settings not read yet.
    pub(super) driver: D,
}

/// What is wrong with a driver that another build has.
pub(super) const NOT_BUILT: &str = "is not built into this program, only into the whole one";

/// A choice of drivers for a kind of device.
pub(super) trait DriverChoice: Sized {
    /// Returns all drivers that this version knows.
    fn all() -> Vec<Known<Self>>;

    /// Returns the name of the one that is chosen.
    fn name(&self) -> &'static str;
}

/// Returns a driver that needs nothing of the machine, and so is always built in.
pub(super) fn always<D>(name: &'static str, driver: D) -> Known<D> {
    Known {
        name,
        is_built: true,
        driver,
    }
}

impl DriverChoice for AutopilotDriver {
    fn all() -> Vec<Known<AutopilotDriver>> {
        let mavlink = Known {
            name: "mavlink",
            is_built: cfg!(feature = "net"),
            driver: AutopilotDriver::Mavlink(Box::default()),
        };
        vec![always("sim", AutopilotDriver::Simulated), mavlink]
    }

    fn name(&self) -> &'static str {
        match self {
            AutopilotDriver::Simulated => "sim",
            AutopilotDriver::Mavlink(_) => "mavlink",
        }
    }
}

impl DriverChoice for RadioDriver {
    fn all() -> Vec<Known<RadioDriver>> {
        let xbee = Known {
            name: "xbee",
            is_built: cfg!(feature = "hw"),
            driver: RadioDriver::Xbee(XbeePort::default()),
        };
        vec![always("sim", RadioDriver::Simulated), xbee]
    }

    fn name(&self) -> &'static str {
        match self {
            RadioDriver::Simulated => "sim",
            RadioDriver::Xbee(_) => "xbee",
        }
    }
}

/// The key `driver` of a device's table.
pub(super) struct DriverKey<'a, D>(pub(super) &'a mut D);

impl<D: DriverChoice> DriverKey<'_, D> {
    pub(super) fn show(&mut self, to: &mut dyn Keys) {
        to.form(
            self,
            KeyEntry {
                name: "driver",
                left_out: "needed",
                means: "what speaks with it",
            },
        );
    }
}

impl<D: DriverChoice> Form for DriverKey<'_, D> {
    fn to_toml(&self) -> Option<String> {
        Some(quoted(self.0.name()))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let all = D::all();
        let built: Vec<String> = all
            .iter()
            .filter(|known| known.is_built)
            .map(|known| quoted(known.name))
            .collect();
        let allowed = format!("driver = {} is allowed", built.join(" or "));
        section.require(key, &allowed);
        let Some(name) = section.text(key) else {
            return;
        };
        let known = all.into_iter().find(|known| known.name == name);
        match known {
            Some(known) if known.is_built => *self.0 = known.driver,
            Some(_) => section.refuse(key, NOT_BUILT, &allowed),
            None => section.refuse(key, "is not known", &allowed),
        }
    }

    fn allowed(&self) -> String {
        let names: Vec<&str> = D::all().iter().map(|known| known.name).collect();
        names.join(", ")
    }
}
