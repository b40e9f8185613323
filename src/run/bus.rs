//! The bus between processes: zenoh, and the only file (with its settings in `bus/`) that names it.
//!
//! Everything is published with *drop*: delivery is ours (what is said is repeated, tiles are repaired, samples wait for
//! `Have`). Publishing never waits for the network: what the budget does not allow now waits in [`Egress`]. What arrives is
//! judged before anyone hears it: the key's sender, its share of the bus, the codec, and that the author is the sender.
//!
//! One thread keeps the session: it opens it, opens it anew when nothing was heard for long, and sends what has waited.

mod zenoh_config;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError, RwLock, Weak};
use std::thread::JoinHandle;
use std::time::Duration;

use tomoswarm_proto::codec::{self, DecodeError, LIMIT};
use tomoswarm_proto::{Key, Message, Sender};
use zenoh::Wait;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::Locality;

use super::allowance::Allowance;
use super::clock::Clock;
use super::desk::{Troubles, lock};
use super::egress::{Class, Egress, Parcel};
use super::subjects::heard_by;
use super::trust::AccessRule;
use crate::time::Time;

pub use crate::operator::Heard;

/// Between two tries to open a session.
const RETRY: Duration = Duration::from_millis(300);
/// A session in which somebody was heard, and then nobody for this long, is opened anew: its links may be half open.
const DEAF_AFTER: Duration = Duration::from_secs(15);
/// One in which nobody was ever heard gets this long: it is seeking its neighbours by itself.
const ALONE_AFTER: Duration = Duration::from_secs(60);
/// So many times what this node may send is taken from each of the others, and saved up for so many seconds.
const INGRESS_SHARE: f64 = 4.0;
const INGRESS_SAVED_S: f64 = 4.0;
/// The keeper looks at the session this often when there is nothing to send.
const LOOKS_EVERY: Duration = Duration::from_secs(1);
/// A session that does not close within this time is left alone.
const CLOSES_WITHIN: Duration = Duration::from_secs(1);

/// How nodes are joined.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Topology {
    /// Everyone with everyone; goes on without the ground station. Up to about 25 nodes.
    Mesh,
    /// All through the ground station.
    Star,
}

/// The files by which nodes know each other, and what the roster allows.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Trust {
    /// Certificate of the authority.
    pub ca: PathBuf,
    /// Own certificate.
    pub certificate: PathBuf,
    /// Own private key.
    pub key: PathBuf,
    /// Who may write what.
    pub access: Vec<AccessRule>,
}

/// How a node takes part in the bus.
#[derive(Clone, PartialEq, Debug)]
pub struct BusSettings {
    /// Who this is.
    pub node: Sender,
    /// Before every key: `tomoswarm/<venue>`.
    pub prefix: String,
    /// How nodes are joined.
    pub topology: Topology,
    /// Where it listens, such as `tcp/127.0.0.1:7447`.
    pub listen: Vec<String>,
    /// Whom it connects to.
    pub connect: Vec<String>,
    /// Certificates; `None` = unprotected.
    pub trust: Option<Trust>,
    /// A link on which nothing comes for this long is given up.
    pub lease: Duration,
    /// What it may send, bytes per second.
    pub egress_bytes_per_s: u32,
    /// Whether the nodes of a mesh tell each other of further ones; otherwise only `connect` joins them.
    pub gossip: bool,
}

/// What the bus has carried and refused.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Traffic {
    /// Frames published.
    pub sent: u64,
    /// Their bytes.
    pub sent_bytes: u64,
    /// Frames taken.
    pub taken: u64,
    /// Their bytes.
    pub taken_bytes: u64,
    /// Frames refused: not ours, impossible, too much, or not the sender's to say.
    pub refused: u64,
    /// Frames dropped before they were sent because too much waited, among them batches of samples beyond the second; what
    /// the network drops under congestion is not known.
    pub dropped: u64,
}

/// Why a node cannot take part in the bus.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The settings are not taken.
    #[error("the bus cannot be set up: {reason}")]
    Settings {
        /// What zenoh says.
        reason: String,
    },
    /// It cannot listen where it should.
    #[error("the bus cannot listen on {endpoints}: {reason}")]
    Listen {
        /// Where.
        endpoints: String,
        /// What zenoh says.
        reason: String,
    },
    /// The machine has no thread to give.
    #[error("the bus has no thread: {0}")]
    Thread(#[from] std::io::Error),
}

type Ear = dyn Fn(Heard) + Send + Sync;

/// A node's part of the bus.
pub struct Bus {
    shared: Arc<Shared>,
    keeper: Option<JoinHandle<()>>,
}

struct Shared {
    settings: BusSettings,
    clock: Clock,
    troubles: Troubles,
    session: RwLock<Option<zenoh::Session>>,
    egress: Mutex<Egress>,
    more: Condvar,
    is_closing: AtomicBool,
    /// Whether a message could not be encoded since the start.
    has_failed: AtomicBool,
    /// Whether anything but greetings may be said.
    is_open: AtomicBool,
    ingress: Mutex<Ingress>,
    ear: Box<Ear>,
    /// When a frame was taken last, nanoseconds.
    heard_at: AtomicU64,
    /// Whether any was taken in this session.
    has_heard: AtomicBool,
    sent: AtomicU64,
    sent_bytes: AtomicU64,
    taken: AtomicU64,
    taken_bytes: AtomicU64,
    refused: AtomicU64,
}

#[derive(Default)]
struct Ingress {
    allowances: BTreeMap<Sender, Allowance>,
    /// Reasons already logged, by sender.
    logged: BTreeMap<(Option<Sender>, &'static str), u64>,
}

impl Bus {
    /// Takes part in the bus; `hear` is called from the bus's threads for everything that comes, and must not wait.
    ///
    /// A vehicle in a star, or a peer whose neighbours are away, opens all the same: they are sought for in the background.
    ///
    /// # Errors
    /// The settings cannot be used, or the node cannot listen where it should.
    pub fn open(
        settings: BusSettings,
        clock: Clock,
        troubles: Troubles,
        hear: impl Fn(Heard) + Send + Sync + 'static,
    ) -> Result<Bus, BusError> {
        let egress = Egress::new(settings.egress_bytes_per_s);
        let shared = Arc::new(Shared {
            settings,
            clock,
            troubles,
            session: RwLock::new(None),
            egress: Mutex::new(egress),
            more: Condvar::new(),
            is_closing: AtomicBool::new(false),
            has_failed: AtomicBool::new(false),
            is_open: AtomicBool::new(false),
            ingress: Mutex::new(Ingress::default()),
            ear: Box::new(hear),
            heard_at: AtomicU64::new(clock.now().as_nanos()),
            has_heard: AtomicBool::new(false),
            sent: AtomicU64::new(0),
            sent_bytes: AtomicU64::new(0),
            taken: AtomicU64::new(0),
            taken_bytes: AtomicU64::new(0),
            refused: AtomicU64::new(0),
        });
        // What listens must listen from the beginning; who only connects may find nobody yet.
        if shared.is_hub() {
            shared.open_session()?;
        }
        let of_keeper = shared.clone();
        let keeper = std::thread::Builder::new().name("bus".to_owned()).spawn(move || of_keeper.keep_on())?;
        Ok(Bus { shared, keeper: Some(keeper) })
    }

    /// Gives a handle by which messages are published from any thread.
    pub fn mouth(&self) -> Mouth {
        Mouth { shared: self.shared.clone() }
    }

    /// Leaves the bus: what waits is dropped.
    pub fn close(mut self) {
        self.end();
    }

    fn end(&mut self) {
        self.shared.is_closing.store(true, Ordering::Relaxed);
        // With the lock taken the keeper is either before its look at `is_closing`, or waits already.
        drop(lock(&self.shared.egress));
        self.shared.more.notify_all();
        if let Some(keeper) = self.keeper.take() {
            // A keeper that panicked has nothing left to close.
            let _ = keeper.join();
        }
    }
}

impl Drop for Bus {
    fn drop(&mut self) {
        self.end();
    }
}

/// Publishes; cheap to clone, usable from any thread, never waits for the network. As long as one is held the bus's ear is.
#[derive(Clone)]
pub struct Mouth {
    shared: Arc<Shared>,
}

impl Mouth {
    /// Publishes a message under the key that belongs to it. Before [`Mouth::speak`] only greetings are.
    pub fn publish(&self, message: &Message) {
        let shared = &self.shared;
        if !shared.is_open.load(Ordering::Relaxed) && !matches!(message, Message::Hello(_)) {
            return;
        }
        let Some(frame) = shared.frame(message) else { return };
        let key = Key::of(shared.settings.node, message).as_str().to_owned();
        let is_state = !matches!(message, Message::Samples(_) | Message::Want(_));
        let parcel = Parcel { class: Class::of(message), key, is_state, frame };
        let now = shared.clock.now();
        let ready = lock(&shared.egress).offer(now, parcel);
        match ready {
            Some(parcel) => shared.send(parcel),
            None => shared.more.notify_one(),
        }
    }

    /// Gives a handle that does not keep the bus from being dropped.
    pub fn reply(&self) -> Reply {
        Reply { shared: Arc::downgrade(&self.shared) }
    }

    /// From now on everything is published.
    pub fn speak(&self) {
        self.shared.is_open.store(true, Ordering::Relaxed);
    }

    /// Gives what was carried so far.
    pub fn traffic(&self) -> Traffic {
        let shared = &self.shared;
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Traffic {
            sent: read(&shared.sent),
            sent_bytes: read(&shared.sent_bytes),
            taken: read(&shared.taken),
            taken_bytes: read(&shared.taken_bytes),
            refused: read(&shared.refused),
            dropped: lock(&shared.egress).dropped(),
        }
    }

    /// Gives how many nodes this one has a link to.
    pub fn links(&self) -> usize {
        let session = self.shared.session.read().unwrap_or_else(PoisonError::into_inner);
        let Some(session) = &*session else { return 0 };
        session.info().peers_zid().wait().count() + session.info().routers_zid().wait().count()
    }
}

/// Publishes as long as the bus is there; for what the bus itself holds on to, such as its ear.
#[derive(Clone)]
pub struct Reply {
    shared: Weak<Shared>,
}

impl Reply {
    /// Publishes a message; nothing when the bus is gone.
    pub fn publish(&self, message: &Message) {
        if let Some(shared) = self.shared.upgrade() {
            Mouth { shared }.publish(message);
        }
    }
}

impl Shared {
    /// Tells whether the node listens for others.
    fn is_hub(&self) -> bool {
        match self.settings.topology {
            Topology::Mesh => true,
            Topology::Star => self.settings.node == Sender::Ground,
        }
    }

    fn open_session(self: &Arc<Self>) -> Result<(), BusError> {
        let text = zenoh_config::session(&self.settings, self.is_hub()).to_string();
        let settings_error = |error: &dyn std::fmt::Display| BusError::Settings { reason: error.to_string() };
        let config = zenoh::Config::from_json5(&text).map_err(|error| settings_error(&error))?;
        let session = zenoh::open(config).wait().map_err(|error| match self.is_hub() {
            true => {
                BusError::Listen { endpoints: self.settings.listen.join(", "), reason: error.to_string() }
            }
            false => settings_error(&error),
        })?;
        for key in heard_by(self.settings.node) {
            let weak = Arc::downgrade(self);
            let hear = move |sample: zenoh::sample::Sample| {
                if let Some(shared) = weak.upgrade() {
                    shared.take(sample.key_expr().as_str(), &sample.payload().to_bytes());
                }
            };
            let full = format!("{}/{key}", self.settings.prefix);
            let declared = session.declare_subscriber(full).callback(hear).allowed_origin(Locality::Remote);
            declared.background().wait().map_err(|error| settings_error(&error))?;
        }
        self.heard_at.store(self.clock.now().as_nanos(), Ordering::Relaxed);
        self.has_heard.store(false, Ordering::Relaxed);
        *self.session.write().unwrap_or_else(PoisonError::into_inner) = Some(session);
        Ok(())
    }

    /// Keeps the session until the bus is closed; a keeper that panics begins anew, with a new session.
    fn keep_on(self: &Arc<Self>) {
        while catch_unwind(AssertUnwindSafe(|| self.keep())).is_err() {
            self.troubles.raise("bus", "what keeps the session failed, and begins anew".to_owned());
            // A session that cannot even be closed is left alone.
            let _ = catch_unwind(AssertUnwindSafe(|| self.close_session()));
            if self.is_closing.load(Ordering::Relaxed) {
                return;
            }
            self.wait_for_more(RETRY);
        }
    }

    /// Encodes a message; one that cannot be sent is a trouble until one of its kind can.
    fn frame(&self, message: &Message) -> Option<Vec<u8>> {
        let who = || format!("bus: {}", message.word());
        match codec::encode(message) {
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
        while !self.is_closing.load(Ordering::Relaxed) {
            if !self.has_session() {
                if let Err(error) = self.open_session() {
                    self.troubles.raise("bus", error.to_string());
                    self.wait_for_more(RETRY);
                    continue;
                }
                self.troubles.clear("bus");
            } else if self.is_deaf() {
                tracing::info!("nothing heard on the bus: its session is opened anew");
                self.close_session();
                continue;
            }
            self.drain();
        }
        self.close_session();
    }

    fn has_session(&self) -> bool {
        self.session.read().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    fn is_deaf(&self) -> bool {
        let heard_at = Time::from_nanos(self.heard_at.load(Ordering::Relaxed));
        let after = if self.has_heard.load(Ordering::Relaxed) { DEAF_AFTER } else { ALONE_AFTER };
        self.clock.now().since(heard_at) > after
    }

    fn close_session(&self) {
        let session = self.session.write().unwrap_or_else(PoisonError::into_inner).take();
        let Some(session) = session else { return };
        let (done, closed) = std::sync::mpsc::channel();
        let close = move || {
            let _ = session.close().wait();
            done.send(()).unwrap_or_default();
        };
        // Who cannot be told in time that we leave finds out by the lease.
        if std::thread::Builder::new().name("bus-close".to_owned()).spawn(close).is_ok() {
            let _ = closed.recv_timeout(CLOSES_WITHIN);
        }
    }

    /// Sends what is due, or waits for more: it looks and begins to wait under one lock, so that nothing that is offered
    /// meanwhile is overlooked.
    fn drain(&self) {
        let mut egress = lock(&self.egress);
        let now = self.clock.now();
        let due: Vec<Parcel> = std::iter::from_fn(|| egress.due(now)).collect();
        if due.is_empty() {
            let wait = egress.next().map_or(LOOKS_EVERY, |at| at.since(now)).min(LOOKS_EVERY);
            if !self.is_closing.load(Ordering::Relaxed) {
                drop(self.more.wait_timeout(egress, wait));
            }
            return;
        }
        drop(egress);
        due.into_iter().for_each(|parcel| self.send(parcel));
    }

    fn wait_for_more(&self, wait: Duration) {
        let egress = lock(&self.egress);
        if !self.is_closing.load(Ordering::Relaxed) {
            drop(self.more.wait_timeout(egress, wait));
        }
    }

    fn send(&self, parcel: Parcel) {
        let session = self.session.read().unwrap_or_else(PoisonError::into_inner);
        let Some(session) = &*session else { return };
        self.sent.fetch_add(1, Ordering::Relaxed);
        self.sent_bytes.fetch_add(parcel.frame.len() as u64, Ordering::Relaxed);
        let (priority, is_express) = match parcel.class {
            Class::Urgent => (Priority::RealTime, true),
            Class::High => (Priority::InteractiveHigh, false),
            Class::Normal => (Priority::Data, false),
            Class::Low => (Priority::Background, false),
        };
        let key = format!("{}/{}", self.settings.prefix, parcel.key);
        let put = session.put(key, parcel.frame).congestion_control(CongestionControl::Drop);
        if let Err(error) = put.priority(priority).express(is_express).wait() {
            tracing::debug!("not published under {}: {error}", parcel.key);
        }
    }

    /// Judges what came, and lets the node hear it.
    fn take(&self, full_key: &str, bytes: &[u8]) {
        let now = self.clock.now();
        let key = full_key.strip_prefix(&self.settings.prefix).and_then(|key| key.strip_prefix('/'));
        let Some((key, sender)) = key.and_then(|key| Some((key, Key::sender(key)?))) else {
            return self.refuse(None, "a key of no sender", &full_key);
        };
        let share = |ingress: &mut Ingress| {
            let per_s = INGRESS_SHARE * f64::from(self.settings.egress_bytes_per_s);
            let fresh = || Allowance::new(per_s, INGRESS_SAVED_S * per_s);
            ingress.allowances.entry(sender).or_insert_with(fresh).spend(now, bytes.len())
        };
        if !share(&mut lock(&self.ingress)) {
            return self.refuse(Some(sender), "more than its share of the bus", &key);
        }
        match self.read(sender, key, bytes) {
            Ok(heard) => {
                self.heard_at.store(now.as_nanos(), Ordering::Relaxed);
                self.has_heard.store(true, Ordering::Relaxed);
                self.taken.fetch_add(1, Ordering::Relaxed);
                self.taken_bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
                (self.ear)(heard);
            }
            Err(reason) => self.refuse(Some(sender), "a frame", &reason),
        }
    }

    fn read(&self, sender: Sender, key: &str, bytes: &[u8]) -> Result<Heard, String> {
        if bytes.len() > LIMIT {
            return Err(format!("{} bytes under {key}, longer than any message", bytes.len()));
        }
        if let Ok(greeting) = codec::greeting(bytes) {
            if greeting.node != sender {
                return Err(format!("a greeting of {} under {key}", greeting.node));
            }
            return match codec::decode(bytes) {
                Ok(Message::Hello(hello)) => Ok(Heard::Greeting(greeting, Some(hello))),
                Err(DecodeError::Version { .. }) => Ok(Heard::Greeting(greeting, None)),
                Ok(other) => Err(format!("{other:?} that begins as a greeting")),
                Err(error) => Err(format!("{error} (under {key})")),
            };
        }
        let message = codec::decode(bytes).map_err(|error| format!("{error} (under {key})"))?;
        if message.author().is_some_and(|author| author != sender)
            || Key::of(sender, &message).as_str() != key
        {
            return Err(format!("what {sender} may not say, under {key}"));
        }
        let is_order = matches!(message, Message::Order(_));
        if is_order && matches!(sender, Sender::Vehicle(_)) {
            return Err(format!("an order of {sender}"));
        }
        Ok(Heard::Message(sender, message))
    }

    /// Counts what is refused, and logs it when its number is a power of ten.
    fn refuse(&self, sender: Option<Sender>, what: &'static str, reason: &dyn std::fmt::Display) {
        self.refused.fetch_add(1, Ordering::Relaxed);
        let mut ingress = lock(&self.ingress);
        let count = ingress.logged.entry((sender, what)).or_default();
        *count += 1;
        if 10_u64.pow(count.ilog10()) == *count {
            let who = sender.map_or("somebody".to_owned(), |sender| sender.to_string());
            tracing::warn!("refused {what} of {who} ({count} so far): {reason}");
        }
    }
}

#[cfg(test)]
mod tests;
