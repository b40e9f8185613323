//! What a run leaves behind: facts for pictures, files and tests. Nothing here is written anywhere.

use std::collections::BTreeMap;

use tomoswarm_proto::VehicleId;

use super::bus::{BytesByKind, NodeId};
use super::log::Log;
use super::operator_script::RUN;
use super::place_results::PlaceResult;
use super::silence::Silence;
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

/// A find in the change since the empty sweep: a person, or nobody.
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
    /// Which person it is, by the index in [`RunOutcome::persons`]; `None` = nobody. Each person is one find at most.
    pub person: Option<usize>,
    /// Distance to that person, for nobody to the nearest one, of one who walks to the nearest place where it has been,
    /// metres; `None` when there is none.
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
    /// What the vehicles whose software runs at the end and the ground station know together, merged as the ground station
    /// merges it, whoever hears whom by then; of a live run what the ground station has stored.
    pub map: Merged,
    /// Where each vehicle truly was, 0.05 m and more apart, at the times of its telemetry.
    pub tracks: Vec<(VehicleId, Vec<Point>)>,
    /// When and how the mission of its own of each vehicle ended; none ends in a sweep.
    pub missions: Vec<EndedMission>,
    /// What became of the places that vehicles were to visit on paths around what they see, those of the first vehicle
    /// first; empty for other missions, and of a live run not known.
    pub places: Vec<PlaceResult>,
    /// When in a sweep the ground station was told of no beacon between any two vehicles for long; of a live run not known.
    pub silences: Vec<Silence>,
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
    /// Returns whether it is a person: one within [`NEAR_M`] of it, whom no other find is.
    pub fn is_somebody(&self) -> bool {
        self.person.is_some()
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

    /// Returns whether persons were searched in the change since the empty sweep; a sweep that is given up has no such image.
    pub fn has_searched(&self) -> bool {
        let change = self.change.as_ref();
        change.is_some_and(|change| change.finds.is_some())
    }

    /// Returns the finds in the change since the empty sweep, the surest first; none where nobody was searched.
    pub fn found(&self) -> Vec<FoundObject> {
        let finds = self.finds();
        let pairs = pairs(&self.ways, finds);
        let judged = |(index, find): (usize, &Find)| {
            let paired = pairs.iter().find(|pair| pair.find == index);
            let its = paired.filter(|pair| pair.apart_m <= NEAR_M);
            let distances = self.ways.iter().map(|way| away_m(way, find.at));
            FoundObject {
                at: find.at,
                strength: find.strength,
                covariance_m2: find.covariance_m2,
                evidence: find.evidence,
                probability: find.probability,
                person: its.map(|pair| pair.person),
                error_m: match its {
                    Some(pair) => Some(pair.apart_m),
                    None => distances.min_by(f64::total_cmp),
                },
            }
        };
        finds.iter().enumerate().map(judged).collect()
    }

    /// Returns for each person how far its find is from where it has been, metres; infinite where no find is left for it. Each
    /// find is given to one person, the nearest pair first.
    pub fn errors_m(&self) -> Vec<f64> {
        let pairs = pairs(&self.ways, self.finds());
        let error_m = |person: usize| {
            let paired = pairs.iter().find(|pair| pair.person == person);
            paired.map_or(f64::INFINITY, |pair| pair.apart_m)
        };
        (0..self.ways.len()).map(error_m).collect()
    }

    fn finds(&self) -> &[Find] {
        let searched = self
            .change
            .as_ref()
            .and_then(|change| change.finds.as_ref());
        searched.map_or(&[], |finds| &finds.found)
    }
}

/// A person and the find that is given to it, by their indices.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Pair {
    person: usize,
    find: usize,
    apart_m: f64,
}

/// Gives every person one find and every find one person, the nearest pair first, however far apart, until one of them is left
/// alone.
fn pairs(ways: &[Vec<Point>], finds: &[Find]) -> Vec<Pair> {
    let of = |person: usize| {
        let pair = move |(find, found): (usize, &Find)| Pair {
            person,
            find,
            apart_m: away_m(&ways[person], found.at),
        };
        finds.iter().enumerate().map(pair)
    };
    let mut all: Vec<Pair> = (0..ways.len()).flat_map(of).collect();
    all.sort_by(|one, other| one.apart_m.total_cmp(&other.apart_m));
    let mut taken: Vec<Pair> = Vec::new();
    for pair in all {
        let is_free = |known: &Pair| known.person != pair.person && known.find != pair.find;
        if taken.iter().all(is_free) {
            taken.push(pair);
        }
    }
    taken
}

/// Returns how far a place is from the nearest place of a way, metres.
fn away_m(way: &[Point], place: Point) -> f64 {
    let distances = way.iter().map(|at| at.distance_to(place));
    distances.fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How far each person's find is off, of persons and finds on a line.
    fn check(persons_m: &[f64], finds_m: &[f64], expected: &[Option<(usize, f64)>]) {
        let ways: Vec<Vec<Point>> = persons_m
            .iter()
            .map(|x_m| vec![Point::new(*x_m, 0.0)])
            .collect();
        let find = |x_m: &f64| Find {
            at: Point::new(*x_m, 0.0),
            strength: 8.0,
            covariance_m2: [0.01, 0.0, 0.01],
            evidence: 50.0,
            probability: 0.0,
        };
        let finds: Vec<Find> = finds_m.iter().map(find).collect();
        let pairs = pairs(&ways, &finds);
        let paired = |person: usize| {
            let pair = pairs.iter().find(|pair| pair.person == person);
            pair.map(|pair| (pair.find, (pair.apart_m * 1e6).round() / 1e6))
        };
        let found: Vec<_> = (0..ways.len()).map(paired).collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn one_find_is_one_person_the_nearest() {
        check(&[1.0, 1.6], &[1.5], &[None, Some((0, 0.1))]);
        check(&[1.0, 1.6], &[1.2, 1.5], &[Some((0, 0.2)), Some((1, 0.1))]);
        check(&[1.0], &[1.4, 0.7], &[Some((1, 0.3))]);
        // A person who is missed is given what is left, to say how far it is.
        check(&[1.0, 9.0], &[1.1, 5.0], &[Some((0, 0.1)), Some((1, 4.0))]);
        check(&[1.0], &[], &[None]);
        check(&[], &[1.0], &[]);
    }
}
