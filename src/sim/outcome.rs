//! What a run leaves behind: facts for pictures, files and tests. Nothing here is written anywhere.

use std::collections::BTreeMap;

use tomoswarm_proto::VehicleId;

use super::bus::{BytesByKind, NodeId};
use super::log::Log;
use super::operator_script::RUN;
use super::place_results::PlaceResult;
use super::world::{Collision, FenceBreach};
use crate::geom::Point;
use crate::ground::MeasuredSample;
use crate::ground::imager::{ReconstructedImage, Subject};
use crate::map::Merged;
use crate::node::mission::EndReason;
use crate::scene::{Outline, Person};
use crate::time::Time;
use crate::tomo::{Find, Link, Reconstruction};

/// How often things happened.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct RunCounts {
    /// Events of the kernel, but for those of operators: looking costs nothing.
    pub events: u64,
    /// Range readings.
    pub scans: u64,
    /// Beacons that were received, each receiver counted.
    pub beacons_heard: u64,
    /// Beacons lost because two spoke at once.
    pub collided_beacons: u64,
    /// Commands of vehicles that their devices dropped: busy or wrecked ones, or impossible commands.
    pub dropped_commands: u64,
    /// Messages delivered by the bus to vehicles and ground station.
    pub messages: u64,
}

/// A vehicle, and when and how its own mission ended.
pub type EndedMission = (VehicleId, Option<(Time, EndReason)>);

/// What was written down while a run went on.
pub(super) struct Recorded {
    pub log: Log,
    pub counts: RunCounts,
    pub tracks: Vec<(VehicleId, Vec<Point>)>,
    pub pictures: Vec<ReconstructedImage>,
    pub failure: Option<String>,
}

/// How many vehicles there are at a moment whose software runs, how many of them are home, and how many stand and stay.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct FleetCount {
    pub alive: usize,
    pub home: usize,
    pub held: usize,
}

/// A find within this of a person is that person, metres.
pub const NEAR_M: f64 = 1.0;

/// A person found in the change since the empty sweep.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FoundObject {
    /// Where.
    pub at: Point,
    /// How strong, dB/m.
    pub strength: f64,
    /// Variance by x, covariance, variance by y of the place, m².
    pub covariance_m2: [f64; 3],
    /// How sure it is, see [`crate::tomo::Find`].
    pub evidence: f64,
    /// Probability that an image of nobody shows no place as strong as this one.
    pub probability: f64,
    /// Distance to the nearest true person, of one who walks to the nearest place where it has been, metres; `None` when there is none.
    pub error_m: Option<f64>,
}

/// Everything that a run leaves behind.
pub struct RunOutcome {
    /// Whether it ended as its file expects; by that, all sweeps were driven to their end.
    pub finished: bool,
    /// Why not, if not.
    pub failure: Option<String>,
    /// How many vehicles were home at the end.
    pub home: usize,
    /// How many stood where they were and would have stayed.
    pub held: usize,
    /// Virtual time at the end.
    pub simulated: Time,
    /// What the referee saw.
    pub collisions: Vec<Collision>,
    /// How many commands led over the fence.
    pub fence_breaches: usize,
    /// Which, in order; of a live run only their number is known.
    pub breaches: Vec<FenceBreach>,
    /// Smallest distance between the middles of two vehicles, metres; `None` for one alone.
    pub min_separation_m: Option<f64>,
    /// Samples stored of the main sweep.
    pub samples: u64,
    /// All samples of all sweeps, each once, in order; `None` = the scenario was not to keep them.
    pub measured: Option<Vec<MeasuredSample>>,
    /// Links of the main sweep.
    pub links: Vec<Link>,
    /// Links of the empty sweep; none without one.
    pub empty_links: Vec<Link>,
    /// What changed since the empty sweep, if there was one.
    pub change: Option<Reconstruction>,
    /// What stands there.
    pub structure: Option<Reconstruction>,
    /// Which of the two could not be made of what was measured, and why; of a live run not known.
    pub not_made: Vec<(Subject, String)>,
    /// The merged map of the ground station.
    pub map: Merged,
    /// Where each vehicle truly was, 0.05 m and more apart, at the times of its telemetry.
    pub tracks: Vec<(VehicleId, Vec<Point>)>,
    /// When and how the mission of its own of each vehicle ended; none ends in a sweep.
    pub missions: Vec<EndedMission>,
    /// What became of the places that vehicles were to visit on paths around what they see, those of the first vehicle
    /// first; empty for other missions, and of a live run not known.
    pub places: Vec<PlaceResult>,
    /// Who stood in the scene.
    pub persons: Vec<Person>,
    /// Where each of them has been ([`super::Scenario::ways`]).
    pub ways: Vec<Vec<Point>>,
    /// What stood in the scene at antenna height, without the persons.
    pub outlines: Vec<Outline>,
    /// How often things happened.
    pub counts: RunCounts,
    /// Bytes that every node sent over the bus, by kind of message.
    pub bus_bytes: BTreeMap<NodeId, BytesByKind>,
    /// The deterministic log.
    pub log: String,
}

impl FoundObject {
    /// Returns whether a person stood within [`NEAR_M`] of it.
    pub fn is_somebody(&self) -> bool {
        self.error_m.is_some_and(|error_m| error_m <= NEAR_M)
    }
}

impl RunOutcome {
    /// Takes the last picture of a subject of the main run out of those recorded; of one that could not be made the reason
    /// goes to `not_made`.
    pub(super) fn take(
        pictures: &mut Vec<ReconstructedImage>,
        subject: Subject,
        not_made: &mut Vec<(Subject, String)>,
    ) -> Option<Reconstruction> {
        let index = pictures
            .iter()
            .position(|picture| (picture.run, picture.subject) == (RUN, subject))?;
        let result = pictures.remove(index).result;
        result.map_err(|why| not_made.push((subject, why))).ok()
    }

    /// Returns the bytes that all nodes sent over the bus, by kind of message.
    pub fn bus_bytes_by_kind(&self) -> BytesByKind {
        let mut all = BytesByKind::new();
        for (kind, bytes) in self.bus_bytes.values().flatten() {
            *all.entry(kind).or_default() += bytes;
        }
        all
    }

    /// Returns how much a vehicle sent over the bus, bytes a second, the mean over all vehicles. A message counts
    /// once, however many receive it.
    pub fn bus_bytes_per_vehicle_s(&self) -> f64 {
        let of_vehicle = |(node, sent): (&NodeId, &BytesByKind)| match node {
            NodeId::Vehicle(_) => sent.values().sum(),
            NodeId::Ground | NodeId::Operator(_) => 0,
        };
        let bytes: u64 = self.bus_bytes.iter().map(of_vehicle).sum();
        bytes as f64 / self.simulated.as_secs_f64().max(1e-9) / self.tracks.len().max(1) as f64
    }

    /// Returns the persons found in the change since the empty sweep, the surest first.
    pub fn found(&self) -> Vec<FoundObject> {
        let finds = self
            .change
            .as_ref()
            .and_then(|change| change.finds.as_ref());
        finds.map_or_else(Vec::new, |finds| {
            finds.found.iter().map(|find| self.judged(find)).collect()
        })
    }

    /// Returns for each person how far the nearest find is from where it has been, metres; infinite when nobody was found.
    pub fn errors_m(&self) -> Vec<f64> {
        let found = self.found();
        let nearest_m = |way: &Vec<Point>| {
            let errors_m = found.iter().map(|find| away_m(way, find.at));
            errors_m.fold(f64::INFINITY, f64::min)
        };
        self.ways.iter().map(nearest_m).collect()
    }

    fn judged(&self, find: &Find) -> FoundObject {
        let distances = self.ways.iter().map(|way| away_m(way, find.at));
        FoundObject {
            at: find.at,
            strength: find.strength,
            covariance_m2: find.covariance_m2,
            evidence: find.evidence,
            probability: find.probability,
            error_m: distances.min_by(f64::total_cmp),
        }
    }
}

/// Returns how far a place is from the nearest place of a way, metres.
fn away_m(way: &[Point], place: Point) -> f64 {
    let distances = way.iter().map(|at| at.distance_to(place));
    distances.fold(f64::INFINITY, f64::min)
}
