//! The table `[range]` of a vehicle: the driver of its range sensors, where they look, and the driver of a single one where the
//! kinds are mixed, the key `driver` of a `[[range.sensor]]` with the table of its name in it. Opens nothing.

use super::drivers::{DriverChoice, DriverKey, Known, NOT_BUILT};
use super::keys::{Form, KeyEntry, Keyed, Keys, quoted};
use super::range::SensorCoverage;
use super::range_driver::RangeDriver;
use super::section::Section;
use super::servo_driver::ServoDriver;

/// The table `[range]` of a vehicle.
pub(super) struct RangeTable<'a> {
    pub(super) driver: &'a mut RangeDriver,
    /// Of each sensor its own, if it has one.
    pub(super) own: &'a mut Vec<Option<RangeDriver>>,
    pub(super) servo: &'a ServoDriver,
    pub(super) look: &'a mut SensorCoverage,
}

impl Keyed for RangeTable<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        DriverKey(&mut *self.driver).show(to);
        self.driver.show_tables(to);
        let is_fixed = *self.servo == ServoDriver::None;
        let own = &mut *self.own;
        self.look.keys_with(is_fixed, to, &mut |sensor, index, to| {
            sensor.keys(to);
            show_own_driver(own, index, to);
        });
    }
}

/// Shows the driver of a sensor of its own, by the sensor's number.
fn show_own_driver(drivers: &mut Vec<Option<RangeDriver>>, sensor: usize, to: &mut dyn Keys) {
    if drivers.len() <= sensor {
        drivers.resize(sensor + 1, None);
    }
    let own = &mut drivers[sensor];
    let entry = KeyEntry {
        name: "driver",
        left_out: "that of `[range]`",
        means: "what speaks with this one, where the kinds are mixed; where and how far all look is said in `[range]`",
    };
    to.form(&mut OwnDriver(own), entry);
    let mut unused = RangeDriver::None;
    own.as_mut().unwrap_or(&mut unused).show_tables(to);
}

/// The key `driver` of one sensor.
struct OwnDriver<'a>(&'a mut Option<RangeDriver>);

/// Returns the drivers that a sensor may have of its own: those of real ones.
fn choices() -> impl Iterator<Item = Known<RangeDriver>> {
    let all = RangeDriver::all().into_iter();
    all.filter(|known| known.driver.is_real())
}

impl Form for OwnDriver<'_> {
    fn to_toml(&self) -> Option<String> {
        self.0.as_ref().map(|driver| quoted(driver.name()))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let Some(name) = section.text(key) else {
            return;
        };
        let known = choices().find(|known| known.name == name);
        let wrong = match &known {
            Some(known) if !known.is_built => NOT_BUILT,
            Some(_) => {
                *self.0 = known.map(|known| known.driver);
                return;
            }
            None => "is not known",
        };
        let built: Vec<String> = choices()
            .filter(|known| known.is_built)
            .map(|known| quoted(known.name))
            .collect();
        let allowed = match built.is_empty() {
            true => "none is built in".to_owned(),
            false => format!("driver = {} is allowed", built.join(" or ")),
        };
        section.refuse(key, wrong, &allowed);
    }

    fn allowed(&self) -> String {
        let names: Vec<&str> = choices().map(|known| known.name).collect();
        names.join(", ")
    }
}
