//! An actor's place in a live process: its inbox, which anyone may put inputs into without waiting, and the thread that
//! lets it act.
//!
//! The thread sleeps until something is unread or the actor's deadline has come. At a *shared* desk whoever tells the actor
//! something lets it act at once, on its own thread, when nobody else does: waking a thread takes longer than joining a
//! tile. It keeps the actor contract by
//! [`Seat`], as the simulator does. What the actor says goes to the closure that the process gives; nothing here knows who
//! hears whom.
//!
//! ```text
//!   tell ─► inbox ─► thread: seat.act(now) ─► say(out)
//!                      │ fault or panic
//!                      ├─ leaf: a fresh actor after 1, 2, 4 s; then it stays down, and that is a trouble
//!                      └─ vital: the process is told to end in order
//! ```

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, RwLock};
use std::thread::JoinHandle;
use std::time::Duration;

use super::clock::Clock;
use serde::Serialize;

use crate::actor::{Actor, Fault, Inbox, Input, Seat, Step};
use crate::exchange::restarts::Restarts;
use crate::store::recording::{Deed, Recorder, Scribe};
use crate::time::Time;

/// Inputs of the queue class that may wait.
const INBOX: usize = 256;
/// A thread that has nothing to do looks up this often all the same.
const IDLE: Duration = Duration::from_secs(5);

/// What happens when an actor fails.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Post {
    /// It begins anew; others go on meanwhile.
    Leaf,
    /// The process ends in order, and is started anew from outside.
    Vital,
}

/// What is wrong in a process, by who says it; shown to the operator.
#[derive(Clone, Debug, Default)]
pub struct Troubles {
    said: Arc<Mutex<BTreeMap<String, String>>>,
}

impl Troubles {
    /// Names a trouble; a later one of the same name replaces it.
    pub fn raise(&self, who: &str, what: String) {
        let known = lock(&self.said).insert(who.to_owned(), what.clone());
        if known.as_ref() != Some(&what) {
            tracing::warn!("{who}: {what}");
        }
    }

    /// Takes a trouble back.
    pub fn clear(&self, who: &str) {
        if lock(&self.said).remove(who).is_some() {
            tracing::info!("{who}: in order again");
        }
    }

    /// Gives all that is wrong, in words.
    pub fn list(&self) -> Vec<String> {
        lock(&self.said).iter().map(|(who, what)| format!("{who}: {what}")).collect()
    }
}

/// The inbox of an actor, shared between its thread and everyone who tells it something.
pub struct Desk<I: Input> {
    name: &'static str,
    unread: Arc<Unread<I>>,
}

/// Lets an actor act on the caller's thread.
type Help = Arc<dyn Fn() + Send + Sync>;

struct Unread<I> {
    tray: Mutex<Tray<I>>,
    come: Condvar,
    /// Since when the actor acts, nanoseconds + 1; 0 = it waits.
    busy_since: AtomicU64,
    /// When the actor is to be woken, nanoseconds.
    deadline: AtomicU64,
    /// Whether who tells it something may let it act at once.
    is_shared: bool,
    help: RwLock<Option<Help>>,
}

struct Tray<I> {
    inbox: Inbox<I>,
    is_closed: bool,
    /// Why the actor cannot go on.
    fault: Option<Fault>,
}

impl<I: Input> Clone for Desk<I> {
    fn clone(&self) -> Desk<I> {
        Desk { name: self.name, unread: self.unread.clone() }
    }
}

impl<I: Input> Desk<I> {
    /// Sets up a desk at which nobody sits yet; its actor acts on a thread of its own.
    pub fn new(name: &'static str) -> Desk<I> {
        Desk::set_up(name, false)
    }

    /// Sets up a desk whose actor also acts on the thread of whoever tells it something, when it is at rest: that saves
    /// the time of waking a thread. Only for an actor that is never busy for long.
    pub fn shared(name: &'static str) -> Desk<I> {
        Desk::set_up(name, true)
    }

    fn set_up(name: &'static str, is_shared: bool) -> Desk<I> {
        let tray = Mutex::new(Tray { inbox: Inbox::new(INBOX), is_closed: false, fault: None });
        let unread = Unread {
            tray,
            come: Condvar::new(),
            busy_since: AtomicU64::new(0),
            deadline: AtomicU64::new(u64::MAX),
            is_shared,
            help: RwLock::new(None),
        };
        Desk { name, unread: Arc::new(unread) }
    }

    /// Puts an input into the inbox; never waits for the actor.
    pub fn tell(&self, input: I) {
        lock(&self.unread.tray).inbox.push(input);
        let help = self.unread.help.read().unwrap_or_else(PoisonError::into_inner).clone();
        match help {
            Some(help) => help(),
            None => self.unread.come.notify_one(),
        }
    }

    /// Tells how many inputs were dropped unread.
    pub fn dropped(&self) -> u64 {
        lock(&self.unread.tray).inbox.dropped()
    }

    /// Sends the actor home: its thread ends after what it does now.
    pub fn close(&self) {
        lock(&self.unread.tray).is_closed = true;
        *self.unread.help.write().unwrap_or_else(PoisonError::into_inner) = None;
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
        let mut tray = lock(&self.unread.tray);
        loop {
            let until = Time::from_nanos(self.unread.deadline.load(Ordering::Relaxed));
            let now = clock.now();
            if tray.is_closed || tray.fault.is_some() || !tray.inbox.is_empty() || until <= now {
                return !tray.is_closed;
            }
            let wait = until.since(now).min(IDLE);
            tray = self.unread.come.wait_timeout(tray, wait).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Waits so long, or until the desk is closed; gives whether it is still open.
    fn pause(&self, clock: Clock, span: Duration) -> bool {
        let until = clock.now() + span;
        let mut tray = lock(&self.unread.tray);
        while !tray.is_closed && clock.now() < until {
            let wait = until.since(clock.now());
            tray = self.unread.come.wait_timeout(tray, wait).unwrap_or_else(PoisonError::into_inner).0;
        }
        !tray.is_closed
    }

    fn take(&self) -> Vec<I> {
        let mut tray = lock(&self.unread.tray);
        std::iter::from_fn(|| tray.inbox.pop()).collect()
    }

    fn is_empty(&self) -> bool {
        lock(&self.unread.tray).inbox.is_empty()
    }

    /// Sets when the actor is to be woken; its thread hears of it when that is sooner than it knew.
    fn set_deadline(&self, at: Option<Time>) {
        let at = at.map_or(u64::MAX, Time::as_nanos);
        if at < self.unread.deadline.swap(at, Ordering::Relaxed) {
            // With the tray locked the thread is either before its look at the deadline, or waits already.
            let _tray = lock(&self.unread.tray);
            self.unread.come.notify_one();
        }
    }

    fn fail(&self, fault: Fault) {
        lock(&self.unread.tray).fault = Some(fault);
        self.unread.come.notify_all();
    }
}

/// What all threads of a process share.
#[derive(Clone)]
pub struct Office {
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
    /// An actor cannot go on.
    Fault(Fault),
    /// It may not take part in the bus.
    Refused(String),
}

/// How the steps of an actor are written down.
pub struct Record<A: Actor> {
    /// Who writes them.
    pub scribe: Scribe,
    /// Names whose steps they are.
    pub deed: fn(Step<A::In, A::Out>) -> Deed,
}

impl<A: Actor> Record<A> {
    /// Has the steps written down by a recorder, if there is one.
    pub fn by(recorder: Option<&Recorder>, deed: fn(Step<A::In, A::Out>) -> Deed) -> Option<Record<A>> {
        recorder.map(|recorder| Record { scribe: recorder.scribe(), deed })
    }
}

/// Seats an actor at a desk, on a thread of its own. `make` gives a fresh actor at the start and after a fault;
/// `say` takes what it says; `record` writes down what it does.
///
/// # Errors
/// The machine has no thread to give.
pub fn seat<A, M, S>(
    office: &Office,
    desk: &Desk<A::In>,
    post: Post,
    record: Option<Record<A>>,
    make: M,
    say: S,
) -> std::io::Result<JoinHandle<()>>
where
    A: Actor + Serialize + Send + 'static,
    A::In: Input + Clone + Send + 'static,
    A::Out: Clone + Send + 'static,
    M: FnMut() -> Result<A, Fault> + Send + 'static,
    S: FnMut(A::Out) + Send + 'static,
{
    let at_work = Mutex::new(Work { seat: None, record, say });
    let bench = Arc::new(Bench { office: office.clone(), desk: desk.clone(), at_work });
    if desk.unread.is_shared {
        let shared = bench.clone();
        let help: Help = Arc::new(move || shared.help());
        *desk.unread.help.write().unwrap_or_else(PoisonError::into_inner) = Some(help);
    }
    std::thread::Builder::new().name(desk.name.to_owned()).spawn(move || work(&bench, post, make))
}

/// An actor's place of work: who holds the lock lets it act.
struct Bench<A: Actor, S>
where
    A::In: Input,
{
    office: Office,
    desk: Desk<A::In>,
    at_work: Mutex<Work<A, S>>,
}

struct Work<A: Actor, S>
where
    A::In: Input,
{
    /// `None` = it cannot go on, or has not begun yet.
    seat: Option<Seat<A>>,
    record: Option<Record<A>>,
    say: S,
}

impl<A, S> Bench<A, S>
where
    A: Actor + Serialize,
    A::In: Input + Clone,
    A::Out: Clone,
    S: FnMut(A::Out),
{
    /// Lets the actor act on the caller's thread, unless somebody else does so just now: who does looks again
    /// afterwards.
    fn help(&self) {
        loop {
            let Ok(mut work) = self.at_work.try_lock() else { return };
            if work.seat.is_none() {
                return;
            }
            self.act(&mut work);
            drop(work);
            if self.desk.is_empty() {
                return;
            }
        }
    }

    /// Lets the actor act on all that is unread and due.
    fn act(&self, work: &mut Work<A, S>) {
        let Work { seat: place, record, say } = work;
        let Some(seat) = place else { return };
        let (now, inputs) = (self.office.clock.now(), self.desk.take());
        self.desk.unread.busy_since.store(now.as_nanos() + 1, Ordering::Relaxed);
        let acted = catch_unwind(AssertUnwindSafe(|| {
            inputs.into_iter().for_each(|input| seat.push(input));
            let mut watched = record.as_mut();
            watched.take_if(|record| !record.scribe.prepare(now, self.desk.name, seat.actor()));
            match watched {
                Some(Record { scribe, deed }) => {
                    seat.act_watched(now, Some(|step| scribe.step(deed(step))), &mut *say)
                }
                None => seat.act(now, &mut *say),
            }
        }));
        self.desk.unread.busy_since.store(0, Ordering::Relaxed);
        let fault = match acted {
            Ok(Ok(())) => return self.desk.set_deadline(seat.deadline().map(|deadline| deadline.at)),
            Ok(Err(fault)) => fault,
            Err(panic) => Fault { actor: self.desk.name, reason: words_of(panic.as_ref()) },
        };
        *place = None;
        record.iter_mut().for_each(|record| record.scribe.restarted());
        self.desk.fail(fault);
    }

    /// Seats an actor and lets it act until it cannot go on; `None` = it was sent home.
    fn attend(&self, actor: A) -> Option<Fault> {
        let seat = Seat::new(actor);
        self.desk.set_deadline(seat.deadline().map(|deadline| deadline.at));
        lock(&self.at_work).seat = Some(seat);
        loop {
            if !self.desk.wait(self.office.clock) {
                return None;
            }
            let fault = lock(&self.desk.unread.tray).fault.take();
            if fault.is_some() {
                self.desk.set_deadline(None);
                return fault;
            }
            self.act(&mut lock(&self.at_work));
        }
    }
}

fn work<A, M, S>(bench: &Bench<A, S>, post: Post, mut make: M)
where
    A: Actor + Serialize,
    A::In: Input + Clone,
    A::Out: Clone,
    M: FnMut() -> Result<A, Fault>,
    S: FnMut(A::Out),
{
    let (office, desk) = (&bench.office, &bench.desk);
    let mut restarts = Restarts::default();
    loop {
        let made = catch_unwind(AssertUnwindSafe(&mut make));
        let made =
            made.unwrap_or_else(|panic| Err(Fault { actor: desk.name, reason: words_of(panic.as_ref()) }));
        let fault = match made {
            Ok(actor) => bench.attend(actor),
            Err(fault) => Some(fault),
        };
        let Some(fault) = fault else { return };
        let wait = match post {
            Post::Leaf => restarts.failed(office.clock.now()),
            Post::Vital => None,
        };
        let Some(wait) = wait else {
            office.troubles.raise(desk.name, format!("stays down: {}", fault.reason));
            if post == Post::Vital {
                // Nobody listens any more only when the process is ending already.
                let _ = office.endings.send(Ending::Fault(fault));
            }
            return;
        };
        office.troubles.raise(desk.name, format!("begins anew: {}", fault.reason));
        if !desk.pause(office.clock, wait) {
            return;
        }
    }
}

fn words_of(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    format!("panicked: {}", text.unwrap_or_else(|| "without words".to_owned()))
}

/// Locks, also after a thread that held the lock has panicked: all that is locked here is whole between statements.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actor::Class;
    use crate::time::Deadline;
    use std::sync::mpsc::{Receiver, channel};

    /// Repeats what it is told; 13 makes it panic, 7 is a fault.
    #[derive(Serialize)]
    struct Echo {
        wakes: u32,
        next: Time,
    }

    #[derive(Clone)]
    struct Told(u32);

    impl Input for Told {
        type Key = ();
        fn class(&self) -> Class<()> {
            Class::Queue
        }
    }

    impl Actor for Echo {
        type In = Told;
        type Out = u32;
        fn handle(&mut self, _now: Time, input: Told, out: &mut Vec<u32>) -> Result<(), Fault> {
            assert_ne!(input.0, 13, "thirteen");
            if input.0 == 7 {
                return Err(Fault { actor: "echo", reason: "seven".to_owned() });
            }
            out.push(input.0);
            Ok(())
        }
        fn deadline(&self) -> Option<Deadline> {
            (self.wakes > 0).then_some(Deadline { at: self.next, why: "tick" })
        }
        fn wake(&mut self, now: Time, out: &mut Vec<u32>) -> Result<(), Fault> {
            (self.wakes, self.next) = (self.wakes - 1, now + Duration::from_millis(5));
            out.push(1000);
            Ok(())
        }
    }

    fn seated(
        post: Post,
        wakes: u32,
    ) -> (Desk<Told>, Receiver<u32>, Receiver<Ending>, Troubles, JoinHandle<()>) {
        let (endings, failed) = channel();
        let (said, heard) = channel();
        let office = Office { clock: Clock::start(), troubles: Troubles::default(), endings };
        let desk = Desk::new("echo");
        let make = move || Ok(Echo { wakes, next: Time::ZERO });
        let say = move |out| said.send(out).unwrap_or_default();
        let thread = seat(&office, &desk, post, None, make, say).unwrap();
        (desk, heard, failed, office.troubles.clone(), thread)
    }

    const SOON: Duration = Duration::from_secs(5);

    #[test]
    fn what_is_told_is_handled_and_deadlines_are_kept() {
        let (desk, heard, _, _, thread) = seated(Post::Vital, 3);
        desk.tell(Told(5));
        let all: Vec<u32> = (0..4).map(|_| heard.recv_timeout(SOON).unwrap()).collect();
        assert_eq!(all.iter().filter(|out| **out == 1000).count(), 3);
        assert!(all.contains(&5));
        desk.close();
        thread.join().unwrap();
    }

    #[test]
    fn a_leaf_that_panics_begins_anew_and_says_so() {
        let (desk, heard, _, troubles, thread) = seated(Post::Leaf, 0);
        desk.tell(Told(13));
        assert!(heard.recv_timeout(Duration::from_millis(500)).is_err(), "it waits a second first");
        desk.tell(Told(3));
        assert_eq!(heard.recv_timeout(SOON), Ok(3));
        assert!(troubles.list()[0].contains("panicked: ") && troubles.list()[0].contains("thirteen"));
        desk.close();
        thread.join().unwrap();
    }

    #[test]
    fn at_a_shared_desk_the_teller_lets_the_actor_act_and_nothing_is_lost() {
        let (endings, _ended) = channel();
        let office = Office { clock: Clock::start(), troubles: Troubles::default(), endings };
        let desk = Desk::shared("echo");
        let (said, heard) = channel();
        let say = move |out| said.send((out, std::thread::current().id())).unwrap_or_default();
        let thread =
            seat(&office, &desk, Post::Vital, None, || Ok(Echo { wakes: 2, next: Time::ZERO }), say).unwrap();
        // The two wakes are the thread's.
        let own: Vec<_> = (0..2).map(|_| heard.recv_timeout(SOON).unwrap()).collect();
        assert!(own.iter().all(|(out, by)| *out == 1000 && *by == thread.thread().id()));
        while desk.busy_for(office.clock.now()) > Duration::ZERO {}
        std::thread::sleep(Duration::from_millis(20));
        desk.tell(Told(1));
        assert_eq!(heard.recv_timeout(SOON), Ok((1, std::thread::current().id())));
        let tellers: Vec<_> = (0..4)
            .map(|_| {
                let desk = desk.clone();
                std::thread::spawn(move || (100..1100).for_each(|number| desk.tell(Told(number))))
            })
            .collect();
        tellers.into_iter().for_each(|teller| teller.join().unwrap());
        let counted = std::iter::from_fn(|| heard.recv_timeout(Duration::from_millis(300)).ok()).count();
        assert_eq!(counted as u64 + desk.dropped(), 4000);
        desk.close();
        thread.join().unwrap();
    }

    #[test]
    fn a_vital_actor_that_fails_ends_the_process() {
        let (desk, _, failed, _, thread) = seated(Post::Vital, 0);
        desk.tell(Told(7));
        let Ok(Ending::Fault(fault)) = failed.recv_timeout(SOON) else { panic!("no fault") };
        assert_eq!(fault.reason, "seven");
        thread.join().unwrap();
    }
}
