//! What the process of a vehicle and that of the ground station have in common: it greets, feeds the watchdog, looks for
//! actors that are stuck, and ends in order. It looks after its node once a second, and at once when it is asked to.
//!
//! ```text
//!   start ─► asking ─► member ──────────────► asked to stop ─► in order: actors, disk, bus ─► exit 0
//!               │ refused: exit 2   │ fault: the same order, exit 1
//! ```

use std::sync::atomic::{AtomicBool, Ordering};
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

/// Asks a process to look after its node at once, from any thread, and wakes it for it; a handle.
#[derive(Clone, Debug)]
pub struct LookRequest {
    is_asked: Arc<AtomicBool>,
    endings: EndingSender<Ending>,
}

impl LookRequest {
    /// Asks; what is asked again before it has looked is one look.
    pub fn ask(&self) {
        if !self.is_asked.swap(true, Ordering::AcqRel) {
            // It wakes; that nobody has asked it to end is seen then.
            let _ = self.endings.send(Ending::Asked);
        }
    }
}

/// The common part of a process.
pub struct Process {
    context: RuntimeContext,
    endings: Receiver<Ending>,
    stop: StopRequest,
    look: LookRequest,
    ticked: Time,
}

impl Process {
    /// Begins, to end when it is asked; the clock starts now.
    pub fn begin(stop: &StopRequest) -> Process {
        let (endings, ended) = channel();
        lock(&stop.0).endings = Some(endings.clone());
        let look = LookRequest {
            is_asked: Arc::default(),
            endings: endings.clone(),
        };
        let context = RuntimeContext {
            clock: Clock::start(),
            troubles: Troubles::default(),
            endings,
        };
        Process {
            context,
            endings: ended,
            stop: stop.clone(),
            look,
            ticked: Time::ZERO,
        }
    }

    /// Returns what all threads share.
    pub fn context(&self) -> &RuntimeContext {
        &self.context
    }

    /// Returns the handle by which it is asked to look after its node at once.
    pub fn look_request(&self) -> LookRequest {
        self.look.clone()
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
            if let Some(finish) = self.wait(wait) {
                return Some(finish);
            }
        }
    }

    /// Keeps the process going until it is asked to stop or cannot go on. `busy_for` gives how long the busiest vital
    /// actor has been acting; `tick` is called once a second, and at once when it was asked for ([`LookRequest`]).
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
            if self.takes_up_look(now) {
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
            if let Some(finish) = self.wait(wait) {
                return finish;
            }
        }
    }

    /// Returns whether the node is to be looked after now; a look that was asked for is this one.
    fn takes_up_look(&self, now: Time) -> bool {
        let is_asked = self.look.is_asked.swap(false, Ordering::AcqRel);
        is_asked || now.since(self.ticked) >= TICK
    }

    /// Waits so long, or until it is woken; returns how it ends when it cannot go on.
    fn wait(&self, lasts: Duration) -> Option<Finish> {
        match self.endings.recv_timeout(lasts) {
            // What it was asked for is seen in the next round.
            Ok(Ending::Asked) => None,
            Ok(ending @ (Ending::Fault(_) | Ending::Refused(_) | Ending::Outdated(_))) => {
                Some(Finish::Ending(ending))
            }
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => None,
        }
    }
}

/// Tells the system's service manager, if there is one; without one nobody listens, and that is no fault.
fn notify(states: &[NotifyState]) {
    if let Err(error) = sd_notify::notify(states) {
        tracing::debug!("the service manager cannot be told: {error}");
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::*;

    const LONG: Duration = Duration::from_secs(20);

    #[test]
    fn a_process_that_is_asked_to_look_wakes_for_it_and_looks_once() {
        let process = Process::begin(&StopRequest::default());
        let (look, began) = (process.look_request(), Instant::now());
        assert!(!process.takes_up_look(Time::ZERO));
        let asking = std::thread::spawn(move || {
            look.ask();
            look.ask();
        });
        assert_eq!(process.wait(LONG), None);
        assert!(began.elapsed() < LONG / 2, "it has slept on");
        asking.join().unwrap();
        assert!(process.takes_up_look(Time::ZERO));
        assert!(!process.takes_up_look(Time::ZERO), "it was one look");
        assert!(
            process.takes_up_look(Time::ZERO + TICK),
            "one comes with every second"
        );
    }

    #[test]
    fn a_process_that_is_asked_to_end_wakes_for_it_and_a_fault_ends_it() {
        let stop = StopRequest::default();
        let process = Process::begin(&stop);
        stop.ask();
        assert_eq!(process.wait(LONG), None);
        assert!(process.stop.is_asked());
        let refused = Ending::Refused("its id is in use".to_owned());
        process.context.endings.send(refused.clone()).unwrap();
        assert_eq!(process.wait(LONG), Some(Finish::Ending(refused)));
    }
}
