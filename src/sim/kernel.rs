//! The discrete-event kernel: pops the earliest of what is to happen, tells whom it concerns, and puts what
//! they want done back into the queue. One thread, virtual time; the same scenario and seed give the same run.
//!
//! ```text
//!   queue ─► wake │ telemetry │ echo │ end of a beacon │ delivery │ contact ─► node.tell / node.wake ─► effects
//!     ▲                                                                                                   │
//!     └───────────── simulated drivers (world), bus ◄────────────────────────────────────────────────────┘
//! ```

mod failing;
mod journal;
mod recorded;
#[cfg(test)]
mod rig;
mod scripted;

use std::sync::Arc;
use std::time::Duration;

use tomoswarm_proto::codec::{self, Decoded};
use tomoswarm_proto::{Beacon, Message, VehicleId};

pub(super) use self::recorded::Recording;
use super::bus::{Bus, Frame, NodeId, receivers};
use super::disk::Disk;
use super::faults::{Faults, Turn};
use super::noise::Noise;
use super::outcome::Recorder;
use super::outside::{Happened, Later, Outside, TELEMETRY_EVERY, TRACK_EVERY, first_telemetry};
use super::queue::EventQueue;
use super::script::{Next, Script, Step};
use super::shown::{Shown, Shows};
use super::world::{Touch, World};
use crate::actor::Fault;
use crate::ground::station::Note as GroundNote;
use crate::ground::{self, GroundNode};
use crate::node::mission::Remark as MissionRemark;
use crate::node::radio::Heard;
use crate::node::route::Note as VehicleNote;
use crate::node::vehicle::Fly;
use crate::node::{self, VehicleNode};
use crate::time::Time;

/// After the end the sensors and radios are silent and nobody drives; the bus carries on for so long.
const SETTLES: Duration = Duration::from_secs(20);
/// What is to happen.
enum Event {
    Wake { node: usize, generation: u64 },
    Telemetry { vehicle: usize },
    Track,
    Later(Later),
    Deliver { to: NodeId, frame: Arc<Frame> },
    Script(Step),
    Fault(Turn),
}

/// A node's alarm; a generation tells which of the queued wakes counts.
#[derive(Clone, Copy, Default)]
struct Alarm {
    at: Option<Time>,
    generation: u64,
}

/// How a run goes on, for a progress line.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Status {
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
    pub world: World,
    pub bus: Bus,
    pub vehicles: Vec<VehicleNode>,
    /// What each of them was told, to be told again when it restarts.
    pub settings: Vec<node::Settings>,
    pub faults: Faults,
    pub ground: GroundNode,
    pub script: Script,
    pub until: Time,
    pub shuffle_ties: bool,
    /// How often the run shows itself, virtual time.
    pub shown_every: Duration,
}

/// The kernel of one run.
pub(super) struct Kernel {
    now: Time,
    noise: Noise,
    queue: EventQueue<Event>,
    outside: Outside,
    bus: Bus,
    vehicles: Vec<VehicleNode>,
    settings: Vec<node::Settings>,
    faults: Faults,
    is_dead: Vec<bool>,
    disks: Vec<Disk>,
    ground: GroundNode,
    alarms: Vec<Alarm>,
    script: Script,
    until: Time,
    shows: Shows,
    record: Recorder,
    status: Status,
    ended: Option<Time>,
    vehicle_effects: Vec<node::Effect>,
    ground_effects: Vec<ground::Effect>,
}

impl Kernel {
    pub fn new(parts: Parts) -> Kernel {
        let count = parts.vehicles.len();
        let ties = parts.shuffle_ties.then_some(parts.noise);
        let ids: Vec<VehicleId> = parts.vehicles.iter().map(VehicleNode::id).collect();
        let mut kernel = Kernel {
            now: Time::ZERO,
            noise: parts.noise,
            queue: EventQueue::new(ties),
            outside: Outside::new(parts.world),
            bus: parts.bus,
            vehicles: parts.vehicles,
            settings: parts.settings,
            faults: parts.faults,
            is_dead: vec![false; count],
            disks: vec![Disk::default(); count],
            ground: parts.ground,
            alarms: vec![Alarm::default(); count + 1],
            script: parts.script,
            until: parts.until,
            shows: Shows::every(parts.shown_every),
            record: Recorder::new(&ids),
            status: Status { now: Time::ZERO, laps_done: 0, laps: 0, samples: 0 },
            ended: None,
            vehicle_effects: Vec::new(),
            ground_effects: Vec::new(),
        };
        kernel.prime();
        kernel
    }

    fn prime(&mut self) {
        for vehicle in 0..self.vehicles.len() {
            let first = first_telemetry(self.noise, self.vehicles[vehicle].id());
            self.queue.push(first, Event::Telemetry { vehicle });
        }
        self.queue.push(Time::ZERO + TRACK_EVERY, Event::Track);
        let (after, first) = self.script.first();
        self.queue.push(Time::ZERO + after, Event::Script(first));
        for (at, turn) in self.faults.turns() {
            self.queue.push(at, Event::Fault(turn));
        }
        for node in 0..self.alarms.len() {
            self.set_alarm(node);
        }
    }

    /// Runs to the end, or until `watch` says that it is enough.
    pub fn run(
        &mut self,
        watch: &mut dyn FnMut(&Shown<'_>) -> bool,
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
            self.record.counts.events += 1;
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
    pub fn into_parts(mut self) -> (Recorder, Outside, GroundNode, Bus, Time, f64) {
        self.log_holdings();
        self.record.sweep_done = self.script.is_sweep_done();
        (self.record.alive, self.record.home, self.record.held) = self.muster();
        let separation_m = self.outside.min_separation_m(self.now);
        let end = self.ended.unwrap_or(self.now);
        (self.record, self.outside, self.ground, self.bus, end, separation_m)
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
            Event::Telemetry { vehicle } => {
                self.record.track(vehicle, self.outside.world().truth(vehicle, self.now).at);
                let telemetry = self.outside.telemetry(vehicle, self.now);
                let touches = self.outside.foreseen();
                self.foresee(touches);
                self.queue.push(self.now + TELEMETRY_EVERY, Event::Telemetry { vehicle });
                self.tell(vehicle, node::Event::Telemetry(telemetry))
            }
            Event::Track => {
                self.track();
                Ok(())
            }
            Event::Later(later) => self.outside(later),
            Event::Deliver { to, frame } => self.deliver(to, &frame),
            Event::Script(step) => self.script(step),
            Event::Fault(turn) => {
                self.fail(turn);
                Ok(())
            }
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
        self.ground.tell(self.now, event, &mut self.ground_effects)?;
        self.carry_out_ground();
        self.set_alarm(self.vehicles.len());
        Ok(())
    }

    /// Queues the node's next wake, unless the one queued already is the right one.
    fn set_alarm(&mut self, node: usize) {
        let deadline = match self.vehicles.get_mut(node) {
            Some(vehicle) => vehicle.deadline(),
            None => self.ground.deadline(),
        };
        let at = deadline.map(|deadline| deadline.at.max(self.now));
        let alarm = &mut self.alarms[node];
        if alarm.at == at {
            return;
        }
        *alarm = Alarm { at, generation: alarm.generation + 1 };
        if let Some(at) = at {
            self.queue.push(at, Event::Wake { node, generation: alarm.generation });
        }
    }

    /// Carries out what a vehicle wants done, and tells it what is known at once, until it wants nothing more.
    fn carry_out(&mut self, vehicle: usize) -> Result<(), Fault> {
        while !self.vehicle_effects.is_empty() {
            let mut effects = std::mem::take(&mut self.vehicle_effects);
            let answers: Vec<node::Event> =
                effects.drain(..).filter_map(|effect| self.carry_out_one(vehicle, effect)).collect();
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
            node::Effect::Fly(Fly::Drive { .. } | Fly::Turn(_)) if self.ended.is_some() => {}
            node::Effect::Fly(fly) => {
                let touches = self.outside.fly(vehicle, self.now, &fly);
                self.foresee(touches);
            }
            node::Effect::Steer(beam) => self.outside.steer(vehicle, self.now, beam),
            node::Effect::Ping(_) | node::Effect::Transmit(_) if self.ended.is_some() => {}
            node::Effect::Ping(ping) => self.ping(vehicle, ping.number),
            node::Effect::Transmit(beacon) => self.transmit(vehicle, beacon),
            node::Effect::Publish(message) => {
                self.publish(NodeId::Vehicle(self.vehicles[vehicle].id()), &message);
            }
            node::Effect::Note(note) => self.note(vehicle, &note),
            node::Effect::Keep(run, sample) => {
                let boot = self.vehicles[vehicle].boot();
                self.disks[vehicle].keep(boot, run, sample);
                return Some(node::Event::Kept(boot, run, sample));
            }
            node::Effect::Recall { after } => {
                return Some(node::Event::Recalled(self.disks[vehicle].recall(after)));
            }
            node::Effect::Forget { boot, run, below } => self.disks[vehicle].forget(boot, run, below),
            node::Effect::Tally(_) => {}
        }
        None
    }

    /// Queues contacts that will happen unless the motion changes before.
    fn foresee(&mut self, touches: Vec<Touch>) {
        for touch in touches {
            self.queue.push(touch.at.max(self.now), Event::Later(Later::Touch(touch)));
        }
    }

    fn ping(&mut self, vehicle: usize, number: u64) {
        if self.faults.blind(self.now, self.vehicles[vehicle].id()) {
            return;
        }
        self.record.counts.scans += 1;
        let (at, later) = self.outside.ping(vehicle, self.now, number);
        self.queue.push(at, Event::Later(later));
    }

    fn transmit(&mut self, vehicle: usize, beacon: Beacon) {
        if self.faults.cut_radio(self.now, self.vehicles[vehicle].id()) {
            return;
        }
        if let Some((ends, later)) = self.outside.transmit(vehicle, self.now, beacon) {
            self.queue.push(ends, Event::Later(later));
        }
    }

    /// Lets something happen outside the vehicles, and tells those who notice.
    fn outside(&mut self, later: Later) -> Result<(), Fault> {
        match self.outside.happen(self.now, later) {
            Happened::Nothing => Ok(()),
            Happened::Echo { vehicle, echo } => self.tell(vehicle, node::Event::Echo(echo)),
            Happened::Collided => {
                self.record.counts.collided_beacons += 1;
                Ok(())
            }
            Happened::Heard { frame, receivers } => self.hear(&frame, &receivers),
            Happened::Collision(collision) => {
                self.log_collision(&collision);
                self.record.failure.get_or_insert(collision.in_words());
                self.end();
                Ok(())
            }
        }
    }

    fn hear(&mut self, frame: &[u8], receivers: &[(usize, i16)]) -> Result<(), Fault> {
        let Ok(Decoded::Message(Message::Beacon(beacon))) = codec::decode(frame) else { return Ok(()) };
        for (to, rssi_dbm) in receivers {
            if self.faults.cut_radio(self.now, self.vehicles[*to].id()) {
                continue;
            }
            self.record.counts.beacons_heard += 1;
            let heard = Heard { beacon: beacon.clone(), rssi_dbm: *rssi_dbm };
            self.tell(*to, node::Event::Heard(heard))?;
        }
        Ok(())
    }

    fn publish(&mut self, sender: NodeId, message: &Message) {
        let receivers = receivers(sender, message, self.vehicles.iter().map(VehicleNode::id));
        // A message too long for a frame is dropped here as a live bus would drop it.
        let Ok(deliveries) = self.bus.send(self.now, sender, message, &receivers) else { return };
        for delivery in deliveries {
            self.queue.push(delivery.at, Event::Deliver { to: delivery.to, frame: delivery.frame });
        }
    }

    fn deliver(&mut self, to: NodeId, frame: &Frame) -> Result<(), Fault> {
        let message = match self.bus.deliver(to, frame) {
            Ok(Some(message)) => message,
            Ok(None) => return Ok(()),
            Err(error) => {
                self.log("bus", format_args!("a frame was refused: {error}"));
                return Ok(());
            }
        };
        self.record.counts.messages += 1;
        let sender = frame.sender();
        match to {
            NodeId::Ground => self.tell_ground(ground::Event::Bus(sender, message)),
            // In the simulation the scenario is the operator.
            NodeId::Operator(_) => Ok(()),
            NodeId::Vehicle(id) => match self.index_of(id) {
                Some(vehicle) => self.tell(vehicle, node::Event::Bus(sender, message)),
                None => Ok(()),
            },
        }
    }

    fn note(&mut self, vehicle: usize, note: &VehicleNote) {
        let who = format!("vehicle {}", self.vehicles[vehicle].id());
        match note {
            VehicleNote::Vehicle(remark) => self.log(&who, format_args!("{remark:?}")),
            VehicleNote::Mission(remark) => {
                self.log(&who, format_args!("{remark:?}"));
                self.heed(vehicle, remark);
            }
        }
    }

    /// Takes what matters to the script out of what a mission says.
    fn heed(&mut self, vehicle: usize, remark: &MissionRemark) {
        let next = match remark {
            MissionRemark::Home => {
                let (alive, home, _) = self.muster();
                self.script.came_home(home, alive)
            }
            MissionRemark::Ended(end) => {
                self.record.missions[vehicle].1 = Some((self.now, end.clone()));
                let (alive, ..) = self.muster();
                let ended =
                    |vehicle: &usize| !self.is_dead[*vehicle] && self.record.missions[*vehicle].1.is_some();
                self.script.mission_ended((0..self.vehicles.len()).filter(ended).count(), alive)
            }
            _ => Next::Nothing,
        };
        self.follow(next);
    }

    fn carry_out_ground(&mut self) {
        let mut effects = std::mem::take(&mut self.ground_effects);
        for effect in effects.drain(..) {
            match effect {
                ground::Effect::Publish(message) => self.publish(NodeId::Ground, &message),
                ground::Effect::Picture(picture) => self.picture(picture),
                // A simulated ground station is never started anew from its memory.
                ground::Effect::Remember(_) => {}
                ground::Effect::Note(note) => self.ground_note(&note),
            }
        }
        self.ground_effects = effects;
    }

    fn ground_note(&mut self, note: &GroundNote) {
        self.log("ground", format_args!("{note:?}"));
        match note {
            GroundNote::Planned { laps, .. } => {
                self.status.laps = self.status.laps_done + laps * self.script.sweeps_left();
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
        let next = self.script.hear(note);
        self.follow(next);
    }
}
