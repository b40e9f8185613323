//! A simulated mission: its venue and scene, loaded, and every constant of vehicles, sensors, radio,
//! bus, sweep and imaging; and the checks that concern several of them together.

use std::ops::RangeInclusive;
use std::time::Duration;

use tomoswarm_proto::{TaskKind, VehicleId};

use super::fault::PlannedFault;
use super::forms::LoadedFile;
use super::keys::WordChoice;
use super::keys::{Flag, KeyEntry, Keyed, Keys, List, Number, Rowed, Whole, Words, read_table};
use super::mission::{
    AfterSweep, Durations, Expect, Imaging, Planner, SMALLEST_GAP, Sweep, SweepTable, check_sweep,
};
use super::radio::{Bus, BusTable, Radio, RadioTable};
use super::range::RangeSensor;
use super::scene::{SceneFile, Up};
use super::section::Section;
use super::swarm::Swarm;
use super::task::MissionTable;
use super::vehicle::{
    PARTY, SWARM, Safety, Vehicles, VehiclesTable, check_ceiling, seconds, sight,
};
use super::venue::Venue;
use super::{Loader, beside, read_kind_over};
use crate::geom::{Point, Segment};
use crate::plan::{SensingLimits, SpeedError};

/// A simulation as its file describes it, checked; a run needs nothing else but a seed.
#[derive(Clone, PartialEq, Debug)]
pub struct Sim {
    /// The file of the place, with its folder.
    pub venue_file: String,
    /// The place, with what this simulation says of the swarm's contract laid over it.
    pub venue: Venue,
    /// The file of the world, with its folder.
    pub scene_file: String,
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
    /// What the vehicles are out for, as it is written.
    pub mission: MissionTable,
    /// What the vehicles are out for; `None` = they follow the plans of the ground station.
    pub task: Option<TaskKind>,
    /// How the sweep is driven.
    pub sweep: Sweep,
    /// Whether the same sweep is driven first without the persons.
    pub empty_sweep: bool,
    /// How images are made.
    pub imaging: Imaging,
    /// How long slow actors think.
    pub durations: Durations,
    /// When the run is given up, seconds of virtual time.
    pub until_s: f64,
    /// What vehicles do at the end.
    pub end: AfterSweep,
    /// What the run is to end with.
    pub expect: Expect,
    /// What goes wrong on the way.
    pub faults: Vec<PlannedFault>,
    /// The seed, unless the command line gives another.
    pub seed: u64,
}

impl Sim {
    /// Returns the ids of the vehicles, 1 to `count`.
    pub fn vehicle_ids(&self) -> impl Iterator<Item = VehicleId> + use<> {
        (1..=self.vehicles.count)
            .filter_map(|id| u8::try_from(id).ok())
            .map(VehicleId)
    }

    /// Returns the place where a vehicle starts; `None` for a vehicle that is not of this simulation.
    pub fn home(&self, vehicle: VehicleId) -> Option<Point> {
        let index = usize::from(vehicle.0)
            .checked_sub(1)
            .filter(|index| *index < self.vehicles.count)?;
        self.venue.homes.get(index).copied()
    }

    /// Returns what a vehicle surely sees and how it stops, the one rule for its speed.
    pub fn sight(&self) -> SensingLimits {
        let Sim {
            vehicles,
            range,
            safety,
            ..
        } = self;
        sight(
            &vehicles.body,
            &range.look,
            safety,
            self.venue.cell_m,
            vehicles.pose_sd_m,
        )
    }

    /// Returns whether the ground station plans what the vehicles are out for.
    pub fn is_planned_by_ground(&self) -> bool {
        self.task.is_none()
    }

    /// Returns when the run is given up, virtual time.
    pub fn until(&self) -> Duration {
        seconds(self.until_s)
    }

    /// Returns a simulation of nothing, to be filled.
    pub(super) fn blank() -> Sim {
        Sim {
            venue_file: String::new(),
            venue: Venue::blank(),
            scene_file: String::new(),
            scene: SceneFile::of_shapes(Up::Y),
            vehicles: Vehicles::default(),
            range: RangeSensor::default(),
            safety: Safety::default(),
            radio: Radio::default(),
            bus: Bus::default(),
            mission: MissionTable::default(),
            task: None,
            sweep: Sweep::default(),
            empty_sweep: false,
            imaging: Imaging::default(),
            durations: Durations::default(),
            until_s: 0.0,
            end: AfterSweep::default(),
            expect: Expect::default(),
            faults: Vec::new(),
            seed: 0,
        }
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
        let are_loaded = venue.is_some() && scene.is_some();
        let mut sim = Sim::blank();
        if let Some((file, venue)) = venue {
            (sim.venue_file, sim.venue) = (file, venue);
        }
        if let Some((file, scene)) = scene {
            (sim.scene_file, sim.scene) = (file, scene);
        }
        read_table(
            &mut SimTable {
                sim: &mut sim,
                allowed: &allowed,
                asked: vehicles,
            },
            root,
        );
        if let Some(count) = vehicles {
            root.replace_in("vehicles", "count", count, sim.allowed(&allowed));
        }
        sim.task = sim
            .mission
            .task(root.source, are_loaded.then_some(&sim.venue), loader);
        sim.check_tables(root);
        if !are_loaded {
            return None;
        }
        check_look_before_you_drive(root, &sim);
        check_ceiling(root, &sim.vehicles, sim.venue.ceiling_m);
        check_places(root, &sim);
        Some(sim)
    }

    /// Returns how many vehicles there may be; only as many as the planners can keep apart follow plans.
    fn allowed(&self, swarm: &RangeInclusive<usize>) -> RangeInclusive<usize> {
        if self.mission.is_planned_by_ground() {
            swarm.clone()
        } else {
            PARTY
        }
    }

    /// Checks the keys of each table together, and fills in what depends on others.
    fn check_tables(&mut self, root: &Section<'_>) {
        let source = root.source;
        self.range.look.check(source);
        self.safety.check(source);
        self.bus.check(source);
        let sweeping = self.vehicles.count.min(*SWARM.end());
        check_sweep(source, &self.sweep, sweeping, self.mission.planner());
        for (index, fault) in self.faults.iter_mut().enumerate() {
            fault.check(source, &format!("fault[{index}]"));
        }
        check_margins(root, self);
    }
}

/// A simulation's file; there may be as many vehicles as `allowed`, and the command line may have asked for another number
/// than the file says.
pub(super) struct SimTable<'a> {
    pub(super) sim: &'a mut Sim,
    pub(super) allowed: &'a RangeInclusive<usize>,
    pub(super) asked: Option<usize>,
}

impl Keyed for SimTable<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        let allowed = self.allowed;
        let Sim {
            venue_file,
            venue,
            scene_file,
            scene: _,
            vehicles,
            range,
            safety,
            radio,
            bus,
            mission,
            task: _,
            sweep,
            empty_sweep,
            imaging,
            durations,
            until_s,
            end,
            expect,
            faults,
            seed,
        } = &mut *self.sim;
        let table = |name, means| KeyEntry {
            name,
            left_out: "",
            means,
        };
        let file = |name, means| KeyEntry {
            name,
            left_out: "needed",
            means,
        };
        to.form(
            &mut LoadedFile(venue_file),
            file("venue", "file of the place"),
        );
        to.form(
            &mut LoadedFile(scene_file),
            file("scene", "file of the simulated world"),
        );
        to.table(
            mission,
            table(
                "mission",
                "what the vehicles are out for; also in a vehicle's file",
            ),
        );
        let allowed = if mission.is_planned_by_ground() {
            allowed.clone()
        } else {
            PARTY
        };
        let mut fleet = VehiclesTable {
            vehicles,
            allowed: allowed.clone(),
        };
        to.table(&mut fleet, table("vehicles", "the vehicles, all alike"));
        // A number that was refused is not reckoned with.
        vehicles.count = self
            .asked
            .filter(|count| allowed.contains(count))
            .unwrap_or(vehicles.count);
        let count = vehicles.count;
        to.table(range, table("range", "their range sensors"));
        let mut margins = SafetyTable {
            safety,
            swarm: &mut venue.swarm,
        };
        to.table(&mut margins, table("safety", "the margins that they keep"));
        let mut field = RadioTable {
            radio,
            swarm: &mut venue.swarm,
        };
        to.table(&mut field, table("radio", "the radio field"));
        let mut cut = BusTable {
            bus,
            vehicles: count,
        };
        to.table(
            &mut cut,
            table("bus", "the simulated bus between the nodes"),
        );
        let mut driven = SweepTable {
            sweep,
            mission: mission.planner(),
        };
        to.table(&mut driven, table("sweep", "how a sweep is driven"));
        let means = "begin with a sweep without the persons";
        to.flag(
            empty_sweep,
            Flag {
                name: "empty_sweep",
                default: false,
                means,
            },
        );
        to.table(imaging, table("imaging", "how images are made"));
        to.table(
            durations,
            table("durations", "virtual time that thinking takes"),
        );
        let means = "end after this much virtual time";
        to.number(
            until_s,
            Number {
                name: "until_s",
                default: 14_400.0,
                allowed: 1.0..=1e6,
                means,
            },
        );
        to.word(
            end,
            Words {
                name: "end",
                default: AfterSweep::Return.word(),
                means: "after the sweep",
            },
        );
        let means = "how the run is to end, without a collision: `finished` (all sweeps), `home` or `held` (every vehicle \
                     whose software runs)";
        to.word(
            expect,
            Words {
                name: "expect",
                default: Expect::Finished.word(),
                means,
            },
        );
        let keys = |fault: &mut PlannedFault, _, to: &mut dyn Keys| fault.keys(count, to);
        let means = "what goes wrong on the way";
        to.rows(
            &mut List { list: faults, keys },
            Rowed {
                name: "fault",
                most: 1000,
                means,
            },
        );
        let mut number = *seed as usize;
        let means = "of everything random; `--seed` replaces it";
        let allowed = 0..=i64::MAX as usize;
        to.whole(
            &mut number,
            Whole {
                name: "seed",
                default: 1,
                allowed,
                means,
            },
        );
        *seed = number as u64;
    }
}

/// The table `[safety]` of a simulation, which may say what its venue does.
struct SafetyTable<'a> {
    safety: &'a mut Safety,
    swarm: &'a mut Swarm,
}

impl Keyed for SafetyTable<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        self.safety.keys(to);
        self.swarm.margins(to);
    }
}

/// Loads a file that this one names, and returns its name with its folder; what is wrong with it is noted here too.
pub(super) fn load<T>(
    root: &Section,
    kind: &'static str,
    loader: &mut Loader,
    read: impl FnOnce(&Section) -> Option<T>,
) -> Option<(String, T)> {
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
        Ok(value) => Some((path, value)),
        Err(problems) => {
            root.source.absorb(problems);
            None
        }
    }
}

/// Refuses a speed at which a vehicle could not stop within what it surely sees.
fn check_look_before_you_drive(root: &Section, sim: &Sim) {
    if root.source.is_sound(&["vehicles", "range", "safety"]) {
        refuse_blind_speed(
            root,
            &sim.sight(),
            sim.vehicles.body.max_speed_mps,
            "vehicles.max_speed_mps",
        );
    }
}

/// Refuses a speed at which a vehicle could not stop within what it surely sees; `key` names the speed.
pub(super) fn refuse_blind_speed(root: &Section, sight: &SensingLimits, speed_mps: f64, key: &str) {
    let Err(error) = sight.allow(speed_mps) else {
        return;
    };
    let (key, allowed) = match error {
        SpeedError::NoRoom { .. } => (
            "range.sure_range_m",
            "see farther, or lower radius_m, padding_m, pose_sd_m or cell_m",
        ),
        SpeedError::TooFast { .. } | SpeedError::Value { .. } => (
            key,
            "lower max_speed_mps, brake harder, scan faster or with fewer beams, or see farther",
        ),
    };
    root.source.refuse(
        key,
        &format!("the vehicle cannot look before it drives: {error}"),
        allowed,
    );
}

fn check_margins(root: &Section<'_>, sim: &Sim) {
    let (fleet, swarm) = (&sim.vehicles, &sim.venue.swarm);
    let are_sound = root
        .source
        .is_sound(&["vehicles.radius_m", "safety.separation_m"]);
    if are_sound && swarm.separation_m <= 2.0 * fleet.body.radius_m {
        let wrong = "lets two vehicles touch: it is measured from middle to middle";
        root.source.refuse(
            "safety.separation_m",
            wrong,
            "more than two vehicles.radius_m is allowed",
        );
    }
    let are_sound = root
        .source
        .is_sound(&["vehicles.pose_sd_m", "safety.pose_sd_max_m"]);
    if are_sound && fleet.pose_sd_m > swarm.pose_sd_max_m {
        let wrong = "is above safety.pose_sd_max_m: nothing would ever be measured";
        root.source.refuse(
            "vehicles.pose_sd_m",
            wrong,
            "at most pose_sd_max_m is allowed",
        );
    }
}

/// Checks the venue and the scene against the vehicles.
fn check_places(root: &Section, sim: &Sim) {
    if root.source.is_sound(&["vehicles", "safety", "sweep"]) {
        check_homes(root, sim);
        if sim.is_planned_by_ground() {
            check_ring(root, sim);
        }
    }
    check_task(root, sim.task.as_ref(), &sim.venue);
    let Some(random) = sim.scene.random_persons else {
        return;
    };
    let inner = sim.venue.area.shrunk(random.keep_from_border_m);
    let room_m2 = inner.width_m() * inner.height_m();
    // Discs of half the distance cover at least this share of the room when no more fit (jamming).
    let taken_m2 =
        random.count as f64 * random.apart_m * random.apart_m * std::f64::consts::FRAC_PI_4;
    if random.count > 0
        && (inner.width_m() <= 0.0 || inner.height_m() <= 0.0 || taken_m2 > 0.5 * room_m2)
    {
        let wrong = format!(
            "{} random persons do not fit into the area of the venue",
            random.count
        );
        root.refuse(
            "scene",
            &wrong,
            "fewer persons or smaller distances are needed in [random_persons]",
        );
    }
}

fn check_homes(root: &Section, sim: &Sim) {
    let (count, homes) = (sim.vehicles.count, &sim.venue.homes);
    if homes.len() < count {
        let wrong = format!("the venue has {} homes for {count} vehicles", homes.len());
        root.source.refuse(
            "vehicles.count",
            &wrong,
            "at most one vehicle per home is allowed",
        );
        return;
    }
    let apart_m = sim.venue.swarm.separation_m;
    let reach_m = sim.vehicles.body.radius_m + sim.safety.padding_m;
    for (index, home) in homes.iter().take(count).enumerate() {
        if !sim.venue.fence.contains_disc(*home, reach_m) {
            let wrong = format!(
                "home {} is nearer than {reach_m:.2} m to the fence",
                index + 1
            );
            root.refuse(
                "venue",
                &wrong,
                "a vehicle and its padding must fit at home",
            );
        }
        check_nobody_at_home(root, sim, index + 1, *home);
        let is_near = |other: &&Point| other.distance_to(*home) < apart_m;
        if homes.iter().take(index).any(|other| is_near(&other)) {
            let wrong = format!(
                "home {} is nearer than {apart_m:.2} m to another",
                index + 1
            );
            root.refuse("venue", &wrong, "homes must be separation_m apart");
        }
    }
}

fn check_nobody_at_home(root: &Section, sim: &Sim, number: usize, home: Point) {
    let room_m = |radius_m: f64| sim.vehicles.body.radius_m + sim.safety.padding_m + radius_m;
    let is_there = |at: Point, radius_m: f64| at.distance_to(home) < room_m(radius_m);
    for person in sim
        .scene
        .persons
        .iter()
        .filter(|person| is_there(person.at, person.radius_m))
    {
        let wrong = format!(
            "{} stands in the way of vehicle {number} at its home",
            person.name
        );
        root.refuse("scene", &wrong, "vehicles and persons must stand apart");
    }
}

/// Refuses a mission that leads out of the fence.
pub(super) fn check_task(root: &Section, task: Option<&TaskKind>, venue: &Venue) {
    let places = task.map(TaskKind::places).unwrap_or_default();
    let mut places = places.into_iter().map(Point::from);
    let Some(outside) = places.find(|place| !venue.fence.contains(*place)) else {
        return;
    };
    let wrong = format!(
        "leads to ({}, {}), outside the fence of the venue",
        outside.x_m, outside.y_m
    );
    let key = ["mission.waypoints_m", "mission.size_m", "mission"];
    let key = key
        .into_iter()
        .find(|key| root.source.is_known(key))
        .unwrap_or("mission");
    root.source
        .refuse(key, &wrong, "places inside the fence are allowed");
}

fn check_ring(root: &Section, sim: &Sim) {
    check_border(
        root,
        &sim.venue,
        sim.vehicles.body.radius_m + sim.safety.padding_m,
    );
    check_gaps(
        root,
        &sim.venue,
        &sim.sweep,
        sim.vehicles.count,
        sim.venue.swarm.separation_m,
    );
}

/// Refuses a fence that leaves less room around the area than a vehicle needs.
pub(super) fn check_border(root: &Section, venue: &Venue, reach_m: f64) {
    let corners = venue.area.corners();
    let mut sides = corners.iter().zip(corners.iter().cycle().skip(1));
    if !sides.all(|(from, to)| {
        venue
            .fence
            .contains_corridor(Segment::new(*from, *to), reach_m)
    }) {
        let wrong = format!("its fence leaves less than {reach_m:.2} m around the area");
        root.refuse(
            "venue",
            &wrong,
            "vehicles drive along the area's border and need their radius and padding",
        );
    }
}

/// Refuses a ring on which the smallest gap between two vehicles is under their separation.
pub(super) fn check_gaps(
    root: &Section,
    venue: &Venue,
    sweep: &Sweep,
    vehicles: usize,
    apart_m: f64,
) {
    let around_m = 2.0 * (venue.area.width_m() + venue.area.height_m());
    let gap_m = around_m / sweep.positions as f64 * SMALLEST_GAP as f64;
    if sweep.planner == Planner::RotatingGap && vehicles > 1 && gap_m < apart_m {
        let wrong = format!(
            "puts {SMALLEST_GAP} steps into {gap_m:.2} m, under the separation of {apart_m:.2} m"
        );
        root.source.refuse(
            "sweep.positions",
            &wrong,
            "fewer positions or a larger area are needed",
        );
    }
}
