//! A whole live mission as one command: `sim --live` with real processes, in real time.
#![cfg(feature = "net")]

use std::path::Path;
use std::process::Command;

const CONFIG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/small.sim.toml");

/// Tells whether a process runs whose command line names a folder.
fn anybody_in(folder: &Path) -> bool {
    let named = folder.to_string_lossy().into_owned();
    let processes = std::fs::read_dir("/proc").unwrap().flatten();
    let mut lines = processes.filter_map(|process| std::fs::read(process.path().join("cmdline")).ok());
    lines.any(|line| String::from_utf8_lossy(&line).contains(&named))
}

#[test]
fn two_vehicle_processes_find_the_person_and_leave_nobody_behind() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("run");
    let mut program = Command::new(env!("CARGO_BIN_EXE_tomoswarm"));
    program.args(["sim", CONFIG, "--live", "--out"]).arg(&out);
    let done = program.output().unwrap();
    let said = format!("{}{}", String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr));
    assert!(done.status.success(), "{said}");
    let text = std::fs::read_to_string(out.join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!((&summary["finished"], &summary["collisions"]), (&true.into(), &0.into()), "{text}");
    assert_eq!(summary["fence_breaches"], 0, "{text}");
    let found = summary["found"].as_array().unwrap();
    assert!(found.iter().any(|find| find["error_m"].as_f64().unwrap() <= 1.0), "{text}");
    for name in [
        "image.png",
        "structure.png",
        "map.png",
        "image.npy",
        "structure.npy",
        "links.csv",
        "empty.csv",
        "run.log",
    ] {
        assert!(out.join(name).metadata().unwrap().len() > 0, "{name}");
    }
    for name in ["ground.toml", "vehicle-2.toml", "vehicle-2.log", "state/ground/ground.sqlite"] {
        assert!(out.join("live").join(name).exists(), "{name}");
    }
    assert!(!anybody_in(root.path()));
}
