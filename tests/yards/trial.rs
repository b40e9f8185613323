//! Several vehicles in an empty yard, on a mission whose ways cross, and the table of many such runs: each is to do
//! everything, and nobody is touched.

use std::collections::BTreeMap;
use std::fmt::{self, Write as _};

use tomoswarm::node::mission::EndReason;
use tomoswarm::sim::RunOutcome;

use super::place::Place;

/// What all of them do.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum YardMission {
    /// A square of 2 m in the middle, each from another corner on.
    SmallSquare,
    /// A square of 6 m.
    Square,
    /// Straight through places near the corners of the yard, each from another one on.
    Waypoints,
    /// Straight ahead from home, through the middle.
    Forward,
    /// Nine places, shared among them, on paths.
    Pathfind,
    /// A round over four places on paths.
    Patrol,
}

/// All of them.
pub const MISSIONS: [YardMission; 6] = [
    YardMission::SmallSquare,
    YardMission::Square,
    YardMission::Waypoints,
    YardMission::Forward,
    YardMission::Pathfind,
    YardMission::Patrol,
];

impl YardMission {
    /// Returns the keys of `[mission]` in a yard with sides of this length, metres.
    fn keys(self, side_m: f64) -> String {
        let (low_m, middle_m, high_m) = (1.0, side_m / 2.0, side_m - 1.0);
        let corners = [
            [low_m, low_m],
            [high_m, low_m],
            [high_m, high_m],
            [low_m, high_m],
        ];
        let between = [
            [middle_m, middle_m],
            [middle_m, low_m],
            [middle_m, high_m],
            [low_m, middle_m],
            [high_m, middle_m],
        ];
        match self {
            YardMission::SmallSquare => "kind = \"square\"\nsize_m = 2.0".to_owned(),
            YardMission::Square => "kind = \"square\"\nsize_m = 6.0".to_owned(),
            YardMission::Waypoints => format!("kind = \"waypoints\"\nwaypoints_m = {corners:?}"),
            YardMission::Forward => format!("kind = \"forward\"\ndistance_m = {high_m:?}"),
            YardMission::Pathfind => {
                let places: Vec<[f64; 2]> = corners.into_iter().chain(between).collect();
                format!("kind = \"pathfind\"\nwaypoints_m = {places:?}")
            }
            YardMission::Patrol => {
                format!("kind = \"patrol\"\nrounds = 1\nwaypoints_m = {corners:?}")
            }
        }
    }
}

impl fmt::Display for YardMission {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            YardMission::SmallSquare => "square of 2 m",
            YardMission::Square => "square of 6 m",
            YardMission::Waypoints => "waypoints",
            YardMission::Forward => "forward",
            YardMission::Pathfind => "pathfind",
            YardMission::Patrol => "patrol",
        })
    }
}

/// A run.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct YardTrial {
    /// What all of them do.
    pub mission: YardMission,
    /// How many they are, 1 to 8.
    pub vehicles: usize,
    /// Length of the yard's sides, metres.
    pub side_m: f64,
    /// The seed.
    pub seed: u64,
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct YardResult {
    /// The run.
    pub trial: YardTrial,
    /// How many vehicles did everything.
    pub done: usize,
    /// How many are home.
    pub home: usize,
    /// Contacts, and breaches of the fence.
    pub mishaps: usize,
    /// When the last mission ended, seconds.
    pub ended_s: f64,
    /// How the missions ended that did not do everything.
    pub others: Vec<String>,
}

impl YardTrial {
    /// Runs it.
    pub fn run(&self) -> YardResult {
        let outcome = Place::new(self.side_m, self.side_m)
            .root("end = \"return\"\nuntil_s = 3600.0")
            .vehicles(self.vehicles)
            .seed(self.seed)
            .with(&format!("[mission]\n{}", self.mission.keys(self.side_m)))
            .run();
        self.result(&outcome)
    }

    fn result(&self, outcome: &RunOutcome) -> YardResult {
        let ends = || outcome.missions.iter().map(|(_, end)| end.as_ref());
        let is_done = |end: &Option<&(_, EndReason)>| matches!(end, Some((_, EndReason::Done)));
        YardResult {
            trial: *self,
            done: ends().filter(is_done).count(),
            home: outcome.home,
            mishaps: outcome.collisions.len() + outcome.fence_breaches,
            ended_s: ends()
                .flatten()
                .map(|(at, _)| at.as_secs_f64())
                .fold(0.0, f64::max),
            others: ends()
                .filter(|end| !is_done(end))
                .map(|end| end.map_or("no end".to_owned(), |(_, how)| how.to_string()))
                .collect(),
        }
    }
}

/// Returns a line for each mission, yard and number of vehicles.
pub fn table(results: &[YardResult]) -> String {
    let mut groups: BTreeMap<(YardMission, u32, usize), Vec<&YardResult>> = BTreeMap::new();
    for one in results {
        let YardTrial {
            mission,
            vehicles,
            side_m,
            ..
        } = one.trial;
        let key = (mission, side_m as u32, vehicles);
        groups.entry(key).or_default().push(one);
    }
    let mut text =
        "mission        yard  vehicles  runs    done      home  mishaps  last end\n".to_owned();
    for ((mission, side_m, vehicles), runs) in groups {
        let sum =
            |count: fn(&YardResult) -> usize| runs.iter().map(|one| count(one)).sum::<usize>();
        let all = vehicles * runs.len();
        let (done, home) = (sum(|one| one.done), sum(|one| one.home));
        let mishaps = sum(|one| one.mishaps);
        let last_s = runs.iter().map(|one| one.ended_s).fold(0.0, f64::max);
        let _ = writeln!(
            text,
            "{:<14} {side_m:>2} m {vehicles:>9} {:>5} {done:>4}/{all:<4} {home:>4}/{all:<4} {mishaps:>7} {last_s:>7.0} s",
            mission.to_string(),
            runs.len(),
        );
    }
    text
}
