//! What the process of a vehicle and that of the ground station have in common: it greets, feeds the watchdog, looks for
//! actors that are stuck, and ends in order.
//!
//! ```text
//!   start ─► asking ─► member ──────────────► asked to stop ─► in order: actors, disk, bus ─► exit 0
//!               │ refused: exit 2   │ fault: the same order, exit 1
//! ```

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender as EndingSender, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use sd_notify::NotifyState;
use tomoswarm_proto::Message;

use super::bus::{BusError, BusSettings};
use super::clock::Clock;
use super::mailbox::{Ending, RuntimeContext, Troubles, lock};
use super::member::BusMember;
use crate::time::Time;
use tomoswarm_proto::{Hello, Sender};

/// The watchdog is fed as long as no vital actor has been acting for this long without a pause; whether it says anything of
/// use is not looked at.
const STUCK_AFTER: Duration = Duration::from_secs(20);
/// While it asks whether it may take part, the process looks this often whether it does.
const LOOKS_EVERY: Duration = Duration::from_millis(100);
/// What is said in intervals: health, report, status. The watchdog is fed at least as often.
const TICK: Duration = Duration::from_secs(1);

/// How a process ended.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Finish {
    /// It was asked to.
    Asked,
    /// It cannot go on.
    Ending(Ending),
}

/// Asks a process to end, from any thread, and wakes it for it; a handle.
#[derive(Clone, Debug, Default)]
pub struct StopRequest(Arc<Mutex<Asked>>);

#[derive(Debug, Default)]
struct Asked {
    is_asked: bool,
    /// Of the process that waits to be asked.
    endings: Option<EndingSender<Ending>>,
}

impl StopRequest {
    /// Asks; once is enough.
    pub fn ask(&self) {
        let mut asked = lock(&self.0);
        asked.is_asked = true;
        if let Some(endings) = &asked.endings {
            // Nobody listens any more only when the process is ending already.
            let _ = endings.send(Ending::Asked);
        }
    }

    /// Returns whether it was asked to.
    pub fn is_asked(&self) -> bool {
        lock(&self.0).is_asked
    }
}

/// The common part of a process.
pub struct Process {
    context: RuntimeContext,
    endings: Receiver<Ending>,
    stop: StopRequest,
    ticked: Time,
}

impl Process {
    /// Begins, to end when it is asked; the clock starts now.
    pub fn begin(stop: &StopRequest) -> Process {
        let (endings, ended) = channel();
        lock(&stop.0).endings = Some(endings.clone());
        let context = RuntimeContext {
            clock: Clock::start(),
            troubles: Troubles::default(),
            endings,
        };
        Process {
            context,
            endings: ended,
            stop: stop.clone(),
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
    pub fn ask(&mut self, member: &mut BusMember) -> Option<Finish> {
        loop {
            let next = member.greet(self.context.clock.now());
            if self.stop.is_asked() {
                return Some(Finish::Asked);
            }
            if member.is_member() {
                return None;
            }
            let wait = next.since(self.context.clock.now()).min(LOOKS_EVERY);
            if let Ok(ending) = self.endings.recv_timeout(wait) {
                return Some(finish_of(ending));
            }
        }
    }

    /// Keeps the process going until it is asked to stop or cannot go on. `busy_for` gives how long the busiest vital
    /// actor has been acting; `tick` is called once a second.
    pub fn keep(
        &mut self,
        member: &mut BusMember,
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
            if self.stop.is_asked() {
                notify(&[NotifyState::Stopping]);
                return Finish::Asked;
            }
            let due = match is_ready {
                true => self.ticked + TICK,
                false => now + LOOKS_EVERY,
            };
            let wait = next.min(due).since(self.context.clock.now());
            match self.endings.recv_timeout(wait) {
                // The request is seen in the next round.
                Ok(Ending::Asked) => {}
                Ok(ending) => return finish_of(ending),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {}
            }
        }
    }
}

fn finish_of(ending: Ending) -> Finish {
    match ending {
        Ending::Asked => Finish::Asked,
        Ending::Fault(_) | Ending::Refused(_) | Ending::Outdated(_) => Finish::Ending(ending),
    }
}

/// Tells the system's service manager, if there is one; without one nobody listens, and that is no fault.
fn notify(states: &[NotifyState]) {
    if let Err(error) = sd_notify::notify(states) {
        tracing::debug!("the service manager cannot be told: {error}");
    }
}
