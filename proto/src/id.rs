//! Names of things, each with its own type so that none is taken for another.

use std::cmp::Ordering;
use std::fmt;

use serde::{Deserialize, Serialize};

/// A vehicle of the swarm; unique within a venue.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct VehicleId(pub u8);

impl fmt::Display for VehicleId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// An operator of the swarm; unique within a venue.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct OperatorId(pub u8);

impl fmt::Display for OperatorId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Counts the starts of a vehicle's software, so that a restart never continues an old numbering.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct Boot(pub u32);

impl fmt::Display for Boot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// One mission with its data.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct RunId(pub u32);

impl fmt::Display for RunId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Version of the plans or orders of a run; the higher one wins.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct Revision(pub u32);

impl fmt::Display for Revision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// A stop of a vehicle's plan; stable across revisions of one run.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct StopId(pub u32);

impl fmt::Display for StopId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// The name of one emergency stop. An operator draws it at random, so that nothing can be forged above it and two
/// operators do not collide; names are compared for equality and sorted, never ranked.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct EmergencyName(pub u32);

impl EmergencyName {
    /// The lowest name that is drawn. Those below it stand for more stops than a node names one by one.
    pub const LOWEST_DRAWN: u32 = 1 << 16;

    /// Returns the name of what takes the place of a stop that cannot be named any more.
    pub const fn many_of(name: EmergencyName) -> EmergencyName {
        EmergencyName(name.0 % EmergencyName::LOWEST_DRAWN)
    }

    /// Returns the name by which a start ends what somebody else has begun with a vehicle, by remote control or the
    /// autopilot by itself, under this start of its software. No node opens a stop of that name: a vehicle whose state says
    /// that somebody else steers is known to stand under it.
    pub const fn of_take_over(vehicle: VehicleId, boot: Boot) -> EmergencyName {
        let mixed = (boot.0 ^ (vehicle.0 as u32).rotate_right(8)).wrapping_mul(0x9E37_79B1);
        EmergencyName(mixed | EmergencyName::LOWEST_DRAWN)
    }

    /// Returns whether it stands for more stops than a node names one by one.
    pub const fn is_many(self) -> bool {
        self.0 < EmergencyName::LOWEST_DRAWN
    }
}

impl fmt::Display for EmergencyName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_many() {
            write!(f, "many-{:04x}", self.0)
        } else {
            write!(f, "{:08x}", self.0)
        }
    }
}

/// An operator's right to give orders: the greatest one wins, which is that of the highest number, and on
/// a tie that of the lower holder.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default, Serialize, Deserialize)]
pub struct Lease {
    /// Counts the leases of a venue.
    pub number: u32,
    /// Random id of who holds it.
    pub holder: u64,
}

impl Lease {
    /// Returns the lowest lease of a number: every other of that number is greater.
    pub const fn lowest(number: u32) -> Lease {
        Lease {
            number,
            holder: u64::MAX,
        }
    }
}

impl Ord for Lease {
    fn cmp(&self, other: &Lease) -> Ordering {
        self.number
            .cmp(&other.number)
            .then(other.holder.cmp(&self.holder))
    }
}

impl PartialOrd for Lease {
    fn partial_cmp(&self, other: &Lease) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Names the one writer of a map layer.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize,
)]
pub struct LayerId {
    /// The vehicle that wrote it.
    pub vehicle: VehicleId,
    /// The start of that vehicle's software.
    pub boot: Boot,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn take_overs_have_names_of_their_own_for_each_vehicle_and_start() {
        let of = |vehicle, boot| EmergencyName::of_take_over(VehicleId(vehicle), Boot(boot));
        assert_eq!(of(1, 1), EmergencyName(0x4F37_79B1));
        let all = (1..=8).flat_map(|vehicle| (1..=200).map(move |boot| of(vehicle, boot)));
        let all: std::collections::BTreeSet<EmergencyName> = all.collect();
        assert_eq!(all.len(), 1600);
        assert!(all.iter().all(|name| !name.is_many()));
    }

    #[test]
    fn the_name_of_many_stops_is_told_apart() {
        assert_eq!(EmergencyName(0x1_002a).to_string(), "0001002a");
        let many = EmergencyName::many_of(EmergencyName(0x1_002a));
        assert_eq!(
            (many.to_string().as_str(), many.is_many()),
            ("many-002a", true)
        );
    }

    #[test]
    fn a_tie_between_leases_goes_to_the_lower_holder() {
        let lease = |number, holder| Lease { number, holder };
        assert!(lease(2, 9) > lease(1, 1));
        assert!(lease(2, 1) > lease(2, 9));
    }
}
