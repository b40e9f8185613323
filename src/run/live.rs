//! A live swarm on one machine: the files of its nodes, its processes, the script that an operator plays, and what is left
//! in the end. The nodes are the same programs as in the field; only their drivers speak with a simulated world.
//!
//! ```text
//!   sim --live ─► files ─► processes: world, ground, vehicle 1 … N
//!       │                     ▲ world link    ▲ bus
//!       └── scenario runner ──┴───────────────┘  ─► outcome, from the ground's store and the world's referee
//! ```
//!
//! It simulates nothing and decides nothing about vehicles.

pub mod files;
pub mod gather;
pub mod processes;
pub mod scenario_runner;
