//! Straight legs: from place to place without a path around anything; it ends in front of what stands there.
//! Peers that are in the way are waited for, as in every mission: that is the runner's.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::{Behaviour, MissionContext, MissionInput, MissionStep};
use crate::geom::{Point, Vector};
use crate::node::mission::EndReason;

/// A mission of straight legs.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Straight {
    /// Places that are still to be visited.
    places: VecDeque<Point>,
    /// How far ahead of where it begins the only place lies, metres; `None` when the places are known.
    ahead_m: Option<f64>,
}

impl Straight {
    /// Makes a mission that visits places in order.
    pub(crate) fn along(places: &[Point]) -> Straight {
        Straight {
            places: places.iter().copied().collect(),
            ahead_m: None,
        }
    }

    /// Makes a mission that goes straight ahead, as the vehicle stands when it begins.
    pub(crate) fn ahead(distance_m: f64) -> Straight {
        Straight {
            places: VecDeque::new(),
            ahead_m: Some(distance_m),
        }
    }

    /// Returns how many places are still to be visited.
    pub(crate) fn places_left(&self) -> usize {
        self.places.len() + usize::from(self.ahead_m.is_some())
    }

    fn next_leg(&mut self, around: &MissionContext<'_>) -> MissionStep {
        if let Some(ahead_m) = self.ahead_m.take() {
            self.places
                .push_back(around.pose.at + Vector::polar(around.pose.heading, ahead_m));
        }
        self.places
            .front()
            .map_or(MissionStep::End(EndReason::Done), |place| {
                MissionStep::GoStraight(*place)
            })
    }
}

impl Behaviour for Straight {
    fn next(&mut self, seen: MissionInput, around: &MissionContext<'_>) -> MissionStep {
        match seen {
            MissionInput::Ready => self.next_leg(around),
            MissionInput::UnderWay | MissionInput::Autopilot(_) => MissionStep::GoOn,
            MissionInput::Arrived => {
                self.places.pop_front();
                MissionStep::Think
            }
            MissionInput::Blocked(by) => MissionStep::End(EndReason::Stopped(by)),
            MissionInput::Looked { .. } => MissionStep::Think,
        }
    }

    fn goal(&self) -> Option<Point> {
        self.places.front().copied()
    }

    fn give_up(&self) -> EndReason {
        EndReason::GaveUp(self.places.len())
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests_support::{obstacle, step};
    use super::*;

    #[test]
    fn places_are_visited_in_order_and_then_it_has_ended() {
        let places = [Point::new(2.0, 0.0), Point::new(2.0, 3.0)];
        let mut legs = Straight::along(&places);
        for place in places {
            assert_eq!(
                step(&mut legs, MissionInput::Ready, (0.0, 0.0)),
                MissionStep::GoStraight(place)
            );
            assert_eq!(
                step(&mut legs, MissionInput::UnderWay, (1.0, 0.0)),
                MissionStep::GoOn
            );
            assert_eq!(
                step(&mut legs, MissionInput::Arrived, (place.x_m, place.y_m)),
                MissionStep::Think
            );
        }
        assert_eq!(
            step(&mut legs, MissionInput::Ready, (2.0, 3.0)),
            MissionStep::End(EndReason::Done)
        );
    }

    #[test]
    fn a_leg_that_was_interrupted_is_gone_on_with() {
        let mut legs = Straight::along(&[Point::new(2.0, 0.0)]);
        let first = step(&mut legs, MissionInput::Ready, (0.0, 0.0));
        assert_eq!(step(&mut legs, MissionInput::Ready, (1.0, 0.0)), first);
    }

    #[test]
    fn it_ends_in_front_of_what_stands_in_its_way() {
        let mut legs = Straight::along(&[Point::new(2.0, 0.0)]);
        let wall = obstacle(1.0, 0.0);
        step(&mut legs, MissionInput::Ready, (0.0, 0.0));
        assert_eq!(
            step(&mut legs, MissionInput::Blocked(wall), (0.5, 0.0)),
            MissionStep::End(EndReason::Stopped(wall))
        );
    }

    #[test]
    fn ahead_is_where_it_faced_when_it_began() {
        let mut ahead = Straight::ahead(3.0);
        let goal = MissionStep::GoStraight(Point::new(4.0, 2.0));
        assert_eq!(step(&mut ahead, MissionInput::Ready, (1.0, 2.0)), goal);
        assert_eq!(
            step(&mut ahead, MissionInput::Ready, (2.0, 2.0)),
            goal,
            "also after an interruption"
        );
        step(&mut ahead, MissionInput::Arrived, (4.0, 2.0));
        assert_eq!(
            step(&mut ahead, MissionInput::Ready, (4.0, 2.0)),
            MissionStep::End(EndReason::Done)
        );
    }
}
