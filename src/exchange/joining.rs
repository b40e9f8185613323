//! Whether a node may take part, by what greetings say. Pure: it is told greetings and the time, and opens nothing.
//!
//! ```text
//!            somebody is linked, and nobody objects for a moment; or nobody is there
//!   Asking ──────────────────────────────────────────────────────────────────────────► Member
//!     │ a member of another wire version or venue, or of the same name
//!     ▼
//!   Refused                     Member ─ a member of the same name for longer ─► Refused
//! ```
//!
//! A member answers whoever asks and does not fit, so that both sides say why. Who found nobody takes part alone; when it
//! meets others later, of two of one name the one that has been a member for longer stays. A node that must leave for
//! another of its name leaves only after hearing it for a while: a greeting may have been long on its way, and the
//! one that
//! sent it may have left, or be this very node before it was started anew. Two ground stations do not refuse each other: the
//! lease decides between them.

use std::collections::BTreeMap;
use std::time::Duration;

use tomoswarm_proto::codec::{Greeting, VERSION};
use tomoswarm_proto::{Hello, Sender};

use crate::time::Time;

/// How long a node that somebody can hear listens for objections before it takes part.
const ASKS_FOR: Duration = Duration::from_millis(300);
/// A node that nobody can hear for this long takes part alone.
const ALONE_AFTER: Duration = Duration::from_millis(1500);
/// A greeting is repeated this often.
const EVERY: Duration = Duration::from_secs(2);
/// While it asks, this often.
const EVERY_ASKING: Duration = Duration::from_millis(100);
/// Who does not fit, and a node of its own name, is answered this often at most.
const EVERY_ANSWER: Duration = Duration::from_millis(100);
/// And so many times, as long as it greets in the same way: two that both answer would never end.
const ANSWERS: u32 = 10;
/// A node of which nothing that fits was heard for this long may be silenced by one of its name that does not fit; one that
/// does not fit and was silent for this long is answered anew.
const FORGOTTEN: Duration = Duration::from_secs(5);
/// Members for equally long, as far as can be told from afar.
const ALIKE_S: u32 = 2;
/// A node that must leave for another of its name has heard it this long.
const CONFIRMS_FOR: Duration = Duration::from_millis(500);
/// Who seems to be the elder, but not by enough, for this long.
const HESITATES: Duration = Duration::from_secs(1);
/// A member of its own name that is not heard for this long is gone: it greets more often.
const MISSED_AFTER: Duration = Duration::from_millis(2500);
/// Nodes of its own name that are told apart.
const TWINS_MAX: usize = 64;
/// Nodes that do not fit, of each name.
const MISFITS_MAX: usize = 4;

/// What follows from a greeting.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum JoinEffect {
    /// Nothing.
    Fine,
    /// The other one does not fit: what it says is not listened to, unless one of its name fits. Said once.
    Foreign(String),
    /// Another node of its own name has to leave. Said once of each.
    Stays(String),
    /// This node may not take part.
    Refused(String),
}

/// What is known of those that use one name.
#[derive(Clone, Default, Debug)]
struct Known {
    /// When one that fits greeted last.
    fitted: Option<Time>,
    is_silenced: bool,
    /// Those that do not fit.
    misfits: Vec<IncompatibleNode>,
}

#[derive(Clone, Copy, Debug)]
struct IncompatibleNode {
    greeting: Greeting,
    heard: Time,
    /// How often it was answered.
    answers: u32,
}

/// How far a node is with joining.
#[derive(Debug)]
pub struct Joining {
    own: Hello,
    since: Time,
    /// When somebody could hear it first.
    met: Option<Time>,
    member_since: Time,
    greeted: Option<Time>,
    /// Whether somebody is to be answered.
    owes: bool,
    /// By name: bounded, since names are numbers under 256, of vehicles and of operators, and the ground.
    known: BTreeMap<Sender, Known>,
    /// Since when nodes of its own name are heard, and when they were heard last, by instance.
    twins: BTreeMap<u64, (Time, Time)>,
    /// It does not take part before: another one of its name may do.
    waits_until: Time,
}

impl Joining {
    /// Begins to ask.
    pub fn new(now: Time, own: Hello) -> Joining {
        Joining {
            own: Hello {
                is_member: false,
                member_for_s: 0,
                ..own
            },
            since: now,
            met: None,
            member_since: now,
            greeted: None,
            owes: false,
            known: BTreeMap::new(),
            twins: BTreeMap::new(),
            waits_until: now,
        }
    }

    /// Returns whether the node takes part.
    pub fn is_member(&self) -> bool {
        self.own.is_member
    }

    /// Returns whether what a node says is listened to.
    pub fn listens_to(&self, node: Sender) -> bool {
        !self.known.get(&node).is_some_and(|known| known.is_silenced)
    }

    /// Learns that somebody can hear it: there is a link, or something was heard.
    pub fn meet(&mut self, now: Time) {
        self.met.get_or_insert(now);
    }

    /// Returns a greeting when one is due; also ends the asking when nobody has objected.
    pub fn greet(&mut self, now: Time) -> Option<Hello> {
        let has_asked = self.met.is_some_and(|met| now.since(met) >= ASKS_FOR);
        let is_alone = self.met.is_none() && now.since(self.since) >= ALONE_AFTER;
        if !self.own.is_member && now >= self.waits_until && (has_asked || is_alone) {
            (self.own.is_member, self.member_since) = (true, now);
            self.greeted = None;
        }
        let is_due = self.greeted.is_none_or(|at| now.since(at) >= self.every());
        is_due.then(|| self.greeting(now))
    }

    /// Returns an answer to whoever does not fit, if one is due now; never ends the asking.
    pub fn greet_if_due(&mut self, now: Time) -> Option<Hello> {
        let is_free = self.greeted.is_none_or(|at| now.since(at) >= EVERY_ANSWER);
        (self.own.is_member && self.owes && is_free).then(|| self.greeting(now))
    }

    /// Returns when to greet next.
    pub fn next(&self) -> Time {
        self.greeted.map_or(self.since, |at| at + self.every())
    }

    /// Takes a greeting of another node; of one of another wire version only the greeting can be read.
    pub fn hear(&mut self, now: Time, greeting: &Greeting, hello: Option<&Hello>) -> JoinEffect {
        self.meet(now);
        if let Some(misfit) = self.misfit(greeting) {
            return self.object(now, greeting, hello, &misfit);
        }
        let known = self.known.entry(greeting.node).or_default();
        (known.fitted, known.is_silenced) = (Some(now), false);
        match hello {
            Some(hello) if hello.node == self.own.node && hello.instance != self.own.instance => {
                self.compete(now, hello)
            }
            Some(_) | None => JoinEffect::Fine,
        }
    }

    fn every(&self) -> Duration {
        match (self.own.is_member, self.owes) {
            (true, true) => EVERY_ANSWER,
            (true, false) => EVERY,
            (false, _) => EVERY_ASKING,
        }
    }

    fn greeting(&mut self, now: Time) -> Hello {
        (self.greeted, self.owes) = (Some(now), false);
        Hello {
            member_for_s: self.member_for_s(now),
            ..self.own.clone()
        }
    }

    /// Returns how long the node has been a member, whole seconds.
    fn member_for_s(&self, now: Time) -> u32 {
        let member_for_s = now.since(self.member_since).as_secs();
        if self.own.is_member {
            u32::try_from(member_for_s).unwrap_or(u32::MAX)
        } else {
            0
        }
    }

    fn misfit(&self, greeting: &Greeting) -> Option<String> {
        if greeting.version != VERSION {
            return Some(format!(
                "wire version {}, here it is {VERSION}",
                greeting.version
            ));
        }
        (greeting.venue_hash != self.own.venue_hash).then(|| {
            format!(
                "another venue file (hash {:016x}, here {:016x})",
                greeting.venue_hash, self.own.venue_hash
            )
        })
    }

    /// Decides between this node and another one of its name, so that exactly one of them goes.
    fn compete(&mut self, now: Time, theirs: &Hello) -> JoinEffect {
        let Sender::Vehicle(_) = theirs.node else {
            return JoinEffect::Fine;
        };
        let is_new = !self.twins.contains_key(&theirs.instance);
        if is_new && self.twins.len() >= TWINS_MAX {
            self.twins.pop_first();
        }
        let (since, last) = self.twins.entry(theirs.instance).or_insert((now, now));
        if now.since(*last) >= FORGOTTEN {
            *since = now;
        }
        *last = now;
        let heard_for = now.since(*since);
        let ours_s = self.member_for_s(now);
        let is_lower = self.own.instance < theirs.instance;
        let is_alike = ours_s.abs_diff(theirs.member_for_s) <= ALIKE_S;
        let (stays, hesitates) = match (self.own.is_member, theirs.is_member) {
            (true, false) => (true, false),
            (false, true) => (false, false),
            (false, false) => (is_lower, false),
            (true, true) if is_alike => (is_lower, ours_s > theirs.member_for_s),
            (true, true) => (ours_s > theirs.member_for_s, false),
        };
        let name = theirs.node;
        let confirms_for = if hesitates { HESITATES } else { CONFIRMS_FOR };
        if !stays && heard_for >= confirms_for {
            return JoinEffect::Refused(format!(
                "{name} is on the bus already: another node runs under this id"
            ));
        }
        if !stays {
            self.waits_until = now
                + if theirs.is_member {
                    MISSED_AFTER
                } else {
                    ASKS_FOR
                };
        }
        self.owes = true;
        if is_new && stays {
            let age = format!("here for {ours_s} s, there for {} s", theirs.member_for_s);
            return JoinEffect::Stays(format!(
                "another node runs as {name} and has to leave ({age})"
            ));
        }
        JoinEffect::Fine
    }

    /// The newcomer gives way: who asks leaves, who takes part goes on and does not listen.
    fn object(
        &mut self,
        now: Time,
        greeting: &Greeting,
        hello: Option<&Hello>,
        misfit: &str,
    ) -> JoinEffect {
        let they_ask = hello.is_some_and(|hello| !hello.is_member);
        if !self.own.is_member && !they_ask && !matches!(greeting.node, Sender::Operator(_)) {
            return JoinEffect::Refused(format!("{} has {misfit}", greeting.node));
        }
        let known = self.known.entry(greeting.node).or_default();
        known.is_silenced = known.fitted.is_none_or(|at| now.since(at) >= FORGOTTEN);
        let (is_new, is_answered) = known.misfit(now, greeting);
        self.owes |= is_answered;
        match is_new {
            true => JoinEffect::Foreign(format!("{} is refused: {misfit}", greeting.node)),
            false => JoinEffect::Fine,
        }
    }
}

impl Known {
    /// Returns whether one that does not fit is new, and whether it is answered.
    fn misfit(&mut self, now: Time, greeting: &Greeting) -> (bool, bool) {
        if let Some(known) = self
            .misfits
            .iter_mut()
            .find(|known| known.greeting == *greeting)
        {
            if now.since(known.heard) >= FORGOTTEN {
                known.answers = 0;
            }
            known.heard = now;
            known.answers = (known.answers + 1).min(ANSWERS + 1);
            return (false, known.answers <= ANSWERS);
        }
        if self.misfits.len() >= MISFITS_MAX {
            let silent = self
                .misfits
                .iter()
                .position(|known| now.since(known.heard) >= FORGOTTEN);
            let Some(silent) = silent else {
                return (false, false);
            };
            self.misfits.swap_remove(silent);
        }
        self.misfits.push(IncompatibleNode {
            greeting: *greeting,
            heard: now,
            answers: 1,
        });
        (true, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Boot, VehicleId};

    fn hello(node: Sender, instance: u64) -> Hello {
        Hello::asking(node, Boot(1), 5, instance)
    }

    const TWO: Sender = Sender::Vehicle(VehicleId(2));

    const THREE: Sender = Sender::Vehicle(VehicleId(3));

    fn at(at_s: f64) -> Time {
        Time::from_secs_f64(at_s)
    }

    fn joining(node: Sender, instance: u64, is_member: bool) -> Joining {
        let mut joining = Joining::new(Time::ZERO, hello(node, instance));
        if is_member {
            joining.greet(at(2.0));
        }
        joining
    }

    /// Hears a greeting two seconds after the start.
    fn hear(joining: &mut Joining, hello: &Hello) -> JoinEffect {
        hear_at(joining, 2.0, hello)
    }

    fn hear_at(joining: &mut Joining, at_s: f64, hello: &Hello) -> JoinEffect {
        let greeting = Greeting {
            version: VERSION,
            node: hello.node,
            boot: hello.boot,
            venue_hash: hello.venue_hash,
        };
        joining.hear(at(at_s), &greeting, Some(hello))
    }

    #[test]
    fn without_objection_a_node_takes_part_soon_after_it_can_be_heard() {
        let mut joining = joining(TWO, 1, false);
        assert!(!joining.greet(Time::ZERO).unwrap().is_member);
        assert!(joining.greet(at(0.05)).is_none());
        assert!(
            !joining.greet(at(0.9)).unwrap().is_member,
            "nobody could object yet"
        );
        joining.meet(at(1.0));
        assert!(!joining.greet(at(1.25)).unwrap().is_member);
        let greeting = joining.greet(at(1.31)).unwrap();
        assert!(greeting.is_member && joining.is_member());
        assert_eq!(joining.greet(at(5.4)).unwrap().member_for_s, 4);
    }

    #[test]
    fn who_finds_nobody_takes_part_alone_within_two_seconds() {
        let mut joining = joining(TWO, 1, false);
        assert!(!joining.greet(at(1.4)).unwrap().is_member);
        assert!(joining.greet(at(1.6)).unwrap().is_member);
    }

    /// Hears a node for as long as it takes to believe it.
    fn hear_for_long(joining: &mut Joining, hello: &Hello) -> JoinEffect {
        let first = hear_at(joining, 2.0, hello);
        match hear_at(joining, 2.5, hello) {
            JoinEffect::Fine => first,
            later => later,
        }
    }

    #[test]
    fn a_node_linked_late_is_refused_by_the_established_one_of_its_name() {
        let mut late = joining(TWO, 1, false);
        late.greet(at(1.2));
        let member = Hello {
            is_member: true,
            member_for_s: 100,
            ..hello(TWO, 9)
        };
        assert_eq!(
            hear_at(&mut late, 1.2, &member),
            JoinEffect::Fine,
            "it may be gone since"
        );
        late.greet(at(1.6));
        assert!(!late.is_member(), "nor does it take part");
        assert!(matches!(
            hear_at(&mut late, 1.7, &member),
            JoinEffect::Refused(_)
        ));
        assert!(!late.is_member());
    }

    #[test]
    fn a_greeting_that_was_long_on_its_way_keeps_nobody_out() {
        let mut anew = joining(TWO, 1, false);
        let before = Hello {
            is_member: true,
            member_for_s: 100,
            ..hello(TWO, 9)
        };
        assert_eq!(hear_at(&mut anew, 0.1, &before), JoinEffect::Fine);
        assert!(!anew.greet(at(2.5)).unwrap().is_member, "it may be there");
        assert!(anew.greet(at(2.61)).unwrap().is_member, "it is gone");
        // A member that is not heard any more is not one that was heard for long.
        assert_eq!(hear_at(&mut anew, 60.0, &before), JoinEffect::Fine);
    }

    #[test]
    fn a_name_in_use_is_refused_to_the_newcomer() {
        let member = Hello {
            is_member: true,
            ..hello(TWO, 9)
        };
        assert!(matches!(
            hear_for_long(&mut joining(TWO, 1, false), &member),
            JoinEffect::Refused(_)
        ));
        let mut first = joining(TWO, 1, true);
        assert!(matches!(
            hear(&mut first, &hello(TWO, 9)),
            JoinEffect::Stays(_)
        ));
        assert_eq!(
            hear(&mut first, &hello(TWO, 9)),
            JoinEffect::Fine,
            "it is said once"
        );
        let other = Hello {
            is_member: true,
            ..hello(THREE, 9)
        };
        assert_eq!(hear(&mut joining(TWO, 1, false), &other), JoinEffect::Fine);
    }

    #[test]
    fn of_two_that_come_together_exactly_one_stays() {
        for is_member in [false, true] {
            let output = |instance| Hello {
                is_member,
                ..hello(TWO, instance)
            };
            let verdicts = [
                hear_for_long(&mut joining(TWO, 1, is_member), &output(9)),
                hear_for_long(&mut joining(TWO, 9, is_member), &output(1)),
            ];
            assert!(
                matches!(verdicts, [JoinEffect::Stays(_), JoinEffect::Refused(_)]),
                "{verdicts:?}"
            );
        }
    }

    #[test]
    fn of_two_members_the_one_that_has_been_one_for_longer_stays() {
        // Linked only a minute after the elder began, 20 s after the younger did; the younger has the lower instance.
        let (mut elder, mut younger) = (joining(TWO, 9, true), joining(TWO, 1, true));
        let of_elder = Hello {
            is_member: true,
            member_for_s: 58,
            ..hello(TWO, 9)
        };
        let of_younger = Hello {
            is_member: true,
            member_for_s: 18,
            ..hello(TWO, 1)
        };
        assert!(matches!(
            hear_at(&mut elder, 60.0, &of_younger),
            JoinEffect::Stays(_)
        ));
        assert_eq!(hear_at(&mut younger, 20.0, &of_elder), JoinEffect::Fine);
        assert!(matches!(
            hear_at(&mut younger, 20.5, &of_elder),
            JoinEffect::Refused(_)
        ));
    }

    #[test]
    fn of_two_members_one_goes_whatever_the_difference_of_their_ages() {
        for difference_ms in (0..6000_u64).step_by(70) {
            for elder_is_lower in [false, true] {
                let instances = if elder_is_lower { [1, 9] } else { [9, 1] };
                let mut gone: [Option<u64>; 2] = [None, None];
                let mut pair =
                    instances.map(|instance| Joining::new(Time::ZERO, hello(TWO, instance)));
                let clock = |of: usize, now_ms: u64| {
                    Time::from_nanos(now_ms.saturating_sub([0, difference_ms][of]) * 1_000_000)
                };
                // They meet after ten seconds; each hears every 100 ms what the other said 30 ms before.
                for now_ms in (0..20_000).step_by(50) {
                    for which in [0, 1] {
                        pair[which].greet(clock(which, now_ms));
                        let (other, said_ms) = (1 - which, now_ms.saturating_sub(30));
                        let has_said = gone[other].is_none_or(|at_ms| at_ms > said_ms);
                        let is_turn = now_ms >= 10_000 && now_ms % 100 == 50 * which as u64;
                        if !is_turn || gone[which].is_some() || !has_said {
                            continue;
                        }
                        let output = pair[other].greeting(clock(other, said_ms));
                        let now = clock(which, now_ms);
                        if let JoinEffect::Refused(_) =
                            hear_at(&mut pair[which], now.as_secs_f64(), &output)
                        {
                            gone[which] = Some(now_ms);
                        }
                    }
                }
                assert!(
                    gone[0].is_some() != gone[1].is_some(),
                    "{difference_ms} ms: {gone:?}"
                );
                assert!(
                    difference_ms < 3000 || gone[1].is_some(),
                    "{difference_ms} ms: the elder went"
                );
            }
        }
    }

    #[test]
    fn another_venue_is_refused_on_both_sides() {
        let elsewhere = Hello {
            venue_hash: 6,
            ..hello(THREE, 9)
        };
        let mut member = joining(TWO, 1, true);
        assert!(matches!(
            hear(&mut member, &elsewhere),
            JoinEffect::Foreign(_)
        ));
        assert!(!member.listens_to(THREE));
        assert_eq!(
            hear(&mut member, &elsewhere),
            JoinEffect::Fine,
            "it is said once"
        );
        let established = Hello {
            is_member: true,
            ..elsewhere
        };
        assert!(matches!(
            hear(&mut joining(TWO, 1, false), &established),
            JoinEffect::Refused(_)
        ));
    }

    #[test]
    fn a_stranger_does_not_silence_the_right_one_of_its_name() {
        let (right, stranger) = (
            hello(THREE, 3),
            Hello {
                venue_hash: 6,
                ..hello(THREE, 9)
            },
        );
        let mut member = joining(TWO, 1, true);
        hear_at(&mut member, 10.0, &right);
        assert!(matches!(
            hear_at(&mut member, 12.0, &stranger),
            JoinEffect::Foreign(_)
        ));
        assert!(member.listens_to(THREE));
        hear_at(&mut member, 15.1, &stranger);
        assert!(!member.listens_to(THREE), "the right one is gone");
        hear_at(&mut member, 16.0, &right);
        assert!(member.listens_to(THREE));
    }

    #[test]
    fn who_does_not_fit_is_answered_every_100_ms_and_not_for_ever() {
        let mut member = joining(TWO, 1, true);
        let mut answers_within = |from_ms: u64, to_ms: u64| {
            let mut answers = 0;
            for now_ms in from_ms..to_ms {
                let now = Time::from_nanos(now_ms * 1_000_000);
                let elsewhere = Hello {
                    venue_hash: 6,
                    ..hello(THREE, 9)
                };
                hear_at(&mut member, now.as_secs_f64(), &elsewhere);
                answers += usize::from(member.greet_if_due(now).is_some());
            }
            answers
        };
        assert!((1..=2).contains(&answers_within(3000, 3150)));
        assert!(answers_within(3150, 10_000) <= 10);
        assert!(
            answers_within(20_000, 20_050) == 1,
            "it is answered again after a silence"
        );
    }

    #[test]
    fn another_version_is_refused_though_only_its_greeting_can_be_read() {
        let greeting = Greeting {
            version: 9,
            node: Sender::Ground,
            boot: Boot(1),
            venue_hash: 5,
        };
        let JoinEffect::Refused(reason) = joining(TWO, 1, false).hear(at(0.1), &greeting, None)
        else {
            panic!()
        };
        assert!(reason.contains("wire version 9"), "{reason}");
        assert!(matches!(
            joining(TWO, 1, true).hear(at(2.0), &greeting, None),
            JoinEffect::Foreign(_)
        ));
    }

    #[test]
    fn two_grounds_do_not_refuse_each_other() {
        let other = Hello {
            is_member: true,
            ..hello(Sender::Ground, 9)
        };
        assert_eq!(
            hear(&mut joining(Sender::Ground, 1, false), &other),
            JoinEffect::Fine
        );
    }
}
