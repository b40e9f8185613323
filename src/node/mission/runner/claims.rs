//! Whether the vehicle may say that something is done, seen or unreachable: it knows its place, and its range sensors answer.

use super::{Phase, RunnerContext, StepRunner, WAIT};
use crate::node::mission::Out;
use crate::node::vehicle::MoveCommand;

impl StepRunner {
    /// Without range sensors it goes where it is going, over what is known; then the mission waits until they answer, or ends
    /// for that. Returns whether nothing else is done.
    pub(super) fn waits_to_see(&mut self, scene: &mut RunnerContext<'_>) -> bool {
        // What was not passed meanwhile was not looked at.
        self.barred.clear();
        match self.phase {
            Phase::Choosing { from } if self.end().is_none() => {
                from > scene.now || !self.may_claim(scene)
            }
            Phase::Looking { .. } => !self.may_claim(scene),
            // Nobody knows what the autopilot drives into.
            Phase::Following { .. } => {
                scene.out.push(Out::Command(scene.now, MoveCommand::Hold));
                self.think(scene.now);
                true
            }
            Phase::Choosing { .. } | Phase::Driving { .. } | Phase::Over => false,
        }
    }

    /// Returns whether place and sensors are so good that what is said of the mission is true; otherwise that is waited
    /// for, or the mission ends for it.
    pub(super) fn may_claim(&mut self, scene: &mut RunnerContext<'_>) -> bool {
        if scene.place.may_claim() {
            return true;
        }
        if scene.place.wait(scene.now) {
            let end = scene.place.reason();
            self.finish(scene, end);
        } else {
            self.choose_at(scene.now + WAIT);
        }
        false
    }
}
