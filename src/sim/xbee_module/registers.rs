//! The registers of a simulated module: which it knows, what they may be, what was set, what is in effect, and what is saved.

use std::collections::BTreeMap;

use crate::config::XBEE_BAUDS;
use crate::hw::xbee_frame::{ApiMode, AtName};
use crate::hw::xbee_registers::{
    AO, AP, BD, CH, EE, HV, ID, MM, MY, ModuleKind, NP, PL, PP, SH, SL, VR, value_of,
};

/// Its name.
const NI: AtName = AtName(*b"NI");
/// Back-offs before it first listens for others, as an exponent of 2.
pub(super) const RN: AtName = AtName(*b"RN");
/// Silence before and behind `+++`, ms.
pub(super) const GT: AtName = AtName(*b"GT");
/// It leaves its command mode after this silence, 100 ms.
pub(super) const CT: AtName = AtName(*b"CT");
/// To whom it sends what is no frame, upper and lower half.
pub(super) const DH: AtName = AtName(*b"DH");
pub(super) const DL: AtName = AtName(*b"DL");
/// Strength of what was heard last.
pub(super) const DB: AtName = AtName(*b"DB");
/// The longest name, bytes.
const NAME_MOST: usize = 20;

/// Numbers that can be set: how many bytes it answers, the least and most value, and the value from the factory.
const NUMBERS: [(AtName, usize, [u32; 2], u32); 19] = [
    (AP, 1, [0, 2], 0),
    (BD, 1, [0, 8], 3),
    (MY, 2, [0, 0xFFFF], 0),
    (ID, 2, [0, 0xFFFF], 0x3332),
    (CH, 1, [11, 26], 12),
    (PL, 1, [0, 4], 4),
    (AO, 1, [0, 2], 2),
    (RN, 1, [0, 3], 0),
    (GT, 2, [2, 0xCE4], 1000),
    (CT, 2, [2, 0xFFFF], 100),
    (DH, 4, [0, u32::MAX], 0),
    (DL, 4, [0, u32::MAX], 0),
    (AtName(*b"CE"), 1, [0, 1], 0),
    (AtName(*b"A1"), 1, [0, 15], 0),
    (AtName(*b"SM"), 1, [0, 6], 0),
    (EE, 1, [0, 1], 0),
    (AtName(*b"RR"), 1, [0, 6], 0),
    (MM, 1, [0, 3], 0),
    (AtName(*b"CA"), 1, [0, 0x50], 0x41),
];

/// What a register is asked or set in vain.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum RegisterError {
    /// The module does not know it.
    Unknown,
    /// It takes no such value.
    Impossible,
}

impl RegisterError {
    /// Returns what a module answers then.
    pub(super) fn status(self) -> u8 {
        match self {
            RegisterError::Unknown => 2,
            RegisterError::Impossible => 3,
        }
    }
}

/// The registers of a module.
#[derive(Clone, Debug)]
pub(super) struct ModuleRegisters {
    kind: ModuleKind,
    serial: u64,
    saved: BTreeMap<AtName, Vec<u8>>,
    set: BTreeMap<AtName, Vec<u8>>,
    in_effect: BTreeMap<AtName, Vec<u8>>,
    last_rssi: u8,
}

impl ModuleRegisters {
    /// Makes those of a module as it comes from the factory.
    pub(super) fn new(kind: ModuleKind, serial: u64) -> ModuleRegisters {
        let mut registers = ModuleRegisters {
            kind,
            serial,
            saved: BTreeMap::new(),
            set: BTreeMap::new(),
            in_effect: BTreeMap::new(),
            last_rssi: 0,
        };
        registers.forget_all();
        registers.save();
        registers.apply();
        registers
    }

    /// Sets all as they come from the factory.
    pub(super) fn forget_all(&mut self) {
        let numbers = NUMBERS.iter().filter(|(name, ..)| self.knows(*name));
        let numbers = numbers.map(|(name, width, _, value)| (*name, bytes_of(*value, *width)));
        self.set = numbers.chain([(NI, b" ".to_vec())]).collect();
    }

    /// Returns a register's value as the module says it.
    pub(super) fn read(&self, name: AtName) -> Result<Vec<u8>, RegisterError> {
        if let Some(value) = self.set.get(&name) {
            return Ok(value.clone());
        }
        let (value, width) = match name {
            VR => (self.firmware(), 2),
            HV => (self.hardware(), 2),
            SH => ((self.serial >> 32) as u32, 4),
            SL => (self.serial as u32, 4),
            NP => (self.payload_most() as u32, 1),
            PP if self.kind == ModuleKind::Xbee3 => {
                (u32::from(self.power_dbm().cast_unsigned()), 1)
            }
            DB => (u32::from(self.last_rssi), 1),
            AtName([b'A', b'I']) => (0, 1),
            _ => return Err(RegisterError::Unknown),
        };
        Ok(bytes_of(value, width))
    }

    /// Sets a register; it takes effect with [`ModuleRegisters::apply`].
    pub(super) fn write(&mut self, name: AtName, value: &[u8]) -> Result<(), RegisterError> {
        if name == NI {
            let is_name = (1..=NAME_MOST).contains(&value.len());
            let is_text = value
                .iter()
                .all(|byte| byte.is_ascii_graphic() || *byte == b' ');
            if !is_name || !is_text {
                return Err(RegisterError::Impossible);
            }
            self.set.insert(NI, value.to_vec());
            return Ok(());
        }
        let number = NUMBERS.iter().find(|(known, ..)| *known == name);
        let Some((_, width, [least, most], _)) = number.filter(|_| self.knows(name)) else {
            return Err(RegisterError::Unknown);
        };
        let [least, most] = match (name, self.kind) {
            (CH, ModuleKind::S1Pro) => [12, 23],
            _ => [*least, *most],
        };
        let number = value_of(value);
        if value.len() > 4 || number < least || number > most {
            return Err(RegisterError::Impossible);
        }
        self.set.insert(name, bytes_of(number, *width));
        Ok(())
    }

    /// What was set takes effect.
    pub(super) fn apply(&mut self) {
        self.in_effect.clone_from(&self.set);
    }

    /// What was set outlives a reset.
    pub(super) fn save(&mut self) {
        self.saved.clone_from(&self.set);
    }

    /// Only what was saved is left, and takes effect.
    pub(super) fn reset(&mut self) {
        self.set.clone_from(&self.saved);
        self.apply();
        self.last_rssi = 0;
    }

    /// Notes how strongly something was heard.
    pub(super) fn heard(&mut self, rssi: u8) {
        self.last_rssi = rssi;
    }

    /// Returns a number that is in effect.
    pub(super) fn number(&self, name: AtName) -> u32 {
        self.in_effect.get(&name).map_or(0, |value| value_of(value))
    }

    /// Returns how its frames are marked; `None` = it speaks none.
    pub(super) fn mode(&self) -> Option<ApiMode> {
        ApiMode::of_register(self.number(AP))
    }

    /// Returns at which baud rate it speaks.
    pub(super) fn baud(&self) -> u32 {
        let code = self.number(BD) as usize;
        XBEE_BAUDS.get(code).copied().unwrap_or(XBEE_BAUDS[3])
    }

    /// Returns its own address; FFFE and FFFF = it has none.
    pub(super) fn address(&self) -> u16 {
        self.number(MY) as u16
    }

    /// Returns its transmit power, dBm.
    pub(super) fn power_dbm(&self) -> i8 {
        let level = self.number(PL) as usize;
        self.kind.powers_dbm().get(level).copied().unwrap_or(0)
    }

    /// Returns the most bytes that it sends in a packet.
    pub(super) fn payload_most(&self) -> usize {
        match self.kind {
            ModuleKind::S1 | ModuleKind::S1Pro => 100,
            ModuleKind::S2c | ModuleKind::S2cPro | ModuleKind::Xbee3 => 114,
        }
    }

    /// Returns whether it says how strongly it has heard something.
    pub(super) fn says_rssi(&self) -> bool {
        !self.knows(AO) || self.number(AO) == 2
    }

    /// Returns whether the maker's two bytes come before each payload.
    pub(super) fn has_header(&self) -> bool {
        matches!(self.number(MM), 0 | 3)
    }

    fn knows(&self, name: AtName) -> bool {
        let is_first_series = matches!(self.kind, ModuleKind::S1 | ModuleKind::S1Pro);
        name != AO || !is_first_series
    }

    fn hardware(&self) -> u32 {
        match self.kind {
            ModuleKind::S1 => 0x1743,
            ModuleKind::S1Pro => 0x1843,
            ModuleKind::S2c => 0x2E4C,
            ModuleKind::S2cPro => 0x2D4C,
            ModuleKind::Xbee3 => 0x4242,
        }
    }

    fn firmware(&self) -> u32 {
        match self.kind {
            ModuleKind::S1 | ModuleKind::S1Pro => 0x10EF,
            ModuleKind::S2c | ModuleKind::S2cPro => 0x2003,
            ModuleKind::Xbee3 => 0x2014,
        }
    }
}

/// Returns the last bytes of a number, big endian.
fn bytes_of(value: u32, width: usize) -> Vec<u8> {
    let bytes = value.to_be_bytes();
    bytes[bytes.len().saturating_sub(width)..].to_vec()
}
