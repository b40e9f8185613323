//! Somebody says frames in the names of others for some seconds, on a bus without certificates: once that ends, everything
//! must come right again without anybody being started anew. An operator may have to say once more what it wants.

use std::sync::Arc;

use tomoswarm_proto::{
    Digest, EmergencyName, EmergencyStop, GroundReport, Have, HeardFrom, Hello, LayerDigest,
    LayerId, Message, MissionEnd, MissionProgress, OpenStops, Ordered, Plan, PoseReport, Position,
    Progress, RunEnd, Sample, Samples, SeenState, State, StationPhase, StopId, StopScope,
    TILE_CELLS, Task, TaskKind, TileAddress, TileReport, VehicleId, codec,
};

use super::*;
use crate::map::Merged;
use crate::node::VehicleNode;
use crate::sim::bus::BusFrame;

/// It lasts so long, and something is said so often.
const FORGES_FOR_S: f64 = 10.0;
const EVERY_S: f64 = 0.1;
/// So long after its end the operator says once more that they shall go on: a forged start is believed for 30 s.
const AGAIN_AFTER_S: f64 = 65.0;
/// So long after that a sweep must have come to its end; undisturbed it takes half a minute.
const LIMIT_S: u32 = 120;
/// A sweep has so many samples at least.
const FEWEST_SAMPLES: u64 = 500;
const MOST: u32 = u32::MAX - 1;
/// As high as anybody believes at once.
const HIGH: u32 = 1 << 30;

/// What whoever forges knows, since it listens.
#[derive(Clone, Copy)]
struct Known {
    lease: Lease,
    store: u64,
    venue_hash: u64,
    /// What vehicle 1 follows.
    run: RunId,
    revision: Revision,
    /// Counts what was forged.
    turn: u64,
}

impl Known {
    fn higher_lease(&self, by: u32) -> Lease {
        Lease {
            number: self.lease.number + by,
            holder: 99,
        }
    }
}

const HIGHEST: Lease = Lease {
    number: u32::MAX,
    holder: u64::MAX,
};

fn vehicles() -> [VehicleId; 2] {
    [VehicleId(1), VehicleId(2)]
}

fn state(vehicle: VehicleId) -> State {
    let at = Position::from_metres(-3.0, 9.0, 0.0);
    let pose = Some(PoseReport {
        at,
        ..PoseReport::default()
    });
    State {
        vehicle,
        boot: Boot(1),
        sequence: u64::MAX,
        pose,
        is_at_rest: true,
        ..State::default()
    }
}

fn mission(vehicle: VehicleId, run: u32, revision: u32) -> MissionProgress {
    let done = Some(StopId(MOST));
    let progress = Progress {
        run: RunId(run),
        revision: Revision(revision),
        done,
        leg: None,
    };
    MissionProgress {
        vehicle,
        boot: Boot(1),
        progress,
        end: Some(MissionEnd::Done),
        ..MissionProgress::default()
    }
}

fn plan(vehicle: VehicleId, lease: Lease, run: u32, revision: u32) -> Plan {
    let (run, revision, members) = (RunId(run), Revision(revision), vehicles().to_vec());
    Plan {
        vehicle,
        lease,
        run,
        revision,
        members,
        ..Plan::default()
    }
}

fn hold(vehicle: VehicleId, lease: Lease, run: u32, revision: u32) -> Order {
    let (run, revision, kind) = (RunId(run), Revision(revision), OrderKind::Hold);
    let seen: Option<SeenState> = None;
    Order {
        vehicle,
        lease,
        run,
        revision,
        seen,
        kind,
        ends: Vec::new(),
    }
}

fn tiles(vehicle: VehicleId, revision: u32) -> Vec<Message> {
    let layer = LayerId {
        vehicle,
        boot: Boot(1),
    };
    let places = (-2..4).flat_map(|x| (-2..4).map(move |y| TileAddress { slice: 0, x, y }));
    let cells = Arc::new([127; TILE_CELLS]);
    places
        .map(|address| {
            Message::Tile(TileReport {
                layer,
                address,
                revision,
                cells: cells.clone(),
            })
        })
        .collect()
}

fn samples(vehicle: VehicleId, sequence: u64) -> Samples {
    let sample = Sample {
        sequence,
        heard_at_ns: 1,
        transmitter: VehicleId(1),
        transmitter_pose: PoseReport::default(),
        receiver_pose: PoseReport::default(),
        channel: 15,
        power_dbm: 0,
        rssi_dbm: Some(-50),
    };
    let samples = vec![sample];
    Samples {
        vehicle,
        boot: Boot(1),
        run: RunId(1),
        samples,
        lost: Vec::new(),
    }
}

fn have(store: u64) -> Have {
    let mark = |vehicle| HeardFrom {
        vehicle,
        boot: Boot(1),
        run: RunId(1),
        below: u64::MAX,
    };
    Have {
        store,
        watermarks: vehicles().map(mark).to_vec(),
        closed: vec![RunId(1)],
    }
}

fn digest() -> Digest {
    let layer = |vehicle| LayerId {
        vehicle: VehicleId(vehicle),
        boot: Boot(1),
    };
    let all = |vehicle| LayerDigest {
        layer: layer(vehicle),
        tiles: u32::MAX,
        revisions: u64::MAX,
        hash: 7,
    };
    Digest {
        layers: (0..=255).map(all).collect(),
    }
}

fn report(store: u64, lease: Lease) -> GroundReport {
    let members = vehicles().to_vec();
    GroundReport {
        lease,
        store,
        phase: StationPhase::Running,
        run: RunId(MOST),
        members,
        ..GroundReport::default()
    }
}

fn greeting(node: Sender, lease: Option<Lease>, venue_hash: u64) -> Hello {
    Hello {
        node,
        boot: Boot(1),
        venue_hash,
        instance: 1,
        is_member: true,
        member_for_s: 0,
        name: String::new(),
        software: String::new(),
        capabilities: Vec::new(),
        lease,
        interest: Vec::new(),
    }
}

/// A way of forging: its name, and what is said at every turn.
type Forgery = (&'static str, fn(Known) -> Vec<(Sender, Message)>);

fn of_vehicles(output: impl Fn(VehicleId) -> Message) -> Vec<(Sender, Message)> {
    vehicles()
        .map(|id| (Sender::Vehicle(id), output(id)))
        .to_vec()
}

fn of_ground(output: impl Fn(VehicleId) -> Message) -> Vec<(Sender, Message)> {
    vehicles().map(|id| (Sender::Ground, output(id))).to_vec()
}

const FORGERIES: &[Forgery] = &[
    ("nothing", |_| vec![]),
    ("states of the last number", |_| {
        of_vehicles(|id| Message::State(state(id)))
    }),
    ("states of the last start", |_| {
        of_vehicles(|id| {
            Message::State(State {
                boot: Boot(u32::MAX),
                ..state(id)
            })
        })
    }),
    ("states that show the highest of all", |known| {
        let ordered = Ordered {
            lease: HIGHEST,
            revision: Revision(MOST),
            run: RunId(MOST),
            kind: Some(OrderKind::Start),
        };
        let accepted = (RunId(MOST), Revision(MOST));
        let sequence = u64::MAX / 2 + known.turn;
        of_vehicles(|id| {
            Message::State(State {
                ordered,
                accepted,
                sequence,
                ..state(id)
            })
        })
    }),
    ("states that show a stop under a higher lease", |known| {
        let lease = known.higher_lease(900);
        let ordered = Ordered {
            lease,
            revision: Revision(9),
            run: RunId(1),
            kind: Some(OrderKind::Hold),
        };
        let sequence = u64::MAX / 2 + known.turn;
        of_vehicles(|id| {
            Message::State(State {
                ordered,
                sequence,
                ..state(id)
            })
        })
    }),
    ("missions of the highest plan", |_| {
        of_vehicles(|id| {
            Message::Mission(MissionProgress {
                lease_number: u32::MAX,
                ..mission(id, MOST, MOST)
            })
        })
    }),
    ("missions that are done", |known| {
        of_vehicles(|id| Message::Mission(mission(id, known.run.0, known.revision.0)))
    }),
    ("missions of a later plan", |_| {
        of_vehicles(|id| Message::Mission(mission(id, 1, 900)))
    }),
    ("missions of the last start", |_| {
        of_vehicles(|id| {
            Message::Mission(MissionProgress {
                boot: Boot(u32::MAX),
                ..mission(id, 1, 900)
            })
        })
    }),
    ("a plan of the highest lease", |_| {
        vec![(
            Sender::Ground,
            Message::Plan(plan(VehicleId(1), HIGHEST, MOST, MOST)),
        )]
    }),
    ("a later plan of the lease in force", |known| {
        vec![(
            Sender::Ground,
            Message::Plan(plan(VehicleId(1), known.lease, 1, 900)),
        )]
    }),
    ("a later plan of a higher lease", |known| {
        vec![(
            Sender::Ground,
            Message::Plan(plan(VehicleId(1), known.higher_lease(900), 1, 900)),
        )]
    }),
    ("whole plans of the next run", |known| {
        of_ground(|id| Message::Plan(plan(id, known.lease, 2, 1)))
    }),
    ("whole plans of the highest run", |known| {
        of_ground(|id| Message::Plan(plan(id, known.lease, MOST, MOST)))
    }),
    ("orders of the highest lease", |_| {
        of_ground(|id| Message::Order(hold(id, HIGHEST, MOST, MOST)))
    }),
    ("orders of the last revision", |known| {
        of_ground(|id| Message::Order(hold(id, known.lease, 1, MOST)))
    }),
    ("orders of an operator", |known| {
        let output = |id| Message::Order(hold(id, known.higher_lease(900), 1, 1));
        vehicles()
            .map(|id| (Sender::Operator(OperatorId(1)), output(id)))
            .to_vec()
    }),
    ("everything is stored", |known| {
        vec![(Sender::Ground, Message::Have(have(known.store)))]
    }),
    ("another store has everything", |_| {
        vec![(Sender::Ground, Message::Have(have(1)))]
    }),
    ("samples far ahead", |known| {
        let output = |id| Message::Samples(samples(id, u64::MAX - 1 - known.turn));
        of_vehicles(output)
    }),
    ("digests of everything", |_| {
        of_vehicles(|_| Message::Digest(digest()))
    }),
    ("tiles of the last revision", |_| {
        let of = |id| {
            tiles(id, u32::MAX)
                .into_iter()
                .map(move |tile| (Sender::Vehicle(id), tile))
        };
        vehicles().into_iter().flat_map(of).collect()
    }),
    ("reports of the highest lease", |_| {
        vec![(Sender::Ground, Message::Report(report(1, HIGHEST)))]
    }),
    ("reports of an elder ground", |known| {
        vec![(Sender::Ground, Message::Report(report(1, known.lease)))]
    }),
    ("an operator of the highest lease", |known| {
        let node = Sender::Operator(OperatorId(1));
        vec![(
            node,
            Message::Hello(greeting(node, Some(HIGHEST), known.venue_hash)),
        )]
    }),
    ("an operator of a higher lease", |known| {
        let node = Sender::Operator(OperatorId(1));
        let lease = Some(known.higher_lease(900));
        vec![(
            node,
            Message::Hello(greeting(node, lease, known.venue_hash)),
        )]
    }),
    ("greetings of another venue", |_| {
        let all = vehicles()
            .map(Sender::Vehicle)
            .into_iter()
            .chain([Sender::Ground]);
        all.map(|node| (node, Message::Hello(greeting(node, None, 1))))
            .collect()
    }),
    ("stops of invented names", |known| {
        let name = EmergencyName(EmergencyName::LOWEST_DRAWN + u32::try_from(known.turn).unwrap());
        let stop = EmergencyStop {
            name,
            scope: StopScope::All,
            by: OperatorId(1),
        };
        of_vehicles(|_| {
            Message::Standing(OpenStops {
                open: vec![stop],
                lifted: vec![],
            })
        })
    }),
    ("a vehicle that is not there", |known| {
        let at = Position::from_metres(0.0, f64::from(known.turn as u32) / 20.0, 0.0);
        let pose = Some(PoseReport {
            at,
            ..PoseReport::default()
        });
        let id = VehicleId(20 + known.turn as u8);
        vec![(
            Sender::Vehicle(id),
            Message::State(State { pose, ..state(id) }),
        )]
    }),
    ("states that show high numbers", |known| {
        let lease = known.higher_lease(900);
        let ordered = Ordered {
            lease,
            revision: Revision(HIGH),
            run: RunId(HIGH),
            kind: Some(OrderKind::Start),
        };
        let sequence = u64::MAX / 2 + known.turn;
        let accepted = (RunId(HIGH), Revision(HIGH));
        of_vehicles(|id| {
            Message::State(State {
                ordered,
                accepted,
                sequence,
                ..state(id)
            })
        })
    }),
    ("missions of a high plan", |known| {
        let lease_number = known.lease.number + 900;
        of_vehicles(|id| {
            Message::Mission(MissionProgress {
                lease_number,
                ..mission(id, HIGH, HIGH)
            })
        })
    }),
    ("a plan of a high run", |known| {
        vec![(
            Sender::Ground,
            Message::Plan(plan(VehicleId(1), known.higher_lease(900), HIGH, HIGH)),
        )]
    }),
    ("whole plans of a high run", |known| {
        of_ground(|id| Message::Plan(plan(id, known.lease, HIGH, HIGH)))
    }),
    ("orders of a high revision", |known| {
        of_ground(|id| Message::Order(hold(id, known.lease, HIGH, HIGH)))
    }),
    ("leases that rise step by step", |known| {
        let lease = known.higher_lease(u32::try_from(known.turn).unwrap() * 1000);
        of_ground(|id| Message::Order(hold(id, lease, 1, 1)))
    }),
    ("tiles of a later revision", |_| {
        let of = |id| {
            tiles(id, 5000)
                .into_iter()
                .map(move |tile| (Sender::Vehicle(id), tile))
        };
        vehicles().into_iter().flat_map(of).collect()
    }),
    ("a task of a high run", |known| {
        let (lease, members) = (known.lease, vehicles().to_vec());
        let kind = TaskKind::Explore;
        let task = Task {
            lease,
            run: RunId(HIGH),
            members,
            compare_with: None,
            kind,
        };
        vec![(Sender::Operator(OperatorId(1)), Message::Task(task))]
    }),
    ("a task of the run under way", |known| {
        let (lease, members) = (known.lease, vehicles().to_vec());
        let task = Task {
            lease,
            run: RunId(1),
            members,
            compare_with: None,
            kind: TaskKind::Browse,
        };
        vec![(Sender::Operator(OperatorId(1)), Message::Task(task))]
    }),
    ("a task of the highest run", |known| {
        let (lease, members) = (known.lease, vehicles().to_vec());
        let task = Task {
            lease,
            run: RunId(MOST),
            members,
            compare_with: None,
            kind: TaskKind::Explore,
        };
        vec![(Sender::Operator(OperatorId(1)), Message::Task(task))]
    }),
];

/// A sweep of one lap, and who says after a while that it shall go on.
fn kernel(again_s: f64) -> (Kernel, u64) {
    let mut read = |name: &str| {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
        std::fs::read_to_string(path).map_err(|error| error.to_string())
    };
    let name = "configs/small.sim.toml";
    let text = read(name).unwrap().replace("laps = 2", "laps = 1");
    let sim = config::read_sim(name, &text, None, &mut read).unwrap();
    let mut scenario = Scenario::new(sim, Vec::new(), 1).unwrap();
    scenario.shown_every = Duration::from_millis(100);
    let mut parts = scenario.parts().unwrap();
    let begins = |run| {
        operator_script::ScriptStep::Want(OrderGoal {
            run,
            begins: true,
            lifts_many: true,
            ..OrderGoal::new(OrderKind::Start, BTreeSet::new(), Duration::from_secs(5))
        })
    };
    let delay = operator_script::ScriptStep::Delay;
    let stays = Duration::from_secs(3000);
    let first = vec![
        delay(Duration::from_secs(2)),
        begins(Some(RunId(1))),
        delay(stays),
    ];
    let at = |at_s: f64| {
        vec![
            delay(Duration::from_secs_f64(at_s)),
            begins(None),
            delay(stays),
        ]
    };
    // A start lifts eight stops; what stands for the others is left to another one.
    let again = [(3, 0.0), (4, 6.0)]
        .map(|(number, after_s)| operator(&scenario, number, at(again_s + after_s)));
    parts.operators = [operator(&scenario, 0, first)]
        .into_iter()
        .chain(again)
        .collect();
    (Kernel::new(parts), scenario.sim().venue.hash())
}

/// Says a frame in the name of somebody to everyone, whoever that is.
fn say(kernel: &mut Kernel, sender: Sender, message: &Message) {
    let frame = Arc::new(BusFrame::of_bytes(sender, &codec::encode(message).unwrap()));
    let operators = kernel
        .nodes
        .operators()
        .iter()
        .map(|operator| NodeId::Operator(operator.id()));
    let to: Vec<NodeId> = vehicles()
        .map(NodeId::Vehicle)
        .into_iter()
        .chain([NodeId::Ground])
        .chain(operators)
        .collect();
    for to in to {
        kernel.schedule.push(
            kernel.schedule.now(),
            ScheduledEvent::Deliver {
                to,
                frame: frame.clone(),
            },
        );
    }
}

/// Forges for a while, from a moment on, and lets an operator start a sweep some time after that; returns what is amiss
/// when that has ended.
fn what_stays(from_s: f64, forge: &dyn Fn(Known) -> Vec<(Sender, Message)>) -> Vec<String> {
    let again_s = from_s + FORGES_FOR_S + AGAIN_AFTER_S;
    let (mut kernel, venue_hash) = kernel(again_s);
    run(&mut kernel, from_s);
    let mut known = known(&kernel, venue_hash);
    while kernel.schedule.now().as_secs_f64() < from_s + FORGES_FOR_S {
        for (sender, message) in forge(known) {
            say(&mut kernel, sender, &message);
        }
        known.turn += 1;
        let next_s = kernel.schedule.now().as_secs_f64() + EVERY_S;
        run(&mut kernel, next_s);
    }
    run(&mut kernel, again_s);
    let before = done(&kernel);
    for second in 1..LIMIT_S {
        run(&mut kernel, again_s + f64::from(second));
        if let Some(run) = done(&kernel).into_iter().find(|run| !before.contains(run)) {
            return amiss(&mut kernel, run);
        }
    }
    vec![format!(
        "no sweep has ended {LIMIT_S} s after it was started"
    )]
}

fn known(kernel: &Kernel, venue_hash: u64) -> Known {
    let heard = view(&kernel.nodes.operators()[0]);
    let report = &heard
        .ground(kernel.schedule.now())
        .expect("it is heard")
        .value;
    let mission = heard
        .vehicle(VehicleId(1))
        .and_then(|seen| seen.mission.as_ref());
    let Progress { run, revision, .. } = mission
        .map(|mission| mission.value.progress)
        .unwrap_or_default();
    Known {
        lease: report.lease,
        store: report.store,
        venue_hash,
        run,
        revision,
        turn: 0,
    }
}

/// Returns the runs that the ground station says to be done.
fn done(kernel: &Kernel) -> Vec<RunId> {
    let report = view(&kernel.nodes.operators()[1])
        .ground(kernel.schedule.now())
        .map(|report| report.value.clone());
    let runs = report.map(|report| report.runs).unwrap_or_default();
    runs.into_iter()
        .filter(|run| run.end == Some(RunEnd::Done))
        .map(|run| run.run)
        .collect()
}

/// Returns what is amiss a while after a sweep's end: samples that are not stored, maps that are not the same.
fn amiss(kernel: &mut Kernel, swept: RunId) -> Vec<String> {
    let later_s = kernel.schedule.now().as_secs_f64() + 20.0;
    run(kernel, later_s);
    let mut amiss = Vec::new();
    for of in [RunId(1), swept] {
        let made: u64 = kernel
            .nodes
            .vehicles()
            .iter()
            .map(|vehicle| vehicle.node().samples_made(of))
            .sum();
        let stored = kernel.nodes.ground().node().station().samples().count(of);
        if stored < made || (of == swept && made < FEWEST_SAMPLES) {
            amiss.push(format!("of {made} samples of run {of} {stored} are stored"));
        }
    }
    // What was seen just now is still on its way.
    let are_equal = (1..=10).any(|second| {
        run(kernel, later_s + f64::from(second));
        have_all_maps(kernel)
    });
    if !are_equal {
        amiss.push("not everybody has what the others have written of the map".to_owned());
    }
    amiss
}

/// Returns whether everybody holds every vehicle's layer as that vehicle has written it.
fn have_all_maps(kernel: &Kernel) -> bool {
    let vehicles = kernel.nodes.vehicles().iter().map(SimulatedVehicle::node);
    let maps: Vec<&Merged> = vehicles
        .clone()
        .map(VehicleNode::map)
        .chain([kernel.nodes.ground().node().station().map()])
        .collect();
    vehicles.clone().all(|writer| {
        let layer = LayerId {
            vehicle: writer.id(),
            boot: writer.boot(),
        };
        maps.iter()
            .all(|map| map.layer(layer) == writer.map().layer(layer))
    })
}

/// Checks that nothing stays of any forgery that begins at a moment.
fn check(from_s: f64) {
    let mut stays: Vec<String> = Vec::new();
    for (name, forge) in FORGERIES {
        let amiss = what_stays(from_s, forge);
        stays.extend(amiss.into_iter().map(|what| format!("{name}: {what}")));
    }
    assert!(stays.is_empty(), "{stays:#?}");
}

#[test]
fn nothing_stays_of_what_was_forged_when_a_sweep_begins() {
    check(3.0);
}

#[test]
fn nothing_stays_of_what_was_forged_in_the_middle_of_a_sweep() {
    check(10.0);
}

#[test]
fn nothing_stays_of_what_was_forged_while_everybody_waits() {
    check(45.0);
}

#[test]
fn nothing_stays_of_everything_at_once() {
    let all = |known: Known| {
        FORGERIES
            .iter()
            .flat_map(|(_, forge)| forge(known))
            .collect()
    };
    for from_s in [3.0, 10.0, 45.0] {
        let amiss = what_stays(from_s, &all);
        assert!(amiss.is_empty(), "{from_s} s: {amiss:?}");
    }
}
