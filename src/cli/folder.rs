//! An output folder that appears whole or not at all: files are written beside it and moved in at the end.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::error::CliError;

/// Files that are to appear in a folder.
#[derive(Debug)]
pub struct OutputFolder {
    target: PathBuf,
    stage: PathBuf,
    names: Vec<String>,
}

impl OutputFolder {
    /// Prepares a folder; finds out now whether it can be written, before any work is done.
    ///
    /// # Errors
    /// The folder cannot be made or written.
    pub fn prepare(target: &Path) -> Result<OutputFolder, CliError> {
        let fail = |source| CliError::Write { path: target.to_owned(), source };
        if target.exists() && !target.is_dir() {
            return Err(fail(io::Error::from(io::ErrorKind::NotADirectory)));
        }
        let name = target.file_name().ok_or_else(|| fail(io::Error::from(io::ErrorKind::InvalidInput)))?;
        let partial = format!(".{}.partial-{}", name.to_string_lossy(), std::process::id());
        let stage = target.with_file_name(partial);
        fs::create_dir_all(&stage).map_err(fail)?;
        let folder = OutputFolder { target: target.to_owned(), stage, names: Vec::new() };
        if target.exists() {
            folder.try_writing().map_err(fail)?;
        }
        Ok(folder)
    }

    /// Tries whether files can be made in a folder that exists already.
    fn try_writing(&self) -> io::Result<()> {
        let trial = self.target.join(format!(".trial-{}", std::process::id()));
        fs::write(&trial, [])?;
        fs::remove_file(&trial)
    }

    /// Writes a file, not yet visible.
    ///
    /// # Errors
    /// The disk is full, or the folder went away.
    pub fn write(&mut self, name: &str, bytes: &[u8]) -> Result<(), CliError> {
        let path = self.stage.join(name);
        fs::write(&path, bytes).map_err(|source| CliError::Write { path: self.target.join(name), source })?;
        self.names.push(name.to_owned());
        Ok(())
    }

    /// Lets all files appear, in place of older ones of the same names.
    ///
    /// # Errors
    /// The folder cannot be made or written.
    pub fn publish(self) -> Result<PathBuf, CliError> {
        let fail = |source| CliError::Write { path: self.target.clone(), source };
        fs::create_dir_all(&self.target).map_err(fail)?;
        for name in &self.names {
            fs::rename(self.stage.join(name), self.target.join(name)).map_err(fail)?;
        }
        Ok(self.target.clone())
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        // What is left of the stage is of no use to anybody; a second failure would tell nothing new.
        let _ = fs::remove_dir_all(&self.stage);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn listed(folder: &Path) -> Vec<String> {
        let names =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    }

    #[test]
    fn files_appear_together_and_nothing_else_is_left() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("run");
        let mut folder = OutputFolder::prepare(&target).unwrap();
        folder.write("a.txt", b"1").unwrap();
        assert!(!target.exists());
        folder.publish().unwrap();
        assert_eq!(listed(&target), ["a.txt"]);
        assert_eq!(listed(root.path()), ["run"]);
    }

    #[test]
    fn a_folder_that_is_given_up_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        let mut folder = OutputFolder::prepare(&root.path().join("run")).unwrap();
        folder.write("a.txt", b"1").unwrap();
        drop(folder);
        assert!(listed(root.path()).is_empty());
    }

    #[test]
    fn files_of_others_in_the_folder_stay() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("mine.txt"), b"keep").unwrap();
        let mut folder = OutputFolder::prepare(root.path()).unwrap();
        folder.write("a.txt", b"1").unwrap();
        folder.publish().unwrap();
        assert_eq!(listed(root.path()), ["a.txt", "mine.txt"]);
    }

    #[test]
    fn a_file_in_the_way_is_refused_before_the_work() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("taken");
        fs::write(&path, b"").unwrap();
        let error = OutputFolder::prepare(&path).unwrap_err();
        assert!(error.to_string().contains("taken: cannot be written"), "{error}");
        assert_eq!(error.exit_code(), 2);
    }
}
