//! What the package says that it is, what its own script asks of the machine after an installation and after an upgrade, and
//! what its other script leaves of nodes after a purge.

use std::fs;
use std::path::Path;
use std::process::Command;

use super::program_runner::ProgramRunner;

/// Runs `postinst configure FORMER` on a machine whose services run; returns what it asks of udev and systemd, and what it
/// says. `former` is the version that was installed before, empty the first time.
fn configure(folder: &Path, former: &str) -> (Vec<String>, String) {
    let systemd = folder.join("systemd");
    let asked = folder.join("asked");
    let programs = folder.join("programs");
    for made in [&systemd, &programs] {
        fs::create_dir_all(made).unwrap();
    }
    fs::write(&asked, "").unwrap();
    let note = format!("#!/bin/sh\necho \"${{0##*/}} $*\" >> {}\n", asked.display());
    fs::write(folder.join("note"), note).unwrap();
    for program in ["udevadm", "systemctl"] {
        // By a process of its own: a file that is being written, here or in what a test has begun meanwhile, does not run.
        let mut install = Command::new("install");
        install.args(["-m", "755"]);
        install.args([folder.join("note"), programs.join(program)]);
        assert!(install.status().unwrap().success());
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/deploy/debian/postinst");
    let script = fs::read_to_string(script).unwrap();
    assert!(script.contains("/run/systemd/system"));
    let script = script.replace("/run/systemd/system", systemd.to_str().unwrap());
    let path = format!("{}:/usr/bin:/bin", programs.display());
    let run = Command::new("sh")
        .args(["-c", &script, "postinst", "configure", former])
        .env("PATH", path)
        .output()
        .unwrap();
    assert!(run.status.success(), "{run:?}");
    let asked = fs::read_to_string(&asked).unwrap();
    let said = String::from_utf8_lossy(&run.stdout).into_owned();
    (asked.lines().map(str::to_owned).collect(), said)
}

#[test]
fn devices_are_named_anew_at_the_first_installation_and_left_alone_by_an_upgrade() {
    let folder = tempfile::tempdir().unwrap();
    let (first, said) = configure(folder.path(), "");
    let triggers = |asked: &[String]| {
        let is_trigger = |line: &&String| line.starts_with("udevadm trigger --action=add");
        asked.iter().filter(is_trigger).count()
    };
    assert_eq!(triggers(&first), 1, "{first:?}");
    assert_eq!(said, "");
    let (upgrade, said) = configure(folder.path(), "0.1.0-1+git1.abcdef0");
    assert_eq!(triggers(&upgrade), 0, "{upgrade:?}");
    for asked in [&first, &upgrade] {
        let changes = |word: &str| asked.iter().any(|line| line.contains(word));
        assert!(asked.contains(&"udevadm control --reload".to_owned()));
        assert!(asked.contains(&"systemctl daemon-reload".to_owned()));
        let touches = [" start", " stop", " restart", " enable", " kill"];
        assert!(!touches.into_iter().any(changes), "{asked:?}");
    }
    for unit in ["tomoswarm-vehicle", "tomoswarm-ground"] {
        let expected = format!("{unit} runs on with the former program until");
        assert!(said.contains(&expected), "{said}");
    }
}

/// Runs `postrm purge` where nodes have their folders below `state` and `etc`; returns what it says, line by line.
fn purge(state: &Path, etc: &Path) -> Vec<String> {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/deploy/debian/postrm");
    let mut script = fs::read_to_string(script).unwrap();
    for (named, own) in [("/var/lib/tomoswarm", state), ("/etc/tomoswarm", etc)] {
        assert!(script.contains(named));
        script = script.replace(named, own.to_str().unwrap());
    }
    let run = Command::new("sh")
        .args(["-c", &script, "postrm", "purge"])
        .output()
        .unwrap();
    assert!(run.status.success() && run.stderr.is_empty(), "{run:?}");
    let said = String::from_utf8_lossy(&run.stdout).into_owned();
    said.lines().map(str::to_owned).collect()
}

/// Writes files below a folder.
fn write_all(folder: &Path, files: &[&str]) {
    for file in files {
        let file = folder.join(file);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(file, "1").unwrap();
    }
}

/// Returns the files below a folder, in order.
fn files_below(folder: &Path) -> Vec<String> {
    let (mut files, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => folders.push(path),
                false => {
                    let below = path.strip_prefix(folder).unwrap();
                    files.push(below.to_str().unwrap().to_owned());
                }
            }
        }
    }
    files.sort_unstable();
    files
}

#[test]
fn a_purge_keeps_what_was_not_delivered_names_it_and_deletes_the_rest() {
    let folder = tempfile::tempdir().unwrap();
    let (state, etc) = (folder.path().join("state"), folder.path().join("etc"));
    let kept = [
        "ground/boot",
        "ground/flight/flight-000001.mcap",
        "ground/ground.sqlite",
        "ground/ground.sqlite-wal",
        "vehicle 2/boot",
        "vehicle 2/outbox.sqlite",
        "vehicle 2/outbox.sqlite-wal",
        "vehicle-1/flight/flight-000001.mcap",
        "vehicle-1/flight/flight-000002.mcap",
    ];
    write_all(&state, &kept);
    write_all(
        &state,
        &[
            "ground/memory",
            "vehicle 2/memory",
            "vehicle-1/boot",
            "vehicle-1/memory",
            "vehicle-1/reserve",
            "vehicle-3/boot",
            "vehicle-3/memory",
        ],
    );
    write_all(&etc, &["vehicle.toml"]);
    let said = purge(&state, &etc);
    assert_eq!(files_below(&state), kept);
    assert!(!state.join("vehicle-3").exists(), "nothing is left in it");
    assert!(etc.join("vehicle.toml").exists());
    let kept = |path: &str| format!("tomoswarm: kept {}/{path}", state.display());
    let undelivered = ": samples that were not delivered may be in it";
    assert_eq!(
        said,
        [
            kept("vehicle 2/outbox.sqlite") + undelivered,
            kept("ground/ground.sqlite"),
            kept("ground/flight"),
            kept("vehicle-1/flight"),
            format!("tomoswarm: kept {}", etc.display()),
        ]
    );
    let files = files_below(&state);
    assert_eq!(purge(&state, &etc), said, "a second time the same");
    assert_eq!(files_below(&state), files);
}

#[test]
fn a_purge_names_nothing_where_all_was_delivered_or_no_node_ever_ran() {
    let folder = tempfile::tempdir().unwrap();
    let (state, etc) = (folder.path().join("state"), folder.path().join("etc"));
    assert_eq!(purge(&state, &etc), [""; 0]);
    write_all(&state, &["vehicle-1/boot", "vehicle-1/memory"]);
    fs::create_dir_all(state.join("vehicle-1/flight")).unwrap();
    assert_eq!(purge(&state, &etc), [""; 0]);
    assert!(!state.exists(), "nothing is left");
}

#[test]
fn the_program_says_which_build_it_is_and_a_build_that_was_not_told_says_its_version_alone() {
    let told = option_env!("TOMOSWARM_BUILD").filter(|build| !build.is_empty());
    let expected = told.unwrap_or(env!("CARGO_PKG_VERSION"));
    let said = ProgramRunner::new().run(&["--version"]);
    assert_eq!(
        (said.code, said.out),
        (0, format!("tomoswarm {expected}\n"))
    );
}

#[test]
fn a_package_and_its_program_say_the_same_version() {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/deploy/build-deb");
    let script = fs::read_to_string(script).unwrap();
    let begin = script.find("release=").unwrap();
    let end = script.find("export TOMOSWARM_BUILD=").unwrap();
    let end = end + script[end..].find('\n').unwrap();
    let says = format!(
        "set -euo pipefail\n{}\necho \"$version $TOMOSWARM_BUILD\"\n",
        &script[begin..end]
    );
    let run = Command::new("bash")
        .args(["-c", &says])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(run.status.success(), "{run:?}");
    let said = String::from_utf8(run.stdout).unwrap();
    let (package, program) = said.trim().split_once(' ').unwrap();
    let release = env!("CARGO_PKG_VERSION");
    let of_package = package.strip_prefix(&format!("{release}-1")).unwrap();
    assert_eq!(program.strip_prefix(release), Some(of_package), "{said}");
    assert!(
        of_package.is_empty() || of_package.starts_with("+git"),
        "{said}"
    );
    assert!(program.len() <= 64, "{said}");
}
