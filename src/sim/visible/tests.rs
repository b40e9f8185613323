//! Counts done by hand, in rooms whose walls are one cell thick.

use std::collections::BTreeMap;
use std::sync::Arc;

use tomoswarm_proto::{Boot, LayerId, TILE_CELLS, TileAddress, TileReport, VehicleId};

use super::*;
use crate::scene::{Footprint, Material, Post, SceneParts};
use crate::sim::reachable::Room;

const CELL_M: f64 = 0.2;

fn block(x0_m: f64, y0_m: f64, x1_m: f64, y1_m: f64) -> Post {
    Post {
        name: "block".to_owned(),
        footprint: Footprint::Corners(
            Rect::new(Point::new(x0_m, y0_m), Point::new(x1_m, y1_m)).polygon(),
        ),
        low_m: 0.0,
        high_m: 2.0,
        material: Material::default(),
    }
}

/// A room of 6 m by 6 m inside.
fn room() -> Vec<Post> {
    vec![
        block(-0.2, -0.2, 0.0, 6.2),
        block(6.0, -0.2, 6.2, 6.2),
        block(0.0, -0.2, 6.0, 0.0),
        block(0.0, 6.0, 6.0, 6.2),
    ]
}

fn scene(posts: &[Post]) -> Scene {
    let materials = BTreeMap::new();
    Scene::build(&SceneParts {
        shapes: &[],
        offset_m: [0.0; 3],
        materials: &materials,
        default_material: Material::default(),
        posts,
        persons: &[],
    })
    .unwrap()
}

fn fence(x0_m: f64, y0_m: f64, x1_m: f64, y1_m: f64) -> Polygon {
    Rect::new(Point::new(x0_m, y0_m), Point::new(x1_m, y1_m)).polygon()
}

fn keeping(keep_m: f64) -> Room {
    Room {
        keep_m,
        body_m: keep_m / 2.0,
        low_m: 0.02,
        high_m: 0.3,
    }
}

/// A sensor whose cone is a ray.
fn ray(max_m: f64) -> SensorView {
    let incidence_max_rad = 60f64.to_radians();
    SensorView {
        height_m: 0.3,
        half_angle_rad: 0.0,
        min_m: 0.02,
        max_m,
        incidence_max_rad,
        posts: None,
    }
}

fn pole(centre: Point, radius_m: f64) -> Post {
    Post {
        footprint: Footprint::Round { centre, radius_m },
        ..block(0.0, 0.0, 1.0, 1.0)
    }
}

fn find(posts: &[Post], keep_m: f64, sight: SensorView) -> Visible {
    let home = [Point::new(1.0, 1.0)];
    let around = fence(-20.0, -20.0, 20.0, 20.0);
    let scene = scene(posts);
    let region = Reachable::find(&scene, &around, &home, &keeping(keep_m));
    Visible::find(&scene, Lattice::new(CELL_M), &region, &sight)
}

fn count(places: &PlaceIndex) -> usize {
    places.buckets.values().map(Vec::len).sum()
}

#[test]
fn in_a_room_with_a_box_all_inner_sides_are_seen_and_the_outer_corners_are_not() {
    let mut posts = room();
    posts.push(block(2.0, 2.0, 3.0, 3.0));
    let seen = find(&posts, 0.35, ray(10.0));
    // Walls: 4 × 30 cells and 4 corners. Box: a ring of 5 × 5 cells without the 3 × 3 inside.
    assert_eq!(seen.surface.cells().count(), 124 + 16);
    assert_eq!(seen.cells.len(), 120 + 16);
    for corner in [
        Cell::new(-1, -1),
        Cell::new(30, -1),
        Cell::new(-1, 30),
        Cell::new(30, 30),
    ] {
        assert!(seen.surface.cells().any(|cell| cell == corner) && !seen.cells.contains(&corner));
    }
}

#[test]
fn what_is_seen_ends_with_the_range() {
    let mut posts = room();
    posts.push(block(2.0, 2.0, 3.0, 3.0));
    // Places are 1.0 to 5.0 m from each wall, so a wall is seen from 1.0 m only, 0.14 m to either side: points from
    // 0.86 to 5.14 m, of the cells 4 to 25.
    let seen = find(&posts, 0.95, ray(1.01));
    assert_eq!(seen.cells.len(), 4 * 22 + 16);
    let west: Vec<i32> = seen
        .cells
        .iter()
        .filter(|cell| cell.x == -1)
        .map(|cell| cell.y)
        .collect();
    assert_eq!(west, (4..=25).collect::<Vec<_>>());
    assert_eq!(find(&posts, 0.95, ray(0.9)).cells.len(), 0);
}

#[test]
fn places_are_counted_as_far_as_the_body_fits() {
    // 1.0, 1.1, … 5.0 m in both directions, and the home itself.
    let found = |posts: &[Post], around: &Polygon| {
        let home = [Point::new(1.0, 1.0)];
        let region = Reachable::find(&scene(posts), around, &home, &keeping(0.95));
        count(&PlaceIndex::within(&region))
    };
    assert_eq!(
        found(&room(), &fence(-20.0, -20.0, 20.0, 20.0)),
        41 * 41 + 1
    );
    assert_eq!(found(&[], &fence(0.0, 0.0, 4.0, 3.0)), 21 * 11 + 1);
}

#[test]
fn a_gap_is_passed_by_whom_it_lets_through() {
    // A wall across the room with a gap of 1.0 m.
    let mut posts = room();
    posts.extend([block(0.0, 3.0, 2.5, 3.2), block(3.5, 3.0, 6.0, 3.2)]);
    let (narrow, wide) = (find(&posts, 0.45, ray(1.0)), find(&posts, 0.55, ray(1.0)));
    let beyond = |seen: &Visible| seen.cells.iter().any(|cell| cell.y == 30);
    assert!(beyond(&narrow) && !beyond(&wide));
    assert!(
        !beyond(&find(&posts, 0.5, ray(1.0))),
        "rounding opens no gap"
    );
}

#[test]
fn nothing_is_seen_through_a_wall_or_at_a_grazing_angle() {
    let posts = [block(3.0, -5.0, 3.2, 10.0), block(4.0, 0.0, 5.0, 1.0)];
    let places = PlaceIndex::along([&[Point::new(1.0, 0.5)][..]].into_iter());
    let (scene, sight) = (scene(&posts), ray(20.0));
    let surface = VisibleSurface::of(&scene, 0.3, Lattice::new(CELL_M));
    let seen = surface.seen_from(&scene, &sight, &places, &surface.cells().collect());
    assert!(seen.iter().all(|cell| cell.x == 15), "{seen:?}");
    // 60° off the normal from 2 m: 3.46 m to either side of 0.5 m, points from −2.96 to 3.96 m.
    let rows: Vec<i32> = seen.iter().map(|cell| cell.y).collect();
    assert_eq!(rows, (-15..=19).collect::<Vec<_>>());
}

#[test]
fn a_surface_behind_something_nearer_in_every_cone_is_not_heard() {
    let heard = |beside: &[f64], wall_m: f64, posts: Option<PostDetection>| {
        let post = |degrees: &f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            pole(Point::new(cos, sin), 0.05)
        };
        // A wall 3 m ahead; the point is straight ahead.
        let mut things = vec![block(3.0, -wall_m / 2.0, 3.2, wall_m / 2.0)];
        things.extend(beside.iter().map(post));
        let (scene, wide) = (
            scene(&things),
            SensorView {
                half_angle_rad: 15f64.to_radians(),
                posts,
                ..ray(4.0)
            },
        );
        let surface = VisibleSurface::of(&scene, 0.3, Lattice::new(CELL_M));
        let places = PlaceIndex::along([&[Point::default()][..]].into_iter());
        let seen = surface.seen_from(&scene, &wide, &places, &surface.cells().collect());
        seen.contains(&Cell::new(15, 0))
    };
    let hears = |beside: &[f64]| heard(beside, 0.2, None);
    assert!(hears(&[]) && hears(&[10.0]) && hears(&[-10.0]) && hears(&[25.0, -25.0]));
    assert!(
        !hears(&[10.0, -10.0]),
        "every cone of 30° holds one of them"
    );
    // What is too thin to be heard drowns nothing: a wall of 8 m is heard, and these posts are not.
    let law = Some(PostDetection::measured(4.0, 3.1, 4.0));
    assert!(heard(&[10.0, -10.0], 8.0, law) && !heard(&[10.0, -10.0], 8.0, None));
    assert!(!heard(&[], 0.2, law));
}

#[test]
fn a_thin_post_is_seen_only_from_as_near_as_it_is_heard() {
    let scene = scene(&[pole(Point::new(2.0, 0.0), 0.01)]);
    let surface = VisibleSurface::of(&scene, 0.3, Lattice::new(CELL_M));
    let all = surface.cells().collect();
    let heard = |x_m: f64, posts: Option<PostDetection>| {
        let places = PlaceIndex::along([&[Point::new(x_m, 0.0)][..]].into_iter());
        let sight = SensorView { posts, ..ray(4.0) };
        !surface.seen_from(&scene, &sight, &places, &all).is_empty()
    };
    let law = Some(PostDetection::measured(0.01, 0.7, 4.0));
    assert!(heard(0.5, None), "a ray hears whatever it meets");
    assert!(heard(1.3, law) && !heard(1.2, law));
    // Whatever hangs together is as wide as all of it.
    let wall: Vec<Post> = (-10..=10)
        .map(|step| pole(Point::new(2.0, 0.025 * f64::from(step)), 0.01))
        .collect();
    let scene = self::scene(&wall);
    let surface = VisibleSurface::of(&scene, 0.3, Lattice::new(CELL_M));
    let places = PlaceIndex::along([&[Point::new(0.5, 0.0)][..]].into_iter());
    let sight = SensorView {
        posts: law,
        ..ray(4.0)
    };
    assert!(
        !surface
            .seen_from(&scene, &sight, &places, &surface.cells().collect())
            .is_empty()
    );
}

#[test]
fn solids_that_touch_have_no_surface_between_them() {
    let surface = VisibleSurface::of(
        &scene(&[block(0.0, 0.0, 1.0, 1.0), block(1.0, 0.0, 2.0, 1.0)]),
        0.3,
        Lattice::new(CELL_M),
    );
    // The ring of 10 × 5 cells.
    assert_eq!(surface.cells().count(), 10 * 5 - 8 * 3);
    assert!(
        VisibleSurface::of(
            &scene(&[block(0.0, 0.0, 1.0, 1.0)]),
            2.5,
            Lattice::new(CELL_M)
        )
        .cells()
        .next()
        .is_none()
    );
}

fn map(occupied: &[usize]) -> Merged {
    let mut cells = [0; TILE_CELLS];
    occupied.iter().for_each(|index| cells[*index] = 9);
    let mut map = Merged::new(Lattice::new(CELL_M), None);
    let layer = LayerId {
        vehicle: VehicleId(1),
        boot: Boot(1),
    };
    let report = TileReport {
        layer,
        address: TileAddress::default(),
        revision: 1,
        cells: Arc::new(cells),
    };
    map.join(&report).unwrap();
    map
}

#[test]
fn a_cell_is_detected_within_one_cell() {
    // Cell (5, 3) is occupied, and (20, 20).
    let map = map(&[3 * 32 + 5, 20 * 32 + 20]);
    let wanted = |cells: &[(i32, i32)]| {
        let cells: BTreeSet<Cell> = cells.iter().map(|(x, y)| Cell::new(*x, *y)).collect();
        detected(&map, 0, &cells)
    };
    assert_eq!(
        wanted(&[(5, 3), (6, 4), (4, 2), (7, 3), (5, 5), (-1, -1)]),
        3
    );
    assert_eq!(occupied(&map, 0), 2);
    assert_eq!(
        (
            occupied(&map, 1),
            detected(&map, 1, &BTreeSet::from([Cell::new(5, 3)]))
        ),
        (0, 0)
    );
}

#[test]
fn clearance_is_the_least_along_all_tracks_from_the_bodys_side() {
    let scene = scene(&[block(2.0, 2.0, 3.0, 3.0)]);
    let track: Vec<Point> = (0..=100)
        .map(|step| Point::new(f64::from(step) * 0.05, 1.5))
        .collect();
    let far = [Point::new(2.5, 10.0)];
    let body = (0.25, 0.02, 0.3);
    let least_m = least_clearance_m(&scene, body, [&far[..], &track[..]].into_iter());
    assert!((least_m.unwrap() - 0.25).abs() < 1e-9);
    let inside = [Point::new(2.5, 2.5)];
    assert!(least_clearance_m(&scene, body, [&inside[..]].into_iter()).unwrap() < -0.2);
}

#[test]
fn a_track_leaves_no_gap() {
    let corners = [
        Point::new(0.0, 0.0),
        Point::new(2.0, 0.0),
        Point::new(2.0, 1.0),
    ];
    let places = PlaceIndex::along([&corners[..]].into_iter());
    assert_eq!(count(&places), 31);
    assert_eq!(count(&PlaceIndex::along([&[][..]].into_iter())), 0);
}
