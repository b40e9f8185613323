//! Requests to end in the middle of the work: by the user, by the system, and by force.

use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use super::program_runner::ProgramRunner;

/// A mission that takes long enough to be ended in the middle, and whether it was.
const LONG: [&str; 5] = ["sim", "small.sim.toml", "--no-pictures", "--out", "run"];

fn long_world() -> ProgramRunner {
    let runner = ProgramRunner::new();
    runner.change(
        "small.sim.toml",
        "laps = 1",
        "laps = 64\ndwell_s = 100.0\ndwell_limit_s = 3000.0",
    );
    runner.change("small.sim.toml", "until_s = 600.0", "until_s = 1000000.0");
    runner
}

fn start(runner: &ProgramRunner, arguments: &[&str]) -> Child {
    let mut program = runner.program(arguments);
    program
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

#[allow(
    clippy::disallowed_methods,
    reason = "another process cannot be waited for otherwise"
)]
fn pause() {
    std::thread::sleep(Duration::from_millis(20));
}

/// Waits until the run has opened its hidden folder, and a little more.
fn wait_for_stage(runner: &ProgramRunner) {
    let has_stage = || {
        runner
            .names_in(".")
            .iter()
            .any(|name| name.contains(".partial"))
    };
    for _ in 0..500 {
        if has_stage() {
            (0..10).for_each(|_| pause());
            return;
        }
        pause();
    }
    panic!("the run has not begun");
}

fn signal(child: &Child, name: &str) {
    assert!(
        Command::new("kill")
            .args([name, &child.id().to_string()])
            .status()
            .unwrap()
            .success()
    );
}

fn end(child: Child) -> Output {
    child.wait_with_output().unwrap()
}

fn hidden(runner: &ProgramRunner) -> Vec<String> {
    runner
        .names_in(".")
        .into_iter()
        .filter(|name| name.starts_with('.'))
        .collect()
}

#[test]
fn a_run_that_is_asked_to_end_writes_what_it_has() {
    for name in ["-INT", "-TERM", "-HUP"] {
        let runner = long_world();
        let child = start(&runner, &LONG);
        wait_for_stage(&runner);
        signal(&child, name);
        if name == "-HUP" {
            // A terminal that closes says so twice, by its kernel and its shell.
            signal(&child, name);
        }
        let Output {
            status,
            stderr,
            stdout,
        } = end(child);
        let err = String::from_utf8(stderr).unwrap();
        assert_eq!(status.code(), Some(1), "{name}: {err}");
        assert!(err.contains("asked to stop"), "{err}");
        assert!(
            String::from_utf8(stdout)
                .unwrap()
                .contains("NOT finished: it was asked to stop")
        );
        let summary: serde_json::Value =
            serde_json::from_slice(&runner.read("run/summary.json")).unwrap();
        assert_eq!(summary["finished"], false);
        assert!(runner.path("run/run.log").exists() && hidden(&runner).is_empty());
    }
}

#[test]
fn a_killed_run_leaves_only_a_hidden_folder_and_the_next_run_removes_it() {
    let runner = long_world();
    let child = start(&runner, &LONG);
    wait_for_stage(&runner);
    signal(&child, "-KILL");
    end(child);
    assert!(!runner.path("run").exists());
    assert_eq!(hidden(&runner).len(), 1, "{:?}", hidden(&runner));
    assert_eq!(
        runner
            .run(&["sim", "small.sim.toml", "--until", "5", "--out", "run"])
            .code,
        1
    );
    assert!(hidden(&runner).is_empty(), "{:?}", hidden(&runner));
}

#[test]
fn two_runs_side_by_side_do_not_disturb_each_other() {
    let runner = long_world();
    let child = start(&runner, &LONG);
    wait_for_stage(&runner);
    assert_eq!(
        runner
            .run(&["sim", "small.sim.toml", "--until", "5", "--out", "other"])
            .code,
        1
    );
    signal(&child, "-INT");
    assert_eq!(end(child).status.code(), Some(1));
    assert!(runner.path("run/summary.json").exists() && runner.path("other/summary.json").exists());
    assert!(hidden(&runner).is_empty(), "{:?}", hidden(&runner));
}

#[test]
fn an_image_that_is_ended_leaves_nothing() {
    let runner = ProgramRunner::new();
    let line = |n: u32| format!("{}.{:03},0,{}.5,20,-5{}\n", n % 20, n % 997, n % 19, n % 7);
    let lines: String = (0..20_000).map(line).collect();
    runner.write(
        "a.csv",
        format!("tx_x_m,tx_y_m,rx_x_m,rx_y_m,rssi_dbm\n{lines}"),
    );
    runner.write("i.png", "of an earlier run");
    let before = runner.files();
    let child = start(
        &runner,
        &[
            "image", "a.csv", "--pixels", "300x300", "--png", "i.png", "--json", "i.json",
        ],
    );
    (0..20).for_each(|_| pause());
    signal(&child, "-TERM");
    assert_eq!(
        end(child).status.code(),
        None,
        "it was over before it was ended"
    );
    assert_eq!(runner.files(), before);
}

#[test]
fn trials_that_are_asked_to_end_say_how_many_were_run() {
    let runner = long_world();
    let before = runner.files();
    let child = start(&runner, &["sim", "small.sim.toml", "--trials", "1000000"]);
    (0..25).for_each(|_| pause());
    signal(&child, "-INT");
    let Output {
        status,
        stderr,
        stdout,
    } = end(child);
    let err = String::from_utf8(stderr).unwrap();
    assert_eq!(status.code(), Some(1), "{err}");
    assert!(
        err.contains("asked to stop after") && err.contains("of 1000000 seeds"),
        "{err}"
    );
    assert!(
        String::from_utf8(stdout)
            .unwrap()
            .starts_with("  seed  end")
    );
    assert_eq!(runner.files(), before);
}
