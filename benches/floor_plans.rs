//! Random floor plans, explored and with a place to visit in each room, judged by the truth. It measures what missions
//! achieve, not how fast the program is; the tests take a sample of the same plans.
//!
//! - `cargo bench --bench floor_plans -- 200`: plans 0 to 199, safety distances and doors in turn, on all cores; prints a
//!   table, and names the runs with a contact, with a false "no way", or without an end. A second number is the first plan.
//! - `… -- 200 explore` or `pathfind`: only that.
//! - `… -- 200 covered`: without the poles that a rover of 0.5 m/s is not promised to hear in time (`tomoswarm check` says it).
//! - `… -- write FOLDER PLAN`: writes the files of a plan, for `tomoswarm sim FOLDER/explore.sim.toml`.
//! - `… -- repro [FOLDER]`: instead runs the cases that once went wrong (`../shared/repro`), and says how each ends.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

#[path = "all_cores/mod.rs"]
mod all_cores;
#[path = "../tests/repro/cases.rs"]
mod cases;
#[path = "../tests/orders/chance.rs"]
mod chance;
#[path = "../tests/floor_plans/plan.rs"]
mod plan;
#[path = "../tests/floor_plans/trial.rs"]
mod trial;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use all_cores::in_parallel;
use plan::FloorPlan;
use trial::{TrialMission, TrialResult, demand_in_turn, table};

/// Radius of the thinnest pole, metres.
const THINNEST_M: f64 = 0.01;
/// The same of the poles that the speed covers, metres.
const COVERED_M: f64 = 0.03;
const MISSIONS: [TrialMission; 2] = [TrialMission::Explore, TrialMission::Pathfind];
/// A case that takes longer is stopped.
const CASE_LIMIT: Duration = Duration::from_secs(120);

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| word != "--bench")
        .collect();
    let word = |index: usize| words.get(index).map(String::as_str);
    match word(0) {
        Some("write") => write(word(1), word(2)),
        Some("repro") => repro(word(1)),
        _ => plans(&words),
    }
}

fn floor_plan(seed: u64, thinnest_m: f64) -> FloorPlan {
    FloorPlan::draw(seed, demand_in_turn(seed, thinnest_m))
}

fn write(folder: Option<&str>, seed: Option<&str>) -> ExitCode {
    let (Some(folder), Some(seed)) = (folder, seed.and_then(|seed| seed.parse().ok())) else {
        println!("write FOLDER PLAN: the number of a plan is expected");
        return ExitCode::FAILURE;
    };
    match floor_plan(seed, THINNEST_M).write(Path::new(folder)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            println!("{folder}: {error}");
            ExitCode::FAILURE
        }
    }
}

fn repro(folder: Option<&str>) -> ExitCode {
    let Some(folder) = folder.map(PathBuf::from).or_else(cases::folder_beside) else {
        return ExitCode::SUCCESS;
    };
    let ends = in_parallel(&cases::names(&folder), |name| {
        let end = cases::run(&folder, name, CASE_LIMIT);
        println!("{end}");
        end
    });
    let panicked = ends.iter().filter(|end| end.has_panicked).count();
    println!("{} cases, {panicked} panicked", ends.len());
    if panicked == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

fn plans(words: &[String]) -> ExitCode {
    let numbers: Vec<u64> = words.iter().filter_map(|word| word.parse().ok()).collect();
    let (count, first) = (
        numbers.first().copied().unwrap_or(12),
        numbers.get(1).copied().unwrap_or(0),
    );
    let is_covered = |word: &String| word == "covered";
    let thinnest_m = match words.iter().any(is_covered) {
        true => COVERED_M,
        false => THINNEST_M,
    };
    let is_wanted = |mission: &TrialMission| {
        words
            .iter()
            .all(|word| word.parse::<u64>().is_ok() || is_covered(word) || word == mission.word())
    };
    let jobs: Vec<(u64, TrialMission)> = (first..first + count)
        .flat_map(|seed| MISSIONS.map(|mission| (seed, mission)))
        .filter(|(_, mission)| is_wanted(mission))
        .collect();
    let began = Instant::now();
    let results = in_parallel(&jobs, |(seed, mission)| {
        trial::run(&floor_plan(*seed, thinnest_m), *mission)
    });
    println!("{}\n{}", table(&results), mishaps(&results));
    println!(
        "{} runs of {count} plans from {first} on in {:.0} s",
        results.len(),
        began.elapsed().as_secs_f64()
    );
    ExitCode::SUCCESS
}

/// Something that may have gone wrong in a run.
type Mishap = (&'static str, fn(&TrialResult) -> bool);

/// Names the runs that went wrong.
fn mishaps(results: &[TrialResult]) -> String {
    let kinds: [Mishap; 4] = [
        ("contacts", |one| one.collisions > 0),
        ("breaches of the fence", |one| one.fence_breaches > 0),
        ("without an end", |one| one.end.is_none()),
        ("reachable places called unreachable", |one| {
            one.places.false_no_way > 0
        }),
    ];
    let line = |(what, is_it): Mishap| {
        let wrong: Vec<String> = results
            .iter()
            .filter(|one| is_it(one))
            .map(|one| format!("{} {}", one.mission.word(), one.seed))
            .collect();
        (!wrong.is_empty()).then(|| format!("{what}: {}\n", wrong.join(", ")))
    };
    kinds.into_iter().filter_map(line).collect()
}
