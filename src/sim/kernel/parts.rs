//! What a run is made of, and what is left of it at its end: values only.

use std::time::Duration;

use super::network::Greetings;
use super::nodes::{SimulatedGround, SimulatedOperator, SimulatedVehicle};
use crate::ground::from_config::GroundParts;
use crate::map::Merged;
use crate::sim::bus::SimulatedBus;
use crate::sim::environment::Environment;
use crate::sim::faults::Faults;
use crate::sim::noise::Noise;
use crate::sim::outcome::{FleetCount, Recorded};
use crate::sim::run_monitor::RunMonitor;
use crate::time::Time;

/// Everything that a run is made of.
pub(in crate::sim) struct Parts {
    pub noise: Noise,
    pub environment: Environment,
    pub bus: SimulatedBus,
    pub greetings: Greetings,
    /// What every node may send.
    pub egress_bytes_per_s: u32,
    pub vehicles: Vec<SimulatedVehicle>,
    pub faults: Faults,
    /// What the ground station is made of, also when it restarts.
    pub ground: GroundParts,
    pub operators: Vec<SimulatedOperator>,
    pub monitor: RunMonitor,
    pub until: Time,
    pub shuffle_ties: bool,
    /// The first contact ends the run.
    pub ends_at_contact: bool,
    /// How often the run shows itself, virtual time.
    pub shown_every: Duration,
    /// All samples are wanted at the end.
    pub keeps_samples: bool,
}

/// A run that is over.
pub(in crate::sim) struct FinishedRun {
    pub record: Recorded,
    pub fleet: FleetCount,
    pub monitor: RunMonitor,
    pub environment: Environment,
    pub ground: SimulatedGround,
    /// What the nodes know of the world together.
    pub map: Merged,
    pub bus: SimulatedBus,
    /// When it has ended.
    pub ended_at: Time,
    /// Whether it was given up then, nothing having ended it.
    pub is_time_up: bool,
    /// Smallest distance between the middles of two vehicles, metres; infinite for one alone.
    pub min_separation_m: f64,
}
