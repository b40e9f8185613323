//! A random floor plan, explored or with a place to visit in each room, judged by the truth, and the table of many.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::time::Instant;

use tomoswarm::config;
use tomoswarm::geom::{Cell, Lattice, Rect};
use tomoswarm::map::Occupancy;
use tomoswarm::sim::reachable::{Reachable, Room, STEP_M};
use tomoswarm::sim::visible::{Visible, detected};
use tomoswarm::sim::{PlaceCounts, PlaceFate, RunOutcome, SLICE, Scenario, VisibleScene};

use super::plan::{Demand, FloorPlan};

/// Safety distances of the plans, metres.
const DISTANCES_M: [f64; 4] = [0.3, 0.35, 0.6, 0.9];
/// How much wider the doors are than twice the distance and two deviations, metres.
const EXTRAS_M: [f64; 3] = [0.2, 0.3, 0.4];
/// A room of whose free floor this share is known to be free was entered, from the door or wherever.
const KNOWN_SHARE: f64 = 0.8;

/// What a vehicle does in a plan.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum TrialMission {
    /// It explores.
    Explore,
    /// It visits a place in each room.
    Pathfind,
}

impl TrialMission {
    fn file(self) -> &'static str {
        match self {
            TrialMission::Explore => "explore.sim.toml",
            TrialMission::Pathfind => "pathfind.sim.toml",
        }
    }

    /// Returns its word.
    pub fn word(self) -> &'static str {
        match self {
            TrialMission::Explore => "explore",
            TrialMission::Pathfind => "pathfind",
        }
    }
}

/// Returns what a plan with this seed is made for when plans of all distances and doors come in turn.
pub fn demand_in_turn(seed: u64, thinnest_m: f64) -> Demand {
    let (distances, extras) = (DISTANCES_M.len() as u64, EXTRAS_M.len() as u64);
    Demand {
        distance_m: DISTANCES_M[(seed % distances) as usize],
        extra_m: EXTRAS_M[(seed / distances % extras) as usize],
        thinnest_m,
    }
}

/// What came of a plan.
#[derive(Clone, PartialEq, Debug)]
pub struct TrialResult {
    pub seed: u64,
    pub mission: TrialMission,
    pub demand: Demand,
    pub rooms: usize,
    /// Rooms that were entered.
    pub entered: usize,
    /// Share of the surface that can be seen from all rooms that the map has, 0 to 1; whether or not a map of cells leaves
    /// room enough at the doors.
    pub share: f64,
    /// Places by the truth, for vehicles that know a map of cells: they need doors 0.3 m wider than the least.
    pub places: PlaceCounts,
    /// Places to which no way was said to lead, whether or not they count as reachable for such a vehicle. There is a way to
    /// all of them.
    pub no_way: usize,
    pub collisions: usize,
    pub fence_breaches: usize,
    /// How the mission ended, in words; `None` = it has not.
    pub end: Option<String>,
    pub simulated_s: f64,
    /// How long the run took, seconds.
    pub took_s: f64,
}

/// Makes the scenario of a plan.
pub fn scenario(plan: &FloorPlan, mission: TrialMission) -> Scenario {
    let files: BTreeMap<&str, String> = plan.files().into_iter().collect();
    let mut loader = |name: &str| files.get(name).cloned().ok_or_else(|| format!("no {name}"));
    let text = loader(mission.file()).expect("there is one for each mission");
    let sim = config::read_sim(mission.file(), &text, None, &mut loader)
        .unwrap_or_else(|problems| panic!("plan {}: {problems}", plan.seed));
    Scenario::new(sim, Vec::new(), plan.seed)
        .unwrap_or_else(|error| panic!("plan {}: {error}", plan.seed))
}

/// Runs a plan and judges it.
pub fn run(plan: &FloorPlan, mission: TrialMission) -> TrialResult {
    let began = Instant::now();
    let scenario = scenario(plan, mission);
    let outcome = scenario
        .run(&mut |_| true)
        .unwrap_or_else(|error| panic!("plan {}: {error}", plan.seed));
    let seen = VisibleScene::find(&scenario).expect("the scene was built once");
    let visible = visible_from_all_rooms(plan, &scenario, &seen);
    let no_way = |fate: PlaceFate| fate == PlaceFate::NoWay;
    TrialResult {
        seed: plan.seed,
        mission,
        demand: plan.demand,
        rooms: plan.rooms.len(),
        entered: rooms_entered(plan, &outcome),
        share: detected(&outcome.map, SLICE, &visible) as f64 / visible.len().max(1) as f64,
        places: seen.count_places(&outcome.places),
        no_way: outcome
            .places
            .iter()
            .filter(|place| no_way(place.fate))
            .count(),
        collisions: outcome.collisions.len(),
        fence_breaches: outcome.fence_breaches,
        end: outcome.missions[0]
            .1
            .as_ref()
            .map(|(_, end)| end.to_string()),
        simulated_s: outcome.simulated.as_secs_f64(),
        took_s: began.elapsed().as_secs_f64(),
    }
}

/// Returns the cells of the surface that can be seen by somebody who keeps just so far from everything that the doors let
/// it through.
pub fn visible_from_all_rooms(
    plan: &FloorPlan,
    scenario: &Scenario,
    seen: &VisibleScene,
) -> BTreeSet<Cell> {
    let (body_m, low_m, high_m) = seen.body;
    let room = Room {
        keep_m: plan.demand.door_m() / 2.0 - 1.01 * STEP_M,
        body_m,
        low_m,
        high_m,
    };
    let venue = &scenario.sim().venue;
    let region = Reachable::find(&seen.scene, &venue.fence, &[plan.home], &room);
    let lattice = Lattice::new(venue.cell_m);
    Visible::find(&seen.scene, lattice, &region, &seen.sight).cells
}

/// Counts the rooms that the vehicle was in, or of whose free floor the map knows enough.
pub fn rooms_entered(plan: &FloorPlan, outcome: &RunOutcome) -> usize {
    let was_in = |room: &Rect| {
        let mut track = outcome.tracks.iter().flat_map(|(_, track)| track);
        track.any(|at| room.contains(*at))
    };
    let is_entered = |room: &&Rect| was_in(room) || known_share(plan, outcome, room) >= KNOWN_SHARE;
    plan.rooms.iter().filter(is_entered).count()
}

/// Returns which share of the free floor of a room is known to be free.
fn known_share(plan: &FloorPlan, outcome: &RunOutcome, room: &Rect) -> f64 {
    let lattice = outcome.map.lattice();
    let (low, high) = (lattice.cell_at(room.min), lattice.cell_at(room.max));
    let cells = (low.y..=high.y).flat_map(|y| (low.x..=high.x).map(move |x| Cell::new(x, y)));
    let is_floor = |cell: &Cell| {
        let at = lattice.centre(*cell);
        room.contains(at) && plan.clearance_m(at) > 0.5 * lattice.cell_m()
    };
    let floor: Vec<Cell> = cells.filter(is_floor).collect();
    let is_known = |cell: &&Cell| outcome.map.occupancy(SLICE, **cell) == Occupancy::Free;
    let known = floor.iter().filter(is_known).count();
    known as f64 / floor.len().max(1) as f64
}

/// Returns the table of some results: a line for every mission, distance and width of the doors. *In 95 %* = in how many
/// plans at least that share was seen.
pub fn table(results: &[TrialResult]) -> String {
    let mut groups: BTreeMap<(TrialMission, u64, u64), Vec<&TrialResult>> = BTreeMap::new();
    for result in results {
        let millimetres = |metres: f64| (metres * 1000.0).round() as u64;
        let Demand {
            distance_m,
            extra_m,
            ..
        } = result.demand;
        let key = (
            result.mission,
            millimetres(distance_m),
            millimetres(extra_m),
        );
        groups.entry(key).or_default().push(result);
    }
    let mut text =
        "mission    dist/m  extra/m  plans  rooms  entered/%  seen/% worst median  in 95 %  \
        places  visited/%  false no way  no way  collided  not ended  simulated/s  took/s\n"
            .to_owned();
    for ((mission, distance_mm, extra_mm), group) in &groups {
        let sum = |of: fn(&TrialResult) -> usize| group.iter().map(|one| of(one)).sum::<usize>();
        let percent = |part: usize, of: usize| 100.0 * part as f64 / of.max(1) as f64;
        let mut shares: Vec<f64> = group.iter().map(|one| 100.0 * one.share).collect();
        shares.sort_by(f64::total_cmp);
        let mean = |of: fn(&TrialResult) -> f64| {
            group.iter().map(|one| of(one)).sum::<f64>() / group.len() as f64
        };
        let (rooms, places) = (sum(|one| one.rooms), sum(|one| one.places.reachable));
        let _ = writeln!(
            text,
            "{:<8}  {:>6.2}  {:>7.1}  {:>5}  {rooms:>5}  {:>9.1}  {:>12.1} {:>6.1}  {:>7}  {places:>6}  {:>9.1}  {:>12}  {:>6}  \
             {:>8}  {:>9}  {:>11.0}  {:>6.2}",
            mission.word(),
            *distance_mm as f64 / 1000.0,
            *extra_mm as f64 / 1000.0,
            group.len(),
            percent(sum(|one| one.entered), rooms),
            shares[0],
            shares[shares.len() / 2],
            shares.iter().filter(|share| **share >= 95.0).count(),
            percent(sum(|one| one.places.visited), places),
            sum(|one| one.places.false_no_way),
            sum(|one| one.no_way),
            sum(|one| usize::from(one.collisions > 0)),
            sum(|one| usize::from(one.end.is_none())),
            mean(|one| one.simulated_s),
            mean(|one| one.took_s),
        );
    }
    text
}
