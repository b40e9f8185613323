//! Reading whole text files, with a limit and an error that names the file.

use std::fs::{File, Metadata};
use std::io::{self, Read};
use std::path::Path;

use super::error::CliError;
#[cfg(feature = "net")]
use crate::mavlink::signing::{KEY_BYTES, key_from_hex};

/// The largest file that any command reads, bytes.
pub(super) const LIMIT_BYTES: u64 = 256 << 20;

/// Refuses what is there and is no regular file: nobody may ever write into a named pipe. What is not there, and a folder,
/// are left to those who read it.
///
/// # Errors
/// A pipe, a socket or a device.
pub(super) fn check_regular(path: &Path) -> Result<(), CliError> {
    let is_other = |found: Metadata| !found.is_file() && !found.is_dir();
    if std::fs::metadata(path).is_ok_and(is_other) {
        return Err(CliError::Input {
            path: path.to_owned(),
            reason: "is no regular file, but a pipe, a socket or a device".to_owned(),
        });
    }
    Ok(())
}

/// Returns the text of a file.
///
/// # Errors
///
/// When it cannot be read, is larger than [`LIMIT_BYTES`], or is no UTF-8.
pub(super) fn text(path: &Path) -> Result<String, CliError> {
    let unreadable = |source| CliError::Read {
        path: path.to_owned(),
        source,
    };
    let file = File::open(path).map_err(unreadable)?;
    if file.metadata().map_err(unreadable)?.is_dir() {
        return Err(unreadable(io::Error::from(io::ErrorKind::IsADirectory)));
    }
    let mut bytes = Vec::new();
    file.take(LIMIT_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(unreadable)?;
    text_of(path, bytes)
}

/// Returns what was read as text, unless there is too much of it or it is none.
fn text_of(path: &Path, bytes: Vec<u8>) -> Result<String, CliError> {
    let unusable = |reason: String| CliError::Input {
        path: path.to_owned(),
        reason,
    };
    if bytes.len() as u64 > LIMIT_BYTES {
        return Err(unusable(format!(
            "the file is too large; at most {LIMIT_BYTES} bytes are read"
        )));
    }
    String::from_utf8(bytes).map_err(|error| {
        let good = error.utf8_error().valid_up_to();
        let line = 1 + error.as_bytes()[..good]
            .iter()
            .filter(|byte| **byte == b'\n')
            .count();
        CliError::Line {
            path: path.to_owned(),
            line,
            reason: "is no text (UTF-8 is expected)".to_owned(),
        }
    })
}

/// Returns the key of MAVLink 2 signatures that a file holds.
///
/// # Errors
/// The file cannot be read, or holds no key.
#[cfg(feature = "net")]
pub(super) fn signing_key(path: &Path) -> Result<[u8; KEY_BYTES], CliError> {
    key_from_hex(&text(path)?).ok_or_else(|| CliError::Input {
        path: path.to_owned(),
        reason: "holds no key; expected 64 hexadecimal digits".to_owned(),
    })
}

/// The name that stands for standard input.
pub(super) const STANDARD_INPUT: &str = "-";

/// Returns the text that comes from standard input, up to its end.
///
/// # Errors
/// As for [`text`].
pub(super) fn standard_input() -> Result<String, CliError> {
    let path = Path::new(STANDARD_INPUT);
    let mut bytes = Vec::new();
    let unreadable = |source| CliError::Read {
        path: path.to_owned(),
        source,
    };
    io::stdin()
        .take(LIMIT_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(unreadable)?;
    text_of(path, bytes)
}

/// Returns a loader for a file and all that is named in it, by names such as [`shown`] gives of the file.
///
/// Configurations name files in UTF-8, but the folder in which they lie may have any name: it is put in the place
/// of what was shown of it.
pub(super) fn around(file: &Path) -> impl FnMut(&str) -> Result<String, String> + Send + use<> {
    let file = file.to_owned();
    let folder = file.parent().unwrap_or(Path::new("")).to_owned();
    let (shown_file, shown_folder) = (shown(&file), format!("{}/", shown(&folder)));
    move |name| {
        if name == shown_file {
            return named(&file);
        }
        match name.strip_prefix(&shown_folder) {
            Some(rest) if folder != Path::new("") => regular(&folder.join(rest)),
            Some(_) | None => regular(Path::new(name)),
        }
    }
}

/// Returns the name of a file as it is shown in messages and handed to `config` and `scene`.
pub(super) fn shown(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

/// Returns the text of a regular file, or only the reason why not.
fn regular(path: &Path) -> Result<String, String> {
    let read = check_regular(path).and_then(|()| text(path));
    read.map_err(reason_of)
}

/// Returns the text of a file that a configuration names, or only the reason why not.
///
/// # Errors
///
/// As for [`text`], without the name of the file.
pub(super) fn named(path: &Path) -> Result<String, String> {
    text(path).map_err(reason_of)
}

/// Returns what is wrong with a file without its name.
fn reason_of(error: CliError) -> String {
    match error {
        CliError::Read { source, .. } => source.to_string(),
        CliError::Input { reason, .. } => reason,
        CliError::Line { line, reason, .. } => format!("line {line}: {reason}"),
        #[cfg(feature = "net")]
        CliError::Store(_) => error.to_string(),
        CliError::Usage(_)
        | CliError::Config(_)
        | CliError::Several(_)
        | CliError::Image(_)
        | CliError::Write { .. }
        | CliError::Mission(_)
        | CliError::Stopped(_)
        | CliError::Swarm(_)
        | CliError::Differs(_)
        | CliError::NotNow(_)
        | CliError::Fault(_) => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(content: &[u8], expected: Result<&str, &str>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        std::fs::write(&path, content).unwrap();
        let got = named(&path);
        assert_eq!(got, expected.map(str::to_owned).map_err(str::to_owned));
    }

    #[test]
    fn only_text_is_read() {
        check(b"one\ntwo", Ok("one\ntwo"));
        check(
            b"one\ntw\xff",
            Err("line 2: is no text (UTF-8 is expected)"),
        );
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_regular_file_is_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        let _socket = std::os::unix::net::UnixListener::bind(&path).unwrap();
        let mut loader = around(&folder.path().join("any.toml"));
        let refused = loader(&shown(&path)).unwrap_err();
        assert!(refused.starts_with("is no regular file"), "{refused}");
        assert!(check_regular(&path).is_err());
        for allowed in [folder.path().to_owned(), folder.path().join("gone")] {
            assert!(check_regular(&allowed).is_ok());
        }
    }

    #[test]
    fn a_folder_and_a_missing_file_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = text(folder.path()).unwrap_err().to_string();
        assert!(
            error.starts_with(folder.path().to_str().unwrap()) && error.contains("directory"),
            "{error}"
        );
        let error = text(&folder.path().join("gone")).unwrap_err().to_string();
        assert!(
            error.contains("gone: cannot be read: No such file"),
            "{error}"
        );
    }
}
