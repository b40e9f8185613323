//! The folder in which a node keeps what must outlive it: the count of its starts, its samples or its store, its
//! recordings. One process has it at a time.
//!
//! The count of starts names what a start of a node has measured, so a number must never come twice, and a later start
//! has a higher one: others do not listen to a lower one until they have not heard the node for a while. It is therefore
//! never less than the seconds since 2020: a folder without a count (a new SD card), or with an old one (restored from a
//! copy), begins above every start before. To a folder without a count a little chance is added: cards written from one
//! image begin with the same wrong time when the machine has no clock (the image's), and must not repeat each other's
//! numbers. Where the clock cannot be right (1970) it is one more than the last, or chance alone: hardly a number that
//! was used, but perhaps a lower one. That others have heard of a higher one is noticed by `later_start`.
//!
//! Recordings give way before a start is counted. Should the disk be full all the same, of other files, there is a file of
//! 1 MB to be deleted (`reserve`), which is made again when there is room: a node that is started anew does not fail for want
//! of room for its count.

use std::fs::{self, File, Metadata};
use std::io::{self, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use rustix::fs::{FlockOperation, flock};
use tomoswarm_proto::Boot;

use super::membership::{self, RandomUnavailable};
use crate::store::recording::give_way;
use crate::store::{DiskRoom, replace};

/// From 1970 to 2020.
const UNTIL_2020: Duration = Duration::from_secs(1_577_836_800);
/// No clock is right that shows less than this since 2020 (about mid 2024), or more (2100).
const PLAUSIBLE_S: std::ops::Range<u64> = 142_000_000..2_524_608_000;
/// Chance added to the seconds: less than a day.
const SPREAD: u64 = 1 << 16;
/// Chance alone: less than any plausible time.
const SPREAD_ALONE: u64 = 1 << 20;

/// The file that counts the starts that ended by themselves, in a row, to get a later number.
const EARLY_ENDS: &str = "early-ends";
/// The size of the file that is deleted when a start cannot be counted, bytes. A disk with a smaller reserve gets none.
const BALLAST_BYTES: u64 = 1 << 20;

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
    /// There is no count of starts, and none can be drawn.
    #[error(transparent)]
    NoChance(#[from] RandomUnavailable),
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
    place: FolderPlace,
    _lock: File,
}

/// Where a node's folder was when the node began: whether it still is there can be asked by every thread.
#[derive(Clone, Debug)]
pub struct FolderPlace {
    lock_path: PathBuf,
    /// Held open: the number of a file that is gone and closed may be given to the next one at once.
    lock: Arc<File>,
}

impl FolderPlace {
    /// Notes where a folder's lock is now.
    ///
    /// # Errors
    /// It cannot be opened.
    pub(super) fn of(lock_path: PathBuf) -> io::Result<FolderPlace> {
        let lock = Arc::new(File::open(&lock_path)?);
        Ok(FolderPlace { lock_path, lock })
    }

    /// Returns whether the folder is where it was. One that was removed or replaced can still be written by who has its files
    /// open, and nobody will find what is written.
    pub fn is_there(&self) -> bool {
        let identity = |file: Metadata| (file.dev(), file.ino());
        let there = fs::metadata(&self.lock_path).map(identity).ok();
        there.is_some() && there == self.lock.metadata().map(identity).ok()
    }
}

/// Returns whether a process has a node's folder; touches nothing.
///
/// # Errors
/// Its lock is there and cannot be looked at.
pub fn is_in_use(path: &Path) -> io::Result<bool> {
    let lock = match File::open(path.join("lock")) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
        lock => lock?,
    };
    match flock(&lock, FlockOperation::NonBlockingLockShared) {
        Ok(()) => Ok(false),
        Err(rustix::io::Errno::WOULDBLOCK) => Ok(true),
        Err(error) => Err(error.into()),
    }
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
            return Err(StateDirError::InUse {
                path: path.to_owned(),
            });
        }
        if let Err(error) = give_way(&path.join("flight")) {
            tracing::warn!("recordings cannot give way: {error}");
        }
        let count_path = path.join("boot");
        let boot = next_boot(&count_path)?;
        let ballast = path.join("reserve");
        count(&count_path, boot.0, &ballast).map_err(io(&count_path))?;
        lay_by(&ballast);
        Ok(StateDir {
            path: path.to_owned(),
            boot,
            place: FolderPlace::of(lock_path.clone()).map_err(io(&lock_path))?,
            _lock: lock,
        })
    }

    /// Returns which start this is: a later one than the last in this folder.
    pub fn boot(&self) -> Boot {
        self.boot
    }

    /// Returns what it counts of its starts, for who may change that.
    pub(super) fn counts(&self) -> StartCounts {
        StartCounts {
            folder: self.path.clone(),
            boot: self.boot,
        }
    }

    /// Returns the path of something in the folder.
    pub fn join(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Returns the room left, MB (2²⁰ bytes); `None` when the system does not tell.
    pub fn free_mb(&self) -> Option<u32> {
        DiskRoom::of(&self.path).map(DiskRoom::free_mb)
    }

    /// Returns where the folder is, for who must know that it still is there.
    pub fn place(&self) -> FolderPlace {
        self.place.clone()
    }

    /// Returns in words that the folder is gone from its place, if so.
    pub fn trouble(&self) -> Option<String> {
        (!self.place.is_there()).then(|| {
            format!(
                "{} was removed or replaced while it is in use: what is stored is lost at the end; start the node anew",
                self.path.display()
            )
        })
    }
}

/// What a folder counts of its starts. Only a node that has the folder may have it.
#[derive(Debug)]
pub(super) struct StartCounts {
    folder: PathBuf,
    boot: Boot,
}

impl StartCounts {
    /// Returns which start this is.
    pub(super) fn boot(&self) -> Boot {
        self.boot
    }

    /// Lets the next start come after this one and after another.
    ///
    /// # Errors
    /// It cannot be written.
    pub(super) fn count_on(&self, boot: Boot) -> Result<(), StateDirError> {
        self.keep("boot", self.boot.max(boot).0)
    }

    /// Returns how many starts before this one ended by themselves, in a row, to get a later number. A damaged file counts
    /// as none: it only bounds a row.
    pub(super) fn early_ends(&self) -> u32 {
        let text = fs::read_to_string(self.folder.join(EARLY_ENDS)).unwrap_or_default();
        text.trim().parse().unwrap_or(0)
    }

    /// Keeps that number.
    ///
    /// # Errors
    /// It cannot be written.
    pub(super) fn keep_early_ends(&self, ends: u32) -> Result<(), StateDirError> {
        self.keep(EARLY_ENDS, ends)
    }

    fn keep(&self, name: &str, number: u32) -> Result<(), StateDirError> {
        let path = self.folder.join(name);
        let counted = count(&path, number, &self.folder.join("reserve"));
        counted.map_err(|source| StateDirError::Io { path, source })
    }
}

/// Writes a number; a disk that is full has the ballast's room for it.
fn count(path: &Path, number: u32, ballast: &Path) -> io::Result<()> {
    let text = format!("{number}\n");
    match replace(path, &text) {
        Err(error) if error.kind() == io::ErrorKind::StorageFull && ballast.exists() => {
            fs::remove_file(ballast)?;
            replace(path, &text)
        }
        counted => counted,
    }
}

/// Makes the ballast where the disk has room for it. Without it everything works until the disk is full.
fn lay_by(ballast: &Path) {
    let is_small = |room: DiskRoom| room.reserve_bytes() < BALLAST_BYTES;
    let room = ballast.parent().and_then(DiskRoom::of);
    if ballast.exists() || room.is_none_or(|room| is_small(room) || room.missing_bytes(0) > 0) {
        return;
    }
    let write = || File::create(ballast)?.write_all(&vec![0; BALLAST_BYTES as usize]);
    if let Err(error) = write() {
        tracing::warn!("{}: cannot be written: {error}", ballast.display());
        // A part of it is of no use.
        let _ = fs::remove_file(ballast);
    }
}

fn next_boot(path: &Path) -> Result<Boot, StateDirError> {
    let utc = SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .ok();
    let text = match fs::read(path) {
        Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            return Ok(first_boot(utc, membership::draw()?));
        }
        Err(source) => {
            return Err(StateDirError::Io {
                path: path.to_owned(),
                source,
            });
        }
    };
    let count: Option<u32> = text.trim().parse().ok();
    let next = count.and_then(|count| boot_after(count, utc));
    next.ok_or_else(|| StateDirError::Count {
        path: path.to_owned(),
        text: text.trim().to_owned(),
    })
}

/// Returns the number of the start after `count`, by the system's clock; `None` = there is none left.
fn boot_after(count: u32, utc: Option<Duration>) -> Option<Boot> {
    let by_clock = plausible_s(utc).and_then(|seconds| u32::try_from(seconds).ok());
    let next = count.checked_add(1)?;
    Some(Boot(by_clock.map_or(next, |seconds| seconds.max(next))))
}

/// Returns the seconds since 2020 by the system's clock, if it can be right.
fn plausible_s(utc: Option<Duration>) -> Option<u64> {
    let since_2020 = utc.and_then(|utc| utc.checked_sub(UNTIL_2020))?;
    Some(since_2020.as_secs()).filter(|seconds| PLAUSIBLE_S.contains(seconds))
}

/// Returns the number of the first start in a folder, by the system's clock and a random number.
fn first_boot(utc: Option<Duration>, drawn: u64) -> Boot {
    let number = match plausible_s(utc) {
        Some(seconds) => seconds + drawn % SPREAD,
        None => 1 + drawn % SPREAD_ALONE,
    };
    Boot(u32::try_from(number).unwrap_or(u32::MAX - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_folder_begins_above_what_older_ones_have_counted() {
        let at =
            |since_1970_s: u64, drawn| first_boot(Some(Duration::from_secs(since_1970_s)), drawn).0;
        let in_2026 = 1_790_000_000;
        assert_eq!(at(in_2026, 0), 212_163_200);
        assert!(
            at(in_2026 + 86_400, 0) > at(in_2026, u64::MAX),
            "a day later it is higher in any case"
        );
        assert!(
            at(4_102_444_799, u64::MAX) > at(in_2026, 0),
            "it fits until 2100"
        );
        for clock in [
            Some(Duration::ZERO),
            Some(UNTIL_2020),
            Some(Duration::MAX),
            None,
        ] {
            assert_eq!(first_boot(clock, 0), Boot(1), "{clock:?}");
            assert!(
                first_boot(clock, u64::MAX).0 < at(1_720_000_000, 0),
                "{clock:?}"
            );
        }
        assert_ne!(first_boot(None, 5), first_boot(None, 6));
    }

    #[test]
    fn an_old_count_is_gone_on_with_above_all_that_may_have_come_since() {
        let at = |since_2020_s: u64| Some(UNTIL_2020 + Duration::from_secs(since_2020_s));
        assert_eq!(boot_after(6, at(212_163_200)), Some(Boot(212_163_200)));
        assert_eq!(
            boot_after(212_163_200, at(212_163_200)),
            Some(Boot(212_163_201))
        );
        assert_eq!(
            boot_after(300_000_000, at(212_163_200)),
            Some(Boot(300_000_001))
        );
        for clock in [None, at(0), at(3_000_000_000)] {
            assert_eq!(boot_after(6, clock), Some(Boot(7)), "{clock:?}");
        }
        assert_eq!(boot_after(u32::MAX, at(212_163_200)), None);
    }

    #[test]
    fn the_next_start_comes_after_what_others_know() {
        let folder = tempfile::tempdir().unwrap();
        let state = StateDir::open(folder.path()).unwrap();
        let first = state.boot();
        state.counts().count_on(Boot(first.0 + 1000)).unwrap();
        drop(state);
        let state = StateDir::open(folder.path()).unwrap();
        assert_eq!(state.boot(), Boot(first.0 + 1001));
        state.counts().count_on(first).unwrap();
        drop(state);
        assert_eq!(
            StateDir::open(folder.path()).unwrap().boot(),
            Boot(first.0 + 1002)
        );
    }

    #[test]
    fn every_start_is_counted_and_one_process_has_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rover/3");
        let first = StateDir::open(&path).unwrap().boot();
        for count in 1..=3 {
            assert!(!is_in_use(&path).unwrap());
            let state = StateDir::open(&path).unwrap();
            assert!(is_in_use(&path).unwrap());
            assert_eq!(state.boot(), Boot(first.0 + count));
            assert!(matches!(
                StateDir::open(&path),
                Err(StateDirError::InUse { .. })
            ));
            assert!(state.free_mb().is_some());
        }
    }

    #[test]
    fn a_damaged_count_is_not_begun_anew() {
        let folder = tempfile::tempdir().unwrap();
        for damaged in ["", "many", "4294967295", "-1"] {
            fs::write(folder.path().join("boot"), damaged).unwrap();
            assert!(
                matches!(
                    StateDir::open(folder.path()),
                    Err(StateDirError::Count { .. })
                ),
                "{damaged}"
            );
        }
    }

    #[test]
    fn a_folder_that_was_removed_or_replaced_is_a_trouble() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rover");
        let state = StateDir::open(&path).unwrap();
        assert_eq!(state.trouble(), None);
        fs::rename(&path, folder.path().join("elsewhere")).unwrap();
        let trouble = state.trouble().unwrap();
        assert!(
            trouble.starts_with(&path.display().to_string()) && trouble.contains("removed"),
            "{trouble}"
        );
        fs::create_dir(&path).unwrap();
        fs::write(path.join("lock"), "").unwrap();
        assert!(state.trouble().is_some(), "another one in its place");
    }
}
