//! Figures of a live swarm on this machine, over loopback: `cargo bench --bench swarm [-- WHAT]`, where WHAT is one of
//! `emergency`, `partition`, `start`, `unplugged`, `star` (`star 600` keeps it for ten minutes); without it all but the long ones.
//!
//! - emergency: an emergency order → heard by each of four vehicles, through a relay of 5 Mbit/s and 20 ms, while every
//!   vehicle has more tiles to send than fit;
//! - partition: the last link is restored after 60 s apart → both maps hold everything, through the relay;
//! - start: a vehicle's process starts → it is heard in a mesh of ten nodes; memory, processor and wake-ups of an idle vehicle;
//!   with `TOMOSWARM_OTHER=PROGRAM` every second vehicle runs another program, and both are told: a pair in one mesh;
//! - unplugged: processor of a vehicle process each of whose devices is not there, against one that looks for none, in a mesh;
//!   and of one alone, without a mesh and a world, none of whose devices is there;
//! - star: fifty vehicle processes around one ground station: heard, memory, processor.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

#[path = "../tests/net/relay.rs"]
#[allow(dead_code, reason = "the tests also freeze a link")]
mod relay;

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use relay::Relay;
use tomoswarm::actor::RestartPolicy;
use tomoswarm::config::{self, bundled};
use tomoswarm::geom::{Angle, Point, Pose};
use tomoswarm::node::VehicleSettings;
use tomoswarm::node::map::{self, Map};
use tomoswarm::node::sensor::Scan;
use tomoswarm::run::bus::{BusSession, BusSettings, HeardMessage, Publisher, SessionTopology};
use tomoswarm::run::clock::Clock;
use tomoswarm::run::live::processes::free_ports;
use tomoswarm::run::mailbox::{Mailbox, RuntimeContext, Troubles, start_actor};
use tomoswarm_proto::{
    Boot, LayerId, Lease, Message, OperatorId, Order, OrderKind, Revision, RunId, Sender,
    TileAddress, TileReport, VehicleId,
};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tomoswarm");
/// As deploy/tomoswarm-vehicle.service sets it.
const BUS_THREADS: &str = "(rx: (worker_threads: 1), net: (handover: tx), acc: (handover: tx))";
/// The shaped link: 5 Mbit/s, 20 ms each way.
const RATE_BYTES_PER_S: f64 = 5e6 / 8.0;
const DELAY: Duration = Duration::from_millis(20);

fn main() {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with("--"))
        .collect();
    let wanted = |what: &str| words.is_empty() || words.iter().any(|word| word == what);
    println!(
        "machine: {} cores",
        std::thread::available_parallelism().map_or(0, usize::from)
    );
    if wanted("emergency") {
        emergency(
            64_000,
            "with the default budget of a vehicle (64 kB/s)",
            150.0,
        );
        emergency(
            5_000_000,
            "with a budget that the link cannot carry (5 MB/s)",
            250.0,
        );
    }
    if wanted("partition") {
        partition();
    }
    if wanted("start") {
        start();
    }
    if wanted("unplugged") {
        unplugged();
    }
    if wanted("star") {
        let seconds = words
            .iter()
            .find_map(|word| word.parse().ok())
            .unwrap_or(60);
        star(seconds);
    }
}

fn free_address() -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], free_ports(1).unwrap()[0]))
}

struct Join {
    node: Sender,
    topology: SessionTopology,
    listen: Vec<SocketAddr>,
    connect: Vec<SocketAddr>,
    egress_bytes_per_s: u32,
}

fn bus(join: Join, hear: impl Fn(HeardMessage) + Send + Sync + 'static) -> BusSession {
    let endpoints = |all: Vec<SocketAddr>| all.into_iter().map(|at| format!("tcp/{at}")).collect();
    let settings = BusSettings {
        node: join.node,
        prefix: "tomoswarm/bench".to_owned(),
        topology: join.topology,
        listen: endpoints(join.listen),
        connect: endpoints(join.connect),
        trust: None,
        gossip: false,
        lease: Duration::from_secs(3),
        egress_bytes_per_s: join.egress_bytes_per_s,
    };
    let bus = BusSession::open(settings, Clock::start(), Troubles::default(), hear).unwrap();
    bus.publisher().speak();
    bus
}

/// A tile that does not pack well, as noise would not.
fn tile(vehicle: u8, number: u32) -> Message {
    let layer = LayerId {
        vehicle: VehicleId(vehicle),
        boot: Boot(1),
    };
    let cells = Arc::new(std::array::from_fn(|index| {
        ((index as u32 * 7919 + number * 104_729) % 35) as i8 - 17
    }));
    let address = TileAddress {
        slice: 0,
        x: (number % 64) as i32,
        y: (number / 64 % 64) as i32,
    };
    Message::Tile(TileReport {
        layer,
        address,
        revision: number,
        cells,
    })
}

const VEHICLES: u8 = 4;
const ORDERS: u32 = 150;

fn emergency(egress_bytes_per_s: u32, what: &str, wanted_ms: f64) {
    let hub = free_address();
    let ground = bus(
        Join {
            node: Sender::Ground,
            topology: SessionTopology::Star,
            listen: vec![hub],
            connect: vec![],
            egress_bytes_per_s: 1_000_000,
        },
        |_| {},
    );
    let is_over = Arc::new(AtomicBool::new(false));
    let (mut buses, mut relays, mut ears, mut floods) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for id in 1..=VEHICLES {
        let relay = Relay::start(hub);
        relay.shape(RATE_BYTES_PER_S, DELAY);
        let (heard, by_vehicle) = channel();
        let heard = Mutex::new(heard);
        let hear = move |what| {
            if let HeardMessage::Message(_, Message::Order(order)) = what {
                heard
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .send((order.revision, Instant::now()))
                    .unwrap_or_default();
            }
        };
        let node = Sender::Vehicle(VehicleId(id));
        let connect = vec![relay.address()];
        let bus = bus(
            Join {
                node,
                topology: SessionTopology::Star,
                listen: vec![],
                connect,
                egress_bytes_per_s,
            },
            hear,
        );
        floods.push(flood(bus.publisher(), id, is_over.clone()));
        buses.push(bus);
        relays.push(relay);
        ears.push(by_vehicle);
    }
    std::thread::sleep(Duration::from_secs(4));
    let mut spans = Vec::new();
    for number in 1..=ORDERS {
        for (index, ear) in ears.iter().enumerate() {
            spans.extend(ordered(&ground.publisher(), index as u8 + 1, number, ear));
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    is_over.store(true, Ordering::Relaxed);
    floods.into_iter().for_each(|flood| flood.join().unwrap());
    let carried: u64 = relays.iter().map(Relay::carried).sum();
    println!(
        "\nemergency, {what}: {} of {} heard at once; relays carried {:.1} MB",
        spans.len(),
        ORDERS * u32::from(VEHICLES),
        carried as f64 / 1e6
    );
    print_row("order -> heard by the vehicle", &mut spans, wanted_ms);
}

fn flood(publisher: Publisher, id: u8, is_over: Arc<AtomicBool>) -> std::thread::JoinHandle<()> {
    std::thread::spawn(move || {
        let mut number = 0;
        while !is_over.load(Ordering::Relaxed) {
            (0..8).for_each(|more| publisher.publish(&tile(id, number + more)));
            number += 8;
            std::thread::sleep(Duration::from_millis(4));
        }
    })
}

fn ordered(
    publisher: &Publisher,
    vehicle: u8,
    number: u32,
    ear: &Receiver<(Revision, Instant)>,
) -> Option<Duration> {
    let lease = Lease {
        number: 1,
        holder: 1,
    };
    let (vehicle, run, revision) = (VehicleId(vehicle), RunId(1), Revision(number));
    let order = Order {
        vehicle,
        lease,
        run,
        revision,
        seen: None,
        kind: OrderKind::CutMotors,
        ends: vec![],
    };
    let began = Instant::now();
    publisher.publish(&Message::Order(order));
    while let Ok((heard, at)) = ear.recv_timeout(Duration::from_secs(2)) {
        if heard == revision {
            return Some(at - began);
        }
    }
    None
}

/// A map actor on the bus, that tells how many of the other's tiles it holds at their newest.
struct Mapper {
    mailbox: Mailbox<map::In>,
    _bus: BusSession,
    held: Arc<Mutex<BTreeMap<TileAddress, u32>>>,
}

fn mapper(id: u8, listen: SocketAddr, connect: Vec<SocketAddr>) -> Mapper {
    let mailbox: Mailbox<map::In> = Mailbox::shared("map");
    let to_map = mailbox.clone();
    let hear = move |heard| match heard {
        HeardMessage::Message(_, Message::Tile(report)) => to_map.tell(map::In::Tile(report)),
        HeardMessage::Message(_, Message::Digest(digest)) => to_map.tell(map::In::Digest(digest)),
        HeardMessage::Message(_, Message::Want(want)) => to_map.tell(map::In::Want(want)),
        HeardMessage::Message(..) | HeardMessage::Greeting(..) | HeardMessage::Unknown(_) => {}
    };
    let node = Sender::Vehicle(VehicleId(id));
    let join = Join {
        node,
        topology: SessionTopology::Mesh,
        listen: vec![listen],
        connect,
        egress_bytes_per_s: 64_000,
    };
    let bus = bus(join, hear);
    let (endings, _) = channel();
    let context = RuntimeContext {
        clock: Clock::start(),
        troubles: Troubles::default(),
        endings,
    };
    let settings = settings(id);
    let (publisher, held) = (bus.publisher(), Arc::new(Mutex::new(BTreeMap::new())));
    let of_map = held.clone();
    let say = move |out| match out {
        map::Out::Publish(message) => publisher.publish(&message),
        map::Out::Tiles(tiles) => {
            let mut held = of_map.lock().unwrap_or_else(PoisonError::into_inner);
            // One vehicle maps, so addresses are enough.
            held.extend(
                tiles
                    .into_iter()
                    .map(|tile| (tile.report.address, tile.report.revision)),
            );
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
    Mapper {
        mailbox,
        _bus: bus,
        held,
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

const APART: Duration = Duration::from_secs(60);

fn partition() {
    let here = free_address();
    let relay = Relay::start(here);
    relay.shape(RATE_BYTES_PER_S, DELAY);
    let one = mapper(1, here, vec![]);
    let two = mapper(2, free_address(), vec![relay.address()]);
    let look = |mapper: &Mapper, number: u32| {
        let at = Point::new(
            f64::from(number % 10) * 6.4 + 1.0,
            f64::from(number / 10) * 6.4 + 1.0,
        );
        let heading = Angle::from_degrees(f64::from(number * 37));
        let pose = Pose {
            at,
            heading,
            sd_m: 0.05,
        };
        mapper.mailbox.tell(map::In::Scan(Scan {
            pose,
            beam: Angle::default(),
            range_m: Some(2.0),
            suspect: false,
        }));
    };
    (0..20).for_each(|number| look(&one, number));
    assert!(
        within(Duration::from_secs(20), || lacking(&one, &two) == 0),
        "the maps are equal before"
    );
    relay.cut();
    let began = Instant::now();
    let mut number = 0;
    while began.elapsed() < APART {
        look(&one, number % 80);
        number += 1;
        std::thread::sleep(Duration::from_millis(100));
    }
    std::thread::sleep(Duration::from_millis(500));
    let missing = lacking(&one, &two);
    relay.restore();
    let began = Instant::now();
    let is_equal = within(Duration::from_secs(30), || lacking(&one, &two) == 0);
    println!(
        "\npartition: 60 s apart, {missing} tiles behind; equal again: {is_equal}, after {:.2} s (wanted <= 3 s)",
        began.elapsed().as_secs_f64()
    );
    one.mailbox.close();
    two.mailbox.close();
}

/// Returns how many tiles of one the other does not hold at their newest.
fn lacking(one: &Mapper, other: &Mapper) -> usize {
    let (one, other) = (one.held.lock().unwrap(), other.held.lock().unwrap());
    one.iter()
        .filter(|(address, revision)| other.get(address) != Some(revision))
        .count()
}

fn within(limit: Duration, mut holds: impl FnMut() -> bool) -> bool {
    let began = Instant::now();
    while began.elapsed() < limit {
        if holds() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    false
}

/// The program of every second vehicle, where one is named.
fn other() -> Option<String> {
    std::env::var("TOMOSWARM_OTHER").ok()
}

fn is_other(name: &str) -> bool {
    let number = name.strip_prefix('v').and_then(|id| id.parse::<u8>().ok());
    other().is_some() && number.is_some_and(|id| id % 2 == 0)
}

/// Processes that end with this value.
struct Processes(BTreeMap<String, Child>);

impl Processes {
    fn start(&mut self, folder: &Path, name: &str, words: &[&str]) -> Instant {
        let log = std::fs::File::create(folder.join(format!("{name}.log"))).unwrap();
        let mut program = Command::new(match is_other(name) {
            true => other().unwrap_or_default(),
            false => PROGRAM.to_owned(),
        });
        program.env("ZENOH_RUNTIME", BUS_THREADS);
        let began = Instant::now();
        let program = program.args(words).current_dir(folder).stdin(Stdio::null());
        let child = program.stdout(Stdio::null()).stderr(log).spawn().unwrap();
        self.0.insert(name.to_owned(), child);
        began
    }

    fn kill(&mut self, name: &str) {
        if let Some(mut child) = self.0.remove(name) {
            child.kill().unwrap();
            child.wait().unwrap();
        }
    }
}

impl Drop for Processes {
    fn drop(&mut self) {
        for child in self.0.values_mut() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// A folder with the files of a world, a ground station and vehicles.
struct Files {
    folder: tempfile::TempDir,
    ground: SocketAddr,
    vehicles: BTreeMap<u8, SocketAddr>,
}

fn files(count: u8, topology: &str) -> Files {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    let homes: Vec<String> = (0..count)
        .map(|id| {
            format!(
                "[{}, {}]",
                -3 - 2 * i32::from(id / 10),
                2 * i32::from(id % 10)
            )
        })
        .collect();
    write(
        "venue.toml",
        format!(
            "kind = \"venue\"\nname = \"bench\"\narea_m = [0, 0, 20, 20]\nfence_m = [[-40, -40], [40, -40], [40, 40], [-40, 40]]\nhomes_m = [{}]\n[datum]\nlatitude_deg = 52.0\nlongitude_deg = 4.0\n",
            homes.join(", ")
        ),
    );
    for id in 1..=count {
        // Starts are counted from 1 where the count is known to be 0.
        std::fs::create_dir_all(folder.path().join(format!("state-{id}"))).unwrap();
        write(&format!("state-{id}/boot"), "0\n".to_owned());
    }
    write(
        "scene.toml",
        "kind = \"scene\"\nname = \"bench\"\n".to_owned(),
    );
    let (world, ground) = (free_address(), free_address());
    let vehicles: BTreeMap<u8, SocketAddr> = (1..=count).map(|id| (id, free_address())).collect();
    write(
        "sim.toml",
        format!(
            "kind = \"sim\"\nvenue = \"venue.toml\"\nscene = \"scene.toml\"\n[vehicles]\ncount = {count}\n"
        ),
    );
    write("world", world.to_string());
    let ids: Vec<String> = vehicles.keys().map(u8::to_string).collect();
    write(
        "ground.toml",
        format!(
            "kind = \"ground\"\nvenue = \"venue.toml\"\nvehicles = [{}]\nstate_dir = \"state-g\"\n[sweep]\npositions = 220\n[bus]\ntopology = \"{topology}\"\nlisten = [\"tcp/{ground}\"]\n",
            ids.join(", ")
        ),
    );
    let drivers: String = ["autopilot", "range", "servo", "radio"]
        .map(|part| format!("[{part}]\ndriver = \"sim\"\n"))
        .concat();
    for (id, own) in &vehicles {
        let listen = if topology == "mesh" {
            format!("listen = [\"tcp/{own}\"]\n")
        } else {
            String::new()
        };
        write(
            &format!("v{id}.toml"),
            format!(
                "kind = \"vehicle\"\nvenue = \"venue.toml\"\nid = {id}\nstate_dir = \"state-{id}\"\n{drivers}[world]\nconnect = \"{world}\"\ntoken = \"bench-token\"\n[bus]\ntopology = \"{topology}\"\n{listen}connect = [\"tcp/{ground}\"]\n"
            ),
        );
    }
    Files {
        folder,
        ground,
        vehicles,
    }
}

/// When each vehicle's newest State was heard.
type LastHeard = Arc<Mutex<BTreeMap<u8, (Boot, Instant)>>>;

fn listen(files: &Files, topology: SessionTopology) -> (BusSession, LastHeard) {
    let heard: LastHeard = Arc::default();
    let of_bus = heard.clone();
    let hear = move |what| {
        if let HeardMessage::Message(_, Message::State(state)) = what {
            of_bus
                .lock()
                .unwrap()
                .insert(state.vehicle.0, (state.boot, Instant::now()));
        }
    };
    let listen = if topology == SessionTopology::Mesh {
        vec![free_address()]
    } else {
        vec![]
    };
    let settings = BusSettings {
        node: Sender::Operator(OperatorId(1)),
        prefix: "tomoswarm/bench".to_owned(),
        topology,
        listen: listen.into_iter().map(|at| format!("tcp/{at}")).collect(),
        connect: vec![format!("tcp/{}", files.ground)],
        trust: None,
        gossip: true,
        lease: Duration::from_secs(3),
        egress_bytes_per_s: 64_000,
    };
    (
        BusSession::open(settings, Clock::start(), Troubles::default(), hear).unwrap(),
        heard,
    )
}

fn begin(files: &Files, processes: &mut Processes) {
    let folder = files.folder.path();
    let world = std::fs::read_to_string(folder.join("world")).unwrap();
    processes.start(
        folder,
        "world",
        &[
            "world",
            "sim.toml",
            "--listen",
            &world,
            "--token",
            "bench-token",
        ],
    );
    processes.start(folder, "ground", &["ground", "ground.toml"]);
    std::thread::sleep(Duration::from_secs(2));
}

fn start() {
    let files = files(8, "mesh");
    let mut processes = Processes(BTreeMap::new());
    begin(&files, &mut processes);
    let (_bus, heard) = listen(&files, SessionTopology::Mesh);
    let mut spans = Vec::new();
    let folder = files.folder.path().to_owned();
    let start = |id: u8, processes: &mut Processes| {
        processes.start(
            &folder,
            &format!("v{id}"),
            &["vehicle", &format!("v{id}.toml")],
        )
    };
    let began: Vec<(u8, Instant)> = files
        .vehicles
        .keys()
        .map(|id| (*id, start(*id, &mut processes)))
        .collect();
    for (id, began) in began {
        spans.extend(first_heard(&heard, id, None, began));
    }
    let at_once = spans.len();
    for _ in 2..=8 {
        for id in files.vehicles.keys() {
            processes.kill(&format!("v{id}"));
            let former = heard.lock().unwrap().get(id).map(|(boot, _)| *boot);
            let began = start(*id, &mut processes);
            spans.extend(first_heard(&heard, *id, former, began));
        }
    }
    println!(
        "\nstart, in a mesh of 8 vehicles, ground and operator: {at_once} started at once, {} one by one (killed before)",
        spans.len() - at_once
    );
    print_row("process start -> its State heard", &mut spans, 2000.0);
    std::thread::sleep(Duration::from_secs(5));
    use_of(&processes, 20);
}

/// Returns how long after its start a vehicle was heard, of a later start than the former one.
fn first_heard(
    heard: &LastHeard,
    id: u8,
    former: Option<Boot>,
    began: Instant,
) -> Option<Duration> {
    let is_heard = || {
        heard
            .lock()
            .unwrap()
            .get(&id)
            .is_some_and(|(known, _)| former.is_none_or(|former| *known > former))
    };
    within(Duration::from_secs(20), is_heard).then(|| began.elapsed())
}

/// How often each thread of a process has gone to sleep, by its name.
type Wakes = BTreeMap<String, u64>;

fn wakes(process: u32) -> Wakes {
    let mut all = Wakes::new();
    for task in std::fs::read_dir(format!("/proc/{process}/task"))
        .into_iter()
        .flatten()
        .flatten()
    {
        let text = |name: &str| std::fs::read_to_string(task.path().join(name)).unwrap_or_default();
        let status = text("status");
        let slept = status
            .lines()
            .find_map(|line| line.strip_prefix("voluntary_ctxt_switches:"))
            .and_then(|count| count.trim().parse::<u64>().ok());
        *all.entry(text("comm").trim().to_owned()).or_default() += slept.unwrap_or(0);
    }
    all
}

/// Returns how many hundredths of a second a process has computed.
fn ticks(child: &Child) -> u64 {
    let text = std::fs::read_to_string(format!("/proc/{}/stat", child.id())).unwrap_or_default();
    let fields: Vec<&str> = text
        .rsplit(')')
        .next()
        .unwrap_or_default()
        .split_whitespace()
        .collect();
    let field = |index: usize| {
        fields
            .get(index)
            .and_then(|word| word.parse::<u64>().ok())
            .unwrap_or(0)
    };
    field(11) + field(12)
}

/// Prints memory, processor and wake-ups of the vehicles over some seconds at rest.
fn use_of(processes: &Processes, seconds: u64) {
    let memory_kb = |child: &Child| {
        let text =
            std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let line = text
            .lines()
            .find_map(|line| line.strip_prefix("VmRSS:"))
            .unwrap_or_default()
            .to_owned();
        line.split_whitespace()
            .next()
            .and_then(|word| word.parse::<f64>().ok())
            .unwrap_or(0.0)
    };
    let woken = |child: &Child| wakes(child.id());
    let wakes_before: BTreeMap<&String, Wakes> = processes
        .0
        .iter()
        .map(|(name, child)| (name, woken(child)))
        .collect();
    let before: BTreeMap<&String, u64> = processes
        .0
        .iter()
        .map(|(name, child)| (name, ticks(child)))
        .collect();
    std::thread::sleep(Duration::from_secs(seconds));
    let share = |name: &String| (ticks(&processes.0[name]) - before[name]) as f64 / seconds as f64;
    for of_other in [false, true] {
        let names: Vec<&String> = processes
            .0
            .keys()
            .filter(|name| name.starts_with('v') && is_other(name) == of_other)
            .collect();
        if names.is_empty() {
            continue;
        }
        let sorted = |mut all: Vec<f64>| {
            all.sort_by(f64::total_cmp);
            (all[all.len() / 2], all[all.len() - 1])
        };
        let (share, most) = sorted(names.iter().map(|name| share(name)).collect());
        let memory = names
            .iter()
            .map(|name| memory_kb(&processes.0[*name]) / 1e3);
        let (resident_mb, most_mb) = sorted(memory.collect());
        let mut by_thread = Wakes::new();
        for name in &names {
            let now = woken(&processes.0[*name]);
            for (thread, count) in now {
                let former = wakes_before[name].get(&thread).copied().unwrap_or(0);
                let sum = by_thread.entry(thread).or_default();
                *sum += count.saturating_sub(former);
            }
        }
        let each = |count: u64| count as f64 / names.len() as f64 / seconds as f64;
        println!(
            "{} at rest: median {share:.2} %, most {most:.2} % of one core (wanted <= 1 %); resident median {resident_mb:.1} MB, most {most_mb:.1} MB (wanted <= 25 MB); {:.0} wake-ups a second:",
            if of_other {
                "the other program"
            } else {
                "vehicle process"
            },
            each(by_thread.values().sum())
        );
        let rows = by_thread
            .iter()
            .map(|(thread, count)| (thread, each(*count)))
            .filter(|(_, rate)| *rate >= 0.3);
        println!(
            "  {}",
            rows.map(|(thread, rate)| format!("{thread} {rate:.1}"))
                .collect::<Vec<_>>()
                .join(", ")
        );
    }
    for name in ["ground", "world"] {
        let name = name.to_owned();
        println!(
            "{name}: {:.2} % of one core, {:.1} MB",
            share(&name),
            memory_kb(&processes.0[&name]) / 1e3
        );
    }
}

/// A part of a vehicle's file whose driver looks for a device that is not there.
type NotThere = (&'static str, &'static str);

const PWM: NotThere = (
    "servo",
    "driver = \"pwm\"\n[servo.pwm]\nchip = \"/sys/class/pwm/not-there\"\nchannel = 0\npulse_us = [1000.0, 2000.0]\nangle_deg = [-90.0, 90.0]\n",
);
const SERIAL_TEXT: NotThere = (
    "range",
    "driver = \"serial-text\"\nmax_range_m = 5.0\nscan_period_s = 0.25\n[range.serial-text]\nport = \"/dev/not-there-1\"\n",
);
const HCSR04: NotThere = (
    "range",
    "driver = \"hcsr04\"\nmax_range_m = 4.0\n[range.hcsr04]\ntrigger = \"NOT-THERE-1\"\necho = \"NOT-THERE-2\"\nair_temperature_c = 20\n",
);
const XBEE: NotThere = (
    "radio",
    "driver = \"xbee\"\npower_dbm = 0\n[radio.xbee]\nport = \"/dev/not-there-2\"\n",
);
const AUTOPILOT: NotThere = (
    "autopilot",
    "driver = \"mavlink\"\n[autopilot.mavlink]\nconnection = \"serial:/dev/not-there-3\"\n",
);

/// All devices that a vehicle can have.
const ALL_REAL: &[NotThere] = &[AUTOPILOT, HCSR04, PWM, XBEE];

/// Starts a vehicle that looks for devices that are not there.
fn start_without(files: &Files, processes: &mut Processes, id: u8, missing: &[NotThere]) {
    let folder = files.folder.path();
    let path = folder.join(format!("v{id}.toml"));
    let mut text = std::fs::read_to_string(&path).unwrap();
    for (part, instead) in missing {
        let simulated = format!("[{part}]\ndriver = \"sim\"\n");
        assert!(text.contains(&simulated), "{text}");
        text = text.replace(&simulated, &format!("[{part}]\n{instead}"));
    }
    std::fs::write(&path, text).unwrap();
    processes.start(
        folder,
        &format!("v{id}"),
        &["vehicle", &format!("v{id}.toml")],
    );
}

/// Returns how much of a core each of the vehicles takes over a minute, after its first seconds, percent.
fn shares(processes: &mut Processes, vehicles: usize) -> Vec<f64> {
    const SECONDS: u64 = 60;
    std::thread::sleep(Duration::from_secs(10));
    let before = ticks_of_all(processes, vehicles);
    std::thread::sleep(Duration::from_secs(SECONDS));
    let mut all = processes.0.values_mut();
    assert!(
        all.all(|child| child.try_wait().unwrap().is_none()),
        "one has ended"
    );
    let after = ticks_of_all(processes, vehicles);
    let both = after.iter().zip(&before);
    both.map(|(after, before)| (after - before) as f64 / SECONDS as f64)
        .collect()
}

fn ticks_of_all(processes: &Processes, vehicles: usize) -> Vec<u64> {
    (1..=vehicles)
        .map(|id| ticks(&processes.0[&format!("v{id}")]))
        .collect()
}

fn unplugged() {
    unplugged_in_a_mesh();
    unplugged_alone();
}

/// Vehicles in one mesh, with a world: one that has no device of its own, and others whose devices are not there. A simulated
/// servo turns no real sensor, so a range sensor is missed together with its servo.
fn unplugged_in_a_mesh() {
    const DEVICES: [(&str, &[NotThere]); 7] = [
        ("all simulated", &[]),
        ("servo", &[PWM]),
        ("serial range and servo", &[SERIAL_TEXT, PWM]),
        ("HC-SR04 and servo", &[HCSR04, PWM]),
        ("XBee", &[XBEE]),
        ("autopilot", &[AUTOPILOT]),
        ("all that are real", ALL_REAL),
    ];
    let files = files(DEVICES.len() as u8, "mesh");
    let mut processes = Processes(BTreeMap::new());
    begin(&files, &mut processes);
    for (id, (_, missing)) in (1..).zip(DEVICES) {
        start_without(&files, &mut processes, id, missing);
    }
    let taken = shares(&mut processes, DEVICES.len());
    println!(
        "\nunplugged, in a mesh of {} vehicles and a ground station:",
        DEVICES.len()
    );
    for ((device, _), share) in DEVICES.iter().zip(taken) {
        println!("{device:24} {share:.2} % of one core");
    }
}

/// A vehicle that knows nobody and has no world; each of its devices is real, and not there.
fn unplugged_alone() {
    let files = files(1, "mesh");
    let path = files.folder.path().join("v1.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let connect = format!("connect = [\"tcp/{}\"]\n", files.ground);
    assert!(text.contains(&connect), "{text}");
    std::fs::write(&path, text.replace(&connect, "")).unwrap();
    let mut processes = Processes(BTreeMap::new());
    start_without(&files, &mut processes, 1, ALL_REAL);
    let taken = shares(&mut processes, 1);
    println!(
        "\nunplugged, alone, none of its devices there: {:.2} % of one core (wanted <= 1 %)",
        taken[0]
    );
}

fn star(seconds: u64) {
    let files = files(50, "star");
    let mut processes = Processes(BTreeMap::new());
    begin(&files, &mut processes);
    let (_bus, heard) = listen(&files, SessionTopology::Star);
    for id in files.vehicles.keys() {
        processes.start(
            files.folder.path(),
            &format!("v{id}"),
            &["vehicle", &format!("v{id}.toml")],
        );
    }
    let all = files.vehicles.len();
    let is_there = within(Duration::from_secs(60), || {
        heard.lock().unwrap().len() == all
    });
    println!("\nstar of {all} vehicle processes: all heard within a minute: {is_there}");
    let (mut worst, began) = (Duration::ZERO, Instant::now());
    let mut is_gone = false;
    while began.elapsed() < Duration::from_secs(seconds) {
        let silent = heard
            .lock()
            .unwrap()
            .values()
            .map(|(_, at)| at.elapsed())
            .max()
            .unwrap_or_default();
        worst = worst.max(silent);
        is_gone |= processes
            .0
            .values_mut()
            .any(|child| child.try_wait().unwrap().is_some());
        std::thread::sleep(Duration::from_millis(50));
    }
    println!(
        "over {seconds} s: longest silence of any {:.2} s; a process ended: {is_gone}",
        worst.as_secs_f64()
    );
    use_of(&processes, 20);
}

fn print_row(what: &str, spans: &mut [Duration], wanted_ms: f64) {
    spans.sort();
    let at = |share: f64| {
        spans
            .get(((spans.len().max(1) - 1) as f64 * share) as usize)
            .map_or(f64::NAN, |span| span.as_secs_f64() * 1e3)
    };
    println!(
        "{what:34} median {:7.1} ms, p99 {:7.1} ms, most {:7.1} ms (wanted p99 <= {wanted_ms} ms)",
        at(0.5),
        at(0.99),
        at(1.0)
    );
}
