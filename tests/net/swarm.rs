//! A small swarm of separate processes: a world, a ground station and vehicles, in a folder of its own, on free ports; and
//! an operator in this process who hears everything. It can kill, freeze and restart each, and cut any link.
//!
//! At the end [`Swarm::finish`] checks what every scenario claims. Whatever happens, no process outlives it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, OpenOptions};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::atomic::{AtomicU16, Ordering};
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use tomoswarm::geom::Point;
use tomoswarm::operator::fleet_view::FleetView;
use tomoswarm::run::bus::{BusSession, HeardMessage};
use tomoswarm::run::clock::Clock;
use tomoswarm::run::link::WorldControl;
use tomoswarm::run::mailbox::Troubles;
use tomoswarm::run::membership;
use tomoswarm::run::trust::CommonName;
use tomoswarm::store::ground::GroundStore;
use tomoswarm_proto::{
    Boot, Digest, GroundReport, Message, RunId, Sample, Sender, StationPhase, VehicleId,
};

use crate::forgers::FORGED_FROM;
use crate::member::settings;
use crate::relay::Relay;

pub const PROGRAM: &str = env!("CARGO_BIN_EXE_tomoswarm");
/// No process may ever take more, kB (unoptimised build).
const MEMORY_MAX_KB: u64 = 60_000;
/// In which Linux counts processor time.
const TICKS_PER_S: f64 = 100.0;
const TOKEN: &str = "secret-token";
/// Scenarios that run at a time.
const AT_A_TIME: usize = 4;
pub const GROUND: Sender = Sender::Ground;

pub const fn vehicle(id: u8) -> Sender {
    Sender::Vehicle(VehicleId(id))
}

/// Returns a free address, one that no outgoing connection is given meanwhile.
pub fn free_address() -> SocketAddr {
    static NEXT: AtomicU16 = AtomicU16::new(0);
    let first = 12_000 + (std::process::id() % 90) as u16 * 200;
    loop {
        let port = first + NEXT.fetch_add(1, Ordering::Relaxed) % 200;
        let address = SocketAddr::from(([127, 0, 0, 1], port));
        if std::net::TcpListener::bind(address).is_ok() {
            return address;
        }
    }
}

/// So many scenarios of a kind run at a time.
struct Places {
    most: usize,
    taken: Mutex<usize>,
    is_left: Condvar,
}

/// All scenarios; and of these the ones that depend on the time of single bytes, which others of their kind would hold up.
static SCENARIOS: Places = Places::new(AT_A_TIME);
static TO_THE_BYTE: Places = Places::new(1);

/// A place among the scenarios of a kind.
struct Place(&'static Places);

impl Places {
    const fn new(most: usize) -> Places {
        Places {
            most,
            taken: Mutex::new(0),
            is_left: Condvar::new(),
        }
    }

    fn take(&'static self) -> Place {
        let mut taken = self.taken.lock().unwrap();
        while *taken >= self.most {
            taken = self.is_left.wait(taken).unwrap();
        }
        *taken += 1;
        Place(self)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        *self.0.taken.lock().unwrap() -= 1;
        self.0.is_left.notify_one();
    }
}

/// What a swarm is made of.
#[derive(Clone, Copy, Debug)]
pub struct Size {
    pub vehicles: u8,
    pub laps: u32,
    /// Whether every link goes through a relay, and there are no others.
    pub relayed: bool,
}

/// What the operator has heard.
#[derive(Default)]
pub struct Watch {
    pub view: FleetView,
    pub digests: BTreeMap<Sender, (Instant, Digest)>,
    /// How many looks of vehicles it has heard.
    pub looks: usize,
    /// How many messages with settings of nodes, or with lines of their logs.
    pub told_of_nodes: usize,
    samples: BTreeMap<(VehicleId, Boot, RunId), BTreeMap<u64, Sample>>,
}

impl Watch {
    fn hear(&mut self, clock: Clock, heard: &HeardMessage) {
        self.view.hear(clock.now(), heard);
        let HeardMessage::Message(sender, message) = heard else {
            return;
        };
        match message {
            Message::Digest(digest) => {
                self.digests
                    .insert(*sender, (Instant::now(), digest.clone()));
            }
            Message::Look(_) => self.looks += 1,
            Message::Log(_) | Message::Settings(_) => self.told_of_nodes += 1,
            Message::Samples(batch) => {
                let known = self
                    .samples
                    .entry((batch.vehicle, batch.boot, batch.run))
                    .or_default();
                known.extend(
                    batch
                        .samples
                        .iter()
                        .map(|sample| (sample.sequence, *sample)),
                );
            }
            _ => {}
        }
    }

    /// Returns the newest report of the ground station with the greatest lease.
    pub fn report(&self) -> GroundReport {
        let all = self.view.grounds().map(|report| &report.value);
        all.max_by_key(|report| report.lease)
            .cloned()
            .unwrap_or_default()
    }

    /// Returns whether run 1 was driven to its end and closed.
    pub fn has_ended(&self) -> bool {
        let report = self.report();
        report.run == RunId(1) && self.ends(&report)
    }

    /// Returns whether by a report a run was driven to its end and closed.
    pub fn ends(&self, report: &GroundReport) -> bool {
        report.phase == StationPhase::Idle && report.laps > 0 && report.laps_done == report.laps
    }

    /// Returns how many samples were heard of one start of a vehicle ([`start`]).
    pub fn samples_of(&self, id: u8, number: u32) -> usize {
        let of = (VehicleId(id), start(number), RunId(1));
        self.samples.get(&of).map_or(0, BTreeMap::len)
    }

    /// Returns whether the newest digests of these nodes are fresh, equal and not empty.
    fn agree(&self, nodes: &BTreeSet<Sender>) -> bool {
        let fresh = |node: &Sender| {
            self.digests
                .get(node)
                .filter(|(at, _)| at.elapsed() < Duration::from_millis(2500))
        };
        let all: Option<Vec<&Digest>> = nodes.iter().map(|node| Some(&fresh(node)?.1)).collect();
        all.is_some_and(|all| {
            !all[0].layers.is_empty() && all.iter().all(|digest| *digest == all[0])
        })
    }
}

/// A process of the swarm.
struct Node {
    arguments: Vec<String>,
    preload: Option<PathBuf>,
    log: PathBuf,
    child: Option<Child>,
}

impl Node {
    fn start(&mut self, folder: &Path) {
        let out = || log(&self.log);
        let mut program = Command::new(PROGRAM);
        program
            .args(&self.arguments)
            .current_dir(folder)
            .stdin(Stdio::null())
            .stdout(out())
            .stderr(out());
        if let Some(library) = &self.preload {
            program.env("LD_PRELOAD", library);
        }
        self.child = Some(program.spawn().unwrap());
    }

    fn signal(&self, signal: Signal) {
        let child = self.child.as_ref().unwrap();
        kill_process(Pid::from_child(child), signal).unwrap();
    }

    fn memory_kb(&self) -> Option<u64> {
        let id = self.child.as_ref()?.id();
        let status = std::fs::read_to_string(format!("/proc/{id}/status")).ok()?;
        let line = status
            .lines()
            .find_map(|line| line.strip_prefix("VmHWM:"))?;
        line.split_whitespace().next()?.parse().ok()
    }

    /// Processor time of its threads with a name that begins so, seconds.
    fn processor_s(&self, threads: &str) -> f64 {
        let id = self.child.as_ref().unwrap().id();
        let tasks = std::fs::read_dir(format!("/proc/{id}/task")).unwrap();
        let ticks = |task: std::fs::DirEntry| {
            let text = std::fs::read_to_string(task.path().join("stat")).ok()?;
            let (head, rest) = text.rsplit_once(") ")?;
            let (_, name) = head.split_once('(')?;
            let fields: Vec<&str> = rest.split(' ').collect();
            let ticks: u64 = fields[11].parse::<u64>().ok()? + fields[12].parse::<u64>().ok()?;
            name.starts_with(threads).then_some(ticks)
        };
        let all: u64 = tasks.flatten().filter_map(ticks).sum();
        all as f64 / TICKS_PER_S
    }

    fn ends_within(&mut self, limit: Duration) -> Option<ExitStatus> {
        let began = Instant::now();
        while began.elapsed() < limit {
            if let Some(status) = self.child.as_mut()?.try_wait().unwrap() {
                self.child = None;
                return Some(status);
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        None
    }
}

/// Returns the number of a vehicle's start, counted from 1: above any that a clock gives.
pub fn start(number: u32) -> Boot {
    Boot(2_600_000_000 + number)
}

fn log(path: &Path) -> File {
    OpenOptions::new()
        .create(true)
        .append(true)
        .open(path)
        .unwrap()
}

/// A swarm.
pub struct Swarm {
    size: Size,
    pub folder: tempfile::TempDir,
    world: SocketAddr,
    addresses: BTreeMap<Sender, SocketAddr>,
    relays: BTreeMap<(Sender, Sender), Relay>,
    processes: BTreeMap<String, Node>,
    watch: Arc<Mutex<Watch>>,
    operator: Option<BusSession>,
    preloads: BTreeMap<String, PathBuf>,
    /// Where the world serves autopilots over MAVLink, vehicle 1 first.
    autopilots: Option<SocketAddr>,
    /// Further words of the ground station's command line, and of the world's.
    ground_options: Vec<String>,
    world_options: Vec<String>,
    began: Instant,
    places: Vec<Place>,
}

impl Swarm {
    /// Writes the files and starts the world, the vehicles, the ground station and the operator.
    pub fn start(size: Size) -> Swarm {
        let mut swarm = Swarm::prepare(size);
        swarm.run();
        swarm
    }

    /// Writes the files.
    pub fn prepare(size: Size) -> Swarm {
        let place = SCENARIOS.take();
        let nodes: Vec<Sender> = [GROUND]
            .into_iter()
            .chain((1..=size.vehicles).map(vehicle))
            .collect();
        let mut swarm = Swarm {
            size,
            folder: tempfile::tempdir().unwrap(),
            world: free_address(),
            addresses: nodes.iter().map(|node| (*node, free_address())).collect(),
            relays: BTreeMap::new(),
            processes: BTreeMap::new(),
            watch: Arc::default(),
            operator: None,
            preloads: BTreeMap::new(),
            autopilots: None,
            ground_options: Vec::new(),
            world_options: Vec::new(),
            began: Instant::now(),
            places: vec![place],
        };
        if size.relayed {
            swarm.relay_all(&nodes);
        }
        swarm.write_files();
        swarm
    }

    /// Starts the world, the vehicles, the ground station and the operator.
    pub fn run(&mut self) {
        let world = self.world.to_string();
        let mut words = vec!["world", "sim.toml", "--listen", &world, "--token", TOKEN];
        let autopilots = self.autopilots.map(|address| address.to_string());
        words.extend(
            autopilots
                .iter()
                .flat_map(|address| ["--mavlink", address.as_str()]),
        );
        let options = self.world_options.clone();
        words.extend(options.iter().map(String::as_str));
        self.spawn("world", &words);
        let nodes: Vec<Sender> = self.addresses.keys().copied().collect();
        for node in nodes {
            self.spawn_node(node);
        }
        let (watch, clock) = (self.watch.clone(), Clock::start());
        let hear = move |heard: HeardMessage| watch.lock().unwrap().hear(clock, &heard);
        let operator = settings(&self.path("operator.toml"));
        self.operator = Some(BusSession::open(operator, clock, Troubles::default(), hear).unwrap());
    }

    /// Gives every node its certificate; from then on all endpoints are TLS.
    pub fn enroll(&self) {
        let nodes = self
            .addresses
            .keys()
            .copied()
            .chain([Sender::Operator(membership::FIRST_OPERATOR)]);
        for node in nodes {
            let name = Swarm::name(node);
            let mut program = Command::new(PROGRAM);
            program.args([
                "enroll",
                "swarm",
                "--venue",
                "venue.toml",
                "--state-dir",
                "state",
            ]);
            let run = program
                .args(name.split('-'))
                .current_dir(self.folder.path())
                .output()
                .unwrap();
            assert!(
                run.status.success(),
                "{}",
                String::from_utf8_lossy(&run.stderr)
            );
            let (file, folder) = (format!("{name}.toml"), CommonName::node_name(node));
            let plain = std::fs::read_to_string(self.path(&file)).unwrap();
            let own = ["ca.pem", "certificate.pem", "key.pem", "roster.txt"].map(|own| {
                let key = own.split('.').next().unwrap();
                format!("{key} = \"swarm/{folder}/{own}\"\n")
            });
            self.write(&file, &(plain.replace("tcp/", "tls/") + &own.concat()));
        }
    }

    /// Lets vehicles fly simulated autopilots over MAVLink, at these addresses, each in turn; the world serves them from
    /// the other one on.
    pub fn fly_over_mavlink(&mut self, served: SocketAddr, connections: &[SocketAddr]) {
        self.autopilots = Some(served);
        for (id, address) in (1..=self.size.vehicles).zip(connections) {
            let name = format!("vehicle-{id}.toml");
            let text = std::fs::read_to_string(self.path(&name)).unwrap();
            let mavlink = format!(
                "[autopilot]\ndriver = \"mavlink\"\n[autopilot.mavlink]\nconnection = \"tcp:{address}\"\nsystem = {id}\n"
            );
            let text = text.replace("[autopilot]\ndriver = \"sim\"\n", &mavlink);
            self.write(&name, &text);
        }
    }

    /// Gives every vehicle an XBee at a pseudo-terminal of the world; waits until no other scenario has any.
    pub fn speak_by_xbee(&mut self) {
        self.places.push(TO_THE_BYTE.take());
        self.world_options = ["--xbee-pty", "ports"].map(str::to_owned).to_vec();
        for id in 1..=self.size.vehicles {
            let name = format!("vehicle-{id}.toml");
            let text = std::fs::read_to_string(self.path(&name)).unwrap();
            let port = self.path(&format!("ports/vehicle-{id}"));
            let xbee = format!(
                "[radio]\ndriver = \"xbee\"\n[radio.xbee]\nport = {:?}\n",
                port.to_str().unwrap()
            );
            let text = text.replace("[radio]\ndriver = \"sim\"\n", &xbee);
            self.write(&name, &text);
        }
    }

    /// Lets the ground station show the swarm over MAVLink, as these lines say.
    pub fn show_over_mavlink(&mut self, lines: &str) {
        let operator = std::fs::read_to_string(self.path("operator.toml")).unwrap();
        self.write("station.toml", &format!("{operator}[mavlink]\n{lines}"));
        self.ground_options = vec!["--mavlink".to_owned(), "station.toml".to_owned()];
    }

    /// Lets the ground station start the operator's page as well.
    pub fn serve_page(&mut self, port: &str) {
        let words = ["--dash", "operator.toml", "--port", port];
        self.ground_options = words.map(str::to_owned).into();
    }

    /// Lets a node's processes load a library before all others.
    pub fn preload(&mut self, node: Sender, library: &Path) {
        self.preloads.insert(Swarm::name(node), library.to_owned());
    }

    /// The later node of each pair connects to the earlier one.
    fn relay_all(&mut self, nodes: &[Sender]) {
        for (index, later) in nodes.iter().enumerate() {
            for earlier in &nodes[..index] {
                self.relays
                    .insert((*earlier, *later), Relay::start(self.addresses[earlier]));
            }
        }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn address(&self, node: Sender) -> SocketAddr {
        self.addresses[&node]
    }

    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    fn write_files(&self) {
        let Size { vehicles, laps, .. } = self.size;
        let positions = self.positions();
        let sweep = format!("[sweep]\npositions = {positions}\nlaps = {laps}\n");
        for id in 1..=vehicles {
            std::fs::create_dir_all(self.path(&format!("state-{id}"))).unwrap();
            self.write(&format!("state-{id}/boot"), &format!("{}\n", start(0)));
        }
        self.write("venue.toml", VENUE);
        self.write("scene.toml", SCENE);
        let body = BODY;
        self.write(
            "sim.toml",
            &format!("kind = \"sim\"\nvenue = \"venue.toml\"\nscene = \"scene.toml\"\n[vehicles]\ncount = {vehicles}\n{body}{sweep}"),
        );
        for id in 1..=vehicles {
            let bus = self.bus_lines(vehicle(id));
            self.write(
                &format!("vehicle-{id}.toml"),
                &self.vehicle_text(id, &format!("state-{id}"), &bus),
            );
        }
        self.write(
            "ground.toml",
            &self.ground_text("state-g", &self.bus_lines(GROUND)),
        );
        let all: Vec<String> = self
            .addresses
            .values()
            .map(|at| format!("\"tcp/{at}\""))
            .collect();
        let bus = format!(
            "[bus]\nconnect = [{}]\ngossip = {}\n",
            all.join(", "),
            !self.size.relayed
        );
        self.write(
            "operator.toml",
            &format!("kind = \"operator\"\nvenue = \"venue.toml\"\n{bus}"),
        );
    }

    /// Returns the `[bus]` of a node: through relays only, or by the ground station and what it tells.
    fn bus_lines(&self, node: Sender) -> String {
        let own = self.addresses[&node];
        let through: Vec<String> = if self.size.relayed {
            let mine = self.relays.iter().filter(|((_, later), _)| *later == node);
            mine.map(|(_, relay)| format!("\"tcp/{}\"", relay.address()))
                .collect()
        } else if node == GROUND {
            Vec::new()
        } else {
            vec![format!("\"tcp/{}\"", self.addresses[&GROUND])]
        };
        let gossip = !self.size.relayed;
        format!(
            "[bus]\nlisten = [\"tcp/{own}\"]\nconnect = [{}]\ngossip = {gossip}\n",
            through.join(", ")
        )
    }

    /// Returns the file of a vehicle.
    pub fn vehicle_text(&self, id: u8, state_dir: &str, bus: &str) -> String {
        let driver = ["autopilot", "range", "servo", "radio"]
            .map(|part| format!("[{part}]\ndriver = \"sim\"\n"))
            .concat();
        let world = format!(
            "[world]\nconnect = \"{}\"\ntoken = \"{TOKEN}\"\n",
            self.world
        );
        format!(
            "kind = \"vehicle\"\nvenue = \"venue.toml\"\nid = {id}\nstate_dir = \"{state_dir}\"\n[vehicle]\n{BODY}{driver}{world}{bus}"
        )
    }

    /// Returns the smallest ring that is allowed.
    fn positions(&self) -> u32 {
        if self.size.vehicles > 3 { 20 } else { 16 }
    }

    /// Returns the file of a ground station.
    pub fn ground_text(&self, state_dir: &str, bus: &str) -> String {
        let ids: Vec<String> = (1..=self.size.vehicles).map(|id| id.to_string()).collect();
        let positions = self.positions();
        format!(
            "kind = \"ground\"\nvenue = \"venue.toml\"\nvehicles = [{}]\nstate_dir = \"{state_dir}\"\n[sweep]\npositions = {positions}\nlaps = {}\n{bus}",
            ids.join(", "),
            self.size.laps
        )
    }

    fn name(node: Sender) -> String {
        match node {
            Sender::Ground => "ground".to_owned(),
            Sender::Vehicle(id) => format!("vehicle-{id}"),
            Sender::Operator(_) => "operator".to_owned(),
        }
    }

    /// Starts a process under a name, or starts it again.
    pub fn spawn(&mut self, name: &str, arguments: &[&str]) {
        let log = self.path(&format!("{name}.log"));
        let arguments = arguments.iter().map(|word| (*word).to_owned()).collect();
        let mut node = Node {
            arguments,
            preload: self.preloads.get(name).cloned(),
            log,
            child: None,
        };
        node.start(self.folder.path());
        self.processes.insert(name.to_owned(), node);
    }

    /// Returns the number of a process.
    pub fn process_id(&self, name: &str) -> u32 {
        self.processes[name].child.as_ref().unwrap().id()
    }

    fn spawn_node(&mut self, node: Sender) {
        let name = Swarm::name(node);
        let (command, options) = match node {
            GROUND => ("ground", self.ground_options.clone()),
            _ => ("vehicle", Vec::new()),
        };
        let file = format!("{name}.toml");
        let options = options.iter().map(String::as_str);
        let words: Vec<&str> = [command, &file].into_iter().chain(options).collect();
        self.spawn(&name, &words);
    }

    /// Ends a process as a power cut does, after a look at how much memory it took.
    pub fn kill(&mut self, name: &str) {
        let mut node = self.processes.remove(name).unwrap();
        check_memory(name, &node);
        let child = node.child.as_mut().unwrap();
        child.kill().unwrap();
        child.wait().unwrap();
        self.note(&format!("{name} killed"));
    }

    pub fn restart(&mut self, node: Sender) {
        self.note(&format!("{node} started"));
        self.spawn_node(node);
    }

    /// Stops a process from running, without ending it.
    pub fn stop(&self, node: Sender) {
        self.stop_process(&Swarm::name(node));
    }

    pub fn go_on(&self, node: Sender) {
        self.let_process_go_on(&Swarm::name(node));
    }

    pub fn stop_process(&self, name: &str) {
        self.note(&format!("{name} stopped"));
        self.processes[name].signal(Signal::STOP);
    }

    pub fn let_process_go_on(&self, name: &str) {
        self.note(&format!("{name} goes on"));
        self.processes[name].signal(Signal::CONT);
    }

    /// Waits until a process ends by itself; returns its exit code and its log.
    pub fn ended(&mut self, name: &str, limit: Duration) -> (Option<i32>, String) {
        let node = self.processes.get_mut(name).unwrap();
        let status = node.ends_within(limit);
        let printed = std::fs::read_to_string(&node.log).unwrap();
        (status.and_then(|status| status.code()), printed)
    }

    pub fn log_of(&self, node: Sender) -> String {
        std::fs::read_to_string(self.path(&format!("{}.log", Swarm::name(node)))).unwrap()
    }

    /// Returns all relays between one side and the rest.
    pub fn border<'a>(&'a self, side: &'a [Sender]) -> impl Iterator<Item = &'a Relay> {
        let crosses = |(a, b): &(Sender, Sender)| side.contains(a) != side.contains(b);
        self.relays
            .iter()
            .filter(move |(ends, _)| crosses(ends))
            .map(|(_, relay)| relay)
    }

    pub fn relays(&self) -> impl Iterator<Item = &Relay> {
        self.relays.values()
    }

    /// Returns the processor time that a process's threads with a name that begins so have taken so far, seconds.
    pub fn processor_s(&self, node: Sender, threads: &str) -> f64 {
        self.processes[&Swarm::name(node)].processor_s(threads)
    }

    /// Looks at what the operator has heard.
    pub fn look<T>(&self, look: impl FnOnce(&Watch) -> T) -> T {
        look(&self.watch.lock().unwrap())
    }

    /// Waits until something was heard.
    pub fn until(&self, what: &str, limit_s: u64, holds: impl Fn(&Watch) -> bool) {
        let began = Instant::now();
        while !self.look(&holds) {
            let report = self.look(Watch::report);
            assert!(
                began.elapsed() < Duration::from_secs(limit_s),
                "not within {limit_s} s: {what}; {report:?}"
            );
            std::thread::sleep(Duration::from_millis(50));
        }
        self.note(&format!(
            "{what}, after {:.1} s",
            began.elapsed().as_secs_f64()
        ));
    }

    pub fn note(&self, what: &str) {
        println!("{:5.1} s {what}", self.began.elapsed().as_secs_f64());
    }

    /// Waits until everyone is there, and starts run 1.
    pub fn begin(&self) {
        self.until("all are there", 20, |watch| {
            let all = (1..=self.size.vehicles).all(|id| watch.view.state(VehicleId(id)).is_some());
            all && watch.view.grounds().next().is_some()
        });
        self.order(&["start", "--run", "1"]);
        self.until("the sweep runs", 60, |watch| {
            watch.report().phase == StationPhase::Running
        });
    }

    /// Waits until the sweep has begun and so many samples of run 1 are stored.
    pub fn until_samples(&self, count: u64) {
        self.until("enough samples", 60, |watch| {
            watch.report().samples >= count
        });
    }

    /// Orders, whatever becomes of it.
    pub fn try_order(&self, words: &[&str]) -> Output {
        let mut program = Command::new(PROGRAM);
        let run = program
            .args(["order", "operator.toml"])
            .args(words)
            .current_dir(self.folder.path());
        run.output().unwrap()
    }

    pub fn order(&self, words: &[&str]) {
        let run = self.try_order(words);
        // What each vehicle shows stands on stdout, what is wrong on stderr.
        let printed = [&run.stdout, &run.stderr].map(|printed| String::from_utf8_lossy(printed));
        assert!(
            run.status.success(),
            "order {words:?}: {}",
            printed.concat()
        );
    }

    /// Returns an order that is refused as bad usage; returns what is said of it.
    pub fn refused(&self, words: &[&str]) -> String {
        let mut program = Command::new(PROGRAM);
        let run = program
            .args(["order", "operator.toml"])
            .args(words)
            .current_dir(self.folder.path());
        let run = run.output().unwrap();
        assert_eq!(run.status.code(), Some(2), "order {words:?}");
        String::from_utf8_lossy(&run.stderr).into_owned()
    }

    /// Runs an operator's tool to its end, however it ends; returns what it prints.
    pub fn tool(&self, words: &[&str]) -> String {
        let run = Command::new(PROGRAM)
            .args(words)
            .current_dir(self.folder.path())
            .output()
            .unwrap();
        String::from_utf8_lossy(&run.stdout).into_owned()
    }

    /// Returns where the persons truly stand.
    pub fn persons(&self) -> Vec<Point> {
        let mut world = WorldControl::connect(self.world, TOKEN).unwrap();
        world.report().unwrap().persons
    }

    /// Waits until the sweep has ended.
    pub fn until_end(&self) {
        self.until("the sweep has ended", 120, Watch::has_ended);
    }

    /// Waits until the ground has confirmed all that the vehicles have measured.
    pub fn until_delivered(&self) {
        let waits = |watch: &Watch, id| {
            let health = watch.view.vehicle(VehicleId(id))?.health.as_ref()?;
            Some(health.value.samples_waiting)
        };
        self.until("all samples are stored", 20, |watch| {
            (1..=self.size.vehicles).all(|id| waits(watch, id) == Some(0))
        });
    }

    /// Waits until the maps of all nodes are equal.
    pub fn until_maps_equal(&self, limit_s: u64) {
        let nodes: BTreeSet<Sender> = self.addresses.keys().copied().collect();
        let began = Instant::now();
        while !self.look(|watch| watch.agree(&nodes)) {
            let held = || self.look(|watch| format!("{:?}", watch.digests));
            assert!(
                began.elapsed() < Duration::from_secs(limit_s),
                "maps differ: {}",
                held()
            );
            std::thread::sleep(Duration::from_millis(50));
        }
        self.note(&format!(
            "all maps are equal, after {:.1} s",
            began.elapsed().as_secs_f64()
        ));
    }

    /// Checks what every scenario claims: the sweep ends, maps are equal, no collision, bounded memory, an end in order,
    /// and no sample lost or doubled.
    pub fn finish(&mut self) {
        self.until_end();
        self.until_maps_equal(10);
        self.finish_among_strangers();
    }

    /// The same where others have written into the maps, whose digests are their own.
    pub fn finish_among_strangers(&mut self) {
        self.until_end();
        for (name, node) in &self.processes {
            check_memory(name, node);
        }
        let status = WorldControl::connect(self.world, TOKEN)
            .unwrap()
            .report()
            .unwrap();
        assert_eq!(
            (status.collision_count, status.fence_breaches),
            (0, 0),
            "{:?}",
            status.collisions
        );
        self.end_in_order();
        self.check_samples("state-g", RunId(1));
    }

    /// The same where bytes were damaged on links without certificates: what is damaged and reads as a message is believed, so
    /// what is stored is compared by its numbers only.
    pub fn finish_after_damage(&mut self) {
        self.until_end();
        self.until_maps_equal(20);
        let status = WorldControl::connect(self.world, TOKEN)
            .unwrap()
            .report()
            .unwrap();
        assert_eq!(
            (status.collision_count, status.fence_breaches),
            (0, 0),
            "{:?}",
            status.collisions
        );
        self.end_in_order();
        let store = GroundStore::open_to_read(&self.path("state-g").join("ground.sqlite")).unwrap();
        let mut stored: BTreeMap<VehicleId, Vec<u64>> = BTreeMap::new();
        store
            .each_sample(None, |row| {
                if (row.boot, row.run) == (start(1), RunId(1)) {
                    stored
                        .entry(row.vehicle)
                        .or_default()
                        .push(row.sample.sequence);
                }
            })
            .unwrap();
        for id in (1..=self.size.vehicles).map(VehicleId) {
            let sequences = stored.entry(id).or_default();
            sequences.sort_unstable();
            let printed = self.look(|watch| watch.samples_of(id.0, 1));
            assert!(
                printed > 0 && *sequences == (0..sequences.len() as u64).collect::<Vec<_>>(),
                "a gap: {id}"
            );
        }
    }

    /// The same where somebody has said frames in others' names: a sample of a number that no vehicle has come to is stored as
    /// well, and of the true ones none may be missing.
    pub fn finish_after_forgery(&mut self, run: RunId) {
        let status = WorldControl::connect(self.world, TOKEN)
            .unwrap()
            .report()
            .unwrap();
        assert_eq!(
            (status.collision_count, status.fence_breaches),
            (0, 0),
            "{:?}",
            status.collisions
        );
        self.end_in_order();
        let store = GroundStore::open_to_read(&self.path("state-g").join("ground.sqlite")).unwrap();
        let mut stored: BTreeMap<(VehicleId, RunId), Vec<u64>> = BTreeMap::new();
        store
            .each_sample(None, |row| {
                if row.boot == start(1) && row.sample.sequence < FORGED_FROM {
                    stored
                        .entry((row.vehicle, row.run))
                        .or_default()
                        .push(row.sample.sequence);
                }
            })
            .unwrap();
        for of in (1..=self.size.vehicles).map(|id| (VehicleId(id), run)) {
            assert!(stored.contains_key(&of), "nothing of {of:?}");
        }
        for (of, mut sequences) in stored {
            sequences.sort_unstable();
            assert_eq!(
                sequences,
                (0..sequences.len() as u64).collect::<Vec<_>>(),
                "a gap in {of:?}"
            );
        }
        let runs = store.runs().unwrap();
        assert!(
            runs.iter()
                .any(|stored| stored.run == run && stored.closed_utc_s.is_some()),
            "{runs:?}"
        );
    }

    /// Ends the vehicles and then the grounds, which store what the vehicles have said last.
    pub fn end_in_order(&mut self) {
        for kind in ["vehicle", "ground"] {
            let is_kind = |name: &&String| name.starts_with(kind);
            let names: Vec<String> = self.processes.keys().filter(is_kind).cloned().collect();
            for name in &names {
                let node = &self.processes[name];
                if node.child.is_some() {
                    node.signal(Signal::TERM);
                }
            }
            for name in &names {
                let node = self.processes.get_mut(name).unwrap();
                if node.child.is_some() {
                    let status = node.ends_within(Duration::from_secs(15));
                    assert_eq!(
                        status.and_then(|status| status.code()),
                        Some(0),
                        "{name} does not end in order"
                    );
                }
            }
        }
    }

    /// Checks that a store has every sample that was ever said, as it was said, that no sequence has a gap, and that the
    /// run is closed.
    pub fn check_samples(&self, state_dir: &str, run: RunId) {
        let store = GroundStore::open_to_read(&self.path(state_dir).join("ground.sqlite")).unwrap();
        let mut stored: BTreeMap<_, BTreeMap<u64, Sample>> = BTreeMap::new();
        let mut count = 0;
        store
            .each_sample(None, |row| {
                count += 1;
                let of = (row.vehicle, row.boot, row.run);
                let known = stored
                    .entry(of)
                    .or_default()
                    .insert(row.sample.sequence, row.sample);
                assert_eq!(known, None, "doubled");
            })
            .unwrap();
        // Strangers may have got something stored; of them nothing is claimed.
        stored.retain(|(vehicle, _, _), _| vehicle.0 <= self.size.vehicles);
        for (of, samples) in &stored {
            let sequences: Vec<u64> = samples.keys().copied().collect();
            let whole: Vec<u64> = (0..samples.len() as u64).collect();
            assert_eq!(sequences, whole, "a gap in {of:?}");
        }
        self.look(|watch| {
            for (of, samples) in watch
                .samples
                .iter()
                .filter(|(of, _)| of.0.0 <= self.size.vehicles)
            {
                let in_store = &stored[of];
                for (sequence, sample) in samples {
                    assert_eq!(in_store.get(sequence), Some(sample), "{of:?}");
                }
            }
        });
        let vehicles: BTreeSet<VehicleId> = stored.keys().map(|(vehicle, _, _)| *vehicle).collect();
        assert_eq!(
            vehicles.len(),
            usize::from(self.size.vehicles),
            "somebody measured nothing"
        );
        let runs = store.runs().unwrap();
        assert!(
            runs.iter()
                .any(|stored| stored.run == run && stored.closed_utc_s.is_some()),
            "{runs:?}"
        );
        self.note(&format!(
            "{count} samples stored, of {} starts and runs",
            stored.len()
        ));
    }
}

fn check_memory(name: &str, node: &Node) {
    if let Some(peak_kb) = node.memory_kb() {
        println!("        {name}: at most {peak_kb} kB");
        assert!(peak_kb < MEMORY_MAX_KB, "{name} took {peak_kb} kB");
    }
}

impl Drop for Swarm {
    fn drop(&mut self) {
        for node in self.processes.values_mut() {
            if let Some(child) = &mut node.child {
                let _ = child.kill();
                let _ = child.wait();
            }
        }
        if std::thread::panicking() {
            for node in self.processes.values() {
                let text = std::fs::read_to_string(&node.log).unwrap_or_default();
                let lines: Vec<&str> = text.lines().collect();
                let last = &lines[lines.len().saturating_sub(25)..];
                println!("--- {}\n{}", node.log.display(), last.join("\n"));
            }
        }
    }
}

const VENUE: &str = "kind = \"venue\"
name = \"courtyard\"
area_m = [0, 0, 6, 6]
fence_m = [[-4, -4], [10, -4], [10, 10], [-4, 10]]
homes_m = [[-1.5, -1.5], [7.5, -1.5], [7.5, 7.5], [-1.5, 7.5]]
[datum]
latitude_deg = 52.0
longitude_deg = 4.0
[swarm]
lost_after_s = 8
";
const SCENE: &str = "kind = \"scene\"
name = \"small\"
[[person]]
name = \"ada\"
at_m = [3, 3.5]
";
/// As fast as the range sensor allows.
const BODY: &str = "max_speed_mps = 1.5
acceleration_mps2 = 3
braking_mps2 = 3
turn_rate_deg_per_s = 360
";
