//! Whether a node may take part, by what greetings say. Pure: it is told greetings and the time, and opens nothing.
//!
//! ```text
//!            nobody objects for a moment
//!   Asking ─────────────────────────────► Member
//!     │ a member of another wire version or venue, or of the same name
//!     ▼
//!   Refused                                 Member ─ who joined under the same name earlier ─► Refused
//! ```
//!
//! A member answers whoever asks and does not fit, so that both sides say why. Two ground stations do not refuse each
//! other: the lease decides between them.

use std::collections::BTreeMap;
use std::time::Duration;

use tomoswarm_proto::codec::{Greeting, VERSION};
use tomoswarm_proto::{Hello, Sender};

use crate::time::Time;

/// How long a node listens for objections before it takes part.
const ASKS_FOR: Duration = Duration::from_millis(300);
/// A greeting is repeated this often.
const EVERY: Duration = Duration::from_secs(2);
/// While it asks, this often.
const EVERY_ASKING: Duration = Duration::from_millis(100);
/// Reasons kept for nodes that do not fit.
const FOREIGN_MAX: usize = 64;

/// What follows from a greeting.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Verdict {
    /// Nothing.
    Fine,
    /// The other one does not fit: what it says is not listened to. Said once; answer with the own greeting.
    Foreign(String),
    /// This node may not take part.
    Refused(String),
}

/// How far a node is with joining.
#[derive(Debug)]
pub struct Joining {
    own: Hello,
    since: Time,
    greeted: Option<Time>,
    foreign: BTreeMap<Sender, String>,
}

impl Joining {
    /// Begins to ask.
    pub fn new(now: Time, own: Hello) -> Joining {
        Joining {
            own: Hello { is_member: false, ..own },
            since: now,
            greeted: None,
            foreign: BTreeMap::new(),
        }
    }

    /// Tells whether the node takes part.
    pub fn is_member(&self) -> bool {
        self.own.is_member
    }

    /// Tells whether what a node says is listened to.
    pub fn listens_to(&self, node: Sender) -> bool {
        !self.foreign.contains_key(&node)
    }

    /// Gives a greeting when one is due; also ends the asking when nobody has objected.
    pub fn greet(&mut self, now: Time) -> Option<Hello> {
        if !self.own.is_member && now.since(self.since) >= ASKS_FOR {
            self.own.is_member = true;
            self.greeted = None;
        }
        let every = if self.own.is_member { EVERY } else { EVERY_ASKING };
        let is_due = self.greeted.is_none_or(|at| now.since(at) >= every);
        is_due.then(|| {
            self.greeted = Some(now);
            self.own.clone()
        })
    }

    /// Gives an answer to whoever does not fit, if one is due now; never ends the asking.
    pub fn greet_if_due(&mut self, now: Time) -> Option<Hello> {
        let is_due = self.own.is_member && self.greeted.is_none();
        is_due.then(|| {
            self.greeted = Some(now);
            self.own.clone()
        })
    }

    /// Gives when to greet next.
    pub fn next(&self) -> Time {
        let every = if self.own.is_member { EVERY } else { EVERY_ASKING };
        self.greeted.map_or(self.since, |at| at + every)
    }

    /// Takes a greeting of another node; of one of another wire version only the greeting can be read.
    pub fn hear(&mut self, greeting: &Greeting, hello: Option<&Hello>) -> Verdict {
        let theirs_counts = hello.is_none_or(|hello| hello.is_member);
        if let Some(misfit) = self.misfit(greeting) {
            return self.object(greeting, hello, misfit);
        }
        self.foreign.remove(&greeting.node);
        let is_twin = hello.is_some_and(|hello| hello.instance != self.own.instance);
        let Sender::Vehicle(_) = greeting.node else { return Verdict::Fine };
        if greeting.node != self.own.node || !is_twin {
            return Verdict::Fine;
        }
        let theirs = hello.map_or(0, |hello| hello.instance);
        let ours_stays = match (self.own.is_member, theirs_counts) {
            (true, false) => true,
            (false, true) => false,
            // Both have joined, or both ask: anything that both decide alike.
            (true, true) | (false, false) => self.own.instance < theirs,
        };
        let name = greeting.node;
        if ours_stays {
            self.greeted = None;
            return Verdict::Fine;
        }
        Verdict::Refused(format!("{name} is on the bus already: another node runs under this id"))
    }

    fn misfit(&self, greeting: &Greeting) -> Option<String> {
        if greeting.version != VERSION {
            return Some(format!("wire version {}, here it is {VERSION}", greeting.version));
        }
        (greeting.venue_hash != self.own.venue_hash).then(|| {
            format!(
                "another venue file (hash {:016x}, here {:016x})",
                greeting.venue_hash, self.own.venue_hash
            )
        })
    }

    /// The newcomer gives way: who asks leaves, who takes part goes on and does not listen.
    fn object(&mut self, greeting: &Greeting, hello: Option<&Hello>, misfit: String) -> Verdict {
        let they_ask = hello.is_some_and(|hello| !hello.is_member);
        if !self.own.is_member && !they_ask && greeting.node != Sender::Operator {
            return Verdict::Refused(format!("{} has {misfit}", greeting.node));
        }
        self.greeted = None;
        let known = self.foreign.get(&greeting.node) == Some(&misfit);
        if known || self.foreign.len() >= FOREIGN_MAX {
            return Verdict::Fine;
        }
        let reason = format!("{} is refused: {misfit}", greeting.node);
        self.foreign.insert(greeting.node, misfit);
        Verdict::Foreign(reason)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Boot, VehicleId};

    fn hello(node: Sender, instance: u64) -> Hello {
        Hello {
            node,
            boot: Boot(1),
            venue_hash: 5,
            instance,
            is_member: false,
            software: String::new(),
            capabilities: vec![],
        }
    }

    const TWO: Sender = Sender::Vehicle(VehicleId(2));

    fn joining(node: Sender, instance: u64, is_member: bool) -> Joining {
        let mut joining = Joining::new(Time::ZERO, hello(node, instance));
        if is_member {
            joining.greet(Time::from_secs_f64(1.0));
        }
        joining
    }

    fn hear(joining: &mut Joining, hello: &Hello) -> Verdict {
        let greeting =
            Greeting { version: VERSION, node: hello.node, boot: hello.boot, venue_hash: hello.venue_hash };
        joining.hear(&greeting, Some(hello))
    }

    #[test]
    fn without_objection_a_node_takes_part_soon() {
        let mut joining = joining(TWO, 1, false);
        assert!(!joining.greet(Time::ZERO).unwrap().is_member);
        assert!(joining.greet(Time::from_secs_f64(0.05)).is_none());
        assert!(joining.greet(Time::from_secs_f64(0.31)).unwrap().is_member);
        assert!(joining.is_member());
    }

    #[test]
    fn a_name_in_use_is_refused_to_the_newcomer() {
        let member = Hello { is_member: true, ..hello(TWO, 9) };
        assert!(matches!(hear(&mut joining(TWO, 1, false), &member), Verdict::Refused(_)));
        assert_eq!(hear(&mut joining(TWO, 1, true), &hello(TWO, 9)), Verdict::Fine);
        let other = Hello { is_member: true, ..hello(Sender::Vehicle(VehicleId(3)), 9) };
        assert_eq!(hear(&mut joining(TWO, 1, false), &other), Verdict::Fine);
    }

    #[test]
    fn of_two_that_come_together_exactly_one_stays() {
        for is_member in [false, true] {
            let said = |instance| Hello { is_member, ..hello(TWO, instance) };
            let verdicts = [
                hear(&mut joining(TWO, 1, is_member), &said(9)),
                hear(&mut joining(TWO, 9, is_member), &said(1)),
            ];
            assert!(matches!(verdicts, [Verdict::Fine, Verdict::Refused(_)]), "{verdicts:?}");
        }
    }

    #[test]
    fn another_venue_is_refused_on_both_sides() {
        let elsewhere = Hello { venue_hash: 6, ..hello(Sender::Vehicle(VehicleId(3)), 9) };
        let mut member = joining(TWO, 1, true);
        assert!(matches!(hear(&mut member, &elsewhere), Verdict::Foreign(_)));
        assert!(!member.listens_to(Sender::Vehicle(VehicleId(3))));
        assert_eq!(hear(&mut member, &elsewhere), Verdict::Fine, "it is said once");
        let established = Hello { is_member: true, ..elsewhere };
        assert!(matches!(hear(&mut joining(TWO, 1, false), &established), Verdict::Refused(_)));
    }

    #[test]
    fn another_version_is_refused_though_only_its_greeting_can_be_read() {
        let greeting = Greeting { version: 9, node: Sender::Ground, boot: Boot(1), venue_hash: 5 };
        let Verdict::Refused(reason) = joining(TWO, 1, false).hear(&greeting, None) else { panic!() };
        assert!(reason.contains("wire version 9"), "{reason}");
        assert!(matches!(joining(TWO, 1, true).hear(&greeting, None), Verdict::Foreign(_)));
    }

    #[test]
    fn two_grounds_do_not_refuse_each_other() {
        let other = Hello { is_member: true, ..hello(Sender::Ground, 9) };
        assert_eq!(hear(&mut joining(Sender::Ground, 1, false), &other), Verdict::Fine);
    }
}
