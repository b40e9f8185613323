//! The ground station's store: one SQLite file per venue, with everything that must outlive the process. The tables
//! are documented in `docs/store.md`.
//!
//! WAL and `synchronous = FULL`: what a method has stored when it returns outlives the process and the power. Each
//! method is one transaction: all of it is stored or nothing, and after an error the store goes on as before. It
//! decides nothing and knows no bus: the edge stores samples here *before* it tells the station of them.

mod reading;
mod schema;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use rusqlite::{
    Connection, OpenFlags, OptionalExtension, Transaction, TransactionBehavior, params,
};
use serde_json::json;
use tomoswarm_proto::{Boot, Mark, Plan, RunId, Samples, TileReport, VehicleId};

use super::{StoreError, sample_row};
use crate::ground::imager::{ReconstructedImage, Subject};
use crate::tomo::{Image, Peak};

pub use reading::{Provenance, RestoredStore, StoredImage, StoredMark, StoredRun};

/// How long another program may hold the file.
const BUSY: Duration = Duration::from_secs(3);
/// Starts of one vehicle whose clocks are known, the newest; samples of older ones get no UTC.
const CLOCKS_MOST: usize = 64;
/// The program's own version.
const SOFTWARE: &str = env!("CARGO_PKG_VERSION");
/// What wrote a memory: its form changes with the wire as well.
const MEMORY: &str = concat!(env!("CARGO_PKG_VERSION"), ", wire 2");

/// What a start of the ground station says about itself, to be kept with the data.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Start<'a> {
    /// Text of the ground station's config.
    pub config: &'a str,
    /// Text of the venue file.
    pub venue: &'a str,
    /// Hash of the venue; a store holds the data of one venue.
    pub venue_hash: u64,
    /// Seed, when the world is simulated.
    pub seed: Option<u64>,
    /// What the operator wants to be remembered.
    pub note: Option<&'a str>,
    /// Id that a store gets when it is made: random, never twice.
    pub new_id: u64,
}

/// How a vehicle's clock stands to UTC.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct UtcOffset {
    /// UTC, seconds since 1970, when the vehicle's clock showed zero.
    pub offset_s: f64,
    /// Standard deviation of it, seconds.
    pub error_s: f64,
}

/// The ground station's store.
#[derive(Debug)]
pub struct GroundStore {
    connection: Connection,
    path: PathBuf,
    id: u64,
    clocks: BTreeMap<(VehicleId, Boot), UtcOffset>,
    /// Held so that no second ground station writes the same file.
    _lock: Option<File>,
}

impl GroundStore {
    /// Opens a store to write, or makes one, and notes the start in it.
    ///
    /// # Errors
    /// [`StoreError`]: nothing is changed then.
    pub fn open(path: &Path, start: &Start) -> Result<GroundStore, StoreError> {
        let fail = |source| StoreError::of(path, source);
        let connection = Connection::open(path).map_err(fail)?;
        connection.busy_timeout(BUSY).map_err(fail)?;
        let is_new = schema::is_empty(&connection, path)?;
        if !is_new {
            schema::check(&connection, path)?;
        }
        let lock = lock(path)?;
        let mode: String = connection
            .query_row("PRAGMA journal_mode = WAL", [], |row| row.get(0))
            .map_err(fail)?;
        if mode != "wal" {
            let reason = format!("the disk allows no write-ahead log (journal mode {mode})");
            return Err(StoreError::Unopened {
                path: path.to_owned(),
                reason,
            });
        }
        connection
            .execute_batch("PRAGMA synchronous = FULL; PRAGMA cache_size = -8192;")
            .map_err(fail)?;
        let clocks = BTreeMap::new();
        let mut store = GroundStore {
            connection,
            path: path.to_owned(),
            id: 0,
            clocks,
            _lock: Some(lock),
        };
        store.begin(start)?;
        store.clocks = store.read_clocks()?;
        Ok(store)
    }

    /// Opens a store to read, also while a ground station writes it. Nothing can be stored through it.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn open_to_read(path: &Path) -> Result<GroundStore, StoreError> {
        let fail = |source| StoreError::of(path, source);
        if !path.is_file() {
            let reason = if path.exists() {
                "it is no file"
            } else {
                "there is no such file"
            };
            return Err(StoreError::Unopened {
                path: path.to_owned(),
                reason: reason.to_owned(),
            });
        }
        let connection = open_read_only(path).map_err(fail)?;
        connection.busy_timeout(BUSY).map_err(fail)?;
        if schema::is_empty(&connection, path)? {
            return Err(StoreError::NoStore {
                path: path.to_owned(),
                found: "an empty file",
            });
        }
        schema::check(&connection, path)?;
        let clocks = BTreeMap::new();
        let mut store = GroundStore {
            connection,
            path: path.to_owned(),
            id: 0,
            clocks,
            _lock: None,
        };
        store.id = store.identity().map(|(id, _)| id)?;
        Ok(store)
    }

    /// Returns the store's id: drawn when it was made, and kept.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// Returns the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Makes the tables if there are none, or brings them up to date, and notes the start; a store of another venue is left as it
    /// is.
    fn begin(&mut self, start: &Start) -> Result<(), StoreError> {
        let expected = start.venue_hash;
        let found = self.write(|transaction| {
            let has_tables = transaction
                .pragma_query_value(None, "application_id", |row| row.get::<_, i64>(0))?;
            if has_tables != schema::APPLICATION {
                transaction.execute_batch(&schema::tables())?;
                transaction.execute(
                    "INSERT INTO store VALUES (?, ?, ?)",
                    params![hex(start.new_id), hex(expected), now_utc_s()],
                )?;
            }
            let found: String =
                transaction.query_row("SELECT venue_hash FROM store", [], |row| row.get(0))?;
            if found != hex(expected) {
                return Ok(found);
            }
            let version = schema::version(transaction)?;
            transaction.execute_batch(&schema::updates(version))?;
            transaction.execute(
                "INSERT INTO provenance VALUES (?, ?, ?, ?, ?, ?, ?)",
                params![
                    now_utc_s(),
                    SOFTWARE,
                    start.config,
                    start.venue,
                    hex(expected),
                    start.seed.map(u64::cast_signed),
                    start.note
                ],
            )?;
            Ok(found)
        })?;
        if found != hex(expected) {
            let found = u64::from_str_radix(&found, 16).unwrap_or(0);
            return Err(StoreError::OtherVenue {
                path: self.path.clone(),
                found,
                expected,
            });
        }
        self.id = self.identity().map(|(id, _)| id)?;
        Ok(())
    }

    /// Stores batches of samples, each sample once; returns how many were new.
    ///
    /// # Errors
    /// [`StoreError`]: nothing of the batches is stored; do not acknowledge them.
    pub fn take(&mut self, batches: &[Samples]) -> Result<usize, StoreError> {
        let clocks = std::mem::take(&mut self.clocks);
        let taken = self.write(|transaction| {
            let mut new = 0;
            for batch in batches {
                note_source(transaction, batch)?;
                new += insert(transaction, batch, clocks.get(&(batch.vehicle, batch.boot)))?;
            }
            Ok(new)
        });
        self.clocks = clocks;
        taken
    }

    /// Stores tiles, of each the highest revision.
    ///
    /// # Errors
    /// [`StoreError`]: none of them is stored.
    pub fn keep_tiles<'a>(
        &mut self,
        tiles: impl IntoIterator<Item = &'a TileReport>,
    ) -> Result<(), StoreError> {
        self.write(|transaction| {
            let mut statement = transaction.prepare_cached(
                "INSERT INTO tiles VALUES (?, ?, ?, ?, ?, ?, ?)
                 ON CONFLICT DO UPDATE SET revision = excluded.revision, cells = excluded.cells
                 WHERE (excluded.revision, excluded.cells) > (revision, cells)",
            )?;
            for tile in tiles {
                let cells: Vec<u8> = tile.cells.iter().map(|cell| cell.cast_unsigned()).collect();
                let (layer, at) = (tile.layer, tile.address);
                statement.execute(params![
                    layer.vehicle.0,
                    layer.boot.0,
                    at.slice,
                    at.x,
                    at.y,
                    tile.revision,
                    cells
                ])?;
            }
            Ok(())
        })
    }

    /// Stores plans, each in place of an earlier one of the same run, revision and vehicle.
    ///
    /// # Errors
    /// [`StoreError`]: none of them is stored.
    pub fn keep_plans<'a>(
        &mut self,
        plans: impl IntoIterator<Item = &'a Plan>,
    ) -> Result<(), StoreError> {
        self.write(|transaction| {
            let mut statement = transaction
                .prepare_cached("INSERT OR REPLACE INTO plans VALUES (?, ?, ?, ?, ?, ?)")?;
            for plan in plans {
                statement.execute(params![
                    plan.run.0,
                    plan.revision.0,
                    plan.vehicle.0,
                    plan.lease.number,
                    hex(plan.lease.holder),
                    json!(plan).to_string()
                ])?;
            }
            Ok(())
        })
    }

    /// Stores a picture; one that could not be made is passed over.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn keep_picture(&mut self, picture: &ReconstructedImage) -> Result<(), StoreError> {
        let Ok(made) = &picture.result else {
            return Ok(());
        };
        let Image { grid, values } = &made.image;
        let bytes = |values: &[f64]| -> Vec<u8> {
            let numbers = values.iter().map(|value| *value as f32);
            numbers.flat_map(f32::to_le_bytes).collect()
        };
        let peaks: Vec<_> = made.peaks.iter().map(peak_json).collect();
        self.write(|transaction| {
            transaction.execute(
                "INSERT OR REPLACE INTO images VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                params![
                    picture.run.0,
                    picture.laps as i64,
                    kind_name(picture.subject),
                    now_utc_s(),
                    grid.rows as i64,
                    grid.columns as i64,
                    grid.area.min.x_m,
                    grid.area.min.y_m,
                    grid.area.max.x_m,
                    grid.area.max.y_m,
                    made.used as i64,
                    made.residual_rms_db,
                    json!(peaks).to_string(),
                    bytes(values),
                    json!(made.finds).to_string(),
                    made.deviation.as_deref().map(bytes)
                ],
            )?;
            Ok(())
        })
    }

    /// Notes that a run began; `empty` = the run that was measured with nobody inside.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn note_run(&mut self, run: RunId, empty: Option<RunId>) -> Result<(), StoreError> {
        self.write(|transaction| {
            transaction.execute(
                "INSERT INTO runs VALUES (?, ?, ?, NULL) ON CONFLICT DO UPDATE SET empty_run = excluded.empty_run",
                params![run.0, empty.map(|run| run.0), now_utc_s()],
            )?;
            Ok(())
        })
    }

    /// Stores a mark, or takes it back; one that stands already keeps its time.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn keep_mark(&mut self, mark: Mark) -> Result<(), StoreError> {
        let metres = |coordinate_mm: i32| f64::from(coordinate_mm) / 1e3;
        let (x_m, y_m, z_m) = (
            metres(mark.at.x_mm),
            metres(mark.at.y_mm),
            metres(mark.at.z_mm),
        );
        self.write(|transaction| {
            if mark.stands {
                transaction.execute(
                    "INSERT OR IGNORE INTO marks VALUES (?, ?, ?, ?, ?)",
                    params![mark.run.0, x_m, y_m, z_m, now_utc_s()],
                )?;
            } else {
                transaction.execute(
                    "DELETE FROM marks WHERE (run, x_m, y_m, z_m) = (?, ?, ?, ?)",
                    params![mark.run.0, x_m, y_m, z_m],
                )?;
            }
            Ok(())
        })
    }

    /// Notes that a run is closed.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn close_run(&mut self, run: RunId) -> Result<(), StoreError> {
        self.write(|transaction| {
            transaction.execute(
                "INSERT INTO runs VALUES (?1, NULL, ?2, ?2) ON CONFLICT DO UPDATE SET closed_utc_s = ?2",
                params![run.0, now_utc_s()],
            )?;
            Ok(())
        })
    }

    /// Notes a vehicle's software and how its clock stands to UTC, as far as known; samples that come from now on
    /// carry the estimate.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn note_vehicle(
        &mut self,
        vehicle: VehicleId,
        boot: Boot,
        software: Option<&str>,
        clock: Option<UtcOffset>,
    ) -> Result<(), StoreError> {
        self.write(|transaction| {
            transaction.execute(
                "INSERT INTO vehicles VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT DO UPDATE SET
                     software = coalesce(excluded.software, software),
                     utc_offset_s = coalesce(excluded.utc_offset_s, utc_offset_s),
                     utc_error_s = coalesce(excluded.utc_error_s, utc_error_s)",
                params![
                    vehicle.0,
                    boot.0,
                    software,
                    now_utc_s(),
                    clock.map(|clock| clock.offset_s),
                    clock.map(|clock| clock.error_s)
                ],
            )?;
            Ok(())
        })?;
        if let Some(clock) = clock {
            self.clocks.insert((vehicle, boot), clock);
            let of_vehicle = (vehicle, Boot(0))..=(vehicle, boot);
            if self.clocks.range(of_vehicle.clone()).count() > CLOCKS_MOST
                && let Some(oldest) = self
                    .clocks
                    .range(of_vehicle)
                    .next()
                    .map(|(source, _)| *source)
            {
                self.clocks.remove(&oldest);
            }
        }
        Ok(())
    }

    /// Stores what a resumed station needs, in place of what was there.
    ///
    /// # Errors
    /// [`StoreError`]: the earlier one is there still.
    pub fn remember(&mut self, memory: &[u8]) -> Result<(), StoreError> {
        self.write(|transaction| {
            transaction.execute(
                "INSERT OR REPLACE INTO memory VALUES (1, ?, ?)",
                params![MEMORY, memory],
            )?;
            Ok(())
        })
    }

    /// Does all of something or nothing.
    fn write<T>(
        &mut self,
        work: impl FnOnce(&Transaction) -> rusqlite::Result<T>,
    ) -> Result<T, StoreError> {
        let path = &self.path;
        let fail = |source| StoreError::of(path, source);
        // The right to write is taken at the beginning, so that nothing fails half-way for want of it.
        let transaction = self
            .connection
            .transaction_with_behavior(TransactionBehavior::Immediate)
            .map_err(fail)?;
        let done = work(&transaction).map_err(fail)?;
        transaction.commit().map_err(fail)?;
        Ok(done)
    }
}

/// Returns the name of a picture's kind.
pub(super) fn kind_name(subject: Subject) -> &'static str {
    match subject {
        Subject::Change => "change",
        Subject::Structure => "structure",
    }
}

fn peak_json(peak: &Peak) -> serde_json::Value {
    json!({"x_m": peak.at.x_m, "y_m": peak.at.y_m, "strength": peak.strength, "significance": peak.significance})
}

/// Notes run and vehicle of a batch, the first time they are heard of.
fn note_source(transaction: &Transaction, batch: &Samples) -> rusqlite::Result<()> {
    let run = "INSERT OR IGNORE INTO runs VALUES (?, NULL, ?, NULL)";
    transaction
        .prepare_cached(run)?
        .execute(params![batch.run.0, now_utc_s()])?;
    let vehicle = "INSERT OR IGNORE INTO vehicles VALUES (?, ?, NULL, ?, NULL, NULL)";
    transaction.prepare_cached(vehicle)?.execute(params![
        batch.vehicle.0,
        batch.boot.0,
        now_utc_s()
    ])?;
    Ok(())
}

fn insert(
    transaction: &Transaction,
    batch: &Samples,
    clock: Option<&UtcOffset>,
) -> rusqlite::Result<usize> {
    let (names, marks) = (sample_row::NAMES, sample_row::marks(5 + sample_row::COUNT));
    let mut statement = transaction.prepare_cached(&format!(
        "INSERT OR IGNORE INTO samples (vehicle, boot, run, utc_s, utc_error_s, {names}) VALUES ({marks})"
    ))?;
    let mut new = 0;
    for sample in &batch.samples {
        statement.raw_bind_parameter(1, batch.vehicle.0)?;
        statement.raw_bind_parameter(2, batch.boot.0)?;
        statement.raw_bind_parameter(3, batch.run.0)?;
        let utc_s = clock.map(|clock| clock.offset_s + sample_row::heard_at_s(sample));
        statement.raw_bind_parameter(4, utc_s)?;
        statement.raw_bind_parameter(5, clock.map(|clock| clock.error_s))?;
        sample_row::bind(&mut statement, 6, sample)?;
        new += statement.raw_execute()?;
    }
    Ok(new)
}

/// A store that is in use is tried so often, and again after this long.
const LOCK_TRIES: u32 = 5;
const LOCK_AGAIN: Duration = Duration::from_millis(50);

/// Takes the lock that a ground station holds while it writes a store. (Locks of the file itself are the database's.)
fn lock(path: &Path) -> Result<File, StoreError> {
    let mut name = path.as_os_str().to_owned();
    name.push(".lock");
    let lock = File::create(PathBuf::from(name)).map_err(|error| StoreError::Unopened {
        path: path.to_owned(),
        reason: error.to_string(),
    })?;
    for attempt in 1..=LOCK_TRIES {
        match lock.try_lock() {
            // Where files cannot be locked nobody is kept out either.
            Ok(()) | Err(std::fs::TryLockError::Error(_)) => return Ok(lock),
            // A child that was begun while the lock was held holds it too until it runs its own program.
            Err(std::fs::TryLockError::WouldBlock) if attempt < LOCK_TRIES => {
                std::thread::sleep(LOCK_AGAIN)
            }
            Err(std::fs::TryLockError::WouldBlock) => break,
        }
    }
    Err(StoreError::InUse {
        path: path.to_owned(),
    })
}

/// Opens a file to read; where not even the index of its log can be made (a read-only folder), as one that nobody changes.
fn open_read_only(path: &Path) -> rusqlite::Result<Connection> {
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(path, flags)?;
    let probe = connection
        .query_row("SELECT count(*) FROM sqlite_schema", [], |_| Ok(()))
        .optional();
    match probe.map_err(|error| error.sqlite_error_code()) {
        Err(Some(rusqlite::ErrorCode::CannotOpen | rusqlite::ErrorCode::ReadOnly)) => {
            let escaped = path
                .to_string_lossy()
                .replace('%', "%25")
                .replace('?', "%3f")
                .replace('#', "%23");
            let uri = format!("file:{escaped}?immutable=1");
            Connection::open_with_flags(uri, flags | OpenFlags::SQLITE_OPEN_URI)
        }
        Ok(_) | Err(_) => Ok(connection),
    }
}

fn hex(number: u64) -> String {
    format!("{number:016x}")
}

fn now_utc_s() -> f64 {
    SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .unwrap_or_default()
        .as_secs_f64()
}
