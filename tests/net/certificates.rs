//! Certificates on the real bus: who has none, a foreign one, a revoked one, or writes what is not its own gets nothing in
//! and hears nothing. Everything is enrolled by the program itself.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use tomoswarm::run::bus::BusSettings;
use tomoswarm::run::live::processes::free_ports;
use tomoswarm_proto::{Message, OperatorId, Sender, State, VehicleId, codec};

use crate::member::{Member, progress, settings, within};
use crate::raw::{Shows, Stranger};

const SOON: Duration = Duration::from_secs(10);
/// How long nothing must come.
const QUIET: Duration = Duration::from_secs(3);
const PREFIX: &str = "tomoswarm/courtyard";

fn vehicle(id: u8) -> Sender {
    Sender::Vehicle(VehicleId(id))
}

fn operator_of(number: u8) -> Sender {
    Sender::Operator(OperatorId(number))
}

fn address() -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], free_ports(1).unwrap()[0]))
}

fn enroll(folder: &Path, arguments: &[&str]) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_tomoswarm"));
    let run = program
        .arg("enroll")
        .arg(folder)
        .args(arguments)
        .output()
        .unwrap();
    assert!(
        run.status.success(),
        "{}",
        String::from_utf8_lossy(&run.stderr)
    );
}

/// A swarm of a ground station and two vehicles, enrolled in a folder.
struct Enrolled {
    folder: PathBuf,
    ground: SocketAddr,
}

impl Enrolled {
    fn make(folder: PathBuf, topology: &str) -> Enrolled {
        let venue = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/courtyard.venue.toml");
        let ground = address();
        let port = ground.port().to_string();
        for node in [&["ground"][..], &["vehicle", "1"], &["vehicle", "2"]] {
            let common = [
                "--venue",
                venue,
                "--topology",
                topology,
                "--port",
                &port,
                "--state-dir",
                "state",
            ];
            enroll(&folder, &[&common, node].concat());
        }
        Enrolled { folder, ground }
    }

    fn of(&self, node: &str) -> PathBuf {
        self.folder.join(node)
    }

    fn ground(&self) -> Member {
        Member::join(settings(&self.of("ground/ground.toml")))
    }

    fn vehicle(&self, id: u8) -> Member {
        Member::join(settings(&self.of(&format!("vehicle-{id}/vehicle.toml"))))
    }
}

fn frame(message: &Message) -> Vec<u8> {
    codec::encode(message).unwrap()
}

/// Says something again and again until it is heard.
fn gets_through(from: &Member, message: &Message, to: &Member, of: Sender) -> bool {
    within(SOON, || {
        from.publisher.publish(message);
        std::thread::sleep(Duration::from_millis(50));
        !to.heard_of(of).is_empty()
    })
}

/// Lets a stranger say what vehicle 1 says, while the others talk; returns what it heard.
fn intrude(stranger: &Stranger, talks: &Member) -> usize {
    let about = frame(&progress(1, 666));
    let until = std::time::Instant::now() + QUIET;
    while std::time::Instant::now() < until {
        stranger.say(&format!("{PREFIX}/vehicle/1/mission"), &about);
        talks
            .publisher
            .publish(&Message::Report(Default::default()));
        std::thread::sleep(Duration::from_millis(50));
    }
    stranger.heard().len()
}

#[test]
fn enrolled_nodes_of_a_mesh_talk_and_write_only_their_own_keys() {
    let folder = tempfile::tempdir().unwrap();
    let swarm = Enrolled::make(folder.path().join("swarm"), "mesh");
    let ground = swarm.ground();
    let one = swarm.vehicle(1);
    assert!(
        gets_through(&one, &progress(1, 1), &ground, vehicle(1)),
        "nothing passes at all"
    );
    assert!(gets_through(
        &ground,
        &Message::Have(Default::default()),
        &one,
        Sender::Ground
    ));
    // Vehicle 2 goes bad: first it shows that it is connected, then it writes as others.
    let two = Stranger::peer(Shows::Folder(&swarm.of("vehicle-2")), None, &[swarm.ground]);
    let own = frame(&progress(2, 2));
    assert!(within(SOON, || {
        two.say(&format!("{PREFIX}/vehicle/2/mission"), &own);
        !ground.heard_of(vehicle(2)).is_empty()
    }));
    let (before, refused) = (
        ground.heard_of(vehicle(1)).len(),
        ground.publisher.traffic().refused,
    );
    for key in ["vehicle/1/mission", "ground/have", "operator/1/order/1"] {
        two.say(&format!("{PREFIX}/{key}"), &frame(&progress(1, 666)));
    }
    std::thread::sleep(Duration::from_secs(1));
    assert_eq!(ground.heard_of(vehicle(1)).len(), before);
    assert_eq!(
        ground.publisher.traffic().refused,
        refused,
        "access control ends it before the bus does"
    );
}

#[test]
fn enrolled_clients_of_a_star_talk_through_the_ground_and_write_only_their_own_keys() {
    let folder = tempfile::tempdir().unwrap();
    let swarm = Enrolled::make(folder.path().join("swarm"), "star");
    let ground = swarm.ground();
    let one = swarm.vehicle(1);
    let two = Stranger::client(Shows::Folder(&swarm.of("vehicle-2")), swarm.ground).unwrap();
    let own = frame(&progress(2, 2));
    assert!(within(SOON, || {
        two.say(&format!("{PREFIX}/vehicle/2/mission"), &own);
        !ground.heard_of(vehicle(2)).is_empty() && !one.heard_of(vehicle(2)).is_empty()
    }));
    let key = format!("{PREFIX}/vehicle/1/mission");
    assert!(within(SOON, || {
        one.publisher.publish(&progress(1, 1));
        two.heard().contains_key(&key)
    }));
    let mine = ground.heard_of(vehicle(1)).len();
    two.say(&key, &frame(&progress(1, 666)));
    std::thread::sleep(Duration::from_secs(1));
    let heard = ground.heard_of(vehicle(1));
    assert!(
        heard
            .iter()
            .skip(mine)
            .all(|heard| format!("{heard:?}").contains("RunId(1)")),
        "{heard:?}"
    );
    assert!(one.heard_of(vehicle(1)).is_empty());
}

/// The library once let one thread write to a link's encryption while another one read from it: links broke, and processes
/// died.
#[test]
fn a_link_with_certificates_carries_much_both_ways_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let swarm = Enrolled::make(folder.path().join("swarm"), "mesh");
    let without_budget = |node: &str| {
        Member::join(BusSettings {
            egress_bytes_per_s: u32::MAX,
            ..settings(&swarm.of(node))
        })
    };
    let (one, two) = (
        without_budget("vehicle-1/vehicle.toml"),
        without_budget("ground/ground.toml"),
    );
    assert!(
        gets_through(&one, &progress(1, 1), &two, vehicle(1)),
        "nothing passes at all"
    );
    let until = Instant::now() + Duration::from_secs(8);
    let floods = |member: &Member, message: Message| {
        let publisher = member.publisher.clone();
        std::thread::spawn(move || {
            while Instant::now() < until {
                (0..50).for_each(|_| publisher.publish(&message));
                std::thread::sleep(Duration::from_millis(2));
            }
        })
    };
    let state = State {
        vehicle: VehicleId(1),
        ..State::default()
    };
    let floods = [
        floods(&one, Message::State(state)),
        floods(&two, Message::Report(Default::default())),
    ];
    let mut lost = 0;
    while Instant::now() < until {
        lost += u32::from(one.publisher.links() == 0 || two.publisher.links() == 0);
        std::thread::sleep(Duration::from_millis(10));
    }
    floods.into_iter().for_each(|flood| flood.join().unwrap());
    let came = [&one, &two]
        .map(|member| member.publisher.traffic().taken + member.publisher.traffic().refused);
    assert!(
        lost == 0 && came.iter().all(|came| *came > 10_000),
        "{lost} times without a link; {came:?} frames"
    );
}

#[test]
fn who_has_no_certificate_or_a_foreign_one_gets_nothing_in_and_hears_nothing() {
    let folder = tempfile::tempdir().unwrap();
    for topology in ["mesh", "star"] {
        let own = Enrolled::make(folder.path().join(format!("own-{topology}")), topology);
        let other = Enrolled::make(folder.path().join(format!("other-{topology}")), topology);
        let ground = own.ground();
        let ca = own.of("ca.pem");
        let foreign = other.of("vehicle-1");
        for shows in [
            Shows::Nothing,
            Shows::Authority(&ca),
            Shows::Folder(&foreign),
        ] {
            assert!(
                Stranger::client(shows, own.ground).is_none(),
                "{shows:?} as a client of a {topology}"
            );
            let stranger = Stranger::peer(shows, None, &[own.ground]);
            assert_eq!(
                intrude(&stranger, &ground),
                0,
                "{shows:?} heard something in a {topology}"
            );
            assert_eq!(
                (stranger.links(), ground.heard_count()),
                (0, 0),
                "{shows:?} in a {topology}"
            );
            stranger.close();
        }
    }
}

#[test]
fn nobody_talks_to_a_false_ground_station() {
    let folder = tempfile::tempdir().unwrap();
    let own = Enrolled::make(folder.path().join("own"), "mesh");
    let other = Enrolled::make(folder.path().join("other"), "mesh");
    let foreign = other.of("ground");
    let false_ground = Stranger::peer(Shows::Folder(&foreign), Some(own.ground), &[]);
    let one = own.vehicle(1);
    let have = frame(&Message::Have(Default::default()));
    for _ in 0..60 {
        one.publisher.publish(&progress(1, 1));
        false_ground.say(&format!("{PREFIX}/ground/have"), &have);
        std::thread::sleep(Duration::from_millis(50));
    }
    assert_eq!(
        (
            false_ground.heard().len(),
            one.heard_count(),
            one.publisher.links()
        ),
        (0, 0, 0)
    );
}

#[test]
fn who_was_revoked_gets_nothing_in_and_hears_nothing() {
    let folder = tempfile::tempdir().unwrap();
    for topology in ["mesh", "star"] {
        let swarm = Enrolled::make(folder.path().join(topology), topology);
        enroll(&swarm.folder, &["--revoke", "vehicle-1"]);
        let ground = swarm.ground();
        let two = swarm.vehicle(2);
        assert!(gets_through(&two, &progress(2, 2), &ground, vehicle(2)));
        let former = swarm.of("vehicle-1.1.revoked");
        let stranger = Stranger::peer(Shows::Folder(&former), None, &[swarm.ground]);
        let heard = ground.heard_count();
        assert_eq!(
            intrude(&stranger, &ground),
            0,
            "it heard something in a {topology}"
        );
        assert_eq!(
            ground.heard_count(),
            heard,
            "it got something in, in a {topology}"
        );
        // Its own program does not even begin, once it is given the newest roster.
        std::fs::copy(swarm.of("roster.txt"), former.join("roster.txt")).unwrap();
        let run = Command::new(env!("CARGO_BIN_EXE_tomoswarm"))
            .args(["vehicle".as_ref(), former.join("vehicle.toml").as_os_str()])
            .output()
            .unwrap();
        let printed = String::from_utf8_lossy(&run.stderr);
        assert!(
            run.status.code() == Some(2) && printed.contains("roster"),
            "{printed}"
        );
    }
}

/// A process that ends with its test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_running_ground_station_takes_up_a_newer_roster_and_drops_who_left() {
    let folder = tempfile::tempdir().unwrap();
    for topology in ["mesh", "star"] {
        let swarm = Enrolled::make(folder.path().join(topology), topology);
        let config = swarm.of("ground/ground.toml");
        let mut program = Command::new(env!("CARGO_BIN_EXE_tomoswarm"));
        program.arg("ground").arg(&config).stderr(Stdio::null());
        let mut ground = Running(program.spawn().unwrap());
        let (one, two) = (swarm.vehicle(1), swarm.vehicle(2));
        let heard = |member: &Member| member.heard_of(Sender::Ground).len();
        let both_hear = || heard(&one) > 0 && heard(&two) > 0;
        assert!(
            within(2 * SOON, both_hear),
            "nothing is heard in a {topology}"
        );
        // The ground station's own folder gets the new roster at once.
        enroll(&swarm.folder, &["--revoke", "vehicle-1"]);
        let (mut before, mut since) = (heard(&one), Instant::now());
        let is_dropped = within(2 * SOON, || {
            if heard(&one) != before {
                (before, since) = (heard(&one), Instant::now());
            }
            since.elapsed() > QUIET
        });
        assert!(is_dropped, "who was revoked hears on in a {topology}");
        let before = heard(&two);
        assert!(
            within(SOON, || heard(&two) > before),
            "who stays hears nothing in a {topology}"
        );
        let venue = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/courtyard.venue.toml");
        let port = swarm.ground.port().to_string();
        let common = ["--venue", venue, "--topology", topology, "--port", &port];
        enroll(&swarm.folder, &[&common[..], &["vehicle", "3"]].concat());
        let three = swarm.vehicle(3);
        assert!(
            within(SOON, || heard(&three) > 0),
            "who is new hears nothing in a {topology}"
        );
        // A roster that is refused changes nothing, and ends nothing.
        std::fs::write(swarm.of("ground/roster.txt"), "torn").unwrap();
        std::thread::sleep(QUIET);
        let before = heard(&three);
        assert!(
            within(SOON, || heard(&three) > before),
            "a torn roster ends a {topology}"
        );
        assert_eq!(ground.0.try_wait().unwrap(), None, "it was not to end");
    }
}

#[test]
fn an_operator_of_a_mesh_is_told_where_every_vehicle_is_reached_also_of_those_enrolled_later() {
    let folder = tempfile::tempdir().unwrap();
    let swarm = folder.path().join("swarm");
    let venue = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/courtyard.venue.toml");
    let add = |node: &[&str], more: &[&str]| {
        let common = ["--venue", venue, "--ground-host", "ground.local"];
        enroll(&swarm, &[&common, node, more].concat());
    };
    let connects = |operator: &str| {
        let text = std::fs::read_to_string(swarm.join(operator).join("operator.toml")).unwrap();
        let line = text
            .lines()
            .find(|line| line.starts_with("connect = "))
            .unwrap()
            .to_owned();
        line.split('"')
            .skip(1)
            .step_by(2)
            .map(str::to_owned)
            .collect::<Vec<String>>()
    };
    let ground = "tls/ground.local:7447";
    add(&["ground"], &["--host", "ground.local"]);
    add(&["vehicle", "1"], &["--host", "rover1.local"]);
    add(&["operator"], &[]);
    assert_eq!(connects("operator-1"), [ground, "tls/rover1.local:7447"]);
    add(&["operator", "7"], &[]);
    add(&["vehicle", "2"], &["--host", "10.0.0.7"]);
    for operator in ["operator-1", "operator-7"] {
        assert_eq!(
            connects(operator),
            [ground, "tls/rover1.local:7447", "tls/10.0.0.7:7447"]
        );
    }
    enroll(&swarm, &["--revoke", "vehicle-1"]);
    add(&["vehicle", "2"], &["--host", "rover2.local", "--replace"]);
    for operator in ["operator-1", "operator-7"] {
        assert_eq!(connects(operator).last().unwrap(), "tls/rover2.local:7447");
    }
}

#[test]
fn two_operators_are_told_apart_and_neither_is_taken_for_the_other() {
    let folder = tempfile::tempdir().unwrap();
    let swarm = Enrolled::make(folder.path().join("swarm"), "mesh");
    let venue = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/courtyard.venue.toml");
    let port = swarm.ground.port().to_string();
    let all = ["--venue", venue, "--port", &port];
    enroll(
        &swarm.folder,
        &[&all[..], &["--operator", "--operator=2"]].concat(),
    );
    let ground = swarm.ground();
    for number in [1, 2] {
        let own = swarm.of(&format!("operator-{number}/operator.toml"));
        let operator = Member::join(settings(&own));
        let says = Message::Standing(Default::default());
        assert!(
            gets_through(&operator, &says, &ground, operator_of(number)),
            "operator {number} is not heard"
        );
    }
    // The file of one with the number of the other is refused before anything is said.
    let own = swarm.of("operator-2/operator.toml");
    let text = std::fs::read_to_string(&own).unwrap();
    let other = text.replace("\nid = 2 ", "\nid = 1 ");
    assert_ne!(other, text);
    std::fs::write(&own, other).unwrap();
    let run = Command::new(env!("CARGO_BIN_EXE_tomoswarm"))
        .arg("status")
        .arg(&own)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(2), "{said}");
    assert!(
        said.contains("operator-2") && said.contains("operator-1"),
        "{said}"
    );
}
