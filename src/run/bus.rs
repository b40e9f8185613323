//! The bus between processes: zenoh, and the only file (with its settings in `bus/`) that names it.
//!
//! It decides nothing: what comes is judged and what goes waits in the node's [`Exchange`]. Everything is published with
//! *drop*: delivery is ours (what is said is repeated, tiles are repaired, samples wait for `Have`), and publishing never
//! waits for the network.
//!
//! The exchange is behind one lock, which is held for moments only: frames are written and read outside of it, so that
//! nobody who has something urgent to say waits while another thread reads a long frame.
//!
//! Every frame travels with its CRC-32 beside it (zenoh's attachment, 4 bytes, little endian): TCP's own checksum lets damage
//! through, and what is damaged may read as another message. A frame without one is read as it is.
//!
//! One thread keeps the session: it opens it, opens it anew when it has become deaf (`bus/hearing.rs`), the roster has
//! changed or a thread of the library has panicked, and sends what has waited. Another one asks the library to whom there
//! are links (`bus/links.rs`). The library is never called with a lock of ours held: it may call us, or wait, with locks of
//! its own.

mod declared_keys;
mod frame_checks;
mod hearing;
mod library_panics;
mod links;
mod session_id;
mod settings;
mod zenoh_config;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError, RwLock};
use std::thread::JoinHandle;
use std::time::Duration;

use tomoswarm_proto::{Key, Message, Sender, Topic};
use zenoh::Wait;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::Locality;

use self::declared_keys::DeclaredKeys;
use self::frame_checks::{under_its_key, whole};
use self::hearing::{ReopenReason, SessionHearing};
use self::library_panics::{PanicsSeen, guarded};
use self::links::LinkCounter;
use self::settings::without_places;
pub use self::settings::{BusError, BusSettings, BusTraffic, SessionTopology, Trust};
use super::clock::Clock;
use super::mailbox::{Troubles, lock};
use super::subjects;
use super::trust::AccessRule;
use crate::exchange::egress::OutboundFrame;
pub use crate::exchange::ingress::HeardMessage;
use crate::exchange::ingress::{FrameRefusal, read};
use crate::exchange::joining::JoinEffect;
use crate::exchange::presence::Presence;
use crate::exchange::table::{Ride, Urgency};
use crate::exchange::{Exchange, ReceivedFrame};
use crate::time::Time;

/// Between two tries to open a session.
const RETRY: Duration = Duration::from_millis(300);
/// The keeper looks at what was heard this often when there is nothing to send.
const LOOKS_EVERY: Duration = Duration::from_millis(500);
/// A session that does not close within this time is left alone.
const CLOSES_WITHIN: Duration = Duration::from_secs(1);

/// Takes what a node is to be told, and what follows for taking part.
type Subscriber = dyn Fn(Option<HeardMessage>, JoinEffect) + Send + Sync;

/// A node's part of the bus.
pub struct BusSession {
    shared: Arc<Shared>,
    links: LinkCounter,
    keeper: Option<JoinHandle<()>>,
}

struct Shared {
    settings: BusSettings,
    clock: Clock,
    troubles: Troubles,
    session: RwLock<Option<zenoh::Session>>,
    keys: DeclaredKeys,
    /// Who may write what by the newest roster.
    access: Mutex<Vec<AccessRule>>,
    exchange: Mutex<Exchange>,
    more: Condvar,
    is_closing: AtomicBool,
    /// Whether a message could not be encoded since the start.
    has_failed: AtomicBool,
    subscriber: Box<Subscriber>,
    hearing: Mutex<SessionHearing>,
    sent: AtomicU64,
    sent_bytes: AtomicU64,
    /// The library has panicked in a call of this session: it is not used any more.
    is_broken: AtomicBool,
    /// How often the session was opened anew because of a panic of the library.
    panics: AtomicU64,
}

impl BusSession {
    /// Listens to the bus as a tool does, which asks nobody; `hear` is called from the bus's threads for everything that
    /// comes, and must not wait.
    ///
    /// A vehicle in a star, or a peer whose neighbours are away, opens all the same: they are sought for in the background.
    ///
    /// # Errors
    /// The settings cannot be used, or the node cannot listen where it should.
    pub fn open(
        settings: BusSettings,
        clock: Clock,
        troubles: Troubles,
        hear: impl Fn(HeardMessage) + Send + Sync + 'static,
    ) -> Result<BusSession, BusError> {
        let hear_all = move |heard: Option<HeardMessage>, _| heard.into_iter().for_each(&hear);
        BusSession::join(settings, Presence::listening(), clock, troubles, hear_all)
    }

    /// Goes on the bus; `hear` is called from the bus's threads for what the node is to be told and for what follows for
    /// taking part, and must not wait.
    ///
    /// # Errors
    /// As [`BusSession::open`].
    pub fn join(
        settings: BusSettings,
        presence: Presence,
        clock: Clock,
        troubles: Troubles,
        hear: impl Fn(Option<HeardMessage>, JoinEffect) + Send + Sync + 'static,
    ) -> Result<BusSession, BusError> {
        library_panics::watch();
        let exchange = Exchange::new(settings.egress_bytes_per_s, presence);
        let access = settings.trust.as_ref().map(|trust| trust.access.clone());
        let shared = Arc::new(Shared {
            access: Mutex::new(access.unwrap_or_default()),
            settings,
            clock,
            troubles,
            session: RwLock::new(None),
            keys: DeclaredKeys::default(),
            exchange: Mutex::new(exchange),
            more: Condvar::new(),
            is_closing: AtomicBool::new(false),
            has_failed: AtomicBool::new(false),
            subscriber: Box::new(hear),
            hearing: Mutex::new(SessionHearing::new(clock.now())),
            sent: AtomicU64::new(0),
            sent_bytes: AtomicU64::new(0),
            is_broken: AtomicBool::new(false),
            panics: AtomicU64::new(0),
        });
        // What listens must listen from the beginning; who only connects may find nobody yet.
        if shared.is_hub() {
            shared.open_session()?;
        }
        let weak = Arc::downgrade(&shared);
        let links = LinkCounter::watch(move || weak.upgrade()?.look())?;
        let of_keeper = shared.clone();
        let keeper = std::thread::Builder::new()
            .name("bus".to_owned())
            .spawn(move || of_keeper.keep_on())?;
        Ok(BusSession {
            shared,
            links,
            keeper: Some(keeper),
        })
    }

    /// Returns a handle by which messages are published from any thread.
    pub fn publisher(&self) -> Publisher {
        Publisher {
            shared: self.shared.clone(),
            links: self.links.clone(),
        }
    }

    /// From now on others may write what a newer roster says: the session is opened anew, unless it says the same. The files by
    /// which the node is known are read again too.
    pub fn allow(&self, access: Vec<AccessRule>) {
        let former = std::mem::replace(&mut *lock(&self.shared.access), access.clone());
        if former != access {
            lock(&self.shared.hearing).change_roster();
            self.shared.more.notify_one();
        }
    }

    /// Leaves the bus: what waits is dropped.
    pub fn close(mut self) {
        self.end();
    }

    fn end(&mut self) {
        self.shared.is_closing.store(true, Ordering::Relaxed);
        // With the lock taken the keeper is either before its look at `is_closing`, or waits already.
        drop(lock(&self.shared.exchange));
        self.shared.more.notify_all();
        if let Some(keeper) = self.keeper.take() {
            // A keeper that panicked has nothing left to close.
            let _ = keeper.join();
        }
    }
}

impl Drop for BusSession {
    fn drop(&mut self) {
        self.end();
    }
}

/// Publishes; cheap to clone, usable from any thread, never waits for the network. As long as one is held, what the
/// bus calls for everything heard is kept too.
#[derive(Clone)]
pub struct Publisher {
    shared: Arc<Shared>,
    links: LinkCounter,
}

impl Publisher {
    /// Publishes a message under the key that belongs to it. A node that does not take part yet publishes only greetings,
    /// and so does a tool before [`Publisher::speak`].
    pub fn publish(&self, message: &Message) {
        let shared = &self.shared;
        let Some(frame) = shared.frame(message) else {
            return;
        };
        let rides = frame.rides != Ride::Never;
        let ready = lock(&shared.exchange).offer(shared.clock.now(), frame);
        // The keeper looks soon enough for what waits for company.
        if ready.is_empty() && !rides {
            shared.more.notify_one();
        }
        ready.into_iter().for_each(|frame| shared.send(frame));
    }

    /// Greets when it is time, and learns whether somebody can hear it; returns when to be called again, `None` = never.
    pub fn greet(&self, now: Time, is_linked: bool) -> Option<Time> {
        let mut exchange = lock(&self.shared.exchange);
        if is_linked {
            exchange.meet(now);
        }
        let (greeting, next) = (exchange.greet(now), exchange.greets_at());
        drop(exchange);
        greeting
            .into_iter()
            .for_each(|frame| self.shared.send(frame));
        next
    }

    /// Returns whether the node takes part, or the tool speaks.
    pub fn is_member(&self) -> bool {
        lock(&self.shared.exchange).is_member()
    }

    /// From now on a tool publishes everything.
    pub fn speak(&self) {
        lock(&self.shared.exchange).speak();
    }

    /// Returns what was carried so far.
    pub fn traffic(&self) -> BusTraffic {
        let counts = lock(&self.shared.exchange).counts();
        BusTraffic {
            sent: self.shared.sent.load(Ordering::Relaxed),
            sent_bytes: self.shared.sent_bytes.load(Ordering::Relaxed),
            taken: counts.taken,
            taken_bytes: counts.taken_bytes,
            refused: counts.refused,
            unknown: counts.unknown,
            dropped: counts.dropped,
            panics: self.shared.panics.load(Ordering::Relaxed),
        }
    }

    /// Returns how many nodes this one has a link to; in a star the hub is told of none. It never waits long for it.
    pub fn links(&self) -> usize {
        self.links.count()
    }
}

impl Shared {
    /// Returns whether the node listens for others.
    fn is_hub(&self) -> bool {
        match self.settings.topology {
            SessionTopology::Mesh => true,
            SessionTopology::Star => self.settings.node == Sender::Ground,
        }
    }

    fn open_session(self: &Arc<Self>) -> Result<(), BusError> {
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

    /// Keeps the session until the bus is closed; a keeper that panics begins anew, with a new session.
    fn keep_on(self: &Arc<Self>) {
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

    /// Encodes a message; one that cannot be sent is a trouble until one of its kind can.
    fn frame(&self, message: &Message) -> Option<OutboundFrame> {
        let who = || format!("bus: {}", message.word());
        match OutboundFrame::of(message) {
            Ok(frame) => {
                if self.has_failed.load(Ordering::Relaxed) {
                    self.troubles.clear(&who());
                }
                Some(frame)
            }
            Err(error) => {
                self.has_failed.store(true, Ordering::Relaxed);
                self.troubles.raise(&who(), error.to_string());
                None
            }
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

    /// Returns the session that is open, to be called without the lock.
    fn session(&self) -> Option<zenoh::Session> {
        self.session
            .read()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Returns why the session is to be opened anew. The lock is held for this moment only.
    fn why_anew(&self) -> Option<ReopenReason> {
        lock(&self.hearing).why_anew(self.clock.now())
    }

    /// Asks the library to whom there are links, and returns to how many; `None` = the bus is closed.
    fn look(&self) -> Option<usize> {
        if self.is_closing.load(Ordering::Relaxed) {
            return None;
        }
        let ids = self.session().and_then(|session| {
            let info = session.info();
            guarded(|| {
                info.peers_zid()
                    .wait()
                    .chain(info.routers_zid().wait())
                    .collect::<Vec<_>>()
            })
        });
        let ids = ids.unwrap_or_default();
        let nodes = ids
            .iter()
            .filter_map(|id| session_id::node_of(*id, &self.settings.prefix));
        lock(&self.hearing).link(self.clock.now(), &nodes.collect::<Vec<_>>());
        Some(ids.len())
    }

    fn close_session(&self) {
        let session = self
            .session
            .write()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        let Some(session) = session else { return };
        self.keys.forget();
        let (done, closed) = std::sync::mpsc::channel();
        let close = move || {
            let _ = session.close().wait();
            done.send(()).unwrap_or_default();
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

    fn send(&self, frame: OutboundFrame) {
        let Some(session) = self
            .session()
            .filter(|_| !self.is_broken.load(Ordering::Relaxed))
        else {
            return;
        };
        self.sent.fetch_add(1, Ordering::Relaxed);
        self.sent_bytes
            .fetch_add(frame.frame.len() as u64, Ordering::Relaxed);
        let (priority, is_express) = match frame.class {
            Urgency::Urgent => (Priority::RealTime, true),
            Urgency::High => (Priority::InteractiveHigh, false),
            Urgency::Normal => (Priority::Data, false),
            Urgency::Low => (Priority::Background, false),
        };
        let key = format!(
            "{}/{}",
            self.settings.prefix,
            Key {
                sender: self.settings.node,
                topic: frame.topic
            }
        );
        let check = crc32fast::hash(&frame.frame).to_le_bytes();
        self.keys.note(&key, frame.topic);
        let put = || {
            let put = session.put(&key, frame.frame).attachment(check);
            put.congestion_control(CongestionControl::Drop)
                .priority(priority)
                .express(is_express)
                .wait()
        };
        match guarded(put) {
            Some(Ok(())) => {}
            Some(Err(error)) => tracing::debug!("not published under {key}: {error}"),
            None => {
                self.is_broken.store(true, Ordering::Relaxed);
                self.more.notify_one();
            }
        }
    }

    /// Lets the exchange judge what came, and the node hear it. The exchange is not locked while the frame is read.
    fn take(&self, full_key: &str, bytes: &[u8], check: Option<&[u8]>) {
        let now = self.clock.now();
        let key = full_key
            .strip_prefix(&self.settings.prefix)
            .and_then(|key| key.strip_prefix('/'));
        let Some((key, sender)) = key.and_then(|key| Some((key, Key::sender(key)?))) else {
            return self.refuse(None, full_key, &FrameRefusal::NoSender);
        };
        let admitted = lock(&self.exchange).admit(now, sender, bytes.len());
        let whole = admitted.and_then(|()| whole(bytes, check));
        let heard = whole
            .and_then(|()| read(sender, bytes))
            .and_then(|heard| under_its_key(heard, key));
        let heard = match heard {
            Ok(heard) => heard,
            Err(refusal) => {
                if let FrameRefusal::Damaged = refusal {
                    lock(&self.hearing).damage(now);
                }
                return self.refuse(Some(sender), key, &refusal);
            }
        };
        lock(&self.hearing).hear(now, sender);
        if let HeardMessage::Message(_, message) = &heard {
            self.keys.note(full_key, Topic::of(message));
        }
        let reception = lock(&self.exchange).accept(now, bytes.len(), heard);
        let ReceivedFrame {
            heard,
            verdict,
            replies,
        } = match reception {
            Ok(reception) => reception,
            Err(refusal) => return self.refuse(Some(sender), key, &refusal),
        };
        (self.subscriber)(heard, verdict);
        replies.into_iter().for_each(|frame| self.send(frame));
    }

    /// Counts what is refused, and logs it when its number is a power of ten.
    fn refuse(&self, sender: Option<Sender>, key: &str, refusal: &FrameRefusal) {
        let worth_a_line = lock(&self.exchange).refuse(sender, refusal);
        if let Some(count) = worth_a_line {
            let (what, who) = (
                refusal.what(),
                sender.map_or("somebody".to_owned(), |sender| sender.to_string()),
            );
            tracing::warn!("refused {what} of {who} ({count} so far): {refusal} (under {key})");
        }
    }
}

#[cfg(test)]
mod tests;
