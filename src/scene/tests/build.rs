//! How a scene is put together, and what it refuses.

use super::*;
use crate::geom::Polygon;
use crate::scene::{Footprint, Post, SceneError, Shape};

const TWO: &str = "DEF Yard Group { children [
    DEF House Transform { translation 5 5 1 children DEF Door Shape { geometry Box {} } }
    DEF Shed Transform { translation 9 5 1 children Shape { geometry Box {} } }
    Shape { geometry Sphere {} } ] } Shape { geometry Box {} }";

fn build(materials: &[(&str, f64)], persons: &[Person]) -> Result<Scene, SceneError> {
    let read = read(TWO).unwrap();
    let materials = materials.iter().map(|(name, db_per_m)| {
        (
            name.to_string(),
            Material {
                db_per_m: *db_per_m,
                db_per_crossing: 0.0,
            },
        )
    });
    Scene::build(&SceneParts {
        shapes: &read.shapes,
        offset_m: [100.0, 0.0, 0.5],
        materials: &materials.collect(),
        default_material: Material {
            db_per_m: 1.0,
            db_per_crossing: 0.0,
        },
        posts: &[],
        persons,
    })
}

#[test]
fn the_innermost_named_material_counts() {
    let scene = build(
        &[("Yard", 2.0), ("House", 3.0), ("Door", 4.0)],
        &[person(1.0, 2.0)],
    )
    .unwrap();
    let objects: Vec<(&str, f64)> = scene
        .objects()
        .iter()
        .map(|object| (object.name.as_str(), object.material.db_per_m))
        .collect();
    assert_eq!(
        objects,
        [
            ("Door", 4.0),
            ("Yard", 2.0),
            ("Yard", 2.0),
            ("shape 4", 1.0),
            ("someone", 10.0)
        ]
    );
}

#[test]
fn the_offset_moves_shapes_and_no_persons() {
    let scene = build(&[], &[person(1.0, 2.0)]).unwrap();
    let Shape::Prism {
        footprint,
        low_m,
        high_m,
    } = &scene.objects()[0].shape
    else {
        panic!("a box is a prism")
    };
    assert!(
        footprint.contains(Point::new(105.9, 5.9)) && !footprint.contains(Point::new(106.1, 5.9))
    );
    assert_eq!((*low_m, *high_m), (0.5, 2.5));
    let outline = scene.outlines(0.1).pop().unwrap();
    assert!(outline.name == "someone" && outline.contains(Point::new(1.0, 2.29)));
    assert!(!outline.contains(Point::new(1.0, 2.31)));
    let area_m2 = std::f64::consts::PI * 0.09;
    assert!(
        (outline.polygon.area_m2() - area_m2).abs() < 1e-12,
        "a person has a circle's area"
    );
}

#[test]
fn mistakes_are_refused_by_name() {
    let message = |built: Result<Scene, SceneError>| built.err().unwrap().to_string();
    let unknown = message(build(&[("House", 3.0), ("Huose", 3.0)], &[]));
    assert!(
        unknown.contains("`Huose`") && unknown.ends_with("it has: Door, House, Shed, Yard"),
        "{unknown}"
    );
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(message(build(&[("House", bad)], &[])).contains("db_per_m of `House`"));
        let radius = Person {
            radius_m: bad,
            ..person(1.0, 1.0)
        };
        assert!(message(build(&[], &[radius])).contains("radius_m of `someone`"));
        let height = Person {
            height_m: bad,
            ..person(1.0, 1.0)
        };
        assert!(message(build(&[], &[height])).contains("height_m of `someone`"));
    }
    assert!(message(build(&[], &[person(f64::NAN, 1.0)])).contains("1000 km"));
}

#[test]
fn a_courtyard_seen_from_above_has_a_hole() {
    // A square ring as one closed mesh: the outline has one hole, which is not inside.
    let ring = "Shape { geometry IndexedFaceSet { coord Coordinate { point [
        0 0 0, 4 0 0, 4 4 0, 0 4 0, 1 1 0, 3 1 0, 3 3 0, 1 3 0,
        0 0 2, 4 0 2, 4 4 2, 0 4 2, 1 1 2, 3 1 2, 3 3 2, 1 3 2 ] } coordIndex [
        0 1 9 8 -1 1 2 10 9 -1 2 3 11 10 -1 3 0 8 11 -1 5 4 12 13 -1 6 5 13 14 -1 7 6 14 15 -1 4 7 15 12 -1
        1 0 4 5 -1 2 1 5 6 -1 3 2 6 7 -1 0 3 7 4 -1 8 9 13 12 -1 9 10 14 13 -1 10 11 15 14 -1 11 8 12 15 -1 ] } }";
    let scene = scene_of(ring, 1.0, &[]);
    assert_eq!(scene.objects().len(), 1);
    assert!(scene.objects()[0].closed);
    let outline = scene.outlines(1.0).remove(0);
    assert_eq!(outline.holes.len(), 1);
    assert!(outline.contains(Point::new(0.5, 2.0)) && !outline.contains(Point::new(2.0, 2.0)));
    assert_eq!(scene.clearance_m(Point::new(2.0, 2.0), 0.1, 0.5), 1.0);
    assert_eq!(scene.clearance_m(Point::new(0.5, 2.0), 0.1, 0.5), 0.0);
}

#[test]
fn a_body_need_not_be_convex() {
    // An L of 3 m²; its corners run either way.
    let mut corners = [
        (0.0, 0.0),
        (2.0, 0.0),
        (2.0, 1.0),
        (1.0, 1.0),
        (1.0, 2.0),
        (0.0, 2.0),
    ];
    for _ in 0..2 {
        let outline = Polygon::new(corners.iter().map(|(x, y)| Point::new(*x, *y)).collect());
        let post = Post {
            name: "corner".into(),
            footprint: Footprint::Corners(outline),
            low_m: 0.0,
            high_m: 1.5,
            material: Material {
                db_per_m: 5.0,
                db_per_crossing: 0.0,
            },
        };
        let parts = SceneParts {
            shapes: &[],
            offset_m: [0.0; 3],
            materials: &BTreeMap::new(),
            default_material: Material::default(),
            posts: &[post],
            persons: &[],
        };
        let scene = Scene::build(&parts).unwrap();
        assert!(scene.objects()[0].closed);
        let outline = scene.outlines(0.7).remove(0);
        assert!((outline.polygon.area_m2() - 3.0).abs() < 1e-9 && outline.object == 0);
        assert!(!outline.contains(Point::new(1.5, 1.5)) && outline.contains(Point::new(0.5, 1.5)));
        assert!((scene.clearance_m(Point::new(1.5, 1.4), 0.02, 0.3) - 0.4).abs() < 1e-9);
        assert_eq!(scene.clearance_m(Point::new(0.5, 1.5), 0.02, 0.3), 0.0);
        // Into the notch from above: the lower arm's top is at 1.5 m, the notch has none.
        let down = |x: f64, y: f64| {
            scene
                .cast([x, y, 9.0], [0.0, 0.0, -1.0], 20.0)
                .map(|hit| hit.distance_m)
        };
        assert_eq!(
            (down(1.5, 0.5), down(0.5, 1.5), down(1.5, 1.5)),
            (Some(7.5), Some(7.5), None)
        );
        assert_eq!(scene.extent(), Some(([0.0; 3], [2.0, 2.0, 1.5])));
        corners.reverse();
    }
}
