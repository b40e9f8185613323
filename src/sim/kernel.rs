//! The discrete-event kernel: pops the earliest of what is to happen, tells whom it concerns, and puts what
//! they want done back into the queue. One thread, virtual time; the same scenario and seed give the same run.
//!
//! ```text
//!   queue ─► wake │ telemetry │ echo │ end of a beacon │ delivery │ contact ─► node.tell / node.wake ─► effects
//!     ▲                                                                                                   │
//!     └───────────── simulated drivers (world), bus ◄────────────────────────────────────────────────────┘
//! ```

#[cfg(test)]
mod rig;

use std::sync::Arc;
use std::time::Duration;

use tomoswarm_proto::{Beacon, Digest, Message, OrderKind, RunId, VehicleId, codec};

use super::bus::{Bus, NodeId, deliver};
use super::log::hash;
use super::noise::{Noise, Purpose};
use super::outcome::Recorder;
use super::queue::EventQueue;
use super::world::{Stage, Touch, World};
use crate::actor::Fault;
use crate::config::End;
use crate::geom::{Angle, Point};
use crate::ground::station::{Note as GroundNote, Wish};
use crate::ground::{self, GroundNode, imager};
use crate::node::mission::Remark as MissionRemark;
use crate::node::radio::Heard;
use crate::node::route::Note as VehicleNote;
use crate::node::sensor::Echo;
use crate::node::{self, VehicleNode};
use crate::time::Time;

/// Telemetry comes this often.
const TELEMETRY_EVERY: Duration = Duration::from_millis(100);
/// Tracks are recorded this often.
const TRACK_EVERY: Duration = Duration::from_secs(1);
/// A beacon is on the air this long; two that overlap are lost.
const AIRTIME: Duration = Duration::from_millis(4);
/// Speed of sound, m/s.
const SOUND_MPS: f64 = 343.0;
/// The operator begins the first sweep after this time.
const BEGIN_AT: Duration = Duration::from_secs(2);
/// Between two sweeps people need this long to walk in.
const ENTER_TAKES: Duration = Duration::from_secs(2);
/// After the end the sensors and radios are silent and nobody drives; the bus carries on for so long.
const SETTLES: Duration = Duration::from_secs(20);
/// After the last picture nothing is waited for any longer than this.
const HOME_WITHIN: Duration = Duration::from_secs(900);

/// The first sweep of a scenario, with nobody inside; without an empty sweep it is not driven.
pub const EMPTY_RUN: RunId = RunId(1);
/// The sweep whose picture is wanted.
pub const RUN: RunId = RunId(2);

/// What is to happen.
enum Event {
    Wake { node: usize, generation: u64 },
    Telemetry { vehicle: usize },
    Track,
    Echo { vehicle: usize, echo: Echo },
    AirEnds { number: u64 },
    Deliver { to: NodeId, frame: Arc<[u8]> },
    Touch(Touch),
    Script(Step),
}

/// What the scenario does by itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Step {
    BeginFirst,
    PeopleEnter,
    BeginMain,
    ReturnHome,
    GiveUpWaiting,
}

/// A beacon on the air.
struct OnAir {
    number: u64,
    from: usize,
    start: Time,
    place: Point,
    frame: Arc<[u8]>,
    channel: u8,
    power_dbm: i8,
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
    pub ground: GroundNode,
    /// The stage with everybody in it, and whether a sweep without them comes first.
    pub populated: Option<Stage>,
    pub end: End,
    pub until: Time,
    pub shuffle_ties: bool,
}

/// The kernel of one run.
pub(super) struct Kernel {
    now: Time,
    noise: Noise,
    queue: EventQueue<Event>,
    world: World,
    bus: Bus,
    vehicles: Vec<VehicleNode>,
    ground: GroundNode,
    alarms: Vec<Alarm>,
    beams: Vec<Angle>,
    air: Vec<OnAir>,
    beacons: u64,
    populated: Option<Stage>,
    end: End,
    until: Time,
    record: Recorder,
    status: Status,
    homes: usize,
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
            world: parts.world,
            bus: parts.bus,
            vehicles: parts.vehicles,
            ground: parts.ground,
            alarms: vec![Alarm::default(); count + 1],
            beams: vec![Angle::default(); count],
            air: Vec::new(),
            beacons: 0,
            populated: parts.populated,
            end: parts.end,
            until: parts.until,
            record: Recorder::new(&ids),
            status: Status { now: Time::ZERO, laps_done: 0, laps: 0, samples: 0 },
            homes: 0,
            ended: None,
            vehicle_effects: Vec::new(),
            ground_effects: Vec::new(),
        };
        kernel.prime();
        kernel
    }

    fn prime(&mut self) {
        for vehicle in 0..self.vehicles.len() {
            let id = u64::from(self.vehicles[vehicle].id().0);
            let share = self.noise.uniform(Purpose::Start, &[id]);
            self.queue.push(Time::ZERO + TELEMETRY_EVERY.mul_f64(share), Event::Telemetry { vehicle });
        }
        self.queue.push(Time::ZERO + TRACK_EVERY, Event::Track);
        let first = if self.populated.is_some() { Step::BeginFirst } else { Step::BeginMain };
        self.queue.push(Time::ZERO + BEGIN_AT, Event::Script(first));
        for node in 0..self.alarms.len() {
            self.set_alarm(node);
        }
    }

    /// Runs to the end, or until `watch` (asked once a virtual second) says that it is enough.
    pub fn run(&mut self, watch: &mut dyn FnMut(&Status) -> bool) -> Result<(), Fault> {
        while let Some((at, event)) = self.queue.pop() {
            if at > self.until {
                break;
            }
            debug_assert!(at >= self.now, "time never goes back");
            self.now = at;
            self.record.counts.events += 1;
            let is_track = matches!(event, Event::Track);
            self.happen(event)?;
            if is_track {
                self.status.now = self.now;
                if !watch(&self.status) {
                    break;
                }
            }
        }
        Ok(())
    }

    /// Takes the run apart.
    pub fn into_parts(mut self) -> (Recorder, World, GroundNode, Bus, Time, f64) {
        self.log_holdings();
        let separation_m = self.world.min_separation_m(self.now);
        let end = self.ended.unwrap_or(self.now);
        (self.record, self.world, self.ground, self.bus, end, separation_m)
    }

    /// Ends the run, but for what is still on its way.
    fn end(&mut self) {
        if self.ended.is_none() {
            self.ended = Some(self.now);
            self.until = self.until.min(self.now + SETTLES);
        }
    }

    /// Logs what every node holds at the end: all maps must be one, and every sample made must be stored.
    fn log_holdings(&mut self) {
        for vehicle in 0..self.vehicles.len() {
            let node = &self.vehicles[vehicle];
            let (who, map) = (format!("vehicle {}", node.id()), map_hash(&node.map().digest()));
            let (samples, dropped) = (node.samples_made(RUN), node.dropped());
            let waits = node.mission().waits_for().map_or("drives on".to_owned(), |waits| waits.to_string());
            let what =
                format!("holds map {map:016x}, made {samples} samples, dropped {dropped} inputs, {waits}");
            self.log(&who, format_args!("{what}"));
        }
        let station = self.ground.station();
        let (map, samples) = (map_hash(&station.map().digest()), station.samples().count(RUN));
        self.log("ground", format_args!("holds map {map:016x}, stored {samples} samples"));
    }

    fn happen(&mut self, event: Event) -> Result<(), Fault> {
        match event {
            Event::Wake { node, generation } => self.wake(node, generation),
            Event::Telemetry { vehicle } => {
                let telemetry = self.world.telemetry(vehicle, self.now);
                self.queue.push(self.now + TELEMETRY_EVERY, Event::Telemetry { vehicle });
                self.tell(vehicle, node::Event::Telemetry(telemetry))
            }
            Event::Track => {
                self.track();
                Ok(())
            }
            Event::Echo { vehicle, echo } => self.tell(vehicle, node::Event::Echo(echo)),
            Event::AirEnds { number } => self.end_of_beacon(number),
            Event::Deliver { to, frame } => self.deliver(to, &frame),
            Event::Touch(touch) => {
                if let Some(collision) = self.world.touch(&touch) {
                    let place = collision.place;
                    self.log(
                        "referee",
                        format_args!(
                            "collision of {} with {} at {:.3},{:.3}",
                            collision.vehicle,
                            collision.with.map_or("the scene".to_owned(), |peer| peer.to_string()),
                            place.x_m,
                            place.y_m
                        ),
                    );
                }
                Ok(())
            }
            Event::Script(step) => self.script(step),
        }
    }

    fn log(&mut self, who: &str, what: std::fmt::Arguments<'_>) {
        self.record.log.line(self.now, who, what);
    }

    fn wake(&mut self, node: usize, generation: u64) -> Result<(), Fault> {
        if self.alarms[node].generation != generation {
            return Ok(());
        }
        self.alarms[node].at = None;
        if node < self.vehicles.len() {
            self.vehicles[node].wake(self.now, &mut self.vehicle_effects)?;
            self.carry_out(node);
        } else {
            self.ground.wake(self.now, &mut self.ground_effects)?;
            self.carry_out_ground();
        }
        self.set_alarm(node);
        Ok(())
    }

    fn tell(&mut self, vehicle: usize, event: node::Event) -> Result<(), Fault> {
        self.vehicles[vehicle].tell(self.now, event, &mut self.vehicle_effects)?;
        self.carry_out(vehicle);
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
        let deadline = match self.vehicles.get(node) {
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

    fn carry_out(&mut self, vehicle: usize) {
        let mut effects = std::mem::take(&mut self.vehicle_effects);
        for effect in effects.drain(..) {
            match effect {
                node::Effect::Fly(fly) => {
                    let touches = self.world.fly(vehicle, self.now, &fly);
                    self.foresee(touches);
                }
                node::Effect::Steer(beam) => self.beams[vehicle] = beam,
                node::Effect::Ping(_) | node::Effect::Transmit(_) if self.ended.is_some() => {}
                node::Effect::Ping(ping) => self.ping(vehicle, ping.number),
                node::Effect::Transmit(beacon) => self.transmit(vehicle, beacon),
                node::Effect::Publish(message) => {
                    self.publish(NodeId::Vehicle(self.vehicles[vehicle].id()), &message);
                }
                node::Effect::Note(note) => self.note(vehicle, &note),
            }
        }
        self.vehicle_effects = effects;
    }

    /// Queues contacts that will happen unless the motion changes before.
    fn foresee(&mut self, touches: Vec<Touch>) {
        for touch in touches {
            self.queue.push(touch.at, Event::Touch(touch));
        }
    }

    fn ping(&mut self, vehicle: usize, number: u64) {
        self.record.counts.scans += 1;
        let range_m = self.world.range_m(vehicle, self.now, self.beams[vehicle], number);
        let way_m = 2.0 * range_m.unwrap_or(4.0);
        let at = self.now + Duration::from_secs_f64(way_m / SOUND_MPS);
        self.queue.push(at, Event::Echo { vehicle, echo: Echo { number, range_m } });
    }

    fn transmit(&mut self, vehicle: usize, beacon: Beacon) {
        let place = self.world.truth(vehicle, self.now).at;
        let (channel, power_dbm) = (beacon.channel, beacon.power_dbm);
        // A beacon that does not fit into a frame is not sent; its sequence then shows as a miss.
        let Ok(frame) = codec::encode(&Message::Beacon(beacon)) else { return };
        self.beacons += 1;
        let number = self.beacons;
        let (start, frame) = (self.now, frame.into());
        self.air.push(OnAir { number, from: vehicle, start, place, frame, channel, power_dbm });
        self.queue.push(self.now + AIRTIME, Event::AirEnds { number });
    }

    fn end_of_beacon(&mut self, number: u64) -> Result<(), Fault> {
        let Some(index) = self.air.iter().position(|beacon| beacon.number == number) else { return Ok(()) };
        let overlaps = |other: &OnAir| {
            let beacon = &self.air[index];
            other.number != number && other.channel == beacon.channel && other.start + AIRTIME > beacon.start
        };
        let collided = self.air.iter().any(overlaps);
        let beacon = &self.air[index];
        let (from, place, radio) = (beacon.from, beacon.place, (beacon.channel, beacon.power_dbm));
        let frame = beacon.frame.clone();
        self.air.retain(|beacon| self.now.since(beacon.start) <= AIRTIME * 2);
        if collided {
            self.record.counts.collided_beacons += 1;
            return Ok(());
        }
        for to in (0..self.vehicles.len()).filter(|to| *to != from) {
            let ids = [number, u64::from(self.vehicles[to].id().0)];
            let Some(rssi_dbm) = self.world.received_dbm(place, to, self.now, radio, &ids) else { continue };
            let Ok(Message::Beacon(beacon)) = deliver(&frame) else { continue };
            self.record.counts.beacons_heard += 1;
            self.tell(to, node::Event::Heard(Heard { beacon, rssi_dbm }))?;
        }
        Ok(())
    }

    fn publish(&mut self, sender: NodeId, message: &Message) {
        let receivers = self.receivers(message);
        // A message too long for a frame is dropped here as a live bus would drop it.
        let Ok(deliveries) = self.bus.send(self.now, sender, message, &receivers) else { return };
        for delivery in deliveries {
            self.queue.push(delivery.at, Event::Deliver { to: delivery.to, frame: delivery.frame });
        }
    }

    /// Gives who subscribes to a message.
    fn receivers(&self, message: &Message) -> Vec<NodeId> {
        let vehicles = self.vehicles.iter().map(|vehicle| NodeId::Vehicle(vehicle.id()));
        match message {
            Message::Samples(_) => vec![NodeId::Ground],
            Message::Order(order) => vec![NodeId::Vehicle(order.vehicle)],
            Message::Plan(_) | Message::Have(_) => vehicles.collect(),
            Message::State(_)
            | Message::Tile(_)
            | Message::Digest(_)
            | Message::Want(_)
            | Message::Progress(_)
            | Message::Hello(_) => vehicles.chain([NodeId::Ground]).collect(),
            Message::Beacon(_) => Vec::new(),
        }
    }

    fn deliver(&mut self, to: NodeId, frame: &[u8]) -> Result<(), Fault> {
        let message = match deliver(frame) {
            Ok(message) => message,
            Err(error) => {
                self.log("bus", format_args!("a frame was refused: {error}"));
                return Ok(());
            }
        };
        self.record.counts.messages += 1;
        match to {
            NodeId::Ground => self.tell_ground(ground::Event::Bus(message)),
            NodeId::Vehicle(id) => match self.vehicles.iter().position(|vehicle| vehicle.id() == id) {
                Some(vehicle) => self.tell(vehicle, node::Event::Bus(message)),
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
                if matches!(remark, MissionRemark::Home) {
                    self.homes += 1;
                    if self.homes == self.vehicles.len() {
                        self.end();
                    }
                }
            }
        }
    }

    fn carry_out_ground(&mut self) {
        let mut effects = std::mem::take(&mut self.ground_effects);
        for effect in effects.drain(..) {
            match effect {
                ground::Effect::Publish(message) => self.publish(NodeId::Ground, &message),
                ground::Effect::Picture(picture) => self.picture(picture),
                ground::Effect::Note(note) => self.ground_note(&note),
            }
        }
        self.ground_effects = effects;
    }

    fn ground_note(&mut self, note: &GroundNote) {
        self.log("ground", format_args!("{note:?}"));
        match note {
            GroundNote::Planned { laps, .. } => {
                let sweeps = if self.populated.is_some() { 2 } else { 1 };
                self.status.laps = self.status.laps_done + laps * sweeps;
            }
            GroundNote::LapDone { samples, .. } => {
                self.status.laps_done += 1;
                self.status.samples = self.status.samples.max(*samples);
            }
            GroundNote::RunClosed { run, .. } if *run == EMPTY_RUN => {
                self.queue.push(self.now + ENTER_TAKES, Event::Script(Step::PeopleEnter));
            }
            GroundNote::RunClosed { .. } => self.record.sweep_done = true,
            GroundNote::NoPlan(reason) => {
                self.record.failure = Some(reason.clone());
                self.end();
            }
            GroundNote::Stalled(run) => {
                self.record.failure = Some(format!("sweep {run} cannot be ended: no vehicle gets on"));
                self.end();
            }
            GroundNote::Replans(_) => {}
        }
    }

    /// Takes a picture; the last one of the main run ends the run, or sends everybody home.
    fn picture(&mut self, picture: imager::Picture) {
        let last = picture.run == RUN && picture.subject == imager::Subject::Structure;
        self.record.picture(self.now, picture);
        if !(last && self.record.sweep_done) {
            return;
        }
        match self.end {
            End::Hold => self.end(),
            End::Return => self.queue.push(self.now, Event::Script(Step::ReturnHome)),
        }
    }

    fn script(&mut self, step: Step) -> Result<(), Fault> {
        match step {
            Step::BeginFirst => self.begin(EMPTY_RUN, None),
            Step::PeopleEnter => {
                if let Some(stage) = self.populated.take() {
                    let touches = self.world.set_stage(stage, self.now);
                    self.foresee(touches);
                }
                self.log("scenario", format_args!("the persons enter"));
                self.queue.push(self.now + ENTER_TAKES, Event::Script(Step::BeginMain));
                self.record.empty_done = true;
                Ok(())
            }
            Step::BeginMain => self.begin(RUN, self.record.empty_done.then_some(EMPTY_RUN)),
            Step::GiveUpWaiting if self.ended.is_some() => Ok(()),
            Step::GiveUpWaiting => {
                self.record.failure = Some("not everybody came home in time".to_owned());
                self.end();
                Ok(())
            }
            Step::ReturnHome => {
                self.queue.push(self.now + HOME_WITHIN, Event::Script(Step::GiveUpWaiting));
                self.tell_ground(ground::Event::Operator(Wish::Order(OrderKind::Return)))
            }
        }
    }

    fn begin(&mut self, run: RunId, empty: Option<RunId>) -> Result<(), Fault> {
        self.log("scenario", format_args!("sweep {run} is wished"));
        self.tell_ground(ground::Event::Operator(Wish::Sweep { run, empty }))
    }

    fn track(&mut self) {
        self.queue.push(self.now + TRACK_EVERY, Event::Track);
        for vehicle in 0..self.vehicles.len() {
            let state = self.world.truth(vehicle, self.now);
            self.record.track(vehicle, state.at);
        }
        if self.now.as_nanos() % 10_000_000_000 < 1_000_000_000 {
            self.log_poses();
        }
    }

    fn log_poses(&mut self) {
        for vehicle in 0..self.vehicles.len() {
            let state = self.world.truth(vehicle, self.now);
            let who = format!("vehicle {}", self.vehicles[vehicle].id());
            let (at, degrees) = (state.at, state.heading.degrees());
            self.log(
                &who,
                format_args!(
                    "at {:.3},{:.3} faces {degrees:.1} drives {:.3}",
                    at.x_m, at.y_m, state.speed_mps
                ),
            );
        }
    }
}

/// Gives a hash of what a node holds of every layer of the map.
fn map_hash(digest: &Digest) -> u64 {
    let words = digest.layers.iter().flat_map(|layer| {
        let (vehicle, boot) = (u64::from(layer.layer.vehicle.0), u64::from(layer.layer.boot.0));
        [vehicle, boot, u64::from(layer.tiles), layer.hash]
    });
    hash(words)
}
