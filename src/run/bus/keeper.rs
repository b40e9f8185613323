//! The thread that keeps the bus's session: it opens it, opens it anew when it is deaf, the roster has changed or a thread of
//! the library has panicked, tells it of new keys, and sends what has waited.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::PoisonError;
use std::sync::atomic::Ordering;
use std::time::Duration;

use zenoh::Wait;
use zenoh::sample::Locality;

use super::super::mailbox::lock;
use super::super::subjects;
use super::hearing::ReopenReason;
use super::library_panics::PanicsSeen;
use super::settings::{BusError, without_places};
use super::{Shared, zenoh_config};

/// Between two tries to open a session.
const RETRY: Duration = Duration::from_millis(300);
/// The keeper looks at what was heard this often when there is nothing to send.
pub(super) const LOOKS_EVERY: Duration = Duration::from_millis(500);
/// A session that does not close within this time is left alone.
const CLOSES_WITHIN: Duration = Duration::from_secs(1);

impl Shared {
    /// Keeps the session until the bus is closed; a keeper that panics begins anew, with a new session.
    pub(super) fn keep_on(self: &Arc<Self>) {
        while catch_unwind(AssertUnwindSafe(|| self.keep())).is_err() {
            self.troubles.raise(
                "bus",
                "what keeps the session failed, and begins anew".to_owned(),
            );
            // A session that cannot even be closed is left alone.
            let _ = catch_unwind(AssertUnwindSafe(|| self.close_session()));
            if self.is_closing.load(Ordering::Relaxed) {
                return;
            }
            self.wait_for_more(RETRY);
        }
    }

    /// Opens the session anew whenever it is gone or deaf, and sends what has waited.
    fn keep(self: &Arc<Self>) {
        let mut panics = PanicsSeen::default();
        while !self.is_closing.load(Ordering::Relaxed) {
            if self.session().is_none() {
                if let Err(error) = self.open_session() {
                    self.troubles.raise("bus", error.to_string());
                    self.wait_for_more(RETRY);
                    continue;
                }
                self.troubles.clear("bus");
            } else if let Some(why) = self.why_anew() {
                tracing::info!("the bus's session is opened anew: {why}");
                self.close_session();
                continue;
            } else if panics.look(self.clock.now(), &self.troubles) {
                self.panics.fetch_add(1, Ordering::Relaxed);
                self.close_session();
                continue;
            }
            self.declare_keys();
            self.drain();
        }
        self.close_session();
    }

    /// Tells the session of the keys that were used since it was told last.
    fn declare_keys(&self) {
        if let Some(session) = self.session()
            && self.keys.declare_new(&session).is_none()
        {
            self.is_broken.store(true, Ordering::Relaxed);
        }
    }

    pub(super) fn open_session(self: &Arc<Self>) -> Result<(), BusError> {
        let mut settings = self.settings.clone();
        if let Some(trust) = &mut settings.trust {
            trust.access = lock(&self.access).clone();
        }
        let text = zenoh_config::session(&settings, self.is_hub()).to_string();
        let settings_error = |error: &dyn std::fmt::Display| BusError::Settings {
            reason: without_places(&error.to_string()),
        };
        let config = zenoh::Config::from_json5(&text).map_err(|error| settings_error(&error))?;
        let session = zenoh::open(config)
            .wait()
            .map_err(|error| match self.is_hub() {
                true => BusError::Listen {
                    endpoints: self.settings.listen.join(", "),
                    reason: without_places(&error.to_string()),
                },
                false => settings_error(&error),
            })?;
        for key in subjects::heard_by(self.settings.node) {
            let weak = Arc::downgrade(self);
            let hear = move |sample: zenoh::sample::Sample| {
                if let Some(shared) = weak.upgrade() {
                    let check = sample.attachment().map(|check| check.to_bytes());
                    shared.take(
                        sample.key_expr().as_str(),
                        &sample.payload().to_bytes(),
                        check.as_deref(),
                    );
                }
            };
            let full = format!("{}/{key}", self.settings.prefix);
            let declared = session
                .declare_subscriber(full)
                .callback(hear)
                .allowed_origin(Locality::Remote);
            declared
                .background()
                .wait()
                .map_err(|error| settings_error(&error))?;
        }
        lock(&self.hearing).open(self.clock.now());
        self.is_broken.store(false, Ordering::Relaxed);
        *self.session.write().unwrap_or_else(PoisonError::into_inner) = Some(session);
        Ok(())
    }

    /// Returns why the session is to be opened anew. The lock is held for this moment only.
    fn why_anew(&self) -> Option<ReopenReason> {
        lock(&self.hearing).why_anew(self.clock.now())
    }

    fn close_session(&self) {
        let session = self
            .session
            .write()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        let Some(session) = session else { return };
        let keys = self.keys.take();
        let (done, closed) = std::sync::mpsc::channel();
        let close = move || {
            let has_closed = catch_unwind(AssertUnwindSafe(|| session.close().wait())).is_ok();
            done.send(()).unwrap_or_default();
            // Dropping it would close it again: one more panic of the library within a destructor would end the process.
            if !has_closed {
                std::mem::forget((keys, session));
            }
        };
        // Who cannot be told in time that we leave finds out by the lease.
        if std::thread::Builder::new()
            .name("bus-close".to_owned())
            .spawn(close)
            .is_ok()
        {
            let _ = closed.recv_timeout(CLOSES_WITHIN);
        }
    }

    /// Sends what is due, or waits for more: it looks and begins to wait under one lock, so that nothing that is offered
    /// meanwhile is overlooked.
    fn drain(&self) {
        let mut exchange = lock(&self.exchange);
        let now = self.clock.now();
        let due = exchange.due(now);
        if due.is_empty() {
            let wait = exchange
                .deadline()
                .map_or(LOOKS_EVERY, |at| at.since(now))
                .min(LOOKS_EVERY);
            if !self.is_closing.load(Ordering::Relaxed) {
                drop(self.more.wait_timeout(exchange, wait));
            }
            return;
        }
        drop(exchange);
        due.into_iter().for_each(|frame| self.send(frame));
    }

    fn wait_for_more(&self, wait: Duration) {
        let exchange = lock(&self.exchange);
        if !self.is_closing.load(Ordering::Relaxed) {
            drop(self.more.wait_timeout(exchange, wait));
        }
    }
}
