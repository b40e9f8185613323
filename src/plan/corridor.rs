//! *Look before you drive*: how far along its route a vehicle may drive, because the whole strip that it will
//! sweep is known to be free. Whether the rest is then looked at or planned around is for the mission to say.
//!
//! What is not free is judged part by part (see [`RequiredClearance`]).

use std::f64::consts::SQRT_2;

use super::RequiredClearance;
use super::swath::{ALL_ROWS, rows_within};
use crate::geom::{Cell, Point, Segment, Vector};
use crate::map::View;

/// A contact counts when it is deeper than this, metres: rounding must not hold a vehicle that only touches.
const TOUCH_M: f64 = 1e-9;

/// The strip that must be free, and how far ahead it is asked for.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Corridor {
    /// Half of its width, by what is not free there.
    pub clearance: RequiredClearance,
    /// How far ahead of the vehicle to judge, metres along the route.
    pub ahead_m: f64,
}

/// How much of a route is released.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Release {
    /// Length along the route, metres from its first point, up to which the strip is known free: the place where
    /// the vehicle's disc would first touch a cell that is not. At most the route's length, or where `ahead_m`
    /// ends.
    pub free_until_m: f64,
    /// Where on the route the vehicle is, metres from its first point. Never more than `free_until_m`.
    pub here_m: f64,
    /// The occupied cell which the disc touches first, by its middle; `None` when there is none ahead.
    pub blocked: Option<Point>,
    /// Length along the route at which it touches that cell, metres.
    pub blocked_at_m: Option<f64>,
    /// The unknown cell which the disc touches first, by its middle; `None` when there is none ahead.
    pub unknown: Option<Point>,
    /// Length along the route at which it touches that cell, metres.
    pub unknown_at_m: Option<f64>,
}

impl Release {
    /// Returns how far the vehicle may still drive, metres.
    pub fn ahead_m(&self) -> f64 {
        self.free_until_m - self.here_m
    }
}

/// Where the vehicle stands, and its place on the route when it has only drifted from there.
#[derive(Clone, Copy)]
struct Stands {
    from: Point,
    on_route: Point,
}

impl Stands {
    fn at(from: Point, on_route: Point, drift_m: f64) -> Stands {
        let drifted = from.distance_to(on_route) <= drift_m;
        Stands {
            from,
            on_route: if drifted { on_route } else { from },
        }
    }

    fn distance_to(self, cell: Point) -> f64 {
        self.from
            .distance_to(cell)
            .min(self.on_route.distance_to(cell))
    }
}

/// The first contact with cells of one kind.
#[derive(Clone, Copy)]
struct Contact {
    at_m: f64,
    cell: Option<Point>,
}

impl Contact {
    const NONE: Contact = Contact {
        at_m: f64::INFINITY,
        cell: None,
    };

    fn meet(&mut self, at_m: f64, cell: Point) {
        if at_m < self.at_m {
            *self = Contact {
                at_m,
                cell: Some(cell),
            };
        }
    }
}

impl Corridor {
    /// Judges a route from where the vehicle stands (`from`: the nearest place on the route counts, the earliest
    /// on a tie). What lies behind is not judged. A cell already nearer than the half-width holds the vehicle only
    /// where it would come nearer still by more than half a cell: who stands too close to something may always move away.
    /// (Being off the route by up to one cell is driving error; coming back to the route is then not judged.)
    ///
    /// An empty route, or one that is not finite, releases nothing.
    pub fn released(&self, view: &View<'_>, route: &[Point], from: Point) -> Release {
        let nothing = Release {
            free_until_m: 0.0,
            here_m: 0.0,
            blocked: None,
            blocked_at_m: None,
            unknown: None,
            unknown_at_m: None,
        };
        if route.is_empty() || !from.is_finite() || !route.iter().all(|point| point.is_finite()) {
            return nothing;
        }
        let here_m = nearest_on(route, from);
        let end_m = here_m + self.ahead_m.max(0.0);
        let (mut blocked, mut unknown) = (Contact::NONE, Contact::NONE);
        let mut stands = None;
        let mut done_m = 0.0;
        for pair in route.windows(2) {
            let whole = Segment::new(pair[0], pair[1]);
            let length_m = whole.length_m();
            let start_m = done_m;
            done_m += length_m;
            if done_m <= here_m || length_m == 0.0 {
                continue;
            }
            let share = |at_m: f64| ((at_m - start_m) / length_m).clamp(0.0, 1.0);
            let (first, last) = (share(here_m), share(end_m));
            let part = Segment::new(
                whole.from.toward(whole.to, first),
                whole.from.toward(whole.to, last),
            );
            // Where it stands is taken once, on the first part that is not behind it: a cell that is too near now is
            // excused on all parts, as far as it is near now.
            let here = *stands.get_or_insert(Stands::at(from, part.from, view.lattice().cell_m()));
            self.judge(
                view,
                part,
                start_m + first * length_m,
                here,
                &mut blocked,
                &mut unknown,
            );
            // What is unknown does not end the search: it may be looked at, and then what is occupied behind it counts.
            if done_m >= end_m || blocked.cell.is_some() {
                break;
            }
        }
        let until_m = done_m.min(end_m).max(here_m);
        Release {
            free_until_m: until_m.min(blocked.at_m).min(unknown.at_m),
            here_m,
            blocked: blocked.cell,
            blocked_at_m: blocked.cell.map(|_| blocked.at_m),
            unknown: unknown.cell,
            unknown_at_m: unknown.cell.map(|_| unknown.at_m),
        }
    }

    /// Finds the first contacts on one straight part that begins at `start_m`.
    fn judge(
        &self,
        view: &View<'_>,
        part: Segment,
        start_m: f64,
        stands: Stands,
        blocked: &mut Contact,
        unknown: &mut Contact,
    ) {
        let lattice = view.lattice();
        // The middles of a cell's outermost parts lie so far from its own.
        let spread_m = lattice.cell_m() * SQRT_2 * 3.0 / 8.0;
        let width_m = self.clearance.most_m() + spread_m;
        let length_m = part.length_m();
        let along = match length_m {
            0.0 => Vector::default(),
            length_m => part.vector() * (1.0 / length_m),
        };
        for (y, columns) in rows_within(lattice, part, width_m, ALL_ROWS) {
            for x in columns {
                let cell = Cell::new(x, y);
                let Some(barred) = view.barred(cell) else {
                    continue;
                };
                let kept_m = self.clearance.from_cell_m(barred);
                let centre = lattice.centre(cell);
                if part.distance_to_point(centre) - spread_m >= kept_m {
                    continue;
                }
                let contact = match barred.is_occupied() {
                    false => &mut *unknown,
                    true => &mut *blocked,
                };
                // No part of it is met before this: another one may be met sooner anyway.
                let ahead_m = (centre - part.from).dot(along);
                if start_m + ahead_m - kept_m - spread_m > contact.at_m {
                    continue;
                }
                for place in barred.places(lattice, cell) {
                    let here_m = stands.distance_to(place);
                    let reach_m = match here_m < kept_m {
                        true => self.clearance.leaving_m(here_m, lattice.cell_m() / 2.0),
                        false => kept_m,
                    } - TOUCH_M;
                    if let Some(at_m) = first_touch(part, place, reach_m) {
                        contact.meet(start_m + at_m, centre);
                    }
                }
            }
        }
    }
}

/// Returns how far along a part a point moves until it comes nearer than `reach_m` to `centre`.
fn first_touch(part: Segment, centre: Point, reach_m: f64) -> Option<f64> {
    let length_m = part.length_m();
    if reach_m <= 0.0 {
        return None;
    }
    if part.from.distance_to(centre) < reach_m {
        return Some(0.0);
    }
    if length_m == 0.0 {
        return None;
    }
    let along = part.vector() * (1.0 / length_m);
    let to = centre - part.from;
    let (ahead_m, aside_m) = (to.dot(along), along.cross(to));
    let depth_m2 = reach_m * reach_m - aside_m * aside_m;
    if depth_m2 <= 0.0 || ahead_m <= 0.0 {
        return None;
    }
    let at_m = (ahead_m - depth_m2.sqrt()).max(0.0);
    (at_m <= length_m).then_some(at_m)
}

/// Returns the length along a route at which it comes nearest to a point.
fn nearest_on(route: &[Point], point: Point) -> f64 {
    let (mut best_m, mut at_m, mut done_m) = (f64::INFINITY, 0.0, 0.0);
    for pair in route.windows(2) {
        let segment = Segment::new(pair[0], pair[1]);
        let length_m = segment.length_m();
        let share = segment.nearest_share(point);
        let distance_m = segment.from.toward(segment.to, share).distance_to(point);
        if distance_m < best_m {
            (best_m, at_m) = (distance_m, done_m + share * length_m);
        }
        done_m += length_m;
    }
    at_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Lattice;
    use crate::map::{Bar, BarredCell, CellRect, Merged};
    use proptest::prelude::*;
    use std::sync::Arc;
    use tomoswarm_proto::{LayerId, TILE_CELLS, TileAddress, TileReport};

    const CORRIDOR: Corridor = Corridor {
        clearance: RequiredClearance {
            occupied_m: 0.5,
            unknown_m: 0.5,
            least_m: 0.5,
            body_m: 0.5,
        },
        ahead_m: 4.0,
    };

    /// A free map around the datum with some cells of other values.
    fn map(others: &[(Point, i8)]) -> Merged {
        let lattice = Lattice::new(0.2);
        let mut map = Merged::new(lattice, None);
        for (x, y) in (-2..2).flat_map(|x| (-2..2).map(move |y| (x, y))) {
            let mut cells = [-17; TILE_CELLS];
            for (at, value) in others {
                let cell = lattice.cell_at(*at);
                if (cell.x >> 5, cell.y >> 5) == (x, y) {
                    cells[((cell.y & 31) * 32 + (cell.x & 31)) as usize] = *value;
                }
            }
            let address = TileAddress { slice: 0, x, y };
            let cells = Arc::new(cells);
            map.join(&TileReport {
                layer: LayerId::default(),
                address,
                revision: 1,
                cells,
            })
            .unwrap();
        }
        map
    }

    fn released(map: &Merged, route: &[(f64, f64)], from: (f64, f64)) -> Release {
        let route: Vec<Point> = route.iter().map(|(x, y)| Point::new(*x, *y)).collect();
        let view = map.view(0, CellRect::around(map.lattice(), &route, 1.0).unwrap());
        CORRIDOR.released(&view, &route, Point::new(from.0, from.1))
    }

    #[test]
    fn a_free_route_is_released_as_far_as_asked() {
        let map = map(&[]);
        let release = released(&map, &[(0.0, 0.0), (2.0, 0.0), (2.0, 3.0)], (0.5, 0.1));
        assert!((release.here_m - 0.5).abs() < 1e-9 && (release.free_until_m - 4.5).abs() < 1e-9);
        assert_eq!((release.blocked, release.unknown), (None, None));
        let short = released(&map, &[(0.0, 0.0), (2.0, 0.0)], (0.5, 0.1));
        assert!((short.ahead_m() - 1.5).abs() < 1e-9);
    }

    #[test]
    fn the_first_cell_that_the_disc_touches_ends_the_release() {
        let (occupied, unknown) = (Point::new(3.1, 0.3), Point::new(2.5, -0.1));
        let release = released(
            &map(&[(occupied, 17), (unknown, 0)]),
            &[(0.1, 0.0), (6.0, 0.0)],
            (0.1, 0.0),
        );
        assert!(release.blocked.unwrap().distance_to(occupied) < 1e-9);
        // The parts that are met first: 0.225 m beside the way, and 0.025 m, each 0.075 m nearer than its cell's middle.
        let touch_m = |ahead_m: f64, aside_m: f64| ahead_m - (0.25 - aside_m * aside_m).sqrt();
        let blocked_m = touch_m(3.025 - 0.1, 0.225);
        assert!((release.blocked_at_m.unwrap() - blocked_m).abs() < 1e-6);
        assert!(release.unknown.unwrap().distance_to(unknown) < 1e-9);
        assert!((release.free_until_m - touch_m(2.425 - 0.1, 0.025)).abs() < 1e-6);
    }

    #[test]
    fn what_lies_beside_or_behind_does_not_hold_the_vehicle() {
        let beside = [(Point::new(2.1, 0.9), 17), (Point::new(0.1, -0.1), 17)];
        let release = released(&map(&beside), &[(0.0, 0.1), (3.0, 0.1)], (1.0, 0.1));
        assert!((release.free_until_m - 3.0).abs() < 1e-9, "{release:?}");
    }

    #[test]
    fn who_stands_too_near_to_something_may_only_move_away() {
        let map = map(&[(Point::new(0.1, 0.3), 17)]);
        let away = released(&map, &[(0.1, 0.0), (0.1, -2.0)], (0.1, 0.0));
        assert!((away.ahead_m() - 2.0).abs() < 1e-9);
        let toward = released(&map, &[(0.1, 0.0), (0.1, 2.0)], (0.1, 0.0));
        assert!(toward.ahead_m() < 1e-6 && toward.blocked.is_some());
    }

    #[test]
    fn nothing_is_released_on_ground_that_nobody_has_seen_or_without_a_route() {
        let empty = Merged::new(Lattice::new(0.2), None);
        let release = released(&empty, &[(0.05, 0.05), (2.0, 0.0)], (0.05, 0.05));
        assert!(release.ahead_m() < 0.05 && release.unknown.is_some());
        let map = map(&[]);
        let view = map.view(0, CellRect::new(Cell::new(0, 0), Cell::new(9, 9)));
        for route in [
            vec![],
            vec![Point::new(f64::NAN, 0.0), Point::new(1.0, 1.0)],
        ] {
            assert_eq!(
                CORRIDOR
                    .released(&view, &route, Point::new(0.0, 0.0))
                    .ahead_m(),
                0.0
            );
        }
    }

    proptest! {
        #[test]
        fn the_released_part_sweeps_over_free_cells_only(
            route in proptest::collection::vec((-3.0..3.0f64, -3.0..3.0f64), 2..6),
            others in proptest::collection::vec((-4.0..4.0f64, -4.0..4.0f64, prop::sample::select(vec![0i8, 17])), 0..12),
        ) {
            let others: Vec<(Point, i8)> = others.into_iter().map(|(x, y, v)| (Point::new(x, y), v)).collect();
            let map = map(&others);
            let release = released(&map, &route, route[0]);
            let (start, lattice) = (Point::new(route[0].0, route[0].1), map.lattice());
            let barred = BarredCell { bar: Bar::Doubtful, parts: u16::MAX };
            let cells = others.iter().map(|(at, _)| lattice.cell_at(*at));
            let bad: Vec<Point> = cells.flat_map(|cell| barred.places(lattice, cell)).collect();
            let (mut left_m, mut contact) = (release.free_until_m, false);
            for pair in route.windows(2) {
                let along = Segment::new(Point::new(pair[0].0, pair[0].1), Point::new(pair[1].0, pair[1].1));
                let part_m = left_m.min(along.length_m());
                for step in 0..=100 {
                    let at = along.from.toward(along.to, part_m / along.length_m() * f64::from(step) / 100.0);
                    for cell in &bad {
                        let allowed_m = CORRIDOR.clearance.occupied_m.min(start.distance_to(*cell));
                        prop_assert!(at.distance_to(*cell) >= allowed_m - 1e-6);
                        contact |= at.distance_to(*cell) <= allowed_m + 0.02;
                    }
                }
                left_m -= part_m;
                if left_m <= 0.0 {
                    break;
                }
            }
            let whole_m: f64 = route.windows(2).map(|p| (p[0].0 - p[1].0).hypot(p[0].1 - p[1].1)).sum();
            let complete = (release.free_until_m - whole_m.min(4.0)).abs() < 1e-6;
            prop_assert!(complete || contact, "stopped without a reason: {release:?}");
        }
    }
}
