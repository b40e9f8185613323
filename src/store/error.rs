//! Why a store cannot be opened, read or written, in words for an operator. Repairs nothing.

use std::path::{Path, PathBuf};

use rusqlite::ErrorCode;

/// Why a store cannot be used. Nothing was half written: what failed is as if it had not been asked for.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// There is no room.
    #[error("{}: the disk is full; nothing of this was stored, make room and it will be", path.display())]
    Full {
        /// The file.
        path: PathBuf,
    },
    /// Nothing can be written there.
    #[error("{}: cannot be written; the file, its folder or its disk is read-only", path.display())]
    ReadOnly {
        /// The file.
        path: PathBuf,
    },
    /// Another program writes it.
    #[error("{}: another program is writing it; end that one, or name another file", path.display())]
    InUse {
        /// The file.
        path: PathBuf,
    },
    /// It cannot be opened at all.
    #[error("{}: cannot be opened: {reason}", path.display())]
    Unopened {
        /// The file.
        path: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// Its content makes no sense.
    #[error("{}: the file is damaged: {reason}; restore a copy, or name another file", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What was found.
        reason: String,
    },
    /// It is something else.
    #[error("{}: found {found}, expected a store of tomoswarm", path.display())]
    NoStore {
        /// The file.
        path: PathBuf,
        /// What it is.
        found: &'static str,
    },
    /// A later program wrote it.
    #[error("{}: written by a newer tomoswarm (store version {found}, this one knows {known})", path.display())]
    Newer {
        /// The file.
        path: PathBuf,
        /// Version of its tables.
        found: i64,
        /// The newest version known.
        known: i64,
    },
    /// It belongs to another place.
    #[error("{}: holds the data of another venue (hash {found:016x}, this one has {expected:016x})", path.display())]
    OtherVenue {
        /// The file.
        path: PathBuf,
        /// The venue's hash in the file.
        found: u64,
        /// The hash of the venue at hand.
        expected: u64,
    },
    /// Anything else that the database says.
    #[error("{}: {source}", path.display())]
    Database {
        /// The file.
        path: PathBuf,
        /// What it says.
        source: rusqlite::Error,
    },
}

impl StoreError {
    /// Returns the words for what the database said about a file.
    pub(super) fn of(path: &Path, source: rusqlite::Error) -> StoreError {
        let path = path.to_owned();
        let reason = source.to_string();
        match source.sqlite_error_code() {
            Some(ErrorCode::DiskFull) => StoreError::Full { path },
            Some(ErrorCode::ReadOnly | ErrorCode::PermissionDenied) => {
                StoreError::ReadOnly { path }
            }
            Some(ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked) => StoreError::InUse { path },
            Some(ErrorCode::CannotOpen) => StoreError::Unopened { path, reason },
            Some(ErrorCode::DatabaseCorrupt) => StoreError::Damaged { path, reason },
            Some(ErrorCode::NotADatabase) => StoreError::NoStore {
                path,
                found: "a file that is no database",
            },
            Some(_) | None => StoreError::Database { path, source },
        }
    }
}
