//! Inputs that are drawn from their numbers: a few in the suite, for as many minutes as wanted by hand, or one that was wrong.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use crate::chance::Chance;

/// How many inputs are tried in the suite.
const SAMPLE: u64 = 60;

/// Tries one input after the other, each drawn from its number.
pub fn try_all(name: &str, one: fn(&mut Chance)) {
    let (tried, seconds) = try_each(name, one);
    println!("{name}: {tried} inputs in {seconds:.0} s, none wrong");
}

/// Tries one session after the other, each drawn from its number, and counts the events in them, which each returns.
#[allow(dead_code, reason = "not every parser is told of events")]
pub fn try_sessions(name: &str, one: fn(&mut Chance) -> u64) {
    let mut events = 0;
    let (tried, seconds) = try_each(name, |chance| events += one(chance));
    println!("{name}: {tried} sessions of {events} events in {seconds:.0} s, none wrong");
}

/// Tries one input after the other; returns how many there were, and how many seconds that took.
fn try_each(name: &str, mut one: impl FnMut(&mut Chance)) -> (u64, f64) {
    let minutes = std::env::var("TOMOSWARM_FUZZ_MINUTES").ok();
    let seed = std::env::var("TOMOSWARM_FUZZ_SEED").ok();
    let number = |text: &str| text.trim().parse::<u64>().expect("a number");
    let first = seed
        .as_deref()
        .map_or(0, |seed| number(seed.trim_end_matches('-')));
    let end = match (&seed, &minutes) {
        (Some(seed), _) if !seed.ends_with('-') => first + 1,
        (_, Some(_)) => u64::MAX,
        (_, None) => first + SAMPLE,
    };
    let lasts = minutes.map_or(Duration::MAX, |minutes| {
        Duration::from_secs(60 * number(&minutes))
    });
    let began = Instant::now();
    let mut tried = 0;
    for seed in first..end {
        if began.elapsed() >= lasts {
            break;
        }
        let outcome = catch_unwind(AssertUnwindSafe(|| one(&mut Chance::new(seed))));
        assert!(outcome.is_ok(), "{name}: input {seed}, see above");
        tried += 1;
    }
    (tried, began.elapsed().as_secs_f64())
}
