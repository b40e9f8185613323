//! Several vehicles in empty yards, on missions whose ways cross. It measures whether they make room for each other, not how
//! fast the program is; the tests take a sample of the same runs.
//!
//! - `cargo bench --bench yards -- 20`: all missions, yards with sides of 8, 12 and 20 m, 2, 4, 6 and 8 vehicles, seeds 1 to
//!   20, on all cores; prints a table, and names the runs in which a vehicle did not do everything.
//! - `… -- 20 waypoints`: only the missions with such a name.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

#[path = "all_cores/mod.rs"]
mod all_cores;
#[allow(dead_code, reason = "the tests use more of it")]
#[path = "../tests/sim/place.rs"]
mod place;
#[path = "../tests/yards/trial.rs"]
mod trial;

use std::time::Instant;

use all_cores::in_parallel;
use trial::{MISSIONS, YardTrial, table};

const SIDES_M: [f64; 3] = [8.0, 12.0, 20.0];
const VEHICLES: [usize; 4] = [2, 4, 6, 8];

fn main() {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| word != "--bench")
        .collect();
    let (numbers, names): (Vec<String>, Vec<String>) = words
        .into_iter()
        .partition(|word| word.parse::<u64>().is_ok());
    let seeds = numbers
        .first()
        .and_then(|word| word.parse().ok())
        .unwrap_or(2);
    let mut trials = Vec::new();
    for mission in MISSIONS {
        let is_wanted = names.iter().all(|name| mission.to_string().contains(name));
        for side_m in SIDES_M.into_iter().filter(|_| is_wanted) {
            for vehicles in VEHICLES {
                trials.extend((1..=seeds).map(|seed| YardTrial {
                    mission,
                    vehicles,
                    side_m,
                    seed,
                }));
            }
        }
    }
    let began = Instant::now();
    let results = in_parallel(&trials, YardTrial::run);
    println!("{}", table(&results));
    for one in results
        .iter()
        .filter(|one| !one.others.is_empty() || one.mishaps > 0)
    {
        println!(
            "{:?}, {} mishaps: {}",
            one.trial,
            one.mishaps,
            one.others.join("; ")
        );
    }
    println!(
        "{} runs in {:.0} s",
        results.len(),
        began.elapsed().as_secs_f64()
    );
}
