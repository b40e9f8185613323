//! Gaps, homes and fences with figures done by hand.

use std::collections::BTreeMap;

use super::*;
use crate::geom::Rect;
use crate::scene::{Footprint, Material, Post, SceneParts};

fn post(footprint: Footprint) -> Post {
    Post {
        name: "post".to_owned(),
        footprint,
        low_m: 0.0,
        high_m: 2.0,
        material: Material::default(),
    }
}

fn block(x0_m: f64, y0_m: f64, x1_m: f64, y1_m: f64) -> Post {
    let rect = Rect::new(Point::new(x0_m, y0_m), Point::new(x1_m, y1_m));
    post(Footprint::Corners(rect.polygon()))
}

fn pole(x_m: f64, y_m: f64, radius_m: f64) -> Post {
    let centre = Point::new(x_m, y_m);
    post(Footprint::Round { centre, radius_m })
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

/// A yard of 8 m by 4 m.
fn yard() -> Polygon {
    Rect::new(Point::new(0.0, 0.0), Point::new(8.0, 4.0)).polygon()
}

fn keeping(keep_m: f64) -> Room {
    Room {
        keep_m,
        body_m: 0.25,
        low_m: 0.02,
        high_m: 0.3,
    }
}

/// A wall across the yard, its left side at 4 m, with a gap from one height to another.
fn wall(thick_m: f64, from_m: f64, to_m: f64) -> Vec<Post> {
    let right_m = 4.0 + thick_m;
    vec![
        block(4.0, -1.0, right_m, from_m),
        block(4.0, to_m, right_m, 5.0),
    ]
}

/// Returns whether a vehicle at (1, 2) that keeps so much room can get to a place.
fn gets_to(posts: &[Post], keep_m: f64, place: (f64, f64)) -> bool {
    let (scene, place) = (scene(posts), Point::new(place.0, place.1));
    Reachable::find(&scene, &yard(), &[Point::new(1.0, 2.0)], &keeping(keep_m))
        .is_reachable(&scene, 0, place)
}

const BEYOND: (f64, f64) = (7.0, 2.0);

#[test]
fn a_gap_lets_through_who_has_a_step_of_room_more_than_it_needs_wherever_it_lies() {
    for offset in 0..40 {
        let low_m = 1.3 + 0.0131 * f64::from(offset);
        for thick_m in [0.001, 0.1, 1.0] {
            let gap = |width_m: f64| wall(thick_m, low_m, low_m + width_m);
            assert!(gets_to(&gap(0.8 + 0.051), 0.4, BEYOND), "{low_m} {thick_m}");
            assert!(!gets_to(&gap(0.8), 0.4, BEYOND), "{low_m} {thick_m}");
            assert!(!gets_to(&gap(0.7), 0.4, BEYOND), "{low_m} {thick_m}");
        }
    }
}

#[test]
fn between_two_poles_nobody_is_taken_through_a_gap_that_is_a_centimetre_too_narrow() {
    for offset in 0..40 {
        let low_m = 1.3 + 0.0131 * f64::from(offset);
        let across = |apart_m: f64| {
            let mut posts = wall(0.02, low_m, low_m + apart_m);
            posts.push(pole(4.01, low_m, 0.03));
            posts.push(pole(4.01, low_m + apart_m, 0.03));
            posts
        };
        assert!(!gets_to(&across(0.06 + 0.8 - 0.01), 0.4, BEYOND), "{low_m}");
        assert!(gets_to(&across(0.06 + 0.8 + 0.06), 0.4, BEYOND), "{low_m}");
    }
}

#[test]
fn a_place_must_have_room_itself() {
    let posts = [block(5.0, 1.0, 6.0, 3.0)];
    assert!(gets_to(&posts, 0.4, (4.55, 2.0)) && !gets_to(&posts, 0.4, (4.65, 2.0)));
    assert!(gets_to(&posts, 0.4, (4.59, 2.0)) && !gets_to(&posts, 0.4, (4.61, 2.0)));
    assert!(!gets_to(&posts, 0.4, (5.5, 2.0)), "inside");
    assert!(gets_to(&[], 0.4, (7.55, 2.0)) && !gets_to(&[], 0.4, (7.65, 2.0)));
    assert!(!gets_to(&[], 0.4, (9.0, 2.0)), "beyond the fence");
    let absurd = [(f64::NAN, 2.0), (1e300, 2.0), (f64::INFINITY, 0.0)];
    assert!(absurd.iter().all(|place| !gets_to(&[], 0.4, *place)));
}

#[test]
fn each_vehicle_gets_about_on_its_own_side_of_a_wall_and_always_home() {
    let homes = [
        Point::new(1.0, 2.0),
        Point::new(7.0, 2.0),
        Point::new(2.0, 1.0),
        Point::new(4.1, 1.0),
    ];
    let scene = scene(&wall(0.2, 2.0, 2.0));
    let found = Reachable::find(&scene, &yard(), &homes, &keeping(0.4));
    let gets = |home: usize, x_m: f64| found.is_reachable(&scene, home, Point::new(x_m, 1.5));
    assert_eq!([gets(0, 2.5), gets(0, 6.5)], [true, false]);
    assert_eq!([gets(1, 2.5), gets(1, 6.5)], [false, true]);
    assert_eq!([gets(2, 2.5), gets(2, 6.5)], [true, false]);
    // Inside the wall it stays where it is, as one that is not there does not begin at all.
    assert_eq!([gets(3, 2.5), gets(4, 2.5)], [false, false]);
    assert!((0..4).all(|home| found.is_reachable(&scene, home, homes[home])));
    assert_eq!(found.regions.len(), 2);
}

#[test]
fn a_home_with_too_little_room_is_left_straight_where_the_body_fits() {
    let home = [Point::new(1.0, 0.3)];
    let leaves = |posts: &[Post]| {
        let scene = scene(posts);
        let found = Reachable::find(&scene, &yard(), &home, &keeping(0.5));
        found.is_reachable(&scene, 0, Point::new(7.0, 2.0))
    };
    // The fence is 0.3 m away, and the vehicle keeps 0.5 m from it.
    assert!(leaves(&[]));
    let pocket = |wide_m: f64| {
        let (left_m, right_m) = (1.0 - wide_m / 2.0, 1.0 + wide_m / 2.0);
        [
            block(left_m - 0.1, 0.0, left_m, 0.7),
            block(right_m, 0.0, right_m + 0.1, 0.7),
        ]
    };
    assert!(leaves(&pocket(0.6)), "0.05 m more than the body");
    assert!(!leaves(&pocket(0.48)), "less than the body");
    // Straight ahead it is too deep to be left.
    let deep = [block(0.6, 0.0, 0.7, 1.4), block(1.3, 0.0, 1.4, 1.4)];
    assert!(!leaves(&deep));
}

#[test]
fn places_come_so_many_steps_apart_and_the_homes_with_them() {
    let home = [Point::new(1.01, 2.0)];
    let found = Reachable::find(&scene(&[]), &yard(), &home, &keeping(0.99));
    let count = |steps: i32| found.places(steps).count();
    // 1.0 to 7.0 m by 1.0 to 3.0 m.
    assert_eq!([count(1), count(2)], [121 * 41 + 1, 61 * 21 + 1]);
    let is_between =
        |at: &Point| (0.99..=7.01).contains(&at.x_m) && (0.99..=3.01).contains(&at.y_m);
    assert!(found.places(1).all(|at| is_between(&at)));
}

#[test]
fn what_stands_above_or_below_the_body_is_not_in_the_way() {
    let standing = |low_m: f64, high_m: f64| {
        let shelf = Post {
            low_m,
            high_m,
            ..block(3.0, -1.0, 5.0, 5.0)
        };
        gets_to(&[shelf], 0.4, BEYOND)
    };
    assert!(standing(0.5, 2.0) && standing(0.0, 0.01));
    assert!(!standing(0.2, 2.0) && !standing(0.0, 0.1));
}
