//! Who gets in: certificates, the roster, and `tomoswarm enroll` from the first call to a revocation.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use tomoswarm::config::{self, Config, Identity, Topology};
use tomoswarm::run::trust::{
    Authority, Certificate, CertificateError, CommonName, Roster, RosterError, TrustError, Trusted,
    access_rules,
};
use tomoswarm_proto::{OperatorId, Sender, VehicleId};

const ROVER: Sender = Sender::Vehicle(VehicleId(3));
const OPERATOR: Sender = Sender::Operator(OperatorId(1));

fn name(text: &str) -> CommonName {
    text.parse().unwrap()
}

/// Returns a roster of the ground station and vehicle 3.
fn roster(authority: &Authority) -> Roster {
    ["ground.1", "vehicle-3.1"].into_iter().fold(
        Roster {
            issue: 1,
            ..Roster::default()
        },
        |roster, text| {
            roster
                .admitting(authority.issue(name(text), &[]).unwrap().entry)
                .unwrap()
        },
    )
}

#[test]
fn a_signed_roster_is_read_back_as_it_was() {
    let authority = Authority::create().unwrap();
    let roster = roster(&authority).revoking(ROVER).unwrap();
    let text = authority.sign(&roster).unwrap();
    assert_eq!(
        Roster::verify(&text, authority.certificate()),
        Ok(roster.clone())
    );
    assert_eq!(
        (roster.issue, roster.revoked),
        (4, vec![name("vehicle-3.1")])
    );
}

#[test]
fn a_roster_that_differs_in_any_byte_is_refused() {
    let authority = Authority::create().unwrap();
    let text = authority.sign(&roster(&authority)).unwrap();
    for at in 0..text.len() {
        let mut bytes = text.clone().into_bytes();
        bytes[at] ^= 1;
        let changed = String::from_utf8(bytes).unwrap();
        let read = Roster::verify(&changed, authority.certificate());
        assert_eq!(read, Err(RosterError::Signature), "byte {at} of {changed}");
    }
    for changed in [
        "",
        "\n",
        &format!("{text}\n"),
        &format!("\n{text}"),
        &text.replace('\n', "\r\n"),
        &text[1..],
    ] {
        assert_eq!(
            Roster::verify(changed, authority.certificate()),
            Err(RosterError::Signature),
            "{changed}"
        );
    }
    // A line of its own, with the good signature below.
    let added = text.replace("signature ", "revoked ground.1\nsignature ");
    assert_eq!(
        Roster::verify(&added, authority.certificate()),
        Err(RosterError::Signature)
    );
}

#[test]
fn a_roster_of_another_authority_or_of_a_node_is_refused() {
    let (own, other) = (Authority::create().unwrap(), Authority::create().unwrap());
    let text = other.sign(&roster(&other)).unwrap();
    assert_eq!(
        Roster::verify(&text, own.certificate()),
        Err(RosterError::Signature)
    );
    let node =
        Certificate::from_pem(&own.issue(name("ground.1"), &[]).unwrap().certificate_pem).unwrap();
    let text = own.sign(&roster(&own)).unwrap();
    assert_eq!(Roster::verify(&text, &node), Err(RosterError::Signature));
}

#[test]
fn the_issue_of_a_roster_never_goes_back() {
    let roster = Roster {
        issue: 7,
        ..Roster::default()
    };
    for seen in [None, Some(0), Some(6), Some(7)] {
        assert_eq!(roster.check_not_older(seen), Ok(()));
    }
    assert_eq!(
        roster.check_not_older(Some(8)),
        Err(RosterError::Old { found: 7, seen: 8 })
    );
}

#[test]
fn a_name_is_never_given_twice() {
    let authority = Authority::create().unwrap();
    let first = roster(&authority);
    assert_eq!(
        first.next_name(ROVER, false),
        Err(RosterError::Duplicate {
            name: name("vehicle-3.1")
        })
    );
    assert_eq!(first.next_name(ROVER, true), Ok(name("vehicle-3.2")));
    let second = first
        .admitting(authority.issue(name("vehicle-3.2"), &[]).unwrap().entry)
        .unwrap();
    assert_eq!(
        (second.allowed.len(), second.revoked.clone()),
        (2, vec![name("vehicle-3.1")])
    );
    let without = second.revoking(ROVER).unwrap();
    assert_eq!(without.next_name(ROVER, false), Ok(name("vehicle-3.3")));
    assert_eq!((first.issue, second.issue, without.issue), (3, 4, 5));
    assert!(matches!(
        without.revoking(ROVER),
        Err(RosterError::Unknown { .. })
    ));
    assert_eq!(without.next_name(OPERATOR, false), Ok(name("operator-1.1")));
}

#[test]
fn a_certificate_of_another_authority_is_refused() {
    let (own, other) = (Authority::create().unwrap(), Authority::create().unwrap());
    let read = |authority: &Authority| {
        let issued = authority
            .issue(name("vehicle-3.1"), &["rover.local".to_owned()])
            .unwrap();
        Certificate::from_pem(&issued.certificate_pem).unwrap()
    };
    let (good, foreign) = (read(&own), read(&other));
    assert_eq!(good.check_signed_by(own.certificate()), Ok(()));
    assert_eq!(good.common_name, "vehicle-3.1");
    assert_eq!(
        foreign.check_signed_by(own.certificate()),
        Err(CertificateError::Foreign)
    );
    // A node cannot enrol others.
    assert_eq!(
        foreign.check_signed_by(&good),
        Err(CertificateError::NoAuthority)
    );
    for text in [
        "",
        "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n",
        "garbage",
    ] {
        assert_eq!(Certificate::from_pem(text), Err(CertificateError::Form));
    }
    assert!(Authority::open(own.certificate_pem(), &other.key_pem()).is_err());
    assert!(own.issue(name("ground.1"), &["a b".to_owned()]).is_err());
}

#[test]
fn certificates_hold_on_a_machine_whose_clock_is_wrong() {
    let issued = Authority::create()
        .unwrap()
        .issue(name("ground.1"), &["10.0.0.7".to_owned()])
        .unwrap();
    let (_, pem) = x509_parser::pem::parse_x509_pem(issued.certificate_pem.as_bytes()).unwrap();
    let certificate = pem.parse_x509().unwrap();
    let (from, until) = (
        certificate.validity().not_before.timestamp(),
        certificate.validity().not_after.timestamp(),
    );
    // 1970-01-01 and 9999-12-31, by `date -u +%s`.
    assert_eq!((from, until), (0, 253_402_214_400));
    let usage = certificate.extended_key_usage().unwrap().unwrap().value;
    assert!(usage.server_auth && usage.client_auth && !certificate.is_ca());
    let names = format!(
        "{:?}",
        certificate
            .subject_alternative_name()
            .unwrap()
            .unwrap()
            .value
            .general_names
    );
    assert!(
        names.contains("localhost") && names.contains("[10, 0, 0, 7]"),
        "{names}"
    );
}

#[test]
fn a_node_may_write_only_its_own_keys() {
    let roster = roster(&Authority::create().unwrap());
    let rules = |topology| -> Vec<(String, Vec<String>)> {
        let rules = access_rules(&roster, "yard", topology);
        assert!(rules.iter().all(|rule| rule.reads == ["tomoswarm/yard/**"]));
        rules
            .into_iter()
            .map(|rule| (rule.common_name, rule.writes))
            .collect()
    };
    let own = |name: &str, key: &str| (name.to_owned(), vec![key.to_owned()]);
    let rover = own("vehicle-3.1", "tomoswarm/yard/vehicle/3/**");
    assert_eq!(
        rules(Topology::Mesh),
        [own("ground.1", "tomoswarm/yard/ground/**"), rover.clone()]
    );
    // In a star the ground station hands on what vehicles say.
    assert_eq!(
        rules(Topology::Star),
        [own("ground.1", "tomoswarm/yard/**"), rover]
    );
    let revoked = roster.revoking(ROVER).unwrap();
    assert_eq!(access_rules(&revoked, "yard", Topology::Mesh).len(), 1);
}

/// Runs `tomoswarm enroll` in a folder; returns its exit code and all that it said.
fn enroll(folder: &Path, arguments: &str) -> (i32, String) {
    tomoswarm(folder, &format!("enroll {arguments}"))
}

/// Runs the program in a folder; returns its exit code and all that it said.
pub fn tomoswarm(folder: &Path, arguments: &str) -> (i32, String) {
    let program = env!("CARGO_BIN_EXE_tomoswarm");
    let venue = format!(
        "{}/configs/courtyard.venue.toml",
        env!("CARGO_MANIFEST_DIR")
    );
    let words = arguments
        .split_whitespace()
        .map(|word| word.replace("VENUE", &venue));
    let run = Command::new(program)
        .args(words)
        .current_dir(folder)
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&run.stdout) + String::from_utf8_lossy(&run.stderr);
    (run.status.code().unwrap(), printed.into_owned())
}

/// Enrols in a folder; returns what is said.
pub fn good(folder: &Path, arguments: &str) -> String {
    let (code, printed) = enroll(folder, arguments);
    assert_eq!(code, 0, "{arguments}\n{printed}");
    printed
}

fn bad(folder: &Path, arguments: &str, part: &str) {
    let before = tree(folder);
    let (code, printed) = enroll(folder, arguments);
    assert_eq!(code, 2, "{arguments}\n{printed}");
    assert!(printed.contains(part), "{part} is missing in: {printed}");
    assert_eq!(tree(folder), before, "{arguments} has changed files");
}

/// Returns every file under a folder, with its mode and its content.
pub fn tree(folder: &Path) -> Vec<(String, u32, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => found.extend(tree(&path)),
            false => {
                let mode = fs::metadata(&path).unwrap().permissions().mode() & 0o777;
                found.push((path.display().to_string(), mode, fs::read(&path).unwrap()));
            }
        }
    }
    found.sort();
    found
}

fn read(path: &Path) -> Result<Config, String> {
    let mut loader = |path: &str| fs::read_to_string(path).map_err(|error| error.to_string());
    let text = fs::read_to_string(path).unwrap();
    config::read(path.to_str().unwrap(), &text, &mut loader)
        .map_err(|problems| problems.to_string())
}

fn identity(folder: &Path) -> Identity {
    let config = ["vehicle.toml", "ground.toml", "operator.toml"].map(|file| folder.join(file));
    let path = config.iter().find(|path| path.exists()).unwrap();
    let bus = match read(path).unwrap() {
        Config::Vehicle(file) => file.bus,
        Config::Ground(file) => file.bus,
        Config::Operator(file) => file.bus,
        other => panic!("{other:?}"),
    };
    bus.identity.unwrap()
}

#[test]
fn an_enrolled_node_has_all_that_it_needs_and_is_trusted() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    good(
        root,
        "swarm --venue VENUE ground --host ground.local --host 10.0.0.1 --port 7000",
    );
    good(
        root,
        "swarm --venue VENUE vehicle 3 --host rover3.local --ground-host ground.local --port 7000",
    );
    good(root, "swarm --venue VENUE operator --ground-host 10.0.0.1");
    let swarm = root.join("swarm");
    for (path, mode, _) in tree(&swarm) {
        let is_key = path.ends_with("key.pem");
        assert_eq!(mode, if is_key { 0o600 } else { 0o644 }, "{path}");
    }
    for (node, sender) in [
        ("ground", Sender::Ground),
        ("vehicle-3", ROVER),
        ("operator-1", OPERATOR),
    ] {
        let trusted = Trusted::read(&identity(&swarm.join(node)), sender, Some(4)).unwrap();
        assert_eq!(
            trusted.own,
            CommonName {
                node: sender,
                issue: 1
            }
        );
        // The rosters of those that were enrolled first are new as well.
        assert_eq!((trusted.roster.issue, trusted.roster.allowed.len()), (4, 3));
    }
    let Ok(Config::Ground(ground)) = read(&swarm.join("ground/ground.toml")) else {
        panic!("no ground")
    };
    assert_eq!(ground.vehicles, [VehicleId(3)]);
    assert_eq!(ground.bus.listen[0].to_string(), "tls/0.0.0.0:7000");
    let Ok(Config::Vehicle(rover)) = read(&swarm.join("vehicle-3/vehicle.toml")) else {
        panic!("no vehicle")
    };
    assert_eq!(rover.bus.connect[0].to_string(), "tls/ground.local:7000");
    assert_eq!(
        (rover.id, rover.state_dir.as_str()),
        (VehicleId(3), "/var/lib/tomoswarm/vehicle-3")
    );
}

#[test]
fn all_nodes_are_enrolled_in_one_call_with_one_issue_of_the_roster() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let call = "swarm --venue VENUE --ground ground.local,10.0.0.1 --vehicle 1=rover1.local --vehicle 3=rover3.local --operator";
    let printed = good(root, call);
    for line in [
        "vehicle-3.1 is enrolled, roster issue 2",
        "scp -pr swarm/vehicle-1 rover1.local: && ssh -t rover1.local sudo tomoswarm accept vehicle-1 --start",
        "tomoswarm preflight swarm/operator-1/operator.toml",
    ] {
        assert!(printed.contains(line), "{line} is missing in: {printed}");
    }
    let swarm = root.join("swarm");
    for (node, sender) in [
        ("ground", Sender::Ground),
        ("vehicle-3", ROVER),
        ("operator-1", OPERATOR),
    ] {
        let trusted = Trusted::read(&identity(&swarm.join(node)), sender, None).unwrap();
        assert_eq!((trusted.roster.issue, trusted.roster.allowed.len()), (2, 4));
    }
    let Ok(Config::Ground(ground)) = read(&swarm.join("ground/ground.toml")) else {
        panic!("no ground")
    };
    assert_eq!(ground.vehicles, [VehicleId(1), VehicleId(3)]);
    let Ok(Config::Vehicle(rover)) = read(&swarm.join("vehicle-3/vehicle.toml")) else {
        panic!("no vehicle")
    };
    assert_eq!(rover.bus.connect[0].to_string(), "tls/ground.local:7447");
    assert_eq!(
        (ground.record.limit_mb, rover.record.limit_mb),
        (10_000, 10_000),
        "a day in the field"
    );
    let Ok(Config::Operator(operator)) = read(&swarm.join("operator-1/operator.toml")) else {
        panic!("no operator")
    };
    let connects: Vec<String> = operator
        .bus
        .connect
        .iter()
        .map(ToString::to_string)
        .collect();
    assert_eq!(
        connects,
        [
            "tls/ground.local:7447",
            "tls/rover1.local:7447",
            "tls/rover3.local:7447"
        ]
    );
    // The same call again changes nothing, and one more vehicle is one more issue.
    let before = tree(&swarm);
    let printed = good(root, call);
    assert!(printed.contains("all are enrolled already, roster issue 2"));
    assert!(printed.contains("sudo tomoswarm accept vehicle-3 --start"));
    assert_eq!(tree(&swarm), before);
    // What a call that was killed left is ended by the next one: what is in force is placed, what never was is gone.
    let staged = swarm.join(".vehicle-3.new");
    fs::rename(swarm.join("vehicle-3"), &staged).unwrap();
    fs::create_dir(swarm.join(".vehicle-7.new")).unwrap();
    fs::write(swarm.join(".vehicle-7.new/key.pem"), "half").unwrap();
    good(root, call);
    assert_eq!(tree(&swarm), before);
    // A folder that was carried away is no reason to refuse the same call.
    fs::rename(swarm.join("vehicle-3"), root.join("carried")).unwrap();
    let printed = good(root, call);
    assert!(
        printed.contains("vehicle-3 has no certificate here"),
        "{printed}"
    );
    fs::rename(root.join("carried"), swarm.join("vehicle-3")).unwrap();
    bad(
        root,
        "swarm --venue VENUE vehicle 2 --host rover2.local --topology star",
        "--topology star: the swarm is a mesh",
    );
    for (options, part) in [
        (
            "vehicle 2 --host rover1.local",
            "vehicle-2 and vehicle-1 would both be reached at tls/rover1.local:7447",
        ),
        (
            "vehicle 2 --host ground.local",
            "vehicle-2 and ground would both be reached",
        ),
        (
            "vehicle 2 --host rover2.local --port 9999",
            "--port 9999: the ground station is reached at tls/ground.local:7447",
        ),
        (
            "vehicle 2 --host rover2.local --ground-host other.local",
            "--ground-host other.local: the ground station's certificate is of",
        ),
        (
            "--vehicle 1=rover1.local --port 9999",
            "--port 9999: the ground station is reached at",
        ),
        (
            "vehicle 1 --host rover1.local --replace --state-dir elsewhere",
            "not what --state-dir says",
        ),
    ] {
        bad(root, &format!("swarm --venue VENUE {options}"), part);
    }
    let printed = good(
        root,
        &format!("{call} --operator=2=laptop.local --vehicle 2=rover2.local"),
    );
    assert!(
        printed.contains("vehicle-2.1 is enrolled, roster issue 3")
            && printed.contains("operator-2.1 is enrolled, roster issue 3")
            && printed.contains(
                "scp -pr swarm/operator-2 laptop.local:, and there: tomoswarm preflight operator-2/operator.toml"
            )
            && printed.contains("scp swarm/roster.txt rover1.local: && ssh -t rover1.local sudo tomoswarm accept roster.txt")
            && !printed.contains("accept vehicle-1"),
        "{printed}"
    );
    // An operator on another machine is told to take the newer folder, and a list that was edited is left as it is.
    let own = swarm.join("operator-2/operator.toml");
    let text = fs::read_to_string(&own).unwrap();
    fs::write(&own, text.replace("tls/rover1.local", "tls/elsewhere")).unwrap();
    let printed = good(root, "swarm --venue VENUE vehicle 4 --host rover4.local");
    for line in [
        "the list `connect` of the file of operator-2 was edited: it is to end with ",
        "  scp -pr swarm/operator-2 laptop.local:\n",
    ] {
        assert!(printed.contains(line), "{line} is missing in: {printed}");
    }
    // Who is enrolled later joins as the others do, and after a revocation the lists go on being kept.
    let printed = good(root, "swarm --revoke vehicle-4");
    assert!(printed.contains("  vehicles = [1, 2, 3]\n"), "{printed}");
    let printed = good(root, "swarm --venue VENUE vehicle 5 --host rover5.local");
    assert!(!printed.contains("the file of operator-1"), "{printed}");
    let Ok(Config::Vehicle(rover)) = read(&swarm.join("vehicle-5/vehicle.toml")) else {
        panic!("no vehicle")
    };
    assert_eq!(rover.bus.connect[0].to_string(), "tls/ground.local:7447");
    let text = fs::read_to_string(swarm.join("operator-1/operator.toml")).unwrap();
    assert!(
        text.contains("rover5.local") && !text.contains("rover4.local"),
        "{text}"
    );
    let text = fs::read_to_string(swarm.join("ground/ground.toml")).unwrap();
    assert!(text.contains("vehicles = [1, 2, 3, 5]"), "{text}");
    // A folder that holds the configuration of another node is refused.
    fs::create_dir(swarm.join("operator-3")).unwrap();
    fs::copy(
        swarm.join("operator-1/operator.toml"),
        swarm.join("operator-3/operator.toml"),
    )
    .unwrap();
    bad(
        root,
        "swarm --venue VENUE operator 3",
        "is the configuration of operator-1; that of operator-3 is expected",
    );
    bad(
        root,
        "swarm --venue VENUE --ground ground.local,10.0.0.1 --vehicle 1=elsewhere.local",
        "vehicle-1 is enrolled already, with the hosts [rover1.local]",
    );
}

#[test]
fn of_a_node_whose_folder_was_carried_away_nothing_is_assumed() {
    let folder = tempfile::tempdir().unwrap();
    let (root, swarm) = (folder.path(), folder.path().join("swarm"));
    let call = "swarm --venue VENUE --ground ground.local --vehicle 1=rover1.local --port 7600 --topology star";
    good(root, call);
    fs::rename(swarm.join("vehicle-1"), root.join("carried")).unwrap();
    let printed = good(root, "swarm --venue VENUE vehicle 2 --host rover2.local");
    assert!(
        printed.contains("no certificate of vehicle-1 is here"),
        "{printed}"
    );
    // On this machine the roster is for nobody.
    assert!(
        !printed.contains("  sudo tomoswarm accept swarm/"),
        "{printed}"
    );
    for node in ["ground", "vehicle-2"] {
        fs::rename(swarm.join(node), root.join(node)).unwrap();
    }
    let next = "swarm --venue VENUE vehicle 3 --host rover3.local";
    bad(root, next, "no file in swarm says how the swarm is joined");
    let printed = good(
        root,
        &format!("{next} --topology star --port 7600 --ground-host ground.local"),
    );
    assert!(printed.contains("vehicle-3.1 is enrolled"), "{printed}");
}

#[test]
fn a_roster_that_has_not_got_to_every_folder_is_brought_there_by_the_next_call() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let first = "swarm --venue VENUE --ground ground.local --vehicle 1=rover1.local";
    good(root, first);
    let own = root.join("swarm/vehicle-1/roster.txt");
    let old = fs::read_to_string(&own).unwrap();
    let call = format!("{first} --vehicle 2=rover2.local");
    good(root, &call);
    let newest = fs::read_to_string(root.join("swarm/roster.txt")).unwrap();
    assert_ne!(newest, old);
    // As a call leaves it that is killed when it has written the authority's own.
    fs::write(&own, &old).unwrap();
    assert!(good(root, &call).contains("all are enrolled already, roster issue 3"));
    assert_eq!(fs::read_to_string(&own).unwrap(), newest);
    // Revoking is put right by the same call again, too, although nobody is left to be revoked.
    good(root, "swarm --revoke vehicle-2");
    let newest = fs::read_to_string(root.join("swarm/roster.txt")).unwrap();
    fs::write(&own, &old).unwrap();
    let (code, printed) = enroll(root, "swarm --revoke vehicle-2");
    assert!(
        code == 2 && printed.contains("is not enrolled"),
        "{printed}"
    );
    assert_eq!(fs::read_to_string(&own).unwrap(), newest);
}

#[test]
fn without_hosts_a_node_stays_on_its_machine_and_in_a_star_only_the_ground_listens() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    good(root, "swarm --venue VENUE --topology star ground");
    good(
        root,
        "swarm --venue VENUE --topology star vehicle 1 --state-dir state\"1",
    );
    let Ok(Config::Ground(ground)) = read(&root.join("swarm/ground/ground.toml")) else {
        panic!("no ground")
    };
    assert_eq!(ground.bus.listen[0].to_string(), "tls/127.0.0.1:7447");
    let Ok(Config::Vehicle(rover)) = read(&root.join("swarm/vehicle-1/vehicle.toml")) else {
        panic!("none")
    };
    assert_eq!(
        (rover.bus.listen.len(), rover.bus.topology),
        (0, Topology::Star)
    );
    assert!(
        rover.state_dir.ends_with("vehicle-1/state\"1"),
        "{}",
        rover.state_dir
    );
}

#[test]
fn a_ground_station_that_moves_is_named_where_it_is_in_the_files_of_all_others() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    good(
        root,
        "swarm --venue VENUE --ground ground.local --vehicle 1=rover1.local --vehicle 2=rover2.local --operator",
    );
    let file = |node: &str| {
        let kind = node.split('-').next().unwrap();
        root.join(format!("swarm/{node}/{kind}.toml"))
    };
    // Somebody has listed another place by hand.
    let edited = fs::read_to_string(file("vehicle-2")).unwrap();
    let edited = edited.replace("tls/ground.local:7447", "tls/10.0.0.1:7447");
    fs::write(file("vehicle-2"), &edited).unwrap();
    let printed = good(
        root,
        "swarm --venue VENUE ground --host base.local --replace",
    );
    for said in [
        "is reached at tls/base.local:7447, no more at tls/ground.local:7447: the files of vehicle-1, operator-1 say so here",
        "the list `connect` of vehicle-2 was edited",
    ] {
        assert!(printed.contains(said), "{said} in {printed}");
    }
    assert_eq!(fs::read_to_string(file("vehicle-2")).unwrap(), edited);
    for node in ["vehicle-1", "operator-1"] {
        let text = fs::read_to_string(file(node)).unwrap();
        assert!(
            text.contains("connect = [\"tls/base.local:7447\""),
            "{text}"
        );
        assert!(!text.contains("ground.local"), "{text}");
    }
    let printed = good(
        root,
        "swarm --venue VENUE ground --host base.local --replace",
    );
    assert!(!printed.contains("reached at"), "{printed}");
    // Revoked and enrolled anew elsewhere.
    good(root, "swarm --revoke ground");
    let printed = good(root, "swarm --venue VENUE --ground far.local");
    let said = "at tls/far.local:7447, no more at tls/base.local:7447";
    assert!(printed.contains(said), "{printed}");
    let text = fs::read_to_string(file("vehicle-1")).unwrap();
    assert!(text.contains("tls/far.local:7447"), "{text}");
}

#[test]
fn a_node_is_enrolled_once_replaced_and_revoked() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    good(root, "swarm --venue VENUE ground");
    good(root, "swarm --venue VENUE vehicle 3");
    bad(
        root,
        "swarm --venue VENUE vehicle 3",
        "vehicle-3.1 is enrolled already; give --replace",
    );
    let ca_key = root.join("swarm/ca-key.pem");
    fs::set_permissions(&ca_key, fs::Permissions::from_mode(0o644)).unwrap();
    bad(
        root,
        "swarm --venue VENUE vehicle 4",
        "swarm/ca-key.pem: everyone on this machine can read the private key",
    );
    fs::set_permissions(&ca_key, fs::Permissions::from_mode(0o600)).unwrap();
    let (swarm, own) = (root.join("swarm"), root.join("swarm/vehicle-3"));
    let written = fs::read_to_string(own.join("vehicle.toml")).unwrap();
    let edited = written.replace("egress_kb_per_s = 64.0", "egress_kb_per_s = 100.0");
    assert_ne!(edited, written);
    fs::write(own.join("vehicle.toml"), &edited).unwrap();
    good(root, "swarm --venue VENUE vehicle 3 --replace");
    assert_eq!(
        fs::read_to_string(own.join("vehicle.toml")).unwrap(),
        edited
    );
    let trusted = Trusted::read(&identity(&own), ROVER, None).unwrap();
    assert_eq!(
        (trusted.own, trusted.roster.issue),
        (name("vehicle-3.2"), 4)
    );
    // The former certificate is worth nothing under the newest roster.
    let former = Identity {
        roster: identity(&own).roster,
        ..identity(&swarm.join("vehicle-3.1.replaced"))
    };
    let refused = Trusted::read(&former, ROVER, None).unwrap_err();
    assert!(
        matches!(refused, TrustError::NotAllowed { issue: 4, .. }),
        "{refused}"
    );
    let printed = good(root, "swarm --revoke vehicle-3");
    assert!(printed.contains("roster issue 5"), "{printed}");
    assert!(!own.exists() && swarm.join("vehicle-3.2.revoked/key.pem").exists());
    assert_eq!(
        Trusted::read(&identity(&swarm.join("ground")), Sender::Ground, Some(5))
            .unwrap()
            .roster
            .issue,
        5
    );
    bad(
        root,
        "swarm --revoke vehicle-3",
        "vehicle-3 is not enrolled; enrolled: ground",
    );
    bad(root, "swarm --revoke rover", "rover: is no node");
    let printed = good(root, "swarm --venue VENUE vehicle 3");
    assert!(
        printed.contains("swarm/vehicle-3/vehicle.toml is new; the one that the node had before it was revoked is swarm/vehicle-3.2.revoked/vehicle.toml"),
        "{printed}"
    );
    assert_eq!(
        Trusted::read(&identity(&own), ROVER, None).unwrap().own,
        name("vehicle-3.3")
    );
}

#[test]
fn files_that_do_not_belong_together_are_refused_at_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for swarm in ["own", "other"] {
        good(root, &format!("{swarm} --venue VENUE ground"));
        good(root, &format!("{swarm} --venue VENUE vehicle 3"));
    }
    let own = identity(&root.join("own/vehicle-3"));
    let other = identity(&root.join("other/vehicle-3"));
    let ground = identity(&root.join("own/ground"));
    let refused = |identity: Identity, node, seen, part: &str| {
        let printed = Trusted::read(&identity, node, seen)
            .unwrap_err()
            .to_string();
        assert!(printed.contains(part), "{part} is missing in: {printed}");
    };
    assert!(Trusted::read(&own, ROVER, None).is_ok());
    refused(
        other.clone(),
        Sender::Ground,
        None,
        "is of \"vehicle-3.1\", not of ground",
    );
    refused(
        Identity {
            certificate: other.certificate.clone(),
            ..own.clone()
        },
        ROVER,
        None,
        "is not signed by",
    );
    refused(
        Identity {
            roster: other.roster.clone(),
            ..own.clone()
        },
        ROVER,
        None,
        "is not signed by",
    );
    refused(
        Identity {
            ca: other.ca.clone(),
            ..own.clone()
        },
        ROVER,
        None,
        "is not signed by",
    );
    refused(
        Identity {
            ca: own.certificate.clone(),
            ..own.clone()
        },
        ROVER,
        None,
        "is no authority's",
    );
    refused(
        Identity {
            key: ground.key.clone(),
            ..own.clone()
        },
        ROVER,
        None,
        "is not the private key",
    );
    refused(
        Identity {
            key: own.ca.clone(),
            ..own.clone()
        },
        ROVER,
        None,
        "everyone on this machine can read",
    );
    refused(
        Identity {
            key: format!("{}.gone", own.key),
            ..own.clone()
        },
        ROVER,
        None,
        "cannot be read",
    );
    refused(
        own,
        ROVER,
        Some(9),
        "is issue 3, but issue 9 was in force here",
    );
}

#[test]
fn bad_usage_leaves_no_trace() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for (arguments, part) in [
        ("swarm --venue VENUE", "required"),
        ("swarm vehicle 1", "--venue"),
        ("swarm --venue VENUE vehicle", "its number is missing"),
        ("swarm --venue VENUE vehicle 0", "0 is not in 1..=255"),
        (
            "swarm --venue VENUE vehicle 9",
            "vehicle 9: has no home, the venue has 8",
        ),
        (
            "swarm --venue VENUE ground 1",
            "there is one ground station, which has no number",
        ),
        (
            "swarm --venue VENUE vehicle 251",
            "vehicles have numbers from 1 to 250",
        ),
        ("swarm --venue VENUE operator 0", "0 is not in 1..=255"),
        (
            "swarm --venue VENUE --operator=x",
            "N or N=HOST is expected, N from 1 to 255",
        ),
        (
            "swarm --venue VENUE --operator=0",
            "N or N=HOST is expected, N from 1 to 255",
        ),
        ("swarm --venue VENUE --operator=2=", "\"\": is no host"),
        (
            "swarm --venue VENUE --operator --operator=1",
            "operator-1 is given twice",
        ),
        ("swarm --venue VENUE pilot", "invalid value 'pilot'"),
        (
            "swarm --venue VENUE --ground base.local --vehicle 1=pi.local --vehicle 2=pi.local",
            "vehicle-2 and vehicle-1 would both be reached at tls/pi.local:7447",
        ),
        (
            "swarm --venue VENUE vehicle 1 --host rover1.local",
            "vehicle-1 is on another machine (rover1.local), where 127.0.0.1 is that machine itself",
        ),
        (
            "swarm --venue VENUE ground --host a..b",
            "--host \"a..b\": is no host",
        ),
        (
            "swarm --venue VENUE ground --ground-host tls/x:1",
            "--ground-host \"tls/x:1\": is no host",
        ),
        (
            "swarm --venue VENUE ground --port 0",
            "0 is not in 1..=65535",
        ),
        (
            "swarm --venue gone.toml ground",
            "gone.toml: cannot be read",
        ),
        ("swarm --revoke ground", "cannot be read"),
        (
            "swarm --venue VENUE --vehicle 0=a",
            "N=HOST is expected, N from 1 to 250",
        ),
        ("swarm --venue VENUE --vehicle 1=a,", "\"\": is no host"),
        (
            "swarm --venue VENUE --vehicle 1=a --vehicle 1=b",
            "vehicle-1 is given twice",
        ),
        (
            "swarm --venue VENUE --ground a vehicle 1",
            "cannot be used with",
        ),
    ] {
        bad(root, arguments, part);
        assert!(!root.join("swarm").exists(), "{arguments}");
    }
    fs::create_dir(root.join("full")).unwrap();
    fs::write(root.join("full/mine.txt"), "mine").unwrap();
    bad(root, "full --venue VENUE ground", "is no folder of a swarm");
}

#[test]
fn a_swarm_has_one_venue_and_its_own_files() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    good(root, "swarm --venue VENUE ground");
    let venue = fs::read_to_string(root.join("swarm/venue.toml")).unwrap();
    fs::write(
        root.join("other.toml"),
        venue.replace("cell_m = 0.2", "cell_m = 0.25"),
    )
    .unwrap();
    bad(
        root,
        "swarm --venue other.toml vehicle 1",
        "all nodes of a swarm share one venue",
    );
    let roster = root.join("swarm/roster.txt");
    let text = fs::read_to_string(&roster).unwrap();
    fs::write(&roster, text.replace("issue 2", "issue 1")).unwrap();
    bad(
        root,
        "swarm --venue VENUE vehicle 1",
        "was changed afterwards",
    );
}

#[test]
fn a_node_that_stays_with_its_file_moves_only_where_that_file_would_do() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    good(
        root,
        "swarm --venue VENUE --ground 127.0.0.1 --vehicle 1=127.0.0.1 --operator",
    );
    bad(
        root,
        "swarm --venue VENUE ground --host base.local --replace",
        "ground.toml: listens at tls/127.0.0.1:7447 alone, where nobody reaches base.local",
    );
    bad(
        root,
        "swarm --venue VENUE vehicle 1 --host rover1.local --replace",
        "127.0.0.1",
    );
    // A vehicle of the ground station's own machine takes any port there.
    good(
        root,
        "other --venue VENUE --ground base.local --vehicle 1=127.0.0.1 --vehicle 2=127.0.0.1",
    );
    let Ok(Config::Vehicle(rover)) = read(&root.join("other/vehicle-2/vehicle.toml")) else {
        panic!("no vehicle")
    };
    assert_eq!(rover.bus.listen[0].port, 0);
    assert_eq!(rover.bus.connect[0].to_string(), "tls/base.local:7447");
}

#[test]
fn what_a_call_has_not_got_to_the_next_one_does() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let first = "swarm --venue VENUE --ground ground.local --vehicle 1=rover1.local --operator";
    good(root, first);
    let swarm = root.join("swarm");
    let lists = ["ground/ground.toml", "operator-1/operator.toml"].map(|file| swarm.join(file));
    let before = lists.each_ref().map(|path| fs::read(path).unwrap());
    let call = format!("{first} --vehicle 3=rover3.local");
    good(root, &call);
    let after = tree(&swarm);
    // As the folder is when that call is killed once its roster is in force.
    let left = |issue: u64, more: &str| {
        let text = format!(
            "{{\"issue\":{issue},\"vehicles\":[1{more}],\"reached\":[\"tls/rover1.local:7447\"],\
             \"ground\":\"tls/ground.local:7447\",\"revoked\":\"vehicle-3\"}}"
        );
        fs::write(swarm.join(".lists-before.json"), text).unwrap();
    };
    for (path, text) in lists.iter().zip(&before) {
        fs::write(path, text).unwrap();
    }
    left(3, "");
    let printed = good(root, &call);
    for part in [
        "the call before was interrupted",
        "the ground station plans for who is in its file",
        "all are enrolled already, roster issue 3",
    ] {
        assert!(printed.contains(part), "{part} is missing in: {printed}");
    }
    assert_eq!(tree(&swarm), after);
    // What was never in force is forgotten.
    left(4, "");
    assert!(!good(root, &call).contains("interrupted"));
    assert_eq!(tree(&swarm), after);
    good(root, "swarm --revoke vehicle-3");
    let revoked = tree(&swarm);
    fs::rename(swarm.join("vehicle-3.1.revoked"), swarm.join("vehicle-3")).unwrap();
    left(4, ",3");
    let printed = good(root, "swarm --revoke vehicle-3");
    assert!(printed.contains("vehicle-3 is revoked"), "{printed}");
    assert_eq!(tree(&swarm), revoked);
    bad(root, "swarm --revoke vehicle-3", "is not enrolled");
}
