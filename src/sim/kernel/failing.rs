//! How the kernel carries out faults: whose software runs no more, and who starts anew.

use tomoswarm_proto::{Boot, VehicleId};

use super::{Alarm, Kernel, NodeId};
use crate::ground::from_config::GroundParts;
use crate::ground::station::StationSettings;
use crate::node::mission::MissionStatus;
use crate::sim::faults::FaultTurn;
use crate::sim::noise::Purpose;

impl Kernel {
    pub(super) fn fail(&mut self, turn: FaultTurn) {
        match turn {
            FaultTurn::Ends(NodeId::Vehicle(vehicle)) => self.die(vehicle),
            FaultTurn::Ends(NodeId::Ground) => self.end_ground(),
            FaultTurn::Starts(NodeId::Vehicle(vehicle)) => self.restart(vehicle),
            FaultTurn::Starts(NodeId::Ground) => self.restart_ground(),
            // An operator's end is not what a file can say.
            FaultTurn::Ends(NodeId::Operator(_)) | FaultTurn::Starts(NodeId::Operator(_)) => {}
        }
    }

    pub(super) fn index_of(&self, id: VehicleId) -> Option<usize> {
        self.vehicles.iter().position(|vehicle| vehicle.id() == id)
    }

    /// Ends a vehicle's software; without it the autopilot brakes after a while.
    pub(super) fn die(&mut self, vehicle: VehicleId) {
        let Some(index) = self.index_of(vehicle) else {
            return;
        };
        self.log(
            &format!("vehicle {vehicle}"),
            format_args!("its software ends"),
        );
        self.is_dead[index] = true;
        self.alarms[index] = Alarm {
            at: None,
            generation: self.alarms[index].generation + 1,
        };
        self.leave(index);
        self.environment.detach(self.now, index);
    }

    /// Starts a vehicle's software anew, with what its disk holds.
    fn restart(&mut self, vehicle: VehicleId) {
        let Some(index) = self.index_of(vehicle).filter(|index| self.is_dead[*index]) else {
            return;
        };
        let settings = &mut self.settings[index];
        settings.boot = Boot(settings.boot.0.saturating_add(1));
        settings.memory = self.disks[index].memory();
        settings.stops = self.disks[index].stops();
        let boot = settings.boot;
        self.vehicles[index].restart(settings);
        self.is_dead[index] = false;
        self.environment.attach(self.now, index);
        self.log(
            &format!("vehicle {vehicle}"),
            format_args!("its software starts, boot {boot}"),
        );
        self.join(index, boot);
        self.set_alarm(index);
        self.begun_anew.push(NodeId::Vehicle(vehicle));
    }

    /// Ends the ground station's software: what it has not kept is gone.
    fn end_ground(&mut self) {
        let index = self.vehicles.len();
        self.log("ground", format_args!("its software ends"));
        self.alarms[index] = Alarm {
            at: None,
            generation: self.alarms[index].generation + 1,
        };
        self.leave(index);
    }

    /// Starts the ground station's software anew, with what its disk holds: as a live one it listens first, and draws a new
    /// name for the lease that it may hold.
    fn restart_ground(&mut self) {
        let index = self.vehicles.len();
        if self.runs(index) {
            return;
        }
        let settings = &mut self.ground_parts.station;
        settings.boot = Boot(settings.boot.0.saturating_add(1));
        let boot = settings.boot;
        let holder = self
            .noise
            .hash(Purpose::Start, &[u64::MAX, u64::from(boot.0)]);
        let station = StationSettings {
            lease: None,
            holder,
            ..settings.clone()
        };
        self.ground.restart(self.ground_disk.source(GroundParts {
            station,
            ..self.ground_parts.clone()
        }));
        self.log("ground", format_args!("its software starts, boot {boot}"));
        self.join(index, boot);
        self.set_alarm(index);
        self.begun_anew.push(NodeId::Ground);
    }

    /// Returns how many vehicles are alive, how many of them are home, and how many stand and stay.
    pub(super) fn muster(&self) -> (usize, usize, usize) {
        let alive = || (0..self.vehicles.len()).filter(|index| !self.is_dead[*index]);
        let count = |wanted: MissionStatus| {
            let is_so = |index: &usize| {
                // Who has come home may still roll a hand's breadth.
                let rests = self.environment.world().truth(*index, self.now).speed_mps == 0.0;
                (rests || wanted == MissionStatus::Home)
                    && self.vehicles[*index].mission().status() == wanted
            };
            alive().filter(is_so).count()
        };
        (
            alive().count(),
            count(MissionStatus::Home),
            count(MissionStatus::Held),
        )
    }
}
