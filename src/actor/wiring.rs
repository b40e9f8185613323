//! How the actors of a kind of node are wired, said once, for every runtime: which actors there are, in the order of
//! the data's way, what each is called, what happens when it fails, and how what it says enters the route.
//!
//! ```text
//!   fill ──► Actors<Cells>      one thread: act, deadline, dropped, snapshots    (the simulator)
//!       ├──► Actors<Mailboxes>  a thread for each: start, tell, close            (a live process)
//!       └──► Actors<Names>      nothing in the places: restore, read, write      (recordings)
//!   Event ─► Output ─► route ─► Destination ─► deliver ─► one of the places, or an Effect
//! ```
//!
//! A kind of node is a [`Wiring`]. Its `Actors` hold one place per actor; what stands in a place is the runtime's
//! choice ([`Place`]). Whatever is done with every actor is a [`Fill`], which makes what stands in the places, or a
//! [`Visitor`], which goes from place to place. All is resolved when it is compiled: nothing here allocates or looks
//! anything up. Nothing here runs an actor, and nothing here knows a kind of node.

use std::fmt;

use serde::Serialize;
use serde::de::DeserializeOwned;
use tomoswarm_proto::Message;

use super::{Actor, Input};

/// What happens when an actor cannot go on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RestartPolicy {
    /// It begins anew; others go on meanwhile.
    Restart,
    /// The node ends in order, and is started anew from outside.
    StopNode,
}

/// How long an actor may act without a pause.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ActingTime {
    /// So shortly that whoever tells it something may let it act at once: waking a thread would take longer.
    Instant,
    /// Shortly: one that acts for seconds is stuck.
    Short,
    /// For seconds or minutes.
    Long,
}

/// An actor that can be a part of a node: it is told and says plain data, and can be written down.
pub trait NodeActor:
    Actor<
        In: Input + Clone + Serialize + DeserializeOwned + Send + Sync + 'static,
        Out: Clone + Serialize + DeserializeOwned + Send + Sync + 'static,
    > + Serialize
    + DeserializeOwned
    + Send
    + 'static
{
}

impl<A> NodeActor for A
where
    A: Actor + Serialize + DeserializeOwned + Send + 'static,
    A::In: Input + Clone + Serialize + DeserializeOwned + Send + Sync + 'static,
    A::Out: Clone + Serialize + DeserializeOwned + Send + Sync + 'static,
{
}

/// How one actor is wired into a node.
pub struct Wire<A: Actor, W: Wiring> {
    /// The name of the actor within its node; recordings and troubles call it so.
    pub name: &'static str,
    /// What happens when it fails.
    pub restart: RestartPolicy,
    /// How long it may act.
    pub acting: ActingTime,
    /// Makes the actor, at the start and again after a fault.
    pub make: fn(&mut W::Source) -> A,
    /// How what it says enters the route.
    pub output: fn(A::Out) -> W::Output,
}

impl<A: Actor, W: Wiring> Clone for Wire<A, W> {
    fn clone(&self) -> Wire<A, W> {
        *self
    }
}

impl<A: Actor, W: Wiring> Copy for Wire<A, W> {}

/// A kind of node: its actors, and how what is said finds its way.
pub trait Wiring: Sized + 'static {
    /// The first word of the names of such nodes: `vehicle` of `vehicle/3`.
    const KIND: &'static str;

    /// What the actors are made from.
    type Source: Send + 'static;
    /// What reaches such a node from outside.
    type Event;
    /// What it wants done outside.
    type Effect;
    /// Whatever is said inside the node or at its edge.
    type Output: 'static;
    /// Where it goes.
    type Destination;
    /// One place for each actor.
    type Actors<P: Place<Self>>;

    /// Lists the actors, in the order of the data's way, and fills the place of each.
    fn fill<P: Place<Self>>(fill: &mut impl Fill<Self, P>) -> Self::Actors<P>;

    /// Goes from place to place, in the same order.
    fn visit<P: Place<Self>>(actors: &mut Self::Actors<P>, visitor: &mut impl Visitor<Self, P>);

    /// Returns an event as something said at the edge.
    fn event(event: Self::Event) -> Self::Output;

    /// Says where something goes; destinations are in the order in which they are told.
    fn route(output: Self::Output, to: &mut Vec<Self::Destination>);

    /// Tells the actor that it is for, or hands an effect to `carry_out`.
    fn deliver<P: Recipient<Self>>(
        actors: &mut Self::Actors<P>,
        destination: Self::Destination,
        carry_out: &mut impl FnMut(Self::Effect),
    );

    /// Returns what the bus shall carry, if that is what an effect asks for.
    fn published(effect: Self::Effect) -> Option<Message>;
}

/// What stands where an actor of a node belongs.
pub trait Place<W: Wiring> {
    /// It, for one actor.
    type Of<A: NodeActor>;
}

/// A place behind which somebody listens.
pub trait Recipient<W: Wiring>: Place<W> {
    /// Tells the actor something; it is read later.
    fn tell<A: NodeActor>(place: &mut Self::Of<A>, input: A::In);
}

/// Makes what stands in the places of a node's actors.
pub trait Fill<W: Wiring, P: Place<W>> {
    /// Makes it for one actor.
    fn actor<A: NodeActor>(&mut self, wire: Wire<A, W>) -> P::Of<A>;
}

/// Does something with what stands in the places of a node's actors, one after another.
pub trait Visitor<W: Wiring, P: Place<W>> {
    /// Does it with one actor's.
    fn actor<A: NodeActor>(&mut self, place: &mut P::Of<A>);
}

/// What stands in a place, with how its actor is wired.
pub struct Wired<A: Actor, W: Wiring, T> {
    /// How the actor is wired.
    pub wire: Wire<A, W>,
    /// What stands there.
    pub place: T,
}

impl<A: Actor, W: Wiring, T: Clone> Clone for Wired<A, W, T> {
    fn clone(&self) -> Wired<A, W, T> {
        Wired {
            wire: self.wire,
            place: self.place.clone(),
        }
    }
}

impl<A: Actor, W: Wiring, T: fmt::Debug> fmt::Debug for Wired<A, W, T> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}: ", self.wire.name)?;
        self.place.fmt(formatter)
    }
}

/// Nothing stands in the places: the list of the actors alone.
#[derive(Debug)]
pub enum Names {}

impl<W: Wiring> Place<W> for Names {
    type Of<A: NodeActor> = ();
}

/// Nobody listens.
impl<W: Wiring> Recipient<W> for Names {
    fn tell<A: NodeActor>(_place: &mut (), _input: A::In) {}
}
