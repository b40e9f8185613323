//! Who takes part: vehicles with what is truly in force on them, and operators with what is judged of them.

use std::collections::{BTreeMap, BTreeSet};

use tomoswarm::actor::ActorCell;
use tomoswarm::node::Memory;
use tomoswarm::node::vehicle::Vehicle;
use tomoswarm::operator::operator_actor::{In, Operator, OperatorSettings};
use tomoswarm::operator::want::{Want, WantId};
use tomoswarm::time::Time;
use tomoswarm_proto::{Boot, Hello, Lease, OperatorId, Order, Ordered, Revision, Sender, VehicleId};

/// Vehicles of a world.
pub const VEHICLES: u8 = 3;

/// A vehicle: its order logic, and what is truly in force on it.
pub struct Rover {
    pub id: VehicleId,
    pub actor: Vehicle,
    pub boot: Boot,
    /// Its software runs from here on.
    pub up_from: Time,
    pub in_force: Ordered,
    pub history: Vec<(Time, Ordered)>,
    pub disk: Disk,
}

/// A vehicle's disk, which takes its time, and what is judged of it.
#[derive(Default)]
pub struct Disk {
    /// What is on it.
    pub memory: Memory,
    /// What is being written, and when that is done.
    pub writes: Vec<(Time, Memory)>,
    /// The highest edition that was ever on it, as orders are sent.
    pub highest: (Lease, Revision),
}

/// An operator, and what is judged of it.
pub struct Hand {
    pub actor: ActorCell<Operator>,
    pub holder: u64,
    pub wants: BTreeMap<WantId, (Time, Want)>,
    pub next: u32,
    /// It follows a script, and wants nothing by hand.
    pub is_scripted: bool,
    /// The first order of a want to a vehicle: when, and its edition.
    pub firsts: BTreeMap<(WantId, VehicleId), (Time, (Lease, Revision))>,
    pub sent: BTreeSet<(VehicleId, Lease, Revision)>,
    pub newest: BTreeMap<VehicleId, Order>,
}

impl Hand {
    pub fn new(number: u8) -> Hand {
        let hello = Hello {
            node: Sender::Operator(OperatorId(1)),
            boot: Boot(0),
            venue_hash: 5,
            instance: u64::from(number),
            is_member: true,
            member_for_s: 0,
            software: String::new(),
            capabilities: vec![],
            name: String::new(),
            lease: None,
            interest: vec![],
        };
        let holder = 50 + u64::from(number);
        let all: BTreeSet<VehicleId> = (1..=VEHICLES).map(VehicleId).collect();
        let settings = OperatorSettings { hello, greets: true, holder, expected: all.clone(), possible: all };
        let mut actor = ActorCell::new(Operator::new(settings));
        actor.push(In::Linked(true));
        Hand {
            actor,
            holder,
            wants: BTreeMap::new(),
            next: 0,
            is_scripted: false,
            firsts: BTreeMap::new(),
            sent: BTreeSet::new(),
            newest: BTreeMap::new(),
        }
    }

    /// Tells which want an order is of: the newest one of this kind for this vehicle.
    pub fn want_of(&self, order: &Order) -> Option<WantId> {
        let is_of = |want: &Want| {
            want.kind == order.kind && (want.vehicles.is_empty() || want.vehicles.contains(&order.vehicle))
        };
        let wants = self.wants.iter().filter(|(_, (_, want))| is_of(want));
        wants.max_by_key(|(_, (since, _))| *since).map(|(id, _)| *id)
    }
}

impl Rover {
    /// Tells whether such an order was in force at any moment of a span.
    pub fn was_in_force(&self, from: Time, until: Time, is_it: impl Fn(&Ordered) -> bool) -> bool {
        let ends = self.history.iter().skip(1).map(|(at, _)| *at).chain([Time::NEVER]);
        let spans = self.history.iter().zip(ends);
        spans.into_iter().any(|((since, order), end)| *since <= until && end >= from && is_it(order))
    }
}
