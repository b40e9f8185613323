//! `tomoswarm mock-autopilot`: simulated vehicles behind MAVLink, on real time or faster. It brings an environment and its
//! port together; what is said is decided by [`crate::sim::mavlink_vehicle`].

use std::net::SocketAddr;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

use super::clock::Clock;
use super::mavlink_port::{MavlinkPort, PortError, PortSettings};
use super::mavlink_sockets::{FromClient, by_queue};
use crate::sim::environment::{Environment, WorldEvent};
use crate::time::Time;

/// Words that wait for the vehicles; whoever says more waits.
const WORDS_WAITING: usize = 1024;
/// So many words are heard before time goes on.
const WORDS_AT_ONCE: usize = 256;
/// It sleeps no longer than this, so that it is asked whether to end.
const NAP: Duration = Duration::from_millis(200);

/// Simulated vehicles and who listens to them.
pub struct MockAutopilots {
    environment: Environment,
    port: MavlinkPort,
    inbox: Receiver<FromClient>,
    clock: Clock,
    speedup: f64,
    contacts: usize,
}

impl MockAutopilots {
    /// Opens the sockets; vehicles are switched on now, and their time goes so many times as fast as ours.
    ///
    /// # Errors
    /// [`PortError`].
    pub fn start(
        mut environment: Environment,
        settings: &PortSettings,
        speedup: f64,
    ) -> Result<MockAutopilots, PortError> {
        environment.begin(&mut Vec::new());
        let (words, inbox) = sync_channel(WORDS_WAITING);
        let port = MavlinkPort::open(
            &mut environment,
            settings,
            by_queue(words, |word| word, Some),
        )?;
        Ok(MockAutopilots {
            environment,
            port,
            inbox,
            clock: Clock::start(),
            speedup,
            contacts: 0,
        })
    }

    /// Returns where they are served.
    pub fn addresses(&self) -> &[SocketAddr] {
        self.port.addresses()
    }

    /// Serves them until it is asked to stop; returns how many contacts there were.
    pub fn run(mut self, is_stopped: &dyn Fn() -> bool) -> usize {
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
                self.port.take(now, word, &mut self.environment);
            }
            self.port.due(now, &mut self.environment);
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
        let due = environment.min(self.port.deadline());
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
}
