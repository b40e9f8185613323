//! The nodes of a simulated run: the vehicles, the ground station and the operators, each with what its process would have
//! beside it. It lets nothing happen: whoever tells a node something carries out what it wants done.

mod ground;
mod operator;
#[cfg(test)]
mod tests;
mod vehicle;

use tomoswarm_proto::{Boot, Digest, codec::EncodeError};

pub(in crate::sim) use self::ground::SimulatedGround;
pub(in crate::sim) use self::operator::SimulatedOperator;
pub(in crate::sim) use self::vehicle::SimulatedVehicle;
use super::alarm::Alarm;
use crate::actor::{ActorStep, Snapshot};
use crate::map::Merged;
use crate::node::mission::MissionStatus;
use crate::sim::bus::NodeId;
use crate::sim::log::hash;
use crate::sim::noise::Noise;
use crate::sim::outcome::FleetCount;
use crate::time::Time;

/// Which node it is, by its place among those of its kind.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(in crate::sim) enum NodePlace {
    Vehicle(usize),
    Ground,
    Operator(usize),
}

/// All nodes of a run.
pub(super) struct Nodes {
    vehicles: Vec<SimulatedVehicle>,
    ground: SimulatedGround,
    operators: Vec<SimulatedOperator>,
}

impl Nodes {
    pub(super) fn new(
        vehicles: Vec<SimulatedVehicle>,
        ground: SimulatedGround,
        operators: Vec<SimulatedOperator>,
    ) -> Nodes {
        Nodes {
            vehicles,
            ground,
            operators,
        }
    }

    /// Returns the vehicles, in their order.
    pub(super) fn vehicles(&self) -> &[SimulatedVehicle] {
        &self.vehicles
    }

    /// Returns a vehicle, to be told something.
    pub(super) fn vehicle_mut(&mut self, vehicle: usize) -> &mut SimulatedVehicle {
        &mut self.vehicles[vehicle]
    }

    /// Returns the ground station.
    pub(super) fn ground(&self) -> &SimulatedGround {
        &self.ground
    }

    /// Returns the ground station, to be told something.
    pub(super) fn ground_mut(&mut self) -> &mut SimulatedGround {
        &mut self.ground
    }

    /// Returns the operators, in their order.
    pub(super) fn operators(&self) -> &[SimulatedOperator] {
        &self.operators
    }

    /// Returns an operator, to be told something.
    pub(super) fn operator_mut(&mut self, operator: usize) -> &mut SimulatedOperator {
        &mut self.operators[operator]
    }

    /// Returns all places: the vehicles, the ground station, the operators.
    pub(super) fn places(&self) -> impl Iterator<Item = NodePlace> + use<> {
        let vehicles = (0..self.vehicles.len()).map(NodePlace::Vehicle);
        let operators = (0..self.operators.len()).map(NodePlace::Operator);
        vehicles.chain([NodePlace::Ground]).chain(operators)
    }

    /// Returns the place of a node; `None` = it takes no part in this run.
    pub(super) fn place_of(&self, node: NodeId) -> Option<NodePlace> {
        match node {
            NodeId::Vehicle(id) => {
                let place = self.vehicles.iter().position(|vehicle| vehicle.id() == id);
                place.map(NodePlace::Vehicle)
            }
            NodeId::Ground => Some(NodePlace::Ground),
            NodeId::Operator(id) => {
                let place = self
                    .operators
                    .iter()
                    .position(|operator| operator.id() == id);
                place.map(NodePlace::Operator)
            }
        }
    }

    /// Returns a node by its place, as it is named on the bus.
    pub(super) fn id_of(&self, node: NodePlace) -> NodeId {
        match node {
            NodePlace::Vehicle(vehicle) => NodeId::Vehicle(self.vehicles[vehicle].id()),
            NodePlace::Ground => NodeId::Ground,
            NodePlace::Operator(operator) => NodeId::Operator(self.operators[operator].id()),
        }
    }

    /// Sets the alarm of a node to its deadline; returns the wake that must be queued, if one must.
    pub(super) fn set_alarm(&mut self, node: NodePlace, now: Time) -> Option<(Time, u64)> {
        let (alarm, deadline) = match node {
            NodePlace::Vehicle(vehicle) => self.vehicles[vehicle].alarm_and_deadline(),
            NodePlace::Ground => self.ground.alarm_and_deadline(),
            NodePlace::Operator(operator) => self.operators[operator].alarm_and_deadline(),
        };
        alarm.set(now, deadline)
    }

    /// Returns whether a wake of a node counts.
    pub(super) fn rings(&mut self, node: NodePlace, generation: u64) -> bool {
        let alarm: &mut Alarm = match node {
            NodePlace::Vehicle(vehicle) => self.vehicles[vehicle].alarm_mut(),
            NodePlace::Ground => self.ground.alarm_mut(),
            NodePlace::Operator(operator) => self.operators[operator].alarm_mut(),
        };
        alarm.rings(generation)
    }

    /// Ends the software of a vehicle or of the ground station: what it has not on its disk is gone.
    pub(super) fn end(&mut self, node: NodePlace) {
        match node {
            NodePlace::Vehicle(vehicle) => self.vehicles[vehicle].end(),
            NodePlace::Ground => self.ground.end(),
            NodePlace::Operator(_) => {}
        }
    }

    /// Starts the software of a vehicle or of the ground station anew, with what its disk holds; returns the count of its
    /// starts. Operators are not started anew.
    pub(super) fn restart(&mut self, node: NodePlace, noise: Noise) -> Option<Boot> {
        match node {
            NodePlace::Vehicle(vehicle) => Some(self.vehicles[vehicle].restart()),
            NodePlace::Ground => Some(self.ground.restart(noise)),
            NodePlace::Operator(_) => None,
        }
    }

    /// Returns which vehicles are dead.
    pub(super) fn are_dead(&self) -> impl Iterator<Item = bool> + '_ {
        self.vehicles.iter().map(SimulatedVehicle::is_dead)
    }

    /// Returns how many vehicles are alive, how many of them are home, and how many stand and stay: held, or with nothing left
    /// to do.
    pub(super) fn count_fleet(
        &self,
        is_at_rest: impl Fn(usize) -> bool,
        has_ended: impl Fn(usize) -> bool,
    ) -> FleetCount {
        let mut fleet = FleetCount::default();
        let vehicles = self.vehicles.iter().enumerate();
        for (index, vehicle) in vehicles.filter(|(_, vehicle)| !vehicle.is_dead()) {
            fleet.alive += 1;
            match vehicle.node().mission().status() {
                // Who has come home may still roll a hand's breadth.
                MissionStatus::Home => fleet.home += 1,
                MissionStatus::Held if is_at_rest(index) => fleet.held += 1,
                MissionStatus::Following if is_at_rest(index) && has_ended(index) => {
                    fleet.held += 1;
                }
                MissionStatus::Waiting
                | MissionStatus::Following
                | MissionStatus::Held
                | MissionStatus::Returning => {}
            }
        }
        fleet
    }

    /// Returns what the nodes know of the world together: every vehicle whose software runs, and the ground station, whose
    /// store outlives its software. What only a dead vehicle knew is lost.
    pub(super) fn known_map(&self) -> Merged {
        let mut map = self.ground.node().station().map().clone();
        let alive = self.vehicles.iter().filter(|vehicle| !vehicle.is_dead());
        alive.for_each(|vehicle| map.join_all(vehicle.node().map()));
        map
    }

    /// Begins to keep what the actors do.
    pub(super) fn watch(&mut self) {
        let vehicles = self.vehicles.iter_mut();
        vehicles.for_each(|vehicle| vehicle.node_mut().watch());
        self.ground.node_mut().watch();
        let operators = self.operators.iter_mut();
        operators.for_each(|operator| operator.node_mut().watch());
    }

    /// Hands out what the actors have done since the last time.
    pub(super) fn steps(&mut self, mut to: impl FnMut(NodeId, Vec<ActorStep>)) {
        for vehicle in &mut self.vehicles {
            to(NodeId::Vehicle(vehicle.id()), vehicle.node_mut().steps());
        }
        to(NodeId::Ground, self.ground.node_mut().steps());
        for operator in &mut self.operators {
            to(NodeId::Operator(operator.id()), operator.node_mut().steps());
        }
    }

    /// Hands out the actors of all nodes as they are now, or only of those that were started anew since the last time.
    ///
    /// # Errors
    /// One cannot be written, which is a mistake of this program.
    pub(super) fn snapshots(
        &mut self,
        of_all: bool,
        mut to: impl FnMut(NodeId, Vec<Snapshot>),
    ) -> Result<(), EncodeError> {
        for vehicle in &mut self.vehicles {
            if vehicle.take_has_restarted() || of_all {
                to(
                    NodeId::Vehicle(vehicle.id()),
                    vehicle.node_mut().snapshots()?,
                );
            }
        }
        if self.ground.take_has_restarted() || of_all {
            to(NodeId::Ground, self.ground.node_mut().snapshots()?);
        }
        for operator in self.operators.iter_mut().filter(|_| of_all) {
            to(
                NodeId::Operator(operator.id()),
                operator.node_mut().snapshots()?,
            );
        }
        Ok(())
    }

    /// Takes the ground station out, as it is at the end.
    pub(super) fn into_ground(self) -> SimulatedGround {
        self.ground
    }
}

/// Returns how the log names a node.
pub(super) fn name_of(node: NodeId) -> String {
    match node {
        NodeId::Vehicle(vehicle) => format!("vehicle {vehicle}"),
        NodeId::Ground => "ground".to_owned(),
        NodeId::Operator(operator) => format!("operator {operator}"),
    }
}

/// Returns a hash of what a node holds of every layer of the map.
fn map_hash(digest: &Digest) -> u64 {
    let words = digest.layers.iter().flat_map(|layer| {
        let (vehicle, boot) = (
            u64::from(layer.layer.vehicle.0),
            u64::from(layer.layer.boot.0),
        );
        [vehicle, boot, u64::from(layer.tiles), layer.hash]
    });
    hash(words)
}
