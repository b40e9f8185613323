//! What the devices of one vehicle are doing, and whether its companion lives: the software that commands them. Plain
//! values; what follows from them is the environment's.
//!
//! ```text
//!   standing ─a command that moves─► moving ─one that stops, or 2 s without a word─► standing
//!                             └──── contact ────► wrecked: it stays where it is
//! ```

use std::time::Duration;

use tomoswarm_proto::{AutopilotFamily, AutopilotHealth, RadioHealth, RangeHealth};

use crate::autopilot::{AutopilotReport, FlightMode, SystemStatus, VehicleKind};
use crate::hw::Pings;
use crate::node::health::HealthFacts;
use crate::plan::{Mounts, Pointing};
use crate::time::Time;

/// An autopilot that has had no word of its companion for this long brakes and stands.
pub const COMPANION_SILENT: Duration = Duration::from_secs(2);
/// An autopilot says its mode, and whether it is armed, with every so manieth report: once a second.
const REPORTS_A_HEARTBEAT: u8 = 10;

/// The devices of one vehicle.
#[derive(Clone, Debug)]
pub(super) struct SimulatedDevices {
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
    /// What its radio was told to send.
    pub radio: RadioHealth,
    /// What its range sensor was asked, and has answered.
    pub pings: Pings,
    /// What its autopilot said with its last heartbeat.
    heartbeat: Option<Heartbeat>,
    /// Reports since then.
    reports: u8,
}

/// What an autopilot says with its heartbeat only.
#[derive(Clone, Copy, Debug)]
struct Heartbeat {
    mode: FlightMode,
    is_armed: bool,
    status: SystemStatus,
}

impl SimulatedDevices {
    /// Makes the devices of a vehicle that stands and whose software does not run.
    pub(super) fn new(mounts: Mounts) -> SimulatedDevices {
        SimulatedDevices {
            servos: Pointing::new(mounts),
            measures_until: Time::ZERO,
            speaks_until: Time::ZERO,
            is_attached: false,
            heard_at: Time::ZERO,
            moves: false,
            is_minded: false,
            is_wrecked: false,
            radio: RadioHealth::default(),
            pings: Pings::default(),
            heartbeat: None,
            reports: 0,
        }
    }

    /// Returns what the drivers of such devices would tell of them.
    pub(super) fn facts(&self, now: Time, kind: VehicleKind) -> HealthFacts {
        let silent = "range sensor: it answers nothing".to_owned();
        let silent = self.pings.is_silent(now).then_some(silent);
        HealthFacts {
            autopilot: Some(AutopilotHealth {
                family: AutopilotFamily::Simulated,
                body: kind.body(),
                ..AutopilotHealth::default()
            }),
            radio: Some(self.radio),
            range: Some(RangeHealth {
                glitches: 0,
                faults: self.pings.faults(),
            }),
            troubles: Vec::from_iter(silent),
            ..HealthFacts::default()
        }
    }

    /// Its software runs from now on: the autopilot's next report comes with a heartbeat.
    pub(super) fn attach(&mut self, now: Time) {
        (self.is_attached, self.heard_at, self.heartbeat) = (true, now, None);
        (self.radio, self.pings) = (RadioHealth::default(), Pings::default());
    }

    /// Returns what the autopilot says of what it knows of itself now: its mode, and whether it is armed, are as old as its
    /// last heartbeat.
    pub(super) fn as_reported(&mut self, known: AutopilotReport) -> AutopilotReport {
        let known_now = Heartbeat {
            mode: known.mode,
            is_armed: known.is_armed,
            status: known.status,
        };
        let last = self
            .heartbeat
            .filter(|_| self.reports < REPORTS_A_HEARTBEAT);
        self.reports = if last.is_some() { self.reports + 1 } else { 1 };
        let Heartbeat {
            mode,
            is_armed,
            status,
        } = last.unwrap_or(known_now);
        self.heartbeat = Some(last.unwrap_or(known_now));
        AutopilotReport {
            mode,
            is_armed,
            status,
            ..known
        }
    }

    /// Returns when its companion will have been silent for too long.
    pub(super) fn silent_at(&self) -> Time {
        self.heard_at + COMPANION_SILENT
    }
}
