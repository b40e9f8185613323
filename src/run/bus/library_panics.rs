//! Panics in the threads of the bus library. Damaged bytes on an unprotected link have made one of them panic; what the thread
//! was to do is left undone then, without a word to whoever uses the session, and what it has left behind makes later calls
//! of the session panic too, on whatever thread. They are counted, so that the session can be opened anew.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crate::run::mailbox::Troubles;
use crate::time::Time;

/// How the library names its threads, each with a number behind it.
const THREADS: [&str; 5] = ["app-", "acc-", "tx-", "rx-", "net-"];

/// Between two openings because of panics, and how long one is told as a trouble.
const PANICS_EVERY: Duration = Duration::from_secs(2);
const PANICS_TOLD_FOR: Duration = Duration::from_secs(60);
/// Under which name it is told.
const LIBRARY: &str = "bus library";

static COUNT: AtomicU64 = AtomicU64::new(0);
static WATCHING: Once = Once::new();

/// Begins to count; what a panic prints stays as it is.
pub(super) fn watch() {
    WATCHING.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if std::thread::current().name().is_some_and(is_of_library) {
                COUNT.fetch_add(1, Ordering::Relaxed);
            }
            before(panic);
        }));
    });
}

/// Calls the library, and counts its panic as one of its own threads'; `None` = it has panicked.
pub(super) fn guarded<T>(call: impl FnOnce() -> T) -> Option<T> {
    let result = catch_unwind(AssertUnwindSafe(call));
    if result.is_err() {
        COUNT.fetch_add(1, Ordering::Relaxed);
    }
    result.ok()
}

/// Returns how many there were in this process.
pub(super) fn count() -> u64 {
    COUNT.load(Ordering::Relaxed)
}

/// Which panics of the library the keeper has answered.
pub(super) struct PanicsSeen {
    count: u64,
    /// When it answered last.
    answered: Option<Time>,
}

impl Default for PanicsSeen {
    /// What was before this session concerns another one.
    fn default() -> PanicsSeen {
        PanicsSeen {
            count: count(),
            answered: None,
        }
    }
}

impl PanicsSeen {
    /// Returns whether the session is to be opened anew, and tells of it for a while.
    pub(super) fn look(&mut self, now: Time, troubles: &Troubles) -> bool {
        let waits_for = |span| self.answered.is_some_and(|at| now.since(at) < span);
        let count = count();
        if count == self.count || waits_for(PANICS_EVERY) {
            if self.answered.is_some() && !waits_for(PANICS_TOLD_FOR) {
                self.answered = None;
                troubles.clear(LIBRARY);
            }
            return false;
        }
        (self.count, self.answered) = (count, Some(now));
        troubles.raise(
            LIBRARY,
            format!("a thread of it panicked ({count} so far): the session is opened anew"),
        );
        true
    }
}

fn is_of_library(thread: &str) -> bool {
    let number = THREADS.iter().find_map(|name| thread.strip_prefix(name));
    number.is_some_and(|number| {
        !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_of_the_library_is_counted_and_ours_are_not() {
        watch();
        let panic_in = |name: &str| {
            let thread = std::thread::Builder::new().name(name.to_owned());
            assert!(
                thread
                    .spawn(|| panic!("as it shall"))
                    .unwrap()
                    .join()
                    .is_err()
            );
            count()
        };
        let before = count();
        assert_eq!(panic_in("rx-0"), before + 1);
        assert_eq!((guarded(|| 5), count()), (Some(5), before + 1));
        assert_eq!(
            (guarded(|| panic!("as it shall")), count()),
            (None::<()>, before + 2)
        );
        let before = before + 1;
        for ours in ["bus", "vehicle", "rx-", "rx-x", "app"] {
            assert_eq!(panic_in(ours), before + 1, "{ours}");
        }
    }
}
