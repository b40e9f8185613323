//! A few lines of text with a title, a version and a check value, as small files are written that must not be misread. Reads
//! and writes no file.
//!
//! ```text
//!   tomoswarm vehicle memory 1
//!   …
//!   check 9ae16a3b2f90404f
//! ```
//!
//! The check is FNV-1a, 64 bits, over all lines above it: one byte changed always changes it.

use std::hash::Hasher;

use fnv::FnvHasher;

/// Why a text is not what was written.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum TextFault {
    /// Damaged: what was expected, and what was found.
    Damaged(String),
    /// A later program wrote it, in this version.
    Newer(u32),
}

/// Which kind of text.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct CheckedText {
    /// The first words, before the version.
    pub title: &'static str,
    /// The version of what is written here.
    pub version: u32,
}

impl CheckedText {
    /// Returns the whole text of some lines, each with its end.
    pub fn seal(self, lines: &str) -> String {
        let body = format!("{} {}\n{lines}", self.title, self.version);
        format!("{body}check {:016x}\n", fnv(body.as_bytes()))
    }

    /// Returns the lines between title and check.
    ///
    /// # Errors
    /// It is not as it was written, or not of this version.
    pub fn open(self, bytes: &[u8]) -> Result<&str, TextFault> {
        let damaged = |reason: &str| TextFault::Damaged(reason.to_owned());
        let text = std::str::from_utf8(bytes).map_err(|_| damaged("expected text"))?;
        if text.is_empty() {
            return Err(damaged("it is empty"));
        }
        let whole = text.strip_suffix('\n').ok_or_else(|| damaged("its end is missing"))?;
        let (lines, check) = whole.rsplit_once('\n').ok_or_else(|| damaged("its end is missing"))?;
        let body = &text[..=lines.len()];
        let expected = format!("check {:016x}", fnv(body.as_bytes()));
        if check != expected {
            return Err(TextFault::Damaged(format!("expected `{expected}` at its end, found `{check}`")));
        }
        let (title, rest) = lines.split_once('\n').unwrap_or((lines, ""));
        let version = title.strip_prefix(self.title).and_then(|version| version.trim().parse().ok());
        match version {
            Some(version) if version == self.version => Ok(rest),
            Some(newer) if newer > self.version => Err(TextFault::Newer(newer)),
            Some(_) | None => {
                let CheckedText { title: expected, version } = self;
                Err(TextFault::Damaged(format!("expected `{expected} {version}`, found `{title}`")))
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
