//! The mission that a vehicle carries out by itself: under way, or ended, and how. Where it goes is said by its kind.

use serde::{Deserialize, Serialize};

use crate::geom::Point;
use crate::node::mission::EndReason;
use crate::node::mission::kind::{AnyBehaviour, Behaviour};

/// A mission, as far as it is.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) enum OwnMission {
    /// It says the next step.
    UnderWay(AnyBehaviour),
    /// It has ended: the vehicle goes home.
    Ended(EndReason),
}

impl OwnMission {
    /// Returns the mission to be told something; `None` once it has ended.
    pub(super) fn under_way(&mut self) -> Option<&mut dyn Behaviour> {
        match self {
            OwnMission::UnderWay(kind) => Some(kind.mission()),
            OwnMission::Ended(_) => None,
        }
    }

    /// Returns how it ended.
    pub(super) fn end(&self) -> Option<&EndReason> {
        match self {
            OwnMission::UnderWay(_) => None,
            OwnMission::Ended(end) => Some(end),
        }
    }

    /// Returns where it is going, or what it is going to see; `None` = nowhere, or it has ended.
    pub(super) fn goal(&self) -> Option<Point> {
        match self {
            OwnMission::UnderWay(kind) => kind.goal(),
            OwnMission::Ended(_) => None,
        }
    }

    /// Returns how many of its places are still to be visited; one that has no list of places has none.
    pub(super) fn places_left(&self) -> usize {
        match self {
            OwnMission::UnderWay(kind) => kind.places_left(),
            OwnMission::Ended(_) => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::VehicleSettings;
    use crate::node::tests_support::settings;
    use tomoswarm_proto::TaskKind;

    #[test]
    fn a_mission_that_has_ended_says_how_and_has_no_place_left() {
        let places = vec![Point::new(1.0, 0.0).into(), Point::new(2.0, 0.0).into()];
        let kind = AnyBehaviour::of(&VehicleSettings {
            task: Some(TaskKind::Pathfind { places }),
            ..settings(1)
        });
        let mut mission = OwnMission::UnderWay(kind.unwrap());
        assert_eq!((mission.places_left(), mission.end()), (2, None));
        assert!(mission.under_way().is_some());
        mission = OwnMission::Ended(EndReason::NoWay(1));
        assert_eq!(
            (mission.places_left(), mission.end()),
            (0, Some(&EndReason::NoWay(1)))
        );
        assert!(mission.under_way().is_none());
    }
}
