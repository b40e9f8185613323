//! Whether the numbers in a message can be true that everybody counts on from: leases, runs and revisions. Whoever orders
//! or plans goes above the highest that it has heard, so one frame with the last number of all would be the last word for
//! ever. A frame in which a number leaps is refused; what its sender says otherwise is heard.
//!
//! ```text
//!   a lease is plausible up to 1,000 above the highest of the last second; a run, or a revision, also up to 2³⁰
//!   leaps ─► refused ─nothing else was said by this sender in messages of this kind for 30 s─► believed after all
//! ```
//!
//! The last rule is for a node that has missed much: whom nobody contradicts is believed. It is no proof of who speaks:
//! only certificates are. Counts of starts and of states may be anything, and are judged by whoever keeps them.

use std::collections::BTreeMap;
use std::time::Duration;

use tomoswarm_proto::{Hello, Message, MessageKind, MissionProgress, Sender, State};

use super::ingress::{FrameRefusal, HeardMessage};
use crate::time::Time;

/// A number may be so far above the highest heard.
const STEP: u32 = 1000;
/// And rise so far once in this time.
const STEP_EVERY: Duration = Duration::from_secs(1);
/// People choose runs, and whoever comes late hears any revision: up to this there is nothing wrong, and as many are left.
const ANY_UNTIL: u32 = 1 << 30;
/// The first that is heard, before any other is known, is at most this.
const FIRST_MAX: u32 = 1 << 31;
/// A sender that says nothing else for this long is believed.
const BELIEVED_AFTER: Duration = Duration::from_secs(30);
/// Who says nothing for longer than this has not insisted. (Plans are said again every minute.)
const INSISTS_WITHIN: Duration = Duration::from_secs(75);

/// What is counted, in the order of [`Numbers`].
const COUNTED: [&str; 4] = ["lease", "run", "revision of plans", "revision of orders"];
/// Up to which number anything is plausible, in the same order.
const ANY: [u32; 4] = [0, ANY_UNTIL, ANY_UNTIL, ANY_UNTIL];

/// The numbers in a message that others count on from: lease, run, revision of plans, revision of orders; 0 = none.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Numbers([u32; 4]);

/// The highest number of its sort.
#[derive(Clone, Copy, Debug, Default)]
struct Highest {
    /// 0 = none was heard.
    number: u32,
    /// What it was when the present second began, and when that was.
    before: u32,
    since: Time,
}

/// The highest numbers that a node has believed, and who says higher ones.
#[derive(Clone, Debug, Default)]
pub struct Plausibility {
    highest: [Highest; 4],
    /// Since when a sender says nothing else in messages of a kind, and when it did last; bounded, since names are numbers
    /// under 256.
    leaping: BTreeMap<(Sender, MessageKind), (Time, Time)>,
}

impl Plausibility {
    /// Judges what a sender says.
    ///
    /// # Errors
    /// A number in it is too far above all that were heard.
    pub fn judge(&mut self, now: Time, heard: &HeardMessage) -> Result<(), FrameRefusal> {
        let (sender, kind, numbers) = match heard {
            HeardMessage::Message(sender, message) => {
                (*sender, message.kind(), Numbers::of(message))
            }
            HeardMessage::Greeting(greeting, Some(hello)) => (
                greeting.node,
                MessageKind::Hello,
                Numbers::of_greeting(hello),
            ),
            HeardMessage::Greeting(_, None) | HeardMessage::Unknown(_) => return Ok(()),
        };
        if numbers == Numbers::default() {
            return Ok(());
        }
        if let Some(refusal) = self.leap(now, numbers) {
            let (since, last) = self.leaping.entry((sender, kind)).or_insert((now, now));
            // Who insists says it again and again; two frames far apart do not.
            if now.since(*last) > INSISTS_WITHIN {
                *since = now;
            }
            *last = now;
            if now.since(*since) < BELIEVED_AFTER {
                return Err(refusal);
            }
        }
        self.leaping.remove(&(sender, kind));
        self.believe(now, numbers);
        Ok(())
    }

    /// Records what the node itself says, as its disk and store have it.
    pub fn know(&mut self, now: Time, numbers: Numbers) {
        self.believe(now, numbers);
        for (highest, number) in self.highest.iter_mut().zip(numbers.0) {
            highest.before = highest.before.max(number);
        }
    }

    /// Returns the first number that is too high, as a reason to refuse it.
    fn leap(&self, now: Time, numbers: Numbers) -> Option<FrameRefusal> {
        let all = numbers
            .0
            .into_iter()
            .zip(self.highest)
            .zip(COUNTED.into_iter().zip(ANY));
        let mut leaps =
            all.filter(|((number, highest), (_, any))| *number > highest.limit(now).max(*any));
        let ((number, highest), (what, _)) = leaps.next()?;
        Some(FrameRefusal::Leaps {
            what,
            number,
            highest: highest.number,
        })
    }

    fn believe(&mut self, now: Time, numbers: Numbers) {
        for ((highest, number), any) in self.highest.iter_mut().zip(numbers.0).zip(ANY) {
            if number > 0 {
                highest.believe(now, number, any);
            }
        }
    }
}

impl Highest {
    /// Returns the highest number that is plausible now.
    fn limit(&self, now: Time) -> u32 {
        if self.number == 0 {
            return FIRST_MAX;
        }
        let is_later = now.since(self.since) >= STEP_EVERY;
        let before = if is_later { self.number } else { self.before };
        before.saturating_add(STEP)
    }

    /// Takes a number; one of those that are plausible in any case is counted on from at once.
    fn believe(&mut self, now: Time, number: u32, any: u32) {
        if self.number == 0 {
            *self = Highest {
                number,
                before: number,
                since: now,
            };
        } else if now.since(self.since) >= STEP_EVERY {
            (self.before, self.since) = (self.number, now);
        }
        self.number = self.number.max(number);
        if number <= any {
            self.before = self.before.max(number);
        }
    }
}

impl Numbers {
    /// Returns the numbers in a message. Samples and watermarks may name any run: nobody counts on from there.
    pub fn of(message: &Message) -> Numbers {
        Numbers(match message {
            Message::Hello(hello) => return Numbers::of_greeting(hello),
            Message::State(State {
                accepted: (run, revision),
                ordered,
                ..
            }) => [
                ordered.lease.number,
                ordered.run.max(*run).0,
                revision.0,
                ordered.revision.0,
            ],
            Message::Mission(MissionProgress {
                lease_number,
                progress,
                ..
            }) => [*lease_number, progress.run.0, progress.revision.0, 0],
            Message::Plan(plan) => [plan.lease.number, plan.run.0, plan.revision.0, 0],
            Message::Order(order) => [order.lease.number, order.run.0, 0, order.revision.0],
            Message::Report(report) => {
                let newest = report
                    .runs
                    .last()
                    .map_or(report.run, |run| run.run.max(report.run));
                [report.lease.number, newest.0, 0, 0]
            }
            Message::Task(task) => [task.lease.number, task.run.0, 0, 0],
            Message::Tile(_)
            | Message::Digest(_)
            | Message::Want(_)
            | Message::Samples(_)
            | Message::Have(_)
            | Message::Beacon(_)
            | Message::Health(_)
            | Message::Standing(_)
            | Message::Image(_)
            | Message::Fix(_)
            | Message::Mark(_)
            | Message::Look(_)
            | Message::Log(_)
            | Message::Settings(_) => return Numbers::default(),
        })
    }

    fn of_greeting(hello: &Hello) -> Numbers {
        Numbers([hello.lease.map_or(0, |lease| lease.number), 0, 0, 0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Progress, Revision, RunId, VehicleId};

    const ONE: VehicleId = VehicleId(1);
    const TWO: VehicleId = VehicleId(2);

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    /// A vehicle that follows something by a lease, in a run.
    fn mission(vehicle: VehicleId, lease_number: u32, run: u32) -> Message {
        let progress = Progress {
            run: RunId(run),
            revision: Revision(1),
            ..Progress::default()
        };
        Message::Mission(MissionProgress {
            vehicle,
            lease_number,
            progress,
            ..MissionProgress::default()
        })
    }

    fn is_heard(
        known: &mut Plausibility,
        at_s: f64,
        vehicle: VehicleId,
        lease: u32,
        run: u32,
    ) -> bool {
        let heard = HeardMessage::Message(Sender::Vehicle(vehicle), mission(vehicle, lease, run));
        known.judge(at(at_s), &heard).is_ok()
    }

    #[test]
    fn a_lease_far_above_the_highest_is_refused_and_the_next_thousand_are_not() {
        let mut known = Plausibility::default();
        for (at_s, lease, is_plausible) in [
            (0.0, 5, true),
            (0.1, 1005, true),
            (0.2, 1006, false),
            (1.1, 2005, true),
            (1.2, u32::MAX, false),
        ] {
            assert_eq!(
                is_heard(&mut known, at_s, ONE, lease, 1),
                is_plausible,
                "{lease} after {at_s} s"
            );
        }
    }

    #[test]
    fn a_run_may_be_any_that_leaves_as_many_above_it() {
        let mut known = Plausibility::default();
        for (at_s, run, is_plausible) in [
            (0.0, 5, true),
            (0.1, u32::MAX - 1, false),
            (0.2, 20_261_121, true),
            (0.3, ANY_UNTIL, true),
            (0.4, ANY_UNTIL + 1, true),
            (1.4, ANY_UNTIL + 1002, false),
        ] {
            assert_eq!(
                is_heard(&mut known, at_s, ONE, 1, run),
                is_plausible,
                "{run} after {at_s} s"
            );
        }
    }

    #[test]
    fn whom_nobody_contradicts_is_believed_after_a_while() {
        let mut known = Plausibility::default();
        assert!(is_heard(&mut known, 0.0, ONE, 5, 1));
        for at_s in 1..31 {
            assert!(
                !is_heard(&mut known, f64::from(at_s), TWO, 90_000, 1),
                "{at_s} s"
            );
        }
        assert!(is_heard(&mut known, 31.0, TWO, 90_000, 1));
        assert!(
            is_heard(&mut known, 32.0, ONE, 90_001, 1),
            "others count on from there"
        );
    }

    #[test]
    fn single_frames_far_apart_are_not_believed() {
        let mut known = Plausibility::default();
        assert!(is_heard(&mut known, 0.0, ONE, 5, 1));
        for hour in 0..5 {
            let at_s = 3600.0 * f64::from(hour);
            assert!(
                !is_heard(&mut known, at_s + 1.0, TWO, 90_000, 1),
                "{hour} h"
            );
        }
        // Plans are said every minute.
        for minute in 0..2 {
            let at_s = 20_000.0 + 60.0 * f64::from(minute);
            assert_eq!(
                is_heard(&mut known, at_s, TWO, 90_000, 1),
                minute > 0,
                "{minute}"
            );
        }
    }

    #[test]
    fn who_says_both_is_never_believed() {
        let mut known = Plausibility::default();
        for at_s in 0..100 {
            assert!(is_heard(&mut known, f64::from(at_s), ONE, 5, 1));
            assert!(
                !is_heard(&mut known, f64::from(at_s) + 0.5, ONE, u32::MAX, 1),
                "{at_s} s"
            );
        }
    }

    #[test]
    fn what_the_node_says_itself_is_known() {
        let mut known = Plausibility::default();
        assert!(is_heard(&mut known, 0.0, ONE, 5, 1));
        known.know(at(0.1), Numbers::of(&mission(TWO, 90_000, 1)));
        assert!(is_heard(&mut known, 0.2, ONE, 90_001, 1));
    }
}
