//! How the kernel carries out faults: whose software runs no more, and who starts anew.

use tomoswarm_proto::{Boot, VehicleId};

use super::{Alarm, Kernel};
use crate::node::mission::MissionStatus;
use crate::sim::faults::Turn;

impl Kernel {
    pub(super) fn fail(&mut self, turn: Turn) {
        match turn {
            Turn::Ends(vehicle) => self.die(vehicle),
            Turn::Starts(vehicle) => self.restart(vehicle),
        }
    }

    pub(super) fn index_of(&self, id: VehicleId) -> Option<usize> {
        self.vehicles.iter().position(|vehicle| vehicle.id() == id)
    }

    /// Ends a vehicle's software; without it the autopilot brakes after a while.
    pub(super) fn die(&mut self, vehicle: VehicleId) {
        let Some(index) = self.index_of(vehicle) else { return };
        self.log(&format!("vehicle {vehicle}"), format_args!("its software ends"));
        self.is_dead[index] = true;
        self.alarms[index] = Alarm { at: None, generation: self.alarms[index].generation + 1 };
        self.leave(index);
        self.environment.detach(self.now, index);
    }

    /// Starts a vehicle's software anew, with what its disk holds.
    fn restart(&mut self, vehicle: VehicleId) {
        let Some(index) = self.index_of(vehicle).filter(|index| self.is_dead[*index]) else { return };
        let settings = &mut self.settings[index];
        settings.boot = Boot(settings.boot.0.saturating_add(1));
        settings.memory = self.disks[index].memory();
        settings.stops = self.disks[index].stops();
        let boot = settings.boot;
        self.vehicles[index].restart(settings);
        self.is_dead[index] = false;
        self.environment.attach(self.now, index);
        self.log(&format!("vehicle {vehicle}"), format_args!("its software starts, boot {boot}"));
        self.join(index, boot);
        self.set_alarm(index);
    }

    /// Gives how many vehicles are alive, how many of them are home, and how many stand and stay.
    pub(super) fn muster(&self) -> (usize, usize, usize) {
        let alive = || (0..self.vehicles.len()).filter(|index| !self.is_dead[*index]);
        let count = |wanted: MissionStatus| {
            let is_so = |index: &usize| {
                // Who has come home may still roll a hand's breadth.
                let rests = self.environment.world().truth(*index, self.now).speed_mps == 0.0;
                (rests || wanted == MissionStatus::Home) && self.vehicles[*index].mission().status() == wanted
            };
            alive().filter(is_so).count()
        };
        (alive().count(), count(MissionStatus::Home), count(MissionStatus::Held))
    }
}
