//! The files of the ground station's node and of an operator's commands. Opens nothing of what they name but the venue.

use std::time::Duration;

use tomoswarm_proto::{RunId, VehicleId};

use super::Loader;
use super::bus_file::{BusFile, Role};
use super::mission::{Imaging, Sweep};
use super::radio::read_sensitivity_dbm;
use super::section::{Section, whole_of};
use super::sim::load;
use super::vehicle::read_separation_m;
use super::vehicle_file::{Record, VEHICLE_IDS, read_state_dir};
use super::venue::Venue;

/// What the ground station's node is told.
#[derive(Clone, PartialEq, Debug)]
pub struct GroundFile {
    /// The place.
    pub venue: Venue,
    /// The vehicles of the swarm, ascending.
    pub vehicles: Vec<VehicleId>,
    /// The folder in which the store and the recordings are kept.
    pub state_dir: String,
    /// How the sweep is driven.
    pub sweep: Sweep,
    /// How images are made.
    pub imaging: Imaging,
    /// Smallest distance between two vehicles, middle to middle, metres.
    pub separation_m: f64,
    /// The weakest packet that a receiver hears, dBm.
    pub sensitivity_dbm: f64,
    /// The run of the empty area with which images are compared.
    pub compare_with: Option<RunId>,
    /// After this much silence the stops of a vehicle go to the others.
    pub lost_after: Duration,
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
    pub(super) fn read(root: &Section, loader: &mut Loader) -> Option<GroundFile> {
        let venue = load(root, "venue", loader, |root| Some(Venue::read(root)));
        let vehicles = read_vehicles(root);
        let state_dir = read_state_dir(root);
        let sweep = Sweep::read(&root.section("sweep"), vehicles.len(), None);
        let imaging = Imaging::read(&root.section("imaging"));
        let separation_m = read_alone(&root.section("safety"), read_separation_m);
        let sensitivity_dbm = read_alone(&root.section("radio"), read_sensitivity_dbm);
        let compare_with = read_run(root);
        let lost_after = root.duration("lost_after_s", 30.0, 1.0..=3600.0);
        let take_over = root.flag("take_over", false);
        let bus = BusFile::read(&root.section("bus"), Role::Ground);
        let record = Record::read(&root.section("record"));
        let operators_note = root.text("operators_note").unwrap_or_default();
        root.finish();
        let venue = venue?;
        check_homes(root, &venue, &vehicles);
        check_lost_after(root, lost_after, &bus);
        if root.source.is_sound(&["venue", "vehicles", "sweep", "safety"]) {
            super::sim::check_gaps(root, &venue, &sweep, vehicles.len(), separation_m);
        }
        Some(GroundFile {
            venue,
            vehicles,
            state_dir: state_dir?,
            sweep,
            imaging,
            separation_m,
            sensitivity_dbm,
            compare_with,
            lost_after,
            take_over,
            bus,
            record,
            operators_note,
        })
    }
}

/// What an operator's commands (`order`, `status`, `tap`, `preflight`) are told.
#[derive(Clone, PartialEq, Debug)]
pub struct OperatorFile {
    /// The place.
    pub venue: Venue,
    /// How they join the bus.
    pub bus: BusFile,
}

impl OperatorFile {
    pub(super) fn read(root: &Section, loader: &mut Loader) -> Option<OperatorFile> {
        let venue = load(root, "venue", loader, |root| Some(Venue::read(root)));
        let bus = BusFile::read(&root.section("bus"), Role::Operator);
        root.finish();
        Some(OperatorFile { venue: venue?, bus })
    }
}

/// Reads a table of one key.
fn read_alone(section: &Section, read: fn(&Section) -> f64) -> f64 {
    let number = read(section);
    section.finish();
    number
}

fn read_vehicles(root: &Section) -> Vec<VehicleId> {
    let rule = "a list of different vehicles such as [1, 2, 3] is needed, each from 1 to 250";
    root.require("vehicles", rule);
    if !root.has("vehicles") {
        return Vec::new();
    }
    let list = root.list("vehicles").unwrap_or_default();
    let id = |number: usize| u8::try_from(number).ok().map(VehicleId);
    let numbers = list.iter().filter_map(|entry| whole_of(entry.get_ref()));
    let mut vehicles: Vec<VehicleId> =
        numbers.filter(|number| VEHICLE_IDS.contains(number)).filter_map(id).collect();
    vehicles.sort();
    vehicles.dedup();
    // The list of a swarm whose vehicles are not enrolled yet is empty; a value that is no list is not.
    let is_list = root.list("vehicles").is_some();
    if !is_list || vehicles.len() != list.len() {
        root.refuse("vehicles", "is no such list", rule);
        return Vec::new();
    }
    vehicles
}

fn read_run(root: &Section) -> Option<RunId> {
    // The highest number is kept free: others count on from it.
    let numbers = 1..=u32::MAX as usize - 1;
    let run = root.has("compare_with").then(|| root.whole("compare_with", 1, numbers))?;
    u32::try_from(run).ok().map(RunId)
}

fn check_homes(root: &Section, venue: &Venue, vehicles: &[VehicleId]) {
    let homes = venue.homes.len();
    if let Some(homeless) = vehicles.iter().find(|id| usize::from(id.0) > homes) {
        let wrong = format!("has vehicle {homeless}, but the venue has {homes} homes");
        root.refuse("vehicles", &wrong, "vehicle N starts at the N-th of homes_m");
    }
}

fn check_lost_after(root: &Section, lost_after: Duration, bus: &BusFile) {
    if root.source.is_sound(&["lost_after_s", "bus.lease_s"]) && lost_after <= bus.lease {
        let wrong = "is not longer than bus.lease_s, the silence that any link may have";
        root.refuse("lost_after_s", wrong, "more than bus.lease_s is allowed");
    }
}
