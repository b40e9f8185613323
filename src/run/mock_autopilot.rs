//! `tomoswarm mock-autopilot`: simulated vehicles behind MAVLink, on real time or faster. It brings an environment, the fleet that shows it
//! and sockets together; what is said is decided by [`crate::sim::mavlink_vehicle`].

use std::net::SocketAddr;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, SystemTime};

use super::clock::Clock;
use super::mavlink_sockets::{FromClient, MavlinkSockets, SocketKind};
use crate::mavlink::earth_frame::EarthFrame;
use crate::mavlink::signing::KEY_BYTES;
use crate::sim::environment::{Environment, WorldEvent};
use crate::sim::mavlink_fleet::{Endpoints, MavlinkFleet};
use crate::time::Time;

/// Words that wait for the vehicles; whoever says more waits.
const WORDS_WAITING: usize = 1024;
/// So many words are heard before time goes on.
const WORDS_AT_ONCE: usize = 256;
/// It sleeps no longer than this, so that it is asked whether to end.
const NAP: Duration = Duration::from_millis(200);
/// Signatures count from 1 January 2015 on.
const SIGNATURES_FROM: Duration = Duration::from_secs(1_420_070_400);

/// How simulated vehicles are served.
#[derive(Clone, Debug)]
pub struct MockSettings {
    /// Which sockets.
    pub sockets: SocketKind,
    /// The first endpoint; those of more vehicles have the next ports.
    pub address: SocketAddr,
    /// How vehicles are shown.
    pub endpoints: Endpoints,
    /// How much faster than real time it goes.
    pub speedup: f64,
    /// Only who signs with this key is heard.
    pub key: Option<[u8; KEY_BYTES]>,
    /// Where the vehicles' frame lies.
    pub frame: EarthFrame,
}

/// Why vehicles cannot be served.
#[derive(Debug, thiserror::Error)]
#[error("{address} cannot be used: {source}")]
pub struct MockError {
    address: SocketAddr,
    source: std::io::Error,
}

/// Simulated vehicles and who listens to them.
pub struct MockAutopilots {
    environment: Environment,
    fleet: MavlinkFleet,
    sockets: MavlinkSockets,
    inbox: Receiver<FromClient>,
    clock: Clock,
    speedup: f64,
    contacts: usize,
}

impl MockAutopilots {
    /// Opens the sockets; vehicles are switched on now.
    ///
    /// # Errors
    /// [`MockError`].
    pub fn start(
        mut environment: Environment,
        settings: &MockSettings,
    ) -> Result<MockAutopilots, MockError> {
        environment.begin(&mut Vec::new());
        let fleet = MavlinkFleet::new(
            &environment,
            settings.frame,
            settings.endpoints,
            settings.key,
        );
        let (words, inbox): (SyncSender<FromClient>, _) = sync_channel(WORDS_WAITING);
        let sockets =
            MavlinkSockets::open(settings.sockets, settings.address, fleet.endpoints(), words)
                .map_err(|(address, source)| MockError { address, source })?;
        Ok(MockAutopilots {
            environment,
            fleet,
            sockets,
            inbox,
            clock: Clock::start(),
            speedup: settings.speedup,
            contacts: 0,
        })
    }

    /// Returns where they are served.
    pub fn addresses(&self) -> &[SocketAddr] {
        self.sockets.addresses()
    }

    /// Serves them until it is asked to stop; returns how many contacts there were.
    pub fn run(mut self, is_stopped: &dyn Fn() -> bool) -> usize {
        let mut out = Vec::new();
        while !is_stopped() {
            let word = match self.inbox.recv_timeout(self.wait()) {
                Ok(word) => Some(word),
                Err(RecvTimeoutError::Timeout) => None,
                // The sockets are ours: somebody can always speak.
                Err(RecvTimeoutError::Disconnected) => break,
            };
            let now = self.now();
            self.go_on(now);
            let more: Vec<FromClient> = self.inbox.try_iter().take(WORDS_AT_ONCE).collect();
            for word in word.into_iter().chain(more) {
                self.take(now, word, &mut out);
            }
            self.fleet.due(now, &mut self.environment, &mut out);
            for (client, bytes) in out.drain(..) {
                self.sockets.send(client, bytes);
            }
        }
        self.contacts
    }

    fn now(&self) -> Time {
        Time::from_secs_f64(self.clock.now().as_secs_f64() * self.speedup)
    }

    /// Returns how long nothing is due, in real time.
    fn wait(&self) -> Duration {
        let environment = self
            .environment
            .deadline()
            .map_or(Time::NEVER, |deadline| deadline.at);
        let due = environment.min(self.fleet.deadline());
        due.since(self.now()).div_f64(self.speedup).min(NAP)
    }

    /// Lets everything happen that is due in the environment.
    fn go_on(&mut self, now: Time) {
        let mut happened = Vec::new();
        self.environment.wake(now, &mut happened);
        for event in happened {
            if let WorldEvent::Contact(collision) = event {
                self.contacts += 1;
                tracing::warn!("{}", collision.in_words());
            }
        }
    }

    fn take(
        &mut self,
        now: Time,
        word: FromClient,
        out: &mut Vec<(crate::sim::mavlink_vehicle::ClientId, Vec<u8>)>,
    ) {
        match word {
            FromClient::Joined { client, endpoint } => {
                self.fleet.joined(now, client, endpoint, signing_clock())
            }
            FromClient::Bytes { client, bytes } => {
                self.fleet
                    .hear(now, client, &bytes, &mut self.environment, out);
            }
            FromClient::Left { client } => self.fleet.left(client),
        }
    }
}

/// Returns the time of signatures, units of 10 µs since 2015; 0 where the clock is behind that.
pub fn signing_clock() -> u64 {
    let since = SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .unwrap_or_default();
    let counted = since.saturating_sub(SIGNATURES_FROM).as_micros() / 10;
    u64::try_from(counted).unwrap_or(u64::MAX)
}
