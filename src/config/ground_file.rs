//! The files of the ground station's node and of an operator's commands. Opens nothing of what they name but the venue.

use tomoswarm_proto::{OperatorId, RunId, VehicleId};

use super::Loader;
use super::bus_file::{BusFile, BusFileTable, Role};
use super::forms::{LoadedFile, Text};
use super::imaging::{GroundImaging, Imaging};
use super::keys::{
    Flag, Form, KeyEntry, Keyed, Keys, NumberBounds, Whole, read_table, written_list,
};
use super::mavlink_serving::MavlinkServing;
use super::mission::{SweepConfig, SweepTable, check_sweep};
use super::radio::Reception;
use super::section::{Section, whole_of};
use super::sim::load;
use super::swarm::Swarm;
use super::vehicle_file::{Record, VEHICLE_IDS, state_dir_key};
use super::venue::Venue;

/// What the ground station's node is told.
#[derive(Clone, PartialEq, Debug)]
pub struct GroundFile {
    /// The file of the place, with its folder.
    pub venue_file: String,
    /// The place.
    pub venue: Venue,
    /// The vehicles of the swarm, ascending.
    pub vehicles: Vec<VehicleId>,
    /// The folder in which the store and the recordings are kept.
    pub state_dir: String,
    /// How the sweep is driven.
    pub sweep: SweepConfig,
    /// How images are made.
    pub imaging: Imaging,
    /// How well receivers hear.
    pub reception: Reception,
    /// The run of the empty area with which images are compared.
    pub compare_with: Option<RunId>,
    /// Whether a living operator or ground station is displaced.
    pub take_over: bool,
    /// How it joins the bus.
    pub bus: BusFile,
    /// Its flight recording.
    pub record: Record,
    /// What the operator wants kept with the data; empty when nothing.
    pub operators_note: String,
}

impl GroundFile {
    /// Returns a file of nothing, to be filled.
    pub(super) fn blank() -> GroundFile {
        GroundFile {
            venue_file: String::new(),
            venue: Venue::blank(),
            vehicles: Vec::new(),
            state_dir: String::new(),
            sweep: SweepConfig::default(),
            imaging: Imaging::default(),
            reception: Reception::default(),
            compare_with: None,
            take_over: false,
            bus: BusFile::default(),
            record: Record::default(),
            operators_note: String::new(),
        }
    }

    pub(super) fn read(root: &Section<'_>, loader: &mut Loader) -> Option<GroundFile> {
        let mut file = GroundFile::blank();
        let venue = load(root, "venue", loader, |root| Some(Venue::read(root)));
        let is_loaded = venue.is_some();
        if let Some((name, venue)) = venue {
            (file.venue_file, file.venue) = (name, venue);
        }
        read_table(&mut file, root);
        check_sweep(root.source, &file.sweep, file.vehicles.len(), None);
        file.bus.check(root.source, Role::Ground);
        if !is_loaded || file.state_dir.is_empty() {
            return None;
        }
        check_homes(root, &file.venue, &file.vehicles);
        check_lost_after(root, &file.venue, &file.bus);
        if root.source.is_sound(&["venue", "vehicles", "sweep"]) {
            let apart_m = file.venue.swarm.separation_m;
            super::sim::check_gaps(root, &file.venue, &file.sweep, file.vehicles.len(), apart_m);
        }
        Some(file)
    }
}

impl Keyed for GroundFile {
    fn keys(&mut self, to: &mut dyn Keys) {
        let GroundFile {
            venue_file,
            venue: _,
            vehicles,
            state_dir,
            sweep,
            imaging,
            reception,
            compare_with,
            take_over,
            bus,
            record,
            operators_note,
        } = self;
        let table = |name, means| KeyEntry {
            name,
            left_out: "",
            means,
        };
        let left_out = "needed";
        let means = "file of the place, the same on every node";
        to.form(
            &mut LoadedFile(venue_file),
            KeyEntry {
                name: "venue",
                left_out,
                means,
            },
        );
        let means = "the vehicles of the swarm, such as [1, 2, 3]; sweeps are planned for 2 to 8";
        to.form(
            &mut Vehicles(vehicles),
            KeyEntry {
                name: "vehicles",
                left_out,
                means,
            },
        );
        state_dir_key(state_dir, to);
        let mut driven = SweepTable {
            sweep,
            mission: None,
        };
        to.table(&mut driven, table("sweep", "how a sweep is driven"));
        to.table(
            &mut GroundImaging(imaging),
            table("imaging", "how images are made"),
        );
        to.table(&mut MovedSafety, table("safety", ""));
        to.table(reception, table("radio", "how well receivers hear"));
        let mut run = compare_with.and_then(|run| usize::try_from(run.0).ok());
        to.maybe_whole(
            &mut run,
            NumberBounds {
                name: "compare_with",
                left_out: "none",
                // The highest number is kept free: others count on from it.
                allowed: 1..=u32::MAX as usize - 1,
                means: "number of the run of the empty area, with which images are compared",
            },
        );
        *compare_with = run.and_then(|run| u32::try_from(run).ok()).map(RunId);
        let means = "displace an operator or ground station that lives";
        to.flag(
            take_over,
            Flag {
                name: "take_over",
                default: false,
                means,
            },
        );
        let mut joined = BusFileTable {
            bus,
            role: Role::Ground,
        };
        to.table(&mut joined, table("bus", "how it joins the bus"));
        to.table(record, table("record", "its flight recording"));
        let mut note = Some(std::mem::take(operators_note)).filter(|note| !note.is_empty());
        let means = "text that is kept with the data";
        to.form(
            &mut Text(&mut note),
            KeyEntry {
                name: "operators_note",
                left_out: "",
                means,
            },
        );
        *operators_note = note.unwrap_or_default();
        Swarm::moved_silence(to);
    }
}

/// The table `[safety]`, of which nothing is left in a ground station's file.
struct MovedSafety;

impl Keyed for MovedSafety {
    fn keys(&mut self, to: &mut dyn Keys) {
        Swarm::moved_margins(to);
    }
}

/// The vehicles of a swarm, ascending.
struct Vehicles<'a>(&'a mut Vec<VehicleId>);

impl Form for Vehicles<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(written_list(self.0.iter().map(ToString::to_string)))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        *self.0 = read_vehicles(section, key);
    }
}

/// The numbers that operators may have.
const OPERATOR_IDS: std::ops::RangeInclusive<usize> = 1..=255;

/// What an operator's commands (`order`, `status`, `tap`, `preflight`) and whoever shows the swarm over MAVLink are told.
#[derive(Clone, PartialEq, Debug)]
pub struct OperatorFile {
    /// Which operator it is, from 1.
    pub id: OperatorId,
    /// The file of the place, with its folder.
    pub venue_file: String,
    /// The place.
    pub venue: Venue,
    /// How they join the bus.
    pub bus: BusFile,
    /// Where the swarm is shown over MAVLink; only `tomoswarm ground --mavlink` does. `None` = nowhere.
    pub mavlink: Option<MavlinkServing>,
}

impl OperatorFile {
    /// Returns a file of nothing, to be filled.
    pub(super) fn blank() -> OperatorFile {
        OperatorFile {
            id: OperatorId(1),
            venue_file: String::new(),
            venue: Venue::blank(),
            bus: BusFile::default(),
            mavlink: None,
        }
    }

    pub(super) fn read(root: &Section<'_>, loader: &mut Loader) -> Option<OperatorFile> {
        let mut file = OperatorFile::blank();
        let venue = load(root, "venue", loader, |root| Some(Venue::read(root)));
        read_table(&mut file, root);
        file.bus.check(root.source, Role::Operator);
        if let Some(mavlink) = &file.mavlink {
            mavlink.check(root.source);
        }
        (file.venue_file, file.venue) = venue?;
        Some(file)
    }
}

impl Keyed for OperatorFile {
    fn keys(&mut self, to: &mut dyn Keys) {
        let OperatorFile {
            id,
            venue_file,
            venue: _,
            bus,
            mavlink,
        } = self;
        let means = "file of the place, the same on every node";
        to.form(
            &mut LoadedFile(venue_file),
            KeyEntry {
                name: "venue",
                left_out: "needed",
                means,
            },
        );
        let mut number = usize::from(id.0);
        to.whole(
            &mut number,
            Whole {
                name: "id",
                default: 1,
                allowed: OPERATOR_IDS,
                means: "which operator; several machines that give orders have different numbers",
            },
        );
        *id = OperatorId(u8::try_from(number).unwrap_or(1));
        let mut joined = BusFileTable {
            bus,
            role: Role::Operator,
        };
        to.table(
            &mut joined,
            KeyEntry {
                name: "bus",
                left_out: "",
                means: "how the commands join the bus",
            },
        );
        to.maybe_table(
            mavlink,
            KeyEntry {
                name: "mavlink",
                left_out: "",
                means: "where `tomoswarm ground --mavlink` shows the swarm to ground stations; all other commands pass it over",
            },
        );
    }
}

fn read_vehicles(root: &Section<'_>, key: &'static str) -> Vec<VehicleId> {
    let rule = "a list of different vehicles such as [1, 2, 3] is needed, each from 1 to 250";
    root.require(key, rule);
    if !root.has(key) {
        return Vec::new();
    }
    let list = root.list(key).unwrap_or_default();
    let id = |number: usize| u8::try_from(number).ok().map(VehicleId);
    let numbers = list.iter().filter_map(|entry| whole_of(entry.get_ref()));
    let mut vehicles: Vec<VehicleId> = numbers
        .filter(|number| VEHICLE_IDS.contains(number))
        .filter_map(id)
        .collect();
    vehicles.sort();
    vehicles.dedup();
    // The list of a swarm whose vehicles are not enrolled yet is empty; a value that is no list is not.
    let is_list = root.list(key).is_some();
    if !is_list || vehicles.len() != list.len() {
        root.refuse(key, "is no such list", rule);
        return Vec::new();
    }
    vehicles
}

fn check_homes(root: &Section, venue: &Venue, vehicles: &[VehicleId]) {
    let homes = venue.homes.len();
    if let Some(homeless) = vehicles.iter().find(|id| usize::from(id.0) > homes) {
        let wrong = format!("has vehicle {homeless}, but the venue has {homes} homes");
        root.refuse(
            "vehicles",
            &wrong,
            "vehicle N starts at the N-th of homes_m",
        );
    }
}

/// Refuses a lease that is no shorter than the silence after which a vehicle is lost.
fn check_lost_after(root: &Section<'_>, venue: &Venue, bus: &BusFile) {
    let lost_after_s = venue.swarm.lost_after_s;
    if root.source.is_sound(&["bus.lease_s"]) && lost_after_s <= bus.lease_s {
        let wrong = format!(
            "is a silence that any link may have, but a vehicle is lost after {lost_after_s} s"
        );
        root.source.refuse(
            "bus.lease_s",
            &wrong,
            "less than lost_after_s of the venue is allowed",
        );
    }
}
