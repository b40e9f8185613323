//! The swarm against the real thing: separate processes and sessions on loopback, links that are cut and shaped, and
//! strangers who try to get in. One binary, since each that links the bus takes long to build.
//!
//! Scenarios mostly wait, four at a time at most: `cargo test --test net -- --test-threads 6` is quickest.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

mod accept;
#[cfg(feature = "dash")]
mod browser;
mod cable;
mod certificates;
mod clocks;
#[cfg(feature = "dash")]
mod dash;
mod deaths;
mod disks;
#[cfg(feature = "hw")]
mod drivers;
mod forgers;
mod grounds;
mod live_missions;
#[cfg(feature = "dash")]
mod live_recordings;
mod mavlink;
mod member;
mod missions;
mod operator;
#[cfg(feature = "dash")]
mod page_3d;
#[cfg(feature = "dash")]
mod page_begin;
#[cfg(feature = "dash")]
mod page_crowd;
#[cfg(feature = "dash")]
mod page_cut;
#[cfg(feature = "dash")]
mod page_export;
#[cfg(feature = "dash")]
mod page_figures;
#[cfg(feature = "dash")]
mod page_flood;
#[cfg(feature = "dash")]
mod page_hands;
#[cfg(feature = "dash")]
mod page_log;
#[cfg(feature = "dash")]
mod page_marks;
#[cfg(feature = "dash")]
mod page_process;
#[cfg(feature = "dash")]
mod page_ride;
#[cfg(feature = "dash")]
mod page_scene;
#[cfg(feature = "dash")]
mod page_seat;
#[cfg(feature = "dash")]
mod page_times;
#[cfg(feature = "dash")]
mod page_tls;
mod partitions;
mod python;
mod raw;
#[cfg(feature = "dash")]
mod recorded_page;
mod relay;
mod relays;
#[cfg(feature = "dash")]
mod sim_page;
mod small_disk;
mod strangers;
mod swarm;
mod trust;
#[cfg(feature = "dash")]
mod viewers;
#[cfg(feature = "dash")]
mod websocket;
mod xbee;
