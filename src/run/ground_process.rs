//! `tomoswarm ground`: brings the ground station's actors together with the bus and the store, and keeps them until it is
//! asked to stop.
//!
//! What must not be lost is stored before it is an event: samples reach the station once they are in the store, and what
//! the station needs after a restart is stored before what follows from it is published. A store in trouble stops
//! nothing: samples are not acknowledged meanwhile, so the vehicles keep them.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime};

use tomoswarm_proto::{
    Boot, LayerId, Message, Report, RunId, Samples, Sender, TileAddress, TileReport, VehicleId, codec,
};

use super::bus::{BusError, Mouth};
use super::desk::{Troubles, lock};
use super::ground::{Desks, Makers, seat_all};
use super::herald::Herald;
use super::membership::{self, NoChance};
use super::process::{Finish, Process};
use super::state_dir::{StateDir, StateDirError};
use super::trust::TrustError;
use super::vehicle_process::{recorder, short, watch_recorder};
use crate::actor::{Actor, Fault};
use crate::config::GroundFile;
use crate::ground::from_config::{GroundParts, PartsError, ground_parts};
use crate::ground::station::{self, Memory, Note, Station};
use crate::ground::{Effect, Event};
use crate::store::StoreError;
use crate::store::ground::{GroundStore, Restored, Start, UtcOffset};
use crate::time::Time;

/// Batches and tiles that may wait for the store.
const QUEUE: usize = 4096;
/// Samples are stored in groups, a group at least this often.
const GROUP: Duration = Duration::from_millis(50);
/// Batches of one group at most.
const GROUP_MOST: usize = 256;
/// Tiles are stored this often.
const TILES_EVERY: Duration = Duration::from_secs(2);
/// A clock's estimate counts as better by this much, seconds.
const CLOCK_STEP_S: f64 = 0.05;
/// Deviation of such an estimate: how long a sample may be on its way, seconds.
const CLOCK_ERROR_S: f64 = 0.5;

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
    NoChance(#[from] NoChance),
    /// The machine has no threads to give.
    #[error("a thread cannot be started: {0}")]
    Thread(#[from] std::io::Error),
}

/// How the ground station fares, for its status line.
#[derive(Clone, PartialEq, Debug)]
pub struct Status {
    /// What it said of itself last.
    pub report: Option<Report>,
    /// Links to other nodes.
    pub links: usize,
    /// What is wrong.
    pub troubles: Vec<String>,
}

/// What waits for the store.
enum Wanted {
    Samples(Samples),
    Tile(TileReport),
    Software(VehicleId, Boot, String),
    /// Nothing more: what came before is stored, and the thread ends.
    End,
}

/// Runs the ground station until it is asked to stop or cannot go on; `text` and `venue_text` are its files, kept with
/// the data. `status` is called once a second.
///
/// # Errors
/// It cannot begin.
pub fn run(
    file: &GroundFile,
    text: &str,
    venue_text: &str,
    is_stopped: &dyn Fn() -> bool,
    status: &mut dyn FnMut(&Status),
) -> Result<Finish, GroundError> {
    let mut process = Process::begin();
    let state_dir = StateDir::open(Path::new(&file.state_dir))?;
    let note = Some(file.operators_note.as_str()).filter(|note| !note.is_empty());
    let new_id = membership::draw()?;
    let start =
        Start { config: text, venue: venue_text, venue_hash: file.venue.hash(), seed: None, note, new_id };
    let store = GroundStore::open(&state_dir.join("ground.sqlite"), &start)?;
    let holder = membership::draw()?;
    let makers = makers(file, state_dir.boot(), holder, &store)?;
    let hello = membership::greeting(Sender::Ground, state_dir.boot(), &file.venue, &["plans", "images"])?;
    let access = membership::access(Sender::Ground, &file.venue, &file.bus, Some(&state_dir))?;
    let bus = membership::bus_settings(Sender::Ground, &file.venue, &file.bus, access);
    let desks = Desks::default();
    let (to_store, wanted) = sync_channel(QUEUE);
    let told = desks.clone();
    let by_bus = to_store.clone();
    let mut herald =
        process.join(bus, hello, move |sender, message| take(&told, &by_bus, sender, message))?;
    let troubles = process.office().troubles.clone();
    let edge = Arc::new(Edge {
        mouth: herald.mouth(),
        store: Mutex::new(store),
        troubles: troubles.clone(),
        plans: Mutex::default(),
        compare_with: file.compare_with,
        report: Mutex::default(),
    });
    let keeper = keeper(edge.clone(), desks.clone(), wanted)?;
    let lattice = crate::geom::Lattice::new(file.venue.cell_m);
    let recorder = recorder(file.record, &state_dir, "ground", text, lattice);
    let of_actors = edge.clone();
    let carry_out = move |effect| of_actors.carry_out(effect);
    let threads = seat_all(process.office(), &desks, makers, recorder.as_ref(), carry_out)?;
    let mut tick = |_: Time, _: &Herald, troubles: &Troubles| {
        watch_recorder(recorder.as_ref(), troubles);
        let report = lock(&edge.report).clone();
        status(&Status { report, links: edge.mouth.links(), troubles: troubles.list() });
    };
    let finish = process.keep(&mut herald, is_stopped, &|now| desks.busy_for(now), &mut tick);
    desks.close();
    herald.close();
    // The bus's ear lives as long as anyone holds its mouth, so the queue never ends by itself.
    to_store.send(Wanted::End).unwrap_or_default();
    for thread in threads.into_iter().chain([keeper]) {
        // Who panicked has said so already.
        let _ = thread.join();
    }
    Ok(finish)
}

/// Gives what makes the actors: the station goes on where the store says that an earlier one was.
fn makers(file: &GroundFile, boot: Boot, holder: u64, store: &GroundStore) -> Result<Makers, GroundError> {
    let GroundParts { station, planner, imager } = ground_parts(file, boot, holder, store.id())?;
    let restored = store.resume()?;
    let mut first = Some(resume(station.clone(), restored));
    let mut imager = Some(imager);
    let again = file.clone();
    let id = store.id();
    Ok(Makers {
        station: Box::new(move || Ok(first.take().unwrap_or_else(|| Station::new(station.clone())))),
        planner: Box::new(move || Ok(planner.clone())),
        imager: Box::new(move || match imager.take() {
            Some(imager) => Ok(imager),
            None => ground_parts(&again, boot, holder, id)
                .map(|parts| parts.imager)
                .map_err(|error| Fault { actor: "imager", reason: error.to_string() }),
        }),
    })
}

fn resume(settings: station::StationSettings, restored: Restored) -> Station {
    if let Some(version) = &restored.foreign_memory {
        tracing::warn!("the run was left by version {version}: it is not gone on with, its data are kept");
    }
    let memory = restored.memory.as_deref().and_then(|bytes| match codec::unpack::<Memory>(bytes) {
        Ok(memory) => Some(memory),
        Err(error) => {
            tracing::warn!(
                "what the station remembered cannot be read, the run is not gone on with: {error}"
            );
            None
        }
    });
    if let Some(memory) = memory {
        tracing::info!(
            "goes on with run {:?}; {} batches of samples stored",
            memory.run(),
            restored.samples.len()
        );
        return Station::resume(settings, memory, restored.samples, restored.tiles);
    }
    let mut station = Station::new(settings);
    let samples = restored.samples.into_iter().map(Message::Samples);
    for message in samples.chain(restored.tiles.into_iter().map(Message::Tile)) {
        // Nothing that is stored can stop a station, and nothing that it says of it is news.
        let _ = station.handle(Time::ZERO, station::In::Bus(message), &mut Vec::new());
    }
    station
}

/// Takes a message from the bus: samples and what else is stored first go to the store.
fn take(desks: &Desks, store: &SyncSender<Wanted>, sender: Sender, message: Message) {
    match message {
        // When the store cannot keep pace a batch is dropped: its vehicle repeats it.
        Message::Samples(batch) => drop(store.try_send(Wanted::Samples(batch))),
        Message::Hello(hello) => {
            if let Sender::Vehicle(vehicle) = sender {
                drop(store.try_send(Wanted::Software(vehicle, hello.boot, hello.software)));
            }
        }
        Message::Tile(report) => {
            drop(store.try_send(Wanted::Tile(report.clone())));
            desks.tell(Event::Bus(Message::Tile(report)));
        }
        Message::State(_)
        | Message::Digest(_)
        | Message::Want(_)
        | Message::Plan(_)
        | Message::Progress(_)
        | Message::Order(_)
        | Message::Have(_)
        | Message::Beacon(_)
        | Message::Health(_)
        | Message::Report(_) => desks.tell(Event::Bus(message)),
    }
}

struct Edge {
    mouth: Mouth,
    store: Mutex<GroundStore>,
    troubles: Troubles,
    /// The newest edition of each plan that is stored.
    plans: Mutex<BTreeMap<VehicleId, (RunId, u32)>>,
    compare_with: Option<RunId>,
    report: Mutex<Option<Report>>,
}

impl Edge {
    fn carry_out(&self, effect: Effect) {
        match effect {
            Effect::Publish(message) => self.publish(message),
            Effect::Remember(memory) => match codec::pack(&*memory) {
                Ok(bytes) => self.write("memory", |store| store.remember(&bytes)),
                Err(error) => self.troubles.raise("memory", error.to_string()),
            },
            Effect::Picture(picture) => {
                if let Err(reason) = &picture.result {
                    tracing::warn!("no {:?} picture of run {}: {reason}", picture.subject, picture.run);
                }
                self.write("store", |store| store.keep_picture(&picture));
            }
            Effect::Note(note) => self.note(&note),
        }
    }

    fn publish(&self, message: Message) {
        match &message {
            Message::Plan(plan) => {
                let edition = (plan.run, plan.revision.0);
                let known = lock(&self.plans).insert(plan.vehicle, edition);
                if known != Some(edition) {
                    self.write("store", |store| store.keep_plan(plan));
                }
            }
            Message::Report(report) => {
                let report = Report { troubles: short(self.troubles.list()), ..report.clone() };
                self.mouth.publish(&Message::Report(report.clone()));
                *lock(&self.report) = Some(report);
                return;
            }
            _ => {}
        }
        self.mouth.publish(&message);
    }

    fn note(&self, note: &Note) {
        tracing::info!("{note:?}");
        match note {
            Note::Planned { run, .. } => {
                let empty = self.compare_with.filter(|empty| empty != run);
                self.write("store", |store| store.note_run(*run, empty));
            }
            Note::RunClosed { run, .. } => self.write("store", |store| store.close_run(*run)),
            _ => {}
        }
    }

    fn write(&self, what: &str, write: impl FnOnce(&mut GroundStore) -> Result<(), StoreError>) {
        match write(&mut lock(&self.store)) {
            Ok(()) => self.troubles.clear(what),
            Err(error) => self.troubles.raise(what, error.to_string()),
        }
    }
}

/// Starts the thread that stores samples and tiles, and tells the station of samples once they are stored.
fn keeper(edge: Arc<Edge>, desks: Desks, wanted: Receiver<Wanted>) -> std::io::Result<JoinHandle<()>> {
    let keep = move || {
        let mut keeper = Keeper {
            edge,
            desks,
            tiles: BTreeMap::new(),
            tiles_at: SystemTime::now(),
            clocks: BTreeMap::new(),
        };
        loop {
            let first = match wanted.recv_timeout(GROUP) {
                Ok(first) => Some(first),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => break,
            };
            let group: Vec<Wanted> = first.into_iter().chain(wanted.try_iter().take(GROUP_MOST)).collect();
            let is_end = group.iter().any(|wanted| matches!(wanted, Wanted::End));
            keeper.keep(group);
            if is_end {
                break;
            }
        }
        keeper.keep_tiles();
    };
    std::thread::Builder::new().name("store".to_owned()).spawn(keep)
}

struct Keeper {
    edge: Arc<Edge>,
    desks: Desks,
    /// Tiles not stored yet, the newest of each.
    tiles: BTreeMap<(LayerId, TileAddress), TileReport>,
    tiles_at: SystemTime,
    /// The best estimate of each vehicle's clock: UTC when it showed zero, seconds.
    clocks: BTreeMap<(VehicleId, Boot), f64>,
}

impl Keeper {
    fn keep(&mut self, group: Vec<Wanted>) {
        let mut batches = Vec::new();
        for wanted in group {
            match wanted {
                Wanted::Samples(batch) => {
                    self.set_clock(&batch);
                    batches.push(batch);
                }
                Wanted::Tile(tile) => self.hold(tile),
                Wanted::Software(vehicle, boot, software) => {
                    self.edge
                        .write("store", |store| store.note_vehicle(vehicle, boot, Some(&software), None));
                }
                Wanted::End => {}
            }
        }
        if !batches.is_empty() {
            self.keep_samples(batches);
        }
        if self.tiles_at.elapsed().map_or(true, |age| age >= TILES_EVERY) {
            self.tiles_at = SystemTime::now();
            self.keep_tiles();
        }
    }

    fn keep_samples(&mut self, batches: Vec<Samples>) {
        let taken = lock(&self.edge.store).take(&batches);
        match taken {
            Ok(_) => {
                self.edge.troubles.clear("samples");
                for batch in batches {
                    self.desks.tell(Event::Bus(Message::Samples(batch)));
                }
            }
            // Not acknowledged: their vehicles repeat them.
            Err(error) => self.edge.troubles.raise("samples", error.to_string()),
        }
    }

    fn hold(&mut self, tile: TileReport) {
        let key = (tile.layer, tile.address);
        if self.tiles.get(&key).is_none_or(|known| known.revision <= tile.revision) {
            self.tiles.insert(key, tile);
        }
    }

    fn keep_tiles(&mut self) {
        if self.tiles.is_empty() {
            return;
        }
        let tiles = std::mem::take(&mut self.tiles);
        self.edge.write("tiles", |store| store.keep_tiles(tiles.values()));
    }

    /// Estimates how a vehicle's clock stands to UTC: the newest sample of a batch was heard just before it came.
    fn set_clock(&mut self, batch: &Samples) {
        let Some(newest) = batch.samples.iter().map(|sample| sample.heard_at_ns).max() else { return };
        let Ok(utc) = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH) else { return };
        let offset_s = utc.as_secs_f64() - newest as f64 * 1e-9;
        let source = (batch.vehicle, batch.boot);
        if self.clocks.get(&source).is_some_and(|known| *known < offset_s + CLOCK_STEP_S) {
            return;
        }
        self.clocks.insert(source, offset_s);
        let clock = Some(UtcOffset { offset_s, error_s: CLOCK_ERROR_S });
        self.edge.write("store", |store| store.note_vehicle(batch.vehicle, batch.boot, None, clock));
    }
}
