//! Figures of MAVLink on this machine: `cargo bench --bench mavlink [-- WHAT]`, where WHAT is one of these; without it all.
//! The last two need no more than `--no-default-features --features mavlink`.
//!
//! - heartbeat: the process `mock-autopilot` starts → its first heartbeat, and until it accepts to be armed;
//! - sixty: processor time of sixty of its vehicles, each saying all its messages ten times a second;
//! - speedup: processor time of one of its vehicles at a hundred times real time;
//! - driver: processor time of the driver's thread and its reader while 400 messages a second come in packets of UDP;
//! - hour: memory of the driver and of a simulated autopilot after ten minutes and after an hour, in virtual time;
//! - lossy: how long 1,000 parameters and 700 items take over a link of 10 ms that loses 5 % each way, in virtual time.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    unsafe_code,
    deprecated,
    reason = "no product code; it counts what is allocated, and asks as ground stations do"
)]

#[path = "../tests/fuzz/chance.rs"]
#[allow(dead_code, reason = "random configurations draw more")]
mod chance;
#[path = "../tests/mavlink_fuzz/channel.rs"]
#[allow(dead_code, reason = "fuzzing draws links")]
mod channel;
#[cfg(feature = "net")]
#[path = "mavlink/driver.rs"]
mod driver;
#[path = "mavlink/hour.rs"]
mod hour;
#[path = "mavlink/lossy.rs"]
mod lossy;
#[path = "mavlink/memory.rs"]
mod memory;
#[cfg(feature = "net")]
#[path = "mavlink/processor.rs"]
mod processor;
#[cfg(feature = "net")]
#[path = "mavlink/served.rs"]
mod served;

fn main() {
    let words: Vec<String> = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with("--"))
        .collect();
    let wanted = |what: &str| words.is_empty() || words.iter().any(|word| word == what);
    println!(
        "machine: {} cores",
        std::thread::available_parallelism().map_or(0, usize::from)
    );
    let parts: &[(&str, fn())] = &[
        #[cfg(feature = "net")]
        ("heartbeat", served::heartbeat),
        #[cfg(feature = "net")]
        ("sixty", served::sixty),
        #[cfg(feature = "net")]
        ("speedup", served::speedup),
        #[cfg(feature = "net")]
        ("driver", driver::driver),
        ("hour", hour::hour),
        ("lossy", lossy::lossy),
    ];
    for (name, part) in parts {
        if wanted(name) {
            part();
        }
    }
}

/// Returns the median and the largest of some values.
fn median_and_worst(mut values: Vec<f64>) -> (f64, f64) {
    values.sort_by(f64::total_cmp);
    (values[values.len() / 2], values[values.len() - 1])
}
