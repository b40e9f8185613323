//! A simulated mission: its venue and scene, loaded, and every constant of vehicles, sensors, radio,
//! bus, sweep and imaging; and the checks that concern several of them together.

use std::ops::RangeInclusive;
use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::fault::Fault;
use super::mission::{Durations, End, Expect, Imaging, Planner, SMALLEST_GAP, Sweep};
use super::radio::{Bus, Radio};
use super::scene::SceneFile;
use super::section::Section;
use super::task::Task;
use super::vehicle::{PARTY, RangeSensor, SWARM, Safety, Vehicles, check_ceiling, sight};
use super::venue::Venue;
use super::{Loader, beside, read_kind_over};
use crate::geom::{Point, Segment};
use crate::plan::{Sight, SpeedError};

/// A simulation as its file describes it, checked; a run needs nothing else but a seed.
#[derive(Clone, PartialEq, Debug)]
pub struct Sim {
    /// The place.
    pub venue: Venue,
    /// The world.
    pub scene: SceneFile,
    /// The vehicles.
    pub vehicles: Vehicles,
    /// Their range sensor.
    pub range: RangeSensor,
    /// The margins that they keep.
    pub safety: Safety,
    /// The radio field.
    pub radio: Radio,
    /// The bus.
    pub bus: Bus,
    /// What the vehicles are out for.
    pub task: Task,
    /// How the sweep is driven.
    pub sweep: Sweep,
    /// Whether the same sweep is driven first without the persons.
    pub empty_sweep: bool,
    /// How images are made.
    pub imaging: Imaging,
    /// How long slow actors think.
    pub durations: Durations,
    /// When the run is given up, virtual time.
    pub until: Duration,
    /// What vehicles do at the end.
    pub end: End,
    /// What the run is to end with.
    pub expect: Expect,
    /// What goes wrong on the way.
    pub faults: Vec<Fault>,
    /// The seed, unless the command line gives another.
    pub seed: u64,
}

impl Sim {
    /// Gives the ids of the vehicles, 1 to `count`.
    pub fn vehicle_ids(&self) -> impl Iterator<Item = VehicleId> + use<> {
        (1..=self.vehicles.count).filter_map(|id| u8::try_from(id).ok()).map(VehicleId)
    }

    /// Gives the place where a vehicle starts; `None` for a vehicle that is not of this simulation.
    pub fn home(&self, vehicle: VehicleId) -> Option<Point> {
        let index = usize::from(vehicle.0).checked_sub(1).filter(|index| *index < self.vehicles.count)?;
        self.venue.homes.get(index).copied()
    }

    /// Gives what a vehicle surely sees and how it stops, the one rule for its speed.
    pub fn sight(&self) -> Sight {
        let Sim { vehicles, range, safety, .. } = self;
        sight(&vehicles.body(), &range.look(), safety, self.venue.cell_m, vehicles.pose_sd_m)
    }

    /// Reads a simulation and the files that it names; `vehicles` replaces the number of vehicles, of which there may
    /// be as many as `allowed`. Of a sweep only as many as can sweep take part.
    pub(super) fn read(
        root: &Section,
        vehicles: Option<usize>,
        allowed: RangeInclusive<usize>,
        loader: &mut Loader,
    ) -> Option<Sim> {
        let venue = load(root, "venue", loader, |root| Some(Venue::read(root)));
        let scene = load(root, "scene", loader, |root| Some(SceneFile::read(root)));
        let (task, planner) = Task::read(&root.section("mission"), venue.as_ref(), loader);
        let allowed = if task.is_planned_by_ground() { allowed } else { PARTY };
        let fleet = Vehicles::read(&root.section("vehicles"), vehicles, allowed);
        let count = fleet.count;
        let ends = [("hold", End::Hold), ("return", End::Return)];
        let (range, safety) =
            (RangeSensor::read(&root.section("range")), Safety::read(&root.section("safety")));
        let (radio, bus) = (Radio::read(&root.section("radio")), Bus::read(&root.section("bus"), count));
        let sweep = Sweep::read(&root.section("sweep"), count.min(*SWARM.end()), planner);
        let empty_sweep = root.flag("empty_sweep", false);
        let imaging = Imaging::read(&root.section("imaging"));
        let durations = Durations::read(&root.section("durations"));
        let until = root.duration("until_s", 14_400.0, 1.0..=1e6);
        let end = root.choice("end", End::Return, &ends);
        let expectations = [("finished", Expect::Finished), ("home", Expect::Home), ("held", Expect::Held)];
        let expect = root.choice("expect", Expect::Finished, &expectations);
        let faults = root.sections("fault", 1000).iter().map(|fault| Fault::read(fault, count)).collect();
        let seed = root.whole("seed", 1, 0..=i64::MAX as usize) as u64;
        root.finish();
        check_margins(root, &fleet, &safety);
        let (venue, scene) = (venue?, scene?);
        let vehicles = fleet;
        let sim = Sim {
            venue,
            scene,
            vehicles,
            range,
            safety,
            radio,
            bus,
            task,
            sweep,
            empty_sweep,
            imaging,
            durations,
            until,
            end,
            expect,
            faults,
            seed,
        };
        check_look_before_you_drive(root, &sim);
        check_ceiling(root, &sim.vehicles, sim.venue.ceiling_m);
        check_places(root, &sim);
        Some(sim)
    }
}

/// Loads a file that this one names; what is wrong with it is noted here too.
pub(super) fn load<T>(
    root: &Section,
    kind: &'static str,
    loader: &mut Loader,
    read: impl FnOnce(&Section) -> Option<T>,
) -> Option<T> {
    let needed = format!("the name of a {kind} file is needed, relative to this file");
    root.require(kind, &needed);
    let named = root.text(kind)?;
    let path = beside(&root.source.file_of(kind), &named);
    let text = match loader(&path) {
        Ok(text) => text,
        Err(reason) => {
            root.refuse(kind, &format!("{path} cannot be read: {reason}"), &needed);
            return None;
        }
    };
    match read_kind_over(&path, &text, root.source.overlay(), kind, read) {
        Ok(value) => Some(value),
        Err(problems) => {
            root.source.absorb(problems);
            None
        }
    }
}

/// Refuses a speed at which a vehicle could not stop within what it surely sees.
fn check_look_before_you_drive(root: &Section, sim: &Sim) {
    if root.source.is_sound(&["vehicles", "range", "safety"]) {
        refuse_blind_speed(root, &sim.sight(), sim.vehicles.max_speed_mps, "vehicles.max_speed_mps");
    }
}

/// Refuses a speed at which a vehicle could not stop within what it surely sees; `key` names the speed.
pub(super) fn refuse_blind_speed(root: &Section, sight: &Sight, speed_mps: f64, key: &str) {
    let Err(error) = sight.allow(speed_mps) else { return };
    let (key, allowed) = match error {
        SpeedError::NoRoom { .. } => {
            ("range.sure_range_m", "see farther, or lower radius_m, padding_m, pose_sd_m or cell_m")
        }
        SpeedError::TooFast { .. } | SpeedError::Value { .. } => {
            (key, "lower max_speed_mps, brake harder, scan faster or with fewer beams, or see farther")
        }
    };
    root.source.refuse(key, &format!("the vehicle cannot look before it drives: {error}"), allowed);
}

fn check_margins(root: &Section, fleet: &Vehicles, safety: &Safety) {
    let are_sound = root.source.is_sound(&["vehicles.radius_m", "safety.separation_m"]);
    if are_sound && safety.separation_m <= 2.0 * fleet.radius_m {
        let wrong = "lets two vehicles touch: it is measured from middle to middle";
        root.source.refuse("safety.separation_m", wrong, "more than two vehicles.radius_m is allowed");
    }
    let are_sound = root.source.is_sound(&["vehicles.pose_sd_m", "safety.pose_sd_max_m"]);
    if are_sound && fleet.pose_sd_m > safety.pose_sd_max_m {
        let wrong = "is above safety.pose_sd_max_m: nothing would ever be measured";
        root.source.refuse("vehicles.pose_sd_m", wrong, "at most pose_sd_max_m is allowed");
    }
}

/// Checks the venue and the scene against the vehicles.
fn check_places(root: &Section, sim: &Sim) {
    if root.source.is_sound(&["vehicles", "safety", "sweep"]) {
        check_homes(root, sim);
        if sim.task.is_planned_by_ground() {
            check_ring(root, sim);
        }
    }
    check_task(root, &sim.task, &sim.venue);
    let Some(random) = sim.scene.random_persons else { return };
    let inner = sim.venue.area.shrunk(random.keep_from_border_m);
    let room_m2 = inner.width_m() * inner.height_m();
    // Discs of half the distance cover at least this share of the room when no more fit (jamming).
    let taken_m2 = random.count as f64 * random.apart_m * random.apart_m * std::f64::consts::FRAC_PI_4;
    if random.count > 0 && (inner.width_m() <= 0.0 || inner.height_m() <= 0.0 || taken_m2 > 0.5 * room_m2) {
        let wrong = format!("{} random persons do not fit into the area of the venue", random.count);
        root.refuse("scene", &wrong, "fewer persons or smaller distances are needed in [random_persons]");
    }
}

fn check_homes(root: &Section, sim: &Sim) {
    let (count, homes) = (sim.vehicles.count, &sim.venue.homes);
    if homes.len() < count {
        let wrong = format!("the venue has {} homes for {count} vehicles", homes.len());
        root.source.refuse("vehicles.count", &wrong, "at most one vehicle per home is allowed");
        return;
    }
    let apart_m = sim.safety.separation_m;
    let reach_m = sim.vehicles.radius_m + sim.safety.padding_m;
    for (index, home) in homes.iter().take(count).enumerate() {
        if !sim.venue.fence.contains_disc(*home, reach_m) {
            let wrong = format!("home {} is nearer than {reach_m:.2} m to the fence", index + 1);
            root.refuse("venue", &wrong, "a vehicle and its padding must fit at home");
        }
        check_nobody_at_home(root, sim, index + 1, *home);
        let is_near = |other: &&Point| other.distance_to(*home) < apart_m;
        if homes.iter().take(index).any(|other| is_near(&other)) {
            let wrong = format!("home {} is nearer than {apart_m:.2} m to another", index + 1);
            root.refuse("venue", &wrong, "homes must be separation_m apart");
        }
    }
}

fn check_nobody_at_home(root: &Section, sim: &Sim, number: usize, home: Point) {
    let room_m = |radius_m: f64| sim.vehicles.radius_m + sim.safety.padding_m + radius_m;
    let is_there = |at: Point, radius_m: f64| at.distance_to(home) < room_m(radius_m);
    for person in sim.scene.persons.iter().filter(|person| is_there(person.at, person.radius_m)) {
        let wrong = format!("{} stands in the way of vehicle {number} at its home", person.name);
        root.refuse("scene", &wrong, "vehicles and persons must stand apart");
    }
}

/// Refuses a mission that leads out of the fence.
pub(super) fn check_task(root: &Section, task: &Task, venue: &Venue) {
    let Some(outside) = task.places().iter().find(|place| !venue.fence.contains(**place)) else { return };
    let wrong = format!("leads to ({}, {}), outside the fence of the venue", outside.x_m, outside.y_m);
    let key = ["mission.waypoints_m", "mission.size_m", "mission"];
    let key = key.into_iter().find(|key| root.source.is_known(key)).unwrap_or("mission");
    root.source.refuse(key, &wrong, "places inside the fence are allowed");
}

fn check_ring(root: &Section, sim: &Sim) {
    check_border(root, &sim.venue, sim.vehicles.radius_m + sim.safety.padding_m);
    check_gaps(root, &sim.venue, &sim.sweep, sim.vehicles.count, sim.safety.separation_m);
}

/// Refuses a fence that leaves less room around the area than a vehicle needs.
pub(super) fn check_border(root: &Section, venue: &Venue, reach_m: f64) {
    let corners = venue.area.corners();
    let mut sides = corners.iter().zip(corners.iter().cycle().skip(1));
    if !sides.all(|(from, to)| venue.fence.contains_corridor(Segment::new(*from, *to), reach_m)) {
        let wrong = format!("its fence leaves less than {reach_m:.2} m around the area");
        root.refuse(
            "venue",
            &wrong,
            "vehicles drive along the area's border and need their radius and padding",
        );
    }
}

/// Refuses a ring on which the smallest gap between two vehicles is under their separation.
pub(super) fn check_gaps(root: &Section, venue: &Venue, sweep: &Sweep, vehicles: usize, apart_m: f64) {
    let around_m = 2.0 * (venue.area.width_m() + venue.area.height_m());
    let gap_m = around_m / sweep.positions as f64 * SMALLEST_GAP as f64;
    if sweep.planner == Planner::RotatingGap && vehicles > 1 && gap_m < apart_m {
        let wrong =
            format!("puts {SMALLEST_GAP} steps into {gap_m:.2} m, under the separation of {apart_m:.2} m");
        root.source.refuse("sweep.positions", &wrong, "fewer positions or a larger area are needed");
    }
}
