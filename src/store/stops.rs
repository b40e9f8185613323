//! The emergency stops that a node knows, on disk: a small file, replaced as a whole by a thread of its own, so that no brake
//! ever waits for a disk. What is written is the newest that was handed over; what joins what is decided by
//! [`crate::stops`].
//!
//! ```text
//!   tomoswarm emergency stops 1
//!   open 3f2a9c01 all operator 1
//!   open 7bb01234 vehicle 3 operator 1
//!   lifted 0a0b0c0d
//!   check 9ae16a3b2f90404f
//! ```
//!
//! A folder without the file is that of a node that knows no stop. Whatever else is found is refused and left as it is: a node
//! that cannot know whether it must stand does not begin.

use std::io;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use tomoswarm_proto::{
    EmergencyName, EmergencyStop, Message, OpenStops, OperatorId, StopScope, VehicleId,
};

use super::checked_file::{CheckedFile, CheckedFileError};
use super::{lost_thread, replace};

/// What the file is.
const FILE: CheckedFile = CheckedFile {
    title: "tomoswarm emergency stops",
    version: 1,
    longest: 16_384,
    holds: "the emergency stops that this node knows",
    remedy: "remove it when no emergency stop is open (`tomoswarm status` shows them)",
};
/// A disk in trouble is tried again this often.
const RETRY: Duration = Duration::from_secs(1);

/// The stops of a node on disk.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct StopsFile {
    path: PathBuf,
}

impl StopsFile {
    /// Names the file; nothing is read or written yet.
    pub fn at(path: PathBuf) -> StopsFile {
        StopsFile { path }
    }

    /// Reads it; a node without the file knows no stop.
    ///
    /// # Errors
    /// It cannot be read, or is not what was written.
    pub fn read(&self) -> Result<OpenStops, CheckedFileError> {
        Ok(FILE.read(&self.path, parse)?.unwrap_or_default())
    }

    /// Writes it; after a power cut it is as before, or as written now.
    ///
    /// # Errors
    /// The system does not let it be written.
    pub fn write(&self, standing: &OpenStops) -> io::Result<()> {
        replace(&self.path, &text(standing))
    }
}

fn text(standing: &OpenStops) -> String {
    let open = |stop: &EmergencyStop| {
        let scope = match stop.scope {
            StopScope::All => "all".to_owned(),
            StopScope::One(vehicle) => format!("vehicle {vehicle}"),
        };
        format!("open {:08x} {scope} operator {}\n", stop.name.0, stop.by.0)
    };
    let lifted = |name: &EmergencyName| format!("lifted {:08x}\n", name.0);
    let lines = standing
        .open
        .iter()
        .map(open)
        .chain(standing.lifted.iter().map(lifted));
    FILE.seal(&lines.collect::<String>())
}

fn parse(lines: &str) -> Result<OpenStops, String> {
    let mut standing = OpenStops::default();
    for line in lines.lines() {
        let wrong = || format!("`{line}` is no line of version {}", FILE.version);
        let words: Vec<&str> = line.split(' ').collect();
        let name = |word: &str| {
            u32::from_str_radix(word, 16)
                .map(EmergencyName)
                .map_err(|_| wrong())
        };
        let by = |word: &str| word.parse().map(OperatorId).map_err(|_| wrong());
        match words[..] {
            ["open", drawn, "all", "operator", operator] => {
                let stop = EmergencyStop {
                    name: name(drawn)?,
                    scope: StopScope::All,
                    by: by(operator)?,
                };
                standing.open.push(stop);
            }
            ["open", drawn, "vehicle", vehicle, "operator", operator] => {
                let scope = StopScope::One(VehicleId(vehicle.parse().map_err(|_| wrong())?));
                standing.open.push(EmergencyStop {
                    name: name(drawn)?,
                    scope,
                    by: by(operator)?,
                });
            }
            ["lifted", drawn] => standing.lifted.push(name(drawn)?),
            _ => return Err(wrong()),
        }
    }
    let is_sound = Message::Standing(standing.clone()).check();
    is_sound.map_err(|expected| format!("expected: {expected}"))?;
    Ok(standing)
}

/// The stops of a node on a thread of its own; it ends, and tries a last time to write what it has, when it is dropped.
#[derive(Debug)]
pub struct StopsDriver {
    wanted: Option<Sender<OpenStops>>,
    trouble: Arc<Mutex<Option<String>>>,
    thread: Option<JoinHandle<()>>,
}

impl StopsDriver {
    /// Starts the thread.
    ///
    /// # Errors
    /// No thread can be started.
    pub fn start(file: StopsFile) -> io::Result<StopsDriver> {
        let (sender, receiver) = channel();
        let trouble = Arc::<Mutex<Option<String>>>::default();
        let shown = trouble.clone();
        let thread = std::thread::Builder::new()
            .name("stops".to_owned())
            .spawn(move || keep(&file, &receiver, &shown))?;
        Ok(StopsDriver {
            wanted: Some(sender),
            trouble,
            thread: Some(thread),
        })
    }

    /// Keeps these in place of what was kept before.
    pub fn keep(&self, standing: &OpenStops) {
        // The thread lives as long as this, unless it panicked: then what is open is still kept by every other node.
        let _ = self
            .wanted
            .as_ref()
            .map(|wanted| wanted.send(standing.clone()));
    }

    /// Returns why they are not on disk just now.
    pub fn trouble(&self) -> Option<String> {
        lost_thread(self.thread.as_ref()).or_else(|| lock(&self.trouble).clone())
    }
}

impl Drop for StopsDriver {
    fn drop(&mut self) {
        self.wanted = None;
        // A thread that panicked has written what it could; there is nobody left to tell.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn lock(trouble: &Mutex<Option<String>>) -> MutexGuard<'_, Option<String>> {
    trouble.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Writes whatever is wanted, the newest of what waits, until nobody wants anything any more.
fn keep(file: &StopsFile, wanted: &Receiver<OpenStops>, trouble: &Mutex<Option<String>>) {
    let mut unwritten: Option<OpenStops> = None;
    loop {
        let received = match unwritten {
            Some(_) => wanted.recv_timeout(RETRY),
            None => wanted.recv().map_err(|_| RecvTimeoutError::Disconnected),
        };
        let is_over = received == Err(RecvTimeoutError::Disconnected);
        let newest = received.ok().into_iter().chain(wanted.try_iter()).last();
        unwritten = newest.or(unwritten);
        if let Some(standing) = &unwritten {
            match file.write(standing) {
                Ok(()) => (unwritten, *lock(trouble)) = (None, None),
                Err(error) => {
                    *lock(trouble) = Some(format!(
                        "{}: cannot be written: {error}; the emergency stops that are open would be forgotten by a restart",
                        file.path.display()
                    ));
                }
            }
        }
        if is_over {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn known() -> OpenStops {
        let stop = |name, scope| EmergencyStop {
            name: EmergencyName(name),
            scope,
            by: OperatorId(1),
        };
        OpenStops {
            open: vec![
                stop(0x42, StopScope::All),
                stop(0x3f2a_9c01, StopScope::One(VehicleId(3))),
            ],
            lifted: vec![EmergencyName(u32::MAX), EmergencyName(0x1_0000)],
        }
    }

    #[test]
    fn what_is_written_is_read_and_a_folder_without_it_knows_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let file = StopsFile::at(folder.path().join("stops"));
        assert_eq!(file.read().unwrap(), OpenStops::default());
        for standing in [known(), OpenStops::default()] {
            file.write(&standing).unwrap();
            assert_eq!(file.read().unwrap(), standing);
        }
    }

    #[test]
    fn what_is_not_as_it_was_written_is_refused_with_file_and_reason() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stops");
        let file = StopsFile::at(path.clone());
        let check = |bytes: &[u8], part: &str| {
            fs::write(&path, bytes).unwrap();
            let error = file.read().unwrap_err().to_string();
            assert!(
                error.starts_with(&path.display().to_string()) && error.contains(part),
                "{error}"
            );
            assert_eq!(fs::read(&path).unwrap(), bytes, "it is left as it is");
        };
        let whole = text(&known());
        check(b"", "it is empty");
        check(&whole.as_bytes()[..whole.len() - 3], "its end is missing");
        check(
            whole.replace("vehicle 3", "vehicle 4").as_bytes(),
            "at its end",
        );
        check(
            FILE.seal("open 3f2a9c01 some operator 1\n").as_bytes(),
            "`open 3f2a9c01 some operator 1` is no line",
        );
        check(
            FILE.seal("lifted xyz\n").as_bytes(),
            "`lifted xyz` is no line",
        );
        let ten: String = (0..10)
            .map(|number| format!("open 0001000{number} all operator 1\n"))
            .collect();
        check(FILE.seal(&ten).as_bytes(), "at most 9 stops");
        let newer = CheckedFile { version: 2, ..FILE }.seal("");
        check(newer.as_bytes(), "written by a newer tomoswarm (version 2");
        check(&vec![b'x'; 20_000], "20000 bytes");
        check(&[0xff, 0xfe], "expected text");
    }

    #[test]
    fn the_newest_is_on_disk_when_the_driver_ends_and_a_disk_in_trouble_is_tried_again() {
        let folder = tempfile::tempdir().unwrap();
        let file = StopsFile::at(folder.path().join("later/stops"));
        let driver = StopsDriver::start(file.clone()).unwrap();
        driver.keep(&OpenStops::default());
        driver.keep(&known());
        let began = std::time::Instant::now();
        while driver.trouble().is_none() && began.elapsed() < Duration::from_secs(20) {
            std::thread::sleep(Duration::from_millis(5));
        }
        assert!(driver.trouble().unwrap().contains("cannot be written"));
        fs::create_dir(folder.path().join("later")).unwrap();
        while driver.trouble().is_some() && began.elapsed() < Duration::from_secs(20) {
            std::thread::sleep(Duration::from_millis(20));
        }
        assert_eq!((driver.trouble(), file.read().unwrap()), (None, known()));
        driver.keep(&OpenStops::default());
        drop(driver);
        assert_eq!(file.read().unwrap(), OpenStops::default());
    }
}
