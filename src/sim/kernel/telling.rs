//! How nodes are told something: what they want done then is carried out at once.

use super::Kernel;
use super::nodes::NodePlace;
use crate::actor::Fault;
use crate::node::health::HealthFacts;
use crate::operator::operator_actor::In;
use crate::{ground, node};

impl Kernel {
    /// Tells a vehicle something; one whose software does not run hears nothing.
    pub(super) fn tell(&mut self, vehicle: usize, event: node::Event) -> Result<(), Fault> {
        if self.nodes.vehicles()[vehicle].is_dead() {
            return Ok(());
        }
        let mut effects = std::mem::take(&mut self.scratch.vehicle);
        let (now, actors) = (self.schedule.now(), self.nodes.vehicle_mut(vehicle));
        actors.tell(now, event, &mut effects)?;
        self.carry_out(vehicle, effects)
    }

    pub(super) fn tell_ground(&mut self, event: ground::Event) -> Result<(), Fault> {
        let mut effects = std::mem::take(&mut self.scratch.ground);
        let (now, actors) = (self.schedule.now(), self.nodes.ground_mut());
        actors.tell(now, event, &mut effects)?;
        self.carry_out_of_ground(effects);
        Ok(())
    }

    pub(super) fn tell_operator(&mut self, operator: usize, input: In) -> Result<(), Fault> {
        let mut effects = Vec::new();
        let (now, actors) = (self.schedule.now(), self.nodes.operator_mut(operator));
        actors.tell(now, input, &mut effects)?;
        self.carry_out_of_operator(operator, effects)
    }

    pub(super) fn begin_operators(&mut self) -> Result<(), Fault> {
        for operator in 0..self.nodes.operators().len() {
            for input in self.nodes.operator_mut(operator).begin() {
                self.tell_operator(operator, input)?;
            }
        }
        Ok(())
    }

    /// Tells every vehicle how its devices and its side of the bus have fared, as the edge of a live one does.
    pub(super) fn tell_facts(&mut self) -> Result<(), Fault> {
        for vehicle in 0..self.nodes.vehicles().len() {
            let of_bus = self.network.counts(NodePlace::Vehicle(vehicle));
            let facts = HealthFacts {
                inputs_dropped: self.nodes.vehicle_mut(vehicle).node_mut().dropped(),
                frames_refused: of_bus.refused,
                frames_unknown: of_bus.unknown,
                ..self.environment.facts(vehicle)
            };
            self.tell(vehicle, node::Event::Facts(Box::new(facts)))?;
        }
        Ok(())
    }
}
