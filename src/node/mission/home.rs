//! How near to its home a vehicle is at home: said once, for the vehicle itself and for all who judge it from outside; and
//! how the way there looks.

use super::pilot::ARRIVED_M;
use super::terrain::PathSearch;
use crate::geom::{Point, Pose};

/// A vehicle that believes to rest this near to its home has come home, metres. It is the distance at which every way
/// ends: a vehicle drives no nearer on purpose, so a smaller one would never be reached, and a larger one would end
/// missions in front of their end.
pub const HOME_M: f64 = ARRIVED_M;

/// How the way home looks, over what is known to be free.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum WayHome {
    /// It can be driven.
    Open,
    /// Only peers that stand are in the way.
    BehindPeers,
    /// Nothing known leads home, even without peers.
    Unknown,
}

impl WayHome {
    /// Returns how the way home looks from where a search begins, when peers that stand claim this.
    pub(super) fn of(search: &PathSearch<'_>, home: Point, peers: &[Vec<Point>]) -> WayHome {
        let is_open = |peers| {
            search.path(home, false, peers).is_some() || search.driven_path(home, peers).is_some()
        };
        if home.distance_to(search.from()) <= ARRIVED_M || is_open(peers) {
            WayHome::Open
        } else if is_open(&[]) {
            WayHome::BehindPeers
        } else {
            WayHome::Unknown
        }
    }
}

/// Returns whether a vehicle that says this pose of itself is at home. It is judged by [`HOME_M`], and twice the deviation
/// of the place is made allowance for: what a vehicle believes of its place drifts while it rests.
pub fn is_at_home(pose: Pose, home: Point) -> bool {
    home.distance_to(pose.at) <= farthest_m(pose)
}

/// Returns how far from its home a vehicle that says this pose of itself may be to be at home, metres. No allowance is
/// made for a deviation that is not known.
pub fn farthest_m(pose: Pose) -> f64 {
    if pose.sd_m.is_finite() {
        HOME_M + 2.0 * pose.sd_m
    } else {
        HOME_M
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::mission::terrain::tests::terrain_of;
    use crate::node::tests_support::own_state;
    use crate::time::Time;

    #[test]
    fn a_place_that_is_known_well_is_judged_as_the_vehicle_judges_it() {
        let home = Point::new(3.0, 4.0);
        let is_there = |off_m: f64, sd_m: f64| {
            is_at_home(
                Pose {
                    at: Point::new(3.0 + off_m, 4.0),
                    sd_m,
                    ..Pose::default()
                },
                home,
            )
        };
        assert!(is_there(0.34, 0.0) && !is_there(0.36, 0.0));
        assert!(
            is_there(0.8, 0.25) && !is_there(0.9, 0.25),
            "a drift is made allowance for"
        );
        assert!(
            is_there(0.34, f64::INFINITY) && !is_there(0.36, f64::INFINITY),
            "not known is not everywhere"
        );
    }

    #[test]
    fn the_way_home_is_open_barred_by_peers_that_stand_or_not_known() {
        let (now, home) = (Time::ZERO, Point::new(0.0, 0.0));
        let of = |is_wall: fn(f64, f64) -> bool, from_m: f64, peers: &[Vec<Point>]| {
            let (terrain, pose) = (terrain_of(is_wall), own_state(from_m, 0.0).pose);
            WayHome::of(&terrain.search(now, pose), home, peers)
        };
        let at_home = [vec![home]];
        assert_eq!(of(|_, _| false, 3.0, &[]), WayHome::Open);
        assert_eq!(of(|_, _| false, 3.0, &at_home), WayHome::BehindPeers);
        let is_wall = |x_m: f64, _: f64| (1.0..1.4).contains(&x_m);
        assert_eq!(of(is_wall, 3.0, &at_home), WayHome::Unknown);
        assert_eq!(
            of(|_, _| false, 0.3, &at_home),
            WayHome::Open,
            "it is there"
        );
    }
}
