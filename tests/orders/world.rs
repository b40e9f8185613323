//! Operators and vehicles over a bus that loses, delays, doubles and cuts, in virtual time and by a seed. The operators and
//! the vehicles' order logic are the real ones, and so are the ground station and its planner. Vehicles follow plans as far
//! as one does that never drives. After 40 s nothing is cut or started anew any more, and one operator wants everybody to
//! hold.
//!
//! Judged is every moment by what was truly in force on each vehicle, which no operator sees. Mistakes can be planted; they
//! are made of altered messages, so that the real code need not know of them.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use tomoswarm::actor::Actor;
use tomoswarm::config::{self, Config, Sim, bundled};
use tomoswarm::geom::{Angle, Pose};
use tomoswarm::node::vehicle::{self, Motion, Telemetry, Vehicle};
use tomoswarm::node::{Remembered, VehicleMemory, VehicleSettings};
use tomoswarm::operator::HeardMessage;
use tomoswarm::operator::operator_actor::{In, Out};
use tomoswarm::operator::order_goal::{GoalId, OrderGoal};
use tomoswarm::operator::outcome::{OrderOutcome, VehicleOutcome};
use tomoswarm::operator::script::ScriptStep;
use tomoswarm::time::Time;
use tomoswarm_proto::{
    Boot, Lease, Message, OperatorId, Order, OrderKind, Ordered, Plan, RunId, Sender, State,
    VehicleId,
};

use super::chance::Chance;
use super::ground::{Given, Giver, Ground, Turn};
use super::nodes::{Hand, Rover, VEHICLES, place_of};
use super::tally::{Mistake, Tally};

const TICK: Duration = Duration::from_millis(10);
/// Nothing that the bus carries comes later.
const LATEST: Duration = Duration::from_millis(400);
/// Shares of frames that are lost, and that come twice.
const LOST: f64 = 0.3;
const DOUBLED: f64 = 0.1;
/// Until then wants are given at random; then comes the last one, which is judged for some more seconds.
const WANTS_END_S: f64 = 34.0;
const FAULTS_END_S: f64 = 38.0;
const LAST_WANT_S: f64 = 42.0;
const END_S: f64 = 54.0;
/// How long a want may take, and the last one.
const WITHIN: Duration = Duration::from_secs(5);
const LAST_WITHIN: Duration = Duration::from_secs(8);
/// The number of the last want.
const LAST: u32 = 1000;

/// Who takes part.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
enum Node {
    Vehicle(usize),
    Operator(usize),
    Ground,
}

/// A node that nobody reaches for a while.
struct Cut {
    node: Node,
    from: Time,
    until: Time,
}

struct World {
    chance: Chance,
    now: Time,
    sim: Sim,
    rovers: Vec<Rover>,
    hands: Vec<Hand>,
    ground: Ground,
    given: Given,
    cuts: Vec<Cut>,
    restarts: Vec<(Time, Node)>,
    flying: BTreeMap<(Time, u64), (Node, HeardMessage)>,
    frames: u64,
    mistake: Option<Mistake>,
    tally: Tally,
    wrong: Option<String>,
}

/// Lets a world run to its end.
///
/// # Errors
/// What is not as it must be.
pub fn play(seed: u64, mistake: Option<Mistake>) -> Result<Tally, String> {
    let mut world = World::new(seed, mistake);
    while world.now < at(END_S) {
        world.tick();
        if let Some(wrong) = world.wrong {
            return Err(format!("seed {seed}, {} s: {wrong}", world.now));
        }
    }
    Ok(world.tally)
}

fn at(at_s: f64) -> Time {
    Time::from_secs_f64(at_s)
}

/// Returns the bundled simulation, of which the vehicles have their settings.
fn sim() -> Sim {
    let path = bundled::simulation("courtyard").unwrap();
    match config::read(path, &bundled::load(path).unwrap(), &mut |path| {
        bundled::load(path)
    }) {
        Ok(Config::Sim(sim)) => *sim,
        other => panic!("{other:?}"),
    }
}

fn rover(sim: &Sim, id: VehicleId, boot: Boot, memory: VehicleMemory) -> Vehicle {
    let settings = VehicleSettings::from_config(sim, id, boot, place_of(id));
    Vehicle::new(VehicleSettings { memory, ..settings })
}

impl World {
    fn new(seed: u64, mistake: Option<Mistake>) -> World {
        let (chance, sim) = (Chance::new(seed), sim());
        let rovers = (1..=VEHICLES)
            .map(VehicleId)
            .map(|id| Rover::new(id, rover(&sim, id, Boot(1), VehicleMemory::default())));
        let rovers = rovers.collect();
        let mut world = World {
            chance,
            now: Time::ZERO,
            sim,
            rovers,
            hands: vec![Hand::new(1), Hand::new(2)],
            ground: Ground::new(mistake),
            given: Given::default(),
            cuts: Vec::new(),
            restarts: Vec::new(),
            flying: BTreeMap::new(),
            frames: 0,
            mistake,
            tally: Tally::default(),
            wrong: None,
        };
        world.plan_faults();
        if chance.share("script", &[]) < 0.5 {
            world.follow();
        }
        world
    }

    /// Draws who is cut off and who is started anew, and when.
    fn plan_faults(&mut self) {
        let nodes: Vec<Node> = (0..usize::from(VEHICLES))
            .map(Node::Vehicle)
            .chain([Node::Operator(0), Node::Operator(1), Node::Ground])
            .collect();
        for number in 0..6 {
            let draw = |what| self.chance.share(what, &[number]);
            let from = at(1.0 + draw("cut from") * (FAULTS_END_S - 7.0));
            let until = from + Duration::from_secs_f64(6.0 * draw("cut for"));
            let node = nodes[self.chance.below("cut", &[number], nodes.len())];
            self.cuts.push(Cut { node, from, until });
            let restart = at(1.0 + draw("restart at") * (FAULTS_END_S - 4.0));
            let of = [
                Node::Vehicle(0),
                Node::Vehicle(1),
                Node::Vehicle(2),
                Node::Ground,
            ];
            self.restarts.push((
                restart,
                of[self.chance.below("restart", &[number], of.len())],
            ));
        }
    }

    /// Lets the second operator follow a script.
    fn follow(&mut self) {
        let kinds = [
            OrderKind::Start,
            OrderKind::Hold,
            OrderKind::Return,
            OrderKind::CutMotors,
        ];
        let first = self.chance.below("script kind", &[], kinds.len());
        let mut steps = Vec::new();
        for number in 0..3 {
            steps.push(ScriptStep::Delay(Duration::from_secs_f64(
                8.0 * self.chance.share("delay", &[number]),
            )));
            // No two of a kind, so that an order tells of which want it is.
            let kind = kinds[(first + number as usize) % kinds.len()];
            steps.push(ScriptStep::Want(OrderGoal {
                kind,
                ..self.draw_want(1, 100 + number)
            }));
        }
        let began = self.now;
        for step in &steps {
            if let ScriptStep::Want(want) = step {
                let number = u32::try_from(self.hands[1].wants.len()).unwrap();
                self.hands[1]
                    .wants
                    .insert(GoalId::Script(number), (began, want.clone()));
            }
        }
        self.hands[1].is_scripted = true;
        self.hands[1].actor.push(In::Follow(steps));
    }

    fn draw_want(&self, hand: usize, number: u64) -> OrderGoal {
        let ids = [hand as u64, number];
        let kinds = [
            OrderKind::Start,
            OrderKind::Hold,
            OrderKind::Return,
            OrderKind::Land,
            OrderKind::CutMotors,
        ];
        let is_in = |id: &VehicleId| {
            self.chance
                .share("whom", &[ids[0], ids[1], u64::from(id.0)])
                < 0.5
        };
        let is_all = self.chance.share("all", &ids) < 0.5;
        let some = (1..=VEHICLES)
            .map(VehicleId)
            .filter(|id| !is_all && is_in(id))
            .collect();
        let kind = kinds[self.chance.below("kind", &ids, kinds.len())];
        let take_over = self.chance.share("take over", &ids) < 0.4;
        OrderGoal {
            begins: true,
            take_over,
            ..OrderGoal::new(kind, some, WITHIN)
        }
    }

    fn tick(&mut self) {
        self.now = self.now + TICK;
        self.restart();
        self.write();
        self.deliver();
        self.give_wants();
        self.drive();
        self.operate();
        self.lead();
        self.judge_lateness();
        self.judge_the_end();
    }

    fn restart(&mut self) {
        let now = self.now;
        let (due, later): (Vec<_>, Vec<_>) = std::mem::take(&mut self.restarts)
            .into_iter()
            .partition(|(at, _)| *at <= now);
        self.restarts = later;
        for (at, node) in due {
            let down = Duration::from_secs_f64(3.0 * self.chance.share("down", &[at.as_nanos()]));
            match node {
                Node::Vehicle(index) => {
                    let is_lost = self.mistake == Some(Mistake::MemoryLost);
                    let of = &mut self.rovers[index];
                    of.restart(now, down);
                    let memory = if is_lost {
                        VehicleMemory::default()
                    } else {
                        of.disk.memory
                    };
                    of.actor = rover(&self.sim, of.id, of.boot, memory);
                }
                Node::Ground => {
                    let has_new_disk = self.chance.share("new disk", &[at.as_nanos()]) < 0.25;
                    self.ground.restart(now, down, has_new_disk);
                }
                Node::Operator(_) => {}
            }
        }
    }

    /// Puts a message on the bus, for everyone but its sender.
    fn send(&mut self, from: Node, heard: &HeardMessage) {
        let all = (0..self.rovers.len()).map(Node::Vehicle);
        let all = all
            .chain((0..self.hands.len()).map(Node::Operator))
            .chain([Node::Ground]);
        for to in all.filter(|to| *to != from).collect::<Vec<Node>>() {
            self.frames += 1;
            let frame = self.frames;
            let copies = if self.chance.share("doubled", &[frame]) < DOUBLED {
                2
            } else {
                1
            };
            for copy in 0..copies {
                let is_lost = self.chance.share("lost", &[frame, copy]) < LOST;
                if !is_lost && !self.is_cut(from) && !self.is_cut(to) {
                    let share = self.chance.share("delay", &[frame, copy]);
                    // Most come soon.
                    let delay = LATEST.mul_f64(share * share * share);
                    self.flying
                        .insert((self.now + delay, 2 * frame + copy), (to, heard.clone()));
                }
            }
        }
    }

    fn is_cut(&self, node: Node) -> bool {
        self.cuts
            .iter()
            .any(|cut| cut.node == node && cut.from <= self.now && self.now < cut.until)
    }

    fn deliver(&mut self) {
        let later = self.flying.split_off(&(self.now, u64::MAX));
        let due = std::mem::replace(&mut self.flying, later);
        for (to, heard) in due.into_values() {
            match to {
                Node::Vehicle(index) => self.tell_vehicle(index, &heard),
                Node::Operator(index) => self.tell_operator(index, heard),
                Node::Ground => self.tell_ground(&heard),
            }
        }
    }

    fn tell_vehicle(&mut self, index: usize, heard: &HeardMessage) {
        let HeardMessage::Message(sender, message) = heard else {
            return;
        };
        if self.now < self.rovers[index].up_from {
            return;
        }
        match message {
            Message::Order(order) => self.tell_order(index, *sender, order),
            Message::Plan(plan) => self.tell_plan(index, plan),
            Message::Mission(mission) => {
                self.rovers[index].follower.hear(self.now, &mission.into())
            }
            // Vehicles of this world have no map, no radio and no samples, and do not see each other.
            _ => {}
        }
    }

    fn tell_plan(&mut self, index: usize, plan: &Plan) {
        if let Some(memory) = self.rovers[index].hear_plan(plan) {
            self.begin_to_write(index, memory);
        }
        self.tell_accepted(index);
    }

    /// Lets the order logic know which plan is followed, as a mission does.
    fn tell_accepted(&mut self, index: usize) {
        let progress = self.rovers[index].follower.progress();
        self.step_vehicle(
            index,
            vehicle::In::Accepted(progress.run, progress.revision),
        );
    }

    fn tell_order(&mut self, index: usize, sender: Sender, order: &Order) {
        let rover = &self.rovers[index];
        if order.vehicle != rover.id {
            return;
        }
        let is_fresh = rover
            .history
            .last()
            .is_some_and(|(_, in_force)| in_force.kind.is_none());
        self.tally.below_disk +=
            u64::from(is_fresh && (order.lease, order.revision) < rover.disk.highest);
        let mut order = order.clone();
        order.lease = self.as_compared(order.lease);
        self.step_vehicle(index, vehicle::In::Order(sender, order));
    }

    fn tell_operator(&mut self, index: usize, mut heard: HeardMessage) {
        let hand = &mut self.hands[index];
        if self.mistake == Some(Mistake::OldStateCounts)
            && let HeardMessage::Message(
                _,
                Message::State(State {
                    vehicle, ordered, ..
                }),
            ) = &mut heard
            && let Some(order) = hand
                .newest
                .get(vehicle)
                .filter(|order| ordered.kind == Some(order.kind))
        {
            (ordered.lease, ordered.revision) = (order.lease, order.revision);
        }
        hand.actor.push(In::Bus(heard));
    }

    fn tell_ground(&mut self, heard: &HeardMessage) {
        match heard {
            HeardMessage::Message(
                _,
                message @ (Message::State(_)
                | Message::Mission(_)
                | Message::Hello(_)
                | Message::Task(_)),
            ) => self.ground.hear(self.now, message.clone()),
            HeardMessage::Message(..) | HeardMessage::Greeting(..) | HeardMessage::Unknown(_) => {}
        }
    }

    /// Lets the vehicles hear their autopilots, ten times a second.
    fn drive(&mut self) {
        if !self.now.as_nanos().is_multiple_of(100_000_000) {
            return;
        }
        for index in 0..self.rovers.len() {
            if self.now < self.rovers[index].up_from {
                continue;
            }
            let pose = Pose {
                at: place_of(self.rovers[index].id),
                heading: Angle::default(),
                sd_m: 0.05,
            };
            let (motion, is_armed) = (Motion::Resting, true);
            let telemetry = Telemetry {
                pose,
                flight_state: Default::default(),
                speed_mps: 0.0,
                battery: Some(1.0),
                motion,
                is_armed,
                stored: None,
            };
            self.step_vehicle(index, vehicle::In::Telemetry(telemetry));
            if self.now.as_nanos().is_multiple_of(1_000_000_000) {
                self.publish_mission(index);
            }
        }
    }

    fn publish_mission(&mut self, index: usize) {
        let rover = &self.rovers[index];
        let mission = rover.mission(self.as_compared(rover.disk.memory.ordered.lease));
        let sender = Sender::Vehicle(rover.id);
        self.send(
            Node::Vehicle(index),
            &HeardMessage::Message(sender, Message::Mission(mission)),
        );
    }

    fn step_vehicle(&mut self, index: usize, input: vehicle::In) {
        let mut out = Vec::new();
        self.rovers[index]
            .actor
            .handle(self.now, input, &mut out)
            .unwrap();
        for output in out {
            match output {
                vehicle::Out::Publish(state) => self.publish_state(index, state),
                vehicle::Out::Order(order) => self.obey(index, order),
                vehicle::Out::Remember(memory) => self.begin_to_write(index, memory),
                vehicle::Out::AutopilotCommand(_)
                | vehicle::Out::State(_)
                | vehicle::Out::SafetyEvent(_) => {}
            }
        }
    }

    /// Lets a disk begin to write, which takes up to 60 ms.
    fn begin_to_write(&mut self, index: usize, memory: VehicleMemory) {
        let ids = [index as u64, self.now.as_nanos()];
        let takes = Duration::from_millis(1)
            + Duration::from_millis(60).mul_f64(self.chance.share("write", &ids));
        self.rovers[index]
            .disk
            .writes
            .push((self.now + takes, memory));
        if self.mistake == Some(Mistake::ToldTooEarly) {
            self.tell_disk(index, memory);
        }
    }

    /// Brings what is due on the disks, and tells it.
    fn write(&mut self) {
        for index in 0..self.rovers.len() {
            let now = self.now;
            let due: Vec<(Time, VehicleMemory)> = self.rovers[index]
                .disk
                .writes
                .extract_if(.., |(at, _)| *at <= now)
                .collect();
            for (_, memory) in due {
                let edition = (
                    self.as_compared(memory.ordered.lease),
                    memory.ordered.revision,
                );
                let disk = &mut self.rovers[index].disk;
                disk.memory = disk.memory.join(memory);
                disk.highest = disk.highest.max(edition);
                let memory = disk.memory;
                if now >= self.rovers[index].up_from {
                    self.tell_disk(index, memory);
                    self.rovers[index].follow_what_is_on_disk();
                    self.tell_accepted(index);
                }
            }
        }
    }

    fn tell_disk(&mut self, index: usize, memory: VehicleMemory) {
        let told = Remembered {
            on_disk: memory,
            tried: memory,
        };
        self.step_vehicle(index, vehicle::In::Remembered(told));
    }

    /// Returns a lease that is sent as the vehicles compare it, and the other way round.
    fn as_compared(&self, lease: Lease) -> Lease {
        let is_turned =
            self.mistake == Some(Mistake::LeaseComparedWrongly) && lease != Lease::default();
        if is_turned { turned(lease) } else { lease }
    }

    /// Judges what a vehicle shows: nothing that its disk does not have.
    fn publish_state(&mut self, index: usize, mut state: State) {
        state.ordered.lease = self.as_compared(state.ordered.lease);
        let (shown, highest) = (state.ordered.edition(), self.rovers[index].disk.highest);
        if shown > highest {
            self.wrong = Some(format!(
                "{} shows {shown:?}, and its disk has {highest:?}",
                state.vehicle
            ));
        }
        let sender = Sender::Vehicle(state.vehicle);
        self.send(
            Node::Vehicle(index),
            &HeardMessage::Message(sender, Message::State(state)),
        );
    }

    /// Judges what a vehicle obeys: nothing lower than before, and than what is on its disk.
    fn obey(&mut self, index: usize, mut order: Order) {
        order.lease = self.as_compared(order.lease);
        let now = self.now;
        let rover = &mut self.rovers[index];
        let Order {
            lease,
            revision,
            run,
            kind,
            ..
        } = order;
        let before = rover.in_force;
        if (lease, revision) <= before.edition() {
            let id = rover.id;
            self.wrong = Some(format!(
                "vehicle {id} obeys {lease:?} {revision} after {before:?}"
            ));
            return;
        }
        if (lease, revision) < rover.disk.highest {
            let (id, highest) = (rover.id, rover.disk.highest);
            self.wrong = Some(format!(
                "vehicle {id} obeys {lease:?} {revision}, and its disk has {highest:?}"
            ));
            return;
        }
        let is_by_operator = self.given.is_by(rover.id, (lease, revision), kind, |by| {
            by == Giver::Operator
        });
        if is_by_operator {
            rover.is_stopped = kind != OrderKind::Start;
        } else if kind == OrderKind::Start {
            self.tally.ground_starts += 1;
            self.tally.crossed += u64::from(rover.is_stopped);
        }
        rover.in_force = Ordered {
            lease,
            revision,
            run,
            kind: Some(kind),
        };
        rover.history.push((now, rover.in_force));
    }

    fn give_wants(&mut self) {
        for index in 0..self.hands.len() {
            let number = u64::from(self.hands[index].next);
            let is_free = !self.hands[index]
                .wants
                .keys()
                .any(|id| matches!(id, GoalId::Hand(_)));
            let ids = [index as u64, number, self.now.as_nanos()];
            let is_time = self.now < at(WANTS_END_S) && self.chance.share("want now", &ids) < 0.005;
            if is_time && is_free && !self.hands[index].is_scripted {
                let want = self.draw_want(index, number);
                self.give(index, self.hands[index].next, want);
            }
        }
        if self.now == at(LAST_WANT_S) {
            let take_over = self.chance.share("last", &[]) < 0.5;
            let hold = OrderGoal::new(OrderKind::Hold, BTreeSet::new(), LAST_WITHIN);
            let want = OrderGoal {
                run: Some(RunId(1)),
                take_over,
                ..hold
            };
            self.give(0, LAST, want);
        }
    }

    fn give(&mut self, index: usize, number: u32, want: OrderGoal) {
        let hand = &mut self.hands[index];
        hand.next += 1;
        hand.wants
            .insert(GoalId::Hand(number), (self.now, want.clone()));
        hand.actor.push(In::Want(number, want));
    }

    fn operate(&mut self) {
        for index in 0..self.hands.len() {
            let mut output = Vec::new();
            self.hands[index]
                .actor
                .act(self.now, |out| output.push(out))
                .unwrap();
            for out in output {
                match out {
                    Out::Publish(message) => self.publish(index, message),
                    Out::InForce(id, outcome) => self.judge(index, id, &outcome),
                    Out::Ended(id, outcome) => {
                        self.judge(index, id, &outcome);
                        self.hands[index].wants.remove(&id);
                    }
                    // Nobody gives an emergency stop in this world, or marks a place.
                    Out::Announce(_)
                    | Out::ScriptEnded(_)
                    | Out::Give(_)
                    | Out::StopEvent(_)
                    | Out::Marked(..) => {}
                }
            }
        }
    }

    fn publish(&mut self, index: usize, message: Message) {
        if let Message::Order(order) = &message {
            let (now, hand) = (self.now, &mut self.hands[index]);
            let edition = (order.lease, order.revision);
            if let Some(id) = hand.want_of(order) {
                let first = hand
                    .firsts
                    .entry((id, order.vehicle))
                    .or_insert((now, edition));
                first.1 = first.1.min(edition);
            }
            hand.newest.insert(order.vehicle, order.clone());
            self.given.note(order, Giver::Operator);
            let is_new = hand
                .sent
                .insert((order.vehicle, order.lease, order.revision));
            if self.mistake == Some(Mistake::NotRepeated) && !is_new {
                return;
            }
        }
        let number = OperatorId(u8::try_from(index + 1).unwrap());
        self.send(
            Node::Operator(index),
            &HeardMessage::Message(Sender::Operator(number), message),
        );
    }

    /// Judges what an operator says of a want: whom it calls obedient, on that vehicle the order was in force not longer
    /// ago than the bus takes.
    fn judge(&mut self, index: usize, id: GoalId, outcome: &OrderOutcome) {
        for (vehicle, of) in &outcome.vehicles {
            let VehicleOutcome::Obeyed { after, .. } = of else {
                self.tally.not_obeyed += 1;
                continue;
            };
            self.tally.obeyed += 1;
            let hand = &self.hands[index];
            let kind = hand.wants.get(&id).map(|(_, want)| want.kind);
            let Some((first_at, lowest)) = hand.firsts.get(&(id, *vehicle)) else {
                self.wrong = Some(format!(
                    "{id:?}: {vehicle} is called obedient and was sent nothing"
                ));
                return;
            };
            let when = *first_at + *after;
            let rover = &self.rovers[usize::from(vehicle.0) - 1];
            let is_it = |order: &Ordered| order.kind == kind && order.edition() >= *lowest;
            if !rover.was_in_force(when - LATEST - TICK, when, is_it) {
                let history = &rover.history;
                self.wrong = Some(format!(
                    "operator {} ({}) calls {vehicle} obedient to {kind:?} at {when} ({id:?}, lowest {lowest:?}); {history:?}",
                    index + 1,
                    hand.holder,
                ));
            }
        }
        if id == GoalId::Hand(LAST) && !outcome.is_done() {
            self.wrong = Some(format!("the last want is not obeyed: {outcome:?}"));
        }
    }

    /// Judges that wants by hand end in time.
    fn judge_lateness(&mut self) {
        for hand in &self.hands {
            let late = hand.wants.iter().find(|(id, (since, want))| {
                matches!(id, GoalId::Hand(_)) && self.now.since(*since) > want.within + TICK * 2
            });
            if let Some((id, _)) = late {
                self.wrong = Some(format!("{id:?} of {} does not end", hand.holder));
            }
        }
    }

    /// Judges that nobody fights the last want: once it is in force it stays.
    fn judge_the_end(&mut self) {
        let is_over = self.now > at(LAST_WANT_S) + LAST_WITHIN;
        let moved = self
            .rovers
            .iter()
            .find(|rover| rover.in_force.kind != Some(OrderKind::Hold));
        if let Some(rover) = moved.filter(|_| is_over) {
            self.wrong = Some(format!(
                "vehicle {} does not hold in the end: {:?}",
                rover.id, rover.in_force
            ));
        }
    }

    /// Lets the ground station do all that is due.
    fn lead(&mut self) {
        loop {
            match self.ground.turn(self.now, &self.given) {
                Turn::Acted => {}
                Turn::Publish(message) => self.publish_of_ground(*message),
                Turn::Writes => {
                    let share = self.chance.share("ground writes", &[self.now.as_nanos()]);
                    let is_slow = self.mistake == Some(Mistake::GroundDoesNotWait);
                    let at_most = Duration::from_millis(if is_slow { 3000 } else { 60 });
                    let takes = Duration::from_millis(1) + at_most.mul_f64(share);
                    self.ground.write_until(self.now + takes);
                }
                Turn::Wrong(wrong) => {
                    self.wrong = Some(wrong);
                    return;
                }
                Turn::Rests => return,
            }
        }
    }

    fn publish_of_ground(&mut self, message: Message) {
        if let Message::Order(order) = &message {
            self.given.note(order, Giver::Ground(self.ground.store()));
        }
        // What else it says is for nobody in this world.
        if matches!(
            message,
            Message::Order(_) | Message::Plan(_) | Message::Report(_)
        ) {
            self.send(
                Node::Ground,
                &HeardMessage::Message(Sender::Ground, message),
            );
        }
    }
}

/// Returns a lease in the opposite order of all.
fn turned(lease: Lease) -> Lease {
    Lease {
        number: u32::MAX - lease.number,
        holder: lease.holder,
    }
}
