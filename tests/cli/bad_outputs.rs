//! Places that cannot be written: refused before the work where it can be known, and without a trace in any case.

use super::program_runner::ProgramRunner;
#[cfg(unix)]
use super::program_runner::output_of;

const RUN: [&str; 3] = ["sim", "small.sim.toml", "--out"];

fn sim_into(runner: &ProgramRunner, folder: &str, parts: &[&str]) {
    runner.refused(&[&RUN[..], &[folder]].concat(), parts);
}

#[test]
fn a_file_in_the_way_is_refused() {
    let runner = ProgramRunner::new();
    runner.write("taken", "mine");
    sim_into(
        &runner,
        "taken",
        &["taken: cannot be written", "a folder is expected"],
    );
    sim_into(&runner, "taken/below", &["taken/below: cannot be written"]);
    sim_into(
        &runner,
        "taken/far/below",
        &["taken/far/below: cannot be written"],
    );
    sim_into(&runner, &"x".repeat(300), &["cannot be written"]);
}

#[test]
#[cfg(target_os = "linux")]
fn a_folder_that_takes_no_files_is_refused() {
    let runner = ProgramRunner::new();
    for folder in ["/proc", "/proc/run", "/dev/full", "/dev/null/run"] {
        sim_into(&runner, folder, &[folder, "cannot be written"]);
    }
    runner.write(
        "a.csv",
        "tx_x_m,tx_y_m,rx_x_m,rx_y_m,rssi_dbm\n0,0,8,8,-50\n",
    );
    for file in ["/proc/i.png", "gone/i.png", "small.wrl/i.png", ".", "/"] {
        runner.refused(&["image", "a.csv", "--png", file], &[file]);
    }
}

#[test]
#[cfg(unix)]
fn a_folder_without_permission_is_refused() {
    use std::os::unix::fs::PermissionsExt;
    let runner = ProgramRunner::new();
    let folder = runner.path("mine");
    std::fs::create_dir(&folder).unwrap();
    std::fs::set_permissions(&folder, std::fs::Permissions::from_mode(0o555)).unwrap();
    if std::fs::write(folder.join("trial"), "").is_ok() {
        let _ = std::io::Write::write_fmt(
            &mut std::io::stderr(),
            format_args!("skipped: this user may write everywhere\n"),
        );
        return;
    }
    sim_into(
        &runner,
        "mine",
        &["mine: cannot be written", "ermission denied"],
    );
    sim_into(
        &runner,
        "mine/below",
        &["mine/below: cannot be written", "ermission denied"],
    );
}

#[test]
#[cfg(unix)]
fn a_disk_that_gets_full_leaves_the_earlier_run_as_it_was() {
    let runner = ProgramRunner::new();
    assert_eq!(
        runner
            .run(&[&RUN[..], &["run", "--seed", "1"]].concat())
            .code,
        0
    );
    let before = runner.files();
    // A limit on the size of files stands for a full disk: 1 block is enough for some files, not for all.
    let mut shell = std::process::Command::new("sh");
    shell.args([
        "-c",
        "trap '' XFSZ; ulimit -f 8; exec \"$0\" sim small.sim.toml --seed 2 --out run",
    ]);
    shell
        .arg(env!("CARGO_BIN_EXE_tomoswarm"))
        .current_dir(runner.path("."));
    let output = output_of(shell);
    assert_eq!(output.code, 2, "{output:?}");
    assert!(
        output.err.contains("run/") && output.err.contains("cannot be written"),
        "{output:?}"
    );
    assert_eq!(runner.files(), before);
}

#[test]
fn a_refused_run_leaves_the_earlier_one_as_it_was() {
    let runner = ProgramRunner::new();
    let run = [&RUN[..], &["run"]].concat();
    assert_eq!(runner.run(&run).code, 0);
    runner.change("small.sim.toml", "laps = 1", "laps = 0");
    runner.refused(&run, &["small.sim.toml:9: sweep.laps = 0"]);
}

#[test]
fn a_run_takes_the_place_of_an_earlier_one_and_nothing_else() {
    let runner = ProgramRunner::new();
    let run = [&RUN[..], &["run"]].concat();
    assert_eq!(runner.run(&run).code, 0);
    runner.write("run/notes.txt", "mine");
    let all = runner.names_in("run");
    assert!(all.contains(&"image.png".to_owned()), "{all:?}");
    // Pictures of the earlier run would not belong to the figures of this one.
    assert_eq!(
        runner
            .run(&[&run[..], &["--no-pictures", "--seed", "2"]].concat())
            .code,
        0
    );
    let left: Vec<String> = all
        .into_iter()
        .filter(|name| !name.ends_with(".png"))
        .collect();
    assert_eq!(runner.names_in("run"), left);
    assert_eq!(runner.read("run/notes.txt"), b"mine");
}

#[test]
fn a_run_may_be_written_into_the_folder_where_it_stands() {
    let runner = ProgramRunner::new();
    let before: Vec<String> = runner.names_in(".");
    assert_eq!(runner.run(&[&RUN[..], &["."]].concat()).code, 0);
    let new = runner
        .names_in(".")
        .into_iter()
        .filter(|name| !before.contains(name));
    assert!(new.clone().any(|name| name == "summary.json"));
    assert!(
        new.clone().all(|name| !name.starts_with('.')),
        "{:?}",
        new.collect::<Vec<_>>()
    );
}
