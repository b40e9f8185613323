//! An actor with its inbox: how a single-threaded runtime keeps the contract.

use super::step::{self, RecordedStep, StepCause};
use super::{Actor, Fault, Inbox, Input};
use crate::time::{Deadline, Time};

/// Inputs of the queue class that may wait in front of one actor.
const INBOX: usize = 256;

/// An actor with what it has not read yet.
#[derive(Debug)]
pub struct ActorCell<A: Actor> {
    actor: A,
    inbox: Inbox<A::In>,
    output: Vec<A::Out>,
    /// The latest moment that it was told.
    latest: Time,
    /// What the actor said when it was asked last, which is after each of its steps: nothing else can change it.
    deadline: Option<Deadline>,
}

impl<A: Actor> ActorCell<A>
where
    A::In: Input,
{
    /// Puts an actor behind an empty inbox.
    pub fn new(actor: A) -> ActorCell<A> {
        let deadline = actor.deadline();
        ActorCell {
            actor,
            inbox: Inbox::new(INBOX),
            output: Vec::new(),
            latest: Time::ZERO,
            deadline,
        }
    }

    /// Returns the actor.
    pub fn actor(&self) -> &A {
        &self.actor
    }

    /// Puts an input into the inbox.
    pub fn push(&mut self, input: A::In) {
        self.inbox.push(input);
    }

    /// Returns how many inputs were dropped unread.
    pub fn dropped(&self) -> u64 {
        self.inbox.dropped()
    }

    /// Returns the actor's deadline.
    #[inline]
    pub fn deadline(&self) -> Option<Deadline> {
        self.deadline
    }

    /// Lets the actor act until nothing is due and nothing unread, and hands on what it says.
    ///
    /// # Errors
    /// The actor cannot go on, or the contract is broken: time went back, or a deadline did not move when it was due.
    pub fn act(&mut self, now: Time, hand_on: impl FnMut(A::Out)) -> Result<(), Fault>
    where
        A::In: Clone,
        A::Out: Clone,
    {
        self.act_watched(now, None::<fn(RecordedStep<A::In, A::Out>)>, hand_on)
    }

    /// Acts as [`ActorCell::act`] does, and shows every step before what was said in it is handed on; the step that ended
    /// in a fault as well. Nothing is cloned when nobody watches.
    ///
    /// # Errors
    /// As for [`ActorCell::act`].
    #[inline]
    pub fn act_watched(
        &mut self,
        now: Time,
        watch: Option<impl FnMut(RecordedStep<A::In, A::Out>)>,
        hand_on: impl FnMut(A::Out),
    ) -> Result<(), Fault>
    where
        A::In: Clone,
        A::Out: Clone,
    {
        if now < self.latest {
            return Err(step::fault::<A>(format!(
                "time went back from {} to {now} s",
                self.latest
            )));
        }
        self.latest = now;
        // Most actors of a node have nothing to do at most moments: they are passed by without a call.
        if self.inbox.is_empty() && self.due(now).is_none() {
            return Ok(());
        }
        self.take_steps(now, watch, hand_on)
    }

    /// Returns the deadline, if it has come.
    #[inline]
    fn due(&self, now: Time) -> Option<Deadline> {
        self.deadline.filter(|deadline| deadline.at <= now)
    }

    /// Takes one step after another until nothing is due and nothing unread.
    fn take_steps(
        &mut self,
        now: Time,
        mut watch: Option<impl FnMut(RecordedStep<A::In, A::Out>)>,
        mut hand_on: impl FnMut(A::Out),
    ) -> Result<(), Fault>
    where
        A::In: Clone,
        A::Out: Clone,
    {
        loop {
            let due = self.due(now);
            let input = if due.is_some() {
                None
            } else {
                self.inbox.pop()
            };
            let cause = match (&due, &input) {
                (None, None) => return Ok(()),
                (Some(deadline), _) => Some(StepCause::Woken(deadline.why)),
                (None, Some(input)) => watch.is_some().then(|| StepCause::Input(input.clone())),
            };
            let taken = step::take(&mut self.actor, now, input, &mut self.output);
            self.deadline = self.actor.deadline();
            if let (Some(watch), Some(cause)) = (&mut watch, cause) {
                let fault = taken.as_ref().err().map(Fault::to_string);
                watch(RecordedStep {
                    now,
                    cause,
                    outputs: self.output.clone(),
                    fault,
                });
            }
            taken?;
            self.output.drain(..).for_each(&mut hand_on);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actor::InputClass;
    use std::time::Duration;

    /// Repeats what it is told, and ticks once a second.
    struct Clock(Time);

    impl Input for u32 {
        type Key = ();
        fn class(&self) -> InputClass<()> {
            InputClass::Queue
        }
    }

    impl Actor for Clock {
        type In = u32;
        type Out = String;
        fn handle(&mut self, _now: Time, input: u32, out: &mut Vec<String>) -> Result<(), Fault> {
            out.push(format!("told {input}"));
            Ok(())
        }
        fn deadline(&self) -> Option<Deadline> {
            Some(Deadline {
                at: self.0,
                why: "tick",
            })
        }
        fn wake(&mut self, now: Time, out: &mut Vec<String>) -> Result<(), Fault> {
            self.0 = now + Duration::from_secs(1);
            out.push("tick".to_owned());
            Ok(())
        }
    }

    #[test]
    fn a_due_deadline_goes_before_the_inbox() {
        let mut cell = ActorCell::new(Clock(Time::from_secs_f64(1.0)));
        cell.push(1);
        cell.push(2);
        let mut output = Vec::new();
        cell.act(Time::from_secs_f64(0.5), |out| output.push(out))
            .unwrap();
        cell.push(3);
        cell.act(Time::from_secs_f64(1.0), |out| output.push(out))
            .unwrap();
        assert_eq!(output, ["told 1", "told 2", "tick", "told 3"]);
    }

    /// Never moves its deadline.
    struct Stuck;

    impl Actor for Stuck {
        type In = u32;
        type Out = ();
        fn handle(&mut self, _now: Time, _input: u32, _out: &mut Vec<()>) -> Result<(), Fault> {
            Ok(())
        }
        fn deadline(&self) -> Option<Deadline> {
            Some(Deadline {
                at: Time::from_secs_f64(1.0),
                why: "tick",
            })
        }
        fn wake(&mut self, _now: Time, _out: &mut Vec<()>) -> Result<(), Fault> {
            Ok(())
        }
    }

    /// Counts how often it is asked for its deadline.
    #[derive(Default)]
    struct Asked(std::cell::Cell<u32>);

    impl Actor for Asked {
        type In = u32;
        type Out = ();
        fn handle(&mut self, _now: Time, _input: u32, _out: &mut Vec<()>) -> Result<(), Fault> {
            Ok(())
        }
        fn deadline(&self) -> Option<Deadline> {
            self.0.set(self.0.get() + 1);
            None
        }
        fn wake(&mut self, _now: Time, _out: &mut Vec<()>) -> Result<(), Fault> {
            Ok(())
        }
    }

    #[test]
    fn an_actor_that_was_not_touched_is_not_asked_for_its_deadline() {
        let mut cell = ActorCell::new(Asked::default());
        for second in 0..5 {
            cell.act(Time::from_secs_f64(f64::from(second)), |()| {})
                .unwrap();
            assert_eq!(cell.deadline(), None);
        }
        assert_eq!(cell.actor().0.get(), 1, "when it was put in");
        (0..3).for_each(|input| cell.push(input));
        cell.act(Time::from_secs_f64(9.0), |()| {}).unwrap();
        assert_eq!(cell.actor().0.get(), 4, "and after each step");
    }

    #[test]
    fn an_actor_woken_in_vain_is_a_fault_and_no_endless_loop() {
        let mut cell = ActorCell::new(Stuck);
        assert_eq!(cell.act(Time::ZERO, |()| {}), Ok(()));
        let fault = cell.act(Time::from_secs_f64(2.0), |()| {}).unwrap_err();
        assert_eq!(
            fault.to_string(),
            "Stuck cannot go on: woken in vain at 2.000 s: tick is still due"
        );
    }

    #[test]
    fn time_that_goes_back_is_a_fault() {
        let mut cell = ActorCell::new(Clock(Time::from_secs_f64(9.0)));
        cell.act(Time::from_secs_f64(2.0), |_| {}).unwrap();
        cell.act(Time::from_secs_f64(2.0), |_| {}).unwrap();
        let fault = cell.act(Time::from_secs_f64(1.0), |_| {}).unwrap_err();
        assert_eq!(fault.reason, "time went back from 2.000 to 1.000 s");
    }

    #[test]
    fn a_watcher_sees_every_step_before_it_is_handed_on() {
        let mut cell = ActorCell::new(Clock(Time::from_secs_f64(1.0)));
        cell.push(7);
        let order = std::cell::RefCell::new(Vec::new());
        let watch = |step: RecordedStep<u32, String>| {
            order
                .borrow_mut()
                .push(format!("{:?} {:?}", step.cause, step.outputs))
        };
        cell.act_watched(Time::from_secs_f64(1.0), Some(watch), |output| {
            order.borrow_mut().push(output)
        })
        .unwrap();
        let expected = [
            r#"Woken("tick") ["tick"]"#,
            "tick",
            r#"Input(7) ["told 7"]"#,
            "told 7",
        ];
        assert_eq!(order.into_inner(), expected);
    }

    #[test]
    fn a_watcher_sees_the_fault() {
        let mut cell = ActorCell::new(Stuck);
        let mut seen = Vec::new();
        cell.act_watched(
            Time::from_secs_f64(2.0),
            Some(|step: RecordedStep<u32, ()>| seen.push(step)),
            |()| {},
        )
        .unwrap_err();
        assert!(seen[0].fault.as_ref().unwrap().contains("in vain") && seen.len() == 1);
    }

    #[test]
    fn a_step_taken_again_is_the_step_and_one_out_of_turn_is_not() {
        let at = Time::from_secs_f64;
        let mut clock = Clock(at(1.0));
        assert_eq!(
            step::again(&mut clock, at(0.5), Some(3)).outputs,
            ["told 3"]
        );
        assert_eq!(
            step::again(&mut clock, at(0.6), None).cause,
            StepCause::Woken(step::NOT_DUE)
        );
        assert_eq!(
            step::again(&mut clock, at(1.5), Some(4)).cause,
            StepCause::Woken("tick"),
            "what is due goes first"
        );
    }
}
