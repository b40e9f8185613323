//! The simulated radio field and the simulated bus between the nodes.

use std::time::Duration;

use toml::de::DeValue;
use tomoswarm_proto::{Sender, VehicleId};

use super::bus_file::EGRESS;
use super::keys::{Form, KeyEntry, Keyed, Keys, List, Number, NumberBounds, Rowed, written_list};
use super::section::{Section, whole_of};
use super::source::Source;
use super::swarm::Swarm;
use crate::time::Time;

/// Constants of the simulated radio: RSSI = P0 + power − 10 n log10 d − attenuation + fading + noise.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Radio {
    /// What a vehicle sets of it.
    pub own: OwnRadio,
    /// Carrier frequency, Hz.
    pub frequency_hz: f64,
    /// Received power at 1 m for a transmit power of 0 dBm, dBm.
    pub p0_dbm: f64,
    /// Path-loss exponent n.
    pub exponent: f64,
    /// Rician factor K of the static fading, linear (0 = Rayleigh).
    pub rician_k: f64,
    /// Standard deviation of a packet around the link's mean, dB.
    pub packet_sd_db: f64,
    /// Standard deviation from device to device, of what one sends and of what one reports, dB.
    pub device_sd_db: f64,
    /// How well a receiver hears.
    pub reception: Reception,
    /// Width of the packet-error curve around the sensitivity, dB.
    pub sensitivity_slope_db: f64,
    /// Attenuation at which one object saturates, since energy leaks around it, dB.
    pub object_limit_db: f64,
}

/// How well a receiver hears.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Reception {
    /// RSSI at which half of all packets are lost, the weakest that are heard, dBm.
    pub sensitivity_dbm: f64,
}

impl Keyed for Reception {
    fn keys(&mut self, to: &mut dyn Keys) {
        let Reception { sensitivity_dbm } = self;
        to.number(
            sensitivity_dbm,
            Number {
                name: "sensitivity_dbm",
                default: -100.0,
                allowed: -150.0..=-20.0,
                means: "strength at which half of the packets are lost",
            },
        );
    }
}

/// What a vehicle sets of its own radio, simulated or real; slot and channel are the swarm's.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct OwnRadio {
    /// Transmit power, dBm; beacons report it.
    pub power_dbm: i8,
}

impl Keyed for OwnRadio {
    fn keys(&mut self, to: &mut dyn Keys) {
        let OwnRadio { power_dbm } = self;
        let means = "transmit power, a whole number; beacons report it. Of an XBee that of its level (XBee 3 and S2C: -5, -1, 2, 5 or 8)";
        to.form(
            &mut Power(power_dbm),
            KeyEntry {
                name: "power_dbm",
                left_out: "0",
                means,
            },
        );
    }
}

/// A transmit power in whole dBm.
struct Power<'a>(&'a mut i8);

impl Form for Power<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(self.0.to_string())
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let power_dbm = section.number(key, 0.0, -40.0..=30.0);
        *self.0 = libm::round(power_dbm) as i8;
        if f64::from(*self.0) != power_dbm {
            section.refuse(key, "is no whole number", "beacons report whole dBm");
        }
    }
}

impl Radio {
    /// Returns the wavelength, metres.
    pub fn wavelength_m(&self) -> f64 {
        299_792_458.0 / self.frequency_hz
    }
}

/// The table `[radio]` of a simulation, which may say what its venue does.
pub(super) struct RadioTable<'a> {
    pub(super) radio: &'a mut Radio,
    pub(super) swarm: &'a mut Swarm,
}

impl Keyed for RadioTable<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        let Radio {
            own,
            frequency_hz,
            p0_dbm,
            exponent,
            rician_k,
            packet_sd_db,
            device_sd_db,
            reception,
            sensitivity_slope_db,
            object_limit_db,
        } = &mut *self.radio;
        self.swarm.channel_key(to);
        own.keys(to);
        self.swarm.slot_keys(to);
        to.number(
            frequency_hz,
            Number::new("frequency_hz", 2.4e9, 1e8..=1e10, "carrier"),
        );
        let means = "received at 1 m for a transmit power of 0 dBm";
        to.number(p0_dbm, Number::new("p0_dbm", -40.0, -90.0..=20.0, means));
        to.number(
            exponent,
            Number::new("exponent", 2.0, 1.0..=6.0, "path-loss exponent"),
        );
        let means = "Rician factor of the static fading, linear; 0 is Rayleigh";
        to.number(rician_k, Number::new("rician_k", 8.0, 0.0..=1e6, means));
        let means = "standard deviation of a packet around the link's mean";
        to.number(
            packet_sd_db,
            Number::new("packet_sd_db", 2.0, 0.0..=20.0, means),
        );
        let means = "standard deviation from vehicle to vehicle, of what its radio sends and of what it reports";
        to.number(
            device_sd_db,
            Number::new("device_sd_db", 0.0, 0.0..=10.0, means),
        );
        reception.keys(to);
        let means = "width of the packet-error curve around sensitivity_dbm";
        to.number(
            sensitivity_slope_db,
            Number::new("sensitivity_slope_db", 2.0, 0.01..=20.0, means),
        );
        let means = "attenuation at which one object saturates, since energy leaks around it";
        to.number(
            object_limit_db,
            Number::new("object_limit_db", 30.0, 1.0..=200.0, means),
        );
    }
}

/// A time during which the bus is cut into pieces.
#[derive(Clone, PartialEq, Debug)]
pub struct Partition {
    /// When it begins.
    pub from: Time,
    /// When it is over.
    pub until: Time,
    /// The pieces; nodes in different ones do not hear each other. Nodes in none are one more piece.
    pub sides: Vec<Vec<Sender>>,
}

impl Partition {
    /// Returns whether nothing goes between two nodes at a moment (from `from` on, before `until`).
    pub fn cuts(&self, now: Time, a: Sender, b: Sender) -> bool {
        let side_of = |node| self.sides.iter().position(|side| side.contains(&node));
        side_of(a) != side_of(b) && self.from <= now && now < self.until
    }
}

/// A partition as it is written.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct PlannedPartition {
    /// When it begins, seconds.
    pub from_s: f64,
    /// When it is over, seconds.
    pub until_s: f64,
    /// The pieces, as in [`Partition`].
    pub sides: Vec<Vec<Sender>>,
}

impl PlannedPartition {
    /// Returns it in the run's time.
    pub fn partition(&self) -> Partition {
        let (from, until) = (
            Time::from_secs_f64(self.from_s),
            Time::from_secs_f64(self.until_s),
        );
        Partition {
            from,
            until,
            sides: self.sides.clone(),
        }
    }

    fn keys(&mut self, vehicles: usize, to: &mut dyn Keys) {
        let PlannedPartition {
            from_s,
            until_s,
            sides,
        } = self;
        let moment = |name, means| NumberBounds {
            name,
            left_out: "needed",
            allowed: 0.0..=1e6,
            means,
        };
        to.needed_number(from_s, moment("from_s", "when it begins"));
        to.needed_number(until_s, moment("until_s", "when it is over"));
        to.form(
            &mut Sides { sides, vehicles },
            KeyEntry {
                name: "sides",
                left_out: "needed",
                means: "lists of nodes such as `[[\"ground\"], [1, 2]]`; nodes on no side are one more side",
            },
        );
    }
}

/// The simulated bus and its faults.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Bus {
    /// Time from sending to arrival, milliseconds.
    pub delay_ms: f64,
    /// What is added to it at most, drawn for each message, milliseconds.
    pub jitter_ms: f64,
    /// Share of messages that are lost, 0 to 1.
    pub drop_share: f64,
    /// Share of messages that come twice, 0 to 1.
    pub duplicate_share: f64,
    /// The most that a node sends, kilobytes (1000 bytes) per second.
    pub egress_kb_per_s: f64,
    /// Times during which the bus is cut.
    pub partitions: Vec<PlannedPartition>,
}

impl Bus {
    /// Returns the time from sending to arrival.
    pub fn delay(&self) -> Duration {
        Time::from_secs_f64(self.delay_ms * 1e-3).since(Time::ZERO)
    }

    /// Returns what is added to the delay at most.
    pub fn jitter(&self) -> Duration {
        Time::from_secs_f64(self.jitter_ms * 1e-3).since(Time::ZERO)
    }

    /// Returns the most that a node sends, bytes per second.
    pub fn egress_bytes_per_s(&self) -> u32 {
        (self.egress_kb_per_s * 1e3) as u32
    }

    /// Checks the keys of its partitions together.
    pub(super) fn check(&self, source: &Source<'_>) {
        for (
            index,
            PlannedPartition {
                from_s,
                until_s,
                sides: _,
            },
        ) in self.partitions.iter().enumerate()
        {
            let key = |name: &str| format!("bus.partition[{index}].{name}");
            let are_known = source.is_known(&key("from_s")) && source.is_known(&key("until_s"));
            if are_known && until_s <= from_s {
                source.refuse(
                    &key("until_s"),
                    "is not after from_s",
                    "a partition must last some time",
                );
            }
        }
    }
}

/// The table `[bus]` of a simulation of so many vehicles.
pub(super) struct BusTable<'a> {
    pub(super) bus: &'a mut Bus,
    pub(super) vehicles: usize,
}

impl Keyed for BusTable<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        let Bus {
            delay_ms,
            jitter_ms,
            drop_share,
            duplicate_share,
            egress_kb_per_s,
            partitions,
        } = &mut *self.bus;
        let vehicles = self.vehicles;
        to.number(
            delay_ms,
            Number::new("delay_ms", 20.0, 0.01..=60_000.0, "from sending to arrival"),
        );
        let means = "what is added to it at most, drawn for each message";
        to.number(
            jitter_ms,
            Number::new("jitter_ms", 10.0, 0.0..=60_000.0, means),
        );
        to.number(
            drop_share,
            Number::new(
                "drop_share",
                0.0,
                0.0..=0.99,
                "share of the messages that are lost",
            ),
        );
        let means = "share of the messages that come twice";
        to.number(
            duplicate_share,
            Number::new("duplicate_share", 0.0, 0.0..=1.0, means),
        );
        to.number(egress_kb_per_s, EGRESS);
        let keys = |row: &mut PlannedPartition, _, to: &mut dyn Keys| row.keys(vehicles, to);
        let means = "times during which the bus is cut";
        to.rows(
            &mut List {
                list: partitions,
                keys,
            },
            Rowed {
                name: "partition",
                most: 1000,
                means,
            },
        );
    }
}

/// The pieces of a bus that is cut.
struct Sides<'a> {
    sides: &'a mut Vec<Vec<Sender>>,
    vehicles: usize,
}

impl Form for Sides<'_> {
    fn to_toml(&self) -> Option<String> {
        let node = |node: &Sender| match node {
            Sender::Vehicle(id) => id.to_string(),
            Sender::Ground => "\"ground\"".to_owned(),
            Sender::Operator(_) => "\"operator\"".to_owned(),
        };
        Some(written_list(
            self.sides
                .iter()
                .map(|side| written_list(side.iter().map(node))),
        ))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        *self.sides = read_sides(section, key, self.vehicles);
    }
}

fn read_sides(section: &Section<'_>, key: &'static str, vehicles: usize) -> Vec<Vec<Sender>> {
    let rule = format!(
        "lists of nodes are needed, such as [[\"ground\"], [1, 2]]; vehicles are 1 to {vehicles}"
    );
    section.require(key, &rule);
    if !section.has(key) {
        return Vec::new();
    }
    let sides: Option<Vec<Vec<Sender>>> = section.list(key).and_then(|list| {
        let side = |entry: &DeValue| {
            let nodes = entry.as_array()?;
            nodes
                .iter()
                .map(|node| node_of(node.get_ref(), vehicles))
                .collect()
        };
        list.iter().map(|entry| side(entry.get_ref())).collect()
    });
    let Some(sides) =
        sides.filter(|sides| !sides.is_empty() && sides.iter().all(|side| !side.is_empty()))
    else {
        section.refuse(key, "is no such list", &rule);
        return Vec::new();
    };
    let mut nodes: Vec<Sender> = sides.concat();
    nodes.sort();
    if nodes.windows(2).any(|pair| pair[0] == pair[1]) {
        section.refuse(key, "names a node twice", "a node is on one side");
    }
    sides
}

fn node_of(value: &DeValue, vehicles: usize) -> Option<Sender> {
    if value.as_str() == Some("ground") {
        return Some(Sender::Ground);
    }
    let number = whole_of(value).filter(|number| (1..=vehicles).contains(number))?;
    u8::try_from(number)
        .ok()
        .map(|id| Sender::Vehicle(VehicleId(id)))
}
