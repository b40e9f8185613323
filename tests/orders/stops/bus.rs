//! The bus of a world of emergency stops: it loses, doubles and delays frames, and cuts nodes off. Carries frames to everybody
//! else and knows nothing of what they say.

use std::collections::BTreeMap;
use std::time::Duration;

use tomoswarm::time::Time;
use tomoswarm_proto::{OpenStops, Order, Sender, State, VehicleId};

use super::judge::Hardships;
use super::{LIFT_S, OPERATOR, STOP_S, at};
use crate::chance::Chance;

/// What is on its way by bus.
#[derive(Clone, Debug)]
pub enum Frame {
    Standing(OpenStops),
    State(State),
    Order(Order),
}

/// Who sends and hears; vehicle 1 has index 0.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Node {
    Vehicle(usize),
    Ground,
    Operator,
}

impl Node {
    fn sender(self) -> Sender {
        match self {
            Node::Vehicle(index) => Sender::Vehicle(VehicleId(index as u8 + 1)),
            Node::Ground => Sender::Ground,
            Node::Operator => OPERATOR,
        }
    }
}

/// The bus of one world.
pub struct Bus {
    chance: Chance,
    nodes: Vec<Node>,
    loss: f64,
    longest: Duration,
    /// Nodes that are cut off, from when, and until when.
    cuts: Vec<(Node, Time, Time)>,
    /// By beacons alone: only this vehicle hears anyone by bus once the stop is given.
    only_by_bus: Option<usize>,
    flying: BTreeMap<(Time, u64), (Node, Sender, Frame)>,
    frames: u64,
}

impl Bus {
    /// Makes the bus of so many vehicles; nothing cuts it where all but one of them hear by beacons alone.
    pub fn new(chance: Chance, vehicles: usize, by_beacons: bool) -> Bus {
        let cut = |number: u64| {
            let share = |what| chance.share(what, &[number]);
            let from = at(3.5 + 8.0 * share("cut from"));
            let node = Node::Vehicle(chance.below("cut", &[number], vehicles));
            let cut = (
                node,
                from,
                from + Duration::from_secs_f64(0.2 + 4.0 * share("cut for")),
            );
            (!by_beacons && share("cuts") < 0.5).then_some(cut)
        };
        Bus {
            nodes: (0..vehicles)
                .map(Node::Vehicle)
                .chain([Node::Ground, Node::Operator])
                .collect(),
            loss: 0.3 * chance.share("loss", &[]),
            longest: Duration::from_millis(5 + chance.below("longest", &[], 295) as u64),
            cuts: (0..3).filter_map(cut).collect(),
            only_by_bus: by_beacons.then(|| chance.below("only", &[], vehicles)),
            flying: BTreeMap::new(),
            frames: 0,
            chance,
        }
    }

    /// Returns all nodes.
    pub fn nodes(&self) -> Vec<Node> {
        self.nodes.clone()
    }

    /// Returns what makes the world hard; the radios' ring has such slots.
    pub fn hardships(&self, slot: Duration) -> Hardships {
        let of_vehicle = |(node, from, until): &(Node, Time, Time)| match node {
            Node::Vehicle(index) => Some((*index, *from, *until)),
            Node::Ground | Node::Operator => None,
        };
        let cuts = self.cuts.iter().filter_map(of_vehicle).collect();
        Hardships {
            longest: self.longest,
            loss: self.loss,
            cuts,
            only_by_bus: self.only_by_bus,
            slot,
        }
    }

    /// Returns a number that no frame and nothing else has had.
    pub fn next_number(&mut self) -> u64 {
        self.frames += 1;
        self.frames
    }

    /// Sends a frame to everybody else.
    pub fn send(&mut self, now: Time, from: Node, frame: &Frame) {
        if self.is_cut(now, from) {
            return;
        }
        for to in self.nodes().into_iter().filter(|to| *to != from) {
            let number = self.next_number();
            let copies = if self.chance.share("doubled", &[number]) < 0.1 {
                2
            } else {
                1
            };
            for copy in 0..copies {
                if self.chance.share("lost", &[number, copy]) >= self.loss && !self.is_cut(now, to)
                {
                    let delay = self
                        .longest
                        .mul_f64(self.chance.share("delay", &[number, copy]));
                    let frame = (to, from.sender(), frame.clone());
                    self.flying.insert((now + delay, 2 * number + copy), frame);
                }
            }
        }
    }

    /// Takes out what has arrived by now: for whom, by whom, and what.
    pub fn arrived(&mut self, now: Time) -> impl Iterator<Item = (Node, Sender, Frame)> + use<> {
        let later = self.flying.split_off(&(now, u64::MAX));
        std::mem::replace(&mut self.flying, later).into_values()
    }

    fn is_cut(&self, now: Time, node: Node) -> bool {
        let is_cut = self
            .cuts
            .iter()
            .any(|(cut, from, until)| *cut == node && *from <= now && now < *until);
        let hears_radio_only = match (self.only_by_bus, node) {
            (Some(only), Node::Vehicle(index)) => {
                only != index && now >= at(STOP_S) && now < at(LIFT_S)
            }
            (Some(_), Node::Ground | Node::Operator) | (None, _) => false,
        };
        is_cut || hears_radio_only
    }
}
