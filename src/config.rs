//! Venue, scene, simulation and node files: text in, checked values out.
//!
//! A file is TOML and names its `kind`. It is read into a tree with line numbers and taken apart key
//! by key, so that *all* mistakes of all files are listed at once ([`Problems`]), each with file,
//! line, key, value and what is allowed; a key that nobody asked for is refused with the nearest
//! known one. (A serde twin with `deny_unknown_fields` would stop at its first mistake.) Units are in
//! the key names; what is left out has a default.
//!
//! A key is declared once, where its value lives (`keys`): reading it, writing it ([`to_toml`]) and its line in
//! `configs/README.md` ([`key_tables`]) come from there.
//!
//! This module opens no files and reads no environment: content is passed in, and a simulation's
//! venue and scene come from the `loader` of the caller. It does not read the scene's shapes (`.wrl`),
//! places no random persons, and opens neither the certificates nor the folders that a node's file names.

mod autopilot_range;
pub mod bundled;
mod bus_file;
mod drivers;
mod endpoint;
mod experiment;
mod fault;
mod file_line;
mod forms;
mod given_mission;
mod ground_file;
mod hcsr04_lines;
mod imaging;
mod keys;
mod links_file;
mod mavlink_connection;
mod mavlink_serving;
mod mission;
mod nearest;
mod outline;
mod overlay;
mod pose_file;
mod problem;
mod radio;
mod range;
mod range_driver;
mod range_table;
mod scene;
mod section;
mod servo_driver;
mod silence;
mod sim;
mod source;
mod source_file;
mod swarm;
mod task;
mod to_toml;
mod vehicle;
mod vehicle_file;
mod venue;
mod waypoint_file;
mod world_endpoint;
mod xbee_port;

use overlay::{Layer, OverlaidText, Overlay};
use section::Section;
use source::Source;
pub use source::beside;

pub use autopilot_range::AutopilotRange;
pub use bus_file::{BusFile, Identity, Topology};
pub use drivers::{AutopilotDriver, Drivers, RadioDriver};
pub use endpoint::{Endpoint, EndpointError, Protocol, is_host};
pub use experiment::{Axis, Experiment, MOST_RUNS};
pub use fault::{FaultKind, FaultSpec, FaultWord, PlannedFault};
pub use file_line::{FileLine, SimLines};
pub use given_mission::{GivenMission, GivenSweep};
pub use ground_file::{GroundFile, OperatorFile};
pub use hcsr04_lines::HcSr04Lines;
pub use imaging::{ImageTimes, Imaging, Prior, Solver, Weights};
pub use keys::DeclaredKey;
#[cfg(feature = "net")]
pub(crate) use keys::quoted;
pub use links_file::LinksFile;
pub use mavlink_connection::{MavlinkConnection, MavlinkEndpoint, MavlinkPlace};
pub use mavlink_serving::MavlinkServing;
pub use mission::{AfterSweep, Durations, Expect, PlannerChoice, SweepConfig};
pub(crate) use nearest::nearest;
pub use pose_file::{PoseFile, PoseSource};
pub use problem::{Problem, Problems};
pub use radio::{Bus, OwnRadio, Partition, PlannedPartition, Radio, Reception};
pub use range::{Lobe, RangeSensor, SensorCoverage, SensorMount};
pub use range_driver::{
    LengthUnit, RangeDriver, SerialProtocol, SerialSensor, SerialText, TextFormat, TfSensor,
};
pub use scene::{MaterialSpec, Object, Outline, Person, RandomPersons, SceneFile, Up};
pub use servo_driver::{RealServo, ServoDriver, ServoOutput, ServoScale};
pub use sim::{SEEDS, Sim, UNTIL_S};
pub use source_file::SourceFile;
pub use swarm::Swarm;
pub use task::MissionTable;
pub use vehicle::{BodySpec, CARRIED_S, Craft, Flight, Safety, Vehicles};
pub use vehicle_file::{Record, VehicleFile};
pub use venue::{Datum, Venue};
pub use waypoint_file::{
    Above, MOST_ITEMS, MOST_WAYPOINT_BYTES, MissionItem, SpeedOf, Spot, Target, TurnDirection,
    WaypointFile,
};
pub use world_endpoint::{WorldEndpoint, world_token};
pub use xbee_port::{XBEE_BAUD, XBEE_BAUDS, XBEE_POWERS_DBM, XbeePort};

pub use to_toml::{key_tables, keys_in_words, to_toml};

/// Returns the text of a file that another file names, or the reason why it cannot be read.
pub type Loader<'a> = dyn FnMut(&str) -> Result<String, String> + 'a;

/// The content of one configuration file.
#[derive(Clone, PartialEq, Debug)]
pub enum Config {
    /// The shared description of a place.
    Venue(Venue),
    /// A simulated world.
    Scene(SceneFile),
    /// A simulated mission, with its venue and scene.
    Sim(Box<Sim>),
    /// One vehicle's node.
    Vehicle(Box<VehicleFile>),
    /// The ground station's node.
    Ground(Box<GroundFile>),
    /// An operator's commands.
    Operator(Box<OperatorFile>),
    /// A grid of simulations; none of them is read yet.
    Experiment(Box<Experiment>),
}

/// Reads a configuration of any kind; `file_name` is used in messages and to find files named in it.
///
/// # Errors
///
/// Every mistake of this file and of the files that it names.
pub fn read(file_name: &str, text: &str, loader: &mut Loader) -> Result<Config, Problems> {
    read_root(file_name, text, |root| match root.text("kind").as_deref() {
        Some("venue") => Some(Config::Venue(Venue::read(root))),
        Some("scene") => Some(Config::Scene(SceneFile::read(root))),
        Some("sim") => {
            Sim::read(root, None, vehicle::SWARM, loader).map(|sim| Config::Sim(Box::new(sim)))
        }
        Some("vehicle") => {
            VehicleFile::read(root, loader).map(|file| Config::Vehicle(Box::new(file)))
        }
        Some("ground") => GroundFile::read(root, loader).map(|file| Config::Ground(Box::new(file))),
        Some("operator") => {
            OperatorFile::read(root, loader).map(|file| Config::Operator(Box::new(file)))
        }
        Some("experiment") => Some(Config::Experiment(Box::new(Experiment::read(root)))),
        Some(_) => {
            root.refuse("kind", "is not known", KINDS);
            None
        }
        None => {
            root.require("kind", KINDS);
            None
        }
    })
}

/// Reads a simulation file with the venue and the scene that it names; `vehicles`, if given, replaces
/// the number of vehicles before anything is checked.
///
/// # Errors
///
/// Every mistake of the three files; a file of another kind.
pub fn read_sim(
    file_name: &str,
    text: &str,
    vehicles: Option<usize>,
    loader: &mut Loader,
) -> Result<Sim, Problems> {
    read_kind(file_name, text, "sim", |root| {
        Sim::read(root, vehicles, vehicle::SWARM, loader)
    })
}

/// Reads a simulation file as [`read_sim`] does, for a world whose vehicles are driven by others: there may be more of
/// them than can sweep together.
///
/// # Errors
///
/// As for [`read_sim`].
pub fn read_world(
    file_name: &str,
    text: &str,
    vehicles: Option<usize>,
    loader: &mut Loader,
) -> Result<Sim, Problems> {
    read_kind(file_name, text, "sim", |root| {
        Sim::read(root, vehicles, vehicle::CROWD, loader)
    })
}

/// Reads the file of a vehicle's node, with the venue that it names.
///
/// # Errors
///
/// Every mistake of both files; a file of another kind.
pub fn read_vehicle(
    file_name: &str,
    text: &str,
    loader: &mut Loader,
) -> Result<VehicleFile, Problems> {
    read_kind(file_name, text, "vehicle", |root| {
        VehicleFile::read(root, loader)
    })
}

/// Reads the file of the ground station's node, with the venue that it names.
///
/// # Errors
///
/// Every mistake of both files; a file of another kind.
pub fn read_ground(
    file_name: &str,
    text: &str,
    loader: &mut Loader,
) -> Result<GroundFile, Problems> {
    read_kind(file_name, text, "ground", |root| {
        GroundFile::read(root, loader)
    })
}

/// Reads the file of an operator's commands, with the venue that it names.
///
/// # Errors
///
/// Every mistake of both files; a file of another kind.
pub fn read_operator(
    file_name: &str,
    text: &str,
    loader: &mut Loader,
) -> Result<OperatorFile, Problems> {
    read_kind(file_name, text, "operator", |root| {
        OperatorFile::read(root, loader)
    })
}

/// Reads the file of an experiment; the simulations of its grid are read by [`Experiment::sim`].
///
/// # Errors
///
/// Every mistake of the file itself; a file of another kind.
pub fn read_experiment(file_name: &str, text: &str) -> Result<Experiment, Problems> {
    read_kind(file_name, text, "experiment", |root| {
        Some(Experiment::read(root))
    })
}

const KINDS: &str = "a file begins with kind = \"venue\", \"scene\", \"sim\", \"vehicle\", \"ground\", \"operator\" or \"experiment\"";

/// Reads a file that must be of one kind.
fn read_kind<T>(
    file_name: &str,
    text: &str,
    kind: &str,
    read: impl FnOnce(&Section) -> Option<T>,
) -> Result<T, Problems> {
    read_kind_over(file_name, text, None, kind, read)
}

/// Reads a file that must be of one kind, with what is laid over it.
fn read_kind_over<T>(
    file_name: &str,
    text: &str,
    overlay: Option<&Overlay>,
    kind: &str,
    read: impl FnOnce(&Section) -> Option<T>,
) -> Result<T, Problems> {
    read_root_over(
        file_name,
        text,
        overlay.zip(overlay.and_then(|all| all.layer(kind))),
        |root| match root.text("kind") {
            Some(found) if found == kind => read(root),
            Some(_) => {
                root.refuse(
                    "kind",
                    "is of another kind",
                    &format!("kind = \"{kind}\" is needed here"),
                );
                None
            }
            None => {
                root.require("kind", &format!("kind = \"{kind}\" is needed here"));
                None
            }
        },
    )
}

fn read_root<T>(
    file_name: &str,
    text: &str,
    read: impl FnOnce(&Section) -> Option<T>,
) -> Result<T, Problems> {
    read_root_over(file_name, text, None, read)
}

/// Reads a file with a layer of what is laid over it, if any.
fn read_root_over<T>(
    file_name: &str,
    text: &str,
    over: Option<(&Overlay, &Layer)>,
    read: impl FnOnce(&Section) -> Option<T>,
) -> Result<T, Problems> {
    let joined = over.map(|(_, layer)| OverlaidText::new(text, layer));
    let source = match (&joined, over) {
        (Some(joined), Some((overlay, _))) => Source::over(file_name, joined, overlay),
        (Some(_) | None, _) => Source::new(file_name, text),
    };
    let tree = source.parse();
    let value = read(&Section::root(&source, &tree));
    source.finish(value)
}
