//! A small file that must not be misread: a few lines of text with a title, a version and a check value, replaced as a whole.
//! What its lines mean is said by who reads it.
//!
//! ```text
//!   tomoswarm vehicle memory 1
//!   …
//!   check 9ae16a3b2f90404f
//! ```
//!
//! The check is FNV-1a, 64 bits, over all lines above it: one byte changed always changes it.

use std::fs;
use std::hash::Hasher;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use fnv::FnvHasher;

/// Why a small file cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum CheckedFileError {
    /// The system does not let it be read.
    #[error("{}: cannot be read: {source}; it holds {holds}", path.display())]
    Unread {
        /// The file.
        path: PathBuf,
        /// What is in it.
        holds: &'static str,
        /// What the system says.
        source: io::Error,
    },
    /// It is not as it was written.
    #[error("{}: is damaged: {reason}; it holds {holds}: {remedy}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What was expected, and what was found.
        reason: String,
        /// What is in it.
        holds: &'static str,
        /// What to do.
        remedy: &'static str,
    },
    /// A later program wrote it.
    #[error("{}: written by a newer tomoswarm (version {found}, this one knows {known})", path.display())]
    Newer {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u32,
        /// The version of this program.
        known: u32,
    },
}

/// Why a text is not what was written.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum TextFault {
    /// Damaged: what was expected, and what was found.
    Damaged(String),
    /// A later program wrote it, in this version.
    Newer(u32),
}

/// Which kind of file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct CheckedFile {
    /// The first words, before the version.
    pub title: &'static str,
    /// The version of what is written here.
    pub version: u32,
    /// One that is longer is none of ours, bytes.
    pub longest: u64,
    /// What is in it, and what to do when it is damaged, for people.
    pub holds: &'static str,
    pub remedy: &'static str,
}

impl CheckedFile {
    /// Reads the lines of a file by `parse`, which says what is wrong with them; `None` = there is no such file.
    ///
    /// # Errors
    /// It cannot be read, or is not what was written.
    pub(super) fn read<T>(
        self,
        path: &Path,
        parse: impl FnOnce(&str) -> Result<T, String>,
    ) -> Result<Option<T>, CheckedFileError> {
        let CheckedFile {
            version: known,
            longest,
            holds,
            remedy,
            ..
        } = self;
        let at = || path.to_owned();
        let unread = |source| CheckedFileError::Unread {
            path: at(),
            holds,
            source,
        };
        let damaged = |reason| CheckedFileError::Damaged {
            path: at(),
            reason,
            holds,
            remedy,
        };
        let length = match fs::metadata(path) {
            Ok(found) => found.len(),
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(source) => return Err(unread(source)),
        };
        if length > longest {
            return Err(damaged(format!(
                "{length} bytes, expected at most {longest}"
            )));
        }
        let bytes = fs::read(path).map_err(unread)?;
        match self
            .open(&bytes)
            .and_then(|lines| parse(lines).map_err(TextFault::Damaged))
        {
            Ok(content) => Ok(Some(content)),
            Err(TextFault::Damaged(reason)) => Err(damaged(reason)),
            Err(TextFault::Newer(found)) => Err(CheckedFileError::Newer {
                path: at(),
                found,
                known,
            }),
        }
    }

    /// Returns the whole text of some lines, each with its end.
    pub(super) fn seal(self, lines: &str) -> String {
        let body = format!("{} {}\n{lines}", self.title, self.version);
        format!("{body}check {:016x}\n", fnv(body.as_bytes()))
    }

    /// Returns the lines between title and check.
    ///
    /// # Errors
    /// It is not as it was written, or not of this version.
    pub(super) fn open(self, bytes: &[u8]) -> Result<&str, TextFault> {
        let damaged = |reason: &str| TextFault::Damaged(reason.to_owned());
        let text = std::str::from_utf8(bytes).map_err(|_| damaged("expected text"))?;
        if text.is_empty() {
            return Err(damaged("it is empty"));
        }
        let whole = text
            .strip_suffix('\n')
            .ok_or_else(|| damaged("its end is missing"))?;
        let (lines, check) = whole
            .rsplit_once('\n')
            .ok_or_else(|| damaged("its end is missing"))?;
        let body = &text[..=lines.len()];
        let expected = format!("check {:016x}", fnv(body.as_bytes()));
        if check != expected {
            return Err(TextFault::Damaged(format!(
                "expected `{expected}` at its end, found `{check}`"
            )));
        }
        let (title, rest) = lines.split_once('\n').unwrap_or((lines, ""));
        let version = title
            .strip_prefix(self.title)
            .and_then(|version| version.trim().parse().ok());
        match version {
            Some(version) if version == self.version => Ok(rest),
            Some(newer) if newer > self.version => Err(TextFault::Newer(newer)),
            Some(_) | None => {
                let CheckedFile {
                    title: expected,
                    version,
                    ..
                } = self;
                Err(TextFault::Damaged(format!(
                    "expected `{expected} {version}`, found `{title}`"
                )))
            }
        }
    }
}

/// Returns the FNV-1a hash of bytes.
pub(super) fn fnv(bytes: &[u8]) -> u64 {
    let mut hash = FnvHasher::default();
    hash.write(bytes);
    hash.finish()
}
