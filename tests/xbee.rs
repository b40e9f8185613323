//! An XBee from its radio actor's side to the air: modems over simulated modules in virtual time, what a set-up finds and sets,
//! and what a module answers to its host. How frames are cut is tested where they are made.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

#[path = "xbee/field.rs"]
mod field;
#[path = "xbee/module.rs"]
mod module;
#[path = "xbee/ring.rs"]
mod ring;
#[path = "xbee/setup.rs"]
mod setup;
#[path = "xbee/swarm.rs"]
mod swarm;
