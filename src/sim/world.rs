//! The simulated world: bodies that move, what their sensors and radios get, and the referee who sees
//! every contact. It knows no actor and no bus.
//!
//! The autopilot of a vehicle believes to be at its true place plus a slowly drifting error; it drives so that
//! its *believed* place follows the command. The referee judges true places only.

use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::air::Sent;
use super::body::{Body, BodyState, Limits};
use super::contact::{closest_approach, first_contact_of};
use super::noise::{Noise, Purpose};
use super::radio_field::{RadioField, Transmission};
use super::range::{Disc, RangeSensor, Surroundings};
use crate::geom::{Angle, Point, Polygon, Pose, Segment, Vector};
use crate::node::vehicle::{Fly, Motion, Telemetry};
use crate::scene::{Attenuation, Scene};
use crate::time::Time;

/// Objects are touched by what a vehicle has above this height, metres: it drives on the ground.
pub(super) const GROUND_CLEARANCE_M: f64 = 0.02;

/// What stands in the world, and what it does to radio.
pub struct Stage {
    /// What stands there.
    pub scene: Scene,
    /// How it attenuates links at antenna height.
    pub attenuation: Attenuation,
}

/// Figures of the world's vehicles, all alike.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Build {
    /// Radius of the body, metres.
    pub radius_m: f64,
    /// Height of the body, metres.
    pub height_m: f64,
    /// Height of the range sensor, metres.
    pub sensor_m: f64,
    /// What the drive can do.
    pub limits: Limits,
    /// Standard deviation of each believed coordinate, metres.
    pub pose_sd_m: f64,
    /// Time over which the error of the believed place drifts.
    pub pose_drift: Duration,
    /// How long a full battery lasts while driving.
    pub endurance_driving: Duration,
    /// How long a full battery lasts at rest.
    pub endurance_resting: Duration,
}

/// A contact, as the referee writes it down.
#[derive(Clone, PartialEq, Debug)]
pub struct Collision {
    /// When.
    pub at: Time,
    /// Who.
    pub vehicle: VehicleId,
    /// With which other vehicle; `None` = with the scene.
    pub with: Option<VehicleId>,
    /// Where the vehicle's middle was.
    pub place: Point,
}

impl Collision {
    /// Says who touched what, when and where.
    pub fn in_words(&self) -> String {
        let with = self.with.map_or("the scene".to_owned(), |peer| format!("vehicle {peer}"));
        let (after_s, at) = (self.at.as_secs_f64(), self.place);
        format!(
            "vehicle {} touched {with} after {after_s:.0} s at {:.2}, {:.2} m",
            self.vehicle, at.x_m, at.y_m
        )
    }
}

/// Something that will happen unless the motion changes before.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Touch {
    /// When.
    pub at: Time,
    /// Index of the vehicle, and the number of its command.
    pub one: (usize, u64),
    /// The same of the other vehicle; `None` = the scene.
    pub other: Option<(usize, u64)>,
}

struct Rover {
    id: VehicleId,
    body: Body,
    commands: u64,
    is_disarmed: bool,
    /// Charge left when it was reckoned last, 0 to 1.
    charge: f64,
    charge_at: Time,
}

/// Bodies in a scene.
pub struct World {
    stage: Stage,
    build: Build,
    fence: Polygon,
    rovers: Vec<Rover>,
    noise: Noise,
    field: RadioField,
    sensor: RangeSensor,
    /// Up to when each pair's distance has been judged; index = one × rovers + other.
    judged: Vec<Time>,
    min_separation_m: f64,
    collisions: Vec<Collision>,
    fence_breaches: usize,
}

impl World {
    /// Makes a world without vehicles.
    pub fn new(
        stage: Stage,
        build: Build,
        fence: Polygon,
        noise: Noise,
        field: RadioField,
        sensor: RangeSensor,
    ) -> World {
        World {
            stage,
            build,
            fence,
            rovers: Vec::new(),
            noise,
            field,
            sensor,
            judged: Vec::new(),
            min_separation_m: f64::INFINITY,
            collisions: Vec::new(),
            fence_breaches: 0,
        }
    }

    /// Puts a vehicle at rest into the world.
    ///
    /// # Errors
    /// The place or the figures of the drive are impossible.
    pub fn place(&mut self, id: VehicleId, at: Point, heading: Angle) -> Result<(), String> {
        let body = Body::at_rest(at, heading, self.build.limits).map_err(|refusal| refusal.to_string())?;
        self.rovers.push(Rover {
            id,
            body,
            commands: 0,
            is_disarmed: false,
            charge: 1.0,
            charge_at: Time::ZERO,
        });
        self.judged = vec![Time::ZERO; self.rovers.len() * self.rovers.len()];
        Ok(())
    }

    /// Changes what stands in the world; gives the contacts that motion under way now leads to.
    pub fn set_stage(&mut self, stage: Stage, now: Time) -> Vec<Touch> {
        self.stage = stage;
        // The motion stays, but contacts foreseen with the old stage are void.
        self.rovers.iter_mut().for_each(|rover| rover.commands += 1);
        (0..self.rovers.len()).flat_map(|vehicle| self.touches(vehicle, now)).collect()
    }

    /// Gives how many vehicles there are.
    pub fn vehicles(&self) -> usize {
        self.rovers.len()
    }

    /// Gives the id of a vehicle.
    pub fn id(&self, vehicle: usize) -> VehicleId {
        self.rovers[vehicle].id
    }

    /// Gives where a vehicle truly is.
    pub fn truth(&self, vehicle: usize, now: Time) -> BodyState {
        self.rovers[vehicle].body.pose_at(now)
    }

    /// Gives all contacts so far.
    pub fn collisions(&self) -> &[Collision] {
        &self.collisions
    }

    /// Gives how many commands led a body over the fence.
    pub fn fence_breaches(&self) -> usize {
        self.fence_breaches
    }

    /// Gives the error of the believed place at a moment.
    fn pose_error(&self, id: VehicleId, now: Time) -> Vector {
        let drift = |purpose| {
            let smooth = self.noise.smooth(purpose, &[u64::from(id.0)], now, self.build.pose_drift);
            // A receiver's filter does not believe outliers: the error ends at three deviations.
            self.build.pose_sd_m * smooth.clamp(-3.0, 3.0)
        };
        Vector::new(drift(Purpose::PoseX), drift(Purpose::PoseY))
    }

    /// Gives what the autopilot reports.
    pub fn telemetry(&mut self, vehicle: usize, now: Time) -> Telemetry {
        self.drain(vehicle, now);
        let rover = &self.rovers[vehicle];
        let truth = rover.body.pose_at(now);
        let motion = match (truth.speed_mps > 0.0, rover.body.is_done(now)) {
            (true, _) => Motion::Driving,
            (false, true) => Motion::Resting,
            (false, false) => Motion::Turning,
        };
        let at = truth.at + self.pose_error(rover.id, now);
        let pose = Pose { at, heading: truth.heading, sd_m: self.build.pose_sd_m };
        Telemetry {
            pose,
            speed_mps: truth.speed_mps,
            battery: rover.charge,
            motion,
            is_armed: !rover.is_disarmed,
        }
    }

    /// Takes from the battery what was used since it was reckoned last, by how the body moves now.
    fn drain(&mut self, vehicle: usize, now: Time) {
        let rover = &mut self.rovers[vehicle];
        let moves = !rover.body.is_done(now);
        let lasts = if moves { self.build.endurance_driving } else { self.build.endurance_resting };
        let used = now.since(rover.charge_at).as_secs_f64() / lasts.as_secs_f64();
        rover.charge = (rover.charge - used).max(0.0);
        rover.charge_at = now;
    }

    /// Gives a battery a charge, 0 to 1.
    pub fn charge(&mut self, vehicle: usize, now: Time, charge: f64) {
        let rover = &mut self.rovers[vehicle];
        (rover.charge, rover.charge_at) = (charge, now);
    }

    /// Lets the autopilot obey; gives the contacts that the new motion leads to.
    pub fn fly(&mut self, vehicle: usize, now: Time, fly: &Fly) -> Vec<Touch> {
        self.judge(vehicle, now);
        let error = self.pose_error(self.rovers[vehicle].id, now);
        let rover = &mut self.rovers[vehicle];
        rover.commands += 1;
        let obeyed = match fly {
            Fly::Drive { .. } | Fly::Turn(_) if rover.is_disarmed => {
                rover.body.stop(now);
                Ok(())
            }
            Fly::Arm => {
                rover.is_disarmed = false;
                Ok(())
            }
            // Motors without current brake.
            Fly::Disarm => {
                rover.is_disarmed = true;
                rover.body.stop(now);
                Ok(())
            }
            Fly::Drive { corners, speed_mps } => {
                let truly: Vec<Point> = corners.iter().map(|corner| *corner - error).collect();
                rover.body.drive(now, &truly, *speed_mps)
            }
            Fly::Turn(heading) => rover.body.turn(now, *heading),
            Fly::Stop => {
                rover.body.stop(now);
                Ok(())
            }
        };
        // An impossible command leaves the motion as it was, as an autopilot would.
        if obeyed.is_err() {
            return self.touches(vehicle, now);
        }
        self.judge_fence(vehicle, now);
        self.touches(vehicle, now)
    }

    fn judge_fence(&mut self, vehicle: usize, now: Time) {
        let body = &self.rovers[vehicle].body;
        let swept = body.swept(now, Time::NEVER);
        let inside = |way: &Segment| self.fence.contains_corridor(*way, self.build.radius_m);
        if !swept.iter().all(|piece| inside(&piece.segment)) {
            self.fence_breaches += 1;
        }
    }

    /// Gives the contacts that the present motion of a vehicle leads to.
    pub fn touches(&self, vehicle: usize, now: Time) -> Vec<Touch> {
        let rover = &self.rovers[vehicle];
        let one = (vehicle, rover.commands);
        let (radius_m, height_m) = (self.build.radius_m, self.build.height_m);
        let cast = |way: Segment| self.stage.scene.first_contact(way, radius_m, GROUND_CLEARANCE_M, height_m);
        let mut touches = Vec::new();
        if let Some(at) = rover.body.contact_time(now, Time::NEVER, &cast) {
            touches.push(Touch { at, one, other: None });
        }
        for (index, peer) in self.rovers.iter().enumerate().filter(|(index, _)| *index != vehicle) {
            if let Some(at) = first_contact_of(&rover.body, &peer.body, now, Time::NEVER, 2.0 * radius_m) {
                touches.push(Touch { at, one, other: Some((index, peer.commands)) });
            }
        }
        touches
    }

    /// Lets a foreseen contact happen, unless a newer command has prevented it.
    pub fn touch(&mut self, touch: &Touch) -> Option<Collision> {
        let current = |(vehicle, command): (usize, u64)| self.rovers[vehicle].commands == command;
        if !current(touch.one) || !touch.other.is_none_or(current) {
            return None;
        }
        let involved: Vec<usize> =
            [Some(touch.one), touch.other].into_iter().flatten().map(|(index, _)| index).collect();
        for vehicle in &involved {
            self.judge(*vehicle, touch.at);
            self.rovers[*vehicle].body.halt(touch.at);
            self.rovers[*vehicle].commands += 1;
        }
        let place = self.truth(touch.one.0, touch.at).at;
        let with = touch.other.map(|(index, _)| self.rovers[index].id);
        let collision = Collision { at: touch.at, vehicle: self.rovers[touch.one.0].id, with, place };
        self.collisions.push(collision.clone());
        Some(collision)
    }

    /// Judges the distances of a vehicle to all others since they were judged last.
    fn judge(&mut self, vehicle: usize, now: Time) {
        for other in (0..self.rovers.len()).filter(|other| *other != vehicle) {
            let pair = vehicle.min(other) * self.rovers.len() + vehicle.max(other);
            let (one, two) = (&self.rovers[vehicle].body, &self.rovers[other].body);
            let (distance_m, _) = closest_approach(one, two, self.judged[pair], now);
            self.min_separation_m = self.min_separation_m.min(distance_m);
            self.judged[pair] = now;
        }
    }

    /// Gives the smallest distance between the middles of two vehicles so far, metres; infinite for one alone.
    pub fn min_separation_m(&mut self, now: Time) -> f64 {
        for vehicle in 0..self.rovers.len() {
            self.judge(vehicle, now);
        }
        self.min_separation_m
    }

    /// Gives what the range sensor reads when it looks along a beam (relative to the heading).
    pub fn range_m(&self, vehicle: usize, now: Time, beam: Angle, number: u64) -> Option<f64> {
        let rover = &self.rovers[vehicle];
        let truth = rover.body.pose_at(now);
        let others = self.rovers.iter().enumerate().filter(|(index, _)| *index != vehicle);
        let discs: Vec<Disc> = others
            .map(|(_, peer)| Disc { centre: peer.body.pose_at(now).at, radius_m: self.build.radius_m })
            .collect();
        let cast = |origin, direction, max_m| {
            let hit = self.stage.scene.cast(origin, direction, max_m)?;
            Some((hit.distance_m, hit.normal))
        };
        let origin = [truth.at.x_m, truth.at.y_m, self.build.sensor_m];
        let ids = [u64::from(rover.id.0), number];
        let around = Surroundings { cast: &cast, discs: &discs };
        self.sensor.echo(origin, truth.heading + beam, around, &self.noise, &ids)
    }

    /// Gives what the range sensor reads, and after which time.
    pub fn echo(&self, vehicle: usize, now: Time, beam: Angle, number: u64) -> (Option<f64>, Duration) {
        let range_m = self.range_m(vehicle, now, beam, number);
        (range_m, self.sensor.takes(range_m))
    }

    /// Gives how strongly a beacon is heard, dBm; `None` when it is lost. Packet noise depends on the beacon
    /// and the receiver alone.
    pub fn received_dbm(&self, sent: &Sent, to: usize, now: Time) -> Option<i16> {
        let receiver = &self.rovers[to];
        let (from, to) = (sent.place, receiver.body.pose_at(now).at);
        let attenuation_db = self.stage.attenuation.between(from, to);
        let [sender, boot, sequence] = sent.key;
        let ids = [sender, boot, sequence, u64::from(receiver.id.0)];
        let (channel, power_dbm) = (sent.channel, sent.power_dbm);
        self.field.received(&Transmission { from, to, channel, power_dbm }, attenuation_db, &ids)
    }
}
