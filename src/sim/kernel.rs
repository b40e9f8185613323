//! The discrete-event kernel: pops the earliest of what is to happen, tells whom it concerns, and puts what
//! they want done back into the queue. One thread, virtual time; the same scenario and seed give the same run.
//!
//! ```text
//!   queue ─► wake │ what happens in the environment │ delivery │ fault ─► node.tell / node.wake ─► effects
//!     ▲                                                                                              │
//!     └───────────── environment, bus ◄──────────────────────────────────────────────────────────────┘
//! ```

mod exchanges;
mod failing;
mod journal;
mod operators;
mod recorded;
#[cfg(test)]
mod rig;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::time::Duration;

use tomoswarm_proto::codec::{self, Decoded};
use tomoswarm_proto::{Boot, Hello, Message, VehicleId};

use self::exchanges::NodeExchange;
pub(super) use self::operators::SimulatedOperator;
pub(super) use self::recorded::Recording;
use super::bus::{BusFrame, NodeId, SimulatedBus};
use super::disk::Disk;
use super::environment::{DeviceCommand, Environment, WorldEvent};
use super::faults::{FaultTurn, Faults};
use super::ground_disk::GroundDisk;
use super::judge::{Judge, RunVerdict};
use super::noise::Noise;
use super::outcome::RunRecord;
use super::queue::EventQueue;
use super::run_view::{RunView, Shows};
use crate::actor::Fault;
use crate::exchange::ingress::HeardMessage;
use crate::ground::from_config::GroundParts;
use crate::ground::station::StationEvent as GroundNote;
use crate::ground::{self, GroundNode};
use crate::node::mission::MissionEvent as MissionRemark;
use crate::node::radio;
use crate::node::route::VehicleEvent as VehicleNote;
use crate::node::{self, VehicleNode};
use crate::time::Time;

/// After the end the sensors and radios are silent and nobody drives; the bus carries on for so long.
const SETTLES: Duration = Duration::from_secs(20);
/// What is to happen.
enum Event {
    Wake {
        node: usize,
        generation: u64,
    },
    /// A node's exchange has something to send, or must decide whether it takes part.
    Exchange {
        index: usize,
        generation: u64,
    },
    /// Something is to happen in the environment.
    Environment,
    Deliver {
        to: NodeId,
        frame: Arc<BusFrame>,
    },
    Fault(FaultTurn),
    /// The operators join the bus.
    OperatorsBegin,
}

impl Event {
    /// Returns whether it concerns nobody but an operator, in a swarm of so many vehicles.
    fn is_of_operator(&self, vehicles: usize) -> bool {
        match self {
            Event::OperatorsBegin
            | Event::Deliver {
                to: NodeId::Operator(_),
                ..
            } => true,
            Event::Wake { node, .. } | Event::Exchange { index: node, .. } => *node > vehicles,
            Event::Environment | Event::Fault(_) => false,
            Event::Deliver {
                to: NodeId::Ground | NodeId::Vehicle(_),
                ..
            } => false,
        }
    }
}

/// A node's alarm; a generation tells which of the queued wakes counts.
#[derive(Clone, Copy, Default, Debug)]
struct Alarm {
    at: Option<Time>,
    generation: u64,
}

/// How a run goes on, for a progress line.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RunProgress {
    /// Virtual time.
    pub now: Time,
    /// Laps done by all vehicles, over all sweeps.
    pub laps_done: usize,
    /// Laps of all sweeps, as far as planned.
    pub laps: usize,
    /// Samples stored.
    pub samples: u64,
}

/// Everything that a run is made of.
pub(super) struct Parts {
    pub noise: Noise,
    pub environment: Environment,
    pub bus: SimulatedBus,
    /// How the vehicles greet, in their order, and then the ground station.
    pub greetings: Vec<Hello>,
    /// What every node may send.
    pub egress_bytes_per_s: u32,
    pub vehicles: Vec<VehicleNode>,
    /// What each of them was told, to be told again when it restarts.
    pub settings: Vec<node::VehicleSettings>,
    pub faults: Faults,
    /// What the ground station is made of, also when it restarts.
    pub ground: GroundParts,
    pub operators: Vec<SimulatedOperator>,
    pub judge: Judge,
    pub until: Time,
    pub shuffle_ties: bool,
    /// The first contact ends the run.
    pub ends_at_contact: bool,
    /// How often the run shows itself, virtual time.
    pub shown_every: Duration,
}

/// The kernel of one run.
pub(super) struct Kernel {
    now: Time,
    noise: Noise,
    queue: EventQueue<Event>,
    environment: Environment,
    bus: SimulatedBus,
    /// By the same numbers as alarms.
    exchanges: Vec<NodeExchange>,
    egress_bytes_per_s: u32,
    vehicles: Vec<VehicleNode>,
    settings: Vec<node::VehicleSettings>,
    faults: Faults,
    is_dead: Vec<bool>,
    disks: Vec<Disk>,
    ground: GroundNode,
    ground_parts: GroundParts,
    ground_disk: GroundDisk,
    operators: Vec<SimulatedOperator>,
    alarms: Vec<Alarm>,
    judge: Judge,
    until: Time,
    ends_at_contact: bool,
    shows: Shows,
    record: RunRecord,
    status: RunProgress,
    ended: Option<Time>,
    vehicle_effects: Vec<node::Effect>,
    ground_effects: Vec<ground::Effect>,
    world_events: Vec<WorldEvent>,
    /// Who was started anew since a recording looked; nobody looks otherwise.
    begun_anew: Vec<NodeId>,
}

impl Kernel {
    pub fn new(parts: Parts) -> Kernel {
        let count = parts.vehicles.len();
        let ties = parts.shuffle_ties.then_some(parts.noise);
        let ids: Vec<VehicleId> = parts.vehicles.iter().map(VehicleNode::id).collect();
        let egress_bytes_per_s = parts.egress_bytes_per_s;
        let operators = parts.operators.iter();
        let operators = operators.map(|operator| {
            NodeExchange::listening(NodeId::Operator(operator.id), egress_bytes_per_s)
        });
        let starts_anew =
            |(_, turn): &(Time, FaultTurn)| *turn == FaultTurn::Starts(NodeId::Ground);
        let ground_disk = GroundDisk::new(parts.faults.turns().iter().any(starts_anew));
        let exchanges = parts
            .greetings
            .into_iter()
            .map(NodeExchange::greeting)
            .chain(operators)
            .collect();
        let mut kernel = Kernel {
            now: Time::ZERO,
            noise: parts.noise,
            queue: EventQueue::new(ties),
            environment: parts.environment,
            bus: parts.bus,
            exchanges,
            egress_bytes_per_s,
            vehicles: parts.vehicles,
            settings: parts.settings,
            faults: parts.faults,
            is_dead: vec![false; count],
            disks: vec![Disk::default(); count],
            ground: GroundNode::new(parts.ground.clone()),
            ground_parts: parts.ground,
            ground_disk,
            alarms: vec![Alarm::default(); count + 1 + parts.operators.len()],
            operators: parts.operators,
            judge: parts.judge,
            until: parts.until,
            ends_at_contact: parts.ends_at_contact,
            shows: Shows::every(parts.shown_every),
            record: RunRecord::new(&ids),
            status: RunProgress {
                now: Time::ZERO,
                laps_done: 0,
                laps: 0,
                samples: 0,
            },
            ended: None,
            vehicle_effects: Vec::new(),
            ground_effects: Vec::new(),
            world_events: Vec::new(),
            begun_anew: Vec::new(),
        };
        kernel.prime();
        kernel
    }

    fn prime(&mut self) {
        let mut said = Vec::new();
        self.environment.begin(&mut said);
        self.schedule(&mut said);
        (0..self.vehicles.len()).for_each(|vehicle| self.environment.attach(self.now, vehicle));
        for (at, turn) in self.faults.turns() {
            self.queue.push(at, Event::Fault(turn));
        }
        if !self.operators.is_empty() {
            self.queue.push(Time::ZERO, Event::OperatorsBegin);
        }
        for index in 0..=self.vehicles.len() {
            self.join(
                index,
                self.vehicles.get(index).map_or(Boot(1), VehicleNode::boot),
            );
        }
        for node in 0..self.alarms.len() {
            self.set_alarm(node);
        }
    }

    /// Runs to the end, or until `watch` says that it is enough.
    pub fn run(
        &mut self,
        watch: &mut dyn FnMut(&RunView<'_>) -> bool,
        mut recording: Option<Recording<'_>>,
    ) -> Result<(), Fault> {
        if let Some(recording) = &mut recording {
            self.watch_actors();
            self.hand_out(recording)?;
        }
        while let Some((at, event)) = self.queue.pop() {
            if at > self.until {
                break;
            }
            debug_assert!(at >= self.now, "time never goes back");
            self.now = at;
            self.record.counts.events += u64::from(!event.is_of_operator(self.vehicles.len()));
            let happened = self.happen(event);
            if let Some(recording) = &mut recording {
                self.hand_out(recording)?;
            }
            happened?;
            if self.shows.is_due(self.now) && !watch(&self.shown()) {
                break;
            }
        }
        Ok(())
    }

    /// Takes the run apart.
    pub fn into_parts(
        mut self,
    ) -> (
        RunRecord,
        Judge,
        Environment,
        GroundNode,
        SimulatedBus,
        Time,
        f64,
    ) {
        self.log_holdings();
        (self.record.alive, self.record.home, self.record.held) = self.muster();
        let counts = self.environment.counts();
        self.record.counts.scans = counts.scans;
        self.record.counts.beacons_heard = counts.beacons_heard;
        self.record.counts.collided_beacons = counts.collided_beacons;
        self.record.counts.dropped_commands = counts.dropped;
        let separation_m = self.environment.min_separation_m(self.now);
        let end = self.ended.unwrap_or(self.now);
        (
            self.record,
            self.judge,
            self.environment,
            self.ground,
            self.bus,
            end,
            separation_m,
        )
    }

    /// Does what follows from a judgement; of several the first counts.
    fn follow(&mut self, verdict: RunVerdict) {
        if self.ended.is_some() {
            return;
        }
        match verdict {
            RunVerdict::GoesOn => {}
            RunVerdict::Over => self.end(),
            RunVerdict::Failed(reason) => {
                self.record.failure.get_or_insert(reason);
                self.end();
            }
        }
    }

    /// Ends the run, but for what is still on its way.
    fn end(&mut self) {
        if self.ended.is_none() {
            self.ended = Some(self.now);
            self.until = self.until.min(self.now + SETTLES);
        }
    }

    fn happen(&mut self, event: Event) -> Result<(), Fault> {
        match event {
            Event::Wake { node, generation } => self.wake(node, generation),
            Event::Exchange { index, generation } => {
                self.wake_exchange(index, generation);
                Ok(())
            }
            Event::Environment => self.wake_environment(),
            Event::Deliver { to, frame } => self.deliver(to, &frame),
            Event::Fault(turn) => {
                self.fail(turn);
                Ok(())
            }
            Event::OperatorsBegin => self.prime_operators(),
        }
    }

    fn wake(&mut self, node: usize, generation: u64) -> Result<(), Fault> {
        if self.alarms[node].generation != generation {
            return Ok(());
        }
        self.alarms[node].at = None;
        if node < self.vehicles.len() {
            self.vehicles[node].wake(self.now, &mut self.vehicle_effects)?;
            self.carry_out(node)?;
        } else if let Some(operator) = node.checked_sub(self.vehicles.len() + 1) {
            return self.wake_operator(operator);
        } else {
            self.ground.wake(self.now, &mut self.ground_effects)?;
            self.carry_out_ground();
        }
        self.set_alarm(node);
        Ok(())
    }

    /// Tells a vehicle something; one whose software does not run hears nothing.
    fn tell(&mut self, vehicle: usize, event: node::Event) -> Result<(), Fault> {
        if self.is_dead[vehicle] {
            return Ok(());
        }
        self.vehicles[vehicle].tell(self.now, event, &mut self.vehicle_effects)?;
        self.carry_out(vehicle)?;
        self.set_alarm(vehicle);
        Ok(())
    }

    fn tell_ground(&mut self, event: ground::Event) -> Result<(), Fault> {
        let ground::Event::Bus(_, message) = &event;
        self.ground_disk.keep(message);
        self.ground
            .tell(self.now, event, &mut self.ground_effects)?;
        self.carry_out_ground();
        self.set_alarm(self.vehicles.len());
        Ok(())
    }

    /// Queues the node's next wake, unless the one queued already is the right one.
    fn set_alarm(&mut self, node: usize) {
        let ground = self.vehicles.len();
        let deadline = match self.vehicles.get_mut(node) {
            Some(vehicle) => vehicle.deadline(),
            None if node == ground => self.ground.deadline(),
            None => self.operators[node - ground - 1].node.deadline(),
        };
        let at = deadline.map(|deadline| deadline.at.max(self.now));
        let alarm = &mut self.alarms[node];
        if alarm.at == at {
            return;
        }
        *alarm = Alarm {
            at,
            generation: alarm.generation + 1,
        };
        if let Some(at) = at {
            self.queue.push(
                at,
                Event::Wake {
                    node,
                    generation: alarm.generation,
                },
            );
        }
    }

    /// Carries out what a vehicle wants done, and tells it what is known at once, until it wants nothing more.
    fn carry_out(&mut self, vehicle: usize) -> Result<(), Fault> {
        while !self.vehicle_effects.is_empty() {
            let mut effects = std::mem::take(&mut self.vehicle_effects);
            let answers: Vec<node::Event> = effects
                .drain(..)
                .filter_map(|effect| self.carry_out_one(vehicle, effect))
                .collect();
            self.vehicle_effects = effects;
            for answer in answers {
                self.vehicles[vehicle].tell(self.now, answer, &mut self.vehicle_effects)?;
            }
        }
        Ok(())
    }

    fn carry_out_one(&mut self, vehicle: usize, effect: node::Effect) -> Option<node::Event> {
        match effect {
            // After the end nothing sets out any more; what moves comes to rest.
            node::Effect::Command(numbered) if self.ended.is_some() && numbered.command.moves() => {
            }
            node::Effect::Command(command) => {
                return self.command(vehicle, DeviceCommand::Autopilot(command));
            }
            node::Effect::Steer(beam) => return self.command(vehicle, DeviceCommand::Steer(beam)),
            node::Effect::Ping(_) | node::Effect::Transmit(_) if self.ended.is_some() => {}
            node::Effect::Ping(ping) => return self.command(vehicle, DeviceCommand::Ping(ping)),
            node::Effect::Transmit(beacon) => {
                return self.command(vehicle, DeviceCommand::Transmit(beacon));
            }
            node::Effect::Publish(message) => self.publish(vehicle, &message),
            node::Effect::VehicleEvent(note) => self.note(vehicle, &note),
            node::Effect::Keep(run, sample) => {
                let boot = self.vehicles[vehicle].boot();
                self.disks[vehicle].keep(boot, run, sample);
                return Some(node::Event::SampleStored(boot, run, sample));
            }
            node::Effect::Recall { after } => {
                return Some(node::Event::Recalled(self.disks[vehicle].recall(after)));
            }
            node::Effect::Forget { boot, run, below } => {
                self.disks[vehicle].forget(boot, run, below)
            }
            node::Effect::Remember(memory) => {
                return Some(node::Event::Remembered(
                    self.disks[vehicle].remember(memory),
                ));
            }
            node::Effect::KeepStops(standing) => self.disks[vehicle].keep_stops(standing),
            node::Effect::Tally(_) => {}
        }
        None
    }

    /// Lets a device of a vehicle obey; returns what it answers at once. The rest comes when its time has come.
    fn command(&mut self, vehicle: usize, command: DeviceCommand) -> Option<node::Event> {
        let mut said = std::mem::take(&mut self.world_events);
        self.environment.obey(self.now, vehicle, command, &mut said);
        let answer = said.iter().find_map(|event| match event {
            WorldEvent::Unsent { sequence, .. } => Some(node::Event::Unsent(*sequence)),
            WorldEvent::Ack { ack, .. } => Some(node::Event::Ack(*ack)),
            WorldEvent::Scheduled(_)
            | WorldEvent::Report { .. }
            | WorldEvent::Echo { .. }
            | WorldEvent::Heard { .. }
            | WorldEvent::Contact(_)
            | WorldEvent::Charged { .. }
            | WorldEvent::Track(_) => None,
        });
        self.schedule(&mut said);
        self.world_events = said;
        answer
    }

    /// Queues the moments at which the environment wants to be woken; the list is empty then.
    fn schedule(&mut self, said: &mut Vec<WorldEvent>) {
        for event in said.drain(..) {
            if let WorldEvent::Scheduled(at) = event {
                self.queue.push(at, Event::Environment);
            }
        }
    }

    /// Lets happen what is due in the environment, and tells those who notice.
    fn wake_environment(&mut self) -> Result<(), Fault> {
        let mut happened = std::mem::take(&mut self.world_events);
        self.environment.wake(self.now, &mut happened);
        for event in happened.drain(..) {
            self.notice(event)?;
        }
        self.world_events = happened;
        Ok(())
    }

    fn notice(&mut self, event: WorldEvent) -> Result<(), Fault> {
        match event {
            WorldEvent::Scheduled(at) => self.queue.push(at, Event::Environment),
            WorldEvent::Report { vehicle, report } => {
                self.record.track(
                    vehicle,
                    self.environment.world().truth(vehicle, self.now).at,
                );
                self.tell(vehicle, node::Event::Report(report))?;
            }
            WorldEvent::Ack { vehicle, ack } => self.tell(vehicle, node::Event::Ack(ack))?,
            WorldEvent::Echo { vehicle, echo } => self.tell(vehicle, node::Event::Echo(echo))?,
            WorldEvent::Heard { frame, receivers } => self.hear(&frame, &receivers)?,
            WorldEvent::Unsent { vehicle, sequence } => {
                self.tell(vehicle, node::Event::Unsent(sequence))?
            }
            WorldEvent::Contact(collision) => {
                self.log_collision(&collision);
                self.record.failure.get_or_insert(collision.in_words());
                if self.ends_at_contact {
                    self.end();
                }
            }
            WorldEvent::Charged { vehicle, charge } => {
                let who = format!("vehicle {}", self.vehicles[vehicle].id());
                self.log(&who, format_args!("has a charge of {charge}"));
            }
            WorldEvent::Track(states) => self.track(&states),
        }
        Ok(())
    }

    fn hear(&mut self, frame: &[u8], receivers: &[(usize, i16)]) -> Result<(), Fault> {
        let Ok(Decoded::Message(Message::Beacon(beacon))) = codec::decode(frame) else {
            return Ok(());
        };
        for (to, rssi_dbm) in receivers {
            let heard = radio::HeardBeacon {
                beacon: beacon.clone(),
                rssi_dbm: *rssi_dbm,
            };
            self.tell(*to, node::Event::Heard(heard))?;
        }
        Ok(())
    }

    fn deliver(&mut self, to: NodeId, frame: &BusFrame) -> Result<(), Fault> {
        let Some(index) = self.number_of(to) else {
            return Ok(());
        };
        let Some(heard) = self.hear_frame(index, frame) else {
            return Ok(());
        };
        self.record.counts.messages += u64::from(!matches!(to, NodeId::Operator(_)));
        match (to, heard) {
            (NodeId::Operator(id), heard) => self.deliver_to_operator(id, heard),
            (NodeId::Ground, HeardMessage::Message(sender, message)) => {
                self.tell_ground(ground::Event::Bus(sender, message))
            }
            (NodeId::Vehicle(_), HeardMessage::Message(sender, message)) => {
                self.tell(index, node::Event::Bus(sender, message))
            }
            // Of greetings nodes are told the message.
            (
                NodeId::Ground | NodeId::Vehicle(_),
                HeardMessage::Greeting(..) | HeardMessage::Unknown(_),
            ) => Ok(()),
        }
    }

    /// Returns the number by which a node is known here; `None` = it takes no part in this run.
    fn number_of(&self, node: NodeId) -> Option<usize> {
        let vehicles = self.vehicles.len();
        match node {
            NodeId::Vehicle(id) => self.index_of(id),
            NodeId::Ground => Some(vehicles),
            NodeId::Operator(id) => {
                let place = self.operators.iter().position(|operator| operator.id == id);
                place.map(|place| vehicles + 1 + place)
            }
        }
    }

    fn note(&mut self, vehicle: usize, note: &VehicleNote) {
        let who = format!("vehicle {}", self.vehicles[vehicle].id());
        self.log(&who, format_args!("{note}"));
        if let VehicleNote::Mission(remark) = note {
            self.heed(vehicle, remark);
        }
    }

    /// Lets the judge see what a mission says.
    fn heed(&mut self, vehicle: usize, remark: &MissionRemark) {
        match remark {
            MissionRemark::Home => {
                let (alive, home, _) = self.muster();
                self.follow(self.judge.came_home(home, alive));
            }
            MissionRemark::Ended(end) => {
                self.judge
                    .mission_ended(self.now, vehicle, end.clone(), &self.is_dead);
            }
            _ => {}
        }
    }

    fn carry_out_ground(&mut self) {
        let mut effects = std::mem::take(&mut self.ground_effects);
        for effect in effects.drain(..) {
            match effect {
                ground::Effect::Publish(message) => self.publish(self.vehicles.len(), &message),
                ground::Effect::Picture(picture) => self.record.picture(self.now, picture),
                ground::Effect::Remember(memory) => self.ground_disk.remember(memory),
                ground::Effect::KeepStops(stops) => self.ground_disk.keep_stops(stops),
                // What was measured is not told from run to run here.
                ground::Effect::BeginRun { .. } | ground::Effect::EndRun(_) => {}
                ground::Effect::StopsNote(remark) => self.log("ground", format_args!("{remark}")),
                ground::Effect::StationEvent(note) => self.ground_note(&note),
            }
        }
        self.ground_effects = effects;
    }

    fn ground_note(&mut self, note: &GroundNote) {
        self.log("ground", format_args!("{note}"));
        match note {
            GroundNote::Planned { laps, .. } => {
                self.status.laps = self.status.laps_done + laps * self.sweeps_left();
            }
            GroundNote::LapDone { samples, .. } => {
                self.status.laps_done += 1;
                self.status.samples = self.status.samples.max(*samples);
            }
            GroundNote::RunClosed { .. }
            | GroundNote::NoPlan(_)
            | GroundNote::Stalled(_)
            | GroundNote::Replans(_)
            | GroundNote::Waits(_)
            | GroundNote::Lost(_)
            | GroundNote::Found(_)
            | GroundNote::Restarted(_)
            | GroundNote::Leads(_)
            | GroundNote::StandsBy(_)
            | GroundNote::Overtaken(_) => {}
        }
        self.judge.hear(note);
    }

    /// Returns how many sweeps are still to be driven, the present one included.
    fn sweeps_left(&self) -> usize {
        if self.environment.persons_are_in() {
            1
        } else {
            2
        }
    }
}
