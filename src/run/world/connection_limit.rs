//! How many connections there are, so that there are never too many, and that the last words of the world are written
//! before its process ends.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Counts connections against the most that there may be.
#[derive(Debug)]
pub(super) struct ConnectionLimit {
    most: usize,
    count: Mutex<usize>,
    changed: Condvar,
}

impl ConnectionLimit {
    /// Makes a limit of so many connections.
    pub(super) fn new(most: usize) -> ConnectionLimit {
        ConnectionLimit {
            most,
            count: Mutex::new(0),
            changed: Condvar::new(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, usize> {
        self.count.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns whether there are more than there may be.
    pub(super) fn is_exceeded(&self) -> bool {
        *self.lock() > self.most
    }

    /// Waits until all have ended, but no longer than this.
    pub(super) fn wait_for_end(&self, longest: Duration) {
        // Whoever is still there then is left behind: the process ends anyway.
        let _ = self
            .changed
            .wait_timeout_while(self.lock(), longest, |count| *count > 0);
    }
}

/// One connection that is counted, for as long as it lives.
#[derive(Debug)]
pub(super) struct CountedConnection(Arc<ConnectionLimit>);

impl CountedConnection {
    /// Counts one more.
    pub(super) fn begin(limit: &Arc<ConnectionLimit>) -> CountedConnection {
        *limit.lock() += 1;
        CountedConnection(limit.clone())
    }
}

impl Drop for CountedConnection {
    fn drop(&mut self) {
        *self.0.lock() -= 1;
        self.0.changed.notify_all();
    }
}
