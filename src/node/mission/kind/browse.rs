//! A look all around from where the vehicle stands. It goes nowhere.

use serde::{Deserialize, Serialize};

use super::{MissionKind, Seen, Step, Surroundings};
use crate::node::mission::End;

/// A mission that looks around once.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Browse {
    is_begun: bool,
}

impl MissionKind for Browse {
    fn next(&mut self, seen: Seen, _around: &Surroundings<'_>) -> Step {
        match seen {
            Seen::Ready if !std::mem::replace(&mut self.is_begun, true) => Step::LookAround,
            Seen::Ready => Step::End(End::Done),
            Seen::UnderWay => Step::GoOn,
            Seen::Arrived | Seen::Blocked(_) | Seen::Looked { .. } => Step::Think,
        }
    }

    fn give_up(&self) -> End {
        End::NoRoom
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests_support::{LOOKED, step};
    use super::*;

    #[test]
    fn it_looks_around_once_and_has_ended() {
        let mut browse = Browse::default();
        let steps =
            [Seen::Ready, LOOKED, Seen::Ready].map(|seen| step(&mut browse, seen, (0.0, 0.0)));
        assert_eq!(steps, [Step::LookAround, Step::Think, Step::End(End::Done)]);
    }
}
