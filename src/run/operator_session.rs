//! An operator's part of the bus. What is heard waits in a bounded queue; when the operator cannot keep up the newest is
//! dropped and counted. It says nothing by itself.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use super::bus::{BusError, BusSession, BusSettings, HeardMessage, Publisher};
use super::clock::Clock;
use super::mailbox::Troubles;
use super::reach::ReachWatch;
use crate::exchange::presence::Presence;
use crate::time::Time;

/// Messages that may wait to be read.
const WAITING: usize = 8192;

/// What came over the bus, and when; `None` = somebody wants the listener to look up.
type Arrival = Option<(Time, HeardMessage)>;

/// Lets whoever waits in [`Session::hear`] look up at once.
#[derive(Clone)]
pub struct SessionWaker(SyncSender<Arrival>);

impl SessionWaker {
    /// Ends the waiting; who has much to read looks up soon anyway.
    pub fn wake(&self) {
        let _ = self.0.try_send(None);
    }
}

/// A tool's part of the bus.
pub struct Session {
    bus: BusSession,
    publisher: Publisher,
    heard: Receiver<Arrival>,
    waker: SessionWaker,
    clock: Clock,
    /// This machine's date when the clock was started, seconds since 1970.
    began_utc_s: f64,
    troubles: Troubles,
    dropped: Arc<AtomicU64>,
    reach: ReachWatch,
}

impl Session {
    /// Joins the bus with a venue file, by its hash.
    ///
    /// # Errors
    /// The settings cannot be used, or it cannot listen.
    pub fn open(settings: BusSettings, venue_hash: u64) -> Result<Session, BusError> {
        let (clock, troubles, dropped) = (
            Clock::start(),
            Troubles::default(),
            Arc::new(AtomicU64::new(0)),
        );
        let began_utc_s = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap_or_default()
            .as_secs_f64();
        let (say, heard) = sync_channel(WAITING);
        let of_ear = dropped.clone();
        let waker = SessionWaker(SyncSender::clone(&say));
        let hear = move |what: HeardMessage| {
            if say.try_send(Some((clock.now(), what))).is_err() {
                of_ear.fetch_add(1, Ordering::Relaxed);
            }
        };
        let presence = Presence::listening_at(venue_hash);
        let reach = ReachWatch::new(clock.now(), &settings);
        let hear_all = move |heard: Option<HeardMessage>, _| heard.into_iter().for_each(&hear);
        let bus = BusSession::join(settings, presence, clock, troubles.clone(), hear_all)?;
        let publisher = bus.publisher();
        publisher.speak();
        Ok(Session {
            bus,
            publisher,
            heard,
            waker,
            clock,
            began_utc_s,
            troubles,
            dropped,
            reach,
        })
    }

    /// Returns the time since the tool joined.
    pub fn now(&self) -> Time {
        self.clock.now()
    }

    /// Returns a moment by this machine's date, seconds since 1970; for people and notes, never to decide by.
    pub fn utc_s(&self, at: Time) -> f64 {
        self.began_utc_s + at.as_secs_f64()
    }

    /// Returns what ends the waiting of [`Session::hear`], from any thread.
    pub fn waker(&self) -> SessionWaker {
        self.waker.clone()
    }

    /// Waits for the next message until a moment, or until somebody ends the waiting.
    pub fn hear(&self, until: Time) -> Option<(Time, HeardMessage)> {
        let wait = until.since(self.now());
        match self.heard.recv_timeout(wait) {
            Ok(heard) => heard,
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => {
                // The bus is gone; whoever listens must not turn in circles.
                std::thread::sleep(wait.min(Duration::from_millis(50)));
                None
            }
        }
    }

    /// Returns what messages are published by.
    pub fn publisher(&self) -> &Publisher {
        &self.publisher
    }

    /// Returns whether anyone can be reached.
    pub fn is_linked(&self) -> bool {
        self.publisher.links() > 0
    }

    /// Returns whether anyone can be reached, and logs who is sought in vain as long as nobody ever was.
    pub fn look_for_links(&mut self) -> bool {
        let is_linked = self.is_linked();
        self.reach.look(self.now(), is_linked);
        is_linked
    }

    /// Returns what is wrong with the bus, in words.
    pub fn troubles(&self) -> Vec<String> {
        self.troubles.list()
    }

    /// Returns how many messages were dropped since the tool could not keep up.
    pub fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Leaves the bus.
    pub fn close(self) {
        self.bus.close();
    }
}
