//! The simulated world: bodies that move, what their sensors and radios get, and the referee who sees
//! every contact. It knows no actor and no bus.
//!
//! The autopilot of a vehicle believes to be at its true place plus a slowly drifting error; it drives so that
//! its *believed* place follows the command ([`super::autopilot`]). The referee judges true places only; who flies over
//! another does not touch it.

mod build;
mod mishap;

use std::time::Duration;

use tomoswarm_proto::VehicleId;

pub(super) use self::build::{FlightConditions, VehicleBuild};
pub use self::mishap::{Collision, FenceBreach};
use super::air::Sent;
use super::autopilot::{Autopilot, DatedText, LowBattery, Navigation, Outage, Readout};
use super::body::BodyState;
use super::contact::{climb_contact, closest_approach, first_contact_of, overlaps};
use super::noise::Noise;
use super::radio_field::{RadioField, Transmission};
use super::range::{Disc, RangeSensor, SensorPose, SensorSurroundings};
use crate::autopilot::{
    ArmRefusal, AutopilotReport, Command, CommandAck, FlightState, Motion, VehicleKind,
};
use crate::geom::{Angle, Point, Polygon, Segment};
use crate::plan::Mounts;
use crate::scene::{Attenuation, Cuts, Scene};
use crate::time::Time;

/// What rounding may take of a distance, metres: a body that just touches the fence has not left it.
const ROUNDING_M: f64 = 1e-6;
/// Objects are touched by what a vehicle has above this height, metres: it drives on the ground.
pub(super) const GROUND_CLEARANCE_M: f64 = 0.02;

/// What stands in the world, and what it does to radio.
pub struct WorldContents {
    /// What stands there.
    pub scene: Scene,
    /// How it attenuates links at antenna height.
    pub attenuation: Attenuation,
}

/// Something that will happen unless the motion changes before.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PredictedContact {
    /// When.
    pub at: Time,
    /// Index of the vehicle, and the number of its command.
    pub one: (usize, u64),
    /// The same of the other vehicle; `None` = the scene.
    pub other: Option<(usize, u64)>,
}

impl PredictedContact {
    /// Returns whether a vehicle, by its index, takes part.
    pub fn concerns(&self, vehicle: usize) -> bool {
        self.one.0 == vehicle || self.other.is_some_and(|(peer, _)| peer == vehicle)
    }
}

/// What came of a command.
#[derive(Clone, PartialEq, Debug)]
pub struct CommandResult {
    /// The autopilot's answer.
    pub result: CommandAck,
    /// Why it does not arm, if that is what it was told.
    pub arm_refusal: Option<ArmRefusal>,
    /// The contacts that its motion leads to now.
    pub contacts: Vec<PredictedContact>,
}

struct Craft {
    id: VehicleId,
    autopilot: Autopilot,
    /// Counts the commands, and what else changes its motion.
    commands: u64,
    /// The autopilot's own count of that, when contacts were foreseen last.
    motions: u64,
}

/// Bodies in a scene.
pub struct World {
    stage: WorldContents,
    /// Cuts of the stage's scene.
    cuts: Cuts,
    build: VehicleBuild,
    fence: Polygon,
    crafts: Vec<Craft>,
    noise: Noise,
    field: RadioField,
    sensor: RangeSensor,
    mounts: Mounts,
    flying: FlightConditions,
    /// Vehicles are put into it switched on and disarmed, on the ground.
    starts_cold: bool,
    outages: Vec<(VehicleId, Outage)>,
    /// How fast the deviation of a place grows without satellites, m/s.
    growth_mps: f64,
    /// Contacts that follow from motion that nobody has commanded just now.
    foreseen: Vec<PredictedContact>,
    /// Up to when each pair's distance has been judged; index = one × vehicles + other.
    judged: Vec<Time>,
    min_separation_m: f64,
    collisions: Vec<Collision>,
    fence_breaches: Vec<FenceBreach>,
}

impl World {
    /// Makes a world without vehicles.
    pub fn new(
        stage: WorldContents,
        build: VehicleBuild,
        fence: Polygon,
        noise: Noise,
        field: RadioField,
        sensor: RangeSensor,
    ) -> World {
        World {
            stage,
            cuts: Cuts::default(),
            build,
            fence,
            crafts: Vec::new(),
            noise,
            field,
            sensor,
            mounts: Mounts::default(),
            flying: FlightConditions::default(),
            starts_cold: false,
            outages: Vec::new(),
            growth_mps: 0.0,
            foreseen: Vec::new(),
            judged: Vec::new(),
            min_separation_m: f64::INFINITY,
            collisions: Vec::new(),
            fence_breaches: Vec::new(),
        }
    }

    /// Returns every vehicle these range sensors, in place of a single one that looks anywhere at once.
    pub fn with_mounts(self, mounts: Mounts) -> World {
        World { mounts, ..self }
    }

    /// Returns whether its vehicles fly; those that are put into it from now on.
    pub fn with_flying(self, flying: FlightConditions) -> World {
        World { flying, ..self }
    }

    /// Lets vehicles that are put into it from now on stand on the ground, just switched on, disarmed, and with ArduPilot's own
    /// rules for idle motors and lost places: for who flies them over MAVLink.
    pub fn with_cold_start(self) -> World {
        World {
            starts_cold: true,
            ..self
        }
    }

    /// Returns when vehicles hear no satellites, and by how much the deviation of their place grows then, m/s; for those
    /// that are put into it from now on.
    pub fn with_outages(self, outages: Vec<(VehicleId, Outage)>, growth_mps: f64) -> World {
        World {
            outages,
            growth_mps,
            ..self
        }
    }

    /// Returns the range sensors of a vehicle.
    pub fn mounts(&self) -> &Mounts {
        &self.mounts
    }

    /// Puts a vehicle at rest into the world, armed; a copter hovers. (One that starts cold stands on the ground, disarmed.)
    ///
    /// # Errors
    /// The place or the figures of the drive are impossible.
    pub fn place(&mut self, id: VehicleId, at: Point, heading: Angle) -> Result<(), String> {
        let own = self
            .outages
            .iter()
            .filter(|(vehicle, _)| *vehicle == id)
            .map(|(_, outage)| *outage);
        let VehicleBuild {
            pose_sd_m,
            pose_drift,
            ..
        } = self.build;
        let navigation = Navigation::new(self.noise, u64::from(id.0), pose_sd_m, pose_drift)
            .with_outages(own.collect(), self.growth_mps);
        let autopilot = Autopilot::new(
            self.flying.autopilot(&self.build, self.starts_cold),
            navigation,
            at,
            heading,
        )
        .map_err(|refusal| refusal.to_string())?;
        let autopilot = match self.starts_cold {
            true => autopilot,
            false => autopilot.under_way(self.flying.altitude_m),
        };
        self.crafts.push(Craft {
            id,
            motions: autopilot.motion().changes(),
            autopilot,
            commands: 0,
        });
        self.judged = vec![Time::ZERO; self.crafts.len() * self.crafts.len()];
        Ok(())
    }

    /// Changes what stands in the world; returns the contacts that follow: at once of those whom something now stands upon,
    /// and those that motion under way leads to.
    pub fn set_stage(&mut self, stage: WorldContents, now: Time) -> Vec<PredictedContact> {
        self.stage = stage;
        self.cuts = Cuts::default();
        // The motion stays, but contacts foreseen with the old stage are void.
        self.crafts.iter_mut().for_each(|craft| craft.commands += 1);
        (0..self.crafts.len())
            .flat_map(|vehicle| match self.is_stood_upon(vehicle, now) {
                true => vec![PredictedContact {
                    at: now,
                    one: (vehicle, self.crafts[vehicle].commands),
                    other: None,
                }],
                false => self.touches(vehicle, now),
            })
            .collect()
    }

    /// Returns whether something of the scene stands where a vehicle is, whether this moves or not.
    fn is_stood_upon(&self, vehicle: usize, now: Time) -> bool {
        let autopilot = &self.crafts[vehicle].autopilot;
        let altitude_m = autopilot.motion().altitude_m(now);
        self.touches_at(autopilot.truth(now).at, altitude_m, altitude_m)
    }

    /// Returns whether a body at a place touches what stands, at altitudes from one to another.
    fn touches_at(&self, here: Point, low_m: f64, high_m: f64) -> bool {
        let (low_m, high_m) = (low_m + GROUND_CLEARANCE_M, high_m + self.build.height_m);
        let (spot, radius_m) = (Segment::new(here, here), self.build.radius_m);
        let contact = self
            .stage
            .scene
            .first_contact(spot, radius_m, low_m, high_m);
        contact.is_some()
    }

    /// Returns how many vehicles there are.
    pub fn vehicles(&self) -> usize {
        self.crafts.len()
    }

    /// Returns the id of a vehicle.
    pub fn id(&self, vehicle: usize) -> VehicleId {
        self.crafts[vehicle].id
    }

    /// Returns where a vehicle truly is.
    pub fn truth(&self, vehicle: usize, now: Time) -> BodyState {
        self.crafts[vehicle].autopilot.truth(now)
    }

    /// Returns all contacts so far.
    pub fn collisions(&self) -> &[Collision] {
        &self.collisions
    }

    /// Returns all commands so far that led a body over the fence.
    pub fn fence_breaches(&self) -> &[FenceBreach] {
        &self.fence_breaches
    }

    /// Returns what all vehicles are.
    pub fn kind(&self) -> VehicleKind {
        self.flying.kind
    }

    /// Returns all that the autopilot knows of itself at a moment.
    pub fn readout(&mut self, vehicle: usize, now: Time) -> Readout {
        self.advance(vehicle, now);
        self.crafts[vehicle].autopilot.report(now)
    }

    /// Returns what the autopilot has said since the last call, in order.
    pub fn status_texts(&mut self, vehicle: usize) -> Vec<DatedText> {
        self.crafts[vehicle].autopilot.status_texts()
    }

    /// Says what is to happen when the battery of a vehicle is low.
    pub fn set_low_battery(&mut self, vehicle: usize, action: LowBattery) {
        self.crafts[vehicle].autopilot.set_low_battery(action);
    }

    /// Returns what the autopilot says of itself at a moment.
    pub fn report(&mut self, vehicle: usize, now: Time) -> AutopilotReport {
        let readout = self.readout(vehicle, now);
        let autopilot = &self.crafts[vehicle].autopilot;
        let motion = match (readout.speed_mps > 0.0, autopilot.motion().is_at_rest(now)) {
            (true, _) => Motion::Driving,
            (false, true) => Motion::Resting,
            (false, false) => Motion::Turning,
        };
        AutopilotReport {
            pose: readout.pose,
            flight_state: FlightState {
                altitude_m: readout.altitude_m,
                climb_mps: readout.climb_mps,
                course: None,
                // What drives stands level.
                tilt: (autopilot.kind() == VehicleKind::Copter)
                    .then_some((readout.attitude.roll, readout.attitude.pitch)),
            },
            speed_mps: readout.speed_mps,
            battery: Some(readout.battery),
            motion,
            is_landed: readout.is_landed,
            mode: readout.mode,
            is_armed: readout.is_armed,
            status: readout.status,
            switch: None,
            stored: autopilot.stored_report(),
        }
    }

    /// Lets the autopilot go on by itself; contacts that its motion leads to are kept for [`World::foreseen`].
    fn advance(&mut self, vehicle: usize, now: Time) {
        let autopilot = &self.crafts[vehicle].autopilot;
        let (from, changes) = (
            autopilot.now(),
            autopilot.next_change().is_some_and(|at| at <= now),
        );
        if changes && autopilot.kind() == VehicleKind::Copter {
            self.judge(vehicle, now);
        }
        let craft = &mut self.crafts[vehicle];
        craft.autopilot.advance(now);
        if craft.motions != craft.autopilot.motion().changes() {
            craft.motions = craft.autopilot.motion().changes();
            craft.commands += 1;
            // What it does by itself has begun since it was looked at last.
            let touches = self.touches(vehicle, from);
            self.foreseen.extend(touches);
            self.judge_fence(vehicle, from);
        }
    }

    /// Returns the contacts that follow from what autopilots did by themselves, since the last call.
    pub fn foreseen(&mut self) -> Vec<PredictedContact> {
        std::mem::take(&mut self.foreseen)
    }

    /// Gives a battery a charge, 0 to 1.
    pub fn charge(&mut self, vehicle: usize, now: Time, charge: f64) {
        self.crafts[vehicle].autopilot.set_battery(now, charge);
    }

    /// Lets the autopilot obey; one that cannot goes on as it did.
    pub fn command(&mut self, vehicle: usize, now: Time, command: &Command) -> CommandResult {
        self.judge(vehicle, now);
        self.advance(vehicle, now);
        let craft = &mut self.crafts[vehicle];
        let arm_refusal = match command {
            Command::Arm { force } => craft.autopilot.arm_refusal(*force),
            _ => None,
        };
        let result = craft.autopilot.command(now, command.clone());
        craft.commands += 1;
        craft.motions = craft.autopilot.motion().changes();
        if result == CommandAck::Accepted {
            self.judge_fence(vehicle, now);
        }
        CommandResult {
            result,
            arm_refusal,
            contacts: self.touches(vehicle, now),
        }
    }

    fn judge_fence(&mut self, vehicle: usize, now: Time) {
        let body = self.crafts[vehicle].autopilot.motion().body();
        let swept = body.swept(now, Time::NEVER);
        let radius_m = self.build.radius_m - ROUNDING_M;
        let inside = |way: &Segment| self.fence.contains_corridor(*way, radius_m);
        if let Some(outside) = swept.iter().find(|piece| !inside(&piece.segment)) {
            self.fence_breaches.push(FenceBreach {
                at: now,
                vehicle: self.crafts[vehicle].id,
                place: outside.segment.to,
            });
        }
    }

    /// Returns the contacts that the present motion of a vehicle leads to.
    pub fn touches(&self, vehicle: usize, now: Time) -> Vec<PredictedContact> {
        let craft = &self.crafts[vehicle];
        let one = (vehicle, craft.commands);
        let scene = self
            .scene_contact(&craft.autopilot, now)
            .map(|at| PredictedContact {
                at,
                one,
                other: None,
            });
        let others = self
            .crafts
            .iter()
            .enumerate()
            .filter(|(index, _)| *index != vehicle);
        let pairs = others.filter_map(|(index, peer)| {
            let at = self.pair_contact(&craft.autopilot, &peer.autopilot, now)?;
            Some(PredictedContact {
                at,
                one,
                other: Some((index, peer.commands)),
            })
        });
        scene.into_iter().chain(pairs).collect()
    }

    /// When a body first touches what stands: in the plane at its altitude, or while it climbs on the spot.
    fn scene_contact(&self, autopilot: &Autopilot, now: Time) -> Option<Time> {
        let (radius_m, height_m) = (self.build.radius_m, self.build.height_m);
        let scene = &self.stage.scene;
        let climb = autopilot.motion().climb();
        if climb.until() > now {
            let here = autopilot.truth(now).at;
            let touches = |low_m: f64, high_m: f64| self.touches_at(here, low_m, high_m);
            return climb_contact(climb, now, &touches);
        }
        let altitude_m = autopilot.motion().altitude_m(now);
        let (low_m, high_m) = (altitude_m + GROUND_CLEARANCE_M, altitude_m + height_m);
        let cast = |way: Segment| scene.first_contact(way, radius_m, low_m, high_m);
        autopilot
            .motion()
            .body()
            .contact_time(now, Time::NEVER, &cast)
    }

    fn pair_contact(&self, one: &Autopilot, other: &Autopilot, now: Time) -> Option<Time> {
        let (radius_m, height_m) = (self.build.radius_m, self.build.height_m);
        let near = |(from, until)| {
            first_contact_of(
                one.motion().body(),
                other.motion().body(),
                from,
                until,
                2.0 * radius_m,
            )
        };
        overlaps(one.motion().climb(), other.motion().climb(), now, height_m)
            .into_iter()
            .find_map(near)
    }

    /// Lets a foreseen contact happen, unless a newer command has prevented it.
    pub fn touch(&mut self, touch: &PredictedContact) -> Option<Collision> {
        let current = |(vehicle, command): (usize, u64)| self.crafts[vehicle].commands == command;
        if !current(touch.one) || !touch.other.is_none_or(current) {
            return None;
        }
        let involved: Vec<usize> = [Some(touch.one), touch.other]
            .into_iter()
            .flatten()
            .map(|(index, _)| index)
            .collect();
        for vehicle in &involved {
            self.judge(*vehicle, touch.at);
            let craft = &mut self.crafts[*vehicle];
            craft.autopilot.wreck(touch.at);
            craft.motions = craft.autopilot.motion().changes();
            craft.commands += 1;
        }
        let place = self.truth(touch.one.0, touch.at).at;
        let with = touch.other.map(|(index, _)| self.crafts[index].id);
        let collision = Collision {
            at: touch.at,
            vehicle: self.crafts[touch.one.0].id,
            with,
            place,
        };
        self.collisions.push(collision.clone());
        Some(collision)
    }

    /// Judges the distances of a vehicle to all others since they were judged last.
    fn judge(&mut self, vehicle: usize, now: Time) {
        for other in (0..self.crafts.len()).filter(|other| *other != vehicle) {
            let pair = vehicle.min(other) * self.crafts.len() + vehicle.max(other);
            let (one, two) = (
                self.crafts[vehicle].autopilot.motion().body(),
                self.crafts[other].autopilot.motion().body(),
            );
            let (distance_m, _) = closest_approach(one, two, self.judged[pair], now);
            self.min_separation_m = self.min_separation_m.min(distance_m);
            self.judged[pair] = now;
        }
    }

    /// Returns the smallest distance between the middles of two vehicles so far, metres; infinite for one alone.
    pub fn min_separation_m(&mut self, now: Time) -> f64 {
        for vehicle in 0..self.crafts.len() {
            self.judge(vehicle, now);
        }
        self.min_separation_m
    }

    /// Returns what the range sensor reads when it looks along a beam (relative to the heading).
    pub fn range_m(&mut self, vehicle: usize, now: Time, beam: Angle, number: u64) -> Option<f64> {
        let craft = &self.crafts[vehicle];
        let truth = craft.autopilot.truth(now);
        let others = self
            .crafts
            .iter()
            .enumerate()
            .filter(|(index, _)| *index != vehicle);
        let discs: Vec<Disc> = others
            .map(|(_, peer)| self.disc(&peer.autopilot, now))
            .collect();
        let above_ground_m = craft.autopilot.motion().altitude_m(now) + self.build.sensor_m;
        let origin = [truth.at.x_m, truth.at.y_m, above_ground_m];
        let ids = [u64::from(craft.id.0), number];
        let cut = self.cuts.at(&self.stage.scene, above_ground_m);
        let around = SensorSurroundings {
            scene: &self.stage.scene,
            cut: &cut,
            discs: &discs,
        };
        let eye = SensorPose {
            origin,
            attitude: craft.autopilot.attitude(now),
            beam,
        };
        self.sensor.echo_at(&eye, around, &self.noise, &ids)
    }

    /// A vehicle as range sensors see it; at least as high as its own sensor.
    fn disc(&self, autopilot: &Autopilot, now: Time) -> Disc {
        let VehicleBuild {
            radius_m,
            height_m,
            sensor_m,
            ..
        } = self.build;
        let low_m = autopilot.motion().altitude_m(now);
        Disc {
            centre: autopilot.truth(now).at,
            radius_m,
            low_m,
            high_m: low_m + height_m.max(sensor_m),
        }
    }

    /// Returns what the range sensor reads, and after which time.
    pub fn echo(
        &mut self,
        vehicle: usize,
        now: Time,
        beam: Angle,
        number: u64,
    ) -> (Option<f64>, Duration) {
        let range_m = self.range_m(vehicle, now, beam, number);
        (range_m, self.sensor.takes(range_m))
    }

    /// Returns how strongly a beacon is heard, dBm; `None` when it is lost. Packet noise depends on the beacon
    /// and the receiver alone.
    pub fn received_dbm(&self, sent: &Sent, to: usize, now: Time) -> Option<i16> {
        let receiver = &self.crafts[to];
        let (from, to) = (sent.place, receiver.autopilot.truth(now).at);
        let attenuation_db = self.stage.attenuation.between(from, to);
        let [sender, boot, sequence] = sent.key;
        let ids = [sender, boot, sequence, u64::from(receiver.id.0)];
        let (channel, power_dbm) = (sent.channel, sent.power_dbm);
        self.field.received(
            &Transmission {
                from,
                to,
                channel,
                power_dbm,
            },
            attenuation_db,
            ids,
        )
    }
}

#[cfg(test)]
pub(super) mod tests;
