//! An actor's place in a live process: its inbox, which anyone may put inputs into without waiting, and the thread that
//! lets it act.
//!
//! The thread sleeps until something is unread or the actor's deadline has come; what may wait ([`Input::may_wait`]) is read
//! with the next input that may not, or after 100 ms: who tells the thread one need not wake it when it looks up soon enough
//! by itself, and while such inputs come it does. At a *shared* mailbox whoever tells the
//! actor something lets it act at once, on its own thread, when nobody else does: waking a thread takes longer than joining
//! a tile. It does so a few times at most: what others go on telling is left to the actor's thread, or a flood on one link
//! would keep the thread that has another link to read. It keeps the actor contract by [`ActorCell`], as the simulator
//! does. What the actor says goes to a closure; nothing here knows who hears whom.
//!
//! ```text
//!   tell ─► inbox ─► thread: cell.act(now) ─► output
//!                      │ fault or panic
//!                      ├─ restart: a fresh actor after 1, 2, 4 s; then it stays down, and that is a trouble
//!                      └─ stop node: the process is told to end in order
//! ```

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, RwLock};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::clock::Clock;
use crate::actor::{Actor, ActorCell, ActorStep, Fault, Inbox, Input, NodeActor, RestartPolicy};
use crate::exchange::restarts::Restarts;
use crate::store::recording::StepRecorder;
use crate::time::Time;

/// Inputs of the queue class that may wait.
const INBOX: usize = 256;
/// What may wait is read after this long, or sooner together with what may not.
const LIES_UNREAD: Duration = Duration::from_millis(100);
/// So often whoever tells a shared mailbox something lets the actor act, for what came meanwhile.
const HELPS: usize = 4;
/// A trouble that stays, with other words, is logged again after this long.
const LOGGED_EVERY: Duration = Duration::from_secs(60);
/// A thread that has nothing to do looks up this often all the same.
const IDLE: Duration = Duration::from_secs(5);

/// What is wrong in a process, by who says it; shown to the operator.
#[derive(Clone, Debug, Default)]
pub struct Troubles {
    by_name: Arc<Mutex<BTreeMap<String, RaisedTrouble>>>,
}

/// A trouble, and when it was logged last.
#[derive(Clone, Debug)]
struct RaisedTrouble {
    what: String,
    logged: Instant,
}

impl Troubles {
    /// Names a trouble; a later one of the same name replaces it.
    pub fn raise(&self, who: &str, what: String) {
        let (mut by_name, now) = (lock(&self.by_name), Instant::now());
        let known = by_name.get(who);
        // A trouble with a count in it has other words each time.
        let is_logged = known.is_none_or(|known| {
            known.what != what && now.duration_since(known.logged) >= LOGGED_EVERY
        });
        if is_logged {
            tracing::warn!("{who}: {what}");
        }
        let logged = known.map_or(now, |known| if is_logged { now } else { known.logged });
        by_name.insert(who.to_owned(), RaisedTrouble { what, logged });
    }

    /// Takes a trouble back.
    pub fn clear(&self, who: &str) {
        if lock(&self.by_name).remove(who).is_some() {
            tracing::info!("{who}: in order again");
        }
    }

    /// Returns all that is wrong, in words.
    pub fn list(&self) -> Vec<String> {
        lock(&self.by_name)
            .iter()
            .map(|(who, raised)| format!("{who}: {}", raised.what))
            .collect()
    }
}

/// The inbox of an actor, shared between its thread and everyone who tells it something.
pub struct Mailbox<I: Input> {
    name: &'static str,
    unread: Arc<Unread<I>>,
}

/// Lets an actor act on the caller's thread.
type Help = Arc<dyn Fn() + Send + Sync>;

struct Unread<I> {
    state: Mutex<MailboxState<I>>,
    come: Condvar,
    /// Since when the actor acts, nanoseconds + 1; 0 = it waits.
    busy_since: AtomicU64,
    /// When the actor is to be woken, nanoseconds.
    deadline: AtomicU64,
    /// Whether who tells it something may let it act at once.
    is_shared: bool,
    help: RwLock<Option<Help>>,
}

struct MailboxState<I> {
    inbox: Inbox<I>,
    /// Whether something is unread that may not wait.
    is_pressing: bool,
    /// Whether something is unread that may.
    is_waiting: bool,
    /// Whether what it read last was some that may, and it expects more.
    is_watchful: bool,
    /// When the thread looks up by itself; `None` = it does not sleep.
    looks_up_by: Option<Instant>,
    is_closed: bool,
    /// Why the actor cannot go on.
    fault: Option<Fault>,
}

impl<I: Input> Clone for Mailbox<I> {
    fn clone(&self) -> Mailbox<I> {
        Mailbox {
            name: self.name,
            unread: self.unread.clone(),
        }
    }
}

impl<I: Input> Mailbox<I> {
    /// Sets up a mailbox that nobody reads yet; its actor acts on a thread of its own.
    pub fn new(name: &'static str) -> Mailbox<I> {
        Mailbox::set_up(name, false)
    }

    /// Sets up a mailbox whose actor also acts on the thread of whoever tells it something, when it is at rest: that saves
    /// the time of waking a thread. Only for an actor that is never busy for long.
    pub fn shared(name: &'static str) -> Mailbox<I> {
        Mailbox::set_up(name, true)
    }

    fn set_up(name: &'static str, is_shared: bool) -> Mailbox<I> {
        let state = Mutex::new(MailboxState {
            inbox: Inbox::new(INBOX),
            is_pressing: false,
            is_waiting: false,
            is_watchful: false,
            looks_up_by: None,
            is_closed: false,
            fault: None,
        });
        let unread = Unread {
            state,
            come: Condvar::new(),
            busy_since: AtomicU64::new(0),
            deadline: AtomicU64::new(u64::MAX),
            is_shared,
            help: RwLock::new(None),
        };
        Mailbox {
            name,
            unread: Arc::new(unread),
        }
    }

    /// Puts an input into the inbox; never waits for the actor.
    pub fn tell(&self, input: I) {
        let may_wait = input.may_wait();
        let mut state = lock(&self.unread.state);
        state.inbox.push(input);
        state.is_pressing |= !may_wait;
        state.is_waiting |= may_wait;
        let sleeps_until = state.looks_up_by;
        drop(state);
        if may_wait {
            if sleeps_until.is_some_and(|at| at > Instant::now() + LIES_UNREAD) {
                self.unread.come.notify_one();
            }
            return;
        }
        let help = self
            .unread
            .help
            .read()
            .unwrap_or_else(PoisonError::into_inner)
            .clone();
        match help {
            Some(help) => help(),
            None => self.unread.come.notify_one(),
        }
    }

    /// Returns how many inputs were dropped unread.
    pub fn dropped(&self) -> u64 {
        lock(&self.unread.state).inbox.dropped()
    }

    /// Ends the actor: its thread ends after what it does now.
    pub fn close(&self) {
        lock(&self.unread.state).is_closed = true;
        *self
            .unread
            .help
            .write()
            .unwrap_or_else(PoisonError::into_inner) = None;
        self.unread.come.notify_all();
    }

    /// Tells for how long the actor has been acting without a pause.
    pub fn busy_for(&self, now: Time) -> Duration {
        match self.unread.busy_since.load(Ordering::Relaxed) {
            0 => Duration::ZERO,
            since => now.since(Time::from_nanos(since - 1)),
        }
    }

    /// Waits until something is unread, the actor's deadline has come, or it cannot go on; false = closed.
    fn wait(&self, clock: Clock) -> bool {
        let mut state = lock(&self.unread.state);
        // After inputs that may wait further ones are expected.
        let mut looks_at = state.is_watchful.then(|| clock.now() + LIES_UNREAD);
        let mut has_slept = false;
        loop {
            let until = Time::from_nanos(self.unread.deadline.load(Ordering::Relaxed));
            let now = clock.now();
            if state.is_waiting {
                looks_at.get_or_insert(now + LIES_UNREAD);
            }
            let has_looked = looks_at.is_some_and(|at| at <= now);
            let is_due = state.is_pressing || state.fault.is_some() || until <= now;
            let has_lain = state.is_waiting && (has_looked || has_slept);
            if state.is_closed || is_due || has_lain {
                state.is_watchful = state.is_waiting;
                state.looks_up_by = None;
                return !state.is_closed;
            }
            looks_at.take_if(|_| has_looked);
            let wait = until
                .min(looks_at.unwrap_or(Time::NEVER))
                .since(now)
                .min(IDLE);
            state.looks_up_by = Some(Instant::now() + wait);
            let (woken, timeout) = self
                .unread
                .come
                .wait_timeout(state, wait)
                .unwrap_or_else(PoisonError::into_inner);
            (state, has_slept) = (woken, timeout.timed_out());
        }
    }

    /// Waits this long, or until the mailbox is closed; returns whether it is still open.
    fn pause(&self, clock: Clock, span: Duration) -> bool {
        let until = clock.now() + span;
        let mut state = lock(&self.unread.state);
        while !state.is_closed && clock.now() < until {
            let wait = until.since(clock.now());
            state = self
                .unread
                .come
                .wait_timeout(state, wait)
                .unwrap_or_else(PoisonError::into_inner)
                .0;
        }
        !state.is_closed
    }

    fn take(&self) -> Vec<I> {
        let mut state = lock(&self.unread.state);
        (state.is_pressing, state.is_waiting) = (false, false);
        std::iter::from_fn(|| state.inbox.pop()).collect()
    }

    fn is_pressing(&self) -> bool {
        lock(&self.unread.state).is_pressing
    }

    /// Sets when the actor is to be woken; its thread hears of it when that is sooner than it knew.
    fn set_deadline(&self, at: Option<Time>) {
        let at = at.map_or(u64::MAX, Time::as_nanos);
        if at < self.unread.deadline.swap(at, Ordering::Relaxed) {
            // With the state locked the thread is either before its look at the deadline, or waits already.
            let _tray = lock(&self.unread.state);
            self.unread.come.notify_one();
        }
    }

    fn fail(&self, fault: Fault) {
        lock(&self.unread.state).fault = Some(fault);
        self.unread.come.notify_all();
    }
}

/// What all threads of a process share.
#[derive(Clone)]
pub struct RuntimeContext {
    /// The process's clock.
    pub clock: Clock,
    /// What is wrong.
    pub troubles: Troubles,
    /// Why the process is to end.
    pub endings: Sender<Ending>,
}

/// Why a process ends.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Ending {
    /// It was asked to end.
    Asked,
    /// An actor cannot go on.
    Fault(Fault),
    /// It may not take part in the bus.
    Refused(String),
    /// Others know a later start of it; its next start comes after that.
    Outdated(String),
}

/// Starts an actor behind a mailbox, on a thread of its own. `make` makes it at the start and again after a fault;
/// `output` takes what it says; what it does is written down where there is a scribe.
///
/// # Errors
/// The machine has no thread to give.
pub fn start_actor<A, M, S>(
    context: &RuntimeContext,
    mailbox: &Mailbox<A::In>,
    policy: RestartPolicy,
    scribe: Option<StepRecorder>,
    make: M,
    output: S,
) -> std::io::Result<JoinHandle<()>>
where
    A: NodeActor,
    M: FnMut() -> A + Send + 'static,
    S: FnMut(A::Out) + Send + 'static,
{
    let at_work = Mutex::new(Work {
        cell: None,
        scribe,
        output,
    });
    let worker = Arc::new(Worker {
        context: context.clone(),
        mailbox: mailbox.clone(),
        at_work,
    });
    if mailbox.unread.is_shared {
        let shared = worker.clone();
        let help: Help = Arc::new(move || shared.help());
        *mailbox
            .unread
            .help
            .write()
            .unwrap_or_else(PoisonError::into_inner) = Some(help);
    }
    std::thread::Builder::new()
        .name(mailbox.name.to_owned())
        .spawn(move || work(&worker, policy, make))
}

/// An actor's place of work: who holds the lock lets it act.
struct Worker<A: Actor, S>
where
    A::In: Input,
{
    context: RuntimeContext,
    mailbox: Mailbox<A::In>,
    at_work: Mutex<Work<A, S>>,
}

struct Work<A: Actor, S>
where
    A::In: Input,
{
    /// `None` = it cannot go on, or has not begun yet.
    cell: Option<ActorCell<A>>,
    scribe: Option<StepRecorder>,
    output: S,
}

impl<A, S> Worker<A, S>
where
    A: NodeActor,
    S: FnMut(A::Out),
{
    /// Lets the actor act on the caller's thread, unless somebody else does so just now: who does looks again
    /// afterwards, and in the end leaves the rest to the actor's own thread.
    fn help(&self) {
        for _ in 0..HELPS {
            let Ok(mut work) = self.at_work.try_lock() else {
                return;
            };
            if work.cell.is_none() {
                return;
            }
            self.act(&mut work);
            drop(work);
            if !self.mailbox.is_pressing() {
                return;
            }
        }
        self.mailbox.unread.come.notify_one();
    }

    /// Lets the actor act on all that is unread and due.
    fn act(&self, work: &mut Work<A, S>) {
        let Work {
            cell: place,
            scribe,
            output,
        } = work;
        let Some(cell) = place else { return };
        let (now, inputs) = (self.context.clock.now(), self.mailbox.take());
        self.mailbox
            .unread
            .busy_since
            .store(now.as_nanos() + 1, Ordering::Relaxed);
        let ended = catch_unwind(AssertUnwindSafe(|| {
            inputs.into_iter().for_each(|input| cell.push(input));
            let name = self.mailbox.name;
            let mut watched = scribe.as_mut();
            watched.take_if(|scribe| !scribe.prepare(now, name, cell.actor()));
            let watch = watched.map(|scribe| |step| scribe.step(ActorStep::new::<A>(name, step)));
            cell.act_watched(now, watch, &mut *output)
        }));
        self.mailbox.unread.busy_since.store(0, Ordering::Relaxed);
        let fault = match ended {
            Ok(Ok(())) => {
                return self
                    .mailbox
                    .set_deadline(cell.deadline().map(|deadline| deadline.at));
            }
            Ok(Err(fault)) => fault,
            Err(panic) => Fault {
                actor: self.mailbox.name,
                reason: words_of(panic.as_ref()),
            },
        };
        *place = None;
        scribe.iter_mut().for_each(StepRecorder::restarted);
        self.mailbox.fail(fault);
    }

    /// Lets an actor act until it cannot go on; `None` = its mailbox was closed.
    fn attend(&self, actor: A) -> Option<Fault> {
        let cell = ActorCell::new(actor);
        self.mailbox
            .set_deadline(cell.deadline().map(|deadline| deadline.at));
        lock(&self.at_work).cell = Some(cell);
        loop {
            if !self.mailbox.wait(self.context.clock) {
                return None;
            }
            let fault = lock(&self.mailbox.unread.state).fault.take();
            if fault.is_some() {
                self.mailbox.set_deadline(None);
                return fault;
            }
            self.act(&mut lock(&self.at_work));
        }
    }
}

fn work<A, M, S>(worker: &Worker<A, S>, policy: RestartPolicy, mut make: M)
where
    A: NodeActor,
    M: FnMut() -> A,
    S: FnMut(A::Out),
{
    let (context, mailbox) = (&worker.context, &worker.mailbox);
    let mut restarts = Restarts::default();
    loop {
        let fault = match catch_unwind(AssertUnwindSafe(&mut make)) {
            Ok(actor) => worker.attend(actor),
            Err(panic) => Some(Fault {
                actor: mailbox.name,
                reason: words_of(panic.as_ref()),
            }),
        };
        let Some(fault) = fault else { return };
        let wait = match policy {
            RestartPolicy::Restart => restarts.failed(context.clock.now()),
            RestartPolicy::StopNode => None,
        };
        let Some(wait) = wait else {
            context
                .troubles
                .raise(mailbox.name, format!("stays down: {}", fault.reason));
            if policy == RestartPolicy::StopNode {
                // Nobody listens any more only when the process is ending already.
                let _ = context.endings.send(Ending::Fault(fault));
            }
            return;
        };
        context
            .troubles
            .raise(mailbox.name, format!("begins anew: {}", fault.reason));
        if !mailbox.pause(context.clock, wait) {
            return;
        }
    }
}

fn words_of(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    format!(
        "panicked: {}",
        text.unwrap_or_else(|| "without words".to_owned())
    )
}

/// Locks, also after a thread that held the lock has panicked: all that is locked here is whole between statements.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actor::InputClass;
    use crate::time::Deadline;
    use serde::{Deserialize, Serialize};
    use std::sync::atomic::AtomicBool;
    use std::sync::mpsc::{Receiver, channel};

    /// Repeats what it is told; 13 makes it panic, 7 is a fault.
    #[derive(Serialize, Deserialize)]
    struct Echo {
        wakes: u32,
        next: Time,
    }

    #[derive(Clone, Serialize, Deserialize)]
    struct Told(u32);
    /// The first number of those that may wait.
    const WAITS: u32 = 20;

    impl Input for Told {
        type Key = ();
        fn class(&self) -> InputClass<()> {
            InputClass::Queue
        }
        fn may_wait(&self) -> bool {
            (WAITS..WAITS + 10).contains(&self.0)
        }
    }

    impl Actor for Echo {
        type In = Told;
        type Out = u32;
        fn handle(&mut self, _now: Time, input: Told, out: &mut Vec<u32>) -> Result<(), Fault> {
            assert_ne!(input.0, 13, "thirteen");
            if input.0 == 7 {
                return Err(Fault {
                    actor: "echo",
                    reason: "seven".to_owned(),
                });
            }
            out.push(input.0);
            Ok(())
        }
        fn deadline(&self) -> Option<Deadline> {
            (self.wakes > 0).then_some(Deadline {
                at: self.next,
                why: "tick",
            })
        }
        fn wake(&mut self, now: Time, out: &mut Vec<u32>) -> Result<(), Fault> {
            (self.wakes, self.next) = (self.wakes - 1, now + Duration::from_millis(5));
            out.push(1000);
            Ok(())
        }
    }

    fn context() -> (RuntimeContext, Receiver<Ending>) {
        let (endings, ended) = channel();
        let context = RuntimeContext {
            clock: Clock::start(),
            troubles: Troubles::default(),
            endings,
        };
        (context, ended)
    }

    fn started(
        policy: RestartPolicy,
        wakes: u32,
    ) -> (
        Mailbox<Told>,
        Receiver<u32>,
        Receiver<Ending>,
        Troubles,
        JoinHandle<()>,
    ) {
        let (context, failed) = context();
        let (outputs, heard) = channel();
        let mailbox = Mailbox::new("echo");
        let make = move || Echo {
            wakes,
            next: Time::ZERO,
        };
        let output = move |out| outputs.send(out).unwrap_or_default();
        let thread = start_actor(&context, &mailbox, policy, None, make, output).unwrap();
        (mailbox, heard, failed, context.troubles.clone(), thread)
    }

    const SOON: Duration = Duration::from_secs(5);

    #[test]
    fn what_is_told_is_handled_and_deadlines_are_kept() {
        let (mailbox, heard, _, _, thread) = started(RestartPolicy::StopNode, 3);
        mailbox.tell(Told(5));
        let all: Vec<u32> = (0..4).map(|_| heard.recv_timeout(SOON).unwrap()).collect();
        assert_eq!(all.iter().filter(|out| **out == 1000).count(), 3);
        assert!(all.contains(&5));
        mailbox.close();
        thread.join().unwrap();
    }

    #[test]
    fn a_leaf_that_panics_begins_anew_and_says_so() {
        let (mailbox, heard, _, troubles, thread) = started(RestartPolicy::Restart, 0);
        mailbox.tell(Told(13));
        assert!(
            heard.recv_timeout(Duration::from_millis(500)).is_err(),
            "it waits a second first"
        );
        mailbox.tell(Told(3));
        assert_eq!(heard.recv_timeout(SOON), Ok(3));
        assert!(
            troubles.list()[0].contains("panicked: ") && troubles.list()[0].contains("thirteen")
        );
        mailbox.close();
        thread.join().unwrap();
    }

    #[test]
    fn at_a_shared_desk_the_teller_lets_the_actor_act_and_nothing_is_lost() {
        let (context, _ended) = context();
        let mailbox = Mailbox::shared("echo");
        let (outputs, heard) = channel();
        let output = move |out| {
            outputs
                .send((out, std::thread::current().id()))
                .unwrap_or_default()
        };
        let make = || Echo {
            wakes: 2,
            next: Time::ZERO,
        };
        let thread = start_actor(
            &context,
            &mailbox,
            RestartPolicy::StopNode,
            None,
            make,
            output,
        )
        .unwrap();
        // The two wakes are the thread's.
        let own: Vec<_> = (0..2).map(|_| heard.recv_timeout(SOON).unwrap()).collect();
        assert!(
            own.iter()
                .all(|(out, by)| *out == 1000 && *by == thread.thread().id())
        );
        while mailbox.busy_for(context.clock.now()) > Duration::ZERO {}
        std::thread::sleep(Duration::from_millis(20));
        mailbox.tell(Told(1));
        assert_eq!(
            heard.recv_timeout(SOON),
            Ok((1, std::thread::current().id()))
        );
        let tellers: Vec<_> = (0..4)
            .map(|_| {
                let mailbox = mailbox.clone();
                std::thread::spawn(move || {
                    (100..1100).for_each(|number| mailbox.tell(Told(number)))
                })
            })
            .collect();
        tellers
            .into_iter()
            .for_each(|teller| teller.join().unwrap());
        let counted =
            std::iter::from_fn(|| heard.recv_timeout(Duration::from_millis(300)).ok()).count();
        assert_eq!(counted as u64 + mailbox.dropped(), 4000);
        mailbox.close();
        thread.join().unwrap();
    }

    #[test]
    fn who_tells_something_is_not_kept_by_what_others_go_on_telling() {
        let (context, _ended) = context();
        let mailbox = Mailbox::shared("echo");
        let (others, is_over) = (mailbox.clone(), Arc::new(AtomicBool::new(false)));
        let ended = is_over.clone();
        let (begun, begins) = channel();
        // Whatever is handled, others have told something new meanwhile.
        let output = move |out| match out {
            1000 => begun.send(()).unwrap(),
            _ if ended.load(Ordering::Relaxed) => {}
            _ => others.tell(Told(1)),
        };
        let make = || Echo {
            wakes: 1,
            next: Time::ZERO,
        };
        let thread = start_actor(
            &context,
            &mailbox,
            RestartPolicy::StopNode,
            None,
            make,
            output,
        )
        .unwrap();
        begins.recv_timeout(SOON).unwrap();
        while mailbox.busy_for(context.clock.now()) > Duration::ZERO {}
        std::thread::sleep(Duration::from_millis(20));
        let (told, is_told) = channel();
        let teller = mailbox.clone();
        let telling = std::thread::spawn(move || {
            teller.tell(Told(2));
            told.send(()).unwrap();
        });
        let came_back = is_told.recv_timeout(SOON);
        is_over.store(true, Ordering::Relaxed);
        assert_eq!(came_back, Ok(()), "it has to let the actor act for ever");
        telling.join().unwrap();
        mailbox.close();
        thread.join().unwrap();
    }

    #[test]
    fn what_may_wait_is_read_a_moment_later_and_at_once_with_what_may_not() {
        let (mailbox, heard, _, _, thread) = started(RestartPolicy::StopNode, 0);
        let began = std::time::Instant::now();
        mailbox.tell(Told(WAITS));
        assert_eq!(heard.recv_timeout(SOON), Ok(WAITS));
        assert!(began.elapsed() >= LIES_UNREAD, "{:?}", began.elapsed());
        // In their order, all of them, also while it looks up by itself, and after it has looked in vain.
        for pause_ms in [0, 10, 120] {
            std::thread::sleep(Duration::from_millis(pause_ms));
            [WAITS + 1, WAITS + 2, 5, WAITS + 3]
                .into_iter()
                .for_each(|number| mailbox.tell(Told(number)));
            let all: Vec<u32> = (0..4).map(|_| heard.recv_timeout(SOON).unwrap()).collect();
            assert_eq!(all, [WAITS + 1, WAITS + 2, 5, WAITS + 3]);
        }
        mailbox.close();
        thread.join().unwrap();
    }

    #[test]
    fn what_may_wait_is_read_in_time_however_far_off_the_deadline_is() {
        for deadline_ms in [70, 1000, 20_000] {
            let began = Instant::now();
            let (context, _ended) = context();
            let (outputs, heard) = channel();
            let mailbox = Mailbox::new("echo");
            let deadline = Time::ZERO + Duration::from_millis(deadline_ms);
            let make = move || Echo {
                wakes: 1,
                next: deadline,
            };
            let output = move |out| outputs.send((out, Instant::now())).unwrap_or_default();
            let policy = RestartPolicy::StopNode;
            let thread = start_actor(&context, &mailbox, policy, None, make, output).unwrap();
            // It sleeps already.
            std::thread::sleep(Duration::from_millis(10));
            let told_at = Instant::now();
            mailbox.tell(Told(WAITS));
            let mut until_it_comes = std::iter::from_fn(|| heard.recv_timeout(SOON).ok());
            let told = until_it_comes.find(|(what, _)| *what == WAITS).unwrap();
            let lay = told.1.duration_since(told_at);
            match deadline_ms {
                // Told after the deadline, if the machine was busy until then, it lies as long as any other.
                70 if told_at >= began + Duration::from_millis(70) => {}
                70 => assert!(lay < LIES_UNREAD, "it is read with the deadline: {lay:?}"),
                _ => assert!(lay >= LIES_UNREAD && lay < LIES_UNREAD * 8, "{lay:?}"),
            }
            mailbox.close();
            thread.join().unwrap();
        }
    }

    #[test]
    fn a_vital_actor_that_fails_ends_the_process() {
        let (mailbox, _, failed, _, thread) = started(RestartPolicy::StopNode, 0);
        mailbox.tell(Told(7));
        let Ok(Ending::Fault(fault)) = failed.recv_timeout(SOON) else {
            panic!("no fault")
        };
        assert_eq!(fault.reason, "seven");
        thread.join().unwrap();
    }
}
