//! How a command learns that it shall end: Ctrl-C, a terminal that closes, or a request of the system (SIGINT,
//! SIGHUP, SIGTERM).
//!
//! The first request lets the command end in order; a second one ends the program at once. What is left then
//! is a hidden folder that the next run removes.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code of a program that was ended at once, as shells have it for SIGINT.
const ENDED_AT_ONCE: i32 = 130;

/// A flag that a request to end raises, and nothing lowers.
#[derive(Clone, Debug, Default)]
pub struct Stop {
    is_asked: Arc<AtomicBool>,
}

impl Stop {
    /// Listens to requests from now on.
    pub fn listen() -> Stop {
        Stop::listen_with(|| {})
    }

    /// Calls `ask` at the first request, on a thread of its own, for a command that waits for something else.
    pub fn listen_with(ask: impl Fn() + Send + 'static) -> Stop {
        let stop = Stop::default();
        let flag = stop.is_asked.clone();
        // Where no handler can be set a request ends the program at once; the next run then cleans up.
        let _ = ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::Relaxed) {
                std::process::exit(ENDED_AT_ONCE);
            }
            ask();
        });
        stop
    }

    /// Tells whether the command shall end.
    pub fn is_asked(&self) -> bool {
        self.is_asked.load(Ordering::Relaxed)
    }
}
