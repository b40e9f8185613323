//! What the scenario's script orders and what an operator beside it would order, over many seeds:
//! `cargo bench --no-default-features --bench shadow -- 200`, from a seed on with a second number, and of one scenario with
//! its name. Prints every run in which they differ, and ends with 1 when there is one.
#![allow(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

#[path = "../tests/shadow/scenarios.rs"]
mod scenarios;

use std::process::ExitCode;
use std::time::Instant;

use scenarios::CASES;

fn main() -> ExitCode {
    let numbers: Vec<u64> = std::env::args().filter_map(|word| word.parse().ok()).collect();
    let (seeds, first) = (numbers.first().copied().unwrap_or(20), numbers.get(1).copied().unwrap_or(1));
    let is_named = |name: &str| std::env::args().any(|word| word == name);
    let some_named = CASES.iter().any(|case| is_named(case.name));
    let mut wrong = 0;
    for case in CASES.iter().filter(|case| !some_named || is_named(case.name)) {
        let began = Instant::now();
        let differ: Vec<String> =
            (first..first + seeds).filter_map(|seed| case.compare(seed).err()).collect();
        differ.iter().for_each(|what| println!("{what}"));
        wrong += differ.len();
        let took_s = began.elapsed().as_secs_f64();
        println!("{}: {} of {seeds} seeds differ, {took_s:.1} s", case.name, differ.len());
    }
    if wrong == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
