//! The actor that keeps the emergency stops of a node: it joins what is heard, says it on, and tells the node which stops
//! are open. Every vehicle, ground station and operator has one.
//!
//! It says `Standing` at once and every 25 ms for half a second when it begins and when other stops are open than before,
//! then once a second, so that one node that knows is enough; to one that shows that it does not know an open stop, at once
//! and for 0.1 s. What is new is told to the node first; the disk is written then. A stop is heard
//! by bus or by beacon, of whomever; it is lifted by an operator's Start that names it, in a lease not below the highest
//! heard, or by hearing that it was lifted.
//!
//! ```text
//!   [Beginning] ──► [Spreading] (25 ms) ──0.5 s──► [Calm] (1 s)
//!                        ▲──other stops are open, or somebody does not know one──┘
//! ```
//!
//! **Floods.** More than eight new names a minute of one sender stand for many. A lease far above the highest heard does
//! not count, so that a forged one cannot keep stops from being lifted.
//!
//! It draws no names: that is the operator's. It does not know what its node does under an open stop, nor who may take part:
//! of strangers only what is open reaches it.
//!
//! Deadlines: `spreads`, `says`.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fmt;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    EmergencyName, EmergencyStop, Lease, OpenStops, Order, OrderKind, Sender, StopScope, VehicleId,
};

use super::stop_set::{OPEN_BY_NAME, StopSet};
use crate::actor::{Actor, Fault, Input, InputClass};
use crate::time::{Deadline, Time};

/// What is new is said again so often, and for this long.
const SPREADS_EVERY: Duration = Duration::from_millis(25);
const SPREADS_FOR: Duration = Duration::from_millis(500);
/// Who does not know a stop is told for this long.
const ANSWERS_FOR: Duration = Duration::from_millis(100);
/// Otherwise it is said so often.
const SAYS_EVERY: Duration = Duration::from_secs(1);
/// In this time a sender may bring [`OPEN_BY_NAME`] new names; more are merged into one stop.
const FLOOD: Duration = Duration::from_secs(60);
/// A lease so far above the highest heard does not count.
const LEASE_STEP: u32 = 1000;

/// What it is made from.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct StopsSettings {
    /// What the node's disk has kept.
    pub kept: OpenStops,
    /// The greatest lease that the node has followed.
    pub lease: Lease,
    /// Whether it only listens, as whoever looks at a simulation does.
    pub is_silent: bool,
}

/// What it can be told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum In {
    /// Another node says which stops stand.
    Standing(Sender, OpenStops),
    /// A vehicle's beacon names a stop.
    Beacon(VehicleId, EmergencyStop),
    /// Somebody orders; an operator's Start may lift.
    Order(Sender, Order),
    /// By this lease somebody orders or plans.
    Lease(Lease),
    /// The node's own operator gives these stops.
    Give(Vec<EmergencyStop>),
    /// Others can be reached who could not before.
    Linked,
}

/// What it can say.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Out {
    /// Other stops are open than before; ascending by name.
    Open(Vec<EmergencyStop>),
    /// Another node has said for the first time which stops it knows.
    Heard(Sender),
    /// To everyone.
    Publish(OpenStops),
    /// This shall outlive the software, in place of what it kept before.
    Remember(OpenStops),
    /// Something worth a line.
    StopEvent(StopEvent),
}

/// What became of stops, for logs and people.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum StopEvent {
    /// A stop is open now; who told it.
    Opened(EmergencyStop, Sender),
    /// A stop is open no longer; who told that it was lifted.
    Lifted(EmergencyName, Sender),
    /// A start was to lift stops in a lease below the highest heard, which stands here: nothing was lifted.
    LowerLease(Lease),
    /// Somebody orders or plans by a lease that is too far above the highest heard to count.
    LeaseTooHigh(Lease),
}

impl fmt::Display for StopEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StopEvent::Opened(EmergencyStop { name, scope, by }, told_by) => {
                let whom = match scope {
                    StopScope::All => "all vehicles".to_owned(),
                    StopScope::One(vehicle) => format!("vehicle {vehicle}"),
                };
                write!(
                    f,
                    "emergency stop {name} for {whom}, by operator {by}, is open: told by {told_by}"
                )
            }
            StopEvent::Lifted(name, told_by) => {
                write!(f, "emergency stop {name} is lifted: told by {told_by}")
            }
            StopEvent::LowerLease(highest) => {
                write!(
                    f,
                    "a start of a lease below {} was to lift emergency stops: they stay",
                    highest.number
                )
            }
            StopEvent::LeaseTooHigh(lease) => {
                write!(
                    f,
                    "lease {} is too far above all that were heard: it does not count",
                    lease.number
                )
            }
        }
    }
}

/// Keeps the emergency stops of a node.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Stops {
    set: StopSet,
    highest: Lease,
    /// When senders brought new names, in the last minute.
    brought: BTreeMap<Sender, VecDeque<Time>>,
    /// Who has said what stands.
    heard: BTreeSet<Sender>,
    state: State,
    says_at: Time,
    is_silent: bool,
}

/// How often it says what stands.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
enum State {
    /// Nothing has been said yet.
    Beginning,
    /// Everyone has been told.
    Calm,
    /// Something is new.
    Spreading {
        /// For this long.
        until: Time,
    },
}

impl Stops {
    /// Makes the actor of a node whose disk has kept something, or nothing. What was open is open.
    pub fn new(settings: &StopsSettings) -> Stops {
        let set = StopSet::of(&settings.kept);
        Stops {
            set,
            highest: settings.lease,
            brought: BTreeMap::new(),
            heard: BTreeSet::new(),
            state: State::Beginning,
            says_at: Time::ZERO,
            is_silent: settings.is_silent,
        }
    }

    /// Joins what a node says, or what a beacon tells.
    fn join(&mut self, now: Time, sender: Sender, heard: &OpenStops, out: &mut Vec<Out>) {
        let before = self.set.clone();
        self.set.join(&OpenStops {
            open: Vec::new(),
            lifted: heard.lifted.clone(),
        });
        for stop in &heard.open {
            if !self.set.is_news(stop.name) {
                continue;
            }
            if stop.name.is_many() || self.may_bring(now, sender) {
                self.set.open_stop(*stop);
            } else {
                self.set.open_many(*stop);
            }
        }
        self.tell(now, &before, sender, out);
    }

    /// Tells a node what it does not know yet.
    fn answer(&mut self, now: Time, heard: &OpenStops, out: &mut Vec<Out>) {
        let is_told = |stop: &EmergencyStop| heard.open.iter().any(|known| known.name == stop.name);
        if self.state == State::Calm && !self.set.open().all(is_told) {
            self.state = State::Spreading {
                until: now + ANSWERS_FOR,
            };
            self.say(now, out);
        }
    }

    /// Returns whether a sender may bring one more name, and counts it.
    fn may_bring(&mut self, now: Time, sender: Sender) -> bool {
        let times = self.brought.entry(sender).or_default();
        while times.front().is_some_and(|at| now.since(*at) >= FLOOD) {
            times.pop_front();
        }
        if times.len() >= OPEN_BY_NAME {
            return false;
        }
        times.push_back(now);
        true
    }

    fn lease(&mut self, lease: Lease, out: &mut Vec<Out>) {
        if lease.number > self.highest.number.saturating_add(LEASE_STEP) {
            out.push(Out::StopEvent(StopEvent::LeaseTooHigh(lease)));
        } else {
            self.highest = self.highest.max(lease);
        }
    }

    /// Takes an order: an operator's Start lifts the stops that it names. A ground station's lifts none.
    fn order(&mut self, now: Time, sender: Sender, order: &Order, out: &mut Vec<Out>) {
        self.lease(order.lease, out);
        if order.kind != OrderKind::Start || !matches!(sender, Sender::Operator(_)) {
            return;
        }
        let is_open = |name: &&EmergencyName| self.set.named(**name).is_some();
        let named: Vec<EmergencyName> = order.ends.iter().filter(is_open).copied().collect();
        if named.is_empty() {
            return;
        }
        if order.lease < self.highest {
            out.push(Out::StopEvent(StopEvent::LowerLease(self.highest)));
            return;
        }
        let before = self.set.clone();
        for name in named {
            self.set.lift(name);
        }
        self.tell(now, &before, sender, out);
    }

    fn give(&mut self, now: Time, stops: &[EmergencyStop], out: &mut Vec<Out>) {
        let before = self.set.clone();
        for stop in stops {
            self.set.open_stop(*stop);
        }
        if let Some(stop) = stops.first() {
            self.tell(now, &before, Sender::Operator(stop.by), out);
        }
    }

    /// Tells the node, and everyone, when other stops are open than before; writes down what is new in any case.
    fn tell(&mut self, now: Time, before: &StopSet, sender: Sender, out: &mut Vec<Out>) {
        if self.set == *before {
            return;
        }
        let opened = self
            .set
            .open()
            .filter(|stop| before.named(stop.name).is_none());
        let lifted = before
            .open()
            .filter(|stop| self.set.named(stop.name).is_none());
        let opened = opened.map(|stop| Out::StopEvent(StopEvent::Opened(*stop, sender)));
        let lifted = lifted.map(|stop| Out::StopEvent(StopEvent::Lifted(stop.name, sender)));
        let events: Vec<Out> = opened.chain(lifted).collect();
        if !events.is_empty() {
            out.push(Out::Open(self.set.open().copied().collect()));
            self.state = State::Spreading {
                until: now + SPREADS_FOR,
            };
            self.say(now, out);
        }
        out.push(Out::Remember(self.set.standing()));
        out.extend(events);
    }

    /// Begins to speak. What the disk has kept is news to the node.
    fn begin(&mut self, now: Time, out: &mut Vec<Out>) {
        self.state = State::Spreading {
            until: now + SPREADS_FOR,
        };
        if !self.set.is_clear() {
            out.push(Out::Open(self.set.open().copied().collect()));
        }
    }

    fn say(&mut self, now: Time, out: &mut Vec<Out>) {
        if let State::Spreading { until } = self.state
            && now >= until
        {
            self.state = State::Calm;
        }
        self.says_at = match self.state {
            State::Beginning | State::Calm => now + SAYS_EVERY,
            State::Spreading { .. } => now + SPREADS_EVERY,
        };
        if !self.is_silent {
            out.push(Out::Publish(self.set.standing()));
        }
    }
}

impl Actor for Stops {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        match input {
            In::Standing(sender, standing) => {
                if self.heard.insert(sender) {
                    out.push(Out::Heard(sender));
                }
                self.join(now, sender, &standing, out);
                self.answer(now, &standing, out);
            }
            In::Beacon(vehicle, stop) => {
                let told = OpenStops {
                    open: vec![stop],
                    lifted: Vec::new(),
                };
                self.join(now, Sender::Vehicle(vehicle), &told, out);
            }
            In::Order(sender, order) => self.order(now, sender, &order, out),
            In::Lease(lease) => self.lease(lease, out),
            In::Give(stops) => self.give(now, &stops, out),
            In::Linked if self.set.is_clear() => {}
            In::Linked => {
                self.state = State::Spreading {
                    until: now + SPREADS_FOR,
                };
                self.say(now, out);
            }
        }
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        let why = match self.state {
            State::Beginning | State::Calm => "says",
            State::Spreading { .. } => "spreads",
        };
        Some(Deadline {
            at: self.says_at,
            why,
        })
    }

    fn wake(&mut self, now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        if self.state == State::Beginning {
            self.begin(now, out);
        }
        self.say(now, out);
        Ok(())
    }
}

/// Which inputs replace unread ones.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Key {
    /// What one node says stands: it only grows.
    Standing(Sender),
    /// The greatest lease.
    Lease,
}

impl Input for In {
    type Key = Key;

    fn class(&self) -> InputClass<Key> {
        match self {
            In::Standing(sender, _) => InputClass::Latest(Key::Standing(*sender)),
            In::Lease(_) => InputClass::Latest(Key::Lease),
            In::Beacon(..) | In::Order(..) | In::Give(_) | In::Linked => InputClass::Queue,
        }
    }

    fn join(unread: In, newer: In) -> In {
        match (unread, newer) {
            (In::Lease(unread), In::Lease(newer)) => In::Lease(unread.max(newer)),
            (In::Standing(_, unread), In::Standing(sender, newer)) => {
                let mut set = StopSet::of(&unread);
                set.join(&newer);
                In::Standing(sender, set.standing())
            }
            (_, newer) => newer,
        }
    }
}

#[cfg(test)]
mod tests;
