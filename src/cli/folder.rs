//! An output folder that appears whole or not at all: files are written into a hidden stage and moved in at the
//! end, in place of what an earlier run left there.
//!
//! The stage lies in the folder itself, or beside it while the folder does not exist yet. It is locked while
//! its run lives: what a killed run left behind is not locked, and the next run removes it. A run that writes
//! less than the one before it (no pictures) takes the older ones away, so that all files are of one run;
//! files of other names are never touched.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use super::error::CliError;

/// What the name of every stage begins with; the number of the process follows.
const STAGE: &str = ".tomoswarm.partial-";
/// The file in a stage that is locked while its run lives.
const LOCK: &str = ".lock";

/// The folder for recordings.
const FLIGHT: &str = "flight";
/// The folder for what the processes of a live swarm leave behind, and the file that tells it from others of this name.
const LIVE: &str = "live";
const LIVE_MARK: &str = ".tomoswarm-live";

/// The files that one command leaves behind together.
#[derive(Clone, Copy, Debug)]
pub(super) struct FileFamily {
    /// All names, whether a run writes each of them or not.
    pub names: &'static [&'static str],
    /// The file by which a folder is known to hold what the command has written, and a text in it: every run writes it.
    /// `None` = files of these names are replaced, whosever they are.
    pub mark: Option<(&'static str, &'static str)>,
    /// Whether a run leaves the folders `flight` and `live` as well; who does not leaves those of others alone.
    pub has_folders: bool,
}

impl FileFamily {
    /// Refuses a folder where files of these names lie that the command has not written.
    ///
    /// # Errors
    /// The first of them.
    pub(super) fn refuse_foreign(&self, folder: &Path) -> Result<(), CliError> {
        self.refuse_foreign_named(folder, self.names.iter().copied())
    }

    fn refuse_foreign_named<'a>(
        &self,
        folder: &Path,
        names: impl Iterator<Item = &'a str>,
    ) -> Result<(), CliError> {
        let Some((mark, says)) = self.mark else {
            return Ok(());
        };
        // A link that leads nowhere is somebody's as well; a folder is refused at the end, as one in the way.
        let is_there = |path: &Path| path.symlink_metadata().is_ok() && !path.is_dir();
        let found = names
            .map(|name| folder.join(name))
            .find(|path| is_there(path));
        let recording = || recordings_in(&folder.join(FLIGHT)).into_iter().next();
        let Some(found) = found.or_else(|| recording().filter(|_| self.has_folders)) else {
            return Ok(());
        };
        let text = fs::read(folder.join(mark)).unwrap_or_default();
        if text.windows(says.len()).any(|part| part == says.as_bytes()) {
            return Ok(());
        }
        let refused = "this file is not of an earlier run, and would be replaced or removed; \
             move it away, or choose another folder";
        Err(CliError::Write {
            path: found,
            source: io::Error::other(refused),
        })
    }
}

/// Files that are to appear in a folder.
#[derive(Debug)]
pub(super) struct OutputFolder {
    target: PathBuf,
    stage: PathBuf,
    /// Folders on the way that did not exist before, deepest first.
    made: Vec<PathBuf>,
    names: Vec<String>,
    family: FileFamily,
    /// Names that belong to a run, whether this one writes them or not.
    names_of_run: Vec<String>,
    /// Held for its lock.
    _lock: File,
}

impl OutputFolder {
    /// Prepares a folder for files of the given names; finds out now whether it can be written, before any work
    /// is done.
    ///
    /// # Errors
    /// The folder cannot be made or written, or files of these names lie in it that no run has written.
    pub(super) fn prepare(target: &Path, family: FileFamily) -> Result<OutputFolder, CliError> {
        let fail = |source| CliError::Write {
            path: target.to_owned(),
            source,
        };
        // A link that leads nowhere is in the way as well.
        if !target.is_dir() && target.symlink_metadata().is_ok() {
            return Err(fail(io::Error::other(
                "something else is there; a folder is expected",
            )));
        }
        if family.has_folders && target.join(FLIGHT).is_symlink() {
            return Err(fail(io::Error::other(
                "it holds a link `flight`; what that leads to is left alone",
            )));
        }
        if family.has_folders && is_foreign_live(&target.join(LIVE)) {
            return Err(fail(io::Error::other(
                "it holds a folder `live` that is not of a run",
            )));
        }
        family.refuse_foreign(target)?;
        let place = place_of_stage(target);
        let made = missing(place);
        let opened = open_stage(place);
        if opened.is_err() {
            remove_empty(&made);
        }
        let (stage, lock) = opened.map_err(fail)?;
        let names_of_run = family.names.iter().map(|name| (*name).to_owned()).collect();
        Ok(OutputFolder {
            target: target.to_owned(),
            stage,
            made,
            names: Vec::new(),
            family,
            names_of_run,
            _lock: lock,
        })
    }

    /// Adds to the names that belong to a run those files in the folder whose names a test tells to be ours.
    ///
    /// # Errors
    /// No run has written them.
    #[cfg(feature = "net")]
    pub(super) fn claim(&mut self, is_ours: impl Fn(&str) -> bool) -> Result<(), CliError> {
        let entries = fs::read_dir(&self.target).into_iter().flatten().flatten();
        let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
        let claimed: Vec<String> = names.filter(|name| is_ours(name)).collect();
        let names = claimed.iter().map(String::as_str);
        self.family.refuse_foreign_named(&self.target, names)?;
        self.names_of_run.extend(claimed);
        Ok(())
    }

    /// Writes a file, not yet visible.
    ///
    /// # Errors
    /// The disk is full, or the folder went away.
    pub(super) fn write(&mut self, name: &str, bytes: &[u8]) -> Result<(), CliError> {
        let path = self.stage.join(name);
        fs::write(&path, bytes).map_err(|source| CliError::Write {
            path: self.target.join(name),
            source,
        })?;
        self.names.push(name.to_owned());
        Ok(())
    }

    /// Returns a folder for recordings in the stage; what lies in it in the end appears with the rest.
    ///
    /// # Errors
    /// It cannot be made.
    #[cfg(feature = "net")]
    pub(super) fn recordings(&self) -> Result<PathBuf, CliError> {
        let folder = self.stage.join(FLIGHT);
        fs::create_dir_all(&folder).map_err(|source| CliError::Write {
            path: self.target.join(FLIGHT),
            source,
        })?;
        Ok(folder)
    }

    /// Returns a folder for a live swarm in the stage; it appears with the rest as `live`.
    ///
    /// # Errors
    /// It cannot be made.
    #[cfg(feature = "net")]
    pub(super) fn live(&self) -> Result<PathBuf, CliError> {
        let folder = self.stage.join(LIVE);
        let made =
            fs::create_dir_all(&folder).and_then(|()| fs::write(folder.join(LIVE_MARK), b""));
        made.map_err(|source| CliError::Write {
            path: self.target.join(LIVE),
            source,
        })?;
        Ok(folder)
    }

    /// Lets all files appear, in place of those of an earlier run.
    ///
    /// # Errors
    /// The folder cannot be made or written; nothing of an earlier run is gone then, unless the disk fails
    /// half-way.
    pub(super) fn publish(self) -> Result<PathBuf, CliError> {
        let fail = |path: &Path, source| CliError::Write {
            path: path.to_owned(),
            source,
        };
        fs::create_dir_all(&self.target).map_err(|source| fail(&self.target, source))?;
        let in_the_way = self
            .names_of_run
            .iter()
            .map(|name| self.target.join(name))
            .find(|path| path.is_dir());
        if let Some(path) = in_the_way {
            return Err(fail(
                &path,
                io::Error::other("a folder is in the way; a file is expected"),
            ));
        }
        // Whoever comes after a run that is killed here knows by the mark that the files are of a run.
        let mark = self.family.mark.map(|(mark, _)| mark);
        let (first, others): (Vec<&String>, Vec<&String>) = self
            .names
            .iter()
            .partition(|name| mark == Some(name.as_str()));
        for name in first.into_iter().chain(others) {
            let path = self.target.join(name);
            fs::rename(self.stage.join(name), &path).map_err(|source| fail(&path, source))?;
        }
        let older = self
            .names_of_run
            .iter()
            .filter(|name| !self.names.contains(*name));
        for path in older
            .map(|name| self.target.join(name))
            .filter(|path| path.exists())
        {
            fs::remove_file(&path).map_err(|source| fail(&path, source))?;
        }
        if self.family.has_folders {
            self.publish_recordings()
                .map_err(|source| fail(&self.target.join(FLIGHT), source))?;
            self.publish_live()
                .map_err(|source| fail(&self.target.join(LIVE), source))?;
        }
        Ok(self.target.clone())
    }

    /// Lets the folder of a live swarm appear in place of that of an earlier run.
    fn publish_live(&self) -> io::Result<()> {
        let (from, to) = (self.stage.join(LIVE), self.target.join(LIVE));
        if is_foreign_live(&to) {
            return Err(io::Error::other("it is not of a run"));
        }
        if to.exists() {
            fs::remove_dir_all(&to)?;
        }
        if from.exists() {
            fs::rename(&from, &to)
        } else {
            Ok(())
        }
    }

    /// Lets recordings appear in place of those of an earlier run.
    fn publish_recordings(&self) -> io::Result<()> {
        let (from, to) = (self.stage.join(FLIGHT), self.target.join(FLIGHT));
        for old in recordings_in(&to) {
            fs::remove_file(&old)?;
            remove_empty(&[old.parent().unwrap_or(&to).to_owned(), to.clone()]);
        }
        for new in recordings_in(&from) {
            let path = to.join(new.strip_prefix(&from).unwrap_or(&new));
            path.parent().map_or(Ok(()), fs::create_dir_all)?;
            fs::rename(&new, &path)?;
        }
        Ok(())
    }
}

/// Returns whether something is there that no run has made.
fn is_foreign_live(folder: &Path) -> bool {
    folder.symlink_metadata().is_ok() && !folder.join(LIVE_MARK).is_file()
}

/// Lists the recordings in a folder, which has a folder for each node; files of other names are none.
fn recordings_in(folder: &Path) -> Vec<PathBuf> {
    let inside = |folder: &Path| {
        fs::read_dir(folder)
            .into_iter()
            .flatten()
            .flatten()
            .map(|entry| entry.path())
    };
    let is_recording = |path: &PathBuf| {
        let name = path
            .file_name()
            .map(OsStr::to_string_lossy)
            .unwrap_or_default();
        name.starts_with("flight-") && name.ends_with(".mcap") && path.is_file()
    };
    inside(folder)
        .flat_map(|node| inside(&node).filter(is_recording).collect::<Vec<_>>())
        .collect()
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        // What is left of the stage is of no use to anybody; a second failure would tell nothing new.
        let _ = fs::remove_dir_all(&self.stage);
        remove_empty(&self.made);
    }
}

/// Returns the folder in which the stage lies: one from which files can be moved into the target.
fn place_of_stage(target: &Path) -> &Path {
    if target.is_dir() {
        return target;
    }
    match target.parent() {
        Some(parent) if parent != Path::new("") => parent,
        Some(_) | None => Path::new("."),
    }
}

/// Lists a folder and those above it that do not exist, deepest first.
fn missing(folder: &Path) -> Vec<PathBuf> {
    let is_missing = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
    folder
        .ancestors()
        .take_while(is_missing)
        .map(Path::to_owned)
        .collect()
}

fn remove_empty(folders: &[PathBuf]) {
    for folder in folders {
        // It fails when there is something in it, and that is what is wanted.
        let _ = fs::remove_dir(folder);
    }
}

fn open_stage(place: &Path) -> io::Result<(PathBuf, File)> {
    fs::create_dir_all(place)?;
    remove_abandoned(place);
    let stage = place.join(format!("{STAGE}{}", std::process::id()));
    fs::create_dir(&stage)?;
    let locked = File::create(stage.join(LOCK)).inspect(|lock| {
        // Where files cannot be locked nobody takes the stage for abandoned either.
        let _ = lock.try_lock();
    });
    match locked {
        Ok(lock) => Ok((stage, lock)),
        Err(error) => {
            remove_empty(&[stage]);
            Err(error)
        }
    }
}

/// Returns whether the process lives that has made a stage; where nobody can know, it does.
fn is_running(stage: &Path) -> bool {
    let name = stage.file_name().unwrap_or_default().to_string_lossy();
    let process = name.strip_prefix(STAGE).unwrap_or_default();
    let processes = Path::new("/proc");
    !processes.join("self").exists() || processes.join(process).exists()
}

/// Removes the stages of runs that were killed. It is no matter for this run when that fails.
fn remove_abandoned(place: &Path) {
    let is_stage = |name: &OsStr| name.to_string_lossy().starts_with(STAGE);
    let entries = fs::read_dir(place).into_iter().flatten().flatten();
    for stage in entries
        .filter(|entry| is_stage(&entry.file_name()))
        .map(|entry| entry.path())
    {
        let is_abandoned = match File::open(stage.join(LOCK)) {
            Ok(lock) => lock.try_lock().is_ok(),
            // Whoever removed it was killed after the lock had gone, or makes one just now.
            Err(_) => !is_running(&stage),
        };
        if is_abandoned {
            let _ = fs::remove_dir_all(&stage);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAMILY: FileFamily = FileFamily {
        names: &["a.txt", "b.txt"],
        mark: None,
        has_folders: true,
    };

    fn prepare(target: &Path) -> Result<OutputFolder, CliError> {
        OutputFolder::prepare(target, FAMILY)
    }

    fn listed(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    }

    #[test]
    fn files_appear_together_and_nothing_else_is_left() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("run");
        let mut folder = prepare(&target).unwrap();
        folder.write("a.txt", b"1").unwrap();
        assert!(!target.exists());
        folder.publish().unwrap();
        assert_eq!(listed(&target), ["a.txt"]);
        assert_eq!(listed(root.path()), ["run"]);
    }

    #[test]
    fn a_folder_that_is_given_up_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        let mut folder = prepare(&root.path().join("deep/er/run")).unwrap();
        folder.write("a.txt", b"1").unwrap();
        drop(folder);
        assert!(listed(root.path()).is_empty());
    }

    #[test]
    fn files_of_others_in_the_folder_stay_and_older_ones_of_ours_go() {
        let root = tempfile::tempdir().unwrap();
        for name in ["mine.txt", "a.txt", "b.txt"] {
            fs::write(root.path().join(name), b"old").unwrap();
        }
        let mut folder = prepare(root.path()).unwrap();
        folder.write("a.txt", b"new").unwrap();
        assert_eq!(fs::read(root.path().join("a.txt")).unwrap(), b"old");
        folder.publish().unwrap();
        assert_eq!(listed(root.path()), ["a.txt", "mine.txt"]);
        assert_eq!(fs::read(root.path().join("a.txt")).unwrap(), b"new");
    }

    #[test]
    fn files_of_a_runs_names_that_no_run_has_written_are_refused_before_the_work() {
        const MARKED: FileFamily = FileFamily {
            names: &["a.txt", "b.txt"],
            mark: Some(("b.txt", "of a run")),
            has_folders: true,
        };
        let root = tempfile::tempdir().unwrap();
        let prepare = || OutputFolder::prepare(root.path(), MARKED);
        drop(prepare().unwrap());
        fs::write(root.path().join("a.txt"), b"mine").unwrap();
        let words = prepare().unwrap_err().to_string();
        assert!(
            words.contains("a.txt: cannot be written: this file is not of an earlier run"),
            "{words}"
        );
        fs::write(root.path().join("b.txt"), b"mine as well").unwrap();
        assert_eq!(prepare().unwrap_err().exit_code(), 2);
        assert_eq!(listed(root.path()), ["a.txt", "b.txt"]);
        fs::write(root.path().join("b.txt"), b"all is of a run.").unwrap();
        let mut folder = prepare().unwrap();
        folder.write("b.txt", b"of a run again").unwrap();
        folder.publish().unwrap();
        assert_eq!(listed(root.path()), ["b.txt"]);
        // Recordings that no run has made here, and what others than runs leave alone.
        let mine = tempfile::tempdir().unwrap();
        let recording = mine.path().join("flight/vehicle-1/flight-1.mcap");
        fs::create_dir_all(recording.parent().unwrap()).unwrap();
        fs::write(&recording, b"mine").unwrap();
        let words = OutputFolder::prepare(mine.path(), MARKED)
            .unwrap_err()
            .to_string();
        assert!(
            words.contains("flight-1.mcap: cannot be written"),
            "{words}"
        );
        let without = FileFamily {
            has_folders: false,
            ..MARKED
        };
        let folder = OutputFolder::prepare(mine.path(), without).unwrap();
        folder.publish().unwrap();
        assert!(recording.is_file());
        #[cfg(unix)]
        {
            let link = mine.path().join("a.txt");
            std::os::unix::fs::symlink("/nowhere/x", &link).unwrap();
            assert!(OutputFolder::prepare(mine.path(), without).is_err());
        }
    }

    #[test]
    fn what_a_killed_run_left_is_removed_and_what_a_living_one_holds_is_not() {
        let root = tempfile::tempdir().unwrap();
        let stage = |name: &str| {
            let stage = root.path().join(format!("{STAGE}{name}"));
            fs::create_dir(&stage).unwrap();
            File::create(stage.join(LOCK)).unwrap()
        };
        drop(stage("killed"));
        let living = stage("living");
        living.lock().unwrap();
        drop(prepare(&root.path().join("run")).unwrap());
        assert_eq!(listed(root.path()), [format!("{STAGE}living")]);
    }

    #[test]
    fn a_file_in_the_way_is_refused_before_the_work() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("taken");
        fs::write(&path, b"").unwrap();
        let error = prepare(&path).unwrap_err();
        assert!(
            error.to_string().contains("taken: cannot be written"),
            "{error}"
        );
        assert_eq!(error.exit_code(), 2);
        assert!(prepare(&path.join("below")).is_err());
        assert_eq!(listed(root.path()), ["taken"]);
    }

    #[test]
    #[cfg(feature = "net")]
    fn what_a_live_swarm_left_gives_way_to_the_next_run_and_a_folder_of_somebody_else_does_not() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("run");
        let folder = prepare(&target).unwrap();
        fs::write(folder.live().unwrap().join("first.log"), b"").unwrap();
        folder.publish().unwrap();
        assert!(target.join("live/first.log").exists());
        let folder = prepare(&target).unwrap();
        fs::write(folder.live().unwrap().join("second.log"), b"").unwrap();
        folder.publish().unwrap();
        assert!(target.join("live/second.log").exists() && !target.join("live/first.log").exists());
        prepare(&target).unwrap().publish().unwrap();
        assert!(!target.join("live").exists());
        fs::create_dir(target.join("live")).unwrap();
        assert!(
            prepare(&target)
                .unwrap_err()
                .to_string()
                .contains("not of a run")
        );
    }

    #[test]
    fn a_folder_in_place_of_a_file_keeps_the_earlier_run() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("a.txt"), b"old").unwrap();
        fs::create_dir(root.path().join("b.txt")).unwrap();
        let mut folder = prepare(root.path()).unwrap();
        folder.write("a.txt", b"new").unwrap();
        folder.write("b.txt", b"new").unwrap();
        let error = folder.publish().unwrap_err();
        assert!(
            error
                .to_string()
                .contains("b.txt: cannot be written: a folder is in the way"),
            "{error}"
        );
        assert_eq!(fs::read(root.path().join("a.txt")).unwrap(), b"old");
    }
}
