//! What may bar a way and may not: cells that only explain an echo best, and ground that was looked at and is still unknown.
//! Before a place is given up, or an exploration ends, they are looked at from near, from ground that is free, at most so
//! often; and who is hemmed in goes back to open ground. *No way* is said only when none exists with all of them taken for
//! free, and what bars the others for good was looked at from near.
//!
//! Deliberately absent: driving and looking, see [`super::runner`]; what a look means for the map.

mod behind_peers;
mod unseen;

pub(crate) use self::unseen::BehindPeers;

use serde::{Deserialize, Serialize};

use super::kind::{DriveRoute, RouteRoom};
use super::terrain::{PathSearch, RULES, ReachedGround, Resolution};
use crate::geom::{Cell, Lattice, Point, Segment, Track};
use crate::map::{Bar, CellRect};
use crate::plan::{Distances, SearchGrid, shortest_route};

/// So many close looks at a part of the ground, and what it holds is taken for barred.
const LOOKS_MAX: usize = 3;
/// Side of such a part, metres.
const PART_M: f64 = 0.6;
/// So many close looks for one goal, wherever.
const LOOKS_ALL_MAX: usize = 40;
/// So often it goes back to open ground for one goal.
const WENT_BACK_MAX: usize = 2;
/// So many more looks it may take then, each time.
const LOOKS_AFTER_BACK: usize = 10;
/// So many cells are given up for one goal; what else bars is not looked at.
const GIVEN_UP_MAX: usize = 24;
/// A thing of no more cells is small: it may be none.
const SMALL_CELLS: usize = 4;
/// Two looks are from different places when these are so far apart, metres.
const APART_M: f64 = 0.15;
/// A close look is taken from so much farther away at most than the vehicle must keep from what it looks at, metres.
const NEAR_M: f64 = 1.0;
/// A metre more of way to where a look is taken from counts as so much more distance from what is looked at.
const WAY_SHARE: f64 = 0.1;
/// Optimistic ways are followed in steps of this length, metres.
const STEP_M: f64 = 0.1;
/// So many cells are named as barring at most.
const NAMED: usize = 3;

/// What was looked at from near.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Doubts {
    /// From where each part of the ground was looked at.
    looks: Vec<((i32, i32), Vec<Point>)>,
    /// Cells that were looked at often enough, and bar still.
    given_up: Vec<Cell>,
    /// How often it has gone back to open ground.
    went_back: usize,
}

/// A look at a cell from near.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct CloseLook {
    /// The way to where it is taken; `None` = from here.
    pub(crate) course: Option<DriveRoute>,
    /// The cell.
    pub(crate) at: Cell,
}

/// What is done before anything is given up.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum DoubtTry {
    /// Look at a cell from near.
    Look(CloseLook),
    /// Go back over the own track to open ground: where the vehicle stands it is hemmed in by what it has come past.
    GoBack(DriveRoute),
}

/// What to do about what is in doubt.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum DoubtStep {
    /// Try this first.
    Try(DoubtTry),
    /// No way exists, even if everything were free but what is confirmed, and was looked at from near; by the middles of cells
    /// that bar, a few.
    NoWay(Vec<Point>),
    /// Everything in doubt was looked at that can be; what was and bars still, by the middles of cells, a few.
    Spent(Vec<Point>),
}

impl Doubts {
    /// Forgets everything: the vehicle goes for something else.
    pub(crate) fn clear(&mut self) {
        *self = Doubts::default();
    }

    /// Records a close look at a cell from a place.
    pub(crate) fn note(&mut self, lattice: Lattice, cell: Cell, from: Point) {
        let part = part_of(lattice, cell);
        match self.looks.iter_mut().find(|(known, _)| *known == part) {
            Some((_, places)) => places.push(from),
            None => self.looks.push((part, vec![from])),
        }
    }

    /// Records that a peer, whose map is shared, has looked closely from a place at another one, if that is near enough.
    pub(crate) fn note_peers(&mut self, search: &PathSearch<'_>, at: Point, from: Point) {
        let lattice = search.lattice();
        let cell = lattice.cell_at(at);
        let is_near = from.distance_to(at) <= search.planned_m() + NEAR_M + lattice.cell_m();
        let is_here = |place: &Point| place.distance_to(from) < APART_M;
        if is_near && !self.places_of(lattice, cell).iter().any(is_here) {
            self.note(lattice, cell, from);
        }
    }

    /// Returns what to do next to reach a goal to which no way is known; `peers` are what peers claim.
    pub(crate) fn toward(
        &mut self,
        search: &PathSearch<'_>,
        goal: Point,
        peers: &[Vec<Point>],
    ) -> DoubtStep {
        match self.judged(search, goal, peers) {
            step @ DoubtStep::Try(_) => step,
            end @ (DoubtStep::NoWay(_) | DoubtStep::Spent(_)) => {
                let back = self.go_back(search, peers);
                back.map_or(end, |route| DoubtStep::Try(DoubtTry::GoBack(route)))
            }
        }
    }

    /// Returns the way back to open ground where the vehicle is hemmed in; what it gave up here may be looked at from there.
    fn go_back(&mut self, search: &PathSearch<'_>, peers: &[Vec<Point>]) -> Option<DriveRoute> {
        if self.went_back >= WENT_BACK_MAX {
            return None;
        }
        let points = search.back_to_open(peers)?;
        self.went_back += 1;
        self.given_up.clear();
        Some(DriveRoute {
            corners: points[1..].to_vec(),
            room: RouteRoom::OwnTrack,
        })
    }

    /// Returns what to do next from where the vehicle stands to reach a goal to which no way is known.
    fn judged(&mut self, search: &PathSearch<'_>, goal: Point, peers: &[Vec<Point>]) -> DoubtStep {
        let Some(whole) = search.optimistic_ground(Some(goal), &[]) else {
            return DoubtStep::Spent(Vec::new());
        };
        let route = |grid: &SearchGrid| shortest_route(grid, search.from(), goal, &RULES);
        match route(&whole) {
            Ok(_) => {}
            // What keeps it where it is says nothing of the goal.
            Err(_) if is_shut_in(search, &whole) => return DoubtStep::Spent(Vec::new()),
            Err(_) => {
                return self.past_confirmed(search, goal, peers).unwrap_or_else(|| {
                    DoubtStep::NoWay(middles(search.lattice(), &bars_of(search, &whole, goal)))
                });
            }
        }
        let reached = Reached::from_here(search, peers);
        loop {
            let mut grid = whole.clone();
            self.close_given_up(search, &mut grid);
            let Ok(found) = route(&grid) else {
                return self.spent(search);
            };
            let Some(reached) = &reached else {
                return DoubtStep::Spent(Vec::new());
            };
            if let Some(step) = self.look_along(search, reached, &found.points, peers) {
                return step;
            }
        }
    }

    /// Returns what to do about cells that bar for good, but were confirmed by echoes from wherever the vehicle happened to be:
    /// each that a way would lead over is looked at from near. `None` = so it is with all ways: none exists.
    fn past_confirmed(
        &mut self,
        search: &PathSearch<'_>,
        goal: Point,
        peers: &[Vec<Point>],
    ) -> Option<DoubtStep> {
        let Some(reached) = Reached::from_here(search, peers) else {
            return Some(DoubtStep::Spent(Vec::new()));
        };
        let doubted = self.never_looked_at(search);
        let whole = search.optimistic_ground(Some(goal), &doubted)?;
        let route = |grid: &SearchGrid| shortest_route(grid, search.from(), goal, &RULES).ok();
        route(&whole)?;
        loop {
            let mut grid = whole.clone();
            self.close_given_up(search, &mut grid);
            // What could not be looked at proves nothing.
            let Some(found) = route(&grid) else {
                return Some(self.spent(search));
            };
            if let Some(step) = self.look_along(search, &reached, &found.points, peers) {
                return Some(step);
            }
        }
    }

    /// Returns the confirmed cells, ascending, that no close look has shown.
    fn never_looked_at(&self, search: &PathSearch<'_>) -> Vec<Cell> {
        let lattice = search.lattice();
        let far_m = search.planned_m() + NEAR_M + lattice.cell_m();
        let side_m = f64::from(part_side(lattice)) * lattice.cell_m();
        let looks = self.looks.iter().flat_map(|((x, y), places)| {
            let middle = |part: i32| (f64::from(part) + 0.5) * side_m;
            let at = Point::new(middle(*x), middle(*y));
            places.iter().map(move |from| (*from, at))
        });
        let looks: Vec<(Point, Point)> = looks.collect();
        let mut cells = search.confirmed_cells();
        cells.retain(|cell| {
            let place = lattice.centre(*cell);
            let is_shown = |(from, at): &(Point, Point)| {
                from.distance_to(place) <= far_m && search.covers(*from, *at, place)
            };
            !looks.iter().any(is_shown)
        });
        cells
    }

    /// Returns a close look at one of some cells that bar, if none has been taken yet: what is confirmed was so by echoes from
    /// wherever the vehicle happened to be.
    pub(crate) fn look_at_bars(
        &self,
        search: &PathSearch<'_>,
        bars: &[Cell],
        peers: &[Vec<Point>],
    ) -> Option<CloseLook> {
        let lattice = search.lattice();
        let mut unseen = bars
            .iter()
            .filter(|cell| self.places_of(lattice, **cell).is_empty())
            .peekable();
        unseen.peek()?;
        let reached = Reached::from_here(search, peers)?;
        unseen.find_map(|cell| {
            let node = viewpoint(search, &reached.ground.ways, *cell, &[])?;
            Some(CloseLook {
                course: reached.course_to(search, node),
                at: *cell,
            })
        })
    }

    /// Returns the close look at what bars an optimistic way first; `None` when that has just been given up.
    fn look_along(
        &mut self,
        search: &PathSearch<'_>,
        reached: &Reached,
        route: &[Point],
        peers: &[Vec<Point>],
    ) -> Option<DoubtStep> {
        let Some(at) = first_bar(search, &reached.ground.ways, route) else {
            // It is barred by something else than the map: by peers, or by what the reflex has met.
            return Some(self.spent(search));
        };
        let looked = self
            .looks
            .iter()
            .map(|(_, places)| places.len())
            .sum::<usize>();
        let places = self.places_of(search.lattice(), at);
        if looked >= LOOKS_ALL_MAX + self.went_back * LOOKS_AFTER_BACK
            || self.given_up.len() >= GIVEN_UP_MAX
        {
            return Some(self.spent(search));
        }
        let look_from = |reached: &Reached| {
            let node = viewpoint(search, &reached.ground.ways, at, places)?;
            Some(reached.course_to(search, node))
        };
        // Where it stands too near to something, back over places that it has driven.
        let course = if self.is_spent(search.lattice(), at) {
            None
        } else {
            look_from(reached).or_else(|| look_from(&Reached::over_driven(search, peers)?))
        };
        let Some(course) = course else {
            self.given_up.push(at);
            return None;
        };
        Some(DoubtStep::Try(DoubtTry::Look(CloseLook { course, at })))
    }

    fn spent(&self, search: &PathSearch<'_>) -> DoubtStep {
        let is_first = |(index, cell): &(usize, &Cell)| !self.given_up[..*index].contains(cell);
        let given_up = self.given_up.iter().enumerate().filter(is_first);
        // Of what could not be looked at from anywhere nobody knows whether it bars: the ground there may be empty.
        let lattice = search.lattice();
        let was_looked_at =
            |(_, cell): &(usize, &Cell)| !self.places_of(lattice, **cell).is_empty();
        let middles = given_up
            .filter(was_looked_at)
            .map(|(_, cell)| lattice.centre(*cell));
        DoubtStep::Spent(middles.take(NAMED).collect())
    }

    fn places_of(&self, lattice: Lattice, cell: Cell) -> &[Point] {
        let part = part_of(lattice, cell);
        let known = self.looks.iter().find(|(known, _)| *known == part);
        known.map_or(&[], |(_, places)| places)
    }

    /// Returns whether a part of the ground was looked at from near as often as that may be.
    fn is_spent(&self, lattice: Lattice, cell: Cell) -> bool {
        self.places_of(lattice, cell).len() >= LOOKS_MAX
    }

    /// Closes the places that a cell bars that was given up. A way may pass between these and still be barred by it: a cell
    /// that was given up again is given a wider berth, so that what else is in doubt gets its turn.
    fn close_given_up(&self, search: &PathSearch<'_>, grid: &mut SearchGrid) {
        self.close_bars(search, grid, |_| true);
    }

    /// The same of some of what was given up.
    fn close_bars(
        &self,
        search: &PathSearch<'_>,
        grid: &mut SearchGrid,
        is_closed: impl Fn(&Cell) -> bool,
    ) {
        for (index, cell) in self.given_up.iter().enumerate() {
            if !is_closed(cell) {
                continue;
            }
            let before = self.given_up[..index].iter();
            let again = before.filter(|known| *known == cell).count();
            let wider_m = again as f64 * grid.lattice().cell_m();
            for (part, kept_m) in search.barring_parts(*cell) {
                grid.close_within(Segment::new(part, part), kept_m + wider_m);
            }
        }
        grid.stand_on(grid.lattice().cell_at(search.from()));
    }
}

/// Returns the part of the ground that a cell belongs to.
fn part_of(lattice: Lattice, cell: Cell) -> (i32, i32) {
    let side = part_side(lattice);
    (cell.x.div_euclid(side), cell.y.div_euclid(side))
}

/// Returns the side of such a part, in cells.
fn part_side(lattice: Lattice) -> i32 {
    ((PART_M / lattice.cell_m()).round() as i32).max(1)
}

/// The ways to all places that can be reached over ground that is known to be free.
struct Reached {
    ground: ReachedGround,
    /// Over places too that it has driven, however near to something these are.
    is_narrow: bool,
}

impl Reached {
    fn finely(ground: ReachedGround) -> Reached {
        Reached {
            ground,
            is_narrow: false,
        }
    }

    fn from_here(search: &PathSearch<'_>, peers: &[Vec<Point>]) -> Option<Reached> {
        search.reached_finely(peers).map(Reached::finely)
    }

    fn over_driven(search: &PathSearch<'_>, peers: &[Vec<Point>]) -> Option<Reached> {
        let mut grid = search.ground(None, Resolution::Parts, false, peers)?;
        grid.open_along(search.driven());
        let start = grid.lattice().cell_at(search.from());
        let ways = Distances::from_start(&grid, start, &RULES).ok()?;
        Some(Reached {
            ground: ReachedGround { grid, ways },
            is_narrow: true,
        })
    }

    /// Returns the way to a node that can be reached; `None` = the vehicle is there.
    fn course_to(&self, search: &PathSearch<'_>, node: Cell) -> Option<DriveRoute> {
        let ReachedGround { grid, ways } = &self.ground;
        let nodes = ways.lattice();
        if node == nodes.cell_at(search.from()) {
            return None;
        }
        let route = ways.route_to(grid, search.from(), nodes.centre(node))?;
        Some(DriveRoute {
            corners: route.points[1..].to_vec(),
            room: RouteRoom::searched(self.is_narrow),
        })
    }
}

/// Returns the cell that bars a way first beyond what of it can be reached.
fn first_bar(search: &PathSearch<'_>, reached: &Distances, route: &[Point]) -> Option<Cell> {
    let places = places_along(route);
    let beyond = beyond_reached(reached, &places);
    // A way may lie between the places that are searched: then what it is closest to.
    let spare_m = 0.75 * reached.lattice().cell_m();
    [0.0, spare_m].into_iter().find_map(|spare_m| {
        let first = |at: &Point| search.barring(*at, Bar::Unknown, spare_m).first().copied();
        beyond.iter().find_map(first)
    })
}

/// Returns which of the places along a way lie beyond the last one that can be reached.
fn beyond_reached<'p>(reached: &Distances, places: &'p [Point]) -> &'p [Point] {
    let is_reached = |at: &Point| reached.cost_m(reached.lattice().cell_at(*at)).is_some();
    let last = places.iter().rposition(is_reached);
    &places[last.map_or(0, |last| last + 1)..]
}

/// Returns places along a route, a step apart.
fn places_along(route: &[Point]) -> Vec<Point> {
    let track = Track::new(route.to_vec());
    track.map_or_else(Vec::new, |track| track.places(STEP_M).collect())
}

/// Returns the node from which a cell is best looked at from near: one that can be reached, from which nothing hides it, and
/// away from where it was looked at before.
fn viewpoint(
    search: &PathSearch<'_>,
    reached: &Distances,
    at: Cell,
    looked_from: &[Point],
) -> Option<Cell> {
    let (nodes, target) = (reached.lattice(), search.lattice().centre(at));
    let near_m = search.planned_m() + NEAR_M;
    let around = CellRect::around(nodes, &[target], near_m)?;
    let worth = |node: Cell| {
        let (place, way_m) = (nodes.centre(node), reached.cost_m(node)?);
        let away_m = place.distance_to(target);
        let is_new = looked_from
            .iter()
            .all(|from| from.distance_to(place) >= APART_M);
        (away_m <= near_m && is_new).then_some((away_m + WAY_SHARE * way_m, node))
    };
    let mut found: Vec<(f64, Cell)> = around.cells().filter_map(worth).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let sees = |node: &Cell| search.sees_close(nodes.centre(*node), target);
    found.into_iter().map(|(_, node)| node).find(sees)
}

/// Returns whether nothing can be reached from where the vehicle stands but that place itself: it is too near to something,
/// such as the fence.
fn is_shut_in(search: &PathSearch<'_>, optimistic: &SearchGrid) -> bool {
    let start = optimistic.lattice().cell_at(search.from());
    let around = CellRect::new(start, start).grown(1);
    Distances::within(
        optimistic,
        start,
        &RULES,
        2.0 * optimistic.lattice().cell_m(),
    )
    .map_or(true, |reached| reached.costs_m(around).count() <= 1)
}

/// Returns the middles of cells.
fn middles(lattice: Lattice, cells: &[Cell]) -> Vec<Point> {
    cells.iter().map(|cell| lattice.centre(*cell)).collect()
}

/// Returns the cells that bar a goal for good, a few: those near it, or near where an optimist gets to.
fn bars_of(search: &PathSearch<'_>, optimistic: &SearchGrid, goal: Point) -> Vec<Cell> {
    let barring = |place: Point| {
        let mut cells = search.barring(place, Bar::Confirmed, 0.0);
        cells.truncate(NAMED);
        cells
    };
    let at_goal = barring(goal);
    if !at_goal.is_empty() {
        return at_goal;
    }
    let nodes = optimistic.lattice();
    let start = nodes.cell_at(search.from());
    let Ok(reached) = Distances::from_start(optimistic, start, &RULES) else {
        return Vec::new();
    };
    let cells = optimistic
        .area()
        .cells()
        .filter(|node| reached.cost_m(*node).is_some());
    let away_m = |node: Cell| (nodes.centre(node).distance_to(goal), node);
    let nearest = cells.map(away_m).min_by(|a, b| a.0.total_cmp(&b.0));
    let before_goal = nearest.map_or_else(Vec::new, |(_, node)| barring(nodes.centre(node)));
    if !before_goal.is_empty() {
        return before_goal;
    }
    // Nothing bars in a straight line: what bars the way that there would be without all that is confirmed.
    let without = search.optimistic_ground(Some(goal), &search.confirmed_cells());
    let route = without.and_then(|grid| shortest_route(&grid, search.from(), goal, &RULES).ok());
    let places = route.map_or_else(Vec::new, |route| places_along(&route.points));
    let mut beyond = beyond_reached(&reached, &places)
        .iter()
        .map(|at| barring(*at));
    beyond.find(|cells| !cells.is_empty()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::mission::terrain::tests::terrain_of;
    use crate::node::tests_support::own_state;
    use crate::time::Time;

    #[test]
    fn a_cell_that_is_given_up_again_is_given_a_wider_berth() {
        let terrain = terrain_of(|x_m, y_m| (2.0..2.2).contains(&x_m) && (0.0..0.2).contains(&y_m));
        let search = terrain.search(Time::ZERO, own_state(0.0, 0.0).pose);
        let whole = search.optimistic_ground(None, &[]).unwrap();
        let open = |given_up: Vec<Cell>| {
            let doubts = Doubts {
                given_up,
                ..Doubts::default()
            };
            let mut grid = whole.clone();
            doubts.close_given_up(&search, &mut grid);
            grid.area()
                .cells()
                .filter(|node| grid.passable(*node))
                .count()
        };
        let (cell, free) = (Cell::new(10, 0), Cell::new(20, 0));
        assert_eq!(
            open(vec![]),
            open(vec![free]),
            "what is free by now bars nobody"
        );
        let (once, twice) = (open(vec![cell]), open(vec![cell, cell]));
        assert!(open(vec![]) > once && once > twice, "{once} {twice}");
    }

    #[test]
    fn a_vehicle_that_cannot_leave_its_place_does_not_say_that_there_is_no_way_elsewhere() {
        // The fence is at −5; whoever knows its place this badly keeps 1.2 m away from it.
        let terrain = terrain_of(|_, _| false);
        for x_m in [-4.98, -4.7, -4.4, -4.0] {
            let mut pose = own_state(x_m, 0.0).pose;
            pose.sd_m = 0.3;
            let search = terrain.search(Time::ZERO, pose);
            let step = Doubts::default().toward(&search, Point::new(20.0, 0.0), &[]);
            assert!(!matches!(step, DoubtStep::NoWay(_)), "{x_m}: {step:?}");
        }
    }

    #[test]
    fn no_way_into_a_closed_room_is_said_after_its_walls_were_looked_at_from_near_and_not_before() {
        let is_wall = |x_m: f64, y_m: f64| {
            let (x_m, y_m) = ((x_m - 4.0).abs(), y_m.abs());
            x_m.max(y_m) < 1.4 && x_m.max(y_m) > 1.2
        };
        let goal = Point::new(4.0, 0.0);
        let terrain = terrain_of(is_wall);
        let mut doubts = Doubts::default();
        let mut place = Point::new(0.0, 0.0);
        let mut looks: Vec<(Point, Point)> = Vec::new();
        let bars = loop {
            let search = terrain.search(Time::ZERO, own_state(place.x_m, place.y_m).pose);
            match doubts.toward(&search, goal, &[]) {
                DoubtStep::Try(DoubtTry::Look(CloseLook { course, at })) => {
                    place = course.map_or(place, |course| *course.corners.last().unwrap());
                    let lattice = search.lattice();
                    doubts.note(lattice, at, place);
                    looks.push((place, lattice.centre(at)));
                }
                DoubtStep::NoWay(bars) => break bars,
                other => panic!("after {} looks: {other:?}", looks.len()),
            }
        };
        assert!(
            (5..=LOOKS_ALL_MAX).contains(&looks.len()),
            "{}",
            looks.len()
        );
        assert!(looks.iter().all(|(from, at)| from.distance_to(*at) < 2.0));
        assert!(bars.iter().all(|at| is_wall(at.x_m, at.y_m)), "{bars:?}");
        // Each side of it was looked at.
        for (x_m, y_m) in [(2.7, 0.0), (5.3, 0.0), (4.0, -1.3), (4.0, 1.3)] {
            let side = Point::new(x_m, y_m);
            assert!(
                looks.iter().any(|(_, at)| at.distance_to(side) < 1.5),
                "{side:?}"
            );
        }
    }

    #[test]
    fn a_small_thing_that_alone_bars_is_looked_at_once_although_it_is_confirmed() {
        // A wall with a doorway, and in it what may be a pole.
        let is_pole = |x_m: f64, y_m: f64| (4.0..4.2).contains(&x_m) && (0.0..0.2).contains(&y_m);
        let is_wall = |x_m: f64, y_m: f64| (4.0..4.4).contains(&x_m) && !(-0.6..0.8).contains(&y_m);
        let look_of = |doubts: &mut Doubts, has_pole: bool| {
            let terrain = terrain_of(|x_m, y_m| {
                is_wall(x_m, y_m)
                    || (has_pole && is_pole(x_m, y_m))
                    || x_m < -4.0
                    || y_m.abs() > 4.0
            });
            let search = terrain.search(Time::ZERO, own_state(0.0, 0.0).pose);
            assert_eq!(
                search.small_things(SMALL_CELLS).len(),
                usize::from(has_pole)
            );
            doubts.toward_unseen(&search, search.reached_finely(&[]), &[])
        };
        let mut doubts = Doubts::default();
        let Ok(DoubtTry::Look(look)) = look_of(&mut doubts, true) else {
            panic!("it looks")
        };
        assert_eq!(look.at, Cell::new(20, 0));
        doubts.note(Lattice::new(0.2), look.at, Point::new(3.0, 0.0));
        assert_eq!(
            look_of(&mut doubts, true),
            Err(0.0),
            "it stays, and bars for good: what lies behind it cannot be reached"
        );
    }
}
