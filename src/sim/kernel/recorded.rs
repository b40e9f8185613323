//! A run that hands out what its actors do. It changes nothing in the run.

use std::time::Duration;

use super::{Kernel, NodeId, Time};
use crate::actor::{ActorStep, Fault};
use crate::node::VehicleNode;
use crate::sim::entry::SampleFile;

/// Where a recording goes, and when its next segment begins.
pub(in crate::sim) struct Recording<'a> {
    record: &'a mut dyn FnMut(SampleFile),
    every: Duration,
    next_at: Time,
}

impl<'a> Recording<'a> {
    /// Makes a recording that goes where `record` says; a new segment begins `every` so often.
    pub fn to(record: &'a mut dyn FnMut(SampleFile), every: Duration) -> Recording<'a> {
        Recording {
            record,
            every,
            next_at: Time::ZERO,
        }
    }
}

impl Kernel {
    /// Begins to keep what the actors do.
    pub(super) fn watch_actors(&mut self) {
        self.vehicles.iter_mut().for_each(VehicleNode::watch);
        self.ground.watch();
        self.operators
            .iter_mut()
            .for_each(|operator| operator.node.watch());
    }

    /// Hands out what the actors have done since the last time.
    pub(super) fn hand_out(&mut self, recording: &mut Recording<'_>) -> Result<(), Fault> {
        let mut hand_out = |node: NodeId, steps: Vec<ActorStep>| {
            steps
                .into_iter()
                .for_each(|step| (recording.record)(SampleFile::Step(node, step)));
        };
        for vehicle in &mut self.vehicles {
            hand_out(NodeId::Vehicle(vehicle.id()), vehicle.steps());
        }
        hand_out(NodeId::Ground, self.ground.steps());
        for operator in &mut self.operators {
            hand_out(NodeId::Operator(operator.id), operator.node.steps());
        }
        let is_due = self.now >= recording.next_at;
        if is_due {
            recording.next_at = self.now + recording.every;
        }
        // Who was started anew does not go on from the steps before.
        let anew = std::mem::take(&mut self.begun_anew);
        if !is_due && anew.is_empty() {
            return Ok(());
        }
        let begins = |node: &NodeId| is_due || anew.contains(node);
        let unwritable = |error: tomoswarm_proto::codec::EncodeError| Fault {
            actor: "snapshot",
            reason: error.to_string(),
        };
        let now = self.now;
        for vehicle in self
            .vehicles
            .iter_mut()
            .filter(|vehicle| begins(&NodeId::Vehicle(vehicle.id())))
        {
            let (node, snapshots) = (
                NodeId::Vehicle(vehicle.id()),
                vehicle.snapshots().map_err(unwritable)?,
            );
            (recording.record)(SampleFile::Segment {
                node,
                now,
                snapshots,
            });
        }
        if begins(&NodeId::Ground) {
            let (node, snapshots) = (NodeId::Ground, self.ground.snapshots().map_err(unwritable)?);
            (recording.record)(SampleFile::Segment {
                node,
                now,
                snapshots,
            });
        }
        for operator in self
            .operators
            .iter_mut()
            .filter(|operator| begins(&NodeId::Operator(operator.id)))
        {
            let snapshots = operator.node.snapshots().map_err(unwritable)?;
            (recording.record)(SampleFile::Segment {
                node: NodeId::Operator(operator.id),
                now,
                snapshots,
            });
        }
        Ok(())
    }
}
