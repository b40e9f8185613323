//! How a command learns that it shall end: Ctrl-C, a terminal that closes, or a request of the system (SIGINT,
//! SIGHUP, SIGTERM).
//!
//! The first request lets the command end in order; a second one, half a second later or more, ends the program at once. What
//! is left then is a hidden folder that the next run removes. (A terminal that closes asks twice: the kernel, and its shell.)

#[cfg(feature = "net")]
use std::io::Read;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How a run has ended that was stopped: what its report says, and then the command.
pub(super) const STOPPED: &str =
    "it was asked to stop; the folder holds what was measured until then";

/// Exit code of a program that was ended at once, as shells have it for SIGINT.
const ENDED_AT_ONCE: i32 = 130;

/// Requests this soon after the first one are the same.
const SAME_REQUEST: Duration = Duration::from_millis(500);

/// A process tied to another program is killed this long after that one ended.
#[cfg(feature = "net")]
const ORPHAN_ENDS_WITHIN: Duration = Duration::from_secs(8);

/// A flag that a request to end raises, and nothing lowers.
#[derive(Clone, Debug, Default)]
pub(super) struct StopFlag {
    is_asked: Arc<AtomicBool>,
}

impl StopFlag {
    /// Listens to requests from now on.
    pub(super) fn listen() -> StopFlag {
        StopFlag::listen_with(|| {})
    }

    /// Calls `ask` at the first request, on a thread of its own, for a command that waits for something else.
    pub(super) fn listen_with(ask: impl Fn() + Send + 'static) -> StopFlag {
        let stop = StopFlag::default();
        let flag = stop.is_asked.clone();
        let mut asked_at = None;
        // Where no handler can be set a request ends the program at once; the next run then cleans up.
        let _ = ctrlc::set_handler(move || {
            let now = Instant::now();
            let first = *asked_at.get_or_insert(now);
            if flag.swap(true, Ordering::Relaxed) {
                if now.duration_since(first) < SAME_REQUEST {
                    return;
                }
                super::screen::give_back_at_once();
                std::process::exit(ENDED_AT_ONCE);
            }
            ask();
        });
        stop
    }

    /// Asks to end as well when standard input ends: it is a pipe of the program that has started this one, which is
    /// gone then. Who has not ended in order within 8 s is ended at once.
    #[cfg(feature = "net")]
    pub(super) fn end_with_input(&self, ask: impl Fn() + Send + 'static) {
        let flag = self.is_asked.clone();
        let watch = move || {
            let mut ignored = [0; 256];
            let mut input = std::io::stdin().lock();
            // What cannot be read any more has ended, too.
            while input.read(&mut ignored).is_ok_and(|read| read > 0) {}
            flag.store(true, Ordering::Relaxed);
            ask();
            wait(ORPHAN_ENDS_WITHIN);
            std::process::exit(ENDED_AT_ONCE);
        };
        // A machine that has no thread to give can hardly have started us.
        let _ = std::thread::Builder::new()
            .name("standard input".to_owned())
            .spawn(watch);
    }

    /// Returns whether the command shall end.
    pub(super) fn is_asked(&self) -> bool {
        self.is_asked.load(Ordering::Relaxed)
    }
}

#[cfg(feature = "net")]
#[allow(
    clippy::disallowed_methods,
    reason = "the program that would end us is gone; nobody is kept waiting"
)]
fn wait(span: Duration) {
    std::thread::sleep(span);
}
