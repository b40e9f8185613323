//! Files of certificates on disk: a file or a folder is there whole or not at all, and private keys are for their owner
//! only. Knows nothing of what is in them.

use std::fs::{self, DirBuilder, File, OpenOptions, Permissions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt, chown};
use std::path::{Path, PathBuf};

use rustix::fs::{CWD, FlockOperation, Mode, OFlags, RenameFlags, renameat_with, statfs};
use rustix::io::Errno;

/// The largest file of certificates, bytes.
const LIMIT_BYTES: u64 = 4 << 20;
/// The folder of a node: its service and who is of its group read it.
const NODE_FOLDER_MODE: u32 = 0o750;
/// Kinds of file systems that keep no modes, as `statfs` numbers them: FAT and exFAT, those of sticks and boot partitions.
const WITHOUT_MODES: [u64; 2] = [0x4d44, 0x2011_bab0];
/// Kinds that keep modes only where they were set up for that, and show every file as open to all otherwise: NTFS by both
/// drivers of the kernel, and what a program serves (FUSE), as NTFS and exFAT mostly are.
const SELDOM_WITH_MODES: [u64; 3] = [0x7366_746e, 0x5346_544e, 0x6573_5546];
/// Of a file that is open to all.
const OPEN_TO_ALL: u32 = 0o777;

/// To whom a node's files belong.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Owner {
    /// Number of the user.
    pub user: u32,
    /// Number of the group.
    pub group: u32,
}

/// A file to be written.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct NewFile {
    /// Its name inside its folder.
    pub name: String,
    /// Its content.
    pub content: Vec<u8>,
    /// Whether only its owner may read it.
    pub is_private: bool,
}

impl NewFile {
    /// Makes a file that all may read.
    pub fn open(name: impl Into<String>, content: impl Into<Vec<u8>>) -> NewFile {
        NewFile {
            name: name.into(),
            content: content.into(),
            is_private: false,
        }
    }

    /// Makes a file that only its owner may read (mode 0600).
    pub fn private(name: impl Into<String>, content: impl Into<Vec<u8>>) -> NewFile {
        NewFile {
            name: name.into(),
            content: content.into(),
            is_private: true,
        }
    }
}

/// Returns the text of a file of at most 4 MiB.
///
/// # Errors
/// It cannot be read, is larger, or is no UTF-8.
pub fn read_limited(path: &Path) -> io::Result<String> {
    String::from_utf8(read_limited_bytes(path)?)
        .map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))
}

/// Returns the content of a file of at most 4 MiB.
///
/// # Errors
/// It cannot be read, or is larger.
pub fn read_limited_bytes(path: &Path) -> io::Result<Vec<u8>> {
    limited(File::open(path)?)
}

fn limited(file: File) -> io::Result<Vec<u8>> {
    let mut content = Vec::new();
    file.take(LIMIT_BYTES + 1).read_to_end(&mut content)?;
    if content.len() as u64 > LIMIT_BYTES {
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, "over 4 MiB"));
    }
    Ok(content)
}

/// Returns the content of a regular file of at most 4 MiB; what a link leads to, a device or a pipe is none.
///
/// # Errors
/// It cannot be read, is no regular file, or is larger.
pub fn read_regular(path: &Path) -> io::Result<Vec<u8>> {
    let flags = OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let opened = match rustix::fs::open(path, flags, Mode::empty()) {
        Err(Errno::LOOP) => return Err(io::Error::other("it is a link; a file is expected")),
        opened => File::from(opened?),
    };
    match opened.metadata()?.is_file() {
        true => limited(opened),
        false => Err(io::Error::other("it is no regular file; one is expected")),
    }
}

/// Writes a folder with files that is there with all of them or not at all. An empty folder of its name is replaced.
///
/// # Errors
/// The disk refuses, or a folder of its name is there and not empty.
pub fn write_new_folder(folder: &Path, files: &[NewFile]) -> io::Result<()> {
    write_folder(folder, files, |new| fs::rename(new, folder))
}

/// A folder that lies whole beside the place where it belongs, under a hidden name.
#[derive(Debug)]
pub struct StagedFolder {
    staged: PathBuf,
    folder: PathBuf,
}

impl StagedFolder {
    /// Writes a folder with files beside the place where it belongs; it stays there when the process ends.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn write(folder: &Path, files: &[NewFile]) -> io::Result<StagedFolder> {
        let staged = write_beside(folder, files)?;
        sync_parent(folder)?;
        Ok(StagedFolder {
            staged,
            folder: folder.to_owned(),
        })
    }

    /// Finds what lies beside a place.
    pub fn find(folder: &Path) -> Option<StagedFolder> {
        let staged = beside(folder).ok().filter(|staged| staged.is_dir())?;
        Some(StagedFolder {
            staged,
            folder: folder.to_owned(),
        })
    }

    /// Returns where it lies.
    pub fn path(&self) -> &Path {
        &self.staged
    }

    /// Puts it where it belongs; an empty folder there is replaced.
    ///
    /// # Errors
    /// The disk refuses, or a folder of its name is there and not empty.
    pub fn place(self) -> io::Result<()> {
        fs::rename(&self.staged, &self.folder)?;
        sync_parent(&self.folder)
    }

    /// Removes it.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn remove(self) -> io::Result<()> {
        fs::remove_dir_all(&self.staged)
    }
}

/// Puts a folder with files in the place of another one, in one step: at any moment one of the two is there, whole. Returns
/// where the former one is kept; `None` = there was none, or an empty one.
///
/// # Errors
/// The disk refuses, or cannot exchange two folders.
pub fn replace_folder(
    folder: &Path,
    files: &[NewFile],
    owner: Option<Owner>,
) -> io::Result<Option<PathBuf>> {
    let is_taken = match fs::read_dir(folder) {
        Ok(mut entries) => entries.next().is_some(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => false,
        Err(error) => return Err(error),
    };
    let former = is_taken.then(|| unused(folder)).transpose()?;
    write_folder(folder, files, |new| {
        fs::set_permissions(new, Permissions::from_mode(NODE_FOLDER_MODE))?;
        own(new, owner)?;
        for file in files {
            own(&new.join(&file.name), owner)?;
        }
        let Some(former) = &former else {
            return fs::rename(new, folder);
        };
        // The new folder takes the former one's future name first, so that the exchange is the only step that counts.
        fs::rename(new, former)?;
        renameat_with(CWD, former, CWD, folder, RenameFlags::EXCHANGE).map_err(|error| {
            // It was never in force; the first error is the one to tell.
            let _ = fs::remove_dir_all(former);
            error.into()
        })
    })?;
    Ok(former)
}

/// Returns whether a node's folder and its files belong to whom they are to, with modes by which the node can read them, and
/// nobody else what is private. Without an owner it does not matter whose they are.
///
/// # Errors
/// One of them cannot be looked at.
pub fn is_as_replaced(folder: &Path, files: &[NewFile], owner: Option<Owner>) -> io::Result<bool> {
    let is_owned = |found: &fs::Metadata| {
        owner.is_none_or(|Owner { user, group }| (found.uid(), found.gid()) == (user, group))
    };
    let found = fs::metadata(folder)?;
    if !is_owned(&found) || found.mode() & 0o777 != NODE_FOLDER_MODE {
        return Ok(false);
    }
    for file in files {
        let found = fs::metadata(folder.join(&file.name))?;
        let is_right = match file.is_private {
            true => found.mode() & 0o777 == 0o600,
            false => found.mode() & 0o422 == 0o400,
        };
        if !is_owned(&found) || !is_right {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Gives a file or folder to its owner; without one it stays the caller's.
///
/// # Errors
/// The caller may not.
pub fn own(path: &Path, owner: Option<Owner>) -> io::Result<()> {
    match owner {
        Some(Owner { user, group }) => chown(path, Some(user), Some(group)),
        None => Ok(()),
    }
}

/// Writes a folder beside the place where it belongs, and puts it there by `place`.
fn write_folder(
    folder: &Path,
    files: &[NewFile],
    place: impl FnOnce(&Path) -> io::Result<()>,
) -> io::Result<()> {
    let new = write_beside(folder, files)?;
    place(&new).inspect_err(|_| drop(fs::remove_dir_all(&new)))?;
    sync_parent(folder)
}

/// Writes a folder beside the place where it belongs; returns where it lies.
fn write_beside(folder: &Path, files: &[NewFile]) -> io::Result<PathBuf> {
    let new = beside(folder)?;
    if new.exists() {
        // Left by one that was interrupted; it was never in force.
        fs::remove_dir_all(&new)?;
    }
    DirBuilder::new().recursive(true).mode(0o700).create(&new)?;
    let written = files
        .iter()
        .try_for_each(|file| write_file(&new.join(&file.name), file))
        .and_then(|()| File::open(&new)?.sync_all());
    // What is half written must not stay; the first error is the one to tell.
    written.inspect_err(|_| drop(fs::remove_dir_all(&new)))?;
    Ok(new)
}

/// Returns the first name for a former folder that is not taken: FOLDER.former-1 and so on.
fn unused(folder: &Path) -> io::Result<PathBuf> {
    let name = folder.file_name().ok_or(io::ErrorKind::InvalidInput)?;
    let former = |number: u32| {
        let mut name = name.to_owned();
        name.push(format!(".former-{number}"));
        folder.with_file_name(name)
    };
    (1..=u32::MAX)
        .map(former)
        .find(|path| !path.exists())
        .ok_or_else(|| io::ErrorKind::AlreadyExists.into())
}

/// Writes a file in a folder so that it is there whole, and a former one stays until then.
///
/// # Errors
/// The disk refuses.
pub fn replace_file(folder: &Path, file: &NewFile) -> io::Result<()> {
    let path = folder.join(&file.name);
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

/// Returns whether only its owner and its group can read a file; where files have no modes, whoever has the stick has it.
///
/// # Errors
/// It is not there.
pub fn is_private(path: &Path) -> io::Result<bool> {
    Ok(!has_modes(path)? || !is_open_to_others(path)?)
}

/// Returns whether a file can be read by users who are neither its owner nor of its group.
pub(super) fn is_open_to_others(path: &Path) -> io::Result<bool> {
    Ok(fs::metadata(path)?.mode() & 0o007 != 0)
}

/// Returns whether the modes of a file say anything: on a stick they are the same for all files, and whoever has it has them.
pub(super) fn has_modes(path: &Path) -> io::Result<bool> {
    let kind = statfs(path)?.f_type;
    let mode = fs::metadata(path)?.mode();
    Ok(u64::try_from(kind).is_ok_and(|kind| keeps_modes(kind, mode)))
}

/// Returns whether a file system of a kind that shows a file with this mode keeps modes.
fn keeps_modes(kind: u64, mode: u32) -> bool {
    let shows_none = SELDOM_WITH_MODES.contains(&kind) && mode & OPEN_TO_ALL == OPEN_TO_ALL;
    !WITHOUT_MODES.contains(&kind) && !shows_none
}

fn write_file(path: &Path, file: &NewFile) -> io::Result<()> {
    let mode = if file.is_private { 0o600 } else { 0o644 };
    let mut written = OpenOptions::new()
        .write(true)
        .create_new(true)
        .mode(mode)
        .open(path)?;
    written.write_all(&file.content)?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stick_keeps_no_modes_and_ntfs_none_where_all_is_open() {
        for (kind, mode, expected) in [
            (0xEF53, 0o100_777, true),
            (0x4d44, 0o100_600, false),
            (0x2011_bab0, 0o100_755, false),
            (0x7366_746e, 0o100_777, false),
            (0x7366_746e, 0o100_600, true),
            (0x6573_5546, 0o100_777, false),
            (0x6573_5546, 0o100_644, true),
        ] {
            assert_eq!(keeps_modes(kind, mode), expected, "{kind:x} {mode:o}");
        }
    }

    #[test]
    fn a_regular_file_alone_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::write(path("file"), "here").unwrap();
        assert_eq!(read_regular(&path("file")).unwrap(), b"here");
        std::os::unix::fs::symlink(path("file"), path("link")).unwrap();
        fs::create_dir(path("folder")).unwrap();
        for (name, part) in [
            ("link", "it is a link"),
            ("folder", "no regular file"),
            ("gone", "No such file"),
        ] {
            let why = read_regular(&path(name)).unwrap_err().to_string();
            assert!(why.contains(part), "{name}: {why}");
        }
    }

    #[test]
    fn a_folder_that_its_service_cannot_read_is_not_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let node = folder.path().join("node");
        let files = [
            NewFile::open("ca.pem", "c"),
            NewFile::private("key.pem", "k"),
        ];
        replace_folder(&node, &files, None).unwrap();
        let owner = |path: &Path| {
            let found = fs::metadata(path).unwrap();
            let (user, group) = (found.uid(), found.gid());
            Owner { user, group }
        };
        let mine = owner(&node);
        let other = Owner {
            user: mine.user + 1,
            ..mine
        };
        let is_right = |owner| is_as_replaced(&node, &files, owner).unwrap();
        assert!(is_right(None) && is_right(Some(mine)));
        assert!(!is_right(Some(other)), "it is another user's");
        let modes = [
            ("key.pem", 0o640, 0o600),
            ("ca.pem", 0o200, 0o644),
            ("", 0o700, 0o750),
        ];
        for (name, wrong, right) in modes {
            let set = |mode| fs::set_permissions(node.join(name), Permissions::from_mode(mode));
            set(wrong).unwrap();
            assert!(!is_right(None), "{name}");
            set(right).unwrap();
            assert!(is_right(None), "{name}");
        }
    }
}
