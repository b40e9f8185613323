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

/// What speaks with the devices of a vehicle.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Drivers {
    /// The autopilot.
    pub autopilot: AutopilotDriver,
    /// The servo of the range sensor.
    pub servo: ServoDriver,
    /// The range sensor.
    pub range: RangeDriver,
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
        radio: RadioDriver::Simulated,
    };

    /// Returns whether a device is simulated: then a world is needed.
    pub fn has_simulated(&self) -> bool {
        let Drivers {
            autopilot,
            servo,
            range,
            radio,
        } = self;
        *autopilot == AutopilotDriver::Simulated
            || *servo == ServoDriver::Simulated
            || *range == RangeDriver::Simulated
            || *radio == RadioDriver::Simulated
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
        let range = self.range.kind().map(Capability::RangeSensor);
        let mut all: Vec<Capability> = [Some(autopilot), range, servo, Some(radio)]
            .into_iter()
            .flatten()
            .collect();
        all.sort_unstable();
        all
    }

    /// Returns the drivers in words, for people.
    pub fn in_words(&self) -> String {
        let Drivers {
            autopilot,
            servo,
            range,
            radio,
        } = self;
        let connection = match autopilot {
            AutopilotDriver::Simulated => String::new(),
            AutopilotDriver::Mavlink(connection) => {
                format!(" at {}", connection.endpoint.in_words())
            }
        };
        let port = range
            .port()
            .map(|port| format!(" on {port}"))
            .unwrap_or_default();
        let radio_port = match radio {
            RadioDriver::Simulated => String::new(),
            RadioDriver::Xbee(xbee) => format!(" on {}", xbee.port),
        };
        let (autopilot, servo, range, radio) = (
            autopilot.name(),
            servo.in_words(),
            range.name(),
            radio.name(),
        );
        format!(
            "autopilot {autopilot}{connection}, range {range}{port}, servo {servo}, radio {radio}{radio_port}"
        )
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
        let has_link = matches!(self.autopilot, AutopilotDriver::Mavlink(_));
        if matches!(self.range, RangeDriver::Autopilot(_)) && !has_link {
            source.refuse(
                "range.driver",
                "hangs on an autopilot that is simulated, and says nothing",
                "[autopilot] driver = \"mavlink\" is needed with it",
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
        self.range.check(source, look);
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

/// A choice of drivers for a kind of device.
pub(super) trait DriverChoice: Sized {
    /// Names of drivers that later versions will have.
    const PLANNED: &'static [&'static str];

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
    const PLANNED: &'static [&'static str] = &[];

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
    const PLANNED: &'static [&'static str] = &[];

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
        let is_planned = known.is_some() || D::PLANNED.contains(&name.as_str());
        match known.filter(|known| known.is_built) {
            Some(known) => *self.0 = known.driver,
            None if is_planned => section.refuse(key, "is not built in", &allowed),
            None => section.refuse(key, "is not known", &allowed),
        }
    }

    fn allowed(&self) -> String {
        let names: Vec<&str> = D::all().iter().map(|known| known.name).collect();
        names.join(", ")
    }
}
