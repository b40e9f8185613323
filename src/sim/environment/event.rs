//! What goes in and out of the environment: what a vehicle's devices are told, what is still to happen by itself, and
//! what has happened.

use std::sync::Arc;

use tomoswarm_proto::{Beacon, VehicleId};

use crate::autopilot::{Ack, AutopilotReport, NumberedCommand};
use crate::geom::Angle;
use crate::node::sensor::{Echo, Ping};
use crate::sim::body::BodyState;
use crate::sim::world::Collision;
use crate::time::Time;

/// What a vehicle's software tells one of its devices.
#[derive(Clone, PartialEq, Debug)]
pub enum DeviceCommand {
    /// The autopilot shall obey.
    Autopilot(NumberedCommand),
    /// The servo shall point the range sensor, relative to the heading.
    Steer(Angle),
    /// The range sensor shall measure.
    Ping(Ping),
    /// The radio shall send a beacon.
    Transmit(Beacon),
}

/// Something that is to happen by itself.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum PendingEvent {
    /// An autopilot reports.
    Report { vehicle: usize },
    /// It is time to look where everybody is.
    Track,
    /// The range sensor of a vehicle has its reading.
    Echo { vehicle: usize, echo: Echo },
    /// A beacon has been sent to its end.
    AirEnds { number: u64 },
    /// The companion of a vehicle may have been silent for too long.
    Silence { vehicle: usize },
    /// The battery of a vehicle has a charge at once, 0 to 1.
    Charge { vehicle: VehicleId, charge: f64 },
    /// Persons have walked on.
    Walk,
}

/// What the environment says. Vehicles are named by their index.
#[derive(Clone, PartialEq, Debug)]
pub enum WorldEvent {
    /// Something is to happen by itself at this moment. It is said once for each such thing, when that becomes known, so
    /// that a caller with a queue of its own keeps the order of what happens at one moment; who only waits asks for the
    /// deadline.
    Scheduled(Time),
    /// The autopilot of a vehicle reports.
    Report {
        /// Of which vehicle.
        vehicle: usize,
        /// The report.
        report: AutopilotReport,
    },
    /// The autopilot of a vehicle answers to a command.
    Ack {
        /// Of which vehicle.
        vehicle: usize,
        /// The answer.
        ack: Ack,
    },
    /// The range sensor of a vehicle answers.
    Echo {
        /// Of which vehicle.
        vehicle: usize,
        /// The reading.
        echo: Echo,
    },
    /// A beacon was received.
    Heard {
        /// Its bytes.
        frame: Arc<[u8]>,
        /// By which vehicles, and how strongly, dBm.
        receivers: Vec<(usize, i16)>,
    },
    /// The radio of a vehicle has not sent a beacon: it was speaking, or the beacon is none that it could send.
    Unsent {
        /// Of which vehicle.
        vehicle: usize,
        /// The beacon's sequence.
        sequence: u32,
    },
    /// Bodies have touched; they stay where they are.
    Contact(Collision),
    /// A battery has a charge at once, by a fault.
    Charged {
        /// Of which vehicle.
        vehicle: usize,
        /// How much, 0 to 1.
        charge: f64,
    },
    /// Where every vehicle truly is; once a second.
    Track(Vec<BodyState>),
}

/// How often things happened to devices.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct DeviceCounts {
    /// Range readings that were begun.
    pub scans: u64,
    /// Beacons that were received, each receiver counted.
    pub beacons_heard: u64,
    /// Beacons lost because two spoke at once.
    pub collided_beacons: u64,
    /// Commands that were dropped: to a device that was busy, to a wreck, or impossible ones.
    pub dropped: u64,
}
