//! Why a command ends, and with which exit code: 1 for a fault or a mission that failed, 2 for bad
//! usage or input (0, done, is no error). Says nothing to the terminal itself.

use std::io;
use std::path::PathBuf;

use super::image::ImageError;
use super::stop::STOPPED;
use crate::config::Problems;

/// Why a command did not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// The command was used in a way that makes no sense.
    #[error("{0}")]
    Usage(String),
    /// Configuration files are wrong; one line per mistake.
    #[error("{0}")]
    Config(#[from] Problems),
    /// A file that is needed cannot be read.
    #[error("{}: cannot be read: {source}; expected a file that can be read", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file was read and makes no sense.
    #[error("{}: {reason}", path.display())]
    Input {
        /// The file.
        path: PathBuf,
        /// What is wrong, with its place in the file, and what was expected.
        reason: String,
    },
    /// A line of a file makes no sense.
    #[error("{}:{line}: {reason}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// What is wrong, and what was expected.
        reason: String,
    },
    /// Several files are wrong; one line per mistake.
    #[error("{}", lines(.0))]
    Several(Vec<CliError>),
    /// An image cannot be made of recordings.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A result cannot be written where it was asked for.
    #[error("{}: cannot be written: {source}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A store cannot be opened, read or written.
    #[cfg(feature = "net")]
    #[error(transparent)]
    Store(#[from] crate::store::StoreError),
    /// The mission did not reach its end.
    #[error("the mission failed: {0}")]
    Mission(String),
    /// Somebody has asked for the end before there was one.
    #[error("{0}")]
    Stopped(String),
    /// The swarm is not as it was asked for.
    #[error("{0}")]
    Swarm(String),
    /// A recording replayed says something else.
    #[error("the replay differs: {0}")]
    Differs(String),
    /// A node cannot begin now; a later start may go well.
    #[error("cannot begin now: {0}")]
    NotNow(String),
    /// The program itself is at fault.
    #[error("a fault inside the program: {0}")]
    Fault(String),
}

impl CliError {
    /// Makes the error of a run that did not end well, as its report says why.
    pub(super) fn of_run(reason: String) -> CliError {
        match reason == STOPPED {
            true => CliError::Stopped(reason),
            false => CliError::Mission(reason),
        }
    }

    /// Makes the error of an answer that cannot be written.
    pub fn stdout(source: io::Error) -> CliError {
        CliError::Write {
            path: "standard output".into(),
            source,
        }
    }

    /// Returns the exit code of the program: 1 or 2, as above.
    pub fn exit_code(&self) -> u8 {
        match self {
            CliError::Mission(_)
            | CliError::Stopped(_)
            | CliError::Swarm(_)
            | CliError::Differs(_)
            | CliError::NotNow(_)
            | CliError::Fault(_) => 1,
            #[cfg(feature = "net")]
            CliError::Store(_) => 2,
            CliError::Usage(_)
            | CliError::Config(_)
            | CliError::Read { .. }
            | CliError::Input { .. }
            | CliError::Line { .. }
            | CliError::Several(_)
            | CliError::Image(_)
            | CliError::Write { .. } => 2,
        }
    }
}

fn lines(errors: &[CliError]) -> String {
    errors
        .iter()
        .map(CliError::to_string)
        .collect::<Vec<_>>()
        .join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(error: CliError, text: &str, code: u8) {
        assert_eq!(
            (error.to_string().as_str(), error.exit_code()),
            (text, code)
        );
    }

    #[test]
    fn an_error_names_the_file_and_tells_input_from_faults() {
        let missing = || io::Error::from(io::ErrorKind::NotFound);
        let (path, reason) = (
            PathBuf::from("a/b.csv"),
            "line 3: rssi_dbm = 300".to_owned(),
        );
        check(
            CliError::Read {
                path: path.clone(),
                source: missing(),
            },
            "a/b.csv: cannot be read: entity not found; expected a file that can be read",
            2,
        );
        check(
            CliError::Write {
                path: path.clone(),
                source: missing(),
            },
            "a/b.csv: cannot be written: entity not found",
            2,
        );
        check(
            CliError::Input { path, reason },
            "a/b.csv: line 3: rssi_dbm = 300",
            2,
        );
        check(
            CliError::Mission("time is up".to_owned()),
            "the mission failed: time is up",
            1,
        );
        let stopped = CliError::Stopped("it was asked to stop".to_owned());
        check(stopped, "it was asked to stop", 1);
        let several = vec![
            CliError::Usage("one".to_owned()),
            CliError::Usage("two".to_owned()),
        ];
        check(CliError::Several(several), "one\ntwo", 2);
    }
}
