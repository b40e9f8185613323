//! Where the files of an export go: into a folder, or to the operator's page, one at a time. What nobody wants is not made.

#[cfg(feature = "dash")]
use std::path::{Path, PathBuf};

#[cfg(feature = "dash")]
use tomoswarm_proto::RunId;

use super::error::CliError;
#[cfg(feature = "dash")]
use super::export::Export;
use super::folder::OutputFolder;
#[cfg(feature = "dash")]
use crate::dash::run_files::RunFiles;
#[cfg(feature = "dash")]
use crate::tomo::LinkBins;

/// Takes the files of an export.
pub(super) trait ExportTarget {
    /// Returns whether a file is wanted, which there is.
    fn wants(&mut self, name: &str) -> bool;

    /// Takes a file.
    ///
    /// # Errors
    /// It cannot be written.
    fn write(&mut self, name: &str, bytes: &[u8]) -> Result<(), CliError>;
}

impl ExportTarget for OutputFolder {
    fn wants(&mut self, _: &str) -> bool {
        true
    }

    fn write(&mut self, name: &str, bytes: &[u8]) -> Result<(), CliError> {
        OutputFolder::write(self, name, bytes)
    }
}

/// One file of an export, or none; and the names of all that there are.
#[cfg(feature = "dash")]
#[derive(Default)]
struct OneFile<'a> {
    wanted: &'a str,
    names: Vec<String>,
    bytes: Option<Vec<u8>>,
}

#[cfg(feature = "dash")]
impl ExportTarget for OneFile<'_> {
    fn wants(&mut self, name: &str) -> bool {
        self.names.push(name.to_owned());
        self.wanted == name
    }

    fn write(&mut self, name: &str, bytes: &[u8]) -> Result<(), CliError> {
        // Two files may be made together.
        if self.wanted == name {
            self.bytes = Some(bytes.to_vec());
        }
        Ok(())
    }
}

/// The files of a ground station's store, for a page. It opens the store anew for each, and only reads it.
#[cfg(feature = "dash")]
pub(super) struct StoreFiles {
    store: PathBuf,
}

#[cfg(feature = "dash")]
impl StoreFiles {
    /// Returns the files of a store.
    pub(super) fn of(store: &Path) -> StoreFiles {
        StoreFiles {
            store: store.to_owned(),
        }
    }

    fn made<'a>(&self, run: RunId, wanted: &'a str) -> Result<OneFile<'a>, String> {
        let mut file = OneFile {
            wanted,
            ..OneFile::default()
        };
        let export = Export::of(&self.store, Some(run.0));
        let written = export.and_then(|export| export.write_to(&mut file));
        written.map_err(|error| error.to_string())?;
        Ok(file)
    }
}

#[cfg(feature = "dash")]
impl RunFiles for StoreFiles {
    fn names(&self, run: RunId) -> Result<Vec<String>, String> {
        let mut names = self.made(run, "")?.names;
        names.sort();
        Ok(names)
    }

    fn file(&self, run: RunId, name: &str) -> Result<Vec<u8>, String> {
        let OneFile { names, bytes, .. } = self.made(run, name)?;
        let known = || {
            format!(
                "there is no file {name:?} of run {run}; there are {}",
                names.join(", ")
            )
        };
        bytes.ok_or_else(known)
    }

    fn links(&self, run: RunId) -> Result<LinkBins, String> {
        let export = Export::of(&self.store, Some(run.0));
        let links = export.and_then(|export| export.links(run));
        links.map_err(|error| error.to_string())
    }
}
