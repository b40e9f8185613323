//! Where others can get over what this vehicle knows: whether it stands in their way. They are taken to need as much room as it
//! does.

use super::peer_clearance::PeerClearance;
use super::search::{PathSearch, RULES, Resolution, WAYS};
use crate::geom::{Cell, Lattice, Point, Track};
use crate::map::CellRect;
use crate::plan::{Component, Distances, SearchGrid};

/// So much more than the separation others need to get past whoever stands somewhere: their maps differ, metres.
const SPARE_M: f64 = 0.15;

/// From where to where somebody else goes.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Trip {
    /// Where it is.
    pub from: Point,
    /// Where it goes.
    pub to: Point,
    /// It is there when it is so near, metres.
    pub beside_m: f64,
}

impl Trip {
    /// Returns the nodes that are near enough to where it goes: the one in which that lies at least.
    fn ends(&self, nodes: Lattice) -> impl Iterator<Item = Cell> {
        let (to, beside_m) = (self.to, self.beside_m);
        let around = CellRect::around(nodes, &[to], beside_m);
        let is_near = move |node: &Cell| nodes.centre(*node).distance_to(to) <= beside_m;
        let near = around.into_iter().flat_map(CellRect::cells).filter(is_near);
        near.chain([nodes.cell_at(to)])
    }
}

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
    pub(crate) fn way_for(&self, trip: &Trip, ground: Ground, stand: &[Point]) -> Option<Track> {
        past_everything().find_map(|resolution| {
            let grid = self.ground_past(trip, (ground, resolution), stand)?;
            let nodes = grid.lattice();
            let ways = Distances::from_start(&grid, nodes.cell_at(trip.from), &RULES).ok()?;
            let reached = trip.ends(nodes).filter(|node| ways.cost_m(*node).is_some());
            let off_m = |node: Cell| (nodes.centre(node).distance_to(trip.to), node);
            let (_, end) = reached.map(off_m).min_by(|a, b| a.0.total_cmp(&b.0))?;
            Track::new(ways.route_to(&grid, trip.from, nodes.centre(end))?.points)
        })
    }

    /// Returns whether somebody else can get from one place to another, clear of vehicles that stand at some places.
    pub(crate) fn is_open_for(&self, trip: &Trip, ground: Ground, stand: &[Point]) -> bool {
        let is_open = |resolution| {
            let grid = self.ground_past(trip, (ground, resolution), stand)?;
            let nodes = grid.lattice();
            let reached = Component::around(&grid, nodes.cell_at(trip.from), &RULES);
            Some(trip.ends(nodes).any(|node| reached.contains(node)))
        };
        past_everything().any(|resolution| is_open(resolution).unwrap_or(false))
    }

    /// Returns how far others are taken to keep from whoever stands somewhere, metres.
    pub(crate) fn separation_of_others_m(&self) -> f64 {
        self.settings.swarm.separation_m + SPARE_M
    }

    /// Returns the ground of somebody else, clear of vehicles that stand at some places.
    fn ground_past(
        &self,
        trip: &Trip,
        (ground, resolution): (Ground, Resolution),
        stand: &[Point],
    ) -> Option<SearchGrid> {
        let mut grid = self.ground(Some(trip.to), resolution, ground == Ground::UnknownToo, &[])?;
        let clearance = PeerClearance {
            from: trip.from,
            separation_m: self.separation_of_others_m(),
            ..self.peer_clearance(grid.lattice())
        };
        for place in stand {
            clearance.close(&mut grid, &[*place]);
        }
        grid.stand_on(grid.lattice().cell_at(trip.from));
        Some(grid)
    }
}

#[cfg(test)]
mod tests {
    use super::{Ground, Trip};
    use crate::geom::Point;
    use crate::node::mission::terrain::tests::{terrain_of, two_rooms};
    use crate::node::tests_support::own_state;
    use crate::time::Time;

    /// West and east of a wall.
    const ENDS: (Point, Point) = (Point::new(-3.0, 0.0), Point::new(4.0, 0.0));
    const DOORWAY: Point = Point::new(1.2, 0.0);

    /// Whether a vehicle at a place bars somebody's way in two rooms with a doorway of so many metres between them.
    fn bars(doorway_m: f64, (from, to): (Point, Point), place: Point) -> bool {
        let terrain = terrain_of(two_rooms(doorway_m));
        let search = terrain.search(Time::ZERO, own_state(place.x_m, place.y_m).pose);
        let ground = Ground::Known;
        let trip = Trip {
            from,
            to,
            beside_m: 0.35,
        };
        let is_open = |stand: &[Point]| search.is_open_for(&trip, ground, stand);
        let has_way = search.way_for(&trip, ground, &[]).is_some();
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
    fn who_stands_beside_a_place_bars_those_who_visit_it_and_not_those_who_look_at_it() {
        let terrain = terrain_of(two_rooms(2.0));
        let search = terrain.search(Time::ZERO, own_state(-3.0, 3.0).pose);
        let (from, to) = (Point::new(-3.0, 3.0), Point::new(-3.0, -1.0));
        let is_open = |beside_m: f64| {
            let trip = Trip { from, to, beside_m };
            let beside = [Point::new(to.x_m + 0.8, to.y_m)];
            search.is_open_for(&trip, Ground::Known, &beside)
        };
        assert!(is_open(0.7) && !is_open(0.1));
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
