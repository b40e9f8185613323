//! A live node: its actors, each behind a [`Mailbox`] and on a thread of its own, joined by the route of its kind of node.
//!
//! ```text
//!   bus ─────┐                             ┌─ command, steer, ping, transmit ─► drivers
//!   drivers ─┼─ Event ─► mailboxes (actors) ┼─ publish ─► bus
//!   disk ────┘              ▲    │ route    ├─ keep, forget, recall, remember ─► disk
//!                           └────┘          └─ event ─► log
//! ```
//!
//! No actor shares its thread with another: a search for a path or a merge of maps never delays a halt. Which actors
//! there are, and what happens when one fails, is said by the [`Wiring`]; nothing here knows a kind of node.

use std::io;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use super::mailbox::{Mailbox, RuntimeContext, lock, start_actor};
use crate::actor::{ActingTime, Fill, NodeActor, Place, Recipient, Visitor, Wire, Wired, Wiring};
use crate::store::recording::Recorder;
use crate::time::Time;

/// Mailboxes stand in the places; the actors behind them have threads of their own.
#[derive(Clone, Copy, Debug)]
pub enum Mailboxes {}

impl<W: Wiring> Place<W> for Mailboxes {
    type Of<A: NodeActor> = Wired<A, W, Mailbox<A::In>>;
}

impl<W: Wiring> Recipient<W> for Mailboxes {
    fn tell<A: NodeActor>(wired: &mut Wired<A, W, Mailbox<A::In>>, input: A::In) {
        wired.place.tell(input);
    }
}

/// The mailboxes of a node's actors. It is a handle: what a copy of it is told, the same actors hear.
pub struct LiveNode<W: Wiring> {
    actors: W::Actors<Mailboxes>,
}

impl<W: Wiring> Clone for LiveNode<W>
where
    W::Actors<Mailboxes>: Clone,
{
    fn clone(&self) -> LiveNode<W> {
        LiveNode {
            actors: self.actors.clone(),
        }
    }
}

impl<W: Wiring> Default for LiveNode<W> {
    /// Sets up the mailboxes; what they are told before the actors start is read then.
    fn default() -> LiveNode<W> {
        LiveNode {
            actors: W::fill::<Mailboxes>(&mut SetUp),
        }
    }
}

impl<W: Wiring> LiveNode<W>
where
    W::Actors<Mailboxes>: Clone + Send + 'static,
{
    /// Returns the mailboxes.
    pub fn actors(&self) -> &W::Actors<Mailboxes> {
        &self.actors
    }

    /// Tells the node something from outside; never waits.
    pub fn tell(&self, event: W::Event) {
        // What comes from outside concerns actors only.
        self.clone().pass(W::event(event), &mut |_| {});
    }

    /// Hands on what was said; what concerns the outside goes to `carry_out`.
    fn pass(&mut self, output: W::Output, carry_out: &mut impl FnMut(W::Effect)) {
        let mut routed = Vec::new();
        W::route(output, &mut routed);
        for destination in routed {
            W::deliver(&mut self.actors, destination, carry_out);
        }
    }

    /// Returns for how long the busiest actor has been acting without a pause, of those that must not.
    pub fn busy_for(&self, now: Time) -> Duration {
        self.visit(Busiest {
            now,
            longest: Duration::ZERO,
        })
        .longest
    }

    /// Returns how many inputs were dropped unread.
    pub fn dropped(&self) -> u64 {
        self.visit(Dropped(0)).0
    }

    /// Ends all actors, each after what it does now.
    pub fn close(&self) {
        self.visit(Close);
    }

    /// Starts the threads of all actors. `carry_out` is called from them for everything that concerns the outside; what
    /// the actors do is written down where there is a recorder.
    ///
    /// # Errors
    /// The machine has no threads to give.
    pub fn start(
        &self,
        context: &RuntimeContext,
        source: W::Source,
        recorder: Option<&Recorder>,
        carry_out: impl Fn(W::Effect) + Send + Sync + 'static,
    ) -> io::Result<Threads> {
        let (source, carry_out) = (Arc::new(Mutex::new(source)), Arc::new(carry_out));
        let threads = Ok(Threads(Vec::new()));
        self.visit(Start {
            node: self,
            context,
            source,
            recorder,
            carry_out,
            threads,
        })
        .threads
    }

    fn visit<V: Visitor<W, Mailboxes>>(&self, mut visitor: V) -> V {
        W::visit(&mut self.actors.clone(), &mut visitor);
        visitor
    }
}

/// The threads of a node's actors, by the actors' names.
pub struct Threads(Vec<(&'static str, JoinHandle<()>)>);

impl Threads {
    /// Returns whether the actor of this name has ended.
    pub fn has_ended(&self, actor: &str) -> bool {
        self.0
            .iter()
            .any(|(name, thread)| *name == actor && thread.is_finished())
    }

    /// Waits until all have ended.
    pub fn join(self) {
        for (_, thread) in self.0 {
            // An actor that panicked has said so already.
            let _ = thread.join();
        }
    }
}

/// Sets up mailboxes.
struct SetUp;

impl<W: Wiring> Fill<W, Mailboxes> for SetUp {
    fn actor<A: NodeActor>(&mut self, wire: Wire<A, W>) -> Wired<A, W, Mailbox<A::In>> {
        let mailbox = match wire.acting {
            ActingTime::Instant => Mailbox::shared(wire.name),
            ActingTime::Short | ActingTime::Long => Mailbox::new(wire.name),
        };
        Wired {
            wire,
            place: mailbox,
        }
    }
}

/// Starts the threads; after one that cannot be started no more.
struct Start<'s, W: Wiring, E> {
    node: &'s LiveNode<W>,
    context: &'s RuntimeContext,
    source: Arc<Mutex<W::Source>>,
    recorder: Option<&'s Recorder>,
    carry_out: Arc<E>,
    threads: io::Result<Threads>,
}

impl<W, E> Visitor<W, Mailboxes> for Start<'_, W, E>
where
    W: Wiring,
    W::Actors<Mailboxes>: Clone + Send + 'static,
    E: Fn(W::Effect) + Send + Sync + 'static,
{
    fn actor<A: NodeActor>(&mut self, wired: &mut Wired<A, W, Mailbox<A::In>>) {
        let Ok(threads) = &mut self.threads else {
            return;
        };
        let Wired {
            wire,
            place: mailbox,
        } = wired;
        let (source, make) = (self.source.clone(), wire.make);
        let (mut node, carry_out, output) =
            (self.node.clone(), self.carry_out.clone(), wire.output);
        let started = start_actor(
            self.context,
            mailbox,
            wire.restart,
            self.recorder.map(Recorder::scribe),
            move || make(&mut lock(&source)),
            move |out| node.pass(output(out), &mut |effect| carry_out(effect)),
        );
        match started {
            Ok(thread) => threads.0.push((wire.name, thread)),
            Err(error) => self.threads = Err(error),
        }
    }
}

struct Busiest {
    now: Time,
    longest: Duration,
}

impl<W: Wiring> Visitor<W, Mailboxes> for Busiest {
    fn actor<A: NodeActor>(&mut self, wired: &mut Wired<A, W, Mailbox<A::In>>) {
        match wired.wire.acting {
            ActingTime::Instant | ActingTime::Short => {
                self.longest = self.longest.max(wired.place.busy_for(self.now));
            }
            ActingTime::Long => {}
        }
    }
}

struct Dropped(u64);

impl<W: Wiring> Visitor<W, Mailboxes> for Dropped {
    fn actor<A: NodeActor>(&mut self, wired: &mut Wired<A, W, Mailbox<A::In>>) {
        self.0 += wired.place.dropped();
    }
}

struct Close;

impl<W: Wiring> Visitor<W, Mailboxes> for Close {
    fn actor<A: NodeActor>(&mut self, wired: &mut Wired<A, W, Mailbox<A::In>>) {
        wired.place.close();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, channel};

    use super::super::clock::Clock;
    use super::super::mailbox::{Ending, Troubles};
    use super::*;
    use crate::actor::tests_support::{Adding, Number};

    const SOON: Duration = Duration::from_secs(5);

    /// A live node whose sum begins with 10, what it says, why it ends, and its troubles.
    struct Live {
        node: LiveNode<Adding>,
        threads: Threads,
        sums: Receiver<u32>,
        endings: Receiver<Ending>,
        troubles: Troubles,
    }

    fn live(told_before: &[u32]) -> Live {
        let (endings, ended) = channel();
        let (outputs, sums) = channel();
        let context = RuntimeContext {
            clock: Clock::start(),
            troubles: Troubles::default(),
            endings,
        };
        let node = LiveNode::<Adding>::default();
        told_before.iter().for_each(|number| node.tell(*number));
        let threads = node.start(&context, 10, None, move |sum| {
            outputs.send(sum).unwrap_or_default()
        });
        Live {
            node,
            threads: threads.unwrap(),
            sums,
            endings: ended,
            troubles: context.troubles,
        }
    }

    #[test]
    fn a_live_node_says_what_it_says_on_one_thread() {
        let live = live(&[1]);
        assert_eq!(
            live.sums.recv_timeout(SOON),
            Ok(12),
            "also what it was told before it started"
        );
        live.node.tell(2);
        assert_eq!(live.sums.recv_timeout(SOON), Ok(16));
        assert_eq!(live.node.dropped(), 0);
        assert!(!live.threads.has_ended("summer"));
        let summer = &live.node.actors().summer;
        summer.place.close();
        while !live.threads.has_ended(summer.wire.name) {
            std::thread::yield_now();
        }
        live.node.close();
        live.threads.join();
    }

    #[test]
    fn an_actor_that_may_begin_anew_does_and_the_node_goes_on() {
        let live = live(&[]);
        live.node.tell(7);
        // What is read together with what it fails at is lost with it.
        while live.troubles.list().is_empty() {
            std::thread::yield_now();
        }
        live.node.tell(1);
        assert_eq!(
            live.sums.recv_timeout(SOON),
            Ok(12),
            "the others have not begun anew"
        );
        assert_eq!(live.troubles.list(), ["doubler: begins anew: seven"]);
        assert!(live.endings.try_recv().is_err());
        live.node.close();
        live.threads.join();
    }

    #[test]
    fn an_actor_that_must_not_begin_anew_ends_the_node() {
        let live = live(&[]);
        live.node.actors().summer.place.tell(Number(u32::MAX));
        let Ok(Ending::Fault(fault)) = live.endings.recv_timeout(SOON) else {
            panic!("no fault")
        };
        assert_eq!(fault.reason, "too much");
        live.node.close();
        live.threads.join();
    }
}
