//! The operator on the real bus: a thin loop that feeds its actors with what is heard and with the time, and publishes what
//! they say. It decides nothing, and shows nothing.

use super::bus::HeardMessage;
use super::operator_session::Session;
use crate::actor::Fault;
use crate::operator::OperatorNode;
use crate::operator::fleet_view::FleetView;
use crate::operator::operator_actor::{In, OperatorSettings, Out};
use crate::time::Time;

/// Messages taken before whoever shows the operator has its turn.
const AT_ONCE: usize = 1000;

/// An operator and its part of the bus.
pub struct LiveOperator {
    session: Session,
    node: OperatorNode,
    /// What it is told when it goes on.
    unread: Vec<In>,
    is_linked: bool,
    /// The latest moment that the operator was told.
    latest: Time,
}

impl LiveOperator {
    /// Joins an operator with its part of the bus.
    pub fn new(session: Session, mut settings: OperatorSettings) -> LiveOperator {
        let node = OperatorNode::new(&mut settings);
        LiveOperator {
            session,
            node,
            unread: Vec::new(),
            is_linked: false,
            latest: Time::ZERO,
        }
    }

    /// Tells the operator something; it acts on it when it goes on.
    pub fn tell(&mut self, input: In) {
        self.unread.push(input);
    }

    /// Returns what the operator knows of the fleet.
    pub fn view(&self) -> &FleetView {
        self.node.actors().operator.place.actor().view()
    }

    /// Returns its part of the bus.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// Returns the time since it joined.
    pub fn now(&self) -> Time {
        self.session.now()
    }

    /// Goes on until something was heard or said, or a moment has come. `observe` sees all that is heard; what the
    /// operator says beside its messages is returned.
    ///
    /// # Errors
    /// The operator cannot go on.
    pub fn go_on(
        &mut self,
        until: Time,
        mut observe: impl FnMut(Time, &HeardMessage),
    ) -> Result<Vec<Out>, Fault> {
        let is_linked = self.session.look_for_links();
        if is_linked != self.is_linked {
            self.is_linked = is_linked;
            self.unread.push(In::Linked(is_linked));
        }
        let mut output = Vec::new();
        self.act(self.now(), &mut output)?;
        let due = self
            .node
            .deadline()
            .map_or(until, |deadline| deadline.at.min(until));
        let mut next = self
            .session
            .hear(if output.is_empty() { due } else { Time::ZERO });
        for _ in 0..AT_ONCE {
            let Some((at, heard)) = next else { break };
            observe(at, &heard);
            self.unread.push(In::Bus(heard));
            self.act(at, &mut output)?;
            next = self.session.hear(Time::ZERO);
        }
        Ok(output)
    }

    /// Leaves the bus.
    pub fn close(self) {
        self.session.close();
    }

    /// Lets the operator act. What has waited to be read came before what was done meanwhile; time does not go back.
    fn act(&mut self, at: Time, output: &mut Vec<Out>) -> Result<(), Fault> {
        self.latest = self.latest.max(at);
        let mut effects = Vec::new();
        if self
            .node
            .deadline()
            .is_some_and(|deadline| deadline.at <= self.latest)
        {
            self.node.wake(self.latest, &mut effects)?;
        }
        for input in std::mem::take(&mut self.unread) {
            self.node.tell(self.latest, input, &mut effects)?;
        }
        let publisher = self.session.publisher();
        for out in effects {
            match out {
                Out::Publish(message) => publisher.publish(&message),
                Out::Give(_) => {}
                Out::InForce(..)
                | Out::Ended(..)
                | Out::Marked(..)
                | Out::Announce(_)
                | Out::ScriptEnded(_)
                | Out::StopEvent(_) => {
                    output.push(out);
                }
            }
        }
        Ok(())
    }
}
