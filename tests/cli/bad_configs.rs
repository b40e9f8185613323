//! Configurations with mistakes: all are listed at once, with file, line, key, value and what is allowed.

use super::program_runner::{ProgramRunner, SIM, VENUE};

#[test]
fn all_mistakes_of_all_files_are_listed_at_once() {
    let runner = ProgramRunner::new();
    runner.change("small.sim.toml", "until_s = 600.0", "until_s = -5\nsed = 3");
    runner.change("small.sim.toml", "laps = 1", "laps = 1.5");
    runner.change(
        "small.venue.toml",
        "[0.0, 0.0, 8.0, 8.0]",
        "[0.0, 0.0, -8.0, 8.0]",
    );
    runner.change("small.scene.toml", "up = \"z\"", "up = \"w\"");
    let mistakes = [
        "small.sim.toml:5: until_s = -5: is out of range; a number from 1 to",
        "small.sim.toml:6: sed: is not known; did you mean seed?",
        "small.sim.toml:10: sweep.laps = 1.5: is no such number; a whole number from 1 to",
        "small.venue.toml:3: area_m = [0.0, 0.0, -8.0, 8.0]: ",
        "small.scene.toml:4: up = \"w\": is no choice; \"y\" or \"z\" is allowed",
    ];
    for command in ["check", "sim", "plan"] {
        let err = runner.refused(&[command, "small.sim.toml"], &mistakes);
        assert_eq!(err.lines().count(), mistakes.len(), "{err}");
    }
}

#[test]
fn values_that_are_no_numbers_are_refused() {
    let runner = ProgramRunner::new();
    for value in ["nan", "inf", "\"fast\"", "[]", "true", "1e400", "0"] {
        runner.write(
            "small.sim.toml",
            format!("{SIM}\n[vehicles]\nmax_speed_mps = {value}\n"),
        );
        runner.refused(
            &["sim", "small.sim.toml"],
            &["small.sim.toml:12: vehicles.max_speed_mps", "a number from"],
        );
    }
}

#[test]
fn broken_and_deep_toml_is_refused() {
    let runner = ProgramRunner::new();
    let deep = 100_000;
    for (text, part) in [
        (String::new(), "small.sim.toml:1: kind: is missing"),
        (
            SIM[..SIM.len() - 30].to_owned(),
            "small.sim.toml:7: no valid TOML",
        ),
        (
            format!("{SIM}x = {}", "[".repeat(deep)),
            "small.sim.toml:10: no valid TOML",
        ),
        (
            format!("{SIM}x = {}", "{a=".repeat(deep)),
            "small.sim.toml:10: no valid TOML",
        ),
        (format!("{SIM}[{}b]", "a.".repeat(deep)), "no valid TOML"),
        (format!("{SIM}{SIM}"), "no valid TOML: duplicate key"),
        ("\0".repeat(1000), "no valid TOML"),
        ("x".repeat(2 << 20), "the file has 2097152 bytes; at most"),
    ] {
        runner.write("small.sim.toml", text);
        runner.refused(&["check", "small.sim.toml"], &[part]);
        runner.refused(&["sim", "small.sim.toml"], &[part]);
    }
    runner.write("small.sim.toml", b"kind = \"sim\"\n# \xff\xfe");
    runner.refused(
        &["sim", "small.sim.toml"],
        &["small.sim.toml:2: ", "UTF-8 is expected"],
    );
}

#[test]
fn files_that_are_missing_folders_or_of_another_kind_are_named() {
    let runner = ProgramRunner::new();
    for command in ["check", "sim", "plan"] {
        runner.refused(
            &[command, "gone.toml"],
            &["gone.toml: cannot be read: No such file"],
        );
        runner.refused(&[command, "."], &[".: cannot be read: is a directory"]);
        runner.refused(
            &[command, "small.sim.toml/x.toml"],
            &["small.sim.toml/x.toml: cannot be read"],
        );
    }
    runner.refused(
        &["sim", "small.venue.toml"],
        &[
            "small.venue.toml:1: kind = \"venue\"",
            "kind = \"sim\" is needed",
        ],
    );
    for (name, part) in [
        ("gone.toml", "gone.toml cannot be read: No such file"),
        (".", "cannot be read: is a directory"),
        ("small.sim.toml", "kind = \"venue\" is needed here"),
        ("small.wrl", "no valid TOML"),
    ] {
        runner.write("small.sim.toml", SIM.replace("small.venue.toml", name));
        runner.refused(&["sim", "small.sim.toml"], &[part]);
    }
}

#[test]
fn homes_must_lie_inside_the_fence_and_apart() {
    let runner = ProgramRunner::new();
    runner.write(
        "small.venue.toml",
        VENUE.replace("[-0.85, -0.85]", "[-30.0, -0.85]"),
    );
    runner.refused(
        &["sim", "small.sim.toml"],
        &[
            "small.venue.toml:5: homes_m",
            "home 1 (-30, -0.85)",
            "outside",
        ],
    );
    runner.write(
        "small.venue.toml",
        VENUE.replace("[8.85, 8.85]", "[-0.85, -0.8]"),
    );
    runner.refused(
        &["sim", "small.sim.toml"],
        &["small.venue.toml:5: homes_m", "homes 1 and 2 are too near"],
    );
    runner.write(
        "small.venue.toml",
        VENUE.replace("[11.0, 11.0], [-3.0, 11.0]", "[-3.0, 11.0], [11.0, 11.0]"),
    );
    runner.refused(
        &["sim", "small.sim.toml"],
        &["small.venue.toml:4: fence_m", "corners in order"],
    );
}

#[test]
fn a_sweep_that_cannot_be_planned_is_refused_before_it_begins() {
    let runner = ProgramRunner::new();
    runner.change("small.sim.toml", "positions = 24", "positions = 8");
    for command in ["check", "sim", "plan"] {
        runner.refused(
            &[command, "small.sim.toml"],
            &["small.sim.toml: no sweep can be planned", "at least 10"],
        );
    }
}

#[test]
fn every_file_is_looked_at_although_one_is_wrong() {
    let runner = ProgramRunner::new();
    let output = runner.run(&[
        "check",
        "gone.csv",
        "small.sim.toml",
        "small.xyz",
        "small.wrl",
    ]);
    assert_eq!(output.code, 2);
    assert!(
        output.out.contains("small.sim.toml: a simulation")
            && output.out.contains("small.wrl: shapes"),
        "{output:?}"
    );
    assert!(
        output.err.contains("gone.csv: cannot be read") && output.err.contains("small.xyz: "),
        "{output:?}"
    );
}
