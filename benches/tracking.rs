//! How well persons who walk in a fixed network are followed: `cargo bench --bench tracking -- SEEDS` (20) prints the
//! median error of one and of two persons, and how often as many are followed as are there while they are 1.5 m apart. It
//! measures how right tracks are, not time.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

#[path = "all_cores/mod.rs"]
mod all_cores;
#[path = "../tests/walks/walk.rs"]
mod walk;

use all_cores::in_parallel;
use walk::{Walk, WalkResult};

fn main() {
    let seeds = std::env::args().skip(1).find_map(|word| word.parse().ok());
    for persons in [1, 2] {
        let walks = (1..=seeds.unwrap_or(20)).map(|seed| Walk { persons, seed });
        let results: Vec<WalkResult> = in_parallel(&walks.collect::<Vec<_>>(), |walk| {
            let folder = tempfile::tempdir().unwrap();
            walk.run(env!("CARGO_BIN_EXE_tomoswarm"), folder.path())
        });
        print(persons, &results);
    }
}

fn print(persons: u64, results: &[WalkResult]) {
    let all = WalkResult {
        errors_m: results
            .iter()
            .flat_map(|one| one.errors_m.clone())
            .collect(),
        counted_right: results.iter().map(|one| one.counted_right).sum::<f64>()
            / results.len() as f64,
    };
    let worst_m = results.iter().map(WalkResult::median_m).fold(0.0, f64::max);
    println!(
        "{persons} walking, {} seeds: median error {:.2} m, worst median of a seed {worst_m:.2} m, within 1 m {:.3} of the time, \
         number right {:.3} of the time when they are 1.5 m apart",
        results.len(),
        all.median_m(),
        all.near(),
        all.counted_right
    );
}
