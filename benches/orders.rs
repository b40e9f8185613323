//! Orders under faults in many more worlds than the tests take: `cargo bench --bench orders -- 2000`, and from a seed on
//! with a second number. Prints every world that is not as it must be, and ends with 1 when there is one.
#![allow(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

#[path = "../tests/orders/chance.rs"]
mod chance;
#[path = "../tests/orders/ground.rs"]
mod ground;
#[path = "../tests/orders/nodes.rs"]
mod nodes;
#[path = "../tests/orders/tally.rs"]
mod tally;
#[path = "../tests/orders/world.rs"]
mod world;

use std::process::ExitCode;
use std::time::Instant;

use tally::Tally;
use world::play;

fn main() -> ExitCode {
    let numbers: Vec<u64> = std::env::args().filter_map(|word| word.parse().ok()).collect();
    let (seeds, first) = (numbers.first().copied().unwrap_or(100), numbers.get(1).copied().unwrap_or(0));
    let began = Instant::now();
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
    println!("{seeds} worlds in {:.1} s: {wrong} wrong; {sum}", began.elapsed().as_secs_f64());
    if wrong == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
