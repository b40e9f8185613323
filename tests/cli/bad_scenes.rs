//! Scenes that are broken, endless, or not what they are said to be.

use super::program_runner::{ProgramRunner, SCENE, SHAPES, VENUE};

const HEADER: &str = "#VRML V2.0 utf8\n";

/// A scene file with these shapes is refused by `check`, by `sim` and by `plan`, with the same reason.
fn check(shapes: impl AsRef<[u8]>, parts: &[&str]) {
    let runner = ProgramRunner::new();
    runner.write("small.wrl", shapes);
    for arguments in [
        &["check", "small.wrl"][..],
        &["check", "small.scene.toml"],
        &["plan", "small.sim.toml"],
        &["sim", "small.sim.toml"],
    ] {
        let err = runner.refused(arguments, parts);
        assert!(err.contains("small.wrl:"), "{err}");
    }
}

#[test]
fn a_truncated_scene_is_refused() {
    check(
        &SHAPES[..SHAPES.len() - 20],
        &["small.wrl:2: ", "the file ends inside Box", "expected"],
    );
    check(
        &SHAPES[..HEADER.len() - 5],
        &["small.wrl:1: ", "expected the first line"],
    );
}

#[test]
fn an_empty_scene_is_refused() {
    check("", &["small.wrl:1: ", "the file is empty", "expected"]);
    check(
        "\n\n  \n",
        &["small.wrl:1: ", "the file is empty", "expected"],
    );
}

#[test]
fn garbage_is_refused() {
    let garbage: Vec<u8> = (0..5000_u32)
        .map(|n| (n.wrapping_mul(2_654_435_761) >> 13) as u8)
        .collect();
    check(garbage, &["line 1", "UTF-8 is expected"]);
    check(
        "PK\u{3}\u{4} something else\n",
        &["small.wrl:1: ", "expected the first line"],
    );
    check(
        [HEADER.as_bytes(), b"Group { \xff }"].concat(),
        &["line 2", "UTF-8 is expected"],
    );
}

#[test]
fn a_scene_nested_100_000_deep_is_refused() {
    let groups = 100_000;
    let nested = |open: &str, close: &str| {
        format!("{HEADER}{}{}", open.repeat(groups), close.repeat(groups))
    };
    check(
        nested("Group { children ", "}"),
        &["small.wrl:2: ", "nested deeper"],
    );
    check(
        nested("Transform { children [", "] }"),
        &["small.wrl:2: ", "nested deeper"],
    );
    check(
        nested("Unknown { field [", "] }"),
        &["small.wrl:2: ", "nested deeper"],
    );
    check(
        format!("{HEADER}Unknown {{ field {}", "[".repeat(groups)),
        &["small.wrl:2: ", "nested deeper"],
    );
}

#[test]
fn a_scene_that_contains_itself_is_refused() {
    check(
        format!("{HEADER}Inline {{ url \"small.wrl\" }}"),
        &["small.wrl:2: ", "without end"],
    );
    check(
        format!("{HEADER}DEF A Group {{ children USE A }}"),
        &["small.wrl:2: ", "without end"],
    );
}

#[test]
fn files_that_contain_each_other_are_refused() {
    let runner = ProgramRunner::new();
    runner.write(
        "small.wrl",
        format!("{HEADER}Inline {{ url \"other.wrl\" }}"),
    );
    runner.write(
        "other.wrl",
        format!("{HEADER}\nInline {{ url \"small.wrl\" }}"),
    );
    runner.refused(
        &["sim", "small.sim.toml"],
        &["other.wrl:3: ", "`small.wrl`", "without end"],
    );
}

#[test]
fn a_scene_that_multiplies_itself_is_refused() {
    let mut bomb = format!("{HEADER}DEF A0 Shape {{ geometry Box {{ }} }}\n");
    for level in 1..12 {
        bomb += &format!(
            "DEF A{level} Group {{ children [ {} ] }}\n",
            format!("USE A{} ", level - 1).repeat(10)
        );
    }
    check(bomb, &["shapes", "USE"]);
}

#[test]
fn a_huge_scene_is_refused_without_being_read_whole() {
    let runner = ProgramRunner::new();
    // A file with a hole: huge, but it takes no room.
    let file = std::fs::File::create(runner.path("small.wrl")).unwrap();
    file.set_len(3 << 30).unwrap();
    for arguments in [["check", "small.wrl"], ["sim", "small.sim.toml"]] {
        let output = runner.run(&arguments);
        assert_eq!(output.code, 2, "{output:?}");
        assert!(
            output.err.contains("small.wrl:") && output.err.contains("too large; at most"),
            "{output:?}"
        );
    }
    assert!(!runner.path("out").exists());
}

#[test]
fn impossible_numbers_are_refused() {
    let translated = |x: &str| SHAPES.replace("translation 3", &format!("translation {x}"));
    check(
        translated("nan"),
        &["small.wrl:2: ", "`nan`", "expected a finite number"],
    );
    check(
        translated("1e999"),
        &["small.wrl:2: ", "`1e999`", "expected a finite number"],
    );
    check(
        SHAPES.replace("size 2", "size -2"),
        &["small.wrl:2: ", "-2", "above 0"],
    );
    let faces = "Shape { geometry IndexedFaceSet { coord Coordinate { point [0 0 0, 1 0 0, 0 1 0] } coordIndex [0 1 7] } }";
    check(
        format!("{HEADER}\n{faces}"),
        &["small.wrl:3: ", "coordIndex 7", "expected"],
    );
}

#[test]
fn missing_shapes_are_named() {
    let runner = ProgramRunner::new();
    std::fs::remove_file(runner.path("small.wrl")).unwrap();
    runner.refused(
        &["sim", "small.sim.toml"],
        &["small.wrl: cannot be read", "No such file"],
    );
    runner.write(
        "small.wrl",
        format!("{HEADER}Inline {{ url \"gone.wrl\" }}"),
    );
    runner.refused(
        &["check", "small.scene.toml"],
        &["small.wrl:2: ", "`gone.wrl`", "No such file"],
    );
}

#[test]
fn a_material_for_nothing_is_refused() {
    let runner = ProgramRunner::new();
    runner.write(
        "small.scene.toml",
        SCENE.replace("material.Wall", "material.Walll"),
    );
    for file in ["small.scene.toml", "small.sim.toml"] {
        runner.refused(&["check", file], &[file, "Walll", "Wall\n"]);
    }
    runner.refused(&["sim", "small.sim.toml"], &["small.sim.toml", "Walll"]);
}

#[test]
fn persons_who_do_not_fit_are_refused() {
    let runner = ProgramRunner::new();
    runner.write(
        "small.scene.toml",
        SCENE.replace("count = 1", "count = 100"),
    );
    runner.refused(
        &["sim", "small.sim.toml"],
        &["small.sim.toml:3", "scene", "100 random persons do not fit"],
    );
    runner.write(
        "small.scene.toml",
        SCENE.replace("keep_from_objects_m = 0.5", "keep_from_objects_m = 20.0"),
    );
    runner.refused(
        &["sim", "small.sim.toml"],
        &[
            "small.scene.toml:9: random_persons: no room for person 1 of 1",
            "fewer persons or smaller distances are needed",
        ],
    );
}

#[test]
fn a_home_inside_a_wall_or_a_person_is_refused() {
    let runner = ProgramRunner::new();
    runner.write(
        "small.wrl",
        SHAPES.replace("translation 3 3 1", "translation 8.85 8.85 1"),
    );
    runner.refused(
        &["sim", "small.sim.toml"],
        &[
            "small.venue.toml:5: homes_m: vehicle 2 starts",
            "from an object",
        ],
    );
    let runner = ProgramRunner::new();
    runner.write(
        "small.scene.toml",
        format!("{SCENE}\n[[person]]\nname = \"anna\"\nat_m = [-0.9, -0.9]\n"),
    );
    runner.refused(
        &["sim", "small.sim.toml"],
        &[
            "small.sim.toml:3: ",
            "anna (small.scene.toml:16) stands in the way of vehicle 1 at its home",
        ],
    );
}

#[test]
fn a_scene_that_lies_under_the_ground_is_refused() {
    let runner = ProgramRunner::new();
    runner.write(
        "small.scene.toml",
        SCENE.replace("up = \"z\"", "up = \"z\"\noffset_m = [0, 0, -6]"),
    );
    for arguments in [
        &["check", "small.scene.toml"][..],
        &["check", "small.sim.toml"],
        &["scene", "small.scene.toml"],
        &["scene", "small.sim.toml"],
        &["plan", "small.sim.toml"],
        &["sim", "small.sim.toml"],
    ] {
        runner.refused(
            arguments,
            &[
                arguments[1],
                "scene: the highest point",
                "-4.00 m",
                "`up` and `offset_m`",
            ],
        );
    }
}

#[test]
fn ground_that_rises_over_the_wheels_at_a_home_is_refused() {
    let runner = ProgramRunner::new();
    let ground = |height_m: f64| {
        let heights = format!("{height_m} ").repeat(4);
        format!(
            "{SHAPES}Transform {{ translation -2 0 0 rotation 1 0 0 1.5707963267948966 children Shape {{
                geometry ElevationGrid {{ xDimension 2 zDimension 2 xSpacing 2 zSpacing 2 height [ {heights}] }} }} }}"
        )
    };
    runner.write("small.wrl", ground(0.1));
    runner.refused(
        &["sim", "small.sim.toml"],
        &[
            "small.venue.toml:5: homes_m: vehicle 1 starts 0.00 m from an object",
            "0.25 m",
        ],
    );
    runner.write("small.wrl", ground(0.015));
    let output = runner.run(&["sim", "small.sim.toml", "--no-pictures"]);
    assert_eq!(output.code, 0, "{output:?}");
}

#[test]
fn grids_of_a_billion_cells_are_refused() {
    let grid =
        "Shape { geometry ElevationGrid {\nxDimension 40000 zDimension 25000 height [ 0 ] } }";
    check(
        format!("{HEADER}{grid}"),
        &[
            "small.wrl:2: ",
            "40000 x 25000 = 1000000000 points",
            "at most 500000",
        ],
    );
    let holes =
        "Shape { geometry ElevationGrid { xDimension 3 zDimension 3 height [ 0 0 0 0 0 0 0 0 ] } }";
    check(
        format!("{HEADER}{holes}"),
        &["small.wrl:2: ", "8 heights; expected 3 x 3 = 9"],
    );
    let nan = holes.replace("0 ] }", "0 NaN ] }");
    check(
        format!("{HEADER}{nan}"),
        &[
            "small.wrl:2: ",
            "`NaN` for height; expected a finite number",
        ],
    );
    let runner = ProgramRunner::new();
    let fence = "fence_m = [[-3, -3], [1597, -3], [1597, 1597], [-3, 1597]]\ncell_m = 0.05\n";
    let venue: String = VENUE
        .lines()
        .map(|line| {
            if line.starts_with("fence_m") {
                fence.to_owned()
            } else {
                format!("{line}\n")
            }
        })
        .collect();
    runner.write("small.venue.toml", venue);
    for command in ["sim", "plan", "scene"] {
        runner.refused(
            &[command, "small.sim.toml"],
            &[
                "small.venue.toml:4: fence_m",
                "over 10000 cells",
                "make cell_m larger",
            ],
        );
    }
}

#[test]
fn a_view_from_nowhere_is_refused() {
    let runner = ProgramRunner::new();
    for (option, value) in [
        ("--pose", "1,2,3"),
        ("--pose", "1,2,nan,0"),
        ("--size", "0x0"),
        ("--size", "100000x100000"),
        ("--up", "w"),
    ] {
        runner.refused(
            &["scene", "small.wrl", option, value],
            &[value, option, "expected"],
        );
    }
    runner.refused(
        &["scene", "small.venue.toml"],
        &["small.venue.toml: is a venue", "expected a scene"],
    );
}

#[test]
fn bodies_of_the_scene_file_are_refused_with_key_and_line() {
    let runner = ProgramRunner::new();
    let bodies = "[[object]]\nname = \"hut\"\noutline_m = [[0, 0], [2, 2], [2, 0], [0, 2]]\n\
                  [[object]]\ncentre_m = [1, 1]\nradius_m = -1\ntop_m = -5\ncolour = \"mud\"\n";
    runner.write("small.scene.toml", format!("{SCENE}{bodies}"));
    for command in ["scene", "check"] {
        let parts = [
            "object[0].outline_m",
            "side 1 touches side 3",
            "object[1].radius_m",
            "object[1].top_m",
            "object[1].colour",
        ];
        let err = runner.refused(&[command, "small.scene.toml"], &parts);
        assert_eq!(
            err.lines()
                .filter(|line| line.contains("small.scene.toml:"))
                .count(),
            4,
            "{err}"
        );
    }
}

#[test]
fn who_walks_through_a_wall_or_over_the_fence_is_refused() {
    for (path, part) in [
        (
            "[[3.0, 4.5]]",
            "m from an object; at least the radius of 0.3 m is needed",
        ),
        ("[[1.5, 90.0]]", "outside the fence of the venue"),
    ] {
        let runner = ProgramRunner::new();
        let person = format!("[[person]]\nname = \"ada\"\nat_m = [1.5, 1.5]\npath_m = {path}\n");
        runner.write("small.scene.toml", format!("{SCENE}{person}"));
        for command in ["check", "sim"] {
            let place = "small.scene.toml:16: person[0].path_m: person ada walks at (";
            runner.refused(&[command, "small.sim.toml"], &[place, part]);
        }
    }
}

#[test]
fn homes_in_several_lines_are_named_with_their_own() {
    let runner = ProgramRunner::new();
    runner.change("small.venue.toml", "], [8.85, 8.85]", "],\n  [8.85, 8.85]");
    runner.change("small.wrl", "translation 3 3 1", "translation 8.85 8.85 1");
    runner.refused(
        &["check", "small.sim.toml"],
        &["small.venue.toml:6: homes_m: vehicle 2 starts"],
    );
}

#[test]
fn who_walks_over_a_home_is_refused() {
    let runner = ProgramRunner::new();
    let walk = |path: &str| {
        let person = format!("[[person]]\nname = \"ada\"\nat_m = [-0.9, 3.0]\npath_m = {path}\n");
        runner.write("small.scene.toml", format!("{SCENE}{person}"));
    };
    // The home of vehicle 1 lies between two places of the walk.
    walk("[[-0.9, 2.0], [-0.9, -2.0]]");
    for command in ["check", "sim"] {
        let parts = [
            "small.sim.toml:3: ",
            "ada (small.scene.toml:16) walks in the way of vehicle 1 at its home",
            "0.65 m from (-0.85, -0.85) at least",
        ];
        runner.refused(&[command, "small.sim.toml"], &parts);
    }
    walk("[[-0.9, 0.0]]");
    assert_eq!(runner.run(&["check", "small.sim.toml"]).code, 0);
}

#[test]
fn who_walks_nowhere_and_who_has_the_name_of_another_are_refused() {
    let runner = ProgramRunner::new();
    // The wall is at (3, 3).
    let persons = "[[person]]\nat_m = [3, 3]\npath_m = [[3.0, 3.0]]\n\
                   [[person]]\nname = \"ada\"\nat_m = [1, 6]\n\
                   [[person]]\nname = \"ada\"\nat_m = [6, 1]\n\
                   [[person]]\nname = \"person-5\"\nat_m = [6, 5]\n\
                   [[person]]\nat_m = [5, 6]\n";
    runner.write("small.scene.toml", format!("{SCENE}{persons}"));
    for file in ["small.scene.toml", "small.sim.toml"] {
        let parts = [
            "small.scene.toml:15: person[0].path_m = [[3.0, 3.0]]: leads nowhere; a place other than at_m is needed",
            "small.scene.toml:20: person[2].name = \"ada\": is the name of person[1] as well",
            "small.scene.toml:23: person[3].name = \"person-5\": is the name of person[4] as well",
        ];
        runner.refused(&["check", file], &parts);
    }
}

#[test]
fn who_is_never_in_the_area_that_is_imaged_is_warned_of_where_persons_are_searched_for() {
    let runner = ProgramRunner::new();
    let persons = "[[person]]\nname = \"ada\"\nat_m = [10, 4]\n\
                   [[person]]\nname = \"bob\"\nat_m = [10, 2]\npath_m = [[10, 3], [9, 3]]\n\
                   [[person]]\nname = \"cy\"\nat_m = [10, 6]\npath_m = [[6, 6]]\n";
    runner.write("small.scene.toml", format!("{SCENE}{persons}"));
    let output = runner.run(&["check", "small.sim.toml"]);
    let area =
        "outside the area that is imaged (area_m, from (0, 0) to (8, 8) m), where nobody is found";
    for expected in [
        format!("person ada at (10.00, 4.00) m stands {area}"),
        format!("person bob at (10.00, 2.00) m walks {area}"),
    ] {
        assert!(output.out.contains(&expected), "{expected}: {output:?}");
    }
    assert!(!output.out.contains("cy at"), "{output:?}");
    runner.change("small.sim.toml", "empty_sweep = true\n", "");
    let output = runner.run(&["check", "small.sim.toml"]);
    assert!(!output.out.contains("that is imaged"), "{output:?}");
}
