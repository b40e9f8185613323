//! Files and folders whose names are no UTF-8, and paths of all kinds.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStrExt;

use super::program_runner::ProgramRunner;

fn name(ending: &str) -> OsString {
    let mut name = OsStr::from_bytes(b"odd\xff\xfe").to_owned();
    name.push(ending);
    name
}

fn arguments<'a>(list: &[&'a dyn AsRef<OsStr>]) -> Vec<&'a OsStr> {
    list.iter().map(|argument| (*argument).as_ref()).collect()
}

#[test]
fn a_configuration_may_have_a_name_that_is_no_text() {
    let runner = ProgramRunner::new();
    std::fs::rename(
        runner.path("small.sim.toml"),
        runner.path(name(".sim.toml")),
    )
    .unwrap();
    for command in ["check", "plan"] {
        assert_eq!(
            runner.run(&arguments(&[&command, &name(".sim.toml")])).code,
            0
        );
    }
    let output = runner.run(&arguments(&[
        &"sim",
        &name(".sim.toml"),
        &"--out",
        &name(""),
    ]));
    assert_eq!(output.code, 0, "{output:?}");
    assert!(runner.path(name("")).join("summary.json").exists());
}

#[test]
fn a_folder_may_have_a_name_that_is_no_text() {
    let runner = ProgramRunner::new();
    let folder = runner.path(name(""));
    std::fs::create_dir(&folder).unwrap();
    for file in runner
        .names_in(".")
        .iter()
        .filter(|file| file.starts_with("small"))
    {
        std::fs::rename(runner.path(file), folder.join(file)).unwrap();
    }
    for file in [
        "small.sim.toml",
        "small.scene.toml",
        "small.venue.toml",
        "small.wrl",
    ] {
        let output = runner.run(&arguments(&[&"check", &folder.join(file)]));
        assert_eq!(output.code, 0, "{output:?}");
    }
    let mut from_inside = runner.program(&["plan", "small.sim.toml"]);
    from_inside.current_dir(&folder);
    assert_eq!(super::program_runner::output_of(from_inside).code, 0);
}

#[test]
fn a_missing_file_without_a_text_name_is_named() {
    let runner = ProgramRunner::new();
    for command in ["check", "plan", "sim"] {
        runner.refused(
            &arguments(&[&command, &name(".toml")]),
            &["odd", ".toml: cannot be read: No such file"],
        );
    }
    runner.refused(
        &arguments(&[&"image", &name(".csv")]),
        &["odd", ".csv: ", "No such file"],
    );
    runner.refused(
        &arguments(&[&OsStr::from_bytes(b"\xff")]),
        &["unrecognized subcommand"],
    );
}
