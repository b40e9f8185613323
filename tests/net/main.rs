//! The swarm against the real thing: separate processes and sessions on loopback, links that are cut and shaped, and
//! strangers who try to get in. One binary, since each that links the bus takes long to build.
#![allow(clippy::disallowed_methods, reason = "processes and sockets live in real time")]

mod certificates;
mod deaths;
mod door;
mod member;
mod partitions;
mod raw;
mod relay;
mod strangers;
mod swarm;
mod trust;
