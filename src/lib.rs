//! tomoswarm: a few small rovers as one moving radio-tomography instrument.
//!
//! Read ARCHITECTURE.md, then `node/route.rs`, then `actor.rs`. The layers, from the bottom:
//!
//! | layer | modules | is |
//! | --- | --- | --- |
//! | L0 | [`time`], [`geom`] | values |
//! | L1 | [`map`], [`plan`], [`tomo`], [`sweep`], [`scene`], [`config`], [`draw`] | pure functions and values |
//! | L2 | [`actor`], [`stops`], [`autopilot`], [`node`], [`ground`], [`operator`], [`exchange`], [`hw`], [`dash`] | state machines without I/O |
//! | L3 | [`sim`] | the world in virtual time |
//! | L3 | `run`, `store` (feature `net`) | live processes over zenoh, and what outlives them |
//! | top | [`cli`] | files, terminal, assembly |

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        clippy::disallowed_types,
        clippy::restriction,
        unreachable_pub,
        reason = "tests may; the same code is checked without them"
    )
)]

pub mod actor;
pub mod autopilot;
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::print_stderr,
    clippy::print_stdout,
    reason = "the shell touches files, sockets, clocks and the terminal"
)]
pub mod cli;
pub mod config;
pub mod dash;
pub mod draw;
pub mod exchange;
pub mod geom;
pub mod ground;
pub mod hw;
pub mod map;
#[cfg(feature = "mavlink")]
pub mod mavlink;
pub mod node;
pub mod operator;
pub mod plan;
#[cfg(feature = "net")]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::print_stderr,
    clippy::print_stdout,
    reason = "the shell touches files, sockets, clocks and the terminal"
)]
pub mod run;
pub mod scene;
pub mod sim;
pub mod stops;
#[cfg(feature = "net")]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::print_stderr,
    clippy::print_stdout,
    reason = "the shell touches files, sockets, clocks and the terminal"
)]
pub mod store;
pub mod sweep;
pub mod time;
pub mod tomo;
