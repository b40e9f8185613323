//! An actor's place in a live process: its inbox, which anyone may put inputs into without waiting, and the thread that
//! lets it act.
//!
//! The thread sleeps until something is unread or the actor's deadline has come. It keeps the actor contract by
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
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use super::clock::Clock;
use super::restarts::Restarts;
use serde::Serialize;

use crate::actor::{Actor, Fault, Inbox, Input, Seat, Step};
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

struct Unread<I> {
    tray: Mutex<Tray<I>>,
    come: Condvar,
    /// Since when the actor acts, nanoseconds + 1; 0 = it waits.
    busy_since: AtomicU64,
}

struct Tray<I> {
    inbox: Inbox<I>,
    is_closed: bool,
}

impl<I: Input> Clone for Desk<I> {
    fn clone(&self) -> Desk<I> {
        Desk { name: self.name, unread: self.unread.clone() }
    }
}

impl<I: Input> Desk<I> {
    /// Sets up a desk at which nobody sits yet.
    pub fn new(name: &'static str) -> Desk<I> {
        let tray = Mutex::new(Tray { inbox: Inbox::new(INBOX), is_closed: false });
        Desk { name, unread: Arc::new(Unread { tray, come: Condvar::new(), busy_since: AtomicU64::new(0) }) }
    }

    /// Puts an input into the inbox; never waits for the actor.
    pub fn tell(&self, input: I) {
        lock(&self.unread.tray).inbox.push(input);
        self.unread.come.notify_one();
    }

    /// Tells how many inputs were dropped unread.
    pub fn dropped(&self) -> u64 {
        lock(&self.unread.tray).inbox.dropped()
    }

    /// Sends the actor home: its thread ends after what it does now.
    pub fn close(&self) {
        lock(&self.unread.tray).is_closed = true;
        self.unread.come.notify_all();
    }

    /// Tells for how long the actor has been acting without a pause.
    pub fn busy_for(&self, now: Time) -> Duration {
        match self.unread.busy_since.load(Ordering::Relaxed) {
            0 => Duration::ZERO,
            since => now.since(Time::from_nanos(since - 1)),
        }
    }

    /// Waits until something is unread or the moment has come, and takes all that is unread; `None` = closed.
    fn take(&self, clock: Clock, until: Option<Time>) -> Option<Vec<I>> {
        let mut tray = lock(&self.unread.tray);
        loop {
            if tray.is_closed {
                return None;
            }
            let now = clock.now();
            if !tray.inbox.is_empty() || until.is_some_and(|until| until <= now) {
                return Some(std::iter::from_fn(|| tray.inbox.pop()).collect());
            }
            let wait = until.map_or(IDLE, |until| until.since(now).min(IDLE));
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
    A: Actor + Serialize + 'static,
    A::In: Input + Clone + Send + 'static,
    A::Out: Clone,
    M: FnMut() -> Result<A, Fault> + Send + 'static,
    S: FnMut(A::Out) + Send + 'static,
{
    let (office, desk) = (office.clone(), desk.clone());
    std::thread::Builder::new()
        .name(desk.name.to_owned())
        .spawn(move || work(&office, &desk, post, record, make, say))
}

fn work<A, M, S>(
    office: &Office,
    desk: &Desk<A::In>,
    post: Post,
    mut record: Option<Record<A>>,
    mut make: M,
    mut say: S,
) where
    A: Actor + Serialize,
    A::In: Input + Clone,
    A::Out: Clone,
    M: FnMut() -> Result<A, Fault>,
    S: FnMut(A::Out),
{
    let mut restarts = Restarts::default();
    loop {
        let ended = catch_unwind(AssertUnwindSafe(|| act(office, desk, &mut record, make()?, &mut say)));
        desk.unread.busy_since.store(0, Ordering::Relaxed);
        record.iter_mut().for_each(|record| record.scribe.restarted());
        let fault = match ended {
            Ok(Ok(())) => return,
            Ok(Err(fault)) => fault,
            Err(panic) => Fault { actor: desk.name, reason: words_of(panic.as_ref()) },
        };
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

fn act<A>(
    office: &Office,
    desk: &Desk<A::In>,
    record: &mut Option<Record<A>>,
    actor: A,
    say: &mut impl FnMut(A::Out),
) -> Result<(), Fault>
where
    A: Actor + Serialize,
    A::In: Input + Clone,
    A::Out: Clone,
{
    let mut seat = Seat::new(actor);
    while let Some(inputs) = desk.take(office.clock, seat.deadline().map(|deadline| deadline.at)) {
        let now = office.clock.now();
        desk.unread.busy_since.store(now.as_nanos() + 1, Ordering::Relaxed);
        inputs.into_iter().for_each(|input| seat.push(input));
        let mut watched = record.as_mut();
        watched.take_if(|record| !record.scribe.prepare(now, desk.name, seat.actor()));
        match watched {
            Some(Record { scribe, deed }) => {
                seat.act_watched(now, Some(|step| scribe.step(deed(step))), &mut *say)?;
            }
            None => seat.act(now, &mut *say)?,
        }
        desk.unread.busy_since.store(0, Ordering::Relaxed);
    }
    Ok(())
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
        desk.tell(Told(2));
        assert!(heard.recv_timeout(Duration::from_millis(500)).is_err(), "it waits a second first");
        desk.tell(Told(3));
        assert_eq!(heard.recv_timeout(SOON), Ok(3));
        assert!(troubles.list()[0].contains("panicked: ") && troubles.list()[0].contains("thirteen"));
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
