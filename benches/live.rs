//! Figures of the live runtime on this machine, over loopback: `cargo bench --bench live`.
//!
//! - a newly occupied tile, handed to the bus → joined in another vehicle's map, beside a bare put → callback of the
//!   same size, taken in turn in one run;
//! - a scan that calls for a halt → Hold handed to the autopilot's driver, while a search for a path and merging of
//!   tiles keep the other actors busy on 1,000 × 1,000 cells.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender as Channel, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tomoswarm::actor::RestartPolicy;
use tomoswarm::config::{self, bundled};
use tomoswarm::geom::{Angle, Cell, Lattice, Pose};
use tomoswarm::map::CellRect;
use tomoswarm::node::VehicleSettings;
use tomoswarm::node::map::{self, Map};
use tomoswarm::node::sensor::Scan;
use tomoswarm::node::vehicle::{self, AutopilotCommand, Motion, MoveCommand, Telemetry, Vehicle};
use tomoswarm::plan::{Rules, SearchGrid, shortest_cells};
use tomoswarm::run::bus::{BusSession, BusSettings, HeardMessage, SessionTopology};
use tomoswarm::run::clock::Clock;
use tomoswarm::run::live::processes::free_ports;
use tomoswarm::run::mailbox::{Ending, Mailbox, RuntimeContext, Troubles, start_actor};
use tomoswarm_proto::{Boot, LayerId, Message, Sender, TileAddress, TileReport, VehicleId, codec};
use zenoh::Wait;

/// Messages measured, each way.
const ROUNDS: u32 = 1500;
/// Between two of them; so that each meets a quiet system, as a newly seen obstacle does.
const PAUSE: Duration = Duration::from_millis(4);

fn main() {
    println!(
        "machine: {} cores",
        std::thread::available_parallelism().map_or(0, usize::from)
    );
    tile_latency();
    halt_latency();
}

fn free_endpoint() -> String {
    format!("tcp/127.0.0.1:{}", free_ports(1).unwrap()[0])
}

fn bus(
    id: u8,
    listen: &str,
    connect: &[String],
    hear: impl Fn(HeardMessage) + Send + Sync + 'static,
) -> BusSession {
    let settings = BusSettings {
        node: Sender::Vehicle(VehicleId(id)),
        prefix: "tomoswarm/bench".to_owned(),
        topology: SessionTopology::Mesh,
        listen: vec![listen.to_owned()],
        connect: connect.to_vec(),
        trust: None,
        lease: Duration::from_secs(3),
        egress_bytes_per_s: 100_000_000,
        gossip: true,
    };
    let bus = BusSession::open(settings, Clock::start(), Troubles::default(), hear).unwrap();
    bus.publisher().speak();
    bus
}

fn context() -> (RuntimeContext, Receiver<Ending>) {
    let (endings, ended) = channel();
    (
        RuntimeContext {
            clock: Clock::start(),
            troubles: Troubles::default(),
            endings,
        },
        ended,
    )
}

fn sender<T: Send>(channel: Channel<T>) -> impl Fn(T) + Send + Sync {
    let channel = Mutex::new(channel);
    move |what| {
        channel
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .send(what)
            .unwrap_or_default()
    }
}

/// A vehicle of the bundled simulation.
fn settings(id: u8) -> VehicleSettings {
    let mut loader = |name: &str| bundled::load(name);
    let text = loader(bundled::COURTYARD).unwrap();
    let sim = config::read_sim(bundled::COURTYARD, &text, None, &mut loader).unwrap();
    let home = sim.home(VehicleId(id)).unwrap();
    VehicleSettings::from_config(&sim, VehicleId(id), Boot(1), home)
}

fn tile(revision: u32) -> Message {
    let layer = LayerId {
        vehicle: VehicleId(1),
        boot: Boot(1),
    };
    // What a tile looks like: a wall, free space before it, nothing known behind.
    let cell = |index: usize| match index / 32 {
        row if row < 14 => -17,
        14 | 15 => 9 + (index % 3) as i8,
        _ => 0,
    };
    let cells = Arc::new(std::array::from_fn(cell));
    Message::Tile(TileReport {
        layer,
        address: TileAddress::default(),
        revision,
        cells,
    })
}

fn bare(endpoint: &str, is_listening: bool) -> zenoh::Session {
    let (listen, connect) = if is_listening {
        (format!("[\"{endpoint}\"]"), "[]".into())
    } else {
        ("[]".into(), format!("[\"{endpoint}\"]"))
    };
    let text = format!(
        r#"{{"mode":"peer","listen":{{"endpoints":{listen}}},"connect":{{"endpoints":{connect}}},"scouting":{{"multicast":{{"enabled":false}}}}}}"#
    );
    zenoh::open(zenoh::Config::from_json5(&text).unwrap())
        .wait()
        .unwrap()
}

fn tile_latency() {
    let (here, there) = (free_endpoint(), free_endpoint());
    let (joined, by_map) = channel();
    let (context, _ended) = context();
    let mailbox: Mailbox<map::In> = Mailbox::shared("map");
    let settings = settings(2);
    let say = move |out| {
        if let map::Out::Tiles(_) = out {
            joined.send(Instant::now()).unwrap_or_default();
        }
    };
    start_actor(
        &context,
        &mailbox,
        RestartPolicy::StopNode,
        None,
        move || Map::new(settings.clone()),
        say,
    )
    .unwrap();
    let to_map = mailbox.clone();
    let _two = bus(2, &here, &[], move |heard| {
        if let HeardMessage::Message(_, Message::Tile(report)) = heard {
            to_map.tell(map::In::Tile(report));
        }
    });
    let one = bus(1, &there, &[here], |_| {});
    let (heard, by_callback) = channel();
    let heard = sender(heard);
    let endpoint = free_endpoint();
    let receiver = bare(&endpoint, true);
    let subscriber = receiver
        .declare_subscriber("bench/tile")
        .callback(move |_| heard(Instant::now()))
        .wait()
        .unwrap();
    let publisher = bare(&endpoint, false);
    let frame = codec::encode(&tile(1)).unwrap();
    std::thread::sleep(Duration::from_secs(1));
    let (mut ours, mut plain) = (Vec::new(), Vec::new());
    for round in 1..=ROUNDS {
        let message = tile(round);
        let began = Instant::now();
        one.publisher().publish(&message);
        ours.extend(
            by_map
                .recv_timeout(Duration::from_secs(1))
                .ok()
                .map(|at| at - began),
        );
        std::thread::sleep(PAUSE);
        let bytes = frame.clone();
        let began = Instant::now();
        publisher.put("bench/tile", bytes).wait().unwrap();
        plain.extend(
            by_callback
                .recv_timeout(Duration::from_secs(1))
                .ok()
                .map(|at| at - began),
        );
        std::thread::sleep(PAUSE);
    }
    drop(subscriber);
    mailbox.close();
    println!(
        "tile of {} bytes, {} and {} of {ROUNDS} arrived",
        frame.len(),
        ours.len(),
        plain.len()
    );
    let (ours, plain) = (quantiles(ours), quantiles(plain));
    print_row("handed to the bus -> joined", ours);
    print_row("bare put -> callback", plain);
    println!(
        "ratio: median {:.2} (wanted <= 1.5), p99 {:.2} (wanted <= 3)",
        ours.0 / plain.0,
        ours.1 / plain.1
    );
}

/// Rounds of the halt.
const HALTS: u32 = 400;
/// Cells along one side of the map that is searched meanwhile.
const SIDE: i32 = 1000;

fn halt_latency() {
    let (context, _ended) = context();
    let settings = settings(1);
    let mailbox: Mailbox<vehicle::In> = Mailbox::new("vehicle");
    let (stopped, by_driver) = channel();
    let say = move |out| {
        if let vehicle::Out::AutopilotCommand(AutopilotCommand::Stop) = out {
            stopped.send(Instant::now()).unwrap_or_default();
        }
    };
    let home = settings.home;
    let made = settings.clone();
    start_actor(
        &context,
        &mailbox,
        RestartPolicy::StopNode,
        None,
        move || Vehicle::new(made.clone()),
        say,
    )
    .unwrap();
    let is_over = Arc::new(AtomicBool::new(false));
    let busy = keep_busy(&context, &settings, &is_over);
    let pose = Pose {
        at: home,
        heading: Angle::default(),
        sd_m: 0.05,
    };
    let mut spans = Vec::new();
    for round in 0..HALTS {
        let telemetry = |speed_mps, motion| {
            vehicle::In::Telemetry(Telemetry {
                pose,
                flight_state: Default::default(),
                speed_mps,
                battery: Some(1.0),
                motion,
                is_armed: true,
                stored: None,
            })
        };
        // A turn ends the halt of the round before; then it drives again, and something stands 0.4 m ahead.
        mailbox.tell(telemetry(0.0, Motion::Resting));
        mailbox.tell(vehicle::In::Command(
            context.clock.now(),
            MoveCommand::Turn(Angle::from_degrees(f64::from(round))),
        ));
        mailbox.tell(telemetry(0.5, Motion::Driving));
        std::thread::sleep(Duration::from_millis(20));
        let scan = Scan {
            pose,
            beam: Angle::default(),
            range_m: Some(0.4),
            suspect: false,
        };
        let began = Instant::now();
        mailbox.tell(vehicle::In::Scan(scan));
        spans.extend(
            by_driver
                .recv_timeout(Duration::from_secs(2))
                .ok()
                .map(|at| at - began),
        );
    }
    is_over.store(true, Ordering::Relaxed);
    let (searches, merged) = busy
        .into_iter()
        .map(|thread| thread.join().unwrap())
        .fold((0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
    mailbox.close();
    println!(
        "halt: {} of {HALTS}; meanwhile {searches} searches over {SIDE} x {SIDE} cells, {merged} tiles merged",
        spans.len()
    );
    let spans = quantiles(spans);
    print_row("scan -> Hold at the driver", spans);
    println!("p99 {:.2} ms (wanted <= 20 ms)", spans.1 / 1e3);
}

/// Two threads that never rest, as the mission's and the map's would: searches for a path, and merging of tiles. Each
/// gives how many searches and tiles it did.
fn keep_busy(
    context: &RuntimeContext,
    settings: &VehicleSettings,
    is_over: &Arc<AtomicBool>,
) -> Vec<std::thread::JoinHandle<(u64, u64)>> {
    let over = is_over.clone();
    let search = move || {
        let area = CellRect::new(Cell::new(0, 0), Cell::new(SIDE - 1, SIDE - 1));
        let solid =
            |cell: Cell| cell.y % 4 == 2 && cell.x != if cell.y % 8 == 2 { 0 } else { SIDE - 1 };
        let grid = SearchGrid::of_cells(Lattice::new(0.2), area, 0.0, solid).unwrap();
        let mut searches = 0;
        while !over.load(Ordering::Relaxed) {
            let goal = Cell::new(SIDE - 2, SIDE - 1);
            assert!(shortest_cells(&grid, Cell::new(0, 0), goal, &Rules::default()).is_ok());
            searches += 1;
        }
        (searches, 0)
    };
    let mailbox: Mailbox<map::In> = Mailbox::shared("map");
    let own = settings.clone();
    start_actor(
        context,
        &mailbox,
        RestartPolicy::StopNode,
        None,
        move || Map::new(own.clone()),
        |_| {},
    )
    .unwrap();
    let over = is_over.clone();
    let merge = move || {
        let mut merged = 0;
        while !over.load(Ordering::Relaxed) {
            // 32 x 32 tiles are 1,024 x 1,024 cells; every round is news.
            let (round, place) = (merged / 1024, (merged % 1024) as i32);
            let address = TileAddress {
                slice: 0,
                x: place % 32,
                y: place / 32,
            };
            let Message::Tile(report) = tile(round as u32 + 1) else {
                unreachable!("a tile is a tile")
            };
            let layer = LayerId {
                vehicle: VehicleId(2),
                boot: Boot(1),
            };
            mailbox.tell(map::In::Tile(TileReport {
                layer,
                address,
                ..report
            }));
            merged += 1;
            if merged % 64 == 0 {
                std::thread::sleep(Duration::from_micros(200));
            }
        }
        mailbox.close();
        (0, merged)
    };
    vec![std::thread::spawn(search), std::thread::spawn(merge)]
}

fn quantiles(mut spans: Vec<Duration>) -> (f64, f64, f64) {
    spans.sort();
    let at = |share: f64| spans[((spans.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e6;
    (at(0.5), at(0.99), at(1.0))
}

fn print_row(what: &str, (median, p99, most): (f64, f64, f64)) {
    println!("{what:32} median {median:7.1} us, p99 {p99:7.1} us, most {most:7.1} us");
}
