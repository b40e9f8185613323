//! `tomoswarm ground`: brings the ground station's actors together with the bus and the store, and keeps them until it is
//! asked to stop.
//!
//! What must not be lost is stored before it is an event: samples reach the station once they are in the store, and what
//! the station needs after a restart is stored before what follows from it is published; only for that the station
//! waits. Everything else is stored by a thread of its own (`store_thread.rs`). While samples cannot be stored the station
//! knows it: it closes no run, and is silent about what it has, so that vehicles send everything again afterwards.

mod archive;
mod store_thread;
mod utc;

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Instant;

use tomoswarm_proto::{
    Boot, GroundReport, Hello, Message, RecordingHealth, Sender, VehicleId, codec,
};

use self::archive::Archive;
use self::store_thread::{StoreJob, keeper};
use super::bus::{BusError, Publisher};
use super::log_book::LogBook;
use super::machine::Machine;
use super::mailbox::{Troubles, lock};
use super::member::BusMember;
use super::membership::{self, RandomUnavailable};
use super::newcomers::Newcomers;
use super::node_threads::LiveNode;
use super::process::{Finish, Process, StopRequest};
use super::program_file::watch_program;
use super::roster_watch::RosterWatch;
use super::self_report::SelfReport;
use super::state_dir::{StateDir, StateDirError};
use super::swarm_mavlink::SwarmMavlink;
use super::trust::TrustError;
use super::vehicle_process::{
    RecordedNode, recorder, recording_health, watch_folder, watch_recorder, watch_stops,
};
use crate::config::{self, Config, GroundFile};
use crate::ground::ActorSettings;
use crate::ground::from_config::{PartsError, ground_parts};
use crate::ground::imager::ImageStage;
use crate::ground::station::{self, Station, StationMemory};
use crate::ground::{Effect, Event, GroundWiring};
use crate::operator::preflight::{DISK_TROUBLE, disk_room};
use crate::stops::StopsSettings;
use crate::store::CheckedFileError;
use crate::store::StoreError;
use crate::store::ground::{GroundStore, RestoredStore, Start};
use crate::store::lost_thread;
use crate::store::stops::{StopsDriver, StopsFile};
use crate::time::Time;

/// Batches and tiles that may wait for the store.
const QUEUE: usize = 4096;
/// The name of the store in the ground station's folder.
pub const STORE: &str = "ground.sqlite";

/// Why the ground station's process cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum GroundError {
    /// Its folder cannot be used.
    #[error(transparent)]
    StateDir(#[from] StateDirError),
    /// The store cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The file asks for what cannot be.
    #[error(transparent)]
    Parts(#[from] PartsError),
    /// The bus cannot be opened.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// It is not known to the others, or does not know them.
    #[error(transparent)]
    Trust(#[from] TrustError),
    /// The system gives no random numbers.
    #[error(transparent)]
    NoChance(#[from] RandomUnavailable),
    /// Which emergency stops are open cannot be known.
    #[error(transparent)]
    Kept(#[from] CheckedFileError),
    /// The machine has no threads to give.
    #[error("a thread cannot be started: {0}")]
    Thread(#[from] std::io::Error),
}

/// How the ground station fares, for its status line.
#[derive(Clone, PartialEq, Debug)]
pub struct GroundStatus {
    /// What it said of itself last.
    pub report: Option<GroundReport>,
    /// Links to other nodes.
    pub links: usize,
    /// What is wrong.
    pub troubles: Vec<String>,
}

/// The files of the ground station.
#[derive(Clone, Copy, Debug)]
pub struct GroundFiles<'a> {
    /// Its file as it was read.
    pub file: &'a GroundFile,
    /// Its file, kept with the data.
    pub text: &'a str,
    /// The file of the place, kept with the data.
    pub venue_text: &'a str,
}

/// Runs the ground station until it is asked to stop or cannot go on. `mavlink` shows the swarm beside it; what is wrong
/// there is a trouble of the ground station's. `status` is called once a second.
///
/// # Errors
/// It cannot begin.
pub fn run(
    files: GroundFiles<'_>,
    mavlink: Option<&SwarmMavlink>,
    stop: &StopRequest,
    status: &mut dyn FnMut(&GroundStatus),
) -> Result<Finish, GroundError> {
    let GroundFiles {
        file,
        text,
        venue_text,
    } = files;
    let mut process = Process::begin(stop);
    let state_dir = StateDir::open(Path::new(&file.state_dir))?;
    let note = Some(file.operators_note.as_str()).filter(|note| !note.is_empty());
    let new_id = membership::draw()?;
    let start = Start {
        config: text,
        venue: venue_text,
        venue_hash: file.venue.hash(),
        seed: None,
        note,
        new_id,
    };
    let store = GroundStore::open(&state_dir.join(STORE), &start)?;
    let holder = membership::draw()?;
    let stops_file = StopsFile::at(state_dir.join("stops"));
    let source = ActorSettings {
        stops: kept_stops(&stops_file)?,
        ..source(file, state_dir.boot(), holder, &store)?
    };
    let hello = membership::greeting(Sender::Ground, state_dir.boot(), &file.venue, Vec::new())?;
    let mut roster = RosterWatch::begin(Sender::Ground, &file.venue, &file.bus, &state_dir);
    let access = roster.access()?;
    let bus = membership::bus_settings(Sender::Ground, &file.venue, &file.bus, access);
    let node = LiveGround::default();
    let (to_store, wanted) = sync_channel(QUEUE);
    let of_itself = Arc::new(SelfReport::new(
        Sender::Ground,
        hello.instance,
        &config::to_toml(&Config::Ground(Box::new(file.clone()))),
        LogBook::of_process().clone(),
    ));
    let subscriber = Subscriber {
        node: node.clone(),
        store: to_store.clone(),
        expected: expected(file),
        newcomers: Mutex::default(),
        of_itself: of_itself.clone(),
    };
    let mut member = process.join(bus, hello, move |sender, message| {
        subscriber.take(sender, message)
    })?;
    let troubles = process.context().troubles.clone();
    let edge = Arc::new(Edge {
        publisher: member.publisher(),
        archive: Arc::new(Archive::new(store, state_dir.place(), troubles.clone())),
        troubles: troubles.clone(),
        report: Mutex::default(),
        stops: StopsDriver::start(stops_file)?,
    });
    let told = node.clone();
    let keeper = keeper(edge.archive.clone(), wanted, move |event| told.tell(event))?;
    let about = RecordedNode {
        node: "ground",
        settings: text,
        venue: &file.venue,
    };
    let recorder = recorder(file.record, &state_dir, &about);
    let (machine, clock) = (Machine::watch(Path::new("/"))?, process.context().clock);
    let of_actors = edge.clone();
    let carry_out = move |effect| of_actors.carry_out(effect);
    let threads = node.start(process.context(), source, recorder.as_ref(), carry_out)?;
    let mut tick = |_: Time, member: &BusMember, troubles: &Troubles| {
        roster.look(member, troubles);
        watch_recorder(recorder.as_ref(), (&machine, clock), troubles);
        let recording = recording_health(recorder.as_ref());
        watch_disk(state_dir.free_mb(), recording, troubles);
        watch_folder(&state_dir, troubles);
        watch_program(troubles);
        watch_stops(&edge.stops, troubles);
        watch_store(&keeper, &node, troubles);
        watch_mavlink(mavlink, troubles);
        let of_itself = of_itself.due(Instant::now());
        of_itself
            .iter()
            .for_each(|message| edge.publisher.publish(message));
        node.tell(Event::Troubles(troubles.list()));
        let report = lock(&edge.report).clone();
        status(&GroundStatus {
            report,
            links: edge.publisher.links(),
            troubles: troubles.list(),
        });
    };
    let finish = process.keep(&mut member, &|now| node.busy_for(now), &mut tick);
    node.close();
    member.close();
    threads.join();
    // The bus's subscriber lives as long as anyone holds its publisher, so the queue never ends by itself.
    to_store.send(StoreJob::End).unwrap_or_default();
    let _ = keeper.join();
    Ok(finish)
}

/// Returns what the actors are made from: the station goes on where the store says that an earlier one was.
fn source(
    file: &GroundFile,
    boot: Boot,
    holder: u64,
    store: &GroundStore,
) -> Result<ActorSettings, GroundError> {
    let parts = ground_parts(file, boot, holder, store.id())?;
    let resumed = resume(parts.station.clone(), store.resume()?, &expected(file));
    Ok(ActorSettings {
        parts,
        resumed: Some(resumed),
        stops: StopsSettings::default(),
    })
}

fn kept_stops(file: &StopsFile) -> Result<StopsSettings, CheckedFileError> {
    Ok(StopsSettings {
        kept: file.read()?,
        ..StopsSettings::default()
    })
}

fn expected(file: &GroundFile) -> BTreeSet<VehicleId> {
    file.vehicles.iter().copied().collect()
}

/// What was stored of vehicles that are not expected any more stays in the store, and is passed over.
fn resume(
    settings: station::StationSettings,
    mut restored: RestoredStore,
    expected: &BTreeSet<VehicleId>,
) -> Station {
    restored
        .samples
        .retain(|batch| expected.contains(&batch.vehicle));
    restored
        .tiles
        .retain(|tile| expected.contains(&tile.layer.vehicle));
    if let Some(version) = &restored.foreign_memory {
        tracing::warn!(
            "the run was left by version {version}: it is not gone on with, its data are kept"
        );
    }
    let memory = restored.memory.as_deref().and_then(|bytes| match codec::unpack::<StationMemory>(bytes) {
        Ok(memory) => Some(memory),
        Err(error) => {
            tracing::warn!(
                "what the station remembered cannot be read, the run is not gone on with: {error}"
            );
            None
        }
    });
    let is_begun_anew = memory.is_none();
    if let Some(memory) = &memory {
        let stored = restored.samples.len();
        tracing::info!(
            "goes on with {}; {stored} batches of samples stored",
            memory
                .run()
                .map_or("no run".to_owned(), |run| format!("run {run}"))
        );
    }
    let mut station = Station::restored(settings, memory, restored.samples, restored.tiles);
    if is_begun_anew {
        station.recall_runs(
            restored
                .runs
                .iter()
                .map(|run| (run.run, run.closed_utc_s.is_some())),
        );
    }
    station
}

type LiveGround = LiveNode<GroundWiring>;

/// Takes what the bus delivers.
struct Subscriber {
    node: LiveGround,
    store: SyncSender<StoreJob>,
    expected: BTreeSet<VehicleId>,
    /// Operators that are told what is marked.
    newcomers: Mutex<Newcomers>,
    of_itself: Arc<SelfReport>,
}

impl Subscriber {
    /// Returns whether a message is by and about vehicles that the file names: of others nothing is kept, but which emergency
    /// stops they know.
    fn is_of_swarm(&self, sender: Sender, message: &Message) -> bool {
        if let Message::Standing(_) = message {
            return true;
        }
        let is_own = match sender {
            Sender::Vehicle(vehicle) => self.expected.contains(&vehicle),
            Sender::Ground | Sender::Operator(_) => true,
        };
        let about = if let Message::Tile(tile) = message {
            Some(tile.layer.vehicle)
        } else {
            None
        };
        is_own && about.is_none_or(|vehicle| self.expected.contains(&vehicle))
    }

    /// Has an operator who has just come told what is marked.
    fn tell_marks(&self, hello: &Hello) {
        let mut newcomers = lock(&self.newcomers);
        let is_new = newcomers.greets(Instant::now(), hello.instance);
        if is_new && self.store.try_send(StoreJob::TellMarks).is_err() {
            // The store cannot keep pace.
            newcomers.forget(hello.instance);
        }
    }

    /// Samples and what else is stored first go to the store, but nothing of strangers.
    fn take(&self, sender: Sender, message: Message) {
        if !self.is_of_swarm(sender, &message) {
            return;
        }
        match message {
            // When the store cannot keep pace a batch is dropped: its vehicle repeats it.
            Message::Samples(batch) => drop(self.store.try_send(StoreJob::Samples(batch))),
            Message::Hello(hello) => {
                match sender {
                    Sender::Vehicle(vehicle) => {
                        drop(self.store.try_send(StoreJob::Software(
                            vehicle,
                            hello.boot,
                            hello.software,
                        )));
                    }
                    Sender::Operator(_) => {
                        self.tell_marks(&hello);
                        self.of_itself.hear(Instant::now(), sender, &hello);
                        // It names the lease that it holds.
                        self.node.tell(Event::Bus(sender, Message::Hello(hello)))
                    }
                    Sender::Ground => {}
                }
            }
            Message::Tile(report) => {
                drop(self.store.try_send(StoreJob::Tile(report.clone())));
                self.node.tell(Event::Bus(sender, Message::Tile(report)));
            }
            Message::State(_)
            | Message::Digest(_)
            | Message::Want(_)
            | Message::Plan(_)
            | Message::Mission(_)
            | Message::Order(_)
            | Message::Have(_)
            | Message::Beacon(_)
            | Message::Health(_)
            | Message::Report(_)
            | Message::Standing(_)
            | Message::Task(_)
            | Message::Image(_)
            | Message::Fix(_) => self.node.tell(Event::Bus(sender, message)),
            // It is for operators, and comes with all that vehicles say.
            Message::Look(_) | Message::Log(_) | Message::Settings(_) => {}
            // One that cannot be taken now is said again.
            Message::Mark(mark) => drop(self.store.try_send(StoreJob::Mark(sender, mark))),
        }
    }
}

struct Edge {
    publisher: Publisher,
    archive: Arc<Archive>,
    troubles: Troubles,
    report: Mutex<Option<GroundReport>>,
    stops: StopsDriver,
}

impl Edge {
    fn carry_out(&self, effect: Effect) {
        match effect {
            Effect::Publish(message) => self.publish(message),
            Effect::Remember(memory) => match codec::pack(&*memory) {
                Ok(bytes) => self.archive.remember(bytes),
                Err(error) => self.troubles.raise("memory", error.to_string()),
            },
            Effect::Picture(picture) => {
                // What is still under way is shown to whoever listens, and the next one is better.
                if picture.stage != ImageStage::Ongoing {
                    if let Err(reason) = &picture.result {
                        tracing::warn!("no {} of run {}: {reason}", picture.subject, picture.run);
                    }
                    self.archive.hold_picture(*picture);
                }
            }
            Effect::BeginRun { run, compared_with } => self.archive.hold_run(run, compared_with),
            Effect::EndRun(run) => self.archive.hold_end(run),
            Effect::KeepStops(standing) => self.stops.keep(&standing),
            Effect::StopEvent(event) => tracing::info!("{event}"),
            Effect::StationEvent(note) => tracing::info!("{note}"),
        }
    }

    fn publish(&self, message: Message) {
        match message {
            Message::Plan(plan) => {
                self.archive.hold_plan(&plan);
                self.publisher.publish(&Message::Plan(plan));
            }
            Message::Report(report) => {
                self.publisher.publish(&Message::Report(report.clone()));
                *lock(&self.report) = Some(report);
            }
            Message::State(_)
            | Message::Digest(_)
            | Message::Want(_)
            | Message::Mission(_)
            | Message::Order(_)
            | Message::Have(_)
            | Message::Beacon(_)
            | Message::Health(_)
            | Message::Samples(_)
            | Message::Hello(_)
            | Message::Tile(_)
            | Message::Standing(_)
            | Message::Task(_)
            | Message::Image(_)
            | Message::Fix(_)
            | Message::Mark(_)
            | Message::Look(_)
            | Message::Log(_)
            | Message::Settings(_) => self.publisher.publish(&message),
        }
    }
}

/// Tells whether the disk has room for a run; `free_mb` = `None`: nobody says how much it has.
fn watch_disk(free_mb: Option<u32>, recording: Option<RecordingHealth>, troubles: &Troubles) {
    match free_mb.map(|free_mb| disk_room(free_mb, recording)) {
        Some((false, found)) => troubles.raise(DISK_TROUBLE, found),
        Some((true, _)) | None => troubles.clear(DISK_TROUBLE),
    }
}

/// Tells whether anybody stores anything; the station closes no run while nobody does.
fn watch_store(keeper: &JoinHandle<()>, node: &LiveGround, troubles: &Troubles) {
    if let Some(trouble) = lost_thread(Some(keeper)) {
        troubles.raise("store", trouble);
        node.tell(Event::StoresSamples(false));
    }
}

fn watch_mavlink(mavlink: Option<&SwarmMavlink>, troubles: &Troubles) {
    match mavlink.and_then(SwarmMavlink::trouble) {
        Some(trouble) => troubles.raise("mavlink", trouble),
        None => troubles.clear("mavlink"),
    }
}

#[cfg(test)]
mod tests;
