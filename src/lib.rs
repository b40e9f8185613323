//! tomoswarm: a few small rovers as one moving radio-tomography instrument.
//!
//! Read ARCHITECTURE.md, then `node/route.rs`, then `actor.rs`. The layers, from the bottom:
//!
//! | layer | modules | is |
//! | --- | --- | --- |
//! | L0 | [`time`], [`geom`] | values |
//! | L1 | [`map`], [`plan`], [`tomo`], [`sweep`], [`scene`], [`config`], [`draw`] | pure functions and values |
//! | L2 | [`actor`], [`stops`], [`autopilot`], [`node`], [`ground`], [`operator`], [`exchange`], [`hw`] | state machines without I/O |
//! | L3 | [`sim`] | the world in virtual time |
//! | L3 | `run`, `store` (feature `net`) | live processes over zenoh, and what outlives them |
//! | top | [`cli`] | files, terminal, assembly |

#![warn(missing_docs)]

pub mod actor;
pub mod autopilot;
pub mod cli;
pub mod config;
pub mod draw;
pub mod exchange;
pub mod geom;
pub mod ground;
pub mod hw;
pub mod map;
pub mod node;
pub mod operator;
pub mod plan;
#[cfg(feature = "net")]
pub mod run;
pub mod scene;
pub mod sim;
pub mod stops;
#[cfg(feature = "net")]
pub mod store;
pub mod sweep;
pub mod time;
pub mod tomo;
