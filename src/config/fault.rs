//! What goes wrong in a simulation, when, and for whom. What a fault does is the simulator's business.

use toml::de::DeValue;
use tomoswarm_proto::VehicleId;

use super::keys::{
    Flag, Form, KeyEntry, Keys, Number, NumberBounds, WordChoice, Words, written_list,
};
use super::section::{Section, whole_of};
use super::source::Source;
use crate::time::Time;

/// A restart takes this long unless the file says otherwise, seconds.
const RESTART_S: f64 = 3.0;

/// What goes wrong.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum FaultKind {
    /// The node neither hears nor reaches anybody on the bus.
    Bus,
    /// The vehicle neither hears nor reaches anybody by radio.
    Radio,
    /// The node's software ends; a vehicle stands until it starts again.
    Restart,
    /// The node's software ends for good; a vehicle stands.
    Dead,
    /// The range sensor answers nothing.
    Sensor,
    /// The autopilot hears no satellites: the deviation of its place grows.
    Gps,
    /// The battery has this charge at once, 0 to 1.
    Battery(f64),
}

/// A fault of some nodes.
#[derive(Clone, PartialEq, Debug)]
pub struct FaultSpec {
    /// When it begins.
    pub from: Time,
    /// When it is over; [`Time::NEVER`] = not before the end.
    pub until: Time,
    /// What goes wrong.
    pub kind: FaultKind,
    /// For which vehicles, ascending.
    pub vehicles: Vec<VehicleId>,
    /// Whether for the ground station.
    pub ground: bool,
}

impl FaultSpec {
    /// Returns whether it is there for a vehicle at a moment (from `from` on, before `until`).
    pub fn hits(&self, now: Time, vehicle: VehicleId) -> bool {
        self.from <= now && now < self.until && self.vehicles.contains(&vehicle)
    }
}

/// The words for what goes wrong.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum FaultWord {
    /// No bus.
    #[default]
    Bus,
    /// No radio.
    Radio,
    /// The software ends and starts again.
    Restart,
    /// The software ends for good.
    Dead,
    /// No range sensor.
    Sensor,
    /// No satellites.
    Gps,
    /// A charge at once.
    Battery,
}

impl WordChoice for FaultWord {
    const WORDS: &'static [(&'static str, FaultWord)] = &[
        ("bus", FaultWord::Bus),
        ("radio", FaultWord::Radio),
        ("restart", FaultWord::Restart),
        ("dead", FaultWord::Dead),
        ("sensor", FaultWord::Sensor),
        ("gps", FaultWord::Gps),
        ("battery", FaultWord::Battery),
    ];
}

/// A fault as it is written.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct PlannedFault {
    /// What goes wrong.
    pub kind: FaultWord,
    /// The charge that a battery has at once, 0 to 1.
    pub charge: f64,
    /// When it begins, seconds.
    pub at_s: f64,
    /// When it is over, seconds; `None` = not before the end.
    pub until_s: Option<f64>,
    /// For which vehicles, ascending.
    pub vehicles: Vec<VehicleId>,
    /// Whether for the ground station.
    pub ground: bool,
}

impl PlannedFault {
    /// Returns it in the run's time.
    pub fn fault(&self) -> FaultSpec {
        let kind = match self.kind {
            FaultWord::Bus => FaultKind::Bus,
            FaultWord::Radio => FaultKind::Radio,
            FaultWord::Restart => FaultKind::Restart,
            FaultWord::Dead => FaultKind::Dead,
            FaultWord::Sensor => FaultKind::Sensor,
            FaultWord::Gps => FaultKind::Gps,
            FaultWord::Battery => FaultKind::Battery(self.charge),
        };
        let until = self.until_s.map_or(Time::NEVER, Time::from_secs_f64);
        let from = Time::from_secs_f64(self.at_s);
        FaultSpec {
            from,
            until,
            kind,
            vehicles: self.vehicles.clone(),
            ground: self.ground,
        }
    }

    /// Shows the keys of a fault in a simulation of so many vehicles.
    pub(super) fn keys(&mut self, vehicles: usize, to: &mut dyn Keys) {
        let PlannedFault {
            kind,
            charge,
            at_s,
            until_s,
            vehicles: whom,
            ground,
        } = self;
        let means = "`bus`, `radio`: hears and reaches nobody; `sensor`: no readings; `gps`: the deviation of the \
                     place grows; `restart`: the software ends, and starts again at until_s; `dead`: it ends for good; \
                     `battery`: has another charge at once, `charge` (0 to 1, left out 0.1)";
        to.word(
            kind,
            Words {
                name: "kind",
                default: "",
                means,
            },
        );
        if *kind == FaultWord::Battery {
            let means = "charge of the battery from then on; for `battery` only";
            to.number(
                charge,
                Number {
                    name: "charge",
                    default: 0.1,
                    allowed: 0.0..=1.0,
                    means,
                },
            );
        }
        // A restart at the last moment is still over.
        let moment = |name, left_out, means, most| NumberBounds {
            name,
            left_out,
            allowed: 0.0..=most,
            means,
        };
        to.needed_number(at_s, moment("at_s", "needed", "when it begins", 1e6));
        to.maybe_number(
            until_s,
            moment(
                "until_s",
                "for good",
                "when it is over; a `restart` takes 3 s by itself",
                2e6,
            ),
        );
        let means = "whether it hits the ground station; for `bus`, `restart` and `dead` only";
        to.flag(
            ground,
            Flag {
                name: "ground",
                default: false,
                means,
            },
        );
        let means =
            "list of those that it hits, such as [1, 2]; left out beside `ground = true`: none";
        let whom = &mut Whom {
            whom,
            vehicles,
            all: !*ground,
        };
        to.form(
            whom,
            KeyEntry {
                name: "vehicles",
                left_out: "all",
                means,
            },
        );
    }

    /// Checks its keys together; `key` is its full name. What depends on others is filled in.
    pub(super) fn check(&mut self, source: &Source<'_>, key: &str) {
        let until = format!("{key}.until_s");
        if source.is_known(&format!("{key}.at_s"))
            && self.until_s.is_some_and(|until_s| until_s <= self.at_s)
        {
            source.refuse(&until, "is not after at_s", "a fault must last some time");
        }
        if self.until_s.is_some() && matches!(self.kind, FaultWord::Dead | FaultWord::Battery) {
            source.refuse(&until, "has no effect for this kind", "it must be left out");
        }
        if self.ground
            && !matches!(
                self.kind,
                FaultWord::Bus | FaultWord::Restart | FaultWord::Dead
            )
        {
            let rule = "it must be left out, or the kind be bus, restart or dead";
            source.refuse(
                &format!("{key}.ground"),
                "has no effect for this kind",
                rule,
            );
        }
        if self.kind == FaultWord::Restart {
            self.until_s.get_or_insert(self.at_s + RESTART_S);
        }
    }
}

/// The vehicles that a fault hits.
struct Whom<'a> {
    whom: &'a mut Vec<VehicleId>,
    vehicles: usize,
    /// Whether it hits all of them when nothing is said.
    all: bool,
}

impl Form for Whom<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(written_list(self.whom.iter().map(ToString::to_string)))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        *self.whom = match section.has(key) || self.all {
            true => read_vehicles(section, key, self.vehicles),
            false => Vec::new(),
        };
    }
}

/// Reads whom it hits; all when that is left out.
fn read_vehicles(section: &Section<'_>, key: &'static str, count: usize) -> Vec<VehicleId> {
    let id = |number: usize| u8::try_from(number).ok().map(VehicleId);
    if !section.has(key) {
        return (1..=count).filter_map(id).collect();
    }
    let one = |value: &DeValue| {
        whole_of(value)
            .filter(|number| (1..=count).contains(number))
            .and_then(id)
    };
    let list = section.list(key).unwrap_or_default();
    let vehicles: Option<Vec<VehicleId>> = list.iter().map(|entry| one(entry.get_ref())).collect();
    let Some(mut vehicles) = vehicles.filter(|vehicles| !vehicles.is_empty()) else {
        let rule = format!("a list of vehicles, each from 1 to {count}, is allowed");
        section.refuse(key, "is no such list", &rule);
        return Vec::new();
    };
    vehicles.sort();
    vehicles.dedup();
    vehicles
}
