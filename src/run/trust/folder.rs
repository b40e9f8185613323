//! Files of certificates on disk: a file or a folder is there whole or not at all, and private keys are for their owner
//! only. Knows nothing of what is in them.

use std::fs::{self, DirBuilder, File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rustix::fs::FlockOperation;

/// The largest file of certificates, bytes.
const LIMIT_BYTES: u64 = 4 << 20;

/// A file to be written.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct NewFile {
    /// Its name inside its folder.
    pub name: &'static str,
    /// Its text.
    pub text: String,
    /// Whether only its owner may read it.
    pub is_private: bool,
}

impl NewFile {
    /// Makes a file that all may read.
    pub fn open(name: &'static str, text: impl Into<String>) -> NewFile {
        NewFile {
            name,
            text: text.into(),
            is_private: false,
        }
    }

    /// Makes a file that only its owner may read (mode 0600).
    pub fn private(name: &'static str, text: impl Into<String>) -> NewFile {
        NewFile {
            name,
            text: text.into(),
            is_private: true,
        }
    }
}

/// Returns the text of a file of at most 4 MiB.
///
/// # Errors
/// It cannot be read, is larger, or is no UTF-8.
pub fn read_limited(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    File::open(path)?
        .take(LIMIT_BYTES + 1)
        .read_to_string(&mut text)?;
    if text.len() as u64 > LIMIT_BYTES {
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, "over 4 MiB"));
    }
    Ok(text)
}

/// Writes a folder with files that is there with all of them or not at all. An empty folder of its name is replaced.
///
/// # Errors
/// The disk refuses, or a folder of its name is there and not empty.
pub fn write_new_folder(folder: &Path, files: &[NewFile]) -> io::Result<()> {
    let new = beside(folder)?;
    if new.exists() {
        // Left by one that was interrupted; it was never in force.
        fs::remove_dir_all(&new)?;
    }
    DirBuilder::new().recursive(true).mode(0o700).create(&new)?;
    let written = files
        .iter()
        .try_for_each(|file| write_file(&new.join(file.name), file));
    let renamed = written.and_then(|()| fs::rename(&new, folder));
    if renamed.is_err() {
        // What is half written must not stay; the first error is the one to tell.
        let _ = fs::remove_dir_all(&new);
    }
    renamed?;
    sync_parent(folder)
}

/// Writes a file in a folder so that it is there whole, and a former one stays until then.
///
/// # Errors
/// The disk refuses.
pub fn replace_file(folder: &Path, file: &NewFile) -> io::Result<()> {
    let path = folder.join(file.name);
    let new = beside(&path)?;
    if new.exists() {
        fs::remove_file(&new)?;
    }
    let renamed = write_file(&new, file).and_then(|()| fs::rename(&new, &path));
    if renamed.is_err() {
        let _ = fs::remove_file(&new);
    }
    renamed?;
    sync_parent(&path)
}

/// Keeps others from changing the same folder at the same time, as long as it lives.
#[derive(Debug)]
pub struct Lock {
    _file: File,
}

impl Lock {
    /// Takes the lock that hangs on a file.
    ///
    /// # Errors
    /// Another process has it, or the file cannot be opened.
    pub fn take(path: &Path) -> io::Result<Lock> {
        let file = File::open(path)?;
        rustix::fs::flock(&file, FlockOperation::NonBlockingLockExclusive).map_err(|_| {
            io::Error::new(
                io::ErrorKind::WouldBlock,
                "another process is working on it",
            )
        })?;
        Ok(Lock { _file: file })
    }
}

/// Returns whether a file can be read by users who are neither its owner nor of its group.
pub(super) fn is_open_to_others(path: &Path) -> io::Result<bool> {
    Ok(fs::metadata(path)?.mode() & 0o007 != 0)
}

fn write_file(path: &Path, file: &NewFile) -> io::Result<()> {
    let mode = if file.is_private { 0o600 } else { 0o644 };
    let mut written = OpenOptions::new()
        .write(true)
        .create_new(true)
        .mode(mode)
        .open(path)?;
    written.write_all(file.text.as_bytes())?;
    written.sync_all()
}

/// Returns the name under which something is written until it is whole.
fn beside(path: &Path) -> io::Result<PathBuf> {
    let name = path.file_name().ok_or(io::ErrorKind::InvalidInput)?;
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(".new");
    Ok(path.with_file_name(hidden))
}

fn sync_parent(path: &Path) -> io::Result<()> {
    let parent = path
        .parent()
        .filter(|parent| *parent != Path::new(""))
        .unwrap_or(Path::new("."));
    File::open(parent)?.sync_all()
}
