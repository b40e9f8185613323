//! An operator that shadows a scenario orders what the scenario's script orders, in the same order. More seeds:
//! `cargo bench --bench shadow -- 200`.

#[path = "shadow/scenarios.rs"]
mod scenarios;

use scenarios::{CASES, Case};
use tomoswarm::sim::{Deed, EMPTY_RUN, RUN};

fn check(case: &Case, seeds: std::ops::Range<u64>) -> Vec<Deed> {
    let mut last = Vec::new();
    for seed in seeds {
        last = case.compare(seed).unwrap_or_else(|wrong| panic!("{wrong}")).operator;
    }
    last
}

#[test]
fn the_operator_would_order_what_the_script_orders_in_a_whole_scenario() {
    let deeds = check(&CASES[0], 1..6);
    let whole = [Deed::Start(EMPTY_RUN), Deed::PersonsEnter, Deed::Start(RUN), Deed::Return, Deed::Ends];
    assert_eq!(deeds, whole);
}

#[test]
fn the_operator_would_order_what_the_script_orders_whatever_fails() {
    for case in &CASES[1..] {
        check(case, 1..3);
    }
}
