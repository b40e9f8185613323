//! Claims about evidence, checked in small simulated rooms that know nothing of the sensor model under test.

use super::*;
use crate::geom::{Angle, Point, Segment, Vector};
use crate::map::Occupancy;
use proptest::prelude::*;
use tomoswarm_proto::{Boot, VehicleId};

const OWN: LayerId = LayerId {
    vehicle: VehicleId(1),
    boot: Boot(1),
};
const CELL_M: f64 = 0.2;
const BODY_M: f64 = 0.25;
/// Walls answer up to this angle from their normal, degrees.
const INCIDENCE_DEGREES: f64 = 60.0;

/// A vehicle that looks around among walls.
struct Room {
    walls: Vec<Segment>,
    map: Merged,
    mapper: Mapper,
    half_width_rad: f64,
    sure_range_m: f64,
    looks: u64,
    noise_m: f64,
}

impl Room {
    fn new(walls: Vec<Segment>, half_width_degrees: f64, sure_range_m: f64) -> Room {
        Room {
            walls,
            map: Merged::new(Lattice::new(CELL_M), Some(OWN)),
            mapper: Mapper::new(OWN, 0),
            half_width_rad: half_width_degrees.to_radians(),
            sure_range_m,
            looks: 0,
            noise_m: 0.02,
        }
    }

    /// The nearest of many rays of the cone that strikes a wall steeply enough, with some noise.
    fn echo(&mut self, at: Point, direction: Angle) -> Option<f64> {
        let rays = (-30..=30).map(|step| f64::from(step) / 30.0 * self.half_width_rad);
        let hits =
            rays.filter_map(|turn_rad| self.ray(at, direction + Angle::from_radians(turn_rad)));
        let nearest_m = hits
            .filter(|range_m| *range_m <= 3.0)
            .min_by(f64::total_cmp);
        self.looks += 1;
        let noise = (self.looks.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as f64
            / f64::from(1 << 24)
            - 0.5;
        nearest_m.map(|range_m| range_m + 2.0 * self.noise_m * noise)
    }

    /// Where a ray strikes the first wall, when it does so steeply enough to be answered.
    fn ray(&self, at: Point, direction: Angle) -> Option<f64> {
        let ray = Vector::polar(direction, 1.0);
        let strikes = self.walls.iter().filter_map(|wall| {
            let (along, to) = (wall.vector(), wall.from - at);
            let cross = ray.cross(along);
            let (range_m, share) = (to.cross(along) / cross, to.cross(ray) / cross);
            let steep = cross.abs() / along.length_m() >= INCIDENCE_DEGREES.to_radians().cos();
            (range_m > 0.0 && (0.0..=1.0).contains(&share)).then_some((range_m, steep))
        });
        let first = strikes.min_by(|a, b| a.0.total_cmp(&b.0));
        first.and_then(|(range_m, steep)| steep.then_some(range_m))
    }

    fn look(&mut self, at: Point, direction: Angle, peers: &[PeerBody<'_>]) -> Changes {
        let range_m = self.echo(at, direction);
        self.hear(at, direction, range_m, peers)
    }

    /// Takes a reading from a place, of an echo or of none, whatever stands there.
    fn hear(
        &mut self,
        at: Point,
        direction: Angle,
        range_m: Option<f64>,
        peers: &[PeerBody<'_>],
    ) -> Changes {
        let (half_width_rad, sure_range_m) = (self.half_width_rad, self.sure_range_m);
        let scan = reading(at, direction, half_width_rad, sure_range_m, range_m);
        let body = OwnDisc {
            at,
            radius_m: BODY_M,
        };
        self.mapper.record(&mut self.map, &scan, body, peers)
    }

    /// The cells that walls pass through, but for those that they only touch at a corner.
    fn wall_cells(&self) -> Vec<Cell> {
        let deep = |cell: Cell, wall: &Segment| {
            let middle = self.map.lattice().centre(cell);
            wall.distance_to_point(middle) < 0.45 * CELL_M
        };
        let lattice = self.map.lattice();
        let under = self
            .walls
            .iter()
            .flat_map(|wall| lattice.cells_under(*wall).filter(move |c| deep(*c, wall)));
        under.collect()
    }

    fn at(&self, x_m: f64, y_m: f64) -> Occupancy {
        self.map
            .occupancy(0, self.map.lattice().cell_at(Point::new(x_m, y_m)))
    }
}

fn reading(
    origin: Point,
    direction: Angle,
    half_width_rad: f64,
    sure_range_m: f64,
    range_m: Option<f64>,
) -> ScanReading {
    ScanReading {
        origin,
        direction,
        half_width_rad,
        range_m,
        max_range_m: 3.0,
        sure_range_m,
        min_range_m: 0.1,
        origin_sd_m: 0.0,
    }
}

fn wall(x0: f64, y0: f64, x1: f64, y1: f64) -> Segment {
    Segment::new(Point::new(x0, y0), Point::new(x1, y1))
}

fn degrees(degrees: f64) -> Angle {
    Angle::from_degrees(degrees)
}

#[test]
fn nothing_is_seen_from_near_from_a_place_that_is_not_known_by_half_a_cell() {
    let free_value = |origin_sd_m: f64| {
        let mut room = Room::new(Vec::new(), 15.0, 2.0);
        let at = Point::new(0.1, 0.1);
        let scan = ScanReading {
            origin_sd_m,
            ..reading(at, degrees(0.0), 0.26, 2.0, None)
        };
        let body = OwnDisc {
            at,
            radius_m: BODY_M,
        };
        for _ in 0..3 {
            room.mapper.record(&mut room.map, &scan, body, &[]);
        }
        let value = |x_m: f64| {
            let cell = room.map.lattice().cell_at(Point::new(x_m, at.y_m));
            room.map.value(0, cell)
        };
        [value(0.9), value(at.x_m)]
    };
    assert_eq!(free_value(0.5 * CELL_M), [-17, -17], "ahead, and under it");
    assert_eq!(free_value(0.51 * CELL_M), [-12, -12]);
}

#[test]
fn a_wall_ahead_becomes_occupied_and_the_way_to_it_free() {
    let mut room = Room::new(vec![wall(2.1, -3.0, 2.1, 3.0)], 15.0, 2.0);
    let at = Point::new(0.05, 0.05);
    let turns = [0.0, 0.0, 12.0, -12.0, 0.0, 12.0, -12.0, 0.0, 0.0, 0.0];
    let looks = turns.map(|turn| room.look(at, degrees(turn), &[]));
    assert!(
        looks[..3]
            .iter()
            .any(|changes| !changes.newly_occupied.is_empty())
    );
    assert_eq!(room.at(2.1, 0.05), Occupancy::Occupied);
    for x_m in [0.1, 0.5, 1.0, 1.5] {
        assert_eq!(room.at(x_m, 0.05), Occupancy::Free, "{x_m}");
    }
    assert_eq!(room.at(2.5, 0.05), Occupancy::Unknown);
    assert_eq!(room.at(-0.5, 0.05), Occupancy::Unknown);
}

#[test]
fn one_echo_of_a_narrow_beam_makes_one_cell_occupied() {
    for beam in [0.0, 33.0, 45.0, -120.0] {
        let mut room = Room::new(
            vec![wall(-2.0, -2.0, 2.0, -2.0), wall(2.0, -2.0, 2.0, 2.0)],
            1.0,
            2.0,
        );
        let at = Point::new(0.03, -0.07);
        let Some(range_m) = room.echo(at, degrees(beam)) else {
            continue;
        };
        let scan = reading(at, degrees(beam), 0.0, 2.0, Some(range_m));
        room.mapper.record(
            &mut room.map,
            &scan,
            OwnDisc {
                at,
                radius_m: BODY_M,
            },
            &[],
        );
        let struck = at + Vector::polar(degrees(beam), range_m);
        assert_eq!(
            room.at(struck.x_m, struck.y_m),
            Occupancy::Occupied,
            "{beam}"
        );
    }
}

#[test]
fn looking_again_at_what_is_known_changes_nothing() {
    let mut room = Room::new(vec![wall(2.1, -3.0, 2.1, 3.0)], 15.0, 2.0);
    room.noise_m = 0.0;
    for _ in 0..20 {
        room.look(Point::new(0.05, 0.05), degrees(0.0), &[]);
    }
    assert!(
        room.look(Point::new(0.05, 0.05), degrees(0.0), &[])
            .is_empty()
    );
    let revisions: Vec<u32> = room
        .map
        .layer(OWN)
        .unwrap()
        .tiles()
        .map(|(_, tile)| tile.revision)
        .collect();
    assert!(
        revisions.iter().all(|revision| *revision < 20),
        "{revisions:?}"
    );
}

#[test]
fn no_echo_frees_only_the_sure_range() {
    let mut room = Room::new(vec![], 15.0, 1.4);
    for _ in 0..5 {
        room.look(Point::new(0.05, 0.05), degrees(90.0), &[]);
    }
    assert_eq!(room.at(0.05, 1.3), Occupancy::Free);
    assert_eq!(room.at(0.05, 1.7), Occupancy::Unknown);
}

#[test]
fn a_peer_is_not_mapped_and_nothing_behind_it_is_free() {
    let mut room = Room::new(vec![wall(1.5, -0.2, 1.5, 0.2)], 15.0, 2.5);
    let leg = [Point::new(1.7, -2.0), Point::new(1.7, 2.0)];
    for _ in 0..5 {
        let changes = room.look(
            Point::new(0.05, 0.05),
            degrees(0.0),
            &[PeerBody {
                leg: &leg,
                radius_m: 0.3,
            }],
        );
        assert!(changes.newly_occupied.is_empty());
    }
    assert_eq!(room.at(1.5, 0.05), Occupancy::Unknown);
    assert_eq!(room.at(1.9, 0.05), Occupancy::Unknown);
    assert_eq!(room.at(0.9, 0.05), Occupancy::Free);
    let far = [Point::new(1.5, 2.0)];
    for _ in 0..3 {
        room.look(
            Point::new(0.05, 0.05),
            degrees(0.0),
            &[PeerBody {
                leg: &far,
                radius_m: 0.3,
            }],
        );
    }
    assert_eq!(room.at(1.5, 0.05), Occupancy::Occupied);
}

#[test]
fn what_has_gone_is_freed_by_looking_through_its_place() {
    let mut room = Room::new(vec![wall(1.1, -0.2, 1.1, 0.2)], 15.0, 2.5);
    for _ in 0..10 {
        room.look(Point::new(0.05, 0.05), degrees(0.0), &[]);
    }
    assert_eq!(room.at(1.1, 0.05), Occupancy::Occupied);
    room.walls.clear();
    for _ in 0..10 {
        room.look(Point::new(0.05, 0.05), degrees(0.0), &[]);
    }
    assert_eq!(room.at(1.1, 0.05), Occupancy::Free);
}

#[test]
fn a_known_wall_explains_the_echo_of_a_slanted_beam() {
    // Square looks show the wall; a slanted look hears its near edge and must not draw an arc in front of it.
    let mut room = Room::new(vec![wall(-4.0, 1.1, 6.0, 1.1)], 15.0, 2.0);
    for step in 0..20 {
        let at = Point::new(0.2 * f64::from(step), 0.05);
        for beam in [90.0, 75.0, 60.0, 45.0] {
            room.look(at, degrees(beam), &[]);
        }
    }
    for step in 0..20 {
        let x_m = 0.1 + 0.2 * f64::from(step);
        let is_wall = |x_m: f64| room.at(x_m, 1.1) == Occupancy::Occupied;
        let is_found = [-0.2, 0.0, 0.2]
            .iter()
            .any(|aside_m| is_wall(x_m + aside_m));
        assert!(is_found, "wall at {x_m}");
        assert_ne!(room.at(x_m, 1.1), Occupancy::Free, "wall at {x_m}");
        assert_ne!(
            room.at(x_m, 0.5),
            Occupancy::Occupied,
            "before the wall at {x_m}"
        );
    }
}

#[test]
fn a_body_of_impossible_size_hides_no_wall() {
    let mut map = Merged::new(Lattice::new(CELL_M), Some(OWN));
    let at = Point::new(0.05, 0.05);
    for body in [
        OwnDisc {
            at,
            radius_m: f64::INFINITY,
        },
        OwnDisc {
            at: Point::new(1e5, 0.0),
            radius_m: 0.3,
        },
    ] {
        Mapper::new(OWN, 0).record(
            &mut map,
            &reading(at, degrees(0.0), 0.2, 1.0, Some(2.0)),
            body,
            &[],
        );
    }
    assert_eq!(map.occupancy(0, Cell::new(10, 0)), Occupancy::Occupied);
    assert_eq!(map.occupancy(0, Cell::new(-2, 0)), Occupancy::Unknown);
}

#[test]
fn readings_that_are_no_numbers_change_nothing() {
    let mut map = Merged::new(Lattice::new(CELL_M), Some(OWN));
    let mut mapper = Mapper::new(OWN, 0);
    let here = Point::new(0.0, 0.0);
    let body = OwnDisc {
        at: here,
        radius_m: BODY_M,
    };
    let nan = Point::new(f64::NAN, 0.0);
    for (origin, range_m, sure_range_m) in [
        (nan, None, 1.0),
        (here, Some(f64::NAN), 1.0),
        (here, Some(-1.0), 1.0),
        (here, None, f64::INFINITY),
    ] {
        let scan = reading(origin, degrees(0.0), 0.2, sure_range_m, range_m);
        assert!(mapper.record(&mut map, &scan, body, &[]).is_empty());
    }
    for at in [Point::new(1e300, -1e300), Point::new(4e8, 0.0)] {
        let scan = reading(at, degrees(0.0), 3.0, 1.0, Some(2.0));
        assert!(
            mapper
                .record(
                    &mut map,
                    &scan,
                    OwnDisc {
                        at,
                        radius_m: 1e300
                    },
                    &[]
                )
                .is_empty()
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// A vehicle drives along a long wall and swings its beam; walls answer up to 60° from their normal, and the
    /// sure range is what that allows for the distance kept.
    #[test]
    fn a_wall_passed_at_a_grazing_angle_is_seen_and_never_becomes_free(
        aside_m in 0.5..1.6f64, slant in -180.0..180.0f64, half_width in 2.0..20.0f64, first in 0.0..1.0f64,
        swing in prop::sample::select(vec![7.0, 15.0, 22.5, 30.0]),
    ) {
        let sure_range_m = aside_m / INCIDENCE_DEGREES.to_radians().cos();
        let (along, left) = (Vector::polar(degrees(slant), 1.0), Vector::polar(degrees(slant + 90.0), 1.0));
        let start = Point::new(first, -first);
        let line = Segment::new(start + left * aside_m - along * 5.0, start + left * aside_m + along * 9.0);
        let end = Segment::new(start + along * 6.5 + left * aside_m, start + along * 6.5 - left * 3.0);
        let mut room = Room::new(vec![line, end], half_width, sure_range_m);
        let cells = room.wall_cells();
        for step in 0..400 {
            // Forward at 0.125 m/s with 10 looks a second, swinging to both sides.
            let at = start + along * (f64::from(step) * 0.0125);
            let steps = (180.0 / swing) as i32;
            let turn = f64::from((step % (2 * steps) - steps).abs()) * swing - 90.0;
            room.look(at, degrees(slant + turn), &[]);
            for cell in &cells {
                let centre = room.map.lattice().centre(*cell);
                prop_assert_ne!(room.map.occupancy(0, *cell), Occupancy::Free, "step {}, {:?}", step, centre);
            }
        }
        // The wall beside the driven way is known, within a cell.
        for step in 2..20 {
            let seen = start + along * (f64::from(step) * 0.25) + left * aside_m;
            let near = room.map.lattice().cells_within(Segment::new(seen, seen), 1.5 * CELL_M);
            let found = near.filter(|cell| room.map.occupancy(0, *cell) == Occupancy::Occupied).count();
            prop_assert!(found > 0, "nothing near {seen:?}");
        }
    }

    #[test]
    fn a_standing_vehicle_that_looks_around_keeps_its_walls(
        x_m in -0.5..0.5f64, y_m in -0.5..0.5f64, half_width in 8.0..20.0f64,
    ) {
        let corners = [(-1.3, -1.1), (1.5, -1.1), (1.5, 1.4), (-1.3, 1.4)].map(|(x, y)| Point::new(x, y));
        let walls = (0..4).map(|side| Segment::new(corners[side], corners[(side + 1) % 4])).collect();
        let mut room = Room::new(walls, half_width, 1.0);
        for look in 0..1500 {
            room.look(Point::new(x_m, y_m), degrees(f64::from(look) * 10.0), &[]);
        }
        for cell in room.wall_cells() {
            prop_assert_ne!(room.map.occupancy(0, cell), Occupancy::Free, "{:?}", cell);
        }
        // Where it could drive a little is free in nearly all directions.
        let free = (0..36).filter(|angle| {
            let direction = degrees(f64::from(*angle) * 10.0);
            let at = Point::new(x_m, y_m);
            let near_m = room.ray(at, direction).unwrap_or(0.6).min(1.3) - 0.7;
            let cell = room.map.lattice().cell_at(at + Vector::polar(direction, near_m.max(0.0)));
            room.map.occupancy(0, cell) == Occupancy::Free
        });
        let free = free.count();
        prop_assert!(free >= 32, "only {free} of 36 directions are free");
    }
}

#[test]
fn what_was_seen_empty_from_where_no_thin_post_is_heard_may_hold_one() {
    // All that lies ahead was seen empty from up to 1 m; then comes an echo from 0.75 m.
    let free_after = |heard_m: Option<f64>| {
        let mut room = Room::new(vec![], 15.0, 3.0);
        if let Some(heard_m) = heard_m {
            room.mapper.regard_posts(heard_m);
        }
        for y_m in [-0.1, 0.0, 0.1, 0.2, 0.3] {
            room.look(Point::new(0.1, y_m), degrees(0.0), &[]);
        }
        let on_arc = [-10.0, -5.0, 0.0, 5.0, 10.0]
            .map(|turn| Point::new(0.3, 0.1) + Vector::polar(degrees(turn), 0.75));
        let free = |room: &Room| {
            let is_free = |at: &&Point| room.at(at.x_m, at.y_m) == Occupancy::Free;
            on_arc.iter().filter(is_free).count()
        };
        assert_eq!(free(&room), on_arc.len());
        let scan = reading(
            Point::new(0.3, 0.1),
            degrees(0.0),
            15f64.to_radians(),
            3.0,
            Some(0.75),
        );
        let body = OwnDisc {
            at: scan.origin,
            radius_m: BODY_M,
        };
        room.mapper.record(&mut room.map, &scan, body, &[]);
        free(&room)
    };
    // Only the cell that the echo is assigned to is free no more; a post that is heard from 0.8 m may stand in any of them.
    assert!(free_after(None) >= 2 && free_after(Some(3.0)) >= 2);
    assert_eq!(free_after(Some(0.8)), 0);
}

/// Takes a reading from a place, of an echo or of none.
fn hear(room: &mut Room, at: Point, turn: f64, range_m: Option<f64>) {
    room.hear(at, degrees(turn), range_m, &[]);
}

fn occupied(room: &Room) -> Vec<Cell> {
    let area = CellRect::new(Cell::new(-20, -20), Cell::new(25, 20));
    let all = area.cells();
    all.filter(|cell| room.map.occupancy(0, *cell) == Occupancy::Occupied)
        .collect()
}

/// Looks from several places well before x = 2 m, where nothing is.
fn look_through(room: &mut Room) {
    for y_m in [-0.6, -0.3, 0.05, 0.3, 0.6] {
        for turn in [-25.0, -10.0, 0.0, 10.0, 25.0] {
            hear(room, Point::new(0.8, y_m), turn, None);
            hear(room, Point::new(0.9, y_m), turn, None);
        }
    }
}

#[test]
fn an_echo_whose_whole_arc_is_seen_empty_from_nearer_leaves_nothing() {
    // A glitch, or a heading that was not what it was taken for.
    let mut room = Room::new(vec![], 15.0, 2.5);
    hear(&mut room, Point::new(0.05, 0.05), 0.0, Some(2.0));
    assert!(!occupied(&room).is_empty());
    look_through(&mut room);
    assert_eq!(occupied(&room), vec![]);
    // One that comes where all was seen empty before counts until it was seen empty again.
    hear(&mut room, Point::new(0.05, 0.05), 0.0, Some(2.0));
    let there = |room: &Room| occupied(room).iter().filter(|cell| cell.y > -8).count();
    assert!(there(&room) >= 1);
    for _ in 0..10 {
        hear(&mut room, Point::new(-0.5, -3.0), 0.0, Some(1.5));
    }
    assert!(there(&room) >= 1, "other echoes do not refute it");
    look_through(&mut room);
    assert_eq!(there(&room), 0);
    assert!(!occupied(&room).is_empty(), "the other one stays");
}

#[test]
fn an_echo_from_near_is_not_refuted_from_farther() {
    // A post that is heard from no more than 0.9 m.
    let mut room = Room::new(vec![], 15.0, 2.5);
    room.mapper.regard_posts(0.9);
    hear(&mut room, Point::new(1.1, 0.05), 0.0, Some(0.9));
    assert_eq!(occupied(&room).len(), 1);
    look_through(&mut room);
    assert_eq!(occupied(&room).len(), 1);
}
