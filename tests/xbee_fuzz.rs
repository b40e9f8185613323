//! What any bytes do to an XBee's host and to the simulated module: to the reader of frames, the modem, the set-up and the
//! module. Nobody panics, says something for ever or asks to be woken at once for ever; the modem writes no register; no
//! number is lost; and what is called set up is so. A few inputs here; five minutes of each by hand, two at a time, with
//! the checks of a development build: `TOMOSWARM_FUZZ_MINUTES=5 cargo test --no-default-features --test xbee_fuzz --
//! --nocapture --test-threads 2` (`TOMOSWARM_FUZZ_SEED=7` runs that one input alone, `TOMOSWARM_FUZZ_SEED=1000000-` begins
//! there). Each says how many inputs it has tried, and of sessions how many events were in them: bytes that came, packets,
//! beacons, wakes, ports that were opened or closed.

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
#[path = "xbee_fuzz/frames.rs"]
mod frames;
#[path = "fuzz/inputs.rs"]
mod inputs;
#[path = "xbee_fuzz/modem.rs"]
mod modem;
#[path = "xbee_fuzz/module.rs"]
mod module;

use inputs::{try_all, try_sessions};

#[test]
fn whatever_bytes_come_frames_are_read_alike_in_any_pieces_and_little_is_held() {
    try_all("decoder", frames::any_bytes);
}

#[test]
fn a_modem_gives_each_number_back_or_sends_it_whatever_comes() {
    try_sessions("modem", modem::any_events);
}

#[test]
fn a_modem_and_its_module_find_back_to_each_other_behind_a_bad_line() {
    try_sessions("modem and module", module::bad_line);
}

#[test]
fn a_set_up_ends_and_what_is_set_up_is_as_wanted() {
    try_sessions("set-up", module::set_up);
}

#[test]
fn a_simulated_module_goes_on_whatever_its_host_and_the_air_say() {
    try_sessions("module", module::any_words);
}
