//! Operators as nodes of the simulation: they hear what the table lets them hear, as far as they are interested in it,
//! and what they say is carried out. An operator that only listens says nothing, and changes nothing.

use tomoswarm_proto::{Interest, OperatorId};

use super::Kernel;
use crate::actor::Fault;
use crate::exchange::ingress::HeardMessage;
use crate::operator::OperatorNode;
use crate::operator::operator_actor::{In, OperatorSettings, Out};
use crate::operator::script::{ScriptEnd, ScriptStep};
use crate::sim::operator_script::{PERSONS_ENTER, SCENARIO_OPERATOR};

/// An operator in the simulation.
pub(in crate::sim) struct SimulatedOperator {
    pub id: OperatorId,
    pub node: OperatorNode,
    pub interest: Vec<Interest>,
    /// What it is to do by itself; empty for one that only listens.
    pub script: Vec<ScriptStep>,
    /// How its script ended.
    pub ended: Option<ScriptEnd>,
    effects: Vec<Out>,
}

impl SimulatedOperator {
    /// Makes an operator that hears of the fleet, and follows a script if that has steps.
    pub fn new(
        id: OperatorId,
        mut settings: OperatorSettings,
        script: Vec<ScriptStep>,
    ) -> SimulatedOperator {
        let interest = settings.hello.interest.clone();
        let (node, effects) = (OperatorNode::new(&mut settings), Vec::new());
        SimulatedOperator {
            id,
            node,
            interest,
            script,
            ended: None,
            effects,
        }
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

    pub(super) fn deliver_to_operator(
        &mut self,
        id: OperatorId,
        heard: HeardMessage,
    ) -> Result<(), Fault> {
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
                self.carry_out_one_of_operator(index, said)?;
            }
        }
        self.set_alarm(self.vehicles.len() + 1 + index);
        Ok(())
    }

    fn carry_out_one_of_operator(&mut self, index: usize, said: Out) -> Result<(), Fault> {
        let id = self.operators[index].id;
        if let Some(words) = said.in_words() {
            self.log(&format!("operator {id}"), format_args!("{words}"));
        }
        match said {
            Out::Publish(message) => self.publish(self.vehicles.len() + 1 + index, &message),
            Out::Announce(name) => return self.cue(index, &name),
            Out::ScriptEnded(end) => self.script_ended(index, end),
            Out::InForce(..) | Out::Ended(..) | Out::Give(_) | Out::StopsNote(_) => {}
        }
        Ok(())
    }

    /// Does what an operator asks for outside the bus; what is not known here is not done, and the operator gives up.
    fn cue(&mut self, index: usize, name: &str) -> Result<(), Fault> {
        if name != PERSONS_ENTER {
            return Ok(());
        }
        let mut said = Vec::new();
        self.environment.let_persons_enter(self.now, &mut said);
        self.schedule(&mut said);
        self.log("scenario", format_args!("the persons enter"));
        let operator = &mut self.operators[index];
        operator
            .node
            .tell(self.now, In::CueDone, &mut operator.effects)
    }

    /// The script of the scenario's operator is what the run is about.
    fn script_ended(&mut self, index: usize, end: ScriptEnd) {
        if self.operators[index].id == SCENARIO_OPERATOR {
            self.follow(self.judge.script_ended(&end));
        }
        self.operators[index].ended = Some(end);
    }
}
