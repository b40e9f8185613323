//! The thread that writes a vehicle's memory: the driver behind `Effect::Remember`.
//!
//! Whoever hands it something never waits. What is to be remembered meanwhile joins, and is written at once; then it is
//! told as `Event::Remembered`. When the disk cannot be written that is told as well, with what is on disk still, and it is
//! tried again every second: the actors decide what may be done all the same. It writes only what is news.

use std::io;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use super::file::MemoryFile;
use crate::node::{Event, Remembered, VehicleMemory};
use crate::store::lost_thread;

/// A disk in trouble is tried again this often.
const RETRY: Duration = Duration::from_secs(1);

/// A vehicle's memory on a thread of its own; it ends, and tries a last time to write what it has, when it is dropped.
#[derive(Debug)]
pub struct MemoryDriver {
    wanted: Option<Sender<VehicleMemory>>,
    trouble: Arc<Mutex<Option<String>>>,
    thread: Option<JoinHandle<()>>,
}

impl MemoryDriver {
    /// Starts the thread. `known` is what was read of the file; `tell` is given what the vehicle's actors are to be told.
    ///
    /// # Errors
    /// No thread can be started.
    pub fn start(
        file: MemoryFile,
        known: VehicleMemory,
        tell: impl FnMut(Event) + Send + 'static,
    ) -> io::Result<MemoryDriver> {
        let (sender, receiver) = channel();
        let trouble = Arc::<Mutex<Option<String>>>::default();
        let state = Remembered {
            on_disk: known,
            tried: known,
        };
        let writer = Writer {
            file,
            state,
            trouble: trouble.clone(),
            tell,
        };
        let thread = std::thread::Builder::new()
            .name("memory".to_owned())
            .spawn(move || writer.run(&receiver))?;
        Ok(MemoryDriver {
            wanted: Some(sender),
            trouble,
            thread: Some(thread),
        })
    }

    /// Remembers this as well; how it stands then is told.
    pub fn remember(&self, memory: VehicleMemory) {
        // The thread lives as long as this, unless it panicked: then nothing is told, and no start is obeyed.
        let _ = self.wanted.as_ref().map(|wanted| wanted.send(memory));
    }

    /// Returns why the memory is not on disk just now.
    pub fn trouble(&self) -> Option<String> {
        lost_thread(self.thread.as_ref()).or_else(|| lock(&self.trouble).clone())
    }
}

impl Drop for MemoryDriver {
    fn drop(&mut self) {
        self.wanted = None;
        // A thread that panicked has written what it could; there is nobody left to tell.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn lock(trouble: &Mutex<Option<String>>) -> MutexGuard<'_, Option<String>> {
    trouble.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The thread's side.
struct Writer<T> {
    file: MemoryFile,
    state: Remembered,
    trouble: Arc<Mutex<Option<String>>>,
    tell: T,
}

impl<T: FnMut(Event)> Writer<T> {
    fn run(mut self, wanted: &Receiver<VehicleMemory>) {
        loop {
            match wanted.recv_timeout(RETRY) {
                Ok(memory) => {
                    let more = wanted.try_iter().fold(memory, VehicleMemory::join);
                    self.state.tried = self.state.tried.join(more);
                    self.write();
                    (self.tell)(Event::Remembered(self.state));
                }
                Err(RecvTimeoutError::Timeout) => {
                    if self.write() {
                        (self.tell)(Event::Remembered(self.state));
                    }
                }
                Err(RecvTimeoutError::Disconnected) => {
                    self.write();
                    return;
                }
            }
        }
    }

    /// Writes what is not on disk yet; returns whether something was written.
    fn write(&mut self) -> bool {
        if self.state.on_disk == self.state.tried {
            return false;
        }
        match self.file.write(&self.state.tried) {
            Ok(()) => {
                self.state.on_disk = self.state.tried;
                *lock(&self.trouble) = None;
                true
            }
            Err(error) => {
                *lock(&self.trouble) = Some(format!(
                    "{}: cannot be written: {error}; no start and no plan of a new lease is obeyed until it can be",
                    self.file.path().display()
                ));
                false
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::file::tests::memory;
    use super::*;
    use std::path::Path;

    fn start(path: &Path) -> (MemoryDriver, Receiver<Event>) {
        let file = MemoryFile::at(path.to_owned());
        let known = file.read().unwrap();
        let (sender, receiver) = channel();
        let driver =
            MemoryDriver::start(file, known, move |event| drop(sender.send(event))).unwrap();
        (driver, receiver)
    }

    fn next(events: &Receiver<Event>) -> Remembered {
        match events.recv_timeout(Duration::from_secs(20)).unwrap() {
            Event::Remembered(remembered) => remembered,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn what_is_told_is_on_disk_and_what_is_known_is_not_written_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("memory");
        let file = MemoryFile::at(path.clone());
        let (driver, events) = start(&path);
        driver.remember(memory(5, 7));
        let told = next(&events);
        assert_eq!((told.on_disk, told.tried), (memory(5, 7), memory(5, 7)));
        assert_eq!(file.read().unwrap(), memory(5, 7));
        std::fs::remove_file(&path).unwrap();
        driver.remember(memory(5, 6));
        assert_eq!(next(&events).on_disk, memory(5, 7), "it only grows");
        assert!(!path.exists(), "and is not written for nothing");
        driver.remember(memory(6, 1));
        drop(driver);
        assert_eq!(file.read().unwrap(), memory(6, 1));
    }

    #[test]
    fn a_disk_in_trouble_is_told_shown_and_tried_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("later/memory");
        let (driver, events) = start(&path);
        driver.remember(memory(5, 7));
        let told = next(&events);
        assert_eq!(
            (told.on_disk, told.tried),
            (VehicleMemory::default(), memory(5, 7))
        );
        let trouble = driver.trouble().unwrap();
        assert!(
            trouble.starts_with(&path.display().to_string()) && trouble.contains("no start"),
            "{trouble}"
        );
        std::fs::create_dir(folder.path().join("later")).unwrap();
        assert_eq!(next(&events).on_disk, memory(5, 7), "by itself");
        assert_eq!(driver.trouble(), None);
    }
}
