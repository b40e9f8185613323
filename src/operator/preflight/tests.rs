//! Every check by itself: a sound swarm is go, and one thing wrong makes exactly that check refuse.

use tomoswarm_proto::codec::{Greeting, VERSION};
use tomoswarm_proto::{
    AutopilotFamily, AutopilotHealth, BodyKind, Boot, Capability, Deviation, Message, OrderKind,
    Permille, Power, RadioHealth, RadioKind, RangeHealth, RangeSensorKind, RecordingHealth, RunId,
    RunReport, Sender, ServoKind, State,
};

use super::super::HeardMessage;
use super::super::tests_support::{Rover, at, heard, report, state};
use super::*;

const NOW_S: f64 = 10.0;

/// A swarm of two, as it speaks.
struct Swarm {
    states: Vec<(f64, State)>,
    healths: Vec<Health>,
    hellos: Vec<Hello>,
    reports: Vec<GroundReport>,
}

/// What a vehicle has.
fn capabilities() -> [Capability; 4] {
    [
        Capability::Autopilot(AutopilotFamily::Simulated, BodyKind::Rover),
        Capability::RangeSensor(RangeSensorKind::SerialText),
        Capability::Servo(ServoKind::Simulated),
        Capability::Radio(RadioKind::Simulated),
    ]
}

fn hello(node: Sender) -> Hello {
    Hello {
        is_member: true,
        member_for_s: 60,
        software: "0.1.0".to_owned(),
        capabilities: capabilities().to_vec(),
        ..Hello::asking(node, Boot(1), 5, 1)
    }
}

fn health(vehicle: u8, hears: u8) -> Health {
    Health {
        vehicle: VehicleId(vehicle),
        boot: Boot(1),
        hears: vec![VehicleId(hears)],
        disk_free_mb: Some(5000),
        ..Health::default()
    }
}

impl Swarm {
    fn sound() -> Swarm {
        let vehicle = |id| Sender::Vehicle(VehicleId(id));
        Swarm {
            states: vec![(9.9, state(1)), (9.9, state(2))],
            healths: vec![health(1, 2), health(2, 1)],
            hellos: vec![hello(vehicle(1)), hello(vehicle(2)), hello(Sender::Ground)],
            reports: vec![report()],
        }
    }

    fn pose_of_1(&mut self) -> &mut PoseReport {
        self.states[0].1.pose.as_mut().unwrap()
    }

    fn view(self) -> FleetView {
        let mut view = FleetView::default();
        let soon = at(NOW_S - 0.5);
        for hello in self.hellos {
            let Hello {
                node,
                boot,
                venue_hash,
                ..
            } = hello;
            let greeting = Greeting {
                version: VERSION,
                node,
                boot,
                venue_hash,
            };
            view.hear(soon, &HeardMessage::Greeting(greeting, Some(hello)));
        }
        for (at_s, state) in self.states {
            view.hear(at(at_s), &heard(Message::State(state)));
        }
        self.healths
            .into_iter()
            .for_each(|health| view.hear(soon, &heard(Message::Health(health))));
        self.reports
            .into_iter()
            .for_each(|report| view.hear(soon, &heard(Message::Report(report))));
        view
    }
}

fn needs() -> Requirements {
    let corners = [(-5.0, -5.0), (9.0, -5.0), (9.0, 9.0), (-5.0, 9.0)];
    Requirements {
        vehicles: BTreeSet::from([VehicleId(1), VehicleId(2)]),
        venue_hash: 5,
        fence: Polygon::new(corners.map(|(x_m, y_m)| Point::new(x_m, y_m)).to_vec()),
        homes: vec![Point::new(1.0, 1.0), Point::new(2.0, 1.0)],
        pose_sd_max_m: None,
        software: "0.1.0".to_owned(),
    }
}

/// Names what refuses: node and check.
fn refusals(swarm: Swarm, needs: &Requirements) -> Vec<String> {
    let nodes = inspect(&swarm.view(), needs, at(NOW_S));
    let refusing = |node: &NodeChecks| -> Vec<String> {
        let checks = node
            .checks
            .iter()
            .filter(|check| check.light == CheckStatus::NoGo);
        checks
            .map(|check| format!("{}: {}", node.node, check.what))
            .collect()
    };
    let refusals: Vec<String> = nodes.iter().flat_map(refusing).collect();
    assert_eq!(is_go(&nodes), refusals.is_empty());
    refusals
}

/// Makes one thing wrong and names what must refuse.
fn wrong(change: impl FnOnce(&mut Swarm), expected: &[&str]) {
    let mut swarm = Swarm::sound();
    change(&mut swarm);
    assert_eq!(refusals(swarm, &needs()), expected);
}

#[test]
fn a_sound_swarm_is_go() {
    wrong(|_| {}, &[]);
}

#[test]
fn each_check_of_a_vehicle_can_refuse() {
    wrong(|swarm| swarm.states[0].0 = 8.4, &["vehicle 1: bus"]);
    wrong(
        |swarm| swarm.hellos[1].software = "0.2.0".to_owned(),
        &["vehicle 2: software"],
    );
    wrong(
        |swarm| swarm.hellos[1].venue_hash = 6,
        &["vehicle 2: venue"],
    );
    wrong(
        |swarm| swarm.pose_of_1().sd = Deviation(510),
        &["vehicle 1: pose"],
    );
    wrong(
        |swarm| swarm.pose_of_1().at.y_mm = 4000,
        &["vehicle 1: home"],
    );
    wrong(
        |swarm| swarm.pose_of_1().at.y_mm = 10_000,
        &["vehicle 1: fence", "vehicle 1: home"],
    );
    wrong(
        |swarm| swarm.pose_of_1().sd = Deviation::UNKNOWN,
        &["vehicle 1: pose"],
    );
    wrong(
        |swarm| swarm.states[0].1.pose = None,
        &["vehicle 1: pose", "vehicle 1: fence", "vehicle 1: home"],
    );
    wrong(
        |swarm| swarm.states[1].1.battery = None,
        &["vehicle 2: battery"],
    );
    wrong(
        |swarm| swarm.states[1].1.battery = Some(Permille(500)),
        &["vehicle 2: battery"],
    );
    wrong(
        |swarm| swarm.states[1].1.mode = VehicleMode::Held,
        &["vehicle 2: mode"],
    );
    wrong(
        |swarm| swarm.states[1].1.mode = VehicleMode::MotorsCut,
        &["vehicle 2: mode"],
    );
    wrong(
        |swarm| swarm.states[1].1.control = Control::Remote,
        &["vehicle 2: control"],
    );
    wrong(
        |swarm| swarm.states[1].1.control = Control::Own,
        &["vehicle 2: control"],
    );
    wrong(
        |swarm| swarm.states[1].1.control = Control::Silent,
        &["vehicle 2: control"],
    );
    wrong(
        |swarm| swarm.healths[0].hears.clear(),
        &["vehicle 1: radio"],
    );
    wrong(
        |swarm| swarm.healths[0].disk_free_mb = Some(200),
        &["vehicle 1: disk"],
    );
    let recording = RecordingHealth {
        used_mb: 0,
        limit_mb: 4800,
    };
    wrong(
        |swarm| swarm.healths[0].recording = Some(recording),
        &["vehicle 1: disk"],
    );
    wrong(
        |swarm| swarm.healths[0].samples_lost = 1,
        &["vehicle 1: samples"],
    );
    wrong(
        |swarm| swarm.healths[0].troubles.push("radio: silent".to_owned()),
        &["vehicle 1: troubles"],
    );
}

#[test]
fn a_low_voltage_or_a_hot_processor_refuse_and_the_clock_is_only_shown() {
    let found = |change: fn(&mut Health)| {
        let mut swarm = Swarm::sound();
        change(&mut swarm.healths[0]);
        let nodes = inspect(&swarm.view(), &needs(), at(NOW_S));
        let rows = nodes[0]
            .checks
            .iter()
            .filter(|check| ["power", "temperature", "clock"].contains(&check.what));
        rows.map(|check| (check.light, check.found.clone()))
            .collect::<Vec<(CheckStatus, String)>>()
    };
    let unknown = (CheckStatus::Unknown, "not reported".to_owned());
    assert_eq!(found(|_| {}), vec![unknown; 3]);
    let bad = found(|health| {
        (health.power, health.processor_c) = (Power::Low, Some(80));
        health.is_clock_synchronised = Some(false);
    });
    let lights: Vec<CheckStatus> = bad.iter().map(|(light, _)| *light).collect();
    assert_eq!(
        lights,
        [CheckStatus::NoGo, CheckStatus::NoGo, CheckStatus::Go]
    );
    assert!(bad[2].1.starts_with("not synchronised"), "{bad:?}");
    let good = found(|health| {
        (health.power, health.processor_c) = (Power::WasLow, Some(79));
        health.is_clock_synchronised = Some(true);
    });
    assert!(good.iter().all(|(light, _)| *light == CheckStatus::Go));
    assert!(good[0].1.contains("was too low at times"), "{good:?}");
    wrong(
        |swarm| swarm.healths[0].power = Power::Low,
        &["vehicle 1: power"],
    );
    wrong(
        |swarm| swarm.healths[0].processor_c = Some(85),
        &["vehicle 1: temperature"],
    );
}

#[test]
fn failsafes_that_are_off_or_lead_home_in_a_straight_line_refuse_and_others_are_named() {
    use FailsafeAction::{Hold, Land, Off, Return};
    let found = |failsafes: Failsafes| {
        let mut swarm = Swarm::sound();
        swarm.healths[0].autopilot = Some(AutopilotHealth {
            failsafes,
            ..AutopilotHealth::default()
        });
        let nodes = inspect(&swarm.view(), &needs(), at(NOW_S));
        let is_failsafes = |check: &&Check| check.what == "failsafes";
        let check = nodes[0].checks.iter().find(is_failsafes).unwrap();
        (check.light, check.found.clone())
    };
    let good = Failsafes {
        battery: Hold,
        companion: Hold,
        remote: Return,
        fence: Land,
        estimator: Off,
    };
    let said = "battery holds, companion holds, fence lands, remote returns in a straight line, estimator off";
    assert_eq!(found(good), (CheckStatus::Go, said.to_owned()));
    let wrong = |change: fn(&mut Failsafes)| {
        let mut failsafes = good;
        change(&mut failsafes);
        found(failsafes).0
    };
    assert_eq!(wrong(|one| one.companion = Off), CheckStatus::NoGo);
    assert_eq!(wrong(|one| one.battery = Return), CheckStatus::NoGo);
    assert_eq!(
        wrong(|one| one.fence = FailsafeAction::Other),
        CheckStatus::NoGo
    );
    let unknown = (CheckStatus::Unknown, "not reported".to_owned());
    assert_eq!(found(Failsafes::default()), unknown);
}

#[test]
fn a_vehicle_names_its_devices_and_one_that_a_run_needs_is_missed() {
    let found = |change: &dyn Fn(&mut Swarm)| {
        let mut swarm = Swarm::sound();
        change(&mut swarm);
        let nodes = inspect(&swarm.view(), &needs(), at(NOW_S));
        let devices = nodes[0]
            .checks
            .iter()
            .find(|check| check.what == "devices")
            .unwrap();
        (devices.light, devices.found.clone())
    };
    let all = "autopilot: simulated (rover); range sensor: serial text; servo: simulated; radio: simulated";
    assert_eq!(found(&|_| {}), (CheckStatus::Go, all.to_owned()));
    let counted = |swarm: &mut Swarm| {
        swarm.healths[0].range = Some(RangeHealth {
            glitches: 3,
            faults: 4,
        })
    };
    let counts = format!("{all}; range: 3 glitches, 4 pings without an answer");
    assert_eq!(found(&counted), (CheckStatus::Go, counts));
    let has = |without: usize| {
        move |swarm: &mut Swarm| {
            swarm.hellos[0].capabilities.remove(without);
        }
    };
    assert_eq!(
        found(&has(2)).0,
        CheckStatus::Go,
        "a range sensor may be fixed"
    );
    for (without, missed) in [
        (0, "no autopilot"),
        (1, "no range sensor: it sees nothing"),
        (3, "no radio"),
    ] {
        let (light, found) = found(&has(without));
        assert!(
            light == CheckStatus::NoGo && found.starts_with(missed),
            "{found}"
        );
        wrong(has(without), &["vehicle 1: devices"]);
    }
    let says_nothing = |swarm: &mut Swarm| swarm.hellos[0].capabilities.clear();
    assert_eq!(
        found(&says_nothing),
        (CheckStatus::Unknown, "not reported".to_owned())
    );
}

#[test]
fn each_check_of_the_ground_can_refuse() {
    wrong(
        |swarm| {
            swarm.reports.push(GroundReport {
                store: 2,
                ..Swarm::sound().reports[0].clone()
            })
        },
        &["ground: bus"],
    );
    wrong(
        |swarm| swarm.hellos[2].software = "9".to_owned(),
        &["ground: software"],
    );
    wrong(|swarm| swarm.hellos[2].venue_hash = 6, &["ground: venue"]);
    wrong(
        |swarm| swarm.reports[0].lease = Lease::default(),
        &["ground: lease"],
    );
    wrong(
        |swarm| swarm.reports[0].phase = StationPhase::Running,
        &["ground: phase"],
    );
    for kind in [OrderKind::Hold, OrderKind::CutMotors] {
        wrong(
            |swarm| swarm.reports[0].in_force = Some(kind),
            &["ground: standing"],
        );
    }
    // Who is at home has come home.
    wrong(
        |swarm| swarm.reports[0].in_force = Some(OrderKind::Return),
        &[],
    );
    wrong(
        |swarm| swarm.reports[0].members = vec![VehicleId(1)],
        &["ground: vehicles"],
    );
    wrong(
        |swarm| {
            swarm.reports[0]
                .troubles
                .push("store: disk full".to_owned())
        },
        &["ground: troubles"],
    );
    // The disk has a row of its own.
    let short = || format!("{DISK_TROUBLE}: {}", disk_room(200, None).1);
    wrong(
        |swarm| swarm.reports[0].troubles.push(short()),
        &["ground: disk"],
    );
    wrong(
        |swarm| {
            let others = ["disks: two".to_owned(), "store: disk: full".to_owned()];
            swarm.reports[0].troubles.extend(others);
        },
        &["ground: troubles"],
    );
    // The next run may begin after one that has failed.
    let failed = |run: u32| {
        move |swarm: &mut Swarm| {
            let report = &mut swarm.reports[0];
            report.runs = vec![RunReport {
                run: RunId(9),
                end: Some(RunEnd::Failed),
                ..RunReport::default()
            }];
            report.troubles = vec![format!("run {run} has failed: too few positions")];
        }
    };
    wrong(failed(9), &[]);
    wrong(failed(8), &["ground: troubles"]);
    let higher = Rover::ordered(
        1,
        Lease {
            number: 5,
            holder: 1,
        },
        1,
        OrderKind::Start,
    )
    .state;
    wrong(
        |swarm| swarm.states[0].1.ordered = higher.ordered,
        &["ground: lease"],
    );
}

#[test]
fn the_ground_has_a_row_for_its_disk_that_says_how_much_room_is_missing() {
    let row = |trouble: Option<(u32, RecordingHealth)>| {
        let mut swarm = Swarm::sound();
        let said = trouble.map(|(free_mb, recording)| {
            format!("{DISK_TROUBLE}: {}", disk_room(free_mb, Some(recording)).1)
        });
        swarm.reports[0].troubles.extend(said);
        let nodes = inspect(&swarm.view(), &needs(), at(NOW_S));
        let ground = nodes.iter().find(|node| node.node == "ground").unwrap();
        let mut disks = ground.checks.iter().filter(|check| check.what == "disk");
        let disk = disks.next().unwrap();
        (disk.light, disk.found.clone())
    };
    let room = "enough for a run, else it would say so".to_owned();
    assert_eq!(row(None), (CheckStatus::Go, room));
    let recording = RecordingHealth {
        used_mb: 56,
        limit_mb: 256,
    };
    let short = "300 MB free, over 400 MB needed: 200 MB, and 200 MB for recordings (56 of 256 MB)";
    assert_eq!(
        row(Some((300, recording))),
        (CheckStatus::NoGo, short.to_owned())
    );
    let mut silent = Swarm::sound();
    silent.reports.clear();
    assert!(refusals(silent, &needs()).contains(&"ground: disk".to_owned()));
}

#[test]
fn who_says_nothing_is_refused_but_for_what_need_not_be_known() {
    let mut swarm = Swarm::sound();
    swarm.states.pop();
    swarm.healths[0].disk_free_mb = None;
    let refused = refusals(swarm, &needs());
    assert!(
        refused
            .iter()
            .all(|refusal| refusal.starts_with("vehicle 2: ")),
        "{refused:?}"
    );
    assert!(refused.contains(&"vehicle 2: bus".to_owned()));
    let mut silent = Swarm::sound();
    silent.reports.clear();
    assert!(refusals(silent, &needs()).contains(&"ground: bus".to_owned()));
}

#[test]
fn the_limit_of_the_pose_is_that_of_the_file_or_said_to_be_assumed() {
    let strict = Requirements {
        pose_sd_max_m: Some(0.04),
        ..needs()
    };
    assert_eq!(
        refusals(Swarm::sound(), &strict),
        ["vehicle 1: pose", "vehicle 2: pose"]
    );
    let nodes = inspect(&Swarm::sound().view(), &needs(), at(NOW_S));
    let assumed = &nodes[0]
        .checks
        .iter()
        .find(|check| check.what == "pose")
        .unwrap()
        .found;
    assert!(assumed.contains("at most 0.50 m (assumed"), "{assumed}");
}

#[test]
fn nobody_is_no_swarm() {
    let nobody = Requirements {
        vehicles: BTreeSet::new(),
        ..needs()
    };
    assert!(!is_go(&inspect(&Swarm::sound().view(), &nobody, at(NOW_S))));
}

#[test]
fn a_radio_that_has_sent_nothing_refuses_and_one_that_sends_is_shown() {
    let shown = |sent, unsent| {
        let mut swarm = Swarm::sound();
        swarm.healths[0].radio = Some(RadioHealth {
            sent,
            unsent,
            busy: 3,
            bad: 1,
            reopens: 2,
        });
        let nodes = inspect(&swarm.view(), &needs(), at(NOW_S));
        let mut checks = nodes[0].checks.iter();
        let radio = checks.find(|check| check.what == "radio").unwrap();
        (is_go(&nodes), radio.light, radio.found.clone())
    };
    let counts =
        "5 not sent, 3 of them as the channel was busy, 1 bad frames, 2 times opened again";
    let found = format!("hears 2; 400 sent, {counts}");
    assert_eq!(shown(400, 5), (true, CheckStatus::Go, found));
    for unsent in [0, 5] {
        let (is_go, light, found) = shown(0, unsent);
        assert_eq!((is_go, light), (false, CheckStatus::NoGo), "{found}");
    }
}

#[test]
fn a_vehicle_that_names_as_many_as_a_beacon_does_may_hear_more() {
    let all: Vec<VehicleId> = (1..=20).map(VehicleId).collect();
    let needs = Requirements {
        vehicles: all.iter().copied().collect(),
        ..needs()
    };
    let hears = |count: usize| Health {
        hears: all[1..=count].to_vec(),
        ..health(1, 2)
    };
    let is_go = |count: usize| super::radio(VehicleId(1), &hears(count), &needs).0;
    assert!(is_go(BEACON_MEMBERS_MAX) && is_go(19));
    assert!(
        !is_go(BEACON_MEMBERS_MAX - 1),
        "with room for one more it would have been named"
    );
}
