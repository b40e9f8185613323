//! Where others can get over what this vehicle knows: whether it stands in their way. They are taken to need as much room as it
//! does.

use super::peer_clearance::PeerClearance;
use super::search::{PathSearch, RULES, Resolution, WAYS};
use crate::geom::{Cell, Point, Track};
use crate::map::CellRect;
use crate::plan::{Component, Distances, SearchGrid};

/// A way leads to a place when it comes as near to it, metres: who goes to look at something gives that for its goal.
const BESIDE_M: f64 = 0.7;

/// So much more than the separation others need to get past whoever stands somewhere: their maps differ, metres.
const SPARE_M: f64 = 0.15;

/// Over which ground a way leads.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Ground {
    /// What is known to be free.
    Known,
    /// That, and what nobody has seen.
    UnknownToo,
}

/// Returns how finely ways of others are searched, try by try: past everything that the map knows.
fn past_everything() -> impl Iterator<Item = Resolution> {
    let past_all = WAYS.into_iter().filter(|(_, is_narrow)| !is_narrow);
    past_all.map(|(resolution, _)| resolution)
}

impl PathSearch<'_> {
    /// Returns the way from one place to another of somebody else, clear of vehicles that stand at some places; `None` when
    /// there is none.
    pub(crate) fn way_for(
        &self,
        (from, to): (Point, Point),
        ground: Ground,
        stand: &[Point],
    ) -> Option<Track> {
        past_everything().find_map(|resolution| {
            let grid = self.ground_past((from, to), (ground, resolution), stand)?;
            let nodes = grid.lattice();
            let ways = Distances::from_start(&grid, nodes.cell_at(from), &RULES).ok()?;
            let area = CellRect::around(nodes, &[to], BESIDE_M)?;
            let off_m = |(node, _): (Cell, f64)| (nodes.centre(node).distance_to(to), node);
            let beside = ways.costs_m(area).map(off_m);
            let (_, end) = beside.min_by(|a, b| a.0.total_cmp(&b.0))?;
            Track::new(ways.route_to(&grid, from, nodes.centre(end))?.points)
        })
    }

    /// Returns whether somebody else can get from one place to another, clear of vehicles that stand at some places.
    pub(crate) fn is_open_for(
        &self,
        (from, to): (Point, Point),
        ground: Ground,
        stand: &[Point],
    ) -> bool {
        let is_open = |resolution| {
            let grid = self.ground_past((from, to), (ground, resolution), stand)?;
            let nodes = grid.lattice();
            let reached = Component::around(&grid, nodes.cell_at(from), &RULES);
            let beside = CellRect::around(nodes, &[to], BESIDE_M)?;
            Some(beside.cells().any(|node| reached.contains(node)))
        };
        past_everything().any(|resolution| is_open(resolution).unwrap_or(false))
    }

    /// Returns the ground of somebody else, clear of vehicles that stand at some places.
    fn ground_past(
        &self,
        (from, to): (Point, Point),
        (ground, resolution): (Ground, Resolution),
        stand: &[Point],
    ) -> Option<SearchGrid> {
        let mut grid = self.ground(Some(to), resolution, ground == Ground::UnknownToo, &[])?;
        let clearance = PeerClearance {
            from,
            separation_m: self.settings.swarm.separation_m + SPARE_M,
            ..self.peer_clearance(grid.lattice())
        };
        for place in stand {
            clearance.close(&mut grid, &[*place]);
        }
        grid.stand_on(grid.lattice().cell_at(from));
        Some(grid)
    }
}

#[cfg(test)]
mod tests {
    use super::Ground;
    use crate::geom::Point;
    use crate::node::mission::terrain::tests::{terrain_of, two_rooms};
    use crate::node::tests_support::own_state;
    use crate::time::Time;

    /// West and east of a wall.
    const ENDS: (Point, Point) = (Point::new(-3.0, 0.0), Point::new(4.0, 0.0));
    const DOORWAY: Point = Point::new(1.2, 0.0);

    /// Whether a vehicle at a place bars somebody's way in two rooms with a doorway of so many metres between them.
    fn bars(doorway_m: f64, ends: (Point, Point), place: Point) -> bool {
        let terrain = terrain_of(two_rooms(doorway_m));
        let search = terrain.search(Time::ZERO, own_state(place.x_m, place.y_m).pose);
        let ground = Ground::Known;
        let is_open = |stand: &[Point]| search.is_open_for(ends, ground, stand);
        let has_way = search.way_for(ends, ground, &[]).is_some();
        assert_eq!(is_open(&[]), has_way, "both say the same");
        has_way && !is_open(&[place])
    }

    #[test]
    fn who_stands_in_a_doorway_bars_those_who_must_get_through_it() {
        assert!(bars(2.0, ENDS, DOORWAY));
        assert!(bars(2.0, (ENDS.1, ENDS.0), DOORWAY), "from either side");
        let before_it = Point::new(0.4, 0.0);
        assert!(bars(2.0, ENDS, before_it));
    }

    #[test]
    fn who_stands_elsewhere_or_where_nobody_gets_through_anyway_bars_nobody() {
        let aside = Point::new(-1.0, 3.0);
        assert!(!bars(2.0, ENDS, aside));
        let west = (ENDS.0, Point::new(-3.0, 3.0));
        assert!(!bars(2.0, west, DOORWAY), "it stays on its side");
        assert!(!bars(6.0, ENDS, DOORWAY), "the doorway is wide");
        assert!(
            !bars(0.4, ENDS, Point::new(0.4, 0.0)),
            "nobody gets through"
        );
    }
}
