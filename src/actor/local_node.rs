//! A node whose actors act one after another on one thread, as the simulator runs it. What its actors are, and who
//! hears whom, is said by its [`Wiring`].

use tomoswarm_proto::codec::EncodeError;

use super::wiring::{Fill, NodeActor, Place, Recipient, Visitor, Wire, Wired, Wiring};
use super::{ActorCell, ActorStep, Fault, Snapshot};
use crate::time::{Deadline, Time};

/// The actors themselves stand in the places, each with its inbox.
#[derive(Debug)]
pub enum Cells {}

impl<W: Wiring> Place<W> for Cells {
    type Of<A: NodeActor> = Wired<A, W, ActorCell<A>>;
}

impl<W: Wiring> Recipient<W> for Cells {
    fn tell<A: NodeActor>(place: &mut Wired<A, W, ActorCell<A>>, input: A::In) {
        place.place.push(input);
    }
}

/// The actors of a node on one thread.
#[derive(Debug)]
pub struct LocalNode<W: Wiring> {
    actors: W::Actors<Cells>,
    routed: Vec<W::Destination>,
    /// What is being delivered; empty between two calls, and kept for its memory.
    delivered: Vec<W::Destination>,
    /// What the actors did and nobody has taken yet; `None` while nobody watches.
    steps: Option<Vec<ActorStep>>,
}

impl<W: Wiring> LocalNode<W> {
    /// Makes all actors of a node.
    pub fn new(source: &mut W::Source) -> LocalNode<W> {
        let actors = W::fill::<Cells>(&mut Make::<W>(source));
        LocalNode {
            actors,
            routed: Vec::new(),
            delivered: Vec::new(),
            steps: None,
        }
    }

    /// Returns the actors.
    pub fn actors(&self) -> &W::Actors<Cells> {
        &self.actors
    }

    /// Tells the node something, and lets its actors act until all is quiet.
    ///
    /// # Errors
    /// An actor cannot go on.
    pub fn tell(
        &mut self,
        now: Time,
        event: W::Event,
        effects: &mut Vec<W::Effect>,
    ) -> Result<(), Fault> {
        W::route(W::event(event), &mut self.routed);
        self.settle(now, effects)
    }

    /// Lets all actors act whose deadline has come, until all is quiet.
    ///
    /// # Errors
    /// An actor cannot go on.
    pub fn wake(&mut self, now: Time, effects: &mut Vec<W::Effect>) -> Result<(), Fault> {
        self.act(now)?;
        self.settle(now, effects)
    }

    /// Returns the earliest deadline of all actors.
    pub fn deadline(&mut self) -> Option<Deadline> {
        let mut earliest = Earliest(None);
        W::visit(&mut self.actors, &mut earliest);
        earliest.0
    }

    /// Returns how many inputs the actors have dropped unread, because they were too slow.
    pub fn dropped(&mut self) -> u64 {
        let mut dropped = Dropped(0);
        W::visit(&mut self.actors, &mut dropped);
        dropped.0
    }

    /// Begins to keep every step of every actor, for [`LocalNode::steps`].
    pub fn watch(&mut self) {
        self.steps.get_or_insert_default();
    }

    /// Returns what the actors did since the last call, in order; nothing unless it is watched.
    pub fn steps(&mut self) -> Vec<ActorStep> {
        self.steps.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Goes on watching as another node did whose place this one takes.
    pub fn go_on_from(&mut self, before: &mut LocalNode<W>) {
        self.steps = before.steps.take();
    }

    /// Returns every actor as it is now. Nothing may be unread, as it is between two calls.
    ///
    /// # Errors
    /// One cannot be written, which is a mistake of this program.
    pub fn snapshots(&mut self) -> Result<Vec<Snapshot>, EncodeError> {
        let mut snapshots = Snapshots(Vec::new());
        W::visit(&mut self.actors, &mut snapshots);
        snapshots.0.into_iter().collect()
    }

    fn settle(&mut self, now: Time, effects: &mut Vec<W::Effect>) -> Result<(), Fault> {
        while !self.routed.is_empty() {
            std::mem::swap(&mut self.routed, &mut self.delivered);
            for destination in self.delivered.drain(..) {
                W::deliver(&mut self.actors, destination, &mut |effect| {
                    effects.push(effect)
                });
            }
            self.act(now)?;
        }
        Ok(())
    }

    /// Lets every actor act, in the order of the list, and routes what they say.
    fn act(&mut self, now: Time) -> Result<(), Fault> {
        let mut act = Act::<W> {
            now,
            routed: &mut self.routed,
            steps: self.steps.as_mut(),
            fault: None,
        };
        W::visit(&mut self.actors, &mut act);
        act.fault.map_or(Ok(()), Err)
    }
}

/// Makes the actors.
struct Make<'s, W: Wiring>(&'s mut W::Source);

impl<W: Wiring> Fill<W, Cells> for Make<'_, W> {
    fn actor<A: NodeActor>(&mut self, wire: Wire<A, W>) -> Wired<A, W, ActorCell<A>> {
        Wired {
            wire,
            place: ActorCell::new((wire.make)(self.0)),
        }
    }
}

/// Lets actors act; after a fault the others do not.
struct Act<'n, W: Wiring> {
    now: Time,
    routed: &'n mut Vec<W::Destination>,
    steps: Option<&'n mut Vec<ActorStep>>,
    fault: Option<Fault>,
}

impl<W: Wiring> Visitor<W, Cells> for Act<'_, W> {
    #[inline]
    fn actor<A: NodeActor>(&mut self, wired: &mut Wired<A, W, ActorCell<A>>) {
        if self.fault.is_some() {
            return;
        }
        let Wired {
            wire: Wire { name, output, .. },
            place: cell,
        } = wired;
        let watch = self
            .steps
            .as_mut()
            .map(|steps| |step| steps.push(ActorStep::new::<A>(name, step)));
        let acted = cell.act_watched(self.now, watch, |out| W::route(output(out), self.routed));
        if let Err(fault) = acted {
            self.fault = Some(fault);
        }
    }
}

struct Earliest(Option<Deadline>);

impl<W: Wiring> Visitor<W, Cells> for Earliest {
    #[inline]
    fn actor<A: NodeActor>(&mut self, wired: &mut Wired<A, W, ActorCell<A>>) {
        self.0 = Deadline::earlier(self.0, wired.place.deadline());
    }
}

struct Dropped(u64);

impl<W: Wiring> Visitor<W, Cells> for Dropped {
    fn actor<A: NodeActor>(&mut self, wired: &mut Wired<A, W, ActorCell<A>>) {
        self.0 += wired.place.dropped();
    }
}

struct Snapshots(Vec<Result<Snapshot, EncodeError>>);

impl<W: Wiring> Visitor<W, Cells> for Snapshots {
    fn actor<A: NodeActor>(&mut self, wired: &mut Wired<A, W, ActorCell<A>>) {
        self.0
            .push(Snapshot::of(wired.wire.name, wired.place.actor()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actor::tests_support::{Adding, Doubler, Number, Summer};
    use crate::actor::{RestartPolicy, StepCause};

    fn fed(node: &mut LocalNode<Adding>, numbers: &[u32]) -> Result<Vec<u32>, Fault> {
        let mut sums = Vec::new();
        numbers
            .iter()
            .try_for_each(|number| node.tell(Time::ZERO, *number, &mut sums))?;
        Ok(sums)
    }

    #[test]
    fn what_one_actor_says_the_next_hears_until_all_is_quiet() {
        let mut node = LocalNode::<Adding>::new(&mut 10);
        assert_eq!(fed(&mut node, &[1, 2]).unwrap(), [12, 16]);
        assert_eq!((node.deadline(), node.dropped()), (None, 0));
    }

    #[test]
    fn the_earliest_deadline_is_the_nodes_and_waking_it_is_enough() {
        let mut node = LocalNode::<Adding>::new(&mut 130);
        assert_eq!(node.deadline().unwrap().why, "over a hundred");
        node.wake(Time::ZERO, &mut Vec::new()).unwrap();
        assert_eq!(
            (node.deadline(), node.actors().summer.place.actor().0),
            (None, 30)
        );
    }

    #[test]
    fn a_fault_ends_the_round_and_is_handed_out() {
        let mut node = LocalNode::<Adding>::new(&mut 130);
        assert_eq!(fed(&mut node, &[7]).unwrap_err().reason, "seven");
        assert_eq!(
            node.actors().summer.place.actor().0,
            130,
            "it stands after the one that failed"
        );
    }

    #[test]
    fn steps_and_snapshots_bear_the_names_of_the_list_in_its_order() {
        let mut node = LocalNode::<Adding>::new(&mut 0);
        fed(&mut node, &[4]).unwrap();
        assert!(node.steps().is_empty(), "nobody watches");
        node.watch();
        fed(&mut node, &[5]).unwrap();
        let mut next = LocalNode::<Adding>::new(&mut 0);
        next.go_on_from(&mut node);
        fed(&mut next, &[6]).unwrap();
        let steps = next.steps();
        assert_eq!(
            steps.iter().map(|step| step.actor).collect::<Vec<_>>(),
            ["doubler", "summer", "doubler", "summer"]
        );
        let step = steps[1].of::<Summer>().unwrap();
        assert_eq!(
            (&step.cause, &step.outputs[..]),
            (&StepCause::Input(Number(10)), &[(18,)][..])
        );
        assert!(steps[1].of::<Doubler>().is_none());
        let names = |node: &mut LocalNode<Adding>| -> Vec<_> {
            node.snapshots()
                .unwrap()
                .iter()
                .map(|snapshot| snapshot.actor)
                .collect()
        };
        assert_eq!(names(&mut next), ["doubler", "summer"]);
    }

    /// Lists names and restart policies.
    struct List(Vec<(&'static str, RestartPolicy)>);

    impl<W: Wiring> Fill<W, super::super::Names> for List {
        fn actor<A: NodeActor>(&mut self, wire: Wire<A, W>) {
            self.0.push((wire.name, wire.restart));
        }
    }

    #[test]
    fn a_list_needs_no_actor() {
        let mut list = List(Vec::new());
        Adding::fill(&mut list);
        assert_eq!(
            list.0,
            [
                ("doubler", RestartPolicy::Restart),
                ("summer", RestartPolicy::StopNode)
            ]
        );
    }
}
