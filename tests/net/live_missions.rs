//! A whole live mission as one command: `sim --live` with real processes, in real time.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

const CONFIG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/small.sim.toml");

/// Returns all processes with their command lines.
fn processes() -> Vec<(i32, String)> {
    let all = std::fs::read_dir("/proc").unwrap().flatten();
    let process = |entry: std::fs::DirEntry| {
        let line = std::fs::read(entry.path().join("cmdline")).ok()?;
        let pid = entry.file_name().to_str()?.parse().ok()?;
        Some((pid, String::from_utf8_lossy(&line).into_owned()))
    };
    all.filter_map(process).collect()
}

/// Returns whether a process runs whose command line names a folder.
fn anybody_in(folder: &Path) -> bool {
    let named = folder.to_string_lossy().into_owned();
    processes().iter().any(|(_, line)| line.contains(&named))
}

#[test]
fn two_vehicle_processes_find_the_person_and_leave_nobody_behind() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("run");
    let mut program = Command::new(env!("CARGO_BIN_EXE_tomoswarm"));
    program.args(["sim", CONFIG, "--live", "--out"]).arg(&out);
    let done = program.output().unwrap();
    let printed = format!(
        "{}{}",
        String::from_utf8_lossy(&done.stdout),
        String::from_utf8_lossy(&done.stderr)
    );
    assert!(done.status.success(), "{printed}");
    let text = std::fs::read_to_string(out.join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(
        (&summary["finished"], &summary["collisions"]),
        (&true.into(), &0.into()),
        "{text}"
    );
    assert_eq!(summary["fence_breaches"], 0, "{text}");
    let found = summary["found"].as_array().unwrap();
    assert!(
        found
            .iter()
            .any(|find| find["error_m"].as_f64().unwrap() <= 1.0),
        "{text}"
    );
    for name in [
        "image.png",
        "structure.png",
        "coverage.png",
        "links.png",
        "residuals.png",
        "deviation.png",
        "map.png",
        "image.npy",
        "structure.npy",
        "links.csv",
        "empty.csv",
        "run.log",
    ] {
        assert!(out.join(name).metadata().unwrap().len() > 0, "{name}");
    }
    for name in [
        "ground.toml",
        "vehicle-2.toml",
        "vehicle-2.log",
        "state/ground/ground.sqlite",
    ] {
        assert!(out.join("live").join(name).exists(), "{name}");
    }
    assert!(!anybody_in(root.path()));
}

/// A mission of its own in the yard of the short mission, that lasts long enough for a vehicle to be killed under way.
fn exploring(folder: &Path) -> std::path::PathBuf {
    let configs = concat!(env!("CARGO_MANIFEST_DIR"), "/configs");
    let short = std::fs::read_to_string(CONFIG).unwrap();
    let of_yard =
        |name: &str| short.replace(&format!("\"{name}\""), &format!("\"{configs}/{name}\""));
    let text = of_yard("small.venue.toml").replace(
        "\"small.scene.toml\"",
        &format!("\"{configs}/small.scene.toml\""),
    );
    let text = text
        .replace("empty_sweep = true\n", "")
        .replace("end = \"hold\"\n", "")
        .replace("slot_ms = 20.0\n", "slot_ms = 40.0\n");
    let path = folder.join("explore.sim.toml");
    std::fs::write(&path, format!("{text}\n[mission]\nkind = \"explore\"\n")).unwrap();
    path
}

#[test]
fn slots_that_are_too_short_for_xbees_are_refused_before_anything_begins() {
    let root = tempfile::tempdir().unwrap();
    let mut program = Command::new(env!("CARGO_BIN_EXE_tomoswarm"));
    program.args(["sim", CONFIG, "--live", "--xbee", "--out"]);
    let refused = program.arg(root.path().join("run")).output().unwrap();
    assert_eq!(refused.status.code(), Some(2));
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(
        said.contains("--xbee: found slots of 20 ms, expected slot_ms of at least 40"),
        "{said}"
    );
    assert_eq!(root.path().read_dir().unwrap().count(), 0);
}

#[test]
fn a_mission_of_their_own_runs_live_with_xbees_and_a_vehicle_that_is_killed_is_started_again_and_ends_it()
 {
    let root = tempfile::tempdir().unwrap();
    let (out, config) = (root.path().join("run"), exploring(root.path()));
    let mut program = Command::new(env!("CARGO_BIN_EXE_tomoswarm"));
    program
        .arg("sim")
        .arg(&config)
        .args(["--live", "--xbee", "--out"])
        .arg(&out);
    let running = program
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    let killed = std::iter::repeat_with(|| {
        std::thread::sleep(Duration::from_millis(100));
        assert!(
            begun.elapsed() < Duration::from_secs(60),
            "vehicle 2 does not begin"
        );
        // The folder has another name until the run is over.
        let of_two = |text: &str| {
            text.contains("vehicle-2.toml") && text.contains(root.path().to_str().unwrap())
        };
        processes()
            .into_iter()
            .find(|(_, line)| of_two(line))
            .map(|(pid, _)| pid)
    });
    let killed = killed.take(600).flatten().next().unwrap();
    std::thread::sleep(Duration::from_secs(8));
    kill_process(Pid::from_raw(killed).unwrap(), Signal::KILL).unwrap();
    let done = running.wait_with_output().unwrap();
    let printed = format!(
        "{}{}",
        String::from_utf8_lossy(&done.stdout),
        String::from_utf8_lossy(&done.stderr)
    );
    assert!(done.status.success(), "{printed}");
    assert!(
        printed.contains("vehicle-2 has ended: signal: 9"),
        "{printed}"
    );
    let text = std::fs::read_to_string(out.join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(
        (&summary["finished"], &summary["collisions"]),
        (&true.into(), &0.into()),
        "{text}"
    );
    assert_eq!(summary["missions"].as_array().unwrap().len(), 2, "{text}");
    let log = std::fs::read_to_string(out.join("run.log")).unwrap();
    assert!(log.contains("vehicle-2 is started again"), "{log}");
    for words in [
        "vehicle 1 its mission has ended: done",
        "vehicle 2 its mission has ended: done",
    ] {
        assert!(log.contains(words), "{log}");
    }
    let asked = std::fs::read_to_string(out.join("live/vehicle-1.log")).unwrap();
    assert!(asked.contains("radio xbee"), "{asked}");
    assert!(!anybody_in(root.path()));
}
