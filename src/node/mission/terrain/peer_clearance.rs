//! What is kept clear of since peers are there, or claim a way: their separation, measured from where a vehicle sets out. A
//! vehicle that stands too near already may leave, and come no nearer.

use crate::geom::{Lattice, Point, Segment, Track};
use crate::node::peers::keeps_clear;
use crate::plan::SearchGrid;

/// A vehicle too near to a peer may leave it over places this near, metres.
const LEAVE_M: f64 = 0.6;

/// The clearance of a vehicle that sets out from a place.
pub(super) struct PeerClearance {
    pub from: Point,
    pub lattice: Lattice,
    /// How far the middles of two vehicles are to be apart, metres.
    pub separation_m: f64,
    /// How much farther the middles of cells are to be, so that a path keeps the distance wherever it leads in a cell, metres.
    pub spare_m: f64,
}

impl PeerClearance {
    /// Returns whether a route keeps its distance from a peer's claim, or leads away from it, as the vehicle actor asks.
    pub(super) fn holds_along(&self, route: &[Point], claim: &[Point]) -> bool {
        let (Some(claim), Some(route)) = (Track::new(claim.to_vec()), Track::new(route.to_vec()))
        else {
            return true;
        };
        keeps_clear(route.start(), &route, &claim, self.separation_m)
    }

    /// Closes what lies too near to a peer: to where it is, and to each piece of the way that it claims.
    pub(super) fn close(&self, grid: &mut SearchGrid, claim: &[Point]) {
        // A peer that stands claims a single point.
        let place = claim.first().map(|at| Segment::new(*at, *at));
        let pieces = claim.windows(2).map(|pair| Segment::new(pair[0], pair[1]));
        place
            .into_iter()
            .chain(pieces)
            .for_each(|piece| self.close_piece(grid, piece));
    }

    fn close_piece(&self, grid: &mut SearchGrid, claim: Segment) {
        let keep_m = self.separation_m + self.spare_m;
        let here_m = claim.distance_to_point(self.from);
        if here_m > keep_m + self.lattice.cell_m() {
            return grid.close_within(claim, keep_m);
        }
        let start = self.lattice.cell_at(self.from);
        grid.close_where(|place| {
            claim.distance_to_point(place) <= keep_m
                && self.lattice.cell_at(place) != start
                && !self.may_leave_over(place, claim, here_m)
        });
    }

    /// Returns whether a vehicle that stands `here_m` from a claim, too near to it, may leave over a place: one beside it, to
    /// which a straight line does not lead any nearer.
    fn may_leave_over(&self, place: Point, claim: Segment, here_m: f64) -> bool {
        let leads_m = Segment::new(self.from, place).distance_to(claim);
        let is_beside = place.distance_to(self.from) <= LEAVE_M;
        is_beside
            && claim.distance_to_point(place) >= here_m
            && leads_m >= here_m.min(self.separation_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Cell;
    use crate::map::CellRect;

    const PEER: Point = Point::new(0.0, 0.0);

    fn clearance(from_m: f64) -> PeerClearance {
        PeerClearance {
            from: Point::new(from_m, 0.0),
            lattice: Lattice::new(0.2),
            separation_m: 1.0,
            spare_m: 0.2,
        }
    }

    /// Whether a place is open to a vehicle that sets out from a place on x, with these claims of a peer.
    fn is_open(from_m: f64, claim: &[Point], place: (f64, f64)) -> bool {
        let clearance = clearance(from_m);
        let area = CellRect::new(Cell::new(-30, -30), Cell::new(30, 30));
        let mut grid = SearchGrid::of_cells(clearance.lattice, area, 0.0, |_| false).unwrap();
        clearance.close(&mut grid, claim);
        grid.passable(clearance.lattice.cell_at(Point::new(place.0, place.1)))
    }

    #[test]
    fn what_is_near_a_peer_and_its_way_is_closed() {
        let claim = [PEER, Point::new(0.0, 3.0)];
        for (place, expected) in [
            ((1.1, 0.1), false),
            ((1.3, 0.1), true),
            ((1.1, 2.9), false),
            ((0.1, 4.3), true),
        ] {
            assert_eq!(is_open(5.0, &claim, place), expected, "{place:?}");
        }
        assert!(
            is_open(5.0, &[PEER], (0.1, 2.9)),
            "one that stands claims no way"
        );
    }

    #[test]
    fn a_vehicle_too_near_may_leave_over_what_is_beside_it_and_not_come_nearer() {
        assert!(!is_open(5.0, &[PEER], (1.1, 0.1)), "for one that comes");
        assert!(is_open(0.9, &[PEER], (1.1, 0.1)), "away");
        assert!(!is_open(0.9, &[PEER], (0.7, 0.1)), "nearer");
        assert!(!is_open(0.9, &[PEER], (-1.1, 0.1)), "on the other side");
    }

    #[test]
    fn a_route_keeps_its_distance_or_leads_away() {
        let to = |from_m: f64, to_m: f64| {
            let route = [Point::new(from_m, 0.0), Point::new(to_m, 0.0)];
            clearance(from_m).holds_along(&route, &[PEER])
        };
        assert!(to(3.0, 1.0) && !to(3.0, 0.9), "it comes");
        assert!(to(0.5, 0.8) && !to(0.8, 0.5) && !to(0.5, -0.9), "it leaves");
        assert!(
            clearance(0.5).holds_along(&[PEER, PEER], &[]),
            "nobody is there"
        );
    }
}
