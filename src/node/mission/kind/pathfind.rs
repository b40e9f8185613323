//! Visits of places on paths around what is seen. Before it sets out and at every place it looks around. A place to which
//! no way leads is passed over: then everything that can be reached was searched.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::{Behaviour, MissionContext, MissionInput, MissionStep, PassedOver};
use crate::geom::Point;
use crate::node::mission::EndReason;

/// A mission that visits places.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Pathfind {
    is_begun: bool,
    /// Places that are still to be visited.
    places: VecDeque<Point>,
    /// Places to which no way leads.
    no_way: usize,
    /// Places that were given up although a way may lead there.
    given_up: usize,
}

impl Pathfind {
    /// Makes a mission that visits places in order.
    pub(crate) fn to(places: &[Point]) -> Pathfind {
        Pathfind {
            is_begun: false,
            places: places.iter().copied().collect(),
            no_way: 0,
            given_up: 0,
        }
    }

    /// Returns how many places are still to be visited.
    pub(crate) fn places_left(&self) -> usize {
        self.places.len()
    }

    fn next_place(&self) -> MissionStep {
        match (self.places.front(), self.given_up, self.no_way) {
            (Some(place), ..) => MissionStep::GoTo(*place),
            (None, 0, 0) => MissionStep::End(EndReason::Done),
            (None, 0, places) => MissionStep::End(EndReason::NoWay(places)),
            (None, places, _) => MissionStep::End(EndReason::GaveUp(places)),
        }
    }
}

impl Behaviour for Pathfind {
    fn next(&mut self, seen: MissionInput, _around: &MissionContext<'_>) -> MissionStep {
        match seen {
            MissionInput::Ready if !std::mem::replace(&mut self.is_begun, true) => {
                MissionStep::LookAround
            }
            MissionInput::Ready => self.next_place(),
            MissionInput::UnderWay | MissionInput::Autopilot(_) => MissionStep::GoOn,
            MissionInput::Arrived => {
                self.places.pop_front();
                MissionStep::LookAround
            }
            MissionInput::Blocked(_) => MissionStep::TryAgain,
            MissionInput::Looked { .. } => MissionStep::Think,
        }
    }

    fn goal(&self) -> Option<Point> {
        self.places.front().copied()
    }

    fn give_up(&self) -> EndReason {
        EndReason::GaveUp(self.given_up + self.places.len())
    }

    fn pass_over(&mut self, why: PassedOver) {
        self.places.pop_front();
        match why {
            PassedOver::NoWay => self.no_way += 1,
            PassedOver::GivenUp => self.given_up += 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests_support::{LOOKED, obstacle, step};
    use super::*;

    const PLACES: [Point; 2] = [Point { x_m: 2.0, y_m: 0.0 }, Point { x_m: 2.0, y_m: 3.0 }];

    /// A mission to [`PLACES`] that has looked around where it begins.
    fn begun() -> Pathfind {
        let mut pathfind = Pathfind::to(&PLACES);
        assert_eq!(
            step(&mut pathfind, MissionInput::Ready, (0.0, 0.0)),
            MissionStep::LookAround
        );
        assert_eq!(step(&mut pathfind, LOOKED, (0.0, 0.0)), MissionStep::Think);
        pathfind
    }

    #[test]
    fn it_looks_around_at_every_place() {
        let mut pathfind = begun();
        for place in PLACES {
            assert_eq!(
                step(&mut pathfind, MissionInput::Ready, (0.0, 0.0)),
                MissionStep::GoTo(place)
            );
            assert_eq!(
                step(&mut pathfind, MissionInput::Arrived, (place.x_m, place.y_m)),
                MissionStep::LookAround
            );
        }
        assert_eq!(
            step(&mut pathfind, MissionInput::Ready, (2.0, 3.0)),
            MissionStep::End(EndReason::Done)
        );
    }

    #[test]
    fn what_is_in_the_way_is_no_reason_to_pass_a_place_over() {
        let mut pathfind = begun();
        assert_eq!(
            step(
                &mut pathfind,
                MissionInput::Blocked(obstacle(1.0, 0.0)),
                (0.5, 0.0)
            ),
            MissionStep::TryAgain
        );
        assert_eq!(
            step(&mut pathfind, MissionInput::Ready, (0.5, 0.0)),
            MissionStep::GoTo(PLACES[0])
        );
    }

    #[test]
    fn the_end_says_what_became_of_the_places() {
        use PassedOver::{GivenUp, NoWay};
        let end = |passed: [Option<PassedOver>; 2]| {
            let mut pathfind = begun();
            for why in passed {
                match why {
                    Some(why) => pathfind.pass_over(why),
                    None => drop(step(&mut pathfind, MissionInput::Arrived, (0.0, 0.0))),
                }
            }
            step(&mut pathfind, MissionInput::Ready, (0.0, 0.0))
        };
        assert_eq!(
            end([None, Some(NoWay)]),
            MissionStep::End(EndReason::NoWay(1))
        );
        assert_eq!(
            end([Some(NoWay), Some(NoWay)]),
            MissionStep::End(EndReason::NoWay(2))
        );
        assert_eq!(
            end([Some(GivenUp), None]),
            MissionStep::End(EndReason::GaveUp(1))
        );
        assert_eq!(
            end([Some(GivenUp), Some(NoWay)]),
            MissionStep::End(EndReason::GaveUp(1))
        );
    }

    #[test]
    fn who_gives_up_says_how_many_places_it_has_given_up() {
        let mut pathfind = begun();
        step(&mut pathfind, MissionInput::Arrived, (2.0, 0.0));
        assert_eq!(pathfind.give_up(), EndReason::GaveUp(1));
        let mut pathfind = begun();
        pathfind.pass_over(PassedOver::GivenUp);
        assert_eq!(
            pathfind.give_up(),
            EndReason::GaveUp(2),
            "one of them was given up before"
        );
    }
}
