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
//! One thread keeps the session (`bus/keeper.rs`): it opens it, opens it anew when it has become deaf (`bus/hearing.rs`), the
//! roster has changed or a thread of the library has panicked, and sends what has waited. Another one asks the library to whom
//! there are links (`bus/links.rs`). The library is never called with a lock of ours held: it may call us, or wait, with locks of
//! its own.

mod declared_keys;
mod frame_checks;
mod hearing;
mod keeper;
mod library_panics;
mod links;
mod session_id;
mod settings;
mod zenoh_config;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError, RwLock};
use std::thread::JoinHandle;

use tomoswarm_proto::{Key, Message, Sender, Topic};
use zenoh::Wait;
use zenoh::qos::{CongestionControl, Priority};

use self::declared_keys::DeclaredKeys;
use self::frame_checks::{under_its_key, whole};
use self::hearing::SessionHearing;
use self::keeper::LOOKS_EVERY;
use self::library_panics::guarded;
use self::links::LinkCounter;
pub use self::settings::{BusError, BusSettings, BusTraffic, SessionTopology, Trust};
use super::clock::Clock;
use super::mailbox::{Troubles, lock};
use super::trust::AccessRule;
use crate::exchange::egress::OutboundFrame;
pub use crate::exchange::ingress::HeardMessage;
use crate::exchange::ingress::{FrameRefusal, read};
use crate::exchange::joining::JoinEffect;
use crate::exchange::presence::Presence;
use crate::exchange::table::{Piggyback, Urgency, row};
use crate::exchange::{Exchange, ReceivedFrame};
use crate::time::Time;

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
        let ready = shared.with_exchange(|exchange, now| exchange.offer(now, frame));
        ready.into_iter().for_each(|frame| shared.send(frame));
    }

    /// Greets when it is time, and learns whether somebody can hear it; returns when to be called again, `None` = never.
    pub fn greet(&self, now: Time, is_linked: bool) -> Option<Time> {
        let (greeting, next) = self.shared.with_exchange(|exchange, _| {
            if is_linked {
                exchange.meet(now);
            }
            (exchange.greet(now), exchange.greets_at())
        });
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

    /// Lets the exchange take something, and wakes the keeper when something is to be sent sooner than it looks.
    fn with_exchange<T>(&self, takes: impl FnOnce(&mut Exchange, Time) -> T) -> T {
        let mut exchange = lock(&self.exchange);
        let now = self.clock.now();
        let looks_at = exchange.deadline().unwrap_or(Time::NEVER);
        let taken = takes(&mut exchange, now);
        let looks_at = looks_at.min(now + LOOKS_EVERY);
        if exchange.deadline().is_some_and(|at| at < looks_at) {
            self.more.notify_one();
        }
        taken
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

    /// Returns the session that is open, to be called without the lock.
    fn session(&self) -> Option<zenoh::Session> {
        self.session
            .read()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
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

    fn send(&self, frame: OutboundFrame) {
        // What travels with something else may be older than what its own thread has just sent: that is seen here, but for the
        // moment in which the library takes it.
        let may_wait = row(frame.topic.kind).piggybacks != Piggyback::Never;
        if may_wait && lock(&self.exchange).is_outdated(&frame) {
            return;
        }
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
        let topic = match &heard {
            HeardMessage::Message(_, message) => Some(Topic::of(message)),
            HeardMessage::Greeting(..) | HeardMessage::Unknown(_) => None,
        };
        let reception =
            self.with_exchange(|exchange, now| exchange.accept(now, bytes.len(), heard));
        let ReceivedFrame {
            heard,
            verdict,
            replies,
        } = match reception {
            Ok(reception) => reception,
            Err(refusal) => return self.refuse(Some(sender), key, &refusal),
        };
        if let Some(topic) = topic {
            self.keys.note(full_key, topic);
        }
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
