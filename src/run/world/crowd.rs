//! How many connections there are, so that there are never too many, and that the last words of the world are written
//! before its process ends.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Counts connections.
#[derive(Debug, Default)]
pub struct Crowd {
    count: Mutex<usize>,
    changed: Condvar,
}

impl Crowd {
    fn lock(&self) -> MutexGuard<'_, usize> {
        self.count.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives how many there are.
    pub fn count(&self) -> usize {
        *self.lock()
    }

    /// Waits until all have ended, but no longer than this.
    pub fn wait_for_end(&self, longest: Duration) {
        // Whoever is still there then is left behind: the process ends anyway.
        let _ = self.changed.wait_timeout_while(self.lock(), longest, |count| *count > 0);
    }
}

/// One connection, for as long as it lives.
#[derive(Debug)]
pub struct Inside(Arc<Crowd>);

impl Inside {
    /// Counts one more.
    pub fn enter(crowd: &Arc<Crowd>) -> Inside {
        *crowd.lock() += 1;
        Inside(crowd.clone())
    }
}

impl Drop for Inside {
    fn drop(&mut self) {
        *self.0.lock() -= 1;
        self.0.changed.notify_all();
    }
}
