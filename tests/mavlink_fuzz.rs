//! What bytes and messages of strangers do to MAVLink: to the reader of frames, to each machine of `src/mavlink/` and to the
//! simulated autopilot. Nobody panics, says something for ever or asks to be woken at once for ever; machines end when nobody
//! answers; what is signed with another key is not believed; and nothing that is no number comes out. A few inputs here; ten
//! minutes of each by hand, two at a time, with the checks of a development build:
//! `TOMOSWARM_FUZZ_MINUTES=10 cargo test --no-default-features --features mavlink --test mavlink_fuzz -- --nocapture
//! --test-threads 2` (`TOMOSWARM_FUZZ_SEED=7` runs that one input alone, `TOMOSWARM_FUZZ_SEED=1000000-` begins there).

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    deprecated,
    reason = "no product code"
)]

#[path = "fuzz/chance.rs"]
mod chance;
#[path = "mavlink_fuzz/channel.rs"]
mod channel;
#[path = "mavlink_fuzz/frames.rs"]
mod frames;
#[path = "fuzz/inputs.rs"]
mod inputs;
#[path = "mavlink_fuzz/machines.rs"]
mod machines;
#[path = "mavlink_fuzz/noise.rs"]
mod noise;
#[path = "mavlink_fuzz/vehicles.rs"]
mod vehicles;

use inputs::try_all;

#[test]
fn whatever_bytes_come_frames_are_read_alike_in_any_pieces() {
    try_all("frames", frames::any_bytes);
}

#[test]
fn of_any_bytes_only_what_is_signed_is_believed_and_once() {
    try_all("signed frames", frames::signed_bytes);
}

#[test]
fn a_command_ends_whatever_is_answered() {
    try_all("command_call", machines::command);
}

#[test]
fn an_upload_ends_and_what_is_accepted_is_what_was_sent() {
    try_all("mission_upload", machines::upload);
}

#[test]
fn a_download_ends_and_what_is_whole_is_what_is_stored() {
    try_all("mission_download", machines::download);
}

#[test]
fn a_list_of_parameters_ends_and_a_whole_one_is_right() {
    try_all("parameter_list", machines::list);
}

#[test]
fn reading_parameters_ends_and_what_is_read_was_said() {
    try_all("parameter_reads", machines::reads);
}

#[test]
fn a_driver_reports_numbers_whatever_its_autopilot_says() {
    try_all("autopilot_driver", vehicles::driver);
}

#[test]
fn a_simulated_vehicle_speaks_sense_whatever_its_clients_say() {
    try_all("mavlink_vehicle", vehicles::vehicle);
}
