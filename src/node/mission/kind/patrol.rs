//! Rounds over places, on paths around what is seen, until so many rounds are done or the time is over; without either the
//! battery ends it. Before it sets out and at every place it looks around. A place that cannot be got to is passed over,
//! and tried again in the next round: what stood in the way may have gone.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::{Behaviour, MissionContext, MissionInput, MissionStep, PassedOver};
use crate::geom::Point;
use crate::node::mission::EndReason;
use crate::time::Time;

/// A mission that goes round.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Patrol {
    /// The places of a round, in order, each with what became of it.
    places: Vec<(Point, PlaceResult)>,
    /// After so many rounds it ends.
    rounds: Option<usize>,
    /// After this long it ends, at the next place.
    duration: Option<Duration>,
    /// When it set out.
    began: Option<Time>,
    /// Places that it has come to or passed over, of all rounds.
    passed: usize,
    /// Of these, those that it has passed over since it came to one.
    missed_in_a_row: usize,
}

/// What became of a place so far.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
enum PlaceResult {
    Untried,
    /// It was visited once at least.
    Visited,
    /// It was passed over whenever it was tried, the last time because of this.
    Missed(PassedOver),
}

impl Patrol {
    /// Makes a patrol over places; a round that ends where it began visits that place once. `None` is without a limit.
    pub(crate) fn over(
        places: &[Point],
        rounds: Option<usize>,
        duration: Option<Duration>,
    ) -> Patrol {
        let is_closed = places.len() > 1 && places.first() == places.last();
        let open = &places[..places.len() - usize::from(is_closed)];
        Patrol {
            places: open
                .iter()
                .map(|place| (*place, PlaceResult::Untried))
                .collect(),
            rounds,
            duration,
            began: None,
            passed: 0,
            missed_in_a_row: 0,
        }
    }

    /// Returns how many places are still to be visited: of all rounds, or of this one when their number has no limit.
    pub(crate) fn places_left(&self) -> usize {
        let in_round = self.places.len();
        match self.rounds {
            Some(rounds) => (rounds * in_round).saturating_sub(self.passed),
            None => in_round - self.passed.checked_rem(in_round).unwrap_or(0),
        }
    }

    /// Returns the place that comes next, unless the patrol is over.
    fn next_place(&self, now: Time) -> Option<Point> {
        let began = self.began.unwrap_or(now);
        let is_late = self
            .duration
            .is_some_and(|duration| now.since(began) >= duration);
        let is_barred = self.missed_in_a_row >= self.places.len();
        if is_late || is_barred || self.places_left() == 0 {
            return None;
        }
        Some(self.places[self.passed % self.places.len()].0)
    }

    /// Returns how it ends: well, unless it never came to a place that it tried.
    fn end(&self) -> EndReason {
        let missed = || {
            self.places.iter().filter_map(|(_, fate)| match fate {
                PlaceResult::Missed(why) => Some(*why),
                PlaceResult::Untried | PlaceResult::Visited => None,
            })
        };
        match (
            missed().count(),
            missed().any(|why| why == PassedOver::GivenUp),
        ) {
            (0, _) => EndReason::Done,
            (places, false) => EndReason::NoWay(places),
            (places, true) => EndReason::GaveUp(places),
        }
    }

    /// Takes what became of the place that was next.
    fn pass(&mut self, became: PlaceResult) {
        let in_round = self.places.len();
        if let Some((_, fate)) = self
            .places
            .get_mut(self.passed.checked_rem(in_round).unwrap_or(0))
        {
            *fate = if *fate == PlaceResult::Visited {
                PlaceResult::Visited
            } else {
                became
            };
        }
        self.passed += 1;
        self.missed_in_a_row = if became == PlaceResult::Visited {
            0
        } else {
            self.missed_in_a_row + 1
        };
    }
}

impl Behaviour for Patrol {
    fn next(&mut self, seen: MissionInput, around: &MissionContext<'_>) -> MissionStep {
        match seen {
            MissionInput::Ready if self.began.is_none() => {
                self.began = Some(around.now);
                MissionStep::LookAround
            }
            MissionInput::Ready => self
                .next_place(around.now)
                .map_or_else(|| MissionStep::End(self.end()), MissionStep::GoTo),
            MissionInput::UnderWay | MissionInput::Autopilot(_) => MissionStep::GoOn,
            MissionInput::Arrived => {
                self.pass(PlaceResult::Visited);
                MissionStep::LookAround
            }
            MissionInput::Blocked(_) => MissionStep::TryAgain,
            MissionInput::Looked { .. } => MissionStep::Think,
        }
    }

    fn goal(&self) -> Option<Point> {
        let place = || self.places.get(self.passed % self.places.len().max(1));
        (self.places_left() > 0)
            .then(place)
            .flatten()
            .map(|(at, _)| *at)
    }

    fn give_up(&self) -> EndReason {
        EndReason::GaveUp(self.places_left().clamp(1, self.places.len().max(1)))
    }

    fn pass_over(&mut self, why: PassedOver) {
        self.pass(PlaceResult::Missed(why));
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests_support::{LOOKED, step, step_at};
    use super::*;

    const A: Point = Point { x_m: 2.0, y_m: 0.0 };
    const B: Point = Point { x_m: 2.0, y_m: 3.0 };

    fn begun(rounds: Option<usize>, duration_s: Option<u64>) -> Patrol {
        let mut patrol = Patrol::over(&[A, B], rounds, duration_s.map(Duration::from_secs));
        assert_eq!(
            step(&mut patrol, MissionInput::Ready, (0.0, 0.0)),
            MissionStep::LookAround
        );
        assert_eq!(step(&mut patrol, LOOKED, (0.0, 0.0)), MissionStep::Think);
        patrol
    }

    /// Lets it choose, and does what it says; returns the places visited until it ends, at most so many, and the end.
    fn visited(patrol: &mut Patrol, most: usize) -> (Vec<Point>, Option<EndReason>) {
        let mut places = Vec::new();
        while places.len() < most {
            match step(patrol, MissionInput::Ready, (0.0, 0.0)) {
                MissionStep::GoTo(place) => {
                    places.push(place);
                    assert_eq!(
                        step(patrol, MissionInput::Arrived, (place.x_m, place.y_m)),
                        MissionStep::LookAround
                    );
                }
                MissionStep::End(end) => return (places, Some(end)),
                other => panic!("{other:?}"),
            }
        }
        (places, None)
    }

    #[test]
    fn so_many_rounds_are_driven_and_no_more() {
        let mut patrol = begun(Some(2), None);
        assert_eq!(patrol.places_left(), 4);
        assert_eq!(
            visited(&mut patrol, 9),
            (vec![A, B, A, B], Some(EndReason::Done))
        );
        assert_eq!(patrol.places_left(), 0);
    }

    #[test]
    fn without_a_limit_it_never_ends() {
        let mut patrol = begun(None, None);
        assert_eq!(visited(&mut patrol, 101).1, None);
        assert_eq!(patrol.places_left(), 1, "of this round");
    }

    #[test]
    fn when_its_time_is_over_it_ends_at_the_next_place() {
        let mut patrol = begun(None, Some(60));
        let at = |s: u64| Time::from_nanos(s * 1_000_000_000);
        assert_eq!(
            step_at(&mut patrol, MissionInput::Ready, (0.0, 0.0), at(59)),
            MissionStep::GoTo(A)
        );
        assert_eq!(
            step_at(&mut patrol, MissionInput::UnderWay, (1.0, 0.0), at(61)),
            MissionStep::GoOn
        );
        assert_eq!(
            step_at(&mut patrol, MissionInput::Arrived, (2.0, 0.0), at(62)),
            MissionStep::LookAround
        );
        assert_eq!(
            step_at(&mut patrol, MissionInput::Ready, (2.0, 0.0), at(70)),
            MissionStep::End(EndReason::Done)
        );
    }

    #[test]
    fn a_round_that_ends_where_it_began_visits_that_place_once() {
        let mut patrol = Patrol::over(&[A, B, A], Some(1), None);
        step(&mut patrol, MissionInput::Ready, (0.0, 0.0));
        assert_eq!(visited(&mut patrol, 9), (vec![A, B], Some(EndReason::Done)));
    }

    #[test]
    fn a_place_that_was_passed_over_is_tried_again_in_the_next_round() {
        let mut patrol = begun(Some(2), None);
        patrol.pass_over(PassedOver::NoWay);
        assert_eq!(
            visited(&mut patrol, 9),
            (vec![B, A, B], Some(EndReason::Done))
        );
        let mut patrol = begun(Some(2), None);
        patrol.pass_over(PassedOver::GivenUp);
        assert_eq!(visited(&mut patrol, 1), (vec![B], None));
        patrol.pass_over(PassedOver::NoWay);
        assert_eq!(
            visited(&mut patrol, 9),
            (vec![B], Some(EndReason::NoWay(1))),
            "the last reason counts"
        );
    }

    #[test]
    fn a_whole_round_of_places_that_cannot_be_got_to_is_the_last() {
        let mut patrol = begun(None, None);
        assert_eq!(visited(&mut patrol, 1), (vec![A], None));
        patrol.pass_over(PassedOver::NoWay);
        patrol.pass_over(PassedOver::GivenUp);
        assert_eq!(
            visited(&mut patrol, 9),
            (vec![], Some(EndReason::NoWay(1))),
            "it has been at the other one"
        );
        let mut patrol = begun(None, None);
        patrol.pass_over(PassedOver::NoWay);
        patrol.pass_over(PassedOver::GivenUp);
        assert_eq!(
            visited(&mut patrol, 9),
            (vec![], Some(EndReason::GaveUp(2)))
        );
    }

    #[test]
    fn who_gives_up_names_the_places_of_the_round_that_it_leaves() {
        let mut patrol = begun(None, None);
        assert_eq!(patrol.give_up(), EndReason::GaveUp(2));
        assert_eq!(visited(&mut patrol, 1), (vec![A], None));
        assert_eq!(patrol.give_up(), EndReason::GaveUp(1));
    }
}
