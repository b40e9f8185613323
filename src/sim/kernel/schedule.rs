//! The time of a run: what is still to happen, what time it is, and when the run is over. It does not know what follows from an
//! event.

use std::sync::Arc;
use std::time::Duration;

use super::nodes::NodePlace;
use crate::sim::bus::{BusFrame, NodeId};
use crate::sim::faults::SoftwareFaultEvent;
use crate::sim::noise::Noise;
use crate::sim::queue::EventQueue;
use crate::time::Time;

/// After the end the sensors and radios are silent and nobody drives; the bus carries on for this long.
const SETTLES: Duration = Duration::from_secs(20);

/// What is to happen.
pub(super) enum ScheduledEvent {
    Wake {
        node: NodePlace,
        generation: u64,
    },
    /// A node's exchange has something to send, or must decide whether it takes part.
    Exchange {
        node: NodePlace,
        generation: u64,
    },
    /// Something is to happen in the environment.
    Environment,
    Deliver {
        to: NodeId,
        frame: Arc<BusFrame>,
    },
    Fault(SoftwareFaultEvent),
    /// The operators join the bus.
    OperatorsBegin,
}

impl ScheduledEvent {
    /// Returns whether it concerns nobody but an operator.
    pub(super) fn is_of_operator(&self) -> bool {
        match self {
            ScheduledEvent::Wake { node, .. } | ScheduledEvent::Exchange { node, .. } => match node
            {
                NodePlace::Operator(_) => true,
                NodePlace::Vehicle(_) | NodePlace::Ground => false,
            },
            ScheduledEvent::Deliver { to, .. } => match to {
                NodeId::Operator(_) => true,
                NodeId::Ground | NodeId::Vehicle(_) => false,
            },
            ScheduledEvent::OperatorsBegin => true,
            ScheduledEvent::Environment | ScheduledEvent::Fault(_) => false,
        }
    }
}

/// The events to come, and the time.
pub(super) struct Schedule {
    queue: EventQueue<ScheduledEvent>,
    now: Time,
    until: Time,
    ended_at: Option<Time>,
}

impl Schedule {
    /// Makes one in which nothing is to happen, of a run that lasts this long at most; with `ties` events of one moment
    /// come in an order drawn from it.
    pub(super) fn new(until: Time, ties: Option<Noise>) -> Schedule {
        Schedule {
            queue: EventQueue::new(ties),
            now: Time::ZERO,
            until,
            ended_at: None,
        }
    }

    /// Returns what time it is.
    pub(super) fn now(&self) -> Time {
        self.now
    }

    /// Lets something happen at a moment.
    pub(super) fn push(&mut self, at: Time, event: ScheduledEvent) {
        self.queue.push(at, event);
    }

    /// Returns what happens next; the time is that of it then. `None` = nothing happens any more.
    pub(super) fn pop(&mut self) -> Option<ScheduledEvent> {
        let (at, event) = self.queue.pop().filter(|(at, _)| *at <= self.until)?;
        debug_assert!(at >= self.now, "time never goes back");
        self.now = at;
        Some(event)
    }

    /// Ends the run now, but for what is still on its way.
    pub(super) fn end(&mut self) {
        if self.ended_at.is_none() {
            self.ended_at = Some(self.now);
            self.until = self.until.min(self.now + SETTLES);
        }
    }

    /// Returns when the run has ended, if it has.
    pub(super) fn ended_at(&self) -> Option<Time> {
        self.ended_at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn secs(seconds_s: f64) -> Time {
        Time::from_secs_f64(seconds_s)
    }

    fn schedule(at_s: &[f64]) -> Schedule {
        let mut schedule = Schedule::new(secs(100.0), None);
        at_s.iter()
            .for_each(|at_s| schedule.push(secs(*at_s), ScheduledEvent::Environment));
        schedule
    }

    #[test]
    fn it_is_as_late_as_the_last_event_and_none_comes_after_the_end() {
        let mut schedule = schedule(&[99.0, 3.0, 101.0]);
        let times: Vec<Time> =
            std::iter::from_fn(|| schedule.pop().map(|_| schedule.now())).collect();
        assert_eq!(times, [secs(3.0), secs(99.0)]);
        assert_eq!(schedule.ended_at(), None);
    }

    #[test]
    fn what_is_on_its_way_still_happens_after_the_end() {
        let mut schedule = schedule(&[3.0, 5.0, 22.9, 23.1]);
        schedule.pop();
        schedule.end();
        schedule.pop();
        schedule.end();
        assert_eq!(schedule.ended_at(), Some(secs(3.0)), "it ends once");
        assert!(schedule.pop().is_some() && schedule.pop().is_none());
        assert_eq!(schedule.now(), secs(22.9));
    }

    #[test]
    fn what_concerns_an_operator_alone_is_known() {
        let frame = Arc::new(BusFrame::of_bytes(NodeId::Ground, &[]));
        let operator = NodeId::Operator(tomoswarm_proto::OperatorId(1));
        for (to, expected) in [(operator, true), (NodeId::Ground, false)] {
            let frame = frame.clone();
            assert_eq!(
                ScheduledEvent::Deliver { to, frame }.is_of_operator(),
                expected
            );
        }
        for (node, expected) in [
            (NodePlace::Operator(0), true),
            (NodePlace::Ground, false),
            (NodePlace::Vehicle(3), false),
        ] {
            let generation = 1;
            assert_eq!(
                ScheduledEvent::Wake { node, generation }.is_of_operator(),
                expected
            );
            assert_eq!(
                ScheduledEvent::Exchange { node, generation }.is_of_operator(),
                expected
            );
        }
        assert!(
            ScheduledEvent::OperatorsBegin.is_of_operator()
                && !ScheduledEvent::Environment.is_of_operator()
        );
    }
}
