//! What became of the places that vehicles were to visit, by what their missions say: what the run monitor writes down and
//! an outcome carries. Whether a place could be got to is not known here; that is the judge's
//! ([`super::reachable`]).

use tomoswarm_proto::{Position, TaskKind, TaskParameter, VehicleId};

use crate::geom::Point;
use crate::node::mission::{EndReason, MissionEvent, share};

/// Two places nearer than this are one, metres: places travel in whole millimetres.
const SAME_M: f64 = 1e-3;

/// What became of a place; of several things that were said of it the last one of these counts.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum PlaceFate {
    /// Nothing was said of it.
    NotTried,
    /// It was given up although a way may lead there, by itself or with the whole mission.
    GivenUp,
    /// It was said that no way leads there.
    NoWay,
    /// It was visited.
    Visited,
}

/// A place that a vehicle was to visit, and what became of it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PlaceResult {
    /// Who was to visit it.
    pub vehicle: VehicleId,
    /// Where it is.
    pub place: Point,
    /// What became of it.
    pub fate: PlaceFate,
    /// Whether it was ever said that no way leads there, also when it was visited in a later round.
    pub was_called_no_way: bool,
}

/// Returns the places that some vehicles are to visit on paths around what is seen, those of the first vehicle first,
/// each once. Missions that drive straight ahead, and those without a list of places, have none.
pub(super) fn places_of(task: Option<&TaskKind>, vehicles: &[VehicleId]) -> Vec<PlaceResult> {
    let Some(task @ (TaskKind::Pathfind { .. } | TaskKind::Patrol { .. })) = task else {
        return Vec::new();
    };
    let all = listed_places(task.clone());
    let mut results: Vec<PlaceResult> = Vec::new();
    for (index, vehicle) in vehicles.iter().enumerate() {
        let own = listed_places(share(task, index, vehicles.len()));
        for place in all.iter().filter(|place| own.contains(place)) {
            let place = Point::from(*place);
            if !results.iter().any(|known| known.is_of(*vehicle, place)) {
                results.push(PlaceResult {
                    vehicle: *vehicle,
                    place,
                    fate: PlaceFate::NotTried,
                    was_called_no_way: false,
                });
            }
        }
    }
    results
}

/// Returns the places that a mission lists, in its order.
fn listed_places(mut task: TaskKind) -> Vec<Position> {
    let parameters = task.parameters().into_iter();
    let places = parameters.filter_map(|parameter| match parameter {
        TaskParameter::Places(places, _) => Some(std::mem::take(places)),
        TaskParameter::Number(..) => None,
    });
    places.flatten().collect()
}

/// Takes what a vehicle says of its mission.
pub(super) fn hear(results: &mut [PlaceResult], vehicle: VehicleId, event: &MissionEvent) {
    match event {
        MissionEvent::Visited(at) => settle(results, vehicle, *at, PlaceFate::Visited),
        MissionEvent::NoWay(at, ..) => settle(results, vehicle, *at, PlaceFate::NoWay),
        // This is also said of a place to which no way leads.
        MissionEvent::Passed(at) => settle(results, vehicle, *at, PlaceFate::GivenUp),
        MissionEvent::Ended(EndReason::GaveUp(_)) => {
            let own = results
                .iter_mut()
                .filter(|result| result.vehicle == vehicle);
            own.for_each(|result| result.fate = result.fate.max(PlaceFate::GivenUp));
        }
        _ => {}
    }
}

fn settle(results: &mut [PlaceResult], vehicle: VehicleId, at: Point, fate: PlaceFate) {
    let its = |result: &&mut PlaceResult| result.is_of(vehicle, at);
    for result in results.iter_mut().filter(its) {
        result.fate = result.fate.max(fate);
        result.was_called_no_way |= fate == PlaceFate::NoWay;
    }
}

impl PlaceResult {
    fn is_of(&self, vehicle: VehicleId, place: Point) -> bool {
        self.vehicle == vehicle && self.place.distance_to(place) < SAME_M
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::TaskKind::{Explore, Legs, Pathfind, Patrol};

    use super::*;

    const A: Point = Point::new(1.0, 2.0);
    const B: Point = Point::new(3.0, 2.5);
    const C: Point = Point::new(-1.25, 0.0);
    const BOTH: [VehicleId; 2] = [VehicleId(1), VehicleId(4)];

    fn positions(places: &[Point]) -> Vec<Position> {
        places.iter().map(|place| Position::from(*place)).collect()
    }

    fn patrol(places: &[Point]) -> TaskKind {
        Patrol {
            places: positions(places),
            rounds: 2,
            duration_ms: 0,
        }
    }

    /// Whose a mission's places are.
    fn whose(task: &TaskKind) -> Vec<(u8, Point)> {
        places_of(Some(task), &BOTH)
            .iter()
            .map(|result| (result.vehicle.0, result.place))
            .collect()
    }

    /// What becomes of A, B and C when vehicle 4 patrols there and says something.
    fn fates(events: &[MissionEvent]) -> [PlaceFate; 3] {
        let mut results = places_of(Some(&patrol(&[A, B, C])), &[VehicleId(4)]);
        for event in events {
            hear(
                &mut results,
                VehicleId(9),
                &MissionEvent::NoWay(C, Vec::new()),
            );
            hear(&mut results, VehicleId(4), event);
        }
        [results[0].fate, results[1].fate, results[2].fate]
    }

    #[test]
    fn pathfinders_share_their_places_and_each_patrol_has_all() {
        let pathfind = Pathfind {
            places: positions(&[A, B, C]),
        };
        assert_eq!(whose(&pathfind), [(1, A), (1, C), (4, B)]);
        let all = [(1, A), (1, B), (4, A), (4, B)];
        assert_eq!(whose(&patrol(&[A, B])), all);
        assert_eq!(whose(&patrol(&[A, B, A])), all, "a round");
    }

    #[test]
    fn missions_that_drive_straight_or_have_no_places_are_not_judged_by_places() {
        let places = positions(&[A, B]);
        assert!(whose(&Legs { places }).is_empty() && whose(&Explore).is_empty());
        assert!(places_of(None, &BOTH).is_empty());
    }

    #[test]
    fn each_place_has_the_fate_that_its_own_vehicle_told() {
        use PlaceFate::{GivenUp, NoWay, NotTried, Visited};
        let (visited, passed) = (MissionEvent::Visited, MissionEvent::Passed);
        assert_eq!(fates(&[visited(A)]), [Visited, NotTried, NotTried]);
        // As a runner says it.
        let no_way = [MissionEvent::NoWay(A, Vec::new()), passed(A), passed(B)];
        assert_eq!(fates(&no_way), [NoWay, GivenUp, NotTried]);
        let over = [visited(B), MissionEvent::Ended(EndReason::GaveUp(2))];
        assert_eq!(fates(&over), [GivenUp, Visited, GivenUp]);
        let done = [visited(B), MissionEvent::Ended(EndReason::Done)];
        assert_eq!(fates(&done), [NotTried, Visited, NotTried]);
    }

    #[test]
    fn what_is_visited_in_a_later_round_was_called_unreachable_all_the_same() {
        let mut results = places_of(Some(&patrol(&[A, B])), &[VehicleId(4)]);
        for event in [
            MissionEvent::NoWay(A, Vec::new()),
            MissionEvent::Passed(A),
            MissionEvent::Visited(A),
            MissionEvent::Passed(A),
        ] {
            hear(&mut results, VehicleId(4), &event);
        }
        let told: Vec<(PlaceFate, bool)> = results
            .iter()
            .map(|result| (result.fate, result.was_called_no_way))
            .collect();
        assert_eq!(
            told,
            [(PlaceFate::Visited, true), (PlaceFate::NotTried, false)]
        );
    }
}
