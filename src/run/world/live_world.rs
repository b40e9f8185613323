//! The world with its drivers: whose software moves which body, what its devices are doing, what happens next, and what
//! is told to whom. It reads no clock and knows no socket, so that it can be tested in any time.
//!
//! It differs from the simulator in what a real world must bear: words of a device that is still busy are dropped, an
//! autopilot whose companion is silent brakes, and after a contact the bodies involved stay where they are.

use std::time::Duration;

use tomoswarm_proto::codec::{self, Decoded};
use tomoswarm_proto::{Beacon, Boot, Message, VehicleId};

use crate::geom::{Angle, Point};
use crate::node::sensor::Ping;
use crate::node::vehicle::Fly;
use crate::run::link::{
    COLLISIONS_LIMIT, Contact, FromWorld, PLACES_LIMIT, Refused, Status, ToWorld, VehicleStatus, Welcome,
};
use crate::sim::outside::{Happened, Later, Outside, TELEMETRY_EVERY, TRACK_EVERY};
use crate::sim::queue::EventQueue;
use crate::sim::{Collision, Scenario, ScenarioError, Stage, Touch};
use crate::time::Time;

/// An autopilot that has had no word of its companion for so long brakes and stands.
pub const COMPANION_SILENT: Duration = Duration::from_secs(2);
/// A place is written down when it is this far from the one before, metres.
const TRACK_STEP_M: f64 = 0.05;
/// A track of more places than this loses every other one.
const TRACK_LIMIT: usize = 50_000;

/// Something for one vehicle: its index, and what is said.
pub type Said = (usize, FromWorld);

/// The world with its drivers.
pub struct LiveWorld {
    now: Time,
    outside: Outside,
    /// What stands there with the persons in, while they wait outside.
    waiting: Option<Stage>,
    seats: Vec<Seat>,
    queue: EventQueue<Due>,
    /// Contacts that the present motion leads to.
    touches: Vec<Touch>,
    /// What is counted; the rest is filled in when it is asked for.
    status: Status,
}

/// What is to happen by itself, but for contacts.
#[derive(Debug)]
enum Due {
    Telemetry(usize),
    Track,
    Later(Later),
}

/// Who drives a body, and what its devices are doing.
#[derive(Debug)]
struct Seat {
    id: VehicleId,
    /// Whose words move it now.
    driver: Option<Boot>,
    /// The highest boot that ever did.
    highest: Option<Boot>,
    /// When its companion was heard last.
    heard_at: Time,
    /// It has been told to move, and not stopped since.
    moves: bool,
    /// It has touched something.
    is_wrecked: bool,
    /// Until when the range sensor is measuring.
    measures_until: Time,
    /// Until when the radio is speaking.
    speaks_until: Time,
    track: Vec<Point>,
}

impl LiveWorld {
    /// Makes the world of a scenario with everybody at home and nobody driving.
    ///
    /// # Errors
    /// The scenario is impossible.
    pub fn new(scenario: &Scenario) -> Result<LiveWorld, ScenarioError> {
        let (outside, waiting) = scenario.outside()?;
        let mut queue = EventQueue::new(None);
        let mut seats = Vec::new();
        for index in 0..outside.world().vehicles() {
            let seat = Seat::new(outside.world().id(index));
            queue.push(scenario.first_telemetry(seat.id), Due::Telemetry(index));
            seats.push(seat);
        }
        queue.push(Time::ZERO, Due::Track);
        let persons = scenario.persons().iter().map(|person| person.at).collect();
        let status = Status { persons, ..Status::default() };
        Ok(LiveWorld { now: Time::ZERO, outside, waiting, seats, queue, touches: Vec::new(), status })
    }

    /// Gives how many vehicles there are; their ids are 1 to this.
    pub fn vehicles(&self) -> u8 {
        u8::try_from(self.seats.len()).unwrap_or(u8::MAX)
    }

    /// Gives how many things are to happen by themselves.
    #[cfg(test)]
    pub fn pending(&self) -> usize {
        self.queue.len() + self.touches.len()
    }

    /// Gives when something happens by itself next.
    pub fn next_at(&self) -> Time {
        let touch = self.touches.iter().map(|touch| touch.at).min().unwrap_or(Time::NEVER);
        self.queue.next_at().unwrap_or(Time::NEVER).min(touch)
    }

    /// Lets everything happen up to a moment, each at its own time.
    pub fn advance(&mut self, now: Time, said: &mut Vec<Said>) {
        while self.next_at() <= now {
            self.now = self.now.max(self.next_at());
            let due = self.touches.iter().position(|touch| touch.at <= self.now);
            if let Some(index) = due {
                let touch = self.touches.swap_remove(index);
                self.happen(Later::Touch(touch), said);
            } else if let Some((at, due)) = self.queue.pop() {
                self.come(at, due, now, said);
            }
        }
        self.now = self.now.max(now);
    }

    /// One thing comes; `until` is how far the world is to go on now.
    fn come(&mut self, at: Time, due: Due, until: Time, said: &mut Vec<Said>) {
        match due {
            Due::Telemetry(index) => {
                self.queue.push(next_of(at, TELEMETRY_EVERY, until), Due::Telemetry(index));
                self.mind_companion(index);
                self.report(index, said);
            }
            Due::Track => {
                self.queue.push(next_of(at, TRACK_EVERY, until), Due::Track);
                for index in 0..self.seats.len() {
                    let place = self.outside.world().truth(index, self.now).at;
                    self.seats[index].track(place);
                }
            }
            Due::Later(later) => self.happen(later, said),
        }
    }

    fn report(&mut self, index: usize, said: &mut Vec<Said>) {
        if self.seats[index].driver.is_some() {
            said.push((index, FromWorld::Telemetry(self.outside.telemetry(index, self.now))));
            self.touches.extend(self.outside.foreseen());
        }
    }

    fn happen(&mut self, later: Later, said: &mut Vec<Said>) {
        match self.outside.happen(self.now, later) {
            Happened::Nothing => {}
            Happened::Echo { vehicle, echo } => said.push((vehicle, FromWorld::Echo(echo))),
            Happened::Collided => self.status.collided_beacons += 1,
            Happened::Heard { frame, receivers } => {
                for (index, rssi_dbm) in receivers {
                    self.status.beacons_heard += 1;
                    said.push((index, FromWorld::Heard { frame: frame.to_vec(), rssi_dbm }));
                }
            }
            Happened::Collision(collision) => self.collide(&collision),
        }
    }

    /// Who has touched stays where it is; for the others contacts are foreseen anew.
    fn collide(&mut self, collision: &Collision) {
        let Collision { at, vehicle, with, place } = *collision;
        self.status.collision_count += 1;
        if self.status.collisions.len() < COLLISIONS_LIMIT {
            self.status.collisions.push(Contact { at_ns: at.as_nanos(), vehicle, with, place });
        }
        for seat in &mut self.seats {
            seat.is_wrecked |= seat.id == vehicle || Some(seat.id) == with;
        }
        let sound = (0..self.seats.len()).filter(|index| !self.seats[*index].is_wrecked);
        self.touches = sound.flat_map(|index| self.outside.world().touches(index, self.now)).collect();
    }

    /// Lets an autopilot brake that has been left alone by its companion.
    fn mind_companion(&mut self, index: usize) {
        let seat = &self.seats[index];
        if seat.moves && !seat.is_wrecked && self.now.since(seat.heard_at) >= COMPANION_SILENT {
            self.fly(index, &Fly::Stop);
        }
    }

    /// Lets the software of a vehicle drive it from now on; gives the vehicle's index and what it is told.
    ///
    /// # Errors
    /// There is no such vehicle, or a start of its software that is as high drives it already.
    pub fn join(&mut self, vehicle: VehicleId, boot: Boot) -> Result<(usize, Welcome), Refused> {
        let unknown = Refused::Unknown { vehicle, count: self.vehicles() };
        let index = self.seats.iter().position(|seat| seat.id == vehicle).ok_or(unknown)?;
        let seat = &mut self.seats[index];
        if let Some(present) = seat.driver.filter(|present| *present >= boot) {
            return Err(Refused::Taken { vehicle, present, found: boot });
        }
        if let Some(present) = seat.highest.filter(|present| *present > boot) {
            return Err(Refused::Outdated { vehicle, present, found: boot });
        }
        (seat.driver, seat.highest, seat.heard_at) = (Some(boot), Some(boot), self.now);
        let start = self.outside.telemetry(index, self.now).pose;
        Ok((index, Welcome { now_ns: self.now.as_nanos(), start: Some(start) }))
    }

    /// Nobody drives a vehicle any more; its autopilot brakes after [`COMPANION_SILENT`].
    pub fn leave(&mut self, index: usize) {
        self.seats[index].driver = None;
    }

    /// Lets the devices of a vehicle do what its driver said.
    pub fn obey(&mut self, index: usize, word: ToWorld) {
        self.seats[index].heard_at = self.now;
        match word {
            ToWorld::Fly(_) if self.seats[index].is_wrecked => self.status.dropped += 1,
            ToWorld::Fly(fly) => self.fly(index, &fly),
            ToWorld::Steer(beam) => self.steer(index, beam),
            ToWorld::Ping(ping) => self.ping(index, ping),
            ToWorld::Transmit(frame) => match codec::decode(&frame) {
                Ok(Decoded::Message(Message::Beacon(beacon))) => self.transmit(index, beacon),
                Ok(_) | Err(_) => self.status.dropped += 1,
            },
            ToWorld::Join { .. }
            | ToWorld::Control { .. }
            | ToWorld::Enter
            | ToWorld::Report
            | ToWorld::Track { .. }
            | ToWorld::Stop => self.status.dropped += 1,
        }
    }

    fn fly(&mut self, index: usize, fly: &Fly) {
        self.seats[index].moves = matches!(fly, Fly::Drive { .. } | Fly::Turn(_));
        let foreseen = self.outside.fly(index, self.now, fly);
        self.touches.retain(|touch| touch.one.0 != index && touch.other.is_none_or(|peer| peer.0 != index));
        self.touches.extend(foreseen);
    }

    fn steer(&mut self, index: usize, beam: Angle) {
        // From outside an angle may be any number.
        let beam = Angle::from_radians(beam.radians());
        if beam.radians().is_finite() {
            self.outside.steer(index, self.now, beam);
        } else {
            self.status.dropped += 1;
        }
    }

    fn ping(&mut self, index: usize, ping: Ping) {
        if self.seats[index].measures_until > self.now {
            self.status.dropped += 1;
            return;
        }
        self.status.scans += 1;
        let (at, later) = self.outside.ping(index, self.now, ping.number);
        self.seats[index].measures_until = at;
        self.queue.push(at, Due::Later(later));
    }

    fn transmit(&mut self, index: usize, beacon: Beacon) {
        let seat = &mut self.seats[index];
        let speaks = seat.speaks_until > self.now || beacon.sender != seat.id;
        let begun = if speaks { None } else { self.outside.transmit(index, self.now, beacon) };
        let Some((ends, later)) = begun else {
            self.status.dropped += 1;
            return;
        };
        seat.speaks_until = ends;
        self.queue.push(ends, Due::Later(later));
    }

    /// Lets the persons enter, unless they are in.
    pub fn enter(&mut self) {
        if let Some(stage) = self.waiting.take() {
            let touches = self.outside.set_stage(stage, self.now);
            let is_sound = |touch: &Touch| !self.seats[touch.one.0].is_wrecked;
            self.touches = touches.into_iter().filter(is_sound).collect();
        }
    }

    /// Tells how it is going.
    pub fn status(&mut self) -> Status {
        let separation_m = self.outside.min_separation_m(self.now);
        let world = self.outside.world();
        let vehicle = |(index, seat): (usize, &Seat)| {
            let truth = world.truth(index, self.now);
            VehicleStatus {
                vehicle: seat.id,
                driver: seat.driver,
                at: truth.at,
                heading: truth.heading,
                speed_mps: truth.speed_mps,
                places: u32::try_from(seat.track.len()).unwrap_or(u32::MAX),
            }
        };
        Status {
            now_ns: self.now.as_nanos(),
            entered: self.waiting.is_none(),
            vehicles: self.seats.iter().enumerate().map(vehicle).collect(),
            fence_breaches: world.fence_breaches() as u64,
            min_separation_m: separation_m.is_finite().then_some(separation_m),
            ..self.status.clone()
        }
    }

    /// Gives a piece of a vehicle's track; empty behind its end and for a vehicle that is not there.
    pub fn places(&self, vehicle: VehicleId, from: u32) -> Vec<Point> {
        let Some(seat) = self.seats.iter().find(|seat| seat.id == vehicle) else { return Vec::new() };
        let from = usize::try_from(from).unwrap_or(usize::MAX);
        seat.track.iter().skip(from).take(PLACES_LIMIT).copied().collect()
    }
}

impl Seat {
    fn new(id: VehicleId) -> Seat {
        Seat {
            id,
            driver: None,
            highest: None,
            heard_at: Time::ZERO,
            moves: false,
            is_wrecked: false,
            measures_until: Time::ZERO,
            speaks_until: Time::ZERO,
            track: Vec::new(),
        }
    }

    fn track(&mut self, place: Point) {
        if self.track.last().is_some_and(|last| last.distance_to(place) <= TRACK_STEP_M) {
            return;
        }
        if self.track.len() >= TRACK_LIMIT {
            let mut odd = false;
            self.track.retain(|_| {
                odd = !odd;
                odd
            });
        }
        self.track.push(place);
    }
}

/// Gives the next of moments that come at equal steps; steps that would all be past are left out, so that a process
/// that was stopped for a while does not say everything at once.
fn next_of(at: Time, step: Duration, until: Time) -> Time {
    let steps = until.since(at).as_nanos() / step.as_nanos().max(1);
    let missed = u32::try_from(steps.saturating_sub(1)).unwrap_or(u32::MAX);
    at + step + step.saturating_mul(missed)
}
