//! What the process of a vehicle and that of the ground station have in common: it greets, feeds the watchdog, looks for
//! actors that are stuck, and ends in order.
//!
//! ```text
//!   start ─► asking ─► member ──────────────► asked to stop ─► in order: actors, disk, bus ─► exit 0
//!               │ refused: exit 2   │ fault: the same order, exit 1
//! ```

use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use sd_notify::NotifyState;
use tomoswarm_proto::Message;

use super::bus::{BusError, BusSettings};
use super::clock::Clock;
use super::mailbox::{Ending, RuntimeContext, Troubles};
use super::member::BusMember;
use crate::time::Time;
use tomoswarm_proto::{Hello, Sender};

/// The watchdog is fed as long as no vital actor has been acting for this long without a pause; whether it says anything of
/// use is not looked at.
const STUCK_AFTER: Duration = Duration::from_secs(20);
/// The watchdog is fed this often, and the process looks whether it is to end.
const LOOKS_EVERY: Duration = Duration::from_millis(100);
/// What is said in intervals: health, report, status.
const TICK: Duration = Duration::from_secs(1);

/// How a process ended.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Finish {
    /// It was asked to.
    Asked,
    /// It cannot go on.
    Ending(Ending),
}

/// The common part of a process.
pub struct Process {
    context: RuntimeContext,
    endings: Receiver<Ending>,
    ticked: Time,
}

impl Process {
    /// Begins; the clock starts now.
    pub fn begin() -> Process {
        let (endings, ended) = channel();
        let context = RuntimeContext {
            clock: Clock::start(),
            troubles: Troubles::default(),
            endings,
        };
        Process {
            context,
            endings: ended,
            ticked: Time::ZERO,
        }
    }

    /// Returns what all threads share.
    pub fn context(&self) -> &RuntimeContext {
        &self.context
    }

    /// Goes on the bus.
    ///
    /// # Errors
    /// The bus cannot be opened.
    pub fn join(
        &self,
        settings: BusSettings,
        own: Hello,
        hear: impl Fn(Sender, Message) + Send + Sync + 'static,
    ) -> Result<BusMember, BusError> {
        BusMember::open(settings, own, &self.context, hear)
    }

    /// Asks whether it may take part, until it does; returns how it ended if it may not, or was asked to stop meanwhile.
    pub fn ask(&mut self, member: &mut BusMember, is_stopped: &dyn Fn() -> bool) -> Option<Finish> {
        loop {
            let next = member.greet(self.context.clock.now());
            if is_stopped() {
                return Some(Finish::Asked);
            }
            if member.is_member() {
                return None;
            }
            let wait = next.since(self.context.clock.now()).min(LOOKS_EVERY);
            if let Ok(ending) = self.endings.recv_timeout(wait) {
                return Some(Finish::Ending(ending));
            }
        }
    }

    /// Keeps the process going until it is asked to stop or cannot go on. `busy_for` gives how long the busiest vital
    /// actor has been acting; `tick` is called once a second.
    pub fn keep(
        &mut self,
        member: &mut BusMember,
        is_stopped: &dyn Fn() -> bool,
        busy_for: &dyn Fn(Time) -> Duration,
        tick: &mut dyn FnMut(Time, &BusMember, &Troubles),
    ) -> Finish {
        let mut is_ready = false;
        loop {
            let now = self.context.clock.now();
            let next = member.greet(now);
            if member.is_member() && !is_ready {
                is_ready = true;
                notify(&[NotifyState::Ready]);
            }
            if busy_for(now) < STUCK_AFTER {
                notify(&[NotifyState::Watchdog]);
            }
            if now.since(self.ticked) >= TICK {
                self.ticked = now;
                tick(now, member, &self.context.troubles);
            }
            if is_stopped() {
                notify(&[NotifyState::Stopping]);
                return Finish::Asked;
            }
            let wait = next.since(self.context.clock.now()).min(LOOKS_EVERY);
            match self.endings.recv_timeout(wait) {
                Ok(ending) => return Finish::Ending(ending),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {}
            }
        }
    }
}

/// Tells the system's service manager, if there is one; without one nobody listens, and that is no fault.
fn notify(states: &[NotifyState]) {
    if let Err(error) = sd_notify::notify(states) {
        tracing::debug!("the service manager cannot be told: {error}");
    }
}
