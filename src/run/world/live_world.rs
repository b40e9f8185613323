//! The environment as the live world keeps it: whose software drives which vehicle, what is told to whom, and how it is
//! going. It reads no clock and knows no socket, so that it can be tested in any time.
//!
//! What bodies and devices do is the environment's matter ([`crate::sim::environment`]), and the same as in a simulation.

use tomoswarm_proto::codec::{self, Decoded};
use tomoswarm_proto::{Boot, Message, VehicleId};

use crate::geom::{Angle, Point};
use crate::run::link::{
    COLLISIONS_LIMIT, Contact, FromWorld, LinkRefusal, PLACES_LIMIT, ToWorld, VehicleStatus,
    Welcome, WorldStatus,
};
use crate::sim::environment::{DeviceCommand, Environment, WorldEvent};
use crate::sim::{Collision, Scenario, ScenarioError};
use crate::time::Time;

/// A place is written down when it is this far from the one before, metres.
const TRACK_STEP_M: f64 = 0.05;
/// A track of more places than this loses every other one.
const TRACK_LIMIT: usize = 50_000;

/// Something for one vehicle: its index, and what is said.
pub(super) type VehicleWord = (usize, FromWorld);

/// The environment with those who drive in it.
pub(super) struct LiveWorld {
    now: Time,
    environment: Environment,
    vehicles: Vec<DrivenVehicle>,
    /// What is counted here; the rest is filled in when it is asked for.
    status: WorldStatus,
}

/// Whose software drives a vehicle, and where that has been.
#[derive(Debug)]
struct DrivenVehicle {
    id: VehicleId,
    /// Whose words move it now.
    driver: Option<Boot>,
    /// The highest boot that ever did.
    highest: Option<Boot>,
    track: Vec<Point>,
}

impl LiveWorld {
    /// Makes the world of a scenario with everybody at home and nobody driving; those that start cold are just switched on.
    ///
    /// # Errors
    /// The scenario is impossible.
    pub(super) fn new(scenario: &Scenario, starts_cold: bool) -> Result<LiveWorld, ScenarioError> {
        let mut environment = match starts_cold {
            true => scenario.environment_from_cold()?,
            false => scenario.environment()?,
        };
        // A live world asks for the deadline.
        environment.begin(&mut Vec::new());
        let world = environment.world();
        let vehicle = |index: usize| DrivenVehicle {
            id: world.id(index),
            driver: None,
            highest: None,
            track: vec![world.truth(index, Time::ZERO).at],
        };
        let vehicles = (0..world.vehicles()).map(vehicle).collect();
        let persons = scenario.persons().iter().map(|person| person.at).collect();
        let status = WorldStatus {
            persons,
            ..WorldStatus::default()
        };
        Ok(LiveWorld {
            now: Time::ZERO,
            environment,
            vehicles,
            status,
        })
    }

    /// Returns the environment, for who flies vehicles by another way.
    pub(super) fn environment(&mut self) -> &mut Environment {
        &mut self.environment
    }

    /// Returns how many vehicles there are; their ids are 1 to this.
    pub(super) fn vehicles(&self) -> u8 {
        u8::try_from(self.vehicles.len()).unwrap_or(u8::MAX)
    }

    /// Returns how many things are to happen by themselves.
    #[cfg(test)]
    pub fn pending(&self) -> usize {
        self.environment.pending()
    }

    /// Returns when something happens by itself next.
    pub(super) fn next_at(&self) -> Time {
        self.environment
            .deadline()
            .map_or(Time::NEVER, |deadline| deadline.at)
    }

    /// Lets everything happen up to a moment, each at its own time.
    pub(super) fn advance(&mut self, now: Time, output: &mut Vec<VehicleWord>) {
        let mut happened = Vec::new();
        self.environment.wake(now, &mut happened);
        self.now = self.now.max(now);
        happened
            .into_iter()
            .for_each(|event| self.report(event, output));
    }

    /// Hands on what has happened, and writes down what is asked for later.
    fn report(&mut self, event: WorldEvent, output: &mut Vec<VehicleWord>) {
        match event {
            WorldEvent::Report { vehicle, report } => {
                output.push((vehicle, FromWorld::Autopilot(report)))
            }
            WorldEvent::Ack { vehicle, ack } => output.push((vehicle, FromWorld::Ack(ack))),
            WorldEvent::Echo { vehicle, echo } => output.push((vehicle, FromWorld::Echo(echo))),
            WorldEvent::Heard { frame, receivers } => {
                for (vehicle, rssi_dbm) in receivers {
                    output.push((
                        vehicle,
                        FromWorld::Heard {
                            frame: frame.to_vec(),
                            rssi_dbm,
                        },
                    ));
                }
            }
            WorldEvent::Unsent { vehicle, sequence } => {
                output.push((vehicle, FromWorld::Unsent(sequence)))
            }
            WorldEvent::Contact(collision) => self.write_down(&collision),
            WorldEvent::Track(states) => {
                let places = states.iter().map(|state| state.at);
                self.vehicles
                    .iter_mut()
                    .zip(places)
                    .for_each(|(vehicle, at)| vehicle.track(at));
            }
            WorldEvent::Scheduled(_) | WorldEvent::Charged { .. } => {}
        }
    }

    fn write_down(&mut self, collision: &Collision) {
        let Collision {
            at,
            vehicle,
            with,
            place,
        } = *collision;
        self.status.collision_count += 1;
        if self.status.collisions.len() < COLLISIONS_LIMIT {
            self.status.collisions.push(Contact {
                at_ns: at.as_nanos(),
                vehicle,
                with,
                place,
            });
        }
    }

    /// Lets the software of a vehicle drive it from now on; returns the vehicle's index and what it is told.
    ///
    /// # Errors
    /// There is no such vehicle, or a start of its software that is as high drives it already.
    pub(super) fn join(
        &mut self,
        vehicle: VehicleId,
        boot: Boot,
    ) -> Result<(usize, Welcome), LinkRefusal> {
        let unknown = LinkRefusal::Unknown {
            vehicle,
            count: self.vehicles(),
        };
        let index = self
            .vehicles
            .iter()
            .position(|known| known.id == vehicle)
            .ok_or(unknown)?;
        let known = &mut self.vehicles[index];
        if let Some(present) = known.driver.filter(|present| *present >= boot) {
            return Err(LinkRefusal::Taken {
                vehicle,
                present,
                found: boot,
            });
        }
        if let Some(present) = known.highest.filter(|present| *present > boot) {
            return Err(LinkRefusal::Outdated {
                vehicle,
                present,
                found: boot,
            });
        }
        (known.driver, known.highest) = (Some(boot), Some(boot));
        self.environment.attach(self.now, index);
        let start = self.environment.known(index, self.now).pose;
        Ok((
            index,
            Welcome {
                now_ns: self.now.as_nanos(),
                start: Some(start),
            },
        ))
    }

    /// Nobody drives a vehicle any more; its autopilot brakes after a while.
    pub(super) fn leave(&mut self, index: usize) {
        self.vehicles[index].driver = None;
        self.environment.detach(self.now, index);
    }

    /// Lets the devices of a vehicle do what its driver said.
    pub(super) fn obey(&mut self, index: usize, word: ToWorld, output: &mut Vec<VehicleWord>) {
        let Some(command) = command(word) else {
            self.status.dropped += 1;
            return;
        };
        let mut happened = Vec::new();
        self.environment
            .obey(self.now, index, command, &mut happened);
        happened
            .into_iter()
            .for_each(|event| self.report(event, output));
    }

    /// Lets the persons enter, unless they are in.
    pub(super) fn enter(&mut self) {
        self.environment
            .let_persons_enter(self.now, &mut Vec::new());
    }

    /// Returns how it is going.
    pub(super) fn status(&mut self) -> WorldStatus {
        let separation_m = self.environment.min_separation_m(self.now);
        let (world, counts) = (self.environment.world(), self.environment.counts());
        let vehicle = |(index, vehicle): (usize, &DrivenVehicle)| {
            let truth = world.truth(index, self.now);
            VehicleStatus {
                vehicle: vehicle.id,
                driver: vehicle.driver,
                at: truth.at,
                heading: truth.heading,
                speed_mps: truth.speed_mps,
                places: u32::try_from(vehicle.track.len()).unwrap_or(u32::MAX),
            }
        };
        WorldStatus {
            now_ns: self.now.as_nanos(),
            entered: self.environment.persons_are_in(),
            vehicles: self.vehicles.iter().enumerate().map(vehicle).collect(),
            fence_breaches: world.fence_breaches().len() as u64,
            min_separation_m: separation_m.is_finite().then_some(separation_m),
            scans: counts.scans,
            beacons_heard: counts.beacons_heard,
            collided_beacons: counts.collided_beacons,
            dropped: self.status.dropped + counts.dropped,
            ..self.status.clone()
        }
    }

    /// Returns a piece of a vehicle's track; empty behind its end and for a vehicle that is not there.
    pub(super) fn places(&self, vehicle: VehicleId, from: u32) -> Vec<Point> {
        let Some(known) = self.vehicles.iter().find(|known| known.id == vehicle) else {
            return Vec::new();
        };
        let from = usize::try_from(from).unwrap_or(usize::MAX);
        known
            .track
            .iter()
            .skip(from)
            .take(PLACES_LIMIT)
            .copied()
            .collect()
    }
}

/// Returns what a word wants a device to do; `None` when it is no word for a device, or cannot be understood.
fn command(word: ToWorld) -> Option<DeviceCommand> {
    match word {
        ToWorld::Autopilot(command) => Some(DeviceCommand::Autopilot(command)),
        // From outside an angle may be any number.
        ToWorld::Steer(beam) => Some(DeviceCommand::Steer(Angle::from_radians(beam.radians()))),
        ToWorld::Ping(ping) => Some(DeviceCommand::Ping(ping)),
        ToWorld::Transmit(frame) => match codec::decode(&frame) {
            Ok(Decoded::Message(Message::Beacon(beacon))) => Some(DeviceCommand::Transmit(beacon)),
            Ok(_) | Err(_) => None,
        },
        ToWorld::Join { .. }
        | ToWorld::Control { .. }
        | ToWorld::Enter
        | ToWorld::Report
        | ToWorld::Track { .. }
        | ToWorld::Stop => None,
    }
}

impl DrivenVehicle {
    fn track(&mut self, place: Point) {
        if self
            .track
            .last()
            .is_some_and(|last| last.distance_to(place) <= TRACK_STEP_M)
        {
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
