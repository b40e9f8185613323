//! The VRML reader: what it understands, and what it refuses and how.

use super::*;
use crate::scene::{MAX_BYTES, MAX_LEVELS, Shape};

/// Expects a refusal at a line, with a reason that holds some words.
fn check_refused(body: &str, line: usize, words: &str) {
    let error = read(body).expect_err(&format!("not refused: {}", &body[..body.len().min(200)]));
    assert!(error.reason.contains(words), "{error}");
    assert_eq!(
        (error.file.as_str(), error.line),
        ("test.wrl", line),
        "{error}"
    );
}

/// Expects the box around the only shape of a body.
fn check_box(body: &str, up: Up, low: [f64; 3], high: [f64; 3]) {
    let text = format!("#VRML V2.0 utf8\n{body}");
    let read = read_vrml(&text, "test.wrl", up, &mut |_| Err("none".into())).unwrap();
    assert_eq!(read.shapes.len(), 1);
    let surface = read.shapes[0].shape.surface();
    for axis in 0..3 {
        let parts = || surface.vertices().iter().map(|vertex| vertex[axis]);
        let (least, most) = (
            parts().fold(f64::INFINITY, f64::min),
            parts().fold(f64::NEG_INFINITY, f64::max),
        );
        assert!(
            (least - low[axis]).abs() < 1e-9 && (most - high[axis]).abs() < 1e-9,
            "{axis}: {least}..{most}"
        );
    }
}

const BOX: &str = "children Shape { geometry Box { size 2 4 6 } }";

#[test]
fn transforms_apply_centre_scale_rotation_translation_from_the_inside() {
    check_box(
        &format!("Group {{ {BOX} }}"),
        Up::Z,
        [-1.0, -2.0, -3.0],
        [1.0, 2.0, 3.0],
    );
    let turned =
        format!("Transform {{ rotation 0 0 2 1.5707963267948966 translation 10 0 0 {BOX} }}");
    check_box(&turned, Up::Z, [8.0, -1.0, -3.0], [12.0, 1.0, 3.0]);
    let centred =
        format!("Transform {{ center 1 0 0 rotation 0 0 1 1.5707963267948966 scale 2 1 1 {BOX} }}");
    check_box(&centred, Up::Z, [-1.0, -4.0, -3.0], [3.0, 0.0, 3.0]);
    let nested =
        format!("Transform {{ scale 2 2 2 children Transform {{ translation 1 0 0 {BOX} }} }}");
    check_box(&nested, Up::Z, [0.0, -4.0, -6.0], [4.0, 4.0, 6.0]);
    let slanted =
        format!("Transform {{ scale 2 1 1 scaleOrientation 0 0 1 1.5707963267948966 {BOX} }}");
    check_box(&slanted, Up::Z, [-1.0, -4.0, -3.0], [1.0, 4.0, 3.0]);
}

#[test]
fn y_up_becomes_z_up() {
    let body = format!("Transform {{ translation 1 10 100 {BOX} }}");
    check_box(&body, Up::Y, [0.0, -103.0, 8.0], [2.0, -97.0, 12.0]);
    check_box(&body, Up::Z, [0.0, 8.0, 97.0], [2.0, 12.0, 103.0]);
}

#[test]
fn upright_boxes_and_cylinders_are_prisms_and_slanted_ones_are_not() {
    let is_prism = |body: &str, up: Up| {
        let text = format!("#VRML V2.0 utf8\n{body}");
        let read = read_vrml(&text, "test.wrl", up, &mut |_| Err("none".into())).unwrap();
        matches!(read.shapes[0].shape, Shape::Prism { .. })
    };
    let cylinder = "Shape { geometry Cylinder { radius 0.5 height 3 } }";
    assert!(is_prism(cylinder, Up::Y) && !is_prism(cylinder, Up::Z));
    assert!(is_prism("Shape { geometry Box {} }", Up::Y));
    assert!(is_prism(
        &format!("Transform {{ rotation 0 0 1 0.3 {BOX} }}"),
        Up::Z
    ));
    assert!(is_prism(
        &format!("Transform {{ rotation 1 0 0 1.5707963267948966 {BOX} }}"),
        Up::Z
    ));
    assert!(!is_prism(
        &format!("Transform {{ rotation 1 0 0 0.3 {BOX} }}"),
        Up::Z
    ));
    assert!(!is_prism(
        "Shape { geometry Cylinder { top FALSE } }",
        Up::Y
    ));
}

#[test]
fn the_courtyard_is_an_l_of_two_boxes() {
    let read = read_vrml(courtyard(), "courtyard.wrl", Up::Z, &mut |_| {
        Err("none".into())
    })
    .unwrap();
    assert_eq!(read.warnings, Vec::<String>::new());
    let names: Vec<Vec<&str>> = read
        .shapes
        .iter()
        .map(|shape| shape.names.iter().map(|name| &**name).collect())
        .collect();
    assert_eq!(names, [["Wall", "NorthArm"], ["Wall", "EastArm"]]);
    let scene = scene_of(courtyard(), 20.0, &[]);
    let outlines = scene.outlines(0.5);
    let area_m2: f64 = outlines
        .iter()
        .map(|outline| outline.polygon.area_m2())
        .sum();
    assert!((area_m2 - 0.3 * 15.0).abs() < 1e-9);
    assert!(
        outlines
            .iter()
            .any(|outline| outline.contains(Point::new(6.01, 12.99)))
    );
    assert!(
        outlines
            .iter()
            .any(|outline| outline.contains(Point::new(12.99, 5.01)))
    );
    assert!(scene.outlines(2.5).is_empty());
}

#[test]
fn def_and_use_give_the_same_shape_again() {
    let body = "DEF A Transform { children DEF B Shape { geometry DEF G Box {} } }
        Transform { translation 9 0 0 children [ USE B Shape { geometry USE G } ] }
        DEF C Group { children USE A }";
    let names: Vec<String> = read(body)
        .unwrap()
        .shapes
        .iter()
        .map(|shape| shape.names.join("/"))
        .collect();
    assert_eq!(names, ["A/B", "B", "", "C/A/B"]);
}

#[test]
fn face_sets_are_cut_into_fans_and_may_share_points() {
    let body = "Shape { appearance Appearance { material DEF M Material { diffuseColor 1 0 0 } }
        geometry IndexedFaceSet { solid FALSE creaseAngle 0.5
            coord DEF P Coordinate { point [ 0 0 0, 1 0 0, 1 1 0, 0.5 1.5 0, 0 1 0 ] }
            coordIndex [ 0 1 2 3 4 -1 0 1 2 ] color Color { color [ 1 1 1 ] } } }
        Shape { appearance Appearance { material USE M } geometry IndexedFaceSet { coordIndex [ 0, 2, 4 -1 ] coord USE P } }";
    let read = read(body).unwrap();
    let counts: Vec<_> = read
        .shapes
        .iter()
        .map(|shape| (shape.faces, shape.triangles))
        .collect();
    assert_eq!(counts, [(2, 4), (1, 1)]);
    assert!(read.warnings.is_empty(), "{:?}", read.warnings);
}

#[test]
fn other_nodes_are_skipped_with_one_warning_per_type() {
    let body = "WorldInfo { title \"} { [\" info [ \"a\" \"b\" ] }
        DEF L PointLight { on TRUE location 0 1 2 } PointLight {}
        PROTO P [ field SFNode x NULL exposedField MFNode y [ DEF Q Group { } ] ] { Group { children IS y } }
        EXTERNPROTO E [ field SFBool b ] [ \"e.wrl#E\" ]
        P { x Group { children [ Shape { geometry Box {} } ] } }
        DEF S Script { url \"javascript: f() { }\" field SFNode n USE L eventIn SFBool go directOutput TRUE }
        ROUTE S.go TO L.on
        Group { bboxSize 1 2 3 ROUTE S.go TO L.on children [ USE L NULL
            Collision { collide TRUE proxy NULL children Shape { geometry Text { string [ \"x\" ] } } } USE Q
            DEF X Shape { geometry Sphere { radius 2 } } ] }
        Shape { }";
    let read = read(body).unwrap();
    assert_eq!(read.shapes.len(), 1);
    let skipped: Vec<&str> = read
        .warnings
        .iter()
        .map(|warning| warning.split(' ').nth(1).unwrap())
        .collect();
    assert_eq!(
        skipped,
        [
            "WorldInfo",
            "PointLight",
            "PROTO",
            "EXTERNPROTO",
            "P",
            "Script",
            "ROUTE",
            "Text"
        ]
    );
    assert!(
        read.warnings[1].starts_with("test.wrl:3: "),
        "{}",
        read.warnings[1]
    );
}

#[test]
fn inlines_are_loaded_beside_the_file_that_names_them() {
    let mut asked = Vec::new();
    let mut loader = |address: &str| {
        asked.push(address.to_string());
        match address {
            "parts/a.wrl" => Ok(
                "#VRML V2.0 utf8\nDEF A Inline { url [ \"gone.wrl\" \"../b.wrl\" ] }".to_string(),
            ),
            "b.wrl" => Ok("#VRML V2.0 utf8\nDEF B Shape { geometry Box {} }".to_string()),
            _ => Err("no such file".to_string()),
        }
    };
    let text = "#VRML V2.0 utf8\nTransform { children [ Inline { url \"./parts/a.wrl\" } ] }";
    let read = read_vrml(text, "scenes/main.wrl", Up::Z, &mut loader).unwrap();
    assert_eq!(read.shapes[0].names.join("/"), "A/B");
    assert_eq!(asked, ["parts/a.wrl", "parts/gone.wrl", "b.wrl"]);
}

#[test]
fn inlines_in_a_circle_or_missing_are_refused() {
    let main = "#VRML V2.0 utf8\n\nInline { url \"a.wrl\" }";
    let to = |address: &'static str| {
        move |_: &str| {
            Ok(format!(
                "#VRML V2.0 utf8\nGroup {{ children Inline {{ url \"{address}\" }} }}"
            ))
        }
    };
    for address in ["a.wrl", "main.wrl", "./x/../a.wrl"] {
        let error = read_vrml(main, "scenes/main.wrl", Up::Z, &mut to(address)).unwrap_err();
        assert_eq!((error.file.as_str(), error.line), ("a.wrl", 2));
        assert!(error.reason.contains("inside itself"), "{error}");
    }
    let error =
        read_vrml(main, "main.wrl", Up::Z, &mut |_| Err("no such file".into())).unwrap_err();
    assert_eq!(
        error.to_string(),
        "main.wrl:3: Inline of `a.wrl` cannot be read: no such file"
    );
    let error = read_vrml(main, "main.wrl", Up::Z, &mut |_| {
        Ok("#VRML V2.0 utf8\n}".into())
    })
    .unwrap_err();
    assert_eq!((error.file.as_str(), error.line), ("a.wrl", 2));
    let mut count = 0;
    let mut endless = |_: &str| {
        count += 1;
        Ok(format!(
            "#VRML V2.0 utf8\nInline {{ url \"{count}.wrl\" }} Inline {{ url \"x{count}.wrl\" }}"
        ))
    };
    assert!(read_vrml(main, "main.wrl", Up::Z, &mut endless).is_err());
}

#[test]
fn broken_files_are_refused_with_their_line() {
    check_refused(
        "Group { children [\n",
        3,
        "the file ends inside children, opened in line 2; expected `]`",
    );
    check_refused("Transform {\n translation 0 0", 3, "the end of the file");
    check_refused("Foo { bar [\n", 3, "the file ends inside");
    check_refused("Group {\n children ] }", 3, "found `]`; expected a node");
    check_refused("\nFoo [ }", 3, "found `[`; expected `{`");
    check_refused("Foo {\n [ } ]", 3, "found `}`; expected `]`");
    check_refused("Transform {\n translation 0 nan 0 }", 3, "finite");
    check_refused("Transform {\n translation 0 1e999 0 }", 3, "finite");
    check_refused(
        "Transform {\n translation 0 x 0 }",
        3,
        "a number for translation",
    );
    check_refused("Transform {\n scale 0 1 1 }", 3, "a scale of 0");
    check_refused("Shape { geometry Box { size 1\n-1 1 } }", 3, "above 0");
    check_refused("Shape { geometry Sphere { radius\n0 } }", 3, "above 0");
    check_refused(
        "Transform { translation 1e7 0 0 children\nShape { geometry Box {} } }",
        3,
        "1000 km",
    );
    check_refused(
        "Shape { geometry IndexedFaceSet { coord Coordinate { point [ 0 0 0 1 ] } } }",
        2,
        "point",
    );
    let faces = |index: &str| {
        format!(
            "Shape {{ geometry IndexedFaceSet {{ coord Coordinate {{ point [ 0 0 0 1 0 0 0 1 0 ] }}\ncoordIndex [ 0 1 {index} -1 ] }} }}"
        )
    };
    check_refused(
        &faces("3"),
        3,
        "coordIndex 3; expected −1 or one of the 3 points",
    );
    check_refused(&faces("-2"), 3, "coordIndex -2");
    check_refused(&faces("1.5"), 3, "whole number");
    check_refused(&faces("99999999999999999999"), 3, "whole number");
}

#[test]
fn names_in_a_circle_or_unknown_are_refused() {
    check_refused(
        "DEF A Group { children [\nDEF B Group { children USE A } ] }",
        3,
        "inside its own DEF",
    );
    check_refused("\nUSE A", 3, "no DEF of this name");
    check_refused("Shape { geometry DEF G Box {} }\nUSE G", 3, "is no node");
    check_refused(
        "DEF N Group {}\nShape { geometry USE N }",
        3,
        "is no geometry",
    );
}

#[test]
fn files_that_are_no_vrml_are_refused() {
    for (text, words) in [
        ("", "the file is empty"),
        (" \n\n", "the file is empty"),
        (
            "#VRML V1.0 ascii\n",
            "found `#VRML V1.0 ascii`; expected the first line `#VRML V2.0 utf8`",
        ),
        ("<X3D/>", "expected the first line"),
    ] {
        let error = read_vrml(text, "x.wrl", Up::Z, &mut |_| Err("none".into())).unwrap_err();
        assert!(error.line == 1 && error.reason.contains(words), "{error}");
    }
    assert_eq!(read("").unwrap(), VrmlScene::default());
    let huge = " ".repeat(MAX_BYTES + 1);
    let error = read_vrml(&huge, "x.wrl", Up::Z, &mut |_| Err("none".into())).unwrap_err();
    assert!(error.reason.contains("over 64 MiB"), "{error}");
}

#[test]
fn a_hundred_thousand_levels_are_refused_without_a_stack() {
    let levels = 100_000;
    check_refused(
        &"Group { children [\n".repeat(levels),
        2 + MAX_LEVELS,
        "deeper than 256 levels",
    );
    check_refused(
        &"Group { children\n".repeat(levels),
        2 + MAX_LEVELS,
        "deeper than 256 levels",
    );
    check_refused(
        &format!("Foo {{ {}", "[\n".repeat(levels)),
        2 + 2 * MAX_LEVELS - 1,
        "deeper than",
    );
    check_refused(
        &format!("Shape {{ appearance {}", "A { b\n".repeat(levels)),
        2 + 2 * MAX_LEVELS,
        "deeper",
    );
    let chain: String = (1..levels)
        .map(|i| format!("DEF A{i} Group {{ children USE A{} }}\n", i - 1))
        .collect();
    check_refused(
        &format!("DEF A0 Group {{ }}\n{chain}"),
        2 + MAX_LEVELS,
        "levels of nodes",
    );
    let fine = format!("{}{}", "Group { children [ ".repeat(200), "] }".repeat(200));
    assert!(read(&fine).is_ok());
}

#[test]
fn a_small_file_cannot_unfold_to_a_huge_scene() {
    let doubled = |first: &str| {
        let steps: String = (1..60)
            .map(|i| {
                format!(
                    "DEF A{i} Group {{ children [ USE A{0} USE A{0} ] }}\n",
                    i - 1
                )
            })
            .collect();
        format!("DEF A0 {first}\n{steps}")
    };
    for (first, words) in [
        ("Shape { geometry Box {} }", "over 20000 shapes"),
        ("Group {}", "over 1000000 nodes"),
        ("Shape { geometry Sphere {} }", "over 1000000 triangles"),
    ] {
        let error = read(&doubled(first)).unwrap_err();
        assert!(error.reason.contains(words), "{error}");
    }
}

/// A file with a bit of everything.
const SAMPLE: &str = "WorldInfo { title \"é ä\" } # ünder\n
    DEF A Transform { translation 1 2 3 rotation 0 0 1 0.5 scale 1 2 1 center 0 0 1 children [
      DEF S Shape { appearance Appearance { material Material { } } geometry IndexedFaceSet {
        coord DEF P Coordinate { point [ 0 0 0, 1 0 0, 1 1 0, 0 1 0 ] } coordIndex [ 0 1 2 3 -1 ] } }
      Shape { geometry Cylinder { radius 1 height 2 bottom FALSE } } Inline { url \"x.wrl\" } ] }
    Shape { geometry ElevationGrid { xDimension 2 zDimension 2 xSpacing 3 height [ 0 1, 2 1.5 ] } }
    Shape { geometry Extrusion { convex FALSE crossSection [ 0 0, 0 2, 1 2, 1 1, 2 1, 2 0, 0 0 ] endCap FALSE
      spine [ 0 0 0, 1 1 0, 2 1 1 ] scale [ 1 1, 2 2, 1 0 ] orientation 0 1 0 0.3 } }
    PROTO Q [ ] { Group { } } ROUTE A.b TO B.c Group { children [ USE A USE S ] }\n";

#[test]
fn files_cut_off_or_damaged_never_panic() {
    let whole = format!("#VRML V2.0 utf8\n{SAMPLE}{}", &courtyard()[16..]);
    let mut loader = |_: &str| Ok("#VRML V2.0 utf8\nShape { geometry Cone { } }".to_string());
    assert_eq!(
        read_vrml(&whole, "x", Up::Z, &mut loader)
            .unwrap()
            .shapes
            .len(),
        11
    );
    let mut refused = 0;
    for (end, _) in whole.char_indices() {
        refused += usize::from(read_vrml(&whole[..end], "x", Up::Z, &mut loader).is_err());
    }
    assert!(refused > 500, "{refused}");
    let mut numbers = Sequence(7);
    let alphabet = b"{}[]\"#\\ ,\n-.0179eEUSEDFnaif";
    for _ in 0..3000 {
        let mut bytes = whole.clone().into_bytes();
        for _ in 0..=numbers.below(4) {
            let at = numbers.below(bytes.len());
            match numbers.below(3) {
                0 => bytes[at] = alphabet[numbers.below(alphabet.len())],
                1 => drop(bytes.remove(at)),
                _ => bytes[at] ^= 1 << numbers.below(8),
            }
        }
        let text = String::from_utf8_lossy(&bytes);
        if let Ok(read) = read_vrml(&text, "x", Up::Z, &mut loader) {
            let materials = BTreeMap::new();
            let default_material = Material::default();
            let shapes = &read.shapes;
            let parts = SceneParts {
                shapes,
                offset_m: [0.0; 3],
                materials: &materials,
                default_material,
                posts: &[],
                persons: &[],
            };
            Scene::build(&parts).unwrap();
        }
    }
}
