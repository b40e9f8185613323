//! Where others can get over what this vehicle knows: whether it stands in their way. They are taken to need as much room as it
//! does.

use super::peer_clearance::PeerClearance;
use super::search::{PathSearch, RULES, WAYS};
use crate::geom::{Cell, Point, Track};
use crate::map::CellRect;
use crate::plan::Distances;

/// A way leads to a place when it comes as near to it, metres: who goes to look at something gives that for its goal.
const BESIDE_M: f64 = 0.7;

impl PathSearch<'_> {
    /// Returns the way from one place to another of somebody else, over unknown ground too; `None` when there is none.
    pub(crate) fn way_for(&self, ends: (Point, Point)) -> Option<Track> {
        self.way_past(ends, None)
    }

    /// Returns whether somebody else cannot get from one place to another as long as a vehicle stands at a third one, and may if
    /// none does.
    pub(crate) fn is_barred_for(&self, ends: (Point, Point), place: Point) -> bool {
        self.way_past(ends, Some(place)).is_none() && self.way_for(ends).is_some()
    }

    /// Returns such a way, clear of a vehicle that stands at a place.
    fn way_past(&self, (from, to): (Point, Point), stands: Option<Point>) -> Option<Track> {
        let way = |resolution| {
            let mut grid = self.ground(Some(to), resolution, true, &[])?;
            if let Some(place) = stands {
                let clearance = PeerClearance {
                    from,
                    ..self.peer_clearance(grid.lattice())
                };
                clearance.close(&mut grid, &[place]);
            }
            let nodes = grid.lattice();
            grid.stand_on(nodes.cell_at(from));
            let ways = Distances::from_start(&grid, nodes.cell_at(from), &RULES).ok()?;
            let area = CellRect::around(nodes, &[to], BESIDE_M)?;
            let off_m = |(node, _): (Cell, f64)| (nodes.centre(node).distance_to(to), node);
            let beside = ways.costs_m(area).map(off_m);
            let (_, end) = beside.min_by(|a, b| a.0.total_cmp(&b.0))?;
            Track::new(ways.route_to(&grid, from, nodes.centre(end))?.points)
        };
        let past_all = WAYS.into_iter().filter(|(_, is_narrow)| !is_narrow);
        past_all.map(|(resolution, _)| resolution).find_map(way)
    }
}
