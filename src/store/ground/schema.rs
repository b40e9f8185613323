//! The tables of the ground's store, as `docs/store.md` describes them, and the checks of a file that is opened.

use rusqlite::Connection;

use crate::store::{StoreError, sample_row};
use std::path::Path;

/// Marks the file as a store ("tSgs").
pub(super) const APPLICATION: i64 = 0x7453_6773;
/// Version of the tables.
pub(super) const VERSION: i64 = 4;

/// Makes the tables of version 1 those of version 2, which have the finds of images.
const FROM_1_TO_2: &str =
    "ALTER TABLE images ADD COLUMN finds TEXT NOT NULL DEFAULT 'null'; PRAGMA user_version = 2;";

/// The places where somebody truly stood.
const MARKS: &str = "CREATE TABLE marks (
             run INTEGER NOT NULL, x_m REAL NOT NULL, y_m REAL NOT NULL, z_m REAL NOT NULL, marked_utc_s REAL NOT NULL,
             PRIMARY KEY (run, x_m, y_m, z_m)) WITHOUT ROWID;";

/// Makes the tables of version 3 those of version 4, which have the deviations of images.
const FROM_3_TO_4: &str = "ALTER TABLE images ADD COLUMN deviation BLOB; PRAGMA user_version = 4;";

/// Returns the statements that bring the tables of a version up to date, for one transaction; none of the newest.
pub(super) fn updates(from: i64) -> String {
    // Those of version 3 have marks.
    let from_2_to_3 = format!("{MARKS} PRAGMA user_version = 3;");
    let steps = [(2, FROM_1_TO_2), (3, &from_2_to_3), (4, FROM_3_TO_4)];
    let missing = steps.into_iter().filter(|(to, _)| from < *to);
    missing.map(|(_, step)| step).collect()
}

/// Returns the statements that make the tables, for one transaction.
pub(super) fn tables() -> String {
    let sample = sample_row::DEFINITIONS;
    format!(
        "CREATE TABLE store (id TEXT NOT NULL, venue_hash TEXT NOT NULL, made_utc_s REAL NOT NULL);
         CREATE TABLE provenance (
             started_utc_s REAL NOT NULL, version TEXT NOT NULL, config TEXT NOT NULL, venue TEXT NOT NULL,
             venue_hash TEXT NOT NULL, seed INTEGER, note TEXT);
         CREATE TABLE runs (
             run INTEGER PRIMARY KEY, empty_run INTEGER, began_utc_s REAL NOT NULL, closed_utc_s REAL);
         CREATE TABLE vehicles (
             vehicle INTEGER NOT NULL, boot INTEGER NOT NULL, software TEXT, first_heard_utc_s REAL NOT NULL,
             utc_offset_s REAL, utc_error_s REAL, PRIMARY KEY (vehicle, boot)) WITHOUT ROWID;
         CREATE TABLE samples (
             vehicle INTEGER NOT NULL, boot INTEGER NOT NULL, run INTEGER NOT NULL, {sample},
             utc_s REAL, utc_error_s REAL, PRIMARY KEY (vehicle, boot, run, sequence)) WITHOUT ROWID;
         CREATE INDEX samples_by_run ON samples (run);
         CREATE TABLE tiles (
             vehicle INTEGER NOT NULL, boot INTEGER NOT NULL, slice INTEGER NOT NULL, x INTEGER NOT NULL,
             y INTEGER NOT NULL, revision INTEGER NOT NULL, cells BLOB NOT NULL,
             PRIMARY KEY (vehicle, boot, slice, x, y));
         CREATE TABLE plans (
             run INTEGER NOT NULL, revision INTEGER NOT NULL, vehicle INTEGER NOT NULL,
             lease_number INTEGER NOT NULL, lease_holder TEXT NOT NULL, plan TEXT NOT NULL,
             PRIMARY KEY (run, revision, vehicle));
         CREATE TABLE images (
             run INTEGER NOT NULL, laps INTEGER NOT NULL, kind TEXT NOT NULL, made_utc_s REAL NOT NULL,
             rows INTEGER NOT NULL, columns INTEGER NOT NULL,
             x0_m REAL NOT NULL, y0_m REAL NOT NULL, x1_m REAL NOT NULL, y1_m REAL NOT NULL,
             links INTEGER NOT NULL, residual_db REAL, peaks TEXT NOT NULL, data BLOB NOT NULL, finds TEXT NOT NULL DEFAULT 'null',
             deviation BLOB, PRIMARY KEY (run, laps, kind));
         {MARKS}
         CREATE TABLE memory (one INTEGER PRIMARY KEY CHECK (one = 1), version TEXT NOT NULL, blob BLOB NOT NULL);
         PRAGMA application_id = {APPLICATION};
         PRAGMA user_version = {VERSION};"
    )
}

/// Returns whether a database has nothing in it yet.
pub(super) fn is_empty(connection: &Connection, path: &Path) -> Result<bool, StoreError> {
    Ok(number(connection, path, "schema_version")? == 0)
}

/// Returns the version of the tables.
pub(super) fn version(connection: &Connection) -> rusqlite::Result<i64> {
    connection.pragma_query_value(None, "user_version", |row| row.get(0))
}

/// Refuses what is not a sound store of a known version.
pub(super) fn check(connection: &Connection, path: &Path) -> Result<(), StoreError> {
    if number(connection, path, "application_id")? != APPLICATION {
        return Err(StoreError::NoStore {
            path: path.to_owned(),
            found: "another database",
        });
    }
    let found = version(connection).map_err(|source| StoreError::of(path, source))?;
    if found > VERSION {
        return Err(StoreError::Newer {
            path: path.to_owned(),
            found,
            known: VERSION,
        });
    }
    let sound: rusqlite::Result<String> =
        connection.query_row("PRAGMA quick_check(1)", [], |row| row.get(0));
    match sound.map_err(|source| StoreError::of(path, source))? {
        sound if sound == "ok" => Ok(()),
        reason => Err(StoreError::Damaged {
            path: path.to_owned(),
            reason,
        }),
    }
}

fn number(connection: &Connection, path: &Path, name: &str) -> Result<i64, StoreError> {
    let number = connection.pragma_query_value(None, name, |row| row.get(0));
    number.map_err(|source| StoreError::of(path, source))
}
