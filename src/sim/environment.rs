//! What lies around the vehicles: bodies, autopilots, range sensors, radios and the air between them, and what goes wrong
//! with them. It is the only thing that a vehicle's drivers touch, in virtual time (the kernel) and on real time (the live
//! world) alike.
//!
//! ```text
//!   obey(vehicle, command) ─► bodies, servos, sensors, air ─► queue of pending events, predicted contacts
//!                                                               │ deadline, wake
//!                                                               ▼
//!         report │ ack │ echo │ heard │ unsent │ contact │ charged │ track ─► caller
//! ```
//!
//! Devices are as real ones are: a ping while the sensor measures and a beacon while the radio speaks are dropped and
//! counted, an autopilot whose companion is silent brakes, and what has touched something stays where it is. A beacon that
//! never went on the air comes back as unsent; a dead radio does not know that it is dead, and what it was told to send is
//! missed by all.
//!
//! It keeps the contract of an actor: `now` never goes back; after [`Environment::wake`] the deadline is later; what it
//! says is a list. It reads no clock, knows no bus and no software of vehicles, and judges nothing: a contact is said,
//! and whether a run ends by it is the caller's matter.

mod devices;
mod event;

#[cfg(test)]
mod tests;

use std::time::Duration;

use tomoswarm_proto::{Beacon, VehicleId};

pub use self::devices::COMPANION_SILENT;
pub use self::event::{DeviceCommand, DeviceCounts, WorldEvent};

use self::devices::SimulatedDevices;
use self::event::PendingEvent;
use super::air::{Air, Fate, Sent};
use super::autopilot::{DatedText, LowBattery, Readout};
use super::faults::Faults;
use super::noise::{Noise, NoisePurpose};
use super::queue::EventQueue;
use super::walking::WalkingScene;
use super::world::{CommandResult, PredictedContact, World, WorldContents};
use crate::autopilot::{
    Ack, AutopilotReport, Command, CommandAck, FlightMode, NumberedCommand, VehicleKind,
};
use crate::geom::Angle;
use crate::node::health::HealthFacts;
use crate::node::sensor::{Echo, Ping};
use crate::time::{Deadline, Time};

/// Autopilots report this often.
const REPORT_EVERY: Duration = Duration::from_millis(100);
/// Where everybody is is said this often.
pub const TRACK_EVERY: Duration = Duration::from_secs(1);

/// Persons who walk are put where they are this often.
const WALK_EVERY: Duration = Duration::from_millis(200);

/// What lies around the vehicles.
pub struct Environment {
    now: Time,
    noise: Noise,
    world: World,
    air: Air,
    faults: Faults,
    devices: Vec<SimulatedDevices>,
    pending: EventQueue<PendingEvent>,
    /// Contacts that the present motion leads to.
    contacts: Vec<PredictedContact>,
    counts: DeviceCounts,
    /// What stands there once the persons have entered; `None` = they have.
    outside: Option<Box<WorldContents>>,
    /// Who walks there.
    walking: Option<Box<WalkingScene>>,
}

impl Environment {
    /// Takes a world with all its vehicles in place, and the faults of their devices; nobody's software runs. With `ties`
    /// what happens at one moment comes in an order drawn from it.
    pub fn new(world: World, noise: Noise, faults: Faults, ties: Option<Noise>) -> Environment {
        let devices = vec![SimulatedDevices::new(world.mounts().clone()); world.vehicles()];
        Environment {
            now: Time::ZERO,
            noise,
            world,
            air: Air::default(),
            faults,
            devices,
            pending: EventQueue::new(ties),
            contacts: Vec::new(),
            counts: DeviceCounts::default(),
            outside: None,
            walking: None,
        }
    }

    /// Lets persons walk, as soon as they are in.
    pub fn with_walking(self, walking: Option<WalkingScene>) -> Environment {
        Environment {
            walking: walking.map(Box::new),
            ..self
        }
    }

    /// Lets the persons wait outside; with them in it the world is as this stage.
    pub fn with_persons_outside(self, entered: Option<WorldContents>) -> Environment {
        Environment {
            outside: entered.map(Box::new),
            ..self
        }
    }

    /// Begins, once: from now on autopilots report and faults come. Not all autopilots speak at the same moment.
    pub fn begin(&mut self, out: &mut Vec<WorldEvent>) {
        for vehicle in 0..self.world.vehicles() {
            let share = self
                .noise
                .uniform(NoisePurpose::Start, &[u64::from(self.world.id(vehicle).0)]);
            let first = Time::ZERO + REPORT_EVERY.mul_f64(share);
            self.schedule(first, PendingEvent::Report { vehicle }, out);
        }
        self.schedule(Time::ZERO + TRACK_EVERY, PendingEvent::Track, out);
        if self.persons_are_in() && self.walking.is_some() {
            self.schedule(Time::ZERO + WALK_EVERY, PendingEvent::Walk, out);
        }
        for (at, vehicle, charge) in self.faults.charges() {
            self.schedule(at, PendingEvent::Charge { vehicle, charge }, out);
        }
    }

    /// Returns the world.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Returns the smallest distance between the middles of two vehicles so far, metres; infinite for one alone.
    pub fn min_separation_m(&mut self, now: Time) -> f64 {
        self.world.min_separation_m(now)
    }

    /// Returns what the devices of a vehicle would tell of themselves.
    pub fn facts(&self, vehicle: usize) -> HealthFacts {
        self.devices[vehicle].facts(self.now, self.world.kind())
    }

    /// Returns how often things happened to devices.
    pub fn counts(&self) -> DeviceCounts {
        self.counts
    }

    /// Returns how many things are to happen by themselves.
    #[cfg(test)]
    pub fn pending(&self) -> usize {
        self.pending.len() + self.contacts.len()
    }

    /// Returns what the autopilot of a vehicle knows of itself at a moment.
    pub fn known(&mut self, vehicle: usize, now: Time) -> AutopilotReport {
        self.world.report(vehicle, now)
    }

    /// Returns when something happens by itself next.
    pub fn deadline(&self) -> Option<Deadline> {
        let contact = self.contacts.iter().map(|contact| contact.at).min();
        let contact = contact.map(|at| Deadline { at, why: "contact" });
        let pending = self.pending.next_at().map(|at| Deadline {
            at,
            why: "pending event",
        });
        Deadline::earlier(contact, pending)
    }

    /// Lets everything happen up to a moment, each at its own time; a contact before what else is due.
    pub fn wake(&mut self, now: Time, out: &mut Vec<WorldEvent>) {
        while let Some(at) = self
            .deadline()
            .map(|deadline| deadline.at)
            .filter(|at| *at <= now)
        {
            self.now = self.now.max(at);
            if let Some(contact) = self.take_due_contact() {
                self.touch(contact, out);
            } else if let Some((at, event)) = self.pending.pop() {
                self.happen(at, event, now, out);
            }
        }
        self.now = self.now.max(now);
    }

    /// The software of a vehicle runs from now on, and is told what its devices say.
    pub fn attach(&mut self, now: Time, vehicle: usize) {
        self.now = self.now.max(now);
        self.devices[vehicle].attach(self.now);
    }

    /// The software of a vehicle runs no more; its autopilot brakes [`COMPANION_SILENT`] after its last word.
    pub fn detach(&mut self, now: Time, vehicle: usize) {
        self.now = self.now.max(now);
        self.devices[vehicle].is_attached = false;
    }

    /// Lets a device of a vehicle do what its software wants. An autopilot's answer and a beacon that is not sent come back
    /// at once; all else that comes of it comes by [`Environment::wake`].
    pub fn obey(
        &mut self,
        now: Time,
        vehicle: usize,
        command: DeviceCommand,
        out: &mut Vec<WorldEvent>,
    ) {
        self.now = self.now.max(now);
        self.devices[vehicle].heard_at = self.now;
        match command {
            DeviceCommand::Autopilot(_) if self.devices[vehicle].is_wrecked => {
                self.counts.dropped += 1
            }
            DeviceCommand::Autopilot(command) => self.answer(vehicle, &command, out),
            DeviceCommand::Steer(beam) => self.steer(vehicle, beam),
            DeviceCommand::Ping(ping) => self.ping(vehicle, ping, out),
            DeviceCommand::Transmit(beacon) => self.transmit(vehicle, beacon, out),
        }
    }

    /// Lets the persons enter, unless they are in.
    pub fn let_persons_enter(&mut self, now: Time, out: &mut Vec<WorldEvent>) {
        let Some(stage) = self.outside.take() else {
            return;
        };
        self.now = self.now.max(now);
        let walked = self.walking.as_ref().map(|walking| walking.at(self.now));
        self.set_stage(walked.and_then(Result::ok).unwrap_or(*stage), out);
        if self.walking.is_some() {
            self.schedule(self.now + WALK_EVERY, PendingEvent::Walk, out);
        }
    }

    /// Changes what stands there.
    fn set_stage(&mut self, stage: WorldContents, out: &mut Vec<WorldEvent>) {
        // Contacts that were predicted with the old stage are void.
        self.contacts.clear();
        let contacts = self.world.set_stage(stage, self.now);
        self.predict(contacts, out);
    }

    /// Puts persons where they have walked to. A scene that cannot be built could not when the run began: nobody moves then.
    fn walk(&mut self, out: &mut Vec<WorldEvent>) {
        let walked = self.walking.as_ref().map(|walking| walking.at(self.now));
        if let Some(Ok(stage)) = walked {
            self.set_stage(stage, out);
        }
    }

    /// Returns whether nobody waits outside.
    pub fn persons_are_in(&self) -> bool {
        self.outside.is_none()
    }

    fn schedule(&mut self, at: Time, event: PendingEvent, out: &mut Vec<WorldEvent>) {
        self.pending.push(at, event);
        out.push(WorldEvent::Scheduled(at));
    }

    /// Keeps contacts of those that can still move.
    fn predict(&mut self, mut contacts: Vec<PredictedContact>, out: &mut Vec<WorldEvent>) {
        contacts.retain(|contact| !self.devices[contact.one.0].is_wrecked);
        out.extend(
            contacts
                .iter()
                .map(|contact| WorldEvent::Scheduled(contact.at.max(self.now))),
        );
        self.contacts.extend(contacts);
    }

    fn take_due_contact(&mut self) -> Option<PredictedContact> {
        let due = self
            .contacts
            .iter()
            .enumerate()
            .filter(|(_, contact)| contact.at <= self.now);
        let index = due.min_by_key(|(_, contact)| contact.at)?.0;
        Some(self.contacts.remove(index))
    }

    /// One thing happens; `until` is how far the environment is to go on now.
    fn happen(&mut self, at: Time, event: PendingEvent, until: Time, out: &mut Vec<WorldEvent>) {
        match event {
            PendingEvent::Report { vehicle } => self.report(at, vehicle, until, out),
            PendingEvent::Track => {
                self.schedule(next_of(at, TRACK_EVERY, until), PendingEvent::Track, out);
                let everybody = 0..self.world.vehicles();
                let states = everybody
                    .map(|vehicle| self.world.truth(vehicle, self.now))
                    .collect();
                out.push(WorldEvent::Track(states));
            }
            PendingEvent::Echo { vehicle, echo } => {
                self.devices[vehicle].pings.answered(echo.number);
                self.tell(vehicle, WorldEvent::Echo { vehicle, echo }, out)
            }
            PendingEvent::Silence { vehicle } => self.mind_companion(vehicle, out),
            PendingEvent::AirEnds { number } => self.end_of_beacon(number, out),
            PendingEvent::Charge { vehicle, charge } => self.charge(vehicle, charge, out),
            PendingEvent::Walk => {
                self.schedule(next_of(at, WALK_EVERY, until), PendingEvent::Walk, out);
                self.walk(out);
            }
        }
    }

    fn report(&mut self, at: Time, vehicle: usize, until: Time, out: &mut Vec<WorldEvent>) {
        let known = self.world.report(vehicle, self.now);
        let report = self.devices[vehicle].as_reported(known);
        let contacts = self.world.foreseen();
        self.predict(contacts, out);
        let next = next_of(at, REPORT_EVERY, until);
        self.schedule(next, PendingEvent::Report { vehicle }, out);
        self.tell(vehicle, WorldEvent::Report { vehicle, report }, out);
    }

    /// Says what concerns the software of a vehicle, if it runs.
    fn tell(&self, vehicle: usize, event: WorldEvent, out: &mut Vec<WorldEvent>) {
        if self.devices[vehicle].is_attached {
            out.push(event);
        }
    }

    /// A predicted contact happens, unless it is void. Those that can still move may now meet the wrecks.
    fn touch(&mut self, contact: PredictedContact, out: &mut Vec<WorldEvent>) {
        let Some(collision) = self.world.touch(&contact) else {
            return;
        };
        for (index, devices) in self.devices.iter_mut().enumerate() {
            devices.is_wrecked |= contact.concerns(index);
        }
        self.contacts.clear();
        let everybody = 0..self.devices.len();
        let contacts = everybody
            .flat_map(|index| self.world.touches(index, self.now))
            .collect();
        self.predict(contacts, out);
        out.push(WorldEvent::Contact(collision));
    }

    /// Brakes an autopilot whose companion has fallen silent.
    fn mind_companion(&mut self, vehicle: usize, out: &mut Vec<WorldEvent>) {
        let devices = &mut self.devices[vehicle];
        devices.is_minded = false;
        if !devices.moves || devices.is_wrecked {
            return;
        }
        if devices.silent_at() > self.now {
            self.schedule_look_at_companion(vehicle, out);
            return;
        }
        let stopped = self.command(vehicle, &Command::Stop, out);
        if stopped.result != CommandAck::Accepted {
            // On its own way: a stored mission, or home.
            let stays = Command::Mode(FlightMode::staying(self.world.kind()));
            self.command(vehicle, &stays, out);
        }
    }

    fn schedule_look_at_companion(&mut self, vehicle: usize, out: &mut Vec<WorldEvent>) {
        let devices = &mut self.devices[vehicle];
        if !devices.is_minded {
            devices.is_minded = true;
            let at = devices.silent_at();
            self.schedule(at, PendingEvent::Silence { vehicle }, out);
        }
    }

    fn charge(&mut self, id: VehicleId, charge: f64, out: &mut Vec<WorldEvent>) {
        let Some(vehicle) = (0..self.world.vehicles()).find(|index| self.world.id(*index) == id)
        else {
            return;
        };
        self.world.charge(vehicle, self.now, charge);
        out.push(WorldEvent::Charged { vehicle, charge });
    }

    /// Lets an autopilot obey its companion, and answer; a wreck does neither.
    fn answer(&mut self, vehicle: usize, numbered: &NumberedCommand, out: &mut Vec<WorldEvent>) {
        let NumberedCommand { number, command } = numbered;
        let CommandResult {
            result,
            arm_refusal,
            ..
        } = self.command(vehicle, command, out);
        let ack = Ack {
            number: *number,
            result,
            arm_refusal,
        };
        self.tell(vehicle, WorldEvent::Ack { vehicle, ack }, out);
    }

    /// A person commands the autopilot of a vehicle by remote control; its companion is told nothing.
    pub fn command_by_remote_control(
        &mut self,
        now: Time,
        vehicle: usize,
        command: &Command,
        out: &mut Vec<WorldEvent>,
    ) -> CommandAck {
        self.now = self.now.max(now);
        self.command(vehicle, command, out).result
    }

    /// A client commands the autopilot of a vehicle over its own link; the companion is told nothing, and its silence does not
    /// brake what follows.
    pub fn command_by_client(
        &mut self,
        now: Time,
        vehicle: usize,
        command: &Command,
    ) -> CommandResult {
        self.now = self.now.max(now);
        // Who asks for the deadline needs not be told what is scheduled.
        let mut obeyed = self.world.command(vehicle, self.now, command);
        self.contacts.retain(|contact| !contact.concerns(vehicle));
        self.predict(std::mem::take(&mut obeyed.contacts), &mut Vec::new());
        obeyed
    }

    /// Returns all that the autopilot of a vehicle knows of itself.
    pub fn readout(&mut self, vehicle: usize, now: Time) -> Readout {
        self.world.readout(vehicle, now)
    }

    /// Returns what the autopilot of a vehicle has said since the last call, in order.
    pub fn status_texts(&mut self, vehicle: usize) -> Vec<DatedText> {
        self.world.status_texts(vehicle)
    }

    /// Returns what all vehicles are.
    pub fn kind(&self) -> VehicleKind {
        self.world.kind()
    }

    /// Says what is to happen when the battery of a vehicle is low.
    pub fn set_low_battery(&mut self, vehicle: usize, action: LowBattery) {
        self.world.set_low_battery(vehicle, action);
    }

    fn command(
        &mut self,
        vehicle: usize,
        command: &Command,
        out: &mut Vec<WorldEvent>,
    ) -> CommandResult {
        let devices = &mut self.devices[vehicle];
        devices.moves = command.moves() || (devices.moves && !command.stops());
        if devices.moves {
            self.schedule_look_at_companion(vehicle, out);
        }
        let mut obeyed = self.world.command(vehicle, self.now, command);
        self.contacts.retain(|contact| !contact.concerns(vehicle));
        self.predict(std::mem::take(&mut obeyed.contacts), out);
        obeyed
    }

    /// Points the range sensor that reaches a direction; its servo begins to turn.
    fn steer(&mut self, vehicle: usize, beam: Angle) {
        if beam.radians().is_finite() {
            self.devices[vehicle]
                .servos
                .steer(self.now.since(Time::ZERO), beam);
        } else {
            self.counts.dropped += 1;
        }
    }

    /// Lets the range sensor that was pointed last measure, wherever its servo stands.
    fn ping(&mut self, vehicle: usize, ping: Ping, out: &mut Vec<WorldEvent>) {
        if self.faults.blind(self.now, self.world.id(vehicle)) {
            self.devices[vehicle].pings.ping(self.now, ping);
            return;
        }
        if self.devices[vehicle].measures_until > self.now {
            self.counts.dropped += 1;
            return;
        }
        self.counts.scans += 1;
        self.devices[vehicle].pings.ping(self.now, ping);
        let beam = self.devices[vehicle]
            .servos
            .beam(self.now.since(Time::ZERO));
        let (range_m, takes) = self.world.echo(vehicle, self.now, beam, ping.number);
        let echo = Echo {
            number: ping.number,
            range_m,
        };
        self.devices[vehicle].measures_until = self.now + takes;
        self.schedule(self.now + takes, PendingEvent::Echo { vehicle, echo }, out);
    }

    fn transmit(&mut self, vehicle: usize, beacon: Beacon, out: &mut Vec<WorldEvent>) {
        // A dead radio knows nothing of it: what it was told to send is missed by all.
        if self.faults.cut_radio(self.now, self.world.id(vehicle)) {
            self.devices[vehicle].radio.sent += 1;
            return;
        }
        let sequence = beacon.sequence;
        match self.begin_beacon(vehicle, beacon) {
            Some((number, ends)) => {
                self.devices[vehicle].speaks_until = ends;
                self.devices[vehicle].radio.sent += 1;
                self.schedule(ends, PendingEvent::AirEnds { number }, out);
            }
            None => {
                self.counts.dropped += 1;
                self.devices[vehicle].radio.unsent += 1;
                self.tell(vehicle, WorldEvent::Unsent { vehicle, sequence }, out);
            }
        }
    }

    /// Begins to send a beacon, unless the radio is speaking, the beacon is too long, or is in another's name; returns its
    /// number and when it ends.
    fn begin_beacon(&mut self, vehicle: usize, beacon: Beacon) -> Option<(u64, Time)> {
        let is_busy = self.devices[vehicle].speaks_until > self.now;
        if is_busy || beacon.sender != self.world.id(vehicle) {
            return None;
        }
        let place = self.world.truth(vehicle, self.now).at;
        self.air.begin(self.now, vehicle, place, beacon)
    }

    fn end_of_beacon(&mut self, number: u64, out: &mut Vec<WorldEvent>) {
        let sent = match self.air.end(self.now, number) {
            Fate::Clear(sent) => sent,
            Fate::Collided => {
                self.counts.collided_beacons += 1;
                return;
            }
            Fate::Unknown => return,
        };
        let mut receivers: Vec<(usize, i16)> = (0..self.world.vehicles())
            .filter_map(|to| Some((to, self.received_dbm(&sent, to)?)))
            .collect();
        self.counts.beacons_heard += receivers.len() as u64;
        receivers.retain(|(to, _)| self.devices[*to].is_attached);
        if !receivers.is_empty() {
            out.push(WorldEvent::Heard {
                frame: sent.frame,
                receivers,
            });
        }
    }

    /// Returns how strongly a vehicle hears what another one has sent, dBm; `None` when it does not.
    pub(super) fn received_dbm(&self, sent: &Sent, to: usize) -> Option<i16> {
        if to == sent.from || self.faults.cut_radio(self.now, self.world.id(to)) {
            return None;
        }
        self.world.received_dbm(sent, to, self.now)
    }
}

/// Returns the next of moments that come at equal steps; steps that would all be past are left out, so that a process
/// that was stopped for a while does not say everything at once.
fn next_of(at: Time, step: Duration, until: Time) -> Time {
    let steps = until.since(at).as_nanos() / step.as_nanos().max(1);
    let missed = u32::try_from(steps.saturating_sub(1)).unwrap_or(u32::MAX);
    at + step + step.saturating_mul(missed)
}
