//! Orders under faults in many more worlds than the tests take: `cargo bench --bench orders -- 2000`, and from a seed on
//! with a second number; emergency stops under faults with the word `stops` before the numbers, joining with the word `joins`.
//! Prints every world that is not as it must be, and ends with 1 when there is one.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

#[path = "../tests/orders/chance.rs"]
mod chance;
#[path = "../tests/orders/ground.rs"]
mod ground;
#[path = "../tests/orders/joins.rs"]
#[allow(dead_code, reason = "the tests plant mistakes")]
mod joins;
#[path = "../tests/orders/nodes.rs"]
mod nodes;
#[path = "../tests/orders/stops.rs"]
#[allow(dead_code, reason = "the tests plant mistakes")]
mod stops;
#[path = "../tests/orders/tally.rs"]
mod tally;
#[path = "../tests/orders/world.rs"]
mod world;

use std::ops::Range;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use joins::{JoinsTally, play_joins};
use stops::{StopsTally, play_stops};
use tally::Tally;
use world::play;

fn main() -> ExitCode {
    let numbers: Vec<u64> = std::env::args()
        .filter_map(|word| word.parse().ok())
        .collect();
    let (seeds, first) = (
        numbers.first().copied().unwrap_or(100),
        numbers.get(1).copied().unwrap_or(0),
    );
    let began = Instant::now();
    if std::env::args().any(|word| word == "stops") {
        return stops_under_faults(first..first + seeds, began);
    }
    if std::env::args().any(|word| word == "joins") {
        return joins_under_faults(first..first + seeds, began);
    }
    let (mut sum, mut wrong) = (Tally::default(), 0);
    for seed in first..first + seeds {
        match play(seed, None) {
            Ok(tally) => sum.add(&tally),
            Err(what) => {
                println!("{what}");
                wrong += 1;
            }
        }
    }
    println!(
        "{seeds} worlds in {:.1} s: {wrong} wrong; {sum}",
        began.elapsed().as_secs_f64()
    );
    if wrong == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

/// Plays the worlds of emergency stops.
fn stops_under_faults(seeds: Range<u64>, began: Instant) -> ExitCode {
    let (mut sum, mut wrong) = (StopsTally::default(), 0);
    let count = seeds.end - seeds.start;
    for seed in seeds {
        match play_stops(seed, None) {
            Ok(tally) => sum.add(&tally),
            Err(what) => {
                println!("{what}");
                wrong += 1;
            }
        }
    }
    sum.by_bus.sort_unstable();
    let longest = sum
        .by_beacons
        .iter()
        .map(|(_, took)| *took)
        .max()
        .unwrap_or_default();
    println!(
        "{count} worlds in {:.1} s: {wrong} wrong",
        began.elapsed().as_secs_f64()
    );
    println!(
        "by bus: {} vehicles, beyond the longest delay median {:?}, most {:?} (wanted <= 300 ms)",
        sum.by_bus.len(),
        sum.by_bus
            .get(sum.by_bus.len() / 2)
            .unwrap_or(&Duration::ZERO),
        sum.by_bus.last().unwrap_or(&Duration::ZERO)
    );
    println!(
        "by beacons alone: {} vehicles, within three turns of the ring {:.2} % (wanted >= 99), longest {longest:?} (wanted <= 10 s)",
        sum.by_beacons.len(),
        1e2 * sum.within_three_turns()
    );
    println!(
        "{} drove when the stop was given, {} were started anew under it",
        sum.driving, sum.restarted
    );
    if wrong == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

/// Plays the worlds of joining.
fn joins_under_faults(seeds: Range<u64>, began: Instant) -> ExitCode {
    let (mut sum, mut wrong) = (JoinsTally::default(), 0);
    let count = seeds.end - seeds.start;
    for seed in seeds {
        match play_joins(seed, None) {
            Ok(tally) => sum.add(&tally),
            Err(what) => {
                println!("{what}");
                wrong += 1;
            }
        }
    }
    println!(
        "{count} worlds in {:.1} s: {wrong} wrong",
        began.elapsed().as_secs_f64()
    );
    let JoinsTally {
        started,
        members,
        left_as_twin,
        left_as_misfit,
        slowest,
    } = sum;
    println!(
        "{started} starts, {members} take part at the end, {left_as_twin} left to another one of their id, \
         {left_as_misfit} to those that they do not fit; at most {slowest:?} from a start to taking part"
    );
    if wrong == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
