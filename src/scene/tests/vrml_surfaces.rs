//! ElevationGrid and Extrusion: corners worked out by hand from VRML97, 6.17 and 6.18, and what is refused.

use super::*;
use crate::scene::affine::{cross, dot, sub};
use crate::scene::{Mesh, Shape};

const QUARTER_TURN: &str = "1.5707963267948966";

fn read_up(geometry: &str, up: Up) -> Result<VrmlScene, VrmlError> {
    let text = format!("#VRML V2.0 utf8\nShape {{ geometry {geometry} }}");
    read_vrml(&text, "test.wrl", up, &mut |_| Err("none".into()))
}

/// Builds a scene of the shapes read, and of nothing else.
fn scene_of(read: &VrmlScene) -> Scene {
    let parts = SceneParts {
        shapes: &read.shapes,
        offset_m: [0.0; 3],
        materials: &BTreeMap::new(),
        default_material: Material::default(),
        posts: &[],
        persons: &[],
    };
    Scene::build(&parts).unwrap()
}

/// Returns the surface of the only shape, in the file's own coordinates.
fn surface(geometry: &str) -> Mesh {
    read_up(geometry, Up::Z).unwrap().shapes[0].shape.surface()
}

/// Expects the corners of a surface, each once, in any order.
fn check_corners(surface: &Mesh, expected: &[[f64; 3]]) {
    let mut missing: Vec<[f64; 3]> = expected.to_vec();
    for vertex in surface.vertices() {
        let near =
            |corner: &[f64; 3]| (0..3).all(|axis| (corner[axis] - vertex[axis]).abs() < 1e-9);
        let place = missing.iter().position(near);
        missing.remove(place.unwrap_or_else(|| panic!("{vertex:?} is none of {missing:?}")));
    }
    assert!(missing.is_empty(), "{missing:?} are missing");
}

fn check_refused(geometry: &str, words: &str) {
    let error = read_up(geometry, Up::Y).expect_err(words);
    assert!(error.reason.contains(words), "{error}");
    assert_eq!(
        (error.file.as_str(), error.line),
        ("test.wrl", 2),
        "{error}"
    );
}

fn volume_m3(mesh: &Mesh) -> f64 {
    mesh.corners()
        .map(|[a, b, c]| dot(a, cross(b, c)) / 6.0)
        .sum()
}

fn area_m2(mesh: &Mesh) -> f64 {
    let twice = |[a, b, c]: [[f64; 3]; 3]| cross(sub(b, a), sub(c, a));
    mesh.corners()
        .map(|corners| dot(twice(corners), twice(corners)).sqrt() / 2.0)
        .sum()
}

const GRID: &str =
    "ElevationGrid { xDimension 3 zDimension 2 xSpacing 2 zSpacing 3 solid FALSE ccw TRUE
    creaseAngle 0.5 height [ 0 1 2 3 4 5 ] }";

#[test]
fn a_grid_runs_along_x_then_z_with_heights_along_y() {
    let expected = [
        [0.0, 0.0, 0.0],
        [2.0, 1.0, 0.0],
        [4.0, 2.0, 0.0],
        [0.0, 3.0, 3.0],
        [2.0, 4.0, 3.0],
        [4.0, 5.0, 3.0],
    ];
    check_corners(&surface(GRID), &expected);
    let read = read_up(GRID, Up::Y).unwrap();
    assert_eq!((read.shapes[0].faces, read.shapes[0].triangles), (2, 4));
    assert_eq!(read.warnings, Vec::<String>::new());
}

#[test]
fn a_grid_lies_level_with_y_up_and_with_z_up_when_it_is_turned() {
    let expected = [
        [0.0, 0.0, 0.0],
        [2.0, 0.0, 1.0],
        [4.0, 0.0, 2.0],
        [0.0, -3.0, 3.0],
        [2.0, -3.0, 4.0],
        [4.0, -3.0, 5.0],
    ];
    let turned = format!(
        "Transform {{ rotation 1 0 0 {QUARTER_TURN} children Shape {{ geometry {GRID} }} }}"
    );
    let scenes = [read_up(GRID, Up::Y).unwrap(), read(&turned).unwrap()];
    for scene in scenes {
        let surface = scene.shapes[0].shape.surface();
        check_corners(&surface, &expected);
        assert!(
            surface
                .corners()
                .all(|[a, b, c]| cross(sub(b, a), sub(c, a))[2] > 0.0),
            "it looks up"
        );
    }
}

#[test]
fn a_grid_is_met_at_the_height_of_its_corners_and_between_them() {
    let read = read_up(GRID, Up::Y).unwrap();
    let scene = scene_of(&read);
    // The heights lie in one plane: x / 2 + z (= -y).
    for (x, y) in [(0.5, -0.5), (1.9, -2.9), (3.0, -1.5), (3.9, -0.1)] {
        let hit = scene.cast([x, y, 100.0], [0.0, 0.0, -1.0], 200.0).unwrap();
        assert!((100.0 - hit.distance_m - (x / 2.0 - y)).abs() < 1e-9);
    }
    assert!(
        scene
            .cast([4.1, -1.0, 100.0], [0.0, 0.0, -1.0], 200.0)
            .is_none()
    );
    assert!(!scene.objects()[0].closed);
}

#[test]
fn grids_that_are_huge_or_have_holes_are_refused() {
    check_refused(
        "ElevationGrid { xDimension 40000 zDimension 25000 height [ 0 ] }",
        "1000000000 points",
    );
    check_refused(
        "ElevationGrid { xDimension 1000000000 }",
        "expected 0 to 500000",
    );
    check_refused("ElevationGrid { xDimension -2 }", "-2 for xDimension");
    check_refused(
        "ElevationGrid { xDimension 2.5 }",
        "expected a whole number",
    );
    check_refused(
        "ElevationGrid { xDimension 2 zDimension 2 height [ 0 1 2 ] }",
        "3 heights; expected 2 x 2 = 4",
    );
    check_refused(
        "ElevationGrid { xDimension 2 zDimension 2 height [ 0 1 2 NaN ] }",
        "expected a finite number",
    );
    check_refused(
        "ElevationGrid { xDimension 2 zDimension 2 height [ 0 1 2 1e999 ] }",
        "a finite number",
    );
    check_refused("ElevationGrid { xSpacing 0 }", "expected a number above 0");
    assert_eq!(
        read_up("ElevationGrid {}", Up::Y).unwrap().shapes[0].triangles,
        0
    );
}

#[test]
fn a_straight_extrusion_is_a_prism() {
    let read = read_up("Extrusion { creaseAngle 0.3 solid FALSE }", Up::Y).unwrap();
    let Shape::Prism {
        footprint,
        low_m,
        high_m,
    } = &read.shapes[0].shape
    else {
        panic!("no prism")
    };
    assert_eq!((footprint.area_m2(), *low_m, *high_m), (4.0, 0.0, 1.0));
    assert_eq!((read.shapes[0].faces, read.shapes[0].triangles), (6, 12));
    assert_eq!(read.warnings, Vec::<String>::new());
}

#[test]
fn the_section_of_a_straight_spine_is_turned_the_shortest_way() {
    // From +y to +x: x goes to -y, z stays.
    let sheet = "Extrusion { crossSection [ 1 2, 3 4 ] beginCap FALSE endCap FALSE spine [ 0 0 0, 5 0 0 ] }";
    check_corners(
        &surface(sheet),
        &[
            [0.0, -1.0, 2.0],
            [0.0, -3.0, 4.0],
            [5.0, -1.0, 2.0],
            [5.0, -3.0, 4.0],
        ],
    );
    // Downward: about x, so that z goes to -z.
    let down = sheet.replace("5 0 0", "0 -5 0");
    check_corners(
        &surface(&down),
        &[
            [1.0, 0.0, -2.0],
            [3.0, 0.0, -4.0],
            [1.0, -5.0, -2.0],
            [3.0, -5.0, -4.0],
        ],
    );
}

#[test]
fn a_bend_stands_halfway_between_its_arms() {
    let bend = "Extrusion { crossSection [ 0.5 0.25, -0.5 0.25 ] beginCap FALSE endCap FALSE
        spine [ 0 0 0, 0 2 0, 2 2 0 ] }";
    // z of the section points to -z (VRML97: next × previous), its x is y × z.
    let half = 0.5 * std::f64::consts::FRAC_1_SQRT_2;
    let expected = [
        [-0.5, 0.0, -0.25],
        [0.5, 0.0, -0.25],
        [-half, 2.0 + half, -0.25],
        [half, 2.0 - half, -0.25],
        [2.0, 2.5, -0.25],
        [2.0, 1.5, -0.25],
    ];
    check_corners(&surface(bend), &expected);
    // Points doubled on the way change nothing but their number.
    let doubled = surface(&bend.replace("0 2 0,", "0 2 0, 0 2 0,"));
    check_corners(&doubled.pieces()[0].0, &expected);
}

#[test]
fn a_winding_spine_keeps_its_section_upright() {
    let winding = "Extrusion { crossSection [ 0 0.5, 0 -0.5 ] beginCap FALSE endCap FALSE
        spine [ 0 0 0, 1 1 0, 2 0 0, 3 1 0, 4 2 0 ] }";
    let surface = surface(winding);
    let above = surface
        .vertices()
        .iter()
        .filter(|vertex| (vertex[2] - 0.5).abs() < 1e-9)
        .count();
    assert_eq!((surface.vertices().len(), above), (10, 5));
    // Each side of the band is one straight row: no triangle joins +z and -z crosswise.
    assert!((area_m2(&surface) - 4.0 * 2f64.sqrt()).abs() < 1e-9);
}

#[test]
fn scale_and_orientation_apply_at_each_point() {
    let text = format!(
        "Extrusion {{ crossSection [ 1 0, 0 1 ] beginCap FALSE endCap FALSE spine [ 0 0 0, 0 1 0, 0 3 0 ]
            scale [ 1 1, 2 3, 1 1 ] orientation [ 0 1 0 0, 0 1 0 0, 0 1 0 {QUARTER_TURN} ] }}"
    );
    // A quarter turn about y takes x to -z and z to x.
    let expected = [
        [1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0],
        [2.0, 1.0, 0.0],
        [0.0, 1.0, 3.0],
        [0.0, 3.0, -1.0],
        [1.0, 3.0, 0.0],
    ];
    check_corners(&surface(&text), &expected);
    let pyramid = surface("Extrusion { scale [ 1 1, 0 0 ] spine [ 0 0 0, 0 3 0 ] }");
    let (piece, closed) = pyramid.pieces().remove(0);
    assert!(closed && (volume_m3(&piece) - 4.0).abs() < 1e-9);
}

#[test]
fn a_closed_spine_needs_no_caps_and_surrounds_a_hole() {
    let ring = "Extrusion { crossSection [ 0.1 0.2, 0.1 -0.2, -0.1 -0.2, -0.1 0.2, 0.1 0.2 ]
        spine [ 1 0 1, 1 0 -1, -1 0 -1, -1 0 1, 1 0 1 ] }";
    let read = read_up(ring, Up::Y).unwrap();
    assert_eq!((read.shapes[0].faces, read.shapes[0].triangles), (16, 32));
    let scene = scene_of(&read);
    assert!(scene.objects()[0].closed);
    let outline = scene.outlines(0.0).remove(0);
    // The corners' sections lie on the diagonals, 0.1 m to each side: the frame is 0.1 · √2 m thick.
    let (outer, inner) = (2.0 + 0.1 * 2f64.sqrt(), 2.0 - 0.1 * 2f64.sqrt());
    assert!((outline.polygon.area_m2() - outer * outer).abs() < 1e-6);
    assert!((outline.holes[0].area_m2() + inner * inner).abs() < 1e-6);
}

#[test]
fn caps_follow_their_flags_and_a_hollow_outline() {
    let bowl = surface("Extrusion { endCap FALSE }");
    assert!(!bowl.pieces()[0].1);
    assert!((area_m2(&bowl) - 12.0).abs() < 1e-9);
    // An L of 3 m² and 8 m around, 1 m high; its corners run clockwise or not.
    for section in [
        "0 0, 0 2, 1 2, 1 1, 2 1, 2 0, 0 0",
        "0 0, 2 0, 2 1, 1 1, 1 2, 0 2, 0 0",
    ] {
        let body = surface(&format!(
            "Extrusion {{ convex FALSE crossSection [ {section} ] }}"
        ));
        assert!(
            (area_m2(&body) - (2.0 * 3.0 + 8.0)).abs() < 1e-9,
            "{section}"
        );
        let (piece, closed) = body.pieces().remove(0);
        assert!(
            closed && (volume_m3(&piece).abs() - 3.0).abs() < 1e-9,
            "{section}"
        );
    }
}

#[test]
fn impossible_extrusions_are_refused() {
    check_refused(
        "Extrusion { spine [ 1 2 3 ] }",
        "spine has under two places",
    );
    check_refused(
        "Extrusion { spine [ 1 2 3, 1 2 3 ] }",
        "spine has under two places",
    );
    check_refused("Extrusion { spine [ ] }", "spine has under two places");
    check_refused("Extrusion { crossSection [ 1 1 ] }", "under two points");
    check_refused(
        "Extrusion { spine [ 0 0 0, 0 1 0, 0 2 0 ] scale [ 1 1, 2 2 ] }",
        "2 values of scale",
    );
    check_refused("Extrusion { orientation [ ] }", "0 values of orientation");
    check_refused(
        "Extrusion { scale -1 1 }",
        "-1 for scale; expected 0 or more",
    );
    check_refused("Extrusion { beginCap 1 }", "expected TRUE or FALSE");
    let (long, wide) = ("0 1 0 ".repeat(40_000), "1 1 ".repeat(25_000));
    let huge = format!("Extrusion {{ spine [ 0 0 0 {long} ] crossSection [ {wide} ] }}");
    check_refused(&huge, "points; expected at most 500000");
    let zigzag: String = (0..3000)
        .map(|corner| format!("{corner} {} ", corner % 2))
        .collect();
    check_refused(
        &format!("Extrusion {{ convex FALSE crossSection [ {zigzag} ] }}"),
        "not convex; expected at most",
    );
}
