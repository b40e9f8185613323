//! What any edges and any bytes do to the readers of range sensors: nobody panics, and a dead, stuck or disturbed sensor never
//! says that nothing is there. A few inputs here; five minutes of each by hand, two at a time, with the checks of a development
//! build:
//! `TOMOSWARM_FUZZ_MINUTES=5 cargo test --no-default-features --test range_fuzz -- --nocapture --test-threads 2`
//! (`TOMOSWARM_FUZZ_SEED=7` runs that one input alone, `TOMOSWARM_FUZZ_SEED=1000000-` begins there). Each says how many inputs
//! it has tried; edges come in sessions, whose events (edges, triggers, wakes) are counted as well.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

#[path = "fuzz/chance.rs"]
#[allow(dead_code, reason = "random configurations draw more")]
mod chance;
#[path = "range_fuzz/edges.rs"]
mod edges;
#[path = "fuzz/inputs.rs"]
mod inputs;
#[path = "range_fuzz/lidar.rs"]
mod lidar;
#[path = "range_fuzz/text.rs"]
mod text;

use inputs::{try_all, try_sessions};

#[test]
fn only_a_whole_pulse_after_a_trigger_is_a_reading_whatever_edges_come() {
    try_sessions("echo edges", edges::any_edges);
}

#[test]
fn only_a_trusted_frame_is_a_reading_whatever_bytes_come() {
    try_all("lidar frames", lidar::any_bytes);
}

#[test]
fn only_a_line_that_says_a_distance_within_the_range_is_a_reading_whatever_bytes_come() {
    try_all("serial text", text::any_bytes);
}
