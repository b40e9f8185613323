//! The ground's store, and what still waits to be written into it. What cannot be written is kept, the newest of each, and
//! written later; a store in trouble stops nothing. Samples are no matter of this page's waiting: their vehicles keep
//! them until they are acknowledged.

use std::collections::BTreeMap;
use std::sync::Mutex;

use tomoswarm_proto::{
    Boot, LayerId, Mark, Plan, Revision, RunId, Samples, TileAddress, TileReport, VehicleId,
};

use super::super::mailbox::{Troubles, lock};
use super::super::state_dir::FolderPlace;
use crate::ground::imager::{ReconstructedImage, Subject};
use crate::map::ANY_REVISION_UNTIL;
use crate::store::StoreError;
use crate::store::ground::{GroundStore, UtcOffset};

/// While nothing can be written, this many of each kind are kept: the newest; of tiles, which vehicles say again, any.
const PLANS_MOST: usize = 1024;
const PICTURES_MOST: usize = 64;
const RUNS_MOST: usize = 1024;
const TILES_MOST: usize = 16_384;

/// The store, shared by the station's thread and the keeper's.
pub(super) struct Archive {
    disk: Mutex<Disk>,
    waiting: Mutex<Waiting>,
    place: FolderPlace,
    troubles: Troubles,
}

struct Disk {
    store: GroundStore,
    /// The newest memory that could not be stored.
    memory: Option<Vec<u8>>,
}

/// A plan's edition.
type Edition = (RunId, Revision);

#[derive(Default)]
struct Waiting {
    plans: BTreeMap<(Edition, VehicleId), Plan>,
    /// The newest edition of each vehicle's plan that is stored.
    stored: BTreeMap<VehicleId, Edition>,
    pictures: BTreeMap<(RunId, usize, Subject), ReconstructedImage>,
    runs: BTreeMap<RunId, RunEntry>,
    tiles: BTreeMap<(LayerId, TileAddress), TileReport>,
    software: BTreeMap<VehicleId, (Boot, String, bool)>,
    clocks: BTreeMap<VehicleId, (Boot, UtcOffset)>,
}

/// What is to be noted of a run.
#[derive(Clone, Copy, Default)]
struct RunEntry {
    /// It began, compared with a run or with none.
    began: Option<Option<RunId>>,
    is_closed: bool,
}

impl Archive {
    /// Takes the store, and where its folder is.
    pub(super) fn new(store: GroundStore, place: FolderPlace, troubles: Troubles) -> Archive {
        let disk = Mutex::new(Disk {
            store,
            memory: None,
        });
        Archive {
            disk,
            waiting: Mutex::default(),
            place,
            troubles,
        }
    }

    /// Stores a memory before it gives back; one that cannot be stored is kept.
    pub(super) fn remember(&self, memory: Vec<u8>) {
        let mut disk = lock(&self.disk);
        let stored = disk.store.remember(&memory);
        disk.memory = stored.is_err().then_some(memory);
        self.say("memory", stored);
    }

    pub(super) fn hold_plan(&self, plan: &Plan) {
        let edition = (plan.run, plan.revision);
        let mut waiting = lock(&self.waiting);
        if waiting.stored.get(&plan.vehicle) != Some(&edition) {
            waiting.plans.insert((edition, plan.vehicle), plan.clone());
            cut(&mut waiting.plans, PLANS_MOST);
        }
    }

    pub(super) fn hold_picture(&self, picture: ReconstructedImage) {
        let mut waiting = lock(&self.waiting);
        waiting
            .pictures
            .insert((picture.run, picture.laps, picture.subject), picture);
        cut(&mut waiting.pictures, PICTURES_MOST);
    }

    pub(super) fn hold_run(&self, run: RunId, empty: Option<RunId>) {
        let mut waiting = lock(&self.waiting);
        waiting.runs.entry(run).or_default().began = Some(empty);
        cut(&mut waiting.runs, RUNS_MOST);
    }

    pub(super) fn hold_end(&self, run: RunId) {
        let mut waiting = lock(&self.waiting);
        waiting.runs.entry(run).or_default().is_closed = true;
        cut(&mut waiting.runs, RUNS_MOST);
    }

    /// One whose revision is beyond all that is usual is left to the map to judge: here it would stay for ever.
    pub(super) fn hold_tile(&self, tile: TileReport) {
        if tile.revision > ANY_REVISION_UNTIL {
            return;
        }
        let mut waiting = lock(&self.waiting);
        let key = (tile.layer, tile.address);
        if waiting
            .tiles
            .get(&key)
            .is_none_or(|known| known.revision <= tile.revision)
        {
            waiting.tiles.insert(key, tile);
            cut(&mut waiting.tiles, TILES_MOST);
        }
    }

    /// Notes a vehicle's software, when it is not known of this start yet.
    pub(super) fn hold_software(&self, vehicle: VehicleId, boot: Boot, software: String) {
        let mut waiting = lock(&self.waiting);
        let is_known = |known: &(Boot, String, bool)| {
            boot < known.0 || (boot, &software) == (known.0, &known.1)
        };
        if !waiting.software.get(&vehicle).is_some_and(is_known) {
            waiting.software.insert(vehicle, (boot, software, false));
        }
    }

    /// Stores samples; returns whether they are stored, where they will be found.
    pub(super) fn keep_samples(&self, batches: &[Samples]) -> bool {
        if !self.place.is_there() {
            return false;
        }
        let taken = lock(&self.disk).store.take(batches);
        let is_stored = taken.is_ok();
        self.say("samples", taken.map(|_| ()));
        is_stored
    }

    /// Stores a mark, or takes it back; returns whether that is stored. One that is not stored is said again.
    pub(super) fn keep_mark(&self, mark: Mark) -> bool {
        self.place.is_there() && self.write("marks", |store| store.keep_mark(mark))
    }

    /// Returns the marks of the newest runs, so many at most, the last one first; none where they cannot be read.
    pub(super) fn newest_marks(&self, most: usize) -> Vec<Mark> {
        let marks = lock(&self.disk).store.newest_marks(most);
        marks.unwrap_or_else(|error| {
            tracing::warn!("no marks can be read: {error}");
            Vec::new()
        })
    }

    /// Notes how a vehicle's clock stands; a later estimate replaces it.
    pub(super) fn hold_clock(&self, vehicle: VehicleId, boot: Boot, clock: UtcOffset) {
        lock(&self.waiting).clocks.insert(vehicle, (boot, clock));
    }

    /// Writes what waits, tiles only on request; what cannot be written waits on. Gives whether all is well.
    pub(super) fn keep(&self, with_tiles: bool) -> bool {
        let all = [
            self.keep_memory(),
            self.keep_runs(),
            self.keep_plans(),
            self.keep_pictures(),
            self.keep_software(),
            self.keep_clocks(),
            !with_tiles || self.keep_tiles(),
        ];
        all.into_iter().all(|is_well| is_well)
    }

    fn keep_memory(&self) -> bool {
        let mut disk = lock(&self.disk);
        let Disk { store, memory } = &mut *disk;
        let Some(bytes) = memory.as_ref() else {
            return true;
        };
        let stored = store.remember(bytes);
        let is_well = stored.is_ok();
        if is_well {
            *memory = None;
        }
        self.say("memory", stored);
        is_well
    }

    fn keep_plans(&self) -> bool {
        let plans = std::mem::take(&mut lock(&self.waiting).plans);
        if plans.is_empty() {
            return true;
        }
        let is_well = self.write("plans", |store| store.keep_plans(plans.values()));
        let mut waiting = lock(&self.waiting);
        if is_well {
            waiting.stored.extend(
                plans
                    .into_keys()
                    .map(|(edition, vehicle)| (vehicle, edition)),
            );
        } else {
            give_back(&mut waiting.plans, plans, PLANS_MOST);
        }
        is_well
    }

    fn keep_pictures(&self) -> bool {
        let mut pictures = std::mem::take(&mut lock(&self.waiting).pictures);
        while let Some(first) = pictures.first_entry() {
            if !self.write("pictures", |store| store.keep_picture(first.get())) {
                give_back(&mut lock(&self.waiting).pictures, pictures, PICTURES_MOST);
                return false;
            }
            first.remove();
        }
        true
    }

    fn keep_runs(&self) -> bool {
        let mut runs = std::mem::take(&mut lock(&self.waiting).runs);
        while let Some((run, RunEntry { began, is_closed })) = runs.pop_first() {
            let write = |store: &mut GroundStore| {
                began.map_or(Ok(()), |empty| store.note_run(run, empty))?;
                if is_closed {
                    store.close_run(run)
                } else {
                    Ok(())
                }
            };
            if !self.write("runs", write) {
                let mut waiting = lock(&self.waiting);
                runs.insert(run, RunEntry { began, is_closed });
                for (run, before) in runs {
                    let story = waiting.runs.entry(run).or_default();
                    story.began = story.began.or(before.began);
                    story.is_closed |= before.is_closed;
                }
                return false;
            }
        }
        true
    }

    fn keep_software(&self) -> bool {
        let is_new =
            |(vehicle, (boot, software, is_stored)): (&VehicleId, &(Boot, String, bool))| {
                (!is_stored).then(|| (*vehicle, *boot, software.clone()))
            };
        let new: Vec<_> = lock(&self.waiting)
            .software
            .iter()
            .filter_map(is_new)
            .collect();
        for (vehicle, boot, software) in new {
            if !self.write("software", |store| {
                store.note_vehicle(vehicle, boot, Some(&software), None)
            }) {
                return false;
            }
            let mut waiting = lock(&self.waiting);
            let same = waiting
                .software
                .get_mut(&vehicle)
                .filter(|held| (held.0, &held.1) == (boot, &software));
            same.into_iter().for_each(|held| held.2 = true);
        }
        true
    }

    fn keep_clocks(&self) -> bool {
        let mut clocks = std::mem::take(&mut lock(&self.waiting).clocks);
        while let Some((vehicle, (boot, clock))) = clocks.pop_first() {
            if !self.write("clocks", |store| {
                store.note_vehicle(vehicle, boot, None, Some(clock))
            }) {
                clocks.insert(vehicle, (boot, clock));
                give_back(&mut lock(&self.waiting).clocks, clocks, usize::MAX);
                return false;
            }
        }
        true
    }

    fn keep_tiles(&self) -> bool {
        let tiles = std::mem::take(&mut lock(&self.waiting).tiles);
        if tiles.is_empty() {
            return true;
        }
        let is_well = self.write("tiles", |store| store.keep_tiles(tiles.values()));
        if !is_well {
            give_back(&mut lock(&self.waiting).tiles, tiles, TILES_MOST);
        }
        is_well
    }

    fn write(
        &self,
        kind: &str,
        write: impl FnOnce(&mut GroundStore) -> Result<(), StoreError>,
    ) -> bool {
        let written = write(&mut lock(&self.disk).store);
        let is_well = written.is_ok();
        self.say(kind, written);
        is_well
    }

    /// One kind's success says nothing of another kind.
    fn say(&self, kind: &str, written: Result<(), StoreError>) {
        let name = format!("store of {kind}");
        match written {
            Ok(()) => self.troubles.clear(&name),
            Err(error) => self.troubles.raise(&name, error.to_string()),
        }
    }
}

/// Puts back what could not be written, but not in place of what came meanwhile.
fn give_back<K: Ord, V>(waiting: &mut BTreeMap<K, V>, back: BTreeMap<K, V>, most: usize) {
    let newer = std::mem::replace(waiting, back);
    waiting.extend(newer);
    cut(waiting, most);
}

fn cut<K: Ord, V>(waiting: &mut BTreeMap<K, V>, most: usize) {
    while waiting.len() > most {
        waiting.pop_first();
    }
}
