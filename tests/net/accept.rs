//! `tomoswarm accept`: what a node takes over from a stick, what it keeps, and all that it refuses.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::trust::{good, tomoswarm, tree};

/// A swarm of a ground station and vehicles 1 and 2, and the folder of a machine.
struct Machine {
    folder: tempfile::TempDir,
}

impl Machine {
    fn new() -> Machine {
        let machine = Machine {
            folder: tempfile::tempdir().unwrap(),
        };
        for node in ["ground", "vehicle 1", "vehicle 2"] {
            machine.enroll(&format!(
                "{node} --state-dir {}",
                machine.path("state").display()
            ));
        }
        machine
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn enroll(&self, arguments: &str) {
        good(
            self.folder.path(),
            &format!("swarm --venue VENUE {arguments}"),
        );
    }

    fn accept(&self, brought: &str) -> (i32, String) {
        tomoswarm(
            self.folder.path(),
            &format!("accept {brought} --into etc/node"),
        )
    }

    fn accepts(&self, brought: &str) -> String {
        let (code, printed) = self.accept(brought);
        assert_eq!(code, 0, "{brought}: {printed}");
        printed
    }

    fn refuses(&self, brought: &str, part: &str) {
        let before = tree(self.folder.path());
        let (code, printed) = self.accept(brought);
        assert_eq!(code, 2, "{brought}: {printed}");
        assert!(printed.contains(part), "{part} is missing in: {printed}");
        assert!(
            tree(self.folder.path()) == before,
            "{brought} has changed files"
        );
    }

    /// Copies a folder as a stick would hold it.
    fn copy(&self, from: &str, to: &str) -> PathBuf {
        let to = self.path(to);
        fs::create_dir_all(&to).unwrap();
        for entry in fs::read_dir(self.path(from)).unwrap() {
            let entry = entry.unwrap();
            fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
        }
        to
    }
}

fn replace(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{from} is missing in {text}");
    fs::write(path, text.replace(from, to)).unwrap();
}

fn mode(path: &Path) -> u32 {
    fs::metadata(path).unwrap().permissions().mode() & 0o777
}

#[test]
fn a_folder_is_taken_over_with_its_modes_and_a_second_time_changes_nothing() {
    let machine = Machine::new();
    let stick = machine.copy("swarm/vehicle-1", "stick");
    fs::set_permissions(
        stick.join("vehicle.toml"),
        fs::Permissions::from_mode(0o777),
    )
    .unwrap();
    let printed = machine.accepts("stick");
    assert!(printed.contains("vehicle-1.1, roster issue 4"), "{printed}");
    let node = machine.path("etc/node");
    assert_eq!(mode(&node), 0o750);
    for (name, expected) in [
        ("key.pem", 0o600),
        ("vehicle.toml", 0o644),
        ("ca.pem", 0o644),
    ] {
        assert_eq!(mode(&node.join(name)), expected, "{name}");
    }
    for name in [
        "ca.pem",
        "certificate.pem",
        "key.pem",
        "roster.txt",
        "venue.toml",
        "vehicle.toml",
    ] {
        let read = |folder: &Path| fs::read(folder.join(name)).unwrap();
        assert_eq!(read(&node), read(&stick), "{name}");
    }
    let before = tree(machine.folder.path());
    let printed = machine.accepts("stick");
    assert!(printed.contains("is here already"), "{printed}");
    assert!(tree(machine.folder.path()) == before, "it changed files");
}

#[test]
fn a_newer_folder_replaces_the_former_which_is_kept_and_an_edited_configuration_stays() {
    let machine = Machine::new();
    machine.accepts("swarm/vehicle-1");
    let node = machine.path("etc/node");
    replace(
        &node.join("vehicle.toml"),
        "egress_kb_per_s = 64.0",
        "egress_kb_per_s = 100.0",
    );
    fs::write(node.join("mavlink.key"), "mine").unwrap();
    let former = tree(&node);
    machine.enroll("vehicle 1 --replace");
    let printed = machine.accepts("swarm/vehicle-1");
    assert!(
        printed.contains("vehicle-1.2, roster issue 5") && printed.contains("was edited here"),
        "{printed}"
    );
    let text = fs::read_to_string(node.join("vehicle.toml")).unwrap();
    assert!(text.contains("egress_kb_per_s = 100.0"), "{text}");
    assert_eq!(
        fs::read_to_string(node.join("mavlink.key")).unwrap(),
        "mine"
    );
    let contents = |tree: Vec<(String, u32, Vec<u8>)>| {
        tree.into_iter()
            .map(|(_, mode, content)| (mode, content))
            .collect::<Vec<_>>()
    };
    let kept = tree(&machine.path("etc/node.former-1"));
    assert!(
        contents(kept) == contents(former),
        "the former folder is not as it was"
    );
    // What is brought and differs lies beside.
    replace(
        &machine.path("swarm/vehicle-1/vehicle.toml"),
        "egress_kb_per_s = 64.0",
        "egress_kb_per_s = 32.0",
    );
    let printed = machine.accepts("swarm/vehicle-1");
    assert!(printed.contains("see vehicle.toml.new"), "{printed}");
    assert!(machine.path("etc/node.former-2").exists());
}

#[test]
fn a_configuration_behind_a_link_stays_and_one_that_names_a_file_in_a_folder_is_refused() {
    let machine = Machine::new();
    machine.accepts("swarm/vehicle-1");
    let (node, real) = (machine.path("etc/node"), machine.path("etc/mine.toml"));
    let config = node.join("vehicle.toml");
    fs::rename(&config, &real).unwrap();
    replace(&real, "egress_kb_per_s = 64.0", "egress_kb_per_s = 100.0");
    std::os::unix::fs::symlink(&real, &config).unwrap();
    machine.enroll("vehicle 1 --replace");
    assert!(
        machine
            .accepts("swarm/vehicle-1")
            .contains("was edited here")
    );
    let text = fs::read_to_string(&config).unwrap();
    assert!(text.contains("egress_kb_per_s = 100.0"), "{text}");
    // What lies in a folder inside is not carried over.
    fs::create_dir(node.join("places")).unwrap();
    fs::copy(node.join("venue.toml"), node.join("places/venue.toml")).unwrap();
    replace(&config, "\"venue.toml\"", "\"places/venue.toml\"");
    machine.enroll("vehicle 1 --replace");
    machine.refuses("swarm/vehicle-1", "is in a folder inside the node's");
}

#[test]
fn a_roster_alone_is_taken_over_unless_it_is_older_or_ends_this_node() {
    let machine = Machine::new();
    machine.refuses("swarm/roster.txt", "there is no node");
    machine.accepts("swarm/vehicle-1");
    fs::copy(machine.path("swarm/roster.txt"), machine.path("old.txt")).unwrap();
    machine.enroll("operator");
    assert!(
        machine
            .accepts("swarm/roster.txt")
            .contains("vehicle-1.1 has roster issue 5")
    );
    assert!(
        machine
            .accepts("swarm/roster.txt")
            .contains("issue 5 is here already")
    );
    let own = fs::read(machine.path("etc/node/roster.txt")).unwrap();
    assert_eq!(own, fs::read(machine.path("swarm/roster.txt")).unwrap());
    machine.refuses("old.txt", "is issue 4, but issue 5 was in force here");
    // A folder in which nothing else lies is the same.
    fs::create_dir(machine.path("lone")).unwrap();
    fs::copy(machine.path("old.txt"), machine.path("lone/roster.txt")).unwrap();
    machine.refuses("lone", "is issue 4, but issue 5 was in force here");
    good(machine.folder.path(), "swarm --revoke vehicle-1");
    machine.refuses(
        "swarm/roster.txt",
        "vehicle-1.1 is not in the roster (issue 6)",
    );
    fs::write(
        machine.path("lone/roster.txt"),
        "tomoswarm roster 1\nissue 99\n",
    )
    .unwrap();
    machine.refuses("lone", "not signed by the authority");
}

#[test]
fn what_belongs_elsewhere_is_refused_and_changes_nothing() {
    let machine = Machine::new();
    machine.accepts("swarm/vehicle-1");
    machine.refuses(
        "swarm/vehicle-2",
        "is of vehicle-2, but etc/node is of vehicle-1",
    );
    machine.refuses(
        "swarm/ground",
        "vehicle.toml and ground.toml; a folder is of one node",
    );
    machine.refuses("swarm", "is the folder of the authority");
    machine.refuses("gone", "cannot be read");
    machine.refuses(
        "swarm/venue.toml",
        "swarm/venue.toml: is no roster; a roster.txt",
    );
    fs::create_dir(machine.path("empty")).unwrap();
    machine.refuses("empty", "the folder of one node is expected");
    for (into, part) in [
        (
            "swarm/roster.txt",
            "swarm/roster.txt: cannot be read: Not a directory",
        ),
        ("/proc/nowhere", "/proc/nowhere: cannot be written: "),
        ("/proc/nowhere", "a folder of yours with --into"),
    ] {
        let words = format!("accept swarm/vehicle-1 --into {into}");
        let (code, printed) = tomoswarm(machine.folder.path(), &words);
        assert_eq!(code, 2, "{into}: {printed}");
        assert!(printed.contains(part), "{part} is missing in: {printed}");
    }
    good(machine.folder.path(), "other --venue VENUE vehicle 1");
    machine.refuses("other/vehicle-1", "is of another swarm");
    // Each of these is wrong in one file.
    let copy = |name: &str| machine.copy("swarm/vehicle-1", name);
    fs::set_permissions(
        copy("open").join("key.pem"),
        fs::Permissions::from_mode(0o644),
    )
    .unwrap();
    machine.refuses("open", "everyone on this machine can read the private key");
    fs::copy(
        machine.path("swarm/vehicle-2/key.pem"),
        copy("key").join("key.pem"),
    )
    .unwrap();
    machine.refuses("key", "is not the private key");
    fs::copy(
        machine.path("other/vehicle-1/certificate.pem"),
        copy("chain").join("certificate.pem"),
    )
    .unwrap();
    machine.refuses("chain", "is not signed by");
    replace(&copy("roster").join("roster.txt"), "issue 4", "issue 9");
    machine.refuses("roster", "was changed afterwards");
    replace(
        &copy("venue").join("venue.toml"),
        "cell_m = 0.2",
        "cell_m = 0.25",
    );
    machine.refuses("venue", "all nodes of a swarm share one venue");
    fs::remove_file(copy("torn").join("key.pem")).unwrap();
    machine.refuses("torn", "torn/key.pem: cannot be read");
    machine.refuses("torn", "`tomoswarm enroll` writes it");
    replace(&copy("id").join("vehicle.toml"), "id = 1", "id = 3");
    machine.refuses("id", "is of vehicle-3, but etc/node is of vehicle-1");
    replace(
        &copy("config").join("vehicle.toml"),
        "egress_kb_per_s = 64.0",
        "egress_kb_per_s = \"many\"",
    );
    machine.refuses("config", "egress_kb_per_s");
}

#[test]
fn an_older_folder_is_refused_also_when_only_the_state_remembers_the_newer_roster() {
    let machine = Machine::new();
    fs::create_dir(machine.path("state")).unwrap();
    fs::write(machine.path("state/roster-issue"), "9\n").unwrap();
    machine.refuses(
        "swarm/vehicle-1",
        "is issue 4, but issue 9 was in force here",
    );
    fs::write(machine.path("state/roster-issue"), "4\n").unwrap();
    machine.accepts("swarm/vehicle-1");
}

/// A machine whose `systemctl` is this test's: it notes what it is asked for.
struct Services {
    machine: Machine,
}

impl Services {
    fn new() -> Services {
        let services = Services {
            machine: Machine::new(),
        };
        let path = |name: &str| services.machine.path(name);
        fs::create_dir(path("programs")).unwrap();
        let script = format!(
            "#!/bin/sh\necho \"$*\" >> {asked}\n[ ! -e {fails} ] || {{ echo 'Job failed.' >&2; exit 5; }}\n",
            asked = path("asked").display(),
            fails = path("fails").display()
        );
        fs::write(path("script"), script).unwrap();
        // By a process of its own: a file that is being written, here or in what a test has begun meanwhile, does not run.
        let install = Command::new("install")
            .args(["-m", "755"])
            .args([path("script"), path("programs/systemctl")])
            .status();
        assert!(install.unwrap().success());
        services
    }

    /// Accepts with these programs alone; returns the exit code, what was said, and what systemctl was asked for since.
    fn accept(&self, brought: &str, programs: &str) -> (i32, String, String) {
        let asked = self.machine.path("asked");
        // Nobody may have asked yet.
        let _ = fs::remove_file(&asked);
        let run = Command::new(env!("CARGO_BIN_EXE_tomoswarm"))
            .args(["accept", "--into", "etc/node"])
            .args(brought.split(' '))
            .env("PATH", self.machine.path(programs))
            .current_dir(self.machine.folder.path())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&run.stdout) + String::from_utf8_lossy(&run.stderr);
        let asked = fs::read_to_string(asked).unwrap_or_default();
        (run.status.code().unwrap(), said.into_owned(), asked)
    }
}

#[test]
fn a_service_is_enabled_and_started_and_one_that_runs_is_left_alone() {
    let services = Services::new();
    let accept = |brought: &str| services.accept(brought, "programs");
    let (code, said, asked) = accept("swarm/vehicle-1");
    assert_eq!((code, asked.as_str()), (0, ""), "nobody wants it: {said}");
    // `enable --now` starts what does not run. Nothing else is asked for, also not with something new: what runs, runs on.
    let enables = "enable --now tomoswarm-vehicle\n";
    for _ in 0..2 {
        let (code, said, asked) = accept("swarm/vehicle-1 --start");
        assert_eq!((code, asked.as_str()), (0, enables), "{said}");
        assert!(said.contains("is here already"), "{said}");
    }
    services.machine.enroll("vehicle 1 --replace");
    let (code, said, asked) = accept("swarm/vehicle-1 --start");
    assert_eq!((code, asked.as_str()), (0, enables), "{said}");
    assert!(said.contains("vehicle-1.2, roster issue 5"), "{said}");
    // What is refused starts nothing.
    let (code, said, asked) = accept("swarm/vehicle-2 --start");
    assert_eq!((code, asked.as_str()), (2, ""), "{said}");
    fs::remove_dir_all(services.machine.path("etc/node")).unwrap();
    let (code, said, asked) = accept("swarm/ground --start");
    let enables = "enable --now tomoswarm-ground\n";
    assert_eq!((code, asked.as_str()), (0, enables), "{said}");
}

#[test]
fn a_service_that_does_not_start_is_exit_code_1_and_the_folder_is_taken_over_all_the_same() {
    let services = Services::new();
    fs::write(services.machine.path("fails"), "").unwrap();
    let (code, said, asked) = services.accept("swarm/vehicle-1 --start", "programs");
    assert_eq!(
        (code, asked.as_str()),
        (1, "enable --now tomoswarm-vehicle\n")
    );
    for part in [
        "is now that of vehicle-1.1",
        "Job failed.",
        "systemctl enable --now tomoswarm-vehicle: exit status: 5",
        "journalctl -u tomoswarm-vehicle says why",
    ] {
        assert!(said.contains(part), "{part} is missing in: {said}");
    }
    let (code, said, _) = services.accept("swarm/vehicle-1 --start", "no-programs");
    assert_eq!(code, 1);
    let part = "systemctl enable --now tomoswarm-vehicle: No such file or directory";
    assert!(said.contains(part), "{said}");
}

#[test]
fn an_operator_has_no_service_that_could_be_started() {
    let machine = Machine::new();
    machine.enroll("operator");
    let (code, printed) = machine.accept("swarm/operator-1 --start");
    assert_eq!(code, 2, "{printed}");
    assert!(printed.contains("an operator has no service"), "{printed}");
}
