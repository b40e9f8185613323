//! From a checked simulation file, its shapes and a seed to a run, and from the run to its outcome.

mod error;
mod runs;
mod walks;

pub use error::ScenarioError;
pub use runs::RunError;

use std::time::Duration;

use tomoswarm_proto::{Boot, Hello, Lease, Sender, VehicleId};

use super::body::DriveLimits;
use super::bus::{BusModel, SimulatedBus};
use super::environment::{Environment, TRACK_EVERY};
use super::faults::Faults;
use super::kernel::{FinishedRun, Greetings, Kernel, Parts, SimulatedOperator, SimulatedVehicle};
use super::noise::{Noise, NoisePurpose};
use super::operator_script::{self, EMPTY_RUN, RUN};
use super::outcome::RunOutcome;
use super::place_results;
use super::radio_field::{RadioConstants, RadioField};
use super::range::{Lobe, RangeModel, RangeSensor};
use super::run_monitor::RunMonitor;
use super::staging;
use super::unmet::unmet;
use super::world::{FlightConditions, GROUND_CLEARANCE_M, VehicleBuild, World, WorldContents};
use crate::autopilot::VehicleKind;
use crate::config::{self, Craft, Drivers, PlannedFault, PlannedPartition, Sim, SourceFile};
use crate::exchange::software::RELEASE;
use crate::geom::Point;
use crate::ground::from_config::{self, GroundParts};
use crate::ground::imager::Subject;
use crate::ground::planner::Method;
use crate::node::VehicleSettings as NodeSettings;
use crate::operator::script::ScriptStep;
use crate::scene::{Attenuation, Outline, Person, Scene, SceneError, VrmlShape};
use crate::sweep::Ring;
use crate::time::Time;
use crate::tomo::ImagingSettings as ImageSettings;

/// Tries to place a person before the scene is held to be too full.
const PLACING_TRIES: u64 = 10_000;

/// A simulation with a seed, ready to be run.
pub struct Scenario {
    sim: Sim,
    shapes: Vec<VrmlShape>,
    noise: Noise,
    persons: Vec<Person>,
    ring: Ring,
    /// Events of one moment come in an order drawn by the seed, to find what depends on it.
    pub shuffle_ties: bool,
    /// The first contact of a body ends the run; otherwise those that have touched stay where they are, and the others go
    /// on. Either way the run has failed.
    pub ends_at_contact: bool,
    /// How often a run shows itself to who watches it, virtual time; once a second by itself.
    pub shown_every: Duration,
    /// All samples are part of the outcome.
    pub keeps_samples: bool,
    /// The files that it was read from, for who reports of it.
    pub made_from: Vec<SourceFile>,
}

impl Scenario {
    /// Checks what the files alone could not tell, and places the persons by the seed.
    ///
    /// # Errors
    /// [`ScenarioError`].
    pub fn new(sim: Sim, shapes: Vec<VrmlShape>, seed: u64) -> Result<Scenario, ScenarioError> {
        let noise = Noise::new(seed);
        let ring = Ring::new(sim.venue.area, sim.sweep.positions)?;
        let (persons, shown_every) = (Vec::new(), TRACK_EVERY);
        let mut scenario = Scenario {
            sim,
            shapes,
            noise,
            persons,
            ring,
            shuffle_ties: false,
            ends_at_contact: true,
            shown_every,
            keeps_samples: false,
            made_from: Vec::new(),
        };
        let structure = scenario.scene(&[])?;
        scenario.persons = scenario.place_persons(&structure)?;
        scenario.check_walks(&structure)?;
        scenario.check_starts(&structure)?;
        Ok(scenario)
    }

    /// Returns the simulation that is run.
    pub fn sim(&self) -> &Sim {
        &self.sim
    }

    /// Returns who stands in the scene.
    pub fn persons(&self) -> &[Person] {
        &self.persons
    }

    /// Returns what stands in the scene at antenna height, without the persons.
    ///
    /// # Errors
    /// The scene cannot be built.
    pub fn outlines(&self) -> Result<Vec<Outline>, ScenarioError> {
        Ok(self.scene(&[])?.outlines(self.antenna_m()))
    }

    /// Returns what stands in the scene, with the persons.
    ///
    /// # Errors
    /// The scene cannot be built.
    pub fn populated(&self) -> Result<Scene, ScenarioError> {
        Ok(self.scene(&self.persons)?)
    }

    /// Returns the scene with those persons who are where they are all the time: nobody walks, and nobody enters after an
    /// empty sweep.
    ///
    /// # Errors
    /// The scene cannot be built.
    pub fn lasting(&self) -> Result<Scene, ScenarioError> {
        let stays = |person: &&Person| !self.sim.empty_sweep && person.path.is_empty();
        let persons: Vec<Person> = self.persons.iter().filter(stays).cloned().collect();
        Ok(self.scene(&persons)?)
    }

    /// Returns what the operator of this scenario does.
    pub fn operator_steps(&self) -> Vec<ScriptStep> {
        operator_script::steps(&self.sim)
    }

    /// Returns the positions that are measured from.
    pub fn ring(&self) -> &Ring {
        &self.ring
    }

    /// Returns the planner of the sweep.
    pub fn method(&self) -> Method {
        from_config::method(&self.sim.sweep)
    }

    /// Returns how high above the ground vehicles send and hear, metres.
    fn antenna_m(&self) -> f64 {
        let vehicles = &self.sim.vehicles;
        match vehicles.flight.craft {
            Craft::Rover => vehicles.body.antenna_height_m,
            Craft::Copter => vehicles.flight.altitude_m,
        }
    }

    fn scene(&self, persons: &[Person]) -> Result<Scene, SceneError> {
        staging::build(&self.sim.scene, &self.shapes, persons)
    }

    fn stage(&self, persons: &[Person]) -> Result<WorldContents, SceneError> {
        let scene = self.scene(persons)?;
        let radio = &self.sim.radio;
        let attenuation = Attenuation::new(
            &scene,
            self.antenna_m(),
            radio.wavelength_m(),
            radio.object_limit_db,
        );
        Ok(WorldContents { scene, attenuation })
    }

    fn place_persons(&self, structure: &Scene) -> Result<Vec<Person>, ScenarioError> {
        let file = &self.sim.scene;
        let mut persons: Vec<Person> = file.persons.iter().map(staging::person).collect();
        let Some(rules) = &file.random_persons else {
            return Ok(persons);
        };
        let room = self.sim.venue.area.shrunk(rules.keep_from_border_m);
        let vehicle_m = self.sim.vehicles.body.radius_m + self.sim.safety.padding_m;
        let homes = || self.sim.venue.homes.iter().take(self.sim.vehicles.count);
        let is_off_homes = |place: Point| {
            homes().all(|home| home.distance_to(place) >= vehicle_m + rules.radius_m)
        };
        for number in 1..=rules.count {
            let place = (0..PLACING_TRIES)
                .map(|attempt| self.draw_place(room, number, attempt))
                .find(|place| {
                    let clear_m = structure.clearance_m(*place, GROUND_CLEARANCE_M, rules.height_m);
                    clear_m >= rules.keep_from_objects_m
                        && is_off_homes(*place)
                        && persons
                            .iter()
                            .all(|other| other.at.distance_to(*place) >= rules.apart_m)
                });
            let Some(at) = place else {
                return Err(ScenarioError::NoRoom {
                    line: self.sim.lines.random_persons.clone(),
                    number,
                    count: rules.count,
                });
            };
            let (radius_m, height_m, db_per_m) = (rules.radius_m, rules.height_m, rules.db_per_m);
            persons.push(Person {
                name: format!("person {number}"),
                at,
                path: Vec::new(),
                radius_m,
                height_m,
                db_per_m,
            });
        }
        Ok(persons)
    }

    fn draw_place(&self, room: crate::geom::Rect, number: usize, attempt: u64) -> Point {
        let draw = |axis: u64| {
            self.noise
                .uniform(NoisePurpose::Placement, &[number as u64, attempt, axis])
        };
        Point::new(
            room.min.x_m + draw(0) * room.width_m(),
            room.min.y_m + draw(1) * room.height_m(),
        )
    }

    fn check_starts(&self, structure: &Scene) -> Result<(), ScenarioError> {
        let vehicles = &self.sim.vehicles;
        for (index, vehicle) in self.sim.vehicle_ids().enumerate() {
            let Some(home) = self.sim.home(vehicle) else {
                continue;
            };
            let low_m = vehicles.flight.way_altitude_m();
            let (low_m, high_m) = (low_m + GROUND_CLEARANCE_M, low_m + vehicles.body.height_m);
            let clearance_m = structure.clearance_m(home, low_m, high_m);
            let (radius_m, carried_m) = (vehicles.body.radius_m, vehicles.flight.carried_m());
            if clearance_m <= radius_m + carried_m {
                return Err(ScenarioError::StartsInside {
                    line: self.sim.lines.homes.get(index).cloned(),
                    vehicle,
                    clearance_m,
                    radius_m,
                    carried_m,
                });
            }
        }
        Ok(())
    }

    fn operator(&self) -> SimulatedOperator {
        let (id, holder) = (
            operator_script::SCENARIO_OPERATOR,
            self.noise.hash(NoisePurpose::Start, &[u64::MAX - 2]),
        );
        let settings = operator_script::settings(&self.sim, id, holder);
        SimulatedOperator::new(id, settings, self.operator_steps())
    }

    fn monitor(&self) -> RunMonitor {
        let ids: Vec<VehicleId> = self.sim.vehicle_ids().collect();
        let places = place_results::places_of(self.sim.task.as_ref(), &ids);
        RunMonitor::new(self.sim.is_planned_by_ground(), self.sim.expect, &ids).with_places(places)
    }

    pub(super) fn parts(&self) -> Result<Parts, ScenarioError> {
        let (sim, noise) = (&self.sim, self.noise);
        let environment = self.environment()?;
        let start = |vehicle| Some((vehicle, sim.home(vehicle)?));
        let told = |(vehicle, home)| NodeSettings::from_config(sim, vehicle, Boot(1), home);
        let vehicles = sim.vehicle_ids().filter_map(start).map(told);
        Ok(Parts {
            noise,
            environment,
            bus: SimulatedBus::new(noise, self.bus()),
            greetings: self.greetings(),
            egress_bytes_per_s: sim.bus.egress_bytes_per_s(),
            vehicles: vehicles.map(SimulatedVehicle::new).collect(),
            faults: faults(sim),
            ground: self.ground()?,
            operators: vec![self.operator()],
            monitor: self.monitor(),
            until: Time::ZERO + sim.until(),
            shuffle_ties: self.shuffle_ties,
            ends_at_contact: self.ends_at_contact,
            shown_every: self.shown_every,
            keeps_samples: self.keeps_samples,
        })
    }

    /// Returns how vehicles and ground station greet; who is started says with which boot and instance.
    fn greetings(&self) -> Greetings {
        let vehicles = self.sim.vehicle_ids().map(|id| {
            let capabilities = Drivers::SIMULATED.capabilities(self.sim.vehicles.flight.craft);
            Hello {
                capabilities,
                ..self.greeting(Sender::Vehicle(id))
            }
        });
        Greetings {
            vehicles: vehicles.collect(),
            ground: self.greeting(Sender::Ground),
        }
    }

    fn greeting(&self, node: Sender) -> Hello {
        Hello {
            software: RELEASE.to_owned(),
            ..Hello::asking(node, Boot(1), self.sim.venue.hash(), 0)
        }
    }

    /// Makes the environment as a run begins, with all vehicles at home; where a sweep comes first, the persons wait
    /// outside.
    ///
    /// # Errors
    /// The scene cannot be built, or a vehicle cannot be put into it.
    pub fn environment(&self) -> Result<Environment, ScenarioError> {
        self.environment_with(false)
    }

    /// Makes the same with all vehicles just switched on, disarmed: for who flies them over MAVLink.
    ///
    /// # Errors
    /// The same.
    #[cfg(feature = "mavlink")]
    pub fn environment_from_cold(&self) -> Result<Environment, ScenarioError> {
        self.environment_with(true)
    }

    fn environment_with(&self, starts_cold: bool) -> Result<Environment, ScenarioError> {
        let (world, entered) = self.world(starts_cold)?;
        let (faults, ties) = (faults(&self.sim), self.shuffle_ties.then_some(self.noise));
        let environment = Environment::new(world, self.noise, faults, ties);
        Ok(environment
            .with_persons_outside(entered)
            .with_walking(self.walking()))
    }

    fn world(&self, starts_cold: bool) -> Result<(World, Option<WorldContents>), ScenarioError> {
        let (sim, noise) = (&self.sim, self.noise);
        let populated = self.stage(&self.persons)?;
        let (first, second) = if sim.empty_sweep {
            (self.stage(&[])?, Some(populated))
        } else {
            (populated, None)
        };
        let mut world = World::new(
            first,
            self.build(),
            sim.venue.fence.clone(),
            noise,
            RadioField::new(noise, radio_constants(&sim.radio)),
            RangeSensor::new(self.range()),
        )
        .with_mounts(sim.range.look.mounts())
        .with_flying(self.flying())
        .with_outages(faults(sim).outages(), sim.vehicles.gps_growth_mps);
        if starts_cold {
            world = world.with_cold_start();
        }
        for vehicle in sim.vehicle_ids() {
            let Some(home) = sim.home(vehicle) else {
                continue;
            };
            let heading = home.angle_to(sim.venue.area.centre());
            world
                .place(vehicle, home, heading)
                .map_err(|reason| ScenarioError::Body { vehicle, reason })?;
        }
        Ok((world, second))
    }

    fn flying(&self) -> FlightConditions {
        let flight = &self.sim.vehicles.flight;
        let kind = match flight.craft {
            Craft::Rover => VehicleKind::Rover,
            Craft::Copter => VehicleKind::Copter,
        };
        let (altitude_m, climb_mps) = (flight.altitude_m, flight.climb_mps);
        FlightConditions {
            kind,
            altitude_m,
            climb_mps,
            wind: flight.wind(self.sim.venue.x_axis_bearing()),
        }
    }

    fn build(&self) -> VehicleBuild {
        let vehicles = &self.sim.vehicles;
        VehicleBuild {
            radius_m: vehicles.body.radius_m,
            height_m: vehicles.body.height_m,
            sensor_m: self.sim.range.height_m,
            limits: DriveLimits {
                speed_mps: vehicles.body.max_speed_mps,
                acceleration_mps2: vehicles.body.acceleration_mps2,
                braking_mps2: vehicles.body.braking_mps2,
                turn_rate_radps: vehicles.body.turn_rate_rad_per_s(),
            },
            pose_sd_m: vehicles.pose_sd_m,
            pose_drift: Duration::from_secs_f64(vehicles.pose_correlation_s),
            endurance_driving: vehicles.endurance_driving(),
            endurance_resting: vehicles.endurance_resting(),
        }
    }

    fn range(&self) -> RangeModel {
        let range = &self.sim.range;
        RangeModel {
            half_angle_rad: range.look.half_angle_rad(),
            min_m: range.look.min_range_m,
            max_m: range.look.max_range_m,
            incidence_max_rad: range.incidence_limit_rad(),
            posts: range.look.post_detection(range.look.max_range_m),
            sd_m: range.noise_sd_m,
            lobe: match range.lobe {
                config::Lobe::Beam => Lobe::Beam,
                config::Lobe::Fan => Lobe::Fan,
                config::Lobe::Cone => Lobe::Cone,
            },
            glitch_share: range.glitch_share,
            ..RangeModel::default()
        }
    }

    fn bus(&self) -> BusModel {
        let bus = &self.sim.bus;
        let faults = faults(&self.sim);
        BusModel {
            delay: bus.delay(),
            jitter: bus.jitter(),
            drop_share: bus.drop_share,
            duplicate_share: bus.duplicate_share,
            partitions: bus
                .partitions
                .iter()
                .map(PlannedPartition::partition)
                .chain(faults.partitions())
                .collect(),
        }
    }

    fn ground(&self) -> Result<GroundParts, ScenarioError> {
        let draw = |id: u64| self.noise.hash(NoisePurpose::Start, &[id]);
        let lease = Lease {
            number: 1,
            holder: draw(u64::MAX),
        };
        Ok(from_config::simulated_ground(
            &self.sim,
            self.ring.clone(),
            lease,
            draw(u64::MAX - 1),
        )?)
    }

    /// Returns how an image is made of a subject.
    pub fn image(&self, subject: Subject) -> ImageSettings {
        from_config::image_settings(
            &self.sim.imaging,
            self.sim.venue.area,
            self.sim.radio.reception.sensitivity_dbm,
            subject,
        )
    }

    pub(super) fn outcome(&self, kernel: Kernel) -> Result<RunOutcome, ScenarioError> {
        let FinishedRun {
            mut record,
            fleet,
            monitor,
            environment,
            ground,
            map,
            bus,
            ended_at,
            is_time_up,
            min_separation_m,
        } = kernel.finish();
        let station = ground.node().station();
        let (links, empty_links) = station.samples().links_against(RUN, EMPTY_RUN);
        let outlines = self.outlines()?;
        let unmet = unmet(&self.sim, fleet, &monitor, is_time_up);
        let finished = unmet.is_none() && record.failure.is_none();
        let failure = record.failure.or(unmet);
        let silences = monitor.sweeps().silences(ended_at, ground.heard());
        let mut not_made = Vec::new();
        let mut take = |subject| RunOutcome::take(&mut record.pictures, subject, &mut not_made);
        let (change, structure) = (take(Subject::Change), take(Subject::Structure));
        Ok(RunOutcome {
            finished,
            failure,
            home: fleet.home,
            held: fleet.held,
            simulated: ended_at,
            collisions: environment.world().collisions().to_vec(),
            fence_breaches: environment.world().fence_breaches().len(),
            breaches: environment.world().fence_breaches().to_vec(),
            min_separation_m: min_separation_m.is_finite().then_some(min_separation_m),
            samples: station.samples().count(RUN),
            measured: self.keeps_samples.then(|| ground.samples()),
            silences,
            links,
            empty_links,
            change,
            structure,
            not_made,
            map,
            tracks: record.tracks,
            missions: match self.sim.is_planned_by_ground() {
                true => Vec::new(),
                false => monitor.missions().to_vec(),
            },
            places: monitor.places().to_vec(),
            persons: self.persons.clone(),
            ways: self.ways(ended_at),
            outlines,
            counts: record.counts,
            bus_bytes: bus.sent_by_kind().clone(),
            log: record.log.into_text(),
        })
    }
}

/// Returns the faults of a simulation.
fn faults(sim: &Sim) -> Faults {
    Faults::new(sim.faults.iter().map(PlannedFault::fault).collect())
}

fn radio_constants(radio: &config::Radio) -> RadioConstants {
    RadioConstants {
        p0_dbm: radio.p0_dbm,
        exponent: radio.exponent,
        wavelength_m: radio.wavelength_m(),
        rician_k: radio.rician_k,
        packet_sd_db: radio.packet_sd_db,
        device_sd_db: radio.device_sd_db,
        sensitivity_dbm: radio.reception.sensitivity_dbm,
        slope_db: radio.sensitivity_slope_db,
    }
}

#[cfg(test)]
mod tests {
    use super::super::radio_field::Transmission;
    use super::*;
    use crate::config::bundled;

    /// The mean strength at 1 m without fading, for a power in the file.
    fn strength_dbm(power_dbm: i8) -> f64 {
        let text = format!(
            "kind = \"sim\"\nvenue = \"courtyard.venue.toml\"\nscene = \"../scenes/courtyard.scene.toml\"\n\
             [radio]\np0_dbm = -40\nrician_k = 1e6\npower_dbm = {power_dbm}\n"
        );
        let sim = config::read_sim("configs/a.toml", &text, None, &mut |path| {
            bundled::load(path)
        })
        .unwrap();
        let field = RadioField::new(Noise::new(1), radio_constants(&sim.radio));
        let (channel, power_dbm) = (sim.venue.swarm.channel(), sim.radio.own.power_dbm);
        let packet = Transmission {
            from: Point::new(0.0, 0.0),
            to: Point::new(1.0, 0.0),
            channel,
            power_dbm,
        };
        field.mean_dbm(&packet, 0.0)
    }

    #[test]
    fn more_power_is_heard_more_strongly() {
        assert!((strength_dbm(0) + 40.0).abs() < 0.1);
        assert!((strength_dbm(10) + 30.0).abs() < 0.1);
        assert!((strength_dbm(-20) + 60.0).abs() < 0.1);
    }
}
