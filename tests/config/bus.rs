//! The `[bus]` of a node's file: what is let out of a machine, and every mistake that would let more out.

use std::time::Duration;

use tomoswarm::config::{self, BusFile, Config, Topology, bundled};

const IDENTITY: &str = "\
ca = \"ca.pem\"
certificate = \"certificate.pem\"
key = \"/etc/key.pem\"
roster = \"roster.txt\"
";

fn text_of(role: &str, lines: &str) -> String {
    let own = match role {
        "vehicle" => {
            "id = 1
state_dir = \"s\"
autopilot.driver = \"sim\"
range.driver = \"sim\"
servo.driver = \"sim\"
radio.driver = \"sim\"
world = { connect = \"127.0.0.1:7500\", token = \"0123456789abcdef\" }
"
        }
        "ground" => "state_dir = \"s\"\nvehicles = [1]\n",
        _ => "",
    };
    format!("kind = \"{role}\"\nvenue = \"courtyard.venue.toml\"\n{own}[bus]\n{lines}")
}

fn read(role: &str, lines: &str) -> Result<BusFile, String> {
    let read = config::read("configs/x.toml", &text_of(role, lines), &mut |path| {
        bundled::load(path)
    });
    match read.map_err(|problems| problems.to_string())? {
        Config::Vehicle(file) => Ok(file.bus),
        Config::Ground(file) => Ok(file.bus),
        Config::Operator(file) => Ok(file.bus),
        other => Err(format!("{other:?}")),
    }
}

fn good(role: &str, lines: &str) -> BusFile {
    read(role, lines).unwrap_or_else(|output| panic!("{output}\n{lines}"))
}

/// Checks that one thing is said, with all these parts.
fn bad(role: &str, lines: &str, parts: &[&str]) {
    let output =
        read(role, lines).map_or_else(|output| output, |bus| panic!("accepted {bus:?}\n{lines}"));
    assert_eq!(output.lines().count(), 1, "{lines}\n{output}");
    for part in parts {
        assert!(
            output.contains(part),
            "{part} is missing in: {output}\n{lines}"
        );
    }
}

fn shown(list: &[config::Endpoint]) -> Vec<String> {
    list.iter().map(ToString::to_string).collect()
}

#[test]
fn what_is_left_out_stays_on_this_machine() {
    let bus = good("ground", "");
    assert_eq!(shown(&bus.listen), ["tcp/127.0.0.1:7447"]);
    assert_eq!(
        (bus.topology, bus.connect.len(), bus.identity.is_some()),
        (Topology::Mesh, 0, false)
    );
    assert_eq!(
        (bus.egress_kb_per_s, bus.lease()),
        (64.0, Duration::from_secs(3))
    );
    assert!(!bus.unprotected_network && bus.gossip);
    assert!(!good("vehicle", "gossip = false").gossip);
    assert_eq!(shown(&good("vehicle", "").listen), ["tcp/127.0.0.1:0"]);
    assert_eq!(
        shown(&good("ground", IDENTITY).listen),
        ["tls/127.0.0.1:7447"]
    );
    let star = good(
        "vehicle",
        "topology = \"star\"\nconnect = [\"tcp/[::1]:7447\"]",
    );
    assert_eq!(
        (star.listen.len(), shown(&star.connect)),
        (0, vec!["tcp/[::1]:7447".to_owned()])
    );
}

#[test]
fn certificates_lie_beside_the_file() {
    let identity = good("ground", IDENTITY).identity.unwrap();
    assert_eq!(
        (identity.ca.as_str(), identity.key.as_str()),
        ("configs/ca.pem", "/etc/key.pem")
    );
    assert_eq!(identity.certificate, "configs/certificate.pem");
    assert_eq!(identity.roster, "configs/roster.txt");
}

#[test]
fn certificates_come_all_together_or_not_at_all() {
    for line in IDENTITY.lines() {
        let key = line.split(' ').next().unwrap();
        let without: String = IDENTITY
            .lines()
            .filter(|other| *other != line)
            .fold(String::new(), |a, b| a + b + "\n");
        bad(
            "ground",
            &without,
            &[&format!("bus.{key}: is missing"), "tomoswarm enroll"],
        );
        let wrong = IDENTITY.replace(line, &format!("{key} = 1"));
        bad("ground", &wrong, &[&format!("bus.{key} = 1: is no text")]);
    }
}

#[test]
fn without_certificates_nothing_leaves_the_machine_unless_told_in_so_many_words() {
    for (key, endpoint) in [
        ("listen", "tcp/0.0.0.0:7447"),
        ("listen", "tcp/[::]:7447"),
        ("connect", "tcp/10.0.0.2:7447"),
        ("connect", "tcp/ground.local:7447"),
    ] {
        let lines = format!("{key} = [\"{endpoint}\"]\n");
        bad(
            "vehicle",
            &lines,
            &[
                &format!("bus.{key} = "),
                endpoint,
                "leaves this machine",
                "without certificates a node binds and connects to loopback (127.0.0.1, ::1, localhost) only",
                "unprotected_network = true",
            ],
        );
        let told = good("vehicle", &format!("{lines}unprotected_network = true\n"));
        assert!(told.unprotected_network && told.identity.is_none());
    }
    good(
        "vehicle",
        "connect = [\"tcp/localhost:7447\", \"tcp/127.0.0.2:7447\"]",
    );
}

#[test]
fn certificates_and_endpoints_go_together() {
    let with = |lines: &str| format!("{IDENTITY}{lines}");
    let tls = "listen = [\"tls/0.0.0.0:7447\"]\nconnect = [\"tls/ground:7447\"]\n";
    assert_eq!(
        shown(&good("vehicle", &with(tls)).connect),
        ["tls/ground:7447"]
    );
    bad(
        "vehicle",
        &with("listen = [\"tcp/127.0.0.1:1\"]"),
        &["bus.listen", "unprotected although certificates"],
    );
    bad(
        "vehicle",
        &with("connect = [\"tcp/127.0.0.1:1\"]"),
        &["bus.connect", "tls/HOST:PORT is needed"],
    );
    bad(
        "vehicle",
        "connect = [\"tls/127.0.0.1:1\"]",
        &["tls/127.0.0.1:1 needs certificates", "enroll"],
    );
    bad(
        "vehicle",
        &with("unprotected_network = true"),
        &["does not go with certificates"],
    );
}

#[test]
fn a_star_has_one_listener_and_all_others_connect() {
    let star = |lines: &str| format!("topology = \"star\"\n{lines}");
    good("ground", &star(""));
    good("operator", &star("connect = [\"tcp/127.0.0.1:7447\"]"));
    bad(
        "ground",
        &star("connect = [\"tcp/127.0.0.1:1\"]"),
        &["bus.connect", "ground station of a star"],
    );
    bad(
        "ground",
        &star("listen = []"),
        &["bus.listen = []: is empty", "must listen somewhere"],
    );
    for role in ["vehicle", "operator"] {
        bad(
            role,
            &star(""),
            &[
                "bus.connect: is missing",
                "ground station is needed in a star",
            ],
        );
        bad(role, &star("connect = []"), &["bus.connect = []: is empty"]);
        let both = star("listen = [\"tcp/127.0.0.1:1\"]\nconnect = [\"tcp/127.0.0.1:7447\"]");
        bad(role, &both, &["bus.listen", "only connects"]);
    }
}

#[test]
fn every_node_of_a_mesh_listens() {
    for role in ["vehicle", "ground"] {
        bad(
            role,
            "listen = []",
            &[
                "bus.listen = []: is empty",
                "every node of a mesh must listen",
            ],
        );
    }
    bad(
        "operator",
        "",
        &["bus.connect: is missing", "one node of the mesh"],
    );
}

#[test]
fn every_wrong_value_is_refused() {
    for (lines, part) in [
        (
            "topology = \"ring\"",
            "bus.topology = \"ring\": is no choice; \"mesh\" or \"star\"",
        ),
        (
            "listen = \"tcp/127.0.0.1:1\"",
            "is no list of at most 256 endpoints",
        ),
        ("listen = [7447]", "number 1 is no text"),
        (
            "listen = [\"tcp/127.0.0.1:1\", \"udp/127.0.0.1:1\"]",
            "number 2 begins with neither tcp/ nor tls/",
        ),
        (
            "listen = [\"tcp/127.0.0.1:1\", \"tcp/127.0.0.1:1\"]",
            "number 2 is there twice",
        ),
        ("connect = [\"tcp/127.0.0.1\"]", "number 1 has no port"),
        ("connect = [\"tcp/:1\"]", "number 1 names no host"),
        (
            "connect = [\"tcp/127.0.0.1:0\"]",
            "has port 0; a free port (0) is for listening only",
        ),
        (
            "listen = [\"tcp/[::1]:5\"]\nconnect = [\"tcp/[::1]:5\"]",
            "is where this node itself listens",
        ),
        (
            "unprotected_network = \"yes\"",
            "bus.unprotected_network = \"yes\": is no yes or no",
        ),
        (
            "egress_kb_per_s = 1",
            "bus.egress_kb_per_s = 1: is out of range",
        ),
        (
            "lease_s = 0.5",
            "bus.lease_s = 0.5: is out of range; a number from 1 to 30",
        ),
        ("lease_s = 31", "bus.lease_s = 31: is out of range"),
        ("delay_ms = 20", "bus.delay_ms: is not known"),
    ] {
        bad("vehicle", lines, &[part]);
    }
}

#[test]
fn the_bus_of_a_node_is_a_table() {
    let text = text_of("operator", "").replace("[bus]\n", "bus = 3\n");
    let output = config::read("x.toml", &text, &mut |path| {
        bundled::load(&format!("configs/{path}"))
    })
    .unwrap_err();
    assert!(
        output.to_string().contains("bus = 3: is no table"),
        "{output}"
    );
}
