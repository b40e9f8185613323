//! Somebody who says frames in the names of the swarm's own nodes, on an unprotected bus: once that ends, the sweep must be
//! brought to its end without any process being started anew. Every way of forging by itself, in virtual time, is in
//! `src/sim/kernel/tests/forging.rs`.

use std::sync::Arc;
use std::time::{Duration, Instant};

use tomoswarm_proto::{
    Boot, Digest, GroundReport, Have, HeardFrom, Key, LayerDigest, LayerId, Lease, Message,
    MissionProgress, OperatorId, Order, OrderKind, Ordered, Plan, PoseReport, Position, Progress,
    Revision, RunEnd, RunId, Samples, Sender, State, StationPhase, StopId, TILE_CELLS, TileAddress,
    TileReport, VehicleId, codec,
};

use crate::member::within;
use crate::raw::{Shows, Stranger};
use crate::strangers::sample;
use crate::swarm::{GROUND, Size, Swarm, start, vehicle};

const PREFIX: &str = "tomoswarm/courtyard";
const FORGES_FOR: Duration = Duration::from_secs(10);
const EVERY: Duration = Duration::from_millis(100);
/// A forged start of a vehicle's software is believed for 30 s after its last word.
const BELIEVED_FOR: Duration = Duration::from_secs(32);
/// A sweep that was started ends within this.
const SWEPT_WITHIN: Duration = Duration::from_secs(180);
/// The store that the forger makes up.
const NO_STORE: u64 = 1;
const HIGHEST: Lease = Lease {
    number: u32::MAX,
    holder: u64::MAX,
};
const MOST: u32 = u32::MAX - 1;
/// Sequences of samples that no vehicle has counted to.
pub const FORGED_FROM: u64 = 1 << 32;

/// What vehicle `id` is said to say.
fn of_vehicle(id: VehicleId, turn: u64) -> Vec<Message> {
    let pose = PoseReport {
        at: Position::from_metres(-3.0, 9.0, 0.0),
        ..PoseReport::default()
    };
    let (pose, boot) = (Some(pose), start(1));
    let last = State {
        vehicle: id,
        boot,
        sequence: u64::MAX,
        pose,
        is_at_rest: true,
        ..State::default()
    };
    let kind = Some(OrderKind::Start);
    let ordered = Ordered {
        lease: HIGHEST,
        revision: Revision(MOST),
        run: RunId(MOST),
        kind,
    };
    let highest = State {
        ordered,
        accepted: (RunId(MOST), Revision(MOST)),
        sequence: MOST.into(),
        ..last.clone()
    };
    let last_start = State {
        boot: Boot(u32::MAX),
        sequence: turn,
        ..last.clone()
    };
    let done = Some(StopId(MOST));
    let progress = Progress {
        run: RunId(1),
        revision: Revision(900),
        done,
        leg: None,
    };
    let later_plan = MissionProgress {
        vehicle: id,
        boot,
        progress,
        ..MissionProgress::default()
    };
    let highest_plan = MissionProgress {
        lease_number: u32::MAX,
        ..later_plan
    };
    let progress_of_last_start = MissionProgress {
        boot: Boot(u32::MAX),
        ..later_plan
    };
    let samples = Samples {
        vehicle: id,
        boot,
        run: RunId(1),
        samples: vec![sample(u64::MAX - 1 - turn)],
        lost: vec![],
    };
    let layer = LayerId { vehicle: id, boot };
    let held = LayerDigest {
        layer,
        tiles: u32::MAX,
        revisions: u64::MAX,
        hash: 7,
    };
    let cells = Arc::new([127; TILE_CELLS]);
    let tile = |revision, (x, y)| {
        let address = TileAddress { slice: 0, x, y };
        Message::Tile(TileReport {
            layer,
            address,
            revision,
            cells: cells.clone(),
        })
    };
    let places = [(0, 0), (0, -1), (-1, 0), (-1, -1)];
    let mut all = vec![
        Message::State(last),
        Message::State(highest),
        Message::State(last_start),
        Message::Mission(later_plan),
        Message::Mission(highest_plan),
        Message::Mission(progress_of_last_start),
        Message::Samples(samples),
        Message::Digest(Digest { layers: vec![held] }),
    ];
    all.extend(places.map(|place| tile(u32::MAX, place)));
    all.extend(places.map(|place| tile(100_000, place)));
    all
}

/// What the ground station, which says this report of itself, is said to say.
fn of_ground(real: &GroundReport) -> Vec<Message> {
    let members = vec![VehicleId(1), VehicleId(2)];
    let (run, revision) = (RunId(1), Revision(900));
    let vehicle = VehicleId(1);
    let later = Plan {
        vehicle,
        lease: real.lease,
        run,
        revision,
        members: members.clone(),
        ..Plan::default()
    };
    let highest = Plan {
        lease: HIGHEST,
        run: RunId(MOST),
        revision: Revision(MOST),
        ..later.clone()
    };
    let mark = |vehicle: &VehicleId| HeardFrom {
        vehicle: *vehicle,
        boot: start(1),
        run,
        below: u64::MAX,
    };
    let have = Have {
        store: real.store,
        watermarks: members.iter().map(mark).collect(),
        closed: vec![run],
    };
    let phase = StationPhase::Closing;
    let report = GroundReport {
        lease: HIGHEST,
        store: NO_STORE,
        phase,
        run: RunId(MOST),
        ..real.clone()
    };
    vec![
        Message::Plan(later),
        Message::Plan(highest),
        Message::Have(Have {
            store: NO_STORE,
            ..have.clone()
        }),
        Message::Have(have),
        Message::Report(GroundReport {
            lease: real.lease,
            run,
            ..report.clone()
        }),
        Message::Report(report),
    ]
}

/// What is said in the name of an operator, or of the ground station, to a vehicle.
fn orders(id: VehicleId, lease: Lease) -> [Message; 2] {
    let (kind, seen, ends) = (OrderKind::Hold, None, vec![]);
    let order = Order {
        vehicle: id,
        lease,
        run: RunId(1),
        revision: Revision(1),
        seen,
        kind,
        ends,
    };
    let highest = Order {
        lease: HIGHEST,
        revision: Revision(MOST),
        run: RunId(MOST),
        ..order.clone()
    };
    [Message::Order(order), Message::Order(highest)]
}

fn forge(stranger: &Stranger, real: &GroundReport, turn: u64) {
    let say = |sender: Sender, message: &Message| {
        let bytes = codec::encode(message).unwrap();
        stranger.say(&format!("{PREFIX}/{}", Key::of(sender, message)), &bytes);
    };
    let higher = Lease {
        number: real.lease.number + 900,
        holder: 99,
    };
    for id in [1, 2].map(VehicleId) {
        of_vehicle(id, turn)
            .iter()
            .for_each(|message| say(Sender::Vehicle(id), message));
        orders(id, higher)
            .iter()
            .for_each(|message| say(Sender::Operator(OperatorId(1)), message));
        orders(id, real.lease)
            .iter()
            .for_each(|message| say(GROUND, message));
    }
    of_ground(real)
        .iter()
        .for_each(|message| say(GROUND, message));
}

/// Returns the runs that the ground station says to be done.
fn done(swarm: &Swarm) -> Vec<RunId> {
    swarm.look(|watch| {
        let reports = watch.view.grounds().map(|report| &report.value);
        let runs = reports
            .filter(|report| report.store != NO_STORE)
            .flat_map(|report| report.runs.clone());
        runs.filter(|run| run.end == Some(RunEnd::Done))
            .map(|run| run.run)
            .collect()
    })
}

#[test]
fn what_is_forged_in_the_names_of_all_is_outlived_without_a_restart() {
    let mut swarm = Swarm::start(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    });
    let all: Vec<_> = [GROUND, vehicle(1), vehicle(2)]
        .map(|node| swarm.address(node))
        .to_vec();
    let stranger = Stranger::peer(Shows::Nothing, None, &all);
    while stranger.links() < 3 {
        std::thread::sleep(Duration::from_millis(50));
    }
    swarm.begin();
    swarm.until_samples(50);
    let real = swarm.look(|watch| watch.report());
    let began = Instant::now();
    for turn in 0.. {
        if began.elapsed() > FORGES_FOR {
            break;
        }
        forge(&stranger, &real, turn);
        std::thread::sleep(EVERY);
    }
    swarm.note("the forger has ended");
    std::thread::sleep(BELIEVED_FOR);
    // It has ordered everybody to hold: that stands until an operator says otherwise, whoever has said it.
    let before = done(&swarm);
    let began = Instant::now();
    swarm.order(&["start"]);
    let news = || done(&swarm).into_iter().find(|run| !before.contains(run));
    let swept = within(SWEPT_WITHIN, || news().is_some())
        .then(news)
        .flatten();
    let reports = || swarm.look(|watch| format!("{:?}", watch.view.grounds().collect::<Vec<_>>()));
    let Some(swept) = swept else {
        panic!("no sweep has ended: {}", reports())
    };
    swarm.note(&format!(
        "run {swept} is done, {:.1} s after the start",
        began.elapsed().as_secs_f64()
    ));
    swarm.finish_after_forgery(swept);
    for node in [GROUND, vehicle(1), vehicle(2)] {
        let says = swarm.log_of(node).contains("a number far above all others");
        assert!(says, "{node} has believed everything");
    }
}
