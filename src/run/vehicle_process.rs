//! `tomoswarm vehicle`: brings a vehicle's actors together with the bus, the disk and the drivers of its devices, and keeps
//! them until it is asked to stop. It knows no driver (`drivers/`).
//!
//! By whose right it was ordered is read from its folder before it joins anything: a vehicle that cannot know it does not
//! start. When it cannot be written under way, that is a trouble, and no start is obeyed (`node/vehicle/orders.rs`).
//!
//! At the end the mission is sent home; it may be in the middle of a search. Until it has ended and the vehicle stands, but
//! for three seconds at most, the vehicle is told to stop, again and again, past the link to its autopilot if that has ended.
//! Then all actors end, the vehicle is told to stop a last time, when nobody is left who could say anything else; the disk is
//! flushed, and the bus is left.

use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant, SystemTime};

use tomoswarm_proto::{Message, RecordingHealth, Sender, State};

use super::bus::{BusError, Publisher};
use super::clock::Clock;
use super::drivers::{EventSink, VehicleDevices};
use super::later_start::LaterStart;
use super::log_book::LogBook;
use super::machine::Machine;
use super::mailbox::{Troubles, lock};
use super::member::BusMember;
use super::membership::{self, RandomUnavailable};
use super::node_threads::{LiveNode, Threads};
use super::process::{Finish, LookRequest, Process, StopRequest};
use super::program_file::watch_program;
use super::roster_watch::RosterWatch;
use super::self_report::SelfReport;
use super::state_dir::{StateDir, StateDirError};
use super::trust::TrustError;
use crate::autopilot::{AutopilotCommand, CommandPurpose, LinkEvent, link};
use crate::config::{self, Config, Record, VehicleFile, Venue};
use crate::geom::Lattice;
use crate::node::health::{HealthEvent, HealthFacts};
use crate::node::route::VehicleEvent;
use crate::node::{Effect, Event, VehicleSettings, VehicleWiring};
use crate::store::CheckedFileError;
use crate::store::memory::{MemoryDriver, MemoryFile};
use crate::store::outbox::{OutboxDriver, OutboxSettings};
use crate::store::recording::{Recorder, RecordingLimits, RecordingSubject};
use crate::store::stops::{StopsDriver, StopsFile};
use crate::time::Time;

/// What the samples on disk may grow to, bytes.
const OUTBOX_BYTES: u64 = 1 << 30;
/// At the end a vehicle that drives gets this long to brake.
const BRAKES_WITHIN: Duration = Duration::from_secs(3);
/// It is told to at least for this long: what the mission said last is done by then, and telemetry shows it.
const BRAKES_AT_LEAST: Duration = Duration::from_millis(300);
/// It is told to this often.
const STOP_EVERY: Duration = Duration::from_millis(50);

/// Why a vehicle's process cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum VehicleError {
    /// Its folder cannot be used.
    #[error(transparent)]
    StateDir(#[from] StateDirError),
    /// What it has obeyed before, or which emergency stops are open, cannot be known.
    #[error(transparent)]
    Kept(#[from] CheckedFileError),
    /// The bus cannot be opened.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// It is not known to the others, or does not know them.
    #[error(transparent)]
    Trust(#[from] TrustError),
    /// The system gives no random numbers.
    #[error(transparent)]
    NoChance(#[from] RandomUnavailable),
    /// The machine has no threads to give.
    #[error("a thread cannot be started: {0}")]
    Thread(#[from] std::io::Error),
}

/// How a vehicle fares, for its status line.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct NodeStatus {
    /// Its newest state, once its autopilot was heard.
    pub state: Option<State>,
    /// Links to other nodes.
    pub links: usize,
    /// Whether it takes part in the bus.
    pub is_member: bool,
    /// What is wrong.
    pub troubles: Vec<String>,
}

/// What the edge remembers of what it carried out.
#[derive(Default)]
struct Last {
    state: Option<State>,
    /// What was wrong when it said last how it fares.
    troubles: Vec<String>,
}

impl Last {
    fn is_moving(&self) -> bool {
        self.state.as_ref().is_some_and(|state| state.mode.moves())
    }
}

type LiveVehicle = LiveNode<VehicleWiring>;

struct Edge {
    publisher: Publisher,
    devices: VehicleDevices,
    outbox: OutboxDriver,
    memory: MemoryDriver,
    stops: StopsDriver,
    last: Arc<Mutex<Last>>,
    later: Arc<LaterStart>,
    node: LiveVehicle,
    machine: Machine,
    clock: Clock,
    look: LookRequest,
}

impl Edge {
    fn carry_out(&self, effect: Effect) {
        match &effect {
            Effect::Command(_)
            | Effect::Fix(..)
            | Effect::Steer(_)
            | Effect::Ping(_)
            | Effect::Transmit(_) => {
                self.devices.carry_out(&effect);
                // That one has failed is noticed whenever one is used, so that no thread wakes to look for it.
                if self.devices.has_new_trouble() {
                    self.look.ask();
                }
            }
            Effect::Publish(message) => {
                if let Message::State(state) = message {
                    self.later.say(state.sequence);
                    lock(&self.last).state = Some(state.clone());
                }
                if let Message::Health(health) = message {
                    lock(&self.last).troubles.clone_from(&health.troubles);
                }
                self.publisher.publish(message);
            }
            Effect::VehicleEvent(note) => match is_trouble(note) {
                true => tracing::warn!("{note}"),
                false => tracing::info!("{note}"),
            },
            Effect::Keep(run, sample) => {
                self.later.measure(*run, sample.sequence);
                self.outbox.keep(*run, *sample);
            }
            Effect::Forget { boot, run, below } => self.outbox.forget(*boot, *run, *below),
            Effect::Recall { after } => self.outbox.recall(*after),
            Effect::Remember(memory) => self.memory.remember(*memory),
            Effect::KeepStops(standing) => self.stops.keep(standing),
        }
    }
}

/// Returns whether something is wrong by which the vehicle does not do what it is to do.
fn is_trouble(event: &VehicleEvent) -> bool {
    matches!(
        event,
        VehicleEvent::Health(HealthEvent::AutopilotSilent)
            | VehicleEvent::Autopilot(LinkEvent::GivenUp(CommandPurpose::Arm, _))
    )
}

/// Runs a vehicle until it is asked to stop or cannot go on. `status` is called once a second, and when a device fails.
///
/// # Errors
/// It cannot begin.
pub fn run(
    file: &VehicleFile,
    stop: &StopRequest,
    status: &mut dyn FnMut(&NodeStatus),
) -> Result<Finish, VehicleError> {
    let mut process = Process::begin(stop);
    let state_dir = StateDir::open(Path::new(&file.state_dir))?;
    let memory_file = MemoryFile::at(state_dir.join("memory"));
    let remembered = memory_file.read()?;
    let stops_file = StopsFile::at(state_dir.join("stops"));
    let stops = stops_file.read()?;
    let settings = VehicleSettings {
        memory: remembered,
        stops,
        ..VehicleSettings::from_vehicle_file(file, state_dir.boot())
    };
    let sender = Sender::Vehicle(file.id);
    let hello = membership::greeting(
        sender,
        state_dir.boot(),
        &file.venue,
        file.drivers.capabilities(file.flight.craft),
    )?;
    let node = LiveVehicle::default();
    let told = node.clone();
    let later = Arc::new(LaterStart::of(
        file.id,
        state_dir.counts(),
        process.context(),
    ));
    let (listening, clock) = (later.clone(), process.context().clock);
    let shown = shown_settings(file);
    let of_itself = Arc::new(SelfReport::new(
        sender,
        hello.instance,
        &shown,
        LogBook::of_process().clone(),
    ));
    let asked = of_itself.clone();
    let mut roster = RosterWatch::begin(sender, &file.venue, &file.bus, &state_dir);
    let access = roster.access()?;
    let bus = membership::bus_settings(sender, &file.venue, &file.bus, access);
    let mut member = process.join(bus, hello, move |sender, message| {
        listening.hear(clock.now(), &message);
        if let Message::Hello(hello) = &message {
            asked.hear(Instant::now(), sender, hello);
        }
        told.tell(Event::Bus(sender, message))
    })?;
    // Nothing is driven by a node that may not take part.
    if let Some(finish) = process.ask(&mut member) {
        member.close();
        return Ok(finish);
    }
    later.join(clock.now());
    let last = Arc::new(Mutex::<Last>::default());
    let told = node.clone();
    let told: EventSink = Arc::new(move |event| told.tell(event));
    let devices = VehicleDevices::start(file, state_dir.boot(), clock, &told)?;
    let outbox = outbox(file, &state_dir, node.clone())?;
    let told = node.clone();
    let memory = MemoryDriver::start(memory_file, remembered, move |event| told.tell(event))?;
    let stops = StopsDriver::start(stops_file)?;
    let edge = Arc::new(Edge {
        publisher: member.publisher(),
        devices,
        outbox,
        memory,
        stops,
        last,
        later: later.clone(),
        node: node.clone(),
        machine: Machine::watch(Path::new("/"))?,
        clock,
        look: process.look_request(),
    });
    let of_actors = edge.clone();
    let name = format!("vehicle/{}", file.id);
    let about = RecordedNode {
        node: &name,
        settings: &shown,
        venue: &file.venue,
    };
    let recorder = recorder(file.record, &state_dir, &about);
    let carry_out = move |effect| of_actors.carry_out(effect);
    let threads = node.start(
        process.context(),
        settings.clone(),
        recorder.as_ref(),
        carry_out,
    )?;
    let mut tick = |now: Time, member: &BusMember, troubles: &Troubles| {
        roster.look(member, troubles);
        edge.devices.watch(troubles);
        edge.watch_disk(troubles);
        watch_folder(&state_dir, troubles);
        watch_program(troubles);
        watch_recorder(recorder.as_ref(), (&edge.machine, clock), troubles);
        later.settle(now);
        let of_itself = of_itself.due(Instant::now());
        of_itself
            .iter()
            .for_each(|message| edge.publisher.publish(message));
        let facts = edge.facts(&state_dir, recorder.as_ref(), troubles);
        node.tell(Event::Facts(Box::new(facts)));
        let last = lock(&edge.last);
        let mut shown = NodeStatus {
            state: last.state.clone(),
            troubles: last.troubles.clone(),
            ..NodeStatus::default()
        };
        drop(last);
        shown.links = edge.publisher.links();
        shown.is_member = member.is_member();
        status(&shown);
    };
    let finish = process.keep(&mut member, &|now| node.busy_for(now), &mut tick);
    edge.come_to_rest(&threads);
    node.close();
    threads.join();
    edge.devices.stop();
    // Nobody else holds them: what is not on disk yet is written now.
    drop((edge, recorder));
    member.close();
    later.count();
    Ok(finish)
}

/// Returns a vehicle's file as others may read it, on the bus and in recordings.
fn shown_settings(file: &VehicleFile) -> String {
    config::to_toml(&Config::Vehicle(Box::new(file.without_secrets())))
}

/// What a node's recording says of it.
pub(super) struct RecordedNode<'a> {
    /// The node as its channels name it.
    pub(super) node: &'a str,
    /// The text of its file, as others may read it.
    pub(super) settings: &'a str,
    pub(super) venue: &'a Venue,
}

/// Begins to record, if the file wants it.
pub(super) fn recorder(
    record: Record,
    state_dir: &StateDir,
    about: &RecordedNode<'_>,
) -> Option<Recorder> {
    let cap_bytes = record.limit_bytes()?;
    let about = RecordingSubject {
        node: about.node.to_owned(),
        settings: about.settings.to_owned(),
        venue: config::to_toml(&Config::Venue(about.venue.clone())),
        lattice: Lattice::new(about.venue.cell_m),
        start: Some(state_dir.boot()),
        // Whether the machine's clock is right is not known yet.
        utc_at_zero_ns: None,
    };
    let defaults = RecordingLimits::default();
    let segment_bytes = defaults.segment_bytes.min(cap_bytes / 8);
    let limits = RecordingLimits {
        cap_bytes,
        segment_bytes,
        leaves_reserve: true,
        ..defaults
    };
    Some(Recorder::start(state_dir.join("flight"), about, limits))
}

/// Returns when a node's clock began, nanoseconds since 1970 by the machine's: it has gone on for a while already.
fn utc_at_zero_ns(utc: SystemTime, now: Time) -> Option<u64> {
    let utc = utc.duration_since(SystemTime::UNIX_EPOCH).ok()?;
    let begun = utc.checked_sub(now.since(Time::ZERO))?;
    u64::try_from(begun.as_nanos()).ok()
}

/// Tells whether the recording is in order, and the recording what time it is, as far as the machine knows it.
pub(super) fn watch_recorder(
    recorder: Option<&Recorder>,
    (machine, clock): (&Machine, Clock),
    troubles: &Troubles,
) {
    if let (Some(recorder), true) = (recorder, machine.has_right_time())
        && let Some(utc_ns) = utc_at_zero_ns(SystemTime::now(), clock.now())
    {
        recorder.note_utc(utc_ns);
    }
    match recorder.and_then(Recorder::trouble) {
        Some(trouble) => troubles.raise("recording", trouble),
        None => troubles.clear("recording"),
    }
}

/// Returns what the recording takes, and what it may take, MB (10⁶ bytes).
pub(super) fn recording_health(recorder: Option<&Recorder>) -> Option<RecordingHealth> {
    let mb = |bytes: u64| u32::try_from(bytes / 1_000_000).unwrap_or(u32::MAX);
    recorder.map(|recorder| {
        let of_disk = recorder.disk_use();
        RecordingHealth {
            used_mb: mb(of_disk.used_bytes),
            limit_mb: mb(of_disk.cap_bytes),
        }
    })
}

/// Tells whether the node's folder still is where it was.
pub(super) fn watch_folder(state_dir: &StateDir, troubles: &Troubles) {
    match state_dir.trouble() {
        Some(trouble) => troubles.raise("folder", trouble),
        None => troubles.clear("folder"),
    }
}

/// Tells whether the emergency stops that are known are on disk.
pub(super) fn watch_stops(stops: &StopsDriver, troubles: &Troubles) {
    match stops.trouble() {
        Some(trouble) => troubles.raise("emergency stops", trouble),
        None => troubles.clear("emergency stops"),
    }
}

fn outbox(
    file: &VehicleFile,
    state_dir: &StateDir,
    node: LiveVehicle,
) -> std::io::Result<OutboxDriver> {
    let settings = OutboxSettings {
        path: state_dir.join("outbox.sqlite"),
        vehicle: file.id,
        boot: state_dir.boot(),
        most_bytes: OUTBOX_BYTES,
    };
    OutboxDriver::start(settings, move |event| node.tell(event))
}

impl Edge {
    fn watch_disk(&self, troubles: &Troubles) {
        let health = self.outbox.health();
        match health.trouble {
            Some(trouble) => troubles.raise(
                "outbox",
                format!("{trouble}; {} samples in memory", health.not_durable),
            ),
            None => troubles.clear("outbox"),
        }
        if let Some(moved) = health.moved_aside {
            troubles.raise("outbox file", moved);
        }
        match self.memory.trouble() {
            Some(trouble) => troubles.raise("memory", trouble),
            None => troubles.clear("memory"),
        }
        watch_stops(&self.stops, troubles);
    }

    fn facts(
        &self,
        state_dir: &StateDir,
        recorder: Option<&Recorder>,
        troubles: &Troubles,
    ) -> HealthFacts {
        let traffic = self.publisher.traffic();
        let machine = self.machine.health();
        HealthFacts {
            samples_lost: self.outbox.health().overrun,
            inputs_dropped: self.node.dropped(),
            frames_refused: traffic.refused,
            frames_unknown: traffic.unknown,
            disk_free_mb: state_dir.free_mb(),
            recording: recording_health(recorder),
            autopilot: self.devices.autopilot_health(),
            radio: self.devices.radio_health(),
            range: self.devices.range_health(),
            power: machine.power,
            processor_c: machine.processor_c,
            is_clock_synchronised: machine.is_clock_synchronised,
            troubles: troubles.list(),
        }
    }

    /// Brakes, until the vehicle stands and the mission has ended, or for long enough.
    fn come_to_rest(&self, threads: &Threads) {
        let mission = &self.node.actors().mission;
        mission.place.close();
        let begun = self.clock.now();
        let mut ended = None;
        loop {
            say_stop(&self.node, threads, || self.devices.stop());
            let now = self.clock.now();
            if threads.has_ended(mission.wire.name) {
                ended.get_or_insert(now);
            }
            let is_over = ended.is_some_and(|at| now.since(at) >= BRAKES_AT_LEAST);
            if now.since(begun) >= BRAKES_WITHIN || (is_over && !lock(&self.last).is_moving()) {
                return;
            }
            std::thread::sleep(STOP_EVERY);
        }
    }
}

/// Tells the vehicle to stop: by the link to its autopilot, or `past_link` when that has ended, since its driver goes on with
/// what it was told last.
fn say_stop(node: &LiveVehicle, threads: &Threads, past_link: impl FnOnce()) {
    let autopilot = &node.actors().autopilot;
    if threads.has_ended(autopilot.wire.name) {
        return past_link();
    }
    let stop = link::In::AutopilotCommand(AutopilotCommand::Stop);
    autopilot.place.tell(stop);
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::sync::mpsc::channel;

    use tomoswarm_proto::Boot;

    use super::super::mailbox::RuntimeContext;
    use super::*;

    #[test]
    fn utc_is_noted_of_when_the_clock_began_and_not_of_when_it_is_asked() {
        let utc = SystemTime::UNIX_EPOCH + Duration::from_secs(1_000);
        let at = utc_at_zero_ns(utc, Time::from_secs_f64(7.5));
        assert_eq!(at, Some(992_500_000_000));
        assert_eq!(utc_at_zero_ns(utc, Time::from_secs_f64(1_001.0)), None);
    }

    fn simulated() -> VehicleFile {
        let text = "kind = \"vehicle\"\nvenue = \"courtyard.venue.toml\"\nid = 1\nstate_dir = \"state\"\n\
                    vehicle.max_speed_mps = 0.2\nautopilot.driver = \"sim\"\nradio.driver = \"sim\"\n\
                    servo.driver = \"none\"\nrange.driver = \"none\"\nworld.connect = \"127.0.0.1:9\"\n\
                    world.token = \"secret-token\"\n";
        let mut load = |path: &str| config::bundled::load(path);
        config::read_vehicle("configs/v.toml", text, &mut load).unwrap()
    }

    #[test]
    fn a_recording_does_not_hold_what_lets_a_driver_into_the_simulated_world() {
        let (folder, file) = (tempfile::tempdir().unwrap(), simulated());
        let state_dir = StateDir::open(folder.path()).unwrap();
        let settings = shown_settings(&file);
        let about = RecordedNode {
            node: "vehicle/1",
            settings: &settings,
            venue: &file.venue,
        };
        drop(recorder(file.record, &state_dir, &about).unwrap());
        let recorded = std::fs::read(folder.path().join("flight/flight-000001.mcap")).unwrap();
        let holds = |text: &str| {
            let mut parts = recorded.windows(text.len());
            parts.any(|part| part == text.as_bytes())
        };
        assert!(holds("max_speed_mps") && !holds("secret-token"));
    }

    #[test]
    fn a_vehicle_whose_link_to_the_autopilot_has_ended_is_stopped_past_it() {
        let file = simulated();
        let (endings, _ended) = channel();
        let context = RuntimeContext {
            clock: Clock::start(),
            troubles: Troubles::default(),
            endings,
        };
        let node = LiveVehicle::default();
        let settings = VehicleSettings::from_vehicle_file(&file, Boot(1));
        let threads = node.start(&context, settings, None, |_| {}).unwrap();
        let past_link = Cell::new(0);
        let stop = || say_stop(&node, &threads, || past_link.set(past_link.get() + 1));
        stop();
        assert_eq!(past_link.get(), 0, "the link sees to it that it stands");
        let autopilot = &node.actors().autopilot;
        autopilot.place.close();
        while !threads.has_ended(autopilot.wire.name) {
            std::thread::yield_now();
        }
        stop();
        assert_eq!(past_link.get(), 1);
        node.close();
        threads.join();
    }
}
