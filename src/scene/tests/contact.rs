//! First contact and clearance, against a fine march along the way.

use super::*;
use crate::geom::{Polygon, Segment};
use crate::scene::Shape;

fn way(x0: f64, y0: f64, x1: f64, y1: f64) -> Segment {
    Segment::new(Point::new(x0, y0), Point::new(x1, y1))
}

fn check(scene: &Scene, along: Segment, expected: Option<f64>) {
    let got = scene.first_contact(along, 0.5, 0.05, 0.4);
    match (got, expected) {
        (Some(got), Some(expected)) => {
            assert!((got - expected).abs() < 1e-9, "{along:?} gave {got}")
        }
        (got, expected) => assert_eq!(got, expected, "{along:?}"),
    }
}

#[test]
fn a_vehicle_stops_at_the_wall() {
    let scene = scene_of(courtyard(), 20.0, &[]);
    check(&scene, way(2.0, 8.0, 12.0, 8.0), Some(0.35));
    check(
        &scene,
        way(10.0, 10.0, 10.0, 4.0),
        Some((10.0 - 5.3 - 0.5) / 6.0),
    );
    check(&scene, way(2.0, 14.0, 12.0, 14.0), None);
    check(&scene, way(5.0, 2.0, 5.0, 18.0), None);
    check(&scene, way(6.0, 15.0, 6.15, 13.0), Some(0.75));
}

#[test]
fn slow_null_and_touching_motion_is_not_missed() {
    let scene = scene_of(courtyard(), 20.0, &[]);
    check(&scene, way(5.4999999, 8.0, 5.4999999, 8.0), None);
    check(&scene, way(5.5000001, 8.0, 5.5000001, 8.0), Some(0.0));
    check(&scene, way(5.6, 8.0, 2.0, 8.0), Some(0.0));
    check(&scene, way(6.1, 8.0, 6.1, 8.0), Some(0.0));
    let slow = scene
        .first_contact(way(5.5 - 1e-9, 8.0, 5.5 + 1e-9, 8.0), 0.5, 0.05, 0.4)
        .unwrap();
    assert!((slow - 0.5).abs() < 1e-3);
}

#[test]
fn what_is_above_or_below_does_not_count() {
    let body = "Transform { translation 0 0 -1 children Shape { geometry Box { size 50 50 2 } } }
        Transform { translation 5 0 3 children Shape { geometry Box { size 2 2 2 } } }";
    let scene = scene_of(body, 20.0, &[]);
    assert_eq!(
        scene.first_contact(way(0.0, 0.0, 10.0, 0.0), 0.5, 0.0, 2.0),
        None
    );
    assert_eq!(
        scene.clearance_m(Point::new(0.0, 0.0), 0.0, 2.0),
        f64::INFINITY
    );
    assert_eq!(
        scene.first_contact(way(0.0, 0.0, 10.0, 0.0), 0.5, 0.0, 2.01),
        Some(0.35)
    );
    assert_eq!(
        scene.first_contact(way(0.0, 0.0, 10.0, 0.0), 0.5, -0.01, 2.0),
        Some(0.0)
    );
}

#[test]
fn a_mesh_stops_like_the_prism_of_its_form() {
    // The same box, once turned about x by a negligible angle, so that it is no upright prism.
    let prism = scene_of(
        "Transform { translation 5 5 1 children Shape { geometry Box { size 2 3 2 } } }",
        1.0,
        &[],
    );
    let mesh = scene_of(
        "Transform { translation 5 5 1 rotation 1 0 0 1e-7 children Shape { geometry Box { size 2 3 2 } } }",
        1.0,
        &[],
    );
    assert!(matches!(prism.objects()[0].shape, Shape::Prism { .. }));
    assert!(matches!(mesh.objects()[0].shape, Shape::Mesh(_)) && mesh.objects()[0].closed);
    let mut numbers = Sequence(8);
    for _ in 0..300 {
        let mut place = || Point::new(numbers.within(2.0, 8.0), numbers.within(2.0, 8.0));
        let along = Segment::new(place(), place());
        let (a, b) = (
            prism.first_contact(along, 0.3, 0.5, 0.9),
            mesh.first_contact(along, 0.3, 0.5, 0.9),
        );
        match (a, b) {
            (Some(a), Some(b)) => assert!((a - b).abs() < 1e-3, "{along:?}: {a} and {b}"),
            (a, b) => assert_eq!(a, b, "{along:?}"),
        }
        let (a, b) = (
            prism.clearance_m(along.from, 0.5, 0.9),
            mesh.clearance_m(along.from, 0.5, 0.9),
        );
        assert!((a - b).abs() < 1e-5, "{a} and {b}");
    }
}

#[test]
fn contact_agrees_with_a_fine_march() {
    let persons = [person(10.0, 9.0), person(15.0, 15.0)];
    let scene = scene_of(courtyard(), 20.0, &persons);
    let outlines: Vec<Polygon> = scene
        .outlines(0.3)
        .into_iter()
        .map(|outline| outline.polygon)
        .collect();
    let gap_m = |at: Point| {
        let gap = |outline: &Polygon| {
            if outline.contains(at) {
                0.0
            } else {
                outline.distance_to_edge(at)
            }
        };
        outlines.iter().map(gap).fold(f64::INFINITY, f64::min)
    };
    let mut numbers = Sequence(1);
    for _ in 0..200 {
        let mut place = || Point::new(numbers.within(0.0, 20.0), numbers.within(0.0, 20.0));
        let along = Segment::new(place(), place());
        assert!((scene.clearance_m(along.from, 0.1, 0.4) - gap_m(along.from)).abs() < 1e-9);
        let steps = 2000;
        let share = |step: i32| f64::from(step) / f64::from(steps);
        let marched =
            (0..=steps).find(|step| gap_m(along.from.toward(along.to, share(*step))) <= 0.4);
        match (scene.first_contact(along, 0.4, 0.1, 0.4), marched) {
            (Some(got), Some(step)) => {
                assert!(
                    got <= share(step) && got >= share(step - 1) - 1e-12,
                    "{got} {step}"
                );
            }
            // The march may step over a graze; then the contact is a graze indeed.
            (Some(got), None) => {
                assert!((gap_m(along.from.toward(along.to, got)) - 0.4).abs() < 1e-9)
            }
            (None, marched) => assert_eq!(marched, None),
        }
    }
}
