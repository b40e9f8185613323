//! The scene of the shared data, against the shared facts and a plain loop over all triangles.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::attenuation::LIMIT_DB;
use super::*;
use crate::geom::Bearing;
use crate::scene::Attenuation;
use crate::scene::affine::{cross, dot, sub};

fn shared(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../shared")
        .join(path)
}

/// The castle, z up; `None`, said so, when the shared data is missing.
fn castle() -> Option<VrmlScene> {
    let Ok(text) = std::fs::read_to_string(shared("data/vrml/castle.wrl")) else {
        println!("skipped: ../shared/data/vrml/castle.wrl is not there");
        return None;
    };
    Some(read_vrml(&text, "castle.wrl", Up::Z, &mut |_| Err("none".into())).unwrap())
}

fn facts(area: &str) -> Vec<Value> {
    let Ok(text) = std::fs::read_to_string(shared("facts.json")) else {
        println!("skipped: ../shared/facts.json is not there");
        return Vec::new();
    };
    let facts: Vec<Value> = serde_json::from_str(&text).unwrap();
    facts
        .into_iter()
        .filter(|fact| fact["area"] == area)
        .collect()
}

fn built(read: &VrmlScene) -> Scene {
    let materials = BTreeMap::new();
    let default_material = Material {
        db_per_m: 20.0,
        db_per_crossing: 6.0,
    };
    let parts = SceneParts {
        shapes: &read.shapes,
        offset_m: [0.0; 3],
        materials: &materials,
        default_material,
        posts: &[],
        persons: &[],
    };
    Scene::build(&parts).unwrap()
}

#[test]
fn counts_agree_with_the_facts() {
    let Some(read) = castle() else { return };
    for fact in facts("vrml") {
        let expected = &fact["expected"];
        let faces: Vec<usize> = read.shapes.iter().map(|shape| shape.faces).collect();
        if let Some(list) = expected["faces"].as_array() {
            assert_eq!(
                faces,
                list.iter()
                    .map(|n| n.as_u64().unwrap() as usize)
                    .collect::<Vec<_>>()
            );
            continue;
        }
        assert_eq!(
            read.shapes.len() as u64,
            expected["objects"].as_u64().unwrap()
        );
        assert_eq!(
            faces.iter().sum::<usize>() as u64,
            expected["faces"].as_u64().unwrap()
        );
        let triangles: usize = read.shapes.iter().map(|shape| shape.triangles).sum();
        assert_eq!(triangles as u64, expected["triangles"].as_u64().unwrap());
    }
    assert_eq!(&*read.shapes[0].names[0], "OB_Ground_001");
}

#[test]
fn ray_casts_agree_with_the_facts() {
    let Some(read) = castle() else { return };
    let scene = built(&read);
    for fact in facts("vrml-ray") {
        let inputs = &fact["inputs"];
        let origin: Vec<f64> = inputs["xyz"]
            .as_array()
            .unwrap()
            .iter()
            .map(|n| n.as_f64().unwrap())
            .collect();
        let angle = Bearing::from_degrees(inputs["bearing_deg"].as_f64().unwrap())
            .angle()
            .radians();
        let hit = scene.cast(
            [origin[0], origin[1], origin[2]],
            [angle.cos(), angle.sin(), 0.0],
            1000.0,
        );
        let got = hit.map(|hit| hit.distance_m);
        match (fact["expected"]["distance"].as_f64(), got) {
            (Some(expected), Some(got)) => {
                assert!((got - expected).abs() < 1e-4, "{}: {got}", fact["id"])
            }
            (expected, got) => assert_eq!(got, expected, "{}", fact["id"]),
        }
    }
}

/// Möller–Trumbore over every triangle.
fn plain_cast(scene: &Scene, origin: [f64; 3], direction: [f64; 3]) -> Option<f64> {
    let surfaces: Vec<_> = scene
        .objects()
        .iter()
        .map(|object| object.shape.surface())
        .collect();
    let corners = surfaces.iter().flat_map(|surface| surface.corners());
    let met = corners.filter_map(|[a, b, c]| {
        let (ab, ac) = (sub(b, a), sub(c, a));
        let p = cross(direction, ac);
        let determinant = dot(ab, p);
        let from = sub(origin, a);
        let q = cross(from, ab);
        let (u, v, t) = (
            dot(from, p) / determinant,
            dot(direction, q) / determinant,
            dot(ac, q) / determinant,
        );
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0).then_some(t)
    });
    met.min_by(f64::total_cmp)
}

#[test]
fn ray_casts_agree_with_a_plain_loop() {
    let mut scenes = vec![scene_of(
        courtyard(),
        20.0,
        &[person(9.0, 9.0), person(15.0, 3.0)],
    )];
    scenes.extend(castle().map(|read| built(&read)));
    let mut numbers = Sequence(4);
    for scene in &scenes {
        let mut hits = 0;
        for round in 0..400 {
            let origin = [
                numbers.within(-20.0, 20.0),
                numbers.within(-20.0, 20.0),
                numbers.within(0.2, 1.5),
            ];
            let angle = numbers.within(0.0, std::f64::consts::TAU);
            let direction = match round % 8 {
                0 => [1.0, 0.0, 0.0],
                1 => [0.0, -1.0, 0.0],
                2 => [0.0, 0.0, -1.0],
                3 => [libm::cos(angle) * 0.8, libm::sin(angle) * 0.8, 0.6],
                _ => [libm::cos(angle), libm::sin(angle), 0.0],
            };
            let (got, expected) = (
                scene.cast(origin, direction, 500.0),
                plain_cast(scene, origin, direction),
            );
            assert_eq!(got.is_some(), expected.is_some(), "{origin:?} {angle}");
            if let (Some(hit), Some(expected)) = (got, expected) {
                hits += 1;
                assert!((hit.distance_m - expected).abs() < 1e-9);
                assert!(
                    dot(hit.normal, direction) <= 0.0,
                    "the normal faces the ray"
                );
                assert!((dot(hit.normal, hit.normal) - 1.0).abs() < 1e-12);
            }
        }
        assert!(hits > 20);
    }
}

#[test]
fn a_hit_names_its_object_and_ends_at_the_range() {
    let scene = scene_of(courtyard(), 20.0, &[person(10.0, 10.0)]);
    let hit = scene
        .cast([10.0, 1.0, 1.0], [0.0, 1.0, 0.0], 100.0)
        .unwrap();
    assert!((hit.distance_m - 4.0).abs() < 1e-9);
    assert_eq!(hit.normal, [0.0, -1.0, 0.0]);
    assert_eq!(scene.objects()[hit.object].name, "Wall");
    assert!(scene.cast([10.0, 1.0, 1.0], [0.0, 1.0, 0.0], 3.9).is_none());
    assert!(
        scene
            .cast([10.0, 1.0, 2.1], [0.0, 1.0, 0.0], 100.0)
            .is_none(),
        "it passes above everything"
    );
    let hit = scene
        .cast([10.0, 6.0, 1.0], [0.0, 1.0, 0.0], 100.0)
        .unwrap();
    assert_eq!(scene.objects()[hit.object].name, "someone");
    assert!((hit.distance_m - 3.7).abs() < 0.01);
    let empty = scene_of("", 20.0, &[]);
    assert!(empty.cast([0.0; 3], [1.0, 0.0, 0.0], 100.0).is_none());
}

#[test]
fn the_castle_weakens_radio_but_never_by_nonsense() {
    let Some(read) = castle() else { return };
    assert!(read.warnings.len() <= 1, "{:?}", read.warnings);
    let scene = built(&read);
    assert!(!scene.outlines(4.0).is_empty());
    let attenuation = Attenuation::new(&scene, 4.0, 0.125, LIMIT_DB);
    let (mut numbers, mut most_db) = (Sequence(9), 0.0f64);
    for _ in 0..500 {
        let mut place = || Point::new(numbers.within(-60.0, 60.0), numbers.within(-60.0, 60.0));
        let (a, b) = (place(), place());
        let got = attenuation.between(a, b);
        assert!((0.0..1000.0).contains(&got), "{a:?} {b:?}: {got}");
        let ray = b - a;
        let direction = [ray.x_m / ray.length_m(), ray.y_m / ray.length_m(), 0.0];
        let free = scene
            .cast([a.x_m, a.y_m, 4.0], direction, ray.length_m())
            .is_none();
        assert!(
            free || got > 0.0 || ray.length_m() < 0.1,
            "a wall on the line takes something: {a:?} {b:?}"
        );
        most_db = most_db.max(got);
    }
    assert!(most_db > 10.0, "{most_db}");
}
