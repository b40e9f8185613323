//! The simulated radio field and the simulated bus between the nodes.

use std::time::Duration;

use toml::de::DeValue;
use tomoswarm_proto::{Sender, VehicleId};

use super::section::{Section, whole_of};
use crate::time::Time;

/// Constants of the simulated radio: RSSI = P0 + power − 10 n log10 d − attenuation + fading + noise.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Radio {
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
    /// RSSI at which half of all packets are lost, dBm.
    pub sensitivity_dbm: f64,
    /// Width of the packet-error curve around the sensitivity, dB.
    pub sensitivity_slope_db: f64,
    /// Attenuation at which one object saturates, since energy leaks around it, dB.
    pub object_limit_db: f64,
    /// Slot T of the beacon ring.
    pub slot: Duration,
    /// Channel number, part of the fading.
    pub channel: u8,
    /// Transmit power, dBm; beacons report it.
    pub power_dbm: i8,
}

/// What a vehicle sets of its own radio, simulated or real.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct OwnRadio {
    /// Channel number.
    pub channel: u8,
    /// Transmit power, dBm; beacons report it.
    pub power_dbm: i8,
    /// Slot T of the beacon ring.
    pub slot: Duration,
}

impl OwnRadio {
    /// Reads its keys out of a table that may hold others.
    pub(super) fn read_keys(section: &Section) -> OwnRadio {
        let channel = section.whole("channel", 15, 11..=26);
        let power_dbm = section.number("power_dbm", 0.0, -40.0..=30.0);
        let own = OwnRadio {
            channel: u8::try_from(channel).unwrap_or(u8::MAX),
            power_dbm: libm::round(power_dbm) as i8,
            slot: section.duration_ms("slot_ms", 50.0, 1.0..=5000.0),
        };
        if f64::from(own.power_dbm) != power_dbm {
            section.refuse("power_dbm", "is no whole number", "beacons report whole dBm");
        }
        own
    }
}

/// Reads the weakest packet that a receiver hears, dBm.
pub(super) fn read_sensitivity_dbm(section: &Section) -> f64 {
    section.number("sensitivity_dbm", -100.0, -150.0..=-20.0)
}

impl Radio {
    pub(super) fn read(section: &Section) -> Radio {
        let own = OwnRadio::read_keys(section);
        let radio = Radio {
            frequency_hz: section.number("frequency_hz", 2.4e9, 1e8..=1e10),
            p0_dbm: section.number("p0_dbm", -40.0, -90.0..=20.0),
            exponent: section.number("exponent", 2.0, 1.0..=6.0),
            rician_k: section.number("rician_k", 8.0, 0.0..=1e6),
            packet_sd_db: section.number("packet_sd_db", 2.0, 0.0..=20.0),
            sensitivity_dbm: read_sensitivity_dbm(section),
            sensitivity_slope_db: section.number("sensitivity_slope_db", 2.0, 0.01..=20.0),
            object_limit_db: section.number("object_limit_db", 30.0, 1.0..=200.0),
            slot: own.slot,
            channel: own.channel,
            power_dbm: own.power_dbm,
        };
        section.finish();
        radio
    }

    /// Gives what a vehicle sets of its own radio.
    pub fn own(&self) -> OwnRadio {
        OwnRadio { channel: self.channel, power_dbm: self.power_dbm, slot: self.slot }
    }

    /// Gives the wavelength, metres.
    pub fn wavelength_m(&self) -> f64 {
        299_792_458.0 / self.frequency_hz
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
    /// Tells whether nothing goes between two nodes at a moment (from `from` on, before `until`).
    pub fn cuts(&self, now: Time, a: Sender, b: Sender) -> bool {
        let side_of = |node| self.sides.iter().position(|side| side.contains(&node));
        side_of(a) != side_of(b) && self.from <= now && now < self.until
    }
}

/// The simulated bus and its faults.
#[derive(Clone, PartialEq, Debug)]
pub struct Bus {
    /// Time from sending to arrival.
    pub delay: Duration,
    /// What is added to it at most, drawn for each message.
    pub jitter: Duration,
    /// Share of messages that are lost, 0 to 1.
    pub drop_share: f64,
    /// Share of messages that come twice, 0 to 1.
    pub duplicate_share: f64,
    /// Times during which the bus is cut.
    pub partitions: Vec<Partition>,
}

impl Bus {
    pub(super) fn read(section: &Section, vehicles: usize) -> Bus {
        let bus = Bus {
            delay: section.duration_ms("delay_ms", 20.0, 0.01..=60_000.0),
            jitter: section.duration_ms("jitter_ms", 10.0, 0.0..=60_000.0),
            drop_share: section.number("drop_share", 0.0, 0.0..=0.99),
            duplicate_share: section.number("duplicate_share", 0.0, 0.0..=1.0),
            partitions: section
                .sections("partition", 1000)
                .iter()
                .map(|partition| read_partition(partition, vehicles))
                .collect(),
        };
        section.finish();
        bus
    }
}

fn read_partition(section: &Section, vehicles: usize) -> Partition {
    let seconds = 0.0..=1e6;
    let from_s = section.required_number("from_s", seconds.clone());
    let until_s = section.required_number("until_s", seconds);
    if section.has("from_s") && section.has("until_s") && until_s <= from_s {
        section.refuse("until_s", "is not after from_s", "a partition must last some time");
    }
    let sides = read_sides(section, vehicles);
    section.finish();
    Partition { from: Time::from_secs_f64(from_s), until: Time::from_secs_f64(until_s), sides }
}

fn read_sides(section: &Section, vehicles: usize) -> Vec<Vec<Sender>> {
    let rule =
        format!("lists of nodes are needed, such as [[\"ground\"], [1, 2]]; vehicles are 1 to {vehicles}");
    section.require("sides", &rule);
    if !section.has("sides") {
        return Vec::new();
    }
    let sides: Option<Vec<Vec<Sender>>> = section.list("sides").and_then(|list| {
        let side = |entry: &DeValue| {
            let nodes = entry.as_array()?;
            nodes.iter().map(|node| node_of(node.get_ref(), vehicles)).collect()
        };
        list.iter().map(|entry| side(entry.get_ref())).collect()
    });
    let Some(sides) = sides.filter(|sides| !sides.is_empty() && sides.iter().all(|side| !side.is_empty()))
    else {
        section.refuse("sides", "is no such list", &rule);
        return Vec::new();
    };
    let mut nodes: Vec<Sender> = sides.concat();
    nodes.sort();
    if nodes.windows(2).any(|pair| pair[0] == pair[1]) {
        section.refuse("sides", "names a node twice", "a node is on one side");
    }
    sides
}

fn node_of(value: &DeValue, vehicles: usize) -> Option<Sender> {
    if value.as_str() == Some("ground") {
        return Some(Sender::Ground);
    }
    let number = whole_of(value).filter(|number| (1..=vehicles).contains(number))?;
    u8::try_from(number).ok().map(|id| Sender::Vehicle(VehicleId(id)))
}
