//! A simulated mission: its venue and scene, loaded, and every constant of vehicles, sensors, radio,
//! bus, sweep and imaging; and the checks that concern several of them together.

mod checks;
mod expectations;

use std::ops::RangeInclusive;
use std::time::Duration;

use tomoswarm_proto::{TaskKind, VehicleId};

pub(in crate::config) use self::checks::{
    check_border, check_gaps, check_task, floored, padding_at_fence_m, place_off_m,
    refuse_blind_speed, refuse_uncovered_radius, smallest_post,
};
use self::checks::{
    check_echoes, check_look_before_you_drive, check_margins, check_near_ground, check_places,
    check_wind,
};
use self::expectations::check_expected;
use super::fault::PlannedFault;
use super::forms::{LoadedFile, seconds};
use super::imaging::Imaging;
use super::keys::WordChoice;
use super::keys::{Flag, KeyEntry, Keyed, Keys, List, Number, Rowed, Whole, Words, read_table};
use super::mission::{
    AfterSweep, Durations, Expect, PlannerChoice, SweepConfig, SweepTable, check_sweep,
};
use super::radio::{Bus, BusTable, Radio, RadioTable};
use super::range::{Lobe, RangeSensor};
use super::scene::{SceneFile, Up};
use super::section::Section;
use super::swarm::Swarm;
use super::task::MissionTable;
use super::vehicle::{
    PARTY, SWARM, Safety, Vehicles, VehiclesTable, check_ceiling, contact_limits, sensing_limits,
};
use super::venue::Venue;
use super::{Loader, SimLines, beside, read_kind_over};
use crate::geom::Point;
use crate::plan::{ContactLimits, SensingLimits, SmallestPost};

/// The seeds that there are, in files and as options: whole numbers as TOML has them.
pub const SEEDS: RangeInclusive<u64> = 0..=i64::MAX as u64;
/// After how much virtual time a run may be given up, seconds.
pub const UNTIL_S: RangeInclusive<f64> = 1.0..=1e6;

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
    pub sweep: SweepConfig,
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
    /// Where homes and persons stand in the files, for what is judged later.
    pub lines: SimLines,
}

impl Sim {
    /// Returns how high above the ground range sensors are under way, metres.
    pub fn sensor_height_m(&self) -> f64 {
        self.vehicles.flight.way_altitude_m() + self.range.height_m
    }

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
    pub fn sensing_limits(&self) -> SensingLimits {
        let still = self.sensing_limits_in_still_air();
        still.carried(self.vehicles.flight.carried_m())
    }

    /// Returns the same without what wind adds to the margin.
    fn sensing_limits_in_still_air(&self) -> SensingLimits {
        let Sim {
            vehicles,
            range,
            safety,
            ..
        } = self;
        sensing_limits(
            &vehicles.body,
            &range.look,
            safety,
            self.venue.cell_m,
            vehicles.pose_sd_m,
        )
    }

    /// Returns what decides which posts a vehicle does not touch; `None` for a beam, which passes by what is thin.
    pub fn contact_limits(&self) -> Option<ContactLimits> {
        let body = &self.vehicles.body;
        let limits = contact_limits(
            body,
            &self.range.look,
            self.venue.cell_m,
            self.vehicles.pose_sd_m,
        );
        (self.range.lobe != Lobe::Beam).then_some(limits)
    }

    /// Returns the thinnest post that a vehicle does not touch; `None` when its sensor does not promise it of any.
    pub fn smallest_post(&self) -> Option<SmallestPost> {
        let named_m = self.range.look.smallest_radius_m;
        smallest_post(
            self.contact_limits()?,
            named_m,
            self.vehicles.body.max_speed_mps,
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
            sweep: SweepConfig::default(),
            empty_sweep: false,
            imaging: Imaging::default(),
            durations: Durations::default(),
            until_s: 0.0,
            end: AfterSweep::default(),
            expect: Expect::default(),
            faults: Vec::new(),
            seed: 0,
            lines: SimLines::default(),
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
        let mut lines = SimLines::default();
        let venue = load(root, "venue", loader, |root| {
            let venue = Venue::read(root);
            lines.homes = Venue::lines_of_homes(root);
            Some(venue)
        });
        let scene = load(root, "scene", loader, |root| {
            let scene = SceneFile::read(root);
            lines.persons = scene.lines_of_persons(root);
            lines.random_persons = root.source.line_of_key("random_persons");
            Some(scene)
        });
        let are_loaded = venue.is_some() && scene.is_some();
        let mut sim = Sim {
            lines,
            ..Sim::blank()
        };
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
        let flown = (&sim.vehicles.flight, &sim.vehicles.body);
        check_ceiling(root, "vehicles.altitude_m", flown, sim.venue.ceiling_m);
        check_places(root, &sim);
        check_wind(root, &sim);
        check_echoes(root, &sim);
        check_near_ground(root, &sim);
        if root.source.is_sound(&[
            "expect", "end", "mission", "fault", "bus", "until_s", "vehicles",
        ]) {
            check_expected(root, &sim);
        }
        Some(sim)
    }

    /// Returns how many vehicles there may be; only as many as the planners can keep apart follow plans.
    fn allowed(&self, swarm: &RangeInclusive<usize>) -> RangeInclusive<usize> {
        allowed_for(&self.mission, swarm)
    }

    /// Checks the keys of each table together, and fills in what depends on others.
    fn check_tables(&mut self, root: &Section<'_>) {
        let source = root.source;
        if source.is_sound(&["vehicles", "safety.padding_m", "range"]) {
            let body = &self.vehicles.body;
            self.range
                .bound_silence(source, body, self.safety.padding_m);
        }
        self.range.look.check(source);
        self.safety.check(source);
        self.bus.check(source);
        self.venue.swarm.check(source, "radio");
        let sweeping = self.vehicles.count.min(*SWARM.end());
        check_sweep(source, &self.sweep, sweeping, self.mission.planner());
        for (index, fault) in self.faults.iter_mut().enumerate() {
            fault.check(source, &format!("fault[{index}]"));
        }
        check_margins(root, self);
    }
}

/// Returns how many vehicles a mission may have. A pattern refuses any other number than two by itself, and says so.
fn allowed_for(mission: &MissionTable, swarm: &RangeInclusive<usize>) -> RangeInclusive<usize> {
    let is_pattern = mission.planner().is_some_and(PlannerChoice::is_pattern);
    if mission.is_planned_by_ground() && !is_pattern {
        swarm.clone()
    } else {
        PARTY
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
            lines: _,
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
        let allowed = allowed_for(mission, allowed);
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
        let means = "the run is given up after this much virtual time";
        to.number(
            until_s,
            Number {
                name: "until_s",
                default: 14_400.0,
                allowed: UNTIL_S,
                means,
            },
        );
        to.word(
            end,
            Words {
                name: "end",
                default: AfterSweep::Return.word(),
                means: "after the sweep or the missions; a `return` is given up when not all are home after 900 s",
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
        let allowed = *SEEDS.start() as usize..=*SEEDS.end() as usize;
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
