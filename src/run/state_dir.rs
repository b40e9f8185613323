//! The folder in which a node keeps what must outlive it: the count of its starts, its samples or its store, its
//! recordings. One process has it at a time.

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock, statvfs};
use tomoswarm_proto::Boot;

/// Why a folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum StateDirError {
    /// It cannot be read or written.
    #[error("{}: {source}; a node needs a folder of its own that it can write (state_dir)", path.display())]
    Io {
        /// Which file or folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Another process has it.
    #[error("{} is in use by another process; every node needs a state_dir of its own", path.display())]
    InUse {
        /// Which folder.
        path: PathBuf,
    },
    /// The count of starts is no number.
    #[error("{}: `{text}` is no count of starts; write the highest boot number used so far into it", path.display())]
    Count {
        /// Which file.
        path: PathBuf,
        /// What stands in it.
        text: String,
    },
}

/// A node's folder, held until it is dropped.
#[derive(Debug)]
pub struct StateDir {
    path: PathBuf,
    boot: Boot,
    _lock: File,
}

impl StateDir {
    /// Takes the folder, makes it if it is not there, and counts this start.
    ///
    /// # Errors
    /// It cannot be written, or another process has it.
    pub fn open(path: &Path) -> Result<StateDir, StateDirError> {
        let io = |path: &Path| {
            let path = path.to_owned();
            move |source| StateDirError::Io { path, source }
        };
        fs::create_dir_all(path).map_err(io(path))?;
        let lock_path = path.join("lock");
        let lock = File::create(&lock_path).map_err(io(&lock_path))?;
        if flock(&lock, FlockOperation::NonBlockingLockExclusive).is_err() {
            return Err(StateDirError::InUse { path: path.to_owned() });
        }
        let count_path = path.join("boot");
        let boot = next_boot(&count_path)?;
        let fresh = path.join("boot.new");
        let write = || {
            let mut file = File::create(&fresh)?;
            writeln!(file, "{boot}")?;
            file.sync_all()?;
            fs::rename(&fresh, &count_path)
        };
        write().map_err(io(&count_path))?;
        Ok(StateDir { path: path.to_owned(), boot, _lock: lock })
    }

    /// Gives which start this is; the first is 1.
    pub fn boot(&self) -> Boot {
        self.boot
    }

    /// Gives the path of something in the folder.
    pub fn join(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Gives the room left, MB; `None` when the system does not tell.
    pub fn free_mb(&self) -> Option<u32> {
        let room = statvfs(&self.path).ok()?;
        u32::try_from(room.f_bavail.saturating_mul(room.f_frsize) >> 20).ok()
    }
}

fn next_boot(path: &Path) -> Result<Boot, StateDirError> {
    let text = match fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Boot(1)),
        Err(source) => return Err(StateDirError::Io { path: path.to_owned(), source }),
    };
    let count: Option<u32> = text.trim().parse().ok();
    let next = count.and_then(|count| count.checked_add(1));
    next.map(Boot).ok_or_else(|| StateDirError::Count { path: path.to_owned(), text: text.trim().to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_start_is_counted_and_one_process_has_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rover/3");
        for count in 1..=3 {
            let state = StateDir::open(&path).unwrap();
            assert_eq!(state.boot(), Boot(count));
            assert!(matches!(StateDir::open(&path), Err(StateDirError::InUse { .. })));
            assert!(state.free_mb().is_some());
        }
    }

    #[test]
    fn a_damaged_count_is_not_begun_anew() {
        let folder = tempfile::tempdir().unwrap();
        for damaged in ["", "many", "4294967295", "-1"] {
            fs::write(folder.path().join("boot"), damaged).unwrap();
            assert!(matches!(StateDir::open(folder.path()), Err(StateDirError::Count { .. })), "{damaged}");
        }
    }
}
