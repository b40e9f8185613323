//! Random configurations, checked and run by the program: whatever `check` accepts, `sim` runs; nobody panics, touches what
//! its sensors promise to hear, or leaves the fence; and every run ends, or says why. A few here; 2,000 by hand:
//! `TOMOSWARM_FUZZ=2000 cargo test --release --no-default-features --test fuzz -- --nocapture` (first number 0, or
//! `TOMOSWARM_FUZZ=500-700`; `TOMOSWARM_FUZZ_KEEP=FOLDER` keeps what went wrong,
//! `TOMOSWARM_FUZZ_PROGRAM=FILE` tries another build).

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

#[path = "fuzz/chance.rs"]
mod chance;
#[path = "fuzz/configuration.rs"]
mod configuration;
#[path = "fuzz/trial.rs"]
mod trial;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use configuration::Configuration;
use trial::{Trial, Verdict};

/// How many are run in the suite; refused ones cost nothing.
const SAMPLE: Range<u64> = 0..16;

fn asked() -> Range<u64> {
    let Ok(asked) = std::env::var("TOMOSWARM_FUZZ") else {
        return SAMPLE;
    };
    let number = |text: &str| text.trim().parse().expect("a number, or FROM-TO");
    match asked.split_once('-') {
        Some((from, to)) => number(from)..number(to),
        None => 0..number(&asked),
    }
}

#[test]
fn random_configurations_are_refused_or_run_safely_to_an_end() {
    let (asked, is_sample) = (asked(), std::env::var("TOMOSWARM_FUZZ").is_err());
    let keep = std::env::var_os("TOMOSWARM_FUZZ_KEEP").map(PathBuf::from);
    let next = AtomicU64::new(asked.start);
    let found: Mutex<BTreeMap<u64, (Verdict, String)>> = Mutex::default();
    let work = || {
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= asked.end {
                return;
            }
            let trial = Trial::of(&Configuration::drawn(seed, is_sample), keep.as_deref());
            if !is_sample {
                println!("{seed} {} {:?} {}", trial.kind, trial.verdict, trial.words);
            }
            let words = format!("{} {}", trial.kind, trial.words);
            found.lock().unwrap().insert(seed, (trial.verdict, words));
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(work);
        }
    });
    let found = found.into_inner().unwrap();
    let mut counts: BTreeMap<Verdict, usize> = BTreeMap::new();
    for (verdict, _) in found.values() {
        *counts.entry(*verdict).or_default() += 1;
    }
    println!("{counts:?}");
    let wrong: Vec<String> = found
        .iter()
        .filter(|(_, (verdict, _))| verdict.is_wrong())
        .map(|(seed, (verdict, words))| format!("{seed}: {verdict:?}: {words}"))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let runs = found
        .values()
        .filter(|(verdict, _)| verdict.is_run())
        .count();
    assert!(
        runs * 4 >= found.len(),
        "{runs} of {} were run",
        found.len()
    );
}

#[test]
fn the_same_number_draws_the_same_configuration_and_another_one_another() {
    let text = |seed| {
        let drawn = Configuration::drawn(seed, true);
        drawn.files().map(|(_, text)| text.to_owned())
    };
    assert_eq!(text(3), text(3));
    assert_ne!(text(3), text(4));
}
