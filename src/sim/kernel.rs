//! The discrete-event kernel: pops the earliest event, tells whom it concerns, and hands on what they want done, to the
//! environment, to the network or to a disk. One thread, virtual time; same scenario and seed, same run.
//!
//! ```text
//!   schedule ─► wake │ what happens in the environment │ delivery │ fault ─► node.tell / node.wake ─► effects
//!     ▲                                                                                                 │
//!     └───────────── environment, network ◄─────────────────────────────────────────────────────────────┘
//! ```
//!
//! It holds no state of a node and none of the bus ([`nodes`], [`network`]); when a run is over the judge says.

mod alarm;
mod network;
mod nodes;
mod parts;
mod progress;
mod recording;
mod run_record;
mod schedule;
mod scheduled_environment;
mod telling;
#[cfg(test)]
mod tests;

use tomoswarm_proto::codec::{self, Decoded};
use tomoswarm_proto::{Boot, Message};

use self::network::Network;
use self::nodes::{NodePlace, Nodes, name_of};
use self::progress::ProgressMeter;
use self::run_record::RunRecord;
use self::schedule::{Schedule, ScheduledEvent};
use self::scheduled_environment::ScheduledEnvironment;
use super::bus::{BusFrame, NodeId};
use super::environment::{DeviceCommand, WorldEvent};
use super::faults::SoftwareFaultEvent;
use super::noise::Noise;
use super::operator_script::{PERSONS_ENTER, SCENARIO_OPERATOR};
use super::outcome::FleetCount;
use super::run_monitor::{RunMonitor, RunState};
use super::run_view::{RunView, VehicleSnapshot};
use crate::actor::Fault;
use crate::exchange::ingress::HeardMessage;
use crate::ground;
use crate::node;
use crate::node::mission::MissionEvent;
use crate::node::radio;
use crate::node::route::VehicleEvent;
use crate::operator::operator_actor::{In, Out};
use crate::time::Time;

pub(super) use self::network::Greetings;
pub(super) use self::nodes::{SimulatedGround, SimulatedOperator, SimulatedVehicle};
pub(super) use self::parts::{FinishedRun, Parts};
pub use self::progress::RunProgress;
pub(super) use self::recording::Recording;

/// The kernel of one run.
pub(super) struct Kernel {
    schedule: Schedule,
    environment: ScheduledEnvironment,
    network: Network,
    nodes: Nodes,
    monitor: RunMonitor,
    record: RunRecord,
    progress: ProgressMeter,
    noise: Noise,
    ends_at_contact: bool,
    /// How many starts of vehicles' software are still to come.
    starts_left: usize,
    scratch: Scratch,
}

/// Lists that are empty between two events, and kept for their memory.
#[derive(Default)]
struct Scratch {
    vehicle: Vec<node::Effect>,
    ground: Vec<ground::Effect>,
}

impl Kernel {
    /// Makes the kernel of a run that has not begun.
    pub(super) fn new(parts: Parts) -> Kernel {
        let noise = parts.noise;
        let turns = parts.faults.turns();
        let restarts = |(_, turn): &(_, SoftwareFaultEvent)| {
            *turn == SoftwareFaultEvent::Starts(NodeId::Ground)
        };
        let is_disk_read = parts.keeps_samples || turns.iter().any(restarts);
        let ground = SimulatedGround::new(parts.ground, is_disk_read);
        let operators = parts.operators.iter();
        let operators = operators.map(|operator| (operator.id(), operator.interest().to_vec()));
        let (greetings, egress_bytes_per_s) = (parts.greetings, parts.egress_bytes_per_s);
        let network = Network::new(parts.bus, noise, egress_bytes_per_s, greetings, operators);
        let mut schedule = Schedule::new(parts.until, parts.shuffle_ties.then_some(noise));
        let (environment, vehicles) = (parts.environment, parts.vehicles.len());
        let environment = ScheduledEnvironment::begin(environment, vehicles, &mut schedule);
        let mut kernel = Kernel {
            schedule,
            environment,
            network,
            record: RunRecord::new(parts.vehicles.iter().map(SimulatedVehicle::id)),
            nodes: Nodes::new(parts.vehicles, ground, parts.operators),
            monitor: parts.monitor,
            progress: ProgressMeter::shown_every(parts.shown_every),
            noise,
            ends_at_contact: parts.ends_at_contact,
            starts_left: turns
                .iter()
                .filter(|(_, turn)| turn.starts_vehicle())
                .count(),
            scratch: Scratch::default(),
        };
        kernel.prime(turns);
        kernel
    }

    /// Queues what happens by itself from the beginning.
    fn prime(&mut self, turns: Vec<(Time, SoftwareFaultEvent)>) {
        for (at, turn) in turns {
            self.schedule.push(at, ScheduledEvent::Fault(turn));
        }
        if !self.nodes.operators().is_empty() {
            self.schedule
                .push(Time::ZERO, ScheduledEvent::OperatorsBegin);
        }
        for (index, vehicle) in self.nodes.vehicles().iter().enumerate() {
            let (place, boot) = (NodePlace::Vehicle(index), vehicle.node().boot());
            self.network.join(place, boot, &mut self.schedule);
        }
        self.network
            .join(NodePlace::Ground, Boot(1), &mut self.schedule);
        for place in self.nodes.places() {
            self.set_alarm(place);
        }
    }

    /// Runs to the end, or until `watch` says that it is enough.
    pub(super) fn run(
        &mut self,
        watch: &mut dyn FnMut(&RunView<'_>) -> bool,
        mut recording: Option<Recording<'_>>,
    ) -> Result<(), Fault> {
        if let Some(recording) = &mut recording {
            recording.begin(self.schedule.now(), &mut self.nodes)?;
        }
        while let Some(event) = self.schedule.pop() {
            if !event.is_of_operator() {
                self.record.count_event();
            }
            let happened = self.happen(event);
            if let Some(recording) = &mut recording {
                recording.hand_out(self.schedule.now(), &mut self.nodes)?;
            }
            happened?;
            if self.progress.is_shown(self.schedule.now()) && !watch(&self.shown()) {
                break;
            }
        }
        Ok(())
    }

    /// Takes the run apart, and logs what every node holds: all maps must be one, and every sample made must be stored.
    pub(super) fn finish(mut self) -> FinishedRun {
        let now = self.schedule.now();
        for vehicle in 0..self.nodes.vehicles().len() {
            let vehicle = self.nodes.vehicle_mut(vehicle);
            let (who, what) = (name_of(NodeId::Vehicle(vehicle.id())), vehicle.holdings());
            self.record.line(now, &who, format_args!("{what}"));
        }
        let what = self.nodes.ground().holdings();
        self.record.line(now, "ground", format_args!("{what}"));
        let fleet = self.fleet(now);
        let mut environment = self.environment.into_environment();
        FinishedRun {
            fleet,
            record: self.record.close(environment.counts()),
            monitor: self.monitor,
            min_separation_m: environment.min_separation_m(now),
            environment,
            map: self.nodes.known_map(),
            ground: self.nodes.into_ground(),
            bus: self.network.into_bus(),
            ended_at: self.schedule.ended_at().unwrap_or(now),
            is_time_up: self.schedule.ended_at().is_none(),
        }
    }

    fn fleet(&self, now: Time) -> FleetCount {
        let rests = |vehicle| self.environment.truth(vehicle, now).speed_mps == 0.0;
        let has_ended = |vehicle| self.monitor.has_ended(vehicle);
        self.nodes.count_fleet(rests, has_ended)
    }

    fn happen(&mut self, event: ScheduledEvent) -> Result<(), Fault> {
        match event {
            ScheduledEvent::Wake { node, generation } if self.nodes.rings(node, generation) => {
                self.wake(node)
            }
            ScheduledEvent::Wake { .. } => Ok(()),
            ScheduledEvent::Exchange { node, generation } => {
                if self.network.wake(node, generation, &mut self.schedule) {
                    self.log(node, format_args!("takes part in the bus"));
                }
                Ok(())
            }
            ScheduledEvent::Environment => self.wake_environment(),
            ScheduledEvent::Deliver { to, frame } => self.deliver(to, &frame),
            ScheduledEvent::Fault(turn) => {
                self.turn(turn);
                Ok(())
            }
            ScheduledEvent::OperatorsBegin => self.begin_operators(),
        }
    }

    fn wake(&mut self, node: NodePlace) -> Result<(), Fault> {
        let now = self.schedule.now();
        match node {
            NodePlace::Vehicle(vehicle) => {
                let mut effects = std::mem::take(&mut self.scratch.vehicle);
                self.nodes.vehicle_mut(vehicle).wake(now, &mut effects)?;
                self.carry_out(vehicle, effects)
            }
            NodePlace::Ground => {
                let mut effects = std::mem::take(&mut self.scratch.ground);
                self.nodes.ground_mut().wake(now, &mut effects)?;
                self.carry_out_of_ground(effects);
                Ok(())
            }
            NodePlace::Operator(operator) => {
                let mut effects = Vec::new();
                self.nodes.operator_mut(operator).wake(now, &mut effects)?;
                self.carry_out_of_operator(operator, effects)
            }
        }
    }

    /// Queues the node's next wake, unless the one queued already is the right one.
    fn set_alarm(&mut self, node: NodePlace) {
        if let Some((at, generation)) = self.nodes.set_alarm(node, self.schedule.now()) {
            self.schedule
                .push(at, ScheduledEvent::Wake { node, generation });
        }
    }

    /// Carries out what a vehicle wants done, and tells it what is known at once, until it wants nothing more.
    fn carry_out(&mut self, vehicle: usize, mut effects: Vec<node::Effect>) -> Result<(), Fault> {
        while !effects.is_empty() {
            let answers: Vec<node::Event> = effects
                .drain(..)
                .filter_map(|effect| self.carry_out_one(vehicle, effect))
                .collect();
            for answer in answers {
                let (now, actors) = (self.schedule.now(), self.nodes.vehicle_mut(vehicle));
                actors.tell(now, answer, &mut effects)?;
            }
        }
        self.scratch.vehicle = effects;
        self.set_alarm(NodePlace::Vehicle(vehicle));
        Ok(())
    }

    fn carry_out_one(&mut self, vehicle: usize, effect: node::Effect) -> Option<node::Event> {
        let place = NodePlace::Vehicle(vehicle);
        let is_over = self.schedule.ended_at().is_some();
        let mut obey = |command| self.environment.obey(vehicle, command, &mut self.schedule);
        match effect {
            // After the end nothing sets out any more; what moves comes to rest.
            node::Effect::Command(numbered) if is_over && numbered.command.moves() => None,
            node::Effect::Ping(_) | node::Effect::Transmit(_) if is_over => None,
            node::Effect::Command(command) => obey(DeviceCommand::Autopilot(command)),
            // A simulated autopilot measures its place itself.
            node::Effect::Fix(..) => None,
            node::Effect::Steer(beam) => obey(DeviceCommand::Steer(beam)),
            node::Effect::Ping(ping) => obey(DeviceCommand::Ping(ping)),
            node::Effect::Transmit(beacon) => obey(DeviceCommand::Transmit(beacon)),
            node::Effect::Publish(message) => {
                self.network.publish(place, &message, &mut self.schedule);
                None
            }
            node::Effect::VehicleEvent(note) => {
                self.log(place, format_args!("{note}"));
                if let VehicleEvent::Mission(event) = &note {
                    self.inform_monitor(vehicle, event);
                }
                None
            }
            stored @ (node::Effect::Keep(..)
            | node::Effect::Recall { .. }
            | node::Effect::Forget { .. }
            | node::Effect::Remember(_)
            | node::Effect::KeepStops(_)) => self.nodes.vehicle_mut(vehicle).store(stored),
        }
    }

    /// Lets the judge see what a mission says.
    fn inform_monitor(&mut self, vehicle: usize, event: &MissionEvent) {
        let now = self.schedule.now();
        self.monitor.hear_of_mission(vehicle, event);
        match event {
            MissionEvent::Home => {
                let fleet = self.fleet(now);
                self.follow(self.monitor.came_home(fleet.home, fleet.alive));
            }
            MissionEvent::Ended(end) => {
                self.monitor.mission_ended(now, vehicle, end.clone());
                self.look_at_missions();
            }
            _ => {}
        }
    }

    /// Lets the judge see whether all missions have ended. While somebody is going to start anew nobody counts as dead.
    fn look_at_missions(&mut self) {
        let is_awaited = self.starts_left > 0;
        let are_dead = self.nodes.are_dead();
        let are_gone = are_dead.map(|is_dead| is_dead && !is_awaited);
        self.monitor.look_at_missions(are_gone);
    }

    fn carry_out_of_ground(&mut self, mut effects: Vec<ground::Effect>) {
        let (place, now) = (NodePlace::Ground, self.schedule.now());
        for effect in effects.drain(..) {
            match effect {
                ground::Effect::Publish(message) => {
                    self.network.publish(place, &message, &mut self.schedule);
                }
                ground::Effect::Picture(picture) => self.record.picture(now, *picture),
                ground::Effect::Remember(memory) => self.nodes.ground_mut().remember(memory),
                ground::Effect::KeepStops(stops) => self.nodes.ground_mut().keep_stops(stops),
                // What was measured is not told from run to run here.
                ground::Effect::BeginRun { .. } | ground::Effect::EndRun(_) => {}
                ground::Effect::StopEvent(event) => self.log(place, format_args!("{event}")),
                ground::Effect::StationEvent(note) => {
                    self.log(place, format_args!("{note}"));
                    self.progress.hear(&note, self.environment.sweeps_left());
                    self.monitor.hear(now, &note);
                }
            }
        }
        self.scratch.ground = effects;
        self.set_alarm(place);
    }

    /// Carries out what an operator wants done, until it wants nothing more.
    fn carry_out_of_operator(
        &mut self,
        operator: usize,
        mut effects: Vec<Out>,
    ) -> Result<(), Fault> {
        let (place, now) = (NodePlace::Operator(operator), self.schedule.now());
        while !effects.is_empty() {
            for effect in std::mem::take(&mut effects) {
                if let Some(words) = effect.in_words() {
                    self.log(place, format_args!("{words}"));
                }
                match effect {
                    Out::Publish(message) => {
                        self.network.publish(place, &message, &mut self.schedule);
                    }
                    // What is not known here is not done, and the operator gives up.
                    Out::Announce(name) if name == PERSONS_ENTER => {
                        self.environment.let_persons_enter(&mut self.schedule);
                        self.record
                            .line(now, "scenario", format_args!("the persons enter"));
                        let actors = self.nodes.operator_mut(operator);
                        actors.tell(now, In::CueDone, &mut effects)?;
                    }
                    Out::ScriptEnded(end) => {
                        // The script of the scenario's operator is what the run is about.
                        if self.nodes.operators()[operator].id() == SCENARIO_OPERATOR {
                            self.follow(self.monitor.script_ended(&end));
                        }
                        self.nodes.operator_mut(operator).end_script(end);
                    }
                    Out::Announce(_)
                    | Out::InForce(..)
                    | Out::Ended(..)
                    | Out::Marked(..)
                    | Out::Give(_)
                    | Out::StopEvent(_) => {}
                }
            }
        }
        self.set_alarm(place);
        Ok(())
    }

    /// Runs what is due in the environment, and tells the nodes concerned.
    fn wake_environment(&mut self) -> Result<(), Fault> {
        let mut happened = self.environment.wake(self.schedule.now());
        for event in happened.drain(..) {
            self.notice(event)?;
        }
        self.environment.take_back(happened);
        Ok(())
    }

    fn notice(&mut self, event: WorldEvent) -> Result<(), Fault> {
        let now = self.schedule.now();
        match event {
            WorldEvent::Scheduled(at) => self.schedule.push(at, ScheduledEvent::Environment),
            WorldEvent::Report { vehicle, report } => {
                let place = self.environment.truth(vehicle, now).at;
                self.record.track(vehicle, place);
                self.tell(vehicle, node::Event::Report(report))?;
            }
            WorldEvent::Ack { vehicle, ack } => self.tell(vehicle, node::Event::Ack(ack))?,
            WorldEvent::Echo { vehicle, echo } => self.tell(vehicle, node::Event::Echo(echo))?,
            WorldEvent::Heard { frame, receivers } => self.hear_beacon(&frame, &receivers)?,
            WorldEvent::Unsent { vehicle, sequence } => {
                self.tell(vehicle, node::Event::Unsent(sequence))?;
            }
            WorldEvent::Contact(collision) => {
                self.record.collision(now, &collision);
                if self.ends_at_contact {
                    self.schedule.end();
                }
            }
            WorldEvent::Charged { vehicle, charge } => {
                let place = NodePlace::Vehicle(vehicle);
                self.log(place, format_args!("has a charge of {charge}"));
            }
            WorldEvent::Track(states) => {
                self.record.track_all(now, &states);
                self.tell_facts()?;
            }
        }
        Ok(())
    }

    fn hear_beacon(&mut self, frame: &[u8], receivers: &[(usize, i16)]) -> Result<(), Fault> {
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
        let Some(place) = self.nodes.place_of(to) else {
            return Ok(());
        };
        let hearing = self.network.hear(place, frame, &mut self.schedule);
        if let Some(line) = hearing.line {
            self.log(place, format_args!("{line}"));
        }
        if let Some(reason) = hearing.expelled {
            self.expel(place, &reason);
        }
        let Some(heard) = hearing.heard else {
            return Ok(());
        };
        if let NodePlace::Operator(operator) = place {
            return self.tell_operator(operator, In::Bus(heard));
        }
        self.record.count_message();
        // Vehicles and ground station hear nothing else of greetings.
        let HeardMessage::Message(sender, message) = heard else {
            return Ok(());
        };
        match place {
            NodePlace::Vehicle(vehicle) => self.tell(vehicle, node::Event::Bus(sender, message)),
            NodePlace::Ground => self.tell_ground(ground::Event::Bus(sender, message)),
            NodePlace::Operator(_) => Ok(()),
        }
    }

    /// Ends a node that may not take part in the bus, as its process would end; without a ground station the run is over.
    fn expel(&mut self, node: NodePlace, reason: &str) {
        self.log(node, format_args!("may not take part: {reason}"));
        match node {
            NodePlace::Vehicle(_) => self.end_node(node),
            NodePlace::Ground => {
                self.network.leave(node);
                self.follow(RunState::Failed(format!(
                    "the ground station may not take part: {reason}"
                )));
            }
            // Operators ask nobody.
            NodePlace::Operator(_) => {}
        }
    }

    /// Lets a fault of software begin or end.
    fn turn(&mut self, turn: SoftwareFaultEvent) {
        self.starts_left -= usize::from(turn.starts_vehicle());
        let (SoftwareFaultEvent::Ends(node) | SoftwareFaultEvent::Starts(node)) = turn;
        match (turn, self.nodes.place_of(node)) {
            // An operator's end is not what a file can say.
            (_, None | Some(NodePlace::Operator(_))) => {}
            (SoftwareFaultEvent::Ends(_), Some(place)) => self.end_node(place),
            (SoftwareFaultEvent::Starts(_), Some(place)) => self.start_node(place),
        }
        self.look_at_missions();
    }

    /// Ends the software of a node; without it an autopilot brakes after a while.
    fn end_node(&mut self, node: NodePlace) {
        self.log(node, format_args!("its software ends"));
        self.nodes.end(node);
        self.network.leave(node);
        if let NodePlace::Vehicle(vehicle) = node {
            self.environment.detach(self.schedule.now(), vehicle);
        }
        self.look_at_missions();
        let alive = self.nodes.are_dead().filter(|is_dead| !is_dead).count();
        if self.starts_left == 0 && alive < self.monitor.least_vehicles() {
            let why = format!("the software of {alive} vehicles runs, too few");
            self.follow(RunState::Failed(why));
        }
    }

    /// Starts the software of a node anew, unless it runs.
    fn start_node(&mut self, node: NodePlace) {
        if self.network.is_joined(node) {
            return;
        }
        let Some(boot) = self.nodes.restart(node, self.noise) else {
            return;
        };
        if let NodePlace::Vehicle(vehicle) = node {
            self.environment.attach(self.schedule.now(), vehicle);
        }
        self.log(node, format_args!("its software starts, boot {boot}"));
        self.network.join(node, boot, &mut self.schedule);
        self.set_alarm(node);
    }

    /// Takes over what the monitor decided; of several the first counts.
    fn follow(&mut self, verdict: RunState) {
        if self.schedule.ended_at().is_some() {
            return;
        }
        match verdict {
            RunState::GoesOn => {}
            RunState::Over => self.schedule.end(),
            RunState::Failed(reason) => {
                self.record.fail(reason);
                self.schedule.end();
            }
        }
    }

    fn log(&mut self, node: NodePlace, what: std::fmt::Arguments<'_>) {
        let (now, id) = (self.schedule.now(), self.nodes.id_of(node));
        self.record.line(now, &name_of(id), what);
        self.network.overhear(now, id, what);
    }

    /// Returns what is to be seen of the run now.
    fn shown(&self) -> RunView<'_> {
        let now = self.schedule.now();
        let one = |(index, vehicle): (usize, &SimulatedVehicle)| {
            let (state, node) = (self.environment.truth(index, now), vehicle.node());
            VehicleSnapshot {
                id: vehicle.id(),
                at: state.at,
                heading: state.heading,
                status: (!vehicle.is_dead()).then(|| node.mission().status()),
            }
        };
        RunView {
            status: self.progress.status(now),
            map: self.nodes.ground().node().station().map(),
            vehicles: self.nodes.vehicles().iter().enumerate().map(one).collect(),
        }
    }
}
