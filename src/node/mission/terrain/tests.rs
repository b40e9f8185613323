//! What follows from what is known of the ground, on small maps that are known within 6.4 m around the datum.

use std::sync::Arc;

use tomoswarm_proto::{LayerId, TileAddress, TileReport};

use super::*;
use crate::geom::Track;
use crate::map::CONFIRMED_FROM;
use crate::node::tests_support::{own_state, settings};

fn at(time_s: f64) -> Time {
    Time::from_secs_f64(time_s)
}

fn pose(x_m: f64, y_m: f64) -> Pose {
    own_state(x_m, y_m).pose
}

/// Tiles of ground that is solid where the predicate says so, by the middle of a cell in metres, and free elsewhere.
pub(in crate::node::mission) fn tiles_of(is_solid: impl Fn(f64, f64) -> bool) -> Vec<TileReport> {
    tiles_valued(LayerId::default(), |x_m, y_m| {
        if is_solid(x_m, y_m) { 17 } else { -17 }
    })
}

/// Tiles in which a layer says so much of each cell, 0.1 log-odds, by its middle in metres.
pub(in crate::node::mission) fn tiles_valued(
    layer: LayerId,
    value: impl Fn(f64, f64) -> i8,
) -> Vec<TileReport> {
    let middle_m = |tile: i32, cell: usize| (f64::from(tile * 32) + cell as f64 + 0.5) * 0.2;
    let value =
        |x: i32, y: i32, index: usize| value(middle_m(x, index % 32), middle_m(y, index / 32));
    let addresses = (-1..1).flat_map(|x| (-1..1).map(move |y| (x, y)));
    addresses
        .map(|(x, y)| TileReport {
            layer,
            address: TileAddress { slice: 0, x, y },
            revision: 1,
            cells: Arc::new(std::array::from_fn(|index| value(x, y, index))),
        })
        .collect()
}

/// Says what is solid of two rooms west and east of a wall with a doorway of so many metres, at [1.2, 0].
pub(in crate::node::mission) fn two_rooms(doorway_m: f64) -> impl Fn(f64, f64) -> bool {
    move |x_m, y_m| {
        let is_wall = (1.0..1.4).contains(&x_m) && y_m.abs() > doorway_m / 2.0;
        is_wall || y_m.abs() > 4.0
    }
}

/// What is known of such ground.
pub(in crate::node::mission) fn terrain_of(is_solid: impl Fn(f64, f64) -> bool) -> Terrain {
    let mut terrain = Terrain::new(settings(1));
    tiles_of(is_solid)
        .iter()
        .for_each(|tile| terrain.learn(&tile.clone().into()));
    terrain
}

/// Something that made the reflex halt, until 9 s.
pub(in crate::node::mission) fn obstacle(x_m: f64, y_m: f64) -> ReflexObstacle {
    ReflexObstacle {
        at: Point::new(x_m, y_m),
        keep_m: 0.5,
        middle_keep_m: 0.35,
        until: at(9.0),
    }
}

/// How much of a way from the datum along x is released at a time, metres, and what blocks it.
fn released(terrain: &Terrain, now: Time) -> (f64, Option<Point>) {
    let mut way = Way::default();
    way.append([], Point::new(9.0, 0.0), None);
    let strip = Strip {
        way: &way,
        route: way.points(),
        corridor: Corridor {
            clearance: RequiredClearance::everywhere(0.3),
            ahead_m: 8.0,
        },
    };
    let release = terrain.release(now, pose(0.0, 0.0), &strip);
    (release.free_until_m, release.blocked)
}

#[test]
fn a_strip_is_released_up_to_what_is_unknown_what_stands_there_and_what_the_reflex_met() {
    let mut terrain = terrain_of(|_, _| false);
    let (unknown_m, blocked) = released(&terrain, at(1.0));
    assert!((6.0..6.4).contains(&unknown_m) && blocked.is_none());
    terrain.note_obstacle(at(1.0), obstacle(3.0, 0.0));
    let (held_m, blocked) = released(&terrain, at(1.0));
    assert!((held_m - 2.5).abs() < 1e-9, "{held_m} m");
    assert_eq!(blocked, Some(Point::new(3.0, 0.0)));
    assert_eq!(released(&terrain, at(9.0)), (unknown_m, None), "it is gone");
    let (wall_m, blocked) = released(&terrain_of(|x_m, _| (2.0..2.4).contains(&x_m)), at(1.0));
    assert!((1.5..2.0).contains(&wall_m) && blocked.is_some());
}

#[test]
fn who_does_not_see_is_released_and_finds_paths_over_its_own_track_alone() {
    let mut terrain = terrain_of(|_, _| false);
    (0..=20).for_each(|step| terrain.note_place(Point::new(0.1 * f64::from(step), 0.0)));
    let reaches = |terrain: &Terrain, x_m: f64, y_m: f64| {
        terrain.can_reach(at(1.0), pose(0.0, 0.0), Point::new(x_m, y_m))
    };
    for sees in [true, false, true] {
        terrain.note_sight(sees);
        let (until_m, blocked) = released(&terrain, at(1.0));
        let is_on_track = (2.0..2.5).contains(&until_m);
        assert!(is_on_track != sees && blocked.is_none(), "{until_m} m");
        assert!(reaches(&terrain, 1.95, 0.05));
        assert_eq!(reaches(&terrain, 1.0, 1.0), sees);
        assert_eq!(reaches(&terrain, 4.0, 0.0), sees);
    }
}

#[test]
fn what_is_noted_counts_in_the_next_search() {
    let mut terrain = terrain_of(|_, _| false);
    let goal = Point::new(4.0, 0.0);
    assert!(terrain.can_reach(at(1.0), pose(0.0, 0.0), goal));
    terrain.note_standing_peers(vec![vec![goal]]);
    assert!(!terrain.can_reach(at(1.0), pose(0.0, 0.0), goal), "a peer");
    terrain.note_standing_peers(Vec::new());
    terrain.note_obstacle(at(1.0), obstacle(4.0, 0.2));
    assert!(!terrain.can_reach(at(1.0), pose(0.0, 0.0), goal));
    assert!(
        terrain.can_reach(at(9.0), pose(0.0, 0.0), goal),
        "it is believed no more"
    );
}

#[test]
fn what_the_map_is_sure_of_on_the_arc_of_an_echo_leaves_the_rest_of_the_arc_open() {
    // The reflex met something at (3, 0.4), on an arc of 0.15 m to each side: as near as 0.35 m to it, or 0.5 m to all of it.
    let post = |x_m: f64, y_m: f64| (2.9..3.1).contains(&x_m) && (0.4..0.6).contains(&y_m);
    let elsewhere = |x_m: f64, y_m: f64| (2.9..3.1).contains(&x_m) && (1.0..1.2).contains(&y_m);
    let nothing = |_: f64, _: f64| false;
    let mut doubted = tiles_of(post);
    for tile in &mut doubted {
        let unsure = tile.cells.map(|value| value.min(CONFIRMED_FROM - 1));
        tile.cells = Arc::new(unsure);
    }
    for (name, tiles, is_held) in [
        ("sure", tiles_of(post), false),
        ("doubted", doubted, true),
        ("sure, farther away", tiles_of(elsewhere), true),
        ("unknown", tiles_of(nothing), true),
    ] {
        let mut terrain = Terrain::new(settings(1));
        tiles
            .into_iter()
            .for_each(|tile| terrain.learn(&tile.into()));
        let (free_m, blocked) = released(&terrain, at(1.0));
        assert!(free_m > 5.0 && blocked.is_none(), "{name}: {free_m} m");
        terrain.note_obstacle(at(1.0), obstacle(3.0, 0.4));
        let blocked = released(&terrain, at(1.0)).1;
        assert_eq!(blocked.is_some(), is_held, "{name}");
        let goal = Point::new(5.0, 0.0);
        let way = terrain
            .search(at(1.0), pose(0.0, 0.0))
            .path(goal, true, &[])
            .unwrap();
        let track = Track::new(way).unwrap();
        let away_m = track
            .segments()
            .map(|piece| piece.distance_to_point(Point::new(3.0, 0.4)));
        let nearest_m = away_m.fold(f64::INFINITY, f64::min);
        let least_m = if is_held { 0.47 } else { 0.32 };
        assert!(nearest_m >= least_m, "{name}: {nearest_m} m");
    }
}

#[test]
fn places_are_remembered_in_the_order_in_which_they_were_driven() {
    let mut terrain = Terrain::new(settings(1));
    let places = [0.0, 1.0, 2.0].map(|x_m| Point::new(x_m, 0.0));
    places.iter().for_each(|place| terrain.note_place(*place));
    assert_eq!(terrain.driven(), places);
    assert!(terrain.passed_lately().eq(places));
}
