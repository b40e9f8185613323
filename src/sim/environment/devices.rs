//! What the devices of one vehicle are doing, and whether its companion lives: the software that commands them. Plain
//! values; what follows from them is the environment's.
//!
//! ```text
//!   standing ─Drive, Turn─► moving ─Stop, Arm, Disarm, or 2 s without a word─► standing
//!                             └──── contact ────► wrecked: it stays where it is
//! ```

use std::time::Duration;

use crate::plan::{Mounts, Pointing};
use crate::time::Time;

/// An autopilot that has had no word of its companion for so long brakes and stands.
pub const COMPANION_SILENT: Duration = Duration::from_secs(2);

/// The devices of one vehicle.
#[derive(Clone, Debug)]
pub(super) struct Devices {
    /// Where its range sensors are pointed.
    pub servos: Pointing,
    /// Until when the range sensor is measuring.
    pub measures_until: Time,
    /// Until when the radio is speaking.
    pub speaks_until: Time,
    /// Whether its software runs, and hears what the devices say.
    pub is_attached: bool,
    /// When its software said something last.
    pub heard_at: Time,
    /// It has been told to move, and not stopped since.
    pub moves: bool,
    /// A look at whether its companion is silent is pending.
    pub is_minded: bool,
    /// It has touched something.
    pub is_wrecked: bool,
}

impl Devices {
    /// Makes the devices of a vehicle that stands and whose software does not run.
    pub fn new(mounts: Mounts) -> Devices {
        Devices {
            servos: Pointing::new(mounts),
            measures_until: Time::ZERO,
            speaks_until: Time::ZERO,
            is_attached: false,
            heard_at: Time::ZERO,
            moves: false,
            is_minded: false,
            is_wrecked: false,
        }
    }

    /// Returns when its companion will have been silent for too long.
    pub fn silent_at(&self) -> Time {
        self.heard_at + COMPANION_SILENT
    }
}
