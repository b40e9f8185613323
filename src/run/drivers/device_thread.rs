//! A thread that has a device to itself: it opens it, works with it until it is gone, and opens it anew for ever.
//!
//! ```text
//!   closed ──opened──► open ──gone──► closed
//!     └──── not there, in use: again after 250 ms, then 500 ms, then every second
//! ```
//!
//! What the work is, and with what device, is not known here.

use std::io;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use super::reopening::{LATEST, SOONEST};
use crate::run::mailbox::lock;
use crate::store::lost_thread;

/// A device and its thread, with what both sides of it share; dropping it ends the thread.
pub(super) struct DeviceThread<S> {
    shared: Arc<Shared<S>>,
    thread: Option<JoinHandle<()>>,
}

/// Why a device is closed.
pub(super) struct Gone {
    /// In words.
    pub(super) why: String,
    /// Whether it worked before.
    pub(super) has_worked: bool,
}

/// What the thread and its owner share.
pub(super) struct Shared<S> {
    state: Mutex<State<S>>,
    changed: Condvar,
}

struct State<S> {
    is_ended: bool,
    /// Why the device is closed, while it is.
    trouble: Option<String>,
    /// How often it was opened.
    opened: u64,
    content: S,
}

impl<S: Send + 'static> DeviceThread<S> {
    /// Begins a thread of a name that has a device of a name. A session opens the device, says so ([`Shared::opened`]) and
    /// works until it is gone, or until the end ([`Shared::is_ended`]).
    ///
    /// # Errors
    /// No thread can be started.
    pub(super) fn start(
        name: &str,
        device: String,
        content: S,
        mut session: impl FnMut(&Shared<S>) -> Result<(), Gone> + Send + 'static,
    ) -> io::Result<DeviceThread<S>> {
        let shared = Arc::new(Shared {
            state: Mutex::new(State {
                is_ended: false,
                trouble: Some(format!("{device}: not open yet")),
                opened: 0,
                content,
            }),
            changed: Condvar::new(),
        });
        let seen = shared.clone();
        let thread = std::thread::Builder::new()
            .name(name.to_owned())
            .spawn(move || seen.run(&device, &mut session))?;
        Ok(DeviceThread {
            shared,
            thread: Some(thread),
        })
    }

    /// Returns why the device is closed, or what is wrong with it while it is open; `None` when all is well.
    pub(super) fn trouble(&self) -> Option<String> {
        lost_thread(self.thread.as_ref()).or_else(|| lock(&self.shared.state).trouble.clone())
    }

    /// Looks at what is shared, or changes it and wakes the thread.
    pub(super) fn with<T>(&self, with: impl FnOnce(&mut S) -> T) -> T {
        self.shared.with(with)
    }
}

impl<S> Drop for DeviceThread<S> {
    fn drop(&mut self) {
        lock(&self.shared.state).is_ended = true;
        self.shared.changed.notify_all();
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has ended, too.
            let _ = thread.join();
        }
    }
}

impl<S> Shared<S> {
    /// Returns whether the end has come.
    pub(super) fn is_ended(&self) -> bool {
        lock(&self.state).is_ended
    }

    /// Notes that the device is open.
    pub(super) fn opened(&self) {
        let mut state = lock(&self.state);
        (state.trouble, state.opened) = (None, state.opened + 1);
    }

    /// Looks at what is shared, or changes it and wakes the other side.
    pub(super) fn with<T>(&self, with: impl FnOnce(&mut S) -> T) -> T {
        let found = with(&mut lock(&self.state).content);
        self.changed.notify_all();
        found
    }

    /// Waits until something is there to be taken of what is shared; `None` when the end has come.
    pub(super) fn wait<T>(&self, mut take: impl FnMut(&mut S) -> Option<T>) -> Option<T> {
        let mut state = lock(&self.state);
        while !state.is_ended {
            if let Some(found) = take(&mut state.content) {
                return Some(found);
            }
            state = recovered(self.changed.wait(state));
        }
        None
    }

    /// Waits so long, or until the end.
    pub(super) fn pause(&self, lasts: Duration) {
        let state = lock(&self.state);
        drop(
            self.changed
                .wait_timeout_while(state, lasts, |state| !state.is_ended),
        );
    }

    fn run(&self, device: &str, session: &mut impl FnMut(&Shared<S>) -> Result<(), Gone>) {
        let mut wait = SOONEST;
        while let Err(gone) = session(self) {
            wait = if gone.has_worked { SOONEST } else { wait };
            self.say(device, &gone.why);
            self.pause(wait);
            if self.is_ended() {
                return;
            }
            wait = (wait * 2).min(LATEST);
        }
    }

    /// Says why the device is closed.
    fn say(&self, device: &str, why: &str) {
        let mut state = lock(&self.state);
        state.trouble = Some(match state.opened {
            0 => format!("{device}: {why}"),
            1 => format!("{device}: {why}; opened once before"),
            opened => format!("{device}: {why}; opened {opened} times before"),
        });
    }
}

fn recovered<'a, T>(
    locked: Result<MutexGuard<'a, T>, PoisonError<MutexGuard<'a, T>>>,
) -> MutexGuard<'a, T> {
    locked.unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::*;

    #[test]
    fn a_device_whose_thread_has_ended_is_in_trouble() {
        let session = |shared: &Shared<()>| -> Result<(), Gone> {
            shared.opened();
            panic!("as it shall");
        };
        let device = DeviceThread::start("device", "port".to_owned(), (), session).unwrap();
        let is_told = || {
            let trouble = device.trouble();
            trouble.is_some_and(|trouble| trouble.contains("its thread has ended"))
        };
        let began = Instant::now();
        while !is_told() {
            assert!(began.elapsed() < Duration::from_secs(20));
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}
