//! Visits of places on paths around what is seen. Before it sets out and at every place it looks around. A place to which
//! no way leads is passed over: then everything that can be reached was searched.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::{MissionKind, PassedOver, Seen, Step, Surroundings};
use crate::geom::Point;
use crate::node::mission::End;

/// A mission that visits places.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Pathfind {
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
    pub fn to(places: &[Point]) -> Pathfind {
        Pathfind {
            is_begun: false,
            places: places.iter().copied().collect(),
            no_way: 0,
            given_up: 0,
        }
    }

    /// Returns how many places are still to be visited.
    pub fn places_left(&self) -> usize {
        self.places.len()
    }

    fn next_place(&self) -> Step {
        match (self.places.front(), self.given_up, self.no_way) {
            (Some(place), ..) => Step::GoTo(*place),
            (None, 0, 0) => Step::End(End::Done),
            (None, 0, places) => Step::End(End::NoWay(places)),
            (None, places, _) => Step::End(End::GaveUp(places)),
        }
    }
}

impl MissionKind for Pathfind {
    fn next(&mut self, seen: Seen, _around: &Surroundings<'_>) -> Step {
        match seen {
            Seen::Ready if !std::mem::replace(&mut self.is_begun, true) => Step::LookAround,
            Seen::Ready => self.next_place(),
            Seen::UnderWay => Step::GoOn,
            Seen::Arrived => {
                self.places.pop_front();
                Step::LookAround
            }
            Seen::Blocked(_) => Step::TryAgain,
            Seen::Looked { .. } => Step::Think,
        }
    }

    fn give_up(&self) -> End {
        End::GaveUp(self.given_up + self.places.len())
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
    use super::super::tests_support::{LOOKED, step};
    use super::*;

    const PLACES: [Point; 2] = [Point { x_m: 2.0, y_m: 0.0 }, Point { x_m: 2.0, y_m: 3.0 }];

    /// A mission to [`PLACES`] that has looked around where it begins.
    fn begun() -> Pathfind {
        let mut pathfind = Pathfind::to(&PLACES);
        assert_eq!(
            step(&mut pathfind, Seen::Ready, (0.0, 0.0)),
            Step::LookAround
        );
        assert_eq!(step(&mut pathfind, LOOKED, (0.0, 0.0)), Step::Think);
        pathfind
    }

    #[test]
    fn it_looks_around_at_every_place() {
        let mut pathfind = begun();
        for place in PLACES {
            assert_eq!(
                step(&mut pathfind, Seen::Ready, (0.0, 0.0)),
                Step::GoTo(place)
            );
            assert_eq!(
                step(&mut pathfind, Seen::Arrived, (place.x_m, place.y_m)),
                Step::LookAround
            );
        }
        assert_eq!(
            step(&mut pathfind, Seen::Ready, (2.0, 3.0)),
            Step::End(End::Done)
        );
    }

    #[test]
    fn what_is_in_the_way_is_no_reason_to_pass_a_place_over() {
        let mut pathfind = begun();
        assert_eq!(
            step(
                &mut pathfind,
                Seen::Blocked(Point::new(1.0, 0.0)),
                (0.5, 0.0)
            ),
            Step::TryAgain
        );
        assert_eq!(
            step(&mut pathfind, Seen::Ready, (0.5, 0.0)),
            Step::GoTo(PLACES[0])
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
                    None => drop(step(&mut pathfind, Seen::Arrived, (0.0, 0.0))),
                }
            }
            step(&mut pathfind, Seen::Ready, (0.0, 0.0))
        };
        assert_eq!(end([None, Some(NoWay)]), Step::End(End::NoWay(1)));
        assert_eq!(end([Some(NoWay), Some(NoWay)]), Step::End(End::NoWay(2)));
        assert_eq!(end([Some(GivenUp), None]), Step::End(End::GaveUp(1)));
        assert_eq!(end([Some(GivenUp), Some(NoWay)]), Step::End(End::GaveUp(1)));
    }

    #[test]
    fn who_gives_up_says_how_many_places_it_has_given_up() {
        let mut pathfind = begun();
        step(&mut pathfind, Seen::Arrived, (2.0, 0.0));
        assert_eq!(pathfind.give_up(), End::GaveUp(1));
        let mut pathfind = begun();
        pathfind.pass_over(PassedOver::GivenUp);
        assert_eq!(
            pathfind.give_up(),
            End::GaveUp(2),
            "one of them was given up before"
        );
    }
}
