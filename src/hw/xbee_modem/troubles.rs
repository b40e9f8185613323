//! What is wrong with a module or on the air. What happens on the air passes: it is remembered for 10 s.

use std::mem::discriminant;
use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::super::xbee_registers::Mismatches;
use crate::time::Time;

/// Something on the air is told for this long after it was last seen.
const RECENT: Duration = Duration::from_secs(10);

/// What is wrong.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ModemTrouble {
    /// The module does not answer.
    #[error(
        "the module does not answer: it is off, at another baud rate or in transparent mode; `tomoswarm xbee setup` finds it"
    )]
    Silent,
    /// The module is not as it is to be.
    #[error("the module is not as wanted: {0}")]
    Refused(Mismatches),
    /// Somebody else is this vehicle.
    #[error("another radio says that it is vehicle {vehicle}: each vehicle needs an id of its own")]
    OwnVehicle {
        /// Whom both say to be.
        vehicle: VehicleId,
    },
    /// Another module has the address of this one.
    #[error(
        "another module has the address {address:X} (MY) of this one: `tomoswarm xbee setup` gives it its own"
    )]
    OwnAddress {
        /// The address of both.
        address: u16,
    },
    /// A vehicle speaks from another one's address.
    #[error(
        "vehicle {sender} speaks from the address {address:X} (MY) of another one: `tomoswarm xbee setup` gives its module its own"
    )]
    OthersAddress {
        /// The address.
        address: u16,
        /// Who speaks.
        sender: VehicleId,
    },
    /// What is heard comes without its strength.
    #[error(
        "the module says what it hears without the strength: AO=2 is needed, `tomoswarm xbee setup` sets it"
    )]
    WithoutRssi,
    /// It answers questions, and not what it does.
    #[error(
        "the module does not say what became of {beacons} beacons, so none of them counts as sent"
    )]
    Unconfirmed {
        /// How many, one after the other.
        beacons: u32,
    },
    /// It begins anew again and again.
    #[error(
        "the module was reset {times} times within a minute: its supply or its contacts are too weak"
    )]
    Resets {
        /// How often.
        times: u32,
    },
    /// A beacon was too long for a packet.
    #[error("a beacon of {length} bytes was not sent: a packet carries {most} (NP)")]
    TooLong {
        /// Its length, bytes.
        length: usize,
        /// What a packet carries, bytes.
        most: usize,
    },
    /// A beacon was too long for the module, though not for what it says of itself.
    #[error("the module sends no packets as long as it says (NP)")]
    RefusesLength,
}

/// What was wrong lately, each kind once.
#[derive(Clone, Debug, Default)]
pub(super) struct RecentTroubles(Vec<(Time, ModemTrouble)>);

impl RecentTroubles {
    /// Notes that something is wrong now.
    pub(super) fn note(&mut self, now: Time, trouble: ModemTrouble) {
        let kind = discriminant(&trouble);
        self.0.retain(|(_, other)| discriminant(other) != kind);
        self.0.push((now, trouble));
    }

    /// Returns what was wrong in the last 10 s.
    pub(super) fn lately(&self, now: Time) -> impl Iterator<Item = ModemTrouble> {
        let recent = self
            .0
            .iter()
            .filter(move |(at, _)| now.since(*at) <= RECENT);
        recent.map(|(_, trouble)| trouble.clone())
    }
}
