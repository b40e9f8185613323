//! A bus that delays, loses, doubles and is cut: it costs time, never safety, and in the end all maps are one and
//! every sample is stored exactly once.

use crate::place::{Place, assert_settled};

/// Sweeps and returns over a faulty bus, and claims that all was safe, ended, and is known to all at the end.
fn survives(faults: &str) {
    for (vehicles, seed) in [(2, 1), (2, 2), (4, 3)] {
        let place = Place::new(12.0, 12.0)
            .vehicles(vehicles)
            .seed(seed)
            .with(faults);
        let outcome = place
            .root("end = \"return\"\nuntil_s = 3000.0")
            .run_to_the_end();
        assert_settled(&outcome);
    }
}

/// Cuts the bus for a minute in the middle of the sweep.
fn cut(sides: &str) -> String {
    format!("[[bus.partition]]\nfrom_s = 40.0\nuntil_s = 100.0\nsides = {sides}")
}

#[test]
fn two_seconds_of_delay_cost_time_only() {
    survives("[bus]\ndelay_ms = 2000.0\njitter_ms = 300.0");
}

#[test]
fn a_bus_that_loses_and_doubles_three_in_ten_loses_nothing_for_good() {
    survives("[bus]\ndrop_share = 0.3\nduplicate_share = 0.3\njitter_ms = 400.0");
}

#[test]
fn a_vehicle_that_was_cut_off_catches_up() {
    survives(&cut("[[1]]"));
}

#[test]
fn a_ground_that_was_cut_off_catches_up() {
    survives(&cut("[[\"ground\"]]"));
}

#[test]
fn two_halves_of_a_swarm_find_together_again() {
    survives(&cut("[[1], [2, \"ground\"]]"));
}

#[test]
fn the_order_of_events_of_one_moment_does_not_matter() {
    for seed in 1..5 {
        let place = Place::new(12.0, 12.0).vehicles(3).seed(seed).shuffled();
        assert_settled(
            &place
                .root("end = \"return\"\nuntil_s = 3000.0")
                .run_to_the_end(),
        );
    }
}
