//! What the registers of a module must say for it to carry beacons, and in what it differs. Reads and writes none of them:
//! see `reads`, `xbee_modem` and `xbee_setup`.

mod reads;

use std::collections::BTreeMap;
use std::fmt;

use tomoswarm_proto::VehicleId;

pub use self::reads::{Answer, ReadState, RegisterReads, command};
use super::xbee_frame::{ApiMode, AtName};
use crate::config::Venue;

/// Firmware version.
pub const VR: AtName = AtName(*b"VR");
/// Hardware version; its upper byte says which module it is.
pub const HV: AtName = AtName(*b"HV");
/// Serial number, upper half.
pub const SH: AtName = AtName(*b"SH");
/// Serial number, lower half.
pub const SL: AtName = AtName(*b"SL");
/// API mode.
pub const AP: AtName = AtName(*b"AP");
/// Its own address.
pub const MY: AtName = AtName(*b"MY");
/// The network: modules of another one are not heard.
pub const ID: AtName = AtName(*b"ID");
/// Radio channel.
pub const CH: AtName = AtName(*b"CH");
/// Power level, 0 to 4.
pub const PL: AtName = AtName(*b"PL");
/// Transmit power, dBm, in two's complement; not known to all modules.
pub const PP: AtName = AtName(*b"PP");
/// The most bytes of a packet; not known to old firmware.
pub const NP: AtName = AtName(*b"NP");
/// Which frames say what was heard: 2 = with the strength; not known to an S1, which always says it.
pub const AO: AtName = AtName(*b"AO");

/// MAC mode: with or without the maker's two bytes before each payload. Modules of two kinds do not understand each other; not
/// known to old firmware, which always has them.
pub const MM: AtName = AtName(*b"MM");

/// Whether it encrypts what it says; if so, it hears no module that does not.
pub const EE: AtName = AtName(*b"EE");
/// Baud rate, as the index of one of [`crate::config::XBEE_BAUDS`].
pub const BD: AtName = AtName(*b"BD");
/// What is read before a module is used, in this order: the mode says how the rest is framed.
pub const READ: [AtName; 14] = [AP, VR, HV, SH, SL, MY, ID, CH, PL, PP, NP, AO, MM, EE];
/// A module that does not know these is none of those that carry beacons.
const NEEDED: [AtName; 6] = [AP, VR, HV, MY, ID, CH];

/// These are shown and not compared.
const SHOWN_ONLY: [AtName; 2] = [SH, SL];

/// The network is not this one: it is that of all modules (Digi 90000982, `ID`).
const ALL_NETWORKS: u16 = 0xFFFF;
/// The most bytes of a packet where a module does not say so.
const PAYLOAD_UNTOLD: usize = 100;
/// No 802.15.4 firmware carries more in a packet; what says more is something else.
const PAYLOAD_MOST: usize = 116;
/// A packet of fewer bytes carries no beacon.
const PAYLOAD_LEAST: usize = 60;

/// Returns the network of a venue, so that two swarms do not hear each other.
pub fn network_of(venue_hash: u64) -> u16 {
    match (venue_hash & 0xFFFF) as u16 {
        ALL_NETWORKS => ALL_NETWORKS - 1,
        network => network,
    }
}

/// What a module is to be set to.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ModuleSettings {
    /// Whose module it is; its address.
    pub vehicle: VehicleId,
    /// The network ([`network_of`] the venue).
    pub network: u16,
    /// Radio channel, 11 to 26.
    pub channel: u8,
    /// Transmit power, dBm.
    pub power_dbm: i8,
    /// How its frames are marked.
    pub mode: ApiMode,
}

impl ModuleSettings {
    /// Returns what the module of a vehicle is to be in a venue, whose channel it has, and whose network.
    pub fn of_venue(vehicle: VehicleId, venue: &Venue, power_dbm: i8) -> ModuleSettings {
        ModuleSettings {
            vehicle,
            network: network_of(venue.hash()),
            channel: u8::try_from(venue.swarm.channel).unwrap_or(u8::MAX),
            power_dbm,
            mode: ApiMode::Escaped,
        }
    }

    /// Returns the address of its module.
    pub fn address(&self) -> u16 {
        u16::from(self.vehicle.0)
    }
}

/// The modules that carry beacons, as their hardware version tells them apart.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ModuleKind {
    /// XBee 802.15.4, the first series.
    S1,
    /// The same with more power.
    S1Pro,
    /// XBee S2C.
    S2c,
    /// The same with more power.
    S2cPro,
    /// XBee 3, which says its power itself: with and without more of it they are told apart by nothing else.
    Xbee3,
}

impl ModuleKind {
    /// Returns the kind of a hardware version; `None` = it carries no beacons.
    pub fn of_hardware(version: u32) -> Option<ModuleKind> {
        match version >> 8 {
            0x17 => Some(ModuleKind::S1),
            0x18 => Some(ModuleKind::S1Pro),
            0x22 | 0x2E => Some(ModuleKind::S2c),
            0x21 | 0x2D | 0x30 => Some(ModuleKind::S2cPro),
            0x41..=0x43 | 0x52 => Some(ModuleKind::Xbee3),
            _ => None,
        }
    }

    /// Returns whether a firmware version is one of 802.15.4: Zigbee and DigiMesh carry no ring of beacons.
    pub fn is_802_15_4(self, firmware: u32) -> bool {
        match self {
            ModuleKind::S1 | ModuleKind::S1Pro => firmware >> 12 != 8,
            ModuleKind::S2c | ModuleKind::S2cPro | ModuleKind::Xbee3 => firmware >> 12 == 2,
        }
    }

    /// Returns the power of each level, dBm (`PL` in the manuals of each).
    pub fn powers_dbm(self) -> [i8; 5] {
        match self {
            ModuleKind::S1 => [-10, -6, -4, -2, 0],
            ModuleKind::S1Pro => [10, 12, 14, 16, 18],
            ModuleKind::S2c | ModuleKind::Xbee3 => [-5, -1, 2, 5, 8],
            ModuleKind::S2cPro => [0, 12, 14, 16, 18],
        }
    }
}

/// What a module says of a register.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RegisterAnswer {
    /// Its value.
    Value(u32),
    /// The module does not have it.
    NotKnown,
    /// Neither: the answer has this status and no value, as often as it was asked for.
    Failed(u8),
}

/// The registers of a module as it has said them.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Registers(BTreeMap<AtName, RegisterAnswer>);

impl Registers {
    /// Notes an answer.
    pub fn note(&mut self, name: AtName, answer: RegisterAnswer) {
        self.0.insert(name, answer);
    }

    /// Returns what the module says of a register; `None` = not asked.
    pub fn answer(&self, name: AtName) -> Option<RegisterAnswer> {
        self.0.get(&name).copied()
    }

    /// Returns a register's value; `None` = not known, not told, or not asked.
    pub fn get(&self, name: AtName) -> Option<u32> {
        match self.answer(name)? {
            RegisterAnswer::Value(value) => Some(value),
            RegisterAnswer::NotKnown | RegisterAnswer::Failed(_) => None,
        }
    }

    /// Returns what module it is.
    pub fn kind(&self) -> Option<ModuleKind> {
        ModuleKind::of_hardware(self.get(HV)?)
    }

    /// Returns its transmit power, dBm.
    pub fn power_dbm(&self) -> Option<i8> {
        if let Some(power) = self.get(PP) {
            return Some(power.to_be_bytes()[3].cast_signed());
        }
        let level = usize::try_from(self.get(PL)?).ok()?;
        self.kind()?.powers_dbm().get(level).copied()
    }

    /// Returns the most bytes of a packet.
    pub fn payload_most(&self) -> usize {
        let told = self.get(NP).and_then(|most| usize::try_from(most).ok());
        told.map_or(PAYLOAD_UNTOLD, |most| most.min(PAYLOAD_MOST))
    }

    /// Returns in what it differs from what it is to be; nothing = it can be used.
    pub fn mismatches(&self, settings: &ModuleSettings) -> Vec<Mismatch> {
        let untold = self.untold();
        if !untold.is_empty() {
            return untold;
        }
        let missing = NEEDED.into_iter().find(|name| self.get(*name).is_none());
        if let Some(name) = missing {
            return vec![Mismatch::Missing { name }];
        }
        let (hardware, firmware) = (
            self.get(HV).unwrap_or_default(),
            self.get(VR).unwrap_or_default(),
        );
        let Some(kind) = self.kind() else {
            return vec![Mismatch::Hardware { hardware }];
        };
        if !kind.is_802_15_4(firmware) {
            return vec![Mismatch::Firmware { hardware, firmware }];
        }
        let wanted = [
            (AP, u32::from(settings.mode.register())),
            (MY, u32::from(settings.address())),
            (ID, u32::from(settings.network)),
            (CH, u32::from(settings.channel)),
            (AO, 2),
            (MM, 0),
        ];
        let differs = |(name, wanted)| match self.get(name) {
            Some(has) if has != wanted => Some(Mismatch::Register { name, has, wanted }),
            _ => None,
        };
        let mut found: Vec<Mismatch> = wanted.into_iter().filter_map(differs).collect();
        let (has_dbm, wanted_dbm) = (self.power_dbm(), settings.power_dbm);
        if has_dbm != Some(wanted_dbm) {
            found.push(Mismatch::Power {
                has_dbm,
                wanted_dbm,
            });
        }
        if self.payload_most() < PAYLOAD_LEAST {
            found.push(Mismatch::SmallPackets {
                most: self.payload_most(),
            });
        }
        if let Some(has @ 1..) = self.get(EE) {
            found.push(Mismatch::Encrypted { has });
        }
        found
    }

    /// Returns what the module has but does not tell: whether that is as it is to be is not known.
    fn untold(&self) -> Vec<Mismatch> {
        let compared = self.0.iter().filter(|(name, _)| !SHOWN_ONLY.contains(name));
        let untold = compared.filter_map(|(name, answer)| match answer {
            RegisterAnswer::Failed(status) => Some(Mismatch::Untold {
                name: *name,
                status: *status,
            }),
            RegisterAnswer::Value(_) | RegisterAnswer::NotKnown => None,
        });
        untold.collect()
    }
}

/// In what a module differs from what it is to be.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Mismatch {
    /// It does not know a register that all modules have.
    #[error("it does not know {name}: it is no XBee with 802.15.4 firmware")]
    Missing {
        /// The register.
        name: AtName,
    },
    /// It does not say what a register is: that may be anything.
    #[error(
        "it does not say its {name}: the answer has status {status} and no value, wanted a value"
    )]
    Untold {
        /// The register.
        name: AtName,
        /// The status of its answer.
        status: u8,
    },
    /// It is a module that carries no beacons.
    #[error("its hardware (HV {hardware:04X}) is not one that carries beacons")]
    Hardware {
        /// Its hardware version.
        hardware: u32,
    },
    /// It runs Zigbee or DigiMesh.
    #[error("its firmware (HV {hardware:04X}, VR {firmware:04X}) is not 802.15.4")]
    Firmware {
        /// Its hardware version.
        hardware: u32,
        /// Its firmware version.
        firmware: u32,
    },
    /// A register has another value.
    #[error("{name} is {has:X}, wanted {wanted:X}")]
    Register {
        /// The register.
        name: AtName,
        /// Its value.
        has: u32,
        /// What it is to be.
        wanted: u32,
    },
    /// Its power is another one.
    #[error("its power (PL) is {}, wanted {wanted_dbm} dBm", in_dbm(*has_dbm))]
    Power {
        /// Its power, dBm; `None` = not known.
        has_dbm: Option<i8>,
        /// What it is to be, dBm.
        wanted_dbm: i8,
    },
    /// It encrypts.
    #[error("it encrypts (EE is {has:X}, wanted 0), and hears no module that does not")]
    Encrypted {
        /// The value of its register.
        has: u32,
    },
    /// Its packets carry no beacon.
    #[error("its packets carry {most} bytes (NP), a beacon needs {PAYLOAD_LEAST}")]
    SmallPackets {
        /// How much they carry, bytes.
        most: usize,
    },
}

fn in_dbm(power_dbm: Option<i8>) -> String {
    power_dbm.map_or_else(|| "not known".to_owned(), |power| format!("{power} dBm"))
}

impl Mismatch {
    /// Returns whether `tomoswarm xbee setup` can help.
    pub fn can_be_set(self) -> bool {
        match self {
            Mismatch::Register { .. } | Mismatch::Power { .. } | Mismatch::Encrypted { .. } => true,
            Mismatch::Missing { .. }
            | Mismatch::Untold { .. }
            | Mismatch::Hardware { .. }
            | Mismatch::Firmware { .. }
            | Mismatch::SmallPackets { .. } => false,
        }
    }
}

/// All in what a module differs, in words, with the command that helps.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Mismatches(pub Vec<Mismatch>);

impl fmt::Display for Mismatches {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words: Vec<String> = self.0.iter().map(Mismatch::to_string).collect();
        write!(f, "{}", words.join("; "))?;
        let power_dbm = self.0.iter().find_map(|mismatch| match mismatch {
            Mismatch::Power { wanted_dbm, .. } => Some(*wanted_dbm),
            _ => None,
        });
        match (
            power_dbm,
            self.0.iter().any(|mismatch| mismatch.can_be_set()),
        ) {
            (Some(wanted_dbm), _) => write!(
                f,
                ": `tomoswarm xbee setup --power-dbm={wanted_dbm}` sets it"
            ),
            (None, true) => write!(f, ": `tomoswarm xbee setup` sets it"),
            (None, false) => Ok(()),
        }
    }
}

/// Returns the value of a register as it is said: big endian, of any length; what does not fit is cut at the front.
pub fn value_of(bytes: &[u8]) -> u32 {
    bytes
        .iter()
        .fold(0, |value: u32, byte| (value << 8) | u32::from(*byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: ModuleSettings = ModuleSettings {
        vehicle: VehicleId(2),
        network: 0x1A2B,
        channel: 15,
        power_dbm: 8,
        mode: ApiMode::Escaped,
    };

    /// An XBee 3 as it is to be, and what was changed.
    fn registers(changed: &[(AtName, Option<u32>)]) -> Registers {
        let mut registers = Registers::default();
        let good = [
            0x2, 0x2014, 0x4142, 0x13A200, 7, 2, 0x1A2B, 15, 4, 8, 114, 2, 0, 0,
        ];
        for (name, value) in READ.into_iter().zip(good) {
            registers.note(name, RegisterAnswer::Value(value));
        }
        for (name, value) in changed {
            let answer = value.map_or(RegisterAnswer::NotKnown, RegisterAnswer::Value);
            registers.note(*name, answer);
        }
        registers
    }

    fn check(changed: &[(AtName, Option<u32>)], expected: &str) {
        let mismatches = Mismatches(registers(changed).mismatches(&SETTINGS));
        assert_eq!(mismatches.to_string(), expected, "{changed:?}");
    }

    #[test]
    fn a_module_that_differs_is_told_with_what_it_has_what_is_wanted_and_what_helps() {
        check(&[], "");
        let sets = ": `tomoswarm xbee setup` sets it";
        check(&[(MM, Some(2))], &format!("MM is 2, wanted 0{sets}"));
        check(&[(MM, None)], "");
        check(&[(MY, Some(0x12))], &format!("MY is 12, wanted 2{sets}"));
        check(
            &[
                (AP, Some(1)),
                (ID, Some(0x3332)),
                (CH, Some(12)),
                (AO, Some(0)),
            ],
            &format!(
                "AP is 1, wanted 2; ID is 3332, wanted 1A2B; CH is C, wanted F; AO is 0, wanted 2{sets}"
            ),
        );
        check(
            &[(PP, Some(0xFB))],
            "its power (PL) is -5 dBm, wanted 8 dBm: `tomoswarm xbee setup --power-dbm=8` sets it",
        );
        check(
            &[(NP, Some(59))],
            "its packets carry 59 bytes (NP), a beacon needs 60",
        );
        check(
            &[(MY, None)],
            "it does not know MY: it is no XBee with 802.15.4 firmware",
        );
        check(
            &[(HV, Some(0x1942))],
            "its hardware (HV 1942) is not one that carries beacons",
        );
        check(
            &[(VR, Some(0x100B))],
            "its firmware (HV 4142, VR 100B) is not 802.15.4",
        );
    }

    #[test]
    fn a_module_that_encrypts_is_told_and_old_firmware_without_encryption_is_right() {
        check(
            &[(EE, Some(1))],
            "it encrypts (EE is 1, wanted 0), and hears no module that does not: `tomoswarm xbee setup` sets it",
        );
        check(&[(EE, None)], "");
    }

    #[test]
    fn a_register_that_a_module_does_not_tell_is_none_that_it_does_not_know() {
        for name in READ {
            let mut all = registers(&[(AO, Some(0))]);
            all.note(name, RegisterAnswer::Failed(4));
            let said = Mismatches(all.mismatches(&SETTINGS)).to_string();
            let untold = format!(
                "it does not say its {name}: the answer has status 4 and no value, wanted a value"
            );
            let is_shown_only = SHOWN_ONLY.contains(&name);
            assert_eq!(said == untold, !is_shown_only, "{name}: {said}");
        }
    }

    #[test]
    fn a_module_that_does_not_say_its_power_has_that_of_its_level() {
        let s1 = [
            (HV, Some(0x1743)),
            (VR, Some(0x10EF)),
            (PP, None),
            (AO, None),
            (NP, None),
        ];
        check(
            &s1,
            "its power (PL) is 0 dBm, wanted 8 dBm: `tomoswarm xbee setup --power-dbm=8` sets it",
        );
        let s2c = [(HV, Some(0x2E4C)), (VR, Some(0x2003)), (PP, None)];
        check(&s2c, "");
        let level = [s2c.as_slice(), &[(PL, Some(9))]].concat();
        check(
            &level,
            "its power (PL) is not known, wanted 8 dBm: `tomoswarm xbee setup --power-dbm=8` sets it",
        );
        assert_eq!(registers(&s1).payload_most(), 100);
        assert_eq!(registers(&[(NP, Some(255))]).payload_most(), 116);
    }

    #[test]
    fn a_hardware_version_tells_which_module_it_is() {
        for (version, kind) in [
            (0x1744, Some(ModuleKind::S1)),
            (0x2E4C, Some(ModuleKind::S2c)),
            (0x2D44, Some(ModuleKind::S2cPro)),
            (0x3042, Some(ModuleKind::S2cPro)),
            (0x4141, Some(ModuleKind::Xbee3)),
            (0x4242, Some(ModuleKind::Xbee3)),
            (0x4349, Some(ModuleKind::Xbee3)),
            (0x5241, Some(ModuleKind::Xbee3)),
            (0x1942, None),
        ] {
            assert_eq!(ModuleKind::of_hardware(version), kind, "{version:04X}");
        }
    }

    #[test]
    fn a_file_may_name_the_power_of_every_level() {
        use ModuleKind::{S1, S1Pro, S2c, S2cPro, Xbee3};
        for kind in [S1, S1Pro, S2c, S2cPro, Xbee3] {
            let known = |power_dbm| crate::config::XBEE_POWERS_DBM.contains(&power_dbm);
            assert!(kind.powers_dbm().into_iter().all(known), "{kind:?}");
        }
    }

    #[test]
    fn two_venues_have_two_networks_and_none_that_of_all() {
        assert_eq!(network_of(0xABCD_1234), 0x1234);
        assert_eq!(network_of(0xFFFF), 0xFFFE);
    }

    #[test]
    fn a_value_is_read_whatever_its_length() {
        assert_eq!(
            [value_of(&[]), value_of(&[2]), value_of(&[0, 0, 2])],
            [0, 2, 2]
        );
        assert_eq!(value_of(&[9, 1, 2, 3, 4]), 0x0102_0304);
    }
}
