//! The operator's tools as programs, over loopback, against nodes that this test plays on the real bus.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tomoswarm::config::{self, Config, Venue};
use tomoswarm::run::bus::{BusSession, BusSettings, HeardMessage, SessionTopology};
use tomoswarm::run::clock::Clock;
use tomoswarm::run::live::processes::free_ports;
use tomoswarm::run::mailbox::Troubles;
use tomoswarm_proto::{
    Boot, Deviation, GroundReport, Heading, Health, Hello, Lease, Message, OpenStops, Order,
    OrderKind, Ordered, Permille, PoseReport, Position, RunId, Sender, StandReason, State,
    StationPhase, VehicleId, VehicleMode,
};

const GROUNDS: Lease = Lease {
    number: 3,
    holder: 33,
};
const VENUE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/courtyard.venue.toml");

fn venue() -> Venue {
    let text = std::fs::read_to_string(VENUE).unwrap();
    match config::read(VENUE, &text, &mut |_| Err("nothing is named".to_owned())) {
        Ok(Config::Venue(venue)) => venue,
        other => panic!("{other:?}"),
    }
}

fn free_endpoint() -> String {
    format!("tcp/127.0.0.1:{}", free_ports(1).unwrap()[0])
}

/// A node that this test plays, until it is dropped.
struct Player {
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Player {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        self.thread.take().map(JoinHandle::join);
    }
}

/// Plays a node: `say` gives what it says now, ten times a second.
fn play(
    node: Sender,
    listen: &str,
    connect: &[String],
    hear: impl Fn(HeardMessage) + Send + Sync + 'static,
    mut say: impl FnMut(u32) -> Vec<Message> + Send + 'static,
) -> Player {
    let settings = BusSettings {
        node,
        prefix: format!("tomoswarm/{}", venue().name),
        topology: SessionTopology::Mesh,
        listen: vec![listen.to_owned()],
        connect: connect.to_vec(),
        trust: None,
        lease: Duration::from_secs(3),
        egress_bytes_per_s: 64_000,
        gossip: true,
    };
    let bus = BusSession::open(settings, Clock::start(), Troubles::default(), hear).unwrap();
    bus.publisher().speak();
    let is_over = Arc::new(AtomicBool::new(false));
    let seen = is_over.clone();
    let thread = std::thread::spawn(move || {
        for turn in 0.. {
            if seen.load(Ordering::Relaxed) {
                return bus.close();
            }
            say(turn)
                .iter()
                .for_each(|message| bus.publisher().publish(message));
            std::thread::sleep(Duration::from_millis(100));
        }
    });
    Player {
        is_over,
        thread: Some(thread),
    }
}

fn hello(node: Sender) -> Message {
    Message::Hello(Hello {
        is_member: true,
        member_for_s: 60,
        software: tomoswarm::exchange::software::SOFTWARE.to_owned(),
        ..Hello::asking(node, Boot(1), venue().hash(), 1)
    })
}

/// Plays the ground station, which does nothing but hold its lease.
fn ground(listen: &str) -> Player {
    ground_that(
        listen,
        GroundReport {
            members: vec![VehicleId(1), VehicleId(2)],
            ..GroundReport::default()
        },
    )
}

/// Plays the ground station, which holds its lease and says this of itself.
fn ground_that(listen: &str, report: GroundReport) -> Player {
    let report = GroundReport {
        lease: GROUNDS,
        store: 1,
        ..report
    };
    let say = move |_| vec![hello(Sender::Ground), Message::Report(report.clone())];
    play(Sender::Ground, listen, &[], |_| {}, say)
}

/// Plays a vehicle at its home that obeys what is above its echo.
fn vehicle(id: u8, others: &[u8], ground: &str) -> (Player, Arc<Mutex<Ordered>>) {
    let home = venue().homes[usize::from(id) - 1];
    let ordered = Arc::new(Mutex::new(Ordered::default()));
    let (obeyed, echoed) = (ordered.clone(), ordered.clone());
    let stopped = Arc::new(Mutex::new(OpenStops::default()));
    let knows = stopped.clone();
    let hear = move |heard| {
        if let HeardMessage::Message(_, Message::Standing(standing)) = &heard
            && !standing.open.is_empty()
        {
            knows.lock().unwrap().open.clone_from(&standing.open);
        }
        if let HeardMessage::Message(
            _,
            Message::Order(Order {
                vehicle,
                lease,
                revision,
                run,
                kind,
                ..
            }),
        ) = heard
        {
            let mut obeyed = obeyed.lock().unwrap();
            if vehicle == VehicleId(id) && (lease, revision) > obeyed.edition() {
                *obeyed = Ordered {
                    lease,
                    revision,
                    run,
                    kind: Some(kind),
                };
            }
        }
    };
    let hears: Vec<VehicleId> = others.iter().map(|other| VehicleId(*other)).collect();
    let say = move |turn: u32| {
        let standing = stopped.lock().unwrap().clone();
        let state = State {
            stands_under: standing
                .open
                .first()
                .map(|stop| StandReason::Stop(stop.name)),
            vehicle: VehicleId(id),
            boot: Boot(1),
            sequence: u64::from(turn),
            pose: Some(PoseReport {
                at: Position::from_metres(home.x_m, home.y_m, 0.0),
                heading: Heading(0),
                sd: Deviation(50),
            }),
            is_at_rest: true,
            mode: VehicleMode::Idle,
            battery: Some(Permille(900)),
            leg: None,
            accepted: Default::default(),
            ordered: *echoed.lock().unwrap(),
            ..State::default()
        };
        let hears = hears.clone();
        let health = Health {
            vehicle: VehicleId(id),
            boot: Boot(1),
            hears,
            ..Health::default()
        };
        let greeting = hello(Sender::Vehicle(VehicleId(id)));
        vec![
            Message::State(state),
            Message::Standing(standing),
            Message::Health(health),
            greeting,
        ]
    };
    let connect = [ground.to_owned()];
    (
        play(
            Sender::Vehicle(VehicleId(id)),
            &free_endpoint(),
            &connect,
            hear,
            say,
        ),
        ordered,
    )
}

fn operator_file(folder: &Path, connect: &str) -> PathBuf {
    let path = folder.join("operator.toml");
    let text = format!(
        "kind = \"operator\"\nvenue = \"{VENUE}\"\n[bus]\ntopology = \"mesh\"\nconnect = [\"{connect}\"]\n"
    );
    std::fs::write(&path, text).unwrap();
    path
}

fn tool(command: &str, config: &Path, arguments: &[&str]) -> Output {
    let mut program = Command::new(env!("CARGO_BIN_EXE_tomoswarm"));
    program
        .arg(command)
        .arg(config)
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

fn check(output: &Output, code: i32) -> String {
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert_eq!(
        output.status.code(),
        Some(code),
        "said: {printed}\ncomplained: {complaint}"
    );
    printed
}

#[test]
fn the_tools_show_order_and_judge_a_swarm() {
    let folder = tempfile::tempdir().unwrap();
    let hub = free_endpoint();
    let config = operator_file(folder.path(), &hub);
    let _ground = ground(&hub);
    let (_one, by_one) = vehicle(1, &[2], &hub);
    let (two, by_two) = vehicle(2, &[1], &hub);

    let status = check(&tool("status", &config, &[]), 0);
    assert!(
        status.contains("lease 3") && status.lines().count() == 4,
        "{status}"
    );

    let started = check(&tool("order", &config, &["start"]), 0);
    assert!(
        started.lines().count() == 2 && started.contains("vehicle 2 has obeyed after "),
        "{started}"
    );
    let echo = *by_one.lock().unwrap();
    assert_eq!((echo.lease, echo.revision.0, echo.run.0), (GROUNDS, 1, 1));

    check(&tool("order", &config, &["pause", "2"]), 0);
    let kinds = [by_one.lock().unwrap().kind, by_two.lock().unwrap().kind];
    assert_eq!(kinds, [Some(OrderKind::Start), Some(OrderKind::Hold)]);

    let judged = check(&tool("preflight", &config, &["--vehicles", "1,2"]), 0);
    assert!(judged.ends_with("\nGO\n"), "{judged}");
    let refused = check(
        &tool(
            "preflight",
            &config,
            &["--vehicles", "1,2,3", "--for", "1.5"],
        ),
        1,
    );
    assert!(
        refused.contains("hears 2, not 3") && refused.ends_with("\nNO-GO\n"),
        "{refused}"
    );

    let lines = check(
        &tool(
            "tap",
            &config,
            &["--kind", "state", "--vehicle", "2", "--count", "3"],
        ),
        0,
    );
    for line in lines.lines() {
        let line: serde_json::Value = serde_json::from_str(line).unwrap();
        assert_eq!(
            (&line["sender"], &line["kind"]),
            (&"vehicle/2".into(), &"state".into())
        );
        assert_eq!(line["message"]["ordered"]["kind"], "Hold");
    }
    assert_eq!(lines.lines().count(), 3);

    drop(two);
    let missed = tool("order", &config, &["hold", "1", "2", "--timeout", "1.5"]);
    assert!(check(&missed, 1).contains("vehicle 2 is not heard"));
    let silent = tool("order", &config, &["emergency"]);
    let told = check(&silent, 1);
    assert!(
        told.contains("vehicle 2 is not heard"),
        "the ground's report names it: {told}"
    );
    assert!(told.contains("vehicle 1 shows the stop after "), "{told}");
    // It stands until a start, which is refused while somebody is not heard.
    assert!(check(&tool("status", &config, &[]), 1).contains("EMERGENCY STOP"));
    check(&tool("order", &config, &["return"]), 1);
    check(&tool("order", &config, &["start"]), 1);
}

#[test]
fn nobody_there_is_said_and_a_wrong_use_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let config = operator_file(folder.path(), &free_endpoint());
    let silent = tool("status", &config, &["--for", "0.3"]);
    assert!(check(&silent, 1).contains("no vehicle was heard"));
    check(&tool("order", &config, &["hold", "--timeout", "0.3"]), 1);
    check(&tool("tap", &config, &["--for", "0.2"]), 0);
    check(&tool("order", &config, &["cut-motors"]), 2);
    check(&tool("order", Path::new(VENUE), &["hold"]), 2);
    check(&tool("order", &config, &["hold", "--timeout", "nan"]), 2);
}

#[test]
fn a_start_of_another_run_is_refused_while_one_is_driven() {
    let folder = tempfile::tempdir().unwrap();
    let hub = free_endpoint();
    let config = operator_file(folder.path(), &hub);
    let members = vec![VehicleId(1)];
    let report = GroundReport {
        phase: StationPhase::Running,
        run: RunId(1),
        members,
        ..GroundReport::default()
    };
    let _ground = ground_that(&hub, report);
    let (_one, by_one) = vehicle(1, &[], &hub);
    let refused = tool("order", &config, &["start", "--run", "7"]);
    check(&refused, 1);
    let complaint = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(complaint.contains("run 1 is under way"), "{complaint}");
    assert_eq!(by_one.lock().unwrap().kind, None, "nothing was sent");
    check(&tool("order", &config, &["start", "--run", "1"]), 0);
}

#[test]
fn a_status_that_is_watched_ends_when_nobody_reads_it_any_more() {
    let folder = tempfile::tempdir().unwrap();
    let config = operator_file(folder.path(), &free_endpoint());
    let mut program = Command::new(env!("CARGO_BIN_EXE_tomoswarm"));
    program
        .arg("status")
        .arg(&config)
        .args(["--watch", "--for", "0.2"]);
    program
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut watching = program.spawn().unwrap();
    let mut line = String::new();
    BufReader::new(watching.stdout.take().unwrap())
        .read_line(&mut line)
        .unwrap();
    assert_eq!(line, "no vehicle was heard\n");
    let began = Instant::now();
    while watching.try_wait().unwrap().is_none() && began.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(50));
    }
    // One that goes on would otherwise outlive this test.
    let _ = watching.kill();
    let output = watching.wait_with_output().unwrap();
    assert_eq!(
        (
            output.status.code(),
            String::from_utf8_lossy(&output.stderr).as_ref()
        ),
        (Some(0), "")
    );
}

#[test]
fn in_a_star_without_its_ground_station_an_order_ends_at_once_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("operator.toml");
    let connect = free_endpoint();
    let text = format!(
        "kind = \"operator\"\nvenue = \"{VENUE}\"\n[bus]\ntopology = \"star\"\nconnect = [\"{connect}\"]\n"
    );
    std::fs::write(&path, text).unwrap();
    for what in ["emergency", "start"] {
        let began = Instant::now();
        let ended = tool("order", &path, &[what]);
        assert!(
            began.elapsed() < Duration::from_secs(4),
            "{:?}",
            began.elapsed()
        );
        check(&ended, 1);
        let complaint = String::from_utf8_lossy(&ended.stderr);
        assert!(
            complaint.contains("in a star nobody is reached without it"),
            "{complaint}"
        );
    }
}
