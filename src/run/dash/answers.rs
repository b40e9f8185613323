//! Answers that take a while, such as what made a pixel or a file of a run: each kind on a thread of its own, one at a time. An
//! order never waits for one.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use tokio::sync::oneshot;

use crate::dash::gate::GateRefusal;

/// Where an answer goes.
pub(super) type Reply<T> = oneshot::Sender<Result<T, GateRefusal>>;

/// Whether one of a kind is being found.
#[derive(Default)]
pub(super) struct SlowAnswers {
    is_busy: Arc<AtomicBool>,
}

impl SlowAnswers {
    /// Finds an answer and gives it, or says at once why there is none; `busy` is said while another one is being found.
    pub(super) fn give<T: Send + 'static>(
        &self,
        busy: &str,
        work: impl FnOnce() -> Result<T, String> + Send + 'static,
        reply: Reply<T>,
    ) {
        if self.is_busy.swap(true, Ordering::AcqRel) {
            return send(reply, Err(GateRefusal::Unreadable(busy.to_owned())));
        }
        let guard = Busy(self.is_busy.clone());
        let thread = std::thread::Builder::new().name("answer".to_owned());
        let begun = thread.spawn(move || {
            let answer = work().map_err(GateRefusal::Unreadable);
            drop(guard);
            send(reply, answer);
        });
        if let Err(error) = begun {
            // The reply is gone with the thread, so its page is told that there is none.
            tracing::warn!("an answer cannot be found: {error}");
        }
    }
}

/// One is being found; however that ends, the next one may be asked for.
struct Busy(Arc<AtomicBool>);

impl Drop for Busy {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Release);
    }
}

/// A page that has gone meanwhile misses nothing.
pub(super) fn send<T>(reply: Reply<T>, answer: Result<T, GateRefusal>) {
    let _ = reply.send(answer);
}
