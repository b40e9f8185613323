//! Scenes that are broken, endless, or not what they are said to be.

use super::desk::{Desk, SCENE, SHAPES};

const HEADER: &str = "#VRML V2.0 utf8\n";

/// A scene file with these shapes is refused by `check`, by `sim` and by `plan`, with the same reason.
fn check(shapes: impl AsRef<[u8]>, parts: &[&str]) {
    let desk = Desk::new();
    desk.write("small.wrl", shapes);
    for arguments in [
        &["check", "small.wrl"][..],
        &["check", "small.scene.toml"],
        &["plan", "small.sim.toml"],
        &["sim", "small.sim.toml"],
    ] {
        let err = desk.refused(arguments, parts);
        assert!(err.contains("small.wrl:"), "{err}");
    }
}

#[test]
fn a_truncated_scene_is_refused() {
    check(&SHAPES[..SHAPES.len() - 20], &["small.wrl:2: ", "the file ends inside Box", "expected"]);
    check(&SHAPES[..HEADER.len() - 5], &["small.wrl:1: ", "expected the first line"]);
}

#[test]
fn an_empty_scene_is_refused() {
    check("", &["small.wrl:1: ", "the file is empty", "expected"]);
    check("\n\n  \n", &["small.wrl:1: ", "the file is empty", "expected"]);
}

#[test]
fn garbage_is_refused() {
    let garbage: Vec<u8> = (0..5000_u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    check(garbage, &["line 1", "UTF-8 is expected"]);
    check("PK\u{3}\u{4} something else\n", &["small.wrl:1: ", "expected the first line"]);
    check([HEADER.as_bytes(), b"Group { \xff }"].concat(), &["line 2", "UTF-8 is expected"]);
}

#[test]
fn a_scene_nested_100_000_deep_is_refused() {
    let groups = 100_000;
    let nested = |open: &str, close: &str| format!("{HEADER}{}{}", open.repeat(groups), close.repeat(groups));
    check(nested("Group { children ", "}"), &["small.wrl:2: ", "nested deeper"]);
    check(nested("Transform { children [", "] }"), &["small.wrl:2: ", "nested deeper"]);
    check(nested("Unknown { field [", "] }"), &["small.wrl:2: ", "nested deeper"]);
    check(format!("{HEADER}Unknown {{ field {}", "[".repeat(groups)), &["small.wrl:2: ", "nested deeper"]);
}

#[test]
fn a_scene_that_contains_itself_is_refused() {
    check(format!("{HEADER}Inline {{ url \"small.wrl\" }}"), &["small.wrl:2: ", "without end"]);
    check(format!("{HEADER}DEF A Group {{ children USE A }}"), &["small.wrl:2: ", "without end"]);
}

#[test]
fn files_that_contain_each_other_are_refused() {
    let desk = Desk::new();
    desk.write("small.wrl", format!("{HEADER}Inline {{ url \"other.wrl\" }}"));
    desk.write("other.wrl", format!("{HEADER}\nInline {{ url \"small.wrl\" }}"));
    desk.refused(&["sim", "small.sim.toml"], &["other.wrl:3: ", "`small.wrl`", "without end"]);
}

#[test]
fn a_scene_that_multiplies_itself_is_refused() {
    let mut bomb = format!("{HEADER}DEF A0 Shape {{ geometry Box {{ }} }}\n");
    for level in 1..12 {
        bomb +=
            &format!("DEF A{level} Group {{ children [ {} ] }}\n", format!("USE A{} ", level - 1).repeat(10));
    }
    check(bomb, &["shapes", "USE"]);
}

#[test]
fn a_huge_scene_is_refused_without_being_read_whole() {
    let desk = Desk::new();
    // A file with a hole: huge, but it takes no room.
    let file = std::fs::File::create(desk.path("small.wrl")).unwrap();
    file.set_len(3 << 30).unwrap();
    for arguments in [["check", "small.wrl"], ["sim", "small.sim.toml"]] {
        let said = desk.run(&arguments);
        assert_eq!(said.code, 2, "{said:?}");
        assert!(said.err.contains("small.wrl:") && said.err.contains("too large; at most"), "{said:?}");
    }
    assert!(!desk.path("out").exists());
}

#[test]
fn impossible_numbers_are_refused() {
    let translated = |x: &str| SHAPES.replace("translation 3", &format!("translation {x}"));
    check(translated("nan"), &["small.wrl:2: ", "`nan`", "expected a finite number"]);
    check(translated("1e999"), &["small.wrl:2: ", "`1e999`", "expected a finite number"]);
    check(SHAPES.replace("size 2", "size -2"), &["small.wrl:2: ", "-2", "above 0"]);
    let faces = "Shape { geometry IndexedFaceSet { coord Coordinate { point [0 0 0, 1 0 0, 0 1 0] } coordIndex [0 1 7] } }";
    check(format!("{HEADER}\n{faces}"), &["small.wrl:3: ", "coordIndex 7", "expected"]);
}

#[test]
fn missing_shapes_are_named() {
    let desk = Desk::new();
    std::fs::remove_file(desk.path("small.wrl")).unwrap();
    desk.refused(&["sim", "small.sim.toml"], &["small.wrl: cannot be read", "No such file"]);
    desk.write("small.wrl", format!("{HEADER}Inline {{ url \"gone.wrl\" }}"));
    desk.refused(&["check", "small.scene.toml"], &["small.wrl:2: ", "`gone.wrl`", "No such file"]);
}

#[test]
fn a_material_for_nothing_is_refused() {
    let desk = Desk::new();
    desk.write("small.scene.toml", SCENE.replace("material.Wall", "material.Walll"));
    for file in ["small.scene.toml", "small.sim.toml"] {
        desk.refused(&["check", file], &[file, "Walll", "Wall\n"]);
    }
    desk.refused(&["sim", "small.sim.toml"], &["small.sim.toml", "Walll"]);
}

#[test]
fn persons_who_do_not_fit_are_refused() {
    let desk = Desk::new();
    desk.write("small.scene.toml", SCENE.replace("count = 1", "count = 100"));
    desk.refused(&["sim", "small.sim.toml"], &["small.sim.toml:3", "scene", "100 random persons do not fit"]);
    desk.write("small.scene.toml", SCENE.replace("keep_from_objects_m = 0.5", "keep_from_objects_m = 20.0"));
    desk.refused(&["sim", "small.sim.toml"], &["small.sim.toml", "no room for person 1", "[random_persons]"]);
}

#[test]
fn a_home_inside_a_wall_or_a_person_is_refused() {
    let desk = Desk::new();
    desk.write("small.wrl", SHAPES.replace("translation 3 3 1", "translation 8.85 8.85 1"));
    desk.refused(&["sim", "small.sim.toml"], &["small.sim.toml", "vehicle 2 starts", "from an object"]);
    let desk = Desk::new();
    desk.write("small.scene.toml", format!("{SCENE}\n[[person]]\nname = \"anna\"\nat_m = [-0.9, -0.9]\n"));
    desk.refused(&["sim", "small.sim.toml"], &["small.sim.toml:3", "anna", "vehicle 1", "home"]);
}
