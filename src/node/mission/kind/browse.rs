//! A look all around from where the vehicle stands. It goes nowhere.

use serde::{Deserialize, Serialize};

use super::{Behaviour, MissionContext, MissionInput, MissionStep};
use crate::node::mission::EndReason;

/// A mission that looks around once.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Browse {
    is_begun: bool,
}

impl Behaviour for Browse {
    fn next(&mut self, seen: MissionInput, _around: &MissionContext<'_>) -> MissionStep {
        match seen {
            MissionInput::Ready if !std::mem::replace(&mut self.is_begun, true) => {
                MissionStep::LookAround
            }
            MissionInput::Ready => MissionStep::End(EndReason::Done),
            MissionInput::UnderWay => MissionStep::GoOn,
            MissionInput::Arrived | MissionInput::Blocked(_) | MissionInput::Looked { .. } => {
                MissionStep::Think
            }
        }
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
