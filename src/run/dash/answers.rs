//! Answers to what made a pixel, on a thread of their own, one at a time: an order never waits for one.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use tokio::sync::oneshot;

use crate::dash::gate::GateRefusal;
use crate::dash::why::WhyJob;

/// Where an answer goes.
type Reply = oneshot::Sender<Result<String, GateRefusal>>;

/// Whether one is being found.
#[derive(Default)]
pub(super) struct PixelAnswers {
    is_busy: Arc<AtomicBool>,
}

impl PixelAnswers {
    /// Finds an answer and gives it, or says at once why there is none.
    pub(super) fn give(&self, job: Result<WhyJob, GateRefusal>, reply: Reply) {
        let job = match job {
            Ok(job) => job,
            Err(refusal) => return send(reply, Err(refusal)),
        };
        if self.is_busy.swap(true, Ordering::AcqRel) {
            let reason = "another pixel is being asked for: again in a moment";
            return send(reply, Err(GateRefusal::Unreadable(reason.to_owned())));
        }
        let busy = Busy(self.is_busy.clone());
        let thread = std::thread::Builder::new().name("pixel".to_owned());
        let begun = thread.spawn(move || {
            let answer = job.answer().map_err(GateRefusal::Unreadable);
            drop(busy);
            send(reply, answer);
        });
        if let Err(error) = begun {
            // The reply is gone with the thread, so its page is told that there is none.
            tracing::warn!("a pixel's links cannot be found: {error}");
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
fn send(reply: Reply, answer: Result<String, GateRefusal>) {
    let _ = reply.send(answer);
}
