//! Who takes part: vehicles with what is truly in force on them, and operators with what is judged of them. The ground
//! station has a page of its own.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use tomoswarm::actor::ActorCell;
use tomoswarm::geom::Point;
use tomoswarm::node::VehicleMemory;
use tomoswarm::node::vehicle::Vehicle;
use tomoswarm::operator::operator_actor::{In, Operator, OperatorSettings};
use tomoswarm::operator::order_goal::{GoalId, OrderGoal};
use tomoswarm::sweep::Follower;
use tomoswarm::time::Time;
use tomoswarm_proto::{
    Boot, Hello, Lease, MissionProgress, OperatorId, Order, Ordered, Plan, Revision, Sender,
    VehicleId,
};

/// Vehicles of a world.
pub const VEHICLES: u8 = 3;

/// Where a follower of a plan may stand to begin it, metres.
const TOLERANCE_M: f64 = 0.5;

/// A vehicle: its order logic, the plans that it has accepted and never drives, and what is truly in force on it.
pub struct Rover {
    pub id: VehicleId,
    pub actor: Vehicle,
    pub follower: Follower,
    /// Plans by a greater right than any before, which wait for the disk.
    pub plans: Vec<Plan>,
    pub boot: Boot,
    /// Its software runs from here on.
    pub up_from: Time,
    pub in_force: Ordered,
    pub history: Vec<(Time, Ordered)>,
    /// Whether what an operator ordered it last was not to start.
    pub is_stopped: bool,
    pub disk: Disk,
}

/// A vehicle's disk, which takes its time, and what is judged of it.
#[derive(Default)]
pub struct Disk {
    /// What is on it.
    pub memory: VehicleMemory,
    /// What is being written, and when that is done.
    pub writes: Vec<(Time, VehicleMemory)>,
    /// The highest edition that was ever on it, as orders are sent.
    pub highest: (Lease, Revision),
}

/// An operator, and what is judged of it.
pub struct Hand {
    pub actor: ActorCell<Operator>,
    pub holder: u64,
    pub wants: BTreeMap<GoalId, (Time, OrderGoal)>,
    pub next: u32,
    /// It follows a script, and wants nothing by hand.
    pub is_scripted: bool,
    /// The first order of a want to a vehicle: when, and its edition.
    pub firsts: BTreeMap<(GoalId, VehicleId), (Time, (Lease, Revision))>,
    pub sent: BTreeSet<(VehicleId, Lease, Revision)>,
    pub newest: BTreeMap<VehicleId, Order>,
}

/// Returns where a vehicle stands.
pub fn place_of(id: VehicleId) -> Point {
    Point::new(2.0 * f64::from(id.0), -1.0)
}

impl Hand {
    pub fn new(number: u8) -> Hand {
        let node = Sender::Operator(OperatorId(number));
        let hello = Hello {
            is_member: true,
            ..Hello::asking(node, Boot(0), 5, u64::from(number))
        };
        let holder = 50 + u64::from(number);
        let all: BTreeSet<VehicleId> = (1..=VEHICLES).map(VehicleId).collect();
        let settings = OperatorSettings {
            hello,
            greets: true,
            holder,
            expected: all,
        };
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

    /// Returns which want an order is of: the newest one of this kind for this vehicle.
    pub fn want_of(&self, order: &Order) -> Option<GoalId> {
        let is_of = |want: &OrderGoal| {
            want.kind == order.kind
                && (want.vehicles.is_empty() || want.vehicles.contains(&order.vehicle))
        };
        let wants = self.wants.iter().filter(|(_, (_, want))| is_of(want));
        wants
            .max_by_key(|(_, (since, _))| *since)
            .map(|(id, _)| *id)
    }
}

impl Rover {
    /// Makes a vehicle that was never ordered anything, of its order logic.
    pub fn new(id: VehicleId, actor: Vehicle) -> Rover {
        Rover {
            id,
            actor,
            follower: Follower::new(id, place_of(id), TOLERANCE_M),
            plans: Vec::new(),
            boot: Boot(1),
            up_from: Time::ZERO,
            in_force: Ordered::default(),
            history: vec![(Time::ZERO, Ordered::default())],
            is_stopped: false,
            disk: Disk::default(),
        }
    }

    /// Starts its software anew, which runs `down` later; what was being written is lost.
    pub fn restart(&mut self, now: Time, down: Duration) {
        self.boot.0 += 1;
        self.disk.writes.clear();
        self.plans.clear();
        self.follower = Follower::new(self.id, place_of(self.id), TOLERANCE_M);
        self.up_from = now + down;
        self.in_force = Ordered::default();
        self.history.push((now, Ordered::default()));
    }

    /// Takes a plan as a vehicle does that stands; one by a greater right than any before waits for the disk. Returns
    /// what is to be remembered.
    pub fn hear_plan(&mut self, plan: &Plan) -> Option<VehicleMemory> {
        let greatest = self.in_force.lease.max(self.disk.memory.planned);
        if plan.lease < greatest {
            return None;
        }
        if plan.lease == greatest {
            self.follow(plan);
            return None;
        }
        self.plans.push(plan.clone());
        Some(VehicleMemory::of_plan(plan.lease))
    }

    /// Follows the plans that need not wait for the disk any more.
    pub fn follow_what_is_on_disk(&mut self) {
        let planned = self.disk.memory.planned;
        for plan in self
            .plans
            .extract_if(.., |plan| plan.lease <= planned)
            .collect::<Vec<Plan>>()
        {
            self.follow(&plan);
        }
    }

    fn follow(&mut self, plan: &Plan) {
        self.follower.offer(plan);
        self.follower.hold(place_of(self.id));
    }

    /// Returns how far it says to be; `ordered` is the greatest lease of an order on its disk.
    pub fn mission(&self, ordered: Lease) -> MissionProgress {
        let progress = self.follower.progress();
        let lease_number = ordered.max(self.disk.memory.planned).number;
        MissionProgress {
            vehicle: self.id,
            boot: self.boot,
            progress: progress.into(),
            lease_number,
            ..MissionProgress::default()
        }
    }

    /// Returns whether such an order was in force at any moment of a span.
    pub fn was_in_force(&self, from: Time, until: Time, is_it: impl Fn(&Ordered) -> bool) -> bool {
        let ends = self
            .history
            .iter()
            .skip(1)
            .map(|(at, _)| *at)
            .chain([Time::NEVER]);
        let spans = self.history.iter().zip(ends);
        spans
            .into_iter()
            .any(|((since, order), end)| *since <= until && end >= from && is_it(order))
    }
}
