//! A look all around from where the vehicle stands. It goes nowhere.

use serde::{Deserialize, Serialize};

use super::{Behaviour, MissionContext, MissionInput, MissionStep};
use crate::geom::Point;
use crate::node::mission::EndReason;

/// A mission that looks around once.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Browse {
    has_looked: bool,
}

impl Behaviour for Browse {
    fn next(&mut self, seen: MissionInput, _around: &MissionContext<'_>) -> MissionStep {
        match seen {
            MissionInput::Ready if !self.has_looked => MissionStep::LookAround,
            MissionInput::Ready => MissionStep::End(EndReason::Done),
            MissionInput::UnderWay | MissionInput::Autopilot(_) => MissionStep::GoOn,
            MissionInput::Looked { .. } => {
                self.has_looked = true;
                MissionStep::Think
            }
            MissionInput::Arrived | MissionInput::Blocked(_) => MissionStep::Think,
        }
    }

    fn goal(&self) -> Option<Point> {
        None
    }

    fn give_up(&self) -> EndReason {
        EndReason::NoRoom
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests_support::{LOOKED, step};
    use super::*;

    #[test]
    fn a_look_that_was_interrupted_is_begun_again() {
        let mut browse = Browse::default();
        for _ in 0..2 {
            let begun = step(&mut browse, MissionInput::Ready, (0.0, 0.0));
            assert_eq!(begun, MissionStep::LookAround);
        }
    }

    #[test]
    fn it_looks_around_once_and_has_ended() {
        let mut browse = Browse::default();
        let steps = [MissionInput::Ready, LOOKED, MissionInput::Ready]
            .map(|seen| step(&mut browse, seen, (0.0, 0.0)));
        assert_eq!(
            steps,
            [
                MissionStep::LookAround,
                MissionStep::Think,
                MissionStep::End(EndReason::Done)
            ]
        );
    }
}
