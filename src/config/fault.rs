//! What goes wrong in a simulation, when, and for whom. What a fault does is the simulator's business.

use toml::de::DeValue;
use tomoswarm_proto::VehicleId;

use super::section::{Section, whole_of};
use crate::time::Time;

/// A restart takes this long unless the file says otherwise, seconds.
const RESTART_S: f64 = 3.0;

/// What goes wrong.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum FaultKind {
    /// The vehicle neither hears nor reaches anybody on the bus.
    Bus,
    /// The vehicle neither hears nor reaches anybody by radio.
    Radio,
    /// The vehicle's software ends; it stands until it starts again.
    Restart,
    /// The vehicle's software ends for good; it stands.
    Dead,
    /// The range sensor answers nothing.
    Sensor,
    /// The autopilot hears no satellites: the deviation of its place grows.
    Gps,
    /// The battery has this charge at once, 0 to 1.
    Battery(f64),
}

/// A fault of some vehicles.
#[derive(Clone, PartialEq, Debug)]
pub struct Fault {
    /// When it begins.
    pub from: Time,
    /// When it is over; [`Time::NEVER`] = not before the end.
    pub until: Time,
    /// What goes wrong.
    pub kind: FaultKind,
    /// For whom, ascending.
    pub vehicles: Vec<VehicleId>,
}

impl Fault {
    /// Tells whether it is there for a vehicle at a moment (from `from` on, before `until`).
    pub fn hits(&self, now: Time, vehicle: VehicleId) -> bool {
        self.from <= now && now < self.until && self.vehicles.contains(&vehicle)
    }

    pub(super) fn read(section: &Section, vehicles: usize) -> Fault {
        let kind = read_kind(section);
        let at_s = section.required_number("at_s", 0.0..=1e6);
        let until_s = section.optional_number("until_s", 0.0..=1e6);
        if section.has("at_s") && until_s.is_some_and(|until_s| until_s <= at_s) {
            section.refuse("until_s", "is not after at_s", "a fault must last some time");
        }
        if until_s.is_some() && matches!(kind, FaultKind::Dead | FaultKind::Battery(_)) {
            section.refuse("until_s", "has no effect for this kind", "it must be left out");
        }
        let until_s = until_s.or_else(|| (kind == FaultKind::Restart).then_some(at_s + RESTART_S));
        let vehicles = read_vehicles(section, vehicles);
        section.finish();
        let until = until_s.map_or(Time::NEVER, Time::from_secs_f64);
        Fault { from: Time::from_secs_f64(at_s), until, kind, vehicles }
    }
}

fn read_kind(section: &Section) -> FaultKind {
    let kinds = [
        ("bus", FaultKind::Bus),
        ("radio", FaultKind::Radio),
        ("restart", FaultKind::Restart),
        ("dead", FaultKind::Dead),
        ("sensor", FaultKind::Sensor),
        ("gps", FaultKind::Gps),
        ("battery", FaultKind::Battery(0.0)),
    ];
    let names: Vec<&str> = kinds.iter().map(|(name, _)| *name).collect();
    section.require("kind", &format!("one of {} is needed", names.join(", ")));
    let kind = section.choice("kind", FaultKind::Bus, &kinds);
    match kind {
        FaultKind::Battery(_) => FaultKind::Battery(section.number("charge", 0.1, 0.0..=1.0)),
        FaultKind::Bus
        | FaultKind::Radio
        | FaultKind::Restart
        | FaultKind::Dead
        | FaultKind::Sensor
        | FaultKind::Gps => kind,
    }
}

/// Reads whom it hits; all when that is left out.
fn read_vehicles(section: &Section, count: usize) -> Vec<VehicleId> {
    let id = |number: usize| u8::try_from(number).ok().map(VehicleId);
    if !section.has("vehicles") {
        return (1..=count).filter_map(id).collect();
    }
    let one = |value: &DeValue| whole_of(value).filter(|number| (1..=count).contains(number)).and_then(id);
    let list = section.list("vehicles").unwrap_or_default();
    let vehicles: Option<Vec<VehicleId>> = list.iter().map(|entry| one(entry.get_ref())).collect();
    let Some(mut vehicles) = vehicles.filter(|vehicles| !vehicles.is_empty()) else {
        let rule = format!("a list of vehicles, each from 1 to {count}, is allowed");
        section.refuse("vehicles", "is no such list", &rule);
        return Vec::new();
    };
    vehicles.sort();
    vehicles.dedup();
    vehicles
}
