//! A world for emergency stops: vehicles of the real actors (stops, vehicle, radio) whose missions want to drive all the
//! time, a ground station and an operator that say what stands, a bus (`stops/bus.rs`), and air on which beacons that
//! overlap are lost. Virtual time, 5 ms a tick; everything follows from the seed. What must be so is the judge's
//! (`stops/judge.rs`).

use std::time::Duration;

use tomoswarm::actor::Actor;
use tomoswarm::config::{self, Config, Sim, bundled};
use tomoswarm::geom::{Angle, Point, Pose};
use tomoswarm::node::vehicle::{self, AutopilotCommand, Motion, MoveCommand, Telemetry, Vehicle};
use tomoswarm::node::{Remembered, VehicleSettings, radio};
use tomoswarm::stops::{self, Stops, StopsSettings};
use tomoswarm::time::Time;
use tomoswarm_proto::{
    Beacon, Boot, EmergencyName, EmergencyStop, Lease, OpenStops, OperatorId, Order, OrderKind,
    Revision, RunId, SeenState, Sender, State, StopScope, VehicleId,
};

use super::chance::Chance;

#[path = "stops/bus.rs"]
mod bus;
#[path = "stops/judge.rs"]
mod judge;

use bus::{Bus, Frame, Node};
pub use judge::StopsTally;
use judge::{Judge, Seen, SeenVehicle};

const TICK: Duration = Duration::from_millis(5);
/// The operator gives the stop, and the world looks on until then.
const STOP_S: f64 = 6.0;
const END_S: f64 = 24.0;
/// From when on the operator lifts it, if it is alive.
const LIFT_S: f64 = 18.0;
const OPERATOR: Sender = Sender::Operator(OperatorId(1));
/// Telemetry comes so often, ticks; it is published with every one.
const TELEMETRY: u64 = 20;
/// How long a beacon is on the air, ticks.
const AIRTIME: u64 = 1;
const SPEED_MPS: f64 = 0.5;
const BRAKING_MPS2: f64 = 1.0;

/// A mistake that is planted, to see that it is noticed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum StopMistake {
    /// Neither vehicles nor the ground station say on what they hear, by bus or by beacon.
    NotSaidOn,
    /// A vehicle is not told which stops are open.
    VehicleNotTold,
    /// A beacon names no stop.
    BeaconsSilent,
    /// After a lift a vehicle obeys the ground station's start as if it were an operator's.
    GroundStarts,
}

struct Rover {
    id: VehicleId,
    stops: Stops,
    vehicle: Vehicle,
    radio: radio::Radio,
    boot: Boot,
    /// What its disk keeps.
    kept: OpenStops,
    memory: Remembered,
    x_m: f64,
    speed_mps: f64,
    is_driving: bool,
    is_armed: bool,
    up_from: Time,
    state: Option<State>,
    open: Vec<EmergencyStop>,
}

struct World {
    chance: Chance,
    sim: Sim,
    mistake: Option<StopMistake>,
    now: Time,
    tick: u64,
    rovers: Vec<Rover>,
    ground: Stops,
    operator: Stops,
    ground_dies: Option<Time>,
    operator_dies_after_first_copy: bool,
    is_operator_dead: bool,
    bus: Bus,
    on_air: Vec<(u64, usize, Beacon)>,
    restarts: Vec<(Time, usize, Duration)>,
    name: EmergencyName,
    is_lifted: bool,
    revision: u32,
}

/// Lets a world run to its end.
///
/// # Errors
/// What is not as it must be.
pub fn play_stops(seed: u64, mistake: Option<StopMistake>) -> Result<StopsTally, String> {
    let mut world = World::new(seed, mistake);
    let mut judge = Judge::new(world.bus.hardships(world.sim.venue.swarm.slot()));
    while world.now < at(END_S) {
        world.tick();
        judge
            .look(&world.seen())
            .map_err(|wrong| format!("seed {seed}, {} s: {wrong}", world.now))?;
    }
    Ok(judge.tally())
}

fn at(at_s: f64) -> Time {
    Time::from_secs_f64(at_s)
}

fn sim() -> Sim {
    let path = bundled::simulation("courtyard").unwrap();
    match config::read(path, &bundled::load(path).unwrap(), &mut |path| {
        bundled::load(path)
    }) {
        Ok(Config::Sim(sim)) => *sim,
        other => panic!("{other:?}"),
    }
}

impl Rover {
    fn new(sim: &Sim, id: VehicleId) -> Rover {
        let settings = settings(sim, id, Boot(1), OpenStops::default());
        Rover {
            id,
            stops: Stops::new(&StopsSettings::default()),
            vehicle: Vehicle::new(settings.clone()),
            radio: radio::Radio::new(settings),
            boot: Boot(1),
            kept: OpenStops::default(),
            memory: Remembered::default(),
            x_m: 0.0,
            speed_mps: 0.0,
            is_driving: false,
            is_armed: false,
            up_from: Time::ZERO,
            state: None,
            open: Vec::new(),
        }
    }
}

/// The settings of a vehicle whose lane is its own: nobody is in anybody's way.
fn settings(sim: &Sim, id: VehicleId, boot: Boot, stops: OpenStops) -> VehicleSettings {
    let home = lane(id, 0.0);
    VehicleSettings {
        stops,
        ..VehicleSettings::from_config(sim, id, boot, home)
    }
}

fn lane(id: VehicleId, x_m: f64) -> Point {
    Point::new(2.0 + x_m.rem_euclid(12.0), 1.0 + 2.0 * f64::from(id.0))
}

impl World {
    fn new(seed: u64, mistake: Option<StopMistake>) -> World {
        let chance = Chance::new(seed);
        let sim = sim();
        let count = 2 + chance.below("vehicles", &[], 7);
        let ids = (1..=count as u8).map(VehicleId);
        let by_beacons = chance.share("by beacons", &[]) < 0.25;
        let operator_dies = !by_beacons && chance.share("operator", &[]) < 1.0 / 3.0;
        let mut world = World {
            mistake,
            now: Time::ZERO,
            tick: 0,
            rovers: ids.map(|id| Rover::new(&sim, id)).collect(),
            ground: Stops::new(&StopsSettings::default()),
            operator: Stops::new(&StopsSettings::default()),
            ground_dies: (chance.share("ground", &[]) < 1.0 / 3.0).then_some(at(STOP_S - 1.0)),
            operator_dies_after_first_copy: operator_dies,
            is_operator_dead: false,
            bus: Bus::new(chance, count, by_beacons),
            on_air: Vec::new(),
            restarts: Vec::new(),
            name: EmergencyName(EmergencyName::LOWEST_DRAWN + 7),
            is_lifted: false,
            revision: 1,
            sim,
            chance,
        };
        world.draw_restarts(by_beacons);
        world
    }

    fn draw_restarts(&mut self, by_beacons: bool) {
        let count = self.rovers.len();
        for number in 0..3 {
            let share = |what| self.chance.share(what, &[number]);
            if !by_beacons && share("restarts") < 0.5 {
                let from = at(3.0 + 10.0 * share("restart at"));
                let down = Duration::from_secs_f64(0.1 + share("down"));
                self.restarts
                    .push((from, self.chance.below("restart", &[number], count), down));
            }
        }
    }

    fn tick(&mut self) {
        self.now = self.now + TICK;
        self.tick += 1;
        self.restart();
        self.deliver();
        self.wake_all();
        self.drive();
        self.radio();
        self.operate();
        self.lead();
    }

    fn is_up(&self, index: usize) -> bool {
        self.now >= self.rovers[index].up_from
    }

    fn is_ground_alive(&self) -> bool {
        self.ground_dies.is_none_or(|at| self.now < at)
    }

    fn restart(&mut self) {
        let due: Vec<(usize, Duration)> = self
            .restarts
            .iter()
            .filter(|(at, _, _)| *at <= self.now)
            .map(|(_, index, down)| (*index, *down))
            .collect();
        self.restarts.retain(|(at, _, _)| *at > self.now);
        for (index, down) in due {
            let rover = &mut self.rovers[index];
            rover.boot = Boot(rover.boot.0 + 1);
            rover.up_from = self.now + down;
            let kept = rover.kept.clone();
            let settings = VehicleSettings {
                memory: rover.memory.on_disk,
                ..settings(&self.sim, rover.id, rover.boot, kept.clone())
            };
            let lease = rover.memory.on_disk.lease();
            rover.stops = Stops::new(&StopsSettings {
                kept,
                lease,
                is_silent: false,
            });
            rover.vehicle = Vehicle::new(settings.clone());
            rover.radio = radio::Radio::new(settings);
            (rover.is_driving, rover.open) = (false, Vec::new());
        }
    }

    fn send(&mut self, from: Node, frame: &Frame) {
        self.bus.send(self.now, from, frame);
    }

    fn deliver(&mut self) {
        for (to, sender, frame) in self.bus.arrived(self.now) {
            let is_stop = matches!(&frame, Frame::Standing(standing) if !standing.open.is_empty());
            match to {
                Node::Vehicle(index) => self.tell_rover(index, sender, frame),
                Node::Ground if self.is_ground_alive() => {
                    if let Frame::Standing(standing) = frame {
                        self.tell_keeper(Node::Ground, stops::In::Standing(sender, standing));
                    }
                }
                Node::Operator if !self.is_operator_dead => {
                    if let Frame::Standing(standing) = frame {
                        self.tell_keeper(Node::Operator, stops::In::Standing(sender, standing));
                    }
                }
                Node::Ground | Node::Operator => {}
            }
            let is_copy = sender == OPERATOR && is_stop && to != Node::Operator;
            self.is_operator_dead |= is_copy && self.operator_dies_after_first_copy;
        }
    }

    fn tell_rover(&mut self, index: usize, sender: Sender, frame: Frame) {
        if !self.is_up(index) {
            return;
        }
        match frame {
            Frame::Standing(standing) => {
                self.tell_keeper(Node::Vehicle(index), stops::In::Standing(sender, standing));
            }
            Frame::State(state) => self.tell_vehicle(index, vehicle::In::Peer(state)),
            Frame::Order(order) => {
                self.tell_keeper(
                    Node::Vehicle(index),
                    stops::In::Order(sender, order.clone()),
                );
                let is_mistaken = self.mistake == Some(StopMistake::GroundStarts);
                let sender = if is_mistaken { OPERATOR } else { sender };
                self.tell_vehicle(index, vehicle::In::Order(sender, order));
            }
        }
    }

    fn keeper(&mut self, node: Node) -> &mut Stops {
        match node {
            Node::Vehicle(index) => &mut self.rovers[index].stops,
            Node::Ground => &mut self.ground,
            Node::Operator => &mut self.operator,
        }
    }

    fn tell_keeper(&mut self, node: Node, input: stops::In) {
        let now = self.now;
        let mut out = Vec::new();
        self.keeper(node).handle(now, input, &mut out).unwrap();
        self.route_stops(node, out);
    }

    fn route_stops(&mut self, node: Node, out: Vec<stops::Out>) {
        for output in out {
            match (node, output) {
                (Node::Vehicle(index), stops::Out::Open(open)) => {
                    self.rovers[index].open.clone_from(&open);
                    if self.mistake != Some(StopMistake::VehicleNotTold) {
                        self.tell_vehicle(index, vehicle::In::Stops(open.clone()));
                    }
                    let are_silent = matches!(
                        self.mistake,
                        Some(StopMistake::BeaconsSilent | StopMistake::NotSaidOn)
                    );
                    let named = if are_silent { vec![] } else { open };
                    self.tell_radio(index, radio::In::Stops(named));
                }
                (Node::Vehicle(index), stops::Out::Heard(by)) => {
                    self.tell_vehicle(index, vehicle::In::StopsReported(by))
                }
                (Node::Vehicle(index), stops::Out::Remember(standing)) => {
                    self.rovers[index].kept = standing
                }
                (Node::Vehicle(_) | Node::Ground, stops::Out::Publish(_))
                    if self.mistake == Some(StopMistake::NotSaidOn) => {}
                (node, stops::Out::Publish(standing)) => {
                    self.send(node, &Frame::Standing(standing))
                }
                (_, _) => {}
            }
        }
    }

    fn tell_vehicle(&mut self, index: usize, input: vehicle::In) {
        let now = self.now;
        let mut out = Vec::new();
        self.rovers[index]
            .vehicle
            .handle(now, input, &mut out)
            .unwrap();
        for output in out {
            self.carry_out(index, output);
        }
    }

    fn carry_out(&mut self, index: usize, output: vehicle::Out) {
        match output {
            vehicle::Out::AutopilotCommand(AutopilotCommand::Drive { .. }) => {
                self.rovers[index].is_driving = self.rovers[index].is_armed
            }
            vehicle::Out::AutopilotCommand(AutopilotCommand::Stop) => {
                self.rovers[index].is_driving = false
            }
            vehicle::Out::AutopilotCommand(AutopilotCommand::Arm) => {
                self.rovers[index].is_armed = true
            }
            vehicle::Out::AutopilotCommand(AutopilotCommand::Disarm) => {
                (self.rovers[index].is_armed, self.rovers[index].is_driving) = (false, false);
            }
            vehicle::Out::AutopilotCommand(
                AutopilotCommand::Turn(_)
                | AutopilotCommand::FollowStored { .. }
                | AutopilotCommand::TakeBack,
            ) => {}
            vehicle::Out::State(state) => self.tell_radio(index, radio::In::State(state)),
            vehicle::Out::Publish(state) => {
                self.rovers[index].state = Some(state.clone());
                self.send(Node::Vehicle(index), &Frame::State(state));
            }
            vehicle::Out::Remember(memory) => {
                let on_disk = self.rovers[index].memory.on_disk.join(memory);
                let remembered = Remembered {
                    on_disk,
                    tried: on_disk,
                };
                self.rovers[index].memory = remembered;
                self.tell_vehicle(index, vehicle::In::Remembered(remembered));
            }
            vehicle::Out::Order(_) | vehicle::Out::SafetyEvent(_) => {}
        }
    }

    fn tell_radio(&mut self, index: usize, input: radio::In) {
        let now = self.now;
        let mut out = Vec::new();
        self.rovers[index]
            .radio
            .handle(now, input, &mut out)
            .unwrap();
        self.hear_radio(index, out);
    }

    fn hear_radio(&mut self, index: usize, out: Vec<radio::Out>) {
        for output in out {
            match output {
                radio::Out::Transmit(beacon) => {
                    self.on_air.push((self.tick + AIRTIME, index, beacon))
                }
                radio::Out::Stop(by, stop) => {
                    self.tell_keeper(Node::Vehicle(index), stops::In::Beacon(by, stop));
                }
                radio::Out::Peer(sighting) => {
                    self.tell_vehicle(index, vehicle::In::Sighted(sighting))
                }
                radio::Out::Sample(..) => {}
            }
        }
    }

    fn wake_all(&mut self) {
        for node in self.bus.nodes() {
            let is_alive = match node {
                Node::Vehicle(index) => self.is_up(index),
                Node::Ground => self.is_ground_alive(),
                Node::Operator => !self.is_operator_dead,
            };
            let now = self.now;
            if is_alive
                && self
                    .keeper(node)
                    .deadline()
                    .is_some_and(|deadline| deadline.at <= now)
            {
                let mut out = Vec::new();
                self.keeper(node).wake(now, &mut out).unwrap();
                self.route_stops(node, out);
            }
        }
    }

    /// Every mission wants to drive all the time.
    fn drive(&mut self) {
        for index in 0..self.rovers.len() {
            let rover = &mut self.rovers[index];
            let step_s = TICK.as_secs_f64();
            rover.speed_mps = match rover.is_driving {
                true => SPEED_MPS,
                false => (rover.speed_mps - BRAKING_MPS2 * step_s).max(0.0),
            };
            rover.x_m += rover.speed_mps * step_s;
            if !self.is_up(index) || !(self.tick + index as u64).is_multiple_of(TELEMETRY) {
                continue;
            }
            let rover = &self.rovers[index];
            let pose = Pose {
                at: lane(rover.id, rover.x_m),
                heading: Angle::default(),
                sd_m: 0.05,
            };
            let motion = if rover.speed_mps > 0.0 {
                Motion::Driving
            } else {
                Motion::Resting
            };
            let (speed_mps, is_armed) = (rover.speed_mps, rover.is_armed);
            let telemetry = Telemetry {
                pose,
                flight_state: Default::default(),
                speed_mps,
                battery: Some(1.0),
                motion,
                is_armed,
                stored: None,
            };
            let ahead = Point::new(pose.at.x_m + 1.0, pose.at.y_m);
            let route = vec![pose.at, ahead];
            self.tell_vehicle(index, vehicle::In::Telemetry(telemetry));
            let command = MoveCommand::Drive {
                is_off_plan: true,
                route,
            };
            self.tell_vehicle(index, vehicle::In::Command(self.now, command));
        }
    }

    fn radio(&mut self) {
        for index in 0..self.rovers.len() {
            let due = self.rovers[index]
                .radio
                .deadline()
                .is_some_and(|deadline| deadline.at <= self.now);
            if due && self.is_up(index) {
                let (now, mut out) = (self.now, Vec::new());
                self.rovers[index].radio.wake(now, &mut out).unwrap();
                self.hear_radio(index, out);
            }
        }
        let tick = self.tick;
        let ended: Vec<(u64, usize, Beacon)> = self
            .on_air
            .iter()
            .filter(|(end, _, _)| *end <= tick)
            .cloned()
            .collect();
        self.on_air.retain(|(end, _, _)| *end > tick);
        // Of beacons that end together, which overlap, none is heard.
        let [(_, by, beacon)] = &ended[..] else {
            return;
        };
        for to in (0..self.rovers.len()).filter(|to| to != by) {
            let is_lost = self.chance.share("air", &[self.bus.next_number()]) < 0.1;
            if !is_lost && self.is_up(to) {
                let heard = radio::HeardBeacon {
                    beacon: beacon.clone(),
                    rssi_dbm: -60,
                };
                self.tell_radio(to, radio::In::Heard(heard));
            }
        }
    }

    /// Starts everyone, gives the stop, lifts it and starts everyone again.
    fn operate(&mut self) {
        if self.is_operator_dead {
            return;
        }
        if self.now == at(STOP_S) {
            let stop = EmergencyStop {
                name: self.name,
                scope: StopScope::All,
                by: OperatorId(1),
            };
            self.tell_keeper(Node::Operator, stops::In::Give(vec![stop]));
        }
        let lifts = self.now >= at(LIFT_S);
        let is_early = self.now < at(STOP_S);
        if !(is_early || lifts) || !self.tick.is_multiple_of(20) {
            return;
        }
        self.is_lifted |= lifts;
        if self.tick.is_multiple_of(200) {
            self.revision += 1;
        }
        for index in 0..self.rovers.len() {
            let Some(state) = self.rovers[index].state.clone() else {
                continue;
            };
            // The second half of the swarm is lifted and not started.
            if lifts && index >= self.rovers.len().div_ceil(2) {
                continue;
            }
            let order = Order {
                vehicle: state.vehicle,
                lease: Lease {
                    number: 1,
                    holder: 9,
                },
                run: RunId(1),
                revision: Revision(self.revision),
                seen: Some(SeenState {
                    boot: state.boot,
                    sequence: state.sequence,
                }),
                kind: OrderKind::Start,
                ends: if lifts { vec![self.name] } else { vec![] },
            };
            self.send(Node::Operator, &Frame::Order(order));
        }
    }

    /// After the lift the ground station wants to go on: it starts everyone.
    fn lead(&mut self) {
        if !self.is_ground_alive() || self.now < at(LIFT_S + 1.0) || !self.tick.is_multiple_of(40) {
            return;
        }
        for index in 0..self.rovers.len() {
            let Some(state) = self.rovers[index].state.clone() else {
                continue;
            };
            let order = Order {
                vehicle: state.vehicle,
                lease: Lease {
                    number: 1,
                    holder: 9,
                },
                run: RunId(1),
                revision: Revision(1000),
                seen: Some(SeenState {
                    boot: state.boot,
                    sequence: state.sequence,
                }),
                kind: OrderKind::Start,
                ends: vec![],
            };
            self.send(Node::Ground, &Frame::Order(order));
        }
    }

    /// Returns what the judge sees.
    fn seen(&self) -> Seen {
        let vehicle = |rover: &Rover| SeenVehicle {
            id: rover.id,
            boot: rover.boot,
            up_from: rover.up_from,
            shows: rover.open.iter().any(|stop| stop.name == self.name),
            is_driving: rover.is_driving,
        };
        Seen {
            now: self.now,
            vehicles: self.rovers.iter().map(vehicle).collect(),
            is_lifted: self.is_lifted,
            is_operator_dead: self.is_operator_dead,
        }
    }
}
