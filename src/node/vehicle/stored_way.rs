//! The ways on which a stored mission leads: all of them, to be judged against the fence, and the next ones, which the vehicle
//! claims. How far the autopilot is, is not known here.

use crate::autopilot::Item;
use crate::geom::{Point, Track};

/// So many places ahead are claimed at least: when one is passed, the autopilot is on its way to the next.
const PLACES: usize = 2;
/// So much of the way is claimed at least, metres: what a vehicle needs to stop for one that stops for it.
const AHEAD_M: f64 = 4.0;
/// So many corners are claimed at most: of a mission of many items at nearly one place.
const CORNERS_MAX: usize = 64;

/// Returns the way that an autopilot takes from a place, from an item of a mission on, as far as a vehicle claims it: its
/// next two places, and 4 m, or the end, or 64 corners. Where a jump may be taken or not, it leads there and back again.
pub(super) fn way_ahead(items: &[Item], from: usize, home: Point, at: Point) -> Vec<Point> {
    let mut way = vec![at];
    let (mut here, mut places, mut length_m, mut index) = (at, 0, 0.0, from);
    // A jump may lead round and round to no place.
    for _ in 0..2 * items.len() {
        let Some(item) = items.get(index) else {
            break;
        };
        index += 1;
        match item {
            Item::Jump { to, times: None } => index = *to,
            Item::Jump { to, times: Some(_) } => {
                if let Some(place) = place_from(items, *to, home) {
                    way.extend([place, here]);
                }
            }
            other => {
                if let Some(place) = place_of(other, home) {
                    length_m += here.distance_to(place);
                    places += 1;
                    if place != here {
                        way.push(place);
                    }
                    here = place;
                }
            }
        }
        if places >= PLACES && length_m >= AHEAD_M || way.len() >= CORNERS_MAX {
            break;
        }
    }
    way
}

/// Returns the ways between the places of a mission: from each to the next, and to where jumps and returns lead.
pub(super) fn all_ways(items: &[Item], home: Point) -> Vec<Track> {
    let mut at = None;
    let mut ways = Vec::new();
    for item in items.iter().skip(1) {
        let next = match item {
            Item::Jump { to, .. } => place_from(items, *to, home),
            other => place_of(other, home),
        };
        if let (Some(from), Some(to)) = (at, next) {
            ways.extend(track_of(&[from, to]));
        }
        at = match item {
            Item::Jump { .. } => at,
            _ => next.or(at),
        };
    }
    ways
}

/// Makes a track of a route that leads somewhere; `None` for fewer than two corners or one that is not finite.
pub(super) fn track_of(route: &[Point]) -> Option<Track> {
    let finite = route.iter().all(|corner| corner.is_finite());
    (route.len() >= 2 && finite)
        .then(|| Track::new(route.to_vec()))
        .flatten()
}

/// Returns the place to which a mission leads next, from an item on.
fn place_from(items: &[Item], from: usize, home: Point) -> Option<Point> {
    items
        .iter()
        .skip(from)
        .find_map(|item| place_of(item, home))
}

/// Returns the place to which an item leads.
fn place_of(item: &Item, home: Point) -> Option<Point> {
    match item {
        Item::Return => Some(home),
        other => other.place(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOME: Point = Point::new(-9.0, 0.0);

    fn to(x_m: f64) -> Item {
        Item::Land {
            at: Some(Point::new(x_m, 0.0)),
        }
    }

    fn jump(to: usize, times: Option<u16>) -> Item {
        Item::Jump { to, times }
    }

    /// The places along x that are claimed from 0 on, from an item on.
    fn ahead(items: &[Item], from: usize) -> Vec<f64> {
        let way = way_ahead(items, from, HOME, Point::default());
        way[1..].iter().map(|place| place.x_m).collect()
    }

    #[test]
    fn two_places_and_four_metres_are_claimed_as_far_as_the_mission_leads() {
        let far = [to(0.0), to(3.0), Item::Speed(1.0), to(9.0), to(12.0)];
        assert_eq!(ahead(&far, 1), [3.0, 9.0]);
        let near = [to(0.0), to(0.3), to(0.6), to(0.9), to(6.0), to(7.0)];
        assert_eq!(ahead(&near, 1), [0.3, 0.6, 0.9, 6.0]);
        assert_eq!(ahead(&near, 5), [7.0]);
        assert_eq!(ahead(&near, 9), [0.0; 0]);
    }

    #[test]
    fn returns_lead_home_and_jumps_to_where_they_may() {
        assert_eq!(ahead(&[to(0.0), to(3.0), Item::Return], 1), [3.0, -9.0]);
        let endless = [to(0.0), to(1.0), to(5.0), jump(1, None), to(99.0)];
        assert_eq!(ahead(&endless, 2), [5.0, 1.0]);
        let counted = [to(0.0), to(1.0), to(5.0), jump(1, Some(2)), to(9.0)];
        assert_eq!(ahead(&counted, 2), [5.0, 1.0, 5.0, 9.0]);
        let home = [to(0.0), jump(3, Some(1)), to(8.0), Item::Return];
        assert_eq!(ahead(&home, 1), [-9.0, 0.0, 8.0, -9.0]);
    }

    #[test]
    fn a_jump_that_leads_round_and_round_ends() {
        let round = [to(0.0), Item::Speed(1.0), jump(1, None)];
        assert_eq!(ahead(&round, 1), [0.0; 0]);
        assert_eq!(ahead(&[to(0.0), to(0.0), jump(1, None)], 1), [0.0; 0]);
    }

    #[test]
    fn items_at_one_place_are_one_corner_and_many_near_ones_are_not_all_claimed() {
        let column = [to(0.0), to(3.0), to(3.0), to(3.0), to(9.0), to(12.0)];
        assert_eq!(ahead(&column, 1), [3.0, 9.0]);
        let dense: Vec<Item> = (0..700).map(|item| to(f64::from(item) * 0.001)).collect();
        assert_eq!(ahead(&dense, 1).len(), CORNERS_MAX - 1);
    }
}
