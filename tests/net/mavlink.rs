//! Vehicles that fly simulated autopilots over MAVLink, and what clients of others see of the mock autopilot.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use tomoswarm::mavlink::dialect::{
    COMMAND_LONG_DATA, HEARTBEAT_DATA, MavAutopilot, MavCmd, MavMessage, MavResult, MavType,
    VISION_POSITION_ESTIMATE_DATA,
};
use tomoswarm::mavlink::frames::{Content, FrameReader, FrameWriter, MavAddress};
use tomoswarm_proto::{
    MissionEnd, MissionKind, MissionPhase, MissionRefusal, OrderKind, RunEnd, RunId, Sender,
    StandReason, VehicleId,
};

use crate::python::run_script;
use crate::relay::Relay;
use crate::swarm::{PROGRAM, Size, Swarm, Watch, free_address};

/// Returns two addresses with neighbouring ports.
fn two_addresses() -> [SocketAddr; 2] {
    let mut first = free_address();
    loop {
        let second = free_address();
        if second.port() == first.port() + 1 {
            return [first, second];
        }
        first = second;
    }
}

/// Two vehicles and a ground station that are not started yet, and where their autopilots can be served.
fn two(laps: u32) -> (Swarm, [SocketAddr; 2]) {
    let swarm = Swarm::prepare(Size {
        vehicles: 2,
        laps,
        relayed: false,
    });
    (swarm, two_addresses())
}

fn has_trouble(watch: &Watch, id: u8, text: &str) -> bool {
    let health = watch
        .view
        .vehicle(VehicleId(id))
        .and_then(|view| view.health.as_ref());
    health.is_some_and(|health| {
        health
            .value
            .troubles
            .iter()
            .any(|trouble| trouble.contains(text))
    })
}

#[test]
fn a_sweep_is_driven_over_mavlink_although_a_link_is_cut_for_five_seconds() {
    let (mut swarm, served) = two(2);
    let relay = Relay::start(served[0]);
    swarm.fly_over_mavlink(served[0], &[relay.address(), served[1]]);
    swarm.run();
    swarm.until("both know where they are", 20, |watch| {
        (1..=2).all(|id| {
            let state = watch.view.state(VehicleId(id));
            state.is_some_and(|state| state.value.pose.is_some())
                && !has_trouble(watch, id, "autopilot")
        })
    });
    swarm.begin();
    swarm.until_samples(200);
    relay.cut();
    swarm.until("the cut is told", 10, |watch| {
        has_trouble(watch, 1, "autopilot link: tcp:")
    });
    std::thread::sleep(Duration::from_secs(5));
    relay.restore();
    swarm.until("the link is back", 10, |watch| {
        !has_trouble(watch, 1, "autopilot")
    });
    swarm.until_end();
    swarm.until_maps_equal(20);
    // A run is done when its last images are made; a ground station that is ended before makes them at its next start.
    swarm.until("the images are made", 120, |watch| {
        let report = watch.report();
        let mut runs = report.runs.iter();
        runs.any(|known| known.run == RunId(1) && known.end == Some(RunEnd::Done))
    });
    swarm.finish();
    check_image(&swarm);
}

/// Checks that the image of a sweep shows what the same sweep shows in simulations with other seeds, whose autopilots are
/// in the process: it is brightest where the person stands, and about as bright as there.
fn check_image(swarm: &Swarm) {
    swarm.tool(&["export", "state-g/ground.sqlite", "--out", "flown"]);
    let flown = brightest(&swarm.path("flown/run-1-structure.npy"));
    let mut simulated: Vec<(f64, f64)> = (1..=5)
        .map(|seed| {
            let (seed, folder) = (format!("{seed}"), format!("out-{seed}"));
            swarm.tool(&["sim", "sim.toml", "--seed", &seed, "--out", &folder]);
            brightest(&swarm.path(&folder).join("structure.npy"))
        })
        .collect();
    simulated.sort_by(|a, b| a.0.total_cmp(&b.0));
    println!(
        "brightest pixel, dB/m and metres from the person: {flown:.2?}; simulated: {simulated:.2?}"
    );
    let (usual, _) = simulated[2];
    assert!((0.5 * usual..=2.0 * usual).contains(&flown.0));
    assert!(flown.1 <= 0.5 && simulated.iter().all(|(_, away_m)| *away_m <= 0.5));
}

/// Returns how bright the brightest pixel of an image is, dB/m, and how far from the person, metres.
fn brightest(path: &Path) -> (f64, f64) {
    const SIDE: usize = 40;
    let pixels = numbers(path);
    assert_eq!(pixels.len(), SIDE * SIDE);
    let all = pixels.iter().enumerate();
    let (index, value) = all.max_by(|a, b| a.1.total_cmp(b.1)).unwrap();
    // The area is 6 m wide; rows begin at its lower side.
    let middle_m = |index: usize| (index as f64 + 0.5) * 6.0 / SIDE as f64;
    let (x_m, y_m) = (middle_m(index % SIDE), middle_m(index / SIDE));
    (*value, libm::hypot(x_m - 3.0, y_m - 3.5))
}

/// Returns the numbers in a file of NumPy, of 32 bits each.
fn numbers(path: &Path) -> Vec<f64> {
    let bytes = std::fs::read(path).unwrap();
    let header = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let values = bytes[10 + header..].chunks_exact(4);
    values
        .map(|value| f64::from(f32::from_le_bytes(value.try_into().unwrap())))
        .collect()
}

/// A mission of QGroundControl: three places, a stay, a speed, a servo, a command that only an autopilot knows, a jump.
fn stored_mission() -> String {
    let place = |x_m: f64, y_m: f64, stay_s: u32| {
        let (latitude, longitude) = (52.0 + y_m / 111_258.0, 4.0 + x_m / 68_680.0);
        format!("3\t16\t{stay_s}\t0\t0\t0\t{latitude:.8}\t{longitude:.8}\t0")
    };
    let plain = |command: u32, parameters: &str| format!("2\t{command}\t{parameters}\t0\t0\t0");
    let items = [
        "0\t16\t0\t0\t0\t0\t52\t4\t0".to_owned(),
        place(-1.5, 4.0, 1),
        plain(178, "1\t0.8\t-1\t0"),
        plain(183, "9\t1700\t0\t0"),
        place(-1.5, 7.0, 0),
        plain(177, "1\t1\t0\t0"),
        place(1.0, 7.0, 2),
    ];
    let numbered = items.iter().enumerate();
    let lines = numbered.map(|(index, item)| format!("{index}\t0\t{item}\t1\n"));
    format!("QGC WPL 110\n{}", lines.collect::<String>())
}

#[test]
fn an_autopilot_stores_a_mission_carries_it_out_is_paused_and_goes_on_with_its_item() {
    let (mut swarm, served) = two(1);
    swarm.fly_over_mavlink(served[0], &served);
    swarm.write("yard.waypoints", &stored_mission());
    swarm.run();
    let shown = |watch: &Watch| {
        let vehicle = watch.view.vehicle(VehicleId(1))?;
        vehicle.mission.as_ref().map(|said| said.value)
    };
    swarm.until("it knows where it is", 20, |watch| {
        watch.view.grounds().next().is_some() && !has_trouble(watch, 1, "autopilot")
    });
    let refused = swarm.refused(&[
        "start",
        "--mission",
        "stored",
        "--set",
        "file=yard.waypoints",
    ]);
    assert!(refused.contains("is one vehicle's alone"), "{refused}");
    let stored = ["start", "1", "--mission", "stored", "--set"];
    swarm.order(&[&stored[..], &["file=yard.waypoints"]].concat());
    swarm.until("it is under way to its second place", 60, |watch| {
        shown(watch).is_some_and(|said| said.kind == MissionKind::Stored && said.places_left == 2)
    });
    swarm.order(&["pause", "1"]);
    swarm.until("it stands", 10, |watch| {
        let state = watch.view.state(VehicleId(1));
        state.is_some_and(|state| state.value.is_at_rest)
            && shown(watch).is_some_and(|said| said.phase == MissionPhase::Held)
    });
    swarm.order(&["resume", "1"]);
    swarm.until("it has done all", 60, |watch| {
        shown(watch).is_some_and(|said| said.end == Some(MissionEnd::Done))
    });
    let place = swarm.look(|watch| {
        watch
            .view
            .state(VehicleId(1))
            .unwrap()
            .value
            .pose
            .unwrap()
            .at
    });
    let away_m = libm::hypot(place.x_m() - 1.0, place.y_m() - 7.0);
    assert!(away_m < 0.5, "{place:?}");
    swarm.order(&[&stored[..], &["file=yard.waypoints", "--set", "from=6"]].concat());
    swarm.until("its last item alone is done", 30, |watch| {
        let mission = shown(watch);
        mission
            .is_some_and(|said| said.progress.run == RunId(2) && said.end == Some(MissionEnd::Done))
    });
    swarm.write(
        "strange.waypoints",
        &stored_mission().replace("\t183\t", "\t203\t"),
    );
    swarm.order(&[&stored[..], &["file=strange.waypoints"]].concat());
    swarm.until(
        "the autopilot does not take what it does not know",
        30,
        |watch| {
            let refused = MissionEnd::Refused(MissionRefusal::Autopilot);
            shown(watch)
                .is_some_and(|said| said.progress.run == RunId(3) && said.end == Some(refused))
        },
    );
    swarm.order(&[&stored[..], &["file=yard.waypoints"]].concat());
    swarm.until("it is under way once more", 60, |watch| {
        shown(watch).is_some_and(|said| said.progress.run == RunId(4) && said.places_left == 2)
    });
    reboot(served[0]);
    let stands_and_waits = |watch: &Watch| {
        let state = watch.view.state(VehicleId(1));
        state.is_some_and(|state| {
            state.value.is_at_rest
                && !state.value.is_armed
                && state.value.stands_under == Some(StandReason::Autopilot)
        })
    };
    swarm.until("its autopilot has started anew", 15, |watch| {
        stands_and_waits(watch) && shown(watch).is_some_and(|said| said.end.is_none())
    });
    std::thread::sleep(Duration::from_secs(3));
    assert!(swarm.look(stands_and_waits));
    let log = swarm.log_of(Sender::Vehicle(VehicleId(1)));
    assert!(log.contains("the autopilot has started anew"), "{log}");
    swarm.order(&[&stored[..], &["file=yard.waypoints", "--set", "from=6"]].concat());
    swarm.until("it goes on when it is told to", 60, |watch| {
        let mission = shown(watch);
        mission
            .is_some_and(|said| said.progress.run == RunId(5) && said.end == Some(MissionEnd::Done))
    });
}

/// Starts the autopilot of system 1 anew, although it is armed.
fn reboot(served: SocketAddr) {
    let reboot = MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
        param1: 1.0,
        param6: 20_190_226.0,
        command: MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
        target_system: 1,
        target_component: 1,
        ..COMMAND_LONG_DATA::default()
    });
    let mut bytes = Vec::new();
    let mut writer = FrameWriter::new(MavAddress {
        system: 254,
        component: 190,
    });
    writer.write(&reboot, None, &mut bytes);
    let mut stream = TcpStream::connect(served).unwrap();
    stream.write_all(&bytes).unwrap();
    let (mut reader, mut heard) = (FrameReader::default(), [0; 1024]);
    loop {
        let count = stream.read(&mut heard).unwrap();
        reader.push(&heard[..count]);
        while let Some(frame) = reader.next(None) {
            if let Content::Message(message) = frame.content
                && let MavMessage::COMMAND_ACK(ack) = *message
            {
                assert_eq!(ack.result, MavResult::MAV_RESULT_ACCEPTED);
                return;
            }
        }
    }
}

/// Returns what a tool prints, what it complains of, and its exit code.
fn run_tool(swarm: &Swarm, words: &[&str], input: &str) -> (String, String, Option<i32>) {
    let mut tool = Command::new(PROGRAM)
        .args(words)
        .current_dir(swarm.path(""))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    tool.stdin
        .take()
        .unwrap()
        .write_all(input.as_bytes())
        .unwrap();
    let run = tool.wait_with_output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&run.stdout), text(&run.stderr), run.status.code())
}

#[test]
fn the_parameters_of_an_autopilot_are_listed_set_and_kept() {
    let (mut swarm, served) = two(1);
    swarm.fly_over_mavlink(served[0], &served);
    let parameters = |swarm: &Swarm, words: &[&str]| {
        let words = [&["parameters", "vehicle-1.toml"], words].concat();
        run_tool(swarm, &words, "")
    };
    let (_, said, code) = parameters(&swarm, &[]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains(&format!("tcp:{}", served[0])), "{said}");
    let address = served[0].to_string();
    swarm.spawn("mock", &["mock-autopilot", "--tcp", &address]);
    while TcpStream::connect(served[0]).is_err() {
        std::thread::sleep(Duration::from_millis(20));
    }
    let (before, said, code) = parameters(&swarm, &[]);
    assert_eq!(code, Some(0), "{said}");
    assert!(before.lines().count() >= 20, "{before}");
    assert!(before.contains("FS_GCS_ENABLE,0\n"), "{before}");
    let (shown, said, code) = parameters(&swarm, &["--set", "FS_GCS_ENABLE=1", "FS_GCS*"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(
        shown.starts_with("FS_GCS_ENABLE,1 # was 0\nFS_GCS_ENABLE,1\n"),
        "{shown}"
    );
    let (shown, said, code) = parameters(
        &swarm,
        &["--set", "FS_GCS_ENABLE=0", "--set", "FS_GCS_ENABEL=0"],
    );
    assert_eq!((shown.as_str(), code), ("", Some(2)), "{said}");
    assert!(
        said.contains("no parameter FS_GCS_ENABEL; nothing was set"),
        "{said}"
    );
    swarm.write("before.param", &format!("# as it was\n{before}"));
    let (shown, said, code) = parameters(&swarm, &["--set-from", "before.param"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(shown.contains("FS_GCS_ENABLE,0 # was 1\n"), "{shown}");
    assert_eq!(parameters(&swarm, &[]).0, before);
    swarm.write("bad.param", "FS_GCS_ENABLE,0\nFS_GCS_ENABLE\n");
    let (_, said, code) = parameters(&swarm, &["--set-from", "bad.param"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("bad.param:2:"), "{said}");
}

/// Plays an autopilot that says nothing but that it is there; returns where, and what it is told of its place.
fn listening_autopilot() -> (SocketAddr, Arc<Mutex<Vec<VISION_POSITION_ESTIMATE_DATA>>>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let told = Arc::<Mutex<Vec<VISION_POSITION_ESTIMATE_DATA>>>::default();
    let kept = told.clone();
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut said = stream.try_clone().unwrap();
        std::thread::spawn(move || {
            let mut writer = FrameWriter::new(MavAddress {
                system: 1,
                component: 1,
            });
            let heartbeat = MavMessage::HEARTBEAT(HEARTBEAT_DATA {
                mavtype: MavType::MAV_TYPE_GROUND_ROVER,
                autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
                ..HEARTBEAT_DATA::default()
            });
            let mut bytes = Vec::new();
            writer.write(&heartbeat, None, &mut bytes);
            while said.write_all(&bytes).is_ok() {
                std::thread::sleep(Duration::from_millis(300));
            }
        });
        let (mut reader, mut bytes) = (FrameReader::default(), [0; 4096]);
        while let Ok(count) = stream.read(&mut bytes) {
            if count == 0 {
                return;
            }
            reader.push(&bytes[..count]);
            while let Some(frame) = reader.next(None) {
                if let Content::Message(message) = frame.content
                    && let MavMessage::VISION_POSITION_ESTIMATE(estimate) = *message
                {
                    kept.lock().unwrap().push(estimate);
                }
            }
        }
    });
    (address, told)
}

#[test]
fn an_autopilot_is_told_where_it_is_from_outside() {
    let (mut swarm, served) = two(1);
    let (address, told) = listening_autopilot();
    swarm.fly_over_mavlink(served[0], &[address, served[1]]);
    let text = std::fs::read_to_string(swarm.path("vehicle-1.toml")).unwrap();
    swarm.write(
        "vehicle-1.toml",
        &text.replace(
            "[autopilot]\n",
            "[pose]\nsource = \"external\"\n[autopilot]\n",
        ),
    );
    swarm.run();
    swarm.until("nobody measures", 20, |watch| {
        has_trouble(watch, 1, "nobody says where it is from outside")
    });
    let mut fixes = Command::new(PROGRAM)
        .args(["fix", "operator.toml", "--origin", "10,20,0"])
        .current_dir(swarm.path(""))
        .stdin(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = fixes.stdin.take().unwrap();
    let began = Instant::now();
    while told.lock().unwrap().len() < 40 {
        assert!(
            began.elapsed() < Duration::from_secs(20),
            "too few are told"
        );
        let line =
            r#"{"vehicle": 1, "x_m": -7, "y_m": -16, "z_m": 0.5, "heading_deg": 0, "sd_m": 0.1}"#;
        // For the other one, which does not want any.
        let other = r#"{"vehicle": 2, "x_m": 0, "y_m": 0}"#;
        lines
            .write_all(format!("{line}\n{other}\n").as_bytes())
            .unwrap();
        std::thread::sleep(Duration::from_millis(10));
    }
    let estimates = told.lock().unwrap().clone();
    // The venue's x axis points east.
    for estimate in &estimates {
        let (north_m, east_m) = (estimate.x - 4.0, estimate.y - 3.0);
        assert!(north_m.abs() < 0.01 && east_m.abs() < 0.01, "{estimate:?}");
        assert!((estimate.z + 0.5).abs() < 1e-3 && (estimate.covariance[0] - 0.01).abs() < 1e-6);
    }
    let (first, last) = (estimates[0].usec, estimates[39].usec);
    assert!(
        (1_700_000..6_000_000).contains(&(last - first)),
        "40 in {} us",
        last - first
    );
    swarm.until("somebody measures", 5, |watch| {
        !has_trouble(watch, 1, "nobody says where it is from outside")
    });
    drop(lines);
    assert!(fixes.wait().unwrap().success());
    let bad = "{\"vehicle\": 1}\nnothing\n";
    let (_, said, code) = run_tool(&swarm, &["fix", "operator.toml"], bad);
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains("standard input:2:") && said.contains("2 of 2 lines"),
        "{said}"
    );
}

/// A ground station that listens for packets.
struct Station {
    socket: UdpSocket,
    swarm: Option<SocketAddr>,
    reader: FrameReader,
    writer: FrameWriter,
    /// Latitudes and longitudes, 1e-7 degrees, by system.
    places: BTreeMap<u8, BTreeSet<(i32, i32)>>,
    /// The mode in the last heartbeat, by system.
    modes: BTreeMap<u8, u32>,
    answers: Vec<(u8, MavCmd, MavResult)>,
}

impl Station {
    fn listen() -> Station {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let timeout = Some(Duration::from_millis(100));
        socket.set_read_timeout(timeout).unwrap();
        let (system, component) = (255, 190);
        Station {
            socket,
            swarm: None,
            reader: FrameReader::default(),
            writer: FrameWriter::new(MavAddress { system, component }),
            places: BTreeMap::new(),
            modes: BTreeMap::new(),
            answers: Vec::new(),
        }
    }

    fn until(&mut self, what: &str, limit_s: u64, holds: impl Fn(&Station) -> bool) {
        let began = Instant::now();
        while !holds(self) {
            assert!(
                began.elapsed() < Duration::from_secs(limit_s),
                "not within {limit_s} s: {what}; {:?} {:?}",
                self.modes,
                self.answers
            );
            self.hear();
        }
    }

    fn hear(&mut self) {
        let mut packet = [0; 2048];
        let Ok((count, from)) = self.socket.recv_from(&mut packet) else {
            return;
        };
        self.swarm = Some(from);
        self.reader.push(&packet[..count]);
        while let Some(frame) = self.reader.next(None) {
            let (system, Content::Message(message)) = (frame.from.system, frame.content) else {
                continue;
            };
            match *message {
                MavMessage::HEARTBEAT(beat) => drop(self.modes.insert(system, beat.custom_mode)),
                MavMessage::GLOBAL_POSITION_INT(at) => {
                    self.places
                        .entry(system)
                        .or_default()
                        .insert((at.lat, at.lon));
                }
                MavMessage::COMMAND_ACK(ack) => {
                    self.answers.push((system, ack.command, ack.result));
                }
                _ => {}
            }
        }
    }

    fn command(&mut self, system: u8, command: MavCmd, [param1, param2]: [f32; 2]) {
        let command = MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
            param1,
            param2,
            command,
            target_system: system,
            target_component: 1,
            ..Default::default()
        });
        let mut bytes = Vec::new();
        self.writer.write(&command, None, &mut bytes);
        self.socket.send_to(&bytes, self.swarm.unwrap()).unwrap();
    }

    /// The longer side of all places of a vehicle, 1e-7 degrees.
    fn way(&self, system: u8) -> i32 {
        let side = |of: fn(&(i32, i32)) -> i32| {
            let all = || self.places.get(&system).into_iter().flatten().map(of);
            all().max().unwrap_or(0) - all().min().unwrap_or(0)
        };
        side(|place| place.0).max(side(|place| place.1))
    }

    fn was_answered(&self, answer: (u8, MavCmd, MavResult)) -> bool {
        self.answers.contains(&answer)
    }
}

#[test]
fn a_ground_station_shows_the_swarm_and_holds_a_vehicle() {
    const HOLD: u32 = 4;
    const METRE: i32 = 100;
    let mut swarm = Swarm::prepare(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    });
    let mut station = Station::listen();
    let address = station.socket.local_addr().unwrap();
    swarm.show_over_mavlink(&format!("address = \"{address}\"\ncommands = true\n"));
    swarm.run();
    station.until("both are shown", 30, |station| {
        [1, 2].iter().all(|id| station.modes.contains_key(id))
    });
    swarm.begin();
    station.until("both move", 60, |station| {
        [1, 2].iter().all(|id| station.way(*id) > METRE)
    });
    let mode = MavCmd::MAV_CMD_DO_SET_MODE;
    station.command(2, mode, [1.0, HOLD as f32]);
    station.until("the order is in force", 6, |station| {
        station.was_answered((2, mode, MavResult::MAV_RESULT_ACCEPTED))
    });
    assert!(station.was_answered((2, mode, MavResult::MAV_RESULT_IN_PROGRESS)));
    swarm.until("it rests", 5, |watch| {
        let state = &watch.view.state(VehicleId(2)).unwrap().value;
        state.is_at_rest && state.ordered.kind == Some(OrderKind::Hold)
    });
    station.until("it is shown at rest", 5, |station| {
        station.modes[&2] == HOLD
    });
    swarm.end_in_order();
}

#[test]
fn the_mock_autopilot_is_what_pymavlink_expects() {
    run_script("mavlink/mock_pymavlink.py", "pymavlink");
}

#[test]
fn the_mock_autopilot_is_what_mavsdk_expects() {
    run_script("mavlink/mock_mavsdk.py", "mavsdk");
}

#[test]
fn the_mock_autopilot_is_what_mavproxy_expects() {
    run_script("mavlink/mock_mavproxy.py", "MAVProxy");
}
