//! A world for joining: vehicles and a ground station as they are present on a bus that loses, doubles, delays and cuts.
//! The exchanges are the real ones; nobody has anything else to say than greetings and, at the end, one message. Some ids are
//! used twice, some nodes have another venue file or speak another version of the wire; nodes end and are started anew. Virtual
//! time, 10 ms a tick; everything follows from the seed.
//!
//! After [`QUIET_S`] nothing is cut, lost or started anew any more. Five seconds later exactly one node of an id and a kind
//! (venue file and version) takes part, everybody else has left, everybody had a reason, and everybody hears everybody of
//! the own kind and nobody else.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use tomoswarm::exchange::Exchange;
use tomoswarm::exchange::ingress::HeardMessage;
use tomoswarm::exchange::joining::JoinEffect;
use tomoswarm::exchange::presence::Presence;
use tomoswarm::time::Time;
use tomoswarm_proto::codec::{VERSION, encode};
use tomoswarm_proto::{Boot, Hello, LayerId, Message, Sender, TileRequest, VehicleId};

use super::chance::Chance;

const TICK: Duration = Duration::from_millis(10);
/// From then on the bus is in order.
const QUIET_S: f64 = 20.0;
/// So long later everybody is in who may be.
const SETTLED_S: f64 = 25.0;
/// Until then what everybody says at [`SETTLED_S`] is heard.
const END_S: f64 = 26.0;
const BYTES_PER_S: u32 = 250_000;
/// A link stands so long after two nodes can reach each other.
const LINKS_AFTER: Duration = Duration::from_millis(200);

/// A mistake that is planted, to see that it is noticed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum JoinMistake {
    /// Of two nodes of an id each sees the other's instance as the lower one: both leave.
    BothLeave,
    /// Of two nodes of an id each sees the other's instance as the higher one: both stay.
    BothStay,
    /// Greetings of members are lost.
    MembersSilent,
    /// Everybody's venue file looks like the receiver's.
    VenueNotSeen,
}

/// What a world has shown.
#[derive(Clone, Copy, Debug, Default)]
pub struct JoinsTally {
    /// Nodes that were started, those that were started anew among them.
    pub started: usize,
    /// Nodes that took part at the end.
    pub members: usize,
    /// Nodes that left since another one has their id.
    pub left_as_twin: usize,
    /// Nodes that left since they do not fit.
    pub left_as_misfit: usize,
    /// From the start of a node, or from when the bus was in order, until it took part, at most.
    pub slowest: Duration,
}

impl JoinsTally {
    /// Adds another world's.
    pub fn add(&mut self, other: &JoinsTally) {
        self.started += other.started;
        self.members += other.members;
        self.left_as_twin += other.left_as_twin;
        self.left_as_misfit += other.left_as_misfit;
        self.slowest = self.slowest.max(other.slowest);
    }
}

/// What makes nodes fit each other.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
struct Kind {
    venue_hash: u64,
    version: u8,
}

struct Node {
    name: Sender,
    kind: Kind,
    instance: u64,
    boot: Boot,
    /// When it is started, and when its software ends and is started anew.
    starts: Time,
    restarts: Vec<(Time, Duration)>,
    exchange: Option<Exchange>,
    is_linked_from: Option<Time>,
    member_from: Option<Time>,
    left: Option<(Time, Reason)>,
    heard: BTreeSet<usize>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Reason {
    Twin,
    Misfit,
}

/// A frame on its way to a node.
struct Flying {
    from: usize,
    to: usize,
    bytes: Vec<u8>,
}

struct World {
    chance: Chance,
    now: Time,
    nodes: Vec<Node>,
    /// From when until when a node is cut off from all others.
    cuts: Vec<(usize, Time, Time)>,
    loss: f64,
    longest: Duration,
    flying: BTreeMap<(Time, u64), Flying>,
    frames: u64,
    mistake: Option<JoinMistake>,
    tally: JoinsTally,
    wrong: Option<String>,
}

/// Lets a world run to its end.
///
/// # Errors
/// What is not as it must be.
pub fn play_joins(seed: u64, mistake: Option<JoinMistake>) -> Result<JoinsTally, String> {
    let mut world = World::new(seed, mistake);
    while world.now < at(END_S) {
        world.tick();
        if let Some(wrong) = &world.wrong {
            return Err(format!("seed {seed}, {} s: {wrong}", world.now));
        }
    }
    world
        .judge_hearing()
        .map_err(|wrong| format!("seed {seed}: {wrong}"))?;
    Ok(world.tally)
}

fn at(at_s: f64) -> Time {
    Time::from_secs_f64(at_s)
}

/// The one message that a node says at the end: it names its place in the list of nodes.
fn mark(name: Sender, number: usize) -> Message {
    let vehicle = match name {
        Sender::Vehicle(vehicle) => vehicle,
        Sender::Ground | Sender::Operator(_) => VehicleId(0),
    };
    Message::Want(TileRequest {
        layer: LayerId {
            vehicle,
            boot: Boot(number as u32),
        },
        known: vec![],
    })
}

impl World {
    fn new(seed: u64, mistake: Option<JoinMistake>) -> World {
        let chance = Chance::new(seed);
        let count = 3 + chance.below("count", &[], 10);
        let nodes: Vec<Node> = (0..count)
            .map(|number| draw_node(&chance, number as u64))
            .collect();
        let cuts = (0..chance.below("cuts", &[], 5) as u64).map(|number| {
            let from = QUIET_S * chance.share("cut from", &[number]);
            let until = (from + 10.0 * chance.share("cut for", &[number])).min(QUIET_S);
            (chance.below("cut", &[number], count), at(from), at(until))
        });
        World {
            chance,
            now: Time::ZERO,
            cuts: cuts.collect(),
            nodes,
            loss: 0.3 * chance.share("loss", &[]),
            longest: Duration::from_secs_f64(0.005 + 0.2 * chance.share("longest", &[])),
            flying: BTreeMap::new(),
            frames: 0,
            mistake,
            tally: JoinsTally::default(),
            wrong: None,
        }
    }

    fn tick(&mut self) {
        self.now = self.now + TICK;
        for number in 0..self.nodes.len() {
            self.start(number);
            self.link(number);
            self.greet(number);
        }
        while self
            .flying
            .first_key_value()
            .is_some_and(|((due, _), _)| *due <= self.now)
        {
            let Some((_, flying)) = self.flying.pop_first() else {
                break;
            };
            self.deliver(&flying);
        }
        if self.is_first_from(SETTLED_S) {
            self.wrong = self.judge().err();
            (0..self.nodes.len()).for_each(|number| self.say_mark(number));
        }
    }

    /// Returns whether this is the first tick from a moment on.
    fn is_first_from(&self, moment_s: f64) -> bool {
        self.now >= at(moment_s) && self.now - TICK < at(moment_s)
    }

    fn is_quiet(&self) -> bool {
        self.now >= at(QUIET_S)
    }

    /// Starts a node, ends it, and starts it anew. One that had to leave stays away, as one that ends with 2 does.
    fn start(&mut self, number: usize) {
        let now = self.now;
        let node = &mut self.nodes[number];
        if node.left.is_some() {
            return;
        }
        let is_down = node
            .restarts
            .iter()
            .any(|(from, off)| now >= *from && now < *from + *off);
        if now < node.starts || is_down {
            if node.exchange.take().is_some() {
                (node.is_linked_from, node.member_from) = (None, None);
            }
            return;
        }
        if node.exchange.is_none() {
            node.boot = Boot(node.boot.0 + 1);
            // Drawn anew at every start, as by a process.
            node.instance = 1 + self.chance.below(
                "instance",
                &[number as u64, u64::from(node.boot.0)],
                1 << 30,
            ) as u64;
            let hello = Hello::asking(node.name, node.boot, node.kind.venue_hash, node.instance);
            node.exchange = Some(Exchange::new(BYTES_PER_S, Presence::asking(now, hello)));
            self.tally.started += 1;
        }
    }

    /// Returns whether frames of one node reach another one at all.
    fn reaches(&self, from: usize, to: usize) -> bool {
        let is_cut = |node: usize| {
            self.cuts
                .iter()
                .any(|(of, a, b)| *of == node && self.now >= *a && self.now < *b)
        };
        from != to && self.nodes[to].exchange.is_some() && !is_cut(from) && !is_cut(to)
    }

    /// Tells a node that somebody can hear it, some time after that is so.
    fn link(&mut self, number: usize) {
        let is_linked = (0..self.nodes.len()).any(|other| self.reaches(number, other));
        let now = self.now;
        let node = &mut self.nodes[number];
        let Some(exchange) = &mut node.exchange else {
            return;
        };
        let since = is_linked.then(|| node.is_linked_from.unwrap_or(now));
        node.is_linked_from = since;
        if since.is_some_and(|since| now.since(since) >= LINKS_AFTER) {
            exchange.meet(now);
        }
    }

    fn greet(&mut self, number: usize) {
        let now = self.now;
        let Some(exchange) = &mut self.nodes[number].exchange else {
            return;
        };
        let due = exchange.due(now);
        let is_member = exchange.is_member();
        for outbound in due {
            self.send(number, outbound.frame);
        }
        let node = &mut self.nodes[number];
        if is_member && node.member_from.is_none() {
            node.member_from = Some(now);
            let began = node
                .restarts
                .iter()
                .map(|(from, off)| *from + *off)
                .chain([node.starts]);
            let began = began.filter(|began| *began <= now).max().unwrap_or(now);
            self.tally.slowest = self.tally.slowest.max(now.since(began));
        }
    }

    fn say_mark(&mut self, number: usize) {
        let node = &mut self.nodes[number];
        let Some(exchange) = &mut node.exchange else {
            return;
        };
        // An exchange encodes what it says; what it may not say it drops.
        let ready = exchange
            .say(self.now, &mark(node.name, number))
            .unwrap_or_default();
        ready
            .into_iter()
            .for_each(|outbound| self.send(number, outbound.frame));
    }

    /// Puts a frame on its way to everybody; one of another version is written as that version would.
    fn send(&mut self, from: usize, mut bytes: Vec<u8>) {
        bytes[2] = self.nodes[from].kind.version;
        for to in 0..self.nodes.len() {
            if !self.reaches(from, to) {
                continue;
            }
            self.frames += 1;
            let ids = [self.frames];
            let is_lost = !self.is_quiet() && self.chance.share("lost", &ids) < self.loss;
            let is_doubled = self.chance.share("doubled", &ids) < 0.1;
            for copy in 0..if is_lost {
                0
            } else {
                1 + u64::from(is_doubled)
            } {
                let delay = self
                    .longest
                    .mul_f64(self.chance.share("delay", &[self.frames, copy]));
                let key = (self.now + delay, 2 * self.frames + copy);
                self.flying.insert(
                    key,
                    Flying {
                        from,
                        to,
                        bytes: bytes.clone(),
                    },
                );
            }
        }
    }

    fn deliver(&mut self, flying: &Flying) {
        let Flying { from, to, bytes } = flying;
        if !self.reaches(*from, *to) {
            return;
        }
        let Some(bytes) = self.with_mistake(*from, *to, bytes) else {
            return;
        };
        let (now, sender) = (self.now, self.nodes[*from].name);
        // A frame is read by the receiver's version.
        let seen = as_seen_by(self.nodes[*to].kind.version, bytes);
        let Some(exchange) = &mut self.nodes[*to].exchange else {
            return;
        };
        let Ok(reception) = exchange.hear(now, sender, &seen) else {
            return;
        };
        if let Some(HeardMessage::Message(_, Message::Want(want))) = reception.heard {
            self.nodes[*to].heard.insert(want.layer.boot.0 as usize);
        }
        reception
            .replies
            .into_iter()
            .for_each(|outbound| self.send(*to, outbound.frame));
        if let JoinEffect::Refused(why) = reception.verdict {
            self.leave(*to, *from, &why);
        }
    }

    /// Alters a greeting as a planted mistake would; `None` when it is lost.
    fn with_mistake(&self, from: usize, to: usize, bytes: &[u8]) -> Option<Vec<u8>> {
        let unaltered = Some(bytes.to_vec());
        let Some(mistake) = self.mistake else {
            return unaltered;
        };
        let mut read = bytes.to_vec();
        read[2] = VERSION;
        let Ok(tomoswarm_proto::codec::Decoded::Message(Message::Hello(mut hello))) =
            tomoswarm_proto::codec::decode(&read)
        else {
            return unaltered;
        };
        let is_twin = self.nodes[from].name == self.nodes[to].name;
        match mistake {
            JoinMistake::BothLeave if is_twin => hello.instance = 0,
            JoinMistake::BothStay if is_twin => {
                (hello.instance, hello.is_member, hello.member_for_s) = (u64::MAX, false, 0);
            }
            JoinMistake::MembersSilent if hello.is_member => return None,
            JoinMistake::VenueNotSeen => hello.venue_hash = self.nodes[to].kind.venue_hash,
            JoinMistake::BothLeave | JoinMistake::BothStay | JoinMistake::MembersSilent => {
                return unaltered;
            }
        }
        let mut altered = encode(&Message::Hello(hello)).ok()?;
        altered[2] = bytes[2];
        Some(altered)
    }

    /// Takes a node out that had to leave, and looks whether it had to.
    fn leave(&mut self, number: usize, by: usize, why: &str) {
        let is_twin = self.nodes[by].name == self.nodes[number].name
            && self.nodes[by].kind == self.nodes[number].kind
            && self.nodes[by].instance != self.nodes[number].instance;
        let is_misfit = self.nodes[by].kind != self.nodes[number].kind;
        let reason = if is_twin {
            Reason::Twin
        } else {
            Reason::Misfit
        };
        if !is_twin && !is_misfit {
            self.wrong = Some(format!(
                "node {number} leaves because of node {by}, which fits: {why}"
            ));
        }
        if is_misfit && self.nodes[number].member_from.is_some() {
            self.wrong = Some(format!(
                "node {number} takes part, and leaves because of a stranger: {why}"
            ));
        }
        match reason {
            Reason::Twin => self.tally.left_as_twin += 1,
            Reason::Misfit => self.tally.left_as_misfit += 1,
        }
        let node = &mut self.nodes[number];
        (node.exchange, node.member_from, node.left) = (None, None, Some((self.now, reason)));
    }

    /// Looks whether exactly one of each id and kind takes part.
    fn judge(&mut self) -> Result<(), String> {
        let mut claims: BTreeMap<(Sender, Kind), Vec<usize>> = BTreeMap::new();
        for (number, node) in self.nodes.iter().enumerate() {
            claims
                .entry((node.name, node.kind))
                .or_default()
                .push(number);
        }
        for ((name, kind), numbers) in claims {
            let present = || {
                numbers
                    .iter()
                    .filter(|number| self.nodes[**number].left.is_none())
            };
            for number in present() {
                let is_in = self.nodes[*number]
                    .exchange
                    .as_ref()
                    .is_some_and(Exchange::is_member);
                if !is_in {
                    return Err(format!(
                        "{name} (node {number}) is not in, 5 s after the bus was in order"
                    ));
                }
            }
            let left_as_twin =
                |number: &usize| matches!(self.nodes[*number].left, Some((_, Reason::Twin)));
            let all_left = present().count() == 0;
            if all_left
                && numbers.iter().any(left_as_twin)
                && !numbers.iter().any(|number| !left_as_twin(number))
            {
                return Err(format!(
                    "all nodes of {name} have left because of each other"
                ));
            }
            // Two ground stations do not refuse each other: the lease decides between them.
            if name != Sender::Ground && present().count() > 1 {
                let all: Vec<&usize> = present().collect();
                return Err(format!(
                    "{name} of {kind:?} is on the bus more than once: nodes {all:?}"
                ));
            }
            self.tally.members += present().count();
        }
        Ok(())
    }

    /// Looks whether everybody hears everybody of the own kind, and nobody else.
    fn judge_hearing(&self) -> Result<(), String> {
        let is_in = |number: &usize| {
            self.nodes[*number]
                .exchange
                .as_ref()
                .is_some_and(Exchange::is_member)
        };
        let members: Vec<usize> = (0..self.nodes.len()).filter(is_in).collect();
        // Who is listened to is decided by name: a stranger is heard as long as one of its name that fits was heard too.
        let has_namesake = |of: usize| {
            let is_one = |other: &Node| {
                other.name == self.nodes[of].name && other.kind != self.nodes[of].kind
            };
            self.nodes.iter().any(is_one)
        };
        for from in &members {
            for to in members.iter().filter(|to| *to != from) {
                let fits = self.nodes[*from].kind == self.nodes[*to].kind;
                let hears = self.nodes[*to].heard.contains(from);
                if fits && !hears {
                    return Err(format!("node {to} does not hear node {from}, which fits"));
                }
                if !fits && hears && !has_namesake(*from) {
                    return Err(format!(
                        "node {to} listens to node {from}, which does not fit"
                    ));
                }
            }
        }
        Ok(())
    }
}

/// Returns a frame as a node of a version sees it: of the own version it can read everything.
fn as_seen_by(own_version: u8, mut bytes: Vec<u8>) -> Vec<u8> {
    if own_version != VERSION {
        bytes[2] = if bytes[2] == own_version {
            VERSION
        } else {
            own_version
        };
    }
    bytes
}

fn draw_node(chance: &Chance, number: u64) -> Node {
    let share = |what: &str| chance.share(what, &[number]);
    // Few ids, so that some are used twice; the first node is the ground station.
    let name = match number {
        0 => Sender::Ground,
        _ => Sender::Vehicle(VehicleId(1 + chance.below("name", &[number], 12) as u8)),
    };
    let kind = Kind {
        venue_hash: 5 + u64::from(share("venue") < 0.1),
        version: VERSION + u8::from(share("version") < 0.1),
    };
    // Half of them come at once, as after power is switched on.
    let starts = at(if share("at once") < 0.5 {
        0.5 * share("starts")
    } else {
        QUIET_S * share("starts")
    });
    let restarts = (0..chance.below("restarts", &[number], 3) as u64).map(|which| {
        let from = QUIET_S * chance.share("restart", &[number, which]);
        let off = (5.0 * chance.share("off", &[number, which])).min(QUIET_S - from);
        (at(from), Duration::from_secs_f64(off))
    });
    Node {
        name,
        kind,
        instance: 0,
        boot: Boot(0),
        starts,
        restarts: restarts.collect(),
        exchange: None,
        is_linked_from: None,
        member_from: None,
        left: None,
        heard: BTreeSet::new(),
    }
}
