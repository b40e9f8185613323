//! The file of a vehicle's outbox: a SQLite database with one table of samples, in the order in which they were made.
//!
//! WAL and `synchronous = NORMAL`: what was appended outlives the process however it ends; a power cut may take the
//! last moments. There is a cap on its size: the oldest samples make room, and the caller is told which. (What the
//! ground has of closed runs is deleted before that, by [`OutboxFile::forget`].)

use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use rusqlite::{Connection, Transaction, params};
use tomoswarm_proto::{Boot, RunId, Sample, VehicleId};

use crate::node::outbox::{DroppedSamples, SampleKey};
use crate::store::{StoreError, sample_row};

/// Marks the file as an outbox ("tSob").
const APPLICATION: i64 = 0x7453_6f62;
/// Version of its tables.
const VERSION: i64 = 1;
/// How long another program may hold the file.
const BUSY: Duration = Duration::from_secs(2);
/// Samples that make room at a time.
const ROOM: usize = 2048;

/// A vehicle's samples on disk.
#[derive(Debug)]
pub struct OutboxFile {
    connection: Connection,
    path: PathBuf,
    most_bytes: u64,
}

/// An outbox, and what was in its way.
#[derive(Debug)]
pub struct Opened {
    /// The outbox, ready to be written.
    pub file: OutboxFile,
    /// Why what was there before could not be used, and where it lies now.
    pub moved_aside: Option<String>,
}

impl OutboxFile {
    /// Opens the outbox of a vehicle, or makes one; it may grow to about `most_bytes`. A file that cannot be used (damaged,
    /// of another program, another vehicle or a newer version) is moved aside, and an empty outbox is begun.
    ///
    /// # Errors
    /// Nothing can be written there.
    pub fn open(path: &Path, vehicle: VehicleId, most_bytes: u64) -> Result<Opened, StoreError> {
        let reason = match OutboxFile::open_sound(path, vehicle, most_bytes) {
            Ok(file) => {
                return Ok(Opened {
                    file,
                    moved_aside: None,
                });
            }
            Err(error) => error,
        };
        match &reason {
            StoreError::Damaged { .. }
            | StoreError::NoStore { .. }
            | StoreError::Newer { .. }
            | StoreError::OtherVenue { .. } => {}
            StoreError::Full { .. }
            | StoreError::ReadOnly { .. }
            | StoreError::InUse { .. }
            | StoreError::Unopened { .. }
            | StoreError::Database { .. } => return Err(reason),
        }
        let aside = move_aside(path)?;
        let file = OutboxFile::open_sound(path, vehicle, most_bytes)?;
        let words = format!(
            "{reason}; it was moved to {} and an empty outbox begun",
            aside.display()
        );
        Ok(Opened {
            file,
            moved_aside: Some(words),
        })
    }

    fn open_sound(
        path: &Path,
        vehicle: VehicleId,
        most_bytes: u64,
    ) -> Result<OutboxFile, StoreError> {
        let fail = |source| StoreError::of(path, source);
        let connection = Connection::open(path).map_err(fail)?;
        connection.busy_timeout(BUSY).map_err(fail)?;
        let file = OutboxFile {
            connection,
            path: path.to_owned(),
            most_bytes,
        };
        file.check(vehicle)?;
        file.prepare(vehicle).map_err(fail)?;
        Ok(file)
    }

    /// Refuses what is not an outbox of this vehicle; an empty file is one.
    fn check(&self, vehicle: VehicleId) -> Result<(), StoreError> {
        let fail = |source| StoreError::of(&self.path, source);
        let number = |name: &str| -> Result<i64, StoreError> {
            self.connection
                .pragma_query_value(None, name, |row| row.get(0))
                .map_err(fail)
        };
        if number("schema_version")? == 0 {
            return Ok(());
        }
        let path = self.path.clone();
        if number("application_id")? != APPLICATION {
            return Err(StoreError::NoStore {
                path,
                found: "another database",
            });
        }
        let found = number("user_version")?;
        if found > VERSION {
            return Err(StoreError::Newer {
                path,
                found,
                known: VERSION,
            });
        }
        let sound: String = self
            .connection
            .query_row("PRAGMA quick_check(1)", [], |row| row.get(0))
            .map_err(fail)?;
        if sound != "ok" {
            return Err(StoreError::Damaged {
                path,
                reason: sound,
            });
        }
        let owner: u8 = self
            .connection
            .query_row("SELECT vehicle FROM owner", [], |row| row.get(0))
            .map_err(fail)?;
        if owner != vehicle.0 {
            return Err(StoreError::NoStore {
                path,
                found: "the outbox of another vehicle",
            });
        }
        Ok(())
    }

    fn prepare(&self, vehicle: VehicleId) -> rusqlite::Result<()> {
        let connection = &self.connection;
        let _: String = connection.query_row("PRAGMA journal_mode = WAL", [], |row| row.get(0))?;
        connection.execute_batch("PRAGMA synchronous = NORMAL; PRAGMA cache_size = -1024;")?;
        let columns = sample_row::DEFINITIONS;
        connection.execute_batch(&format!(
            "BEGIN IMMEDIATE;
             CREATE TABLE IF NOT EXISTS owner (vehicle INTEGER PRIMARY KEY);
             INSERT OR IGNORE INTO owner VALUES ({vehicle});
             CREATE TABLE IF NOT EXISTS samples (boot INTEGER NOT NULL, run INTEGER NOT NULL, {columns},
                 PRIMARY KEY (boot, run, sequence)) WITHOUT ROWID;
             PRAGMA application_id = {APPLICATION};
             PRAGMA user_version = {VERSION};
             COMMIT;"
        ))
    }

    /// Appends samples, all or none; returns what had to make room for them.
    ///
    /// # Errors
    /// The disk is full, read-only or held by another program; the file is as before.
    pub fn append(
        &mut self,
        samples: &[(Boot, RunId, Sample)],
    ) -> Result<Vec<DroppedSamples>, StoreError> {
        let (path, most_bytes) = (self.path.clone(), self.most_bytes);
        let mut append = || {
            let transaction = self.connection.transaction()?;
            insert(&transaction, samples)?;
            let dropped = make_room(&transaction, most_bytes)?;
            transaction.commit()?;
            Ok(dropped)
        };
        append().map_err(|source| StoreError::of(&path, source))
    }

    /// Deletes what the ground has of a closed run; returns how many samples.
    ///
    /// # Errors
    /// The file cannot be written; nothing is deleted.
    pub fn forget(&mut self, boot: Boot, run: RunId, below: u64) -> Result<usize, StoreError> {
        let below = i64::try_from(below).unwrap_or(i64::MAX);
        let deleted = self.connection.execute(
            "DELETE FROM samples WHERE boot = ? AND run = ? AND sequence < ?",
            params![boot.0, run.0, below],
        );
        deleted.map_err(|source| StoreError::of(&self.path, source))
    }

    /// Returns at most so many samples after a place, or the first ones, of all boots, in order.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn after(
        &self,
        place: Option<SampleKey>,
        most: usize,
    ) -> Result<Vec<(Boot, RunId, Sample)>, StoreError> {
        let read = || {
            let names = sample_row::NAMES;
            let mut statement = self.connection.prepare_cached(&format!(
                "SELECT boot, run, {names} FROM samples WHERE (boot, run, sequence) > (?, ?, ?)
                 ORDER BY boot, run, sequence LIMIT ?"
            ))?;
            let (boot, run, sequence) = place.map_or((-1, -1, -1), |place| {
                (
                    i64::from(place.boot.0),
                    i64::from(place.run.0),
                    place.sequence.cast_signed(),
                )
            });
            let rows = statement.query_map(params![boot, run, sequence, most as i64], |row| {
                Ok((
                    Boot(row.get(0)?),
                    RunId(row.get(1)?),
                    sample_row::read(row, 2)?,
                ))
            })?;
            rows.collect::<rusqlite::Result<Vec<_>>>()
        };
        read().map_err(|source| StoreError::of(&self.path, source))
    }

    /// Lets the file have at most so many pages, as a full disk would.
    #[cfg(test)]
    pub(super) fn limit_pages(&self, pages: i64) {
        self.connection
            .query_row(&format!("PRAGMA max_page_count = {pages}"), [], |_| Ok(()))
            .unwrap();
    }
}

fn insert(transaction: &Transaction, samples: &[(Boot, RunId, Sample)]) -> rusqlite::Result<()> {
    let (names, marks) = (sample_row::NAMES, sample_row::marks(2 + sample_row::COUNT));
    let mut statement = transaction.prepare_cached(&format!(
        "INSERT OR IGNORE INTO samples (boot, run, {names}) VALUES ({marks})"
    ))?;
    for (boot, run, sample) in samples {
        statement.raw_bind_parameter(1, boot.0)?;
        statement.raw_bind_parameter(2, run.0)?;
        sample_row::bind(&mut statement, 3, sample)?;
        statement.raw_execute()?;
    }
    Ok(())
}

/// Deletes the oldest samples while the file is over its cap; returns which.
fn make_room(transaction: &Transaction, most_bytes: u64) -> rusqlite::Result<Vec<DroppedSamples>> {
    let mut dropped: Vec<DroppedSamples> = Vec::new();
    while used_bytes(transaction)? > most_bytes {
        let mut statement = transaction.prepare_cached(
            "DELETE FROM samples WHERE (boot, run, sequence) IN
                 (SELECT boot, run, sequence FROM samples ORDER BY boot, run, sequence LIMIT ?)
             RETURNING boot, run, sequence",
        )?;
        let rows = statement.query_map([ROOM as i64], |row| {
            let sequence = row.get::<_, i64>(2)?.cast_unsigned();
            Ok(SampleKey {
                boot: Boot(row.get(0)?),
                run: RunId(row.get(1)?),
                sequence,
            })
        })?;
        let mut places = rows.collect::<rusqlite::Result<Vec<SampleKey>>>()?;
        if places.is_empty() {
            break;
        }
        places.sort_unstable();
        for place in places {
            let source = |dropped: &&mut DroppedSamples| {
                (dropped.first.boot, dropped.first.run) == (place.boot, place.run)
                    && dropped.below == place.sequence
            };
            match dropped.last_mut().filter(source) {
                Some(last) => last.below += 1,
                None => dropped.push(DroppedSamples {
                    first: place,
                    below: place.sequence.saturating_add(1),
                }),
            }
        }
    }
    Ok(dropped)
}

fn used_bytes(connection: &Connection) -> rusqlite::Result<u64> {
    let number = |name: &str| connection.pragma_query_value(None, name, |row| row.get::<_, i64>(0));
    let used = (number("page_count")? - number("freelist_count")?) * number("page_size")?;
    Ok(used.max(0).cast_unsigned())
}

/// Returns a file, with what belongs to it, a name under which it is in nobody's way.
fn move_aside(path: &Path) -> Result<PathBuf, StoreError> {
    let now_s = SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .unwrap_or_default()
        .as_secs();
    let with = |path: &Path, ending: &str| {
        let mut name = path.as_os_str().to_owned();
        name.push(ending);
        PathBuf::from(name)
    };
    let free = (0..1000).map(|count| with(path, &format!(".damaged-{now_s}-{count}")));
    let aside = free
        .into_iter()
        .find(|aside| !aside.exists())
        .unwrap_or(with(path, ".damaged"));
    for ending in ["-wal", "-shm", ""] {
        let from = with(path, ending);
        let moved = if from.exists() {
            std::fs::rename(&from, with(&aside, ending))
        } else {
            Ok(())
        };
        moved.map_err(|error| StoreError::Unopened {
            path: from,
            reason: error.to_string(),
        })?;
    }
    Ok(aside)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    const OWN: VehicleId = VehicleId(3);

    pub(in super::super) fn sample(sequence: u64) -> Sample {
        let receiver_pose = tomoswarm_proto::PoseReport {
            at: tomoswarm_proto::Position {
                x_mm: 100,
                y_mm: -1,
                z_mm: 0,
            },
            heading: tomoswarm_proto::Heading(30_000),
            sd: tomoswarm_proto::Deviation::UNKNOWN,
        };
        Sample {
            sequence,
            heard_at_ns: 1_234_567_890_123 + sequence,
            transmitter: VehicleId(9),
            transmitter_pose: Default::default(),
            receiver_pose,
            channel: 26,
            power_dbm: -8,
            rssi_dbm: sequence.is_multiple_of(2).then_some(-61),
        }
    }

    fn samples(boot: u32, sequences: std::ops::Range<u64>) -> Vec<(Boot, RunId, Sample)> {
        sequences
            .map(|sequence| (Boot(boot), RunId(7), sample(sequence)))
            .collect()
    }

    fn open(path: &Path) -> OutboxFile {
        let opened = OutboxFile::open(path, OWN, 1 << 30).unwrap();
        assert_eq!(opened.moved_aside, None);
        opened.file
    }

    #[test]
    fn after_a_restart_all_boots_are_read_in_order_and_unchanged() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("outbox.db");
        open(&path).append(&samples(2, 0..300)).unwrap();
        let mut file = open(&path);
        file.append(&samples(1, 5..10)).unwrap();
        // What is appended twice is there once.
        file.append(&samples(2, 250..310)).unwrap();
        let mut all = Vec::new();
        loop {
            let last: Option<&(Boot, RunId, Sample)> = all.last();
            let place = last.map(|(boot, run, s)| SampleKey {
                boot: *boot,
                run: *run,
                sequence: s.sequence,
            });
            let chunk = file.after(place, 100).unwrap();
            if chunk.is_empty() {
                break;
            }
            all.extend(chunk);
        }
        assert_eq!(all, [samples(1, 5..10), samples(2, 0..310)].concat());
    }

    #[test]
    fn only_what_may_be_forgotten_is_forgotten() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = open(&folder.path().join("outbox.db"));
        file.append(&[samples(1, 0..10), samples(2, 0..10)].concat())
            .unwrap();
        assert_eq!(file.forget(Boot(1), RunId(7), 8).unwrap(), 8);
        assert_eq!(file.forget(Boot(2), RunId(8), u64::MAX).unwrap(), 0);
        assert_eq!(
            file.after(None, 100).unwrap(),
            [samples(1, 8..10), samples(2, 0..10)].concat()
        );
    }

    #[test]
    fn the_oldest_make_room_and_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("outbox.db");
        let mut file = OutboxFile::open(&path, OWN, 400_000).unwrap().file;
        let mut dropped = Vec::new();
        for part in 0..20 {
            dropped.extend(
                file.append(&samples(1, part * 1000..(part + 1) * 1000))
                    .unwrap(),
            );
        }
        let rest = file.after(None, 100_000).unwrap();
        let below = rest[0].2.sequence;
        assert_eq!(rest, samples(1, below..20_000), "the newest are all there");
        let named: u64 = dropped
            .iter()
            .map(|dropped| dropped.below - dropped.first.sequence)
            .sum();
        assert_eq!((named, dropped.last().unwrap().below), (below, below));
        drop(file);
        assert!(std::fs::metadata(&path).unwrap().len() < 1_000_000);
    }

    #[test]
    fn a_full_disk_changes_nothing_and_later_all_is_well_again() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = open(&folder.path().join("outbox.db"));
        file.append(&samples(1, 0..10)).unwrap();
        file.limit_pages(8);
        let error = file.append(&samples(1, 10..5000)).unwrap_err();
        assert!(matches!(error, StoreError::Full { .. }), "{error}");
        assert_eq!(file.after(None, 9999).unwrap(), samples(1, 0..10));
        file.limit_pages(1 << 20);
        file.append(&samples(1, 10..5000)).unwrap();
        assert_eq!(file.after(None, 9999).unwrap(), samples(1, 0..5000));
    }

    fn check_moved(content: impl FnOnce(&Path), expected: &str) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("outbox.db");
        content(&path);
        let mut opened = OutboxFile::open(&path, OWN, 1 << 30).unwrap();
        let words = opened.moved_aside.unwrap();
        assert!(
            words.contains(expected) && words.contains("outbox.db.damaged-"),
            "{words}"
        );
        opened.file.append(&samples(1, 0..10)).unwrap();
        drop(opened.file);
        assert_eq!(open(&path).after(None, 99).unwrap().len(), 10);
        let aside = |name: &std::ffi::OsStr| name.to_string_lossy().contains(".damaged-");
        assert!(
            std::fs::read_dir(folder.path())
                .unwrap()
                .any(|entry| aside(&entry.unwrap().file_name()))
        );
    }

    #[test]
    fn what_cannot_be_used_is_moved_aside_with_a_reason() {
        check_moved(
            |path| std::fs::write(path, [7; 9000]).unwrap(),
            "no database",
        );
        check_moved(
            |path| {
                open(path).append(&samples(1, 0..2000)).unwrap();
                let mut bytes = std::fs::read(path).unwrap();
                bytes[4096..].iter_mut().for_each(|byte| *byte ^= 0x5a);
                std::fs::write(path, bytes).unwrap();
            },
            "damaged",
        );
        check_moved(
            |path| drop(OutboxFile::open(path, VehicleId(4), 1 << 30).unwrap()),
            "another vehicle",
        );
        check_moved(
            |path| {
                let file = open(path);
                file.connection
                    .pragma_update(None, "user_version", VERSION + 1)
                    .unwrap();
            },
            "newer",
        );
    }

    #[test]
    fn a_folder_that_is_not_there_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let error =
            OutboxFile::open(&folder.path().join("no/outbox.db"), OWN, 1 << 30).unwrap_err();
        assert!(matches!(error, StoreError::Unopened { .. }), "{error}");
    }
}
