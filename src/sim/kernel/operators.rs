//! Operators as nodes of the simulation: they hear what the table lets them hear, as far as they are interested in it,
//! and what they say is carried out. An operator that only listens says nothing, and changes nothing.

use tomoswarm_proto::{Interest, OperatorId};

use super::{Kernel, NodeId};
use crate::actor::Fault;
use crate::exchange::ingress::Heard;
use crate::operator::operator_actor::{In, OperatorSettings, Out};
use crate::operator::script::{ScriptEnd, Step};
use crate::operator::wiring::OperatorNode;

/// What becomes of what an operator says.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(not(test), expect(dead_code, reason = "outside of tests the scenario's script still drives"))]
pub(in crate::sim) enum Part {
    /// It goes to the bus, and cues are carried out.
    Plays,
    /// It is written down. Nobody hears it, and every cue is done at once.
    Shadows,
}

/// An operator in the simulation.
pub(in crate::sim) struct SimulatedOperator {
    pub id: OperatorId,
    pub node: OperatorNode,
    pub interest: Vec<Interest>,
    pub part: Part,
    /// What it is to do by itself; empty for one that only listens.
    pub script: Vec<Step>,
    /// What a shadow has said.
    pub said: Vec<Out>,
    /// How its script ended.
    pub ended: Option<ScriptEnd>,
    effects: Vec<Out>,
}

impl SimulatedOperator {
    /// Makes an operator that hears of the fleet, and follows a script if that has steps.
    pub fn new(
        id: OperatorId,
        mut settings: OperatorSettings,
        part: Part,
        script: Vec<Step>,
    ) -> SimulatedOperator {
        let interest = settings.hello.interest.clone();
        let (node, said, effects) = (OperatorNode::new(&mut settings), Vec::new(), Vec::new());
        SimulatedOperator { id, node, interest, part, script, said, ended: None, effects }
    }
}

impl Kernel {
    /// Tells the operators what to do; those without a script hear only.
    pub(super) fn prime_operators(&mut self) -> Result<(), Fault> {
        for index in 0..self.operators.len() {
            let script = std::mem::take(&mut self.operators[index].script);
            self.tell_operator(index, In::Linked(true))?;
            if !script.is_empty() {
                self.tell_operator(index, In::Follow(script))?;
            }
        }
        Ok(())
    }

    pub(super) fn deliver_to_operator(&mut self, id: OperatorId, heard: Heard) -> Result<(), Fault> {
        match self.operators.iter().position(|operator| operator.id == id) {
            Some(index) => self.tell_operator(index, In::Bus(heard)),
            None => Ok(()),
        }
    }

    pub(super) fn tell_operator(&mut self, index: usize, input: In) -> Result<(), Fault> {
        let operator = &mut self.operators[index];
        operator.node.tell(self.now, input, &mut operator.effects)?;
        self.carry_out_operator(index)
    }

    pub(super) fn wake_operator(&mut self, index: usize) -> Result<(), Fault> {
        let operator = &mut self.operators[index];
        operator.node.wake(self.now, &mut operator.effects)?;
        self.carry_out_operator(index)
    }

    /// Carries out what an operator wants done, until it wants nothing more.
    fn carry_out_operator(&mut self, index: usize) -> Result<(), Fault> {
        while !self.operators[index].effects.is_empty() {
            for said in std::mem::take(&mut self.operators[index].effects) {
                match self.operators[index].part {
                    Part::Plays => self.carry_out_one_of_operator(index, said)?,
                    Part::Shadows => self.write_down(index, said)?,
                }
            }
        }
        self.set_alarm(self.vehicles.len() + 1 + index);
        Ok(())
    }

    fn carry_out_one_of_operator(&mut self, index: usize, said: Out) -> Result<(), Fault> {
        match said {
            Out::Publish(message) => {
                self.publish(NodeId::Operator(self.operators[index].id), &message);
                Ok(())
            }
            Out::Cue(_) => self.cue_done(index),
            Out::ScriptEnded(end) => {
                self.operators[index].ended = Some(end);
                Ok(())
            }
            Out::InForce(..) | Out::Ended(..) => Ok(()),
        }
    }

    fn write_down(&mut self, index: usize, said: Out) -> Result<(), Fault> {
        let is_cue = matches!(said, Out::Cue(_));
        self.operators[index].said.push(said);
        if is_cue { self.cue_done(index) } else { Ok(()) }
    }

    fn cue_done(&mut self, index: usize) -> Result<(), Fault> {
        let operator = &mut self.operators[index];
        operator.node.tell(self.now, In::CueDone, &mut operator.effects)
    }
}
