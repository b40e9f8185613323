//! The vehicle that a client flies: one of the environment's, under its autopilot.

use crate::autopilot::{Command, VehicleKind};
use crate::sim::autopilot::{DatedText, LowBattery, Readout};
use crate::sim::environment::Environment;
use crate::sim::world::CommandResult;
use crate::time::Time;

/// One vehicle of an environment, which has gone on up to now.
pub struct FlownVehicle<'a> {
    environment: &'a mut Environment,
    index: usize,
}

impl FlownVehicle<'_> {
    /// Takes the vehicle of this index.
    pub fn new(environment: &mut Environment, index: usize) -> FlownVehicle<'_> {
        FlownVehicle { environment, index }
    }

    /// Returns all that its autopilot knows of itself.
    pub(super) fn readout(&mut self, now: Time) -> Readout {
        self.environment.readout(self.index, now)
    }

    /// Returns what it is.
    pub(super) fn kind(&self) -> VehicleKind {
        self.environment.kind()
    }

    /// Commands its autopilot.
    pub(super) fn command(&mut self, now: Time, command: &Command) -> CommandResult {
        self.environment.command_by_client(now, self.index, command)
    }

    /// Returns what its autopilot has said since the last call.
    pub(super) fn status_texts(&mut self) -> Vec<DatedText> {
        self.environment.status_texts(self.index)
    }

    /// Says what is to happen when its battery is low.
    pub(super) fn set_low_battery(&mut self, action: LowBattery) {
        self.environment.set_low_battery(self.index, action);
    }
}
