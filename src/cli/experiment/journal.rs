//! The finished runs of an experiment on disk: a line of JSON each, after a line that says which experiment it is.
//!
//! A line is written at once and ends in a line break; what a killed program left half-written has none, and is dropped.
//! The file is locked while an experiment is run. It does not order the runs.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::row::RunRow;
use crate::cli::error::CliError;
use crate::cli::folder::FileFamily;
use crate::cli::read::LIMIT_BYTES;

/// The file of the runs, as a table to be read on.
pub(super) const RUNS: &str = "runs.csv";
/// The file of the table.
pub(super) const TABLE: &str = "table.txt";
/// The file of the journal.
const JOURNAL: &str = "journal.jsonl";
/// What a journal begins with.
const BEGIN: &str = "{\"experiment_journal\":";
/// What is made of a journal.
const FAMILY: FileFamily = FileFamily {
    names: &[RUNS, TABLE],
    mark: Some((JOURNAL, BEGIN)),
    has_folders: false,
};

/// What is done with an earlier run.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum JournalMode {
    /// It goes on if there is one.
    Any,
    /// It must be there, and goes on.
    Resume,
    /// It is thrown away.
    Fresh,
}

/// Which experiment a journal belongs to.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) struct Header {
    /// The form of the journal.
    experiment_journal: u32,
    /// The version of the program.
    version: String,
    /// Hash over all files of the experiment.
    config_hash: String,
    /// Runs of the grid.
    runs: usize,
}

/// The form of the journal that is written here.
const FORM: u32 = 3;

impl Header {
    /// Makes the header of an experiment.
    pub(super) fn new(hash: u64, runs: usize) -> Header {
        let version = env!("CARGO_PKG_VERSION").to_owned();
        Header {
            experiment_journal: FORM,
            version,
            config_hash: format!("{hash:016x}"),
            runs,
        }
    }

    /// Returns what is not as in another one.
    fn difference(&self, other: &Header) -> Option<String> {
        if self.experiment_journal != other.experiment_journal {
            return Some(format!(
                "its rows have other columns (form {} of the journal, this is {})",
                self.experiment_journal, other.experiment_journal
            ));
        }
        if self.version != other.version {
            return Some(format!(
                "it was begun by version {}, this is {}",
                self.version, other.version
            ));
        }
        (self != other).then(|| {
            format!(
                "the experiment has changed (files {} then, {} now)",
                self.config_hash, other.config_hash
            )
        })
    }
}

/// The journal of an experiment under way.
#[derive(Debug)]
pub(super) struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// Opens the journal in a folder, and returns the runs that are finished.
    ///
    /// # Errors
    /// The folder cannot be used, or what is there is not of this experiment.
    pub(super) fn open(
        folder: &Path,
        header: &Header,
        mode: JournalMode,
    ) -> Result<(Journal, Vec<RunRow>), CliError> {
        let path = folder.join(JOURNAL);
        if mode == JournalMode::Resume && !path.is_file() {
            let reason =
                "there is no run to go on with; leave out --resume to begin one".to_owned();
            return Err(CliError::Input { path, reason });
        }
        FAMILY.refuse_foreign(folder)?;
        let fail = |source| CliError::Write {
            path: path.clone(),
            source,
        };
        fs::create_dir_all(folder).map_err(|source| CliError::Write {
            path: folder.to_owned(),
            source,
        })?;
        let open = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path);
        let mut file = open.map_err(fail)?;
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            let reason = "another program runs this experiment; wait for it, or give another --out"
                .to_owned();
            return Err(CliError::Input { path, reason });
        }
        let mut bytes = read_all(&mut file).map_err(fail)?;
        if !bytes.starts_with(BEGIN.as_bytes()) && !BEGIN.as_bytes().starts_with(&bytes) {
            let reason = "is no journal of an experiment; move it away, or give another --out";
            return Err(CliError::Line {
                path,
                line: 1,
                reason: reason.to_owned(),
            });
        }
        if mode == JournalMode::Fresh {
            for name in FAMILY.names {
                // They may not be there.
                let _ = fs::remove_file(folder.join(name));
            }
            file.set_len(0).and_then(|()| file.rewind()).map_err(fail)?;
            bytes.clear();
        }
        let whole = bytes
            .iter()
            .rposition(|byte| *byte == b'\n')
            .map_or(0, |last| last + 1);
        let rows = rows_of(&path, &bytes[..whole], header)?;
        file.set_len(whole as u64)
            .and_then(|()| file.seek(SeekFrom::End(0)))
            .map_err(fail)?;
        let mut journal = Journal { path, file };
        if whole == 0 {
            journal.write(header)?;
        }
        Ok((journal, rows))
    }

    /// Keeps a finished run.
    ///
    /// # Errors
    /// The disk is full, or the folder went away.
    pub(super) fn record(&mut self, row: &RunRow) -> Result<(), CliError> {
        self.write(row)
    }

    fn write<T: Serialize>(&mut self, line: &T) -> Result<(), CliError> {
        let text = serde_json::to_string(line).map_err(io::Error::from);
        let written = text.and_then(|text| self.file.write_all(format!("{text}\n").as_bytes()));
        written.map_err(|source| CliError::Write {
            path: self.path.clone(),
            source,
        })
    }
}

fn read_all(file: &mut File) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(LIMIT_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LIMIT_BYTES {
        return Err(io::Error::other("it is too large for a journal"));
    }
    Ok(bytes)
}

/// Reads whole lines: the header, which must be this one, and the runs, each once.
fn rows_of(path: &Path, bytes: &[u8], header: &Header) -> Result<Vec<RunRow>, CliError> {
    let bad = |line: usize, reason: &str| CliError::Line {
        path: path.to_owned(),
        line,
        reason: format!("{reason}; use --fresh to begin anew, or give another --out"),
    };
    let text = str::from_utf8(bytes).map_err(|_| bad(1, "is no journal of an experiment"))?;
    let mut lines = text.lines().enumerate();
    let Some((_, first)) = lines.next() else {
        return Ok(Vec::new());
    };
    let found: Header =
        serde_json::from_str(first).map_err(|_| bad(1, "is no journal of an experiment"))?;
    if let Some(difference) = found.difference(header) {
        let finished = text.lines().count() - 1;
        return Err(bad(
            1,
            &format!("{difference}, and {finished} runs are finished"),
        ));
    }
    let mut rows: Vec<RunRow> = Vec::new();
    let mut is_known = vec![false; header.runs];
    for (index, line) in lines {
        let row: RunRow = serde_json::from_str(line)
            .map_err(|error| bad(index + 1, &format!("is damaged ({error})")))?;
        match is_known.get_mut(row.run) {
            Some(known) if !*known => {
                *known = true;
                rows.push(row);
            }
            Some(_) => {}
            None => return Err(bad(index + 1, "is of a run that the grid does not have")),
        }
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::experiment::row::RowEnd;

    fn row(run: usize) -> RunRow {
        RunRow {
            simulated_s: 0.1 + run as f64,
            ..RunRow::without_figures(run, RowEnd::Finished, String::new())
        }
    }

    fn open(
        folder: &Path,
        hash: u64,
        mode: JournalMode,
    ) -> Result<(Journal, Vec<RunRow>), CliError> {
        Journal::open(folder, &Header::new(hash, 10), mode)
    }

    #[test]
    fn finished_runs_come_back_and_a_half_written_line_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let (mut journal, rows) = open(folder.path(), 7, JournalMode::Any).unwrap();
        assert!(rows.is_empty());
        for run in [3, 1, 3] {
            journal.record(&row(run)).unwrap();
        }
        journal.file.write_all(br#"{"run":5,"end":"fin"#).unwrap();
        drop(journal);
        let (mut journal, rows) = open(folder.path(), 7, JournalMode::Resume).unwrap();
        assert_eq!(rows, [row(3), row(1)]);
        journal.record(&row(6)).unwrap();
        drop(journal);
        assert_eq!(
            open(folder.path(), 7, JournalMode::Any).unwrap().1,
            [row(3), row(1), row(6)]
        );
    }

    #[test]
    fn another_experiment_is_refused_with_what_to_do_and_fresh_throws_it_away() {
        let folder = tempfile::tempdir().unwrap();
        open(folder.path(), 7, JournalMode::Any)
            .unwrap()
            .0
            .record(&row(2))
            .unwrap();
        let error = open(folder.path(), 8, JournalMode::Any).unwrap_err();
        let text = error.to_string();
        assert_eq!(error.exit_code(), 2);
        assert!(
            text.contains("has changed")
                && text.contains("1 runs are finished")
                && text.contains("--fresh"),
            "{text}"
        );
        assert!(
            open(folder.path(), 8, JournalMode::Fresh)
                .unwrap()
                .1
                .is_empty()
        );
        assert!(
            open(folder.path(), 8, JournalMode::Resume)
                .unwrap()
                .1
                .is_empty()
        );
    }

    #[test]
    fn a_journal_with_other_columns_is_refused_before_its_rows_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let header = serde_json::to_string(&Header::new(7, 10)).unwrap();
        let old = header.replace(
            &format!("\"experiment_journal\":{FORM}"),
            "\"experiment_journal\":1",
        );
        assert_ne!(old, header);
        let text = format!("{old}\n{{\"run\":2}}\n");
        fs::write(folder.path().join(JOURNAL), &text).unwrap();
        let error = open(folder.path(), 7, JournalMode::Any).unwrap_err();
        let words = error.to_string();
        assert_eq!(error.exit_code(), 2);
        assert!(
            words.contains("other columns (form 1") && words.contains("--fresh"),
            "{words}"
        );
        let kept = fs::read_to_string(folder.path().join(JOURNAL)).unwrap();
        assert_eq!(kept, text);
    }

    #[test]
    fn a_journal_killed_in_its_first_line_begins_anew() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(JOURNAL), b"{\"experiment_jour").unwrap();
        open(folder.path(), 7, JournalMode::Any)
            .unwrap()
            .0
            .record(&row(4))
            .unwrap();
        assert_eq!(
            open(folder.path(), 7, JournalMode::Any).unwrap().1,
            [row(4)]
        );
    }

    #[test]
    fn what_is_no_journal_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(JOURNAL);
        for content in ["my diary\n", "\u{0}\u{1}\n"] {
            fs::write(&path, content).unwrap();
            assert!(
                open(folder.path(), 7, JournalMode::Any)
                    .unwrap_err()
                    .to_string()
                    .contains("is no journal")
            );
            assert_eq!(fs::read_to_string(&path).unwrap(), content);
        }
        let resumed = open(&folder.path().join("none"), 7, JournalMode::Resume).unwrap_err();
        assert!(
            resumed.to_string().contains("leave out --resume"),
            "{resumed}"
        );
        assert!(!folder.path().join("none").exists());
    }

    #[test]
    fn a_damaged_line_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let (mut journal, _) = open(folder.path(), 7, JournalMode::Any).unwrap();
        journal.file.write_all(b"{\"run\":\n").unwrap();
        drop(journal);
        assert!(
            open(folder.path(), 7, JournalMode::Any)
                .unwrap_err()
                .to_string()
                .contains(":2: is damaged")
        );
        let (mut journal, _) = open(folder.path(), 7, JournalMode::Fresh).unwrap();
        journal.record(&row(10)).unwrap();
        drop(journal);
        assert!(
            open(folder.path(), 7, JournalMode::Any)
                .unwrap_err()
                .to_string()
                .contains("does not have")
        );
    }

    #[test]
    fn two_at_a_time_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let held = open(folder.path(), 7, JournalMode::Any).unwrap();
        assert!(
            open(folder.path(), 7, JournalMode::Fresh)
                .unwrap_err()
                .to_string()
                .contains("another program")
        );
        drop(held);
    }
}
