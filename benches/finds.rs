//! Who is found in the courtyard, with persons in other places, numbers and strengths. It measures how right the finds are, not
//! how fast the program is; the tests take a sample of the same runs.
//!
//! - `cargo bench --bench finds -- SEEDS [FIRST] [CROWD…]`: so many runs of each placement, or of those named (default,
//!   nobody, wall, pair, three, five, weak, house, castle: two persons in these scenes), from a seed on, on all cores; prints a table, and names the runs in which
//!   somebody was missed, or nobody was found.
//! - `… -- 3 1 eight`: three default runs with eight vehicles; `trio`, `trio-nobody`, `trio-weak`: with three vehicles.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

#[path = "all_cores/mod.rs"]
mod all_cores;
#[path = "../tests/finds/trial.rs"]
mod trial;

use all_cores::in_parallel;
use trial::{FindTrial, PLACEMENTS, Placement, table};

fn main() {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| word != "--bench")
        .collect();
    let numbers: Vec<u64> = words.iter().filter_map(|word| word.parse().ok()).collect();
    let names: Vec<&String> = words
        .iter()
        .filter(|word| word.parse::<u64>().is_err())
        .collect();
    let (seeds, first) = (
        numbers.first().copied().unwrap_or(5),
        numbers.get(1).copied().unwrap_or(1),
    );
    let of_more = [
        ("eight", Placement::Default, 8),
        ("trio", Placement::Default, 3),
        ("trio-nobody", Placement::Nobody, 3),
        ("trio-weak", Placement::Weak, 3),
    ];
    let of_more = of_more.map(|(name, placement, vehicles)| (name.to_owned(), placement, vehicles));
    let kinds = PLACEMENTS
        .map(|placement| (placement.to_string(), placement, 2))
        .into_iter()
        .chain(of_more);
    let is_wanted = |name: &String, vehicles: usize| match names.is_empty() {
        true => vehicles == 2,
        false => names.contains(&name),
    };
    let mut trials = Vec::new();
    for (_, placement, vehicles) in kinds.filter(|(name, _, vehicles)| is_wanted(name, *vehicles)) {
        trials.extend((first..first + seeds).map(|seed| FindTrial {
            placement,
            vehicles,
            seed,
        }));
    }
    let results = in_parallel(&trials, FindTrial::run);
    for one in results
        .iter()
        .filter(|one| !one.is_all_found() || one.nobodies() > 0)
    {
        let finds: Vec<String> = one
            .finds
            .iter()
            .map(|find| {
                format!(
                    "({:.2}, {:.2}) {:.1} dB/m, evidence {:.1}",
                    find.at.x_m, find.at.y_m, find.strength, find.evidence
                )
            })
            .collect();
        println!(
            "{:?}: persons {:.2?}, finds {finds:?}",
            one.trial, one.persons
        );
    }
    let mut took_s: Vec<f64> = results.iter().map(|one| one.took_s).collect();
    took_s.sort_by(f64::total_cmp);
    println!("{}", table(&results));
    let links: usize = results.iter().map(|one| one.links).sum();
    println!(
        "{} runs, {:.1} s each (median), {} links each (mean)",
        results.len(),
        took_s.get(took_s.len() / 2).copied().unwrap_or(0.0),
        links / results.len().max(1)
    );
}
