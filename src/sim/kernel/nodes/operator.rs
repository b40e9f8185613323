//! A simulated operator: its node, what it is interested in, and what it is to do by itself. One that only listens says
//! nothing, and changes nothing.

use tomoswarm_proto::{Interest, OperatorId};

use super::Alarm;
use crate::actor::Fault;
use crate::operator::OperatorNode;
use crate::operator::operator_actor::{In, OperatorSettings, Out};
use crate::operator::script::{ScriptEnd, ScriptStep};
use crate::time::Time;

/// An operator in the simulation.
pub(in crate::sim) struct SimulatedOperator {
    id: OperatorId,
    node: OperatorNode,
    interest: Vec<Interest>,
    /// What it is to do by itself; empty for one that only listens, and once it does it.
    script: Vec<ScriptStep>,
    script_end: Option<ScriptEnd>,
    alarm: Alarm,
}

impl SimulatedOperator {
    /// Makes an operator that hears of the fleet, and follows a script if that has steps.
    pub(crate) fn new(
        id: OperatorId,
        mut settings: OperatorSettings,
        script: Vec<ScriptStep>,
    ) -> SimulatedOperator {
        SimulatedOperator {
            id,
            interest: settings.hello.interest.clone(),
            node: OperatorNode::new(&mut settings),
            script,
            script_end: None,
            alarm: Alarm::default(),
        }
    }

    /// Returns which operator it is.
    pub(crate) fn id(&self) -> OperatorId {
        self.id
    }

    /// Returns what it is interested in.
    pub(crate) fn interest(&self) -> &[Interest] {
        &self.interest
    }

    /// Returns its node.
    #[cfg(test)]
    pub fn node(&self) -> &OperatorNode {
        &self.node
    }

    /// Returns its node, to be watched.
    pub(crate) fn node_mut(&mut self) -> &mut OperatorNode {
        &mut self.node
    }

    /// Returns how its script has ended, if it has.
    #[cfg(test)]
    pub fn script_end(&self) -> Option<&ScriptEnd> {
        self.script_end.as_ref()
    }

    pub(super) fn alarm_mut(&mut self) -> &mut Alarm {
        &mut self.alarm
    }

    pub(super) fn alarm_and_deadline(&mut self) -> (&mut Alarm, Option<Time>) {
        let deadline = self.node.deadline();
        (&mut self.alarm, deadline.map(|deadline| deadline.at))
    }

    /// Returns what it is told when it joins the bus: that it can hear, and what it is to do.
    pub(crate) fn begin(&mut self) -> impl Iterator<Item = In> + use<> {
        let script = std::mem::take(&mut self.script);
        let follow = (!script.is_empty()).then_some(In::Follow(script));
        std::iter::once(In::Linked(true)).chain(follow)
    }

    /// Tells its node something.
    ///
    /// # Errors
    /// An actor cannot go on.
    pub(crate) fn tell(
        &mut self,
        now: Time,
        input: In,
        effects: &mut Vec<Out>,
    ) -> Result<(), Fault> {
        self.node.tell(now, input, effects)
    }

    /// Lets its node do what is due.
    ///
    /// # Errors
    /// An actor cannot go on.
    pub(crate) fn wake(&mut self, now: Time, effects: &mut Vec<Out>) -> Result<(), Fault> {
        self.node.wake(now, effects)
    }

    /// Its script has ended.
    pub(crate) fn end_script(&mut self, end: ScriptEnd) {
        self.script_end = Some(end);
    }
}
