//! The built program as its users meet it: what it refuses and how it says so, what it leaves on the disk,
//! and how it ends when it is asked to. Says nothing about how good images are.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

mod cli {
    mod bad_configs;
    mod bad_outputs;
    mod bad_recordings;
    mod bad_scenes;
    mod bad_usage;
    mod good_runs;
    #[cfg(unix)]
    mod names;
    #[cfg(unix)]
    mod package;
    mod program_runner;
    #[cfg(feature = "net")]
    mod replays;
    #[cfg(unix)]
    mod signals;
    #[cfg(unix)]
    mod terminals;
}
